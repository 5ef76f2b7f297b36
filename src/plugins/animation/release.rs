//! Nodes that a clip moves no longer: they go back to the pose of the document.

use std::collections::BTreeMap;

use bevy::prelude::*;

use super::{
    ClipPlayer, EndPlayback,
    play::{NodePlace, PlayedClip},
};
use crate::{
    plugins::{
        document::{JointEntities, ShowRest},
        runtime::{ControlPose, RigRuntime},
        schema::Attributes,
    },
    rig::{
        PoseOffset, Rig, Uid,
        animation::{Property, TrackTarget},
    },
};

/// Ends the playback of rigs.
pub(super) fn end_playback(
    mut requests: MessageReader<EndPlayback>,
    mut played: Query<&mut PlayedClip>,
    mut commands: Commands,
) {
    for EndPlayback { rig } in requests.read() {
        if let Ok(mut played) = played.get_mut(*rig) {
            played.end();
            commands.entity(*rig).try_remove::<ClipPlayer>();
        }
    }
}

/// Writes the pose of the document to what clips have left. Rigs without a document keep theirs.
pub(super) fn release(
    mut rigs: Query<(
        &mut PlayedClip,
        Option<&mut RigRuntime>,
        Option<&Rig>,
        Option<&JointEntities>,
        Option<&ShowRest>,
    )>,
    mut transforms: Query<&mut Transform>,
    mut poses: Query<&mut ControlPose>,
    mut attributes: Query<&mut Attributes>,
) {
    for (mut played, mut runtime, rig, joints, rest) in &mut rigs {
        if played.released.is_empty() && played.unposed.is_empty() || rest.is_some_and(|rest| rest.0) {
            continue;
        }
        let played = played.bypass_change_detection();
        for TrackTarget { node, property } in std::mem::take(&mut played.unposed) {
            // A joint that cannot be posed may hold what was shown, too.
            let Some(mut place) = NodePlace::of(node, runtime.as_deref(), rig, joints) else { continue };
            place.is_posable = true;
            let (mut offset, rest) = (place.offset, PoseOffset::IDENTITY);
            match property {
                Property::Translation => offset.translation = rest.translation,
                Property::Rotation => offset.rotation = rest.rotation,
                Property::Scale => offset.scale = rest.scale,
                Property::Attribute(_) => continue,
            }
            pose(&place, node, offset, (&mut poses, &mut transforms), &mut runtime);
        }
        let released = std::mem::take(&mut played.released);
        let Some(rig) = rig else { continue };
        let mut nodes: BTreeMap<Uid, Vec<Property>> = BTreeMap::new();
        for target in released {
            nodes.entry(target.node).or_default().push(target.property);
        }
        for (node, properties) in nodes {
            let Some(place) = NodePlace::of(node, runtime.as_deref(), Some(rig), joints) else { continue };
            let own = rig.offset(node).copied().unwrap_or_default();
            let mut offset = place.offset;
            for property in &properties {
                match property {
                    Property::Translation => offset.translation = own.translation,
                    Property::Rotation => offset.rotation = own.rotation,
                    Property::Scale => offset.scale = own.scale,
                    Property::Attribute(name) => {
                        let default = runtime.as_deref().and_then(|runtime| default_of(runtime, node, name));
                        let Some(value) = rig.attribute_value(node, name).or(default) else { continue };
                        if let Ok(mut told) = attributes.get_mut(place.entity) {
                            if told.0.get(name).is_some_and(|known| *known != value) {
                                told.0.insert(name.clone(), value);
                            }
                        } else if let Some(runtime) = &mut runtime {
                            let state = runtime.bypass_change_detection().state_mut();
                            if let Some(slot) = state.program().attribute(node, name) {
                                state.set_attribute_at(slot, value);
                            }
                        }
                    }
                }
            }
            pose(&place, node, offset, (&mut poses, &mut transforms), &mut runtime);
        }
    }
}

/// Gives a node an offset, if it can be posed.
fn pose(
    place: &NodePlace,
    node: Uid,
    offset: PoseOffset,
    (poses, transforms): (&mut Query<&mut ControlPose>, &mut Query<&mut Transform>),
    runtime: &mut Option<Mut<RigRuntime>>,
) {
    if !place.is_posable {
        return;
    }
    if place.is_direct
        && let Ok(mut pose) = poses.get_mut(place.entity)
    {
        pose.set_if_neq(offset.into());
    }
    // The program of a running rig writes the transforms of its nodes; a clip that moves the node goes on from here.
    match runtime {
        Some(runtime) => {
            let state = runtime.bypass_change_detection().state_mut();
            if let Some(slot) = state.program().node(node) {
                state.set_offset_at(slot, offset);
            }
        }
        None => {
            if let Ok(mut transform) = transforms.get_mut(place.entity) {
                transform.set_if_neq(offset.on(&place.base));
            }
        }
    }
}

/// Value of an attribute until another is set.
fn default_of(runtime: &RigRuntime, node: Uid, name: &str) -> Option<f32> {
    let program = runtime.state().program();
    Some(program.attributes()[program.attribute(node, name)?].default)
}
