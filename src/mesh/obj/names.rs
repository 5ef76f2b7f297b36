//! Names of objects, groups and materials, each stored once.

use std::hash::{DefaultHasher, Hasher};

use super::NONE;

/// Names by number, in the order of their first use.
///
/// A single text and a single table hold all names, so that a million names cost little more than their letters and
/// reading into the same arrays again allocates nothing.
#[derive(Debug, Clone, Default)]
pub struct ObjNames {
    text: String,
    ends: Vec<u32>,
    /// Open addressing with linear steps; [`NONE`] is free.
    slots: Vec<u32>,
}

impl PartialEq for ObjNames {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.ends == other.ends
    }
}

impl ObjNames {
    /// The number of names.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Returns `true` without names.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The name with this number; empty for [`NONE`] and for unknown numbers.
    pub fn get(&self, name: u32) -> &str {
        let name = name as usize;
        let Some(&end) = self.ends.get(name) else { return "" };
        let start = if name == 0 { 0 } else { self.ends[name - 1] };
        &self.text[start as usize..end as usize]
    }

    pub(super) fn clear(&mut self) {
        self.text.clear();
        self.ends.clear();
        self.slots.fill(NONE);
    }

    /// The number of this name; `None` if the names together grow past 4 GiB.
    pub(super) fn intern(&mut self, name: &str) -> Option<u32> {
        if self.ends.len() * 2 >= self.slots.len() {
            self.grow();
        }
        let slot = self.slot(name);
        if self.slots[slot] == NONE {
            let end = u32::try_from(self.text.len() + name.len()).ok()?;
            self.slots[slot] = self.ends.len() as u32;
            self.text.push_str(name);
            self.ends.push(end);
        }
        Some(self.slots[slot])
    }

    /// Slot of the name, or the free slot for it.
    fn slot(&self, name: &str) -> usize {
        // The standard hasher with its fixed key: the same on every run, and not easily made to collide.
        let mut hasher = DefaultHasher::new();
        hasher.write(name.as_bytes());
        let mask = self.slots.len() - 1;
        let mut slot = hasher.finish() as usize & mask;
        while self.slots[slot] != NONE && self.get(self.slots[slot]) != name {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn grow(&mut self) {
        self.slots = vec![NONE; (self.slots.len() * 2).max(16)];
        for name in 0..self.ends.len() as u32 {
            let slot = self.slot(self.get(name));
            self.slots[slot] = name;
        }
    }
}
