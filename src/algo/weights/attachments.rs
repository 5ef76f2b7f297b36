//! Attachments: gear through which no bone runs. Packs, quivers and bows are stiff, and ponytails and wings hang from the one place
//! where they touch the body; neither goes with whatever bones its far end comes near to.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::BoneTree,
    hierarchy::Hierarchy,
    islands::{Islands, SAMPLES},
    roots::{AT_HOME, share},
    sight::encloses,
};
use crate::mesh::{adjacency, model::Weights, surface::Surface};

/// Pairs of bones and pieces whose boxes are compared, and that are looked at. In a crowd of shells around bones nothing is an
/// attachment.
const MOST_BOXES: usize = 1 << 18;
const MOST: usize = 1 << 12;
/// Places of a piece touch the body if they are at most this share of the piece's size farther away from it than the nearest one.
const TOUCH: f32 = 0.1;
/// The places at which a hanging piece touches the body span at most this share of its size.
const ROOT: f32 = 0.33;
/// A rod is at most this share of its length thick.
const THIN: f32 = 0.2;
/// Square of the volume of a block beside that of a ball with the same surface, at least: a cube has 0.52, a box of three, three
/// and one 0.34, a tight scarf 0.2, and folded cloth hardly any.
const STOUT: f32 = 0.3;
/// Length of the open edges of a closed surface beside the root of its area, at most: a ball without its cap of a fifth of its radius
/// has 0.35, a tube six radii long 2.
const OPEN: f32 = 0.5;

/// The large pieces of a mesh, and the surface of those around bones.
pub(super) struct Attachments<'a> {
    places: &'a [Vec3],
    islands: &'a Islands,
    weights: &'a Weights,
    joints: &'a [WeightJoint],
    hierarchy: Hierarchy,
    /// Triangles of each large piece.
    pieces: Vec<Vec<[u32; 3]>>,
    /// Flag of each piece: whether no bone runs through it.
    is_boneless: Vec<bool>,
    /// Triangles of the pieces around bones, and their surface.
    flesh: Vec<[u32; 3]>,
    surface: Surface,
}

impl<'a> Attachments<'a> {
    pub fn new(
        (places, triangles): (&'a [Vec3], &[[u32; 3]]),
        islands: &'a Islands,
        weights: &'a Weights,
        (joints, bones): (&'a [WeightJoint], &[BoneSegment]),
    ) -> Self {
        let mut pieces = vec![Vec::new(); islands.extents.len()];
        for triangle in triangles {
            let island = islands.of[triangle[0] as usize] as usize;
            if !islands.are_small(island) {
                pieces[island].push(*triangle);
            }
        }
        let is_boneless = are_boneless(&pieces, places, bones);
        let fleshy = pieces.iter().zip(&is_boneless).filter(|(_, is_boneless)| !**is_boneless);
        let has_attachments = is_boneless.contains(&true);
        let flesh: Vec<[u32; 3]> = match has_attachments {
            true => fleshy.flat_map(|(piece, _)| piece).copied().collect(),
            false => Vec::new(),
        };
        let surface = Surface::build(places, &flesh);
        let hierarchy = Hierarchy::new(joints);
        Self { places, islands, weights, joints, hierarchy, pieces, is_boneless, flesh, surface }
    }

    /// Joint that a piece of the mesh goes with as one, if it is an attachment: the one that holds most of what the piece touches.
    /// `members` are its places, and `sums` the weights of joints over it.
    pub fn holder(&self, island: usize, members: &[Vec3], sums: &BTreeMap<u32, f32>) -> Option<u32> {
        if !self.is_boneless[island] {
            return None;
        }
        let is_stiff = || is_rod(members) || self.is_block(&self.pieces[island]);
        match self.touched(island, members) {
            Some((touched, hangs)) => (hangs || is_stiff()).then(|| self.bearer(&touched))?,
            None => is_stiff().then(|| self.bearer(sums))?,
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
        while let Some(parent) = self.joints[top as usize].parent
            && 2.0 * held(top) <= whole
        {
            top = parent as u32;
        }
        Some(top)
    }

    /// Weights of the flesh that a piece touches, and whether it hangs from there: if it touches flesh at one end alone. `None` if
    /// none is near.
    fn touched(&self, island: usize, members: &[Vec3]) -> Option<(BTreeMap<u32, f32>, bool)> {
        let near = TOUCH * self.islands.extents[island];
        let samples = members.iter().step_by(members.len().div_ceil(4 * SAMPLES).max(1)).copied();
        let found: Vec<_> = samples.filter_map(|place| Some((place, self.surface.closest_point(place)?))).collect();
        let nearest = found.iter().map(|(_, found)| found.distance).fold(f32::INFINITY, f32::min);
        if nearest > near {
            return None;
        }
        let mut sums = BTreeMap::<u32, f32>::new();
        let (mut low, mut high, mut count) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0);
        for (place, found) in found.iter().filter(|(_, found)| found.distance <= nearest + near) {
            (low, high, count) = (low.min(*place), high.max(*place), count + 1);
            let corners = self.flesh[found.triangle as usize];
            for (corner, share) in corners.into_iter().zip(found.barycentric.to_array()) {
                for (joint, weight) in self.weights.of(corner as usize) {
                    *sums.entry(joint).or_default() += share * weight;
                }
            }
        }
        let hangs = (high - low).max_element() <= ROOT * self.islands.extents[island] && 2 * count <= found.len();
        Some((sums, hangs))
    }

    /// True if some triangles are the closed surface of something stout: a pack, a barrel, a stone.
    fn is_block(&self, triangles: &[[u32; 3]]) -> bool {
        let edges = adjacency::edges(triangles);
        let length = |[from, to]: [u32; 2]| self.places[from as usize].distance(self.places[to as usize]);
        let open: f32 = edges.iter().filter(|edge| edge.triangles == 1).map(|edge| length(edge.points)).sum();
        let origin = self.places[triangles[0][0] as usize];
        let (mut volume, mut area) = (0f32, 0f32);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|place| self.places[place as usize] - origin);
            volume += a.cross(b).dot(c) / 6.0;
            area += (b - a).cross(c - a).length() / 2.0;
        }
        open <= OPEN * area.sqrt() && 36.0 * std::f32::consts::PI * volume * volume >= STOUT * area * area * area
    }
}

/// Flag of each piece: whether it is there, and most of no bone runs through it.
fn are_boneless(pieces: &[Vec<[u32; 3]>], places: &[Vec3], bones: &[BoneSegment]) -> Vec<bool> {
    let there: Vec<usize> = (0..pieces.len()).filter(|piece| !pieces[*piece].is_empty()).collect();
    let diagonal = |piece: &usize| {
        let corners = || pieces[*piece].iter().flatten().map(|place| places[*place as usize]);
        let (head, tail) = (corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(Vec3::NEG_INFINITY, Vec3::max));
        BoneSegment { joint: 0, head, tail }
    };
    let boxes: Vec<BoneSegment> = there.iter().map(diagonal).collect();
    let tree = BoneTree::of_boxes(&boxes);
    let mut near: Vec<Vec<&BoneSegment>> = vec![Vec::new(); there.len()];
    let (mut looks, mut pairs) = (0, 0);
    for bone in bones {
        // What is around most of a bone is around the middle of it.
        let middle = bone.head.midpoint(bone.tail);
        let is_crowd = tree.any_within(middle, 0.0, |index| {
            let BoneSegment { head: low, tail: high, .. } = boxes[index as usize];
            if middle.cmpge(low).all() && middle.cmple(high).all() {
                near[index as usize].push(bone);
                pairs += 1;
            }
            looks += 1;
            looks > MOST_BOXES || pairs > MOST
        });
        if is_crowd {
            return vec![false; pieces.len()];
        }
    }
    let mut flags = vec![false; pieces.len()];
    for (&piece, near) in there.iter().zip(&near) {
        let surface = if near.is_empty() { Surface::default() } else { Surface::build(places, &pieces[piece]) };
        let is_around = |bone: &&BoneSegment| share(bone.head, bone.tail, |at| encloses(&surface, at)) >= AT_HOME;
        flags[piece] = !near.iter().any(is_around);
    }
    flags
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
