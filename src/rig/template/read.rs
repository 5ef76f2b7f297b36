//! Reading templates, strictly and with places.

use std::collections::{HashMap, HashSet};

use bevy::math::{Quat, Vec3};
use ron::value::RawValue;
use serde::Deserialize;

use super::{FORMAT, FeatureSummary, MAX_BYTES, Template, TemplateHeader, write::feature_summaries};
use crate::rig::{
    GroupData, JointData, NodeKind, RestTransform, Rig, RigAbout, RigEdit, SourceError, Tag, TagKind, Uid,
    source::{byte_offset, parse_ron, ron_options, utf8},
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TemplateFile {
    format: u32,
    uid: Uid,
    name: String,
    #[serde(default)]
    version: String,
    #[serde(default)]
    kind: String,
    #[serde(default)]
    author: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    preview: Option<String>,
    #[serde(default)]
    joint_count: Option<usize>,
    #[serde(default)]
    features: Vec<FeatureSummary>,
    #[serde(default)]
    groups: Vec<GroupFile>,
    #[serde(default)]
    joints: Vec<JointFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupFile {
    uid: Uid,
    name: String,
    color: (f32, f32, f32),
    #[serde(default = "yes")]
    enabled: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointFile {
    uid: Uid,
    #[serde(default)]
    parent: Option<Uid>,
    #[serde(default)]
    label: Option<String>,
    #[serde(default)]
    group: Option<Uid>,
    #[serde(default)]
    mirror: Option<Uid>,
    #[serde(default)]
    kind: NodeKind,
    #[serde(default)]
    locked: bool,
    translation: (f32, f32, f32),
    #[serde(default = "no_rotation")]
    rotation: (f32, f32, f32, f32),
    #[serde(default = "no_scale")]
    scale: (f32, f32, f32),
    #[serde(default)]
    tags: Vec<TagFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum TagFile {
    Command {
        uid: Uid,
        #[serde(default = "yes")]
        enabled: bool,
        #[serde(default)]
        comment: String,
        module: String,
        #[serde(default)]
        feature: Option<Uid>,
        params: Box<RawValue>,
    },
    Feature {
        uid: Uid,
        #[serde(default = "yes")]
        enabled: bool,
        #[serde(default)]
        comment: String,
        kind: String,
        name: String,
        #[serde(default)]
        switch: String,
    },
}

fn yes() -> bool {
    true
}

fn no_rotation() -> (f32, f32, f32, f32) {
    (0.0, 0.0, 0.0, 1.0)
}

fn no_scale() -> (f32, f32, f32) {
    (1.0, 1.0, 1.0)
}

/// Reads a template. Nothing is returned unless all of it is right.
pub fn read_template(bytes: &[u8]) -> Result<Template, SourceError> {
    let text = utf8(bytes, MAX_BYTES, "template")?;
    let mut notes = Vec::new();
    let file = parse(text, &mut notes)?;
    let rig = build(text, file, &mut notes)?;
    Ok(Template { rig, notes })
}

/// Reads the header alone; what follows may be missing or wrong. `bytes` may be the first part of a file.
pub fn read_header(bytes: &[u8]) -> Result<TemplateHeader, SourceError> {
    let valid = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    };
    let end = scan_fields(valid).find(|field| field.depth == 1 && matches!(field.name, "groups" | "joints"));
    let header = match end {
        Some(field) => format!("{})", &valid[..field.start]),
        None => valid.to_owned(),
    };
    parse_ron(&header)
}

/// Parses the text; fields that only a newer format has are blanked out one by one and named in `notes`.
fn parse(text: &str, notes: &mut Vec<String>) -> Result<TemplateFile, SourceError> {
    let format = scan_fields(text)
        .find(|field| field.depth == 1 && field.name == "format")
        .and_then(|field| {
            let rest = text[field.value..].trim_start();
            let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            rest[..digits].parse::<u32>().ok()
        });
    if format == Some(0) {
        return Err(SourceError::at(text, 0, "format 0 was never released; the first is format: 1"));
    }
    let newer = format.is_some_and(|format| format > FORMAT);
    let mut text = std::borrow::Cow::Borrowed(text);
    for _ in 0..1000 {
        let error = match ron_options().from_str::<TemplateFile>(&text) {
            Ok(file) => {
                if newer {
                    notes.insert(0, format!(
                        "the template has format {}, newer than {FORMAT}: update Rigsmith, or save under another name to keep what it does not know",
                        file.format
                    ));
                }
                return Ok(file);
            }
            Err(error) => error,
        };
        let unknown = match &error.code {
            ron::Error::NoSuchStructField { found, .. } if newer => found.clone(),
            _ => return Err(SourceError::from_ron(&text, &error)),
        };
        let place = byte_offset(&text, error.span.end);
        let field = scan_fields(&text).filter(|field| field.name == unknown && field.start <= place).last();
        let Some(field) = field else { return Err(SourceError::from_ron(&text, &error)) };
        let (start, end) = (field.start, field.end);
        let line = text[..start].matches('\n').count() + 1;
        notes.push(format!("line {line}: the field `{unknown}` is of a newer format and is not kept"));
        let blank: String = text[start..end].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
        text = format!("{}{blank}{}", &text[..start], &text[end..]).into();
    }
    Err(SourceError::at(&text, 0, "the template has over a thousand fields of a newer format; update Rigsmith"))
}

/// A field in RON text: where its name starts, where its value starts and ends (with the comma, if any).
struct Field<'a> {
    name: &'a str,
    depth: usize,
    start: usize,
    value: usize,
    end: usize,
}

/// All `name: value` pairs of a RON text in the order of their names, whatever they mean.
fn scan_fields(text: &str) -> impl Iterator<Item = Field<'_>> {
    let tokens = tokens(text);
    let mut fields = Vec::new();
    let mut depth = 0_usize;
    for (number, token) in tokens.iter().enumerate() {
        match token.text.as_bytes()[0] {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            b':' if number > 0 && token.text == ":" => {
                let name = &tokens[number - 1];
                let starts = name.text.starts_with(|c: char| c.is_alphabetic() || c == '_');
                if starts {
                    let end = value_end(&tokens[number + 1..]).unwrap_or(text.len());
                    fields.push(Field {
                        name: name.text,
                        depth,
                        start: name.start,
                        value: token.start + 1,
                        end,
                    });
                }
            }
            _ => {}
        }
    }
    fields.into_iter()
}

fn value_end(tokens: &[Token]) -> Option<usize> {
    let mut depth = 0_usize;
    for token in tokens {
        match token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" if depth == 0 => return Some(token.start),
            ")" | "]" | "}" => depth -= 1,
            "," if depth == 0 => return Some(token.start + 1),
            _ => {}
        }
    }
    None
}

struct Token<'a> {
    text: &'a str,
    start: usize,
}

/// Strings, words and single punctuation marks; comments are passed over.
fn tokens(text: &str) -> Vec<Token<'_>> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        match bytes[at] {
            b'/' if bytes.get(at + 1) == Some(&b'/') => {
                at = text[at..].find('\n').map_or(text.len(), |n| at + n);
                continue;
            }
            b'/' if bytes.get(at + 1) == Some(&b'*') => {
                at = text[at + 2..].find("*/").map_or(text.len(), |n| at + n + 4);
                continue;
            }
            b'"' => {
                at += 1;
                while at < bytes.len() && bytes[at] != b'"' {
                    at += if bytes[at] == b'\\' { 2 } else { 1 };
                }
                at = (at + 1).min(bytes.len());
                while !text.is_char_boundary(at) {
                    at += 1;
                }
            }
            b'\'' if bytes.get(at + 2) == Some(&b'\'') => at += 3,
            c if c.is_ascii_alphanumeric() || c == b'_' || c >= 0x80 => {
                while at < bytes.len() && (bytes[at].is_ascii_alphanumeric() || bytes[at] == b'_' || bytes[at] >= 0x80) {
                    at += 1;
                }
            }
            c if c.is_ascii_whitespace() => {
                at += 1;
                continue;
            }
            _ => at += 1,
        }
        tokens.push(Token { text: &text[start..at], start });
    }
    tokens
}

fn build(text: &str, file: TemplateFile, notes: &mut Vec<String>) -> Result<Rig, SourceError> {
    let places = Places::new(text);
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
    let mut unique = |uid: Uid| match seen.insert(uid) {
        true => Ok(()),
        false => Err(places.error(uid, 1, format!("uid {uid} is used twice; give the second a uid of its own"))),
    };
    for group in file.groups {
        unique(group.uid)?;
        let color: [f32; 3] = group.color.into();
        if color.iter().any(|part| !part.is_finite()) {
            return Err(places.error(group.uid, 0, "the colour is not finite; use numbers from 0 to 1".into()));
        }
        rig.groups.push(GroupData { uid: group.uid, name: group.name, color, enabled: group.enabled });
    }
    let count = file.joints.len();
    if let Some(claimed) = file.joint_count.filter(|claimed| *claimed != count) {
        notes.push(format!("the header says {claimed} joints, the file has {count}; saving corrects it"));
    }
    add_joints(&mut rig, file.joints, &places, unique)?;
    if feature_summaries(&rig) != sorted(file.features) {
        notes.push("the header lists other features than the tags; saving corrects it".to_owned());
    }
    Ok(rig)
}

fn sorted(mut features: Vec<FeatureSummary>) -> Vec<FeatureSummary> {
    features.iter_mut().for_each(|feature| feature.switches.sort_unstable());
    features.sort_unstable();
    features
}

fn add_joints(
    rig: &mut Rig,
    joints: Vec<JointFile>,
    places: &Places,
    mut unique: impl FnMut(Uid) -> Result<(), SourceError>,
) -> Result<(), SourceError> {
    let mut data = HashMap::with_capacity(joints.len());
    let mut children: HashMap<Option<Uid>, Vec<Uid>> = HashMap::new();
    let known: HashSet<Uid> = joints.iter().map(|joint| joint.uid).collect();
    let features: HashSet<Uid> = joints.iter().flat_map(|joint| &joint.tags).filter_map(feature_uid).collect();
    let mut order = Vec::with_capacity(joints.len());
    for joint in joints {
        let uid = joint.uid;
        unique(uid)?;
        for (what, other) in [("parent", joint.parent), ("mirror", joint.mirror)] {
            if let Some(other) = other.filter(|other| !known.contains(other)) {
                return Err(places.error(uid, 0, format!(
                    "joint {uid} names the {what} {other}, which is not in the file; correct it or leave the field out"
                )));
            }
        }
        if let Some(group) = joint.group.filter(|group| rig.group(*group).is_none()) {
            return Err(places.error(uid, 0, format!(
                "joint {uid} is in the local group {group}, which is not in the file; add it under `groups`"
            )));
        }
        let (x, y, z, w) = joint.rotation;
        let rest = RestTransform {
            translation: <[f32; 3]>::from(joint.translation).into(),
            rotation: Quat::from_xyzw(x, y, z, w),
            scale: Vec3::from(<[f32; 3]>::from(joint.scale)),
        };
        if !rest.is_valid() {
            return Err(places.error(uid, 0, format!(
                "joint {uid} has a transform that is not finite or whose rotation is not of length 1; correct the numbers"
            )));
        }
        let mut tags = Vec::with_capacity(joint.tags.len());
        for tag in joint.tags {
            let tag = tag_from(tag);
            unique(tag.uid)?;
            if let TagKind::Command { feature: Some(feature), .. } = &tag.kind
                && !features.contains(feature)
            {
                return Err(places.error(tag.uid, 0, format!(
                    "tag {} is in the feature {feature}, which is not in the file; add it or leave the field out",
                    tag.uid
                )));
            }
            tags.push(tag);
        }
        order.push(uid);
        children.entry(joint.parent).or_default().push(uid);
        data.insert(uid, JointData {
            uid,
            label: joint.label,
            group: joint.group,
            kind: joint.kind,
            rest,
            mirror: joint.mirror,
            locked: joint.locked,
            tags,
        });
    }
    // Parents first, whatever the order in the file.
    let mut stack: Vec<(Option<Uid>, Uid)> = Vec::new();
    let push = |stack: &mut Vec<_>, parent: Option<Uid>| {
        stack.extend(children.get(&parent).into_iter().flatten().rev().map(|child| (parent, *child)));
    };
    push(&mut stack, None);
    while let Some((parent, uid)) = stack.pop() {
        let Some(joint) = data.remove(&uid) else { continue };
        let edit = RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX };
        rig.apply(&edit).map_err(|error| places.error(uid, 0, error.to_string()))?;
        push(&mut stack, Some(uid));
    }
    match order.into_iter().find(|uid| data.contains_key(uid)) {
        Some(uid) => Err(places.error(uid, 0, format!(
            "joint {uid} is its own ancestor; give one joint of the cycle another parent"
        ))),
        None => Ok(()),
    }
}

fn feature_uid(tag: &TagFile) -> Option<Uid> {
    match tag {
        TagFile::Feature { uid, .. } => Some(*uid),
        TagFile::Command { .. } => None,
    }
}

fn tag_from(tag: TagFile) -> Tag {
    match tag {
        TagFile::Command { uid, enabled, comment, module, feature, params } => Tag {
            uid,
            enabled,
            comment,
            kind: TagKind::Command { module, params: params.trim().get_ron().to_owned(), feature },
        },
        TagFile::Feature { uid, enabled, comment, kind, name, switch } => {
            Tag { uid, enabled, comment, kind: TagKind::Feature { kind, name, switch } }
        }
    }
}

/// Finds the lines where things are declared.
struct Places<'a> {
    text: &'a str,
}

impl<'a> Places<'a> {
    fn new(text: &'a str) -> Self {
        Self { text }
    }

    /// An error at the `nth` field `uid` with that value (or the first).
    fn error(&self, uid: Uid, nth: usize, message: String) -> SourceError {
        let name = uid.to_string();
        let declared: Vec<usize> = scan_fields(self.text)
            .filter(|field| field.name == "uid")
            .filter(|field| {
                let value = self.text[field.value..field.end].trim_start().trim_start_matches('"');
                value.get(..name.len()).is_some_and(|value| value.eq_ignore_ascii_case(&name))
            })
            .map(|field| field.start)
            .collect();
        let at = declared.get(nth).or(declared.first()).copied().unwrap_or(0);
        SourceError::at(self.text, at, message)
    }
}
