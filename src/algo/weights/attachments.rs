//! Attachments: gear through which no bone runs. Packs, quivers and bows are stiff, and ponytails and wings hang from the
//! one place where they touch the body; neither goes with whatever bones its far end comes near to.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    hierarchy::Hierarchy,
    islands::{Islands, SAMPLES},
    sight,
};
use crate::mesh::{model::Weights, surface::Surface};

/// Places of a bone that are looked at.
const STATIONS: usize = 8;
/// A piece of which a bone runs at least this share within is flesh or clothing.
const AROUND: f32 = 0.7;
/// What is at most this share of a piece's size farther away than the nearest place touches the body.
const TOUCH: f32 = 0.1;
/// The places at which a hanging piece touches the body span at most this share of its size.
const ROOT: f32 = 0.33;
/// A rod is at most this share of its length thick.
const THIN: f32 = 0.2;
/// Volume of a block as a share of that of a ball with the same surface, at least: a cube has 0.5, a folded cloth hardly any.
const STOUT: f32 = 0.3;
/// Share of a closed surface's edges that may be open.
const OPEN: f32 = 0.1;

/// The pieces of a mesh, with their triangles and boxes.
pub(super) struct Attachments<'a> {
    places: &'a [Vec3],
    islands: &'a Islands,
    weights: &'a Weights,
    joints: &'a [WeightJoint],
    bones: &'a [BoneSegment],
    hierarchy: Hierarchy,
    triangles: Vec<Vec<[u32; 3]>>,
    boxes: Vec<(Vec3, Vec3)>,
}

impl<'a> Attachments<'a> {
    pub fn new(
        (places, triangles): (&'a [Vec3], &[[u32; 3]]),
        islands: &'a Islands,
        weights: &'a Weights,
        (joints, bones): (&'a [WeightJoint], &'a [BoneSegment]),
    ) -> Self {
        let mut parts = vec![Vec::new(); islands.extents.len()];
        for triangle in triangles {
            parts[islands.of[triangle[0] as usize] as usize].push(*triangle);
        }
        let mut boxes = vec![(Vec3::INFINITY, Vec3::NEG_INFINITY); parts.len()];
        for (&island, &place) in islands.of.iter().zip(places) {
            let (low, high) = &mut boxes[island as usize];
            (*low, *high) = (low.min(place), high.max(place));
        }
        let hierarchy = Hierarchy::new(joints);
        Self { places, islands, weights, joints, bones, hierarchy, triangles: parts, boxes }
    }

    /// Joint that an island of the mesh goes with as one, if it is an attachment: the one that holds most of what the island
    /// touches. `members` are the island's places, and `sums` the weights of joints over it.
    pub fn holder(&self, island: usize, members: &[Vec3], sums: &BTreeMap<u32, f32>) -> Option<u32> {
        let triangles = &self.triangles[island];
        if triangles.is_empty() || self.is_around_bones(island) {
            return None;
        }
        let t = |k: usize| crate::tune(k, 0.0) > 0.0;
        if self.islands.are_small(island) { return None; }
        let is_stiff = || t(8) && is_rod(members) || t(7) && self.is_block(triangles);
        match self.touched(island, members) {
            Some((touched, true)) if t(6) => self.bearer(&touched),
            Some((touched, _)) if is_stiff() => self.bearer(&touched),
            None if is_stiff() => self.bearer(sums),
            _ => None,
        }
    }

    /// The joint with most of some weights, or the one above it at which more than half come together: what hangs between two
    /// thighs goes with the hips.
    fn bearer(&self, sums: &BTreeMap<u32, f32>) -> Option<u32> {
        let whole: f32 = sums.values().sum();
        let mut top = sums.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0))).map(|(joint, _)| *joint)?;
        let held = |top: u32| {
            let below = sums.iter().filter(|(joint, _)| self.hierarchy.has(top as usize, **joint as usize));
            below.map(|(_, sum)| sum).sum::<f32>()
        };
        // Joints in a ring of parents have no ranges; the walk up ends with all joints in any case.
        for _ in 0..self.joints.len() {
            match self.joints[top as usize].parent {
                Some(parent) if 2.0 * held(top) <= whole => top = parent as u32,
                _ => break,
            }
        }
        Some(top)
    }

    /// True if a bone runs within an island of the mesh.
    fn is_around_bones(&self, island: usize) -> bool {
        let (low, high) = self.boxes[island];
        let is_in_box = |place: Vec3| place.cmpge(low).all() && place.cmple(high).all();
        let station = |bone: &BoneSegment, at: usize| bone.head.lerp(bone.tail, (at as f32 + 0.5) / STATIONS as f32);
        let least = (AROUND * STATIONS as f32).ceil() as usize;
        let within = |bone: &BoneSegment, holds: &dyn Fn(Vec3) -> bool| {
            (0..STATIONS).filter(|at| holds(station(bone, *at))).count() >= least
        };
        let near: Vec<&BoneSegment> = self.bones.iter().filter(|bone| within(bone, &is_in_box)).collect();
        if near.is_empty() {
            return false;
        }
        let surface = Surface::build(self.places, &self.triangles[island]);
        near.into_iter().any(|bone| within(bone, &|place| sight::encloses(&surface, place)))
    }

    /// Weights of what an island touches, and whether it hangs from there: if it touches other islands at one end alone. `None` if
    /// nothing is near.
    fn touched(&self, island: usize, members: &[Vec3]) -> Option<(BTreeMap<u32, f32>, bool)> {
        let size = self.islands.extents[island];
        let (low, high) = self.boxes[island];
        let (low, high) = (low - size * TOUCH, high + size * TOUCH);
        let meets = |from: Vec3, to: Vec3| from.cmple(high).all() && to.cmpge(low).all();
        let others = (0..self.boxes.len()).filter(|other| *other != island);
        let others = others.filter(|other| crate::tune(14, 0.0) <= 0.0 || !self.islands.are_small(*other) && self.is_around_bones(*other));
        let near = others.filter(|other| meets(self.boxes[*other].0, self.boxes[*other].1));
        let is_near = |triangle: &&[u32; 3]| {
            let [a, b, c] = triangle.map(|place| self.places[place as usize]);
            meets(a.min(b).min(c), a.max(b).max(c))
        };
        let triangles: Vec<[u32; 3]> =
            near.flat_map(|other| self.triangles[other].iter().filter(is_near)).copied().collect();
        if triangles.is_empty() {
            return None;
        }
        let surface = Surface::build(self.places, &triangles);
        let stride = members.len().div_ceil(4 * SAMPLES).max(1);
        let samples = members.iter().step_by(stride).copied();
        let found: Vec<_> = samples.filter_map(|place| Some((place, surface.closest_point(place)?))).collect();
        let nearest = found.iter().map(|(_, found)| found.distance).fold(f32::INFINITY, f32::min);
        if nearest > TOUCH * size {
            return None;
        }
        let mut sums = BTreeMap::<u32, f32>::new();
        let (mut low, mut high, mut count) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0);
        for (place, found) in found.iter().filter(|(_, found)| found.distance <= nearest + TOUCH * size) {
            (low, high, count) = (low.min(*place), high.max(*place), count + 1);
            let corners = triangles[found.triangle as usize];
            for (corner, share) in corners.into_iter().zip(found.barycentric.to_array()) {
                for (joint, weight) in self.weights.of(corner as usize) {
                    *sums.entry(joint).or_default() += share * weight;
                }
            }
        }
        let span = (high - low).max_element();
        let mut hangs = span <= ROOT * size && 2 * count <= found.len();
        if crate::tune(13, 0.0) > 0.0 && span <= 0.6 * size && 2 * count <= found.len() {
            let center = members.iter().sum::<Vec3>() / members.len() as f32;
            hangs |= low.midpoint(high).distance(center) <= 0.15 * size;
        }
        Some((sums, hangs))
    }

    /// True if some triangles are the closed surface of something stout: a pack, a barrel, a stone.
    fn is_block(&self, triangles: &[[u32; 3]]) -> bool {
        let mut edges: Vec<[u32; 2]> = triangles
            .iter()
            .flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        let sides: Vec<usize> = edges.chunk_by(|a, b| a == b).map(<[_]>::len).collect();
        let open = sides.iter().filter(|sides| **sides == 1).count();
        if open as f32 > OPEN * sides.len() as f32 {
            return false;
        }
        let origin = self.places[triangles[0][0] as usize];
        let (mut volume, mut area) = (0f32, 0f32);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|place| self.places[place as usize] - origin);
            volume += a.cross(b).dot(c) / 6.0;
            area += (b - a).cross(c - a).length() / 2.0;
        }
        36.0 * std::f32::consts::PI * volume * volume >= STOUT * area * area * area
    }
}

/// True if some places lie along a line: a bow, a staff, a quiver.
fn is_rod(places: &[Vec3]) -> bool {
    let middle = places.iter().sum::<Vec3>() / places.len() as f32;
    let farthest = |from: Vec3| {
        let far = places.iter().max_by(|a, b| a.distance_squared(from).total_cmp(&b.distance_squared(from)));
        far.copied().unwrap_or(from)
    };
    let first = farthest(middle);
    let way = farthest(first) - first;
    let (length, along) = (way.length(), way.normalize_or_zero());
    let across = places.iter().map(|place| (*place - middle).reject_from(along).length()).fold(0f32, f32::max);
    along != Vec3::ZERO && 2.0 * across <= THIN * length
}
