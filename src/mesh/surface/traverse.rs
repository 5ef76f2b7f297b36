//! Queries on the hierarchy.

use std::hint::black_box;

use glam::Vec3;
use wide::f32x4;

use super::closest;
use super::crossing::{Crossing, Frame, SLACK};
use super::node::{BoxRay, Child, Target, WIDTH};
use super::packet::LANES;
use super::tree::{DEPTH, Tree};

/// Largest number of waiting children: seven a level.
const STACK: usize = (WIDTH - 1) * DEPTH + 1;

/// Leaves that a ray may meet without a crossing. A ray through a mesh of a million triangles meets some dozens.
const MOST_LEAVES: usize = 384;

/// Stack of children to visit, the best on top, each with a bound of the distances in it (less is better).
struct ChildStack {
    children: [(f32, Child); STACK],
    len: usize,
}

impl ChildStack {
    fn new(tree: &Tree) -> Self {
        Self { children: [(f32::NEG_INFINITY, Child::ROOT); STACK], len: usize::from(!tree.nodes.is_empty()) }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<(f32, Child)> {
        self.len = self.len.checked_sub(1)?;
        Some(self.children[self.len])
    }

    /// Adds a child; the entries from `start` on are kept in order.
    #[inline(always)]
    fn push(&mut self, start: usize, bound: f32, child: Child) {
        let mut at = self.len;
        while at > start && self.children[at - 1].0 < bound {
            self.children[at] = self.children[at - 1];
            at -= 1;
        }
        self.children[at] = (bound, child);
        self.len += 1;
    }
}

/// The set bits of `mask`.
#[inline(always)]
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(bit)
    })
}

impl Tree {
    /// The nearest crossing.
    pub fn nearest(&self, frame: &Frame, boxes: &BoxRay) -> Option<Crossing> {
        self.extreme::<false>(frame, boxes)
    }

    /// The farthest crossing.
    pub fn farthest(&self, frame: &Frame, boxes: &BoxRay) -> Option<Crossing> {
        self.extreme::<true>(frame, boxes)
    }

    #[inline(always)]
    fn extreme<const FAR: bool>(&self, frame: &Frame, boxes: &BoxRay) -> Option<Crossing> {
        let mut best: Option<Crossing> = None;
        let (mut from, mut to) = (0.0_f32, f32::INFINITY);
        let mut waiting = ChildStack::new(self);
        let mut touched = 0;
        while let Some((bound, child)) = waiting.pop() {
            if if FAR { -bound < from } else { bound > to } {
                continue;
            }
            match child.target() {
                Target::Node(index) => {
                    let node = &self.nodes[index];
                    let (enter, leave, mask) = boxes.meet(node, from, to);
                    let bounds = if FAR { leave.map(|leave| -leave) } else { enter };
                    let bounds = bounds.map(f32x4::to_array);
                    let start = waiting.len;
                    for i in bits(mask) {
                        let child = node.child(i);
                        waiting.push(start, bounds[i / 4][i % 4], child);
                        touched ^= self.touch(child);
                    }
                }
                Target::Leaf(index, two) => {
                    self.test(index, two, frame, |crossing| {
                        let better = best.is_none_or(|best| {
                            if FAR { crossing.key() > best.key() } else { crossing.key() < best.key() }
                        });
                        if better {
                            best = Some(crossing);
                            if FAR {
                                from = (crossing.distance as f32).next_down().max(0.0);
                            } else {
                                to = (crossing.distance as f32).next_up();
                            }
                        }
                    });
                }
            }
        }
        black_box(touched);
        best
    }

    /// Reads a word of the node or packet of a child, so that the processor fetches it from memory while others are
    /// tested.
    #[inline(always)]
    fn touch(&self, child: Child) -> u32 {
        match child.target() {
            Target::Node(index) => self.nodes[index].touch(),
            Target::Leaf(index, _) => self.packets[index].touch(),
        }
    }

    /// True if a triangle is crossed at a distance between `from` and `to`; `None` for a ray that meets [`MOST_LEAVES`]
    /// leaves and crosses none of their triangles, as one that runs along a flat surface.
    pub fn crosses(&self, frame: &Frame, boxes: &BoxRay, from: f32, to: f32) -> Option<bool> {
        let between = |crossing: &Crossing| (f64::from(from)..f64::from(to)).contains(&crossing.distance);
        let mut waiting = ChildStack::new(self);
        let mut leaves = 0;
        while let Some((_, child)) = waiting.pop() {
            match child.target() {
                Target::Node(index) => {
                    let node = &self.nodes[index];
                    let (_, _, mask) = boxes.meet(node, from, to);
                    for i in bits(mask) {
                        waiting.push(waiting.len, 0.0, node.child(i));
                    }
                }
                Target::Leaf(index, two) => {
                    let mut found = false;
                    self.test(index, two, frame, |crossing| found |= between(&crossing));
                    leaves += 1;
                    if found {
                        return Some(true);
                    }
                    if leaves == MOST_LEAVES {
                        return None;
                    }
                }
            }
        }
        Some(false)
    }

    /// Collects every crossing, in no order.
    pub fn all(&self, frame: &Frame, boxes: &BoxRay, out: &mut Vec<Crossing>) {
        let mut waiting = ChildStack::new(self);
        let mut touched = 0;
        while let Some((_, child)) = waiting.pop() {
            match child.target() {
                Target::Node(index) => {
                    let node = &self.nodes[index];
                    let (_, _, mask) = boxes.meet(node, 0.0, f32::INFINITY);
                    for i in bits(mask) {
                        let child = node.child(i);
                        waiting.push(waiting.len, 0.0, child);
                        touched ^= self.touch(child);
                    }
                }
                Target::Leaf(index, two) => self.test(index, two, frame, |crossing| out.push(crossing)),
            }
        }
        black_box(touched);
    }

    /// Calls `found` for each triangle of a leaf that the ray crosses.
    #[inline(always)]
    fn test(&self, index: usize, two: bool, frame: &Frame, mut found: impl FnMut(Crossing)) {
        for index in index..=index + usize::from(two) {
            let packet = &self.packets[index];
            for lane in bits(packet.candidates(frame)) {
                if let Some((distance, entering, tolerance)) = frame.cross(packet.corners(lane)) {
                    let (triangle, slot) = (packet.triangle(lane), (index * LANES + lane) as u32);
                    found(Crossing { distance, triangle, slot, entering, tolerance });
                }
            }
        }
    }

    /// The triangle in a slot of [`Crossing`] and its corners.
    pub fn slot(&self, slot: u32) -> (u32, [Vec3; 3]) {
        let (packet, lane) = (&self.packets[slot as usize / LANES], slot as usize % LANES);
        (packet.triangle(lane), packet.corners(lane))
    }

    /// The point of the surface nearest to `point`: squared distance, slot and barycentric coordinates.
    pub fn nearest_point(&self, point: Vec3) -> Option<(f32, u32, Vec3)> {
        let mut best: Option<(f32, u32, u32, Vec3)> = None;
        let reach = self.bounds.low.abs().max(self.bounds.high.abs()).max(point.abs()).max_element();
        let mut waiting = ChildStack::new(self);
        while let Some((bound, child)) = waiting.pop() {
            if best.is_some_and(|best| bound > best.0) {
                continue;
            }
            match child.target() {
                Target::Node(index) => {
                    let node = &self.nodes[index];
                    let (bounds, mask) = node.distances(point, SLACK * reach);
                    let bounds = bounds.map(f32x4::to_array);
                    let start = waiting.len;
                    for i in bits(mask) {
                        waiting.push(start, bounds[i / 4][i % 4], node.child(i));
                    }
                }
                Target::Leaf(index, two) => {
                    for index in index..=index + usize::from(two) {
                        let packet = &self.packets[index];
                        for lane in bits(packet.lanes()) {
                            let (triangle, corners) = (packet.triangle(lane), packet.corners(lane));
                            let weights = closest::barycentric(point, corners);
                            let distance = closest::at(weights, corners).distance_squared(point);
                            if best.is_none_or(|best| (distance, triangle) < (best.0, best.1)) {
                                best = Some((distance, triangle, (index * LANES + lane) as u32, weights));
                            }
                        }
                    }
                }
            }
        }
        best.map(|(distance, _, slot, weights)| (distance, slot, weights))
    }
}
