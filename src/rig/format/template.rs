//! Rig templates, the `*.rig.ron` files.
//!
//! The header comes first and can be read alone; groups, joints (parents first, siblings as authored) and their tags
//! follow, one field group a line, so that a change of one value changes one line. Reading checks everything before
//! it returns, so that a scene never sees half a rig; loading what was saved gives the same rig, and saving that the
//! same bytes.

mod comment_placement;
mod read;
mod write;

use serde::{Deserialize, Serialize};

pub(in crate::rig) use read::read_text;
pub use read::{read_header, read_template, survey_template};
pub use write::write_template;
pub(in crate::rig) use write::{quoted, vector, write_without_poses};

use crate::rig::{Rig, Uid};

/// The newest format that is read and written. A file says the oldest format that holds what is in it: format 2 where a
/// part says its needs, a feature has a choice, a joint is a placed bone of a face or poses are stored, else 1.
pub const FORMAT: u32 = 2;

/// Largest size in bytes of a template that is read.
pub const MAX_BYTES: usize = 16 << 20;

/// Header of a template: the fields before its groups and joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemplateHeader {
    /// Format of the file.
    pub format: u32,
    /// Uid of the rig.
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
    /// What a part needs of the rig that it is dropped into; `None` for other templates.
    #[serde(default)]
    pub needs: Option<NeedsSummary>,
}

/// What a part needs of its host, in a template's header: see [`PartNeeds`](crate::rig::part::PartNeeds).
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
    /// Notes about content that the reader ignored (fields of a newer format, a wrong joint count), a sentence each.
    pub notes: Vec<String>,
}
