//! The last step: few influences, positive, sorted, summing to one, with rigid parts and locked joints kept.

use std::ops::Range;

use super::{Locks, WeightJoint, WeightSettings};
use crate::mesh::{influences::keep_strongest, model::Weights};

/// Constraints of the caller on the weights: locks, and the number of influences of a point.
pub(crate) struct Shaping<'a> {
    /// The joint that moves each point alone, or `NONE`; empty without rigid parts.
    rigid: Vec<u32>,
    locks: Option<Locks<'a>>,
    most: usize,
    least: f32,
}

const NONE: u32 = u32::MAX;

impl<'a> Shaping<'a> {
    /// Takes checked input.
    pub fn new(
        points: usize,
        parts: &[(Range<u32>, u32)],
        locks: Option<Locks<'a>>,
        settings: &WeightSettings,
    ) -> Self {
        let mut rigid = Vec::new();
        if !parts.is_empty() {
            rigid.resize(points, NONE);
            for (range, joint) in parts {
                rigid[range.start as usize..range.end as usize].fill(*joint);
            }
        }
        let least = if settings.prune.is_finite() { settings.prune.clamp(0.0, 0.5) } else { 0.0 };
        Self { rigid, locks, most: settings.max_influences.max(1), least }
    }

    /// True if the point belongs to a rigid part.
    pub fn is_given(&self, point: usize) -> bool {
        self.rigid.get(point).is_some_and(|&joint| joint != NONE)
    }

    /// The joints that take part: those that deform (all, if none is marked so) and are not locked; if none is left,
    /// all that deform.
    pub fn free_joints(&self, joints: &[WeightJoint]) -> Vec<u32> {
        let locked = |j: usize| self.locks.is_some_and(|l| l.joints[j]);
        let any = joints.iter().any(|j| j.deforms);
        let deforming = |j: usize| joints[j].deforms || !any;
        let all = 0..joints.len();
        let free: Vec<u32> = all.clone().filter(|&j| deforming(j) && !locked(j)).map(|j| j as u32).collect();
        if free.is_empty() { all.filter(|&j| deforming(j)).map(|j| j as u32).collect() } else { free }
    }

    /// The weights of all points from the computed ones.
    pub fn finish<I: Iterator<Item = (u32, f32)>>(&self, computed: impl Fn(usize) -> I, points: usize) -> Weights {
        let mut weights = Weights { starts: Vec::with_capacity(points + 1), ..Weights::default() };
        weights.starts.push(0);
        let mut row = Vec::new();
        for point in 0..points {
            row.clear();
            if self.is_given(point) {
                row.push((self.rigid[point], 1.0));
            } else {
                row.extend(computed(point));
                keep_strongest(&mut row, self.most, self.least);
                if let Some(locks) = &self.locks {
                    self.keep_locked(locks, point, &mut row);
                }
            }
            weights.push(row.iter().copied());
        }
        weights
    }

    /// Puts the locked weights in and shrinks the others into what they leave.
    fn keep_locked(&self, locks: &Locks, point: usize, row: &mut Vec<(u32, f32)>) {
        let locked: Vec<(u32, f32)> =
            locks.weights.of(point).filter(|&(j, w)| locks.joints[j as usize] && w.is_finite() && w > 0.0).collect();
        let held: f32 = locked.iter().map(|e| e.1).sum();
        if held <= 0.0 {
            return;
        }
        row.retain(|e| !locks.joints[e.0 as usize]);
        let rest = if row.is_empty() { 0.0 } else { (1.0 - held).max(0.0) };
        let shrink = (1.0 - rest) / held;
        for entry in row.iter_mut() {
            entry.1 *= rest;
        }
        let room = self.most.saturating_sub(locked.len());
        // Locked joints keep their weights even where that leaves room for fewer others.
        row.truncate(room);
        row.retain(|e| e.1 > 0.0);
        let others: f32 = row.iter().map(|e| e.1).sum();
        if others > 0.0 {
            for entry in row.iter_mut() {
                entry.1 *= rest / others;
            }
            row.extend(locked.iter().map(|&(j, w)| (j, w * shrink)));
            row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        } else {
            row.clear();
            row.extend(locked);
            keep_strongest(row, self.most, 0.0);
        }
    }
}
