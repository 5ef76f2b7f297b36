//! Differences of part instances from their parts.

use std::{borrow::Cow, collections::HashMap};

use bevy::math::Quat;

use super::{PartError, PartInstance, PartTargets, instance::set_tag};
use crate::rig::{
    EditError, Rig, RigEdit, TagData, TagKind, Uid,
    format::tree::{Tree, with_field},
    operations::Draft,
    reference::{NameKind, NameScope, Names, RigNameIndex, bind_known_names, given_name, map_references},
};

/// A difference of an instance from its part: of a joint or of a tag.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartChange {
    /// Label of a joint of the part, or its uid there.
    pub joint: Option<String>,
    /// A tag of the part: `module/name`, `module/label of its joint`, or its uid; where several are called so, with the
    /// number of one behind it, as in `point/hand_l#2`.
    pub tag: Option<String>,
    /// Turns the tag on or off.
    pub enabled: Option<bool>,
    /// Parameters of the tag that have another value, as RON: `(size: 2.0)`.
    pub params: Option<String>,
    /// Parameters of the tag that have their default here.
    pub unset: Vec<String>,
    /// Another note of the tag.
    pub comment: Option<String>,
    /// True for a tag that the instance does not have.
    pub removed: bool,
    /// Another label of the joint, in full: with no prefix but its own.
    pub label: Option<String>,
    /// Locks the joint's weights, or unlocks them.
    pub locked: Option<bool>,
    /// Another place of the joint.
    pub translation: Option<[f32; 3]>,
    /// Another rotation of the joint.
    pub rotation: Option<Quat>,
    /// Other scale factors of the joint.
    pub scale: Option<[f32; 3]>,
    /// Tags that the joint has beyond those of the part, with their uids in the rig.
    pub tags: Vec<TagData>,
}

/// A part that an instance changes, with what all of its changes look up.
pub(super) struct ChangedPart<'a> {
    part: &'a Rig,
    /// Names in the part.
    names: RigNameIndex<'a>,
    targets: PartTargets<'a>,
    /// Joints of the rig, in the order of those of the part that are there.
    joints: &'a [Uid],
    /// Joints of the rig onto which joints of the part went.
    places: HashMap<Uid, Uid>,
}

impl<'a> ChangedPart<'a> {
    /// A fitted part, whose joints are these in the rig.
    pub fn new(instance: &'a PartInstance, part: &'a Rig, joints: &'a [Uid]) -> Self {
        let places = part.walk().map(|joint| joint.data.uid).zip(joints.iter().copied()).collect();
        let (names, targets) = (RigNameIndex::new(part), PartTargets::new(instance, part));
        Self { part, names, targets, joints, places }
    }
}

impl PartInstance {
    /// Makes a change of the part, which is in the rig.
    pub(super) fn change(
        &self,
        draft: &mut Draft,
        changed: &ChangedPart,
        change: &PartChange,
    ) -> Result<(), PartError> {
        if let Some(name) = &change.tag {
            let tag = self.uid_of(changed.targets.find_tag(name)?);
            if change.removed {
                return remove_tag(draft, tag);
            }
            set_tag(draft, tag, |tag| {
                tag.enabled = change.enabled.unwrap_or(tag.enabled);
                tag.comment = change.comment.clone().unwrap_or_else(|| std::mem::take(&mut tag.comment));
                if let TagKind::Command { params, .. } = &mut tag.kind
                    && !change.unset.is_empty()
                {
                    *params = without_params(params, &change.unset);
                }
            })?;
            if let Some(others) = &change.params {
                // Names are those of the part first, then those of the template, in which other parts may bring more, then those
                // that the part's file has, without the prefix.
                let names = PartNames { changed, host: draft.rig(), instance: self };
                let others = &map_references(&bind_known_names(others, &names), |reference| {
                    for (_, uid) in reference.uids_mut() {
                        *uid = names.uid_here(*uid);
                    }
                });
                set_tag(draft, tag, |tag| {
                    if let TagKind::Command { params, .. } = &mut tag.kind {
                        *params = with_params(params, others);
                    }
                })?;
            }
        }
        let Some(label) = &change.joint else { return Ok(()) };
        let place = changed.targets.find_joint(label)?;
        let Some(joint) = changed.joints.get(place).copied() else {
            return Err(PartError::UnusedJoint { label: label.clone() });
        };
        Ok(self.change_joint(draft, joint, change)?)
    }

    fn change_joint(&self, draft: &mut Draft, joint: Uid, change: &PartChange) -> Result<(), EditError> {
        if let Some(mut rest) = draft.rig().joint(joint).map(|joint| joint.data.rest) {
            rest.translation = change.translation.map_or(rest.translation, Into::into);
            rest.rotation = change.rotation.unwrap_or(rest.rotation);
            rest.scale = change.scale.map_or(rest.scale, Into::into);
            draft.apply(RigEdit::SetRest(joint, rest))?;
        }
        if let Some(label) = &change.label {
            draft.apply(RigEdit::SetLabel(joint, Some(label.clone())))?;
        }
        if let Some(locked) = change.locked {
            draft.apply(RigEdit::SetLocked(joint, locked))?;
        }
        for tag in &change.tags {
            draft.apply(RigEdit::AddTag { joint, tag: Box::new(tag.clone()), index: usize::MAX })?;
        }
        Ok(())
    }

    /// Number of the joint of the fitted part that is called so, by its label or its uid there.
    ///
    /// # Errors
    /// A label that no joint has.
    pub(in crate::rig) fn find_joint(&self, part: &Rig, label: &str) -> Result<usize, PartError> {
        PartTargets::new(self, part).find_joint(label)
    }

    /// A label by which a change means that joint of the fitted part, and no other; `None` if there is none.
    pub(in crate::rig) fn name_of_joint<'p>(&self, part: &'p Rig, place: usize) -> Option<&'p str> {
        let label = part.walk().nth(place)?.data.label.as_deref()?;
        let plain = label.strip_prefix(self.prefix.as_str());
        plain.into_iter().chain([label]).find(|name| self.find_joint(part, name) == Ok(place))
    }

    /// A name by which a change means a tag of the fitted part, and no other.
    pub(in crate::rig) fn name_of_tag(&self, part: &Rig, tag: Uid) -> String {
        let called = self.called(part);
        let of = called.iter().filter(|(name, uid)| *uid == tag && name.contains('/')).map(|(name, _)| name);
        let numbered = |name: &String| {
            let mut same: Vec<Uid> = called.iter().filter(|(known, _)| known == name).map(|(_, uid)| *uid).collect();
            same.dedup();
            match same[..] {
                [_] => Some(name.clone()),
                _ => same.iter().position(|uid| *uid == tag).map(|at| format!("{name}#{}", at + 1)),
            }
        };
        let names: Vec<String> = of.filter_map(numbered).collect();
        let plain = names.iter().find(|name| !name.contains('#')).or(names.first());
        let is_right = |name: &&String| self.find_tag(part, name) == Ok(tag);
        plain.filter(is_right).cloned().unwrap_or_else(|| tag.to_string())
    }

    /// Names of the tags of the fitted part.
    pub(super) fn called(&self, part: &Rig) -> Vec<(String, Uid)> {
        let mut called: Vec<(String, Uid)> = Vec::new();
        for joint in part.walk() {
            for tag in &joint.data.tags {
                called.push((tag.uid.to_string(), tag.uid));
                let TagKind::Command { module, params, .. } = &tag.kind else { continue };
                let plain = |name: &str| name.strip_prefix(self.prefix.as_str()).unwrap_or(name).to_owned();
                let given = given_name(params).map(|name| plain(&name));
                let label = joint.data.label.as_deref().map(plain);
                called.extend(given.into_iter().chain(label).map(|name| (format!("{module}/{name}"), tag.uid)));
            }
        }
        called
    }

    /// The tag of the fitted part that is called so.
    ///
    /// # Errors
    /// A name that no tag has, or that several have.
    pub(in crate::rig) fn find_tag(&self, part: &Rig, name: &str) -> Result<Uid, PartError> {
        PartTargets::new(self, part).find_tag(name)
    }
}

/// Names in a part, then those in the template that uses it, each for the uid that it has there.
struct PartNames<'a, 'p> {
    changed: &'a ChangedPart<'p>,
    host: &'a Rig,
    instance: &'a PartInstance,
}

impl PartNames<'_, '_> {
    /// The uid in the template of something that has this one in the part; any other uid as it is.
    fn uid_here(&self, uid: Uid) -> Uid {
        match self.changed.places.get(&uid) {
            Some(joint) => *joint,
            None if self.changed.part.is_taken(uid) => self.instance.uid_of(uid),
            None => uid,
        }
    }
}

impl Names for PartNames<'_, '_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.host.name_of(kind, uid).or_else(|| self.changed.part.name_of(kind, uid))
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        let here = |found: Vec<Uid>| found.into_iter().map(|uid| self.uid_here(uid)).collect::<Vec<Uid>>();
        let part = &self.changed.names;
        let found = part.find(scope, kind, name);
        if !found.is_empty() {
            return here(found);
        }
        let found = self.host.find(scope, kind, name);
        if !found.is_empty() {
            return found;
        }
        // As in the part's file, without the prefix of the instance.
        let prefix = &self.instance.prefix;
        match (kind, name.split_once('/')) {
            (NameKind::Command, Some((module, name))) => {
                let name = name.replace('/', &format!("/{prefix}"));
                here(part.find(scope, kind, &format!("{module}/{prefix}{name}")))
            }
            (NameKind::Joint | NameKind::Label, _) => here(part.find(scope, kind, &format!("{prefix}{name}"))),
            _ => found,
        }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        self.changed.part.all(scope, kind).into_iter().chain(self.host.all(scope, kind)).collect()
    }
}

fn remove_tag(draft: &mut Draft, tag: Uid) -> Result<(), PartError> {
    let Some((joint, _)) = draft.rig().find_tag(tag) else {
        return Err(PartError::UnusedTag { tag });
    };
    let joint = joint.data.uid;
    Ok(draft.apply(RigEdit::RemoveTag(joint, tag))?)
}

/// Parameters without some of them.
fn without_params(params: &str, unset: &[String]) -> String {
    let Some(tree) = Tree::parse(params) else { return params.to_owned() };
    let items = tree.node(tree.root()).items;
    let kept = items.iter().filter(|item| item.key.is_none_or(|key| !unset.iter().any(|name| name == key)));
    let kept: Vec<&str> = kept.map(|item| &params[item.start..tree.node(item.value).range.end]).collect();
    format!("({})", kept.join(", "))
}

/// Parameters with other values for some of them.
fn with_params(params: &str, others: &str) -> String {
    let mut out = params.to_owned();
    let Some(others) = Tree::parse(others) else { return out };
    for item in others.node(others.root()).items {
        let Some(key) = item.key else { continue };
        out = with_field(&out, key, others.written(item.value));
    }
    out
}
