//! Springs: points and rotations that follow a target late and swing.
//!
//! A damped harmonic oscillator, advanced in fixed steps of 1/240 s by its closed solution (so no stiffness and no
//! damping makes it unstable), with the target moving evenly between frames. Time of a frame that does not fill a step
//! is kept for the next frame, and the result is extrapolated over it, so that motion does not depend on the frame
//! rate.

use bevy::math::{Quat, Vec3, ops};

use crate::solve::rotate::{from_scaled_axis, scaled_axis, slerp, unit};

/// Length of a step in seconds.
pub const STEP: f32 = 1.0 / 240.0;

/// Longest simulated time of a frame in seconds; the rest of a longer frame is skipped.
pub const LONGEST: f32 = 0.5;

/// Parameters of a spring.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spring {
    /// Frequency of undamped oscillation in hertz. 0 (or less) ties the value to the target.
    pub frequency: f32,
    /// Damping ratio: 0 swings for ever, 1 does not overshoot, more creeps.
    pub damping: f32,
}

impl Default for Spring {
    fn default() -> Self {
        Self { frequency: 2.0, damping: 0.3 }
    }
}

/// Coefficients of one step: `offset' = a * offset + b * velocity`, and so on.
#[derive(Debug, Clone, Copy)]
struct StepMatrix {
    offset: [f32; 2],
    velocity: [f32; 2],
}

impl Spring {
    /// Returns `true` if the spring moves at all.
    fn is_on(&self) -> bool {
        self.frequency > 0.0 && self.frequency.is_finite()
    }

    /// The closed solution of `x'' = -w² x - 2 d w x'` over `time` seconds.
    fn step_matrix(&self, time: f32) -> StepMatrix {
        let w = std::f32::consts::TAU * self.frequency;
        let d = if self.damping > 0.0 { self.damping.min(1e4) } else { 0.0 };
        let still = StepMatrix { offset: [0.0; 2], velocity: [0.0; 2] };
        let step_matrix = if (d - 1.0).abs() < 1e-3 {
            let decay = ops::exp(-w * time);
            let wt = w * time;
            StepMatrix { offset: [decay * (1.0 + wt), decay * time], velocity: [-decay * w * wt, decay * (1.0 - wt)] }
        } else if d < 1.0 {
            let damped = w * (1.0 - d * d).sqrt();
            let decay = ops::exp(-d * w * time);
            let (sin, cos) = ops::sin_cos(damped * time);
            let (s, ratio) = (sin / damped, d * w);
            StepMatrix {
                offset: [decay * (cos + ratio * s), decay * s],
                velocity: [-decay * w * w * s, decay * (cos - ratio * s)],
            }
        } else {
            // Two decays, a slow and a fast one. The slow root as a quotient: a difference would lose its digits.
            let root = (d * d - 1.0).sqrt();
            let (slow, fast) = (-w / (d + root), -w * (d + root));
            let (e1, e2) = (ops::exp(slow * time), ops::exp(fast * time));
            let span = fast - slow;
            StepMatrix {
                offset: [(fast * e1 - slow * e2) / span, (e2 - e1) / span],
                velocity: [slow * fast * (e1 - e2) / span, (fast * e2 - slow * e1) / span],
            }
        };
        let all = [step_matrix.offset, step_matrix.velocity];
        if all.as_flattened().iter().all(|value| value.is_finite()) { step_matrix } else { still }
    }

    /// Advances a point spring by `dt` seconds, while its target moves evenly from its last position to `target`;
    /// returns the new position of the point. A state or a target that is not finite restarts the spring at rest on the
    /// target.
    pub fn point(&self, state: &mut PointSpring, target: Vec3, dt: f32) -> Vec3 {
        if !target.is_finite() {
            return if state.position.is_finite() { state.position } else { Vec3::ZERO };
        }
        if !(self.is_on() && state.is_finite()) {
            *state = PointSpring::at(target);
            return target;
        }
        let (steps, frame) = advance(&mut state.left, dt);
        if steps > 0 {
            let step_matrix = self.step_matrix(STEP);
            for step in 1..=steps {
                let goal = state.target + (target - state.target) * frame.share(step);
                let offset = state.position - goal;
                let velocity = state.velocity;
                state.position = goal + offset * step_matrix.offset[0] + velocity * step_matrix.offset[1];
                state.velocity = offset * step_matrix.velocity[0] + velocity * step_matrix.velocity[1];
            }
        }
        // The steps of a later frame start from the target at the end of this one, so move it there.
        state.target = target;
        if !state.is_finite() {
            *state = PointSpring::at(target);
        }
        if state.left <= 0.0 {
            return state.position;
        }
        let step_matrix = self.step_matrix(state.left);
        target + (state.position - target) * step_matrix.offset[0] + state.velocity * step_matrix.offset[1]
    }

    /// Advances a rotation spring, like [`Spring::point`]: the offset from the target is an axis times an angle of at
    /// most half a turn, so a target that jumps further is followed the shorter way.
    pub fn rotation(&self, state: &mut RotationSpring, target: Quat, dt: f32) -> Quat {
        if !target.is_finite() {
            return unit(state.rotation);
        }
        let target = unit(target);
        if !(self.is_on() && state.is_finite()) {
            *state = RotationSpring::at(target);
            return target;
        }
        let (steps, frame) = advance(&mut state.left, dt);
        if steps > 0 {
            let step_matrix = self.step_matrix(STEP);
            for step in 1..=steps {
                let goal = slerp(state.target, target, frame.share(step));
                let offset = scaled_axis(state.rotation * goal.conjugate());
                let velocity = state.velocity;
                let led = offset * step_matrix.offset[0] + velocity * step_matrix.offset[1];
                state.rotation = (from_scaled_axis(led) * goal).normalize();
                state.velocity = offset * step_matrix.velocity[0] + velocity * step_matrix.velocity[1];
            }
        }
        state.target = target;
        if !state.is_finite() {
            *state = RotationSpring::at(target);
        }
        if state.left <= 0.0 {
            return state.rotation;
        }
        let step_matrix = self.step_matrix(state.left);
        let offset = scaled_axis(state.rotation * target.conjugate());
        (from_scaled_axis(offset * step_matrix.offset[0] + state.velocity * step_matrix.offset[1]) * target).normalize()
    }
}

/// Times of the steps within a frame.
#[derive(Debug, Clone, Copy)]
struct Frame {
    /// Time before the frame that its first step covers.
    before: f32,
    time: f32,
}

impl Frame {
    /// Share of the frame that has passed after a step (1 for the first).
    fn share(&self, step: u32) -> f32 {
        if self.time > 0.0 { ((step as f32 * STEP - self.before) / self.time).clamp(0.0, 1.0) } else { 1.0 }
    }
}

/// The number of steps of a frame; `left` is the time left over.
fn advance(left: &mut f32, dt: f32) -> (u32, Frame) {
    let time = if dt > 0.0 { dt.min(LONGEST) } else { 0.0 };
    let before = if left.is_finite() { left.clamp(0.0, STEP) } else { 0.0 };
    let due = before + time;
    // A frame of a whole number of steps must not lose one to rounding.
    let steps = (due / STEP + 1e-3).floor();
    *left = (due - steps * STEP).max(0.0);
    (steps as u32, Frame { before, time })
}

/// State of a point spring, in the space of its target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointSpring {
    /// Position at the last step.
    pub position: Vec3,
    /// Velocity in units per second.
    pub velocity: Vec3,
    /// Position of the target in the last frame.
    pub target: Vec3,
    /// Time since the last step, in seconds.
    pub left: f32,
}

impl PointSpring {
    /// A spring at rest on its target.
    pub fn at(target: Vec3) -> Self {
        Self { position: target, velocity: Vec3::ZERO, target, left: 0.0 }
    }

    /// Keeps the point by a share in the world while the space of its target moves: `rotation` and `translation` map
    /// places of the space before to those of the space after.
    pub fn carry(&mut self, rotation: Quat, translation: Vec3, share: f32) {
        let towards = |from: Vec3, to: Vec3| from + (to - from) * share;
        self.position = towards(self.position, rotation * self.position + translation);
        self.target = towards(self.target, rotation * self.target + translation);
        self.velocity = towards(self.velocity, rotation * self.velocity);
    }

    fn is_finite(&self) -> bool {
        self.position.is_finite() && self.velocity.is_finite() && self.target.is_finite() && self.left.is_finite()
    }
}

/// State of a rotation spring, in the space of its target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationSpring {
    /// Rotation at the last step.
    pub rotation: Quat,
    /// Angular velocity about the axes of the target's space, in radians per second.
    pub velocity: Vec3,
    /// Rotation of the target in the last frame.
    pub target: Quat,
    /// Time since the last step, in seconds.
    pub left: f32,
}

impl RotationSpring {
    /// A spring at rest on its target.
    pub fn at(target: Quat) -> Self {
        let target = unit(target);
        Self { rotation: target, velocity: Vec3::ZERO, target, left: 0.0 }
    }

    fn is_finite(&self) -> bool {
        self.rotation.is_finite() && self.velocity.is_finite() && self.target.is_finite() && self.left.is_finite()
    }
}
