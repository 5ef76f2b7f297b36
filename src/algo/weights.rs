//! Automatic skin weights: how much each joint moves each point.
//!
//! Where the surface hangs together around its bones, heat spreads on it until it is in equilibrium (Baran and Popović
//! 2007, "Automatic rigging and animation of 3D characters", section 4). Islands that no bone looks at (clothes over a
//! body) are bound through voxels ([`voxel_bind`]); small ones (teeth, buttons, specks) and what neither reaches are
//! filled from their neighbours ([`fill`]).
//!
//! What differs from the paper: a joint has a bone to each child ([`BoneSegment`](bone::BoneSegment)); the bones of
//! last joints are found from the surface; a bone has a girth, and claims skin beyond it only reluctantly; sight is
//! asked of patches of skin rather than of single points, and of each large piece of the surface alone; a piece belongs
//! to the bones inside of it, and joints that stand off from the body (roots, targets, poles) hold nothing; skin whose
//! bone lies across the air is left to its neighbours; skin on the inside of a chain that is folded at rest belongs to the
//! bone that it faces away from; arms, legs and necks share flesh as painted bodies do; pieces that
//! one joint holds stay stiff, and so do rings around a bone and gear without bones; large meshes are solved on a coarser surface.

mod anatomy;
mod attachments;
pub mod bends;
mod bind;
pub mod bone;
mod bone_tree;
mod bones;
mod check;
mod claim;
mod coarse;
pub mod fill;
mod finish;
mod folds;
mod grips;
mod half;
mod heat;
mod held_pieces;
mod hierarchy;
mod holders;
mod islands;
mod keypoints;
pub(crate) mod laplacian;
mod layers;
pub(crate) mod ldl;
mod limb_parts;
mod odds;
mod report;
mod rings;
mod roots;
mod sight;
mod twist;
pub mod voxel_bind;

use std::ops::Range;

use glam::Vec3;

use crate::mesh::model::Weights;
use bind::{BoundSurface, Source};
use finish::Shaping;
use twist::Limbs;
pub use {
    held_pieces::held_pieces,
    report::{IdleJoint, IdleReason, StiffPiece, WeightReport},
    twist::late_shares,
};

/// A joint as the binding sees it, in the space of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightJoint {
    /// Position of the joint.
    pub head: Vec3,
    /// Index of the parent; `None` for a root.
    pub parent: Option<usize>,
    /// End of the bone of a joint without children; estimated from the surface if `None`.
    pub tail: Option<Vec3>,
    /// False for joints that must not move points; what they hold goes to the nearest ancestor that deforms.
    pub deforms: bool,
    /// The bone whose twist the joint shares, for twist joints: they have no flesh of their own but take shares of
    /// the bone's, linearly between one twist joint and the next.
    pub twist: Option<TwistBone>,
    /// Index of the joint whose bend this one takes by half, for half joints: they have no flesh of their own but take
    /// what is shared between that joint and those above it.
    pub halves: Option<usize>,
}

/// A bone with twist joints along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwistBone {
    /// Index of the joint that the bone begins at, no twist joint itself. It holds what is not twisted against it: the
    /// start of the bone, or the end if there is a twist joint at the start.
    pub joint: usize,
    /// End of the bone.
    pub end: Vec3,
}

/// Method of binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Heat on the surface where it can be trusted, voxels elsewhere.
    #[default]
    Auto,
    /// Heat on the surface everywhere.
    Heat,
    /// Voxels everywhere.
    Voxel,
}

/// Settings of [`skin_weights`].
#[derive(Debug, Clone, PartialEq)]
pub struct WeightSettings {
    /// The largest number of joints that move one point, at least 1.
    pub max_influences: usize,
    /// Width of the blend between neighbouring joints: 1 is usual, 0.25 nearly rigid, 4 very soft.
    pub smoothing: f32,
    /// Method of binding.
    pub method: Method,
    /// Cells along the longest side where voxels are used.
    pub voxel_resolution: usize,
    /// Weights below this are dropped before the rest is made to sum to one.
    pub prune: f32,
    /// Parts of the mesh (connected pieces) that one joint holds in nearly their whole size move with that joint alone,
    /// as helmets, swords and eyes do, rings with the joint whose bone runs through them, and small parts move as one, with
    /// what they lie on if one joint holds that; `false` lets them bend.
    pub stiff_parts: bool,
    /// Ranges of points whose parts bend although [`WeightSettings::stiff_parts`] would hold them stiff.
    pub bending: Vec<Range<u32>>,
    /// Indices of joints that claim skin although they hang outside of the mesh or do not deform. Such a joint holds what
    /// lies nearer to it than to others, which may be nothing.
    pub claims: Vec<usize>,
    /// Indices of joints that carry or steer things, as sockets in hands and targets. Such a joint holds nothing of a part of the
    /// mesh that other joints hold, though it lies in it, unless it is one of [`WeightSettings::claims`]. What is no joint's
    /// index counts for nothing.
    pub slots: Vec<usize>,
}

impl Default for WeightSettings {
    fn default() -> Self {
        Self {
            max_influences: 8,
            smoothing: 1.0,
            method: Method::Auto,
            voxel_resolution: 256,
            prune: 0.002,
            stiff_parts: true,
            bending: Vec::new(),
            claims: Vec::new(),
            slots: Vec::new(),
        }
    }
}

impl WeightSettings {
    /// The smoothing as a usable factor.
    pub(crate) fn blend(&self) -> f32 {
        if self.smoothing.is_finite() { self.smoothing.clamp(0.01, 100.0) } else { 1.0 }
    }
}

/// Joints whose weights stay as they are; the others share what these leave.
#[derive(Debug, Clone, Copy)]
pub struct Locks<'a> {
    /// The present weights, one entry a point.
    pub weights: &'a Weights,
    /// True for each locked joint.
    pub joints: &'a [bool],
}

/// Reason why there are no weights.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WeightError {
    /// No joint to bind to.
    #[error("the rig has no joints; place at least one before binding")]
    NoJoints,
    /// A point that is not a number.
    #[error("point {point} of the mesh is not finite; repair the mesh before binding")]
    Point {
        /// Index of the first such point.
        point: usize,
    },
    /// A joint that is not a number.
    #[error("joint {joint} is not at a finite place; move it before binding")]
    Joint {
        /// Index of the first such joint.
        joint: usize,
    },
    /// A parent that does not exist, or a joint among its own ancestors.
    #[error("joint {joint} has no valid parent: parents must exist and must not form a loop")]
    Parent {
        /// Index of such a joint.
        joint: usize,
    },
    /// A twist joint whose bone does not exist.
    #[error("twist joint {joint} names a bone that does not exist, ends nowhere or is that of another twist joint")]
    Twist {
        /// Index of such a joint.
        joint: usize,
    },
    /// A half joint without a joint whose bend it takes.
    #[error("half joint {joint} names a joint that does not exist, or is itself a half or twist joint")]
    Half {
        /// Index of such a joint.
        joint: usize,
    },
    /// A triangle corner that does not exist.
    #[error("triangle {triangle} has a corner past the last point: the mesh is damaged")]
    Triangle {
        /// Index of the first such triangle.
        triangle: usize,
    },
    /// A rigid part that does not fit the mesh or the rig.
    #[error("rigid part {part} names points or a joint that do not exist")]
    Rigid {
        /// Index of the first such part.
        part: usize,
    },
    /// A joint that is to claim skin and does not exist.
    #[error("joint {joint} is to claim skin, but there are only {joints} joints")]
    Claim {
        /// Index of the first such joint.
        joint: usize,
        /// Number of joints.
        joints: usize,
    },
    /// Locks that do not fit the mesh or the rig.
    #[error(
        "the locked weights are for {points} points and {joints} joints, the mesh and rig have others; bind without locks"
    )]
    Locks {
        /// Number of points of the locked weights.
        points: usize,
        /// Number of joints of the locked weights.
        joints: usize,
    },
    /// The mesh is too large.
    #[error("the mesh has too many points to bind")]
    TooLarge,
    /// The progress callback asked to stop.
    #[error("binding was cancelled")]
    Cancelled,
}

/// Weights of all `points` over `joints`.
///
/// `points`, `triangles` over them and `joints` share one space, of any unit and size. `rigid` lists ranges of points
/// that one joint moves alone. `progress` is called with the share of work done, 0 to 1, and cancels with `false`.
///
/// Every point gets at least one joint and at most [`WeightSettings::max_influences`], strongest first, positive,
/// summing to one. Joints that do not deform get none, unless none does: then all do. The result does not depend on
/// the number of threads. Cost: near linear in the points; about 0.1 s for 13,000 points and 50 joints.
///
/// # Errors
/// [`WeightError`]: no joints, numbers that are not finite, indices that do not exist, or cancelled. A mesh without
/// points or triangles is no error.
pub fn skin_weights(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    joints: &[WeightJoint],
    rigid: &[(Range<u32>, u32)],
    locks: Option<Locks>,
    settings: &WeightSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<(Weights, WeightReport), WeightError> {
    check::input(points, triangles, joints, rigid, locks.as_ref())?;
    check::claims(joints, &settings.claims)?;
    let (joints, claims) = &claiming(joints, &settings.claims);
    let mut slots = vec![false; joints.len()];
    for &joint in settings.slots.iter().filter(|joint| **joint < joints.len()) {
        slots[joint] = !claims[joint];
    }
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(WeightError::Cancelled) };
    step(0.0)?;
    let shaping = Shaping::new(points.len(), rigid, locks, settings);
    let mut report = WeightReport { points: points.len(), ..WeightReport::default() };
    let limbs = Limbs::new(joints, &shaping.free_joints(joints));
    let finish = |of: &dyn Fn(usize) -> Vec<(u32, f32)>| shaping.finish(|point| of(point).into_iter(), points.len());
    let is_locked = |joint: usize| locks.is_some_and(|locks| locks.joints[joint]);
    let is_given = |point: usize| shaping.is_given(point);
    if let [only] = limbs.free[..] {
        report.given = points.len();
        let result = finish(&|point| limbs.spread(points[point], [(only, 1.0)].into_iter()));
        report.idle_joints = report::idle_joints(joints, &result, is_locked, &slots, is_given, |_| None);
        return Ok((result, report));
    }
    // Rigid parts neither spread heat nor hide bones.
    let soft: Vec<[u32; 3]> =
        triangles.iter().copied().filter(|t| !t.iter().any(|&p| shaping.is_given(p as usize))).collect();
    let (bound_claims, bound_slots) = (limbs.flags(claims), limbs.flags(&slots));
    let bound_joints = (&*limbs.joints, &*bound_claims, &*bound_slots);
    let BoundSurface { place, weights, sources, stiff, gaps } =
        bind::bind(points, &soft, bound_joints, &limbs.free, settings, progress)?;
    for (point, &place) in place.iter().enumerate() {
        let count = match sources[place as usize] {
            _ if shaping.is_given(point) => &mut report.given,
            Source::Surface => &mut report.by_surface,
            Source::Voxels => &mut report.by_voxels,
            Source::Fill => &mut report.by_fill,
            Source::Nearest | Source::None => &mut report.by_nearest,
        };
        *count += 1;
    }
    report.comparisons = gaps.comparisons();
    report.stiff_pieces = stiff.pieces(&place, &shaping, &limbs);
    report.stiff = report.stiff_pieces.iter().map(|piece| piece.points).sum();
    let middles = stiff.middles(points, &place);
    let result = finish(&|point| {
        let place = place[point];
        let influences = weights.of(place as usize);
        match stiff.of.get(place as usize).and_then(|piece| middles[*piece as usize]) {
            Some(middle) => limbs.hold(middle, influences),
            None => limbs.spread(points[point], influences),
        }
    });
    let outside = |joint: usize| limbs.index(joint).and_then(|core| gaps.outside(core));
    report.idle_joints = report::idle_joints(joints, &result, is_locked, &slots, is_given, outside);
    step(1.0)?;
    Ok((result, report))
}

/// The joints with those that claim skin as deforming ones, and a flag of each joint: whether it claims skin.
fn claiming(joints: &[WeightJoint], claims: &[usize]) -> (Vec<WeightJoint>, Vec<bool>) {
    let (mut joints, mut flags) = (joints.to_vec(), vec![false; joints.len()]);
    // Without a joint that deforms all do.
    let any_deforms = joints.iter().any(|joint| joint.deforms);
    for &joint in claims {
        flags[joint] = true;
        joints[joint].deforms |= any_deforms;
    }
    (joints, flags)
}
