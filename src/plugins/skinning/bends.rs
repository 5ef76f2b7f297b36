//! Bends that are tried on a mesh while it is bound: which they are, and what becomes of what they show.

use std::{
    collections::{BTreeMap, HashMap},
    f32::consts::{FRAC_PI_2, FRAC_PI_4},
};

use bevy::math::{Vec3, ops};

use super::{BoundSkin, SkinningInput};
use crate::{
    algo::weights::{
        WeightSettings,
        bends::{Bend, Flesh},
    },
    mesh::model::Weights,
    plugins::surface::RigMesh,
    processor::Modules,
    rig::{
        BuiltRig, Constraint, Rig, RigEdit, Scalar, SkinData, TagKind, Target, Uid,
        deform::{DeformJoint, DeformSkeleton},
    },
};

/// Sine of the bend at rest from which on the plane of a hinge is known.
const BENT: f32 = 0.02;
/// Least share of the bone below that the bone above a hinge has.
const HINGED: f32 = 0.8;
/// Least angle of a bend that is tried, in radians: a limb raised to the front further than that bends no more.
const LEAST: f32 = 0.2;
/// The most by which half joints of hinges and of sockets move outwards, as a share of the bone below. Around sockets they hold
/// half of the skin at most.
const MOST: [f32; 2] = [0.3, 0.9];

/// A bend, with the command that made its half joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriedBend {
    bend: Bend,
    command: Uid,
    /// True if the command takes the length that the mesh asks for.
    is_fitted: bool,
}

/// Length by which a half joint leaves a bend to keep the volume of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedPush {
    /// The command that makes the half joint.
    pub command: Uid,
    /// The half joint.
    pub half: Uid,
    /// The length as a share of the bone below the bend.
    pub push: f32,
}

/// Bends of the joints with half joints by a right angle: hinges the way in which they are bent at rest, others to the front
/// (+Z), which is how arms and legs work; limbs that are raised at rest to a right angle with the trunk.
pub(super) fn tried_bends(
    rig: &Rig,
    built: &BuiltRig,
    skeleton: &DeformSkeleton,
    modules: Option<&Modules>,
) -> Vec<TriedBend> {
    let joints = skeleton.joints();
    let is_core = |joint: usize| joints[joint].twist.is_none() && joints[joint].halves.is_none();
    // The nearest of these joints above each joint, and the joints of which it is the nearest: parents come first.
    let mut above: Vec<Option<usize>> = Vec::with_capacity(joints.len());
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); joints.len()];
    for (number, joint) in joints.iter().enumerate() {
        let core = joint.parent.and_then(|parent| if is_core(parent) { Some(parent) } else { above[parent] });
        above.push(core);
        if let Some(core) = core.filter(|_| is_core(number)) {
            children[core].push(number);
        }
    }
    let at = |joint: usize| joints[joint].rest.translation;
    let made = built.nodes.iter().rev().filter_map(|node| Some((node.uid, node.origin.as_ref()?.command)));
    let commands: HashMap<Uid, Uid> = made.collect();
    let turns = built.constraints.iter().rev().filter_map(|constraint| match &*constraint.constraint {
        Constraint::Transform { driven, targets, .. } => Some((*driven, targets.as_slice())),
        _ => None,
    });
    let turns: HashMap<Uid, &[Target]> = turns.collect();
    let tried = |(half, data): (usize, &DeformJoint)| {
        let joint = data.halves?;
        let parent = above[joint]?;
        let below = children[joint].iter().map(|child| at(*child) - at(joint));
        let below = below.max_by(|a, b| a.length().total_cmp(&b.length()))?;
        let upper = at(joint) - at(parent);
        let (up, down) = (upper.try_normalize()?, below.try_normalize()?);
        let is_hinge = upper.length() >= HINGED * below.length();
        let is_raised = !is_hinge && down.z > ops::cos(FRAC_PI_4);
        let axis = if is_hinge {
            let plane = up.cross(down);
            if plane.length() > BENT { plane.try_normalize()? } else { return None }
        } else {
            down.cross(Vec3::Z).try_normalize().filter(|_| down.z > -ops::cos(FRAC_PI_4))?
        };
        let angle = if is_raised { down.angle_between(Vec3::Z) } else { FRAC_PI_2 };
        if angle < LEAST {
            return None;
        }
        let command = *commands.get(&data.uid)?;
        let [from, to] = *turns.get(&data.uid)? else { return None };
        let share = match (&from.weight, &to.weight) {
            (Scalar::Value(from), Scalar::Value(to)) => to / (from + to),
            _ => return None,
        };
        // The length of a command that decides for itself is that of its target along the bone below.
        let now = to.offset.translation.length() / below.length();
        let is_fitted = rig.find_tag(command).is_some_and(|(_, tag)| {
            let TagKind::Command { module, params, .. } = &tag.kind else { return false };
            let info = modules.and_then(|modules| modules.get(module));
            info.is_some_and(|info| matches!(info.pushed(params, 0.0), Ok(Some(_))))
        });
        let push = if is_fitted { [0.0, MOST[usize::from(!is_hinge)]] } else { [now, now] };
        let section = if is_hinge { 0.0 } else { 0.5 };
        let aside = if is_raised { down.cross(axis) } else { Vec3::Z };
        let aside = (!is_hinge).then_some(aside);
        let bend = Bend { half, joint, axis, angle, aside, above: up, below, section, share, push };
        Some(TriedBend { bend, command, is_fitted })
    };
    joints.iter().enumerate().filter_map(tried).collect()
}

impl SkinningInput {
    /// Tries bends of a mesh, those for which `is_tried` is true: weights that do not fold, and for each command of half joints
    /// the length by which they leave the bend. Points for which `is_fixed` is true keep their weights.
    pub(super) fn try_bends(
        &self,
        mesh: &RigMesh,
        weights: Weights,
        settings: &WeightSettings,
        is_fixed: &dyn Fn(usize) -> bool,
        is_tried: &dyn Fn(&Bend) -> bool,
    ) -> (Weights, Vec<FittedPush>) {
        let tried: Vec<&TriedBend> = self.bends.iter().filter(|tried| is_tried(&tried.bend)).collect();
        if tried.is_empty() {
            return (weights, Vec::new());
        }
        let any_locked = self.locked.iter().any(|locked| *locked);
        let mut is_rigid = vec![any_locked; mesh.rest.points.len()];
        for (range, _) in &self.rigid {
            is_rigid[range.start as usize..range.end as usize].fill(true);
        }
        let stays = |point: usize| is_rigid[point] || is_fixed(point);
        let mut flesh = Flesh::new(&mesh.rest.points, &mesh.triangles, &self.joints, &weights, stays);
        let bends: Vec<Bend> = tried.iter().map(|tried| tried.bend).collect();
        let fitted = tried.iter().zip(flesh.settle(&bends)).filter(|(tried, _)| tried.is_fitted);
        let pushes = fitted
            .filter_map(|(tried, push)| {
                Some(FittedPush { command: tried.command, half: self.uids[tried.bend.half], push: push? })
            })
            .collect();
        (flesh.weights(settings.max_influences, settings.prune), pushes)
    }
}

/// Edits that give commands of half joints the lengths that a mesh asks for, in steps of a thousandth, as means over the
/// joints of each command. Where another mesh of the rig hangs more on a half joint, as a body does under clothes, that mesh
/// decides; commands that are gone and lengths that are as before make no edit.
pub(super) fn push_edits(rig: &Rig, modules: &Modules, mesh: Uid, bound: &BoundSkin) -> Vec<RigEdit> {
    if bound.pushes.is_empty() {
        return Vec::new();
    }
    let own = held_points(&bound.skin);
    let others: Vec<HashMap<Uid, usize>> =
        rig.skins().filter(|(other, _)| *other != mesh).map(|(_, skin)| held_points(skin)).collect();
    let held = |skin: &HashMap<Uid, usize>, half: Uid| skin.get(&half).copied().unwrap_or_default();
    let is_most = |half: Uid| others.iter().all(|other| held(other, half) <= held(&own, half));
    let mut by_command: BTreeMap<Uid, Vec<f32>> = BTreeMap::new();
    for fitted in bound.pushes.iter().filter(|fitted| is_most(fitted.half)) {
        by_command.entry(fitted.command).or_default().push(fitted.push);
    }
    let edit = |(command, pushes): (Uid, Vec<f32>)| {
        let (joint, tag) = rig.find_tag(command)?;
        let TagKind::Command { module, params, .. } = &tag.kind else { return None };
        let push = pushes.iter().sum::<f32>() / pushes.len() as f32;
        let text = modules.get(module)?.pushed(params, (push * 1000.0).round() / 1000.0).ok()??;
        if text == *params {
            return None;
        }
        let mut tag = tag.clone();
        if let TagKind::Command { params, .. } = &mut tag.kind {
            *params = text;
        }
        Some(RigEdit::SetTag(joint.data.uid, Box::new(tag)))
    };
    by_command.into_iter().filter_map(edit).collect()
}

/// Number of influences of each joint.
fn held_points(skin: &SkinData) -> HashMap<Uid, usize> {
    let mut counts = vec![0; skin.joints.len()];
    for joint in &skin.weights.joints {
        if let Some(count) = counts.get_mut(*joint as usize) {
            *count += 1;
        }
    }
    // Of a joint that is listed twice, the first place counts.
    skin.joints.iter().copied().zip(counts).rev().collect()
}
