//! Running rigs: programs that are evaluated after Bevy's animation and before its propagation of transforms.
//!
//! A [`RigRuntime`] on an entity makes it an instance of a [`RigProgram`]. Each frame, instances whose inputs changed
//! read the poses of their controls, run (in parallel over instances) and write their results; others cost nothing. In
//! the editor every node is an entity with a `Transform`. In a game only joints and exposed controls are entities, and
//! joints get their `GlobalTransform` at once, so that a crowd does not propagate transforms of hidden nodes: see
//! [`InstanceMode`].
//!
//! The `Transform` of a node owns its pose: a `Transform` that differs from the one the program last wrote was written
//! by a person, an animation or a game, and becomes the node's pose offset before the program runs. The program then
//! writes the `Transform`s of all nodes that moved. The document's pose is passed on only where the document changes.

mod attachments;
pub(in crate::plugins) mod despawn;
mod driven_attributes;
mod hand_over;
mod inputs;
mod spawn;
mod systems;

use std::{collections::BTreeMap, sync::Arc};

use bevy::{math::Affine3A, prelude::*};

#[cfg(feature = "cli")]
pub(crate) use self::systems::is_same_place;
pub(crate) use self::{despawn::despawn_nodes, systems::is_near};
pub use self::{
    hand_over::{HandOver, OutsideTransform},
    inputs::RigInputs,
    spawn::{furnish_instance, spawn_instance},
};
pub use super::schema::{ControlPose, NodeOf, NodeSlot, RigNodes};
use super::{RigSystems, configure_sets, document::EditRefusal};
use crate::{
    rig::{AttributeValues, PoseOffset, Rig, Uid},
    solve::program::{Carry, Memory, RigProgram, RigState},
};

/// Plugin that runs rigs.
pub struct RuntimePlugin;

impl Plugin for RuntimePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        despawn::allow_any_depth(app);
        app.add_message::<EditRefusal>().add_systems(
            PostUpdate,
            (
                (
                    (inputs::check_inputs, inputs::read_inputs, systems::note_controls).chain(),
                    systems::feel_motion,
                    (systems::solve, driven_attributes::tell_driven, driven_attributes::tell_unknown).chain(),
                    (systems::scatter_locals, systems::scatter_attributes, systems::scatter_morphs).chain(),
                )
                    .chain()
                    .in_set(RigSystems::Solve),
                (
                    systems::scatter_globals,
                    systems::correct_globals,
                    hand_over::hand_over,
                    attachments::place_attachments,
                )
                    .chain()
                    .in_set(RigSystems::Scatter),
            ),
        );
        #[cfg(feature = "draw")]
        app.add_systems(PostUpdate, systems::show_morphs.in_set(RigSystems::Solve).after(systems::scatter_morphs));
    }
}

/// Output mode of an instance: the entities that its results are written to.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Default)]
#[reflect(Component, Default)]
pub enum InstanceMode {
    /// Every node is an entity in the same hierarchy as in the rig. Controls are posed by their `Transform`; that of
    /// driven nodes is written before Bevy propagates.
    #[default]
    Hierarchy,
    /// Joints and exposed nodes alone are entities, without parents. Exposed nodes are posed by their [`ControlPose`];
    /// the `GlobalTransform` of joints is written after Bevy has propagated the rig's.
    Direct,
}

/// Running instance of a [`RigProgram`], on the entity of a rig.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone)]
pub struct RigRuntime {
    state: RigState,
    mode: InstanceMode,
    /// Entity of each slot.
    nodes: Vec<Option<Entity>>,
    /// Slots whose poses are read, each with its entity.
    controls: Vec<(u32, Entity)>,
    /// Slots whose transforms are written, each with its entity.
    written: Vec<(u32, Entity)>,
    /// Local `Transform` that was last written to or read from the entity of each slot; empty in
    /// [`InstanceMode::Direct`].
    shown: Vec<Transform>,
    /// Slots whose `Transform` other code wrote; the next run writes them again even if the node has not moved.
    rewritten: Vec<bool>,
    has_rewritten: bool,
    /// True if the next run compares attribute values with the entities that hold them, even if no operation runs.
    attributes_due: bool,
    /// Slots of the attributes that each entity holds.
    attributes: BTreeMap<Entity, Vec<u32>>,
    /// Attribute values last written to or read from entities.
    values: Vec<f32>,
    /// Attributes that constraints drive and other code wrote: holder and slot, until they are told.
    driven_writes: Vec<(Entity, u32)>,
    /// Holders of values of attributes that their nodes do not have, until they are told.
    unknown_writes: Vec<Entity>,
    /// Pose offsets of the document that were last passed on.
    posed: BTreeMap<Uid, PoseOffset>,
    valued: AttributeValues,
    /// True if a document says what the pose and the attribute values are.
    is_of_document: bool,
    /// True if a control has changed since the last run.
    is_due: bool,
    /// True if the next run writes all entities.
    all_due: bool,
    /// Place of the rig in the world at the last run, for springs that feel its motion.
    world: Option<Affine3A>,
}

impl RigRuntime {
    /// Instance whose nodes have no entities yet; see [`spawn_instance`].
    ///
    /// An instance in [`InstanceMode::Direct`] remembers only inputs and results.
    pub fn new(program: Arc<RigProgram>, mode: InstanceMode) -> Self {
        let memory = if mode == InstanceMode::Direct { Memory::Results } else { Memory::Whole };
        Self {
            nodes: vec![None; program.nodes().len()],
            shown: vec![Transform::IDENTITY; if mode == InstanceMode::Hierarchy { program.nodes().len() } else { 0 }],
            rewritten: vec![false; program.nodes().len()],
            has_rewritten: false,
            attributes_due: false,
            attributes: BTreeMap::new(),
            values: vec![f32::NAN; program.attributes().len()],
            driven_writes: Vec::new(),
            unknown_writes: Vec::new(),
            posed: BTreeMap::new(),
            valued: AttributeValues::new(),
            is_of_document: false,
            all_due: mode == InstanceMode::Hierarchy,
            state: RigState::with_memory(program, memory),
            mode,
            controls: Vec::new(),
            written: Vec::new(),
            is_due: false,
            world: None,
        }
    }

    /// Inputs and results.
    pub fn state(&self) -> &RigState {
        &self.state
    }

    /// Inputs for changes, which take effect in the same frame. Leave the evaluation to the plugin, or evaluate a
    /// clone: the plugin does not write the results of other evaluations to entities.
    pub fn state_mut(&mut self) -> &mut RigState {
        &mut self.state
    }

    /// Local `Transform` that was last written to or read from the entity of a node; `None` if there is none.
    pub(in crate::plugins) fn shown_at(&self, node: Uid) -> Option<Transform> {
        let slot = self.state.program().node(node)?;
        self.shown.get(slot).copied().filter(Transform::is_finite)
    }

    /// Output mode of the instance.
    pub fn mode(&self) -> InstanceMode {
        self.mode
    }

    /// Entity of a slot.
    pub fn entity(&self, slot: usize) -> Option<Entity> {
        self.nodes.get(slot).copied().flatten()
    }

    /// Connects a slot with an entity, which poses the slot's node and receives its results. The entity needs
    /// [`NodeOf`] and, in [`InstanceMode::Direct`], [`NodeSlot`]; entities of [`spawn_instance`] have them.
    pub fn attach(&mut self, slot: usize, entity: Entity) {
        let Some(node) = self.state.program().nodes().get(slot) else { return };
        let is_read = node.is_posable() || self.mode == InstanceMode::Hierarchy;
        let had_any = self.nodes[slot].is_some();
        let place = |list: &mut Vec<(u32, Entity)>, is_in: bool| {
            if had_any {
                list.retain(|(known, _)| *known as usize != slot);
            }
            if is_in {
                list.push((slot as u32, entity));
            }
        };
        place(&mut self.controls, is_read);
        place(&mut self.written, true);
        if let Some(shown) = self.shown.get_mut(slot) {
            // The program has never written this entity, so its transform is no pose.
            *shown = UNSEEN;
        }
        self.nodes[slot] = Some(entity);
        // Attributes are in the order of their nodes.
        let attributes = self.state.program().attributes();
        let first = attributes.partition_point(|attribute| attribute.node < slot);
        let slots = first..first + attributes[first..].partition_point(|attribute| attribute.node == slot);
        if !slots.is_empty() {
            // Values of an entity that the program has never written are none that other code set.
            self.values[slots.clone()].fill(f32::NAN);
            let slots: Vec<u32> = slots.map(|number| number as u32).collect();
            if had_any {
                self.attributes.retain(|_, known| known != &slots);
            }
            self.attributes.insert(entity, slots);
        }
        if self.mode == InstanceMode::Direct {
            self.state.mark_moved();
        }
        self.is_due = true;
        self.all_due = self.mode == InstanceMode::Hierarchy;
    }

    /// Passes on the pose and the attribute values of a document where they differ from the last ones; the rest pose if
    /// `is_posed` is false.
    pub(super) fn pose_from(&mut self, rig: &Rig, is_posed: bool) {
        self.is_of_document = true;
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

    /// Sets the pose offset of a node that already stands at this offset of the document.
    pub(super) fn note_pose(&mut self, node: Uid, offset: PoseOffset) {
        if offset != PoseOffset::IDENTITY && self.state.set_offset(node, offset).is_ok() {
            self.posed.insert(node, offset);
        }
    }

    /// Carries the motion of the same rig's previous program over to this one.
    pub(super) fn carry_over(&mut self, before: &Self) {
        self.carry_along(before, &Carry::between(before.state.program(), self.state.program()));
    }

    fn carry_along(&mut self, before: &Self, carry: &Carry) {
        self.state.carry_along(&before.state, carry);
        // What the document says of nodes that come back, from a roll back for example, is passed on again.
        let known = |node: &Uid| before.state.program().node(*node).is_some();
        self.posed = before.posed.iter().filter(|(node, _)| known(node)).map(|(node, at)| (*node, *at)).collect();
        self.valued = before.valued.iter().filter(|(node, _)| known(node)).map(|(n, v)| (*n, v.clone())).collect();
        self.is_of_document = before.is_of_document;
        self.world = before.world;
        for (slot, from) in carry.nodes().iter().enumerate() {
            let Some((from, entity)) = from.and_then(|from| Some((from, before.entity(from)?))) else { continue };
            self.attach(slot, entity);
            if let (Some(shown), Some(known)) = (self.shown.get_mut(slot), before.shown.get(from)) {
                *shown = *known;
            }
        }
    }

    /// Takes over the inputs, the results and the springs of a state of the same program, which the next frame writes to
    /// the entities; returns false, and changes nothing, if the state is one of another program.
    pub fn go_on_from(&mut self, state: &RigState) -> bool {
        let is_same = self.state.hash() == state.hash();
        if is_same {
            self.state.clone_from(state);
            if self.mode == InstanceMode::Direct {
                self.state.mark_moved();
            }
            self.is_due = true;
            self.all_due = self.mode == InstanceMode::Hierarchy;
        }
        is_same
    }

    /// Goes on with another program of the same rig: poses, attribute values, the motion of springs and the entities of
    /// nodes stay. `carry` is [`Carry::between`] the two programs. Nodes that are new have no entities yet, and those of
    /// nodes that are gone are left alone: see [`furnish_instance`].
    pub fn exchange(&mut self, program: &Arc<RigProgram>, carry: &Carry) {
        if carry.is_aligned() {
            self.state.exchange(program, carry);
            // Values that no operation computes may be others, too.
            self.attributes_due = true;
            // Poses that the bounds of before cut off may be free now.
            self.is_due |= !carry.has_same_bounds();
            // Results that no operation computes any more have other values, too.
            self.all_due |= self.mode == InstanceMode::Hierarchy && !carry.is_partial();
            return;
        }
        let mut fresh = Self::new(Arc::clone(program), self.mode);
        fresh.carry_along(self, carry);
        *self = fresh;
    }

    /// Lets the next run write all driven attributes. A build writes its defaults to the same entities, which is no write
    /// of other code.
    pub(super) fn forget_driven(&mut self) {
        let driven = self.values.iter_mut().zip(self.state.program().attributes());
        driven.filter(|(_, attribute)| !attribute.is_settable).for_each(|(value, _)| *value = f32::NAN);
        self.attributes_due = true;
    }
}

/// Marker for a slot whose entity has not been written yet; no entity has this transform.
const UNSEEN: Transform = Transform { translation: Vec3::NAN, rotation: Quat::IDENTITY, scale: Vec3::ONE };

/// Morph targets of a mesh that a running rig drives, with their weights; on the mesh's entity.
///
/// With the feature `draw`, the weights are copied to the mesh's `MeshMorphWeights`.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[reflect(Component)]
pub struct DrivenMorphs {
    /// The running rig.
    pub rig: Entity,
    /// Pairs of the target's number in the mesh and its slot in the program.
    pub targets: Vec<(usize, usize)>,
    /// Weights in the order of `targets`, as the rig last set them.
    pub weights: Vec<f32>,
}

impl DrivenMorphs {
    /// Connects the morph targets of a mesh, given by name in order, with those of a program.
    pub fn new(rig: Entity, program: &RigProgram, names: &[String]) -> Self {
        let slot = |(number, name): (usize, &String)| Some((number, program.morph(name)?));
        let targets: Vec<_> = names.iter().enumerate().filter_map(slot).collect();
        Self { rig, weights: vec![0.0; targets.len()], targets }
    }
}
