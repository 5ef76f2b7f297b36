//! Nodes of what is built, found by references in their text form.

use super::{
    super::resolve::{self, Asker},
    Builder,
};
use crate::rig::{
    Rig, Uid,
    reference::{NodeRefs, ReferenceError},
};

/// The reason why a reference finds no nodes in what is built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FindError {
    /// The text is no reference, or names something that is not there.
    #[error(transparent)]
    Text(#[from] ReferenceError),
    /// The reference means something that is not built.
    #[error("{0}")]
    Meaning(String),
    /// There is no joint that could ask.
    #[error("the rig has no joints, so references find nothing")]
    Empty,
}

impl Builder {
    /// The nodes that a reference in its text form (`@label hand_l type:control`) finds in what is built so far, in
    /// order; `@this` is the first joint. `rig` is the document that the builder follows.
    ///
    /// # Errors
    /// See [`FindError`].
    pub fn find(&self, rig: &Rig, text: &str) -> Result<Vec<Uid>, FindError> {
        let references = NodeRefs::parse(text, rig)?;
        let joint = *self.world.joints.first().ok_or(FindError::Empty)?;
        let asker = Asker { rig: self.rig, joint, place: self.cursor() as u32 };
        let found =
            resolve::resolve(&self.world, asker, &references).map_err(|error| FindError::Meaning(error.to_string()))?;
        Ok(found.into_iter().map(|node| self.world.uid(node)).collect())
    }
}
