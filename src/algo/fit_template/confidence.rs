//! Confidence: how far a fit is to be trusted, joint by joint and as a whole.

mod evidence;

use glam::Vec3;

use self::evidence::Evidence;
use super::{
    assign::Hypothesis,
    human::FittedBody,
    limbs::{Limb, LimbKind, TemplateLimbs},
    place::{self, Placement},
    report::FitReason,
    tree::Tree,
    volume::VoxelGraph,
};
use crate::mesh::voxels::Voxels;

/// Distance between body model and surface, as a share of the height, at which trust is one half.
const HALF_TRUST: f32 = 0.026;
/// Penalty of an assignment at which trust is one half.
const HALF_COST: f32 = 0.6;
/// Difference of a limb's length from the template's, as a logarithm, at which trust is one half.
const HALF_STRAIN: f32 = 0.6;

/// Share of a limb's free length from its end from which on the trunk makes its joints uncertain, and the share over which
/// that fades.
const ROOTED: f32 = 0.63;
const FREE: f32 = 0.2;
/// Confidence in the head of an animal, whose length varies most, as a share of that in its legs.
const STEM: f32 = 0.75;
/// Confidence in the joints that a figure's limbs show by themselves, in a figure without doubt.
const SHOWN: f32 = 0.76;
/// Confidence in the spine of an animal between the ends of its trunk, in a figure without doubt.
const BETWEEN: f32 = 0.9;
/// Most confidence in knees and elbows of animals on all fours: they lie in the flesh, and centre lines of legs bend elsewhere.
const HIDDEN_HINGE: f32 = 0.45;

fn trust(value: f32, half: f32) -> f32 {
    let q = value / half;
    1.0 / (1.0 + q * q)
}

/// Confidence of each joint with its reason.
pub(super) fn joints(
    template: &TemplateLimbs,
    placement: &Placement,
    body: Option<(&FittedBody, &[Option<f32>])>,
    best: &Hypothesis,
    voxels: &Voxels,
    graph: &VoxelGraph,
    places: &[Vec3],
) -> Vec<(f32, FitReason)> {
    let inside = |place: Vec3| {
        let reach = 2.0 * graph.cell;
        let around = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        around.iter().any(|&d| {
            let cell = voxels.cell_at(voxels.to_grid(place + d * reach));
            cell.is_some_and(|c| voxels.solid_index(c).is_some())
        })
    };
    let ends = [template.trunk.first(), template.trunk.last()];
    let heads = template.limbs.iter().filter(|limb| template.is_on_fours() && limb.kind == LimbKind::Head);
    let heads: Vec<usize> = heads.flat_map(|limb| limb.joints.iter().copied()).collect();
    // An animal's trunk is placed over its legs and under its back: what lies between its ends, and the neck before them, is right
    // where the assignment is.
    let is_between = |joint: usize| {
        template.is_on_fours()
            && (heads.contains(&joint) || template.trunk.contains(&joint) && !ends.contains(&Some(&joint)))
    };
    let hips: Vec<usize> =
        template.limbs.iter().filter(|limb| template.is_hind_leg(limb)).map(|limb| limb.joints[0]).collect();
    let hidden: Vec<usize> = template.limbs.iter().filter_map(|limb| template.hidden_hinge(limb)).collect();
    let evidence = Evidence::of(template, placement, best, places);
    (0..places.len())
        .map(|joint| {
            let (mut confidence, mut reason) = match body {
                Some((_, near)) => match near[joint] {
                    Some(residual) => (trust(residual, HALF_TRUST), FitReason::Surface),
                    None => (0.8, FitReason::Proportion),
                },
                None => {
                    let doubt = trust(placement.strain[joint], HALF_STRAIN) * trust(best.posed_cost(), HALF_COST);
                    let reason = match placement.reasons[joint] {
                        FitReason::CentreLine if evidence.is_shared_out[joint] => FitReason::Proportion,
                        reason => reason,
                    };
                    let confidence = match reason {
                        FitReason::NoLimb => 0.2 * doubt,
                        // Towards its end a limb is right whatever the rest of the figure is like, unless parts of it stand
                        // apart.
                        FitReason::CentreLine => {
                            let free = ((ROOTED - placement.along[joint]) / FREE).clamp(0.0, 1.0);
                            let free = if graph.tied > 0 { 0.0 } else { free };
                            let own = if heads.contains(&joint) { STEM } else { 1.0 };
                            own * (0.76 + 0.19 * free) * bevy::math::ops::powf(doubt, 1.0 - 0.5 * free)
                        }
                        FitReason::Proportion if hips.contains(&joint) => BETWEEN * doubt,
                        _ if is_between(joint) => BETWEEN * doubt,
                        _ => 0.52 * doubt,
                    };
                    let is_shown = evidence.is_shown[joint];
                    let by_itself = if is_shown { trust(best.posed_cost(), HALF_COST).sqrt() } else { 0.0 };
                    let most = if hidden.contains(&joint) { HIDDEN_HINGE } else { 1.0 };
                    ((confidence.max(SHOWN * by_itself) * evidence.carried[joint]).min(most), reason)
                }
            };
            if confidence < 0.5 && reason == FitReason::Surface {
                reason = FitReason::UnlikeSurface;
            }
            if !inside(places[joint]) {
                confidence = confidence.min(0.3);
                reason = FitReason::Outside;
            }
            (confidence, reason)
        })
        .collect()
}

/// Length of a limb against its partner's below which the shorter one is doubtful: one of them may not be there as a whole.
const UNEVEN: f32 = 0.8;

/// Lessens the confidence in limbs that are much shorter than those on the other side.
pub(super) fn doubt_uneven(template: &TemplateLimbs, places: &[Vec3], joints: &mut [(f32, FitReason)]) {
    let length =
        |limb: &Limb| -> f32 { limb.joints.windows(2).map(|pair| places[pair[0]].distance(places[pair[1]])).sum() };
    for limb in &template.limbs {
        let Some(partner) = limb.partner.and_then(|partner| template.limbs.get(partner)) else { continue };
        let share = length(limb) / (UNEVEN * length(partner)).max(1e-9);
        if share < 1.0 {
            limb.joints.iter().for_each(|joint| joints[*joint].0 *= share * share * share);
        }
    }
}

/// Length of the branch of a limb against the limb's below which it is doubtful: the limb ends before its joints do, and they
/// lie folded into what is there.
const SHORT: f32 = 0.85;

/// Confidence that is left to a limb of the body model for which there is no branch: an arm beside the hips that it touches is
/// right, one that is not there is folded into the trunk.
const UNSEEN: f32 = 0.5;

/// Lessens the confidence in limbs of the body model that have no branch or are much longer than theirs, and in what hangs on
/// them.
pub(super) fn doubt_folded(
    template: &TemplateLimbs,
    tree: &Tree,
    best: &Hypothesis,
    places: &[Vec3],
    joints: &mut [(f32, FitReason)],
) {
    let mut doubts = vec![1.0f32; joints.len()];
    for (limb, leaf) in template.limbs.iter().zip(&best.leaves) {
        if !matches!(limb.kind, LimbKind::Arm | LimbKind::Leg) {
            continue;
        }
        let Some(leaf) = *leaf else {
            limb.joints.iter().for_each(|joint| doubts[*joint] *= UNSEEN);
            continue;
        };
        let line = tree.lines[leaf].among(&tree.branches, &best.leaves);
        let branch = line.free + line.at(line.free).distance(places[limb.joints[0]]);
        let bones: f32 = limb.joints.windows(2).map(|pair| places[pair[0]].distance(places[pair[1]])).sum();
        let share = branch / (SHORT * (bones + limb.beyond * best.alignment.scale)).max(1e-9);
        if share < 1.0 {
            limb.joints.iter().for_each(|joint| doubts[*joint] *= share * share * share);
        }
    }
    for &joint in &template.order {
        let above = template.parents[joint].map_or(1.0, |parent| doubts[parent]);
        doubts[joint] = doubts[joint].min(above);
    }
    joints.iter_mut().zip(doubts).for_each(|(joint, doubt)| joint.0 *= doubt);
}

/// Penalty above the best assignment's up to which another one is nearly as good.
const RIVAL: f32 = 0.05;
/// Distance of a joint from where another assignment has it, as a share of the height, above which they disagree.
const ELSEWHERE: f32 = 0.05;
/// Confidence that is left to a joint that an equally good assignment has elsewhere.
const AMBIGUOUS: f32 = 0.65;

/// Lessens the confidence in joints that another assignment, which is nearly as good, has elsewhere. Left and right may be
/// swapped: a figure that faces the other way is told of apart.
pub(super) fn doubt_ambiguous(
    template: &TemplateLimbs,
    trees: &[Tree],
    graph: &VoxelGraph,
    hypotheses: &[Hypothesis],
    placement: &Placement,
    joints: &mut [(f32, FitReason)],
) {
    let Some((best, others)) = hypotheses.split_first() else { return };
    // Without sides, limbs differ by their place alone, and each is fitted to know.
    if template.limbs.iter().all(|limb| limb.kind == LimbKind::Free) {
        return;
    }
    let up = best.alignment.rotation * Vec3::Y;
    let heights =
        graph.centres.iter().zip(&graph.body).filter(|(_, is_body)| **is_body).map(|(place, _)| place.dot(up));
    let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let far = ELSEWHERE * (high - low);
    let end = |of: &Hypothesis, limb: usize| of.leaves[limb].map(|leaf| trees[of.tree].lines[leaf].at(0.0));
    let is_same_end = |other: &Hypothesis, limb: usize| {
        let Some(here) = end(other, limb) else { return end(best, limb).is_none() };
        let sides = [Some(limb), template.limbs[limb].partner];
        sides.into_iter().flatten().filter_map(|side| end(best, side)).any(|there| there.distance(here) <= far)
    };
    let mut doubts = vec![1.0f32; joints.len()];
    for other in others.iter().filter(|other| other.cost - best.cost < RIVAL) {
        if (0..template.limbs.len()).all(|limb| is_same_end(other, limb)) {
            continue;
        }
        let share = ((other.cost - best.cost) / RIVAL).clamp(0.0, 1.0);
        let doubt = AMBIGUOUS + (1.0 - AMBIGUOUS) * share;
        let places = place::place(template, &trees[other.tree], graph, other).places;
        for (joint, place) in places.iter().enumerate() {
            let sides = [Some(joint), template.mirror[joint]];
            let is_near = sides.into_iter().flatten().any(|side| placement.places[side].distance(*place) <= far);
            if !is_near {
                doubts[joint] = doubts[joint].min(doubt);
            }
        }
    }
    for ((confidence, reason), doubt) in joints.iter_mut().zip(doubts).filter(|(_, doubt)| *doubt < 1.0) {
        *confidence *= doubt;
        if matches!(reason, FitReason::CentreLine | FitReason::Proportion) {
            *reason = FitReason::Ambiguous;
        }
    }
}

/// Confidence in the whole fit.
pub(super) fn whole(
    template: &TemplateLimbs,
    best: &Hypothesis,
    body: Option<&FittedBody>,
    joints: &[(f32, FitReason)],
) -> f32 {
    // A missing tail says little.
    let counts = |limb: &Limb| limb.kind != LimbKind::Tail;
    let limbs: Vec<bool> =
        template.limbs.iter().zip(&best.leaves).filter(|(l, _)| counts(l)).map(|(_, leaf)| leaf.is_some()).collect();
    let found = limbs.iter().filter(|l| **l).count() as f32 / limbs.len().max(1) as f32;
    let mean = joints.iter().map(|j| j.0).sum::<f32>() / joints.len().max(1) as f32;
    let agreement = match body {
        Some(body) => mean * trust(body.residual, HALF_TRUST).sqrt(),
        None => (0.5 + 0.5 * mean) * trust(best.posed_cost(), HALF_COST).sqrt(),
    };
    (agreement * found * found).clamp(0.0, 1.0)
}
