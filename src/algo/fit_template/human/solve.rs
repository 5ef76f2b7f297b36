//! Gauss-Newton steps of the model's state, by sparse rows and a dense Cholesky factorisation.

use glam::{Quat, Vec3};

use super::{
    model::{BONE_COUNT, COMPONENTS, GROUPS, HumanModel},
    pose::{SHAPE, Skeleton, State},
};

/// Step of the differences that give derivatives by shape parameters.
const STEP: f32 = 1e-2;

/// A wish that a place of the model moves along a direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) place: Place,
    pub(super) direction: Vec3,
    /// Distance that it should move.
    pub(super) distance: f32,
    pub(super) weight: f32,
}

/// A place of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Place {
    Point(usize),
    Joint(usize),
}

/// Strengths with which parameters are held back.
#[derive(Debug, Clone)]
pub(super) struct Holds {
    pub(super) components: f32,
    pub(super) lengths: f32,
    pub(super) girths: f32,
    pub(super) scale: f32,
    /// Hold of each bone's turn; infinite for bones that stay.
    pub(super) turns: [f32; BONE_COUNT],
    /// Turn against the parent that is held to.
    pub(super) rest_turns: [Quat; BONE_COUNT],
    /// Shape that is held to.
    pub(super) rest_shape: [f32; SHAPE],
    /// Added to all diagonals.
    pub(super) damping: f32,
    /// Largest turn of a step.
    pub(super) largest_turn: f32,
}

/// First parameters: offset and scale, then shape, then turns.
const SHAPE_AT: usize = 4;
const TURNS_AT: usize = SHAPE_AT + SHAPE;

/// Moves `state` by one step towards the wishes of `rows`.
pub(super) fn step(model: &HumanModel, state: &mut State, rows: &[Row], holds: &Holds) {
    let skeleton = state.skeleton(model);
    let shape_free: Vec<bool> = (0..SHAPE).map(|k| shape_hold(holds, k).is_finite()).collect();
    let varied = variations(model, state, &shape_free, rows);
    // Numbers of the parameters in the system.
    let mut numbers = [usize::MAX; TURNS_AT + 3 * BONE_COUNT];
    let mut count = 0;
    let mut number = |parameter: usize| {
        numbers[parameter] = count;
        count += 1;
    };
    (0..3).for_each(&mut number);
    if holds.scale.is_finite() {
        number(3);
    }
    (0..SHAPE).filter(|&k| shape_free[k]).for_each(|k| number(SHAPE_AT + k));
    for bone in 0..BONE_COUNT {
        if holds.turns[bone].is_finite() {
            (0..3).for_each(|k| number(TURNS_AT + 3 * bone + k));
        }
    }
    let mut system = System { count, matrix: vec![0.0; count * count], right: vec![0.0; count] };
    let mut entries: Vec<(usize, f32)> = Vec::with_capacity(96);
    let mut slot = vec![0usize; rows.len()];
    let mut next = 0;
    for (i, row) in rows.iter().enumerate() {
        slot[i] = next;
        next += usize::from(row.weight > 0.0);
    }
    for (i, row) in rows.iter().enumerate() {
        if row.weight <= 0.0 {
            continue;
        }
        entries.clear();
        let n = row.direction;
        let (place, bones, carried, weights) = match row.place {
            Place::Point(point) => {
                let p = &model.points[point];
                let carried = state.carried(model, &skeleton, point);
                let place = (0..3).map(|k| carried[k] * p.weights[k]).sum::<Vec3>();
                (place, p.bones, carried, p.weights)
            }
            // A joint is carried by its parent.
            Place::Joint(bone) => {
                let parent = model.bones[bone].parent.unwrap_or(0);
                let place = skeleton.joints[bone];
                (place, [parent; 3], [place; 3], [1.0, 0.0, 0.0])
            }
        };
        for k in 0..3 {
            entries.push((k, n[k]));
        }
        entries.push((3, n.dot(place - state.offset)));
        for (k, moved) in varied.iter().enumerate() {
            if let Some(moved) = moved {
                let change = n.dot(moved[slot[i]] - place) / STEP;
                if change != 0.0 {
                    entries.push((SHAPE_AT + k, change));
                }
            }
        }
        let above = (0..3).filter(|&k| weights[k] > 0.0).fold(0u64, |all, k| all | model.bones[bones[k]].above);
        let mut rest = above;
        while rest != 0 {
            let bone = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if !holds.turns[bone].is_finite() {
                continue;
            }
            let arm: Vec3 = (0..3)
                .filter(|&k| model.bones[bones[k]].above >> bone & 1 == 1)
                .map(|k| (carried[k] - skeleton.joints[bone]) * weights[k])
                .sum();
            let change = arm.cross(n);
            for k in 0..3 {
                entries.push((TURNS_AT + 3 * bone + k, change[k]));
            }
        }
        for entry in &mut entries {
            entry.0 = numbers[entry.0];
        }
        entries.retain(|e| e.0 != usize::MAX);
        system.add(&entries, row.distance, row.weight);
    }
    for k in 0..SHAPE {
        if shape_free[k] {
            system.hold(numbers[SHAPE_AT + k], shape_hold(holds, k), holds.rest_shape[k] - state.shape[k]);
        }
    }
    if holds.scale.is_finite() {
        system.hold(numbers[3], holds.scale, 0.0);
    }
    for bone in 0..BONE_COUNT {
        if !holds.turns[bone].is_finite() {
            continue;
        }
        // The turn away from rest, as a vector in the space that turns are measured in.
        let away = state.turns[bone] * holds.rest_turns[bone].inverse();
        let parent = model.bones[bone].parent.map_or(Quat::IDENTITY, |p| skeleton.frames[p]);
        let vector = parent * scaled_axis(away);
        for k in 0..3 {
            system.hold(numbers[TURNS_AT + 3 * bone + k], holds.turns[bone], -vector[k]);
        }
    }
    let Some(solution) = system.solve(f64::from(holds.damping)) else { return };
    let get =
        |parameter: usize| if numbers[parameter] == usize::MAX { 0.0 } else { solution[numbers[parameter]] as f32 };
    state.offset += Vec3::new(get(0), get(1), get(2)).clamp_length_max(0.2);
    state.scale += get(3).clamp(-0.2, 0.2);
    for k in 0..SHAPE {
        let limit = if k < COMPONENTS { 0.7 } else { 0.15 };
        let range = if k < COMPONENTS { 3.0 } else { 1.6 };
        state.shape[k] = (state.shape[k] + get(SHAPE_AT + k).clamp(-limit, limit)).clamp(-range, range);
    }
    for bone in 0..BONE_COUNT {
        let turn = |k: usize| get(TURNS_AT + 3 * bone + k);
        let vector = Vec3::new(turn(0), turn(1), turn(2)).clamp_length_max(holds.largest_turn);
        let length = vector.length();
        if length > 1e-9 {
            let parent = model.bones[bone].parent.map_or(Quat::IDENTITY, |p| skeleton.frames[p]);
            let (sin, cos) = bevy::math::ops::sin_cos(0.5 * length);
            let axis = parent.inverse() * (vector / length) * sin;
            let turn = Quat::from_xyzw(axis.x, axis.y, axis.z, cos);
            state.turns[bone] = (turn * state.turns[bone]).normalize();
        }
    }
}

/// The rotation vector of a quaternion.
pub(super) fn scaled_axis(q: Quat) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let v = Vec3::new(q.x, q.y, q.z);
    let sin = v.length();
    if sin < 1e-6 { v * 2.0 } else { v / sin * (2.0 * bevy::math::ops::atan2(sin, q.w)) }
}

fn shape_hold(holds: &Holds, k: usize) -> f32 {
    if k < COMPONENTS {
        holds.components
    } else if k < COMPONENTS + GROUPS {
        holds.lengths
    } else {
        holds.girths
    }
}

/// The places of all rows with a weight, with each free shape parameter a step further.
fn variations(model: &HumanModel, state: &State, free: &[bool], rows: &[Row]) -> Vec<Option<Vec<Vec3>>> {
    use rayon::prelude::*;
    (0..SHAPE)
        .into_par_iter()
        .map(|k| {
            free[k].then(|| {
                let mut moved = state.clone();
                moved.shape[k] += STEP;
                let skeleton: Skeleton = moved.skeleton(model);
                rows.iter()
                    .filter(|row| row.weight > 0.0)
                    .map(|row| match row.place {
                        Place::Point(point) => moved.point(model, &skeleton, point),
                        Place::Joint(joint) => skeleton.joints[joint],
                    })
                    .collect()
            })
        })
        .collect()
}

/// Normal equations.
struct System {
    count: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl System {
    fn add(&mut self, entries: &[(usize, f32)], distance: f32, weight: f32) {
        for (i, &(a, va)) in entries.iter().enumerate() {
            let scaled = f64::from(va * weight);
            self.right[a] += scaled * f64::from(distance);
            for &(b, vb) in &entries[..=i] {
                // Entries rise, so b is not above a.
                self.matrix[a * self.count + b] += scaled * f64::from(vb);
            }
        }
    }

    fn hold(&mut self, parameter: usize, weight: f32, wanted: f32) {
        self.matrix[parameter * self.count + parameter] += f64::from(weight);
        self.right[parameter] += f64::from(weight) * f64::from(wanted);
    }

    /// Cholesky factorisation in place, then both substitutions.
    fn solve(mut self, damping: f64) -> Option<Vec<f64>> {
        let n = self.count;
        for i in 0..n {
            self.matrix[i * n + i] += damping + 1e-12;
        }
        for i in 0..n {
            for j in 0..=i {
                let (row_i, row_j) = (&self.matrix[i * n..i * n + j], &self.matrix[j * n..j * n + j]);
                let dot: f64 = row_i.iter().zip(row_j).map(|(a, b)| a * b).sum();
                let value = self.matrix[i * n + j] - dot;
                if i == j {
                    if value.is_nan() || value <= 0.0 {
                        return None;
                    }
                    self.matrix[i * n + i] = value.sqrt();
                } else {
                    self.matrix[i * n + j] = value / self.matrix[j * n + j];
                }
            }
        }
        for i in 0..n {
            let dot: f64 = (0..i).map(|j| self.matrix[i * n + j] * self.right[j]).sum();
            self.right[i] = (self.right[i] - dot) / self.matrix[i * n + i];
        }
        for i in (0..n).rev() {
            let dot: f64 = (i + 1..n).map(|j| self.matrix[j * n + i] * self.right[j]).sum();
            self.right[i] = (self.right[i] - dot) / self.matrix[i * n + i];
        }
        Some(self.right)
    }
}
