//! Faces: bones placed in the background, bound, and moved by expressions.
//!
//! A [`FaceRequest`] looks at a mesh in a task and lands as one edit: joints, weights, a group and tags, so that it can
//! be undone, and what a person changed since stays when another density is asked for. An [`ExpressRequest`] poses the
//! facial joints.

mod edits;
mod job;
mod known;
mod pose;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bevy::prelude::*;

use super::{RigSystems, configure_sets};
use crate::{
    algo::face::{
        auto::{AutoSettings, FaceAnalysis},
        bones::FaceBone,
        expression::ExpressionSet,
    },
    mesh::{model::Model, shapes::Shapes},
};

pub use job::FaceJob;
pub use known::{FaceRig, KnownBone};
pub use pose::{expressed_points, mixed};

/// Adds automatic faces.
pub struct FacePlugin;

impl Plugin for FacePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<FaceExpressions>()
            .add_message::<FaceRequest>()
            .add_message::<FacePlaced>()
            .add_message::<ExpressRequest>()
            .add_message::<Expressed>()
            .add_systems(
                Update,
                (
                    pose::express.after(RigSystems::Gesture).before(RigSystems::Edits),
                    (job::start, job::land).chain().in_set(RigSystems::Bind),
                ),
            );
    }
}

/// The expressions and units that faces can show.
#[derive(Resource, Clone)]
pub struct FaceExpressions(pub Arc<ExpressionSet>);

impl Default for FaceExpressions {
    fn default() -> Self {
        Self(Arc::new(ExpressionSet::bundled().clone()))
    }
}

/// Asks to place a face in a mesh, to place it again with other settings, or to move its bones to fit shapes.
#[derive(Message, Debug, Clone)]
pub struct FaceRequest {
    /// The entity with the mesh.
    pub mesh: Entity,
    /// How.
    pub settings: AutoSettings,
    /// Shapes that the bones are moved to fit, such as those that an artist has sculpted.
    pub fit: Option<Arc<Shapes>>,
}

/// The answer to a [`FaceRequest`].
#[derive(Message, Debug, Clone)]
pub struct FacePlaced {
    /// The mesh.
    pub mesh: Entity,
    /// What was placed, or why nothing was.
    pub result: Result<FaceReport, String>,
}

/// What came of a [`FaceRequest`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FaceReport {
    /// Points of face, middle and back.
    pub groups: [usize; 3],
    /// Where the merge history was cut before front groups were joined.
    pub cut: usize,
    /// Heights of the last merges, highest first.
    pub heights: Vec<f32>,
    /// Points of the facial mask.
    pub mask: usize,
    /// Points of the head and of the whole mesh.
    pub points: [usize; 2],
    /// True if only a part of the mesh was taken for the head.
    pub is_part: bool,
    /// False if the axes are a weak guess.
    pub certain: bool,
    /// How sure the landmarks are, 0 to 1.
    pub confidence: f32,
    /// The bones, in the mesh's space.
    pub bones: Vec<FaceBone>,
    /// Square error of the grouping of the mask.
    pub square_error: f64,
    /// Rounds of grouping.
    pub rounds: usize,
    /// Triangles that the six expressions fold over.
    pub folds: usize,
    /// Bones that a person had touched and that stayed.
    pub kept: usize,
    /// Root mean square error of the fit over points and shapes, in the mesh's unit.
    pub fit_error: Option<f32>,
    /// How long each step took.
    pub times: Vec<(&'static str, Duration)>,
}

/// What is known about the face of a mesh; beside the mesh, and not saved: it is found again when it is needed.
#[derive(Component, Clone)]
pub struct Face {
    /// The analysis of the mesh.
    pub analysis: Arc<FaceAnalysis>,
    /// How it was made.
    pub settings: AutoSettings,
    /// What was analysed.
    rest: Arc<Model>,
}

impl Face {
    /// True if this is what an analysis of `rest` with these settings gives.
    fn serves(&self, rest: &Arc<Model>, settings: &AutoSettings) -> bool {
        Arc::ptr_eq(&self.rest, rest) && self.settings.same_head(settings)
    }
}

/// Asks for expressions and units by name, each with a strength from 0 to 1, in place of those there are.
#[derive(Message, Debug, Clone)]
pub struct ExpressRequest {
    /// The entity with the mesh.
    pub mesh: Entity,
    /// Which, and how strong.
    pub strengths: BTreeMap<String, f32>,
    /// True while a slider is dragged: shown, but not yet a step of the history.
    pub preview: bool,
}

/// The answer to an [`ExpressRequest`].
#[derive(Message, Debug, Clone)]
pub struct Expressed {
    /// The mesh.
    pub mesh: Entity,
    /// Why nothing is shown, if so.
    pub result: Result<(), String>,
}

/// What a face shows at present; beside the mesh.
#[derive(Component, Debug, Clone, PartialEq, Default)]
pub struct Expressions(pub BTreeMap<String, f32>);
