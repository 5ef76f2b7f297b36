//! Part instances: parts that stay parts in a template.
//!
//! A template names a part, says where it goes and what is different about it; the part's own file says the rest. What comes of
//! it has uids that follow from those of the instance and of the part's joints and tags, so that a part can be used many times,
//! and a later version of it changes what it changes and no more: see [`update`](crate::rig::update).

use std::collections::{BTreeMap, HashMap};

use crate::rig::{
    JointData, RestTransform, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
    format::tree::Tree,
    label::mirrored_label,
    nearest::did_you_mean,
    operations::{Draft, MirrorPlane, drop_part},
    reference::{given_name, map_text_fields},
    remap::mirror_names,
};

/// A part in a template.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartInstance {
    /// Identity, from which those of what comes of it follow.
    pub uid: Uid,
    /// File of the part, relative to that of the template.
    pub part: String,
    /// The name people see; the file's without one.
    pub name: String,
    /// Labels of the joints that the part goes onto, in the order of its joints; empty to bring its own.
    pub onto: Vec<String>,
    /// Label of the joint that its own joints hang on.
    pub parent: Option<String>,
    /// Place of its own joints, below `parent`.
    pub rest: RestTransform,
    /// Text before the labels and names that the part gives.
    pub prefix: String,
    /// True for the other side of the character, x = 0 between them.
    pub mirror: bool,
    /// Features, or switches as `feature.switch`, that are off.
    pub off: Vec<String>,
    /// Differences from the part.
    pub changes: Vec<PartChange>,
    /// Place in the template's text, in bytes.
    pub offset: usize,
}

/// A difference of an instance from its part: of a joint or of a tag.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartChange {
    /// Label of a joint of the part.
    pub joint: Option<String>,
    /// A tag of the part: `module/name`, `module/label of its joint`, or its uid.
    pub tag: Option<String>,
    /// Turns the tag on or off.
    pub enabled: Option<bool>,
    /// Parameters of the tag that have another value, as RON: `(size: 2.0)`.
    pub params: Option<String>,
    /// Another place of the joint.
    pub translation: Option<[f32; 3]>,
    /// Another rotation of the joint, as angles about X, Y and Z in degrees.
    pub rotation: Option<[f32; 3]>,
    /// Tags that the joint has besides.
    pub tags: Vec<TagData>,
}

/// Gives the parameters of a module for the other side of the character; `None` if it does not know the module.
pub type MirrorParams<'a> = &'a dyn Fn(&str, &str) -> Option<String>;

impl PartInstance {
    /// Name for messages.
    pub fn title(&self) -> &str {
        if self.name.is_empty() { &self.part } else { &self.name }
    }

    /// Uid here of something with that uid in the part.
    pub fn uid_of(&self, uid: Uid) -> Uid {
        let (own, source) = (self.uid.to_string(), uid.to_string());
        Uid::derived([own.as_str(), source.as_str()])
    }

    /// Puts the part into a rig. Returns notes.
    ///
    /// # Errors
    /// A message about what does not fit: joints that are not there, a part that needs more of them, unknown features or tags.
    pub fn put_into(&self, rig: &mut Rig, part: &Rig, mirror: MirrorParams) -> Result<Vec<String>, String> {
        let part = &self.prepared(part, mirror);
        let mut uids = UidSource::seeded(self.uid.0);
        let mut draft = Draft::new(rig, &mut uids, None);
        let joints = if self.onto.is_empty() { self.own_joints(&mut draft, part) } else { self.known_joints(&draft) }?;
        if joints.len() > part.len() {
            let (given, has) = (joints.len(), part.len());
            return Err(format!("{given} joints are given, and the part has only {has}; take some away"));
        }
        let said = |error: &dyn std::fmt::Display| error.to_string();
        let bindings = BTreeMap::new();
        drop_part(&mut draft, part, &joints, &bindings, &mut |_, uid| self.uid_of(uid))
            .map_err(|error| said(&error))?;
        self.turn_off(&mut draft, part)?;
        for change in &self.changes {
            self.change(&mut draft, part, &joints, change)?;
        }
        Ok(draft.finish().notes.into_iter().map(|note| format!("part {}: {note}", self.title())).collect())
    }

    /// The part with the names and, on the other side, the values that it has here.
    fn prepared(&self, part: &Rig, mirror: MirrorParams) -> Rig {
        let mut part = part.clone();
        let plane = MirrorPlane::sagittal(1.0);
        let globals: HashMap<Uid, _> = part.rest_globals().into_iter().collect();
        let order: Vec<Uid> = part.walk().map(|joint| joint.data.uid).collect();
        let prefixed = |name: &str| format!("{}{name}", self.prefix);
        for group in part.groups.iter_mut().filter(|_| self.mirror) {
            group.name = mirrored_label(&group.name).unwrap_or_else(|| group.name.clone());
        }
        for uid in order {
            let Some(joint) = part.joints.get_mut(&uid) else { continue };
            if self.mirror {
                let of = |uid: Uid| globals.get(&uid).map(|global| plane.mirrored_affine(global)).unwrap_or_default();
                let above = joint.parent.map(of).unwrap_or_default();
                joint.data.rest = RestTransform::from_affine(&(above.inverse() * of(uid)));
                joint.data.label = joint.data.label.take().map(|label| mirrored_label(&label).unwrap_or(label));
            }
            joint.data.label = joint.data.label.take().map(|label| prefixed(&label));
            for tag in &mut joint.data.tags {
                if self.mirror {
                    mirror_names(tag);
                }
                if let TagKind::Command { module, params, .. } = &mut tag.kind {
                    if let Some(mirrored) = self.mirror.then(|| mirror(module, params)).flatten() {
                        *params = mirrored;
                    }
                    if !self.prefix.is_empty() {
                        *params = map_text_fields(params, &["name", "label"], |name| Some(prefixed(name)));
                    }
                }
            }
        }
        part
    }

    fn known_joints(&self, draft: &Draft) -> Result<Vec<Uid>, String> {
        self.onto.iter().map(|label| labelled(draft.rig(), label)).collect()
    }

    /// Adds the joints that the part brings.
    fn own_joints(&self, draft: &mut Draft, part: &Rig) -> Result<Vec<Uid>, String> {
        let parent = self.parent.as_deref().map(|label| labelled(draft.rig(), label)).transpose()?;
        let mut joints = Vec::with_capacity(part.len());
        for joint in part.walk() {
            let (uid, rest) = (self.uid_of(joint.data.uid), joint.data.rest);
            let (above, rest) = match joint.parent {
                Some(above) => (Some(self.uid_of(above)), rest),
                None => (parent, RestTransform::from_affine(&(self.rest.affine() * rest.affine()))),
            };
            let mirror = joint.data.mirror.map(|mirror| self.uid_of(mirror));
            let data = JointData { uid, rest, mirror, tags: Vec::new(), group: None, ..joint.data.clone() };
            let edit = RigEdit::AddJoint { joint: Box::new(data), parent: above, index: usize::MAX };
            draft.apply(edit).map_err(|error| error.to_string())?;
            joints.push(uid);
        }
        Ok(joints)
    }

    fn turn_off(&self, draft: &mut Draft, part: &Rig) -> Result<(), String> {
        let names = |tag: &TagData| match &tag.kind {
            TagKind::Feature { kind, name, switch, .. } => {
                let name = if name.is_empty() { kind } else { name };
                Some(if switch.is_empty() { name.clone() } else { format!("{name}.{switch}") })
            }
            TagKind::Command { .. } => None,
        };
        for off in &self.off {
            let tags = || part.walk().flat_map(|joint| &joint.data.tags);
            let found: Vec<Uid> =
                tags().filter(|tag| names(tag).as_ref() == Some(off)).map(|tag| self.uid_of(tag.uid)).collect();
            if found.is_empty() {
                let known: Vec<String> = tags().filter_map(names).collect();
                let near = did_you_mean(off, known);
                return Err(format!("the part has no feature \"{off}\"{near}"));
            }
            for tag in found {
                set_tag(draft, tag, |tag| tag.enabled = false)?;
            }
        }
        Ok(())
    }

    fn change(&self, draft: &mut Draft, part: &Rig, joints: &[Uid], change: &PartChange) -> Result<(), String> {
        if let Some(name) = &change.tag {
            let tag = self.uid_of(self.find_tag(part, name)?);
            if let Some(enabled) = change.enabled {
                set_tag(draft, tag, |tag| tag.enabled = enabled)?;
            }
            if let Some(others) = &change.params {
                set_tag(draft, tag, |tag| {
                    if let TagKind::Command { params, .. } = &mut tag.kind {
                        *params = with_params(params, others);
                    }
                })?;
            }
        }
        let Some(label) = &change.joint else { return Ok(()) };
        let is_called = |joint: &&(usize, &crate::rig::RigJoint)| {
            let known = joint.1.data.label.as_deref();
            known == Some(label) || known.and_then(|known| known.strip_prefix(self.prefix.as_str())) == Some(label)
        };
        let walked: Vec<_> = part.walk().enumerate().collect();
        let Some((place, _)) = walked.iter().find(is_called) else {
            let known: Vec<&str> = walked.iter().filter_map(|(_, joint)| joint.data.label.as_deref()).collect();
            return Err(format!("the part has no joint \"{label}\"{}", did_you_mean(label, known)));
        };
        let Some(joint) = joints.get(*place).copied() else {
            return Err(format!("joint \"{label}\" of the part is not used here"));
        };
        if let Some(mut rest) = draft.rig().joint(joint).map(|joint| joint.data.rest) {
            rest.translation = change.translation.map_or(rest.translation, Into::into);
            rest.rotation = change.rotation.map_or(rest.rotation, |angles| crate::rig::degrees(angles.into()));
            draft.apply(RigEdit::SetRest(joint, rest)).map_err(|error| error.to_string())?;
        }
        for tag in &change.tags {
            let tag = Box::new(TagData { uid: self.uid_of(tag.uid), ..tag.clone() });
            let edit = RigEdit::AddTag { joint, tag, index: usize::MAX };
            draft.apply(edit).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    /// The tag of the part that is called so.
    fn find_tag(&self, part: &Rig, name: &str) -> Result<Uid, String> {
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
        let mut found: Vec<Uid> = called.iter().filter(|(known, _)| known == name).map(|(_, uid)| *uid).collect();
        found.dedup();
        match found[..] {
            [tag] => Ok(tag),
            [] => {
                let known: Vec<&str> = called.iter().map(|(known, _)| known.as_str()).collect();
                Err(format!("the part has no tag \"{name}\"{}", did_you_mean(name, known)))
            }
            _ => {
                let uids: Vec<String> = found.iter().map(Uid::to_string).collect();
                Err(format!("the part has {} tags \"{name}\"; write the uid of one: {}", uids.len(), uids.join(", ")))
            }
        }
    }
}

fn labelled(rig: &Rig, label: &str) -> Result<Uid, String> {
    rig.find_label(label).ok_or_else(|| {
        let known: Vec<&str> = rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect();
        format!("there is no joint \"{label}\"{}", did_you_mean(label, known))
    })
}

fn set_tag(draft: &mut Draft, tag: Uid, change: impl FnOnce(&mut TagData)) -> Result<(), String> {
    let Some((joint, found)) = draft.rig().find_tag(tag) else {
        return Err(format!("tag {tag} is on a joint that is not used here"));
    };
    let (joint, mut found) = (joint.data.uid, found.clone());
    change(&mut found);
    draft.apply(RigEdit::SetTag(joint, Box::new(found))).map_err(|error| error.to_string())
}

/// Parameters with other values for some of them.
fn with_params(params: &str, others: &str) -> String {
    let mut out = params.to_owned();
    let Some(others) = Tree::parse(others) else { return out };
    for item in &others.node(others.root()).items {
        let Some(key) = item.key else { continue };
        let value = others.written(item.value);
        let Some(tree) = Tree::parse(&out) else { return out };
        let next = match tree.field(tree.root(), key) {
            Some(known) => {
                let range = tree.node(known.value).range.clone();
                format!("{}{value}{}", &out[..range.start], &out[range.end..])
            }
            None => {
                let inside = tree.node(tree.root()).inside;
                let comma = if tree.node(tree.root()).items.is_empty() { "" } else { ", " };
                format!("{}{key}: {value}{comma}{}", &out[..inside], &out[inside..])
            }
        };
        out = next;
    }
    out
}
