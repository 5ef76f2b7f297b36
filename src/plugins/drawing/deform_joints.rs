//! Joints that deform: those that move at least one point of a mesh.

use std::{collections::BTreeSet, sync::Arc};

use crate::rig::{Rig, SkinData, Uid};

/// Joints with an influence on some mesh of a rig, in the order of their uids.
pub fn deforming_joints(rig: &Rig) -> BTreeSet<Uid> {
    let mut joints = BTreeSet::new();
    for (_, skin) in rig.skins() {
        let mut moves = vec![false; skin.joints.len()];
        for joint in &skin.weights.joints {
            if let Some(moves) = moves.get_mut(*joint as usize) {
                *moves = true;
            }
        }
        joints.extend(skin.joints.iter().zip(moves).filter(|(_, moves)| *moves).map(|(joint, _)| *joint));
    }
    joints
}

/// The joints that deform, counted again after a change of weights only.
#[derive(Debug, Default)]
pub(super) struct DeformingJoints {
    of: Vec<Arc<SkinData>>,
    joints: BTreeSet<Uid>,
}

impl DeformingJoints {
    /// The joints of a rig that deform.
    pub fn of(&mut self, rig: &Rig) -> &BTreeSet<Uid> {
        let same = self.of.len() == rig.skins().count()
            && self.of.iter().zip(rig.skins()).all(|(known, (_, skin))| Arc::ptr_eq(known, skin));
        if !same {
            self.of = rig.skins().map(|(_, skin)| skin.clone()).collect();
            self.joints = deforming_joints(rig);
        }
        &self.joints
    }
}
