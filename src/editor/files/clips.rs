//! Clips of the document as animations of an exported character: played by the rig's own program, for every node of the model.

use std::{borrow::Cow, sync::Arc};

use bevy::math::Vec3A;

use super::error::WriteError;
use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Model},
    processor::{Builder, Modules},
    rig::{
        BuiltRig, Rig, Uid,
        animation::{RigClip, clip_extras::joined_extras},
        bake::baked,
        operations::KeyTolerance,
    },
    solve::{
        bake_clip::{BakePlan, BakeSettings, BakedNode},
        packed_clip::{PackedSkeleton, pack_clip},
        program::{CompileOptions, RigProgram},
    },
};

/// Puts the clips of the document in place of the clips that the mesh came with, of which morph targets stay. A document
/// without clips leaves the model as it is.
///
/// # Errors
/// The rig cannot be built, or the built rig cannot run.
pub(super) fn put_clips(
    model: &mut Model,
    rig: &Rig,
    built: Option<&BuiltRig>,
    modules: &Arc<Modules>,
) -> Result<(), WriteError> {
    if rig.clips().is_empty() {
        return Ok(());
    }
    // Nodes of a model are those of the built skeleton, or the joints of the document.
    let uids: Vec<Uid> = match built {
        Some(built) => baked(rig, built).walk().map(|joint| joint.data.uid).collect(),
        None => rig.walk().map(|joint| joint.data.uid).collect(),
    };
    let built = built_or_made(rig, built, modules)?;
    let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default())?);
    let node = |(uid, node): (Uid, &crate::mesh::model::Node)| BakedNode { uid, parent: node.parent, rest: node.rest };
    let nodes: Vec<BakedNode> = uids.into_iter().zip(&model.nodes).map(node).collect();
    // The tolerance is for humans in metres.
    let tolerance = KeyTolerance::default().for_height(size_of(model));
    let plan = BakePlan::new(&program, &nodes);
    let bake = |clip: &RigClip| plan.bake(clip, &BakeSettings::new(clip.frame_rate, tolerance));
    let mut clips: Vec<Clip> = rig.clips().iter().map(bake).collect::<Result<_, _>>()?;
    for mut clip in std::mem::take(&mut model.clips) {
        clip.channels.retain(|channel| matches!(channel.target, ChannelTarget::MorphWeights(_)));
        match rig.clips().iter().position(|own| own.name == clip.name.trim()) {
            // A baked clip begins at zero.
            Some(place) => {
                let own = &mut clips[place];
                own.channels.extend(earlier(clip.channels, rig.clips()[place].range[0]));
                own.extras = joined_extras(own.extras.take(), clip.extras);
            }
            None => clips.push(clip),
        }
    }
    clips.retain(|clip| !clip.channels.is_empty());
    model.clips = clips;
    Ok(())
}

/// Nodes and constraints that the commands of the rig made, made now if it is not there.
fn built_or_made<'b>(
    rig: &Rig,
    built: Option<&'b BuiltRig>,
    modules: &Arc<Modules>,
) -> Result<Cow<'b, BuiltRig>, WriteError> {
    Ok(match built {
        Some(built) => Cow::Borrowed(built),
        None => Cow::Owned(Builder::build(rig, modules)?),
    })
}

fn earlier(channels: Vec<Channel>, by: f32) -> impl Iterator<Item = Channel> {
    channels.into_iter().map(move |channel| {
        let times = channel.times.iter().map(|time| (time - by).max(0.0)).collect();
        Channel { times, ..channel }
    })
}

/// The clips of the document packed into few bytes, with the skeleton that they move.
///
/// # Errors
/// The rig cannot be built, the built rig cannot run, or a clip is too long.
pub(super) fn packed_clips(
    rig: &Rig,
    built: Option<&BuiltRig>,
    modules: &Arc<Modules>,
) -> Result<PackedSkeleton, WriteError> {
    let built = built_or_made(rig, built, modules)?;
    let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default())?);
    let mut packed = PackedSkeleton::of(rig, &built);
    let nodes = packed.baked_nodes();
    let tolerance = KeyTolerance::default().for_height(size_of(&packed.model("")));
    for clip in rig.clips() {
        let settings = BakeSettings::new(clip.frame_rate, tolerance);
        packed.clips.push(pack_clip(&program, clip, &nodes, &settings)?);
    }
    Ok(packed)
}

/// Longest edge of the box around the nodes of a model at rest.
fn size_of(model: &Model) -> f32 {
    let globals = model.rest_globals();
    let places = || globals.iter().map(|at| at.translation);
    let extent = places().reduce(Vec3A::max).zip(places().reduce(Vec3A::min));
    extent.map_or(0.0, |(most, least)| (most - least).max_element())
}
