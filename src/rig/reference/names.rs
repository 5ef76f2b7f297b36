//! Look-up of names for uids and of uids for names, for writing and reading references.

use std::{borrow::Cow, fmt};

use super::{
    GroupScope, RigNameIndex, RigScope,
    params::{self, text_field},
};
use crate::rig::{Rig, RigJoint, TagData, TagKind, Uid};

/// Kind of object that a uid of a reference stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum NameKind {
    /// A rig, by its name.
    Rig,
    /// A local group, by its name.
    Group,
    /// A joint, by its label.
    Joint,
    /// The joint or command that bears a label, by that label.
    Label,
    /// A command tag, by its module, and the label of its joint after a `/` where that is needed. The name that the command
    /// gives may stand in place of the label or, after another `/`, behind it.
    Command,
    /// A declared input, by its name.
    Input,
}

impl fmt::Display for NameKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rig => "rig",
            Self::Group => "local group",
            Self::Joint => "joint",
            Self::Label => "node label",
            Self::Command => "command",
            Self::Input => "input",
        })
    }
}

/// Scope of a look-up by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NameScope {
    /// The rig.
    pub rig: RigScope,
    /// The local group that the reference names; it decides between several bearers of one label.
    pub group: GroupScope,
}

/// Look-up of names and uids.
pub trait Names {
    /// The current name of an object; `None` if it does not exist or has no name.
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>>;

    /// The names by which an object can be found, as far as no other has them, the usual one first.
    fn names_of(&self, kind: NameKind, uid: Uid) -> Vec<String> {
        self.name_of(kind, uid).into_iter().map(Cow::into_owned).collect()
    }

    /// Uids of the objects with a name, in the order of the document.
    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid>;

    /// Names of a kind, for the nearest matches in errors.
    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>>;
}

impl Names for Rig {
    fn names_of(&self, kind: NameKind, uid: Uid) -> Vec<String> {
        let mut list: Vec<String> = self.name_of(kind, uid).into_iter().map(Cow::into_owned).collect();
        if kind == NameKind::Command
            && let Some((joint, tag)) = self.find_tag(uid)
            && let (Some(module), Some(given)) = (module(tag), given_name(tag))
        {
            list.push(format!("{module}/{given}"));
            list.extend(joint.data.label.as_ref().map(|label| format!("{module}/{label}/{given}")));
        }
        list
    }

    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        match kind {
            NameKind::Rig => (self.uid() == uid).then(|| Cow::Borrowed(self.about().name.as_str())),
            NameKind::Group => self.group(uid).map(|group| Cow::Borrowed(group.name.as_str())),
            NameKind::Input => self.input(uid).map(|input| Cow::Borrowed(input.name.as_str())),
            NameKind::Joint => self.joint(uid)?.data.label.as_deref().map(Cow::Borrowed),
            NameKind::Label => label_text(self, uid),
            NameKind::Command => {
                let (joint, tag) = self.find_tag(uid)?;
                command_name(joint, tag)
            }
        }
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        match kind {
            NameKind::Rig => (self.about().name == name).then_some(self.uid()).into_iter().collect(),
            NameKind::Group => self.groups().iter().filter(|group| group.name == name).map(|group| group.uid).collect(),
            NameKind::Input => self.inputs().iter().filter(|input| input.name == name).map(|input| input.uid).collect(),
            NameKind::Joint | NameKind::Label | NameKind::Command => RigNameIndex::new(self).find(scope, kind, name),
        }
    }

    fn all(&self, _scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        let labels = || self.walk().filter_map(|joint| joint.data.label.as_deref()).map(Cow::Borrowed);
        match kind {
            NameKind::Rig => vec![Cow::Borrowed(self.about().name.as_str())],
            NameKind::Group => self.groups().iter().map(|group| Cow::Borrowed(group.name.as_str())).collect(),
            NameKind::Input => self.inputs().iter().map(|input| Cow::Borrowed(input.name.as_str())).collect(),
            NameKind::Joint => labels().collect(),
            NameKind::Label => labels().chain(commands(self).filter_map(|(_, tag)| given_label(tag))).collect(),
            NameKind::Command => commands(self)
                .flat_map(|(joint, tag)| command_name(joint, tag).into_iter().chain(command_by_given_name(tag)))
                .collect(),
        }
    }
}

/// Names in several rigs: the rig of the tag first.
#[derive(Debug, Clone, Copy)]
pub struct RigNames<'a> {
    /// The rig that holds the tags.
    pub own: &'a Rig,
    /// Other rigs that references may refer to.
    pub others: &'a [&'a Rig],
}

impl<'a> RigNames<'a> {
    fn rigs(self) -> impl Iterator<Item = &'a Rig> {
        std::iter::once(self.own).chain(self.others.iter().copied())
    }

    fn scope(self, scope: NameScope) -> Option<&'a Rig> {
        match scope.rig {
            RigScope::Own => Some(self.own),
            RigScope::Rig(uid) => self.rigs().find(|rig| rig.uid() == uid),
        }
    }
}

impl Names for RigNames<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.rigs().find_map(|rig| rig.name_of(kind, uid))
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        match kind {
            NameKind::Rig => self.rigs().flat_map(|rig| rig.find(scope, kind, name)).collect(),
            _ => self.scope(scope).map(|rig| rig.find(scope, kind, name)).unwrap_or_default(),
        }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        match kind {
            NameKind::Rig => self.rigs().flat_map(|rig| rig.all(scope, kind)).collect(),
            _ => self.scope(scope).map(|rig| rig.all(scope, kind)).unwrap_or_default(),
        }
    }
}

/// The label that a joint has, or that a command tag gives its nodes; `None` without one.
///
/// A command gives a label if its parameters have a field `label` that is a text and not empty, at most one bracket
/// deep (`creation: (label: "elbow")`). The nodes of a command without one have the label of its joint.
pub fn label_text(rig: &Rig, bearer: Uid) -> Option<Cow<'_, str>> {
    match rig.joint(bearer) {
        Some(joint) => joint.data.label.as_deref().map(Cow::Borrowed),
        None => {
            let (joint, tag) = rig.find_tag(bearer)?;
            match tag.kind {
                TagKind::Command { .. } => given_label(tag).or_else(|| joint.data.label.as_deref().map(Cow::Borrowed)),
                TagKind::Feature { .. } => None,
            }
        }
    }
}

/// Name that a command gives its nodes, or what else it makes.
pub(super) fn given_name(tag: &TagData) -> Option<String> {
    let TagKind::Command { params, .. } = &tag.kind else { return None };
    params::given_name(params)
}

pub(super) fn commands(rig: &Rig) -> impl Iterator<Item = (&RigJoint, &TagData)> {
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(move |tag| (joint, tag)));
    tags.filter(|(_, tag)| matches!(tag.kind, TagKind::Command { .. }))
}

pub(super) fn module(tag: &TagData) -> Option<&str> {
    match &tag.kind {
        TagKind::Command { module, .. } => Some(module),
        TagKind::Feature { .. } => None,
    }
}

fn command_name<'a>(joint: &'a RigJoint, tag: &'a TagData) -> Option<Cow<'a, str>> {
    let module = module(tag)?;
    Some(match &joint.data.label {
        Some(label) => Cow::Owned(format!("{module}/{label}")),
        None => Cow::Borrowed(module),
    })
}

/// Name of a command by that which it gives its nodes.
fn command_by_given_name(tag: &TagData) -> Option<Cow<'static, str>> {
    // The module of a name ends at the first `/`.
    let module = module(tag).filter(|module| !module.contains('/'))?;
    Some(Cow::Owned(format!("{module}/{}", given_name(tag)?)))
}

pub(super) fn given_label(tag: &TagData) -> Option<Cow<'_, str>> {
    let TagKind::Command { params, .. } = &tag.kind else { return None };
    if !params.contains("label") {
        return None;
    }
    let text = text_field(params, "label")?;
    (!text.is_empty()).then_some(Cow::Owned(text))
}
