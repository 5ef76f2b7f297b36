//! Groups, inputs and stored poses in a text.

use super::{
    super::write::{group_text, input_text, pose_text},
    Rewriter,
};
use crate::rig::Uid;

impl Rewriter<'_, '_> {
    pub(super) fn groups(&mut self) {
        let rig = self.rig;
        for declared in &self.declared.groups {
            let (Some(old), Some(new)) = (self.before.group(declared.uid), rig.group(declared.uid)) else { continue };
            self.keep_uid(declared.node, declared, ["group", &new.name]);
            self.set_text(declared.node, "name", &old.name, &new.name);
            self.patch.set_numbers(declared.node, "color", &old.color, &new.color);
            if old.enabled != new.enabled {
                self.patch.set_or_remove(declared.node, "enabled", (!new.enabled).then_some("false"));
            }
        }
        let wanted: Vec<Uid> = rig.groups().iter().map(|group| group.uid).collect();
        let text = |uid: Uid| rig.group(uid).map(group_text).unwrap_or_default();
        self.patch.list(self.tree().root(), "groups", &self.declared.groups, &wanted, None, text);
    }

    pub(super) fn inputs(&mut self) {
        let rig = self.rig;
        for declared in &self.declared.inputs {
            let (Some(old), Some(new)) = (self.before.input(declared.uid), rig.input(declared.uid)) else { continue };
            self.keep_uid(declared.node, declared, ["input", &new.name]);
            self.set_text(declared.node, "name", &old.name, &new.name);
            self.rest(declared.node, &old.rest, &new.rest);
        }
        let wanted: Vec<Uid> = rig.inputs().iter().map(|input| input.uid).collect();
        let text = |uid: Uid| rig.input(uid).map(input_text).unwrap_or_default();
        self.patch.list(self.tree().root(), "inputs", &self.declared.inputs, &wanted, None, text);
    }

    pub(super) fn poses(&mut self) {
        let rig = self.rig;
        for declared in &self.declared.poses {
            let (old, new) = (self.before.stored_pose(declared.uid), rig.stored_pose(declared.uid));
            let (Some(old), Some(new)) = (old, new) else { continue };
            if old.offsets != new.offsets || old.values != new.values {
                self.patch.replace(declared.node, &pose_text(new));
                continue;
            }
            self.keep_uid(declared.node, declared, ["pose", &new.name]);
            self.set_text(declared.node, "name", &old.name, &new.name);
        }
        let wanted: Vec<Uid> = rig.stored_poses().iter().map(|pose| pose.uid).collect();
        let text = |uid: Uid| rig.stored_pose(uid).map(pose_text).unwrap_or_default();
        self.patch.list(self.tree().root(), "poses", &self.declared.poses, &wanted, None, text);
    }
}
