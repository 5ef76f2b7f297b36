//! Edits of the tags of one joint.

use super::tag_params::checked;
use crate::rig::{EditError, Rig, RigEdit, TagData, Uid};

impl Rig {
    pub(super) fn add_tag(&mut self, joint: Uid, tag: &TagData, index: usize) -> Result<RigEdit, EditError> {
        self.check_free(tag.uid)?;
        let added = checked(tag)?;
        let tags = &mut self.joint_mut(joint)?.data.tags;
        let place = index.min(tags.len());
        tags.insert(place, added);
        self.tags.insert(tag.uid, joint);
        self.tag_places.note(tag.uid, place);
        Ok(RigEdit::RemoveTag(joint, tag.uid))
    }

    pub(super) fn remove_tag(&mut self, joint: Uid, tag: Uid) -> Result<RigEdit, EditError> {
        let index = self.place_of_tag(joint, tag)?;
        let removed = Box::new(self.joint_mut(joint)?.data.tags.remove(index));
        self.tags.remove(&tag);
        self.tag_places.forget(tag);
        Ok(RigEdit::AddTag { joint, tag: removed, index })
    }

    pub(super) fn set_tag(&mut self, joint: Uid, tag: &TagData) -> Result<RigEdit, EditError> {
        let next = checked(tag)?;
        let place = self.place_of_tag(joint, tag.uid)?;
        let old = self.joint_mut(joint)?.data.tags.get_mut(place).ok_or(EditError::NoTag(joint, tag.uid))?;
        Ok(RigEdit::SetTag(joint, Box::new(std::mem::replace(old, next))))
    }

    /// Moves a tag to a place among the tags of a joint.
    pub(super) fn move_tag(&mut self, tag: Uid, joint: Uid, index: usize) -> Result<RigEdit, EditError> {
        let from = self.tags.get(&tag).copied().ok_or(EditError::NoTag(joint, tag))?;
        if !self.joints.contains_key(&joint) {
            return Err(EditError::NoJoint(joint));
        }
        let place = self.place_of_tag(from, tag)?;
        let moved = self.joint_mut(from)?.data.tags.remove(place);
        let tags = &mut self.joint_mut(joint)?.data.tags;
        let next = index.min(tags.len());
        tags.insert(next, moved);
        self.tags.insert(tag, joint);
        self.tag_places.note(tag, next);
        Ok(RigEdit::MoveTag { tag, joint: from, index: place })
    }

    fn place_of_tag(&self, joint: Uid, tag: Uid) -> Result<usize, EditError> {
        if !self.joints.contains_key(&joint) {
            return Err(EditError::NoJoint(joint));
        }
        self.tag_place(joint, tag).ok_or(EditError::NoTag(joint, tag))
    }
}
