//! Motion of another skeleton that waits until a person has accepted the map of joints.

use std::{collections::BTreeSet, sync::Arc};

use bevy::prelude::*;

use super::{map_file::targets_of, motion_options::MotionOptions};
use crate::rig::{
    Rig, Uid,
    animation::{
        joint_map::{FoundBy, JointMap, NamePairs},
        motion::Motion,
    },
};

/// Motion of another skeleton, with the joints of the rig that its joints move.
#[derive(Debug, Clone)]
pub struct MapDraft {
    /// The rig.
    pub rig: Entity,
    /// Name of the file.
    pub name: String,
    /// Motions of one skeleton.
    pub(super) motions: Arc<Vec<Motion>>,
    /// Joint of the rig for each joint of the motion.
    pub targets: Vec<Option<Uid>>,
    /// Way in which the guess was found; `None` if nothing was found.
    pub found_by: Option<FoundBy>,
    /// Choices of how the motion is put onto the rig.
    pub options: MotionOptions,
    /// Remarks, a sentence each.
    pub(super) notes: Vec<String>,
}

impl MapDraft {
    /// Motions with the map that names, shape or labels suggest. Where nothing is found all is for people to choose.
    pub(super) fn new(rig: Entity, name: &str, document: &Rig, motions: Vec<Motion>) -> Self {
        let guess = motions.first().and_then(|motion| JointMap::new(motion, document, &[]).ok());
        let count = motions.first().map_or(0, |motion| motion.joints.len());
        let targets = guess.as_ref().map_or_else(|| vec![None; count], |guess| targets_of(guess, document, count));
        let notes = motions.iter().flat_map(|motion| motion.notes.iter().cloned()).collect();
        Self {
            rig,
            name: name.to_owned(),
            motions: Arc::new(motions),
            targets,
            found_by: guess.map(|guess| guess.found_by),
            options: MotionOptions::default(),
            notes,
        }
    }

    /// Names of the motion's joints, in order.
    pub fn joints(&self) -> impl ExactSizeIterator<Item = &str> {
        self.motions.first().map_or(&[][..], |motion| &motion.joints[..]).iter().map(|joint| joint.name.as_str())
    }

    /// Number of motions.
    pub fn motions(&self) -> usize {
        self.motions.len()
    }

    /// Number of joints of the motion that move a joint of the rig.
    pub fn mapped(&self) -> usize {
        self.targets.iter().flatten().count()
    }

    /// Pairs of names for a map file that gives the joints of this map again. A joint of the motion that moves nothing here, but
    /// would move something by its name or its place in the skeleton, has an empty name beside its own. Pairs with a joint that
    /// has no name are left out.
    pub fn pairs(&self, rig: &Rig) -> NamePairs {
        let Some(motion) = self.motions.first() else { return NamePairs::new() };
        let label = |target: Uid| rig.joint(target).and_then(|joint| joint.data.label.clone());
        let both = motion.joints.iter().zip(&self.targets);
        let named = both.filter_map(|(joint, target)| Some((joint.name.clone(), label((*target)?)?)));
        let mut pairs: NamePairs = named.filter(|(from, to)| !from.is_empty() && !to.is_empty()).collect();
        let guess = JointMap::new(motion, rig, &pairs).map(|map| map.joint_pairs()).unwrap_or_default();
        let moved: BTreeSet<usize> = guess.into_iter().map(|(from, _)| from).collect();
        let unwanted = moved.into_iter().filter(|from| self.targets.get(*from).is_some_and(Option::is_none));
        let names = unwanted.filter_map(|from| motion.joints.get(from)).map(|joint| joint.name.clone());
        pairs.extend(names.filter(|name| !name.is_empty()).map(|name| (name, String::new())));
        pairs
    }

    /// Number of joints of the motion that a map file of these pairs gives another joint of the rig than this map does.
    pub(super) fn differing(&self, rig: &Rig, pairs: &[(String, String)]) -> usize {
        let map = self.motions.first().and_then(|motion| JointMap::new(motion, rig, pairs).ok());
        let read = map.map(|map| targets_of(&map, rig, self.targets.len())).unwrap_or_default();
        self.targets.iter().enumerate().filter(|(joint, target)| read.get(*joint).unwrap_or(&None) != *target).count()
    }
}
