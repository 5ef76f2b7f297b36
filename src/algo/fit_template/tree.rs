//! Trees: the branches of a volume as seen from one centre, with their centre lines.

use super::{
    branches::{self, Branches, Centre, Detail},
    limbs::{LimbKind, TemplateLimbs},
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
    centre: Centre,
    role: TreeRole,
}

/// Figures that a tree is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TreeRole {
    /// All figures.
    Usual,
    /// Figures that carry something on one side, which the tree is without. The legs of an animal that walks are no load.
    Carrier,
    /// Animals on all fours whose legs are short for their trunk.
    ShortLegs,
}

impl Tree {
    fn new(graph: &VoxelGraph, centre: Centre, role: TreeRole) -> Self {
        let detail = if role == TreeRole::ShortLegs { Detail::ShortLimbs } else { Detail::Limbs };
        let branches = branches::branches(graph, centre.node, detail);
        let lines = (0..branches.arcs.len()).map(|arc| CentreLine::new(graph, &branches, arc)).collect();
        let has_forks = !branches.bearers.is_empty();
        let roots = branches.arcs.iter().filter(|arc| arc.parent.is_none());
        let depths = roots.flat_map(|arc| arc.slices.iter().map(|s| s.depth));
        let trunk_thickness = depths.fold(1.0, f32::max);
        Self { branches, lines, has_forks, trunk_thickness, centre, role }
    }

    /// True if a template is tried with it.
    pub(super) fn suits(&self, template: &TemplateLimbs) -> bool {
        match self.role {
            TreeRole::Usual => is_lying(template) || self.centre.is_upright,
            TreeRole::Carrier => !template.is_on_fours() && (is_lying(template) || self.centre.is_upright),
            TreeRole::ShortLegs => template.is_on_fours(),
        }
    }

    /// True if it is tried only where others show no figure.
    pub(super) fn is_last_resort(&self) -> bool {
        self.role == TreeRole::ShortLegs
    }

    /// True if most figures of a template have their trunk there.
    pub(super) fn is_usual(&self, template: &TemplateLimbs) -> bool {
        !is_lying(template) || self.centre.is_lying
    }
}

fn is_lying(template: &TemplateLimbs) -> bool {
    !template.is_upright() && template.count(LimbKind::Leg) > 0
}

/// The trees of a volume, one for each place that may be its centre.
pub(super) fn trees(graph: &VoxelGraph, role: TreeRole) -> Vec<Tree> {
    branches::centres(graph).into_iter().map(|centre| Tree::new(graph, centre, role)).collect()
}

/// The trees for animals with short legs, with the centres that others of the same volume have.
pub(super) fn of_short_legs(graph: &VoxelGraph, trees: &[Tree]) -> Vec<Tree> {
    let usual = trees.iter().filter(|tree| tree.role == TreeRole::Usual && tree.centre.is_lying);
    usual.map(|tree| Tree::new(graph, tree.centre, TreeRole::ShortLegs)).collect()
}
