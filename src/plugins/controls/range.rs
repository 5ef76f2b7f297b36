//! Switches over a range of a clip, as one step of the history.

use bevy::prelude::*;

use super::{SwitchError, names};
use crate::{
    plugins::{
        commands::BuildResult,
        document::{EditRefusal, EditRequest},
        runtime::RigRuntime,
    },
    rig::{BuiltRig, Matching, Rig, Uid, operations::Operation},
    solve::{
        matching::{SwitchNote, SwitchRange, SwitchedRange, match_switch_over, tolerance_of},
        program::{RigProgram, RigState},
    },
};

/// Request to set the attribute of a switch over a range of a clip, with keys for the controls of the other side, so that the
/// joints move as before: one step of the history.
#[derive(Message, Debug, Clone, PartialEq)]
pub struct SwitchOverRequest {
    /// The rig.
    pub rig: Entity,
    /// The node that carries the attribute.
    pub control: Uid,
    /// The attribute.
    pub attribute: String,
    /// Value to set.
    pub value: f32,
    /// The clip.
    pub clip: Uid,
    /// Layer for keys of what no layer animates; `None` for the lowest.
    pub layer: Option<Uid>,
    /// First and last second of the range.
    pub range: [f32; 2],
}

/// Message that a switch was matched over a range, and that its keys are on their way into the document.
#[derive(Message, Debug, Clone, PartialEq)]
pub struct SwitchedOver {
    /// The rig.
    pub rig: Entity,
    /// Number of frames that were matched.
    pub frames: usize,
    /// Number of keys in the range.
    pub keys: usize,
    /// Joints that could not be held.
    pub notes: Vec<SwitchNote>,
}

pub(super) fn throw_over(
    mut requests: MessageReader<SwitchOverRequest>,
    rigs: Query<(&Rig, &BuildResult, &RigRuntime)>,
    mut commands: Commands,
) {
    for request in requests.read() {
        let rig = request.rig;
        let running = rigs.get(rig).ok().map(|(rig, built, runtime)| (rig, &*built.0, runtime.state().program()));
        let switched = running.ok_or(SwitchError::NotBuilt).and_then(|(document, built, program)| {
            let range = (request.clip, request.layer, request.range);
            switch_over(document, built, program, (request.control, request.attribute.as_str(), request.value), range)
        });
        match switched {
            Ok((operation, SwitchedRange { frames, keys, notes, .. })) => {
                commands.write_message(EditRequest::operation(rig, operation));
                commands.write_message(SwitchedOver { rig, frames, keys, notes });
            }
            Err(error) => {
                commands.write_message(EditRefusal { rig, request: None, reason: error.into() });
            }
        }
    }
}

/// Operation that sets a switch, given by its control, its attribute and the value, over a range of a clip of a document, given by
/// the clip, the layer for keys of what no layer animates, and two seconds; with what was done.
///
/// # Errors
/// [`SwitchError`] if there is no such switch or clip, or it cannot be matched.
pub fn switch_over(
    document: &Rig,
    built: &BuiltRig,
    program: &std::sync::Arc<RigProgram>,
    (control, attribute, value): (Uid, &str, f32),
    (clip, layer, span): (Uid, Option<Uid>, [f32; 2]),
) -> Result<(Operation, SwitchedRange), SwitchError> {
    let found = built.switches.iter().find(|switch| switch.control == control && *switch.attribute == *attribute);
    let switch = found.ok_or_else(|| SwitchError::NoSwitch {
        name: attribute.to_owned(),
        nearest: String::new(),
        known: names(built),
    })?;
    let clip = document.clip(clip).ok_or(SwitchError::NoClip)?;
    let state = stored(document, program);
    let range = SwitchRange { clip, layer, span, tolerance: tolerance_of(&state) };
    let mut switched = match_switch_over(built, &state, switch, value, &range)?;
    let name = match switch.matching {
        Matching::IkFk { .. } => "Switch kinematics over range",
        Matching::Space { .. } => "Switch space over range",
    };
    Ok((Operation::Named { name, edits: std::mem::take(&mut switched.edits) }, switched))
}

/// Instance in the stored pose of a document.
fn stored(document: &Rig, program: &std::sync::Arc<RigProgram>) -> RigState {
    let mut state = RigState::new(program.clone());
    for (node, offset) in document.pose() {
        if let Some(slot) = program.node(*node) {
            state.set_offset_at(slot, *offset);
        }
    }
    for (node, values) in document.attribute_values() {
        for (name, value) in values {
            if let Some(slot) = program.attribute(*node, name) {
                state.set_attribute_at(slot, *value);
            }
        }
    }
    state.evaluate(0.0);
    state
}
