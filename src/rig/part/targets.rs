//! Joints and tags of a part by the names that changes and options of its uses give them.

use std::{
    cell::{Cell, OnceCell},
    collections::HashMap,
};

use super::{PartError, PartInstance};
use crate::rig::{Rig, Uid, nearest::did_you_mean, reference::MOST_COMPARED};

/// Joints and tags of a fitted part by their names, which are listed when one is first looked up: an instance may change
/// everything in its part. Unknown names are compared with [`MOST_COMPARED`] names in all.
pub(in crate::rig) struct PartTargets<'a> {
    instance: &'a PartInstance,
    part: &'a Rig,
    tags: OnceCell<HashMap<String, Vec<Uid>>>,
    joints: OnceCell<JointPlaces<'a>>,
    /// Number of names that were compared with unknown ones.
    compared: Cell<usize>,
}

/// Numbers of joints, the first one for each name.
#[derive(Default)]
struct JointPlaces<'a> {
    labels: HashMap<&'a str, usize>,
    uids: HashMap<Uid, usize>,
}

impl<'a> PartTargets<'a> {
    /// Joints and tags of a part, as an instance calls them.
    pub fn new(instance: &'a PartInstance, part: &'a Rig) -> Self {
        Self { instance, part, tags: OnceCell::new(), joints: OnceCell::new(), compared: Cell::new(0) }
    }

    /// The tag that is called so.
    ///
    /// # Errors
    /// A name that no tag has, or that several have.
    pub fn find_tag(&self, name: &str) -> Result<Uid, PartError> {
        let tags = self.tags.get_or_init(|| {
            let mut tags: HashMap<String, Vec<Uid>> = HashMap::new();
            for (name, uid) in self.instance.called(self.part) {
                let called = tags.entry(name).or_default();
                if called.last() != Some(&uid) {
                    called.push(uid);
                }
            }
            tags
        });
        let (plain, number) = match name.rsplit_once('#').map(|(plain, number)| (plain, number.parse::<usize>())) {
            Some((plain, Ok(number))) => (plain, Some(number)),
            _ => (name, None),
        };
        let all: &[Uid] = tags.get(plain).map_or(&[], Vec::as_slice);
        let found = match number {
            Some(number) => number.checked_sub(1).and_then(|at| all.get(at..=at)).unwrap_or_default(),
            None => all,
        };
        match found {
            [tag] => Ok(*tag),
            [] => {
                let known = || self.instance.called(self.part).into_iter().map(|(known, _)| known).collect();
                Err(PartError::UnknownTag { name: name.to_owned(), nearest: self.nearest(name, known) })
            }
            _ => Err(PartError::AmbiguousTag { name: name.to_owned(), count: found.len() }),
        }
    }

    /// Number of the joint that is called so, by its label or its uid in the part.
    ///
    /// # Errors
    /// A label that no joint has.
    pub fn find_joint(&self, label: &str) -> Result<usize, PartError> {
        let joints = self.joints.get_or_init(|| {
            let mut joints = JointPlaces::default();
            for (place, joint) in self.part.walk().enumerate() {
                let own = joint.data.label.as_deref();
                let plain = own.and_then(|own| own.strip_prefix(self.instance.prefix.as_str()));
                for name in own.into_iter().chain(plain) {
                    joints.labels.entry(name).or_insert(place);
                }
                joints.uids.insert(joint.data.uid, place);
            }
            joints
        });
        let of_uid = label.parse::<Uid>().ok().and_then(|uid| joints.uids.get(&uid));
        joints.labels.get(label).into_iter().chain(of_uid).min().copied().ok_or_else(|| {
            let known = || self.part.walk().filter_map(|joint| joint.data.label.clone()).collect();
            PartError::UnknownJoint { label: label.to_owned(), nearest: self.nearest(label, known) }
        })
    }

    /// End of the sentence about an unknown name with similar ones among `known`; empty once too many were compared.
    pub fn nearest(&self, name: &str, known: impl FnOnce() -> Vec<String>) -> String {
        if self.compared.get() >= MOST_COMPARED {
            return String::new();
        }
        let known = known();
        self.compared.set(self.compared.get() + known.len());
        did_you_mean(name, &known)
    }
}
