//! Program of a built rig: its compilation, and its connection to the entities of joints and created nodes.

use std::sync::Arc;

use bevy::prelude::*;

use super::{BuildResult, BuiltEntities};
use crate::{
    plugins::{
        document::{JointEntities, ShowRest},
        runtime::{InstanceMode, RigRuntime},
    },
    rig::{PoseOffset, RestTransform, Rig, TagKind, Uid, nearest::listed_first},
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

impl RunFailure {
    /// The reason with the names that people know: tags by their module and joint, joints by their label.
    pub fn words(&self, rig: &Rig) -> String {
        let ProgramError::Cycle { commands, nodes, .. } = &self.0 else {
            let tag = self.0.commands().first().and_then(|command| tag_name(rig, *command));
            return tag.map_or_else(|| self.0.to_string(), |tag| format!("{tag}: {}", self.0));
        };
        let (mut tags, mut doubles) = (Vec::new(), Vec::new());
        for tag in commands.iter().filter_map(|command| tag_name(rig, *command)) {
            let list = if tags.contains(&tag) { &mut doubles } else { &mut tags };
            list.push(tag);
        }
        let joints = nodes.iter().filter_map(|node| rig.joint(*node)?.data.label.clone());
        let mut joints: Vec<String> = joints.collect();
        joints.dedup();
        if tags.is_empty() {
            return self.0.to_string();
        }
        let count = tags.len();
        let moved = match joints.len() {
            0 => "what they move".to_owned(),
            count => listed_first(joints, count, "and"),
        };
        let hint = doubles.first().map_or_else(String::new, |double| {
            format!("; {double:?} is there twice, so two parts may move the same joints: delete one of them")
        });
        let (tags, rest) = (listed_first(tags, count, "and"), "or let it follow a node that the others do not move");
        format!("the tags {tags} wait for each other to place {moved}; turn one of them off, delete it, {rest}{hint}")
    }
}

/// A [`ProgramError`] of a rig, told as [`RunFailure::words`] does.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{words}")]
pub struct NamedProgramError {
    /// The error, which has uids in place of names.
    pub error: ProgramError,
    words: String,
}

impl NamedProgramError {
    /// The error of a rig's program, in the names of that rig.
    pub fn new(error: ProgramError, rig: &Rig) -> Self {
        let failure = RunFailure(error);
        let words = failure.words(rig);
        Self { error: failure.0, words }
    }
}

/// Name of a command for people: its module and its joint.
fn tag_name(rig: &Rig, tag: Uid) -> Option<String> {
    let (joint, tag) = rig.find_tag(tag)?;
    let TagKind::Command { module, .. } = &tag.kind else { return None };
    let joint = joint.data.label.as_deref().unwrap_or("a joint without a label");
    Some(format!("{} on {joint}", module.replace('_', " ")))
}

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
