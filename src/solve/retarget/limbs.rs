//! Arms and legs: directions of the source's bones on the target's, and hinges about which they bend.

use bevy::math::{Quat, Vec3, ops};

use super::{body::Body, figure::Figure};
use crate::{
    rig::animation::humanoid::{BodySide, HumanBone, LimbBone},
    solve::rotate::{arc, between_frames, direction, perpendicular, perpendicular_or_any},
};

/// Sine of a bend beyond which a source that bends the wrong way is believed.
const REAL: f32 = 0.35;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LimbKind {
    Arm,
    Leg,
}

impl LimbKind {
    fn bones(self) -> [LimbBone; 3] {
        match self {
            Self::Arm => [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand],
            Self::Leg => [LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot],
        }
    }
}

/// Place for the end of a limb.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reach {
    pub place: Vec3,
    /// Share from 0 to 1 with which the limb bends about its own hinge rather than as the source does.
    pub share: f32,
}

/// Arm or leg of both skeletons. Hinges are unit vectors about which a positive angle takes the upper bone's direction to
/// that of the lower one.
#[derive(Debug, Clone)]
pub(super) struct Limb {
    pub side: BodySide,
    pub kind: LimbKind,
    /// Joints of the target: root, middle, end.
    pub target: [usize; 3],
    /// Joints of the source.
    pub source: [usize; 3],
    /// Joints of the source whose rotations are those of the upper and the lower bone.
    turns: [usize; 2],
    /// Lengths of the target's bones.
    pub lengths: [f32; 2],
    /// Target at rest: direction and hinge of both bones, and rotations of both joints.
    rest: [[Vec3; 2]; 2],
    rotations: [Quat; 2],
    /// Hinge of the source in its upper bone's space at rest.
    hinge: Vec3,
    /// Rotation that brings the target's lower bone at rest onto that of the source.
    pub lower_rest: Quat,
}

impl Limb {
    /// Limb that both skeletons have.
    pub fn new(body: &Body, side: BodySide, kind: LimbKind, rest: &dyn Fn(usize) -> Vec3) -> Option<Self> {
        let joints = |figure: &Figure| {
            let [a, b, c] = kind.bones().map(|bone| figure.limb(side, bone));
            Some([a?, b?, c?])
        };
        let (source, target) = (joints(body.source)?, joints(body.target)?);
        let last = |bone: LimbBone| body.source.bones.get(&HumanBone::Limb(side, bone))?.last().copied();
        let [upper, lower, _] = kind.bones();
        let turns = [last(upper)?, last(lower)?];
        let own = target.map(|joint| body.target.joints[joint].rest.translation);
        let lengths = [own[0].distance(own[1]), own[1].distance(own[2])];
        let forward = body.target.axes * Vec3::Z;
        let expected = |upper: Vec3| match kind {
            LimbKind::Arm => upper.cross(forward),
            LimbKind::Leg => forward.cross(upper),
        };
        let [u, f] = bones(own)?;
        let hinge = rest_hinge(u, f, perpendicular_or_any(u, &[expected(u), body.up]));
        let ends = source.map(rest);
        let [source_u, source_f] = bones(ends)?;
        let usual = rest_hinge(source_u, source_f, perpendicular_or_any(source_u, &[expected(source_u), body.up]));
        let [moved, moved_lower] = moved_hinges(body, source, turns);
        let source_hinge = moved.and_then(|hinge| perpendicular(hinge, source_u)).unwrap_or(usual);
        let source_lower = moved_lower.and_then(|hinge| perpendicular(hinge, source_f)).unwrap_or(usual);
        let framed = |direction: Vec3, hinge: Vec3| [direction, perpendicular_or_any(direction, &[hinge])];
        Some(Self {
            side,
            kind,
            target,
            source,
            turns,
            lengths,
            rest: [framed(u, hinge), framed(f, hinge)],
            rotations: [target[0], target[1]].map(|joint| body.target.joints[joint].rest.rotation),
            hinge: source_hinge,
            lower_rest: between_frames(framed(f, hinge), framed(source_f, source_lower)),
        })
    }

    /// Rotations of the upper and the lower joint at a frame. A limb reaches for `goal`; without one, a leg does for the place
    /// that the source's foot has from its hip, and an arm has the directions of the source's. Without twist joints the lower bone has the roll of the source's.
    pub fn solve(&self, body: &Body, frame: usize, root: Vec3, goal: Option<Reach>, has_twist: bool) -> [Quat; 2] {
        let frame = &body.frames[frame];
        let places = self.source.map(|joint| frame.places[joint]);
        let [upper_turn, lower_turn] = self.turns.map(|joint| frame.turns[joint]);
        let reference = upper_turn * self.hinge;
        let [mut u, mut f] = bones(places).unwrap_or([self.rest[0][0], self.rest[1][0]]);
        let across = u.cross(f);
        let mut hinge = reference;
        if let Some(axis) = direction(across) {
            if axis.dot(reference) >= 0.0 || across.length() >= REAL {
                let weight = smooth((across.length() - 0.05) / 0.25);
                hinge = direction(reference.lerp(axis, weight)).unwrap_or(axis);
            } else {
                // A knee or an elbow is straight rather than bent backwards.
                f = u;
            }
        }
        if self.kind == LimbKind::Leg {
            let way = goal.map_or(places[2] - places[0], |goal| goal.place - root);
            hinge = perpendicular_or_any(direction(way).unwrap_or(u), &[hinge, reference]);
            [u, f] = self.bent(way, hinge, u);
        } else if let Some(Reach { place, share }) = goal {
            let (was, way) = (u, place - root);
            // The plane in which the arm bends already, so that it does not jump when it begins to reach.
            let plane = direction(u.cross(f)).unwrap_or(hinge);
            let plane = direction(plane.lerp(hinge, share)).unwrap_or(hinge);
            let plane = perpendicular_or_any(direction(way).unwrap_or(u), &[plane, hinge]);
            [u, f] = self.bent(way, plane, u);
            hinge = arc(was, u, hinge) * hinge;
        }
        let upper = between_frames(self.rest[0], [u, perpendicular_or_any(u, &[hinge])]) * self.rotations[0];
        let lower = if has_twist || self.kind == LimbKind::Leg {
            between_frames(self.rest[1], [f, perpendicular_or_any(f, &[hinge])])
        } else {
            let turned = lower_turn * self.lower_rest;
            arc((turned * self.rest[1][0]).normalize(), f, hinge) * turned
        };
        [upper.normalize(), (lower * self.rotations[1]).normalize()]
    }

    /// Directions of both bones that end at `way` from the root, bent about a hinge across it; `u` is that of the upper bone if
    /// the way has no direction.
    fn bent(&self, way: Vec3, hinge: Vec3, u: Vec3) -> [Vec3; 2] {
        let line = direction(way).unwrap_or(u);
        let [upper, lower] = self.lengths;
        let far = way.length().clamp((upper - lower).abs() + 1e-4 * upper, STRETCHED * (upper + lower));
        let cosine = (upper * upper + far * far - lower * lower) / (2.0 * upper * far);
        let (sin, cos) = ops::sin_cos(ops::acos(cosine.clamp(-1.0, 1.0)));
        let u = line * cos - hinge.cross(line) * sin;
        [u, direction(line * far - u * upper).unwrap_or(u)]
    }
}

/// Greatest share of a limb's length at which it counts as stretched.
pub(super) const STRETCHED: f32 = 0.9995;

/// Directions of two bones.
fn bones([a, b, c]: [Vec3; 3]) -> Option<[Vec3; 2]> {
    Some([direction(b - a)?, direction(c - b)?])
}

/// Hinge of a limb at rest: that of its bend if it is bent as expected, else the expected one.
fn rest_hinge(u: Vec3, f: Vec3, expected: Vec3) -> Vec3 {
    let across = u.cross(f);
    direction(across).filter(|axis| across.length() > 0.03 && axis.dot(expected) > 0.5).unwrap_or(expected)
}

/// Hinges in the spaces of both bones at rest, as the source bends; `None` where it does not bend about one axis.
fn moved_hinges(body: &Body, source: [usize; 3], turns: [usize; 2]) -> [Option<Vec3>; 2] {
    let mut sums = [Vec3::ZERO; 2];
    let mut whole = 0.0;
    for frame in &body.frames {
        let Some([u, f]) = bones(source.map(|joint| frame.places[joint])) else { continue };
        let across = u.cross(f);
        whole += across.length();
        for (sum, turn) in sums.iter_mut().zip(turns) {
            *sum += frame.turns[turn].inverse() * across;
        }
    }
    let is_bent = whole > 0.08 * body.frames.len() as f32;
    sums.map(|sum| direction(sum).filter(|_| is_bent && sum.length() > 0.7 * whole))
}

/// Smooth step from 0 to 1.
pub(super) fn smooth(share: f32) -> f32 {
    let share = share.clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
