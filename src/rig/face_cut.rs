//! Cuts of faces: the choices from which the bones of a mesh's face are placed again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::rig::{Rig, RigEdit, Uid};

/// Density and grouping of a mesh's face as a person chose them. A mesh without a cut has the defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaceCut {
    /// Number of bones of the facial skin: the density.
    pub bones: u32,
    /// Number of groups at which the depths of the head are cut; found from the mesh if `None`.
    #[serde(default)]
    pub groups: Option<u32>,
}

impl Rig {
    /// Cuts of faces by mesh.
    pub fn face_cuts(&self) -> &BTreeMap<Uid, FaceCut> {
        &self.face_cuts
    }

    /// The cut of a mesh's face; `None` for the defaults.
    pub fn face_cut(&self, mesh: Uid) -> Option<FaceCut> {
        self.face_cuts.get(&mesh).copied()
    }

    pub(super) fn set_face_cut(&mut self, mesh: Uid, cut: Option<FaceCut>) -> RigEdit {
        let before = match cut {
            Some(cut) => self.face_cuts.insert(mesh, cut),
            None => self.face_cuts.remove(&mesh),
        };
        RigEdit::SetFaceCut(mesh, before)
    }
}
