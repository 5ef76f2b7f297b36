//! Edits of the current pose and of stored poses.

use crate::rig::{EditError, PoseOffset, Rig, RigEdit, StoredPose, Uid};

impl Rig {
    pub(super) fn set_offset(&mut self, joint: Uid, offset: Option<PoseOffset>) -> Result<RigEdit, EditError> {
        if offset.is_some_and(|offset| !offset.is_valid()) {
            return Err(EditError::BadTransform(joint));
        }
        let old = match offset.filter(is_posed) {
            Some(offset) => self.pose.insert(joint, offset),
            None => self.pose.remove(&joint),
        };
        Ok(RigEdit::SetOffset(joint, old))
    }

    pub(super) fn set_attribute_value(
        &mut self,
        node: Uid,
        name: &str,
        value: Option<f32>,
    ) -> Result<RigEdit, EditError> {
        if value.is_some_and(|value| !value.is_finite()) {
            return Err(EditError::BadValue(node, name.to_owned()));
        }
        let old = match value {
            Some(value) => self.values.entry(node).or_default().insert(name.to_owned(), value),
            None => {
                let old = self.values.get_mut(&node).and_then(|values| values.remove(name));
                if self.values.get(&node).is_some_and(|values| values.is_empty()) {
                    self.values.remove(&node);
                }
                old
            }
        };
        Ok(RigEdit::SetAttributeValue(node, name.to_owned(), old))
    }

    pub(super) fn add_stored_pose(&mut self, pose: &StoredPose, index: usize) -> Result<RigEdit, EditError> {
        self.check_free(pose.uid)?;
        let pose = checked(pose)?;
        let uid = pose.uid;
        self.poses.insert(index, pose);
        Ok(RigEdit::RemoveStoredPose(uid))
    }

    pub(super) fn remove_stored_pose(&mut self, uid: Uid) -> Result<RigEdit, EditError> {
        let (index, pose) = self.poses.remove(uid).ok_or(EditError::NoPose(uid))?;
        Ok(RigEdit::AddStoredPose(Box::new(pose), index))
    }

    pub(super) fn set_stored_pose(&mut self, pose: &StoredPose) -> Result<RigEdit, EditError> {
        let old = self.poses.replace(checked(pose)?).ok_or(EditError::NoPose(pose.uid))?;
        Ok(RigEdit::SetStoredPose(Box::new(old)))
    }
}

fn is_posed(offset: &PoseOffset) -> bool {
    *offset != PoseOffset::IDENTITY
}

/// Pose in its stored form: without offsets that equal the rest pose.
fn checked(pose: &StoredPose) -> Result<StoredPose, EditError> {
    if let Some((joint, _)) = pose.offsets.iter().find(|(_, offset)| !offset.is_valid()) {
        return Err(EditError::BadTransform(*joint));
    }
    let values = pose.values.iter().flat_map(|(node, values)| values.iter().map(move |value| (node, value)));
    for (node, (name, value)) in values {
        if !value.is_finite() {
            return Err(EditError::BadValue(*node, name.clone()));
        }
    }
    let mut pose = pose.clone();
    pose.offsets.retain(|_, offset| is_posed(offset));
    pose.values.retain(|_, values| !values.is_empty());
    Ok(pose)
}
