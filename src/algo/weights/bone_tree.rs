//! The bones near a point, however many there are.

use glam::Vec3;

use super::bone::BoneSegment;

/// Bones in a leaf of the tree.
const LEAF: usize = 4;

/// Number of bones from which on long ones are cut into pieces, most pieces of a bone, and most of all bones.
const MANY: usize = 64;
const PIECES: usize = 8;
const ALL_PIECES: usize = 1 << 16;

/// Margin around the boxes of pieces, as a share of the largest coordinate: more than their ends are off by rounding.
const MARGIN: f32 = 1e-6;

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
    /// Builds the tree by median splits. O(n log n) for n bones. Of many bones, long ones lie in the tree piece by piece: boxes
    /// around bones that cross the whole body, as those of a star, all overlap.
    pub fn new(bones: &[BoneSegment]) -> Self {
        let (pieces, owners) = pieces(bones);
        if pieces.len() == bones.len() {
            return Self::build(bones, false);
        }
        let mut tree = Self::build(&pieces, false);
        for place in &mut tree.order {
            *place = owners[*place as usize];
        }
        let ends = bones.iter().flat_map(|bone| [bone.head, bone.tail]);
        let margin = Vec3::splat(MARGIN * ends.fold(0.0, |most, end| end.abs().max_element().max(most)));
        for node in &mut tree.nodes {
            (node.low, node.high) = (node.low - margin, node.high + margin);
        }
        tree
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
    pub fn nearest(&self, point: Vec3, band: f32, cost: impl FnMut(u32) -> f32, out: &mut Vec<(f32, u32)>) {
        self.cheapest(point, band, cost, |distance| distance, out);
    }

    /// The bones as [`nearest`](Self::nearest) finds them, where `least` says the least cost of a bone at a distance, which does
    /// not fall with the distance.
    pub fn cheapest(
        &self,
        point: Vec3,
        band: f32,
        mut cost: impl FnMut(u32) -> f32,
        least: impl Fn(f32) -> f32,
        out: &mut Vec<(f32, u32)>,
    ) {
        out.clear();
        let mut best = f32::INFINITY;
        // Median splits of at most 2^32 bones are never deeper.
        let mut stack = [0u32; 64];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let index = stack[waiting];
            let node = &self.nodes[index as usize];
            if least(distance_to_box(point, node)) > best * (1.0 + band) {
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
        keep_cheapest(out, best, band);
    }
}

/// Leaves what costs at most `1 + band` times the least, cheapest first, and each bone once.
pub(super) fn keep_cheapest(list: &mut Vec<(f32, u32)>, best: f32, band: f32) {
    list.retain(|e| e.0 <= best * (1.0 + band));
    list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // Pieces of a bone are next to each other, because they have its cost.
    list.dedup_by_key(|e| e.1);
}

impl BoneTree {
    /// Calls `meet` for each bone of the nodes whose boxes are at most `radius` away from a point, until it returns `true`.
    /// Returns whether it did. A bone that lies in the tree piece by piece is met once for each piece.
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

/// Pieces of bones, with the bone of each: bones that are longer than the spacing of as many bones in the space around them are
/// cut to it.
fn pieces(bones: &[BoneSegment]) -> (Vec<BoneSegment>, Vec<u32>) {
    let most = (ALL_PIECES / bones.len().max(1)).min(PIECES);
    if bones.len() < MANY || most < 2 {
        return (bones.to_vec(), Vec::new());
    }
    let ends = || bones.iter().flat_map(|bone| [bone.head, bone.tail]);
    let extent = ends().fold(Vec3::NEG_INFINITY, Vec3::max) - ends().fold(Vec3::INFINITY, Vec3::min);
    let side = (1..).find(|side: &usize| side.pow(3) >= bones.len()).unwrap_or(1);
    let longest = extent.max_element() / side as f32;
    let (mut list, mut owners) = (Vec::with_capacity(bones.len()), Vec::with_capacity(bones.len()));
    for (number, bone) in bones.iter().enumerate() {
        let along = bone.tail - bone.head;
        let count = ((along.length() / longest).ceil() as usize).clamp(1, most);
        let place = |piece: usize| bone.head + along * (piece as f32 / count as f32);
        for piece in 0..count {
            let tail = if piece + 1 == count { bone.tail } else { place(piece + 1) };
            list.push(BoneSegment { joint: bone.joint, head: place(piece), tail });
            owners.push(number as u32);
        }
    }
    (list, owners)
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
