//! Attributes of one node, of which each version shares most with the one before it.

use std::sync::Arc;

use bevy::platform::hash::fixed_hash_one;

use crate::rig::Attribute;

/// Bits of a hash that one level of the tree reads.
const LEVEL: u32 = 5;

/// Attributes of a node, in order.
///
/// A build keeps the list as it is after each command that adds to it. They stand in a tree by the hashes of their names (a hash
/// array mapped trie; Bagwell 2001): a list with one attribute more shares all but one way through the tree with the list that it
/// came from, and a name is found on one way.
#[derive(Debug, Clone, Default)]
pub struct AttributeList {
    root: Option<Arc<Branch>>,
    len: usize,
}

/// Attributes whose names have hashes that begin alike, by the next bits of these.
#[derive(Debug)]
struct Branch {
    /// Bits that a slot has.
    bits: u32,
    /// Slots by rising bits.
    slots: Box<[Slot]>,
}

#[derive(Debug, Clone)]
enum Slot {
    Leaf(Arc<Leaf>),
    Branch(Arc<Branch>),
}

/// Attributes whose names have the same hash: in all likelihood one.
#[derive(Debug)]
struct Leaf {
    hash: u64,
    /// Attributes with their places in the list.
    attributes: Vec<(usize, Attribute)>,
}

impl AttributeList {
    /// The attributes.
    pub fn iter(&self) -> impl Iterator<Item = &Attribute> {
        let mut placed: Vec<&(usize, Attribute)> = Vec::with_capacity(self.len);
        let mut open: Vec<&Branch> = self.root.as_deref().into_iter().collect();
        while let Some(branch) = open.pop() {
            for slot in &branch.slots {
                match slot {
                    Slot::Leaf(leaf) => placed.extend(&leaf.attributes),
                    Slot::Branch(below) => open.push(below),
                }
            }
        }
        placed.sort_unstable_by_key(|(place, _)| *place);
        placed.into_iter().map(|(_, attribute)| attribute)
    }

    /// The attribute with that name; the first one where several have it.
    pub fn get(&self, name: &str) -> Option<&Attribute> {
        let hash = fixed_hash_one(name);
        let (mut branch, mut shift) = (self.root.as_deref()?, 0);
        loop {
            let bit = bit_of(hash, shift);
            if branch.bits & bit == 0 {
                return None;
            }
            match &branch.slots[place_of(branch, bit)] {
                Slot::Leaf(leaf) => {
                    let mut attributes = leaf.attributes.iter().map(|(_, attribute)| attribute);
                    return attributes.find(|attribute| *attribute.name == *name);
                }
                Slot::Branch(below) => (branch, shift) = (below, shift + LEVEL),
            }
        }
    }

    /// True if an attribute has that name.
    pub fn has(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    /// Number of attributes.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if there are no attributes.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The list with one attribute more.
    pub(super) fn with(&self, attribute: Attribute) -> Self {
        let hash = fixed_hash_one(&*attribute.name);
        let leaf = Leaf { hash, attributes: vec![(self.len, attribute)] };
        Self { root: Some(Arc::new(with_leaf(self.root.as_deref(), 0, leaf))), len: self.len + 1 }
    }

    /// True if both lists have the same bits where commands read them (0 and -0 differ, since results may).
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.is_alike(other, |a, b| a == b && a.default.to_bits() == b.default.to_bits())
    }

    /// True if both lists have equal attributes in the same order. Parts that they share are not looked at.
    fn is_alike(&self, other: &Self, equal: fn(&Attribute, &Attribute) -> bool) -> bool {
        if self.len != other.len {
            return false;
        }
        let mut open: Vec<(&Arc<Branch>, &Arc<Branch>)> = self.root.iter().zip(&other.root).collect();
        while let Some((one, two)) = open.pop() {
            if Arc::ptr_eq(one, two) {
                continue;
            }
            if one.bits != two.bits {
                return false;
            }
            for slots in one.slots.iter().zip(&two.slots) {
                match slots {
                    (Slot::Branch(one), Slot::Branch(two)) => open.push((one, two)),
                    (Slot::Leaf(one), Slot::Leaf(two)) => {
                        let is_equal = one.attributes.len() == two.attributes.len()
                            && (one.attributes.iter().zip(&two.attributes))
                                .all(|(a, b)| a.0 == b.0 && equal(&a.1, &b.1));
                        if !Arc::ptr_eq(one, two) && !is_equal {
                            return false;
                        }
                    }
                    _ => return false,
                }
            }
        }
        true
    }
}

impl PartialEq for AttributeList {
    fn eq(&self, other: &Self) -> bool {
        self.is_alike(other, |a, b| a == b)
    }
}

/// Bit of the slot for a hash, at a level.
fn bit_of(hash: u64, shift: u32) -> u32 {
    1 << ((hash >> shift) & ((1 << LEVEL) - 1))
}

/// Place of the slot for a bit.
fn place_of(branch: &Branch, bit: u32) -> usize {
    (branch.bits & (bit - 1)).count_ones() as usize
}

/// A branch with one leaf more. Two hashes differ in one of the 13 levels of their bits, so this goes no deeper.
fn with_leaf(branch: Option<&Branch>, shift: u32, leaf: Leaf) -> Branch {
    let bit = bit_of(leaf.hash, shift);
    let Some(branch) = branch else { return Branch { bits: bit, slots: Box::new([Slot::Leaf(Arc::new(leaf))]) } };
    let place = place_of(branch, bit);
    let mut slots = branch.slots.to_vec();
    if branch.bits & bit == 0 {
        slots.insert(place, Slot::Leaf(Arc::new(leaf)));
    } else {
        slots[place] = match &branch.slots[place] {
            Slot::Branch(below) => Slot::Branch(Arc::new(with_leaf(Some(below), shift + LEVEL, leaf))),
            Slot::Leaf(known) if known.hash == leaf.hash => {
                let attributes = known.attributes.iter().cloned().chain(leaf.attributes).collect();
                Slot::Leaf(Arc::new(Leaf { hash: known.hash, attributes }))
            }
            Slot::Leaf(known) => {
                let below = Branch {
                    bits: bit_of(known.hash, shift + LEVEL),
                    slots: Box::new([Slot::Leaf(Arc::clone(known))]),
                };
                Slot::Branch(Arc::new(with_leaf(Some(&below), shift + LEVEL, leaf)))
            }
        };
    }
    Branch { bits: branch.bits | bit, slots: slots.into() }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::rig::AttributeKind;

    fn attribute(number: usize) -> Attribute {
        let kind = AttributeKind::Number { min: None, max: None };
        Attribute { name: format!("a{number}").as_str().into(), kind, default: number as f32 }
    }

    /// Branches of a list that are not known yet; their slots.
    fn new_slots(list: &AttributeList, known: &mut HashSet<*const Branch>) -> usize {
        let mut open: Vec<&Arc<Branch>> = list.root.iter().collect();
        let mut slots = 0;
        while let Some(branch) = open.pop() {
            if !known.insert(Arc::as_ptr(branch)) {
                continue;
            }
            slots += branch.slots.len();
            open.extend(branch.slots.iter().filter_map(|slot| match slot {
                Slot::Branch(below) => Some(below),
                Slot::Leaf(_) => None,
            }));
        }
        slots
    }

    #[test]
    fn versions_share_all_but_one_way() {
        let mut versions = vec![AttributeList::default()];
        let mut known = HashSet::new();
        for number in 0..3000 {
            let next = versions[number].with(attribute(number));
            let slots = new_slots(&next, &mut known);
            assert!((1..=5 * 32).contains(&slots), "{slots} of {number}");
            versions.push(next);
        }
        for count in [0, 1, 40, 2999, 3000] {
            let list = &versions[count];
            assert_eq!((list.len(), list.is_empty()), (count, count == 0));
            assert!(list.iter().zip(0..count).all(|(found, number)| *found == attribute(number)));
            assert_eq!(list.iter().count(), count);
            for number in [0, 39, 2998, 2999] {
                let wanted = (number < count).then(|| attribute(number));
                assert_eq!(list.get(&format!("a{number}")), wanted.as_ref(), "{number} of {count}");
            }
            assert!(!list.has("b"));
        }
    }

    #[test]
    fn lists_are_compared_by_order_and_bits() {
        let list = |order: &[usize], zero: f32| {
            let with_zero =
                |number| if number == 0 { Attribute { default: zero, ..attribute(0) } } else { attribute(number) };
            order.iter().fold(AttributeList::default(), |list, number| list.with(with_zero(*number)))
        };
        let order: Vec<usize> = (0..100).collect();
        let turned: Vec<usize> = (0..100).rev().collect();
        assert_eq!(list(&order, 0.0), list(&order, 0.0));
        assert!(list(&order, 0.0).is_same(&list(&order, 0.0)));
        assert_ne!(list(&order, 0.0), list(&turned, 0.0));
        assert_ne!(list(&order, 0.0), list(&order[1..], 0.0));
        assert_eq!(list(&order, 0.0), list(&order, -0.0));
        assert!(!list(&order, 0.0).is_same(&list(&order, -0.0)));
    }
}
