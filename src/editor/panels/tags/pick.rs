//! Nodes that a person picks for a reference: the card stays while joints or controls are clicked in the viewport, the
//! Hierarchy or a list, and its joints are selected again afterwards.

use bevy::prelude::*;
use bevy_egui::egui::{Key, Ui};

use crate::{
    editor::panels::displayed_rig::DisplayedRig,
    plugins::commands::{BuildResult, Processor},
    processor::Builder,
    rig::{BuiltRig, NodeRef, NodeRefs, Uid, reference::PickAt},
};

/// Parameter that waits for nodes to be picked.
#[derive(Debug, Clone)]
pub(super) struct Picking {
    rig: Entity,
    /// First tag of the card.
    pub tag: Uid,
    /// Path of the parameter.
    pub path: String,
    /// Joints whose tags the card shows.
    pub joints: Vec<Uid>,
    /// Frame in which the panel was drawn last.
    frame: Option<u64>,
}

/// State of a parameter that waits for nodes.
pub(super) enum PickStep {
    /// Nothing was picked yet.
    Waits(Picking),
    /// Nodes were picked: the text of the reference to them.
    Taken(Picking, String),
    /// Escape was pressed, or nothing is selected any more.
    Dropped(Picking),
    /// The rig, the tag or the panel is not there any more.
    Left,
}

impl PickStep {
    /// Joints whose tags are shown, whatever is selected.
    pub fn joints(&self) -> Option<&[Uid]> {
        match self {
            Self::Waits(picking) | Self::Taken(picking, _) | Self::Dropped(picking) => Some(&picking.joints),
            Self::Left => None,
        }
    }
}

impl Picking {
    /// A parameter of the tags of joints, which begins to wait.
    pub fn new(shown: &DisplayedRig, tag: Uid, path: String, joints: Vec<Uid>) -> Self {
        Self { rig: shown.entity, tag, path, joints, frame: None }
    }

    /// Takes in what is selected in this frame.
    pub fn step(mut self, ui: &Ui, world: &World, shown: &DisplayedRig) -> PickStep {
        let frame = ui.ctx().cumulative_frame_nr();
        // Whoever turned to another tab meanwhile selects for other reasons.
        let was_hidden = self.frame.is_some_and(|last| frame > last + 1);
        self.frame = Some(frame);
        if was_hidden || shown.entity != self.rig || shown.rig.find_tag(self.tag).is_none() {
            return PickStep::Left;
        }
        let selected = &shown.selection.0;
        if selected.is_empty() || ui.input(|input| input.key_pressed(Key::Escape)) {
            return PickStep::Dropped(self);
        }
        if *selected == self.joints {
            return PickStep::Waits(self);
        }
        // With Shift the joints of the card stay selected beside what is picked.
        let others: Vec<Uid> = selected.iter().copied().filter(|node| !self.joints.contains(node)).collect();
        let nodes = if others.is_empty() { selected } else { &others };
        match reference(world, shown, &self.joints, nodes) {
            Some(text) => PickStep::Taken(self, text),
            None => PickStep::Dropped(self),
        }
    }
}

/// Text of a reference to joints.
pub(super) fn joints(shown: &DisplayedRig, joints: &[Uid]) -> String {
    NodeRefs(joints.iter().copied().map(NodeRef::joint).collect()).to_text(&*shown.rig)
}

/// Text of a reference to nodes for commands of joints: to joints by themselves, to nodes that commands made by command and
/// role. `None` if none of the nodes is there.
fn reference(world: &World, shown: &DisplayedRig, readers: &[Uid], nodes: &[Uid]) -> Option<String> {
    let built = world.get::<BuildResult>(shown.entity).map(|built| &*built.0);
    let builder = world.get::<Processor>(shown.entity).map(Processor::builder);
    let of = |node: &Uid| match shown.rig.joint(*node) {
        Some(_) => Some(NodeRef::joint(*node)),
        None => created(built?, builder, shown, readers.first().copied(), *node),
    };
    let references = NodeRefs(nodes.iter().filter_map(of).collect());
    (!references.is_empty()).then(|| references.to_text(&*shown.rig))
}

/// Reference to a node that a command made.
fn created(
    built: &BuiltRig,
    builder: Option<&Builder>,
    shown: &DisplayedRig,
    reader: Option<Uid>,
    node: Uid,
) -> Option<NodeRef> {
    let origin = built.node(node)?.origin.as_ref()?;
    let mut all = NodeRef::command(origin.command);
    if !origin.role.is_empty() {
        all = all.with_role(&*origin.role);
    }
    let found = builder.zip(reader).and_then(|(builder, reader)| {
        builder.find_from(&shown.rig, reader, &all.to_string()).ok().filter(|found| found.len() > 1)
    });
    let place = found.and_then(|found| found.iter().position(|other| *other == node));
    Some(match place {
        Some(place) => all.picking([PickAt::Number(place as u32)]),
        None => all,
    })
}
