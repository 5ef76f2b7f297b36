//! Faces: bones placed in the background, bound, and moved by expressions.
//!
//! A [`FaceRequest`] analyses a mesh in a task and ends as one edit: joints, weights, a group and tags, so that it can
//! be undone. Manual changes stay when another density is requested. An [`ExpressRequest`] poses the facial joints.

mod arkit;
mod edits;
mod error;
mod job;
mod placed_bones;
mod pose;
mod posing;
mod preparation;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bevy::prelude::*;

use super::{RigSystems, configure_sets, document::awaited_steps::AwaitedSteps, limits::RigLimits};
use crate::{
    algo::face::{
        auto::{AutoSettings, FaceAnalysis},
        bones::FaceBone,
        expression::ExpressionSet,
    },
    mesh::{model::Model, shapes::Shapes},
    rig::FaceCut,
};

pub use arkit::{FaceShape, arkit_shapes, pose_names, unit_shapes};
pub use error::{ExpressError, PlaceFaceError};
pub use job::FaceJob;
pub use placed_bones::{FaceRig, PlacedBone};
pub use pose::{expressed_points, mixed};
pub use posing::{BackgroundPosing, FacePosing};
pub use preparation::{FacePreparation, mended_shares};

/// Plugin of automatic faces.
pub struct FacePlugin;

impl Plugin for FacePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<FaceExpressions>()
            .init_resource::<preparation::PreparedSkins>()
            .init_resource::<RigLimits>()
            .init_resource::<AwaitedSteps>()
            .add_observer(preparation::forget)
            .add_message::<FaceRequest>()
            .add_message::<FacePlaced>()
            .add_message::<super::landing::ResultHeld>()
            .add_message::<ExpressRequest>()
            .add_message::<ExpressionAnswer>()
            .add_systems(
                Update,
                (
                    (preparation::keep, pose::adopt, pose::express, pose::await_steps)
                        .chain()
                        .after(RigSystems::Gesture)
                        .before(RigSystems::Edits),
                    preparation::prepare.after(RigSystems::Edits).before(RigSystems::Build),
                    pose::follow_strengths.after(RigSystems::Edits).before(RigSystems::Build),
                    (job::start, job::land).chain().in_set(RigSystems::Bind),
                ),
            );
    }
}

/// The available expressions and units.
#[derive(Resource, Clone)]
pub struct FaceExpressions(pub Arc<ExpressionSet>);

impl Default for FaceExpressions {
    fn default() -> Self {
        Self(ExpressionSet::bundled_shared())
    }
}

/// Request to place a face in a mesh, to place it again with other settings, or to move its bones to fit shapes.
#[derive(Message, Debug, Clone)]
pub struct FaceRequest {
    /// The entity with the mesh.
    pub mesh: Entity,
    /// Settings.
    pub settings: AutoSettings,
    /// Shapes to fit the bones to, such as an artist's sculpted shapes.
    pub fit: Option<Arc<Shapes>>,
}

/// The answer to a [`FaceRequest`].
#[derive(Message, Debug, Clone)]
pub struct FacePlaced {
    /// The mesh.
    pub mesh: Entity,
    /// Report of the placed face, or the reason why none was placed.
    pub result: Result<FaceReport, PlaceFaceError>,
}

/// Report of a [`FaceRequest`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FaceReport {
    /// Numbers of points of face, middle and back.
    pub groups: [usize; 3],
    /// Number of groups at the cut of the merge history, before front groups were joined.
    pub cut: usize,
    /// Heights of the last merges, highest first.
    pub heights: Vec<f32>,
    /// Number of points of the facial mask.
    pub mask: usize,
    /// Numbers of points of the head and of the whole mesh.
    pub points: [usize; 2],
    /// Marks a head that is only a part of the mesh.
    pub is_part: bool,
    /// Certainty of the axes; `false` for a weak guess.
    pub certain: bool,
    /// Confidence of the landmarks, 0 to 1.
    pub confidence: f32,
    /// The bones, in the mesh's space.
    pub bones: Vec<FaceBone>,
    /// Square error of the grouping of the mask.
    pub square_error: f64,
    /// Rounds of the clustering.
    pub rounds: usize,
    /// Number of triangles that the six expressions fold over.
    pub folds: usize,
    /// Number of folded triangles that nobody notices; see [`FaceAnalysis::tolerated_folds`].
    pub tolerated_folds: usize,
    /// Number of bones that a person had edited, which stayed.
    pub kept: usize,
    /// Root mean square error of the fit over points and shapes, in the mesh's unit.
    pub fit_error: Option<f32>,
    /// Duration of each step.
    pub times: Vec<(&'static str, Duration)>,
}

/// Density and grouping of settings as the document keeps them; `None` for the defaults.
pub fn cut_of(settings: &AutoSettings) -> Option<FaceCut> {
    let of = |settings: &AutoSettings| FaceCut {
        bones: u32::try_from(settings.bones).unwrap_or(u32::MAX),
        groups: settings.groups.map(|groups| u32::try_from(groups).unwrap_or(u32::MAX)),
    };
    Some(of(settings)).filter(|cut| *cut != of(&AutoSettings::default()))
}

/// Settings with the density and grouping of a document; its defaults for `None`.
pub fn with_cut(settings: AutoSettings, cut: Option<FaceCut>) -> AutoSettings {
    let AutoSettings { bones, groups, .. } = AutoSettings::default();
    let (bones, groups) =
        cut.map_or((bones, groups), |cut| (cut.bones as usize, cut.groups.map(|count| count as usize)));
    AutoSettings { bones, groups, ..settings }
}

/// Analysis of a mesh's face; beside the mesh, and not saved: it is computed again when it is needed.
#[derive(Component, Reflect, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct Face {
    /// The analysis of the mesh.
    pub analysis: Arc<FaceAnalysis>,
    /// Settings of the analysis.
    pub settings: AutoSettings,
    /// The analysed mesh.
    rest: Arc<Model>,
}

impl Face {
    /// Returns `true` if an analysis of `rest` with these settings would be the same.
    fn serves(&self, rest: &Arc<Model>, settings: &AutoSettings) -> bool {
        Arc::ptr_eq(&self.rest, rest) && self.settings.is_same_head(settings)
    }
}

/// Request for expressions and units by name, each with a strength from 0 to [`MAX_STRENGTH`](crate::algo::face::expression::MAX_STRENGTH), in place of the
/// current ones.
#[derive(Message, Debug, Clone)]
pub struct ExpressRequest {
    /// The entity with the mesh.
    pub mesh: Entity,
    /// Strengths by name.
    pub strengths: BTreeMap<String, f32>,
    /// Shows a preview without a step of the history if `true`, while a slider is dragged. Its pose is computed in the
    /// background ([`FacePosing`]); what is asked for meanwhile waits for it. All others are computed there, too, in apps with
    /// [`BackgroundPosing`].
    pub preview: bool,
}

/// The answer to an [`ExpressRequest`].
#[derive(Message, Debug, Clone)]
pub struct ExpressionAnswer {
    /// The mesh.
    pub mesh: Entity,
    /// Success, or the reason why nothing is shown.
    pub result: Result<(), ExpressError>,
}

/// Current strengths of a face by name, each from 0 to [`MAX_STRENGTH`](crate::algo::face::expression::MAX_STRENGTH);
/// beside the mesh.
///
/// The document holds them as values of attributes of the mesh, so undo, stored poses and projects bring them back.
///
/// A game sets expressions by writing it: the face moves in the same frame, as an [`ExpressRequest`] would move it, and
/// the answer is an [`ExpressionAnswer`] message. While the face is still prepared ([`FacePreparation`]) or a preview is computed
/// ([`FacePosing`]), both wait for it, and so do undo and redo. In apps with [`BackgroundPosing`] the face moves as soon as its
/// pose is computed. A value equal to what is shown is no edit.
///
/// On a [`RigInstance`](crate::instance::RigInstance) it poses the instance's facial joints by the stored poses of its template.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[reflect(Component, Debug, Clone, PartialEq, Default)]
pub struct Expressions(pub BTreeMap<String, f32>);
