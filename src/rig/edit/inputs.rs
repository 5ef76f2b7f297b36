//! Edits of declared inputs.

use std::collections::HashSet;

use super::EditError;
use crate::rig::{Rig, RigEdit, RigInput};

impl Rig {
    pub(super) fn set_inputs(&mut self, inputs: &[RigInput]) -> Result<RigEdit, EditError> {
        let mut seen = HashSet::with_capacity(inputs.len());
        for input in inputs {
            let is_own = self.input(input.uid).is_some();
            if !seen.insert(input.uid) || self.is_taken(input.uid) && !is_own {
                return Err(EditError::UidInUse(input.uid));
            }
            if input.name.is_empty() || inputs.iter().any(|other| other.uid != input.uid && other.name == input.name) {
                return Err(EditError::BadInputName(input.uid, input.name.clone()));
            }
            if !input.rest.is_valid() {
                return Err(EditError::BadInput(input.name.clone()));
            }
        }
        Ok(RigEdit::SetInputs(std::mem::replace(&mut self.inputs, inputs.to_vec())))
    }
}
