//! The pose that the window shows at present: of the clip, of the document, or posed on top of either.

use bevy::prelude::*;

use super::state::OpenClip;
use crate::{
    plugins::{commands::BuildResult, document::JointEntities, runtime::RigRuntime},
    rig::{
        BuiltRig, Channels, NodeType, PoseOffset, Uid,
        animation::{Property, TrackTarget},
    },
};

/// Largest difference by which a shown value is still that of the clip or the document: transforms of entities are rounded.
const ROUNDING: f32 = 2e-6;

/// Values to key of nodes as they are shown: translation and rotation where a control has such channels, scale where it is not
/// one or has keys, and all attributes that people set. Nodes that cannot be posed are left out.
pub(super) fn shown_values(world: &World, open: &OpenClip, nodes: &[Uid]) -> Vec<(TrackTarget, [f32; 4])> {
    let runtime = world.get::<RigRuntime>(open.entity);
    let built = world.get::<BuildResult>(open.entity).map(|built| &*built.0);
    let mut values = Vec::new();
    for &node in nodes {
        let shown = match runtime {
            Some(runtime) => of_runtime(runtime, node),
            None => of_joint(world, open, node),
        };
        if let Some(offset) = shown {
            let free = channels(built, node);
            let vector = |value: Vec3| [value.x, value.y, value.z, 0.0];
            let scale = TrackTarget { node, property: Property::Scale };
            let has_scale = open.layer.is_some_and(|layer| layer.tracks.contains_key(&scale));
            let is_scaled = (offset.scale - Vec3::ONE).abs().max_element() > ROUNDING;
            let all = [
                (Property::Translation, free.translate, vector(offset.translation), true),
                (Property::Rotation, free.rotate, offset.rotation.to_array(), true),
                (Property::Scale, free.scale, vector(offset.scale), is_scaled || has_scale),
            ];
            for (property, free, value, is_wanted) in all {
                if is_wanted && free.contains(&true) {
                    values.push(settled(open, TrackTarget { node, property }, value));
                }
            }
        }
        let Some(state) = runtime.map(RigRuntime::state) else { continue };
        let Some(slot) = state.program().node(node) else { continue };
        for (number, attribute) in state.program().attributes().iter().enumerate() {
            if attribute.node == slot && attribute.is_settable {
                let target = TrackTarget { node, property: Property::Attribute(attribute.name.to_string()) };
                values.push((target, [state.attribute_at(number), 0.0, 0.0, 0.0]));
            }
        }
    }
    values
}

/// Controls of the rig, or its joints if it has none.
pub(super) fn all_nodes(world: &World, open: &OpenClip) -> Vec<Uid> {
    let built = world.get::<BuildResult>(open.entity);
    let controls = built.into_iter().flat_map(|built| &built.0.nodes);
    let controls: Vec<Uid> = controls.filter(|node| node.kind == NodeType::Control).map(|node| node.uid).collect();
    if controls.is_empty() { open.rig.walk().map(|joint| joint.data.uid).collect() } else { controls }
}

fn channels(built: Option<&BuiltRig>, node: Uid) -> Channels {
    let control = built.and_then(|built| built.node(node)?.control.clone());
    control.map(|control| control.channels).unwrap_or_default()
}

fn of_runtime(runtime: &RigRuntime, node: Uid) -> Option<PoseOffset> {
    let state = runtime.state();
    let slot = state.program().node(node)?;
    state.program().nodes()[slot].is_posable().then(|| state.offset_at(slot))
}

fn of_joint(world: &World, open: &OpenClip, node: Uid) -> Option<PoseOffset> {
    let rest = open.rig.joint(node)?.data.rest;
    let entity = world.get::<JointEntities>(open.entity)?.get(node)?;
    Some(PoseOffset::between(&rest, world.get::<Transform>(entity)?))
}

/// A shown value, or that of the clip or the document if it differs from it by rounding alone.
fn settled(open: &OpenClip, target: TrackTarget, shown: [f32; 4]) -> (TrackTarget, [f32; 4]) {
    let own = open.rig.offset(target.node).copied().unwrap_or_default();
    let vector = |value: Vec3| [value.x, value.y, value.z, 0.0];
    let own = match target.property {
        Property::Translation => vector(own.translation),
        Property::Rotation => own.rotation.to_array(),
        Property::Scale => vector(own.scale),
        Property::Attribute(_) => shown,
    };
    let is_near = |other: &[f32; 4]| {
        let sign = if target.property == Property::Rotation { dot(&shown, other).signum() } else { 1.0 };
        shown.iter().zip(other).all(|(a, b)| (a - b * sign).abs() <= ROUNDING * a.abs().max(1.0))
    };
    let known = open.clip.value(&target, open.time).into_iter().chain([own]).find(is_near);
    (target, known.unwrap_or(shown))
}

fn dot(a: &[f32; 4], b: &[f32; 4]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
