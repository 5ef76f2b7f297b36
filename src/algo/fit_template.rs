//! Fit: a template's skeleton moved into a mesh by itself.
//!
//! [`MeshAnalysis`] holds all that depends on the mesh alone: voxels of its volume, branches of the volume with their
//! centre lines, and the surface. [`fit_template`] assigns the template's limbs to branches by a penalty search (the
//! idea of Baran and Popović 2007, "Automatic rigging and animation of 3D characters") and places joints on centre
//! lines. For a human figure a body model with statistics learned from bodies is then registered to the surface
//! (closest points on an articulated model), and its joints are taken. [`FitSettings::markers`] are places that a
//! person gave; [`refit_template`] starts from an earlier fit and is fast enough for a drag.
//!
//! The mesh may be open, inside out, in many shells, in any unit, and turned in any way. The result depends on neither
//! the order of points and faces nor the number of threads.

mod align;
mod analysis;
mod assign;
mod bends;
mod branches;
mod caps;
mod chain;
mod choose;
mod clean;
mod clutter;
mod confidence;
mod eigen;
mod fitting;
mod human;
mod images;
mod level;
mod limbs;
mod line;
mod markers;
mod place;
mod report;
mod symmetry;
mod target;
mod tree;
mod volume;

use glam::Vec3;

pub use analysis::MeshAnalysis;
pub use choose::{TemplateChoice, choose_template};
pub use limbs::LimbKind;
pub use report::{FitError, FitNote, FitReason, FittedSkeleton, HypothesisSummary, JointFit};

use self::fitting::Fit;

/// A joint of a template at rest: Y up, facing +Z, the character's left is +X.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemplateJoint<'a> {
    /// The label, a hint for what the joint is.
    pub label: &'a str,
    /// Index of the parent; joints may come in any order.
    pub parent: Option<usize>,
    /// Position at rest.
    pub position: Vec3,
}

/// Symmetry of a fit: left and right made alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FitSymmetry {
    /// Symmetric if mesh and pose are.
    #[default]
    Auto,
    /// Symmetric in any case.
    On,
    /// Left and right fitted apart.
    Off,
}

/// Wishes of a person for a fit; directions and positions are in the mesh's space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FitSettings {
    /// Up direction; found if not given.
    pub up: Option<Vec3>,
    /// Direction in which the figure faces; found if not given.
    pub forward: Option<Vec3>,
    /// Symmetry of the result.
    pub symmetry: FitSymmetry,
    /// Joints (index into the template) that have to be at a position.
    pub markers: Vec<(usize, Vec3)>,
    /// Place that the skeleton hangs on, such as the joint of a body that gets a tail; found if not given.
    pub root: Option<Vec3>,
    /// True to leave the body model out and place the joints of human figures on centre lines, too.
    pub without_body_model: bool,
}

/// Moves the joints of a template into a mesh.
///
/// `progress` is called with a share of the work done, 0 to 1, and cancels with `false`. The result has one entry for
/// each joint in the template's order, in the mesh's space and unit. Time: some milliseconds, and about 0.4 s more for
/// a human figure.
///
/// # Errors
/// [`FitError`]: a template without chains, a marker or direction that cannot be used, a mesh that shows fewer than
/// half of the template's limbs, or cancelled.
pub fn fit_template(
    analysis: &MeshAnalysis,
    joints: &[TemplateJoint],
    settings: &FitSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<FittedSkeleton, FitError> {
    Fit::new(analysis, joints, settings)?.run(None, progress)
}

/// Fits again with other markers, starting from an earlier fit of the same template to the same mesh: fast enough for a
/// drag.
///
/// # Errors
/// As for [`fit_template`].
pub fn refit_template(
    analysis: &MeshAnalysis,
    joints: &[TemplateJoint],
    settings: &FitSettings,
    before: &FittedSkeleton,
) -> Result<FittedSkeleton, FitError> {
    Fit::new(analysis, joints, settings)?.run(Some(before), &|_| true)
}
