//! Header of a template: what people left out of it follows from the rest of the file.

use std::collections::BTreeMap;

use super::{
    FeatureSummary, TemplateHeader,
    shorthand::{Declared, TagForm},
};
use crate::rig::Uid;

/// The header with the uid that follows from the name, and, where the file is complete and says none, the number of
/// joints and the named features.
pub(super) fn complete(mut header: TemplateHeader, text: &str) -> TemplateHeader {
    if header.uid == Uid::default() {
        header.uid = Uid::derived(["rig", &header.name]);
    }
    if header.joint_count > 0 {
        return header;
    }
    let Some(declared) = Declared::find(text) else { return header };
    header.joint_count = declared.joints.len();
    if header.features.is_empty() {
        header.features = features(&declared);
    }
    header
}

/// Named features with their switches, sorted.
fn features(declared: &Declared) -> Vec<FeatureSummary> {
    let tree = &declared.tree;
    let mut found: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for tag in declared.tags.iter().flatten() {
        if !matches!(TagForm::of(tree, tag.node), Some(TagForm::Feature)) {
            continue;
        }
        let text = |field: &str| tree.string(tag.node, field).unwrap_or_default();
        let (kind, name, switch) = (text("kind"), text("name"), text("switch"));
        if !name.is_empty() {
            let switches = found.entry((kind, name)).or_default();
            if !switch.is_empty() && !switches.contains(&switch) {
                switches.push(switch);
            }
        }
    }
    let summary = |((kind, name), mut switches): (_, Vec<String>)| {
        switches.sort_unstable();
        FeatureSummary { kind, name, switches }
    };
    found.into_iter().map(summary).collect()
}
