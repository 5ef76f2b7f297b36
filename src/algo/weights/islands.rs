//! The connected pieces of a surface: clothes, hair, gear and eyes beside a body.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    Method, WeightJoint, attachments::Attachments, bone::BoneSegment, claim::Claim, grips::Grips, laplacian::Graph,
    limb_parts::small_limbs, report::Stiffness, rings::RingBones, sight::is_surrounded,
};
use crate::mesh::{adjacency, model::Weights, surface::Surface};

/// Heat is trusted on an island if at least this share of its area sees the bone that claims it.
const SEEN: f32 = 0.15;
/// Islands up to this size beside a mesh of size 2 move with what is around them: specks, buttons, teeth. Hands of their own, through
/// which bones run, do not.
const SPECK: f32 = 0.2;

/// A part moves with one joint if that joint holds at least this share of it.
pub(super) const HELD: f32 = 0.8;
/// A part moves with a slot if the slot holds at least this share of it: slots hold no flesh, so it is a thing that they carry.
const CARRIED: f32 = 0.5;

/// Approximate number of places of a part that look for the part that it lies on, or for the limb that carries it.
pub(super) const SAMPLES: usize = 32;

/// The connected pieces of a surface.
pub(crate) struct Islands {
    /// The island of each place.
    pub of: Vec<u32>,
    /// The longest side of each island's box.
    pub extents: Vec<f32>,
    /// Flag of each island: whether it is small beside the whole mesh, and no limb.
    small: Vec<bool>,
}

impl Islands {
    /// Finds the pieces of a welded surface around joints.
    pub fn new(places: &[Vec3], triangles: &[[u32; 3]], joints: &[WeightJoint]) -> Self {
        let (of, count) = adjacency::islands(triangles, places.len());
        let mut boxes = vec![[Vec3::INFINITY, Vec3::NEG_INFINITY]; count];
        for (&island, &place) in of.iter().zip(places) {
            let [low, high] = &mut boxes[island as usize];
            (*low, *high) = (low.min(place), high.max(place));
        }
        let extents: Vec<f32> = boxes.iter().map(|[low, high]| (*high - *low).max_element()).collect();
        let mut small: Vec<bool> = extents.iter().map(|extent| *extent < SPECK).collect();
        if count > 1 {
            for island in small_limbs(&small, &boxes, &of, (places, triangles), joints) {
                small[island] = false;
            }
        }
        Self { of, extents, small }
    }

    /// True if the island of a place is small beside the whole mesh, and no limb.
    pub fn is_small(&self, place: usize) -> bool {
        self.are_small(self.of[place] as usize)
    }

    /// True if an island is small beside the whole mesh, and no limb.
    pub fn are_small(&self, island: usize) -> bool {
        self.small[island]
    }

    /// Flag of each place: whether its island can be bound by heat.
    pub fn trusted(&self, graph: &Graph, claims: &[Claim], method: Method) -> Vec<bool> {
        let mut area = vec![0f64; self.extents.len()];
        let mut seen = vec![0f64; self.extents.len()];
        for (v, claim) in claims.iter().enumerate().filter(|c| c.1.heat > 0.0) {
            area[self.of[v] as usize] += f64::from(graph.areas[v]);
            if claim.seen {
                seen[self.of[v] as usize] += f64::from(graph.areas[v]);
            }
        }
        let share = if method == Method::Heat { 0.0 } else { f64::from(SEEN) };
        self.of.iter().map(|&i| area[i as usize] > 0.0 && seen[i as usize] >= share * area[i as usize]).collect()
    }

    /// Weights with which parts stay as stiff as they are: a part that one joint holds in nearly its whole size (helmet,
    /// eye, sword) moves with that joint, and each small part moves as one. The holder of a small part is the joint with
    /// the largest share. A part of which a slot beside flesh, as `slots` flags joints, holds the most is what it carries. A
    /// ring moves with the one of `bones` that runs through it, what fingers hold with the hand, and an attachment with what it
    /// touches. A surface in one piece stays as it is, and so do the parts that have one of the `bending` places.
    pub fn stiffened(
        &self,
        (places, triangles): (&[Vec3], &[[u32; 3]]),
        weights: &Weights,
        slots: &[bool],
        bending: &[u32],
        (joints, bones): (&[WeightJoint], &[BoneSegment]),
    ) -> (Weights, Stiffness) {
        let mut sums: Vec<BTreeMap<u32, f32>> = vec![BTreeMap::new(); self.extents.len()];
        let mut members: Vec<Vec<Vec3>> = vec![Vec::new(); self.extents.len()];
        for (place, &island) in self.of.iter().enumerate() {
            members[island as usize].push(places[place]);
            for (joint, weight) in weights.of(place) {
                *sums[island as usize].entry(joint).or_default() += weight;
            }
        }
        let mut bends = vec![false; self.extents.len()];
        bending.iter().for_each(|place| bends[self.of[*place as usize] as usize] = true);
        // Where nothing else holds flesh slots do.
        let has_flesh = sums.iter().flat_map(BTreeMap::keys).any(|joint| !slots[*joint as usize]);
        let is_carrier = |joint: u32| has_flesh && slots[joint as usize];
        let is_part = members.iter().filter(|members| members.len() > 2).count() > 1;
        let grips = Grips::new(joints, bones);
        let ring_bones = RingBones::new(bones);
        let attachments = is_part.then(|| Attachments::new((places, triangles), self, weights, (joints, bones)));
        let mut rows: Vec<Option<Vec<(u32, f32)>>> = (sums.iter().zip(&members).enumerate())
            .map(|(island, (sums, members))| {
                if !is_part || members.len() < 3 || bends[island] {
                    return None;
                }
                let whole: f32 = sums.values().sum();
                let first = sums.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)))?;
                let is_carried = is_carrier(*first.0) && *first.1 >= CARRIED * whole;
                let alone = |joint: u32| Some(vec![(joint, 1.0)]);
                if is_carried {
                    return alone(*first.0);
                }
                let carrier = || (!self.are_small(island)).then(|| grips.carrier(sums, members)).flatten();
                if let Some(joint) = ring_bones.bearer(members).or_else(carrier) {
                    return alone(joint);
                }
                if *first.1 >= HELD * whole {
                    return alone(*first.0);
                }
                let holder = |attachments: &Attachments| attachments.holder(island, members, sums);
                if let Some(joint) = attachments.as_ref().and_then(holder) {
                    return alone(joint);
                }
                match self.are_small(island) {
                    true => Some(sums.iter().map(|(joint, sum)| (*joint, sum / whole)).collect()),
                    false => None,
                }
            })
            .collect();
        self.take_along(places, triangles, &mut rows);
        let mut stiff = Weights { starts: vec![0], ..Weights::default() };
        for (place, &island) in self.of.iter().enumerate() {
            match &rows[island as usize] {
                Some(row) => stiff.push(row.iter().copied()),
                None => stiff.push(weights.of(place)),
            }
        }
        let holders = rows.iter().map(|row| row.as_deref().and_then(strongest)).collect();
        (stiff, Stiffness { of: self.of.clone(), holders })
    }

    /// Gives small parts to what they lie on: a bolt on a helmet and an orb on a staff move with the joint that alone holds the
    /// helmet or the staff, whatever bones are near. A tooth that several joints share, which larger parts are all around, moves with
    /// the joint that holds the most of it. Rows shared by joints would shrink such a part as they turn apart.
    fn take_along(&self, places: &[Vec3], triangles: &[[u32; 3]], rows: &mut [Option<Vec<(u32, f32)>>]) {
        let joints = |island: usize| rows[island].as_ref().map_or(0, Vec::len);
        let is_bearer = |island: usize| joints(island) == 1 && !self.are_small(island);
        let is_taken = |island: usize| joints(island) > 1 || joints(island) == 1 && self.are_small(island);
        let mut small: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, &island) in self.of.iter().enumerate().filter(|(_, island)| is_taken(**island as usize)) {
            small.entry(island as usize).or_default().push(place);
        }
        if small.is_empty() {
            return;
        }
        let island_of = |triangle: &[u32; 3]| self.of[triangle[0] as usize] as usize;
        let large: Vec<[u32; 3]> = triangles.iter().copied().filter(|t| !self.are_small(island_of(t))).collect();
        let surface = Surface::build(places, &large);
        let row_of = |island: usize, members: &Vec<usize>| {
            let samples = members.iter().step_by(members.len().div_ceil(SAMPLES));
            let (count, mut votes) = (samples.len(), BTreeMap::<usize, usize>::new());
            let nearest = samples.filter_map(|place| surface.closest_point(places[*place]));
            for nearest in nearest.filter(|nearest| nearest.distance <= self.extents[island]) {
                *votes.entry(island_of(&large[nearest.triangle as usize])).or_default() += 1;
            }
            let most = votes.into_iter().find(|(_, votes)| 2 * votes > count);
            if let Some((bearer, _)) = most.filter(|(bearer, _)| is_bearer(*bearer)) {
                return rows[bearer].clone();
            }
            if joints(island) == 1 {
                return None;
            }
            let center = members.iter().map(|place| places[*place]).sum::<Vec3>() / members.len() as f32;
            let holder = rows[island].as_deref().and_then(strongest).filter(|_| is_surrounded(&surface, center));
            holder.map(|(joint, _)| vec![(joint, 1.0)])
        };
        let taken = small.iter().filter_map(|(island, members)| Some((*island, row_of(*island, members)?)));
        let taken: Vec<(usize, Vec<(u32, f32)>)> = taken.collect();
        for (island, row) in taken {
            rows[island] = Some(row);
        }
    }
}

/// The influence with the largest weight; the first joint of several.
fn strongest(row: &[(u32, f32)]) -> Option<(u32, f32)> {
    row.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
}
