//! Assignment: which branch of the mesh is which limb of the template.
//!
//! A penalty search over branches (the idea of Baran and Popović 2007): ways between the ends of limbs, measured along
//! the skeleton and through the volume, do not change with the pose, so they choose the branches; then the rest pose
//! chooses sides and the front. The best few assignments are kept as hypotheses.

mod front;
mod shapes;

use glam::{Quat, Vec3};

use super::{
    align::{self, Similarity},
    chain, level,
    limbs::{Limb, LimbKind, TemplateLimbs},
    tree::Tree,
    volume::VoxelGraph,
};

/// Most extremities of a mesh that are considered.
const MOST_LEAVES: usize = 10;
/// Most branches that bear others (ears, a staff) and are considered as one branch.
const MOST_BEARERS: usize = 5;
/// Assignments of branches that are tried with all sides.
const TRIED: usize = 100;
/// Assignments that are tried for a template without sides.
const TRIED_FREE: usize = 2_000;
/// Hypotheses that are kept.
pub(super) const KEPT: usize = 6;
/// Largest deviation (of a logarithm) of a way from the template's that counts.
const MOST_SPREAD: f32 = 0.6;
/// Share of a deviation that counts for the tail of an animal on all fours, which is as long as it likes.
const TAIL: f32 = 0.2;
/// Penalty of a limb that has no branch.
const MISSING: f32 = 0.25;
/// Penalties of a missing head, which hardly any figure lacks, and of a missing tail.
const MISSING_HEAD: f32 = 0.4;
const MISSING_TAIL: f32 = 0.1;
/// Penalty of a missing limb in a template without sides.
const MISSING_FREE: f32 = 0.5;
/// Penalty of a branch that has no limb, for a branch as long as the body's reach.
const UNUSED: f32 = 0.12;
/// Share of that penalty for an ear of a head, and the length, as a factor of the head's, from which on it is none.
const EAR: f32 = 0.2;
const NO_EAR: f32 = 1.5;
/// Penalty of a centre of the branches beyond the trunk, for a way to it as long as the body's reach.
const BEYOND: f32 = 1.0;

/// Weight of what remains of the alignment for a template without sides, whose limbs differ by their place alone.
const RIGID: f32 = 6.0;
/// Weight of that alignment for a template with sides, whose limbs may be posed: it tells front legs from hind legs where the ways
/// between them are much alike.
const SIDED: f32 = 1.2;
/// Weight of that alignment in the confidence in a figure, which may be posed.
pub(super) const POSED: f32 = 0.8;
/// Penalty of a centre of branches other than the middle of the volume, for animals.
const OTHER_CENTRE: f32 = 0.1;
/// Penalty of an up direction far from all axes of the file, and of one that is not usual.
const ODD_UP: f32 = 0.12;
const UNUSUAL_UP: f32 = 0.06;
/// Penalty of a left direction across the mesh's plane of symmetry, and of ends that are not mirror images.
const ACROSS: f32 = 0.3;
const NO_IMAGE: f32 = 1.0;

/// An assignment of branches to limbs with the alignment that follows from it.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    /// The tree of branches that the leaves belong to.
    pub(super) tree: usize,
    /// The leaf (an arc of the branches) of each limb of the template.
    pub(super) leaves: Vec<Option<usize>>,
    pub(super) alignment: Similarity,
    /// Turn of a bird's trunk and legs, where tail and neck tell it.
    pub(super) trunk: Option<Quat>,
    /// A point and the normal of the mesh's plane of symmetry, where it lies between left and right of the figure.
    pub(super) middle: Option<(Vec3, Vec3)>,
    /// Pairs of template positions and places on centre lines that the alignment was made from.
    pub(super) pairs: Vec<(Vec3, Vec3, f32)>,
    /// Penalty; smaller is better.
    pub(super) cost: f32,
    /// Residual of the alignment, root mean square as a share of the mesh's longest side.
    pub(super) rest: f32,
    /// Weight with which the penalty holds it.
    pub(super) weight: f32,
}

impl Hypothesis {
    /// The penalty in which what remains of the alignment counts as it does for a posed figure.
    pub(super) fn posed_cost(&self) -> f32 {
        self.cost - (self.weight - POSED) * self.rest
    }
}

/// Directions that a person has chosen, in unit space.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Directions {
    pub(super) up: Option<Vec3>,
    pub(super) forward: Option<Vec3>,
    /// The axes of the file, of which the second and third are usual for up.
    pub(super) file_axes: [Vec3; 3],
    /// A point and the normal of the mesh's plane of symmetry.
    pub(super) mirror: Option<(Vec3, Vec3)>,
    /// Place that the skeleton hangs on.
    pub(super) root: Option<Vec3>,
}

/// A place, in unit space, at which a person has put a joint of a limb.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LimbMarker {
    pub(super) limb: usize,
    pub(super) place: Vec3,
}

/// Finds the hypotheses, best first.
pub(super) fn assign(
    graph: &VoxelGraph,
    trees: &[Tree],
    template: &TemplateLimbs,
    directions: &Directions,
    markers: &[LimbMarker],
    is_tried: &dyn Fn(&Tree) -> bool,
) -> Vec<Hypothesis> {
    let of_tree = |(number, tree): (usize, &Tree)| {
        let branches = &tree.branches;
        let mut leaves: Vec<usize> = branches.leaves.iter().copied().take(MOST_LEAVES).collect();
        leaves.extend(branches.bearers.iter().copied().take(MOST_BEARERS));
        let ways: Vec<Vec<f32>> = leaves
            .iter()
            .map(|&a| leaves.iter().map(|&b| graph.length(branches.way(a, b)) + 2.0 * graph.cell).collect())
            .collect();
        let search = Search { number, graph, tree, template, directions, markers, leaves: &leaves, ways: &ways };
        let mut found = search.unordered();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        // Without sides, ways are much alike and the alignment has to decide.
        let free = template.limbs.iter().all(|l| l.kind == LimbKind::Free);
        found.truncate(if free { TRIED_FREE } else { TRIED });
        found.iter().flat_map(|(cost, chosen)| search.sided(*cost, chosen)).collect::<Vec<Hypothesis>>()
    };
    let mut hypotheses: Vec<Hypothesis> =
        trees.iter().enumerate().filter(|(_, tree)| is_tried(tree) && tree.suits(template)).flat_map(of_tree).collect();
    let rank = |h: &Hypothesis| h.cost + if trees[h.tree].is_usual(template) { 0.0 } else { OTHER_CENTRE };
    hypotheses.sort_by(|a, b| {
        rank(a).total_cmp(&rank(b)).then_with(|| a.tree.cmp(&b.tree)).then_with(|| a.leaves.cmp(&b.leaves))
    });
    // Two centres may give the same assignment.
    let end = |h: &Hypothesis, limb: usize| h.leaves[limb].map(|l| trees[h.tree].lines[l].at(0.0));
    let same = |a: &Hypothesis, b: &Hypothesis| {
        (0..a.leaves.len()).all(|limb| match (end(a, limb), end(b, limb)) {
            (Some(p), Some(q)) => p.distance(q) < 8.0 * graph.cell,
            (None, None) => true,
            _ => false,
        })
    };
    let mut kept: Vec<Hypothesis> = Vec::new();
    for hypothesis in hypotheses {
        if kept.len() < KEPT && !kept.iter().any(|k| same(k, &hypothesis)) {
            kept.push(hypothesis);
        }
    }
    for hypothesis in &mut kept {
        level::stand(template, &trees[hypothesis.tree], hypothesis, directions);
    }
    kept
}

/// Penalty of an up direction that few files with these axes have.
pub(super) fn unusual_up(up: Vec3, axes: [Vec3; 3]) -> f32 {
    let [_, y, z] = axes.map(|usual| (1.0 - up.dot(usual)).min(1.0));
    let near = axes.iter().map(|a| a.dot(up).abs()).fold(0.0, f32::max);
    UNUSUAL_UP * y.min(z + 0.25) + ODD_UP * (1.0 - near)
}

struct Search<'a> {
    number: usize,
    graph: &'a VoxelGraph,
    tree: &'a Tree,
    template: &'a TemplateLimbs,
    directions: &'a Directions,
    markers: &'a [LimbMarker],
    leaves: &'a [usize],
    ways: &'a [Vec<f32>],
}

/// Number of a leaf in the search's list, for each limb.
type Assignment = Vec<Option<usize>>;

impl Search<'_> {
    /// Assignments without regard to sides: a pair's limbs take two leaves in rising order.
    fn unordered(&self) -> Vec<(f32, Assignment)> {
        let limbs = &self.template.limbs;
        let mut partial: Vec<Assignment> = vec![vec![None; limbs.len()]];
        for (index, limb) in limbs.iter().enumerate() {
            if limb.partner.is_some_and(|p| p < index) {
                continue;
            }
            let mut next = Vec::new();
            for chosen in &partial {
                let branches = &self.tree.branches;
                let free = |leaf: usize| {
                    let apart = |c: usize| !branches.on_one_way(self.leaves[c], self.leaves[leaf]);
                    chosen.iter().flatten().all(|&c| apart(c))
                };
                let bears = |leaf: usize| !branches.arcs[self.leaves[leaf]].children.is_empty();
                match limb.partner {
                    Some(partner) => {
                        for a in 0..self.leaves.len() {
                            for b in a + 1..self.leaves.len() {
                                if free(a) && free(b) && (limb.kind == LimbKind::Arm || !(bears(a) || bears(b))) {
                                    let mut chosen = chosen.clone();
                                    (chosen[index], chosen[partner]) = (Some(a), Some(b));
                                    next.push(chosen);
                                }
                            }
                        }
                        if limb.kind != LimbKind::Leg {
                            next.push(chosen.clone());
                        }
                    }
                    None => {
                        for a in 0..self.leaves.len() {
                            if free(a) && (limb.kind == LimbKind::Head || !bears(a)) {
                                let mut chosen = chosen.clone();
                                chosen[index] = Some(a);
                                next.push(chosen);
                            }
                        }
                        next.push(chosen.clone());
                    }
                }
            }
            // Wide searches keep what is best so far.
            if next.len() > 20_000 {
                let mut ranked: Vec<(f32, Assignment)> = next.into_iter().map(|c| (self.cost(&c), c)).collect();
                ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
                ranked.truncate(3_000);
                next = ranked.into_iter().map(|r| r.1).collect();
            }
            partial = next;
        }
        partial.into_iter().map(|c| (self.cost(&c), c)).collect()
    }

    /// The penalty of ways, pairs, and limbs and branches that are left over.
    fn cost(&self, chosen: &Assignment) -> f32 {
        let limbs = &self.template.limbs;
        let mut logs = Vec::new();
        let mut of_tails = Vec::new();
        for a in 0..limbs.len() {
            for b in a + 1..limbs.len() {
                if let (Some(la), Some(lb)) = (chosen[a], chosen[b])
                    && !limbs[a].stem
                    && !limbs[b].stem
                {
                    let (mesh, template) = (self.ways[la][lb], self.template.way(a, b));
                    let is_of_tail = self.has_free_length(&limbs[a]) || self.has_free_length(&limbs[b]);
                    let logs = if is_of_tail { &mut of_tails } else { &mut logs };
                    logs.push(bevy::math::ops::ln(mesh.max(1e-4) / template.max(1e-4)));
                }
            }
        }
        // Deviations from the median, cut off, so that one short pair of legs does not rule an assignment out.
        logs.sort_by(f32::total_cmp);
        let median = logs.get(logs.len() / 2).copied().unwrap_or(0.0);
        let spread_of = |logs: &[f32]| logs.iter().map(|l| (l - median).abs().min(MOST_SPREAD)).sum::<f32>();
        let spread = spread_of(&logs) + TAIL * spread_of(&of_tails);
        let count = (logs.len() + of_tails.len()).max(1);
        let free = limbs.iter().all(|l| l.kind == LimbKind::Free);
        let mut cost = if free { 0.2 } else { 1.0 } * spread / count as f32;
        for (a, limb) in limbs.iter().enumerate() {
            let Some(leaf) = chosen[a] else {
                cost += match limb.kind {
                    LimbKind::Free => MISSING_FREE,
                    LimbKind::Head => MISSING_HEAD,
                    LimbKind::Tail => MISSING_TAIL,
                    _ => MISSING,
                };
                continue;
            };
            if let Some(b) = limb.partner.filter(|&b| b > a)
                && let Some(other) = chosen[b]
            {
                cost += self.unlikeness(leaf, other);
            }
        }
        for (number, &leaf) in self.leaves.iter().enumerate() {
            let arc = &self.tree.branches.arcs[leaf];
            if chosen.contains(&Some(number)) || !arc.children.is_empty() {
                continue;
            }
            // An ear of a head that is taken counts little; what is longer than the head is no ear.
            let bearer = chosen.iter().flatten().find(|&&c| self.tree.branches.on_one_way(self.leaves[c], leaf));
            let share = bearer.map_or(1.0, |&bearer| {
                let length = self.arc_length(leaf) / self.arc_length(self.leaves[bearer]).max(1.0);
                EAR + (1.0 - EAR) * ((length - 1.0) / (NO_EAR - 1.0)).clamp(0.0, 1.0)
            });
            cost += share * UNUSED * self.arc_length(leaf) / self.tree.branches.reach.max(1) as f32;
        }
        cost += BEYOND * self.beyond_trunk(chosen);
        cost + self.unlike_shapes(chosen)
    }

    /// True for the tail of an animal on all fours, whose length tells little.
    fn has_free_length(&self, limb: &Limb) -> bool {
        limb.kind == LimbKind::Tail && self.template.is_on_fours()
    }

    /// Length over which arms and legs run together on their way to the centre of the branches, without the head, as a share of the
    /// body's reach: there the centre lies in a large head, beyond the trunk.
    fn beyond_trunk(&self, chosen: &Assignment) -> f32 {
        let branches = &self.tree.branches;
        let of = |kind: LimbKind| {
            let limbs = self.template.limbs.iter().zip(chosen).filter(move |(limb, _)| limb.kind == kind);
            limbs.filter_map(|(_, leaf)| Some(branches.path(self.leaves[(*leaf)?])))
        };
        let Some(head) = of(LimbKind::Head).next() else { return 0.0 };
        let mut paths = of(LimbKind::Arm).chain(of(LimbKind::Leg));
        let Some(mut shared) = paths.next() else { return 0.0 };
        shared.retain(|arc| !head.contains(arc));
        for path in paths {
            shared.retain(|arc| path.contains(arc));
        }
        shared.into_iter().map(|arc| self.arc_length(arc)).sum::<f32>() / branches.reach.max(1) as f32
    }

    /// Length of an arc, as a cost of steps.
    fn arc_length(&self, leaf: usize) -> f32 {
        let arc = &self.tree.branches.arcs[leaf];
        (arc.far - arc.near) as f32
    }

    /// Difference of two leaves as the two sides of a pair.
    fn unlikeness(&self, a: usize, b: usize) -> f32 {
        let arcs = &self.tree.branches.arcs;
        let (la, lb) = (self.leaves[a], self.leaves[b]);
        let ratio = |a: f32, b: f32| bevy::math::ops::ln(a.max(1e-4) / b.max(1e-4)).abs();
        // The way to every other leaf, from both.
        let others = (0..self.leaves.len()).filter(|&o| o != a && o != b);
        let (mut sum, mut count) = (0.0, 0.0);
        for other in others {
            sum += ratio(self.ways[a][other], self.ways[b][other]);
            count += 1.0;
        }
        let (ta, tb) = (&self.tree.lines[la], &self.tree.lines[lb]);
        let thick = ratio(ta.mean_radius(), tb.mean_radius());
        let apart = if arcs[la].parent == arcs[lb].parent { 0.0 } else { 0.03 };
        0.3 * sum / f32::max(count, 1.0) + 0.08 * thick + apart
    }

    /// Hypotheses of one unordered assignment: all choices of sides.
    fn sided(&self, cost: f32, chosen: &Assignment) -> Vec<Hypothesis> {
        let limbs = &self.template.limbs;
        let pairs: Vec<(usize, usize)> = limbs
            .iter()
            .enumerate()
            .filter_map(|(a, l)| l.partner.filter(|&b| b > a).map(|b| (a, b)))
            .filter(|&(a, b)| chosen[a].is_some() && chosen[b].is_some())
            .collect();
        let mut found = Vec::new();
        for sides in 0..1u32 << pairs.len().min(6) {
            let mut leaves: Vec<Option<usize>> = chosen.iter().map(|c| c.map(|n| self.leaves[n])).collect();
            for (bit, &(a, b)) in pairs.iter().enumerate() {
                if sides >> bit & 1 == 1 {
                    leaves.swap(a, b);
                }
            }
            if let Some(hypothesis) = self.aligned(cost, leaves) {
                found.push(hypothesis);
            }
        }
        found
    }

    /// The ends of limbs and of their branches.
    fn ends(&self, leaves: &[Option<usize>]) -> Vec<(Vec3, Vec3, f32)> {
        let limbs = self.template.limbs.iter().zip(leaves).filter(|(limb, _)| !limb.stem);
        limbs
            .filter_map(|(limb, leaf)| Some((self.template.tip(limb), self.tree.lines[(*leaf)?].at(0.0), 1.0)))
            .collect()
    }

    fn aligned(&self, cost: f32, leaves: Vec<Option<usize>>) -> Option<Hypothesis> {
        let template = self.template;
        // The scale between ways, as for the cost.
        let (mut mesh, mut rest) = (0.0, 0.0);
        for a in 0..leaves.len() {
            for b in a + 1..leaves.len() {
                if let (Some(la), Some(lb)) = (leaves[a], leaves[b])
                    && !template.limbs[a].stem
                    && !template.limbs[b].stem
                {
                    mesh += self.graph.length(self.tree.branches.way(la, lb)) + 2.0 * self.graph.cell;
                    rest += template.way(a, b);
                }
            }
        }
        let mut scale = if rest > 0.0 { mesh / rest } else { 1.0 / template.size };
        if template.limbs.iter().all(|l| l.kind == LimbKind::Free) {
            // Ways between fingers do not lead over the wrist as the template's do; ends alone give the scale.
            scale = align::similarity(&self.ends(&leaves)).map_or(scale, |s| s.0.scale);
        }
        let mut pairs = Vec::new();
        for (limb, leaf) in template.limbs.iter().zip(&leaves) {
            let Some(leaf) = *leaf else { continue };
            let line = &self.tree.lines[leaf];
            let end = limb.joints[limb.joints.len() - 1];
            let way = template.length(limb.attach, end) + limb.beyond;
            let free = if self.tree.has_forks { line.among(&self.tree.branches, &leaves).free } else { line.free };
            // What leaves the trunk of a tail is compared.
            let end_of_way = if self.has_free_length(limb) { (free - way * scale).max(0.0) } else { 0.0 };
            let free = free.min(way * scale);
            for (number, &joint) in limb.joints.iter().enumerate() {
                let along = (template.length(joint, end) + limb.beyond) * scale;
                let last = limb.kind == LimbKind::Free && number + 2 >= limb.joints.len();
                if along <= free * 1.05 || last {
                    let weight = template.length(limb.attach, joint).max(0.02 * template.size);
                    let weight = if limb.stem { 0.1 * weight } else { weight };
                    pairs.push((template.positions[joint], line.at(end_of_way + along), weight));
                }
            }
            pairs.push((template.tip(limb), line.at(end_of_way), way * if limb.stem { 0.05 } else { 0.5 }));
        }
        let centre = self.graph.centres[self.tree.branches.centre as usize];
        let trunk = &template.trunk;
        let middle = trunk.iter().map(|&j| template.positions[j]).sum::<Vec3>() / trunk.len().max(1) as f32;
        if !template.limbs.iter().any(|l| l.stem) {
            pairs.push((middle, centre, 0.1 * template.size));
        }
        let (mut alignment, rest) = align::similarity(&pairs)?;
        let mut cost = cost;
        if chain::is_lone(template) {
            if let Some(leaf) = leaves.first().copied().flatten() {
                cost += chain::penalty(self.tree, self.leaves, leaf, self.directions.root);
            }
            if let Some(level) = chain::level(template, alignment.rotation, self.directions) {
                alignment = alignment.turned(level, &pairs);
            }
        }
        let free = template.limbs.iter().all(|l| l.kind == LimbKind::Free);
        let weight = if free { RIGID } else { SIDED };
        cost += weight * rest;
        let drift = bevy::math::ops::ln(alignment.scale / scale).abs();
        cost += 0.15 * (drift - 0.1).max(0.0);
        let up = alignment.rotation * Vec3::Y;
        let forward = alignment.rotation * Vec3::Z;
        match self.directions.up {
            Some(wanted) => cost += 1.0 - up.dot(wanted),
            None => cost += unusual_up(up, self.directions.file_axes),
        }
        if let Some(wanted) = self.directions.forward {
            cost += 1.0 - forward.dot(wanted);
        }
        if let Some((point, normal)) = self.directions.mirror {
            cost += ACROSS * (1.0 - (alignment.rotation * Vec3::X).dot(normal).abs());
            let image = |p: Vec3| p - normal * (2.0 * (p - point).dot(normal));
            let (mut sum, mut count) = (0.0, 0.0);
            for (a, limb) in template.limbs.iter().enumerate() {
                // A limb without a partner lies on the plane.
                let b = limb.partner.unwrap_or(a);
                if let (Some(la), Some(lb)) = (leaves[a], leaves[b]) {
                    let end = |leaf: usize| self.tree.lines[leaf].at(0.0);
                    sum += end(la).distance(image(end(lb))).min(0.3);
                    count += 1.0;
                }
            }
            cost += NO_IMAGE * sum / f32::max(count, 1.0);
        }
        if !template.is_upright() {
            cost += self.backwards(&leaves, forward, alignment.scale);
        }
        for marker in self.markers {
            if let Some(leaf) = leaves[marker.limb] {
                let distance = |leaf: usize| self.tree.lines[leaf].distance(marker.place);
                let away = distance(leaf);
                let nearest = self.leaves.iter().map(|&l| distance(l)).fold(f32::INFINITY, f32::min);
                cost += 2.0 * (away - nearest);
            }
        }
        let (tree, trunk, middle) = (self.number, None, None);
        let mut found = Hypothesis { tree, leaves, alignment, trunk, middle, pairs, cost, rest, weight };
        if !template.is_upright() {
            let turn = level::level(template, self.tree, &found, self.directions).unwrap_or(alignment.rotation);
            let up = turn * Vec3::Y;
            found.cost += self.off_ground(&found.leaves, up, alignment.scale);
        }
        Some(found)
    }
}
