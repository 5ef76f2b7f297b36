//! Legs where the trunk hides them: by the template's shape, and over the part that hangs free.

use glam::Vec3;

use super::Work;
use crate::algo::fit_template::{
    limbs::{Limb, LimbKind},
    line::CentreLine,
};

/// Share of a leg's free length above which the trunk's flesh hides how it bends, and the share of the template's bend that
/// a joint takes there.
const HIDDEN: f32 = 0.5;
const SHAPED: f32 = 0.75;
/// Place of a knee that the trunk hides, as a share of the way from where its leg leaves the trunk to the hip, and the distances of
/// that hip and that knee from the plane of symmetry, as shares of the leg's: thighs of birds lie nearly level, and lead outwards
/// around the belly; the shank leads back in.
const HIDDEN_KNEE: f32 = 0.75;
const NARROW_HIP: f32 = 0.4;
const WIDE_KNEE: f32 = 1.2;
/// Share of a leg's free length at which its distance from the plane of symmetry is taken, the share by which its root
/// follows it, and the cosine of its angle to up from which on it hangs straight down; an animal's leg that steps forward or
/// back has that cosine to the plane of symmetry.
const LEG: f32 = 0.7;
const LEG_WIDTH: f32 = 0.8;
const HANGS: f32 = 0.85;
const STEPS: f32 = 0.42;

impl Work<'_> {
    /// Moves the knee of an animal on two legs into the trunk: the thighs of birds lie along the body, and what bends where it
    /// can be seen is the hock. The joints below it lie closer together or further apart.
    pub(super) fn hide_knee(&self, limb: &Limb, line: &CentreLine, lengths: &mut [f32]) {
        if !self.template.has_hidden_knee(limb) {
            return;
        }
        let [hip, knee, hock, foot, ..] = lengths else { return };
        let hidden = line.free + HIDDEN_KNEE * (*hip - line.free);
        if hidden > *knee && *knee > *foot && hidden < *hip {
            *hock = *foot + (*hock - *foot) * (hidden - *foot) / (*knee - *foot);
            *knee = hidden;
        }
    }

    /// Draws the joints of an animal's leg that lie where the leg runs into the trunk to the shape that the template has
    /// between their neighbours: the flesh about a knee hides its bend.
    pub(super) fn hold_bends(&self, limb: &Limb, line: &CentreLine, lengths: &[f32], places: &mut [Option<Vec3>]) {
        if limb.kind != LimbKind::Leg || self.template.is_upright() {
            return;
        }
        let has_hidden_knee = self.template.has_hidden_knee(limb);
        for (joints, length) in limb.joints.windows(3).zip(lengths.iter().skip(1)) {
            let near = length / line.free.max(1e-9);
            let [before, here, after] = [joints[0], joints[1], joints[2]];
            if near < HIDDEN {
                continue;
            }
            let (Some(a), Some(c), Some(b)) = (places[before], places[here], places[after]) else { continue };
            let [from, at, to] = [before, here, after].map(|joint| self.template.positions[joint]);
            let chord = to - from;
            let share = (at - from).dot(chord) / chord.length_squared().max(1e-12);
            let out = at - from - chord * share;
            let way = b - a;
            // What the trunk hides of a leg is no part of the template's proportions.
            let share = if has_hidden_knee { (c - a).dot(way) / way.length_squared().max(1e-12) } else { share };
            let side = self.stretch.turn(out);
            let side = (side - way * side.dot(way) / way.length_squared().max(1e-12)).normalize_or_zero();
            let shaped = a + way * share + side * (out.length() / chord.length().max(1e-9) * way.length());
            places[here] = Some(c.lerp(shaped, ((near - HIDDEN) / (1.0 - HIDDEN)).min(1.0).sqrt() * SHAPED));
        }
    }

    /// Moves the joints of an animal's leg that the trunk hides over the part of the leg that hangs free: as far from the plane
    /// of symmetry as that tells, and as the template has them.
    pub(super) fn keep_over_foot(&self, limb: &Limb, line: &CentreLine, lengths: &[f32], places: &mut [Option<Vec3>]) {
        let Some(attach) = places[limb.attach].filter(|_| limb.kind == LimbKind::Leg && !self.template.is_upright())
        else {
            return;
        };
        let turn = self.hypothesis.alignment.rotation;
        let (left, up) = (turn * Vec3::X, turn * Vec3::Y);
        let of = |joint: usize| self.template.positions[joint].x - self.template.positions[limb.attach].x;
        let below = of(limb.joints[limb.joints.len() / 2]);
        if below.abs() < 1e-6 || !self.is_hanging(line, left, up) {
            return;
        }
        let has_hidden_knee = self.template.has_hidden_knee(limb);
        let wide = (line.at(line.free * LEG) - attach).dot(left) / below;
        for (&joint, length) in limb.joints.iter().zip(lengths).filter(|(_, length)| **length > LEG * line.free) {
            let hidden = ((length / line.free - LEG) / (1.0 - LEG)).min(1.0);
            if let Some(place) = &mut places[joint] {
                let share = match limb.joints.iter().position(|own| *own == joint) {
                    Some(0) if has_hidden_knee => NARROW_HIP,
                    Some(1) if has_hidden_knee => WIDE_KNEE,
                    _ => 1.0,
                };
                *place += left * (share * wide * of(joint) - (*place - attach).dot(left)) * hidden;
            }
        }
    }

    /// True for a leg that hangs straight down. An animal's may be on its way forward or back, but not out.
    pub(super) fn is_hanging(&self, line: &CentreLine, left: Vec3, up: Vec3) -> bool {
        let way = (line.at(line.free * LEG) - line.at(line.free * (1.0 - LEG))).normalize_or_zero();
        if self.template.is_upright() {
            return way.dot(up) > HANGS;
        }
        let aside = way.dot(left);
        // Toes of a bird are as long as its shank, and the line over both leads far forward.
        let steps = if self.template.is_on_fours() { STEPS } else { 0.0 };
        way.dot(up) > steps && aside * aside < 1.0 - HANGS * HANGS
    }

    /// The root of a leg that hangs straight down, as far from the plane of symmetry as the leg itself tells.
    pub(super) fn over_leg(&self, limb: &Limb, line: &CentreLine, attach: Vec3, root: Vec3) -> Vec3 {
        let turn = self.hypothesis.alignment.rotation;
        let (left, up) = (turn * Vec3::X, turn * Vec3::Y);
        // The template's leg at the same length from its end.
        let same = self.template.place_on(limb, line.free * LEG / self.hypothesis.alignment.scale);
        let of = |place: Vec3| place.x - self.template.positions[limb.attach].x;
        let below = of(same);
        let share = of(self.template.positions[limb.joints[0]]) / below;
        let is_hanging = self.is_hanging(line, left, up);
        if limb.kind != LimbKind::Leg || !is_hanging || below.abs() < 1e-6 || !(0.0..=1.5).contains(&share) {
            return root;
        }
        let wide = (line.at(line.free * LEG) - attach).dot(left) * share;
        root + left * (wide - (root - attach).dot(left)) * LEG_WIDTH
    }
}
