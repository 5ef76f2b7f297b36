//! The rig that panels show.

use std::borrow::Cow;

use bevy::{ecs::change_detection::Tick, prelude::*};
use bevy_egui::egui::Color32;

use crate::{
    editor::ActiveRig,
    plugins::document::{HoveredNode, Selection},
    rig::{BuiltRig, JointData, Rig, Uid},
};

/// The active rig and its selection.
pub(super) struct DisplayedRig<'w> {
    pub entity: Entity,
    pub rig: Ref<'w, Rig>,
    pub selection: Ref<'w, Selection>,
    pub hovered: Option<Uid>,
}

/// Rig and state that derived data was made from; unequal as soon as the data is out of date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamp {
    entity: Entity,
    rig: Tick,
}

impl Stamp {
    /// True for the state of that rig, however old.
    pub fn is_of(self, entity: Entity) -> bool {
        self.entity == entity
    }
}

impl<'w> DisplayedRig<'w> {
    /// The active rig; `None` before there is one.
    pub fn of(world: &'w World) -> Option<Self> {
        let entity = world.get_resource::<ActiveRig>()?.0;
        let rig = world.get_entity(entity).ok()?;
        Some(Self {
            entity,
            hovered: rig.get::<HoveredNode>().and_then(|hovered| hovered.0),
            rig: rig.get_ref()?,
            selection: rig.get_ref()?,
        })
    }

    /// The state of the rig.
    pub fn stamp(&self) -> Stamp {
        Stamp { entity: self.entity, rig: self.rig.last_changed() }
    }

    /// The state of the selection.
    pub fn selection_stamp(&self) -> Stamp {
        Stamp { entity: self.entity, rig: self.selection.last_changed() }
    }

    /// Name of a joint for people.
    pub fn name(&self, joint: Uid) -> Cow<'_, str> {
        self.rig.joint(joint).map_or_else(|| Cow::Owned(unlabelled(joint)), |joint| joint_name(&joint.data))
    }

    /// The colour of a joint's group.
    pub fn color(&self, joint: Uid) -> Option<Color32> {
        let group = self.rig.joint(joint)?.data.group?;
        self.rig.group(group).map(|group| color(group.color))
    }
}

/// Name of a joint for people: its label, or the first digits of its uid.
pub fn joint_name(joint: &JointData) -> Cow<'_, str> {
    joint.name()
}

/// Name of a node for people: of a joint, or the one that a command gave to what it made.
pub(super) fn node_name(rig: &Rig, built: Option<&BuiltRig>, node: Uid) -> String {
    let made = || built.and_then(|built| built.node(node)).map(|made| made.name.to_string());
    let joint = rig.joint(node).map(|joint| joint_name(&joint.data).into_owned());
    joint.or_else(made).unwrap_or_else(|| unlabelled(node))
}

fn unlabelled(joint: Uid) -> String {
    format!("joint {:04x}", joint.0 >> 48)
}

/// A group's colour (sRGB, 0 to 1) on the screen.
pub(super) fn color([r, g, b]: [f32; 3]) -> Color32 {
    let byte = |part: f32| (part.clamp(0.0, 1.0) * 255.0).round() as u8;
    Color32::from_rgb(byte(r), byte(g), byte(b))
}
