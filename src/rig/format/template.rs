//! Rig templates, the `*.rig.ron` files.
//!
//! The header comes first and can be read alone; groups, joints (parents first, siblings as authored) and their tags
//! follow, one field group a line, so that a change of one value changes one line. Reading checks everything before
//! it returns, so that a scene never sees half a rig; loading what was saved gives the same rig, and saving that the
//! same bytes.
//!
//! # Shorthand
//!
//! People write format 2, in which whatever follows from the rest is left out:
//!
//! - A uid that is left out is derived: that of a joint from its label, of a group, a stored pose and the rig from the
//!   name, of a tag from its joint, its module and the name that it gives (kind, name and switch of a feature); the second
//!   of equal tags on a joint is the second for good.
//! - `parent`, `mirror`, `group` and `feature` take a label or name; a feature's switch stands behind a point, as in
//!   `ik.space`, and of several features of a name the one on the same joint is meant.
//! - `control(shape: "ring")` stands for `Command(module: "control", params: (shape: "ring"))`. The fields `uid`,
//!   `enabled`, `comment` and `feature` belong to the tag, all others to the module.
//! - `parent` may name a joint that a part brings, too, where the file itself has none of that name.
//! - `rotation` takes three angles in degrees, about X, Y and Z, besides a quaternion.
//! - Whatever has a default can be left out: the translation, the colour of a group, the number of joints.

mod comment_placement;
mod file;
mod file_marks;
mod header;
mod moved_text;
mod read;
mod shorthand;
mod text_patch;
mod tidy;
mod write;

use std::{collections::BTreeMap, sync::Arc};

use serde::{Deserialize, Serialize};

pub use super::commas::with_missing_commas;
pub(crate) use file_marks::FileMarks;
pub(crate) use moved_text::{with_changes_on_lines, with_part_files, with_part_uids, with_rig_uid};
pub(in crate::rig) use read::read_text;
pub use read::{read_header, read_template, survey_template, text_of};
pub use shorthand::{ExplicitText, explicit};
pub use text_patch::write_template_over;
pub(crate) use text_patch::{
    PartRigs, differing_parts, says_the_same, with_instance_fields, with_instances, with_instances_of,
    without_instances, write_changes_over, write_own_over, write_short_template,
};
pub use tidy::{UidStyle, format_template, format_with_parts};
pub use write::write_template;
pub(in crate::rig) use write::{
    option_text, quaternion, quoted, rotation_text, socket_text, vector, write_without_poses,
};

use crate::rig::{
    Rig, Uid,
    part::{OptionForm, PartChain, PartInstance, PartOption, PartSocket},
};

/// The newest format that is read and written. A file that the program writes by itself says the oldest format that holds
/// what is in it: format 2 where a part says its needs, a feature has a choice, a joint is a placed bone of a face or poses
/// are stored, else 1. People write format 2, which has shorthand.
pub const FORMAT: u32 = 2;

/// Largest size in bytes of a template that is read.
pub const MAX_BYTES: usize = 16 << 20;

/// Header of a template: the fields before its groups and joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemplateHeader {
    /// Format of the file.
    pub format: u32,
    /// Uid of the rig.
    #[serde(default)]
    pub uid: Uid,
    /// Name of the rig.
    pub name: String,
    /// Version of the content, chosen by the author.
    #[serde(default)]
    pub version: String,
    /// Kind of the rig, for example `character`.
    #[serde(default)]
    pub kind: String,
    /// Author of the rig.
    #[serde(default)]
    pub author: String,
    /// Description in a few sentences.
    #[serde(default)]
    pub description: String,
    /// File name of a picture beside the template.
    #[serde(default)]
    pub preview: Option<String>,
    /// Number of joints, for listings.
    #[serde(default, deserialize_with = "count")]
    pub joint_count: usize,
    /// Named features and their switches, for listings.
    #[serde(default)]
    pub features: Vec<FeatureSummary>,
    /// Needs of a part from the rig that it is dropped into; `None` for other templates.
    #[serde(default)]
    pub needs: Option<NeedsSummary>,
    /// Places that others hang on.
    #[serde(default)]
    pub sockets: Vec<SocketSummary>,
    /// Values that uses of the template as a part may set.
    #[serde(default)]
    pub options: Vec<OptionSummary>,
}

/// A socket in a template's header: see [`PartSocket`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SocketSummary {
    /// Name of the socket.
    pub name: String,
    /// Label of its joint.
    pub joint: String,
}

/// An option in a template's header: see [`PartOption`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptionSummary {
    /// Name of the option.
    pub name: String,
    /// The value without it, as RON.
    #[serde(deserialize_with = "written")]
    pub default: String,
    /// Description for people.
    #[serde(default)]
    pub description: String,
    /// Form of the value.
    #[serde(default)]
    pub form: Option<OptionForm>,
}

/// Reads a value as it is written.
fn written<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    Ok(Box::<ron::value::RawValue>::deserialize(deserializer)?.trim().get_ron().to_owned())
}

/// Needs of a part from its host, in a template's header: see [`PartNeeds`](crate::rig::part::PartNeeds).
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct NeedsSummary {
    /// Labels of the joints that make it whole, in their order.
    pub joints: Vec<String>,
    /// Places of the host that it is connected to.
    #[serde(default)]
    pub sockets: Vec<String>,
}

/// Reads a count; a file may also have `None`, which counts as 0.
fn count<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    Ok(Option::<usize>::deserialize(deserializer)?.unwrap_or_default())
}

/// A named feature in a template's header.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FeatureSummary {
    /// Kind of the feature.
    pub kind: String,
    /// Name of the feature.
    pub name: String,
    /// Switches of the feature.
    #[serde(default)]
    pub switches: Vec<String>,
}

/// A template as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// The rig.
    pub rig: Rig,
    /// Chains that take other numbers of joints where the template is used as a part.
    pub chains: Vec<PartChain>,
    /// Places that others hang on: those of the template itself, and, once its parts are in the rig, those of the parts.
    pub sockets: Vec<PartSocket>,
    /// Values that its uses as a part may set.
    pub options: Vec<PartOption>,
    /// Parts that have not been put into the rig yet: see [`Template::with_parts`].
    pub parts: Vec<PartInstance>,
    /// Joints of the rig whose parents come from parts; empty once the parts are in the rig.
    pub hung: Vec<HungJoint>,
    /// Parts that have been put into the rig.
    pub instances: Vec<PartInstance>,
    /// Instances of the commands that come of parts.
    pub origins: BTreeMap<Uid, PartOrigin>,
    /// References in parameters that are bound to nothing: commands, and a sentence for each. Those of a template that was read
    /// without faults are among its notes instead.
    pub unbound: Vec<(Uid, String)>,
    /// Notes about content that the reader ignored (fields of a newer format, a wrong joint count), a sentence each.
    pub notes: Vec<String>,
}

impl Template {
    /// The template with the references that are bound to nothing among its notes.
    fn with_unbound_told(mut self) -> Self {
        self.notes.extend(self.unbound.drain(..).map(|(_, told)| told));
        self
    }
}

/// Joint of a template whose parent is not in its file, but comes with a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HungJoint {
    /// The joint, which is a root until the parts are in the rig.
    pub joint: Uid,
    /// The parent as the file names it: by its label or its uid.
    pub parent: String,
}

/// Origin of a command that a part brought.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartOrigin {
    /// Name of the part instance.
    pub title: Arc<str>,
    /// Place in the template's text, in bytes, of the parameters that the instance gives the command, else of the instance.
    pub offset: usize,
    /// Uid of the command in the part.
    pub tag: Uid,
    /// Text of the part; `None` where it has no file.
    pub source: Option<Arc<PartSource>>,
}

/// Text of a part, in which its commands stand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartSource {
    /// File of the part, for messages.
    pub file: String,
    /// Content of the file.
    pub text: String,
    /// Origins of the commands that its own parts brought.
    pub origins: BTreeMap<Uid, PartOrigin>,
}
