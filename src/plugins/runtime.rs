//! Rigs that run: programs between Bevy's animation and its propagation of transforms.
//!
//! A [`RigRuntime`] on an entity makes it an instance of a [`RigProgram`]. Each frame, instances whose inputs changed
//! take the poses of their controls, run (in parallel over instances) and hand out what came of it; others cost nothing.
//! In the editor every node is an entity with a `Transform`. In a game only joints and exposed controls are, and joints
//! get their `GlobalTransform` at once, so that a crowd does not propagate what nobody sees: see [`InstanceMode`].

mod spawn;
mod systems;

use std::sync::Arc;

use bevy::prelude::*;

pub use self::spawn::spawn_instance;
use super::{RigSystems, configure_sets};
use crate::{
    rig::PoseOffset,
    solve::program::{Memory, RigProgram, RigState},
};

/// Adds the systems that run rigs.
pub struct RuntimePlugin;

impl Plugin for RuntimePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_systems(
            PostUpdate,
            (
                (systems::note_controls, systems::solve, (systems::scatter_locals, systems::scatter_morphs))
                    .chain()
                    .in_set(RigSystems::Solve),
                systems::scatter_globals.in_set(RigSystems::Scatter),
            ),
        );
        #[cfg(feature = "draw")]
        app.add_systems(PostUpdate, systems::show_morphs.in_set(RigSystems::Solve).after(systems::scatter_morphs));
    }
}

/// How an instance hands out its results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InstanceMode {
    /// Every node is an entity in the same hierarchy as in the rig. Controls are posed by their `Transform`; that of
    /// driven nodes is written before Bevy propagates.
    #[default]
    Hierarchy,
    /// Only joints and exposed nodes are entities, below none. Exposed nodes are posed by their [`ControlPose`]; the
    /// `GlobalTransform` of joints is written after Bevy has propagated that of the rig.
    Direct,
}

/// A running rig.
#[derive(Component, Debug)]
pub struct RigRuntime {
    state: RigState,
    mode: InstanceMode,
    /// The entity of each slot.
    nodes: Vec<Option<Entity>>,
    /// Slots that are posed, and by which entity.
    controls: Vec<(u32, Entity)>,
    /// Slots that are written, and where.
    written: Vec<(u32, Entity)>,
    /// True if a control changed since the last run.
    is_due: bool,
}

impl RigRuntime {
    /// An instance whose nodes have no entities yet; see [`spawn_instance`].
    ///
    /// An instance in [`InstanceMode::Direct`] remembers only inputs and results.
    pub fn new(program: Arc<RigProgram>, mode: InstanceMode) -> Self {
        let memory = if mode == InstanceMode::Direct { Memory::Results } else { Memory::Whole };
        Self {
            nodes: vec![None; program.nodes().len()],
            state: RigState::with_memory(program, memory),
            mode,
            controls: Vec::new(),
            written: Vec::new(),
            is_due: false,
        }
    }

    /// Inputs and results.
    pub fn state(&self) -> &RigState {
        &self.state
    }

    /// Inputs, to be changed: they are taken up in the same frame. Leave evaluating to the plugin, or evaluate a clone:
    /// results of an evaluation that the plugin did not make are not handed out.
    pub fn state_mut(&mut self) -> &mut RigState {
        &mut self.state
    }

    /// How it hands out its results.
    pub fn mode(&self) -> InstanceMode {
        self.mode
    }

    /// The entity of a slot.
    pub fn entity(&self, slot: usize) -> Option<Entity> {
        self.nodes.get(slot).copied().flatten()
    }

    /// Says which entity stands for a slot. Controls are posed by it, joints and driven nodes are written to it. It has to
    /// have [`NodeSlot`] and [`RuntimeNodeOf`], as those of [`spawn_instance`] have.
    pub fn attach(&mut self, slot: usize, entity: Entity) {
        let Some(node) = self.state.program().nodes().get(slot) else { return };
        let is_control = node.kind == crate::rig::NodeType::Control && node.is_posable();
        let is_read = match self.mode {
            InstanceMode::Hierarchy => is_control,
            InstanceMode::Direct => node.is_posable(),
        };
        let is_written = match self.mode {
            // A control that nothing drives stands where it was put.
            InstanceMode::Hierarchy => !is_control || node.is_driven,
            // Whatever has a place in the world: joints, and what people gave one.
            InstanceMode::Direct => true,
        };
        let place = |list: &mut Vec<(u32, Entity)>, is_in: bool| {
            list.retain(|(known, _)| *known as usize != slot);
            if is_in {
                list.push((slot as u32, entity));
            }
        };
        place(&mut self.controls, is_read);
        place(&mut self.written, is_written);
        self.nodes[slot] = Some(entity);
        self.is_due = true;
    }
}

/// The running rig that an entity belongs to.
#[derive(Component, Debug, Clone, Copy)]
#[relationship(relationship_target = RuntimeNodes)]
pub struct RuntimeNodeOf(pub Entity);

/// The entities of a running rig; they go with it.
#[derive(Component, Debug, Default)]
#[relationship_target(relationship = RuntimeNodeOf, linked_spawn)]
pub struct RuntimeNodes(Vec<Entity>);

/// Which slot of its program an entity stands for.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeSlot(pub u32);

/// What an exposed node of an instance in [`InstanceMode::Direct`] is posed by: people, code or an animation curve.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
pub struct ControlPose {
    /// Translation in the node's space at rest.
    pub translation: Vec3,
    /// Rotation about the node's own axes, a unit quaternion.
    pub rotation: Quat,
    /// Factors along the node's own axes.
    pub scale: Vec3,
}

impl Default for ControlPose {
    fn default() -> Self {
        PoseOffset::IDENTITY.into()
    }
}

impl From<PoseOffset> for ControlPose {
    fn from(PoseOffset { translation, rotation, scale }: PoseOffset) -> Self {
        Self { translation, rotation, scale }
    }
}

impl From<ControlPose> for PoseOffset {
    fn from(ControlPose { translation, rotation, scale }: ControlPose) -> Self {
        Self { translation, rotation, scale }
    }
}

/// On a mesh: which of its morph targets a running rig drives, and their weights.
///
/// Where Bevy draws (feature `draw`), the weights go on to the mesh's `MeshMorphWeights`.
#[derive(Component, Debug, Clone, PartialEq)]
pub struct DrivenMorphs {
    /// The running rig.
    pub rig: Entity,
    /// Numbers of the mesh's targets, and slots of the program's.
    pub targets: Vec<(usize, usize)>,
    /// Weights in the order of `targets`, as the rig last gave them.
    pub weights: Vec<f32>,
}

impl DrivenMorphs {
    /// Connects the targets of a mesh, given by name in order, with those of a program.
    pub fn new(rig: Entity, program: &RigProgram, names: &[String]) -> Self {
        let slot = |(number, name): (usize, &String)| Some((number, program.morph(name)?));
        let targets: Vec<_> = names.iter().enumerate().filter_map(slot).collect();
        Self { rig, weights: vec![0.0; targets.len()], targets }
    }
}
