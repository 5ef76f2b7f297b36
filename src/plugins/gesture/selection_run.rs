//! Gestures that select joints and follow one another: requested in one frame, because nothing moves between them.
//!
//! Picks are answered in the order of their requests, so that each gesture gets its own answer.

use std::collections::VecDeque;

use bevy::{ecs::message::MessageId, prelude::*};

use super::{Gesture, GestureScript, error::GestureError};
use crate::{
    plugins::{
        history::quoted_name,
        limits::RigLimits,
        picking::{Pick, PickRequest},
    },
    rig::{Rig, Uid},
};

/// Number of gestures that a run may have on a rig of fewer joints.
const LEAST: usize = 64;

/// Requested selections whose answers are to come, in their order.
#[derive(Default)]
pub(super) struct RequestedSelections {
    /// Requests, each with the index of the answer that it completes; `None` for a selection that is cleared, which tells nothing.
    answers: VecDeque<(MessageId<PickRequest>, Option<usize>)>,
    /// Number of those that complete an answer.
    open: usize,
}

impl RequestedSelections {
    fn push(&mut self, request: MessageId<PickRequest>, answer: Option<usize>) {
        self.open += usize::from(answer.is_some());
        self.answers.push_back((request, answer));
    }

    /// Index of the first answer that is to be completed.
    pub(super) fn first_open(&self) -> Option<usize> {
        self.answers.iter().find_map(|(_, answer)| *answer)
    }

    /// The answer that a selection completes; the outer `None` for one that was not requested here.
    fn take(&mut self, request: MessageId<PickRequest>) -> Option<Option<usize>> {
        // Requests are answered in their order.
        let at = self.answers.iter().position(|(asked, _)| *asked == request)?;
        let (_, answer) = self.answers.remove(at)?;
        self.open -= usize::from(answer.is_some());
        Some(answer)
    }
}

/// True if a gesture selects joints.
fn is_selection(gesture: &Gesture) -> bool {
    use Gesture::{Add, Box, Deselect, Select, SelectAll, SelectLabel};
    matches!(gesture, Select(_) | Add(_) | Box(..) | SelectLabel(_) | SelectAll | Deselect)
}

/// True if the next gestures of a script make a run.
pub(super) fn is_due(script: &GestureScript) -> bool {
    script.is_unwatched && script.waiting.front().is_some_and(is_selection)
}

/// Requests the selections at the front of the script of a rig whose model lies between two corners.
pub(super) fn carry_out(
    script: &mut GestureScript,
    (entity, rig, bounds): (Entity, &Rig, [Vec3; 2]),
    picks: &mut MessageWriter<PickRequest>,
    limits: &RigLimits,
) {
    for _ in 0..rig.len().max(LEAST) {
        let next = script.waiting.front();
        let goes_on = next.is_some_and(|gesture| is_selection(gesture) || gesture.is_setting());
        if !goes_on {
            break;
        }
        let Some(gesture) = script.begin_next(rig.len(), None, limits) else { continue };
        if script.state.take_setting(&gesture) {
            continue;
        }
        let (plane, reach) = (script.state.plane(bounds), script.state.reach(bounds));
        let click = |at: (f32, f32)| Pick::Click { plane, point: at.into(), reach };
        let is_added = matches!(gesture, Gesture::Add(_));
        let what = match gesture {
            Gesture::Select(at) | Gesture::Add(at) => click(at),
            Gesture::Box(a, b) => Pick::Box { plane, corners: [a.into(), b.into()] },
            Gesture::SelectAll => Pick::All,
            Gesture::SelectLabel(label) => match rig.labelled(&label) {
                Some(joint) => Pick::Joints(vec![joint]),
                None => {
                    script.fail(&GestureError::NoLabel(label));
                    continue;
                }
            },
            _ => Pick::None,
        };
        let is_told = !matches!(what, Pick::None);
        let request = picks.write(PickRequest { rig: entity, what, add: is_added });
        let answer = is_told.then(|| script.answers.len() - 1);
        script.selections.push(request, answer);
    }
    script.pending = script.selections.open > 0;
}

impl GestureScript {
    /// Takes over the answer to a requested selection; false if this one was not requested here.
    pub(super) fn take_selection(&mut self, request: MessageId<PickRequest>, joints: &[Uid], rig: &Rig) -> bool {
        let Some(number) = self.selections.take(request) else { return false };
        if let Some(number) = number {
            self.pending = self.selections.open > 0;
            if let Some(answer) = self.answers.get_mut(number) {
                answer.done = !joints.is_empty();
                answer.message = told_selection(joints, rig);
            }
        }
        true
    }
}

/// Sentence about joints that a gesture selects.
pub(super) fn told_selection(joints: &[Uid], rig: &Rig) -> String {
    match joints {
        [] => GestureError::NothingToPick.to_string(),
        [joint] => format!("selected {}", quoted_name(rig, *joint)),
        joints => format!("selected {} joints", joints.len()),
    }
}
