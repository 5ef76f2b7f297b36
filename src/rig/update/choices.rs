//! Choices in the conflicts of an update.

use std::collections::BTreeSet;

use super::Change;
use crate::rig::Uid;

/// Side whose value is taken in a conflict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Take {
    /// Value of the file.
    Theirs,
    /// Value of the rig now.
    Mine,
}

impl Take {
    /// The other side.
    pub fn other(self) -> Self {
        match self {
            Self::Theirs => Self::Mine,
            Self::Mine => Self::Theirs,
        }
    }
}

/// Choices of a person in the conflicts of an update: one side for all, and the other one for some.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choices {
    /// Side whose value is taken where nothing else is chosen.
    pub take: Take,
    /// Conflicts in which the other side's value is taken: the uid and the field of their [`Change`]s.
    pub others: BTreeSet<(Uid, Option<String>)>,
}

impl From<Take> for Choices {
    fn from(take: Take) -> Self {
        Self { take, others: BTreeSet::new() }
    }
}

impl Choices {
    /// Side whose value is taken in a field of the thing with that uid.
    pub fn of(&self, uid: Uid, field: Option<&str>) -> Take {
        let is_other = !self.others.is_empty() && self.others.contains(&(uid, field.map(str::to_owned)));
        if is_other { self.take.other() } else { self.take }
    }

    /// Side whose value is taken in the conflict of a change.
    pub fn of_change(&self, change: &Change) -> Take {
        self.of(change.uid, change.field.as_deref())
    }

    /// Chooses a side in the conflict of a change.
    pub fn choose(&mut self, change: &Change, take: Take) {
        let key = (change.uid, change.field.clone());
        if take == self.take {
            self.others.remove(&key);
        } else {
            self.others.insert(key);
        }
    }
}
