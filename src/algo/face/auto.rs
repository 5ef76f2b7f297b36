//! Automatic face rigging: bones and weights from a mesh alone.
//!
//! [`FaceAnalysis`] holds the results that depend on the mesh only (axes, head part, landmarks, groups, head and neck
//! bones); [`FaceAnalysis::rig`] computes those that depend on the density as well (facial bones and weights). With a
//! kept analysis another density costs only the second half.

mod orientation;
mod refit;

use glam::{Quat, Vec3};

use self::orientation::{OrientedHead, orient};
use super::{
    axes::{AxesError, HeadAxes},
    bones::{FaceBone, FaceBonesError, FaceBonesSettings, FixedBone, place_bones},
    expression::{ExpressionSet, FittedFace, UnitSet, repair_folds},
    grouping::{GroupingError, HeadGroups, group_head},
    head_bones::{HeadBones, HeadBonesError, head_bones},
    head_part::HeadPartError,
    landmarks::{LandmarkError, Landmarks},
    shells::{MouthName, Shells},
    weights::{FaceWeightsError, face_weights},
};
use crate::{algo::fit::FitError, mesh::model::Weights};

pub use refit::FaceFit;

/// Settings of automatic face rigging.
#[derive(Debug, Clone, PartialEq)]
pub struct AutoSettings {
    /// Number of bones on the skin: the density.
    pub bones: usize,
    /// Seed of the first centroids.
    pub seed: u64,
    /// Number of random starts of the clustering; the one with the least square error is kept.
    pub starts: usize,
    /// Places bones in mirrored pairs if `true`.
    pub symmetric: bool,
    /// Adds bones of jaw, eyes and tongue, where the mesh has them, if `true`.
    pub extras: bool,
    /// Up direction in the mesh's space; guessed if `None`.
    pub up: Option<Vec3>,
    /// View direction of the face in the mesh's space; guessed if `None`.
    pub forward: Option<Vec3>,
    /// Takes the whole mesh for a head if `true`, even if it looks like a body.
    pub whole: bool,
    /// Number of groups at which the depths are cut before front groups are joined; found from the mesh if `None`.
    pub groups: Option<usize>,
    /// Largest number of joints that move a point, 1 to 8; 4, which every program reads, unless more are exported.
    pub influences: usize,
}

impl Default for AutoSettings {
    fn default() -> Self {
        Self {
            bones: 40,
            seed: 0,
            starts: 3,
            symmetric: true,
            extras: true,
            up: None,
            forward: None,
            whole: false,
            groups: None,
            influences: 4,
        }
    }
}

impl AutoSettings {
    /// Returns `true` if an analysis for `other` serves these settings, too.
    pub fn is_same_head(&self, other: &Self) -> bool {
        (self.up, self.forward, self.whole, self.groups) == (other.up, other.forward, other.whole, other.groups)
    }
}

/// Steps of face rigging, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaceStep {
    /// Search for the head's axes, and for the head of a body.
    Axes,
    /// Search for landmarks.
    Landmarks,
    /// Grouping in depth, and of the middle group in height.
    Grouping,
    /// Placement of head and neck bones.
    HeadBones,
    /// Placement of facial bones.
    Bones,
    /// Computation of weights.
    Weights,
    /// Test of the six expressions; weights are smoothed where they fold skin.
    Expressions,
    /// Fit of the bones to shapes.
    Fit,
}

impl FaceStep {
    /// Name of the step for people and programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Axes => "axes",
            Self::Landmarks => "landmarks",
            Self::Grouping => "grouping",
            Self::HeadBones => "head_bones",
            Self::Bones => "bones",
            Self::Weights => "weights",
            Self::Expressions => "expressions",
            Self::Fit => "fit",
        }
    }

    /// Start and end of the step in the whole progress from 0 to 1.
    fn share(self) -> (f32, f32) {
        match self {
            Self::Axes => (0.0, 0.1),
            Self::Landmarks => (0.1, 0.25),
            Self::Grouping => (0.25, 0.4),
            Self::HeadBones => (0.4, 0.45),
            Self::Bones => (0.45, 0.6),
            Self::Weights => (0.6, 0.9),
            Self::Expressions => (0.9, 1.0),
            Self::Fit => (0.0, 1.0),
        }
    }
}

/// Progress callback, called with the current step and the finished share, 0 to 1; it cancels the work by returning
/// `false`.
pub type FaceProgress<'a> = &'a (dyn Fn(FaceStep, f32) -> bool + Sync);

/// Error of face rigging.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FaceError {
    /// No points or triangles.
    #[error("the mesh has no points or no triangles; open a head")]
    Empty,
    /// Index of a point that is not finite.
    #[error("point {0} of the mesh is not finite; repair the mesh")]
    NotFinite(usize),
    /// Index of a triangle with a corner that does not exist.
    #[error("triangle {0} has a corner past the last point: the mesh is damaged")]
    Triangle(usize),
    /// A request for zero bones.
    #[error("0 bones make no face; ask for at least 1")]
    NoBones,
    /// Cancelled by the progress callback.
    #[error("placing the face was cancelled")]
    Cancelled,
    /// Error of the search for axes.
    #[error(transparent)]
    Axes(AxesError),
    /// Error of the search for the head part.
    #[error(transparent)]
    Part(HeadPartError),
    /// Error of the search for landmarks.
    #[error(transparent)]
    Landmarks(LandmarkError),
    /// Error of the grouping.
    #[error(transparent)]
    Grouping(GroupingError),
    /// Error of placing head and neck bones.
    #[error(transparent)]
    HeadBones(HeadBonesError),
    /// Error of placing facial bones.
    #[error(transparent)]
    Bones(FaceBonesError),
    /// Error of computing weights.
    #[error(transparent)]
    Weights(FaceWeightsError),
    /// Error of fitting shapes.
    #[error(transparent)]
    Fit(FitError),
}

/// Results of a mesh's analysis that do not depend on the density of bones.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceAnalysis {
    /// Axes of the head in the mesh's space.
    pub axes: HeadAxes,
    /// Certainty of the axes: `false` for a weak guess that a person should confirm.
    pub certain: bool,
    /// Indices of the mesh's points that belong to the head; `None` if the whole mesh is a head.
    pub part: Option<Vec<u32>>,
    /// Number of points of the whole mesh.
    pub mesh_points: usize,
    /// Points of the head in head space.
    pub points: Vec<Vec3>,
    /// Triangles over `points`.
    pub triangles: Vec<[u32; 3]>,
    /// Connected parts of the head: skin, eyes and the rest.
    pub shells: Shells,
    /// Landmarks of the face, in head space.
    pub landmarks: Landmarks,
    /// Groups of the points: face, middle and back.
    pub groups: HeadGroups,
    /// Head and neck bones, in head space.
    pub head_bones: HeadBones,
}

/// Facial bones and the weights of all points.
#[derive(Debug, Clone, PartialEq)]
pub struct AutoFace {
    /// Facial bones, in head space.
    pub bones: Vec<FaceBone>,
    /// Weights of the points of the *analysis* over neck (0), head (1) and the bones (from 2).
    pub weights: Weights,
    /// Sum of squared distances of the mask's points to their bone, in the mesh's unit squared.
    pub square_error: f64,
    /// Rounds of the clustering until no point changed its group.
    pub rounds: usize,
    /// Number of triangles that the six expressions fold over; usually none.
    pub folds: usize,
}

impl FaceAnalysis {
    /// Analyses a mesh.
    ///
    /// `points` and `triangles` are in the mesh's space and any unit. Tens of milliseconds for 11,000 points.
    ///
    /// # Errors
    /// [`FaceError`]: damaged or flat meshes, no face to be seen, or cancelled.
    pub fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        settings: &AutoSettings,
        progress: FaceProgress,
    ) -> Result<Self, FaceError> {
        check(points, triangles)?;
        let step = |step: FaceStep| begin(progress, step);
        let OrientedHead { axes, certain, part, points: head, triangles: faces, mut shells, landmarks } =
            orient(points, triangles, settings, &step)?;
        shells.mark_tongue(&head, &faces, &landmarks, &|_| None);
        step(FaceStep::Grouping)?;
        let groups =
            group_head(&head, &faces, &shells, &landmarks, settings.groups, &within(progress, FaceStep::Grouping))
                .map_err(|error| cancelled(progress, FaceError::Grouping(error)))?;
        step(FaceStep::HeadBones)?;
        let bones = head_bones(&head, &faces, &groups, &landmarks).map_err(FaceError::HeadBones)?;
        Ok(Self {
            axes,
            certain,
            part,
            mesh_points: points.len(),
            points: head,
            triangles: faces,
            shells,
            landmarks,
            groups,
            head_bones: bones,
        })
    }

    /// The analysis with a tongue that names of objects tell: `name_of` gives the part of the mouth that the name of a point's
    /// object tells, for points of the *mesh*. Where no name tells the tongue, its shape and place do.
    pub fn with_names(mut self, name_of: &dyn Fn(usize) -> Option<MouthName>) -> Self {
        let Self { part, points, triangles, landmarks, shells, .. } = &mut self;
        let of_head = |point: usize| name_of(part.as_ref().map_or(point, |part| part[point] as usize));
        shells.mark_tongue(points, triangles, landmarks, &of_head);
        self
    }

    /// Number of triangles that the six expressions together may fold over without anybody noticing: a thousandth of the
    /// facial mask in each. Skin creases in the corners of the mouth, on real faces too.
    pub fn tolerated_folds(&self) -> usize {
        let is_facial = |corners: &&[u32; 3]| corners.iter().all(|corner| self.groups.mask[*corner as usize]);
        6 * self.triangles.iter().filter(is_facial).count() / 1000
    }

    /// Places facial bones and binds the head to them.
    ///
    /// `fixed` bones (head space) stay where they are and count among [`AutoSettings::bones`]. Weights are smoothed where
    /// the six expressions would fold skin over; [`AutoFace::folds`] tells what is left.
    ///
    /// # Errors
    /// [`FaceError`]: no bones, more than the mask has points, or cancelled.
    pub fn rig(
        &self,
        fixed: &[FixedBone],
        settings: &AutoSettings,
        expressions: &ExpressionSet,
        progress: FaceProgress,
    ) -> Result<AutoFace, FaceError> {
        if settings.bones == 0 {
            return Err(FaceError::NoBones);
        }
        let Self { points, triangles, shells, groups, landmarks, .. } = self;
        begin(progress, FaceStep::Bones)?;
        let how = FaceBonesSettings {
            bones: settings.bones,
            seed: settings.seed,
            starts: settings.starts,
            symmetric: settings.symmetric,
            extras: settings.extras,
        };
        let placed =
            place_bones(points, triangles, shells, groups, landmarks, fixed, &how, &within(progress, FaceStep::Bones))
                .map_err(|error| cancelled(progress, FaceError::Bones(error)))?;
        begin(progress, FaceStep::Weights)?;
        let weights = face_weights(
            points,
            triangles,
            shells,
            groups,
            landmarks,
            &placed.bones,
            settings.influences,
            &within(progress, FaceStep::Weights),
        )
        .map_err(|error| cancelled(progress, FaceError::Weights(error)))?;
        let mut face = AutoFace {
            bones: placed.bones,
            weights,
            square_error: placed.square_error,
            rounds: placed.rounds,
            folds: 0,
        };
        begin(progress, FaceStep::Expressions)?;
        let mask = &groups.mask;
        let (most, bones) = (settings.influences, &face.bones);
        face.folds = repair_folds(expressions, points, triangles, mask, &mut face.weights, bones, landmarks, most);
        Ok(face)
    }

    /// The head with the given bones and weights, prepared for expressions.
    pub fn fitted(&self, bones: &[FaceBone], weights: &Weights, units: &UnitSet) -> FittedFace {
        FittedFace::new(&self.points, &self.triangles, &self.groups.mask, weights, bones, &self.landmarks, units)
    }

    /// Rotation from head space to the mesh's space.
    pub fn to_mesh(&self) -> Quat {
        self.axes.rotation().inverse()
    }

    /// Least and greatest corner of a box around the face in the mesh's space, forehead and chin included.
    pub fn face_box(&self) -> [Vec3; 2] {
        let margin = 0.3 * self.landmarks.eye_distance();
        let to_mesh = self.to_mesh();
        let of = |points: &mut dyn Iterator<Item = Vec3>| {
            points.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
        };
        let [low, high] = of(&mut self.landmarks.points.iter().copied());
        let grown = [low - Vec3::splat(margin), high + Vec3::new(margin, 1.6 * margin, margin)];
        of(&mut grown.into_iter().map(|corner| to_mesh * corner))
    }

    /// Index in the mesh of a point of the analysis.
    pub fn mesh_point(&self, point: usize) -> usize {
        match &self.part {
            Some(part) => part.get(point).map_or(point, |point| *point as usize),
            None => point,
        }
    }
}

fn check(points: &[Vec3], triangles: &[[u32; 3]]) -> Result<(), FaceError> {
    if points.is_empty() || triangles.is_empty() {
        return Err(FaceError::Empty);
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(FaceError::NotFinite(point));
    }
    let past = |triangle: &[u32; 3]| triangle.iter().any(|corner| *corner as usize >= points.len());
    triangles.iter().position(past).map_or(Ok(()), |triangle| Err(FaceError::Triangle(triangle)))
}

fn begin(progress: FaceProgress, step: FaceStep) -> Result<(), FaceError> {
    if progress(step, step.share().0) { Ok(()) } else { Err(FaceError::Cancelled) }
}

/// Progress of one step, mapped to its part of the whole.
fn within(progress: FaceProgress<'_>, step: FaceStep) -> impl Fn(f32) -> bool + Sync + '_ {
    move |part| {
        let (from, to) = step.share();
        progress(step, from + (to - from) * part.clamp(0.0, 1.0))
    }
}

/// Maps an error of a step that was cancelled to [`FaceError::Cancelled`].
fn cancelled(progress: FaceProgress, error: FaceError) -> FaceError {
    let stopped = !progress(FaceStep::Weights, FaceStep::Weights.share().0);
    if stopped { FaceError::Cancelled } else { error }
}
