//! Steps that are still computed, and the undo and redo that come after them.
//!
//! A person who lets go of a slider, or types a strength, has made a step, though its pose may be computed for some frames
//! yet. An undo that comes meanwhile is about that step, and waits for it.

use std::mem;

use bevy::{
    ecs::{entity::EntityHashSet, message::MessageId},
    prelude::*,
};

use super::{Change, EditRequest};

/// Rigs with steps that are computed, or that became edits in this frame.
#[derive(Resource, Default)]
pub(in crate::plugins) struct AwaitedSteps {
    /// Rigs with a step that is computed.
    pub computed: EntityHashSet,
    /// Rigs with a step that became an edit in this frame.
    pub landed: EntityHashSet,
}

/// Request with its identity.
type IdentifiedRequest = (MessageId<EditRequest>, EditRequest);

/// Undo and redo that wait for a step of their rig.
#[derive(Default)]
pub(super) struct HeldRequests(Vec<IdentifiedRequest>);

impl HeldRequests {
    /// Requests to carry out in this frame, in their order: an undo and a redo come after the steps that were awaited, and after
    /// those that waited.
    pub(super) fn due(
        &mut self,
        asked: impl Iterator<Item = IdentifiedRequest>,
        awaited: &AwaitedSteps,
        is_rig: impl Fn(Entity) -> bool,
    ) -> Vec<IdentifiedRequest> {
        let waits = |request: &EditRequest| awaited.computed.contains(&request.rig);
        let held = mem::take(&mut self.0).into_iter().filter(|(_, request)| is_rig(request.rig));
        let (mut held, mut late): (Vec<_>, Vec<_>) = held.partition(|(_, request)| waits(request));
        let mut due = Vec::new();
        for (id, request) in asked {
            let comes_late =
                || awaited.landed.contains(&request.rig) || late.iter().any(|(_, before)| before.rig == request.rig);
            match request.change {
                Change::Undo | Change::Redo if waits(&request) => held.push((id, request)),
                Change::Undo | Change::Redo if comes_late() => late.push((id, request)),
                _ => due.push((id, request)),
            }
        }
        self.0 = held;
        due.extend(late);
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_redo_does_not_overtake_an_undo_that_waited() {
        let rig = Entity::PLACEHOLDER;
        let mut messages = Messages::default();
        let mut ask = |change| {
            let request = EditRequest { rig, change };
            (messages.write(request.clone()), request)
        };
        let computed = AwaitedSteps { computed: [rig].into_iter().collect(), ..AwaitedSteps::default() };
        let mut held = HeldRequests::default();
        assert!(held.due([ask(Change::Undo)].into_iter(), &computed, |_| true).is_empty());
        // The step comes to nothing, as when its mesh is removed.
        let due = held.due([ask(Change::Redo)].into_iter(), &AwaitedSteps::default(), |_| true);
        let changes: Vec<Change> = due.into_iter().map(|(_, request)| request.change).collect();
        assert!(matches!(changes.as_slice(), [Change::Undo, Change::Redo]), "{changes:?}");
    }
}
