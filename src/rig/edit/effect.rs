//! Effects of edits: the joints and tags that an edit adds, the meshes that come and go, the size of its weights, and
//! whether it concerns motion alone.

use std::collections::{BTreeMap, HashSet};

use super::RigEdit;
use crate::rig::Uid;

/// Bytes of an influence of weights: its joint and its share.
const INFLUENCE: usize = 8;
/// Bytes of a point of weights.
const POINT: usize = 4;

impl RigEdit {
    /// Uids of the joints and tags that the edit puts into the rig, added to `uids`.
    pub fn added(&self, uids: &mut HashSet<Uid>) {
        match self {
            Self::AddJoint { joint, .. } => {
                uids.insert(joint.uid);
                uids.extend(joint.tags.iter().map(|tag| tag.uid));
            }
            Self::AddTag { tag, .. } => {
                uids.insert(tag.uid);
            }
            Self::Batch(edits) => edits.iter().for_each(|edit| edit.added(uids)),
            _ => {}
        }
    }

    /// Meshes that the edit has come to the rig (`true`) or leave it, put into `meshes` in place of what that says of them.
    pub fn mesh_changes(&self, meshes: &mut BTreeMap<Uid, bool>) {
        match self {
            Self::AddMesh(mesh) => {
                meshes.insert(*mesh, true);
            }
            Self::RemoveMesh(mesh) => {
                meshes.insert(*mesh, false);
            }
            Self::Batch(edits) => edits.iter().for_each(|edit| edit.mesh_changes(meshes)),
            _ => {}
        }
    }

    /// Bytes of the weights that the edit gives to meshes: what makes an edit heavy.
    pub fn weight_bytes(&self) -> usize {
        match self {
            Self::SetSkin(_, Some(skin)) => INFLUENCE * skin.weights.joints.len() + POINT * skin.weights.starts.len(),
            Self::SetWeights(_, patch) => {
                INFLUENCE * patch.rows.joints.len() + POINT * (patch.rows.starts.len() + patch.points.len())
            }
            Self::Batch(edits) => edits.iter().map(Self::weight_bytes).sum(),
            _ => 0,
        }
    }

    /// True if the edit changes nothing but pose, attribute values, stored poses, clips, selection sets, cuts of faces or
    /// meshes, which no command reads.
    pub fn is_of_motion(&self) -> bool {
        match self {
            Self::SetOffset(..) | Self::SetAttributeValue(..) => true,
            Self::AddStoredPose(..) | Self::RemoveStoredPose(..) | Self::SetStoredPose(..) => true,
            Self::AddClip(..) | Self::RemoveClip(..) | Self::SetClipAbout(..) => true,
            Self::AddLayer { .. } | Self::RemoveLayer { .. } | Self::SetLayer { .. } | Self::SetKeys { .. } => true,
            Self::SetSelectionSets(..) | Self::SetFaceCut(..) | Self::ExchangeNodes(..) => true,
            Self::AddMesh(..) | Self::RemoveMesh(..) => true,
            Self::Batch(edits) => edits.iter().all(Self::is_of_motion),
            _ => false,
        }
    }
}
