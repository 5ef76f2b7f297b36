//! Weights by hand: meshes prepared for brushes, and changes of all weights of a mesh, worked out in the background.
//!
//! A stroke is an edit of the points that it touches ([`stroke_edit`]), previewed while it lasts and committed as one step.
//! Normalising, pruning and copying look at every point; a [`WeightChangeRequest`] starts a task for them.

mod canvas;
mod changes;
mod paintable_joints;

use bevy::prelude::*;

pub use self::{
    canvas::{CanvasJob, CanvasUse, PaintCanvas},
    changes::{WeightChange, WeightChangeAnswer, WeightChangeError, WeightChangeJob, WeightChangeRequest},
    paintable_joints::{PaintableError, PaintableJoint, locks, opposite_of, paintable, row_edit, stroke_edit},
};
use super::{RigSystems, configure_sets, landing::ResultHeld};

/// Plugin of weights by hand.
pub struct PaintingPlugin;

impl Plugin for PaintingPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<CanvasUse>()
            .add_message::<WeightChangeRequest>()
            .add_message::<WeightChangeAnswer>()
            .add_message::<ResultHeld>()
            .add_systems(
                Update,
                (
                    (changes::start, changes::land).chain().after(RigSystems::Gesture).before(RigSystems::Edits),
                    canvas::prepare.in_set(RigSystems::Bind),
                ),
            );
    }
}
