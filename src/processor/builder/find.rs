//! Nodes of what is built, found by references in their text form.

use std::collections::BTreeSet;

use super::{
    super::{
        NodeId,
        exclusion::Exclusion,
        resolve::{self, Asker, ResolveError},
    },
    Builder,
};
use crate::rig::{
    Rig, Uid,
    reference::{NodeRefs, ReferenceError, given_names},
};

/// The reason why a reference finds no nodes in what is built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FindError {
    /// The text is no reference, or names something that is not there.
    #[error(transparent)]
    Text(#[from] ReferenceError),
    /// The reference means something that is not built.
    #[error(transparent)]
    Meaning(#[from] ResolveError),
    /// The reference means something that is off.
    #[error("{text}: {off}; turn it on, or refer to something else")]
    Off {
        /// The reference.
        text: String,
        /// Switch that is off.
        off: Exclusion,
    },
    /// Rig without joints, in which no joint could ask.
    #[error("the rig has no joints, so references find nothing")]
    Empty,
}

impl Builder {
    /// The nodes that a reference in its text form (`@any label:hand_l type:control`) finds in what is built so far, in
    /// order; `@this` is the first joint. `rig` is the document that the builder follows.
    ///
    /// # Errors
    /// See [`FindError`].
    pub fn find(&self, rig: &Rig, text: &str) -> Result<Vec<Uid>, FindError> {
        let references = NodeRefs::parse(text, rig)?;
        self.find_all(*self.world.joints.first().ok_or(FindError::Empty)?, text, &references)
    }

    /// Nodes that a reference finds for a tag of a joint, which is `@this`: see [`find`](Self::find).
    ///
    /// # Errors
    /// See [`FindError`].
    pub fn find_from(&self, rig: &Rig, joint: Uid, text: &str) -> Result<Vec<Uid>, FindError> {
        let references = NodeRefs::parse(text, rig)?;
        self.find_all(self.world.id(joint).ok_or(FindError::Empty)?, text, &references)
    }

    /// Name of a node that is built so far, for people.
    pub fn name_of(&self, node: Uid) -> Option<String> {
        let (node, place) = (self.world.id(node)?, self.cursor() as u32);
        self.world.exists(node, place).then(|| self.world.name(node, place))
    }

    fn find_all(&self, joint: NodeId, text: &str, references: &NodeRefs) -> Result<Vec<Uid>, FindError> {
        let asker = Asker { rig: self.rig, joint, place: self.cursor() as u32 };
        let found = resolve::resolve(&self.world, asker, references)?;
        match found.gaps.into_iter().next() {
            Some(gap) if found.nodes.is_empty() => Err(FindError::Off { text: text.to_owned(), off: gap.off }),
            _ => Ok(found.nodes.into_iter().map(|node| self.world.uid(node)).collect()),
        }
    }

    /// Exclusion of the joint with that label, or of the command that makes nodes under that name; `None` if neither is
    /// excluded, or nothing is called so.
    pub fn off_named(&self, name: &str) -> Option<Exclusion> {
        let off = &self.world.off;
        let of_joint =
            off.joints.values().find(|joint| matches!(&joint.off, Exclusion::Joint { joint, .. } if **joint == *name));
        if let Some(joint) = of_joint {
            return Some(joint.off.clone());
        }
        // Of several nodes of a command, those after the first have a number.
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit()).strip_suffix('_').unwrap_or(name);
        let is_named = |number: &&u32| {
            let params = &self.commands[**number as usize].params;
            given_names(params).any(|given| given == name || given == stem)
        };
        let found = self.list.iter().filter(|number| off.commands.contains_key(*number)).find(is_named)?;
        off.commands.get(found).map(|command| command.reason.off().clone())
    }

    /// Names for which [`off_named`](Self::off_named) finds an exclusion: labels of joints, and names that commands give to
    /// their nodes.
    pub fn names_off(&self) -> BTreeSet<String> {
        let off = &self.world.off;
        let labels = off.joints.values().filter_map(|joint| match &joint.off {
            Exclusion::Joint { joint, .. } => Some(joint.to_string()),
            _ => None,
        });
        let commands = self.list.iter().filter(|number| off.commands.contains_key(*number));
        let given = commands.flat_map(|number| given_names(&self.commands[*number as usize].params));
        labels.chain(given).filter(|name| !name.is_empty()).collect()
    }
}
