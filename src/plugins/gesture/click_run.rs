//! Runs of clicks: clicks that follow one another, carried out in one frame.
//!
//! Nobody watches the gestures of a command. Between two clicks on a mesh at rest nothing happens that the second one depends on
//! but the joint of the first, so that entities have to follow the document once for all of them. A run has at most as many
//! gestures as the rig has joints: frames cost what the joints of the rig cost, and a list takes time in proportion to its length.

use bevy::prelude::*;

use super::{Gesture, GestureScript, error::GestureError};
use crate::{
    algo::view::ViewPlane,
    plugins::{
        document::{Change, ChangeError, EditRequest, Selection},
        limits::RigLimits,
        placement::joint_at,
        surface::RigSurface,
    },
    rig::Rig,
};

/// Number of gestures that a run may have on a rig of fewer joints.
const LEAST: usize = 64;

/// Rig on which a run is carried out.
pub(super) struct ClickedRig<'a> {
    pub entity: Entity,
    pub rig: &'a Rig,
    pub selection: &'a Selection,
    pub surface: Option<&'a RigSurface>,
    /// Least and greatest corner of the surface.
    pub bounds: [Vec3; 2],
}

/// True if the next gestures of a script make a run: the rig is at rest, and no joint of it moves the mesh.
pub(super) fn is_due(script: &GestureScript, rig: &Rig, surface: Option<&RigSurface>) -> bool {
    script.is_unwatched
        && script.waiting.front().is_some_and(is_quick)
        && rig.pose().is_empty()
        && rig.skins().next().is_none()
        && surface.is_none_or(|surface| !surface.is_stale())
}

/// True for gestures that a run may have: clicks, and settings of the view and of placing.
fn is_quick(gesture: &Gesture) -> bool {
    use Gesture::{Click, Depth, Reach, Recentre, View, Volume};
    matches!(gesture, Click(_) | View(_) | Depth(_) | Volume(_) | Recentre(_) | Reach(_))
}

/// Requests the joints of the clicks at the front of a script.
pub(super) fn carry_out(
    script: &mut GestureScript,
    clicked: &ClickedRig,
    edits: &mut MessageWriter<EditRequest>,
    limits: &RigLimits,
) {
    for _ in 0..clicked.rig.len().max(LEAST) {
        if !script.waiting.front().is_some_and(is_quick) {
            break;
        }
        let Some(gesture) = script.begin_next(clicked.rig.len(), limits) else { continue };
        let Gesture::Click(at) = gesture else {
            script.state.take_setting(&gesture);
            continue;
        };
        let ray = ViewPlane::orthographic(script.state.view, clicked.bounds).ray(at.into());
        let placed = joint_at(clicked.rig, clicked.selection, clicked.surface, &ray, script.state.place);
        script.tell_placement(&placed.placement, None);
        if let Some(position) = placed.rest {
            edits.write(EditRequest { rig: clicked.entity, change: Change::Place(position) });
            script.placing.push_back(script.answers.len() - 1);
        }
    }
    script.pending = !script.placing.is_empty();
}

impl GestureScript {
    /// Completes the answer of the first click of a run whose joint was requested.
    pub(super) fn take_report(&mut self, added: &Result<usize, ChangeError>) {
        let Some(number) = self.placing.pop_front() else { return };
        self.pending = !self.placing.is_empty();
        let Some(answer) = self.answers.get_mut(number) else { return };
        match added {
            Ok(joints) => answer.joints_added = *joints,
            Err(reason) => {
                answer.done = false;
                answer.message = GestureError::from(reason.clone()).to_string();
                self.refused_places += 1;
            }
        }
    }
}
