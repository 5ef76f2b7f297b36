//! Steps that are still computed, and the undo and redo that come after them.
//!
//! A person who lets go of a slider has made a step, though its pose may be computed for some frames yet. An undo that comes
//! meanwhile is about that step, and waits for it.

use std::mem;

use bevy::{ecs::entity::EntityHashSet, prelude::*};

use super::{Change, EditRequest};

/// Rigs with steps that are computed, or that became edits in this frame.
#[derive(Resource, Default)]
pub(in crate::plugins) struct AwaitedSteps {
    /// Rigs with a step that is computed.
    pub computed: EntityHashSet,
    /// Rigs with a step that became an edit in this frame.
    pub landed: EntityHashSet,
}

/// Undo and redo that wait for a step of their rig.
#[derive(Default)]
pub(super) struct HeldRequests(Vec<EditRequest>);

impl HeldRequests {
    /// Requests to carry out in this frame, in their order: an undo and a redo come after the steps that were awaited.
    pub(super) fn due(
        &mut self,
        asked: impl Iterator<Item = EditRequest>,
        awaited: &AwaitedSteps,
        is_rig: impl Fn(Entity) -> bool,
    ) -> Vec<EditRequest> {
        let waits = |request: &EditRequest| awaited.computed.contains(&request.rig);
        let held = mem::take(&mut self.0).into_iter().filter(|request| is_rig(request.rig));
        let (mut held, mut late): (Vec<_>, Vec<_>) = held.partition(waits);
        let mut due = Vec::new();
        for request in asked {
            match request.change {
                Change::Undo | Change::Redo if waits(&request) => held.push(request),
                Change::Undo | Change::Redo if awaited.landed.contains(&request.rig) => late.push(request),
                _ => due.push(request),
            }
        }
        self.0 = held;
        due.extend(late);
        due
    }
}
