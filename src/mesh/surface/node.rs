//! Nodes of the hierarchy: eight boxes in 128 bytes. Rays mostly wait for memory, so nodes are small.
//!
//! Bounds are kept as 16-bit steps from the node's own lower corner, after Ylitie, Karras and Laine, "Efficient
//! Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs" (HPG 2017), always rounded outwards.

use bytemuck::cast;
use glam::Vec3;
use wide::{CmpLe, f32x4, i32x4, u32x4};

use super::crossing::{Frame, SLACK};

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Marks a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// Marks a leaf of two packets.
const TWO: u32 = 1 << 30;
/// Steps along each axis of a node.
const STEPS: f32 = 65535.0;

/// Four values for the first four children and four for the others.
pub(super) type Eight = [f32x4; 2];

/// Up to eight children: first those that are nodes, then leaves. The children of each kind are stored consecutively.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub(super) struct Node {
    /// Lower and upper bounds along each axis, in steps from `base`. A word holds the bound of child `i` in its lower
    /// half and that of child `i + 4` in its upper half.
    planes: [[[u32; 4]; 3]; 2],
    /// Lower corner of the boxes of all children.
    base: [f32; 3],
    /// Binary exponents of the steps, as in an `f32`.
    exponents: [u8; 3],
    /// Number of children that are nodes.
    nodes: u8,
    /// Number of children.
    count: u8,
    /// A bit for each child that is a leaf of two packets.
    twos: u8,
    /// Index of the first child that is a node.
    pub first_node: u32,
    /// Index of the first packet of the first leaf.
    pub first_packet: u32,
}

/// A node or a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Child(u32);

/// The node or leaf that a [`Child`] refers to.
pub(super) enum Target {
    /// A node.
    Node(usize),
    /// Index of the first packet of a leaf, and whether there is a second.
    Leaf(usize, bool),
}

impl Child {
    pub const ROOT: Self = Self(0);

    #[inline(always)]
    pub fn target(self) -> Target {
        if self.0 & LEAF != 0 {
            Target::Leaf((self.0 & !(LEAF | TWO)) as usize, self.0 & TWO != 0)
        } else {
            Target::Node(self.0 as usize)
        }
    }
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds {
    /// The empty box.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    #[inline(always)]
    pub fn of(corners: [Vec3; 3]) -> Self {
        Self { low: corners[0].min(corners[1]).min(corners[2]), high: corners[0].max(corners[1]).max(corners[2]) }
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

/// The exact boxes of a node's children, side by side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Boxes {
    /// Lower and upper bounds along each axis.
    planes: [[[f32; WIDTH]; 3]; 2],
}

impl Boxes {
    pub const EMPTY: Self = Self { planes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]] };

    #[inline(always)]
    pub fn set(&mut self, i: usize, bounds: &Bounds) {
        for axis in 0..3 {
            self.planes[0][axis][i] = bounds.low[axis];
            self.planes[1][axis][i] = bounds.high[axis];
        }
    }
}

/// A ray prepared for box tests. Boxes are grown by the rounding errors of their triangles and of their own bounds, so
/// that no crossing of the triangle test is lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoxRay {
    /// The origin, moved back for near planes and ahead for far ones.
    origins: [Vec3; 2],
    /// Reciprocal of the direction.
    inverse: Vec3,
    /// Index of the near bound (0 lower, 1 upper) per axis.
    near: [usize; 3],
}

impl BoxRay {
    pub fn new(frame: &Frame, bounds: &Bounds) -> Self {
        let reach = (bounds.low - frame.origin).abs().max((bounds.high - frame.origin).abs()).max_element();
        let slack = SLACK * (reach + frame.origin.abs().max_element());
        // Far below the slack, and far from overflow.
        let least = frame.direction.abs().max_element() * 1e-9;
        let direction = frame.direction.map(|d| if d.abs() < least { least.copysign(d) } else { d });
        let shift = direction.map(|d| slack.copysign(d));
        Self {
            origins: [frame.origin + shift, frame.origin - shift],
            inverse: 1.0 / direction,
            near: direction.to_array().map(|d| usize::from(d < 0.0)),
        }
    }

    /// Distances at which the ray enters and leaves each box, and a bit for each box that it crosses within the range.
    #[inline(always)]
    pub fn meet(&self, node: &Node, from: f32, to: f32) -> (Eight, Eight, u32) {
        let (mut enter, mut leave) = ([f32x4::splat(from); 2], [f32x4::splat(to); 2]);
        for axis in 0..3 {
            let scale = f32x4::splat(node.step(axis) * self.inverse[axis]);
            let plane = |side: usize| {
                let start = f32x4::splat((node.base[axis] - self.origins[side][axis]) * self.inverse[axis]);
                node.steps(self.near[axis] ^ side, axis).map(|steps| steps * scale + start)
            };
            let (near, far) = (plane(0), plane(1));
            for half in 0..2 {
                enter[half] = enter[half].fast_max(near[half]);
                leave[half] = leave[half].fast_min(far[half]);
            }
        }
        let mask = |half: usize| enter[half].cmp_le(leave[half]).move_mask() as u32;
        (enter, leave, (mask(0) | mask(1) << 4) & ((1 << node.count) - 1))
    }
}

impl Node {
    /// Makes a node without boxes from the number of children that are nodes and the number of packets of each leaf
    /// (one or two).
    pub fn new(nodes: usize, leaves: impl Iterator<Item = usize>) -> Self {
        let mut node = Self {
            planes: [[[0; 4]; 3]; 2],
            base: [0.0; 3],
            exponents: [1; 3],
            nodes: nodes as u8,
            count: nodes as u8,
            twos: 0,
            first_node: 0,
            first_packet: 0,
        };
        for packets in leaves {
            node.twos |= u8::from(packets == 2) << node.count;
            node.count += 1;
        }
        node
    }

    /// Number of children.
    pub fn len(&self) -> usize {
        self.count as usize
    }

    /// Number of children that are nodes.
    pub fn inner(&self) -> usize {
        self.nodes as usize
    }

    /// Number of packets of all leaves.
    pub fn packets(&self) -> usize {
        self.len() - self.inner() + self.twos.count_ones() as usize
    }

    /// Number of packets of the leaf at `i`.
    pub fn packets_of(&self, i: usize) -> usize {
        1 + usize::from(self.twos >> i & 1)
    }

    /// The child at `i`.
    #[inline(always)]
    pub fn child(&self, i: usize) -> Child {
        let i = i as u32;
        let nodes = u32::from(self.nodes);
        if i < nodes {
            return Child(self.first_node + i);
        }
        let twos = u32::from(self.twos);
        let before = (twos & ((1 << i) - 1)).count_ones();
        let two = if twos >> i & 1 == 1 { TWO } else { 0 };
        Child(LEAF | two | (self.first_packet + i - nodes + before))
    }

    #[inline(always)]
    fn step(&self, axis: usize) -> f32 {
        f32::from_bits(u32::from(self.exponents[axis]) << 23)
    }

    #[inline(always)]
    fn steps(&self, side: usize, axis: usize) -> Eight {
        let words: u32x4 = cast(self.planes[side][axis]);
        let float = |words: u32x4| f32x4::from_i32x4(cast::<u32x4, i32x4>(words));
        [float(words & u32x4::splat(0xffff)), float(words >> 16)]
    }

    /// Squared distances of `point` from the boxes, and a bit for each child; boxes are grown by `slack`.
    pub fn distances(&self, point: Vec3, slack: f32) -> (Eight, u32) {
        let mut squared = [f32x4::ZERO; 2];
        for axis in 0..3 {
            let (step, base) = (f32x4::splat(self.step(axis)), f32x4::splat(self.base[axis] - point[axis]));
            let (low, high) = (self.steps(0, axis), self.steps(1, axis));
            for half in 0..2 {
                let outside = (low[half] * step + base).fast_max(-(high[half] * step + base)) - f32x4::splat(slack);
                let outside = outside.fast_max(f32x4::ZERO);
                squared[half] += outside * outside;
            }
        }
        (squared, (1 << self.count) - 1)
    }

    /// Sets the boxes of the node's children; returns the box around all.
    pub fn fit(&mut self, boxes: &Boxes) -> Bounds {
        let mut whole = Bounds::EMPTY;
        for axis in 0..3 {
            let [low, high] = [0, 1].map(|side| boxes.planes[side][axis]);
            whole.low[axis] = low.iter().copied().fold(f32::INFINITY, |a, b| if b < a { b } else { a });
            whole.high[axis] = high.iter().copied().fold(f32::NEG_INFINITY, |a, b| if b > a { b } else { a });
            self.base[axis] = whole.low[axis];
            // The next power of two: one more than the exponent of a number that is not below the required step.
            let wanted = (whole.high[axis] - whole.low[axis]) * (1.001 / STEPS);
            self.exponents[axis] = (wanted.to_bits() >> 23) as u8 + 1;
            let (base, scale) = (f32x4::splat(self.base[axis]), f32x4::splat(1.0 / self.step(axis)));
            // Casts round down; the one more above also covers the rounding errors. Absent children stay in range too.
            for (planes, side, more) in [(low, 0, 0.0), (high, 1, 1.0)] {
                let steps = |half: usize| {
                    let four: [f32; 4] = std::array::from_fn(|i| planes[4 * half + i]);
                    let steps = (f32x4::new(four) - base) * scale + f32x4::splat(more);
                    cast::<i32x4, u32x4>(steps.fast_max(f32x4::ZERO).fast_min(f32x4::splat(STEPS)).fast_trunc_int())
                };
                let words: u32x4 = steps(0) | (steps(1) << 16_i32);
                self.planes[side][axis] = words.to_array();
            }
        }
        whole
    }

    /// Reads a word from each half of the node.
    #[inline(always)]
    pub fn touch(&self) -> u32 {
        self.planes[0][0][0] ^ self.first_packet
    }
}
