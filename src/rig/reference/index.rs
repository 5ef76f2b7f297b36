//! Index of the names in a rig, for many look-ups while the rig stays as it is.

use std::{
    borrow::Cow,
    cell::{Cell, OnceCell},
    collections::HashMap,
};

use super::{
    GroupScope, NameKind, NameScope, Names,
    names::{commands, given_label, given_name, module},
};
use crate::rig::{Rig, Uid};

/// Number of names that are compared with unknown ones for suggestions, by one index: each unknown name is compared with all.
pub const MOST_COMPARED: usize = 200_000;

/// Names of a rig, sorted when one is first looked up: [`Names`] of the rig itself walk through it for each name. An index
/// that has listed [`MOST_COMPARED`] names for suggestions lists none any more, so that thousands of unknown names cost no more
/// than a few.
pub struct RigNameIndex<'a> {
    rig: &'a Rig,
    groups: OnceCell<HashMap<&'a str, Vec<Uid>>>,
    inputs: OnceCell<HashMap<&'a str, Vec<Uid>>>,
    joints: OnceCell<HashMap<String, Vec<Uid>>>,
    bearers: OnceCell<HashMap<String, Vec<(Option<Uid>, Uid)>>>,
    commands: OnceCell<CommandNames>,
    /// Number of names that were listed for suggestions.
    compared: Cell<usize>,
}

/// Commands by their names.
#[derive(Default)]
struct CommandNames {
    /// Commands by module, and by module and label of the joint.
    by_joint: HashMap<String, Vec<Uid>>,
    /// Commands by module and the name that the command gives, with the label of the joint between and without.
    by_given: HashMap<String, Vec<Uid>>,
}

impl<'a> RigNameIndex<'a> {
    /// Index of a rig.
    pub fn new(rig: &'a Rig) -> Self {
        let (groups, inputs) = (OnceCell::new(), OnceCell::new());
        let (joints, bearers, commands) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Self { rig, groups, inputs, joints, bearers, commands, compared: Cell::new(0) }
    }

    fn groups(&self, name: &str) -> &[Uid] {
        let named = || by_name(self.rig.groups().iter().map(|group| (group.name.as_str(), group.uid)));
        self.groups.get_or_init(named).get(name).map_or(&[], Vec::as_slice)
    }

    fn inputs(&self, name: &str) -> &[Uid] {
        let named = || by_name(self.rig.inputs().iter().map(|input| (input.name.as_str(), input.uid)));
        self.inputs.get_or_init(named).get(name).map_or(&[], Vec::as_slice)
    }

    fn joints(&self, label: &str) -> &[Uid] {
        let joints = self.joints.get_or_init(|| {
            let mut joints: HashMap<String, Vec<Uid>> = HashMap::new();
            for joint in self.rig.walk() {
                if let Some(label) = joint.data.label.clone() {
                    joints.entry(label).or_default().push(joint.data.uid);
                }
            }
            joints
        });
        joints.get(label).map_or(&[], Vec::as_slice)
    }

    /// The first bearer of a label, in the group if one is named; joints before commands.
    fn bearer(&self, group: GroupScope, label: &str) -> Option<Uid> {
        let bearers = self.bearers.get_or_init(|| {
            let mut bearers: HashMap<String, Vec<(Option<Uid>, Uid)>> = HashMap::new();
            for joint in self.rig.walk() {
                if let Some(label) = joint.data.label.clone() {
                    bearers.entry(label).or_default().push((joint.data.group, joint.data.uid));
                }
            }
            for (joint, tag) in commands(self.rig) {
                if let Some(label) = given_label(tag) {
                    bearers.entry(label.into_owned()).or_default().push((joint.data.group, tag.uid));
                }
            }
            bearers
        });
        let all = bearers.get(label)?;
        let in_group = |(own, _): &&(Option<Uid>, Uid)| match group {
            GroupScope::Group(group) => *own == Some(group),
            _ => true,
        };
        all.iter().find(in_group).or(all.first()).map(|(_, uid)| *uid)
    }

    fn commands(&self, name: &str) -> Vec<Uid> {
        let names = self.commands.get_or_init(|| {
            let mut names = CommandNames::default();
            for (joint, tag) in commands(self.rig) {
                let Some(module) = module(tag) else { continue };
                let label = joint.data.label.as_deref();
                names.by_joint.entry(module.to_owned()).or_default().push(tag.uid);
                if let Some(label) = label {
                    names.by_joint.entry(format!("{module}/{label}")).or_default().push(tag.uid);
                }
                // The module of a name ends at the first `/`.
                if let Some(given) = given_name(tag).filter(|_| !module.contains('/')) {
                    names.by_given.entry(format!("{module}/{given}")).or_default().push(tag.uid);
                    if let Some(label) = label {
                        names.by_given.entry(format!("{module}/{label}/{given}")).or_default().push(tag.uid);
                    }
                }
            }
            names
        });
        let found = names.by_joint.get(name).map_or(&[][..], Vec::as_slice);
        let given = names.by_given.get(name).filter(|_| found.len() != 1).map_or(&[][..], Vec::as_slice);
        if given.len() == 1 || found.is_empty() { given.to_vec() } else { found.to_vec() }
    }
}

/// Uids by name, in their order.
fn by_name<'a>(named: impl Iterator<Item = (&'a str, Uid)>) -> HashMap<&'a str, Vec<Uid>> {
    let mut found: HashMap<&str, Vec<Uid>> = HashMap::new();
    for (name, uid) in named {
        found.entry(name).or_default().push(uid);
    }
    found
}

impl Names for RigNameIndex<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.rig.name_of(kind, uid)
    }

    fn names_of(&self, kind: NameKind, uid: Uid) -> Vec<String> {
        self.rig.names_of(kind, uid)
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        match kind {
            NameKind::Joint => self.joints(name).to_vec(),
            NameKind::Label => self.bearer(scope.group, name).into_iter().collect(),
            NameKind::Command => self.commands(name),
            NameKind::Group => self.groups(name).to_vec(),
            NameKind::Input => self.inputs(name).to_vec(),
            NameKind::Rig => self.rig.find(scope, kind, name),
        }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        if self.compared.get() >= MOST_COMPARED {
            return Vec::new();
        }
        let all = self.rig.all(scope, kind);
        self.compared.set(self.compared.get() + all.len());
        all
    }
}
