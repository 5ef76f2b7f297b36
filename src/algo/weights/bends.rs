//! Bends tried on the mesh: weights that do not fold there, and how far half joints have to move outwards so that the mesh
//! keeps its volume.
//!
//! The flesh around a joint turns about the joint. Where the section of the limb has its centre beside the joint, a bend by
//! the angle `a` takes or adds the section's area times `a` times that distance, whatever the weights (Pappus). A half joint
//! that leaves the bend on the outside makes up for it, and the right length depends on the body: it is measured here.
//! Where that length would swell the mesh in another motion, the border between what moves and what stays is moved a little
//! (`blend`), so that it encloses as much on both sides of the joint.

mod blend;
mod part;
mod push;
mod triangle_tree;

use std::{cell::Cell, collections::BTreeMap};

use glam::Vec3;

use self::{
    blend::Blend,
    part::{Marks, Part, Pose},
    push::push,
    triangle_tree::TriangleTree,
};
use super::{WeightJoint, hierarchy::Hierarchy};
use crate::mesh::{adjacency, influences::keep_strongest, model::Weights};

/// Rounds in which lengths are fitted to the weights and weights to the lengths.
const ROUNDS: usize = 6;
/// Rounds of smoothing of the weights around sockets, where a half joint that moves out would show every step of them.
const SOFTEN: usize = 10;
/// Share of a half joint from which on a place belongs to the flesh around its socket.
const SOFT: f32 = 0.02;
/// Radius of the flesh that a bend concerns, in lengths of the longer of its two bones.
const REACH: f32 = 1.2;

/// Joints that move one place, with their weights.
type Row = Vec<(u32, f32)>;

/// Bend of a joint whose skin a half joint holds: by a right angle, or less where the limb is raised at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Index of the half joint.
    pub half: usize,
    /// Index of the joint that bends.
    pub joint: usize,
    /// Unit vector of the axis about which it bends, in the space of the points.
    pub axis: Vec3,
    /// Angle of the bend, in radians.
    pub angle: f32,
    /// Unit vector of an axis about which the joint turns aside, both ways, if it is no hinge: there the mesh must not swell.
    pub aside: Option<Vec3>,
    /// Unit vector along the bone above the joint, towards it.
    pub above: Vec3,
    /// Bone below the joint: direction and length.
    pub below: Vec3,
    /// Place of the section by which losses of volume are measured, as a share of the bone below: 0 for a limb that goes on
    /// on both sides of the joint, more where it begins at the joint.
    pub section: f32,
    /// Share of the bend that the half joint takes.
    pub share: f32,
    /// Length by which the half joint moves outwards, as a share of the length of the bone below: the least and the largest
    /// that is allowed.
    pub push: [f32; 2],
}

/// The flesh of a mesh around the joints that bend.
pub struct Flesh<'a> {
    points: Vec<Vec3>,
    /// Place of each point of the mesh: points at one position share one.
    place: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    joints: &'a [WeightJoint],
    /// Influences of each place.
    rows: Vec<Row>,
    /// True for places whose weights stay.
    fixed: Vec<bool>,
    neighbours: Vec<Vec<u32>>,
    hierarchy: Hierarchy,
    /// Number of triangles and places that were looked at.
    visits: Cell<u64>,
}

impl<'a> Flesh<'a> {
    /// Collects the flesh of a mesh with its weights over `joints`. Places with a point for which `fixed` is true keep their
    /// weights.
    pub fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        joints: &'a [WeightJoint],
        weights: &Weights,
        fixed: impl Fn(usize) -> bool,
    ) -> Self {
        let (place, count) = adjacency::weld(points);
        let mut flesh = Self {
            points: vec![Vec3::ZERO; count],
            triangles: Vec::with_capacity(triangles.len()),
            joints,
            rows: vec![Vec::new(); count],
            fixed: vec![false; count],
            neighbours: vec![Vec::new(); count],
            hierarchy: Hierarchy::new(joints),
            visits: Cell::new(0),
            place,
        };
        for (point, &place) in flesh.place.iter().enumerate() {
            let place = place as usize;
            flesh.points[place] = points[point];
            flesh.fixed[place] |= fixed(point);
            if flesh.rows[place].is_empty() {
                flesh.rows[place] = weights.of(point).collect();
            }
        }
        let welded = triangles.iter().map(|corners| corners.map(|corner| flesh.place[corner as usize]));
        flesh.triangles.extend(welded.filter(|[a, b, c]| a != b && b != c && c != a));
        for edge in adjacency::edges(&flesh.triangles) {
            let [a, b] = edge.points;
            flesh.neighbours[a as usize].push(b);
            flesh.neighbours[b as usize].push(a);
        }
        flesh
    }

    /// Changes weights until the mesh neither folds nor loses much volume when its joints bend, each by itself, and finds for
    /// each bend the least length, within its limits, by which its half joint has to move outwards; `None` where the mesh
    /// has no section around the joint. The order of the bends does not matter.
    pub fn settle(&mut self, bends: &[Bend]) -> Vec<Option<f32>> {
        let (tree, mut marks) = (TriangleTree::new(&self.points, &self.triangles), Marks::new(self.rows.len()));
        let mut parts: Vec<Part> = bends.iter().map(|bend| Part::new(self, &tree, &mut marks, bend)).collect();
        let sections: Vec<Option<f32>> = bends.iter().map(|bend| self.section(&tree, bend)).collect();
        let pushes = |parts: &[Part]| -> Vec<Option<f32>> {
            let all = bends.iter().zip(parts).zip(&sections);
            all.map(|((bend, part), section)| push(bend, part, (*section)?)).collect()
        };
        let region = self.socket_flesh(bends);
        (0..SOFTEN).for_each(|_| self.smooth(&region));
        parts.iter_mut().for_each(|part| part.read(self));
        for _ in 0..ROUNDS {
            let lengths = pushes(&parts);
            // Each bend changes the weights that it found; where two change one place, the place gets the mean of both.
            let mut changes: BTreeMap<u32, Vec<Row>> = BTreeMap::new();
            for (((bend, part), section), length) in bends.iter().zip(&parts).zip(&sections).zip(&lengths) {
                let pose = Pose::new(bend, bend.axis, bend.angle, length.unwrap_or(bend.push[0]));
                let mut blend = Blend::new(self, part);
                if let Some(section) = section {
                    blend.fill(&pose, *section);
                }
                blend.unfold(&pose);
                blend.rows().into_iter().for_each(|(place, row)| changes.entry(place).or_default().push(row));
            }
            if changes.is_empty() {
                break;
            }
            for (place, rows) in changes {
                let share = 1.0 / rows.len() as f32;
                self.rows[place as usize] = mixed(rows.iter().map(|row| (row, share)));
            }
            parts.iter_mut().for_each(|part| part.read(self));
        }
        pushes(&parts)
    }

    /// Number of triangles and places that were looked at to find what bends concern; for tests of growth.
    pub fn visits(&self) -> u64 {
        self.visits.get()
    }

    fn count(&self, looks: usize) {
        self.visits.set(self.visits.get() + looks as u64);
    }

    /// Shares of the joints below a bend, and of its half joint, at a place.
    fn shares(&self, bent: usize, half: u32, place: u32) -> [f32; 2] {
        let mut shares = [0.0; 2];
        for (joint, weight) in &self.rows[place as usize] {
            if *joint == half {
                shares[1] += weight;
            } else if self.hierarchy.has(bent, *joint as usize) {
                shares[0] += weight;
            }
        }
        shares
    }

    /// Places, rising, that half joints of sockets hold, without those whose weights stay.
    fn socket_flesh(&self, bends: &[Bend]) -> Vec<u32> {
        let mut is_socket = vec![false; self.joints.len()];
        bends.iter().filter(|bend| bend.section > 0.0).for_each(|bend| is_socket[bend.half] = true);
        let is_held = |row: &Row| {
            row.iter().any(|(half, _)| {
                let held = row.iter().filter(|(joint, _)| is_socket[*half as usize] && joint == half);
                held.map(|(_, weight)| *weight).sum::<f32>() > SOFT
            })
        };
        let held = self.rows.iter().zip(0..).filter(|(row, _)| is_held(row)).map(|(_, place)| place);
        held.filter(|place: &u32| !self.fixed[*place as usize]).collect()
    }

    /// The weights of all points of the mesh.
    pub fn weights(&self, most: usize, least: f32) -> Weights {
        let mut weights = Weights { starts: Vec::with_capacity(self.place.len() + 1), ..Weights::default() };
        weights.starts.push(0);
        let mut row = Vec::new();
        for &place in &self.place {
            row.clear();
            row.extend_from_slice(&self.rows[place as usize]);
            if !self.fixed[place as usize] {
                keep_strongest(&mut row, most, least);
            }
            weights.push(row.iter().copied());
        }
        weights
    }

    /// Moves the weights of some places half way to the mean of their neighbours.
    fn smooth(&mut self, region: &[u32]) {
        let smoothed = |place: &u32| {
            let around = &self.neighbours[*place as usize];
            let share = 0.5 / around.len().max(1) as f32;
            let others = around.iter().map(|other| (&self.rows[*other as usize], share));
            mixed(std::iter::once((&self.rows[*place as usize], 0.5)).chain(others))
        };
        let rows: Vec<Row> = region.iter().map(smoothed).collect();
        for (place, row) in region.iter().zip(rows) {
            self.rows[*place as usize] = row;
        }
    }

    /// Volume of a section of the limb, as long as it is thick.
    fn section(&self, tree: &TriangleTree, bend: &Bend) -> Option<f32> {
        let at = self.joints[bend.joint].head + bend.below * bend.section;
        let along = bend.below.normalize_or_zero();
        let across = if bend.section > 0.0 { along } else { (bend.above + along).try_normalize()? };
        let height = |place: u32| (self.points[place as usize] - at).dot(across);
        // Pieces of the border where the plane cuts triangles, by the edges that they end at.
        let mut cuts: Vec<[(u64, Vec3); 2]> = Vec::new();
        let reach = REACH * bend.below.length();
        let near = tree.near(at, reach);
        self.count(near.len());
        for corners in near.into_iter().map(|number| &self.triangles[number]) {
            let mut ends = Vec::new();
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (corners[a], corners[b]);
                let (low, high) = (height(a), height(b));
                if (low < 0.0) != (high < 0.0) {
                    let place = self.points[a as usize].lerp(self.points[b as usize], low / (low - high));
                    let edge = u64::from(a.min(b)) << 32 | u64::from(a.max(b));
                    // From below to above first, so that all pieces run around the section in the same sense.
                    ends.push((low < 0.0, edge, place));
                }
            }
            if let [mut first, mut second] = ends[..]
                && first.2.distance(at) < reach
            {
                if !first.0 {
                    (first, second) = (second, first);
                }
                cuts.push([(first.1, first.2), (second.1, second.2)]);
            }
        }
        // The piece nearest to the joint, and all that hang together with it.
        let nearest = (0..cuts.len())
            .min_by(|a, b| cuts[*a][0].1.distance(at).total_cmp(&cuts[*b][0].1.distance(at)).then(a.cmp(b)))?;
        let mut ends: Vec<(u64, usize)> =
            cuts.iter().enumerate().flat_map(|(cut, ends)| ends.map(|end| (end.0, cut))).collect();
        ends.sort_unstable();
        let at_edge = |edge: u64| {
            let first = ends.partition_point(|end| end.0 < edge);
            ends[first..].iter().take_while(move |end| end.0 == edge).map(|end| end.1)
        };
        let mut ring = vec![nearest];
        let mut is_in = vec![false; cuts.len()];
        is_in[nearest] = true;
        let mut next = 0;
        while next < ring.len() {
            for end in cuts[ring[next]] {
                for other in at_edge(end.0) {
                    if !std::mem::replace(&mut is_in[other], true) {
                        ring.push(other);
                    }
                }
            }
            next += 1;
        }
        ring.sort_unstable();
        let centre = ring.iter().map(|cut| cuts[*cut][0].1).sum::<Vec3>() / ring.len() as f32;
        let around = ring.iter().map(|cut| cuts[*cut].map(|end| end.1 - centre));
        let area = 0.5 * around.map(|[a, b]| a.cross(b)).sum::<Vec3>().dot(across).abs();
        let radius = (area / std::f32::consts::PI).sqrt();
        (area > 0.0).then_some(2.0 * radius * area)
    }
}

/// Sum of rows, each with a factor, by joint.
fn mixed<'a>(rows: impl Iterator<Item = (&'a Row, f32)>) -> Row {
    let mut row: Row = rows.flat_map(|(row, share)| row.iter().map(move |(joint, w)| (*joint, share * w))).collect();
    // A stable order, so that equal weights add up to the same bits.
    row.sort_by_key(|(joint, _)| *joint);
    row.dedup_by(|next, kept| {
        let is_same = next.0 == kept.0;
        kept.1 += if is_same { next.1 } else { 0.0 };
        is_same
    });
    row
}
