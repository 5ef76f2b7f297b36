//! Hands that touch something: when a hand keeps its place in the world, at the other hand or at a part of the body while it
//! could move, and where it is held then.

use bevy::math::{Quat, Vec3};
use serde::Serialize;

use super::{
    body::Body,
    contacts::{fade, runs},
    limbs::{Limb, LimbKind, Reach},
    pose::Pose,
};
use crate::rig::animation::humanoid::{BodySide, HumanBone, LimbBone};

/// Speed in lengths of a leg a second below which a wrist keeps its place.
const STILL: f32 = 0.12;
/// Largest distance from the middle of its places, in lengths of a leg, of a wrist that keeps its place.
const SPREAD: f32 = 0.04;
/// Way, in lengths of a leg, that something has to move for a hand that keeps its place to tell of a touch.
const MOVED: f32 = 0.06;
/// Shortest touch, longest gap within a touch, and shortest time from one touch to the next, in seconds.
const SHORTEST: f32 = 0.3;
const GAP: f32 = 0.07;
const APART: f32 = 0.1;
/// Distance of wrists of hands that hold one another, in lengths of a leg.
const TOGETHER: f32 = 0.3;

/// Span of time in which a hand touches something.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Touch {
    /// True for the left hand.
    pub left: bool,
    /// First and last second.
    pub span: [f32; 2],
    /// Thing that is touched.
    pub thing: TouchTarget,
}

/// Thing that a hand touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TouchTarget {
    /// Thing that stands still in the world, such as a rail or the ground.
    World,
    /// The other hand, or something that both hands hold.
    OtherHand,
    /// Hips.
    Hips,
    /// Chest.
    Chest,
    /// Head or neck.
    Head,
    /// Left thigh.
    LeftThigh,
    /// Right thigh.
    RightThigh,
}

impl TouchTarget {
    /// Parts of the body, with the distance in lengths of a leg within which a wrist touches them.
    const PARTS: [(Self, f32); 5] =
        [(Self::Head, 0.35), (Self::Chest, 0.4), (Self::Hips, 0.35), (Self::LeftThigh, 0.16), (Self::RightThigh, 0.16)];

    /// Bone of a part of the body.
    fn bone(self) -> Option<HumanBone> {
        match self {
            Self::World | Self::OtherHand => None,
            Self::Hips => Some(HumanBone::Hips),
            Self::Chest => Some(HumanBone::Spine),
            Self::Head => Some(HumanBone::Head),
            Self::LeftThigh => Some(HumanBone::Limb(BodySide::Left, LimbBone::UpperLeg)),
            Self::RightThigh => Some(HumanBone::Limb(BodySide::Right, LimbBone::UpperLeg)),
        }
    }

    /// Joints of the source and of the target that carry a part of the body.
    fn joints(self, body: &Body) -> Option<[usize; 2]> {
        let bone = self.bone()?;
        let joint = |figure: &super::figure::Figure| figure.bones.get(&bone)?.last().copied();
        // Twist joints turn about the thigh, so its first joint counts.
        match bone {
            HumanBone::Limb(..) => Some([body.source.first(bone)?, body.target.first(bone)?]),
            _ => Some([joint(body.source)?, joint(body.target)?]),
        }
    }
}

/// Frames in which a hand is held.
#[derive(Debug, Clone, Copy)]
struct Hold {
    side: BodySide,
    from: usize,
    to: usize,
    thing: TouchTarget,
}

/// Touches of both hands.
#[derive(Debug, Clone, Default)]
pub(super) struct Touches(Vec<Hold>);

/// Wrists of the source, with what they are looked at by.
struct Wrists<'a> {
    body: &'a Body<'a>,
    rate: f32,
    /// Joint of the chest, else of the hips.
    trunk: usize,
}

impl Touches {
    /// Touches of a motion by the wrists of the source.
    pub fn find(body: &Body, rate: f32) -> Self {
        let spine = body.source.bones.get(&HumanBone::Spine).and_then(|spine| spine.last().copied());
        let Some(trunk) = spine.or_else(|| body.source.first(HumanBone::Hips)) else { return Self::default() };
        let wrists = Wrists { body, rate, trunk };
        let mut holds = Vec::new();
        let together = wrists.together();
        for arm in arms(body) {
            let wrist = wrists.of(arm);
            let mut own: Vec<Hold> = Vec::new();
            let mut add = |thing: TouchTarget, spans: Vec<(usize, usize)>| {
                own.extend(spans.into_iter().map(|(from, to)| Hold { side: arm.side, from, to, thing }));
            };
            add(TouchTarget::OtherHand, together.clone());
            for (part, near) in TouchTarget::PARTS {
                add(part, wrists.at_part(&wrist, part, near));
            }
            add(TouchTarget::World, wrists.in_world(&wrist));
            // Of touches at the same time the first kind counts; `own` is in the order of the kinds.
            let apart = (APART * rate).round() as usize;
            let mut kept: Vec<Hold> = Vec::new();
            for hold in own {
                if kept.iter().all(|other| hold.from > other.to + apart || hold.to + apart < other.from) {
                    kept.push(hold);
                }
            }
            kept.sort_by_key(|hold| hold.from);
            holds.extend(kept);
        }
        Self(holds)
    }

    /// True without any touch.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Tells for the left and the right hand whether it touches anything.
    pub fn hands(&self) -> [bool; 2] {
        BodySide::BOTH.map(|side| self.0.iter().any(|hold| hold.side == side))
    }

    /// Touches by their times.
    pub fn list(&self, times: &[f32]) -> Vec<Touch> {
        let touch = |hold: &Hold| Touch {
            left: hold.side == BodySide::Left,
            span: [times[hold.from], times[hold.to]],
            thing: hold.thing,
        };
        self.0.iter().map(touch).collect()
    }

    /// Places of the wrists, left and right, frame by frame; `poses` are those of free hands.
    pub fn goals(&self, body: &Body, poses: &[Pose], rate: f32) -> Vec<[Option<Reach>; 2]> {
        let mut goals = vec![[None; 2]; poses.len()];
        for arm in arms(body) {
            let own: Vec<&Hold> = self.0.iter().filter(|hold| hold.side == arm.side).collect();
            let mut corrections = vec![Vec3::ZERO; poses.len()];
            let mut shares = vec![0.0_f32; poses.len()];
            for hold in &own {
                hold.set(body, arm, poses, &mut corrections);
                shares[hold.from..=hold.to].fill(1.0);
            }
            let spans: Vec<(usize, usize)> = own.iter().map(|hold| (hold.from, hold.to)).collect();
            if spans.is_empty() {
                continue;
            }
            fade(&mut corrections, &spans, rate);
            fade(&mut shares, &spans, rate);
            for (at, goal) in goals.iter_mut().enumerate() {
                let place = poses[at][arm.target[2]].translation + corrections[at];
                goal[arm.side as usize] = (shares[at] > 0.0).then_some(Reach { place, share: shares[at].min(1.0) });
            }
        }
        goals
    }
}

/// Arms of both skeletons.
fn arms<'a>(body: &'a Body) -> impl Iterator<Item = &'a Limb> {
    body.limbs.iter().filter(|limb| limb.kind == LimbKind::Arm)
}

impl Wrists<'_> {
    /// Places of the wrist of an arm.
    fn of(&self, arm: &Limb) -> Vec<Vec3> {
        self.body.frames.iter().map(|frame| frame.places[arm.source[2]]).collect()
    }

    /// Places relative to a joint of the source.
    fn relative(&self, places: &[Vec3], joint: usize) -> Vec<Vec3> {
        let frames = self.body.frames.iter().zip(places);
        frames.map(|(frame, place)| frame.turns[joint].inverse() * (*place - frame.places[joint])).collect()
    }

    /// Spans in which both hands hold one another, or the same thing.
    fn together(&self) -> Vec<(usize, usize)> {
        let arms: Vec<&Limb> = arms(self.body).collect();
        let [left, right] = arms[..] else { return Vec::new() };
        let between: Vec<Vec3> = self.of(left).into_iter().zip(self.of(right)).map(|(a, b)| b - a).collect();
        let turned = |(frame, way): (&super::body::SourceFrame, &Vec3)| frame.turns[self.trunk].inverse() * *way;
        let own: Vec<Vec3> = self.body.frames.iter().zip(&between).map(turned).collect();
        self.spans(&own, |at| own[at].length() < TOGETHER * self.leg())
    }

    /// Spans in which a wrist keeps its place at a part of the body and moves with it.
    fn at_part(&self, wrist: &[Vec3], part: TouchTarget, near: f32) -> Vec<(usize, usize)> {
        let Some([joint, _]) = part.joints(self.body) else { return Vec::new() };
        let relative = self.relative(wrist, joint);
        let knee = match part {
            TouchTarget::LeftThigh => self.body.source.limb(BodySide::Left, LimbBone::LowerLeg),
            TouchTarget::RightThigh => self.body.source.limb(BodySide::Right, LimbBone::LowerLeg),
            _ => None,
        };
        let distance = |at: usize| {
            let places = &self.body.frames[at].places;
            let way = wrist[at] - places[joint];
            let Some(bone) = knee.map(|knee| places[knee] - places[joint]) else { return way.length() };
            let share = (way.dot(bone) / bone.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            (way - bone * share).length()
        };
        let mut spans = self.spans(&relative, |at| distance(at) < near * self.leg());
        spans.retain(|span| self.has_moved(wrist, *span));
        spans
    }

    /// Spans in which a wrist stands still while the body moves.
    fn in_world(&self, wrist: &[Vec3]) -> Vec<(usize, usize)> {
        let trunk: Vec<Vec3> = self.body.frames.iter().map(|frame| frame.places[self.trunk]).collect();
        let mut spans = self.spans(wrist, |_| true);
        spans.retain(|span| self.has_moved(&trunk, *span));
        spans
    }

    fn leg(&self) -> f32 {
        self.body.target.leg
    }

    fn has_moved(&self, places: &[Vec3], (from, to): (usize, usize)) -> bool {
        places[from..=to].iter().any(|place| place.distance(places[from]) > MOVED * self.leg())
    }

    /// Spans of frames in which places hardly change.
    fn spans(&self, places: &[Vec3], is_there: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
        let (count, by) = (places.len(), (self.rate / 30.0).round().max(1.0) as usize);
        let is_still = |at: usize| {
            let (from, to) = (at.saturating_sub(by), (at + by).min(count - 1));
            let way = places[from].distance(places[to]);
            way * self.rate < STILL * self.leg() * (to - from).max(1) as f32
        };
        let mut still: Vec<bool> = (0..count).map(|at| is_there(at) && is_still(at)).collect();
        let gap = (GAP * self.rate).round() as usize;
        for (_, from, to) in runs(&still).into_iter().filter(|(is, from, to)| !is && to - from < gap) {
            if from > 0 && to + 1 < count {
                still[from..=to].fill(true);
            }
        }
        let is_long = |from: usize, to: usize| (to - from) as f32 >= SHORTEST * self.rate;
        let is_narrow = |from: usize, to: usize| {
            let middle = mean(&places[from..=to]);
            places[from..=to].iter().all(|place| place.distance(middle) <= SPREAD * self.leg())
        };
        let runs =
            runs(&still).into_iter().filter(|(is, from, to)| *is && is_long(*from, *to) && is_narrow(*from, *to));
        runs.map(|(_, from, to)| (from, to)).collect()
    }
}

impl Hold {
    /// Sets the movement of the wrist, frame by frame, with which it keeps its place.
    fn set(&self, body: &Body, arm: &Limb, poses: &[Pose], corrections: &mut [Vec3]) {
        let wrist = |at: usize| poses[at][arm.target[2]].translation;
        let frames = self.from..=self.to;
        match self.thing {
            TouchTarget::World => {
                let places: Vec<Vec3> = frames.clone().map(wrist).collect();
                let place = mean(&places);
                frames.for_each(|at| corrections[at] = place - wrist(at));
            }
            TouchTarget::OtherHand => {
                let Some(other) = arms(body).find(|other| other.side != arm.side) else { return };
                for at in frames {
                    // Each hand makes half of the way.
                    let places = &body.frames[at].places;
                    let wanted = places[arm.source[2]] - places[other.source[2]];
                    let found = wrist(at) - poses[at][other.target[2]].translation;
                    corrections[at] = 0.5 * (wanted - found);
                }
            }
            part => {
                let Some([_, joint]) = part.joints(body) else { return };
                let back = |at: usize| -> (Quat, Vec3) { (poses[at][joint].rotation, poses[at][joint].translation) };
                let relative = |at: usize| {
                    let (turn, place) = back(at);
                    turn.inverse() * (wrist(at) - place)
                };
                let places: Vec<Vec3> = frames.clone().map(relative).collect();
                let held = mean(&places);
                for at in frames {
                    let (turn, place) = back(at);
                    corrections[at] = place + turn * held - wrist(at);
                }
            }
        }
    }
}

fn mean(places: &[Vec3]) -> Vec3 {
    places.iter().sum::<Vec3>() / places.len().max(1) as f32
}
