//! Rows of the tree: the listed joints and their depths.

use std::collections::HashSet;

use crate::rig::{Rig, RigJoint, TagKind, Uid};

/// A joint in the tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// The joint.
    pub joint: Uid,
    /// Number of joints above it.
    pub depth: usize,
    /// Marks a joint with children that could be listed.
    pub parent: bool,
    /// Marks a joint whose children are listed.
    pub open: bool,
    /// Match with the filter; `false` for a joint that is listed only because one below it matches.
    pub matches: bool,
}

/// The listed joints, top to bottom: all but those below a folded one, or, with a filter, those that match it and their
/// ancestors. All words of the filter must be in the label, the group's name or a module of the joint's tags, in any case.
pub fn rows(rig: &Rig, folded: &HashSet<Uid>, filter: &str) -> Vec<Row> {
    let words = words(filter);
    if words.is_empty() { unfolded(rig, folded) } else { matching(rig, &words) }
}

/// Flat list of the joints that match a filter, in the order of the hierarchy.
pub fn flat_rows(rig: &Rig, filter: &str) -> Vec<Row> {
    let found = matching(rig, &words(filter)).into_iter().filter(|row| row.matches);
    found.map(|row| Row { depth: 0, parent: false, ..row }).collect()
}

/// Rows of a joint and of the joints below it, with the first of them at the left.
pub fn within(rig: &Rig, mut rows: Vec<Row>, top: Uid) -> Vec<Row> {
    let inside: HashSet<Uid> = rig.hierarchy(top).map(|joint| joint.data.uid).collect();
    rows.retain(|row| inside.contains(&row.joint));
    let left = rows.iter().map(|row| row.depth).min().unwrap_or_default();
    rows.iter_mut().for_each(|row| row.depth -= left);
    rows
}

fn words(filter: &str) -> Vec<String> {
    filter.split_whitespace().map(str::to_lowercase).collect()
}

fn unfolded(rig: &Rig, folded: &HashSet<Uid>) -> Vec<Row> {
    let mut stack: Vec<(Uid, usize)> = rig.roots().iter().rev().map(|root| (*root, 0)).collect();
    let mut rows = Vec::with_capacity(rig.len());
    while let Some((joint, depth)) = stack.pop() {
        let children = rig.children(Some(joint));
        let open = !folded.contains(&joint);
        rows.push(Row { joint, depth, parent: !children.is_empty(), open, matches: true });
        if open {
            stack.extend(children.iter().rev().map(|child| (*child, depth + 1)));
        }
    }
    rows
}

fn matching(rig: &Rig, words: &[String]) -> Vec<Row> {
    let groups: Vec<(Uid, String)> = rig.groups().iter().map(|g| (g.uid, g.name.to_lowercase())).collect();
    let hit = |joint: &RigJoint| {
        let name = super::super::joint_name(&joint.data).to_lowercase();
        let group = joint.data.group.and_then(|uid| groups.iter().find(|(group, _)| *group == uid));
        let modules = || {
            joint.data.tags.iter().filter_map(|tag| match &tag.kind {
                TagKind::Command { module, .. } => Some(module.to_lowercase()),
                TagKind::Feature { .. } => None,
            })
        };
        let is_in = |word: &String| {
            name.contains(word)
                || group.is_some_and(|(_, name)| name.contains(word))
                || modules().any(|module| module.contains(word))
        };
        words.iter().all(is_in)
    };
    // Parents come first, so their numbers are known; in reverse order, children mark their parents as listed.
    let mut numbers = std::collections::HashMap::with_capacity(rig.len());
    let mut all: Vec<(Row, Option<usize>, bool)> = Vec::with_capacity(rig.len());
    for joint in rig.walk() {
        let above: Option<usize> = joint.parent.and_then(|parent| numbers.get(&parent).copied());
        let depth = above.map_or(0, |above| all[above].0.depth + 1);
        let matches = hit(joint);
        numbers.insert(joint.data.uid, all.len());
        let row = Row { joint: joint.data.uid, depth, parent: false, open: true, matches };
        all.push((row, above, matches));
    }
    for number in (0..all.len()).rev() {
        if let (_, Some(above), true) = all[number] {
            all[above].2 = true;
            all[above].0.parent = true;
        }
    }
    all.into_iter().filter(|(_, _, listed)| *listed).map(|(row, ..)| row).collect()
}
