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

/// Triangles edge-on that a ray may meet without a crossing: it runs along a flat surface.
const MOST_EDGE_ON: u32 = 32;

/// Answer of [`Tree::crosses`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sightline {
    /// A triangle is crossed.
    Crossed,
    /// No triangle is crossed.
    Clear,
    /// No triangle was crossed among as many as the ray may meet edge-on: it runs along a flat surface.
    EdgeOn,
    /// No triangle was crossed in as many leaves as the ray may meet.
    Crowded,
}

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

    /// Looks for a triangle that is crossed at a distance between `from` and `to`, in `most` leaves at most. The leaves that the
    /// ray meets are added to `leaves`.
    pub fn crosses(
        &self,
        (frame, boxes): (&Frame, &BoxRay),
        (from, to): (f32, f32),
        most: usize,
        leaves: &mut usize,
    ) -> Sightline {
        let between = |crossing: &Crossing| (f64::from(from)..f64::from(to)).contains(&crossing.distance);
        let mut waiting = ChildStack::new(self);
        let most = *leaves + most;
        let mut edge_on = 0;
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
                    edge_on += self.test(index, two, frame, |crossing| found |= between(&crossing));
                    *leaves += 1;
                    if found {
                        return Sightline::Crossed;
                    }
                    if edge_on >= MOST_EDGE_ON {
                        return Sightline::EdgeOn;
                    }
                    if *leaves == most {
                        return Sightline::Crowded;
                    }
                }
            }
        }
        Sightline::Clear
    }

    /// Collects every crossing, in no order; false as soon as the ray has met more than `most` leaves.
    pub fn all(&self, frame: &Frame, boxes: &BoxRay, most: usize, out: &mut Vec<Crossing>) -> bool {
        let mut waiting = ChildStack::new(self);
        let mut touched = 0;
        let mut leaves = 0;
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
                Target::Leaf(index, two) => {
                    if leaves == most {
                        return false;
                    }
                    leaves += 1;
                    self.test(index, two, frame, |crossing| out.push(crossing));
                }
            }
        }
        black_box(touched);
        true
    }

    /// Calls `found` for each triangle of a leaf that the ray crosses; returns the number of those that it meets edge-on.
    #[inline(always)]
    fn test(&self, index: usize, two: bool, frame: &Frame, mut found: impl FnMut(Crossing)) -> u32 {
        let mut edge_on = 0;
        for index in index..=index + usize::from(two) {
            let packet = &self.packets[index];
            for lane in bits(packet.candidates(frame)) {
                let corners = packet.corners(lane);
                match frame.cross(corners) {
                    Some((distance, entering, tolerance)) => {
                        let (triangle, slot) = (packet.triangle(lane), (index * LANES + lane) as u32);
                        found(Crossing { distance, triangle, slot, entering, tolerance });
                    }
                    None => edge_on += u32::from(frame.is_edge_on(corners)),
                }
            }
        }
        edge_on
    }

    /// The triangle in a slot of [`Crossing`] and its corners.
    pub fn slot(&self, slot: u32) -> (u32, [Vec3; 3]) {
        let (packet, lane) = (&self.packets[slot as usize / LANES], slot as usize % LANES);
        (packet.triangle(lane), packet.corners(lane))
    }

    /// The point of the surface nearest to `point` in the first `most` leaves that may have it, nearer ones first: squared
    /// distance, slot and barycentric coordinates. The second value is the number of leaves that were looked at.
    pub fn nearest_point(&self, point: Vec3, most: usize) -> (Option<(f32, u32, Vec3)>, usize) {
        let mut leaves = 0;
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
                Target::Leaf(..) if leaves >= most => break,
                Target::Leaf(index, two) => {
                    leaves += 1;
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
        (best.map(|(distance, _, slot, weights)| (distance, slot, weights)), leaves)
    }
}
