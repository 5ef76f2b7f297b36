//! Trees: the branches of a volume as seen from one centre, with their centre lines.

use super::{
    branches::{self, Branches},
    line::CentreLine,
    volume::VoxelGraph,
};

/// Branches and the centre line of each arc.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    pub(super) branches: Branches,
    pub(super) lines: Vec<CentreLine>,
    /// True if some branches bear others, so that a line's free part depends on what else is taken.
    pub(super) has_forks: bool,
    /// Largest depth of the arc with the centre, in cells.
    pub(super) trunk_thickness: f32,
}

/// The trees of a volume, one for each place that may be its centre.
pub(super) fn trees(graph: &VoxelGraph) -> Vec<Tree> {
    branches::centres(graph)
        .into_iter()
        .map(|centre| {
            let branches = branches::branches(graph, centre);
            let lines = (0..branches.arcs.len()).map(|arc| CentreLine::new(graph, &branches, arc)).collect();
            let has_forks = !branches.bearers.is_empty();
            let roots = branches.arcs.iter().filter(|arc| arc.parent.is_none());
            let depths = roots.flat_map(|arc| arc.slices.iter().map(|s| s.depth));
            let trunk_thickness = depths.fold(1.0, f32::max);
            Tree { branches, lines, has_forks, trunk_thickness }
        })
        .collect()
}
