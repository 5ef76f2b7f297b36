//! Trunk of an animal on all fours: over its legs, with the spine under its back.

use glam::Vec3;

use super::{SPINE_HEIGHT, Work};
use crate::algo::fit_template::{
    limbs::{Limb, LimbKind},
    line::CentreLine,
};

/// Largest depth of the spine under the back, as a share of the mean of the trunk's length and the height of the back over the
/// feet: a belly that hangs low draws no spine down.
const UNDER_BACK: f32 = 0.3;
/// Sections between the ends of the trunk that tell where back and belly are, and how far its ends may rise over them, as a
/// share of the distance between the two.
const STATIONS: usize = 7;
const RISE: f32 = 0.15;
/// Parts of the free length of an animal's leg, between which its place under the trunk is taken.
const LEG_PLACES: usize = 10;

impl Work<'_> {
    /// Place of the joint of the trunk that carries an animal's leg, as the leg tells it. Where a leg leaves the trunk depends on
    /// its flesh, so all of what hangs free tells, in the mean.
    pub(super) fn over_legs(&self, limb: &Limb, line: &CentreLine, joint: usize, place: Vec3) -> Vec3 {
        let (template, turn) = (self.template, self.hypothesis.alignment.rotation);
        let carrier = template.positions[joint];
        let tall = (place - line.at(0.0)).dot(turn * Vec3::Y) / (carrier - template.tip(limb)).y.max(1e-9);
        let tall = tall.max(0.2 * self.hypothesis.alignment.scale);
        let shares = (1..LEG_PLACES).map(|i| i as f32 / LEG_PLACES as f32);
        let sum: Vec3 = shares
            .map(|share| {
                let length = share * line.free;
                line.at(length) + turn * (carrier - template.place_on(limb, length / tall)) * tall
            })
            .sum();
        sum / (LEG_PLACES - 1) as f32
    }

    /// Places of an animal's trunk at the height of its spine. Sections through the middle of the trunk tell where the back is:
    /// at its ends a neck or a tail rises from it.
    pub(super) fn under_back(&self, places: &[Vec3], along: Vec3, left: Vec3, across: Vec3) -> Vec<Vec3> {
        let (Some(&first), Some(&last)) = (places.first(), places.last()) else { return Vec::new() };
        let section = |place: Vec3| {
            let (low, high, centroid) = self.section(place, along, left, across)?;
            let height = place.dot(across);
            (high > low).then_some((low + height, high + height, centroid))
        };
        let stations = (0..STATIONS).map(|i| first.lerp(last, (i as f32 + 0.5) / STATIONS as f32));
        let found: Vec<(f32, f32, Vec3)> = stations.filter_map(section).collect();
        let median = |of: &dyn Fn(&(f32, f32, Vec3)) -> f32| {
            let mut values: Vec<f32> = found.iter().map(of).collect();
            values.sort_by(f32::total_cmp);
            values.get(values.len() / 2).copied()
        };
        let (Some(belly), Some(back)) = (median(&|found| found.0), median(&|found| found.1)) else {
            return places.to_vec();
        };
        let slack = RISE * (back - belly);
        let legs = self.template.limbs.iter().zip(&self.lines).filter(|(limb, _)| limb.kind == LimbKind::Leg);
        let feet: Vec<f32> = legs.filter_map(|(_, line)| Some(line.as_ref()?.at(0.0).dot(across))).collect();
        let ground = feet.iter().sum::<f32>() / feet.len().max(1) as f32;
        let deepest = UNDER_BACK * ((last - first).dot(along) * (back - ground)).max(0.0).sqrt();
        let at_spine = |&place: &Vec3| {
            let (low, high, centroid) = section(place).unwrap_or((belly, back, Vec3::ZERO));
            let (low, high) = (low.clamp(belly - slack, belly + slack), high.clamp(back - slack, back + slack));
            let depth = ((1.0 - SPINE_HEIGHT) * (high - low)).min(deepest);
            place + left * centroid.dot(left) + across * (high - depth - place.dot(across))
        };
        places.iter().map(at_spine).collect()
    }
}
