//! Writer of templates.

use std::{
    collections::{BTreeMap, HashSet},
    fmt::Write,
};

use bevy::math::{EulerRot, Quat, Vec3};

use super::{FORMAT, FeatureSummary, NeedsSummary};
use crate::rig::{
    FacePlacement, GroupData, NodeKind, RestTransform, Rig, RigInput, RigJoint, StoredPose, TagData, TagKind, Uid,
    degrees,
    format::poses::{write_stored_pose, write_stored_poses},
    part::{HeaderSocket, OptionForm, PartNeeds, PartOption},
    reference::refresh_names,
};

/// The text of a rig's template. The same rig gives the same bytes. References in parameters are written with the
/// current names beside the uids.
pub fn write_template(rig: &Rig) -> String {
    let mut out = String::new();
    write_into(&mut out, rig, true).unwrap_or_default();
    out
}

/// The text of a rig's template without its stored poses, for projects, which have them beside it.
pub(in crate::rig) fn write_without_poses(rig: &Rig) -> String {
    let mut out = String::new();
    write_into(&mut out, rig, false).unwrap_or_default();
    out
}

fn write_into(out: &mut String, rig: &Rig, with_poses: bool) -> std::fmt::Result {
    let with_poses = with_poses && !rig.stored_poses().is_empty();
    let about = rig.about();
    let format = if with_poses { needed_format(rig) } else { format_without_poses(rig) };
    writeln!(out, "(\n    format: {format},\n    uid: \"{}\",", rig.uid())?;
    writeln!(out, "    name: {},\n    version: {},", quoted(&about.name), quoted(&about.version))?;
    writeln!(out, "    kind: {},\n    author: {},", quoted(&about.kind), quoted(&about.author))?;
    writeln!(out, "    description: {},", quoted(&about.description))?;
    if let Some(preview) = &about.preview {
        writeln!(out, "    preview: {},", quoted(preview))?;
    }
    writeln!(out, "    joint_count: {},", rig.len())?;
    writeln!(out, "    features: {},", feature_list(rig))?;
    if let Some(needs) = needs_text(rig) {
        writeln!(out, "    needs: {needs},")?;
    }
    for (field, elements) in [("sockets", socket_list(rig)), ("options", option_list(rig))] {
        if !elements.is_empty() {
            writeln!(out, "    {field}: [")?;
            elements.iter().try_for_each(|element| writeln!(out, "        {element},"))?;
            writeln!(out, "    ],")?;
        }
    }
    writeln!(out, "    groups: [")?;
    for group in rig.groups() {
        writeln!(out, "        {},", group_text(group))?;
    }
    if !rig.inputs().is_empty() {
        writeln!(out, "    ],\n    inputs: [")?;
        for input in rig.inputs() {
            writeln!(out, "        {},", input_text(input))?;
        }
    }
    writeln!(out, "    ],\n    joints: [")?;
    let features = feature_uids(rig);
    for joint in rig.walk() {
        write_joint(out, rig, joint, &features)?;
    }
    if with_poses {
        writeln!(out, "    ],\n    poses: [")?;
        write_stored_poses(out, rig, "        ")?;
    }
    writeln!(out, "    ],\n)")
}

/// Oldest format that holds all of a rig's template.
pub(super) fn needed_format(rig: &Rig) -> u32 {
    if rig.stored_poses().is_empty() { format_without_poses(rig) } else { FORMAT }
}

fn format_without_poses(rig: &Rig) -> u32 {
    let has_choice = |tag: &TagData| matches!(&tag.kind, TagKind::Feature { choice, .. } if !choice.is_empty());
    let is_newer = |joint: &RigJoint| joint.data.face.is_some() || joint.data.tags.iter().any(has_choice);
    let about = rig.about();
    let has_lists = !(rig.inputs().is_empty() && about.sockets.is_empty() && about.options.is_empty());
    if about.kind == "part" || has_lists || rig.walk().any(is_newer) { FORMAT } else { 1 }
}

/// The list of named features, an element a line.
pub(super) fn feature_list(rig: &Rig) -> String {
    let features = feature_summaries(rig);
    if features.is_empty() {
        return "[]".to_owned();
    }
    let mut out = String::from("[\n");
    for feature in features {
        let switches: Vec<String> = feature.switches.iter().map(|switch| quoted(switch)).collect();
        let (kind, name, switches) = (quoted(&feature.kind), quoted(&feature.name), switches.join(", "));
        out.push_str(&format!("        (kind: {kind}, name: {name}, switches: [{switches}]),\n"));
    }
    out.push_str("    ]");
    out
}

/// Sockets of a rig with the labels of their joints; those whose joint is gone or has no label are left out.
pub(super) fn labelled_sockets(rig: &Rig) -> impl Iterator<Item = (&HeaderSocket, &str)> {
    let label = |socket: &HeaderSocket| rig.joint(socket.joint)?.data.label.as_deref();
    rig.about().sockets.iter().filter_map(move |socket| Some((socket, label(socket)?)))
}

/// Sockets, an element each.
pub(super) fn socket_list(rig: &Rig) -> Vec<String> {
    labelled_sockets(rig).map(|(socket, label)| socket_text(socket, label)).collect()
}

/// A socket on the joint of a label.
pub(in crate::rig) fn socket_text(socket: &HeaderSocket, label: &str) -> String {
    let mut out = format!("(name: {}, joint: {}", quoted(&socket.name), quoted(label));
    for (field, value) in [("translation", socket.translation), ("rotation", socket.rotation)] {
        if value != Vec3::ZERO {
            out.push_str(&format!(", {field}: {}", vector(value)));
        }
    }
    out.push(')');
    out
}

/// Options, an element each.
pub(super) fn option_list(rig: &Rig) -> Vec<String> {
    rig.about().options.iter().map(option_text).collect()
}

/// An option.
pub(in crate::rig) fn option_text(option: &PartOption) -> String {
    let mut out = format!("(name: {}, default: {}", quoted(&option.name), option.default);
    if !option.description.is_empty() {
        out.push_str(&format!(", description: {}", quoted(&option.description)));
    }
    if let Some(form) = &option.form {
        out.push_str(&format!(", form: {}", form_text(form)));
    }
    out.push_str(&format!(", sets: {})", targets_text(option)));
    out
}

/// Form of an option.
pub(super) fn form_text(form: &OptionForm) -> String {
    match form {
        OptionForm::Slider { min, max, step: None } => format!("Slider(min: {min:?}, max: {max:?})"),
        OptionForm::Slider { min, max, step: Some(step) } => {
            format!("Slider(min: {min:?}, max: {max:?}, step: {step:?})")
        }
        OptionForm::Number => "Number".to_owned(),
        OptionForm::Check => "Check".to_owned(),
        OptionForm::Menu { options } => {
            let options: Vec<String> = options.iter().map(|option| quoted(option)).collect();
            format!("Menu(options: [{}])", options.join(", "))
        }
        OptionForm::Text => "Text".to_owned(),
    }
}

/// Parameters that an option sets.
pub(super) fn targets_text(option: &PartOption) -> String {
    let target = |(tag, param): &(String, String)| format!("(tag: {}, param: {})", quoted(tag), quoted(param));
    format!("[{}]", option.sets.iter().map(target).collect::<Vec<_>>().join(", "))
}

/// Needs of a part as text; `None` for another rig.
pub(super) fn needs_text(rig: &Rig) -> Option<String> {
    let NeedsSummary { joints, sockets } = needs_summary(rig)?;
    let list = |names: &[String]| names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", ");
    Some(format!("(joints: [{}], sockets: [{}])", list(&joints), list(&sockets)))
}

/// A local group.
pub(super) fn group_text(group: &GroupData) -> String {
    let [r, g, b] = group.color;
    let enabled = if group.enabled { "" } else { ", enabled: false" };
    format!("(uid: \"{}\", name: {}, color: ({r:?}, {g:?}, {b:?}){enabled})", group.uid, quoted(&group.name))
}

/// A declared input.
pub(super) fn input_text(input: &RigInput) -> String {
    let RestTransform { translation, rotation, scale } = input.rest;
    let mut out = format!("(uid: \"{}\", name: {}", input.uid, quoted(&input.name));
    if translation != Vec3::ZERO {
        out.push_str(&format!(", translation: {}", vector(translation)));
    }
    if rotation != Quat::IDENTITY {
        out.push_str(&format!(", rotation: {}", quaternion(rotation)));
    }
    if scale != Vec3::ONE {
        out.push_str(&format!(", scale: {}", vector(scale)));
    }
    out.push(')');
    out
}

/// A joint with its tags.
pub(super) fn joint_text(rig: &Rig, joint: &RigJoint, features: &HashSet<Uid>) -> String {
    let mut out = String::new();
    let written = write_joint(&mut out, rig, joint, features);
    debug_assert!(written.is_ok(), "writing to a string does not fail");
    element(&out)
}

/// A tag.
pub(super) fn tag_text(rig: &Rig, tag: &TagData, features: &HashSet<Uid>) -> String {
    let mut out = String::new();
    let written = write_tag(&mut out, rig, tag, features);
    debug_assert!(written.is_ok(), "writing to a string does not fail");
    element(&out)
}

/// A stored pose.
pub(super) fn pose_text(pose: &StoredPose) -> String {
    let mut out = String::new();
    let written = write_stored_pose(&mut out, pose, "        ");
    debug_assert!(written.is_ok(), "writing to a string does not fail");
    element(&out)
}

/// Placement of a facial bone.
pub(super) fn face_text(face: &FacePlacement) -> String {
    let FacePlacement { part, label, position } = face;
    format!("(part: {part:?}, label: {}, at: {})", quoted(label), vector(*position))
}

/// An element of a list without the comma behind it.
fn element(text: &str) -> String {
    let text = text.trim();
    text.strip_suffix(',').unwrap_or(text).to_owned()
}

/// Uids of the feature tags of a rig.
pub(super) fn feature_uids(rig: &Rig) -> HashSet<Uid> {
    rig.walk().flat_map(|joint| &joint.data.tags).filter_map(feature_uid).collect()
}

/// Needs of a rig as a part; `None` for one of another kind.
pub(super) fn needs_summary(rig: &Rig) -> Option<NeedsSummary> {
    let needs = (rig.about().kind == "part").then(|| PartNeeds::of(rig))?;
    Some(NeedsSummary { joints: needs.joints, sockets: needs.sockets.iter().map(ToString::to_string).collect() })
}

/// Named features of the rig with their switches, sorted.
pub(super) fn feature_summaries(rig: &Rig) -> Vec<FeatureSummary> {
    features_of(rig.walk().flat_map(|joint| &joint.data.tags))
}

/// Named features among tags with their switches, sorted.
pub(super) fn features_of<'r>(tags: impl Iterator<Item = &'r TagData>) -> Vec<FeatureSummary> {
    let mut features: BTreeMap<(&str, &str), Vec<&str>> = BTreeMap::new();
    for tag in tags {
        if let TagKind::Feature { kind, name, switch, .. } = &tag.kind
            && !name.is_empty()
        {
            let switches = features.entry((kind, name)).or_default();
            if !switch.is_empty() && !switches.contains(&switch.as_str()) {
                switches.push(switch);
            }
        }
    }
    let summary = |((kind, name), mut switches): ((&str, &str), Vec<&str>)| {
        switches.sort_unstable();
        FeatureSummary {
            kind: kind.to_owned(),
            name: name.to_owned(),
            switches: switches.into_iter().map(str::to_owned).collect(),
        }
    };
    features.into_iter().map(summary).collect()
}

fn feature_uid(tag: &TagData) -> Option<Uid> {
    matches!(tag.kind, TagKind::Feature { .. }).then_some(tag.uid)
}

/// Writes a joint. References to deleted parts of the rig are left out, because readers refuse them.
fn write_joint(out: &mut String, rig: &Rig, joint: &RigJoint, features: &HashSet<Uid>) -> std::fmt::Result {
    let data = &joint.data;
    write!(out, "        (\n            uid: \"{}\",", data.uid)?;
    write_uid(out, "parent", joint.parent)?;
    if let Some(label) = &data.label {
        write!(out, "\n            label: {},", quoted(label))?;
    }
    write_uid(out, "group", data.group)?;
    write_uid(out, "mirror", data.mirror.filter(|mirror| rig.joint(*mirror).is_some()))?;
    if data.kind == NodeKind::Null {
        write!(out, "\n            kind: Null,")?;
    }
    if data.locked {
        write!(out, "\n            locked: true,")?;
    }
    let rest = &data.rest;
    write!(out, "\n            translation: {},", vector(rest.translation))?;
    if rest.rotation != Quat::IDENTITY {
        write!(out, "\n            rotation: {},", quaternion(rest.rotation))?;
    }
    if rest.scale != Vec3::ONE {
        write!(out, "\n            scale: {},", vector(rest.scale))?;
    }
    if let Some(face) = &data.face {
        write!(out, "\n            face: {},", face_text(face))?;
    }
    if !data.tags.is_empty() {
        writeln!(out, "\n            tags: [")?;
        for tag in &data.tags {
            write_tag(out, rig, tag, features)?;
        }
        write!(out, "            ],")?;
    }
    writeln!(out, "\n        ),")
}

fn write_tag(out: &mut String, rig: &Rig, tag: &TagData, features: &HashSet<Uid>) -> std::fmt::Result {
    let name = match tag.kind {
        TagKind::Command { .. } => "Command",
        TagKind::Feature { .. } => "Feature",
    };
    write!(out, "                {name}(\n                    uid: \"{}\",", tag.uid)?;
    if !tag.enabled {
        write!(out, "\n                    enabled: false,")?;
    }
    if !tag.comment.is_empty() {
        write!(out, "\n                    comment: {},", quoted(&tag.comment))?;
    }
    match &tag.kind {
        TagKind::Command { module, params, feature } => {
            write!(out, "\n                    module: {},", quoted(module))?;
            if let Some(feature) = feature.filter(|feature| features.contains(feature)) {
                write!(out, "\n                    feature: \"{feature}\",")?;
            }
            write!(out, "\n                    params: {},", refresh_names(params, rig))?;
        }
        TagKind::Feature { kind, name, switch, choice } => {
            write!(out, "\n                    kind: {}, name: {},", quoted(kind), quoted(name))?;
            if !switch.is_empty() {
                write!(out, "\n                    switch: {},", quoted(switch))?;
            }
            if !choice.is_empty() {
                write!(out, "\n                    choice: {},", quoted(choice))?;
            }
        }
    }
    writeln!(out, "\n                ),")
}

fn write_uid(out: &mut String, field: &str, uid: Option<Uid>) -> std::fmt::Result {
    match uid {
        Some(uid) => write!(out, "\n            {field}: \"{uid}\","),
        None => Ok(()),
    }
}

pub(in crate::rig) fn vector(v: Vec3) -> String {
    format!("({:?}, {:?}, {:?})", v.x, v.y, v.z)
}

/// A rotation as the four numbers of its quaternion.
pub(in crate::rig) fn quaternion(q: Quat) -> String {
    format!("({:?}, {:?}, {:?}, {:?})", q.x, q.y, q.z, q.w)
}

/// A rotation as angles in whole thousandths of a degree where these are exact, else as a quaternion.
pub(in crate::rig) fn rotation_text(rotation: Quat) -> String {
    let (x, y, z) = rotation.to_euler(EulerRot::XYZ);
    let angles = Vec3::new(x, y, z).map(|angle| (angle.to_degrees() * 1000.0).round() / 1000.0);
    if degrees(angles) == rotation { vector(angles) } else { quaternion(rotation) }
}

/// A RON string literal.
pub(in crate::rig) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => out.push_str(&format!("\\u{{{:x}}}", c as u32)),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
