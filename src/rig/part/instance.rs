//! Part instances: parts that stay parts in a template.
//!
//! A template names a part, says where it goes and what is different about it; the part's own file says the rest. What comes of
//! it has uids that follow from those of the instance and of the part's joints and tags, so that a part can be used many times,
//! and a later version of it changes what it changes and no more: see [`update`](crate::rig::update).

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
};

use bevy::math::{Affine3, Vec3};

use super::{OptionError, PartChain, PartChange, PartError, PartOption, PartSocket, PartTargets, change::ChangedPart};
use crate::rig::{
    JointData, RestTransform, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
    format::{
        template::{PartSource, Template},
        tree::with_field,
    },
    label::mirrored_label,
    nearest::did_you_mean,
    operations::{Draft, MirrorPlane, drop_part},
    reference::map_text_fields,
    remap::mirror_names,
};

/// Most joints and tags that the parts of a template bring, with their own parts: a dozen files, each of which uses the next
/// eight times, would bring billions.
pub(in crate::rig) const MOST_BROUGHT: usize = 50_000;

/// Template that other templates use as a part, with the places and numbers that each use may choose.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Joints and tags.
    pub rig: Rig,
    /// Chains that take other numbers of joints.
    pub chains: Vec<PartChain>,
    /// Places that other parts hang on.
    pub sockets: Vec<PartSocket>,
    /// Values that uses of the part may set.
    pub options: Vec<PartOption>,
    /// Text of the part's file; `None` for a part without a file.
    pub source: Option<Arc<PartSource>>,
}

impl Part {
    /// Number of its joints and tags.
    pub(in crate::rig) fn size(&self) -> usize {
        self.rig.joints.len() + self.rig.tags.len()
    }

    /// The part with other values of its options: each an option's name and its value as RON.
    ///
    /// # Errors
    /// An option that the part does not have, or that does not take the value.
    pub fn with_options(mut self, values: &[(String, String)]) -> Result<Self, PartError> {
        let nameless = PartInstance { options: values.to_vec(), ..PartInstance::default() };
        let (values, errors) = nameless.option_values(&self);
        if let Some(error) = errors.into_iter().next() {
            return Err(error.into());
        }
        for (tag, param, value) in values {
            let Some((joint, found)) = self.rig.find_tag(tag) else { continue };
            let (joint, mut found) = (joint.data.uid, found.clone());
            if let TagKind::Command { params, .. } = &mut found.kind {
                *params = with_field(params, &param, &value);
            }
            self.rig.apply(&RigEdit::SetTag(joint, Box::new(found)))?;
        }
        Ok(self)
    }
}

impl From<Rig> for Part {
    /// A part that is as it is everywhere: no chain of another length, no sockets and no options.
    fn from(rig: Rig) -> Self {
        Self { rig, chains: Vec::new(), sockets: Vec::new(), options: Vec::new(), source: None }
    }
}

impl From<Template> for Part {
    fn from(template: Template) -> Self {
        let Template { rig, chains, sockets, options, .. } = template;
        Self { rig, chains, sockets, options, source: None }
    }
}

/// A part in a template.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartInstance {
    /// Identity of the instance. The uids of the joints and tags that the instance brings follow from it.
    pub uid: Uid,
    /// File of the part, relative to that of the template.
    pub part: String,
    /// The name people see; the file's without one.
    pub name: String,
    /// Labels of the joints that the part goes onto, in the order of its joints; empty to bring its own.
    pub onto: Vec<String>,
    /// True to bring its own joints beyond those of `onto`, too.
    pub adds: bool,
    /// Number of joints of the part's chains, or of its branches, by their name; an empty name for the only ones.
    pub counts: Vec<(String, usize)>,
    /// Label of the joint that its own joints hang on.
    pub parent: Option<String>,
    /// Socket that its own joints hang on, in place of a parent: `name` of the template itself, `instance.name` of a part
    /// that stands before.
    pub socket: Option<String>,
    /// Values of the part's options, as RON.
    pub options: Vec<(String, String)>,
    /// Place of its own joints, below the parent or the socket.
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

/// Gives the parameters of a module for the other side of the character; `None` if it does not know the module.
pub type MirrorParams<'a> = &'a dyn Fn(&str, &str) -> Option<String>;

/// Module whose name is that of an attribute, not of a node.
pub(super) const ATTRIBUTE: &str = "attribute";

/// Notes and faults of a part that was put into a rig.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartReport {
    /// Notes, a sentence each.
    pub notes: Vec<String>,
    /// Options and changes of the instance that do not fit the part; changes with their number.
    pub faults: Vec<(Option<usize>, PartError)>,
}

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

    /// Puts the part, of which `fitted` is what comes here, into a rig, below a socket if there is one. Options and changes
    /// that do not fit the part are among the faults, and are left out.
    ///
    /// # Errors
    /// Joints that are not there, a part that needs more of them, unknown features.
    pub fn put_into(
        &self,
        rig: &mut Rig,
        part: &Part,
        fitted: &Rig,
        mirror: MirrorParams,
        socket: Option<&PartSocket>,
    ) -> Result<PartReport, PartError> {
        let (options, errors) = self.option_changes(part, mirror);
        let mut faults: Vec<(Option<usize>, PartError)> =
            errors.into_iter().map(|error| (None, PartError::from(error))).collect();
        let part = fitted;
        let mut uids = UidSource::seeded(self.uid.0);
        let mut draft = Draft::new(rig, &mut uids, None);
        let joints = match self.place(&mut draft, part, socket) {
            Ok(joints) => joints,
            Err(error) => {
                draft.take_back();
                return Err(error);
            }
        };
        faults.extend(self.turn_off(&mut draft, part).into_iter().map(|error| (None, error)));
        let changes = self.changes.iter().enumerate().map(|(number, change)| (Some(number), change));
        let changed = ChangedPart::new(self, part, &joints);
        for (number, change) in options.iter().map(|option| (None, option)).chain(changes) {
            let done = self.change(&mut draft, &changed, change);
            faults.extend(done.err().map(|error| (number, error)));
        }
        let notes = draft.finish().notes.into_iter().map(|note| format!("part {}: {note}", self.title())).collect();
        Ok(PartReport { notes, faults })
    }

    /// Puts the joints and the tags of the part into a rig; returns the joints there.
    fn place(&self, draft: &mut Draft, part: &Rig, socket: Option<&PartSocket>) -> Result<Vec<Uid>, PartError> {
        let mut joints = self.known_joints(draft)?;
        if self.onto.is_empty() || self.adds {
            self.add_joints(draft, part, socket, &mut joints)?;
        }
        if joints.len() > part.len() {
            return Err(PartError::TooManyJoints { given: joints.len(), count: part.len() });
        }
        drop_part(draft, part, &joints, &BTreeMap::new(), &mut |_, uid| self.uid_of(uid))?;
        Ok(joints)
    }

    /// Sockets of the part as they are in `rig`, under the instance's name. The part need not be in the rig yet.
    pub fn sockets_in(&self, rig: &Rig, part: &Part, fitted: &Rig) -> Vec<PartSocket> {
        let plane = MirrorPlane::sagittal(1.0);
        let here = |socket: &PartSocket| {
            let place = fitted.walk().position(|joint| Some(joint.data.uid) == socket.joint)?;
            let joint = match self.onto.get(place) {
                Some(label) => rig.labelled(label)?,
                None if self.onto.is_empty() || self.adds => self.uid_of(socket.joint?),
                None => return None,
            };
            let sided = mirrored_label(&socket.name).filter(|_| self.mirror);
            let name = format!("{}.{}", self.title(), sided.as_ref().unwrap_or(&socket.name));
            let rest = match self.mirror {
                true => RestTransform::from_affine(&plane.mirrored_affine(&socket.rest.affine())),
                false => socket.rest,
            };
            let turned = Vec3::new(socket.angles.x, -socket.angles.y, -socket.angles.z);
            let angles = if self.mirror { turned } else { socket.angles };
            Some(PartSocket { name, joint: Some(joint), rest, angles, ..socket.clone() })
        };
        part.sockets.iter().filter_map(here).collect()
    }

    /// Parameters that the instance's options set: tag, parameter and value; and what is wrong with its options.
    fn option_values(&self, part: &Part) -> (Vec<(Uid, String, String)>, Vec<OptionError>) {
        let (mut values, mut errors) = (Vec::new(), Vec::new());
        let options: HashMap<&str, &PartOption> =
            part.options.iter().map(|option| (option.name.as_str(), option)).collect();
        // The option names tags as the part's file does.
        let plain = PartInstance::default();
        let targets = PartTargets::new(&plain, &part.rig);
        for (name, value) in &self.options {
            let Some(option) = options.get(name.as_str()) else {
                let known = || part.options.iter().map(|option| option.name.clone()).collect();
                errors.push(OptionError::Unknown { name: name.clone(), nearest: targets.nearest(name, known) });
                continue;
            };
            if let Err(error) = option.check(value) {
                errors.push(error);
                continue;
            }
            for (tag, param) in &option.sets {
                match targets.find_tag(tag) {
                    Ok(tag) => values.push((tag, param.clone(), value.clone())),
                    Err(reason) => {
                        errors.push(OptionError::Target { name: name.clone(), reason: Box::new(reason) });
                    }
                }
            }
        }
        (values, errors)
    }

    /// Changes that the instance's options make, and what is wrong with its options.
    fn option_changes(&self, part: &Part, mirror: MirrorParams) -> (Vec<PartChange>, Vec<OptionError>) {
        let change = |(tag, param, value): (Uid, String, String)| {
            let params = with_field("()", &param, &value);
            let module = part.rig.find_tag(tag).and_then(|(_, tag)| match &tag.kind {
                TagKind::Command { module, .. } => Some(module),
                TagKind::Feature { .. } => None,
            });
            let mirrored = module.filter(|_| self.mirror).and_then(|module| mirror(module, &params));
            let params = Some(mirrored.unwrap_or(params));
            PartChange { tag: Some(tag.to_string()), params, ..PartChange::default() }
        };
        let (values, errors) = self.option_values(part);
        (values.into_iter().map(change).collect(), errors)
    }

    /// Faults of an instance whose part cannot be put into `rig`: the joints that are not there, or the reason that is
    /// given, and options, features and changes that do not fit the part. Changes come with their number.
    pub(in crate::rig) fn faults(
        &self,
        rig: &Rig,
        part: &Part,
        fitted: &Rig,
        reason: PartError,
    ) -> Vec<(Option<usize>, PartError)> {
        let labels = self.onto.iter().chain(&self.parent);
        let mut errors: Vec<PartError> = labels.filter_map(|label| labelled(rig, label).err()).collect();
        // The reason may be one of these.
        if !errors.contains(&reason) {
            errors.insert(0, reason);
        }
        errors.extend(self.option_values(part).1.into_iter().map(PartError::from));
        errors.extend(self.off.iter().filter_map(|name| self.tags_called(fitted, name).err()));
        let targets = PartTargets::new(self, fitted);
        let of_change = |(number, change): (usize, &PartChange)| {
            let tag = change.tag.as_ref().and_then(|name| targets.find_tag(name).err());
            let joint = change.joint.as_ref().and_then(|label| targets.find_joint(label).err());
            tag.or(joint).map(|error| (Some(number), error))
        };
        let of_changes = self.changes.iter().enumerate().filter_map(of_change);
        errors.into_iter().map(|error| (None, error)).chain(of_changes).collect()
    }

    /// The part with the joints, names and values that it has here, before its changes.
    ///
    /// # Errors
    /// A chain that the part does not have, or that takes another number of joints.
    pub fn fitted(&self, part: &Part, mirror: MirrorParams) -> Result<Rig, PartError> {
        Ok(self.prepared(self.sized(part)?, mirror))
    }

    /// The part with as many joints as it has here: as many as it goes onto, where nothing else is said.
    ///
    /// # Errors
    /// A chain that the part does not have, or that takes another number of joints.
    pub fn sized(&self, part: &Part) -> Result<Rig, PartError> {
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
            && !only.is_fan
        {
            counts.push((only, only.count_on(&part.rig, self.onto.len())));
        }
        // The copy of a branch has as many joints as the branch.
        counts.sort_by_key(|(chain, _)| chain.is_fan);
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
        if self.mirror {
            part.groups.change_each(|group| {
                group.name = mirrored_label(&group.name).unwrap_or_else(|| group.name.clone());
            });
            part.inputs.change_each(|input| {
                input.name = mirrored_label(&input.name).unwrap_or_else(|| input.name.clone());
                input.rest = RestTransform::from_affine(&plane.mirrored_affine(&input.rest.affine()));
            });
        }
        part.checkpoints.clear();
        part.label_index.clear();
        for uid in order {
            let Some(joint) = part.joints.get_mut(&uid).map(Arc::make_mut) else { continue };
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
                    // Attributes are told apart by the nodes that bear them, and are named in other parameters.
                    if !self.prefix.is_empty() && *module != *ATTRIBUTE {
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
    fn add_joints(
        &self,
        draft: &mut Draft,
        part: &Rig,
        socket: Option<&PartSocket>,
        joints: &mut Vec<Uid>,
    ) -> Result<(), PartError> {
        let parent = self.parent.as_deref().map(|label| labelled(draft.rig(), label)).transpose()?;
        let parent = socket.and_then(|socket| socket.joint).or(parent);
        let below = parent.filter(|_| self.is_world).and_then(|parent| draft.rig().global_from_root(parent));
        let place = match (below, socket) {
            (Some(global), _) => global.inverse() * self.rest.affine(),
            (None, Some(socket)) => socket.rest.affine() * self.rest.affine(),
            (None, None) => self.rest.affine(),
        };
        let beside = joints.first().filter(|_| parent.is_none()).copied();
        let beside = beside.map(|first| (first, self.moved_onto(draft.rig(), part, first)));
        let mut of: HashMap<Uid, Uid> = part.walk().map(|joint| joint.data.uid).zip(joints.iter().copied()).collect();
        for joint in part.walk().skip(joints.len()) {
            let (uid, rest) = (self.uid_of(joint.data.uid), joint.data.rest);
            let (above, rest) = match (joint.parent, beside) {
                (Some(above), _) => (of.get(&above).copied(), rest),
                (None, Some((first, moved))) => {
                    let above = draft.rig().joint(first).and_then(|first| first.parent);
                    (above, draft.rig().local_rest(above, &(moved * rest.affine())))
                }
                (None, None) => (parent, RestTransform::from_affine(&(place * rest.affine()))),
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

    /// The way from the places of the part's roots in its file to those in the rig, where its first joint goes onto `first`: they
    /// stand beside that as they do there, along the axes of the rig, whatever axes the joint has.
    fn moved_onto(&self, rig: &Rig, part: &Rig, first: Uid) -> Affine3 {
        if self.is_world {
            return self.rest.affine();
        }
        let in_file = part.walk().next().map_or(Vec3::ZERO, |own| own.data.rest.translation);
        Affine3::from_translation(rig.position(first)) * self.rest.affine() * Affine3::from_translation(-in_file)
    }

    /// Turns off what the instance turns off; returns what is wrong with it.
    fn turn_off(&self, draft: &mut Draft, part: &Rig) -> Vec<PartError> {
        let mut errors = Vec::new();
        for name in &self.off {
            let turned = self.tags_called(part, name).and_then(|tags| {
                tags.into_iter().try_for_each(|tag| set_tag(draft, self.uid_of(tag), |tag| tag.enabled = false))
            });
            errors.extend(turned.err());
        }
        errors
    }

    /// Tags of the part that are turned off by a name.
    fn tags_called(&self, part: &Rig, name: &str) -> Result<Vec<Uid>, PartError> {
        let tags = || part.walk().flat_map(|joint| &joint.data.tags);
        let is_called = |tag: &&TagData| switch_name(tag).as_deref() == Some(name);
        let found: Vec<Uid> = tags().filter(is_called).map(|tag| tag.uid).collect();
        if found.is_empty() {
            let known: Vec<String> = tags().filter_map(switch_name).collect();
            return Err(PartError::UnknownFeature { name: name.to_owned(), nearest: did_you_mean(name, known) });
        }
        Ok(found)
    }
}

/// Name by which an instance turns a feature of its part off, or a switch of one; `None` for a command.
pub(in crate::rig) fn switch_name(tag: &TagData) -> Option<String> {
    let TagKind::Feature { kind, name, switch, .. } = &tag.kind else { return None };
    let name = if name.is_empty() { kind } else { name };
    Some(if switch.is_empty() { name.clone() } else { format!("{name}.{switch}") })
}

fn unknown_chain(name: &str, chains: &[PartChain]) -> PartError {
    let known: Vec<String> = chains.iter().map(|chain| chain.name.clone()).collect();
    match known[..] {
        [] => PartError::NoChains,
        _ if name.is_empty() => PartError::UnnamedChain { known },
        _ => PartError::UnknownChain { name: name.to_owned(), nearest: did_you_mean(name, known) },
    }
}

/// True if two templates have the same part instances in the same order, whatever these change of their parts.
pub fn have_same_fields(a: &[PartInstance], b: &[PartInstance]) -> bool {
    let fields = |part: &PartInstance| PartInstance { changes: Vec::new(), offset: 0, ..part.clone() };
    a.iter().map(fields).eq(b.iter().map(fields))
}

fn labelled(rig: &Rig, label: &str) -> Result<Uid, PartError> {
    rig.labelled(label).ok_or_else(|| {
        let known: Vec<&str> = rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect();
        PartError::UnknownHostJoint { label: label.to_owned(), nearest: did_you_mean(label, known) }
    })
}

pub(super) fn set_tag(draft: &mut Draft, tag: Uid, change: impl FnOnce(&mut TagData)) -> Result<(), PartError> {
    let Some((joint, found)) = draft.rig().find_tag(tag) else {
        return Err(PartError::UnusedTag { tag });
    };
    let (joint, mut found) = (joint.data.uid, found.clone());
    change(&mut found);
    Ok(draft.apply(RigEdit::SetTag(joint, Box::new(found)))?)
}
