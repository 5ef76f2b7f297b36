//! Changes of the weights of some points: a stroke of a brush, a typed number. They are as large as what they change, so
//! that a history and a journal of many strokes stay small.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use serde::{Deserialize, Serialize};

use super::{RigEdit, skins::is_whole};
use crate::{
    mesh::model::Weights,
    rig::{SkinData, Uid},
};

/// Influences of some points of a bound mesh, in place of those that the points have.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WeightPatch {
    /// Number of joints that stay at the start of the list of the mesh's weights. Those after them leave it.
    pub kept: u32,
    /// Joints that are added at the end of the list, each with the node that a command made it for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub added: Vec<(Uid, Option<Uid>)>,
    /// Points that change, rising.
    pub points: Vec<u32>,
    /// Influences of these points, over the changed list of joints.
    pub rows: Weights,
}

/// Defect of a change of weights.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PatchFault {
    /// A point that the mesh does not have.
    #[error("influences for point {point}, but they are for {points} points; the mesh may have been exchanged")]
    Point {
        /// The point.
        point: u32,
        /// Number of points of the weights.
        points: usize,
    },
    /// Points that do not rise.
    #[error("influences of points that are not listed in rising order, each once; sort them")]
    Order,
    /// Lists of different lengths, or numbers that are not finite.
    #[error("influences whose lists do not fit together, or that are not finite; check the numbers")]
    Rows,
    /// A joint that is not in the list.
    #[error("influences of joint number {joint}, but their list has {joints}; add the joint to it")]
    Joint {
        /// Number of the joint.
        joint: u32,
        /// Number of joints in the list.
        joints: usize,
    },
    /// A joint that would be in the list twice.
    #[error("joint {0} a second time; use its place in the list")]
    Twice(Uid),
    /// A joint that cannot leave the list, because another point has influences of it.
    #[error("no list without joint {0}, which still moves other points; take its influences away first")]
    InUse(Uid),
}

impl WeightPatch {
    /// The change that gives points other influences. `added` lists joints that the weights do not know yet.
    pub fn new(before: &SkinData, added: Vec<(Uid, Option<Uid>)>, points: Vec<u32>, rows: Weights) -> Self {
        Self { kept: before.joints.len() as u32, added, points, rows }
    }

    /// The change from some weights to others of as many points, whose list of joints begins with that of the first.
    /// `None` if there are no such points, or if the lists of joints are others.
    pub fn between(before: &SkinData, after: &SkinData) -> Option<Self> {
        let added = after.joints.strip_prefix(before.joints.as_slice())?;
        let is_alike = before.weights.len() == after.weights.len() && before.at_rest == after.at_rest;
        let added: Vec<(Uid, Option<Uid>)> =
            added.iter().map(|joint| (*joint, after.subjects.get(joint).copied())).collect();
        let mut subjects = before.subjects.clone();
        subjects.extend(added.iter().filter_map(|(joint, subject)| Some((*joint, (*subject)?))));
        if !is_alike || subjects != after.subjects {
            return None;
        }
        let mut patch = Self::new(before, added, Vec::new(), Weights { starts: vec![0], ..Weights::default() });
        for point in 0..before.weights.len() {
            if row(&before.weights, point) != row(&after.weights, point) {
                patch.points.push(point as u32);
                patch.rows.push(after.weights.of(point));
            }
        }
        Some(patch)
    }

    /// True if nothing would change.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.added.is_empty()
    }

    /// Refuses a change that does not fit some weights.
    pub(super) fn check(&self, skin: &SkinData) -> Result<(), PatchFault> {
        let points = skin.weights.len();
        if !self.points.is_sorted_by(|a, b| a < b) {
            return Err(PatchFault::Order);
        }
        if let Some(point) = self.points.last().copied().filter(|point| *point as usize >= points) {
            return Err(PatchFault::Point { point, points });
        }
        if self.rows.len() != self.points.len() || !is_whole(&self.rows) {
            return Err(PatchFault::Rows);
        }
        let kept = self.kept as usize;
        if kept > skin.joints.len() {
            return Err(PatchFault::Joint { joint: self.kept, joints: skin.joints.len() });
        }
        let joints = kept + self.added.len();
        if let Some(joint) = self.rows.joints.iter().copied().find(|joint| *joint as usize >= joints) {
            return Err(PatchFault::Joint { joint, joints });
        }
        self.check_list(skin, kept)
    }

    /// Refuses a list of joints that could not be taken back.
    fn check_list(&self, skin: &SkinData, kept: usize) -> Result<(), PatchFault> {
        let (stay, leave) = skin.joints.split_at(kept);
        if leave.is_empty() && self.added.is_empty() {
            return Ok(());
        }
        let mut known: BTreeSet<Uid> = stay.iter().copied().collect();
        let mut left = BTreeSet::new();
        for joint in leave {
            if known.contains(joint) || !left.insert(*joint) {
                return Err(PatchFault::Twice(*joint));
            }
        }
        for (joint, _) in &self.added {
            let has_subject = skin.subjects.contains_key(joint) && !left.contains(joint);
            if has_subject || !known.insert(*joint) {
                return Err(PatchFault::Twice(*joint));
            }
        }
        if leave.is_empty() {
            return Ok(());
        }
        let mut changed = self.points.iter().peekable();
        for point in 0..skin.weights.len() {
            if changed.next_if(|next| **next as usize == point).is_some() {
                continue;
            }
            let used = row(&skin.weights, point).0.iter().find(|joint| **joint as usize >= kept);
            if let Some(joint) = used.and_then(|joint| skin.joints.get(*joint as usize)) {
                return Err(PatchFault::InUse(*joint));
            }
        }
        Ok(())
    }

    /// The weights after the change, in time linear in them, most of it copying.
    pub(super) fn applied(&self, skin: &SkinData) -> SkinData {
        let (stay, leave) = skin.joints.split_at(self.kept as usize);
        let mut subjects = skin.subjects.clone();
        for joint in leave {
            subjects.remove(joint);
        }
        subjects.extend(self.added.iter().filter_map(|(joint, subject)| Some((*joint, (*subject)?))));
        SkinData {
            joints: stay.iter().copied().chain(self.added.iter().map(|(joint, _)| *joint)).collect(),
            weights: self.patched(&skin.weights),
            at_rest: skin.at_rest,
            subjects,
        }
    }

    fn patched(&self, before: &Weights) -> Weights {
        if self.points.is_empty() {
            return before.clone();
        }
        let room = before.joints.len() + self.rows.joints.len();
        let mut after = Weights {
            starts: Vec::with_capacity(before.starts.len()),
            joints: Vec::with_capacity(room),
            values: Vec::with_capacity(room),
        };
        after.starts.push(0);
        let mut next = 0;
        for (number, point) in self.points.iter().map(|point| *point as usize).enumerate() {
            copy_run(&mut after, before, next..point);
            let (joints, values) = row(&self.rows, number);
            after.joints.extend_from_slice(joints);
            after.values.extend_from_slice(values);
            after.starts.push(after.joints.len() as u32);
            next = point + 1;
        }
        copy_run(&mut after, before, next..before.len());
        after
    }

    /// The change that takes this one back.
    pub(super) fn inverse(&self, skin: &SkinData) -> Self {
        let leave = &skin.joints[self.kept as usize..];
        let mut rows = Weights::default();
        if !self.rows.starts.is_empty() {
            rows.starts.push(0);
        }
        for point in &self.points {
            rows.push(skin.weights.of(*point as usize));
        }
        Self {
            kept: self.kept,
            added: leave.iter().map(|joint| (*joint, skin.subjects.get(joint).copied())).collect(),
            points: self.points.clone(),
            rows,
        }
    }
}

/// Joints and values of a point.
fn row(weights: &Weights, point: usize) -> (&[u32], &[f32]) {
    let range = weights.starts[point] as usize..weights.starts[point + 1] as usize;
    (&weights.joints[range.clone()], &weights.values[range])
}

/// Appends the points of a range as they are.
fn copy_run(after: &mut Weights, before: &Weights, points: std::ops::Range<usize>) {
    if points.is_empty() {
        return;
    }
    let [from, to] = [before.starts[points.start], before.starts[points.end]];
    let shift = after.joints.len() as u32;
    after.joints.extend_from_slice(&before.joints[from as usize..to as usize]);
    after.values.extend_from_slice(&before.values[from as usize..to as usize]);
    after.starts.extend(before.starts[points.start + 1..=points.end].iter().map(|start| start - from + shift));
}

/// The edit that gives a bound mesh other weights: of the points that change, if those are few, or else of all. `None` if
/// nothing changes.
pub fn weight_edit(mesh: Uid, before: &SkinData, after: SkinData) -> Option<RigEdit> {
    // Text of a patch takes several times the bytes of whole weights, which files hold as numbers.
    const FEW: usize = 8;
    match WeightPatch::between(before, &after) {
        Some(patch) if patch.is_empty() => None,
        Some(patch) if patch.points.len() * FEW <= before.weights.len() => {
            Some(RigEdit::SetWeights(mesh, Box::new(patch)))
        }
        _ => Some(RigEdit::SetSkin(mesh, Some(Arc::new(after)))),
    }
}

/// Numbers of `joints` in the list of a skin, and the joints that the list lacks, whose numbers follow behind its end.
pub fn joint_numbers(skin: &SkinData, joints: &[(Uid, Option<Uid>)]) -> (Vec<u32>, Vec<(Uid, Option<Uid>)>) {
    let known: BTreeMap<Uid, u32> =
        skin.joints.iter().rev().zip((0..skin.joints.len() as u32).rev()).map(|(a, b)| (*a, b)).collect();
    let mut added: Vec<(Uid, Option<Uid>)> = Vec::new();
    let numbers = joints.iter().map(|(joint, subject)| {
        let fresh = || added.iter().position(|(other, _)| other == joint).map(|at| (skin.joints.len() + at) as u32);
        known.get(joint).copied().or_else(fresh).unwrap_or_else(|| {
            added.push((*joint, *subject));
            (skin.joints.len() + added.len() - 1) as u32
        })
    });
    (numbers.collect(), added)
}
