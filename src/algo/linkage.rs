//! Average linkage: hierarchical clustering by the mean distance over all pairs.

/// One merge of two clusters. Points are clusters 0 to n - 1, merge `i` makes cluster n + i.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Merge {
    /// The one cluster.
    pub first: u32,
    /// The other cluster.
    pub second: u32,
    /// Their distance when they were merged.
    pub height: f32,
    /// Points in the merged cluster.
    pub size: u32,
}

/// The whole merge history, by height.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dendrogram {
    /// How many points there are.
    pub points: usize,
    /// The merges, lowest first.
    pub merges: Vec<Merge>,
}
