//! Reader of templates: strict, with the place of each error.

mod hung_joints;
mod inputs;
mod instance_places;
mod parts;
mod places;
mod survey;

use std::collections::{BTreeMap, HashMap, HashSet};

use bevy::math::{Quat, Vec3};

use super::{
    FORMAT, FeatureSummary, HungJoint, MAX_BYTES, Template, TemplateHeader,
    comment_placement::take_placement,
    file::{FaceFile, JointFile, TagFile, TemplateFile, known_names},
    header::complete,
    shorthand::{ExplicitText, explicit},
    write::{feature_summaries, needs_summary},
};
use crate::rig::{
    FacePlacement, GROUP_COLORS, GroupData, JointData, RestTransform, Rig, RigAbout, RigEdit, SourceError, TagData,
    TagKind, Uid,
    format::commas::with_missing_commas,
    format::poses::add_poses,
    format::scan::{self, Field},
    format::source::{parse_ron, ron_options, utf8},
    format::version::{Format, blanked},
    part::PartSocket,
    reference::{RigNameIndex, bind_names, refresh_names},
};

use places::Places;

pub(super) use parts::derived_tag_uids;
pub use survey::survey_template;

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

/// Reads a template that stands in another file, where its first line has the number `first_line`.
pub(in crate::rig) fn read_text(source: &str, first_line: usize) -> Result<Template, SourceError> {
    let explicit = explicit(source);
    let read = match explicit.faults.first() {
        Some(fault) => Err(fault.clone()),
        None => read_explicit(&explicit, first_line).map_err(|error| explicit.fault(error)),
    };
    read.map_err(|error| {
        // What follows from a wrong bracket or a missing comma is no fault of its own.
        let lacking = || with_missing_commas(source).1.into_iter().next();
        SourceError::of_brackets(source).or_else(lacking).unwrap_or(error)
    })
}

fn read_explicit(explicit: &ExplicitText, first_line: usize) -> Result<Template, SourceError> {
    let (text, mut notes) = (&*explicit.text, Vec::new());
    let fields = scan::fields(text);
    let known = TEMPLATE.readable(text, &fields, first_line, &mut notes)?;
    let places = Places::new(text, &fields, &[]);
    // Fields make room for what is read.
    drop(fields);
    let file = ron_options().from_str(&known).map_err(|error| SourceError::from_ron(text, &error))?;
    let mut faults = Vec::new();
    let template = build(&places, file, notes, &mut faults);
    match faults.into_iter().next() {
        Some(fault) => Err(fault),
        None => Ok(in_text(explicit, template).with_unbound_told()),
    }
}

/// A template with the places in the source of what is checked later.
fn in_text(explicit: &ExplicitText, mut template: Template) -> Template {
    let parts = template.parts.iter_mut().map(|part| &mut part.offset);
    for offset in parts.chain(template.sockets.iter_mut().map(|socket| &mut socket.offset)) {
        *offset = explicit.in_source(*offset);
    }
    for hung in &mut template.hung {
        if let Some(name) = hung.parent.parse::<Uid>().ok().and_then(|uid| explicit.parent_name(uid)) {
            hung.parent = name.to_owned();
        }
    }
    template
}

/// Reads the header alone; the rest may be missing or invalid. `bytes` may be the first part of a file.
pub fn read_header(bytes: &[u8]) -> Result<TemplateHeader, SourceError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    };
    let fields = scan::fields(text);
    let is_list = |field: &&Field| {
        field.depth == 1
            && matches!(field.name, "chains" | "branches" | "groups" | "inputs" | "joints" | "parts" | "poses")
    };
    let mut passed_over = TEMPLATE.unknown(&fields);
    passed_over.extend(fields.iter().filter(is_list));
    passed_over.sort_unstable_by_key(|field| field.start);
    let whole = parse_ron(&blanked(text, &passed_over));
    let Some(first) = fields.iter().find(is_list) else { return whole.map(|header| complete(header, text)) };
    // If the lists are cut short or invalid, the text before them is enough for the header.
    let header = whole.or_else(|_| parse_ron(&format!("{})", &text[..first.start])))?;
    Ok(complete(header, text))
}

/// The template of a file, without what is at fault.
fn build(places: &Places, file: TemplateFile, mut notes: Vec<String>, faults: &mut Vec<SourceError>) -> Template {
    let mut rig = Rig::new(file.uid, file.name.clone());
    rig.about = RigAbout {
        name: file.name,
        version: file.version,
        kind: file.kind,
        author: file.author,
        description: file.description,
        preview: file.preview,
        ..RigAbout::default()
    };
    let mut seen = HashSet::new();
    let mut groups = Vec::with_capacity(file.groups.len());
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
        groups.push(GroupData { uid: group.uid, name: group.name, color, enabled: group.enabled });
    }
    rig.groups = groups.into_iter().collect();
    rig.inputs = inputs::inputs(places, file.inputs, &mut seen, faults).into_iter().collect();
    let (format, count) = (file.format, file.joints.len());
    let instances = parts::instances(places, file.parts, faults);
    if let Some(claimed) = file.joint_count.filter(|claimed| *claimed != count && instances.is_empty()) {
        notes.push(format!("the header says {claimed} joints, the file has {count}; saving corrects it"));
    }
    let mut hung = Vec::new();
    let may_hang = places.has_parts().then_some(&mut hung);
    add_joints(&mut rig, format, file.joints, places, &mut seen, may_hang, faults);
    let chains = parts::chains(&rig, file.chains, file.branches, &mut notes);
    let mut sockets = parts::sockets(places, file.sockets, faults);
    let options = parts::options(places, file.options, faults);
    rig.about.options.clone_from(&options);
    add_poses(&mut rig, file.poses, &mut |uid, nth, field, message| {
        faults.push(places.error(uid, nth, field, message));
    });
    let mut unbound = Vec::new();
    if instances.is_empty() {
        parts::place_sockets(&rig, &mut sockets, places.text, faults);
        rig.about.sockets = sockets.iter().filter_map(PartSocket::header).collect();
        // References may name what parts bring.
        bind_references(&mut rig, &mut unbound);
        if file.features.is_some_and(|features| feature_summaries(&rig) != sorted(features)) {
            notes.push("the header lists other features than the tags; saving corrects it".to_owned());
        }
        if file.needs.is_some() && file.needs != needs_summary(&rig) {
            notes.push("the header says other needs than the part has; saving corrects it".to_owned());
        }
    }
    Template {
        rig,
        chains,
        sockets,
        options,
        parts: instances,
        hung,
        instances: Vec::new(),
        origins: BTreeMap::new(),
        unbound,
        notes,
    }
}

/// Adds uids to references that people wrote as names alone, and updates the names beside uids. Those that cannot be bound are
/// told with their commands.
pub(super) fn bind_references(rig: &mut Rig, unbound: &mut Vec<(Uid, String)>) {
    let mut edits = Vec::new();
    let names = RigNameIndex::new(rig);
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, feature } = &tag.kind else { continue };
            let (bound, bad) = bind_names(params, &names);
            let on = joint.data.label.as_deref().unwrap_or("without a label");
            let told = |bad| format!("{module} {} on joint {on}: {bad}; it stays as it is", tag.uid);
            unbound.extend(bad.iter().map(|bad| (tag.uid, told(bad))));
            let named = refresh_names(&bound, &names);
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

/// Adds the joints of a file. Those whose parents the file does not have go to `hung`, if parts may bring these.
fn add_joints(
    rig: &mut Rig,
    format: u32,
    mut joints: Vec<JointFile>,
    places: &Places,
    seen: &mut HashSet<Uid>,
    mut hung: Option<&mut Vec<HungJoint>>,
    faults: &mut Vec<SourceError>,
) {
    // Boxed, so that each is freed as soon as its joint is in the rig.
    let mut data: HashMap<Uid, Box<JointData>> = HashMap::with_capacity(joints.len());
    let mut children: HashMap<Option<Uid>, Vec<Uid>> = HashMap::new();
    let known: HashSet<Uid> = joints.iter().map(|joint| joint.uid).collect();
    let features: HashSet<Uid> = joints.iter().flat_map(|joint| &joint.tags).filter_map(feature_uid).collect();
    let mut order = Vec::with_capacity(joints.len());
    // Taken from the end, so that the list of the file makes room for the joints of the rig.
    joints.reverse();
    while let Some(mut joint) = joints.pop() {
        if joints.len() < joints.capacity() / 4 * 3 {
            joints.shrink_to_fit();
        }
        let uid = joint.uid;
        if !seen.insert(uid) {
            faults.push(places.used_twice(uid));
            continue;
        }
        for (what, other) in [("parent", &mut joint.parent), ("mirror", &mut joint.mirror)] {
            let Some(other) = other.take_if(|other| !known.contains(other)) else { continue };
            if places.is_left_out(other) {
                continue;
            }
            match hung.as_deref_mut().filter(|_| what == "parent") {
                Some(hung) => hung.push(HungJoint { joint: uid, parent: other.to_string() }),
                None => faults.push(places.error(uid, 0, what, format!(
                    "joint {uid} names the {what} {other}, which is not in the file; correct it or leave the field out"
                ))),
            }
        }
        if let Some(group) = joint.group.take_if(|group| rig.group(*group).is_none())
            && !places.is_left_out(group)
        {
            faults.push(places.error(
                uid,
                0,
                "group",
                format!("joint {uid} is in the local group {group}, which is not in the file; add it under `groups`"),
            ));
        }
        let rest = rest_of(&joint, places, faults);
        let mut tags = tags_of(joint.tags, &features, places, seen, faults);
        let placed = placement_of(uid, joint.face, places, faults);
        let face = placed.or_else(|| take_placement(format, &mut tags));
        order.push(uid);
        children.entry(joint.parent).or_default().push(uid);
        data.insert(
            uid,
            Box::new(JointData {
                uid,
                label: joint.label,
                group: joint.group,
                kind: joint.kind,
                rest,
                mirror: joint.mirror,
                locked: joint.locked,
                tags,
                face,
            }),
        );
    }
    insert_joints(rig, &order, &children, data, places, faults);
}

/// Rest transform of a joint; the identity, with a fault, where the numbers of the file are no transform.
fn rest_of(joint: &JointFile, places: &Places, faults: &mut Vec<SourceError>) -> RestTransform {
    let (uid, (x, y, z, w)) = (joint.uid, joint.rotation);
    let rest = RestTransform {
        translation: <[f32; 3]>::from(joint.translation).into(),
        rotation: Quat::from_xyzw(x, y, z, w),
        scale: Vec3::from(<[f32; 3]>::from(joint.scale)),
    };
    if rest.is_valid() {
        return rest;
    }
    let wrong = match (rest.translation.is_finite(), rest.scale.is_finite()) {
        (false, _) => "translation",
        (true, false) => "scale",
        (true, true) => "rotation",
    };
    let name = joint.label.clone().unwrap_or_else(|| uid.to_string());
    let message = format!(
        "joint {name} has a transform that is not finite or whose rotation is not of length 1; correct the numbers"
    );
    faults.push(places.error(uid, 0, wrong, message));
    RestTransform::default()
}

/// Tags of a joint, without those whose uids stand before, and without features that the file lacks.
fn tags_of(
    tags: Vec<TagFile>,
    features: &HashSet<Uid>,
    places: &Places,
    seen: &mut HashSet<Uid>,
    faults: &mut Vec<SourceError>,
) -> Vec<TagData> {
    let mut kept = Vec::with_capacity(tags.len());
    for tag in tags {
        let mut tag = tag_from(tag);
        if !seen.insert(tag.uid) {
            faults.push(places.used_twice(tag.uid));
            continue;
        }
        if let TagKind::Command { feature, .. } = &mut tag.kind
            && let Some(missing) = feature.take_if(|feature| !features.contains(feature))
            && !places.is_left_out(missing)
        {
            let message = format!(
                "tag {} is in the feature {missing}, which is not in the file; add it or leave the field out",
                tag.uid
            );
            faults.push(places.error(tag.uid, 0, "feature", message));
        }
        kept.push(tag);
    }
    kept
}

/// Placement of a facial bone; none, with a fault, at a position that is not finite.
fn placement_of(
    uid: Uid,
    face: Option<FaceFile>,
    places: &Places,
    faults: &mut Vec<SourceError>,
) -> Option<FacePlacement> {
    let FaceFile { part, label, at } = face?;
    let position = Vec3::from(<[f32; 3]>::from(at));
    if position.is_finite() {
        return Some(FacePlacement { part, label, position });
    }
    let message = format!("joint {uid} was placed at a position that is not finite; correct the numbers");
    faults.push(places.error(uid, 0, "face", message));
    None
}

/// Puts joints into a rig, parents first, whatever their order in the file. `children` lists the joints below each joint,
/// and those without a parent.
fn insert_joints(
    rig: &mut Rig,
    order: &[Uid],
    children: &HashMap<Option<Uid>, Vec<Uid>>,
    mut data: HashMap<Uid, Box<JointData>>,
    places: &Places,
    faults: &mut Vec<SourceError>,
) {
    // A table that grows is there twice for a moment.
    rig.joints.reserve(order.len());
    let mut stack: Vec<(Option<Uid>, Uid)> = Vec::new();
    let push = |stack: &mut Vec<_>, parent: Option<Uid>| {
        stack.extend(children.get(&parent).into_iter().flatten().rev().map(|child| (parent, *child)));
    };
    push(&mut stack, None);
    let mut next = 0;
    loop {
        while let Some((parent, uid)) = stack.pop() {
            let Some(joint) = data.remove(&uid) else { continue };
            let edit = RigEdit::AddJoint { joint, parent, index: usize::MAX };
            if let Err(error) = rig.apply(&edit) {
                faults.push(places.error(uid, 0, "uid", error.to_string()));
            }
            push(&mut stack, Some(uid));
        }
        // What is left stands below itself: the first of it becomes a root.
        let Some(uid) = order[next..].iter().find(|uid| data.contains_key(uid)).copied() else { return };
        next += order[next..].iter().take_while(|other| **other != uid).count();
        let name = data.get(&uid).and_then(|joint| joint.label.clone()).unwrap_or_else(|| uid.to_string());
        faults.push(places.error(
            uid,
            0,
            "parent",
            format!("joint {name} is its own ancestor; give one joint of the cycle another parent"),
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
