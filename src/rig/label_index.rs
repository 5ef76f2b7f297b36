//! Index of labels: which are in use, and which numbers the chains of a name leave free.
//!
//! The index is made when a name is looked up for the first time, and edits keep it up to date from then on, so that naming a
//! drawn joint takes no look at all labels.

use std::{
    collections::{BTreeMap, HashMap},
    fmt,
    sync::{Mutex, PoisonError},
};

use crate::rig::{Rig, Uid};

/// Highest number of a label from which a chain goes on.
const HIGHEST: u32 = 1_000_000;

/// A label of a drawn joint, taken apart: the chain's name with its side, and the place in the chain from 1.
pub(super) struct ChainPlace<'a> {
    pub chain: &'a str,
    pub number: u32,
}

impl<'a> ChainPlace<'a> {
    /// The parts of a label; `None` for one without a number at its end.
    pub fn of(label: &'a str) -> Option<Self> {
        let (chain, number) = label.rsplit_once('_')?;
        let number = number.parse().ok().filter(|number| (1..=HIGHEST).contains(number))?;
        (!chain.is_empty()).then_some(Self { chain, number })
    }

    /// The chain's name without its side.
    pub fn base(&self) -> &'a str {
        let sideless = self.chain.strip_suffix("_l").or_else(|| self.chain.strip_suffix("_r"));
        sideless.unwrap_or(self.chain)
    }

    /// Name of the chain without its side and its number among the chains of that name, that number, 1 where it has none, and
    /// the place of its side in [`Counts`].
    fn numbered(&self) -> Option<(&'a str, u32, usize)> {
        let base = self.base();
        let side = match self.chain.len() - base.len() {
            0 => 0,
            _ if self.chain.ends_with("_l") => 1,
            _ => 2,
        };
        let name = base.trim_end_matches(|letter: char| letter.is_ascii_digit());
        let digits = &base[name.len()..];
        if digits.is_empty() {
            return Some((name, 1, side));
        }
        Some((name.strip_suffix('+').unwrap_or(name), digits.parse().ok()?, side))
    }
}

/// Number of labels of central, left and right chains.
type Counts = [usize; 3];

/// Sides of the chains among which a chain's number has to be free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ChainSides {
    /// All sides.
    All,
    /// The left side, and none.
    Left,
    /// The right side, and none.
    Right,
}

impl ChainSides {
    const EACH: [Self; 3] = [Self::All, Self::Left, Self::Right];

    fn has_any(self, [central, left, right]: Counts) -> bool {
        match self {
            Self::All => central + left + right > 0,
            Self::Left => central + left > 0,
            Self::Right => central + right > 0,
        }
    }
}

/// Chains of one name.
struct ChainNumbers {
    used: BTreeMap<u32, Counts>,
    /// Lowest free number from 1, for each of [`ChainSides::EACH`].
    free: [u32; 3],
}

impl ChainNumbers {
    fn add(&mut self, number: u32, side: usize) {
        self.used.entry(number).or_default()[side] += 1;
        for (sides, free) in ChainSides::EACH.into_iter().zip(&mut self.free) {
            while self.used.get(&*free).is_some_and(|counts| sides.has_any(*counts)) {
                *free += 1;
            }
        }
    }

    fn remove(&mut self, number: u32, side: usize) {
        let Some(counts) = self.used.get_mut(&number) else { return };
        counts[side] = counts[side].saturating_sub(1);
        let left = *counts;
        if left == Counts::default() {
            self.used.remove(&number);
        }
        for (sides, free) in ChainSides::EACH.into_iter().zip(&mut self.free) {
            if number > 0 && !sides.has_any(left) {
                *free = number.min(*free);
            }
        }
    }
}

impl Default for ChainNumbers {
    fn default() -> Self {
        Self { used: BTreeMap::new(), free: [1; 3] }
    }
}

/// Joints with one label.
#[derive(Default)]
struct LabelBearers {
    count: usize,
    /// Exclusive or of their uids: the uid of the joint where there is one.
    uids: u64,
    /// The first of them in the order of [`Rig::walk`] where it was looked for, behind the order of joints that it is of.
    first: Option<(u64, Uid)>,
}

#[derive(Default)]
struct Labels {
    bearers: HashMap<String, LabelBearers>,
    chains: HashMap<String, ChainNumbers>,
    /// Number of the order of joints.
    order: u64,
}

impl Labels {
    fn add(&mut self, joint: Uid, label: &str) {
        let bearers = self.bearers.entry(label.to_owned()).or_default();
        bearers.count += 1;
        bearers.uids ^= joint.0;
        bearers.first = None;
        if let Some((name, number, side)) = ChainPlace::of(label).and_then(|place| place.numbered()) {
            self.chains.entry(name.to_owned()).or_default().add(number, side);
        }
    }

    fn remove(&mut self, joint: Uid, label: &str) {
        let Some(bearers) = self.bearers.get_mut(label) else { return };
        bearers.count = bearers.count.saturating_sub(1);
        bearers.uids ^= joint.0;
        bearers.first = None;
        if bearers.count == 0 {
            self.bearers.remove(label);
        }
        let place = ChainPlace::of(label).and_then(|place| place.numbered());
        if let Some((name, number, side)) = place
            && let Some(numbers) = self.chains.get_mut(name)
        {
            numbers.remove(number, side);
            if numbers.used.is_empty() {
                self.chains.remove(name);
            }
        }
    }
}

/// Index of the labels of a rig. It follows from the joints and is no content: any two compare as equal, and a clone is empty.
#[derive(Default)]
pub(super) struct LabelIndex(Mutex<Option<Labels>>);

impl LabelIndex {
    /// Forgets all labels; they are read again when one is looked for.
    pub fn clear(&mut self) {
        *self.0.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Takes over that joints which were there have another order.
    pub fn reorder(&mut self) {
        if let Some(labels) = self.0.get_mut().unwrap_or_else(PoisonError::into_inner) {
            labels.order += 1;
        }
    }

    /// Takes over that the label of a joint changed; `None` stands for no label, and for no joint.
    pub fn change(&mut self, joint: Uid, before: Option<&str>, now: Option<&str>) {
        let Some(labels) = self.0.get_mut().unwrap_or_else(PoisonError::into_inner) else { return };
        if let Some(before) = before {
            labels.remove(joint, before);
        }
        if let Some(now) = now {
            labels.add(joint, now);
        }
    }
}

impl Clone for LabelIndex {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for LabelIndex {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for LabelIndex {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("LabelIndex")
    }
}

impl Rig {
    /// True if a joint has that label.
    pub(super) fn has_label(&self, label: &str) -> bool {
        self.read_labels(|labels| labels.bearers.contains_key(label))
    }

    /// Number of joints that have that label.
    pub(super) fn label_count(&self, label: &str) -> usize {
        self.read_labels(|labels| labels.bearers.get(label).map_or(0, |bearers| bearers.count))
    }

    /// The joint that [`find_label`](Self::find_label) finds, without a walk where one joint has the label, or where it was looked
    /// for before: for look-ups between edits.
    pub fn labelled(&self, label: &str) -> Option<Uid> {
        let known = self.read_labels(|labels| {
            let bearers = labels.bearers.get(label)?;
            let first = bearers.first.filter(|(order, _)| *order == labels.order);
            Some(if bearers.count == 1 { Some(Uid(bearers.uids)) } else { first.map(|(_, first)| first) })
        });
        if let Some(joint) = known? {
            return Some(joint);
        }
        self.checkpoints.count(self.len());
        let first = self.find_label(label)?;
        self.read_labels(|labels| {
            if let Some(bearers) = labels.bearers.get_mut(label) {
                bearers.first = Some((labels.order, first));
            }
        });
        Some(first)
    }

    /// Lowest number from 1 that no chain of that name has on some sides. `name` is one without digits at its end; a chain that
    /// has the name without a number has number 1.
    pub(super) fn free_chain_number(&self, name: &str, sides: ChainSides) -> u32 {
        self.read_labels(|labels| labels.chains.get(name).map_or(1, |numbers| numbers.free[sides as usize]))
    }

    fn read_labels<T>(&self, read: impl FnOnce(&mut Labels) -> T) -> T {
        let mut index = self.label_index.0.lock().unwrap_or_else(PoisonError::into_inner);
        let labels = index.get_or_insert_with(|| {
            self.checkpoints.count(self.len());
            let mut labels = Labels::default();
            let labelled = self.joints.iter().filter_map(|(uid, joint)| Some((*uid, joint.data.label.as_deref()?)));
            labelled.for_each(|(joint, label)| labels.add(joint, label));
            labels
        });
        read(labels)
    }
}
