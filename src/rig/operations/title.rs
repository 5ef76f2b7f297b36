//! Titles of operations: their names with the joints that they change, which tell the steps of a history apart.

use std::borrow::Cow;

use super::Operation;
use crate::rig::{RigEdit, Uid};

/// Largest number of letters of a joint's name in a title.
const LETTERS: usize = 40;

impl Operation {
    /// Title of the step that the operation makes: "Pose hand_l", "Move hand_l and 2 more"; [`Self::name`] where the
    /// operation is about no joint in particular. `name_of` gives the name of a node before the operation.
    pub fn title(&self, name_of: &dyn Fn(Uid) -> Option<String>) -> Cow<'static, str> {
        let (verb, nodes) = match self {
            Self::Delete { joints, .. } => ("Delete", joints.clone()),
            Self::Move { to, .. } => ("Move", first_of(to)),
            Self::Rotate { joints, .. } => ("Rotate", joints.clone()),
            Self::Scale { joints, .. } => ("Scale", joints.clone()),
            Self::Rest { to, .. } => ("Set rest of", first_of(to)),
            Self::Reparent { joints, .. } => ("Reparent", joints.clone()),
            Self::Labels(labels) => ("Rename", first_of(labels)),
            Self::Orient { joints, .. } => ("Orient", joints.clone()),
            Self::Mirror { joints } => ("Mirror", joints.clone()),
            Self::Lock(joints, true) => ("Lock", joints.clone()),
            Self::Lock(joints, false) => ("Unlock", joints.clone()),
            Self::Pose(offsets) => ("Pose", first_of(offsets)),
            Self::ResetPose(joints) => ("Reset", joints.clone()),
            Self::Keyed { operation, .. } | Self::Built { operation, .. } | Self::Carried { operation, .. } => {
                return operation.title(name_of);
            }
            Self::Edits(edits) | Self::Named { edits, .. } => return attribute(edits, name_of, self.name()),
            _ => return self.name().into(),
        };
        let named = nodes.first().and_then(|node| name_of(*node));
        match (named, nodes.len()) {
            (Some(name), 1) => format!("{verb} {}", cut(&name)).into(),
            (Some(name), count) => format!("{verb} {} and {} more", cut(&name), count - 1).into(),
            (None, _) => self.name().into(),
        }
    }
}

fn first_of<T>(pairs: &[(Uid, T)]) -> Vec<Uid> {
    pairs.iter().map(|(node, _)| *node).collect()
}

/// Title of edits: the attribute and its node, if a single value of an attribute is set.
fn attribute(edits: &[RigEdit], name_of: &dyn Fn(Uid) -> Option<String>, otherwise: &'static str) -> Cow<'static, str> {
    let [RigEdit::SetAttributeValue(node, attribute, _)] = edits else { return otherwise.into() };
    name_of(*node).map_or(otherwise.into(), |name| format!("Set {attribute} of {}", cut(&name)).into())
}

/// A name of at most [`LETTERS`] letters.
fn cut(name: &str) -> Cow<'_, str> {
    match name.char_indices().nth(LETTERS) {
        Some((end, _)) => format!("{}…", &name[..end]).into(),
        None => name.into(),
    }
}
