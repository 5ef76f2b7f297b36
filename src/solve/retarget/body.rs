//! Source frames in the target's space, and the target's poses that follow from them.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Quat, Vec3};

use super::{
    contacts::Contacts,
    figure::Figure,
    limbs::{Limb, LimbKind, Reach},
    pose::Pose,
    touches::Touches,
};
use crate::{
    mesh::model::Trs,
    rig::animation::{
        humanoid::{BodySide, HumanBone, LimbBone},
        joint_map::JointMap,
        motion::Motion,
    },
    solve::rotate::{between_frames, direction, slerp},
};

/// Joints of the source at a frame, turned and scaled into the target's space.
#[derive(Debug, Clone, Default)]
pub(super) struct SourceFrame {
    /// Positions by joint of the source.
    pub places: Vec<Vec3>,
    /// Rotations beyond rest.
    pub turns: Vec<Quat>,
    /// Balls of the left and the right foot.
    pub balls: [Vec3; 2],
}

/// Places of ankles and wrists at a frame, left and right.
#[derive(Debug, Clone, Copy, Default)]
struct LimbGoals {
    feet: [Option<Reach>; 2],
    hands: [Option<Reach>; 2],
}

/// Source and target with everything that is constant for a clip.
pub(super) struct Body<'a> {
    pub target: &'a Figure,
    pub source: &'a Figure,
    pub frames: Vec<SourceFrame>,
    /// Up direction in the target's space.
    pub up: Vec3,
    /// Joints of the target that are turned, with the joint of the source that tells by how much, and a constant rotation.
    turned: BTreeMap<usize, TurnedJoint>,
    /// Further joints that turn alike.
    pairs: Vec<(usize, usize)>,
    /// Joints of the target whose places anything asks for, sorted.
    pose_joints: Vec<usize>,
    pub limbs: Vec<Limb>,
    /// Height of the ankles above the ground in the source's frames.
    pub source_ankle: f32,
    /// Height of the balls of the feet, likewise.
    pub source_ball: f32,
}

/// Joint of the target that turns with joints of the source.
#[derive(Debug, Clone, Copy)]
struct TurnedJoint {
    /// Joints of the source, and the share of the second.
    from: (usize, usize, f32),
    /// Rotation that brings the rest pose onto that of the source.
    rest: Quat,
}

impl<'a> Body<'a> {
    pub fn new(source: &'a Figure, target: &'a Figure, map: &JointMap, motion: &Motion, times: &[f32]) -> Self {
        let turn = (target.axes * source.axes.inverse()).normalize();
        let scale = target.leg / source.leg;
        let rest_turns: Vec<Quat> = source.joints.iter().map(|joint| joint.rest.rotation.inverse()).collect();
        let feet = BodySide::BOTH.map(|side| ball_of(source, motion, side));
        let frame = |time: &f32| {
            let globals = motion.globals_at(*time);
            let ball = |foot: Option<(usize, Vec3)>| {
                foot.map_or(Vec3::ZERO, |(joint, offset)| turn * globals[joint].transform_point(offset) * scale)
            };
            SourceFrame {
                places: globals.iter().map(|at| turn * at.translation * scale).collect(),
                turns: globals
                    .iter()
                    .zip(&rest_turns)
                    .map(|(at, rest)| (turn * at.rotation * *rest * turn.inverse()).normalize())
                    .collect(),
                balls: feet.map(ball),
            }
        };
        let mut frames: Vec<SourceFrame> = times.iter().map(frame).collect();
        let up = target.axes * Vec3::Y;
        // The clip begins where the rig stands.
        if let (Some(from), Some(to), Some(first)) =
            (source.first(HumanBone::Hips), target.first(HumanBone::Hips), frames.first())
        {
            let shift = target.joints[to].rest.translation - first.places[from];
            let shift = shift - up * shift.dot(up);
            frames.iter_mut().for_each(|frame| frame.shift(shift));
        }
        let mut body = Self {
            target,
            source,
            frames,
            up,
            turned: BTreeMap::new(),
            pairs: map.pairs.clone(),
            pose_joints: Vec::new(),
            limbs: Vec::new(),
            source_ankle: 0.0,
            source_ball: 0.0,
        };
        body.find_ground();
        let rest = |joint: usize| turn * source.joints[joint].rest.translation;
        // Hips of animals, whose paws are not looked at, are as high as at rest.
        if let (Some(_), Some(from), Some(to)) =
            (map.axes, source.first(HumanBone::Hips), target.first(HumanBone::Hips))
        {
            let off = scale * rest(from) - target.joints[to].rest.translation;
            body.source_ankle = body.ankle_height() + off.dot(up);
        }
        for side in BodySide::BOTH {
            for kind in [LimbKind::Arm, LimbKind::Leg] {
                let limb = Limb::new(&body, side, kind, &rest);
                body.limbs.extend(limb);
            }
        }
        body.turned = body.find_turned(map);
        body.pose_joints = body.find_pose_joints();
        body
    }

    /// Joints that the motion moves, with their parents, and those of bones, at which contacts look.
    fn find_pose_joints(&self) -> Vec<usize> {
        let joints = &self.target.joints;
        let moved = (0..joints.len()).filter(|joint| self.is_moved(*joint));
        let mut found: BTreeSet<usize> =
            moved.flat_map(|joint| [Some(joint), joints[joint].parent]).flatten().collect();
        found.extend(self.target.bones.values().flatten());
        found.into_iter().collect()
    }

    /// Joints that turn, but for those of limbs.
    fn find_turned(&self, map: &JointMap) -> BTreeMap<usize, TurnedJoint> {
        let mut found = BTreeMap::new();
        let limb_of =
            |side: BodySide, kind: LimbKind| self.limbs.iter().find(|limb| limb.side == side && limb.kind == kind);
        for (bone, from, to) in map.bones() {
            let last = from[from.len() - 1];
            let rest = match bone {
                HumanBone::Limb(side, LimbBone::Foot | LimbBone::Toes) => self.flat_foot(side),
                HumanBone::Limb(side, LimbBone::Hand) | HumanBone::Finger(side, ..) => {
                    limb_of(side, LimbKind::Arm).map_or(Quat::IDENTITY, |arm| arm.lower_rest)
                }
                _ => Quat::IDENTITY,
            };
            match bone {
                HumanBone::Spine | HumanBone::Neck => {
                    let shares = shared(self.source, from, self.target, to);
                    for (joint, from) in to.iter().zip(shares) {
                        found.insert(*joint, TurnedJoint { from, rest });
                    }
                }
                HumanBone::Limb(
                    _,
                    LimbBone::UpperArm | LimbBone::LowerArm | LimbBone::UpperLeg | LimbBone::LowerLeg,
                ) => {}
                _ => {
                    found.insert(to[0], TurnedJoint { from: (last, last, 0.0), rest });
                }
            }
        }
        found
    }

    /// Rotation that brings the target's foot at rest, which is flat, onto the source's foot as it is when it stands.
    fn flat_foot(&self, side: BodySide) -> Quat {
        let ends = |figure: &Figure| {
            let [foot, toes] = [LimbBone::Foot, LimbBone::Toes].map(|bone| figure.limb(side, bone));
            Some(figure.joints[toes?].rest.translation - figure.joints[foot?].rest.translation)
        };
        let turn = self.target.axes * self.source.axes.inverse();
        let level = |v: Vec3| direction(v - self.up * v.dot(self.up));
        let yaw = match (ends(self.target).and_then(level), ends(self.source).and_then(|v| level(turn * v))) {
            (Some(to), Some(from)) if to.dot(from) > 0.2 => {
                between_frames([self.up, to.cross(self.up)], [self.up, from.cross(self.up)])
            }
            _ => Quat::IDENTITY,
        };
        let Some(foot) = self.source.bones.get(&HumanBone::Limb(side, LimbBone::Foot)).and_then(|list| list.last())
        else {
            return yaw;
        };
        // Up in the space of the foot at rest, at the frames in which the ankle is low and slow.
        let mut sum = Vec3::ZERO;
        for pair in self.frames.windows(2) {
            let (was, is) = (pair[0].places[*foot], pair[1].places[*foot]);
            let is_low = is.dot(self.up) < self.source_ankle + 0.04 * self.target.leg;
            if is_low && was.distance(is) < 0.02 * self.target.leg {
                sum += pair[1].turns[*foot].inverse() * self.up;
            }
        }
        match direction(sum) {
            Some(stood) if stood.dot(self.up) > 0.85 => crate::solve::rotate::arc(self.up, stood, Vec3::X) * yaw,
            _ => yaw,
        }
    }

    /// Heights of ankles and balls in the frames in which they are low.
    fn find_ground(&mut self) {
        let ankles = BodySide::BOTH.map(|side| self.source.limb(side, LimbBone::Foot));
        let low = |mut heights: Vec<f32>| {
            heights.sort_by(f32::total_cmp);
            heights.get(heights.len() / 10).copied().unwrap_or_default()
        };
        let of = |joint: usize| self.frames.iter().map(|frame| frame.places[joint].dot(self.up)).collect();
        let ankles: Vec<f32> = ankles.into_iter().flatten().map(|joint| low(of(joint))).collect();
        let balls = [0, 1].map(|foot| low(self.frames.iter().map(|frame| frame.balls[foot].dot(self.up)).collect()));
        if !ankles.is_empty() {
            self.source_ankle = ankles.iter().sum::<f32>() / ankles.len() as f32;
            self.source_ball = 0.5 * (balls[0] + balls[1]);
        }
    }

    /// Height of an ankle of the target at rest.
    pub fn ankle_height(&self) -> f32 {
        let ankles = BodySide::BOTH.into_iter().filter_map(|side| self.target.limb(side, LimbBone::Foot));
        let heights: Vec<f32> = ankles.map(|joint| self.target.joints[joint].rest.translation.dot(self.up)).collect();
        heights.iter().sum::<f32>() / heights.len().max(1) as f32
    }

    /// Height of the target that belongs to a height in the source's frames.
    pub fn lifted(&self, height: f32) -> f32 {
        self.ankle_height() + height - self.source_ankle
    }

    /// Rotation of a joint of the target in the rig's space that a frame asks for.
    pub fn turn_of(&self, joint: usize, frame: usize) -> Option<Quat> {
        let TurnedJoint { from: (a, b, share), rest } = self.turned.get(&joint)?;
        let turns = &self.frames[frame].turns;
        let turn = if *share > 0.0 { slerp(turns[*a], turns[*b], *share) } else { turns[*a] };
        Some((turn * *rest * self.target.joints[joint].rest.rotation).normalize())
    }

    /// Joints of the target that a clip turns.
    pub fn is_moved(&self, joint: usize) -> bool {
        self.turned.contains_key(&joint)
            || self.pairs.iter().any(|(_, to)| *to == joint)
            || self.limbs.iter().any(|limb| limb.target.contains(&joint))
    }

    /// Position of the target's hips at a frame, lowered by `drop`.
    pub fn hips_place(&self, frame: usize, drop: f32) -> Option<(usize, Vec3)> {
        let (from, to) = (self.source.first(HumanBone::Hips)?, self.target.first(HumanBone::Hips)?);
        let (rest, places) = (&self.target.joints[to].rest, &self.frames[frame].places);
        let sides = BodySide::BOTH.map(|side| {
            let bone = LimbBone::UpperLeg;
            Some((self.source.limb(side, bone)?, self.target.limb(side, bone)?))
        });
        let turned = self.turn_of(to, frame)? * rest.rotation.inverse();
        // The middle between the hip joints counts: joints called hips stand anywhere near it.
        let (middle, carried) = match sides {
            [Some((a, from_a)), Some((b, from_b))] => {
                let at = |joint: usize| self.target.joints[joint].rest.translation;
                (places[a].midpoint(places[b]), at(from_a).midpoint(at(from_b)) - rest.translation)
            }
            _ => (places[from], Vec3::ZERO),
        };
        let level = middle - self.up * middle.dot(self.up);
        Some((to, level + self.up * (self.lifted(middle.dot(self.up)) - drop) - turned * carried))
    }

    /// Poses of the target in the rig's space, frame by frame.
    pub fn poses(&self, contacts: &Contacts, touches: &Touches, rate: f32, has_twist: bool) -> Vec<Pose<'_>> {
        let frames = 0..self.frames.len();
        let free = LimbGoals::default();
        let raw: Vec<Pose> = frames.clone().map(|frame| self.pose(frame, 0.0, &free, has_twist)).collect();
        let feet = contacts.goals(self, &raw, rate);
        let drops = contacts.drops(self, &raw, &feet, rate);
        // The list of the poses to come takes as much.
        drop(raw);
        let goals = |frame: usize, hands: [Option<Reach>; 2]| {
            let feet = feet[frame].map(|place| place.map(|place| Reach { place, share: 1.0 }));
            LimbGoals { feet, hands }
        };
        let standing = |frame: usize| self.pose(frame, drops[frame], &goals(frame, [None; 2]), has_twist);
        let mut poses: Vec<Pose> = frames.map(standing).collect();
        if touches.is_empty() {
            return poses;
        }
        for (frame, hands) in touches.goals(self, &poses, rate).into_iter().enumerate() {
            if hands.iter().any(Option::is_some) {
                poses[frame] = self.pose(frame, drops[frame], &goals(frame, hands), has_twist);
            }
        }
        poses
    }

    /// Pose of the target at a frame.
    fn pose(&self, frame: usize, drop: f32, goals: &LimbGoals, has_twist: bool) -> Pose<'_> {
        let hips = self.hips_place(frame, drop);
        let mut globals: Vec<Trs> = Vec::with_capacity(self.target.joints.len());
        let mut solved: BTreeMap<usize, Quat> = BTreeMap::new();
        for (at, joint) in self.target.joints.iter().enumerate() {
            let mut global = joint.parent.map_or(joint.local, |parent| globals[parent] * joint.local);
            if let Some((_, place)) = hips.filter(|(joint, _)| *joint == at) {
                global.translation = place;
            }
            if let Some(turn) = self.turn_of(at, frame) {
                global.rotation = turn;
            }
            if let Some((from, _)) = self.pairs.iter().find(|(_, to)| *to == at) {
                global.rotation = (self.frames[frame].turns[*from] * joint.rest.rotation).normalize();
            }
            if let Some(limb) = self.limbs.iter().find(|limb| limb.target[0] == at) {
                let goal = match limb.kind {
                    LimbKind::Leg => goals.feet[limb.side as usize],
                    LimbKind::Arm => goals.hands[limb.side as usize],
                };
                let [upper, lower] = limb.solve(self, frame, global.translation, goal, has_twist);
                global.rotation = upper;
                solved.insert(limb.target[1], lower);
            }
            if let Some(lower) = solved.get(&at) {
                global.rotation = *lower;
            }
            globals.push(global);
        }
        Pose::new(self.target, &self.pose_joints, &globals)
    }
}

impl SourceFrame {
    /// Moves the figure.
    pub fn shift(&mut self, by: Vec3) {
        self.places.iter_mut().chain(&mut self.balls).for_each(|place| *place += by);
    }
}

/// Ball of a foot: a joint and a point in its space.
fn ball_of(source: &Figure, motion: &Motion, side: BodySide) -> Option<(usize, Vec3)> {
    if let Some(toes) = source.limb(side, LimbBone::Toes) {
        return Some((toes, Vec3::ZERO));
    }
    let foot = source.limb(side, LimbBone::Foot)?;
    let end = motion.joints[foot].ends.first().copied().unwrap_or_default();
    Some((foot, end))
}

/// Joints of a chain of the source for each joint of a chain of the target, by the share of the length at which their bones
/// have their middles. The last joints belong together.
fn shared(source: &Figure, from: &[usize], target: &Figure, to: &[usize]) -> Vec<(usize, usize, f32)> {
    let middles = |figure: &Figure, chain: &[usize]| {
        let place = |joint: usize| figure.joints[joint].rest.translation;
        let lengths: Vec<f32> = chain.windows(2).map(|pair| place(pair[0]).distance(place(pair[1]))).collect();
        let whole = lengths.iter().sum::<f32>().max(f32::MIN_POSITIVE);
        let mut done = 0.0;
        let mut middles: Vec<f32> = lengths
            .iter()
            .map(|length| {
                done += length;
                (done - 0.5 * length) / whole
            })
            .collect();
        // The last joint holds what is above the chain.
        middles.push(1.0);
        middles
    };
    let (of_source, of_target) = (middles(source, from), middles(target, to));
    let share = |(place, at): (usize, &f32)| {
        if place + 1 == to.len() {
            let last = from[from.len() - 1];
            return (last, last, 0.0);
        }
        let next = of_source.partition_point(|middle| middle < at).min(from.len() - 1);
        let before = next.saturating_sub(1);
        let span = of_source[next] - of_source[before];
        let share = if span > 1e-6 { ((at - of_source[before]) / span).clamp(0.0, 1.0) } else { 0.0 };
        (from[before], from[next], share)
    };
    of_target.iter().enumerate().map(share).collect()
}
