//! Rigs that run: programs between Bevy's animation and its propagation of transforms.
//!
//! A [`RigRuntime`] on an entity makes it an instance of a [`RigProgram`]. Each frame, instances whose inputs changed
//! take the poses of their controls, run (in parallel over instances) and hand out what came of it; others cost nothing.
//! In the editor every node is an entity with a `Transform`. In a game only joints and exposed controls are, and joints
//! get their `GlobalTransform` at once, so that a crowd does not propagate what nobody sees: see [`InstanceMode`].
//!
//! The `Transform` of a node owns its pose: a `Transform` that differs from what the program last wrote was written by a
//! person, an animation or a game, and becomes the node's pose offset before the program runs. The program then writes
//! the `Transform`s of all nodes whose place differs. The document's pose is handed over only where the document changes.

mod spawn;
mod systems;

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::*;

pub use self::spawn::spawn_instance;
pub use super::schema::{NodeOf, RigNodes};
use super::{RigSystems, configure_sets};
use crate::{
    rig::{AttributeValues, PoseOffset, Rig, Uid},
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
                (
                    systems::note_controls,
                    systems::solve,
                    (systems::scatter_locals, systems::scatter_attributes, systems::scatter_morphs).chain(),
                )
                    .chain()
                    .in_set(RigSystems::Solve),
                (systems::scatter_globals, systems::correct_globals).chain().in_set(RigSystems::Scatter),
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
#[derive(Component, Debug, Clone)]
pub struct RigRuntime {
    state: RigState,
    mode: InstanceMode,
    /// The entity of each slot.
    nodes: Vec<Option<Entity>>,
    /// Slots that are posed, and by which entity.
    controls: Vec<(u32, Entity)>,
    /// Slots that are written, and where.
    written: Vec<(u32, Entity)>,
    /// The `Transform` that each slot's entity was last given or read with, where every node is an entity.
    shown: Vec<Transform>,
    /// Slots whose `Transform` somebody else wrote: they are looked at after the run even if nothing moved.
    rewritten: Vec<bool>,
    has_rewritten: bool,
    /// Slots of attributes whose entity holds them, by that entity.
    attributes: BTreeMap<Entity, Vec<u32>>,
    /// The values that attributes were last shown with.
    values: Vec<f32>,
    /// The pose and the values of the document that were last handed over.
    posed: BTreeMap<Uid, PoseOffset>,
    valued: AttributeValues,
    /// True if a control changed since the last run.
    is_due: bool,
    /// True if all entities are looked at after the next run.
    all_due: bool,
}

impl RigRuntime {
    /// An instance whose nodes have no entities yet; see [`spawn_instance`].
    ///
    /// An instance in [`InstanceMode::Direct`] remembers only inputs and results.
    pub fn new(program: Arc<RigProgram>, mode: InstanceMode) -> Self {
        let memory = if mode == InstanceMode::Direct { Memory::Results } else { Memory::Whole };
        Self {
            nodes: vec![None; program.nodes().len()],
            shown: vec![Transform::IDENTITY; if mode == InstanceMode::Hierarchy { program.nodes().len() } else { 0 }],
            rewritten: vec![false; program.nodes().len()],
            has_rewritten: false,
            attributes: BTreeMap::new(),
            values: vec![f32::NAN; program.attributes().len()],
            posed: BTreeMap::new(),
            valued: AttributeValues::new(),
            all_due: mode == InstanceMode::Hierarchy,
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

    /// Lets an entity stand for a slot: it poses the node, and the program writes it. It has to have [`NodeOf`], and
    /// [`NodeSlot`] in [`InstanceMode::Direct`], as those of [`spawn_instance`] have.
    pub fn attach(&mut self, slot: usize, entity: Entity) {
        let Some(node) = self.state.program().nodes().get(slot) else { return };
        let is_read = node.is_posable() || self.mode == InstanceMode::Hierarchy;
        let place = |list: &mut Vec<(u32, Entity)>, is_in: bool| {
            list.retain(|(known, _)| *known as usize != slot);
            if is_in {
                list.push((slot as u32, entity));
            }
        };
        place(&mut self.controls, is_read);
        place(&mut self.written, true);
        if let Some(shown) = self.shown.get_mut(slot) {
            // An entity that was never written: whatever it says is no pose.
            *shown = UNSEEN;
        }
        self.nodes[slot] = Some(entity);
        let slots =
            self.state.program().attributes().iter().enumerate().filter(|(_, attribute)| attribute.node == slot);
        let slots: Vec<u32> = slots.map(|(number, _)| number as u32).collect();
        if !slots.is_empty() {
            self.attributes.retain(|_, known| known != &slots);
            self.attributes.insert(entity, slots);
        }
        self.is_due = true;
        self.all_due = self.mode == InstanceMode::Hierarchy;
    }

    /// Hands over the pose and the attribute values of a document where they differ from those that were last handed
    /// over; a rest pose if `is_posed` is false.
    pub(super) fn pose_from(&mut self, rig: &Rig, is_posed: bool) {
        let none = BTreeMap::new();
        let pose = if is_posed { rig.pose() } else { &none };
        if self.posed != *pose {
            let touched: Vec<Uid> = self.posed.keys().chain(pose.keys()).copied().collect();
            for uid in touched {
                let offset = pose.get(&uid);
                if self.posed.get(&uid) != offset
                    && let Some(slot) = self.state.program().node(uid)
                {
                    self.state.set_offset_at(slot, offset.copied().unwrap_or_default());
                }
            }
            self.posed.clone_from(pose);
        }
        let values = rig.attribute_values();
        if self.valued != *values {
            for slot in 0..self.values.len() {
                let attribute = &self.state.program().attributes()[slot];
                let node = self.state.program().nodes()[attribute.node].uid;
                let of = |values: &AttributeValues| values.get(&node).and_then(|of| of.get(&*attribute.name)).copied();
                let (before, now, default) = (of(&self.valued), of(values), attribute.default);
                if before != now {
                    self.state.set_attribute_at(slot, now.unwrap_or(default));
                }
            }
            self.valued.clone_from(values);
        }
    }

    /// Notes the offset of the document that a node stands with already.
    pub(super) fn note_pose(&mut self, node: Uid, offset: PoseOffset) {
        if offset != PoseOffset::IDENTITY && self.state.set_offset(node, offset).is_ok() {
            self.posed.insert(node, offset);
        }
    }

    /// Lets the motion of the same rig's program before go on in this one.
    pub(super) fn carry_over(&mut self, before: &Self) {
        self.state.carry_over(&before.state);
        self.posed.clone_from(&before.posed);
        self.valued.clone_from(&before.valued);
        for (slot, entity) in before.nodes.iter().enumerate() {
            let uid = before.state.program().nodes()[slot].uid;
            if let (Some(entity), Some(now)) = (entity, self.state.program().node(uid)) {
                self.attach(now, *entity);
                if let (Some(shown), Some(known)) = (self.shown.get_mut(now), before.shown.get(slot)) {
                    *shown = *known;
                }
            }
        }
    }
}

/// A transform that no entity has.
const UNSEEN: Transform = Transform { translation: Vec3::NAN, rotation: Quat::IDENTITY, scale: Vec3::ONE };

/// The slot of a program that an entity stands for.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[component(immutable)]
#[reflect(Component)]
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
