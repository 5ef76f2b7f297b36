//! Clips for Bevy's animation: a game's own graph blends them and masks nodes.
//!
//! Nodes are found by an `AnimationTargetId` that follows from their uid, so that neither a name nor a parent changes it.

use std::{any::TypeId, sync::Arc};

use bevy::{
    animation::{
        AnimatedBy, AnimationEntityMut, AnimationEvaluationError, AnimationTargetId, animated_field, prelude::*,
    },
    asset::uuid::Uuid,
    math::curve::{Curve, Interval},
    platform::hash::Hashed,
    prelude::*,
};

use super::{MarkerReached, play::rest_of};
use crate::{
    plugins::{
        runtime::{ControlPose, InstanceMode, NodeOf, RigRuntime},
        schema::Attributes,
    },
    rig::{
        RestTransform, Uid,
        animation::{ClipLayer, Property, RigClip, TrackTarget},
    },
    solve::program::RigProgram,
};

/// First half of the uuids of nodes.
const NODES: u64 = 0x5249_4753_4D49_8748;

/// Identity of a node for Bevy's animation, for graphs with masks for example.
pub fn target_id(node: Uid) -> AnimationTargetId {
    AnimationTargetId(Uuid::from_u64_pair(NODES, node.0))
}

/// Rig whose nodes Bevy's `AnimationPlayer` animates, which is on the same entity.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Component)]
pub struct ClipTargets;

/// Gives the nodes of rigs with [`ClipTargets`] their identities for Bevy's animation, and those of instances without a
/// document their attributes.
pub(super) fn name_targets(
    nodes: Query<(Entity, &NodeOf, &Uid, Has<Attributes>), Without<AnimationTargetId>>,
    rigs: Query<Option<&RigRuntime>, With<ClipTargets>>,
    mut commands: Commands,
) {
    if rigs.is_empty() {
        return;
    }
    for (entity, NodeOf(rig), uid, has_attributes) in &nodes {
        let Ok(runtime) = rigs.get(*rig) else { continue };
        commands.entity(entity).insert((target_id(*uid), AnimatedBy(*rig)));
        let Some(state) = runtime.map(RigRuntime::state).filter(|_| !has_attributes) else { continue };
        let program = state.program();
        let Some(node) = program.node(*uid) else { continue };
        let own = program.attributes().iter().enumerate().filter(|(_, attribute)| attribute.node == node);
        let held: std::collections::BTreeMap<String, f32> =
            own.map(|(slot, attribute)| (attribute.name.to_string(), state.attribute_at(slot))).collect();
        if !held.is_empty() {
            commands.entity(entity).insert(Attributes(held));
        }
    }
}

/// A clip for Bevy's animation of instances of a program, with all layers mixed. Second 0 is the start of the clip. Markers are
/// told as [`MarkerReached`] of the entity with the player.
///
/// Nodes that the program does not have or that cannot be posed are left out, and so is what no layer in effect concerns: keys of
/// layers that are muted, have no weight, or leave the node out by their mask. A node gets all of its transform from the clip:
/// where the clip has no keys of it, it is at its base. Root motion is not taken out: see
/// [`RootMotion`](super::RootMotion).
pub fn animation_clip(clip: &RigClip, program: &RigProgram, mode: InstanceMode) -> AnimationClip {
    let mut out = AnimationClip::default();
    let targets: std::collections::BTreeSet<&TrackTarget> =
        clip.layers.iter().flat_map(|layer| layer.tracks.keys()).collect();
    for target in targets {
        // A curve would hold the node at its base, which other motion of the game moves.
        if clip.value(target, clip.range[0]).is_none() {
            continue;
        }
        let Some(slot) = program.node(target.node) else { continue };
        let node = &program.nodes()[slot];
        let is_direct = mode == InstanceMode::Direct;
        let base = if is_direct { RestTransform::default() } else { rest_of(&node.base) };
        let curve = ClipCurve(Arc::new(CurveData { clip: only(clip, target), target: target.clone(), base }));
        let id = target_id(target.node);
        if let Property::Attribute(name) = &target.property {
            if program.attribute(target.node, name).is_some() {
                out.add_curve_to_target(id, AnimatableCurve::new(AttributeProperty::new(name), curve));
            }
            continue;
        }
        if !node.is_posable() {
            continue;
        }
        match (&target.property, is_direct) {
            (Property::Translation, false) => {
                out.add_curve_to_target(id, AnimatableCurve::new(animated_field!(Transform::translation), curve));
            }
            (Property::Translation, true) => {
                out.add_curve_to_target(id, AnimatableCurve::new(animated_field!(ControlPose::translation), curve));
            }
            (Property::Rotation, false) => {
                out.add_curve_to_target(id, AnimatableCurve::new(animated_field!(Transform::rotation), curve));
            }
            (Property::Rotation, true) => {
                out.add_curve_to_target(id, AnimatableCurve::new(animated_field!(ControlPose::rotation), curve));
            }
            (Property::Scale, false) => {
                out.add_curve_to_target(id, AnimatableCurve::new(animated_field!(Transform::scale), curve));
            }
            (Property::Scale, true) => {
                out.add_curve_to_target(id, AnimatableCurve::new(animated_field!(ControlPose::scale), curve));
            }
            (Property::Attribute(_), _) => {}
        }
    }
    // The last one of a moment is told first by Bevy.
    let inside = clip.markers.iter().rev().filter(|marker| (clip.range[0]..=clip.range[1]).contains(&marker.time));
    for marker in inside {
        let (uid, name, time) = (clip.uid, marker.name.clone(), marker.time);
        out.add_event_fn(time - clip.range[0], move |commands: &mut Commands, entity: Entity, _: f32, _: f32| {
            commands.trigger(MarkerReached { entity, clip: uid, name: name.clone(), time });
        });
    }
    out.set_duration(clip.duration());
    out
}

/// The clip with the tracks of one target alone.
fn only(clip: &RigClip, target: &TrackTarget) -> RigClip {
    let layer = |layer: &ClipLayer| ClipLayer {
        tracks: layer.tracks.get(target).map(|track| (target.clone(), Arc::clone(track))).into_iter().collect(),
        ..ClipLayer { tracks: std::collections::BTreeMap::new(), ..layer.clone() }
    };
    let layers = clip.layers.iter().map(layer).collect();
    RigClip { layers, markers: Vec::new(), ..RigClip { layers: Vec::new(), ..clip.clone() } }
}

/// Values of a property as a curve.
#[derive(Reflect, Debug, Clone)]
#[reflect(opaque)]
struct ClipCurve(Arc<CurveData>);

#[derive(Debug)]
struct CurveData {
    clip: RigClip,
    target: TrackTarget,
    base: RestTransform,
}

impl ClipCurve {
    fn interval(&self) -> Interval {
        Interval::new(0.0, self.0.clip.duration()).unwrap_or(Interval::UNIT)
    }

    fn value(&self, time: f32) -> [f32; 4] {
        let CurveData { clip, target, .. } = &*self.0;
        clip.value(target, clip.range[0] + time).unwrap_or_else(|| target.property.rest())
    }
}

impl Curve<Vec3> for ClipCurve {
    fn domain(&self) -> Interval {
        self.interval()
    }

    fn sample_unchecked(&self, time: f32) -> Vec3 {
        let [x, y, z, _] = self.value(time);
        let (value, base) = (Vec3::new(x, y, z), &self.0.base);
        match self.0.target.property {
            Property::Scale => base.scale * value,
            _ => base.translation + base.rotation * (base.scale * value),
        }
    }
}

impl Curve<Quat> for ClipCurve {
    fn domain(&self) -> Interval {
        self.interval()
    }

    fn sample_unchecked(&self, time: f32) -> Quat {
        (self.0.base.rotation * Quat::from_array(self.value(time))).normalize()
    }
}

impl Curve<f32> for ClipCurve {
    fn domain(&self) -> Interval {
        self.interval()
    }

    fn sample_unchecked(&self, time: f32) -> f32 {
        self.value(time)[0]
    }
}

/// Attribute of a node that Bevy animates.
#[derive(Debug, Clone)]
pub struct AttributeProperty {
    name: Arc<str>,
    id: Hashed<(TypeId, usize)>,
}

impl AttributeProperty {
    /// The attribute of that name.
    pub fn new(name: &str) -> Self {
        // Numbers of fields are small; names get large ones.
        let number = Uid::derived([name]).0 as usize | 1 << (usize::BITS - 1);
        Self { name: name.into(), id: Hashed::new((TypeId::of::<Attributes>(), number)) }
    }
}

impl AnimatableProperty for AttributeProperty {
    type Property = f32;

    fn get_mut<'a>(&self, entity: &'a mut AnimationEntityMut) -> Result<&'a mut f32, AnimationEvaluationError> {
        let held = entity
            .get_mut::<Attributes>()
            .ok_or_else(|| AnimationEvaluationError::ComponentNotPresent(TypeId::of::<Attributes>()))?
            .into_inner();
        let missing = || AnimationEvaluationError::PropertyNotPresent(TypeId::of::<Attributes>());
        held.0.get_mut(&*self.name).ok_or_else(missing)
    }

    fn evaluator_id(&self) -> EvaluatorId<'_> {
        EvaluatorId::ComponentField(&self.id)
    }
}
