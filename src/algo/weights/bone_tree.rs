//! The bones near a point, however many there are.

use glam::Vec3;

use super::bone::BoneSegment;

/// Bones in a leaf of the tree.
const LEAF: usize = 4;

/// A bounding volume hierarchy over bones.
#[derive(Debug, Clone, Default)]
pub(crate) struct BoneTree {
    /// The root first; a node's left child follows it.
    nodes: Vec<Node>,
    /// Bones in the order of the leaves.
    order: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3,
    high: Vec3,
    /// A leaf's bones are `order[first..first + count]`; an inner node's right child is `first`, and `count` is zero.
    first: u32,
    count: u32,
}

impl BoneTree {
    /// Builds the tree by median splits. O(n log n) for n bones.
    pub fn new(bones: &[BoneSegment]) -> Self {
        Self::build(bones, false)
    }

    /// Tree over boxes, of which each "bone" is a diagonal. Flat boxes over each other are split across, however they lie.
    pub fn of_boxes(diagonals: &[BoneSegment]) -> Self {
        Self::build(diagonals, true)
    }

    fn build(bones: &[BoneSegment], are_boxes: bool) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..bones.len() as u32).collect() };
        if !bones.is_empty() {
            tree.split(bones, 0, bones.len(), are_boxes);
        }
        tree
    }

    fn split(&mut self, bones: &[BoneSegment], from: usize, to: usize, are_boxes: bool) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (mut low_middle, mut high_middle, mut extent) = (low, high, Vec3::ZERO);
        for &bone in &self.order[from..to] {
            let BoneSegment { head, tail, .. } = bones[bone as usize];
            low = low.min(head).min(tail);
            high = high.max(head).max(tail);
            low_middle = low_middle.min(head + tail);
            high_middle = high_middle.max(head + tail);
            extent += (tail - head).abs();
        }
        let node = self.nodes.len();
        self.nodes.push(Node { low, high, first: from as u32, count: (to - from) as u32 });
        if to - from <= LEAF {
            return;
        }
        let spread = high_middle - low_middle;
        let axis = match are_boxes {
            true => (spread / (extent / (to - from) as f32 + spread * 1e-3 + f32::MIN_POSITIVE)).max_position(),
            false => spread.max_position(),
        };
        let middle = (to - from) / 2;
        let place = |&b: &u32| bones[b as usize].head[axis] + bones[b as usize].tail[axis];
        self.order[from..to].select_nth_unstable_by(middle, |a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
        self.split(bones, from, from + middle, are_boxes);
        self.nodes[node].first = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(bones, from + middle, to, are_boxes);
    }

    /// The bones whose `cost` is at most `1 + band` times the least, cheapest first, as (cost, bone). `out` is
    /// overwritten.
    ///
    /// `cost` of a bone must not be less than its distance; infinity leaves a bone out.
    pub fn nearest(&self, point: Vec3, band: f32, mut cost: impl FnMut(u32) -> f32, out: &mut Vec<(f32, u32)>) {
        out.clear();
        let mut best = f32::INFINITY;
        // Median splits of at most 2^32 bones are never deeper.
        let mut stack = [0u32; 64];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let index = stack[waiting];
            let node = &self.nodes[index as usize];
            if distance_to_box(point, node) > best * (1.0 + band) {
                continue;
            }
            if node.count > 0 {
                for &bone in &self.order[node.first as usize..(node.first + node.count) as usize] {
                    let cost = cost(bone);
                    if cost < f32::INFINITY && cost <= best * (1.0 + band) {
                        best = best.min(cost);
                        out.push((cost, bone));
                    }
                }
                continue;
            }
            let (left, right) = (index + 1, node.first);
            let nearer_left = distance_to_box(point, &self.nodes[left as usize])
                <= distance_to_box(point, &self.nodes[right as usize]);
            let (near, far) = if nearer_left { (left, right) } else { (right, left) };
            stack[waiting] = far;
            stack[waiting + 1] = near;
            waiting += 2;
        }
        out.retain(|e| e.0 <= best * (1.0 + band));
        out.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
}

impl BoneTree {
    /// Calls `meet` for each bone of the nodes whose boxes are at most `radius` away from a point, until it returns `true`.
    /// Returns whether it did.
    pub fn any_within(&self, point: Vec3, radius: f32, mut meet: impl FnMut(u32) -> bool) -> bool {
        let mut stack = [0u32; 64];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let index = stack[waiting];
            let node = &self.nodes[index as usize];
            if distance_to_box(point, node) > radius {
                continue;
            }
            if node.count == 0 {
                stack[waiting] = node.first;
                stack[waiting + 1] = index + 1;
                waiting += 2;
            } else if self.order[node.first as usize..(node.first + node.count) as usize].iter().any(|&bone| meet(bone))
            {
                return true;
            }
        }
        false
    }
}

fn distance_to_box(point: Vec3, node: &Node) -> f32 {
    // A hair less, so that rounding never hides a bone that lies on its box.
    point.distance(point.clamp(node.low, node.high)) * 0.999_99
}

/// The point of the bone that is nearest to `point`.
pub(crate) fn closest_on(segment: &BoneSegment, point: Vec3) -> Vec3 {
    let along = segment.tail - segment.head;
    let length = along.length_squared();
    if length <= 0.0 {
        return segment.head;
    }
    segment.head + along * ((point - segment.head).dot(along) / length).clamp(0.0, 1.0)
}
