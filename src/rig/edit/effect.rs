//! Effects of edits, by which others decide whether an edit concerns them.

use super::RigEdit;
use crate::rig::Uid;

impl RigEdit {
    /// True if the edit puts a tag into the rig.
    pub fn adds_tag(&self, tag: Uid) -> bool {
        match self {
            Self::AddJoint { joint, .. } => joint.tags.iter().any(|known| known.uid == tag),
            Self::AddTag { tag: added, .. } => added.uid == tag,
            Self::Batch(edits) => edits.iter().any(|edit| edit.adds_tag(tag)),
            _ => false,
        }
    }

    /// True if the edit changes nothing but pose, attribute values, stored poses or clips, which no command reads.
    pub fn is_of_motion(&self) -> bool {
        match self {
            Self::SetOffset(..) | Self::SetAttributeValue(..) => true,
            Self::AddStoredPose(..) | Self::RemoveStoredPose(..) | Self::SetStoredPose(..) => true,
            Self::AddClip(..) | Self::RemoveClip(..) | Self::SetClipAbout(..) => true,
            Self::AddLayer { .. } | Self::RemoveLayer { .. } | Self::SetLayer { .. } | Self::SetKeys { .. } => true,
            Self::Batch(edits) => edits.iter().all(Self::is_of_motion),
            _ => false,
        }
    }
}
