//! The stack of tags of the selected joints: alike tags of several joints are one entry.

use std::collections::HashMap;

use crate::{
    editor::panels::{
        displayed_rig::{DisplayedRig, Stamp},
        words,
    },
    rig::{TagData, TagKind, Uid},
};

/// Tags of the selected joints.
#[derive(Default)]
pub(super) struct Stack {
    /// State of the rig and of the selection, and whether other joints than the selected ones are shown.
    made_from: Option<(Stamp, Stamp, bool)>,
    /// The selected joints.
    pub joints: Vec<Uid>,
    /// Entries in the order of the joints' tags.
    pub entries: Vec<Entry>,
}

/// Tags that are alike, at most one of each joint.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    /// The tags with their joints.
    pub tags: Vec<(Uid, Uid)>,
    /// Kind of the first tag, which stands for all.
    pub first: TagData,
    /// Parameters of each tag, for commands.
    pub params: Vec<String>,
}

impl Entry {
    /// Uids of the tags.
    pub fn uids(&self) -> Vec<Uid> {
        self.tags.iter().map(|(_, tag)| *tag).collect()
    }

    /// The module of commands.
    pub fn module(&self) -> Option<&str> {
        match &self.first.kind {
            TagKind::Command { module, .. } => Some(module),
            TagKind::Feature { .. } => None,
        }
    }

    /// Name for people.
    pub fn title(&self) -> String {
        match &self.first.kind {
            TagKind::Command { module, .. } => module.clone(),
            TagKind::Feature { kind, name, switch, .. } => {
                let named = [name, switch].into_iter().filter(|part| !part.is_empty());
                let named: Vec<&str> = named.map(String::as_str).collect();
                if named.is_empty() { format!("feature {kind}") } else { format!("feature {}", named.join(", ")) }
            }
        }
    }

    /// Summary of the tags in a few words.
    pub fn summary(&self) -> String {
        let [first, others @ ..] = &self.params[..] else { return self.first.comment.clone() };
        if others.iter().any(|other| other != first) {
            return format!("{} values", super::MIXED);
        }
        words::summary(&self.first.comment, first)
    }
}

impl Stack {
    /// Reads the selected joints again if they or the rig changed, or others in their place.
    pub fn refresh(&mut self, shown: &DisplayedRig, others: Option<&[Uid]>) {
        let made_from = Some((shown.stamp(), shown.selection_stamp(), others.is_some()));
        if self.made_from == made_from {
            return;
        }
        let joints = others.unwrap_or(&shown.selection.0).iter().copied();
        let joints: Vec<Uid> = joints.filter(|uid| shown.rig.joint(*uid).is_some()).collect();
        let mut entries: Vec<Entry> = Vec::new();
        let mut places: HashMap<(String, usize), usize> = HashMap::new();
        for joint in &joints {
            let Some(data) = shown.rig.joint(*joint) else { continue };
            let mut counts: HashMap<String, usize> = HashMap::new();
            for tag in &data.data.tags {
                let entry = Entry { tags: Vec::new(), first: tag.clone(), params: Vec::new() };
                let title = entry.title();
                let count = counts.entry(title.clone()).or_default();
                let place = *places.entry((title, *count)).or_insert_with(|| {
                    entries.push(entry);
                    entries.len() - 1
                });
                *count += 1;
                entries[place].tags.push((*joint, tag.uid));
                if let TagKind::Command { params, .. } = &tag.kind {
                    entries[place].params.push(params.clone());
                }
            }
        }
        *self = Self { made_from, joints, entries };
    }
}
