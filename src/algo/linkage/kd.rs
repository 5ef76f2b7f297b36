//! An order in which neighbours in space are mostly neighbours in the list.

use rayon::join;

/// A place and its owner.
#[derive(Clone, Copy)]
pub(crate) struct Site {
    pub(crate) at: [f32; 3],
    pub(crate) index: u32,
}

/// Number of sites in a leaf, whose order does not matter.
const LEAF: usize = 8;
/// Largest number of sites sorted on one thread.
const ALONE: usize = 2048;

/// Orders sites so that each aligned block of 8, 16, 32... is compact: it comes from splits across the longest side.
pub(crate) fn order(sites: &mut [Site]) {
    if sites.len() <= LEAF {
        return;
    }
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for site in sites.iter() {
        for axis in 0..3 {
            low[axis] = low[axis].min(site.at[axis]);
            high[axis] = high[axis].max(site.at[axis]);
        }
    }
    let side = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
    let axis = if side[0] >= side[1] && side[0] >= side[2] { 0 } else { if side[1] >= side[2] { 1 } else { 2 } };
    // Blocks stay aligned where the left half is a power of two.
    let half = sites.len().next_power_of_two() / 2;
    sites.select_nth_unstable_by(half, |a, b| a.at[axis].total_cmp(&b.at[axis]).then(a.index.cmp(&b.index)));
    let (left, right) = sites.split_at_mut(half);
    if left.len() > ALONE {
        join(|| order(left), || order(right));
    } else {
        order(left);
        order(right);
    }
}
