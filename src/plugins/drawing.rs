//! Drawing: rigs over their meshes, ghosts of tools, the grid.
//!
//! A rig's picture is one mesh of coloured triangles, built on the processor for the view of the [`RigViewport`]
//! camera. Its vertices carry their own depth, in a part of the depth buffer in front of everything else: so bones hide
//! each other properly and are never hidden by the mesh, without a second camera and its passes. The picture is built
//! again only after a change of the rig, its pose, the selection, the hovered joint, the view or [`RigDrawing`].
//!
//! Sizes in pixels are logical pixels. If several cameras are marked, the first active one by order counts.

pub mod controls;
mod deform_joints;
pub mod ghosts;
pub mod grid;
pub mod ink;
pub mod labels;
pub mod material;
pub mod shapes;
pub mod skeleton;
mod systems;
pub mod theme;

use bevy::{asset::AssetEventSystems, camera::CameraUpdateSystems, camera::visibility::VisibilitySystems, prelude::*};

pub use deform_joints::deforming_joints;
pub use ghosts::{GhostJoint, Ghosts};
pub use labels::{LETTER, LabelCandidate, label_places};
pub use theme::{BACKGROUND, Theme};

use super::RigSystems;
#[cfg(doc)]
use super::viewport::RigViewport;

/// Plugin that draws rigs. Works without a renderer, too, and then builds pictures that are not shown.
pub struct DrawingPlugin;

impl Plugin for DrawingPlugin {
    fn build(&self, app: &mut App) {
        material::add_material(app);
        app.init_resource::<RigDrawing>()
            .init_resource::<super::controls::ControlsInUse>()
            .init_resource::<Ghosts>()
            .init_resource::<DrawingCounts>()
            .init_resource::<systems::PictureMaterials>()
            .configure_sets(
                PostUpdate,
                DrawingSystems
                    .after(TransformSystems::Propagate)
                    .after(CameraUpdateSystems)
                    .after(RigSystems::Surface)
                    // The renderer takes a picture's data once: a change must be sent in the frame in which it is made.
                    .before(AssetEventSystems)
                    .before(VisibilitySystems::VisibilityPropagate),
            )
            .add_systems(
                PostUpdate,
                (
                    systems::frame_planes,
                    systems::draw_rigs,
                    systems::draw_ghosts,
                    systems::draw_planes,
                    systems::draw_grid,
                )
                    .chain()
                    .in_set(DrawingSystems),
            );
    }
}

/// System set in `PostUpdate` that builds pictures of rigs, after transforms have propagated and before visibility is
/// computed.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrawingSystems;

/// Settings of the drawing.
#[derive(Resource, Debug, Clone, PartialEq)]
pub struct RigDrawing {
    /// Draws rigs if `true`.
    pub rig: bool,
    /// Draws all bones if `true`; else only those of selected joints and of the hovered one.
    pub bones: bool,
    /// Colours joints by whether they move points of a mesh, in place of their groups, if `true`.
    pub deforming: bool,
    /// The controls of built rigs.
    pub controls: bool,
    /// Choice of the labels.
    pub labels: LabelChoice,
    /// Draws labels with line strokes if `true`; `false` where a window paints [`RigLabels`] with a font.
    pub write_labels: bool,
    /// Draws the local axes of selected joints if `true`.
    pub axes: bool,
    /// Draws the ground grid and the world's axes if `true`.
    pub grid: bool,
    /// Draws the symmetry plane of rigs with live mirroring if `true`.
    pub plane: bool,
    /// Factor of the size of joint balls; 1 is usual.
    pub ball_scale: f32,
    /// Colours.
    pub theme: Theme,
}

impl Default for RigDrawing {
    fn default() -> Self {
        Self {
            rig: true,
            bones: true,
            deforming: false,
            controls: true,
            labels: LabelChoice::None,
            write_labels: true,
            axes: false,
            grid: true,
            plane: true,
            ball_scale: 1.0,
            theme: Theme::default(),
        }
    }
}

/// Choice of the joints whose labels are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LabelChoice {
    /// Labels are not drawn.
    #[default]
    None,
    /// Labels of selected joints and of the hovered one.
    Selected,
    /// Labels, as many as fit, those of selected joints first.
    All,
}

/// Labels of a rig with their positions: pixels from the viewport's top left corner to the left end of each text, at
/// half its height. The component is on every rig that has been drawn, and empty while [`RigDrawing::labels`] is off.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[reflect(Component, Default)]
pub struct RigLabels(pub Vec<(Vec2, String)>);

/// Numbers of built pictures, which show that idle frames build none.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DrawingCounts {
    /// Pictures of rigs.
    pub rigs: u64,
    /// Pictures of ghosts.
    pub ghosts: u64,
    /// Pictures of symmetry planes.
    pub planes: u64,
    /// Pictures of the grid.
    pub grid: u64,
}
