//! Names of joints while an operation changes nothing but tags: they are listed once, however many tags it brings.

use std::{borrow::Cow, cell::OnceCell, collections::HashMap};

use crate::rig::{
    Rig, Uid,
    reference::{GroupScope, NameKind, NameScope, Names, RigNameIndex},
};

/// Joint with a label: its local group and uid.
type Bearer = (Option<Uid>, Uid);

/// Joints by their labels, listed when a name is first looked up.
#[derive(Default)]
pub(super) struct SteadyNames {
    joints: OnceCell<HashMap<String, Vec<Bearer>>>,
}

impl SteadyNames {
    /// Names of a rig that differs in nothing but tags from the one of the first look-up.
    pub(super) fn of<'a>(&'a self, rig: &'a Rig) -> TagNames<'a> {
        TagNames { rig, steady: self }
    }

    fn bearers(&self, rig: &Rig, label: &str) -> &[Bearer] {
        let joints = self.joints.get_or_init(|| {
            let mut joints: HashMap<String, Vec<Bearer>> = HashMap::new();
            for joint in rig.walk() {
                if let Some(label) = joint.data.label.clone() {
                    joints.entry(label).or_default().push((joint.data.group, joint.data.uid));
                }
            }
            joints
        });
        joints.get(label).map_or(&[], Vec::as_slice)
    }
}

/// Names of a rig, of which those of joints are listed already.
pub(super) struct TagNames<'a> {
    rig: &'a Rig,
    steady: &'a SteadyNames,
}

impl Names for TagNames<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.rig.name_of(kind, uid)
    }

    fn names_of(&self, kind: NameKind, uid: Uid) -> Vec<String> {
        self.rig.names_of(kind, uid)
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        let bearers = || self.steady.bearers(self.rig, name).iter();
        // Joints come before the commands that give a label.
        let bearer = || match scope.group {
            GroupScope::Group(group) => bearers().find(|(own, _)| *own == Some(group)),
            GroupScope::Any | GroupScope::Own => bearers().next(),
        };
        match kind {
            NameKind::Joint => bearers().map(|(_, joint)| *joint).collect(),
            NameKind::Label if let Some((_, joint)) = bearer() => vec![*joint],
            NameKind::Label | NameKind::Command => RigNameIndex::new(self.rig).find(scope, kind, name),
            NameKind::Rig | NameKind::Group | NameKind::Input => self.rig.find(scope, kind, name),
        }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        self.rig.all(scope, kind)
    }
}
