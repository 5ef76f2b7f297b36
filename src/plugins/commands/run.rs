//! What is built runs: its program on the rig, over the entities of its joints and created nodes.

use std::sync::Arc;

use bevy::prelude::*;

use super::{Built, BuiltEntities};
use crate::{
    plugins::{
        document::{JointEntities, ShowRest},
        runtime::{InstanceMode, RigRuntime},
    },
    rig::{PoseOffset, Rig},
    solve::program::{CompileOptions, ProgramCache},
};

/// Programs of built rigs; equal ones are shared.
#[derive(Resource, Default)]
pub struct Programs(pub ProgramCache);

/// Why what was built cannot run. The rig stands still, as it was built.
#[derive(Component, Debug, Clone, PartialEq, Eq)]
pub struct RunFailure(pub String);

type BuiltRigs<'a> = (
    Entity,
    &'a Rig,
    &'a Built,
    &'a JointEntities,
    Option<&'a BuiltEntities>,
    Option<&'a ShowRest>,
    Option<&'a mut RigRuntime>,
);

/// Compiles what was built, and tells it the pose and the attribute values of the document.
pub(super) fn run_built(
    mut commands: Commands,
    mut rigs: Query<BuiltRigs, Or<(Changed<Built>, Changed<Rig>, Changed<ShowRest>)>>,
    mut programs: ResMut<Programs>,
) {
    for (entity, rig, built, joints, nodes, show_rest, runtime) in &mut rigs {
        let program = match programs.0.get(&built.0, &CompileOptions::default()) {
            Ok(program) => program,
            Err(error) => {
                commands.entity(entity).remove::<RigRuntime>().insert(RunFailure(error.to_string()));
                continue;
            }
        };
        let is_posed = !show_rest.is_some_and(|show_rest| show_rest.0);
        let mut fresh;
        let mut stored;
        let is_fresh = runtime.as_ref().is_none_or(|runtime| runtime.state().hash() != program.hash());
        let runtime: &mut RigRuntime = match runtime {
            Some(runtime) if !is_fresh => {
                stored = runtime;
                &mut stored
            }
            _ => {
                fresh = RigRuntime::new(Arc::clone(&program), InstanceMode::Hierarchy);
                &mut fresh
            }
        };
        for (slot, node) in program.nodes().iter().enumerate() {
            let target = joints.get(node.uid).or_else(|| nodes.and_then(|nodes| nodes.get(node.uid)));
            if let Some(target) = target.filter(|target| runtime.entity(slot) != Some(*target)) {
                runtime.attach(slot, target);
            }
            let offset = rig.offset(node.uid).copied().filter(|_| is_posed).unwrap_or(PoseOffset::IDENTITY);
            if runtime.state().offset_at(slot) != offset {
                runtime.state_mut().set_offset_at(slot, offset);
            }
        }
        for (slot, attribute) in program.attributes().iter().enumerate() {
            let value =
                rig.attribute_value(program.nodes()[attribute.node].uid, &attribute.name).unwrap_or(attribute.default);
            runtime.state_mut().set_attribute_at(slot, value);
        }
        if is_fresh {
            let runtime = std::mem::replace(runtime, RigRuntime::new(program, InstanceMode::Hierarchy));
            commands.entity(entity).insert(runtime).remove::<RunFailure>();
        }
    }
}
