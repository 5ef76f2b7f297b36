//! Birds: the spine in a trunk that hides thighs, and heads with a beak and a skull before a neck that is drawn in or stretched.

use glam::Vec3;

use super::{SECTION, Work};
use crate::algo::fit_template::{
    limbs::{Limb, LimbKind},
    line::CentreLine,
};

/// Most of a head's free length that is beak and skull.
const SKULL: f32 = 0.85;
/// Height of the spine of a bird in its trunk, from the belly to the back.
const SPINE: f32 = 0.5;
/// Half of the thickness of the part of a section next to the plane of symmetry, and the widest gap in it, in cells.
const MIDDLE: f32 = 1.5;
const GAP: f32 = 2.0;
/// Share of the way from where the legs leave the trunk to over the feet by which the hips lie before there, and the most of it,
/// as a share of the trunk's length.
const OVER_FEET: f32 = 0.5;
const BEFORE_LEGS: f32 = 0.25;

impl Work<'_> {
    /// Directions of a bird's trunk: along it to the chest, left, and across it to the back; `None` for other templates.
    fn axes_of_bird(&self) -> Option<[Vec3; 3]> {
        let (first, last) = (self.template.trunk.first()?, self.template.trunk.last()?);
        let way = self.template.positions[*last] - self.template.positions[*first];
        let along = self.stretch.turn(way).try_normalize().filter(|_| self.template.has_hidden_knees())?;
        let left = self.hypothesis.alignment.rotation * Vec3::X;
        Some([along, left, along.cross(left)])
    }

    /// Moves a place of a bird's trunk across it to the middle between belly and back. Branches of wings and legs take much of the
    /// trunk's sides, and a section without them is lopsided: what lies on the plane of symmetry belongs to the trunk alone.
    pub(super) fn in_trunk(&self, place: Vec3) -> Vec3 {
        let Some([along, left, across]) = self.axes_of_bird() else { return place };
        let cell = self.graph.cell;
        let place = match self.hypothesis.middle {
            Some((point, normal)) => place - normal * (place - point).dot(normal),
            None => place,
        };
        let is_near = |away: &Vec3| away.dot(along).abs() < SECTION * cell && away.dot(left).abs() < MIDDLE * cell;
        let nodes = self.graph.centres.iter().zip(&self.graph.body).filter(|(_, is_body)| **is_body);
        let mut heights: Vec<f32> =
            nodes.map(|(centre, _)| *centre - place).filter(is_near).map(|away| away.dot(across)).collect();
        heights.sort_by(f32::total_cmp);
        // What hangs below the trunk or is held over it lies apart.
        let runs = heights.chunk_by(|below, above| above - below < GAP * cell);
        let bounds = runs.filter_map(|run| Some((*run.first()?, *run.last()?)));
        let distance = |(low, high): &(f32, f32)| low.max(-high).max(0.0);
        let trunk = bounds.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        trunk.map_or(place, |(low, high)| place + across * (low + SPINE * (high - low)))
    }

    /// Place of a joint along a bird's trunk, as the template has it between where the tail and where the neck leave the trunk.
    /// Where a wing leaves it depends on its pose and on its feathers. `None` for other templates.
    pub(super) fn between_ends(&self, joint: usize) -> Option<Vec3> {
        self.axes_of_bird()?;
        let end = |kind: LimbKind| {
            let mut own = self.template.limbs.iter().zip(&self.lines).filter(|(limb, _)| limb.kind == kind);
            let (limb, line) = own.next()?;
            let line = line.as_ref()?;
            Some((self.template.positions[*limb.joints.first()?], line.at(line.free)))
        };
        let (tail, neck) = (end(LimbKind::Tail)?, end(LimbKind::Head)?);
        let rest = neck.0 - tail.0;
        let share = (self.template.positions[joint] - tail.0).dot(rest) / rest.length_squared().max(1e-12);
        Some(tail.1.lerp(neck.1, share))
    }

    /// The root of a bird's wing, as far along the trunk as the template has it and beside the joint that carries it: a bird's
    /// shoulders lie at the sides of its spine, not over it.
    pub(super) fn beside_spine(&self, limb: &Limb, root: Vec3, attach: Vec3) -> Vec3 {
        let Some([along, _, across]) = self.axes_of_bird() else { return root };
        let root = root - across * (root - attach).dot(across);
        self.between_ends(limb.joints[0]).map_or(root, |place| root + along * (place - root).dot(along))
    }

    /// Moves the first joint of a bird's tail to where the spine leaves the trunk.
    pub(super) fn hang_tail(&self, places: &mut [Option<Vec3>]) {
        for limb in self.template.limbs.iter().filter(|limb| limb.kind == LimbKind::Tail) {
            let first = limb.joints[0];
            places[first] = places[first].map(|place| self.in_trunk(place));
        }
    }

    /// Moves the hips of a bird forward from where its legs leave the trunk: thighs lead forward in it, and what they carry lies
    /// over the feet. Legs that are held out to the back carry nothing.
    pub(super) fn carry_by_legs(&self, places: &mut [Option<Vec3>]) {
        let Some([along, left, across]) = self.axes_of_bird() else { return };
        let trunk = &self.template.trunk;
        let [Some(first), Some(last)] = [trunk.first(), trunk.last()].map(|joint| places[*joint?]) else { return };
        let most = BEFORE_LEGS * first.distance(last);
        for &joint in trunk {
            let Some(place) = places[joint] else { continue };
            let legs = self.template.limbs.iter().zip(&self.lines);
            let legs = legs.filter(|(limb, _)| limb.attach == joint && self.template.has_hidden_knee(limb));
            let (mut sum, mut count) = (0.0, 0.0);
            for (limb, line) in legs {
                let (Some(line), Some(foot)) = (line, places[limb.joints[3]]) else { continue };
                if self.is_hanging(line, left, across) {
                    sum += (foot - place).dot(along).max(0.0);
                }
                count += 1.0;
            }
            if count > 0.0 {
                let forward = (OVER_FEET * sum / count).min(most);
                places[joint] = Some(self.in_trunk(place + along * forward));
            }
        }
    }

    /// Gives beak and skull of a bird the size that they have in the whole figure. Birds draw their necks in and stretch them, so
    /// the length from the end of the beak to the chest is shared out over the bones of the neck alone.
    pub(super) fn keep_skull(&self, limb: &Limb, line: &CentreLine, lengths: &mut [f32]) {
        if limb.kind != LimbKind::Head || self.template.is_upright() || self.template.is_on_fours() {
            return;
        }
        let (Some(&whole), Some(&head)) = (lengths.first(), lengths.last()) else { return };
        let skull = (limb.beyond * self.hypothesis.alignment.scale).min(SKULL * line.free);
        if whole - head > 1e-9 && skull < whole {
            let share = (whole - skull) / (whole - head);
            lengths.iter_mut().for_each(|length| *length = whole - (whole - *length) * share);
        }
    }
}
