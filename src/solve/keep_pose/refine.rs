//! Refinement of a nearly kept pose: damped least squares over the offsets of a few controls.

use faer::{Mat, Side, prelude::Solve};
use glam::{Quat, Vec3};

use super::{Pair, PoseKeeper};
use crate::{mesh::model::Trs, rig::PoseOffset, solve::program::RigState};

/// Most controls that are varied at once; each has six parameters.
const HANDLES: usize = 10;
const ITERATIONS: usize = 12;
/// Step of the differences, in lengths of the rig's diagonal and in radians.
const STEP: f32 = 1e-3;
/// Numbers that a joint's place and rotation are told by, and a control's parameters.
const SIX: usize = 6;

impl PoseKeeper {
    /// Brings joints nearer to their targets by varying the controls that move those which are off. Nothing changes if that
    /// brings nothing.
    pub(super) fn refine(&self, attempt: &mut RigState, targets: &[Trs]) {
        let mut error = self.error(attempt, targets);
        let handles = self.handles_of_all(attempt, targets);
        let joints = self.joints_of(&handles);
        if error == 0.0 || handles.is_empty() {
            return;
        }
        let count = handles.len() * SIX;
        let mut damping = 1e-6;
        for _ in 0..ITERATIONS {
            let residual = self.residual(attempt, &joints, targets);
            let columns: Vec<Vec<f64>> = (0..count)
                .map(|number| {
                    let (slot, offset) = (handles[number / SIX], attempt.offset_at(handles[number / SIX]));
                    // A control at the end of its range moves the other way only.
                    let is_moved = [STEP, -STEP].into_iter().find(|step| {
                        let mut change = [0.0; SIX];
                        change[number % SIX] = *step;
                        attempt.set_offset_at(slot, self.changed(&offset, &change));
                        let now = attempt.offset_at(slot);
                        let turned = (offset.rotation.conjugate() * now.rotation).xyz().length();
                        now.translation.distance(offset.translation) / self.size + 2.0 * turned > 0.5 * STEP
                    });
                    let Some(step) = is_moved else {
                        attempt.set_offset_at(slot, offset);
                        return vec![0.0; residual.len()];
                    };
                    attempt.evaluate(0.0);
                    let moved = self.residual(attempt, &joints, targets);
                    attempt.set_offset_at(slot, offset);
                    moved.iter().zip(&residual).map(|(moved, was)| (moved - was) / f64::from(step)).collect()
                })
                .collect();
            attempt.evaluate(0.0);
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let normal = Mat::from_fn(count, count, |row, column| dot(&columns[row], &columns[column]));
            let right = Mat::from_fn(count, 1, |row, _| -dot(&columns[row], &residual));
            let largest = (0..count).map(|at| normal[(at, at)]).fold(0.0, f64::max);
            let before: Vec<PoseOffset> = handles.iter().map(|slot| attempt.offset_at(*slot)).collect();
            let damped = Mat::from_fn(count, count, |row, column| {
                normal[(row, column)] + if row == column { damping * largest.max(1e-12) } else { 0.0 }
            });
            let Ok(factors) = damped.llt(Side::Lower) else { return };
            let step = factors.solve(&right);
            for (number, (slot, offset)) in handles.iter().zip(&before).enumerate() {
                let change: [f32; SIX] = std::array::from_fn(|part| step[(number * SIX + part, 0)] as f32);
                attempt.set_offset_at(*slot, self.changed(offset, &change));
            }
            attempt.evaluate(0.0);
            let next = self.error(attempt, targets);
            if next < error {
                let is_done = next == 0.0 || next > 0.99 * error;
                error = next;
                damping = (damping * 0.1).max(1e-9);
                if is_done {
                    return;
                }
                continue;
            }
            for (slot, offset) in handles.iter().zip(&before) {
                attempt.set_offset_at(*slot, *offset);
            }
            attempt.evaluate(0.0);
            damping *= 100.0;
            if damping > 1e2 {
                return;
            }
        }
    }

    /// Slots of the controls that move joints which are off.
    fn handles_of_all(&self, attempt: &RigState, targets: &[Trs]) -> Vec<usize> {
        let mut handles: Vec<usize> = Vec::new();
        for (number, (pair, target)) in self.joints.iter().zip(targets).enumerate() {
            if self.is_near(attempt.global_at(pair.after), target) {
                continue;
            }
            for slot in self.handles_of(number) {
                if handles.len() < HANDLES && !handles.contains(&slot) {
                    handles.push(slot);
                }
            }
        }
        handles
    }

    /// Joints that any of the controls moves.
    fn joints_of(&self, handles: &[usize]) -> Vec<usize> {
        let moves = self.moves();
        let is_moved = |joint: &usize| handles.iter().any(|slot| moves.get(slot).is_some_and(|of| of.contains(joint)));
        (0..self.joints.len()).filter(is_moved).collect()
    }

    /// Offset with a change of six parameters: translation in lengths of the rig's diagonal, rotation in radians.
    fn changed(&self, offset: &PoseOffset, change: &[f32; SIX]) -> PoseOffset {
        let [x, y, z, a, b, c] = *change;
        PoseOffset {
            translation: offset.translation + Vec3::new(x, y, z) * self.size,
            rotation: (offset.rotation * Quat::from_scaled_axis(Vec3::new(a, b, c))).normalize(),
            scale: offset.scale,
        }
    }

    /// Way of each joint to the target in lengths of the rig's diagonal, and its rotation to it in half radians.
    fn residual(&self, state: &RigState, joints: &[usize], targets: &[Trs]) -> Vec<f64> {
        let six = |joint: &usize| {
            let Pair { after, .. } = self.joints[*joint];
            let (now, target) = (state.global_at(after), &targets[*joint]);
            let moved = (now.translation - target.translation) / self.size;
            let turned = target.rotation.conjugate() * now.rotation;
            let turned = turned.xyz() * turned.w.signum();
            [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z].map(f64::from)
        };
        joints.iter().flat_map(six).collect()
    }
}
