//! Expressions of instances: strengths by name pose the facial joints of a template.
//!
//! An instance has no mesh that could be analysed. What each unit does is in the stored poses of its template, as
//! `rigsmith face --arkit` writes them into `.rig.ron`; an expression is their sum.

use std::collections::{BTreeMap, BTreeSet};

use bevy::{math::ops, prelude::*};

use super::{ControlPoses, InstanceNodes, RunningTemplate};
use crate::{
    algo::face::expression::{ExpressionSet, MAX_STRENGTH, Unit},
    plugins::face::{ExpressError, Expressions, FaceExpressions, mixed, pose_names},
    rig::{PoseOffset, Rig, StoredPose, Uid, nearest::did_you_mean},
};

/// The expressions of an instance cannot be shown; its face stays as it was.
#[derive(EntityEvent, Debug, Clone)]
pub struct ExpressFailed {
    /// The instance.
    pub entity: Entity,
    /// The reason.
    pub error: ExpressError,
}

/// Poses the faces of instances whose [`Expressions`] or templates have changed, and rests those that have none any more.
pub(super) fn express(
    faces: Query<(Entity, Ref<Expressions>, Ref<RunningTemplate>)>,
    set: Option<Res<FaceExpressions>>,
    nodes: InstanceNodes,
    mut poses: ControlPoses,
    mut posed: Local<BTreeMap<Entity, BTreeSet<Uid>>>,
    mut commands: Commands,
) {
    let mut pose = |instance: Entity, joint: Uid, offset: PoseOffset| {
        if let Some(node) = nodes.find_uid(instance, joint) {
            poses.set(node, offset);
        }
    };
    let gone: Vec<Entity> = posed.keys().copied().filter(|instance| !faces.contains(*instance)).collect();
    for instance in gone {
        for joint in posed.remove(&instance).unwrap_or_default() {
            pose(instance, joint, PoseOffset::IDENTITY);
        }
    }
    let is_other_set = set.as_ref().is_some_and(|set| set.is_changed());
    for (instance, expressions, running) in &faces {
        if !(expressions.is_changed() || running.is_changed() || is_other_set) {
            continue;
        }
        let known = match &set {
            Some(set) => &*set.0,
            None => ExpressionSet::bundled(),
        };
        let offsets = match offsets(&running.get().rig, known, &expressions.0) {
            Ok(offsets) => offsets,
            Err(error) => {
                commands.trigger(ExpressFailed { entity: instance, error });
                continue;
            }
        };
        for joint in posed.remove(&instance).unwrap_or_default() {
            if !offsets.contains_key(&joint) {
                pose(instance, joint, PoseOffset::IDENTITY);
            }
        }
        for (joint, offset) in &offsets {
            pose(instance, *joint, *offset);
        }
        posed.insert(instance, offsets.into_keys().collect());
    }
}

/// Offsets of joints that strengths by name make of the stored poses of a rig. A name is that of an expression or unit, in the
/// set's spelling or ARKit's, or else that of a stored pose.
fn offsets(
    rig: &Rig,
    set: &ExpressionSet,
    strengths: &BTreeMap<String, f32>,
) -> Result<BTreeMap<Uid, PoseOffset>, ExpressError> {
    let stored: BTreeMap<&str, &StoredPose> =
        rig.stored_poses().iter().map(|pose| (pose.name.as_str(), pose)).collect();
    let is_posed =
        |unit: &Unit| unit.is_of_tongue() || pose_names(unit).iter().all(|name| stored.contains_key(name.as_str()));
    let mut of_set: BTreeMap<String, f32> = BTreeMap::new();
    let mut sum: BTreeMap<Uid, PoseOffset> = BTreeMap::new();
    for (name, strength) in strengths {
        if !strength.is_finite() {
            return Err(ExpressError::Strength { name: name.clone() });
        }
        let found = set.find(name);
        let used = found.iter().flat_map(|expression| &expression.units);
        let mut units = used.filter_map(|used| set.units().iter().find(|unit| unit.name == used.unit));
        let missing = units.find(|unit| !is_posed(unit));
        match (found.is_some(), missing, stored.get(name.as_str())) {
            (true, None, _) => {
                of_set.insert(name.clone(), *strength);
            }
            (_, _, Some(pose)) => add(&mut sum, pose, strength.clamp(0.0, MAX_STRENGTH)),
            (true, Some(unit), None) => {
                return Err(ExpressError::NoPose { name: name.clone(), unit: unit.name.clone() });
            }
            (false, _, None) => {
                let nearest = did_you_mean(name, set.names());
                return Err(ExpressError::Unknown { name: name.clone(), nearest });
            }
        }
    }
    let mix = mixed(set, &of_set)?;
    for (unit, strengths) in set.units().iter().zip(&mix.strengths) {
        let names = pose_names(unit);
        // A pose of both sides together is shown by the mean of their strengths.
        let share = if names[0] == names[1] { 0.5 } else { 1.0 };
        for (name, strength) in names.iter().zip(strengths) {
            if let Some(pose) = stored.get(name.as_str()) {
                add(&mut sum, pose, strength * share);
            }
        }
    }
    Ok(sum)
}

/// Adds a share of a pose.
fn add(sum: &mut BTreeMap<Uid, PoseOffset>, pose: &StoredPose, share: f32) {
    if share == 0.0 {
        return;
    }
    for (joint, offset) in &pose.offsets {
        let sum = sum.entry(*joint).or_default();
        sum.translation += offset.translation * share;
        sum.rotation = (sum.rotation * turned(offset.rotation, share)).normalize();
        sum.scale *= Vec3::ONE + (offset.scale - Vec3::ONE) * share;
    }
}

/// A share of a rotation, which may be more than all of it.
fn turned(rotation: Quat, share: f32) -> Quat {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let axis = rotation.xyz();
    let sine = axis.length();
    if sine < 1e-7 {
        return Quat::IDENTITY;
    }
    let half = ops::atan2(sine, rotation.w) * share;
    let axis = axis * (ops::sin(half) / sine);
    Quat::from_xyzw(axis.x, axis.y, axis.z, ops::cos(half))
}
