//! The hierarchy: nodes of eight boxes over packets of four triangles, side by side for SIMD.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use wide::{CmpGt, CmpLe, CmpLt, f32x4, f32x8};

use super::build::{self, Part, Primitive};
use super::crossing::{Frame, SLACK};

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a packet.
pub(super) const LANES: usize = 4;
/// Most levels of nodes there can be: the builder halves ranges long before.
pub(super) const DEPTH: usize = 36;
/// Marks a lane without a triangle.
pub(super) const NONE: u32 = u32::MAX;
/// Marks a child that is a packet.
const LEAF: u32 = 1 << 31;
/// The packet of an absent child.
const ABSENT: usize = (NONE & !LEAF) as usize;

/// Eight boxes and what is in them. An absent child has an inverted box, which no ray meets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Lower and upper bounds along x, y, z.
    bounds: [[f32x8; 3]; 2],
    /// What is in each box.
    children: [Child; WIDTH],
}

/// A node or a packet, by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Child(u32);

/// What a [`Child`] refers to.
pub(super) enum Target {
    /// Index of a node.
    Node(usize),
    /// Index of a packet.
    Packet(usize),
}

impl Child {
    pub fn packet(index: usize) -> Self {
        Self(index as u32 | LEAF)
    }

    pub fn node(index: usize) -> Self {
        Self(index as u32)
    }

    pub fn target(self) -> Target {
        if self.0 & LEAF != 0 { Target::Packet((self.0 & !LEAF) as usize) } else { Target::Node(self.0 as usize) }
    }
}

/// Four triangles, lane by lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packet {
    /// Corner, then axis.
    corners: [[f32x4; 3]; 3],
    /// The caller's index of each triangle, [`NONE`] past the last.
    pub triangles: [u32; LANES],
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn of(corners: [Vec3; 3]) -> Self {
        Self {
            low: corners[0].min(corners[1]).min(corners[2]),
            high: corners[0].max(corners[1]).max(corners[2]),
        }
    }

    /// Half the area of the box.
    pub fn half_area(&self) -> f32 {
        let size = self.high - self.low;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    pub fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }
}

/// A ray prepared for boxes: they are grown by what rounding can do to the triangles in them, so that no crossing
/// that the triangle test sees is lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoxRay {
    /// The origin, moved back for near planes and ahead for far ones, per axis.
    origins: [[f32x8; 3]; 2],
    /// One over the direction.
    inverse: [f32x8; 3],
    /// Which bound is near, per axis.
    near: [usize; 3],
}

impl BoxRay {
    pub fn new(frame: &Frame, bounds: &Bounds) -> Self {
        let reach = (bounds.low - frame.origin).abs().max((bounds.high - frame.origin).abs()).max_element();
        let slack = SLACK * (reach + frame.origin.abs().max_element());
        let least = frame.direction.abs().max_element() * 1e-18;
        let direction = frame.direction.to_array().map(|d| if d.abs() < least { least.copysign(d) } else { d });
        let origin = frame.origin.to_array();
        let shift = |i: usize| slack.copysign(direction[i]);
        Self {
            origins: [
                [0, 1, 2].map(|i| f32x8::splat(origin[i] + shift(i))),
                [0, 1, 2].map(|i| f32x8::splat(origin[i] - shift(i))),
            ],
            inverse: direction.map(|d| f32x8::splat(1.0 / d)),
            near: direction.map(|d| usize::from(d < 0.0)),
        }
    }

    /// Distances at which the ray enters and leaves each box, and a bit for each that it meets within the range.
    #[inline(always)]
    pub fn meet(&self, node: &Node, from: f32, to: f32) -> (f32x8, f32x8, u32) {
        let plane = |side: usize, axis: usize| {
            (node.bounds[self.near[axis] ^ side][axis] - self.origins[side][axis]) * self.inverse[axis]
        };
        let enter = plane(0, 0).fast_max(plane(0, 1)).fast_max(plane(0, 2).fast_max(f32x8::splat(from)));
        let leave = plane(1, 0).fast_min(plane(1, 1)).fast_min(plane(1, 2).fast_min(f32x8::splat(to)));
        (enter, leave, enter.cmp_le(leave).move_mask() as u32)
    }
}

impl Node {
    pub const EMPTY: Self = Self {
        bounds: [[f32x8::new([f32::INFINITY; 8]); 3], [f32x8::new([f32::NEG_INFINITY; 8]); 3]],
        children: [Child(NONE); WIDTH],
    };

    pub fn child(&self, i: usize) -> Child {
        self.children[i]
    }

    /// The present children and their boxes.
    pub fn iter(&self) -> impl Iterator<Item = (Bounds, Child)> {
        (0..WIDTH).map(|i| (self.bounds_of(i), self.children[i])).filter(|(bounds, _)| !bounds.is_empty())
    }

    fn bounds_of(&self, i: usize) -> Bounds {
        let at = |side: usize| Vec3::from_array([0, 1, 2].map(|axis| self.bounds[side][axis].as_array_ref()[i]));
        Bounds { low: at(0), high: at(1) }
    }

    fn set(&mut self, i: usize, bounds: Bounds) {
        for axis in 0..3 {
            self.bounds[0][axis].as_array_mut()[i] = bounds.low[axis];
            self.bounds[1][axis].as_array_mut()[i] = bounds.high[axis];
        }
    }

    /// The box around all children.
    pub fn bounds(&self) -> Bounds {
        (0..WIDTH).map(|i| self.bounds_of(i)).fold(Bounds::EMPTY, Bounds::union)
    }
}

impl Packet {
    const EMPTY: Self = Self { corners: [[f32x4::ZERO; 3]; 3], triangles: [NONE; LANES] };

    /// The corners of one lane.
    pub fn corners(&self, lane: usize) -> [Vec3; 3] {
        self.corners.map(|corner| Vec3::from_array(corner.map(|axis| axis.as_array_ref()[lane])))
    }

    fn set(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (to, from) in self.corners.iter_mut().zip(corners) {
            for (to, from) in to.iter_mut().zip(from.to_array()) {
                to.as_array_mut()[lane] = from;
            }
        }
    }

    /// A bit for each lane whose triangle may be crossed: none is missed, and nearly all are right.
    ///
    /// The same sheared coordinates as in [`Frame::cross`]. Rounding keeps order, so a strict comparison of rounded
    /// products is a strict comparison of the products themselves.
    #[inline(always)]
    pub fn candidates(&self, frame: &Frame) -> u32 {
        let [x, y, z] = frame.axes;
        let origin = frame.axes.map(|axis| f32x4::splat(frame.origin[axis]));
        let shear = frame.shear.map(f32x4::splat);
        let flat = self.corners.map(|corner| {
            let depth = corner[z] - origin[2];
            [corner[x] - origin[0] - shear[0] * depth, corner[y] - origin[1] - shear[1] * depth]
        });
        let edge = |a: [f32x4; 2], b: [f32x4; 2]| {
            let (p, q) = (a[0] * b[1], a[1] * b[0]);
            (p.cmp_gt(q), p.cmp_lt(q))
        };
        let (u, v, w) = (edge(flat[1], flat[2]), edge(flat[2], flat[0]), edge(flat[0], flat[1]));
        let mixed = (u.0 | v.0 | w.0) & (u.1 | v.1 | w.1);
        !mixed.move_mask() as u32 & ((1 << LANES) - 1)
    }
}

/// The whole hierarchy.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    /// The root first, then level after level.
    pub nodes: Vec<Node>,
    /// In the order of the nodes that hold them.
    pub packets: Vec<Packet>,
    /// Corners of the triangles of each packet.
    corners: Vec<[[u32; 3]; LANES]>,
    /// Where each level starts in `nodes`, and the end.
    levels: Vec<usize>,
    /// First packet of each node, and the end.
    firsts: Vec<u32>,
}

impl Tree {
    /// Builds over the triangles that can take part; returns how many these are.
    pub fn build(points: &[Vec3], triangles: &[[u32; 3]]) -> (Self, usize) {
        let (mut primitives, count) = build::primitives(points, triangles);
        let mut tree = Self::default();
        if primitives.is_empty() {
            return (tree, 0);
        }
        let mut leaves: Vec<Range<usize>> = Vec::with_capacity(count / 3);
        let mut level = vec![build::whole(&primitives)];
        while !level.is_empty() {
            let depth = tree.levels.len();
            tree.levels.push(tree.nodes.len());
            let split: Vec<Vec<Part>> = slices(&mut primitives, &level)
                .into_par_iter()
                .zip(&level)
                .map(|(own, part)| build::children(own, part, depth))
                .collect();
            let mut below = Vec::with_capacity(level.len() * WIDTH);
            let start = tree.nodes.len() + level.len();
            for parts in split {
                let mut node = Node::EMPTY;
                tree.firsts.push(leaves.len() as u32);
                for (child, part) in node.children.iter_mut().zip(parts) {
                    if part.is_leaf() {
                        *child = Child::packet(leaves.len());
                        leaves.push(part.range);
                    } else {
                        *child = Child::node(start + below.len());
                        below.push(part);
                    }
                }
                tree.nodes.push(node);
            }
            level = below;
        }
        tree.levels.push(tree.nodes.len());
        tree.firsts.push(leaves.len() as u32);
        (tree.packets, tree.corners) = leaves
            .par_iter()
            .with_min_len(1 << 10)
            .map(|leaf| {
                let mut packet = Packet::EMPTY;
                let mut corners = [[0; 3]; LANES];
                let own = primitives[leaf.clone()].iter().flat_map(Primitive::triangles);
                for (lane, triangle) in own.take(LANES).enumerate() {
                    packet.triangles[lane] = triangle;
                    corners[lane] = triangles[triangle as usize];
                }
                (packet, corners)
            })
            .unzip();
        tree.refit(points);
        (tree, count)
    }

    /// Takes new positions, bottom up.
    pub fn refit(&mut self, points: &[Vec3]) {
        for level in self.levels.windows(2).rev() {
            let (start, end) = (level[0], level[1]);
            let (nodes, below) = self.nodes.split_at_mut(end);
            let firsts = &self.firsts[start..=end];
            let packets = firsts[0] as usize..firsts[end - start] as usize;
            let level = Level { below, below_start: end, corners: &self.corners, points };
            level.refit(&mut nodes[start..], &mut self.packets[packets], firsts);
        }
    }
}

/// What refitting a level reads.
struct Level<'a> {
    below: &'a [Node],
    below_start: usize,
    corners: &'a [[[u32; 3]; LANES]],
    points: &'a [Vec3],
}

impl Level<'_> {
    /// Refits `nodes` and their `packets`, in parallel halves.
    fn refit(&self, nodes: &mut [Node], packets: &mut [Packet], firsts: &[u32]) {
        if nodes.len() > 512 {
            let half = nodes.len() / 2;
            let (left, right) = nodes.split_at_mut(half);
            let (left_packets, right_packets) = packets.split_at_mut((firsts[half] - firsts[0]) as usize);
            rayon::join(
                || self.refit(left, left_packets, &firsts[..=half]),
                || self.refit(right, right_packets, &firsts[half..]),
            );
            return;
        }
        let start = firsts[0] as usize;
        for node in nodes {
            for i in 0..WIDTH {
                let bounds = match node.children[i].target() {
                    Target::Node(index) => self.below[index - self.below_start].bounds(),
                    Target::Packet(index) if index == ABSENT => continue,
                    Target::Packet(index) => {
                        let packet = &mut packets[index - start];
                        let mut bounds = Bounds::EMPTY;
                        for lane in 0..LANES {
                            if packet.triangles[lane] == NONE {
                                break;
                            }
                            let corners = self.corners[index][lane].map(|c| self.points[c as usize]);
                            packet.set(lane, corners);
                            bounds = bounds.union(Bounds::of(corners));
                        }
                        bounds
                    }
                };
                node.set(i, bounds);
            }
        }
    }
}

/// The primitives of each part; parts are in order and do not overlap.
fn slices<'a>(mut primitives: &'a mut [Primitive], parts: &[Part]) -> Vec<&'a mut [Primitive]> {
    let mut at = 0;
    parts
        .iter()
        .map(|part| {
            let (_, rest) = std::mem::take(&mut primitives).split_at_mut(part.range.start - at);
            let (own, rest) = rest.split_at_mut(part.range.len());
            at = part.range.end;
            primitives = rest;
            own
        })
        .collect()
}
