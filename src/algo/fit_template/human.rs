//! Human figures: the joints of a learned body model that is registered to the mesh.

mod model;
mod pose;
mod register;
mod roles;
mod shape;
mod solve;
mod surface_points;

use glam::{Quat, Vec3};

use self::{
    model::{HumanModel, bone},
    pose::State,
    register::{Goal, Stage, agreement, closest_points, limb_bones, pose_by_anchors, residual},
};
pub(super) use self::{
    register::Anchor,
    roles::{Role, roles},
    solve::Place,
};
use super::{
    assign::Hypothesis,
    limbs::{LimbKind, TemplateLimbs},
    line::CentreLine,
    report::FitError,
    target::{Sample, Target},
    tree::Tree,
};
use crate::mesh::surface::Surface;

/// A registered body.
#[derive(Debug, Clone)]
pub(super) struct FittedBody {
    pub(super) state: State,
    /// Places of the model's bones in unit space.
    pub(super) joints: Vec<Vec3>,
    /// Turn of the trunk.
    pub(super) trunk: Quat,
    /// Mean distance between the model's and the mesh's surface, as a share of the height.
    pub(super) residual: f32,
    /// Mean distance between the surfaces around each bone, as a share of the height.
    pub(super) near: Vec<f32>,
    /// Residual of the start that was taken, and of the best one that faces elsewhere.
    pub(super) start: f32,
    pub(super) backwards: Option<f32>,
}

impl FittedBody {
    fn new(model: &HumanModel, state: State, goal: &Goal, samples: &[Sample], starts: (f32, Option<f32>)) -> Self {
        let skeleton = state.skeleton(model);
        let (residual, near) = agreement(model, &state, goal, samples);
        let (joints, trunk) = (skeleton.joints, skeleton.frames[bone("spine_02")]);
        Self { state, joints, trunk, residual, near, start: starts.0, backwards: starts.1 }
    }

    /// Distance between the surfaces around a bone. Where the surface shows little of a joint, in the spine and the
    /// toes, the whole figure's distance counts, and more.
    fn doubt(&self, b: usize) -> f32 {
        const HIDDEN: [(&str, f32); 4] = [("spine_02", 4.0), ("spine_03", 4.0), ("ball", 3.6), ("clavicle", 2.0)];
        let hidden = HIDDEN.iter().find(|h| model::bone_name(b).starts_with(h.0)).map_or(1.0, |h| h.1);
        self.near[b].max(hidden * self.residual)
    }

    /// Place of a role and the distance between the surfaces around it.
    pub(super) fn place(&self, role: Role) -> (Vec3, f32) {
        match role {
            Role::Bone(b) => (self.joints[b], self.doubt(b)),
            Role::Between(a, b, share) => {
                (self.joints[a].lerp(self.joints[b], share), self.doubt(a).max(self.doubt(b)))
            }
        }
    }
}

/// Starts that are tried.
const STARTS: usize = 4;
/// Residual of a start that no other one can beat: a body that faces backwards comes not so near.
const CERTAIN: f32 = 0.017;
/// Share of a hypothesis' penalty in the choice of a start, against the distance between the surfaces.
const COST_SHARE: f32 = 0.04;
/// Penalty above the least one up to which a hypothesis is tried.
const WORTH_TRYING: f32 = 0.12;
/// Stages from far to near: rough with the mean body, loose for unusual proportions, then with all freedom.
const ROUGH: Stage = Stage {
    steps: 12,
    from: 0.08,
    to: 0.03,
    components: 4e-6,
    lengths: 4e-3,
    girths: 4e-3,
    turns: 2e-5,
    fingers: false,
};
/// Residual of a start above which the figure is unlike the bodies that the model was learned from.
const UNLIKE: f32 = 0.02;
const LOOSE: Stage = Stage {
    steps: 14,
    from: 0.06,
    to: 0.03,
    components: 1e-5,
    lengths: 1e-4,
    girths: 5e-5,
    turns: 1e-5,
    fingers: false,
};
const MIDDLE: Stage = Stage {
    steps: 14,
    from: 0.03,
    to: 0.012,
    components: 1e-6,
    lengths: 7e-5,
    girths: 4e-5,
    turns: 4e-6,
    fingers: false,
};
const FINE: Stage = Stage {
    steps: 12,
    from: 0.012,
    to: 0.008,
    components: 5e-7,
    lengths: 1.2e-5,
    girths: 7e-6,
    turns: 1e-6,
    fingers: true,
};
const REFIT: Stage = Stage {
    steps: 4,
    from: 0.02,
    to: 0.012,
    components: 1e-6,
    lengths: 2e-4,
    girths: 2e-4,
    turns: 4e-6,
    fingers: true,
};

/// `true` if the surface shows where a bone begins.
pub(super) fn is_shown(b: usize) -> bool {
    let name = model::bone_name(b);
    !["spine", "pelvis", "clavicle"].iter().any(|hidden| name.starts_with(hidden))
}

/// `true` if a template has the limbs of a human figure.
pub(super) fn is_human(template: &TemplateLimbs) -> bool {
    template.count(LimbKind::Arm) == 2 && template.count(LimbKind::Leg) == 2 && template.count(LimbKind::Head) == 1
}

/// The start of a registration by a hypothesis: the model posed along centre lines.
fn start(model: &HumanModel, template: &TemplateLimbs, tree: &Tree, hypothesis: &Hypothesis) -> Option<State> {
    let lines = &tree.lines;
    let joint = |b: usize| model.bones[b].mean;
    let mut anchors = Vec::new();
    let mut ends: Vec<(Vec3, f32)> = Vec::new();
    let mut chains = Vec::new();
    for (limb, leaf) in template.limbs.iter().zip(&hypothesis.leaves) {
        let Some(leaf) = *leaf else { continue };
        let side = if template.positions[limb.joints[0]].x > 0.0 { "l" } else { "r" };
        let (tip, bones, kind) = match limb.kind {
            LimbKind::Arm => {
                let wrist = joint(bone(&format!("hand_{side}")));
                let knuckle = joint(bone(&format!("middle_03_{side}")));
                (model.extreme("middle", side, knuckle - wrist), limb_bones("arm", side), LimbKind::Arm)
            }
            LimbKind::Leg => (model.extreme("ball", side, Vec3::Z), limb_bones("leg", side), LimbKind::Leg),
            LimbKind::Head => (
                model.extreme("head", "", Vec3::Y),
                vec![bone("spine_03"), bone("neck_01"), bone("head")],
                LimbKind::Head,
            ),
            _ => continue,
        };
        // Lengths from the tip to each bone of the chain.
        let mut lengths = vec![0.0; bones.len()];
        let (mut place, mut length) = (model.points[tip].mean, 0.0);
        for (i, &b) in bones.iter().enumerate().rev() {
            length += place.distance(joint(b));
            place = joint(b);
            lengths[i] = length;
        }
        chains.push((leaf, kind, tip, bones, lengths));
        ends.push((place, length));
    }
    if chains.len() < 3 {
        return None;
    }
    // The scale from the ways between ends.
    let (mut mesh, mut rest) = (0.0, 0.0);
    for a in 0..chains.len() {
        for b in a + 1..chains.len() {
            let between = ends[a].0.distance(ends[b].0);
            rest += ends[a].1 + ends[b].1 + between;
            let (la, lb) = (&lines[chains[a].0], &lines[chains[b].0]);
            mesh += way(la, lb);
        }
    }
    let scale = mesh / rest.max(1e-6);
    let mut pairs = Vec::new();
    for (leaf, kind, tip, bones, lengths) in &chains {
        let line = &lines[*leaf].among(&tree.branches, &hypothesis.leaves);
        let mut anchor = |place: Place, position: Vec3, weight: f32| {
            anchors.push(Anchor { place, position, weight });
            let rest = match place {
                Place::Point(p) => model.points[p].mean,
                Place::Joint(j) => joint(j),
            };
            pairs.push((rest, position, weight));
        };
        anchor(Place::Point(*tip), line.at(0.0), if *kind == LimbKind::Head { 1.0 } else { 0.6 });
        if *kind == LimbKind::Head {
            continue;
        }
        for (i, &b) in bones.iter().enumerate().skip(1) {
            let along = lengths[i] * scale;
            if along < line.free {
                anchor(Place::Joint(b), line.at(along), if i == 1 { 0.5 } else { 1.0 });
            }
        }
    }
    let mut state = State::rest(hypothesis.alignment.rotation, scale, Vec3::ZERO);
    // The offset that suits the given turn and scale.
    let total: f32 = pairs.iter().map(|p| p.2).sum();
    state.offset =
        pairs.iter().map(|p| (p.1 - hypothesis.alignment.rotation * (p.0 * scale)) * p.2).sum::<Vec3>() / total;
    pose_by_anchors(model, &mut state, &anchors, f32::INFINITY, 12);
    pose_by_anchors(model, &mut state, &anchors, 6e-3, 4);
    Some(state)
}

/// The way between the ends of two lines along both.
fn way(a: &CentreLine, b: &CentreLine) -> f32 {
    // Lines end at the centre of the body; they share their last points from where they meet.
    let shared = a.points.iter().rev().zip(b.points.iter().rev()).take_while(|(p, q)| p.distance(**q) < 1e-4).count();
    let until = |l: &CentreLine| l.lengths[(l.points.len() - shared.max(1)).min(l.points.len() - 1)];
    until(a) + until(b)
}

/// Registers the model by the best of the hypotheses; `plain` are places of bones by the centre lines of the best one.
pub(super) fn fit(
    surface: &Surface,
    target: &Target,
    template: &TemplateLimbs,
    trees: &[Tree],
    hypotheses: &[Hypothesis],
    plain: &[Anchor],
    step: &dyn Fn(f32) -> Result<(), FitError>,
) -> Result<Option<FittedBody>, FitError> {
    let model = HumanModel::new();
    let goal = Goal { surface, target };
    let samples = &target.samples;
    let few: Vec<_> = samples.iter().step_by(3).copied().collect();
    let mut tried: Vec<(f32, State)> = Vec::new();
    let least = hypotheses.first().map_or(0.0, |h| h.cost);
    let worth = |h: &&Hypothesis| h.cost < least + WORTH_TRYING;
    for hypothesis in hypotheses.iter().filter(worth).take(STARTS) {
        step(0.1 * tried.len() as f32)?;
        let Some(mut state) = start(&model, template, &trees[hypothesis.tree], hypothesis) else { continue };
        closest_points(&model, &mut state, &goal, &few, &ROUGH, &[], None);
        let rest = residual(&model, &state, &goal, &few, 0.08);
        tried.push((rest + COST_SHARE * (hypothesis.cost - least), state));
        if rest < CERTAIN {
            break;
        }
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((best, mut state)) = tried.first().cloned() else { return Ok(None) };
    let front = |s: &State| s.turns[0] * Vec3::Z;
    let elsewhere = tried.iter().find(|t| front(&t.1).dot(front(&state)) < 0.5).map(|t| t.0);
    if best > UNLIKE {
        step(0.35)?;
        // Unusual proportions are taken from the centre lines, too.
        let mut other = state.clone();
        pose_by_anchors(&model, &mut other, plain, 1e-3, 14);
        let rest = |state: &State| residual(&model, state, &goal, samples, 0.08);
        closest_points(&model, &mut state, &goal, samples, &LOOSE, &[], None);
        closest_points(&model, &mut other, &goal, samples, &LOOSE, &[], None);
        if rest(&other) < rest(&state) {
            state = other;
        }
    }
    for (i, stage) in [MIDDLE, FINE].iter().enumerate() {
        step(0.4 + 0.3 * i as f32)?;
        closest_points(&model, &mut state, &goal, samples, stage, &[], None);
    }
    Ok(Some(FittedBody::new(&model, state, &goal, samples, (best, elsewhere))))
}

/// Registers the model again from a body that fits already, with places that its bones have to keep.
pub(super) fn refit(surface: &Surface, target: &Target, body: &FittedBody, places: &[(usize, Vec3)]) -> FittedBody {
    let model = HumanModel::new();
    let goal = Goal { surface, target };
    let few: Vec<_> = target.samples.iter().step_by(3).copied().collect();
    let kept: Vec<Anchor> =
        places.iter().map(|&(bone, position)| Anchor { place: Place::Joint(bone), position, weight: 0.3 }).collect();
    let mut state = body.state.clone();
    closest_points(&model, &mut state, &goal, &few, &REFIT, &kept, Some(&body.state));
    FittedBody::new(&model, state, &goal, &few, (body.start, body.backwards))
}
