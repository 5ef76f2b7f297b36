//! Order of list elements in a text: as the rig has it.

use std::{collections::HashMap, ops::Range};

use super::patch::is_end_or_comment;
use crate::rig::{
    Rig, Uid,
    format::{
        template::shorthand::{Declaration, Declarations},
        tree::{Item, NodeId, Tree},
    },
};

/// The text with the tags of every joint, then groups, joints and poses in the rig's order; joints parents first. Every
/// element takes the comments above it along. `None` if the text declares something else than the rig has.
pub(super) fn reordered(rig: &Rig, text: &str) -> Option<String> {
    let declared = Declarations::find(text)?;
    let mut changes = Vec::new();
    for (joint, tags) in declared.joints.iter().zip(&declared.tags) {
        let wanted: Vec<Uid> = rig.joint(joint.uid)?.data.tags.iter().map(|tag| tag.uid).collect();
        changes.extend(sorted(&declared.tree, joint.node, "tags", tags, &wanted)?);
    }
    let text = with_changes(text, changes);
    let declared = Declarations::find(&text)?;
    let root = declared.tree.root();
    let groups: Vec<Uid> = rig.groups().iter().map(|group| group.uid).collect();
    let inputs: Vec<Uid> = rig.inputs().iter().map(|input| input.uid).collect();
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let poses: Vec<Uid> = rig.stored_poses().iter().map(|pose| pose.uid).collect();
    let lists = [
        sorted(&declared.tree, root, "groups", &declared.groups, &groups)?,
        sorted(&declared.tree, root, "inputs", &declared.inputs, &inputs)?,
        sorted(&declared.tree, root, "joints", &declared.joints, &joints)?,
        sorted(&declared.tree, root, "poses", &declared.poses, &poses)?,
    ];
    Some(with_changes(&text, lists.into_iter().flatten().collect()))
}

pub(super) fn with_changes(text: &str, mut changes: Vec<(Range<usize>, String)>) -> String {
    changes.sort_by_key(|(range, _)| range.start);
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    for (range, with) in changes {
        out.push_str(&text[at..range.start]);
        out.push_str(&with);
        at = range.end;
    }
    out.push_str(&text[at..]);
    out
}

/// Change that puts the elements of a list into an order; nothing if they are in it.
fn sorted(
    tree: &Tree,
    node: NodeId,
    field: &str,
    there: &[Declaration],
    wanted: &[Uid],
) -> Option<Option<(Range<usize>, String)>> {
    if there.iter().map(|one| one.uid).eq(wanted.iter().copied()) {
        return Some(None);
    }
    let items = tree.elements(node, field);
    let places: HashMap<Uid, usize> = there.iter().enumerate().map(|(place, one)| (one.uid, place)).collect();
    if places.len() != wanted.len() || items.len() != wanted.len() {
        return None;
    }
    // The text between two elements belongs to the latter, but the rest of the former's line.
    let text = tree.text;
    let end_of = |item: &Item| {
        if !is_end_or_comment(&text[item.end..]) {
            return item.end;
        }
        let line = text[item.end..].split('\n').next().unwrap_or_default();
        if line.trim().is_empty() || line.trim_start().starts_with("//") { item.end + line.len() } else { item.end }
    };
    let inside = tree.field(node, field).map(|list| tree.node(list.value).inside)?;
    let mut blocks = Vec::new();
    let mut at = inside;
    for item in items {
        let value_end = tree.node(item.value).range.end;
        let end = end_of(item);
        let comma = if item.has_comma { "" } else { "," };
        blocks.push(format!("{}{comma}{}", &text[at..value_end], &text[value_end..end]));
        at = end;
    }
    let in_order: Option<String> = wanted.iter().map(|uid| Some(blocks[*places.get(uid)?].as_str())).collect();
    Some(Some((inside..at, in_order?)))
}
