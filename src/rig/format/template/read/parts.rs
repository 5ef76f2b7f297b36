//! Parts in a template's file: what it lets others vary, and the parts that it uses itself.

use std::{
    collections::{HashMap, HashSet},
    fmt,
    sync::Arc,
};

use bevy::math::{Quat, Vec3};
use ron::value::RawValue;
use serde::Serialize;

use super::{
    super::{
        FORMAT, PartOrigin, Template,
        file::{ChainFile, OptionFile, OptionTargetFile, PartChangeFile, PartFile, SocketFile},
        quoted,
        shorthand::Declarations,
    },
    Places, bind_references,
    instance_places::InstancePlaces,
    read_text,
};
use crate::rig::{
    RestTransform, Rig, RigEdit, SourceError, TagData, TagKind, Uid, degrees,
    format::{
        scan::Field,
        source::{TextLines, ron_text},
    },
    part::{
        MOST_BROUGHT, MOST_JOINTS, MirrorParams, Part, PartChain, PartChange, PartError, PartInstance, PartOption,
        PartSocket, PartTargets, Shortfall, unpaired_sides,
    },
};

/// Chains and branches of a part. One that does not fit the joints is told and left out.
pub(super) fn chains(
    rig: &Rig,
    chains: Vec<ChainFile>,
    branches: Vec<ChainFile>,
    notes: &mut Vec<String>,
) -> Vec<PartChain> {
    let mut known: Vec<PartChain> = Vec::with_capacity(chains.len() + branches.len());
    if chains.is_empty() && branches.is_empty() {
        return known;
    }
    let by_label = rig.joints_by_label();
    let mut names: HashSet<String> = HashSet::new();
    // Joints of chains and of branches.
    let mut taken: [HashSet<Uid>; 2] = Default::default();
    let files = chains.into_iter().map(|file| (file, false)).chain(branches.into_iter().map(|file| (file, true)));
    for (ChainFile { name, joints: labels, min, max }, is_fan) in files {
        let joints: Vec<Uid> = labels.iter().filter_map(|label| by_label.get(label.as_str()).copied()).collect();
        let (min, max) = (min.unwrap_or(1), max.unwrap_or(MOST_JOINTS));
        let parent = |joint: Uid| rig.joint(joint).and_then(|joint| joint.parent);
        let of_kind = &mut taken[usize::from(is_fan)];
        let fault = if joints.len() != labels.len() || joints.len() < 2 {
            "it needs two joints or more, all of them in the file".to_owned()
        } else if !is_fan && joints.windows(2).any(|pair| parent(pair[1]) != Some(pair[0])) {
            "each of its joints must be the parent of the next".to_owned()
        } else if is_fan && joints.windows(2).any(|pair| parent(pair[0]) != parent(pair[1]) || pair[0] == pair[1]) {
            "all of its joints must hang on one joint".to_owned()
        } else if !(1..=joints.len()).contains(&min) || !(joints.len()..=MOST_JOINTS).contains(&max) {
            format!("`min` is 1 to {0}, and `max` {0} to {MOST_JOINTS}, for its {0} joints", joints.len())
        } else if names.contains(&name) || joints.iter().any(|joint| of_kind.contains(joint)) {
            "another has its name or one of its joints".to_owned()
        } else {
            names.insert(name.clone());
            of_kind.extend(&joints);
            known.push(PartChain { name, joints, min, max, is_fan });
            continue;
        };
        let kind = if is_fan { "branches" } else { "chain" };
        notes.push(format!("{kind} \"{name}\" has the number of joints in the file, always: {fault}"));
    }
    known
}

/// Places in the text of the elements of a list of the file.
fn elements<'p>(places: &'p Places, list: &'static str) -> impl Iterator<Item = usize> + 'p {
    let is_name = move |field: &&Field| {
        let parent = field.parent.map(|parent| places.fields()[parent].name);
        field.depth == 3 && field.name == "name" && parent == Some(list) && !places.is_inside_left_out(field)
    };
    places.fields().iter().filter(is_name).map(|field| field.start)
}

/// Sockets of a file, without their joints.
pub(super) fn sockets(places: &Places, files: Vec<SocketFile>, faults: &mut Vec<SourceError>) -> Vec<PartSocket> {
    if files.is_empty() {
        return Vec::new();
    }
    let mut offsets = elements(places, "sockets");
    let mut found: Vec<PartSocket> = Vec::with_capacity(files.len());
    let mut names: HashSet<String> = HashSet::with_capacity(files.len());
    for SocketFile { name, joint, translation, rotation } in files {
        let offset = offsets.next().unwrap_or_default();
        let rest = RestTransform {
            translation: <[f32; 3]>::from(translation).into(),
            rotation: degrees(<[f32; 3]>::from(rotation).into()),
            scale: Vec3::ONE,
        };
        let fault = if name.is_empty() || name.contains('.') {
            "a socket has a name without points".to_owned()
        } else if names.contains(&name) {
            format!("two sockets are called \"{name}\"; give the second another name")
        } else if !rest.is_valid() {
            "the place of the socket is not finite; correct the numbers".to_owned()
        } else {
            let angles = <[f32; 3]>::from(rotation).into();
            names.insert(name.clone());
            found.push(PartSocket { name, label: joint, joint: None, rest, angles, offset });
            continue;
        };
        faults.push(places.error_at(offset, fault));
    }
    found
}

/// Gives sockets their joints. One without a joint is told and left out.
pub(super) fn place_sockets(rig: &Rig, sockets: &mut Vec<PartSocket>, text: &str, faults: &mut Vec<SourceError>) {
    let left_out = PartSocket::put_in_rig(sockets, rig);
    if !left_out.is_empty() {
        let lines = TextLines::new(text);
        faults.extend(left_out.into_iter().map(|(socket, error)| lines.error(socket.offset, error.to_string())));
    }
}

/// Options of a file.
pub(super) fn options(places: &Places, files: Vec<OptionFile>, faults: &mut Vec<SourceError>) -> Vec<PartOption> {
    if files.is_empty() {
        return Vec::new();
    }
    let mut offsets = elements(places, "options");
    let mut found: Vec<PartOption> = Vec::with_capacity(files.len());
    let mut names: HashSet<String> = HashSet::with_capacity(files.len());
    for OptionFile { name, default, description, form, sets } in files {
        let offset = offsets.next().unwrap_or_default();
        let default = default.trim().get_ron().to_owned();
        let sets = sets.into_iter().map(|OptionTargetFile { tag, param }| (tag, param)).collect();
        let option = PartOption { name, default, description, form, sets };
        let fault = if names.contains(&option.name) {
            format!("two options are called \"{}\"; give the second another name", option.name)
        } else if let Err(error) = option.check(&option.default) {
            format!("the default does not fit: {error}")
        } else {
            names.insert(option.name.clone());
            found.push(option);
            continue;
        };
        faults.push(places.error_at(offset, fault));
    }
    found
}

/// The part instances of a file, with their places in the text.
pub(super) fn instances(places: &Places, parts: Vec<PartFile>, faults: &mut Vec<SourceError>) -> Vec<PartInstance> {
    if parts.is_empty() {
        return Vec::new();
    }
    let is_part = |field: &&Field| {
        let parent = field.parent.map(|parent| places.fields()[parent].name);
        field.depth == 3 && field.name == "part" && parent == Some("parts") && !places.is_inside_left_out(field)
    };
    let mut offsets = places.fields().iter().filter(is_part).map(|field| field.start);
    let mut seen = HashSet::new();
    let mut found = Vec::with_capacity(parts.len());
    for file in parts {
        let offset = offsets.next().unwrap_or_default();
        let mut fault = |message: String| faults.push(places.error_at(offset, message));
        let uid = file.uid.unwrap_or_else(|| PartInstance::derived_uid(&file.part, &file.name, &file.onto));
        if !seen.insert(uid) {
            fault(format!("two uses of \"{}\" are called the same; give each a `name`", file.part));
            continue;
        }
        if file.socket.is_some() && (file.parent.is_some() || !file.onto.is_empty()) {
            fault("a part hangs on a socket, below a parent, or goes onto joints; leave out the others".to_owned());
        }
        if !file.onto.is_empty() && file.parent.is_some() {
            fault("a part goes onto joints, or below a parent with its own; leave out `onto` or `parent`".to_owned());
        }
        let counts = file.counts.into_iter().map(|of| (of.chain, of.count));
        let counts: Vec<(String, usize)> =
            file.count.map(|count| (String::new(), count)).into_iter().chain(counts).collect();
        let rest = RestTransform {
            translation: <[f32; 3]>::from(file.translation).into(),
            rotation: degrees(<[f32; 3]>::from(file.rotation).into()),
            scale: Vec3::splat(file.scale),
        };
        if !rest.is_valid() {
            fault("the place of the part is not finite; correct the numbers".to_owned());
            continue;
        }
        let mut changes = Vec::with_capacity(file.changes.len());
        for change in file.changes {
            match change_of(uid, change) {
                Ok(change) => changes.push(change),
                Err(error) => {
                    fault(error.to_string());
                    // Changes are told apart by their numbers.
                    changes.push(PartChange::default());
                }
            }
        }
        found.push(PartInstance {
            uid,
            part: file.part,
            name: file.name,
            onto: file.onto,
            adds: file.adds,
            counts,
            parent: file.parent,
            socket: file.socket,
            options: file.options.into_iter().map(|(name, value)| (name, value.trim().get_ron().to_owned())).collect(),
            rest,
            is_world: file.world,
            prefix: file.prefix,
            mirror: file.mirror,
            off: file.off,
            changes,
            offset,
        });
    }
    found
}

/// Reason why a change of a part cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum PartChangeError {
    /// A change of neither a joint nor a tag, or of both.
    #[error("a change of a part is one of a `joint` or of a `tag`; name one of the two")]
    Subject,
    /// A place, a label or tags for a tag.
    #[error("a tag of a part has no place, no label and no tags; change the `joint`")]
    TagFields,
    /// A switch or parameters for a joint.
    #[error("a joint of a part has no parameters; change the `tag`")]
    JointFields,
    /// A rotation with another number of numbers.
    #[error("a rotation has three angles in degrees, or the four numbers of a quaternion")]
    Rotation,
    /// A place that is not finite.
    #[error("the place of a joint is not finite, or its rotation not of length 1; correct the numbers")]
    Place,
    /// Tags that cannot be read.
    #[error("{}", .0.message)]
    Tags(#[from] SourceError),
}

/// Template of one joint, through which the tags of a change are read.
#[derive(Serialize)]
struct TagTemplate<'a> {
    format: u32,
    name: &'a str,
    joints: &'a [TaggedJoint<'a>],
}

/// Joint with the tags of a change as they are written.
#[derive(Serialize)]
struct TaggedJoint<'a> {
    label: &'a str,
    tags: &'a RawValue,
}

/// A difference of the instance with that uid.
fn change_of(instance: Uid, file: PartChangeFile) -> Result<PartChange, PartChangeError> {
    if file.joint.is_none() == file.tag.is_none() {
        return Err(PartChangeError::Subject);
    }
    let is_of_joint = file.translation.is_some()
        || file.rotation.is_some()
        || file.scale.is_some()
        || file.label.is_some()
        || file.locked.is_some()
        || file.tags.is_some();
    if file.tag.is_some() && is_of_joint {
        return Err(PartChangeError::TagFields);
    }
    let is_of_tag = file.enabled.is_some()
        || file.params.is_some()
        || file.comment.is_some()
        || file.removed
        || !file.unset.is_empty();
    if file.joint.is_some() && is_of_tag {
        return Err(PartChangeError::JointFields);
    }
    let tags = match (&file.tags, &file.joint) {
        (Some(text), Some(joint)) => added_tags(instance, joint, text)?,
        _ => Vec::new(),
    };
    let rotation = file.rotation.map(|text| rotation_of(text.get_ron())).transpose()?;
    let rest = RestTransform {
        translation: file.translation.map_or(Vec3::ZERO, |at| <[f32; 3]>::from(at).into()),
        rotation: rotation.unwrap_or_default(),
        scale: file.scale.map_or(Vec3::ONE, |factors| <[f32; 3]>::from(factors).into()),
    };
    if !rest.is_valid() {
        return Err(PartChangeError::Place);
    }
    Ok(PartChange {
        joint: file.joint,
        tag: file.tag,
        enabled: file.enabled,
        params: file.params.map(|params| params.trim().get_ron().to_owned()),
        unset: file.unset,
        comment: file.comment,
        removed: file.removed,
        label: file.label,
        locked: file.locked,
        translation: file.translation.map(Into::into),
        rotation,
        scale: file.scale.map(Into::into),
        tags,
    })
}

/// Tags that an instance adds to a joint. One whose uid is written has that in the rig; that of another follows from the
/// instance and its names.
fn added_tags(instance: Uid, joint: &str, tags: &RawValue) -> Result<Vec<TagData>, PartChangeError> {
    let joints = &[TaggedJoint { label: joint, tags }];
    let text = ron_text(&TagTemplate { format: FORMAT, name: "part", joints });
    let read = read_text(&text, 1)?;
    let written: HashSet<Uid> = Declarations::find(&text).map_or_else(HashSet::new, |declared| {
        declared.tags.iter().flatten().filter(|tag| tag.is_written).map(|tag| tag.uid).collect()
    });
    let of_instance = PartInstance { uid: instance, ..PartInstance::default() };
    let uid_of = |uid: Uid| if written.contains(&uid) { uid } else { of_instance.uid_of(uid) };
    let mut tags = read.rig.walk().next().map(|joint| joint.data.tags.clone()).unwrap_or_default();
    for tag in &mut tags {
        tag.uid = uid_of(tag.uid);
        if let TagKind::Command { feature: Some(feature), .. } = &mut tag.kind {
            *feature = uid_of(*feature);
        }
    }
    Ok(tags)
}

/// Uids that tags which an instance adds to a joint get where none is written, by their places in the text of their list;
/// `None` where nothing identifies one.
pub fn derived_tag_uids(instance: &PartInstance, joint: &str, tags: &str) -> Vec<Option<Uid>> {
    let text = format!("(format: {FORMAT}, name: \"part\", joints: [(label: {}, tags: {tags})])", quoted(joint));
    let declared = Declarations::find(&text);
    let tags = declared.iter().flat_map(|declared| declared.tags.iter().flatten());
    tags.map(|tag| tag.derived.map(|uid| instance.uid_of(uid))).collect()
}

/// A rotation written as three angles in degrees, or as a quaternion.
fn rotation_of(text: &str) -> Result<Quat, PartChangeError> {
    if let Ok(angles) = ron::from_str::<(f32, f32, f32)>(text) {
        return Ok(degrees(<[f32; 3]>::from(angles).into()));
    }
    let (x, y, z, w) = ron::from_str(text).map_err(|_| PartChangeError::Rotation)?;
    Ok(Quat::from_xyzw(x, y, z, w))
}

impl PartInstance {
    /// Origins of the commands that come of the instance; `fitted` is what comes of the part, and `places` are those of the
    /// changes.
    fn origins(&self, part: &Part, fitted: &Rig, places: &[(usize, Option<usize>)]) -> Vec<(Uid, PartOrigin)> {
        let changes = self.changes.iter().zip(places).filter(|(change, _)| change.params.is_some());
        let targets = PartTargets::new(self, fitted);
        let changed: HashMap<Uid, usize> = changes
            .filter_map(|(change, place)| Some((targets.find_tag(change.tag.as_deref()?).ok()?, place.1?)))
            .collect();
        let title: Arc<str> = self.title().into();
        let tags = fitted.walk().flat_map(|joint| &joint.data.tags);
        let origin = |tag: &TagData| PartOrigin {
            title: title.clone(),
            offset: changed.get(&tag.uid).copied().unwrap_or(self.offset),
            tag: tag.uid,
            source: part.source.clone(),
        };
        tags.map(|tag| (self.uid_of(tag.uid), origin(tag))).collect()
    }
}

impl Template {
    /// Template with its parts in the rig; `part` reads a part by its name.
    ///
    /// # Errors
    /// A part that cannot be had or does not fit, with its place in `source`, the text of the template.
    pub fn with_parts<E: fmt::Display + From<PartError>>(
        self,
        source: &str,
        part: &mut dyn FnMut(&str) -> Result<Arc<Part>, E>,
        mirror: MirrorParams,
    ) -> Result<Self, SourceError> {
        let (template, faults) = self.survey_parts(source, part, mirror);
        match faults.into_iter().next() {
            Some(fault) => Err(fault),
            None => Ok(template.with_unbound_told()),
        }
    }

    /// Template with the parts that can be read and that fit, and all faults of its instances;
    /// [`with_parts`](Self::with_parts) returns the first of these faults. A part that lacks only what a faulty part should
    /// have brought has no fault of its own.
    pub fn survey_parts<E: fmt::Display + From<PartError>>(
        mut self,
        source: &str,
        part: &mut dyn FnMut(&str) -> Result<Arc<Part>, E>,
        mirror: MirrorParams,
    ) -> (Self, Vec<SourceError>) {
        let mut of_parts: Vec<PartSocket> = Vec::new();
        // Places of sockets among those of the file and of its parts.
        let mut by_name: HashMap<String, usize> = HashMap::new();
        note_sockets(&mut by_name, &self.sockets, 0);
        let groups = self.take_groups();
        let hung = std::mem::take(&mut self.hung);
        let mut waiting = hung.clone();
        let (mut faults, mut shortfall, mut brings) = (Vec::new(), Shortfall::default(), 0);
        let places = InstancePlaces::new(source);
        for instance in std::mem::take(&mut self.parts) {
            let message = |error: &dyn fmt::Display| format!("part \"{}\": {error}", instance.title());
            let found = part(&instance.part).and_then(|part| {
                brings += part.size();
                if brings > MOST_BROUGHT {
                    return Err(PartError::TooLarge { most: MOST_BROUGHT }.into());
                }
                let fitted = instance.fitted(&part, mirror)?;
                Ok((part, fitted))
            });
            let (part, fitted) = match found {
                Ok(found) => found,
                Err(error) => {
                    faults.push(SourceError::at(source, instance.offset, message(&error)));
                    shortfall.add_unknown(&instance);
                    continue;
                }
            };
            let among = self.sockets.iter().chain(&of_parts);
            let socket = instance.socket.as_deref().map(|name| {
                let known = by_name.get(name).and_then(|place| among.clone().nth(*place));
                known.map_or_else(|| PartSocket::find(name, among, &self.rig), |socket| socket.in_rig(&self.rig))
            });
            let brought = instance.sockets_in(&self.rig, &part, &fitted);
            let put = socket
                .transpose()
                .map_err(PartError::from)
                .and_then(|socket| instance.put_into(&mut self.rig, &part, &fitted, mirror, socket.as_ref()));
            let changes = places.changes(instance.offset);
            let is_put = put.is_ok();
            let found = match put {
                Ok(put) => {
                    self.notes.extend(put.notes);
                    note_sockets(&mut by_name, &brought, self.sockets.len() + of_parts.len());
                    of_parts.extend(brought);
                    self.origins.extend(instance.origins(&part, &fitted, &changes));
                    // The next parts may hang on them.
                    self.hang_joints(&mut waiting);
                    put.faults
                }
                Err(reason) => {
                    let mut found = instance.faults(&self.rig, &part, &fitted, reason);
                    found.retain(|(_, error)| !shortfall.explains(error));
                    shortfall.add(&instance, &fitted);
                    found
                }
            };
            faults.extend(found.into_iter().map(|(change, error)| {
                let change = change.and_then(|number| changes.get(number));
                let at = change.map_or(instance.offset, |(start, _)| *start);
                SourceError::at(source, at, message(&E::from(error)))
            }));
            if is_put {
                self.instances.push(instance);
            }
        }
        self.give_groups(groups);
        faults.extend(self.settle_hung(&hung, &waiting, source, &shortfall));
        place_sockets(&self.rig, &mut self.sockets, source, &mut faults);
        self.rig.about.sockets = self.sockets.iter().filter_map(PartSocket::header).collect();
        self.sockets.extend(of_parts);
        if !self.instances.is_empty() {
            pair_sides(&mut self.rig);
        }
        bind_references(&mut self.rig, &mut self.unbound);
        (self, faults)
    }
}

/// Notes the places of sockets, of which the first has that place; the first of a name counts.
fn note_sockets(by_name: &mut HashMap<String, usize>, sockets: &[PartSocket], first: usize) {
    for (place, socket) in sockets.iter().enumerate() {
        by_name.entry(socket.name.clone()).or_insert(first + place);
    }
}

/// Makes joints partners whose labels differ by their side alone, where neither has one: a side comes from a part that knows
/// nothing of the other.
fn pair_sides(rig: &mut Rig) {
    for (joint, other) in unpaired_sides(rig) {
        for (of, to) in [(joint, other), (other, joint)] {
            let done = rig.apply(&RigEdit::SetMirror(of, Some(to)));
            debug_assert!(done.is_ok(), "a partner of the rig was refused: {done:?}");
        }
    }
}
