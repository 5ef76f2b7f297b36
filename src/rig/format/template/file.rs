//! Contents of a template file as they are deserialised, and the names of its fields.

use std::collections::BTreeMap;

use ron::value::RawValue;
use serde::Deserialize;

use super::{FeatureSummary, NeedsSummary};
use crate::rig::{
    FaceBonePart, NodeKind, Uid,
    format::{
        poses::{PoseFile, no_rotation, no_scale},
        scan::Field,
    },
    part::OptionForm,
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TemplateFile {
    pub(super) format: u32,
    pub(super) uid: Uid,
    pub(super) name: String,
    #[serde(default)]
    pub(super) version: String,
    #[serde(default)]
    pub(super) kind: String,
    #[serde(default)]
    pub(super) author: String,
    #[serde(default)]
    pub(super) description: String,
    #[serde(default)]
    pub(super) preview: Option<String>,
    #[serde(default)]
    pub(super) joint_count: Option<usize>,
    #[serde(default)]
    pub(super) features: Option<Vec<FeatureSummary>>,
    #[serde(default)]
    pub(super) needs: Option<NeedsSummary>,
    #[serde(default)]
    pub(super) chains: Vec<ChainFile>,
    #[serde(default)]
    pub(super) branches: Vec<ChainFile>,
    #[serde(default)]
    pub(super) sockets: Vec<SocketFile>,
    #[serde(default)]
    pub(super) options: Vec<OptionFile>,
    #[serde(default)]
    pub(super) groups: Vec<GroupFile>,
    #[serde(default)]
    pub(super) inputs: Vec<InputFile>,
    #[serde(default)]
    pub(super) joints: Vec<JointFile>,
    #[serde(default)]
    pub(super) parts: Vec<PartFile>,
    #[serde(default)]
    pub(super) poses: Vec<PoseFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GroupFile {
    pub(super) uid: Uid,
    pub(super) name: String,
    #[serde(default)]
    pub(super) color: Option<(f32, f32, f32)>,
    #[serde(default = "yes")]
    pub(super) enabled: bool,
}

/// A declared input.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InputFile {
    pub(super) uid: Uid,
    pub(super) name: String,
    #[serde(default)]
    pub(super) translation: (f32, f32, f32),
    #[serde(default = "no_rotation")]
    pub(super) rotation: (f32, f32, f32, f32),
    #[serde(default = "no_scale")]
    pub(super) scale: (f32, f32, f32),
}

/// A place that others hang on.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SocketFile {
    pub(super) name: String,
    pub(super) joint: String,
    #[serde(default)]
    pub(super) translation: (f32, f32, f32),
    #[serde(default)]
    pub(super) rotation: (f32, f32, f32),
}

/// A value that a part lets its uses set.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OptionFile {
    pub(super) name: String,
    pub(super) default: Box<RawValue>,
    #[serde(default)]
    pub(super) description: String,
    #[serde(default)]
    pub(super) form: Option<OptionForm>,
    pub(super) sets: Vec<OptionTargetFile>,
}

/// A parameter that an option sets.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OptionTargetFile {
    pub(super) tag: String,
    pub(super) param: String,
}

/// A chain of a part that takes other numbers of joints.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ChainFile {
    pub(super) name: String,
    pub(super) joints: Vec<String>,
    #[serde(default)]
    pub(super) min: Option<usize>,
    #[serde(default)]
    pub(super) max: Option<usize>,
}

/// Number of joints of a chain of a part.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CountFile {
    pub(super) chain: String,
    pub(super) count: usize,
}

/// A part instance.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartFile {
    #[serde(default)]
    pub(super) uid: Option<Uid>,
    pub(super) part: String,
    #[serde(default)]
    pub(super) name: String,
    #[serde(default)]
    pub(super) onto: Vec<String>,
    #[serde(default)]
    pub(super) adds: bool,
    #[serde(default)]
    pub(super) count: Option<usize>,
    #[serde(default)]
    pub(super) counts: Vec<CountFile>,
    #[serde(default)]
    pub(super) parent: Option<String>,
    #[serde(default)]
    pub(super) socket: Option<String>,
    #[serde(default)]
    pub(super) options: BTreeMap<String, Box<RawValue>>,
    #[serde(default)]
    pub(super) world: bool,
    #[serde(default)]
    pub(super) translation: (f32, f32, f32),
    #[serde(default)]
    pub(super) rotation: (f32, f32, f32),
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    pub(super) prefix: String,
    #[serde(default)]
    pub(super) mirror: bool,
    #[serde(default)]
    pub(super) off: Vec<String>,
    #[serde(default)]
    pub(super) changes: Vec<PartChangeFile>,
}

/// A difference of a part instance.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartChangeFile {
    #[serde(default)]
    pub(super) joint: Option<String>,
    #[serde(default)]
    pub(super) tag: Option<String>,
    #[serde(default)]
    pub(super) enabled: Option<bool>,
    #[serde(default)]
    pub(super) params: Option<Box<RawValue>>,
    #[serde(default)]
    pub(super) unset: Vec<String>,
    #[serde(default)]
    pub(super) comment: Option<String>,
    #[serde(default)]
    pub(super) removed: bool,
    #[serde(default)]
    pub(super) label: Option<String>,
    #[serde(default)]
    pub(super) locked: Option<bool>,
    #[serde(default)]
    pub(super) translation: Option<(f32, f32, f32)>,
    #[serde(default)]
    pub(super) rotation: Option<Box<RawValue>>,
    #[serde(default)]
    pub(super) scale: Option<(f32, f32, f32)>,
    #[serde(default)]
    pub(super) tags: Option<Box<RawValue>>,
}

/// Names of the fields of a difference.
pub(super) const PART_CHANGE_FIELDS: [&str; 13] = [
    "joint",
    "tag",
    "enabled",
    "params",
    "unset",
    "comment",
    "removed",
    "label",
    "locked",
    "translation",
    "rotation",
    "scale",
    "tags",
];

fn one() -> f32 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointFile {
    pub(super) uid: Uid,
    #[serde(default)]
    pub(super) parent: Option<Uid>,
    #[serde(default)]
    pub(super) label: Option<String>,
    #[serde(default)]
    pub(super) group: Option<Uid>,
    #[serde(default)]
    pub(super) mirror: Option<Uid>,
    #[serde(default)]
    pub(super) kind: NodeKind,
    #[serde(default)]
    pub(super) locked: bool,
    #[serde(default)]
    pub(super) translation: (f32, f32, f32),
    #[serde(default = "no_rotation")]
    pub(super) rotation: (f32, f32, f32, f32),
    #[serde(default = "no_scale")]
    pub(super) scale: (f32, f32, f32),
    #[serde(default)]
    pub(super) face: Option<FaceFile>,
    #[serde(default)]
    pub(super) tags: Vec<TagFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaceFile {
    pub(super) part: FaceBonePart,
    pub(super) label: String,
    pub(super) at: (f32, f32, f32),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum TagFile {
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
        #[serde(default)]
        name: String,
        #[serde(default)]
        switch: String,
        #[serde(default)]
        choice: String,
    },
}

pub(super) fn yes() -> bool {
    true
}

/// Fields of a template, in the order in which they are written: those of its header come first.
pub(super) const TEMPLATE_FIELDS: &[&str] = &[
    "format",
    "uid",
    "name",
    "version",
    "kind",
    "author",
    "description",
    "preview",
    "joint_count",
    "features",
    "needs",
    "chains",
    "branches",
    "sockets",
    "options",
    "groups",
    "inputs",
    "joints",
    "parts",
    "poses",
];

/// Names that are allowed for a field at its place; `None` where any name is allowed (parameters of modules).
pub(super) fn known_names(fields: &[Field], field: &Field) -> Option<&'static [&'static str]> {
    let parent = field.parent.map(|parent| &fields[parent]);
    let above = parent.and_then(|parent| parent.parent).map(|above| fields[above].name);
    match (field.depth, parent.map(|parent| parent.name)) {
        (1, None) => Some(TEMPLATE_FIELDS),
        (3, Some("parts")) => Some(&[
            "uid",
            "part",
            "name",
            "onto",
            "adds",
            "count",
            "counts",
            "parent",
            "socket",
            "options",
            "world",
            "translation",
            "rotation",
            "scale",
            "prefix",
            "mirror",
            "off",
            "changes",
        ]),
        (3, Some("sockets")) => Some(&["name", "joint", "translation", "rotation"]),
        (3, Some("options")) => Some(&["name", "default", "description", "form", "sets"]),
        (5, Some("sets")) if above == Some("options") => Some(&["tag", "param"]),
        (3, Some("chains" | "branches")) => Some(&["name", "joints", "min", "max"]),
        (5, Some("counts")) if above == Some("parts") => Some(&["chain", "count"]),
        (5, Some("changes")) if above == Some("parts") => Some(&PART_CHANGE_FIELDS),
        (3, Some("poses")) => Some(&["uid", "name", "offsets", "values"]),
        (5, Some("offsets")) if above == Some("poses") => Some(&["joint", "translation", "rotation", "scale"]),
        (5, Some("values")) if above == Some("poses") => Some(&["node", "name", "value"]),
        (2, Some("needs")) => Some(&["joints", "sockets"]),
        (3, Some("features")) => Some(&["kind", "name", "switches"]),
        (3, Some("groups")) => Some(&["uid", "name", "color", "enabled"]),
        (3, Some("inputs")) => Some(&["uid", "name", "translation", "rotation", "scale"]),
        (3, Some("joints")) => Some(&[
            "uid",
            "parent",
            "label",
            "group",
            "mirror",
            "kind",
            "locked",
            "translation",
            "rotation",
            "scale",
            "face",
            "tags",
        ]),
        (4, Some("face")) if above == Some("joints") => Some(&["part", "label", "at"]),
        (5, Some("tags")) if above == Some("joints") => {
            Some(&["uid", "enabled", "comment", "module", "feature", "params", "kind", "name", "switch", "choice"])
        }
        _ => None,
    }
}
