//! Front of a figure that does not stand upright: where its feet point, in which order its limbs end, and what it stands on.

use glam::Vec3;

use super::Search;
use crate::algo::fit_template::limbs::LimbKind;

/// Penalty of feet that point backwards, for a step of one, and the share of a leg's length that is its foot.
const TOES: f32 = 0.2;
const FOOT: f32 = 0.2;
/// Penalty of limbs that all end in another order along the front than the template's, and the distance, as a share of the
/// template's size, from which on two of them have an order.
const DISORDER: f32 = 0.6;
const BEFORE: f32 = 0.1;
/// Penalty of legs that end as high over the lowest end of all branches as the template is large.
const OFF_GROUND: f32 = 1.0;

impl Search<'_> {
    /// The penalty of legs that end above the lowest of all branches, in the mean: what stands has nothing under its feet, and
    /// ears are no legs.
    pub(super) fn off_ground(&self, leaves: &[Option<usize>], up: Vec3, scale: f32) -> f32 {
        let height = |leaf: usize| self.tree.lines[leaf].at(0.0).dot(up);
        let lowest = self.leaves.iter().map(|&leaf| height(leaf)).fold(f32::INFINITY, f32::min);
        let limbs = self.template.limbs.iter().zip(leaves);
        let legs = limbs.filter_map(|(limb, leaf)| leaf.filter(|_| limb.kind == LimbKind::Leg));
        let (sum, count) = legs.fold((0.0, 0.0), |(sum, count), leg| (sum + height(leg) - lowest, count + 1.0));
        OFF_GROUND * sum / (f32::max(count, 1.0) * self.template.size * scale).max(1e-6)
    }

    /// The penalty of a front that the order of limbs contradicts, and feet more than the opposite one: hooves point nowhere.
    pub(super) fn backwards(&self, leaves: &[Option<usize>], forward: Vec3, scale: f32) -> f32 {
        let feet = self.backward_feet(leaves, forward) - self.backward_feet(leaves, -forward);
        TOES * feet.max(0.0) + DISORDER * self.disorder(leaves, forward, scale)
    }

    /// Lack of the ends of legs in leading forward as the template's do, in the mean: toes and paws tell the front. A bird's toes
    /// are splayed, and the longest of them may lead out more than forward; what counts is along the plane of symmetry.
    fn backward_feet(&self, leaves: &[Option<usize>], forward: Vec3) -> f32 {
        let template = self.template;
        let (mut sum, mut count) = (0.0, 0.0);
        for (limb, leaf) in template.limbs.iter().zip(leaves) {
            let Some(line) = leaf.filter(|_| limb.kind == LimbKind::Leg).map(|leaf| &self.tree.lines[leaf]) else {
                continue;
            };
            let rest = FOOT * (template.length(limb.attach, limb.joints[limb.joints.len() - 1]) + limb.beyond);
            let wanted = (template.tip(limb) - template.place_on(limb, rest)).normalize_or_zero().z;
            let mut way = line.at(0.0) - line.at(FOOT * line.free);
            if let Some((_, normal)) = self.directions.mirror.filter(|_| template.has_hidden_knee(limb)) {
                way -= normal * way.dot(normal);
            }
            let found = way.normalize_or_zero().dot(forward);
            sum += (wanted - found).max(0.0);
            count += 1.0;
        }
        sum / f32::max(count, 1.0)
    }

    /// Share of the pairs of limbs of which the one that ends before the other in the template ends behind it: a head behind the
    /// hind legs, a tail before the forelegs.
    fn disorder(&self, leaves: &[Option<usize>], forward: Vec3, scale: f32) -> f32 {
        let template = self.template;
        let ends: Vec<(f32, f32)> =
            self.ends(leaves).iter().map(|(rest, end, _)| (rest.z * scale, end.dot(forward))).collect();
        let (mut sum, mut count) = (0.0, 0.0);
        for (at, a) in ends.iter().enumerate() {
            for b in ends.iter().skip(at + 1) {
                let (rest, found) = (a.0 - b.0, a.1 - b.1);
                if rest.abs() > BEFORE * template.size * scale {
                    sum += (-found / rest).clamp(0.0, 1.0);
                    count += 1.0;
                }
            }
        }
        sum / f32::max(count, 1.0)
    }
}
