//! Checkpoints: rest transforms at every 64th joint of long chains, kept until an edit moves them.
//!
//! With them a look at the end of a chain takes a walk of bounded length, so that work on a chain that grows joint by joint
//! grows with its length. Joints with at most 64 others above them are below no checkpoint; their transforms are plain
//! products. Which joints are checkpoints follows from the hierarchy alone, so that results never depend on what was looked
//! at.

use std::{
    collections::{BTreeSet, HashMap},
    fmt,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use bevy::math::Affine3;

use crate::rig::{Rig, RigJoint, Uid};

/// Number of joints from one checkpoint of a chain to the next.
const STRIDE: usize = 64;

/// Checkpoints of a rig. They follow from its joints and are no content: any two compare as equal, and a clone has none.
#[derive(Default)]
pub(super) struct RestCheckpoints {
    known: Mutex<CheckpointTable>,
    /// Number of joints that were visited.
    visits: AtomicU64,
}

/// A joint that stands at a multiple of [`STRIDE`] below its root.
#[derive(Clone, Copy)]
struct Checkpoint {
    root: Uid,
    /// Number of joints above it.
    depth: usize,
    /// Transform to the rig's space, at rest.
    global: Affine3,
}

/// Checkpoints that were looked at.
#[derive(Default)]
struct CheckpointTable {
    of_joints: HashMap<Uid, Checkpoint>,
    /// The joints, each behind the number of joints above it.
    by_depth: BTreeSet<(usize, Uid)>,
}

impl CheckpointTable {
    fn insert(&mut self, joint: Uid, checkpoint: Checkpoint) {
        self.by_depth.insert((checkpoint.depth, joint));
        self.of_joints.insert(joint, checkpoint);
    }

    fn remove(&mut self, joint: Uid) {
        if let Some(checkpoint) = self.of_joints.remove(&joint) {
            self.by_depth.remove(&(checkpoint.depth, joint));
        }
    }

    /// Removes the checkpoints that have so many joints above them, or more.
    fn remove_from(&mut self, depth: usize) {
        for (_, joint) in self.by_depth.split_off(&(depth, Uid(0))) {
            self.of_joints.remove(&joint);
        }
    }

    fn clear(&mut self) {
        self.of_joints.clear();
        self.by_depth.clear();
    }
}

/// Joints above a joint, up to a checkpoint or to the root.
struct WayUp<'r> {
    checkpoint: Option<Checkpoint>,
    /// Joints below the checkpoint, the nearest to the joint first.
    joints: Vec<&'r RigJoint>,
}

impl RestCheckpoints {
    fn lock(&self) -> MutexGuard<'_, CheckpointTable> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn known_mut(&mut self) -> &mut CheckpointTable {
        self.known.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Forgets all checkpoints.
    pub fn clear(&mut self) {
        self.known_mut().clear();
    }

    /// Counts joints that are visited.
    pub fn count(&self, joints: usize) {
        self.visits.fetch_add(joints as u64, Ordering::Relaxed);
    }
}

impl Clone for RestCheckpoints {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for RestCheckpoints {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for RestCheckpoints {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("RestCheckpoints")
    }
}

/// Product of the rest transforms of a joint, of those above it, the nearest first, and of a checkpoint above these.
fn product<'r>(
    joint: &RigJoint,
    above: impl Iterator<Item = &'r RigJoint>,
    checkpoint: Option<&Checkpoint>,
) -> Affine3 {
    let own = joint.data.rest.affine();
    let global = above.fold(own, |global, above| above.data.rest.affine() * global);
    checkpoint.map_or(global, |checkpoint| checkpoint.global * global)
}

/// Places of joints at rest.
impl Rig {
    /// Transform of a joint from its own space to the rig's, at rest. Identity for an unknown joint.
    ///
    /// A walk of at most 64 joints, once the joints above have been looked at.
    pub fn rest_global(&self, uid: Uid) -> Affine3 {
        let Some(joint) = self.joint(uid) else { return Affine3::IDENTITY };
        if self.len() <= STRIDE {
            return product(joint, self.ancestors(uid), None);
        }
        let way = self.way_up(joint);
        product(joint, way.joints.iter().copied(), way.checkpoint.as_ref())
    }

    /// Transform of a joint to the rig's space at rest, to the bit that of [`Rig::rest_globals`]; `None` for an unknown joint.
    pub(super) fn global_from_root(&self, uid: Uid) -> Option<Affine3> {
        let mut way = vec![self.joint(uid)?.data.rest.affine()];
        way.extend(self.ancestors(uid).map(|above| above.data.rest.affine()));
        Some(way.into_iter().rev().fold(Affine3::IDENTITY, |global, rest| global * rest))
    }

    /// Number of joints that were visited to find transforms, depths and names of single joints, since the rig was made; for
    /// tests of growth.
    pub fn visits(&self) -> u64 {
        self.checkpoints.visits.load(Ordering::Relaxed)
    }

    /// The root above a joint, which is the joint itself where none is above it, and the number of joints above it.
    pub(super) fn root_and_depth(&self, uid: Uid) -> (Uid, usize) {
        let Some(joint) = self.joint(uid) else { return (uid, 0) };
        let WayUp { checkpoint, joints } = self.way_up(joint);
        match checkpoint {
            Some(checkpoint) => (checkpoint.root, checkpoint.depth + 1 + joints.len()),
            None => (joints.last().map_or(uid, |top| top.data.uid), joints.len()),
        }
    }

    /// Forgets the checkpoints whose depth or transform an edit of a joint changes: the joint and those below it. An edit
    /// that moves the joint to another parent comes after.
    ///
    /// Where many joints are below it, all checkpoints go that are not nearer to their roots than the joint. So those above
    /// stay, and joints that are changed in the order of their depth take a walk of bounded length each.
    pub(super) fn forget_checkpoints(&mut self, top: Uid) {
        if self.checkpoints.known_mut().of_joints.is_empty() {
            return;
        }
        let below: Vec<Uid> = self.hierarchy(top).take(STRIDE + 1).map(|joint| joint.data.uid).collect();
        if below.len() > STRIDE {
            let (_, depth) = self.root_and_depth(top);
            self.checkpoints.known_mut().remove_from(depth);
            return;
        }
        let known = self.checkpoints.known_mut();
        for joint in below {
            known.remove(joint);
        }
    }

    /// The joints above a joint up to the next checkpoint. Checkpoints on the way that are not known yet are added.
    fn way_up(&self, joint: &RigJoint) -> WayUp<'_> {
        let mut known = self.checkpoints.lock();
        let mut way: Vec<&RigJoint> = Vec::new();
        let mut last: Option<Checkpoint> = None;
        let mut next = joint.parent;
        while let Some(above) = next.and_then(|uid| self.joint(uid)) {
            last = known.of_joints.get(&above.data.uid).copied();
            if last.is_some() {
                break;
            }
            way.push(above);
            next = above.parent;
        }
        self.checkpoints.count(way.len() + 1);
        // From the top down.
        way.reverse();
        let first = last.map_or(0, |last| last.depth + 1);
        let mut done = 0;
        for (at, above) in way.iter().enumerate() {
            let depth = first + at;
            if depth == 0 || !depth.is_multiple_of(STRIDE) {
                continue;
            }
            let global = product(above, way[done..at].iter().rev().copied(), last.as_ref());
            let root = last.map_or(way[0].data.uid, |last| last.root);
            let checkpoint = Checkpoint { root, depth, global };
            known.insert(above.data.uid, checkpoint);
            (last, done) = (Some(checkpoint), at + 1);
        }
        way.drain(..done);
        way.reverse();
        WayUp { checkpoint: last, joints: way }
    }
}
