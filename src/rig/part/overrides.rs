//! Lists of what instances change of their parts.

use super::PartInstance;
use crate::rig::{
    TagKind,
    format::{
        template::{quaternion, vector},
        tree::Tree,
    },
};

/// Difference between an instance and its part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartOverride {
    /// Changed thing: `joint LABEL`, `tag MODULE/NAME`, `feature NAME` or `option NAME`.
    pub target: String,
    /// Changed field: a parameter of the tag, `enabled`, `translation` and the like.
    pub field: String,
    /// The value here, as in the file.
    pub value: String,
}

impl PartInstance {
    /// Changes that the instance makes to its part, in the order of the file.
    pub fn overrides(&self) -> Vec<PartOverride> {
        let mut list = Vec::new();
        let mut add = |target: &str, field: &str, value: String| {
            list.push(PartOverride { target: target.to_owned(), field: field.to_owned(), value });
        };
        for (name, value) in &self.options {
            add(&format!("option {name}"), "value", value.clone());
        }
        for name in &self.off {
            add(&format!("feature {name}"), "enabled", "false".to_owned());
        }
        for change in &self.changes {
            let joint = change.joint.as_ref().map(|label| format!("joint {label}"));
            let tag = change.tag.as_ref().map(|name| format!("tag {name}"));
            let target = joint.or(tag).unwrap_or_default();
            if change.removed {
                add(&target, "removed", "true".to_owned());
            }
            if let Some(enabled) = change.enabled {
                add(&target, "enabled", enabled.to_string());
            }
            if let Some(params) = change.params.as_deref()
                && let Some(tree) = Tree::parse(params)
            {
                for item in tree.node(tree.root()).items {
                    add(&target, item.key.unwrap_or("params"), tree.written(item.value).to_owned());
                }
            }
            for name in &change.unset {
                add(&target, name, "default".to_owned());
            }
            if let Some(comment) = &change.comment {
                add(&target, "comment", comment.clone());
            }
            if let Some(label) = &change.label {
                add(&target, "label", label.clone());
            }
            if let Some(locked) = change.locked {
                add(&target, "locked", locked.to_string());
            }
            if let Some(translation) = change.translation {
                add(&target, "translation", vector(translation.into()));
            }
            if let Some(rotation) = change.rotation {
                add(&target, "rotation", quaternion(rotation));
            }
            if let Some(scale) = change.scale {
                add(&target, "scale", vector(scale.into()));
            }
            for tag in &change.tags {
                let name = match &tag.kind {
                    TagKind::Command { module, params, .. } => format!("{module}{params}"),
                    TagKind::Feature { kind, name, .. } => format!("Feature({kind}, {name})"),
                };
                add(&target, "tag", name);
            }
        }
        list
    }
}
