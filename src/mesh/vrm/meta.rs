//! Meta data of avatars: names, authors and what users may do.

use serde::{Deserialize, Serialize};

use super::LICENSE_URL;

/// Name, authors and licence of an avatar. The permissions default to those that allow least.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct VrmMeta {
    /// Name of the avatar.
    pub name: String,
    /// Version of the avatar; empty for none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub version: String,
    /// Authors, one or more.
    pub authors: Vec<String>,
    /// Address of the licence document.
    pub license_url: String,
    /// People who may appear as the avatar.
    #[serde(default)]
    pub avatar_permission: AvatarPermission,
    /// Permission for excessively violent content.
    #[serde(default)]
    pub allow_excessively_violent_usage: bool,
    /// Permission for excessively sexual content.
    #[serde(default)]
    pub allow_excessively_sexual_usage: bool,
    /// Commercial use that is allowed.
    #[serde(default)]
    pub commercial_usage: CommercialUsage,
    /// Permission for political or religious content.
    #[serde(default)]
    pub allow_political_or_religious_usage: bool,
    /// Permission for antisocial or hateful content.
    #[serde(default)]
    pub allow_antisocial_or_hate_usage: bool,
    /// Duty to name the authors.
    #[serde(default)]
    pub credit_notation: CreditNotation,
    /// Permission to hand the file on.
    #[serde(default)]
    pub allow_redistribution: bool,
    /// Changes that are allowed.
    #[serde(default)]
    pub modification: ModificationPermission,
}

impl VrmMeta {
    /// Meta data with the permissions that allow least.
    pub fn new(name: impl Into<String>, version: impl Into<String>, authors: Vec<String>) -> Self {
        Self {
            name: name.into(),
            version: version.into(),
            authors,
            license_url: LICENSE_URL.to_owned(),
            avatar_permission: AvatarPermission::default(),
            allow_excessively_violent_usage: false,
            allow_excessively_sexual_usage: false,
            commercial_usage: CommercialUsage::default(),
            allow_political_or_religious_usage: false,
            allow_antisocial_or_hate_usage: false,
            credit_notation: CreditNotation::default(),
            allow_redistribution: false,
            modification: ModificationPermission::default(),
        }
    }
}

/// People who may appear as an avatar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum AvatarPermission {
    /// Authors alone.
    #[default]
    OnlyAuthor,
    /// People with a licence of their own.
    OnlySeparatelyLicensedPerson,
    /// Everybody.
    Everyone,
}

/// Commercial use of an avatar that is allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum CommercialUsage {
    /// Use by people, without profit.
    #[default]
    PersonalNonProfit,
    /// Use by people, for profit, too.
    PersonalProfit,
    /// Use by corporations, too.
    Corporation,
}

/// Duty to name the authors of an avatar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum CreditNotation {
    /// Users name the authors.
    #[default]
    Required,
    /// Users need not name the authors.
    Unnecessary,
}

/// Changes of an avatar that are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum ModificationPermission {
    /// None.
    #[default]
    Prohibited,
    /// Changes for one's own use.
    AllowModification,
    /// Changes, and handing on what was changed.
    AllowModificationRedistribution,
}
