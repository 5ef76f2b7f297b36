//! Edits of the weights of meshes: all of a mesh at once, or those of some points.

use std::sync::Arc;

use super::{EditError, RigEdit, WeightPatch};
use crate::{
    mesh::model::Weights,
    rig::{Rig, SkinData, Uid},
};

impl Rig {
    pub(super) fn set_skin(&mut self, mesh: Uid, skin: Option<&Arc<SkinData>>) -> Result<RigEdit, EditError> {
        if let Some(skin) = skin {
            // Joints deleted after skinning stay in the list: undoing the deletion brings their weights back.
            let beyond = skin.weights.joints.iter().filter(|j| **j as usize >= skin.joints.len()).count();
            if beyond > 0 {
                return Err(EditError::BadSkin(beyond));
            }
            if !is_whole(&skin.weights) {
                return Err(EditError::BadWeights);
            }
        }
        let old = match skin {
            Some(skin) => self.skins.insert(mesh, skin.clone()),
            None => self.skins.remove(&mesh),
        };
        Ok(RigEdit::SetSkin(mesh, old))
    }

    pub(super) fn set_weights(&mut self, mesh: Uid, patch: &WeightPatch) -> Result<RigEdit, EditError> {
        let skin = self.skins.get(&mesh).ok_or(EditError::NoSkin(mesh))?;
        patch.check(skin).map_err(|fault| EditError::BadPatch(mesh, fault))?;
        let (next, inverse) = (patch.applied(skin), patch.inverse(skin));
        // Others hold the weights from before and tell by the address that these are others.
        self.skins.insert(mesh, Arc::new(next));
        Ok(RigEdit::SetWeights(mesh, Box::new(inverse)))
    }
}

/// True for weights whose lists fit together and whose numbers are finite.
pub(super) fn is_whole(weights: &Weights) -> bool {
    let rising = weights.starts.is_sorted() && weights.starts.first().is_none_or(|first| *first == 0);
    let ends = weights.starts.last().map_or(0, |last| *last as usize);
    rising
        && ends == weights.joints.len()
        && ends == weights.values.len()
        // Counting is several times as fast as searching, and there may be millions of weights.
        && weights.values.iter().filter(|w| !w.is_finite()).count() == 0
}
