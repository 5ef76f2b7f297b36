//! Queries on the hierarchy.

use glam::Vec3;

use super::crossing::{Crossing, Frame};
use super::tree::{Bounds, BoxRay, Child, DEPTH, LANES, NONE, Target, Tree, WIDTH};

/// Room for the children that wait: seven a level, and the tree is never deeper than [`super::tree::DEPTH`].
const STACK: usize = (WIDTH - 1) * DEPTH + 1;

impl Tree {
    /// The nearest crossing.
    pub fn nearest(&self, frame: &Frame, boxes: &BoxRay) -> Option<Crossing> {
        self.extreme::<false>(frame, boxes)
    }

    /// The farthest crossing.
    pub fn farthest(&self, frame: &Frame, boxes: &BoxRay) -> Option<Crossing> {
        self.extreme::<true>(frame, boxes)
    }

    fn extreme<const FAR: bool>(&self, frame: &Frame, boxes: &BoxRay) -> Option<Crossing> {
        let mut best: Option<Crossing> = None;
        let (mut from, mut to) = (0.0_f32, f32::INFINITY);
        let mut stack = [(0.0_f32, Child::node(0)); STACK];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let (bound, child) = stack[waiting];
            if if FAR { -bound < from } else { bound > to } {
                continue;
            }
            match child.target() {
                Target::Node(index) => {
                    let node = &self.nodes[index];
                    let (enter, leave, mut mask) = boxes.meet(node, from, to);
                    let bounds = if FAR { -leave } else { enter };
                    let bounds = bounds.as_array_ref();
                    let start = waiting;
                    while mask != 0 {
                        let i = mask.trailing_zeros() as usize;
                        mask &= mask - 1;
                        // Best last, where it is taken first.
                        let mut at = waiting;
                        waiting += 1;
                        while at > start && stack[at - 1].0 < bounds[i] {
                            stack[at] = stack[at - 1];
                            at -= 1;
                        }
                        stack[at] = (bounds[i], node.child(i));
                    }
                }
                Target::Packet(index) => {
                    self.test(index, frame, |crossing| {
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
        best
    }

    /// Every crossing, in no order.
    pub fn all(&self, frame: &Frame, boxes: &BoxRay, out: &mut Vec<Crossing>) {
        let mut stack = [Child::node(0); STACK];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            match stack[waiting].target() {
                Target::Node(index) => {
                    let node = &self.nodes[index];
                    let (_, _, mut mask) = boxes.meet(node, 0.0, f32::INFINITY);
                    while mask != 0 {
                        stack[waiting] = node.child(mask.trailing_zeros() as usize);
                        waiting += 1;
                        mask &= mask - 1;
                    }
                }
                Target::Packet(index) => self.test(index, frame, |crossing| out.push(crossing)),
            }
        }
    }

    /// Calls `found` for each triangle of a packet that the ray crosses.
    #[inline(always)]
    fn test(&self, index: usize, frame: &Frame, mut found: impl FnMut(Crossing)) {
        let packet = &self.packets[index];
        let mut mask = packet.candidates(frame);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let triangle = packet.triangles[lane];
            if triangle == NONE {
                return;
            }
            if let Some((distance, entering, tolerance)) = frame.cross(packet.corners(lane)) {
                found(Crossing { distance, triangle, slot: (index * LANES + lane) as u32, entering, tolerance });
            }
        }
    }

    /// The corners in a slot of [`Crossing`].
    pub fn corners(&self, slot: u32) -> [Vec3; 3] {
        self.packets[slot as usize / LANES].corners(slot as usize % LANES)
    }

    /// The point of the surface nearest to `point`: squared distance, slot and barycentric coordinates.
    pub fn nearest_point(&self, point: Vec3) -> Option<(f32, u32, Vec3)> {
        let mut best: Option<(f32, u32, u32, Vec3)> = None;
        let mut stack = [(0.0_f32, Child::node(0)); STACK];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let (bound, child) = stack[waiting];
            if best.is_some_and(|best| bound > best.0) {
                continue;
            }
            match child.target() {
                Target::Node(index) => {
                    let start = waiting;
                    for (bounds, child) in self.nodes[index].iter() {
                        // Rounding may not hide a box that holds a point at the same distance.
                        let bound = box_distance(&bounds, point) * (1.0 - 1e-6);
                        let mut at = waiting;
                        waiting += 1;
                        while at > start && stack[at - 1].0 < bound {
                            stack[at] = stack[at - 1];
                            at -= 1;
                        }
                        stack[at] = (bound, child);
                    }
                }
                Target::Packet(index) => {
                    let packet = &self.packets[index];
                    for lane in 0..LANES {
                        let triangle = packet.triangles[lane];
                        if triangle == NONE {
                            break;
                        }
                        let corners = packet.corners(lane);
                        let weights = super::closest::barycentric(point, corners);
                        let distance = super::closest::at(weights, corners).distance_squared(point);
                        if best.is_none_or(|best| (distance, triangle) < (best.0, best.1)) {
                            best = Some((distance, triangle, (index * LANES + lane) as u32, weights));
                        }
                    }
                }
            }
        }
        best.map(|(distance, _, slot, weights)| (distance, slot, weights))
    }

    /// The box around everything.
    pub fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, super::tree::Node::bounds)
    }
}

/// Squared distance from a box.
fn box_distance(bounds: &Bounds, point: Vec3) -> f32 {
    (bounds.low - point).max(point - bounds.high).max(Vec3::ZERO).length_squared()
}
