//! Reverse foot: a foot that rolls over heel, ball and toe and tips over its edges, driven by a few numbers.
//!
//! A chain of pivots lies between the control and the ankle: heel, toe tip, edges, ball. Each turns all pivots after
//! it; the resulting ankle is the goal of the leg's solver, and the toes turn without the ball's lift.

use bevy::math::{Quat, Vec3};

use crate::{
    mesh::model::Trs,
    solve::rotate::{about, direction, perpendicular_or_any},
};

/// A foot at rest, in the space of its control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootPivots {
    /// The back of the sole.
    pub heel: Vec3,
    /// The front of the sole.
    pub toe: Vec3,
    /// The ball, about which the heel lifts.
    pub ball: Vec3,
    /// The inner edge of the sole.
    pub inner: Vec3,
    /// The outer edge of the sole.
    pub outer: Vec3,
    /// The ankle.
    pub ankle: Vec3,
    /// Direction up from the sole, of any length.
    pub up: Vec3,
}

/// Inputs of the foot. Angles are in degrees, as people type them.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct FootControls {
    /// Roll. Negative: back over the heel. Positive: over the ball up to [`FootControls::break_angle`], then over the
    /// toe.
    pub roll: f32,
    /// Roll at which the foot begins to go over from ball to toe.
    pub break_angle: f32,
    /// Roll at which the foot stands on the toe alone, the foot straight. A value not above the break angle keeps the
    /// ball bent, and the toe takes the rest.
    pub straight_angle: f32,
    /// Tip over the outer (positive) or inner edge.
    pub bank: f32,
    /// Turn about the heel, on the ground.
    pub heel_twist: f32,
    /// Turn about the ball, on the ground.
    pub ball_twist: f32,
    /// Turn about the toe tip, on the ground.
    pub toe_twist: f32,
    /// Lift of the heel about the ball, on top of the roll.
    pub ball_lift: f32,
    /// Lift of the foot about the toe tip, on top of the roll.
    pub toe_lift: f32,
    /// Bend of the toes, upwards.
    pub toe_bend: f32,
}

impl Default for FootControls {
    fn default() -> Self {
        Self {
            roll: 0.0,
            break_angle: 35.0,
            straight_angle: 70.0,
            bank: 0.0,
            heel_twist: 0.0,
            ball_twist: 0.0,
            toe_twist: 0.0,
            ball_lift: 0.0,
            toe_lift: 0.0,
            toe_bend: 0.0,
        }
    }
}

/// Transforms of the pivots in the space of the control: rotations are from rest, translations the pivots' positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootPose {
    /// The heel pivot.
    pub heel: Trs,
    /// The toe tip pivot, after the heel.
    pub toe_tip: Trs,
    /// The outer edge pivot, after the toe tip.
    pub outer: Trs,
    /// The inner edge pivot, after the outer edge.
    pub inner: Trs,
    /// The ball pivot, after the inner edge, turned on the ground. The toes' joint follows it and bends.
    pub ball: Trs,
    /// The toes: the ball with the toes' bend.
    pub toes: Trs,
    /// The ankle, turned about the ball: the goal of the leg, and the rotation of the foot's bone.
    pub ankle: Trs,
}

/// A rigid motion from rest: a rotation and a translation.
#[derive(Clone, Copy)]
struct RigidMotion {
    rotation: Quat,
    translation: Vec3,
}

impl RigidMotion {
    const NOT: Self = Self { rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    fn apply(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// Motion after a turn about a point at rest.
    fn about(&self, pivot: Vec3, turn: Quat) -> Self {
        let rotation = (self.rotation * turn).normalize();
        Self { rotation, translation: self.apply(pivot) - rotation * pivot }
    }

    fn at(&self, point: Vec3) -> Trs {
        Trs { translation: self.apply(point), rotation: self.rotation, scale: Vec3::ONE }
    }
}

impl FootPivots {
    /// Poses the foot.
    ///
    /// Positive roll lifts the heel, positive bank tips outwards on either foot, positive twist turns counter-clockwise
    /// seen from above. Angles that are not finite count as zero. A foot without length looks along an axis
    /// perpendicular to up; one without width tips over the ball.
    pub fn solve(&self, controls: &FootControls) -> FootPose {
        let up = direction(self.up).unwrap_or(Vec3::Y);
        let forward = perpendicular_or_any(up, &[self.toe - self.heel, self.ball - self.heel, Vec3::Z]);
        let side = up.cross(forward);
        let width = self.outer - self.inner;
        let outwards = if width.dot(side) < 0.0 { -side } else { side };
        let tilt = up.cross(outwards);
        let turn = |axis: Vec3, degrees: f32| {
            if degrees.is_finite() { about(axis, degrees.to_radians()) } else { Quat::IDENTITY }
        };
        let [heel, ball, toe] = controls.split();
        let (inner, outer) = if direction(width).is_some() { (self.inner, self.outer) } else { (self.ball, self.ball) };

        let on_heel = RigidMotion::NOT.about(self.heel, turn(up, controls.heel_twist) * turn(side, heel));
        let toe_lift = if controls.toe_lift.is_finite() { controls.toe_lift } else { 0.0 };
        let on_toe = on_heel.about(self.toe, turn(up, controls.toe_twist) * turn(side, toe + toe_lift));
        let on_outer = on_toe.about(outer, turn(tilt, controls.bank.max(0.0)));
        let on_inner = on_outer.about(inner, turn(tilt, controls.bank.min(0.0)));
        let on_ball = on_inner.about(self.ball, turn(up, controls.ball_twist));
        let ball_lift = if controls.ball_lift.is_finite() { controls.ball_lift } else { 0.0 };
        let lifted = on_ball.about(self.ball, turn(side, ball + ball_lift));
        let toes = on_ball.about(self.ball, turn(side, -controls.toe_bend));
        FootPose {
            heel: on_heel.at(self.heel),
            toe_tip: on_toe.at(self.toe),
            outer: on_outer.at(self.outer),
            inner: on_inner.at(self.inner),
            ball: on_ball.at(self.ball),
            toes: toes.at(self.ball),
            ankle: lifted.at(self.ankle),
        }
    }
}

impl FootControls {
    /// The parts of the roll at heel, ball and toe, in degrees; continuous in the roll.
    pub fn split(&self) -> [f32; 3] {
        let roll = self.roll;
        // The negation covers NaN, too.
        if !(roll.is_finite() && roll > 0.0) {
            return [if roll.is_finite() { roll } else { 0.0 }, 0.0, 0.0];
        }
        let bend = if self.break_angle > 0.0 { self.break_angle } else { 0.0 };
        if roll <= bend {
            return [0.0, roll, 0.0];
        }
        let span = self.straight_angle - bend;
        if !(span > 0.0 && span.is_finite()) {
            return [0.0, bend, roll - bend];
        }
        // From the break angle on, the ball straightens while the toe takes over.
        let share = ((roll - bend) / span).min(1.0);
        [0.0, bend * (1.0 - share), roll - bend * (1.0 - share)]
    }
}
