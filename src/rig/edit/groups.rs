//! Edits of local groups.

use crate::rig::{EditError, GroupData, Rig, RigEdit, Uid};

impl Rig {
    pub(super) fn add_local_group(&mut self, group: &GroupData, index: usize) -> Result<RigEdit, EditError> {
        self.check_free(group.uid)?;
        check_color(group)?;
        self.groups.insert(index, group.clone());
        Ok(RigEdit::RemoveLocalGroup(group.uid))
    }

    pub(super) fn remove_local_group(&mut self, uid: Uid) -> Result<RigEdit, EditError> {
        if self.groups.has(uid) && self.has_members(uid) {
            return Err(EditError::GroupInUse(uid));
        }
        let (index, group) = self.groups.remove(uid).ok_or(EditError::NoGroup(uid))?;
        Ok(RigEdit::AddLocalGroup(group, index))
    }

    pub(super) fn set_local_group(&mut self, group: &GroupData) -> Result<RigEdit, EditError> {
        check_color(group)?;
        let old = self.groups.replace(group.clone()).ok_or(EditError::NoGroup(group.uid))?;
        Ok(RigEdit::SetLocalGroup(old))
    }

    /// Puts a joint into a local group, or takes it out of its group.
    pub(super) fn set_group(&mut self, joint: Uid, group: Option<Uid>) -> Result<RigEdit, EditError> {
        self.check_group(group)?;
        let before = std::mem::replace(&mut self.joint_mut(joint)?.data.group, group);
        self.group_members.change(before, group);
        Ok(RigEdit::SetGroup(joint, before))
    }
}

fn check_color(group: &GroupData) -> Result<(), EditError> {
    if group.color.iter().all(|part| part.is_finite()) { Ok(()) } else { Err(EditError::BadColor(group.uid)) }
}
