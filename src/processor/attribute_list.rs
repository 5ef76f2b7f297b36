//! Attributes of one node, of which each version shares most with the one before it.

use std::sync::Arc;

use crate::rig::Attribute;

/// Attributes in one part of a list.
const PART: usize = 32;

/// Attributes of a node, in order.
///
/// A build keeps the list as it is after each command that adds to it. A list with one attribute more shares all full
/// parts with the list that it came from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AttributeList {
    /// Parts of [`PART`] attributes; the last one may have fewer.
    parts: Arc<[Arc<[Attribute]>]>,
}

impl AttributeList {
    /// The attributes.
    pub fn iter(&self) -> impl Iterator<Item = &Attribute> {
        self.parts.iter().flat_map(|part| part.iter())
    }

    /// Number of attributes.
    pub fn len(&self) -> usize {
        self.parts.split_last().map_or(0, |(last, full)| full.len() * PART + last.len())
    }

    /// True if there are no attributes.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The list with one attribute more.
    pub(super) fn with(&self, attribute: Attribute) -> Self {
        let (last, full) = match self.parts.split_last() {
            Some((last, full)) if last.len() < PART => (&**last, full),
            _ => (&[][..], &*self.parts),
        };
        let last: Arc<[Attribute]> = last.iter().cloned().chain([attribute]).collect();
        Self { parts: full.iter().cloned().chain([last]).collect() }
    }

    /// True if both lists have the same bits where commands read them (0 and -0 differ, since results may).
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let defaults = |list: &Self| list.iter().map(|attribute| attribute.default.to_bits()).collect::<Vec<_>>();
        self == other && defaults(self) == defaults(other)
    }
}
