//! Feet on the ground: when they stand, how far a figure travels, and where standing feet are held.

use bevy::math::Vec3;
use serde::Serialize;

use super::{
    body::Body,
    limbs::{Limb, LimbKind, STRETCHED, smooth},
    pose::Pose,
};
use crate::rig::animation::humanoid::{BodySide, LimbBone};

/// Speeds in lengths of a leg a second below which a low foot, and one at any height, stands.
const SLOW: f32 = 0.9;
const STILL: f32 = 0.15;
/// Speed in lengths of a leg a second below which a low ankle stands while its ball is still above the ground.
const HEEL: f32 = 0.6;
/// Heights above the ground, in lengths of a leg, below which an ankle and a ball are low.
const LOW: [f32; 2] = [0.06, 0.05];
/// Seconds over which the correction of a foot fades.
const FADE: f32 = 0.25;

/// Span of time in which a foot stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stance {
    /// True for the left foot.
    pub left: bool,
    /// First and last second.
    pub span: [f32; 2],
    /// True if the whole foot stands, false if its ball does while the heel is up.
    pub flat: bool,
}

/// Part of a foot that stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Contact {
    None,
    Ankle,
    Ball,
}

/// Contacts of both feet, frame by frame.
pub(super) struct Contacts([Vec<Contact>; 2]);

/// Lets a figure that walks on the spot travel, so that its standing feet stay; returns `false` for any other motion.
pub(super) fn travel(body: &mut Body, rate: f32) -> bool {
    let ankles = BodySide::BOTH.map(|side| body.source.limb(side, LimbBone::Foot));
    let hips = body.source.first(crate::rig::animation::humanoid::HumanBone::Hips);
    let (&[Some(left), Some(right)], Some(hips)) = (&ankles, hips) else { return false };
    let leg = body.target.leg;
    let start = body.frames[0].places[hips];
    let level = |v: Vec3| v - body.up * v.dot(body.up);
    if body.frames.iter().any(|frame| level(frame.places[hips] - start).length() > 0.35 * leg) {
        return false;
    }
    let steps_of = |mean: Option<Vec3>| -> Vec<Vec3> {
        let step = |pair: &[super::body::SourceFrame]| {
            let points = |frame: &super::body::SourceFrame| {
                [frame.places[left], frame.places[right], frame.balls[0], frame.balls[1]]
            };
            let grounds = [body.source_ankle, body.source_ankle, body.source_ball, body.source_ball];
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for ((was, is), ground) in points(&pair[0]).into_iter().zip(points(&pair[1])).zip(grounds) {
                let height = (0.5 * (was + is).dot(body.up) - ground).max(0.0);
                let step = level(was - is);
                // A foot that swings forward just above the ground does not stand on it.
                let share = mean.map_or(1.0, |mean| (step.dot(mean) / mean.length_squared() - 0.2) / 0.4);
                let weight = bevy::math::ops::exp(-height / (0.015 * leg)) * share.clamp(1e-3, 1.0);
                sum += step * weight;
                weights += weight;
            }
            sum / weights.max(1e-12)
        };
        body.frames.windows(2).map(step).collect()
    };
    let mut steps = steps_of(None);
    let net: Vec3 = steps.iter().sum();
    let way: f32 = steps.iter().map(|step| step.length()).sum();
    if net.length() < 0.5 * leg || net.length() < 0.5 * way {
        return false;
    }
    for _ in 0..2 {
        let mean = steps.iter().sum::<Vec3>() / steps.len() as f32;
        steps = steps_of(Some(mean).filter(|mean| mean.length_squared() > 0.0));
    }
    let steps = averaged(&steps, (0.04 * rate).round().max(1.0) as usize);
    let mut shift = Vec3::ZERO;
    for (at, frame) in body.frames.iter_mut().enumerate() {
        frame.shift(shift);
        shift += steps.get(at).copied().unwrap_or_default();
    }
    true
}

/// Averages over as many neighbours on both sides.
fn averaged<T: Copy + std::iter::Sum + std::ops::Div<f32, Output = T>>(list: &[T], by: usize) -> Vec<T> {
    let around = |at: usize| &list[at.saturating_sub(by)..(at + by + 1).min(list.len())];
    (0..list.len()).map(|at| around(at).iter().copied().sum::<T>() / around(at).len() as f32).collect()
}

impl Contacts {
    /// Contacts of a motion without any.
    pub fn none(body: &Body) -> Self {
        Self(std::array::from_fn(|_| vec![Contact::None; body.frames.len()]))
    }

    /// Contacts by the heights and speeds of the source's feet.
    pub fn find(body: &Body, rate: f32) -> Self {
        Self(BodySide::BOTH.map(|side| {
            let Some(ankle) = body.source.limb(side, LimbBone::Foot) else {
                return vec![Contact::None; body.frames.len()];
            };
            let ankle = |at: usize| body.frames[at].places[ankle];
            let ball = |at: usize| body.frames[at].balls[side as usize];
            let (count, by) = (body.frames.len(), (rate / 30.0).round().max(1.0) as usize);
            let leg = body.target.leg;
            let speed = |point: &dyn Fn(usize) -> Vec3, at: usize| {
                let (from, to) = (at.saturating_sub(by), (at + by).min(count - 1));
                if from == to { 0.0 } else { point(from).distance(point(to)) * rate / ((to - from) as f32 * leg) }
            };
            let contact = |at: usize| {
                let heights = [ankle(at).dot(body.up) - body.source_ankle, ball(at).dot(body.up) - body.source_ball];
                let [low_ankle, low_ball] = [0, 1].map(|part| heights[part] < LOW[part] * leg);
                let [of_ankle, of_ball] = [speed(&ankle, at), speed(&ball, at)];
                // A heel stands while the ball comes down.
                let is_heel = low_ankle && of_ankle < HEEL && heights[1] < 2.5 * LOW[1] * leg;
                if (low_ankle && low_ball && of_ankle < SLOW) || is_heel || of_ankle < STILL {
                    Contact::Ankle
                } else if low_ball && of_ball < SLOW {
                    Contact::Ball
                } else {
                    Contact::None
                }
            };
            let mut contacts: Vec<Contact> = (0..count).map(contact).collect();
            let short = (0.05 * rate).round().max(1.0) as usize;
            close(&mut contacts, short);
            contacts
        }))
    }

    /// Spans of time in which feet stand.
    pub fn stances(&self, body: &Body, times: &[f32]) -> Vec<Stance> {
        let mut stances = Vec::new();
        for side in BodySide::BOTH {
            if body.source.limb(side, LimbBone::Foot).is_none() {
                continue;
            }
            for (contact, from, to) in runs(&self.0[side as usize]) {
                if contact != Contact::None {
                    let span = [times[from], times[to]];
                    stances.push(Stance { left: side == BodySide::Left, span, flat: contact == Contact::Ankle });
                }
            }
        }
        stances
    }

    /// Places of the ankles, frame by frame; `raw` are poses without any.
    pub fn goals(&self, body: &Body, raw: &[Pose], rate: f32) -> Vec<[Option<Vec3>; 2]> {
        let mut goals = vec![[None; 2]; raw.len()];
        for limb in body.limbs.iter().filter(|limb| limb.kind == LimbKind::Leg) {
            let foot = Foot::of(body, limb, raw);
            let corrections = self.corrections(body, limb.side, &foot, rate);
            for (at, goal) in goals.iter_mut().enumerate() {
                goal[limb.side as usize] = Some(foot.ankles[at] + corrections[at]);
            }
        }
        goals
    }

    /// Movement of an ankle, frame by frame, with which the foot stands still where it stands.
    fn corrections(&self, body: &Body, side: BodySide, foot: &Foot, rate: f32) -> Vec<Vec3> {
        let mut contacts = self.0[side as usize].clone();
        if foot.balls.is_none() {
            contacts
                .iter_mut()
                .filter(|contact| **contact == Contact::Ball)
                .for_each(|contact| *contact = Contact::None);
        }
        let mut corrections = vec![Vec3::ZERO; contacts.len()];
        let mut stood: Vec<(usize, usize)> = Vec::new();
        let all = runs(&contacts);
        let mut next = 0;
        while next < all.len() {
            if all[next].0 == Contact::None {
                next += 1;
                continue;
            }
            let end = (next..all.len()).find(|run| all[*run].0 == Contact::None).unwrap_or(all.len());
            foot.hold(body, &all[next..end], &mut corrections);
            stood.push((all[next].1, all[end - 1].2));
            next = end;
        }
        fade(&mut corrections, &stood, rate);
        corrections
    }

    /// Distances by which the hips are lowered, frame by frame, so that standing feet reach the ground.
    pub fn drops(&self, body: &Body, raw: &[Pose], goals: &[[Option<Vec3>; 2]], rate: f32) -> Vec<f32> {
        let mut needed = vec![0.0_f32; raw.len()];
        for limb in body.limbs.iter().filter(|limb| limb.kind == LimbKind::Leg) {
            let reach = 0.998 * STRETCHED * (limb.lengths[0] + limb.lengths[1]);
            for (at, drop) in needed.iter_mut().enumerate() {
                let (Some(goal), true) =
                    (goals[at][limb.side as usize], self.0[limb.side as usize][at] != Contact::None)
                else {
                    continue;
                };
                let way = raw[at][limb.target[0]].translation - goal;
                let height = way.dot(body.up);
                let beside = (way - body.up * height).length();
                let most = (reach * reach - beside * beside).max(0.0).sqrt();
                *drop = drop.max((height - most).clamp(0.0, 0.15 * body.target.leg));
            }
        }
        let by = (0.1 * rate).round().max(1.0) as usize;
        let around = |at: usize| &needed[at.saturating_sub(by)..(at + by + 1).min(needed.len())];
        let highest: Vec<f32> = (0..needed.len()).map(|at| around(at).iter().copied().fold(0.0, f32::max)).collect();
        averaged(&highest, by)
    }
}

/// Lets corrections fade from each span of frames in which they are given to the next one.
pub(super) fn fade<T>(corrections: &mut [T], spans: &[(usize, usize)], rate: f32)
where
    T: Copy + std::iter::Sum + std::ops::Mul<f32, Output = T>,
{
    let fade = (FADE * rate).max(1.0);
    let count = corrections.len();
    let (first, last) = (spans.first().copied(), spans.last().copied());
    let gaps = spans.windows(2).map(|pair| (Some(pair[0].1), Some(pair[1].0)));
    let ends = [(None, first.map(|(from, _)| from)), (last.map(|(_, to)| to), None)];
    for (from, to) in gaps.chain(ends) {
        let (low, high) = (from.map_or(0, |from| from + 1), to.unwrap_or(count));
        let span = fade.min((high + 1 - low.min(high)) as f32);
        for at in low..high {
            let leaving = from.map(|from| (from, 1.0 - smooth((at - from) as f32 / span)));
            let coming = to.map(|to| (to, 1.0 - smooth((to - at) as f32 / span)));
            corrections[at] = leaving.into_iter().chain(coming).map(|(of, weight)| corrections[of] * weight).sum();
        }
    }
}

/// Foot of the target without corrections.
struct Foot {
    ankles: Vec<Vec3>,
    /// Ball relative to the ankle; `None` without toes.
    balls: Option<Vec<Vec3>>,
    /// Heights of ankle and ball at rest.
    grounds: [f32; 2],
}

impl Foot {
    fn of(body: &Body, limb: &Limb, raw: &[Pose]) -> Self {
        let [hip, _, ankle] = limb.source;
        let goal = |(at, pose): (usize, &Pose)| {
            let places = &body.frames[at].places;
            let goal = pose[limb.target[0]].translation + places[ankle] - places[hip];
            goal + body.up * (body.lifted(places[ankle].dot(body.up)) - goal.dot(body.up))
        };
        let toes = body.target.limb(limb.side, LimbBone::Toes);
        let ball = |pose: &Pose| toes.map(|toes| pose[toes].translation - pose[limb.target[2]].translation);
        let at_rest = |joint: usize| body.target.joints[joint].rest.translation.dot(body.up);
        Self {
            ankles: raw.iter().enumerate().map(goal).collect(),
            balls: raw.iter().map(ball).collect(),
            grounds: [at_rest(limb.target[2]), toes.map_or(0.0, at_rest)],
        }
    }

    /// Sets the corrections of one stance, whose parts follow one another.
    fn hold(&self, body: &Body, parts: &[(Contact, usize, usize)], corrections: &mut [Vec3]) {
        let first = parts.iter().position(|(contact, ..)| *contact == Contact::Ankle).unwrap_or(0);
        let (contact, from, to) = parts[first];
        let ball = |at: usize| self.balls.as_ref().map_or(Vec3::ZERO, |balls| balls[at]);
        let point = |contact: Contact, at: usize| match contact {
            Contact::Ball => self.ankles[at] + ball(at),
            Contact::Ankle | Contact::None => self.ankles[at],
        };
        let count = (to - from + 1) as f32;
        let mut place = (from..=to).map(|at| point(contact, at)).sum::<Vec3>() / count;
        // A foot near the ground stands on it.
        let ground = self.grounds[usize::from(contact == Contact::Ball)];
        let off = ground - place.dot(body.up);
        if off.abs() < 0.1 * body.target.leg {
            place += body.up * off;
        }
        let mut set = |contact: Contact, place: Vec3, from: usize, to: usize| {
            (from..=to).for_each(|at| corrections[at] = place - point(contact, at));
        };
        set(contact, place, from, to);
        // The place at which one part ends is that at which the next one begins.
        let moved = |place: Vec3, was: Contact, is: Contact, at: usize| match (was, is) {
            (Contact::Ankle, Contact::Ball) => place + ball(at),
            (Contact::Ball, Contact::Ankle) => place - ball(at),
            _ => place,
        };
        let (mut held, mut was) = (place, contact);
        for (contact, from, to) in &parts[first + 1..] {
            held = moved(held, was, *contact, from - 1);
            set(*contact, held, *from, *to);
            was = *contact;
        }
        let (mut held, mut was) = (place, contact);
        for (contact, from, to) in parts[..first].iter().rev() {
            held = moved(held, was, *contact, to + 1);
            set(*contact, held, *from, *to);
            was = *contact;
        }
    }
}

/// Runs of the same value: value, first and last frame.
pub(super) fn runs<T: Copy + PartialEq>(values: &[T]) -> Vec<(T, usize, usize)> {
    let mut runs: Vec<(T, usize, usize)> = Vec::new();
    for (at, value) in values.iter().enumerate() {
        match runs.last_mut() {
            Some((known, _, last)) if known == value => *last = at,
            _ => runs.push((*value, at, at)),
        }
    }
    runs
}

/// Fills short gaps, then drops short contacts.
fn close(contacts: &mut [Contact], short: usize) {
    for is_gap in [true, false] {
        let all = runs(contacts);
        for (place, (contact, from, to)) in all.iter().enumerate() {
            let is_short = to - from < short && (*contact == Contact::None) == is_gap;
            let is_inside = place > 0 && place + 1 < all.len();
            if is_short && is_inside {
                let before = all[place - 1].0;
                contacts[*from..=*to].fill(before);
            }
        }
    }
}
