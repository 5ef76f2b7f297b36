//! Part instances: parts that stay parts in a template.
//!
//! A template names a part, says where it goes and what is different about it; the part's own file says the rest. What comes of
//! it has uids that follow from those of the instance and of the part's joints and tags, so that a part can be used many times,
//! and a later version of it changes what it changes and no more: see [`update`](crate::rig::update).

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashMap},
};

use crate::rig::{
    JointData, RestTransform, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
    format::tree::{Tree, with_field},
    label::mirrored_label,
    nearest::did_you_mean,
    operations::{Draft, MirrorPlane, drop_part},
    part::{PartChain, PartError},
    reference::{NameKind, NameScope, Names, bind_names, given_name, map_references, map_text_fields},
    remap::mirror_names,
};

/// A template that others use, with what it lets them vary.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its joints and tags.
    pub rig: Rig,
    /// Chains that take other numbers of joints.
    pub chains: Vec<PartChain>,
}

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
    /// True to bring its own joints beyond those of `onto`, too.
    pub adds: bool,
    /// Number of joints of the part's chains, by the name of the chain; an empty name for its only one.
    pub counts: Vec<(String, usize)>,
    /// Label of the joint that its own joints hang on.
    pub parent: Option<String>,
    /// Place of its own joints, below `parent`.
    pub rest: RestTransform,
    /// True if `rest` is a place in the rig's space, instead of one below `parent`.
    pub is_world: bool,
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
    /// A tag of the part: `module/name`, `module/label of its joint`, or its uid; where several are called so, with the
    /// number of one behind it, as in `point/hand_l#2`.
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
    /// Joints that are not there, a part that needs more of them, unknown features or tags.
    pub fn put_into(&self, rig: &mut Rig, part: &Part, mirror: MirrorParams) -> Result<Vec<String>, PartError> {
        let part = &self.prepared(self.resized(part)?, mirror);
        let mut uids = UidSource::seeded(self.uid.0);
        let mut draft = Draft::new(rig, &mut uids, None);
        let mut joints = self.known_joints(&draft)?;
        if self.onto.is_empty() || self.adds {
            self.add_joints(&mut draft, part, &mut joints)?;
        }
        if joints.len() > part.len() {
            return Err(PartError::TooManyJoints { given: joints.len(), count: part.len() });
        }
        let bindings = BTreeMap::new();
        drop_part(&mut draft, part, &joints, &bindings, &mut |_, uid| self.uid_of(uid))?;
        self.turn_off(&mut draft, part)?;
        for change in &self.changes {
            self.change(&mut draft, part, &joints, change)?;
        }
        Ok(draft.finish().notes.into_iter().map(|note| format!("part {}: {note}", self.title())).collect())
    }

    /// The part with as many joints as it has here: as many as it goes onto, where nothing else is said.
    fn resized(&self, part: &Part) -> Result<Rig, PartError> {
        let mut counts = Vec::new();
        for (name, count) in &self.counts {
            let chain = match part.chains.as_slice() {
                [only] if name.is_empty() => Some(only),
                chains => chains.iter().find(|chain| chain.name == *name),
            };
            counts.push((chain.ok_or_else(|| unknown_chain(name, &part.chains))?, *count));
        }
        if let ([only], true) = (part.chains.as_slice(), counts.is_empty())
            && !self.onto.is_empty()
            && !self.adds
        {
            let others = part.rig.len() - only.joints.len();
            let most = self.onto.len().saturating_sub(others);
            // What hangs behind the chain may be left out.
            let count = if (only.min..=only.max).contains(&most) { most } else { self.onto.len().min(only.max) };
            counts.push((only, count));
        }
        let mut rig = part.rig.clone();
        for (chain, count) in counts {
            rig = chain.resized(&rig, count)?;
        }
        Ok(rig)
    }

    /// The part with the names and, on the other side, the values that it has here.
    fn prepared(&self, mut part: Rig, mirror: MirrorParams) -> Rig {
        let plane = MirrorPlane::sagittal(1.0);
        let globals: HashMap<Uid, _> = part.rest_globals().into_iter().collect();
        let order: Vec<Uid> = part.walk().map(|joint| joint.data.uid).collect();
        let prefixed = |name: &str| format!("{}{name}", self.prefix);
        for group in part.groups.iter_mut().filter(|_| self.mirror) {
            group.name = mirrored_label(&group.name).unwrap_or_else(|| group.name.clone());
        }
        for input in part.inputs.iter_mut().filter(|_| self.mirror) {
            input.name = mirrored_label(&input.name).unwrap_or_else(|| input.name.clone());
            input.rest = RestTransform::from_affine(&plane.mirrored_affine(&input.rest.affine()));
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

    fn known_joints(&self, draft: &Draft) -> Result<Vec<Uid>, PartError> {
        self.onto.iter().map(|label| labelled(draft.rig(), label)).collect()
    }

    /// Adds the joints that the part brings, beyond the first ones, which are there.
    fn add_joints(&self, draft: &mut Draft, part: &Rig, joints: &mut Vec<Uid>) -> Result<(), PartError> {
        let parent = self.parent.as_deref().map(|label| labelled(draft.rig(), label)).transpose()?;
        let globals = draft.rig().rest_globals();
        let below = globals.into_iter().find(|(uid, _)| self.is_world && parent == Some(*uid));
        let place = below.map_or(self.rest.affine(), |(_, global)| global.inverse() * self.rest.affine());
        let mut of: HashMap<Uid, Uid> = part.walk().map(|joint| joint.data.uid).zip(joints.iter().copied()).collect();
        for joint in part.walk().skip(joints.len()) {
            let (uid, rest) = (self.uid_of(joint.data.uid), joint.data.rest);
            let (above, rest) = match joint.parent {
                Some(above) => (of.get(&above).copied(), rest),
                None => (parent, RestTransform::from_affine(&(place * rest.affine()))),
            };
            of.insert(joint.data.uid, uid);
            let mirror = joint.data.mirror.map(|mirror| self.uid_of(mirror));
            let data = JointData { uid, rest, mirror, tags: Vec::new(), group: None, ..joint.data.clone() };
            let edit = RigEdit::AddJoint { joint: Box::new(data), parent: above, index: usize::MAX };
            draft.apply(edit)?;
            joints.push(uid);
        }
        Ok(())
    }

    fn turn_off(&self, draft: &mut Draft, part: &Rig) -> Result<(), PartError> {
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
                return Err(PartError::UnknownFeature { name: off.clone(), nearest: did_you_mean(off, known) });
            }
            for tag in found {
                set_tag(draft, tag, |tag| tag.enabled = false)?;
            }
        }
        Ok(())
    }

    fn change(&self, draft: &mut Draft, part: &Rig, joints: &[Uid], change: &PartChange) -> Result<(), PartError> {
        let places: HashMap<Uid, Uid> = part.walk().map(|joint| joint.data.uid).zip(joints.iter().copied()).collect();
        if let Some(name) = &change.tag {
            let tag = self.uid_of(self.find_tag(part, name)?);
            if let Some(enabled) = change.enabled {
                set_tag(draft, tag, |tag| tag.enabled = enabled)?;
            }
            if let Some(others) = &change.params {
                // Names are those of the part first, then those of the template.
                let (bound, _) = bind_names(others, &PartNames { part, host: draft.rig() });
                let others = &map_references(&bound, |reference| {
                    for (_, uid) in reference.uids_mut() {
                        match places.get(uid) {
                            Some(joint) => *uid = *joint,
                            None if part.is_taken(*uid) => *uid = self.uid_of(*uid),
                            None => {}
                        }
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
        let is_called = |joint: &&(usize, &crate::rig::RigJoint)| {
            let known = joint.1.data.label.as_deref();
            known == Some(label) || known.and_then(|known| known.strip_prefix(self.prefix.as_str())) == Some(label)
        };
        let walked: Vec<_> = part.walk().enumerate().collect();
        let Some((place, _)) = walked.iter().find(is_called) else {
            let known: Vec<&str> = walked.iter().filter_map(|(_, joint)| joint.data.label.as_deref()).collect();
            return Err(PartError::UnknownJoint { label: label.clone(), nearest: did_you_mean(label, known) });
        };
        let Some(joint) = joints.get(*place).copied() else {
            return Err(PartError::UnusedJoint { label: label.clone() });
        };
        if let Some(mut rest) = draft.rig().joint(joint).map(|joint| joint.data.rest) {
            rest.translation = change.translation.map_or(rest.translation, Into::into);
            rest.rotation = change.rotation.map_or(rest.rotation, |angles| crate::rig::degrees(angles.into()));
            draft.apply(RigEdit::SetRest(joint, rest))?;
        }
        for tag in &change.tags {
            let tag = Box::new(TagData { uid: self.uid_of(tag.uid), ..tag.clone() });
            let edit = RigEdit::AddTag { joint, tag, index: usize::MAX };
            draft.apply(edit)?;
        }
        Ok(())
    }

    /// The tag of the part that is called so.
    fn find_tag(&self, part: &Rig, name: &str) -> Result<Uid, PartError> {
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
        let (plain, number) = match name.rsplit_once('#').map(|(plain, number)| (plain, number.parse::<usize>())) {
            Some((plain, Ok(number))) => (plain, Some(number)),
            _ => (name, None),
        };
        let mut found: Vec<Uid> = called.iter().filter(|(known, _)| known == plain).map(|(_, uid)| *uid).collect();
        found.dedup();
        if let Some(number) = number {
            found = number.checked_sub(1).and_then(|at| found.get(at).copied()).into_iter().collect();
        }
        match found[..] {
            [tag] => Ok(tag),
            [] => {
                let known: Vec<&str> = called.iter().map(|(known, _)| known.as_str()).collect();
                Err(PartError::UnknownTag { name: name.to_owned(), nearest: did_you_mean(name, known) })
            }
            _ => Err(PartError::AmbiguousTag { name: name.to_owned(), count: found.len() }),
        }
    }
}

/// Names in a part, then those in the template that uses it.
struct PartNames<'a> {
    part: &'a Rig,
    host: &'a Rig,
}

impl Names for PartNames<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.part.name_of(kind, uid).or_else(|| self.host.name_of(kind, uid))
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        let found = self.part.find(scope, kind, name);
        if found.is_empty() { self.host.find(scope, kind, name) } else { found }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        self.part.all(scope, kind).into_iter().chain(self.host.all(scope, kind)).collect()
    }
}

fn unknown_chain(name: &str, chains: &[PartChain]) -> PartError {
    let known: Vec<String> = chains.iter().map(|chain| chain.name.clone()).collect();
    match known[..] {
        [] => PartError::NoChains,
        _ if name.is_empty() => PartError::UnnamedChain { known },
        _ => PartError::UnknownChain { name: name.to_owned(), nearest: did_you_mean(name, known) },
    }
}

fn labelled(rig: &Rig, label: &str) -> Result<Uid, PartError> {
    rig.find_label(label).ok_or_else(|| {
        let known: Vec<&str> = rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect();
        PartError::UnknownHostJoint { label: label.to_owned(), nearest: did_you_mean(label, known) }
    })
}

fn set_tag(draft: &mut Draft, tag: Uid, change: impl FnOnce(&mut TagData)) -> Result<(), PartError> {
    let Some((joint, found)) = draft.rig().find_tag(tag) else {
        return Err(PartError::UnusedTag { tag });
    };
    let (joint, mut found) = (joint.data.uid, found.clone());
    change(&mut found);
    Ok(draft.apply(RigEdit::SetTag(joint, Box::new(found)))?)
}

/// Parameters with other values for some of them.
fn with_params(params: &str, others: &str) -> String {
    let mut out = params.to_owned();
    let Some(others) = Tree::parse(others) else { return out };
    for item in &others.node(others.root()).items {
        let Some(key) = item.key else { continue };
        out = with_field(&out, key, others.written(item.value));
    }
    out
}
