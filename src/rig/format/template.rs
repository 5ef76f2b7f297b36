//! Rig templates, the `*.rig.ron` files.
//!
//! The header comes first and can be read alone; groups, joints (parents first, siblings as authored) and their tags
//! follow, one field group a line, so that a change of one value changes one line. Reading checks everything before
//! it returns, so that a scene never sees half a rig; loading what was saved gives the same rig, and saving that the
//! same bytes.

mod read;
mod write;

use serde::{Deserialize, Serialize};

pub(in crate::rig) use read::read_text;
pub use read::{read_header, read_template, survey_template};
pub use write::write_template;
pub(in crate::rig) use write::{quoted, vector};

use crate::rig::{Rig, Uid};

/// The newest format that is read and written. A file says the oldest format that holds what is in it: format 2 where a
/// part says its needs or a feature has a choice, else 1.
pub const FORMAT: u32 = 2;

/// The longest template that is read, in bytes.
pub const MAX_BYTES: usize = 16 << 20;

/// What a template tells before its joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TemplateHeader {
    /// The file format.
    pub format: u32,
    /// The rig's identity.
    pub uid: Uid,
    /// The rig's name.
    pub name: String,
    /// The version of its content.
    #[serde(default)]
    pub version: String,
    /// For example `character`.
    #[serde(default)]
    pub kind: String,
    /// Who made it.
    #[serde(default)]
    pub author: String,
    /// A few sentences.
    #[serde(default)]
    pub description: String,
    /// File name of a picture beside the template.
    #[serde(default)]
    pub preview: Option<String>,
    /// The number of joints, for listings.
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

/// A count that may also be written as none.
fn count<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    Ok(Option::<usize>::deserialize(deserializer)?.unwrap_or_default())
}

/// A named feature in a template's header.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FeatureSummary {
    /// Its kind.
    pub kind: String,
    /// Its name.
    pub name: String,
    /// Its switches.
    #[serde(default)]
    pub switches: Vec<String>,
}

/// A template as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// The rig.
    pub rig: Rig,
    /// What the reader passed over: fields of a newer format, a wrong joint count. A sentence each.
    pub notes: Vec<String>,
}
