//! Program of a built rig: its compilation, and its connection to the entities of joints and created nodes.

use std::sync::Arc;

use bevy::prelude::*;

use super::{BuildResult, BuiltEntities};
use crate::{
    plugins::{
        document::{JointEntities, ShowRest},
        runtime::{InstanceMode, RigRuntime},
    },
    rig::{PoseOffset, RestTransform, Rig},
    solve::program::{Carry, CompileOptions, ProgramCache, ProgramError},
};

/// Compiled programs of built rigs; rigs with equal programs share one.
#[derive(Resource, Default)]
pub struct Programs(pub ProgramCache);

/// Reason why the built rig cannot run. The rig then stands still in its built pose.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[component(immutable)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct RunFailure(pub ProgramError);

type BuiltRigs<'a> = (
    Entity,
    &'a Rig,
    Ref<'a, BuildResult>,
    &'a JointEntities,
    &'a BuiltEntities,
    Option<&'a ShowRest>,
    Option<&'a mut RigRuntime>,
    Option<&'a SuspendedRuntime>,
);

/// Last runtime of a rig, kept while the built rig cannot run, so that its motion continues afterwards.
#[derive(Component)]
pub(super) struct SuspendedRuntime(RigRuntime);

/// Compiles the built rig, carries the motion of the previous program over, and passes on the pose and the attribute
/// values of the document where those have changed.
pub(super) fn run_built(
    mut commands: Commands,
    mut rigs: Query<BuiltRigs, Or<(Changed<BuildResult>, Changed<Rig>, Changed<ShowRest>)>>,
    transforms: Query<&Transform>,
    mut programs: ResMut<Programs>,
) {
    for (entity, rig, built, joints, nodes, show_rest, runtime, suspended) in &mut rigs {
        let is_posed = !show_rest.is_some_and(|show_rest| show_rest.0);
        let mut runtime = match runtime {
            // The document changed, but the build is the same.
            Some(mut runtime) if !built.is_changed() => {
                let target = runtime.bypass_change_detection();
                if !joints.follow(rig) {
                    attach(target, joints, nodes);
                }
                target.pose_from(rig, is_posed);
                continue;
            }
            runtime => runtime,
        };
        let program = match programs.0.get(&built.0, &CompileOptions::default()) {
            Ok(program) => program,
            Err(error) => {
                let mut entity = commands.entity(entity);
                entity.try_insert(RunFailure(error));
                if let Some(runtime) = runtime {
                    entity.try_remove::<RigRuntime>().try_insert(SuspendedRuntime(runtime.clone()));
                }
                continue;
            }
        };
        let mut fresh = None;
        let target = match &mut runtime {
            Some(runtime) if runtime.state().hash() == program.hash() => runtime.bypass_change_detection(),
            Some(runtime) => {
                let runtime = runtime.bypass_change_detection();
                let carry = Carry::between(runtime.state().program(), &program);
                runtime.exchange(&program, &carry);
                runtime.forget_driven();
                runtime
            }
            None => {
                let fresh = fresh.insert(RigRuntime::new(Arc::clone(&program), InstanceMode::Hierarchy));
                match suspended {
                    Some(before) => fresh.carry_over(&before.0),
                    None => take_motion(fresh, rig, joints, &transforms),
                }
                fresh
            }
        };
        attach(target, joints, nodes);
        target.pose_from(rig, is_posed);
        if let Some(fresh) = fresh {
            commands.entity(entity).try_insert(fresh);
            commands.entity(entity).try_remove::<(RunFailure, SuspendedRuntime)>();
        }
    }
}

/// Connects the program's slots to the entities of joints and created nodes.
fn attach(runtime: &mut RigRuntime, joints: &JointEntities, nodes: &BuiltEntities) {
    let program = Arc::clone(runtime.state().program());
    for (slot, node) in program.nodes().iter().enumerate() {
        let entity = joints.get(node.uid).or_else(|| nodes.get(node.uid));
        if let Some(entity) = entity.filter(|entity| runtime.entity(slot) != Some(*entity)) {
            runtime.attach(slot, entity);
        }
    }
}

/// Takes over the motion that an animation or a game gave to the joints before the rig ran for the first time.
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
            // Offsets with infinite or undefined numbers are refused.
            let _ = runtime.state_mut().set_offset(data.uid, live);
        }
    }
}
