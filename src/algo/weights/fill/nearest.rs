//! The nearest few of a set of points: a balanced k-d tree that no distribution of points can unbalance.

use glam::Vec3;

/// Points at most in a leaf.
const LEAF: usize = 16;

/// A k-d tree over points, implicit in their order: the middle of each range splits it.
pub(crate) struct Nearest {
    points: Vec<Vec3>,
    order: Vec<u32>,
}

impl Nearest {
    /// Builds the tree over finite points; `O(n log n)`.
    pub(crate) fn new(points: &[Vec3]) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut ranges = vec![(0, order.len(), 0)];
        while let Some((start, end, axis)) = ranges.pop() {
            if end - start > LEAF {
                let middle = (start + end) / 2;
                order[start..end].select_nth_unstable_by(middle - start, |&a, &b| {
                    points[a as usize][axis].total_cmp(&points[b as usize][axis]).then(a.cmp(&b))
                });
                ranges.push((start, middle, (axis + 1) % 3));
                ranges.push((middle + 1, end, (axis + 1) % 3));
            }
        }
        Self { points: order.iter().map(|&i| points[i as usize]).collect(), order }
    }

    /// Up to `count` points within `reach` of a place, nearest first, as index and distance.
    pub(crate) fn nearest(&self, place: Vec3, count: usize, reach: f32) -> impl Iterator<Item = (u32, f32)> + use<> {
        let mut best: Vec<(f32, u32)> = Vec::with_capacity(count + 1);
        let mut limit = reach * reach;
        let mut ranges = vec![(0, self.order.len(), 0, 0.0f32)];
        while let Some((start, end, axis, gap)) = ranges.pop() {
            if gap * gap > limit || count == 0 {
                continue;
            }
            let mut look = |at: usize| {
                let far = self.points[at].distance_squared(place);
                if far <= limit {
                    let entry = (far, self.order[at]);
                    let slot = best.partition_point(|b| (b.0, b.1) < entry);
                    best.insert(slot, entry);
                    best.truncate(count);
                    if best.len() == count {
                        limit = best[count - 1].0;
                    }
                }
            };
            if end - start <= LEAF {
                (start..end).for_each(look);
                continue;
            }
            let middle = (start + end) / 2;
            look(middle);
            let side = place[axis] - self.points[middle][axis];
            let next = (axis + 1) % 3;
            let (low, high) = ((start, middle, next), (middle + 1, end, next));
            let (near, far) = if side < 0.0 { (low, high) } else { (high, low) };
            ranges.push((far.0, far.1, far.2, side.abs()));
            ranges.push((near.0, near.1, near.2, 0.0));
        }
        best.into_iter().map(|(far, index)| (index, far.sqrt()))
    }
}
