//! Labels of joints in the header of a text.

use super::patch::Patch;
use crate::rig::{
    Rig,
    format::{template::quoted, tree::Tree},
};

/// Writes the labels of joints that sockets and chains name, where these are others now. A socket whose joint is gone goes.
pub(super) fn header_labels(patch: &mut Patch, tree: &Tree, before: &Rig, rig: &Rig) {
    let root = tree.root();
    let joint = |label: &str| before.find_label(label);
    let renamed = |label: &str| {
        let now = rig.joint(joint(label)?)?.data.label.clone()?;
        (now != label).then(|| quoted(&now))
    };
    let mut gone = Vec::new();
    for (place, item) in tree.elements(root, "sockets").iter().enumerate() {
        let Some(label) = tree.string(item.value, "joint") else { continue };
        if joint(&label).is_some_and(|joint| rig.joint(joint).is_none()) {
            gone.push(place);
        } else if let Some(now) = renamed(&label) {
            patch.set(item.value, "joint", &now);
        }
    }
    patch.exchange(root, "sockets", &gone, &[]);
    for chain in tree.elements(root, "chains") {
        for item in tree.elements(chain.value, "joints") {
            let label: Option<String> = ron::from_str(tree.written(item.value)).ok();
            if let Some(now) = label.as_deref().and_then(renamed) {
                patch.replace(item.value, &now);
            }
        }
    }
}
