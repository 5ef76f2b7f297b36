//! Sides of lips and lids: the upper or lower rim of each vertex, found along the surface.

use std::{cmp::Reverse, collections::BinaryHeap};

use glam::Vec3;

use super::{Face, smooth};
use crate::algo::{
    face::bones::{FaceBoneKind, Region, map::line_distance},
    weights::ldl::{LANES, Lane, Ldl, Symmetric},
};

/// Distance along the surface, as a share of the face's scale, over which the upper rim goes over into the lower one in the
/// corners of an opening, where both are one skin.
const CORNER: f32 = 0.03;

/// Upper or lower rim of lips or lids.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rim {
    /// No rim.
    None,
    /// Rim above the opening.
    Upper,
    /// Rim below the opening.
    Lower,
}

/// The openings of a face: mouth, left eye, right eye.
pub(crate) const OPENINGS: usize = 3;

/// Rims of vertices and bones at the openings.
pub(crate) struct Sides {
    /// Rim of each vertex, by opening.
    rims: [Vec<Rim>; OPENINGS],
    /// Share of the lower rim at each vertex, by opening: 1 on the lower one, and smoothly less to 0 on the upper one in the
    /// corners.
    lower: [Vec<f32>; OPENINGS],
    /// Rim of each bone, by opening.
    bones: Vec<[Rim; OPENINGS]>,
}

impl Sides {
    /// Floods the surroundings of each opening from the outer rims of lips and lids. A mouth that is one closed surface has no
    /// rims: its skin stretches.
    ///
    /// `O(n log n)` in the vertices around the openings.
    pub fn new(face: &Face) -> Self {
        let n = face.places.len();
        let mut rims = [vec![Rim::None; n], vec![Rim::None; n], vec![Rim::None; n]];
        let mut bones = vec![[Rim::None; OPENINGS]; face.bones.len()];
        if !face.map.trusted {
            let lower = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            return Self { rims, lower, bones };
        }
        for (opening, rims) in rims.iter_mut().enumerate().skip(usize::from(!face.lips_part)) {
            let zone = Zone::new(face, opening);
            flood(face, &zone, rims);
            for (bone, rim) in face.bones.iter().zip(&mut bones) {
                let lips = bone.region == Region::Lip && opening == 0;
                let lids = bone.region == Region::Lid && opening > 0;
                if bone.kind != FaceBoneKind::Skin || !(lips || lids) || !zone.holds(bone.position) {
                    continue;
                }
                // Bones at the corners of the mouth belong to both lips.
                if lips && face.map.lip_inset(bone.position) < 0.14 {
                    continue;
                }
                let nearest = (0..n).filter(|&v| rims[v] != Rim::None && face.mask[v]).min_by(|&a, &b| {
                    let to = bone.position;
                    face.places[a].distance_squared(to).total_cmp(&face.places[b].distance_squared(to))
                });
                rim[opening] = nearest.map_or(Rim::None, |v| rims[v]);
            }
        }
        let lower = [0, 1, 2].map(|opening| lower_shares(face, &rims[opening]));
        Self { rims, lower, bones }
    }

    /// Share of the lower lip at a vertex of a lip, 0 to 1; 0 elsewhere.
    pub fn lower_lip(&self, vertex: usize) -> f32 {
        self.lower[0][vertex]
    }

    /// Lip of a vertex.
    pub fn lip(&self, vertex: usize) -> Rim {
        self.rims[0][vertex]
    }

    /// True for a vertex on a rim of any opening.
    pub fn is_rim(&self, vertex: usize) -> bool {
        self.rims.iter().any(|rims| rims[vertex] != Rim::None)
    }

    /// Rim of a vertex at an opening.
    pub fn rim(&self, vertex: usize, opening: usize) -> Rim {
        self.rims[opening][vertex]
    }

    /// Share of its weight that a bone keeps on a vertex: nothing across an opening, all elsewhere, and smoothly less
    /// from the corners of the opening inwards.
    pub fn keep(&self, face: &Face, vertex: usize, bone: usize) -> f32 {
        let mut keep = 1.0;
        for opening in 0..OPENINGS {
            if self.rims[opening][vertex] == Rim::None {
                continue;
            }
            let lower = self.lower[opening][vertex];
            let across = match self.bones[bone][opening] {
                Rim::None => continue,
                Rim::Upper => lower,
                Rim::Lower => 1.0 - lower,
            };
            keep *= 1.0 - across * inset(face, opening, face.places[vertex]);
        }
        keep
    }

    /// Returns `true` if two bones lie across an opening from each other.
    pub fn are_apart(&self, a: usize, b: usize) -> bool {
        let across = |o: usize| {
            matches!((self.bones[a][o], self.bones[b][o]), (Rim::Upper, Rim::Lower) | (Rim::Lower, Rim::Upper))
        };
        (0..OPENINGS).any(across)
    }

    /// Returns `true` if a bone may be the nearest one of a vertex.
    pub fn allows(&self, vertex: usize, bone: usize) -> bool {
        (0..OPENINGS).all(|o| {
            !matches!((self.bones[bone][o], self.rims[o][vertex]), (Rim::Upper, Rim::Lower) | (Rim::Lower, Rim::Upper))
        })
    }
}

/// 0 at and outside the corners of an opening, 1 well inside.
pub(crate) fn inset(face: &Face, opening: usize, p: Vec3) -> f32 {
    if opening == 0 { smooth(0.0, 0.3, face.map.lip_inset(p)) } else { smooth(0.0, 0.3, face.map.lid_inset(p)) }
}

/// The surroundings of an opening.
struct Zone {
    center: Vec3,
    /// Half the size of the zone around the centre, in each direction.
    reach: Vec3,
    upper: Vec<Vec3>,
    lower: Vec<Vec3>,
}

impl Zone {
    fn new(face: &Face, opening: usize) -> Self {
        let e = face.map.scale;
        let real = |side: usize, p: Vec3| {
            let x = if side == 0 { p.x } else { -p.x };
            p.with_x(face.map.middle + x)
        };
        if opening == 0 {
            let [left, right] = &face.map.halves;
            let join = |l: &[Vec3], r: &[Vec3]| {
                let mut line: Vec<Vec3> = r[1..].iter().rev().map(|&p| real(1, p)).collect();
                line.extend(l.iter().map(|&p| real(0, p)));
                line
            };
            let center = 0.5 * (real(0, left.lip_corner()) + real(1, right.lip_corner()));
            let half = left.lip_corner().x.max(right.lip_corner().x);
            let mouth = left.lip_line()[0];
            let height = (left.upper_lip[0].y - left.lower_lip[0].y).abs().max(0.1 * e);
            let center = Vec3::new(center.x, mouth.y, center.z);
            let reach = Vec3::new(half * 1.05, 1.1 * height, 0.6 * e);
            return Self {
                center,
                reach,
                upper: join(&left.upper_lip[..3], &right.upper_lip[..3]),
                lower: join(&left.lower_lip[..3], &right.lower_lip[..3]),
            };
        }
        let side = opening - 1;
        let half = &face.map.halves[side];
        let opening = half.upper_lid[1].distance(half.lower_lid[1]).max(0.03 * e);
        let out = |line: &[Vec3; 4], by: f32| -> Vec<Vec3> {
            line[1..3].iter().map(|&p| real(side, p + Vec3::new(0.0, by, 0.0))).collect()
        };
        let half_width = 0.5 * (half.upper_lid[3].x - half.upper_lid[0].x).abs();
        Self {
            center: real(side, half.eye()),
            reach: Vec3::new(1.1 * half_width, 0.16 * e, 0.4 * e),
            upper: out(&half.upper_lid, 0.35 * opening),
            lower: out(&half.lower_lid, -0.35 * opening),
        }
    }

    fn holds(&self, p: Vec3) -> bool {
        (p - self.center).abs().cmple(self.reach).all()
    }
}

/// Assigns each vertex of a zone to the rim that is nearer along the surface.
fn flood(face: &Face, zone: &Zone, rims: &mut [Rim]) {
    let inside: Vec<usize> = (0..face.places.len()).filter(|&v| face.skin[v] && zone.holds(face.places[v])).collect();
    if inside.is_empty() {
        return;
    }
    let mut distance = vec![f32::INFINITY; rims.len()];
    let mut heap = BinaryHeap::new();
    for (line, rim) in [(&zone.upper, Rim::Upper), (&zone.lower, Rim::Lower)] {
        // Seeds: visible skin about as near to the line as the nearest vertex to each of its points.
        for &p in line {
            let near = |v: usize| face.places[v].distance(p);
            let seen = inside.iter().copied().filter(|&v| face.mask[v]);
            if let Some(v) = seen.min_by(|&a, &b| near(a).total_cmp(&near(b))) {
                let d = line_distance(line, face.places[v]);
                if d < distance[v] {
                    distance[v] = d;
                    rims[v] = rim;
                    heap.push(Reverse((order(d), v as u32)));
                }
            }
        }
    }
    while let Some(Reverse((d, v))) = heap.pop() {
        let v = v as usize;
        if d != order(distance[v]) {
            continue;
        }
        for (other, _) in face.graph.of(v) {
            if !face.skin[other] || !zone.holds(face.places[other]) {
                continue;
            }
            let to = distance[v] + face.places[v].distance(face.places[other]);
            if to < distance[other] {
                distance[other] = to;
                rims[other] = rims[v];
                heap.push(Reverse((order(to), other as u32)));
            }
        }
    }
}

/// Share of the lower rim at each vertex: what the rims say, spread by heat along the surface over [`CORNER`].
fn lower_shares(face: &Face, rims: &[Rim]) -> Vec<f32> {
    let mut shares: Vec<f32> = rims.iter().map(|rim| f32::from(u8::from(*rim == Rim::Lower))).collect();
    let inside: Vec<usize> = (0..rims.len()).filter(|&v| rims[v] != Rim::None).collect();
    if inside.is_empty() {
        return shares;
    }
    let mut index = vec![u32::MAX; rims.len()];
    inside.iter().enumerate().for_each(|(i, &v)| index[v] = i as u32);
    let areas: Vec<f64> = inside.iter().map(|&v| f64::from(face.graph.areas[v])).collect();
    let least = (1e-3 * areas.iter().sum::<f64>() / areas.len() as f64).max(1e-30);
    let width = f64::from(CORNER * face.map.scale);
    let mut matrix = Symmetric { starts: vec![0], columns: Vec::new(), values: Vec::new(), diagonal: Vec::new() };
    for (&v, area) in inside.iter().zip(&areas) {
        let mut diagonal = area.max(least);
        for (other, weight) in face.graph.of(v).filter(|(other, _)| index[*other] != u32::MAX) {
            let flow = width * width * f64::from(weight);
            diagonal += flow;
            matrix.columns.push(index[other]);
            matrix.values.push(-flow);
        }
        matrix.starts.push(matrix.columns.len() as u32);
        matrix.diagonal.push(diagonal);
    }
    // Without a factor, rims stay as they are.
    let Some(factor) = Ldl::new(&matrix) else { return shares };
    let row = |&at: &u32| {
        let at = at as usize;
        let mut lane = [0.0; LANES];
        lane[0] = areas[at].max(least) * f64::from(shares[inside[at]]);
        lane
    };
    let mut lanes: Vec<Lane> = factor.order().iter().map(row).collect();
    factor.solve(&mut lanes);
    for (lane, &at) in lanes.iter().zip(factor.order()) {
        shares[inside[at as usize]] = (lane[0] as f32).clamp(0.0, 1.0);
    }
    shares
}

/// Non-negative float as an integer with the same order, for the heap.
fn order(x: f32) -> u32 {
    x.to_bits()
}
