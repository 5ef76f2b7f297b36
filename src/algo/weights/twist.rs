//! Twist joints: how the flesh of a bone is shared among the joints along it.
//!
//! A twist joint turns about its bone by a share of the twist and does nothing else, so it must hold flesh of that bone
//! only: skin is bound as if there were none, and what a bone then holds is shared among its joints by how far along it
//! a point lies, linearly from one to the next. So shares never cross the next joint of the limb, and points that other
//! bones hold stay as they are.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{WeightJoint, half::Halves};
use crate::mesh::{influences::keep_strongest, model::Weights};

/// Twist joints closer than this share of the bone to its start stand in for the joint there.
const AT_START: f32 = 0.01;

/// The joints that are bound, and those that share their bones.
pub(crate) struct Limbs {
    /// The joints without twist and half joints; with half joints if nothing else takes part.
    pub joints: Vec<WeightJoint>,
    /// Indices of the joints that take part.
    pub free: Vec<u32>,
    /// Index of each of `joints` among all joints of the rig.
    places: Vec<u32>,
    /// The bones with twist joints of each of them.
    bones: Vec<Vec<Bone>>,
    halves: Halves,
}

/// A bone with the joints that share it.
struct Bone {
    start: Vec3,
    along: Vec3,
    /// Places from 0 at the start to 1 at the end, rising, with the joints there.
    stations: Vec<(f32, u32)>,
}

impl Limbs {
    /// Takes apart checked joints; `free` are those that take part.
    pub fn new(joints: &[WeightJoint], free: &[u32]) -> Self {
        let mut is_free = vec![false; joints.len()];
        for &joint in free {
            is_free[joint as usize] = true;
        }
        // Half joints take from the joints of a bend: where none of those takes part, they are bound like any other.
        let is_bound = |joint: usize| {
            let owner = joints[joint].twist.map_or(joint, |twist| twist.joint);
            is_free[joint] && joints[owner].halves.is_none()
        };
        let has_halves = (0..joints.len()).any(is_bound);
        let is_core = |joint: &WeightJoint| joint.twist.is_none() && (joint.halves.is_none() || !has_halves);
        let places: Vec<u32> = (0..joints.len() as u32).filter(|&j| is_core(&joints[j as usize])).collect();
        let mut number = vec![None; joints.len()];
        for (core, &place) in places.iter().enumerate() {
            number[place as usize] = Some(core);
        }
        let core = |joint: usize| {
            let joint = joints[joint];
            let mut parent = joint.parent;
            while let Some(twist) = parent.filter(|&parent| number[parent].is_none()) {
                parent = joints[twist].parent;
            }
            WeightJoint { parent: parent.and_then(|parent| number[parent]), ..joint }
        };
        let mut twists = vec![Vec::new(); joints.len()];
        for (joint, data) in joints.iter().enumerate().filter(|(joint, _)| is_free[*joint]) {
            if let Some(twist) = data.twist {
                twists[twist.joint].push(joint as u32);
            }
        }
        let shared = |&place: &u32| bones(joints, place, &twists[place as usize], &is_free);
        let bones: Vec<Vec<Bone>> = places.iter().map(shared).collect();
        let takes_part = |core: &usize| is_free[places[*core] as usize] || !bones[*core].is_empty();
        let free = (0..places.len()).filter(takes_part).map(|core| core as u32).collect();
        Self {
            joints: places.iter().map(|&place| core(place as usize)).collect(),
            free,
            places,
            bones,
            halves: if has_halves { Halves::new(joints, &is_free) } else { Halves::default() },
        }
    }

    /// Index among all joints of the rig of one of [`Limbs::joints`].
    pub fn place(&self, core: u32) -> usize {
        self.places[core as usize] as usize
    }

    /// Index in [`Limbs::joints`] of a joint of the rig; `None` for twist and half joints.
    pub fn index(&self, joint: usize) -> Option<usize> {
        self.places.binary_search(&(joint as u32)).ok()
    }

    /// Flags of all joints of the rig as flags of [`Limbs::joints`].
    pub fn flags(&self, flags: &[bool]) -> Vec<bool> {
        self.places.iter().map(|place| flags[*place as usize]).collect()
    }

    /// Influences of the bound joints at a point as influences of all joints.
    pub fn spread(&self, point: Vec3, influences: impl Iterator<Item = (u32, f32)>) -> Vec<(u32, f32)> {
        let mut row = Vec::new();
        for (joint, weight) in influences {
            match nearest(&self.bones[joint as usize], point) {
                Some(bone) => row.extend(bone.shares(point).map(|(joint, share)| (joint, weight * share))),
                None => row.push((self.places[joint as usize], weight)),
            }
        }
        self.halves.take(&mut row);
        row
    }

    /// Influences of the bound joints over a piece of the mesh that moves as one as influences of all joints: one joint of each
    /// bone, the one that holds the most in the piece's middle. A greave that follows a part of the shin's twist here and a part
    /// there would shear.
    pub fn hold(&self, middle: Vec3, influences: impl Iterator<Item = (u32, f32)>) -> Vec<(u32, f32)> {
        let mut row: Vec<(u32, f32)> = influences
            .map(|(joint, weight)| {
                let nearest = nearest(&self.bones[joint as usize], middle);
                (nearest.map_or(self.places[joint as usize], |bone| bone.holder(middle)), weight)
            })
            .collect();
        self.halves.take(&mut row);
        row
    }
}

/// Shares of joints that were built after a mesh was bound: of `weights`, twist joints take theirs from the joints of their bone,
/// and half joints from both sides of their bend, as if they had been there. `is_late` marks those joints. Influences of points
/// for which `is_fixed` is true stay, and so do those of all other bones; no point gets more influences than `most`. `middles` has
/// the middle of each point's piece where that moves as one: all of it goes to one joint.
pub fn late_shares(
    points: &[Vec3],
    joints: &[WeightJoint],
    is_late: &[bool],
    weights: &Weights,
    middles: &[Option<Vec3>],
    is_fixed: impl Fn(usize) -> bool,
    most: usize,
) -> Weights {
    let is_free = vec![true; joints.len()];
    let mut twists: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (joint, data) in joints.iter().enumerate() {
        if let Some(twist) = data.twist {
            twists.entry(twist.joint as u32).or_default().push(joint as u32);
        }
    }
    twists.retain(|_, twists| twists.iter().any(|joint| is_late[*joint as usize]));
    let mut owners: Vec<Option<u32>> = vec![None; joints.len()];
    for (owner, twists) in &twists {
        twists.iter().chain([owner]).for_each(|joint| owners[*joint as usize] = Some(*owner));
    }
    let limbs: BTreeMap<u32, Vec<Bone>> =
        twists.iter().map(|(owner, twists)| (*owner, bones(joints, *owner, twists, &is_free))).collect();
    let halves = Halves::new(joints, is_late);
    let mut shared = Weights { starts: Vec::with_capacity(weights.starts.len()), ..Weights::default() };
    shared.starts.push(0);
    let mut row: Vec<(u32, f32)> = Vec::new();
    for (point, place) in points.iter().enumerate().take(weights.len()) {
        let before: Vec<(u32, f32)> = weights.of(point).collect();
        row.clear();
        let mut held: BTreeMap<u32, f32> = BTreeMap::new();
        for (joint, weight) in &before {
            match owners.get(*joint as usize).copied().flatten() {
                Some(owner) => *held.entry(owner).or_default() += weight,
                None => row.push((*joint, *weight)),
            }
        }
        for (owner, weight) in held {
            let middle = middles.get(point).copied().flatten();
            match nearest(&limbs[&owner], middle.unwrap_or(*place)) {
                Some(bone) if let Some(middle) = middle => row.push((bone.holder(middle), weight)),
                Some(bone) => row.extend(bone.shares(*place).map(|(joint, share)| (joint, weight * share))),
                None => row.push((owner, weight)),
            }
        }
        halves.take(&mut row);
        let is_changed = row.iter().any(|(joint, _)| is_late[*joint as usize]);
        if is_changed && !is_fixed(point) {
            keep_strongest(&mut row, most, 0.0);
            shared.push(row.iter().copied());
        } else {
            shared.push(before);
        }
    }
    shared
}

/// The bones of a joint that its free twist joints share.
fn bones(joints: &[WeightJoint], owner: u32, twists: &[u32], is_free: &[bool]) -> Vec<Bone> {
    let start = joints[owner as usize].head;
    let mut bones: Vec<(Vec3, Bone)> = Vec::new();
    for &joint in twists {
        let data = joints[joint as usize];
        let Some(twist) = data.twist else { continue };
        let along = twist.end - start;
        let at = place(data.head - start, along);
        match bones.iter_mut().find(|(end, _)| *end == twist.end) {
            Some((_, bone)) => bone.stations.push((at, joint)),
            None => bones.push((twist.end, Bone { start, along, stations: vec![(at, joint)] })),
        }
    }
    let complete = |(_, mut bone): (Vec3, Bone)| {
        bone.stations.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if is_free[owner as usize] {
            match bone.stations[0].0 < AT_START {
                true => bone.stations.push((1.0, owner)),
                false => bone.stations.insert(0, (0.0, owner)),
            }
        }
        bone
    };
    bones.into_iter().map(complete).collect()
}

/// The bone that is nearest to a point.
fn nearest(bones: &[Bone], point: Vec3) -> Option<&Bone> {
    bones.iter().min_by(|a, b| a.distance(point).total_cmp(&b.distance(point)))
}

/// Position of a point along a bone, 0 at the start and 1 at the end.
fn place(point: Vec3, along: Vec3) -> f32 {
    // Divided first: squares of small or large units leave the range of numbers.
    let length = along.length();
    let at = (point / length).dot(along / length);
    if at.is_finite() { at.clamp(0.0, 1.0) } else { 0.0 }
}

impl Bone {
    fn distance(&self, point: Vec3) -> f32 {
        point.distance(self.start + self.along * place(point - self.start, self.along))
    }

    /// The joint that holds the most of the flesh at a point.
    fn holder(&self, point: Vec3) -> u32 {
        let nearest = self.shares(point).max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        nearest.map_or(self.stations[0].1, |(joint, _)| joint)
    }

    /// The joints that share the flesh at a point, with shares that sum to one.
    fn shares(&self, point: Vec3) -> impl Iterator<Item = (u32, f32)> + use<> {
        let at = place(point - self.start, self.along);
        let next = self.stations.partition_point(|(place, _)| *place <= at);
        let (_, after) = self.stations[next.min(self.stations.len() - 1)];
        let shares = match next.checked_sub(1).map(|before| (self.stations[before], self.stations.get(next))) {
            Some(((from, before), Some((to, _)))) => {
                let share = (at - from) / (to - from);
                [(before, 1.0 - share), (after, share)]
            }
            Some(((_, before), None)) => [(before, 1.0), (before, 0.0)],
            None => [(after, 1.0), (after, 0.0)],
        };
        shares.into_iter().filter(|(_, share)| *share > 0.0)
    }
}
