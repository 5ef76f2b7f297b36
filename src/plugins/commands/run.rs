//! The program of a built rig, over the entities of its joints and created nodes.

use std::sync::Arc;

use bevy::prelude::*;

use super::{Built, BuiltEntities};
use crate::{
    plugins::{
        document::{JointEntities, ShowRest},
        runtime::{InstanceMode, RigRuntime},
    },
    rig::{PoseOffset, RestTransform, Rig},
    solve::program::{CompileOptions, ProgramCache},
};

/// Programs of built rigs; equal ones are shared.
#[derive(Resource, Default)]
pub struct Programs(pub ProgramCache);

/// The reason why what was built cannot run. The rig stands still, as it was built.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
#[component(immutable)]
pub struct RunFailure(pub String);

type BuiltRigs<'a> = (
    Entity,
    &'a Rig,
    Ref<'a, Built>,
    &'a JointEntities,
    &'a BuiltEntities,
    Option<&'a ShowRest>,
    Option<&'a mut RigRuntime>,
    Option<&'a Suspended>,
);

/// The last program of a rig that ran, kept while what is built cannot run, so that its motion can go on afterwards.
#[derive(Component)]
pub(super) struct Suspended(RigRuntime);

/// Compiles what was built, lets the motion of the program before go on in it, and hands it the pose and the attribute
/// values of the document where those have changed.
pub(super) fn run_built(
    mut commands: Commands,
    mut rigs: Query<BuiltRigs, Or<(Changed<Built>, Changed<Rig>, Changed<ShowRest>)>>,
    transforms: Query<&Transform>,
    mut programs: ResMut<Programs>,
) {
    for (entity, rig, built, joints, nodes, show_rest, runtime, suspended) in &mut rigs {
        let is_posed = !show_rest.is_some_and(|show_rest| show_rest.0);
        let mut runtime = match runtime {
            // The document changed, the build did not.
            Some(mut runtime) if !built.is_changed() => {
                let target = runtime.bypass_change_detection();
                attach(target, joints, nodes);
                target.pose_from(rig, is_posed);
                continue;
            }
            runtime => runtime,
        };
        let program = match programs.0.get(&built.0, &CompileOptions::default()) {
            Ok(program) => program,
            Err(error) => {
                let mut entity = commands.entity(entity);
                entity.try_insert(RunFailure(error.to_string()));
                if let Some(runtime) = runtime {
                    entity.try_remove::<RigRuntime>().try_insert(Suspended(runtime.clone()));
                }
                continue;
            }
        };
        let mut fresh = None;
        let target = match &mut runtime {
            Some(runtime) if runtime.state().hash() == program.hash() => runtime.bypass_change_detection(),
            before => {
                let fresh = fresh.insert(RigRuntime::new(Arc::clone(&program), InstanceMode::Hierarchy));
                match (before, suspended) {
                    (Some(before), _) => fresh.carry_over(before),
                    (None, Some(before)) => fresh.carry_over(&before.0),
                    (None, None) => take_motion(fresh, rig, joints, &transforms),
                }
                fresh
            }
        };
        attach(target, joints, nodes);
        target.pose_from(rig, is_posed);
        if let Some(fresh) = fresh {
            commands.entity(entity).try_insert(fresh);
            commands.entity(entity).try_remove::<(RunFailure, Suspended)>();
        }
    }
}

/// Lets the entities of joints and created nodes stand for the slots of the program.
fn attach(runtime: &mut RigRuntime, joints: &JointEntities, nodes: &BuiltEntities) {
    let program = Arc::clone(runtime.state().program());
    for (slot, node) in program.nodes().iter().enumerate() {
        let entity = joints.get(node.uid).or_else(|| nodes.get(node.uid));
        if let Some(entity) = entity.filter(|entity| runtime.entity(slot) != Some(*entity)) {
            runtime.attach(slot, entity);
        }
    }
}

/// Motion that an animation or a game gave the joints of a rig that did not run before goes on.
fn take_motion(runtime: &mut RigRuntime, rig: &Rig, joints: &JointEntities, transforms: &Query<&Transform>) {
    for joint in rig.walk() {
        let data = &joint.data;
        let Some(transform) = joints.get(data.uid).and_then(|entity| transforms.get(entity).ok()) else { continue };
        let posed = joints.posed(data.uid).copied().unwrap_or_default();
        let rest: &RestTransform = &data.rest;
        if *transform == posed.on(rest) {
            runtime.note_pose(data.uid, posed);
        } else {
            let live = PoseOffset::between(rest, transform);
            runtime.note_pose(data.uid, posed);
            // Offsets that are not finite are not taken.
            let _ = runtime.state_mut().set_offset(data.uid, live);
        }
    }
}
