//! A hierarchy of boxes over the means of clusters, eight to a node, without pointers: node `i` of a level covers nodes 8i to
//! 8i + 7 of the level below.

use wide::{CmpLe, f32x8};

/// Eight means in single precision, with the variances of their clusters. A lane without a cluster is at infinity.
#[derive(Clone, Copy)]
pub(super) struct Leaf {
    pub(super) x: f32x8,
    pub(super) y: f32x8,
    pub(super) z: f32x8,
    pub(super) variance: f32x8,
}

/// Eight boxes. A lane without a box has inverted bounds at infinity.
#[derive(Clone, Copy)]
struct Node {
    low: [f32x8; 3],
    high: [f32x8; 3],
}

const EMPTY_LEAF: Leaf = Leaf {
    x: f32x8::new([f32::INFINITY; 8]),
    y: f32x8::new([f32::INFINITY; 8]),
    z: f32x8::new([f32::INFINITY; 8]),
    variance: f32x8::new([0.0; 8]),
};
const EMPTY_NODE: Node =
    Node { low: [f32x8::new([f32::INFINITY; 8]); 3], high: [f32x8::new([f32::NEG_INFINITY; 8]); 3] };

/// The hierarchy.
#[derive(Default)]
pub(super) struct Boxes {
    leaves: Vec<Leaf>,
    /// Boxes of leaves first, the root (one node) last.
    levels: Vec<Vec<Node>>,
}

impl Boxes {
    /// Builds the hierarchy over means and variances, ordered so that neighbours are near.
    pub(super) fn build(&mut self, means: impl ExactSizeIterator<Item = ([f32; 3], f32)>) {
        self.leaves.clear();
        self.leaves.resize(means.len().div_ceil(8), EMPTY_LEAF);
        for (at, (mean, variance)) in means.enumerate() {
            self.leaves[at / 8].put(at % 8, mean, variance);
        }
        let mut below: Vec<([f32; 3], [f32; 3])> = self.leaves.iter().map(Leaf::bounds).collect();
        self.levels.clear();
        loop {
            let mut level = vec![EMPTY_NODE; below.len().div_ceil(8)];
            for (at, &(low, high)) in below.iter().enumerate() {
                level[at / 8].put(at % 8, low, high);
            }
            below = level.iter().map(Node::bounds).collect();
            let done = level.len() <= 1;
            self.levels.push(level);
            if done {
                break;
            }
        }
    }

    pub(super) fn leaf(&self, leaf: usize) -> &Leaf {
        &self.leaves[leaf]
    }

    /// Removes a mean. Boxes are not shrunk.
    pub(super) fn remove(&mut self, slot: usize) {
        self.leaves[slot / 8].put(slot % 8, [f32::INFINITY; 3], 0.0);
    }

    /// Moves a mean; the boxes above it grow to hold it.
    pub(super) fn put(&mut self, slot: usize, mean: [f32; 3], variance: f32) {
        self.leaves[slot / 8].put(slot % 8, mean, variance);
        let mut at = slot / 8;
        for level in &mut self.levels {
            level[at / 8].grow(at % 8, mean);
            at /= 8;
        }
    }

    /// Calls `visit` with each leaf within a squared distance of `place`; it returns that distance, which may fall on
    /// the way. `stack` is a buffer.
    pub(super) fn near(
        &self,
        place: [f32; 3],
        mut within: f32,
        stack: &mut Vec<(u32, u32, f32)>,
        mut visit: impl FnMut(usize) -> f32,
    ) {
        let query = place.map(f32x8::splat);
        stack.clear();
        stack.push((self.levels.len() as u32, 0, 0.0));
        while let Some((level, at, distance)) = stack.pop() {
            if distance > within {
                continue;
            }
            if level == 0 {
                within = visit(at as usize);
                continue;
            }
            let node = &self.levels[level as usize - 1][at as usize];
            let mut square = f32x8::ZERO;
            for ((low, high), query) in node.low.iter().zip(&node.high).zip(query) {
                let out = (*low - query).fast_max(query - *high).fast_max(f32x8::ZERO);
                square += out * out;
            }
            let mut mask = square.cmp_le(f32x8::splat(within)).move_mask() as u32;
            let square = square.to_array();
            while mask != 0 {
                let lane = mask.trailing_zeros();
                mask &= mask - 1;
                stack.push((level - 1, at * 8 + lane, square[lane as usize]));
            }
        }
    }
}

impl Leaf {
    fn put(&mut self, lane: usize, mean: [f32; 3], variance: f32) {
        self.x.as_array_mut()[lane] = mean[0];
        self.y.as_array_mut()[lane] = mean[1];
        self.z.as_array_mut()[lane] = mean[2];
        self.variance.as_array_mut()[lane] = variance;
    }

    fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for (axis, values) in [self.x, self.y, self.z].into_iter().enumerate() {
            for value in values.to_array().into_iter().filter(|value| value.is_finite()) {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        (low, high)
    }
}

impl Node {
    fn put(&mut self, lane: usize, low: [f32; 3], high: [f32; 3]) {
        for axis in 0..3 {
            self.low[axis].as_array_mut()[lane] = low[axis];
            self.high[axis].as_array_mut()[lane] = high[axis];
        }
    }

    fn grow(&mut self, lane: usize, place: [f32; 3]) {
        for ((low, high), place) in self.low.iter_mut().zip(&mut self.high).zip(place) {
            let low = &mut low.as_array_mut()[lane];
            *low = low.min(place);
            let high = &mut high.as_array_mut()[lane];
            *high = high.max(place);
        }
    }

    fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for axis in 0..3 {
            low[axis] = self.low[axis].to_array().into_iter().fold(f32::INFINITY, f32::min);
            high[axis] = self.high[axis].to_array().into_iter().fold(f32::NEG_INFINITY, f32::max);
        }
        (low, high)
    }
}
