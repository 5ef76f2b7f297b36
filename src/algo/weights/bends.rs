//! Bends tried on the mesh: weights that do not fold there, and how far half joints have to move outwards so that the mesh
//! keeps its volume.
//!
//! The flesh around a joint turns about the joint. Where the section of the limb has its centre beside the joint, a bend by
//! the angle `a` takes or adds the section's area times `a` times that distance, whatever the weights (Pappus). A half joint
//! that leaves the bend on the outside makes up for it, and the right length depends on the body: it is measured here.

use std::{collections::BTreeMap, f32::consts::FRAC_PI_2};

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};

use super::WeightJoint;
use crate::mesh::{adjacency, influences::keep_strongest, model::Weights};

/// Loss of volume, as a share of a section, that is aimed at.
const LOSS: f32 = 0.08;
/// Gain of volume, as a share of a section, that is allowed where a joint turns aside.
const SWELL: f32 = 0.55;
/// Angle by which joints turn aside, in radians.
const ASIDE: f32 = 1.0;
/// Times that weights are smoothed where the mesh folds.
const PASSES: usize = 24;
/// Rounds of each pass.
const ROUNDS: usize = 4;
/// Rounds of smoothing of the weights around sockets, where a half joint that moves out would show every step of them.
const SOFTEN: usize = 10;
/// Share of a half joint from which on a place belongs to the flesh around its socket.
const SOFT: f32 = 0.02;
/// Triangles with less area than this share of their longest edge squared are slivers, whose direction means nothing.
const SLIVER: f32 = 1e-3;
/// Radius of the flesh that a bend concerns, in lengths of the longer of its two bones.
const REACH: f32 = 1.2;

/// Joints that move one place, with their weights.
type Row = Vec<(u32, f32)>;

/// A right-angled bend of a joint whose skin a half joint holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Index of the half joint.
    pub half: usize,
    /// Index of the joint that bends.
    pub joint: usize,
    /// Unit vector of the axis about which it bends, in the space of the points.
    pub axis: Vec3,
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

    /// Smooths weights where the mesh folds when its joints bend, each by itself, and finds for each bend the least length,
    /// within its limits, by which its half joint has to move outwards so that the mesh loses little; `None` where the mesh
    /// has no section around the joint. The order of the bends does not matter.
    pub fn settle(&mut self, bends: &[Bend]) -> Vec<Option<f32>> {
        let mut parts: Vec<Part> = bends.iter().map(|bend| Part::new(self, bend)).collect();
        let sections: Vec<Option<f32>> = bends.iter().map(|bend| self.section(bend)).collect();
        let pushes = |flesh: &Self, parts: &[Part]| -> Vec<Option<f32>> {
            let all = bends.iter().zip(parts).zip(&sections);
            all.map(|((bend, part), section)| push(flesh, bend, part, (*section)?)).collect()
        };
        let sockets = bends.iter().zip(&parts).filter(|(bend, _)| bend.section > 0.0).map(|(_, part)| part);
        let held = |part: &Part| {
            let shares = part.shares.iter().zip(0..).filter(|([_, half], _)| *half > SOFT).map(|(_, place)| place);
            shares.collect::<Vec<u32>>()
        };
        let region = self.around(sockets.flat_map(held), 0);
        (0..SOFTEN).for_each(|_| self.smooth(&region));
        parts.iter_mut().for_each(|part| part.read(self, &region));
        let first = pushes(self, &parts);
        let pose =
            |(bend, push): (&Bend, &Option<f32>)| Pose::new(bend, bend.axis, FRAC_PI_2, push.unwrap_or(bend.push[0]));
        let poses: Vec<Pose> = bends.iter().zip(&first).map(pose).collect();
        // Each bend changes the weights that it found; where two change one place, the place gets the mean of both.
        let mut changes: BTreeMap<u32, Vec<Row>> = BTreeMap::new();
        for (part, pose) in parts.iter().zip(&poses) {
            for (place, row) in self.unfolded(part, pose) {
                changes.entry(place).or_default().push(row);
            }
        }
        let places: Vec<u32> = changes.keys().copied().collect();
        for (place, rows) in changes {
            let share = 1.0 / rows.len() as f32;
            self.rows[place as usize] = mixed(rows.iter().map(|row| (row, share)));
        }
        parts.iter_mut().for_each(|part| part.read(self, &places));
        pushes(self, &parts)
    }

    /// Rows with which the fewest triangles fold in a bend, of the places where smoothing changed them.
    fn unfolded(&mut self, part: &Part, pose: &Pose) -> BTreeMap<u32, Row> {
        let mut part = part.clone();
        let (mut found, mut best) = (BTreeMap::new(), BTreeMap::new());
        let mut least = usize::MAX;
        for pass in 0..=PASSES {
            let folds = part.folds(self, pose);
            if folds.len() < least {
                least = folds.len();
                best = found.keys().map(|place| (*place, self.rows[*place as usize].clone())).collect();
            }
            if folds.is_empty() || pass == PASSES {
                break;
            }
            let region = self.around(folds.iter().flat_map(|at| part.triangles[*at]), 1 + pass / 6);
            for place in &region {
                found.entry(*place).or_insert_with(|| self.rows[*place as usize].clone());
            }
            (0..ROUNDS).for_each(|_| self.smooth(&region));
            part.read(self, &region);
        }
        for (place, row) in found {
            self.rows[place as usize] = row;
        }
        best
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

    /// Places within some edges of some places, sorted, without those that are fixed.
    fn around(&self, places: impl Iterator<Item = u32>, edges: usize) -> Vec<u32> {
        let mut region: Vec<u32> = places.collect();
        for _ in 0..edges {
            region.sort_unstable();
            region.dedup();
            let more: Vec<u32> =
                region.iter().flat_map(|place| self.neighbours[*place as usize].iter().copied()).collect();
            region.extend(more);
        }
        region.sort_unstable();
        region.dedup();
        region.retain(|place| !self.fixed[*place as usize]);
        region
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
    fn section(&self, bend: &Bend) -> Option<f32> {
        let at = self.joints[bend.joint].head + bend.below * bend.section;
        let along = bend.below.normalize_or_zero();
        let across = if bend.section > 0.0 { along } else { (bend.above + along).try_normalize()? };
        let height = |place: u32| (self.points[place as usize] - at).dot(across);
        // Pieces of the border where the plane cuts triangles, by the edges that they end at.
        let mut cuts: Vec<[(u64, Vec3); 2]> = Vec::new();
        let reach = REACH * bend.below.length();
        for corners in &self.triangles {
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

/// The least push of a bend with which a mesh loses little, in limits.
fn push(flesh: &Flesh, bend: &Bend, part: &Part, section: f32) -> Option<f32> {
    let lost = |push: f32| part.lost(flesh, &Pose::new(bend, bend.axis, FRAC_PI_2, push)) / section;
    let [least, mut most] = bend.push;
    for (axis, angle) in bend.aside.into_iter().flat_map(|axis| [(axis, ASIDE), (axis, -ASIDE)]) {
        let gained = |push: f32| -part.lost(flesh, &Pose::new(bend, axis, angle, push)) / section;
        let (low, high) = (gained(least), gained(most));
        let allowed = SWELL.max(low);
        if high > allowed {
            most = least + (most - least) * (allowed - low) / (high - low);
        }
    }
    let (mut low, mut high) = ((least, lost(least)), (most, lost(most)));
    if !(low.1.is_finite() && high.1.is_finite()) {
        return None;
    }
    if low.1 <= LOSS {
        return Some(least);
    }
    if high.1 >= LOSS {
        return (high.1 < low.1).then_some(most);
    }
    // Volume is a polynomial of the third degree in the length, and nearly straight.
    for _ in 0..4 {
        let push = low.0 + (high.0 - low.0) * (low.1 - LOSS) / (low.1 - high.1);
        let is = (push, lost(push));
        if is.1 > LOSS { low = is } else { high = is }
    }
    let off = |end: (f32, f32)| (end.1 - LOSS).abs();
    Some(if off(low) < off(high) { low.0 } else { high.0 })
}

/// Motions of the flesh in a bend about the joint; flesh above it stays.
struct Pose {
    lower: Affine3A,
    half: Affine3A,
}

impl Pose {
    fn new(bend: &Bend, axis: Vec3, angle: f32, push: f32) -> Self {
        let length = push * bend.below.length();
        let turn = Quat::from_axis_angle(axis, angle);
        let share = Quat::from_axis_angle(axis, angle * bend.share);
        let on = bend.above * length;
        let back = bend.below.normalize_or_zero() * -length;
        let (rest, posed) = (on.lerp(back, bend.share), on.lerp(turn * back, bend.share));
        let half = Affine3A::from_rotation_translation(share, posed) * Affine3A::from_translation(-rest);
        Self { lower: Affine3A::from_quat(turn), half }
    }
}

/// Triangles that a bend concerns, with the shares of the bending and of the half joint at their corners.
#[derive(Clone)]
struct Part {
    at: Vec3,
    triangles: Vec<[u32; 3]>,
    /// Shares of every place of the mesh.
    shares: Vec<[f32; 2]>,
    /// Side of each joint: true below the bend.
    lower: Vec<bool>,
    half: u32,
}

impl Part {
    fn new(flesh: &Flesh, bend: &Bend) -> Self {
        let joints = flesh.joints;
        let mut lower = vec![false; joints.len()];
        // Parents need not come before their children.
        for (joint, below) in lower.iter_mut().enumerate() {
            let mut chain = std::iter::successors(Some(joint), |joint| joints[*joint].parent).take(joints.len());
            *below = chain.any(|above| above == bend.joint);
        }
        lower[bend.half] = false;
        let at = joints[bend.joint].head;
        let above = joints[bend.joint].parent.map_or(0.0, |parent| joints[parent].head.distance(at));
        let reach = REACH * bend.below.length().max(above);
        let is_near = |corners: &&[u32; 3]| flesh.points[corners[0] as usize].distance(at) < reach;
        let triangles = flesh.triangles.iter().filter(is_near).copied().collect();
        let mut part = Self { at, triangles, shares: vec![[0.0; 2]; flesh.rows.len()], lower, half: bend.half as u32 };
        let all: Vec<u32> = (0..flesh.rows.len() as u32).collect();
        part.read(flesh, &all);
        // What does not move, and what moves as one, cannot fold and keeps its volume. Smoothing reaches a little further.
        let is_still = |[lower, half]: [f32; 2]| half == 0.0 && (lower == 0.0 || lower > 0.999);
        let still: Vec<bool> = part.shares.iter().map(|shares| is_still(*shares)).collect();
        let mut near = still.iter().map(|still| !still).collect::<Vec<bool>>();
        for _ in 0..8 {
            let wider: Vec<usize> = (0..near.len()).filter(|place| near[*place]).collect();
            for place in wider {
                flesh.neighbours[place].iter().for_each(|other| near[*other as usize] = true);
            }
        }
        part.triangles.retain(|corners| corners.iter().any(|corner| near[*corner as usize]));
        part
    }

    /// Takes up the weights of some places.
    fn read(&mut self, flesh: &Flesh, places: &[u32]) {
        for &place in places {
            let mut shares = [0.0; 2];
            for (joint, weight) in &flesh.rows[place as usize] {
                if *joint == self.half {
                    shares[1] += weight;
                } else if self.lower[*joint as usize] {
                    shares[0] += weight;
                }
            }
            self.shares[place as usize] = shares;
        }
    }

    /// Corners of a triangle from the joint, at rest and posed, and the mean motion of the flesh there.
    fn corners(&self, flesh: &Flesh, pose: &Pose, corners: &[u32; 3]) -> ([Vec3; 3], [Vec3; 3], Mat3A) {
        let mut motion = Mat3A::ZERO;
        let rest = corners.map(|corner| flesh.points[corner as usize] - self.at);
        let mut posed = rest;
        for (corner, point) in corners.iter().zip(&mut posed) {
            let [lower, half] = self.shares[*corner as usize];
            let still = 1.0 - lower - half;
            motion += Mat3A::IDENTITY * still + pose.lower.matrix3 * lower + pose.half.matrix3 * half;
            *point = *point * still
                + pose.lower.transform_point3(*point) * lower
                + pose.half.transform_point3(*point) * half;
        }
        (rest, posed, motion)
    }

    /// Triangles that turn by more than a right angle against the motion of the flesh around them.
    fn folds(&self, flesh: &Flesh, pose: &Pose) -> Vec<usize> {
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
        let is_folded = |at: &usize| {
            let (rest, posed, motion) = self.corners(flesh, pose, &self.triangles[*at]);
            let [a, b, c] = rest;
            let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
            let before = normal(rest);
            let turned = motion.inverse().transpose() * Vec3A::from(before);
            before.length() > SLIVER * longest && Vec3::from(turned).dot(normal(posed)) < 0.0
        };
        (0..self.triangles.len()).filter(is_folded).collect()
    }

    /// Volume that the bend takes. Motions are about the joint, so what moves as one keeps its share of the volume, and
    /// holes of the mesh do not matter.
    fn lost(&self, flesh: &Flesh, pose: &Pose) -> f32 {
        let volume = |[a, b, c]: [Vec3; 3]| f64::from(a.dot(b.cross(c))) / 6.0;
        let lost = |corners: &[u32; 3]| {
            let (rest, posed, _) = self.corners(flesh, pose, corners);
            volume(rest) - volume(posed)
        };
        self.triangles.iter().map(lost).sum::<f64>() as f32
    }
}
