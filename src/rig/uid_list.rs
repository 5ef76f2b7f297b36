//! Lists whose items are found by their uids and names without a search: groups, inputs and stored poses of a rig.

use std::{
    collections::{HashMap, HashSet},
    fmt,
    ops::Deref,
    sync::OnceLock,
};

use crate::rig::{GroupData, RigInput, StoredPose, Uid};

/// Item with an identity of its own.
pub(in crate::rig) trait HasUid {
    /// The identity.
    fn uid(&self) -> Uid;
    /// The name that people see.
    fn name(&self) -> &str;
}

impl HasUid for GroupData {
    fn uid(&self) -> Uid {
        self.uid
    }

    fn name(&self) -> &str {
        &self.name
    }
}

impl HasUid for RigInput {
    fn uid(&self) -> Uid {
        self.uid
    }

    fn name(&self) -> &str {
        &self.name
    }
}

impl HasUid for StoredPose {
    fn uid(&self) -> Uid {
        self.uid
    }

    fn name(&self) -> &str {
        &self.name
    }
}

/// List of items with a uid each, of which no two have the same.
#[derive(Clone)]
pub(in crate::rig) struct UidList<T> {
    items: Vec<T>,
    uids: HashSet<Uid>,
    /// Place of each item, from the first look-up after a change within the list.
    places: OnceLock<HashMap<Uid, usize>>,
    /// Place of the first item of each name, from the first look-up after a change of names or places.
    names: OnceLock<HashMap<String, usize>>,
}

impl<T: fmt::Debug> fmt::Debug for UidList<T> {
    /// Items alone: fingerprints of rigs are made of this text, and what items are found by has no order.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.items.fmt(f)
    }
}

impl<T> Default for UidList<T> {
    fn default() -> Self {
        Self { items: Vec::new(), uids: HashSet::new(), places: OnceLock::new(), names: OnceLock::new() }
    }
}

impl<T: PartialEq> PartialEq for UidList<T> {
    fn eq(&self, other: &Self) -> bool {
        self.items == other.items
    }
}

impl<T> Deref for UidList<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.items
    }
}

impl<T: HasUid> FromIterator<T> for UidList<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        let mut list = Self { items: items.into_iter().collect(), ..Self::default() };
        list.renew();
        list
    }
}

impl<T: HasUid> UidList<T> {
    /// Place of the item with a uid.
    pub(in crate::rig) fn place(&self, uid: Uid) -> Option<usize> {
        let listed = || self.items.iter().zip(0..).map(|(item, place)| (item.uid(), place)).collect();
        self.has(uid).then(|| self.places.get_or_init(listed).get(&uid).copied()).flatten()
    }

    /// The item with a uid.
    pub(in crate::rig) fn find(&self, uid: Uid) -> Option<&T> {
        self.items.get(self.place(uid)?)
    }

    /// The first item with that name. `count` is called with the number of items that are listed for it.
    pub(in crate::rig) fn named(&self, name: &str, count: impl FnOnce(usize)) -> Option<&T> {
        let names = self.names.get_or_init(|| {
            count(self.items.len());
            let mut names = HashMap::with_capacity(self.items.len());
            for (item, place) in self.items.iter().zip(0..) {
                names.entry(item.name().to_owned()).or_insert(place);
            }
            names
        });
        self.items.get(*names.get(name)?)
    }

    /// True if an item has that uid.
    pub(in crate::rig) fn has(&self, uid: Uid) -> bool {
        self.uids.contains(&uid)
    }

    /// Adds an item at a place, or at the end if the list is shorter.
    pub(in crate::rig) fn insert(&mut self, place: usize, item: T) {
        let (uid, end) = (item.uid(), self.items.len());
        self.uids.insert(uid);
        if place < end {
            self.items.insert(place, item);
            (self.places, self.names) = (OnceLock::new(), OnceLock::new());
            return;
        }
        if let Some(names) = self.names.get_mut() {
            names.entry(item.name().to_owned()).or_insert(end);
        }
        self.items.push(item);
        if let Some(places) = self.places.get_mut() {
            places.insert(uid, end);
        }
    }

    /// Takes an item out; returns the place that it had, too.
    pub(in crate::rig) fn remove(&mut self, uid: Uid) -> Option<(usize, T)> {
        // Places that are not known now are of no use after the change either.
        let place = match self.places.get() {
            Some(places) => places.get(&uid).copied()?,
            None => self.items.iter().position(|item| item.uid() == uid)?,
        };
        let item = self.items.remove(place);
        self.uids.remove(&uid);
        if place < self.items.len() {
            (self.places, self.names) = (OnceLock::new(), OnceLock::new());
            return Some((place, item));
        }
        if let Some(places) = self.places.get_mut() {
            places.remove(&uid);
        }
        // The last item may be the first of its name; then it is the only one.
        if let Some(names) = self.names.get_mut()
            && names.get(item.name()) == Some(&place)
        {
            names.remove(item.name());
        }
        Some((place, item))
    }

    /// Exchanges the item with the uid of another item for that; returns the one that was there.
    pub(in crate::rig) fn replace(&mut self, item: T) -> Option<T> {
        let place = self.place(item.uid())?;
        let old = self.items.get_mut(place)?;
        if old.name() != item.name() {
            self.names = OnceLock::new();
        }
        Some(std::mem::replace(old, item))
    }

    /// Exchanges all items; returns those that were there.
    pub(in crate::rig) fn replace_all(&mut self, items: Vec<T>) -> Vec<T> {
        let old = std::mem::replace(&mut self.items, items);
        self.renew();
        old
    }

    /// Changes each item, of which none gets or loses its place.
    pub(in crate::rig) fn change_each(&mut self, change: impl FnMut(&mut T)) {
        self.items.iter_mut().for_each(change);
        self.renew();
    }

    /// Removes the items that `stays` is false for.
    pub(in crate::rig) fn retain(&mut self, stays: impl FnMut(&T) -> bool) {
        self.items.retain(stays);
        self.renew();
    }

    /// Sorts the items, of which equal ones stay in their order.
    pub(in crate::rig) fn sort_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K) {
        self.items.sort_by_key(key);
        self.renew();
    }

    /// Notes the uids anew.
    fn renew(&mut self) {
        (self.places, self.names) = (OnceLock::new(), OnceLock::new());
        self.uids.clear();
        self.uids.extend(self.items.iter().map(HasUid::uid));
    }
}
