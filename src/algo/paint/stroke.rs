//! One stroke of a brush, dab by dab.

use std::collections::BTreeMap;

use super::{Brush, BrushError, BrushMode, Canvas, Mirror, Row, RowRules, Spot, assign, towards};
use crate::mesh::model::Weights;

/// A stroke that is being painted. It holds what it has changed and leaves the weights of the mesh alone.
///
/// All dabs of a stroke are on one canvas and over the same weights, those from before the stroke.
pub struct PaintStroke {
    brush: Brush,
    /// The joint, and the one on the other side, which may be the same.
    joints: Option<[u32; 2]>,
    locked: Vec<bool>,
    most: usize,
    /// Largest effects so far on each node, of dabs and of their mirror images.
    effects: BTreeMap<u32, [f32; 2]>,
    /// Influences of the points that changed.
    rows: BTreeMap<u32, Row>,
}

impl PaintStroke {
    /// Begins a stroke for a joint and its partner on the other side (a central joint is its own). Without a joint the brush
    /// must smooth or sharpen all joints. `locked` has an entry a joint, and `most` is the largest number of influences of
    /// a painted point.
    ///
    /// # Errors
    /// See [`BrushError`].
    pub fn new(
        brush: Brush,
        joint: Option<u32>,
        partner: Option<u32>,
        locked: Vec<bool>,
        most: usize,
    ) -> Result<Self, BrushError> {
        brush.check()?;
        if most == 0 {
            return Err(BrushError::Influences);
        }
        let is_for_all = brush.all_joints && brush.mode.is_relative();
        let joints = match joint {
            _ if is_for_all => None,
            None => return Err(BrushError::NoJoint),
            Some(joint) => Some([joint, partner.unwrap_or(joint)]),
        };
        for joint in joints.into_iter().flatten() {
            if joint as usize >= locked.len() {
                return Err(BrushError::Joint { joint, joints: locked.len() });
            }
        }
        if joints.is_some_and(|[joint, _]| locked[joint as usize]) {
            return Err(BrushError::Locked);
        }
        Ok(Self { brush, joints, locked, most, effects: BTreeMap::new(), rows: BTreeMap::new() })
    }

    /// The brush of the stroke.
    pub fn brush(&self) -> &Brush {
        &self.brush
    }

    /// Paints at a spot and, with a plane, for the partner at its mirror image. `weights` are those of the mesh before the stroke; points
    /// past their end stay. The cost grows with the number of points within the radius, and in the volume with the points
    /// in a slab of the radius.
    pub fn dab(&mut self, canvas: &Canvas, weights: &Weights, at: &Spot, mirror: Option<&Mirror>) {
        let Brush { radius, reach, .. } = self.brush;
        let near = canvas.nodes_within(at, radius, reach);
        let images = mirror.map(|mirror| canvas.images(&near, at, mirror, radius, reach));
        let mut effects: BTreeMap<u32, [f32; 2]> = BTreeMap::new();
        for (side, nodes) in [near, images.unwrap_or_default()].into_iter().enumerate() {
            for (node, far) in nodes {
                let effect = self.brush.effect(far);
                if effect > 0.0 {
                    effects.entry(node).or_default()[side] = effect;
                }
            }
        }
        if self.brush.mode.is_relative() {
            self.relax(canvas, weights, &effects);
        } else {
            self.set(canvas, weights, effects);
        }
    }

    /// Points that differ from the weights before the stroke, rising, and their influences.
    pub fn changed(&self, weights: &Weights) -> (Vec<u32>, Weights) {
        let mut points = Vec::with_capacity(self.rows.len());
        let mut rows = Weights { starts: vec![0], ..Weights::default() };
        for (point, row) in &self.rows {
            if !weights.of(*point as usize).eq(row.iter().copied()) {
                points.push(*point);
                rows.push(row.iter().copied());
            }
        }
        (points, rows)
    }

    fn rules(&self) -> RowRules<'_> {
        RowRules { locked: &self.locked, most: self.most }
    }

    /// Effects by joint: of both sides together where the joint is its own partner.
    fn by_joint(&self, [own, other]: [f32; 2]) -> Vec<(u32, f32)> {
        match self.joints {
            None => Vec::new(),
            Some([joint, partner]) if joint == partner => vec![(joint, own.max(other))],
            Some([joint, partner]) => {
                [(joint, own), (partner, other)].into_iter().filter(|(_, effect)| *effect > 0.0).collect()
            }
        }
    }

    /// Sets weights from those before the stroke and the largest effect so far.
    fn set(&mut self, canvas: &Canvas, weights: &Weights, effects: BTreeMap<u32, [f32; 2]>) {
        let strength = self.brush.strength;
        for (node, now) in effects {
            let most = self.effects.entry(node).or_default();
            let next = [most[0].max(now[0]), most[1].max(now[1])];
            if std::mem::replace(most, next) == next {
                continue;
            }
            let effects = self.by_joint(next);
            for &point in canvas.points_of(node).iter().filter(|point| (**point as usize) < weights.len()) {
                let row: Row = weights.of(point as usize).collect();
                let target = |&(joint, effect): &(u32, f32)| {
                    let weight = weight_of(&row, joint);
                    let next = match self.brush.mode {
                        BrushMode::Subtract => weight - strength * effect,
                        BrushMode::Replace => weight + (strength - weight) * effect,
                        _ => weight + strength * effect,
                    };
                    (joint, next.clamp(0.0, 1.0))
                };
                let targets: Vec<(u32, f32)> = effects.iter().map(target).collect();
                let next = assign(&row, &targets, &self.rules());
                self.rows.insert(point, next);
            }
        }
    }

    /// Moves weights to the mean of the neighbours or away from it, from those that the dabs before have left.
    fn relax(&mut self, canvas: &Canvas, weights: &Weights, effects: &BTreeMap<u32, [f32; 2]>) {
        let sign = if self.brush.mode == BrushMode::Sharpen { -1.0 } else { 1.0 };
        let mut next: Vec<(u32, Row)> = Vec::new();
        for (node, both) in effects {
            let mean = self.mean(canvas, weights, *node);
            if mean.is_empty() {
                continue;
            }
            for &point in canvas.points_of(*node).iter().filter(|point| (**point as usize) < weights.len()) {
                let row = self.row(weights, point);
                let changed = match self.joints {
                    None => towards(&row, &mean, sign * self.brush.strength * both[0].max(both[1]), &self.rules()),
                    Some(_) => {
                        let target = |(joint, effect): (u32, f32)| {
                            let weight = weight_of(&row, joint);
                            let of_mean =
                                mean.iter().find(|(other, _)| *other == joint).map_or(0.0, |(_, w)| *w as f32);
                            let next = weight + sign * self.brush.strength * effect * (of_mean - weight);
                            (joint, next.clamp(0.0, 1.0))
                        };
                        let targets: Vec<(u32, f32)> = self.by_joint(*both).into_iter().map(target).collect();
                        assign(&row, &targets, &self.rules())
                    }
                };
                next.push((point, changed));
            }
        }
        self.rows.extend(next);
    }

    /// Present influences of a point.
    fn row(&self, weights: &Weights, point: u32) -> Row {
        let before = || weights.of(point as usize).collect();
        self.rows.get(&point).cloned().unwrap_or_else(before)
    }

    /// Mean influences of the neighbours of a node that have any; empty if none has.
    fn mean(&self, canvas: &Canvas, weights: &Weights, node: u32) -> Vec<(u32, f64)> {
        let mut sums: BTreeMap<u32, f64> = BTreeMap::new();
        let mut count = 0.0;
        for neighbour in canvas.neighbours(node) {
            let first = canvas.points_of(*neighbour).first().filter(|point| (**point as usize) < weights.len());
            let row = first.map(|point| self.row(weights, *point)).unwrap_or_default();
            if row.is_empty() {
                continue;
            }
            count += 1.0;
            for (joint, weight) in row.into_iter().filter(|(_, weight)| weight.is_finite() && *weight > 0.0) {
                *sums.entry(joint).or_default() += f64::from(weight);
            }
        }
        sums.into_iter().map(|(joint, sum)| (joint, sum / count)).collect()
    }
}

/// Weight of a joint, 0 where a point has none of it.
fn weight_of(row: &[(u32, f32)], joint: u32) -> f32 {
    row.iter()
        .find(|(other, _)| *other == joint)
        .map_or(0.0, |(_, weight)| if weight.is_finite() { *weight } else { 0.0 })
}
