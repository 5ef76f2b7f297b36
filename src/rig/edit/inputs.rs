//! Edits of declared inputs.

use std::collections::{HashMap, HashSet};

use super::EditError;
use crate::rig::{Rig, RigEdit, RigInput, Uid};

impl Rig {
    pub(super) fn set_inputs(&mut self, inputs: &[RigInput]) -> Result<RigEdit, EditError> {
        // The first and the last input with each name are two where several have it.
        let mut bearers: HashMap<&str, [Uid; 2]> = HashMap::with_capacity(inputs.len());
        for RigInput { uid, name, .. } in inputs {
            bearers.entry(name).or_insert([*uid; 2])[1] = *uid;
        }
        let mut seen = HashSet::with_capacity(inputs.len());
        for input in inputs {
            let is_own = self.inputs.has(input.uid);
            if !seen.insert(input.uid) || !is_own && self.is_taken(input.uid) {
                return Err(EditError::UidInUse(input.uid));
            }
            let is_alone = bearers.get(input.name.as_str()).is_some_and(|[first, last]| first == last);
            if input.name.is_empty() || !is_alone {
                return Err(EditError::BadInputName(input.uid, input.name.clone()));
            }
            if !input.rest.is_valid() {
                return Err(EditError::BadInput(input.name.clone()));
            }
        }
        Ok(RigEdit::SetInputs(self.inputs.replace_all(inputs.to_vec())))
    }
}
