//! Inputs of a program: nodes outside of the rig.

use std::sync::Arc;

use super::{CompileOptions, ExternalNode, RigProgram};
use crate::{
    mesh::model::Trs,
    rig::{BuiltRig, Uid},
};

/// Inputs of a program: those that the rig declares, then those of the options.
pub(super) fn outside(rig: &BuiltRig, options: &CompileOptions) -> Vec<ExternalNode> {
    let declared = rig.inputs.iter().map(|input| ExternalNode { uid: input.uid, rest: input.rest });
    declared.chain(options.inputs.iter().copied()).collect()
}

impl RigProgram {
    /// Uids of the inputs by slot.
    pub fn inputs(&self) -> &[Uid] {
        &self.inputs
    }

    /// Slot of an input.
    pub fn input(&self, uid: Uid) -> Option<usize> {
        self.inputs.iter().position(|known| *known == uid)
    }

    /// Names of the inputs that the rig declares, by slot.
    pub fn declared_inputs(&self) -> &[Arc<str>] {
        &self.declared
    }

    /// Transform of an input until it is set, in the rig's space.
    pub fn input_rest(&self, slot: usize) -> Option<Trs> {
        let register = self.nodes.len() + 1 + slot;
        (slot < self.inputs.len()).then(|| self.x.get(register).copied()).flatten()
    }
}
