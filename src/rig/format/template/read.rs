//! Reader of templates: strict, with the place of each error.

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    sync::Arc,
};

use bevy::math::{Quat, Vec3};

use super::{
    FORMAT, FeatureSummary, MAX_BYTES, Template, TemplateHeader,
    comment_placement::take_placement,
    file::{FaceFile, JointFile, PartChangeFile, PartFile, TagFile, TemplateFile, known_names},
    header::complete,
    quoted,
    shorthand::{Explicit, explicit},
    write::{feature_summaries, needs_summary},
};
use crate::rig::{
    FacePlacement, GROUP_COLORS, GroupData, JointData, RestTransform, Rig, RigAbout, RigEdit, SourceError, TagData,
    TagKind, Uid, degrees,
    format::poses::add_poses,
    format::scan::{self, Field},
    format::source::{parse_ron, ron_options, utf8},
    format::version::{Format, blanked},
    part::{MirrorParams, PartChange, PartInstance},
    reference::{bind_names, refresh_names},
};

const TEMPLATE: Format = Format { what: "template", number: FORMAT, known: known_names };

/// The text of a template's bytes.
///
/// # Errors
/// Bytes that are no UTF-8, none at all, or more than [`MAX_BYTES`].
pub fn text_of(bytes: &[u8]) -> Result<&str, SourceError> {
    utf8(bytes, MAX_BYTES, "template")
}

/// Reads a template. An error anywhere refuses the whole template.
pub fn read_template(bytes: &[u8]) -> Result<Template, SourceError> {
    read_text(text_of(bytes)?, 1)
}

/// Reads a template as far as it goes, to tell all that is wrong with it: with every fault of its structure, in the
/// order of the text, and without what is at fault (a joint without its group, say).
///
/// # Errors
/// A text that cannot be read as a template at all, with the faults that were found before that.
pub fn survey_template(bytes: &[u8]) -> Result<(Template, Vec<SourceError>), Vec<SourceError>> {
    let source = text_of(bytes).map_err(|error| vec![error])?;
    let explicit = explicit(source);
    let (text, mut notes, mut faults) = (&*explicit.text, Vec::new(), Vec::new());
    let in_source = |faults: Vec<SourceError>| {
        let mut all: Vec<SourceError> = faults.into_iter().map(|fault| explicit.fault(fault)).collect();
        all.extend(explicit.faults.iter().cloned());
        all.sort_by_key(|fault| fault.offset);
        all
    };
    let fields = scan::fields(text);
    let readable = TEMPLATE.readable(text, &fields, 1, &mut notes).map_err(|error| in_source(vec![error]))?;
    // In a file of a newer format they are notes.
    let unknown = if matches!(readable, Cow::Borrowed(_)) { TEMPLATE.unknown(&fields) } else { Vec::new() };
    for field in &unknown {
        let message = format!("there is no field `{}` here; remove it or correct its name", field.name);
        faults.push(SourceError::at(text, field.start, message));
    }
    let known = if unknown.is_empty() { readable } else { Cow::Owned(blanked(text, &unknown)) };
    let file = match ron_options().from_str(&known) {
        Ok(file) => file,
        Err(error) => {
            faults.push(SourceError::from_ron(text, &error));
            return Err(in_source(faults));
        }
    };
    let (rig, parts) = build(&Places { text, fields: &fields }, file, &mut notes, &mut faults);
    let parts = parts_in(&explicit, parts);
    Ok((Template { rig, parts, instances: Vec::new(), notes }, in_source(faults)))
}

/// Reads a template that stands in another file, where its first line has the number `first_line`.
pub(in crate::rig) fn read_text(source: &str, first_line: usize) -> Result<Template, SourceError> {
    let explicit = explicit(source);
    match explicit.faults.first() {
        Some(fault) => Err(fault.clone()),
        None => read_explicit(&explicit, first_line).map_err(|error| explicit.fault(error)),
    }
}

fn read_explicit(explicit: &Explicit, first_line: usize) -> Result<Template, SourceError> {
    let (text, mut notes) = (&*explicit.text, Vec::new());
    let fields = scan::fields(text);
    let known = TEMPLATE.readable(text, &fields, first_line, &mut notes)?;
    let file = ron_options().from_str(&known).map_err(|error| SourceError::from_ron(text, &error))?;
    let mut faults = Vec::new();
    let (rig, parts) = build(&Places { text, fields: &fields }, file, &mut notes, &mut faults);
    match faults.into_iter().next() {
        Some(fault) => Err(fault),
        None => Ok(Template { rig, parts: parts_in(explicit, parts), instances: Vec::new(), notes }),
    }
}

/// Part instances with their places in the source.
fn parts_in(explicit: &Explicit, mut parts: Vec<PartInstance>) -> Vec<PartInstance> {
    for part in &mut parts {
        part.offset = explicit.in_source(part.offset);
    }
    parts
}

/// Reads the header alone; the rest may be missing or invalid. `bytes` may be the first part of a file.
pub fn read_header(bytes: &[u8]) -> Result<TemplateHeader, SourceError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    };
    let fields = scan::fields(text);
    let is_list = |field: &&Field| field.depth == 1 && matches!(field.name, "groups" | "joints" | "parts" | "poses");
    let mut passed_over = TEMPLATE.unknown(&fields);
    passed_over.extend(fields.iter().filter(is_list));
    passed_over.sort_unstable_by_key(|field| field.start);
    let whole = parse_ron(&blanked(text, &passed_over));
    let Some(first) = fields.iter().find(is_list) else { return whole.map(|header| complete(header, text)) };
    // If the lists are cut short or invalid, the text before them is enough for the header.
    let header = whole.or_else(|_| parse_ron(&format!("{})", &text[..first.start])))?;
    Ok(complete(header, text))
}

/// The rig of a file, without what is at fault.
fn build(
    places: &Places,
    file: TemplateFile,
    notes: &mut Vec<String>,
    faults: &mut Vec<SourceError>,
) -> (Rig, Vec<PartInstance>) {
    let mut rig = Rig::new(file.uid, file.name.clone());
    rig.about = RigAbout {
        name: file.name,
        version: file.version,
        kind: file.kind,
        author: file.author,
        description: file.description,
        preview: file.preview,
    };
    let mut seen = HashSet::new();
    for (number, group) in file.groups.into_iter().enumerate() {
        if !seen.insert(group.uid) {
            faults.push(places.used_twice(group.uid));
            continue;
        }
        let mut color = group.color.map_or(GROUP_COLORS[number % GROUP_COLORS.len()], <[f32; 3]>::from);
        if color.iter().any(|part| !part.is_finite()) {
            let message = "the colour is not finite; use numbers from 0 to 1".to_owned();
            faults.push(places.error(group.uid, 0, "color", message));
            color = [0.5; 3];
        }
        rig.groups.push(GroupData { uid: group.uid, name: group.name, color, enabled: group.enabled });
    }
    let (format, count) = (file.format, file.joints.len());
    let parts = part_instances(places, file.parts, faults);
    if let Some(claimed) = file.joint_count.filter(|claimed| *claimed != count && parts.is_empty()) {
        notes.push(format!("the header says {claimed} joints, the file has {count}; saving corrects it"));
    }
    add_joints(&mut rig, format, file.joints, places, &mut seen, faults);
    add_poses(&mut rig, file.poses, &mut |uid, nth, field, message| {
        faults.push(places.error(uid, nth, field, message));
    });
    if !parts.is_empty() {
        // References may name what parts bring.
        return (rig, parts);
    }
    bind_references(&mut rig, notes);
    if file.features.is_some_and(|features| feature_summaries(&rig) != sorted(features)) {
        notes.push("the header lists other features than the tags; saving corrects it".to_owned());
    }
    if file.needs.is_some() && file.needs != needs_summary(&rig) {
        notes.push("the header says other needs than the part has; saving corrects it".to_owned());
    }
    (rig, parts)
}

/// The part instances of a file, with their places in the text.
fn part_instances(places: &Places, parts: Vec<PartFile>, faults: &mut Vec<SourceError>) -> Vec<PartInstance> {
    let is_part = |field: &&Field| {
        let parent = field.parent.map(|parent| places.fields[parent].name);
        field.depth == 3 && field.name == "part" && parent == Some("parts")
    };
    let mut offsets = places.fields.iter().filter(is_part).map(|field| field.start);
    let mut seen = HashSet::new();
    let mut found = Vec::with_capacity(parts.len());
    for file in parts {
        let offset = offsets.next().unwrap_or_default();
        let mut fault = |message: String| faults.push(SourceError::at(places.text, offset, message));
        let onto = file.onto.join(" ");
        let title = if file.name.is_empty() { onto.as_str() } else { &file.name };
        let uid = file.uid.unwrap_or_else(|| Uid::derived(["part instance", file.part.as_str(), title]));
        if !seen.insert(uid) {
            fault(format!("two uses of \"{}\" are called the same; give each a `name`", file.part));
            continue;
        }
        if !file.onto.is_empty() && file.parent.is_some() {
            fault("a part goes onto joints, or below a parent with its own; leave out `onto` or `parent`".to_owned());
        }
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
            match change_of(change) {
                Ok(change) => changes.push(change),
                Err(message) => fault(message),
            }
        }
        found.push(PartInstance {
            uid,
            part: file.part,
            name: file.name,
            onto: file.onto,
            parent: file.parent,
            rest,
            prefix: file.prefix,
            mirror: file.mirror,
            off: file.off,
            changes,
            offset,
        });
    }
    found
}

fn change_of(file: PartChangeFile) -> Result<PartChange, String> {
    if file.joint.is_none() == file.tag.is_none() {
        return Err("a change of a part is one of a `joint` or of a `tag`; name one of the two".to_owned());
    }
    if file.tag.is_some() && (file.translation.is_some() || file.rotation.is_some() || file.tags.is_some()) {
        return Err("a tag of a part has no place and no tags; change the `joint`".to_owned());
    }
    if file.joint.is_some() && (file.enabled.is_some() || file.params.is_some()) {
        return Err("a joint of a part has no parameters; change the `tag`".to_owned());
    }
    let mut tags = Vec::new();
    if let (Some(text), Some(joint)) = (&file.tags, &file.joint) {
        let text =
            format!("(format: 2, name: \"part\", joints: [(label: {}, tags: {})])", quoted(joint), text.get_ron());
        let read = read_text(&text, 1).map_err(|error| error.message)?;
        tags = read.rig.walk().next().map(|joint| joint.data.tags.clone()).unwrap_or_default();
    }
    Ok(PartChange {
        joint: file.joint,
        tag: file.tag,
        enabled: file.enabled,
        params: file.params.map(|params| params.trim().get_ron().to_owned()),
        translation: file.translation.map(Into::into),
        rotation: file.rotation.map(Into::into),
        tags,
    })
}

impl Template {
    /// The template with its parts, each of which `part` gives.
    ///
    /// # Errors
    /// A part that cannot be had or does not fit, with its place in `source`, the text of the template.
    pub fn with_parts(
        mut self,
        source: &str,
        part: &mut dyn FnMut(&str) -> Result<Arc<Rig>, String>,
        mirror: MirrorParams,
    ) -> Result<Self, SourceError> {
        for instance in std::mem::take(&mut self.parts) {
            let put = part(&instance.part).and_then(|part| instance.put_into(&mut self.rig, &part, mirror));
            match put {
                Ok(notes) => self.notes.extend(notes),
                Err(message) => {
                    let message = format!("part \"{}\": {message}", instance.title());
                    return Err(SourceError::at(source, instance.offset, message));
                }
            }
            self.instances.push(instance);
        }
        bind_references(&mut self.rig, &mut self.notes);
        Ok(self)
    }
}

/// Adds uids to references that people wrote as names alone, and updates the names beside uids.
fn bind_references(rig: &mut Rig, notes: &mut Vec<String>) {
    let mut edits = Vec::new();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, feature } = &tag.kind else { continue };
            let (bound, bad) = bind_names(params, rig);
            let on = joint.data.label.as_deref().unwrap_or("without a label");
            notes.extend(bad.iter().map(|bad| format!("{module} {} on joint {on}: {bad}; it stays as it is", tag.uid)));
            let named = refresh_names(&bound, rig);
            if *named != **params {
                let kind = TagKind::Command { module: module.clone(), params: named.into_owned(), feature: *feature };
                edits.push(RigEdit::SetTag(joint.data.uid, Box::new(TagData { kind, ..tag.clone() })));
            }
        }
    }
    for edit in edits {
        let done = rig.apply(&edit);
        debug_assert!(done.is_ok(), "a tag of the rig was refused: {done:?}");
    }
}

fn sorted(mut features: Vec<FeatureSummary>) -> Vec<FeatureSummary> {
    features.iter_mut().for_each(|feature| feature.switches.sort_unstable());
    features.sort_unstable();
    features
}

fn add_joints(
    rig: &mut Rig,
    format: u32,
    joints: Vec<JointFile>,
    places: &Places,
    seen: &mut HashSet<Uid>,
    faults: &mut Vec<SourceError>,
) {
    let mut data = HashMap::with_capacity(joints.len());
    let mut children: HashMap<Option<Uid>, Vec<Uid>> = HashMap::new();
    let known: HashSet<Uid> = joints.iter().map(|joint| joint.uid).collect();
    let features: HashSet<Uid> = joints.iter().flat_map(|joint| &joint.tags).filter_map(feature_uid).collect();
    let mut order = Vec::with_capacity(joints.len());
    for mut joint in joints {
        let uid = joint.uid;
        if !seen.insert(uid) {
            faults.push(places.used_twice(uid));
            continue;
        }
        for (what, other) in [("parent", &mut joint.parent), ("mirror", &mut joint.mirror)] {
            if let Some(other) = other.take_if(|other| !known.contains(other)) {
                faults.push(places.error(uid, 0, what, format!(
                    "joint {uid} names the {what} {other}, which is not in the file; correct it or leave the field out"
                )));
            }
        }
        if let Some(group) = joint.group.take_if(|group| rig.group(*group).is_none()) {
            faults.push(places.error(
                uid,
                0,
                "group",
                format!("joint {uid} is in the local group {group}, which is not in the file; add it under `groups`"),
            ));
        }
        let (x, y, z, w) = joint.rotation;
        let mut rest = RestTransform {
            translation: <[f32; 3]>::from(joint.translation).into(),
            rotation: Quat::from_xyzw(x, y, z, w),
            scale: Vec3::from(<[f32; 3]>::from(joint.scale)),
        };
        if !rest.is_valid() {
            let finite = |v: Vec3| v.is_finite();
            let wrong = match (finite(rest.translation), finite(rest.scale)) {
                (false, _) => "translation",
                (true, false) => "scale",
                (true, true) => "rotation",
            };
            faults.push(places.error(uid, 0, wrong, format!(
                "joint {uid} has a transform that is not finite or whose rotation is not of length 1; correct the numbers"
            )));
            rest = RestTransform::default();
        }
        let mut tags = Vec::with_capacity(joint.tags.len());
        for tag in joint.tags {
            let mut tag = tag_from(tag);
            if !seen.insert(tag.uid) {
                faults.push(places.used_twice(tag.uid));
                continue;
            }
            if let TagKind::Command { feature, .. } = &mut tag.kind
                && let Some(missing) = feature.take_if(|feature| !features.contains(feature))
            {
                faults.push(places.error(
                    tag.uid,
                    0,
                    "feature",
                    format!(
                        "tag {} is in the feature {missing}, which is not in the file; add it or leave the field out",
                        tag.uid
                    ),
                ));
            }
            tags.push(tag);
        }
        let mut placed = joint.face.map(|FaceFile { part, label, at }| {
            let position = Vec3::from(<[f32; 3]>::from(at));
            FacePlacement { part, label, position }
        });
        if placed.take_if(|placed| !placed.position.is_finite()).is_some() {
            let message = format!("joint {uid} was placed at a position that is not finite; correct the numbers");
            faults.push(places.error(uid, 0, "face", message));
        }
        let face = placed.or_else(|| take_placement(format, &mut tags));
        order.push(uid);
        children.entry(joint.parent).or_default().push(uid);
        data.insert(
            uid,
            JointData {
                uid,
                label: joint.label,
                group: joint.group,
                kind: joint.kind,
                rest,
                mirror: joint.mirror,
                locked: joint.locked,
                tags,
                face,
            },
        );
    }
    // Parents first, whatever the order in the file.
    let mut stack: Vec<(Option<Uid>, Uid)> = Vec::new();
    let push = |stack: &mut Vec<_>, parent: Option<Uid>| {
        stack.extend(children.get(&parent).into_iter().flatten().rev().map(|child| (parent, *child)));
    };
    push(&mut stack, None);
    let mut next = 0;
    loop {
        while let Some((parent, uid)) = stack.pop() {
            let Some(joint) = data.remove(&uid) else { continue };
            let edit = RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX };
            if let Err(error) = rig.apply(&edit) {
                faults.push(places.error(uid, 0, "uid", error.to_string()));
            }
            push(&mut stack, Some(uid));
        }
        // What is left stands below itself: the first of it becomes a root.
        let Some(uid) = order[next..].iter().find(|uid| data.contains_key(uid)).copied() else { return };
        next += order[next..].iter().take_while(|other| **other != uid).count();
        faults.push(places.error(
            uid,
            0,
            "parent",
            format!("joint {uid} is its own ancestor; give one joint of the cycle another parent"),
        ));
        stack.push((None, uid));
    }
}

fn feature_uid(tag: &TagFile) -> Option<Uid> {
    match tag {
        TagFile::Feature { uid, .. } => Some(*uid),
        TagFile::Command { .. } => None,
    }
}

fn tag_from(tag: TagFile) -> TagData {
    match tag {
        TagFile::Command { uid, enabled, comment, module, feature, params } => TagData {
            uid,
            enabled,
            comment,
            kind: TagKind::Command { module, params: params.trim().get_ron().to_owned(), feature },
        },
        TagFile::Feature { uid, enabled, comment, kind, name, switch, choice } => {
            TagData { uid, enabled, comment, kind: TagKind::Feature { kind, name, switch, choice } }
        }
    }
}

/// Finds the places of declarations in the text.
struct Places<'a> {
    text: &'a str,
    fields: &'a [Field<'a>],
}

impl Places<'_> {
    fn used_twice(&self, uid: Uid) -> SourceError {
        self.error(uid, 1, "uid", format!("uid {uid} is used twice; give the second a uid of its own"))
    }

    /// An error at the field `name` of the `nth` declaration with that uid (or of the first).
    fn error(&self, uid: Uid, nth: usize, name: &str, message: String) -> SourceError {
        let digits = uid.to_string();
        let declares = |field: &&Field| {
            let value = self.text[field.value..field.end].trim_start().trim_start_matches('"');
            field.depth > 1
                && field.name == "uid"
                && known_names(self.fields, field).is_some()
                && value.get(..digits.len()).is_some_and(|value| value.eq_ignore_ascii_case(&digits))
        };
        let thing = self.fields.iter().filter(declares).nth(nth).or_else(|| self.fields.iter().find(declares));
        let field = thing.and_then(|uid| self.fields.iter().find(|f| f.bracket == uid.bracket && f.name == name));
        let at = field.or(thing).map_or(0, |field| field.start);
        SourceError::at(self.text, at, message)
    }
}
