//! Numbers of joints in local groups: whether a group has joints takes no look at all of them.
//!
//! They are counted when the first group is to be removed, and edits keep them up to date from then on.

use std::{
    collections::HashMap,
    fmt,
    sync::{Mutex, PoisonError},
};

use crate::rig::{Rig, Uid};

/// Numbers of joints by group. They follow from the joints and are no content: any two compare as equal, and a clone is empty.
#[derive(Default)]
pub(super) struct GroupMembers(Mutex<Option<HashMap<Uid, usize>>>);

impl GroupMembers {
    /// Forgets all numbers; they are counted again when one is looked for.
    pub fn clear(&mut self) {
        *self.0.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Takes over that the group of a joint changed; `None` stands for no group, and for no joint.
    pub fn change(&mut self, before: Option<Uid>, now: Option<Uid>) {
        let Some(counts) = self.0.get_mut().unwrap_or_else(PoisonError::into_inner) else { return };
        if let Some(before) = before
            && let Some(count) = counts.get_mut(&before)
        {
            *count = count.saturating_sub(1);
            if *count == 0 {
                counts.remove(&before);
            }
        }
        if let Some(now) = now {
            *counts.entry(now).or_default() += 1;
        }
    }
}

impl Clone for GroupMembers {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for GroupMembers {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for GroupMembers {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("GroupMembers")
    }
}

impl Rig {
    /// True if a joint is in a local group.
    pub(super) fn has_members(&self, group: Uid) -> bool {
        let mut index = self.group_members.0.lock().unwrap_or_else(PoisonError::into_inner);
        let counts = index.get_or_insert_with(|| {
            self.checkpoints.count(self.len());
            let mut counts = HashMap::new();
            for group in self.joints.values().filter_map(|joint| joint.data.group) {
                *counts.entry(group).or_default() += 1;
            }
            counts
        });
        counts.contains_key(&group)
    }
}
