//! Two-bone inverse kinematics in closed form: arms and legs.
//!
//! The law of cosines places the middle joint in the plane through root, goal and pole; its height over the line from
//! root to goal comes from Heron's formula, which keeps its digits where the limb is almost straight or folded. Soft
//! reach is the exponential slow-down of Andy Nicholas (<http://www.softimageblog.com/archives/108>, "The IK softness
//! problem"). The solved rotations are the posed ones turned by the rotation that takes the bone and the bend plane to
//! their solved directions, so joints may have any axes.

use bevy::math::{Quat, Vec3, ops};

use crate::solve::rotate::{arc, between_frames, direction, perpendicular, perpendicular_or_any};

/// Sine of the bend under which a limb counts as straight.
const STRAIGHT: f32 = 1e-4;

/// A limb of two bones in its current pose, with its goal. All in the rig's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoBone {
    /// Position of the root joint (shoulder, hip). It stays.
    pub root: Vec3,
    /// Position of the middle joint (elbow, knee).
    pub mid: Vec3,
    /// Position of the end joint (wrist, ankle).
    pub end: Vec3,
    /// Rotation of the root joint, a unit quaternion.
    pub root_rotation: Quat,
    /// Rotation of the middle joint, a unit quaternion.
    pub mid_rotation: Quat,
    /// Goal of the end joint.
    pub goal: Vec3,
    /// The point towards which the limb bends. Without one (or with one in line with root and goal) the posed bend
    /// plane follows the goal by the shortest rotation.
    pub pole: Option<Vec3>,
    /// Direction in which a limb bends that is posed straight; any length. Zero: a direction that depends on the limb's
    /// direction only.
    pub preferred: Vec3,
    /// The share of the limb's length over which the end slows down before full stretch, 0 to 1. 0: none.
    pub soft: f32,
    /// Share by which the bones lengthen towards a goal out of reach, 0 (not) to 1 (until they reach it).
    pub stretch: f32,
    /// The greatest factor by which bones lengthen; under 1 counts as 1, infinity as no limit.
    pub max_stretch: f32,
    /// Share by which the middle joint goes to the pole and the end to the goal, 0 (not) to 1 (wholly): both bones take
    /// the lengths that this needs. Without a pole nothing is pinned.
    pub pin: f32,
}

/// The solved limb, in the rig's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoBoneSolution {
    /// Rotation of the root joint.
    pub root_rotation: Quat,
    /// Rotation of the middle joint.
    pub mid_rotation: Quat,
    /// Position of the middle joint.
    pub mid: Vec3,
    /// Position of the end joint.
    pub end: Vec3,
    /// The factor of both bones' lengths before the middle joint is pinned, 1 or more.
    pub stretch: f32,
    /// Factors of the lengths of the upper and the lower bone.
    pub lengths: [f32; 2],
}

impl TwoBone {
    /// Solves the limb.
    ///
    /// Without softness the end is on every goal between the difference and the sum of the bones' lengths, to 1e-5 of
    /// the limb's length; on others it is as near as it can be. With softness (and without stretch) it lags behind a
    /// goal further than `1 - soft` of the limb's length; its place, the bend and their first derivative by the goal's
    /// distance are continuous. The solution is finite for any input: a limb without length, or with input that is not
    /// finite, stays as posed; a goal on the root is met along the posed direction of the limb.
    #[inline]
    pub fn solve(&self) -> TwoBoneSolution {
        let (upper, lower) = (self.mid - self.root, self.end - self.mid);
        let (upper_length, lower_length) = (upper.length(), lower.length());
        let length = upper_length + lower_length;
        let to_goal = self.goal - self.root;
        let distance = to_goal.length();
        // A bone without length has no direction; comparisons are also false for NaN.
        let usable = upper_length > 1e-6 * length && lower_length > 1e-6 * length;
        let in_range = length > 1e-15 && length < 1e18 && distance < 1e18;
        if !(usable && in_range) {
            return self.unsolved();
        }
        let (u, l) = (upper / upper_length, lower / lower_length);

        // The posed bend: the limb's line, and the direction in which the middle joint leaves it.
        let line = direction(upper + lower).filter(|_| (upper + lower).length_squared() > 1e-12 * length * length);
        let line = line.unwrap_or(u);
        let across = l.cross(u);
        let bend_axis = if across.length_squared() > STRAIGHT * STRAIGHT {
            across.normalize()
        } else {
            // The axis of the preferred bend.
            u.cross(perpendicular_or_any(u, &[self.preferred]))
        };

        // The solved line and bend axis.
        let aim = if distance > 1e-6 * length { to_goal / distance } else { line };
        let poled = self.pole.and_then(|pole| perpendicular(pole - self.root, aim)).map(|bend| aim.cross(bend));
        let solved_axis = poled.unwrap_or_else(|| {
            let axis = arc(line, aim, bend_axis) * bend_axis;
            perpendicular_or_any(aim, &[axis, bend_axis])
        });
        let bend = solved_axis.cross(aim);

        let (reach, stretch) = self.reach(distance, upper_length, lower_length);
        let shortest = (upper_length - lower_length).abs();
        let squares = (upper_length - lower_length) * length;
        let double = 2.0 * reach;
        let along_upper = (reach * reach + squares) / double;
        let along_lower = (reach * reach - squares) / double;
        // Two roots, because the product of all four factors could overflow.
        let outer = ((length - reach) * (length + reach)).max(0.0).sqrt();
        let inner = ((reach - shortest) * (reach + shortest)).max(0.0).sqrt();
        let height = outer * (inner / double);

        let solved_u = (aim * along_upper + bend * height) / upper_length;
        let solved_l = (aim * along_lower - bend * height) / lower_length;
        let mid = self.root + solved_u * (upper_length * stretch);
        let solution = TwoBoneSolution {
            root_rotation: (between_frames([u, bend_axis], [solved_u, solved_axis]) * self.root_rotation).normalize(),
            mid_rotation: (between_frames([l, bend_axis], [solved_l, solved_axis]) * self.mid_rotation).normalize(),
            mid,
            end: mid + solved_l * (lower_length * stretch),
            stretch,
            lengths: [stretch; 2],
        };
        match self.pole {
            Some(pole) if self.pin > 0.0 && pole.distance(self.root) < 1e18 => {
                self.pinned(&solution, pole, [u, l, bend_axis, solved_axis], [upper_length, lower_length])
            }
            _ => solution,
        }
    }

    /// The solved limb with its middle joint at the pole and its end at the goal, by the share `pin` of the way.
    ///
    /// `posed` has the directions of both posed bones and the posed and the solved axis of the bend. Bones that would
    /// have no length leave the limb as it is.
    fn pinned(
        &self,
        solution: &TwoBoneSolution,
        pole: Vec3,
        [u, l, bend_axis, solved_axis]: [Vec3; 4],
        [upper_length, lower_length]: [f32; 2],
    ) -> TwoBoneSolution {
        let share = self.pin.min(1.0);
        // At its end the way is met exactly.
        let towards = |from: Vec3, to: Vec3| if share >= 1.0 { to } else { from + (to - from) * share };
        let (mid, end) = (towards(solution.mid, pole), towards(solution.end, self.goal));
        let (upper, lower) = (mid - self.root, end - mid);
        let least = 1e-6 * (upper_length + lower_length);
        if upper.length() <= least || lower.length() <= least {
            return *solution;
        }
        let (Some(to_mid), Some(to_end)) = (direction(upper), direction(lower)) else { return *solution };
        let across = to_end.cross(to_mid);
        let axis = match direction(across) {
            Some(axis) if across.length_squared() > STRAIGHT * STRAIGHT => axis,
            _ => perpendicular_or_any(to_mid, &[solved_axis]),
        };
        // A limb that its pole has drawn straight bends about the axis of before; it does not turn over.
        let flat = |bone: Vec3| perpendicular_or_any(bone, &[axis]);
        TwoBoneSolution {
            root_rotation: (between_frames([u, bend_axis], [to_mid, flat(to_mid)]) * self.root_rotation).normalize(),
            mid_rotation: (between_frames([l, bend_axis], [to_end, flat(to_end)]) * self.mid_rotation).normalize(),
            mid,
            end,
            stretch: solution.stretch,
            lengths: [upper.length() / upper_length, lower.length() / lower_length],
        }
    }

    /// The distance from root to end before bones lengthen, and the factor by which they lengthen.
    #[inline]
    fn reach(&self, distance: f32, upper: f32, lower: f32) -> (f32, f32) {
        let length = upper + lower;
        let shortest = (upper - lower).abs().max(1e-7 * length);
        let soft = length * self.soft.clamp(0.0, 1.0);
        // NaN counts as zero.
        let soft = if soft > 0.0 { soft.min(length - shortest) } else { 0.0 };
        let hard = length - soft;
        let reach = if distance <= hard || soft <= 1e-6 * length {
            distance.min(length)
        } else {
            (hard + soft * (1.0 - ops::exp((hard - distance) / soft))).min(length)
        };
        let reach = reach.max(shortest);
        let wanted = if self.stretch > 0.0 { self.stretch.min(1.0) * (distance / reach - 1.0).max(0.0) } else { 0.0 };
        (reach, (1.0 + wanted).min(self.max_stretch.max(1.0)))
    }

    /// The limb in its given pose; joints that are not finite are at the origin.
    #[cold]
    fn unsolved(&self) -> TwoBoneSolution {
        let finite = |point: Vec3| if point.is_finite() { point } else { Vec3::ZERO };
        TwoBoneSolution {
            root_rotation: crate::solve::rotate::unit(self.root_rotation),
            mid_rotation: crate::solve::rotate::unit(self.mid_rotation),
            mid: finite(self.mid),
            end: finite(self.end),
            stretch: 1.0,
            lengths: [1.0; 2],
        }
    }
}
