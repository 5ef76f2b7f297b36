//! State of the graph: selected commands, nodes that were moved by hand, frames that are folded, what is in view. It belongs
//! to the window and lasts as long as the rig is open; only the places of nodes are stored, with the project's view.

use std::collections::{BTreeMap, BTreeSet};

use bevy::prelude::*;

use super::{layout::snapped, model::frame_of};
use crate::rig::{Rig, Uid};

/// State of the graph of the active rig.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct GraphView {
    /// The rig that the state is of.
    pub rig: Option<Entity>,
    /// Selected command tags.
    pub selected: BTreeSet<Uid>,
    /// Places of nodes and folded frames that were moved by hand, on the grid.
    pub moved: BTreeMap<Uid, [f32; 2]>,
    /// Frames that a person opened or folded: `true` for open ones.
    pub folds: BTreeMap<Uid, bool>,
    /// Choice for all other frames; `None` opens them in a graph of few commands.
    pub every: Option<bool>,
    /// Frames that are open because of the selection.
    pub lit: BTreeSet<Uid>,
    /// Request of the view, with the number of requests before it.
    pub look: (u64, GraphLook),
    /// True while the pointer is over the graph, which then takes the keys that delete and select.
    pub hovered: bool,
}

/// Most commands of a graph whose frames are open at first, and of a selection that opens frames.
pub const FEW: usize = 60;

impl GraphView {
    /// State of a rig that was opened, with stored places.
    pub fn opened(rig: Entity, places: &BTreeMap<Uid, [f32; 2]>) -> Self {
        let finite = places.iter().filter(|(_, place)| place.iter().all(|number| number.is_finite()));
        let moved = finite.map(|(uid, place)| (*uid, snapped(*place))).collect();
        Self { rig: Some(rig), moved, ..Self::default() }
    }

    /// Places that are stored: those of commands and frames that a rig has.
    pub fn places(&self, rig: &Rig) -> BTreeMap<Uid, [f32; 2]> {
        let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (&joint.data, tag)));
        let known: BTreeSet<Uid> =
            tags.flat_map(|(joint, tag)| [Some(tag.uid), frame_of(rig, joint, tag)]).flatten().collect();
        self.moved.iter().filter(|(uid, _)| known.contains(uid)).map(|(uid, place)| (*uid, *place)).collect()
    }

    /// True if a frame is open in a graph of so many commands.
    pub fn is_open(&self, frame: Uid, commands: usize) -> bool {
        let usual = || self.every.unwrap_or(commands <= FEW) || self.lit.contains(&frame);
        self.folds.get(&frame).copied().unwrap_or_else(usual)
    }
}

/// Part of the graph that is brought into view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GraphLook {
    /// All nodes.
    #[default]
    All,
    /// The selected nodes.
    Selected,
}

/// Request to change what the graph shows. Requests never change a document.
#[derive(Message, Debug, Clone, PartialEq)]
pub enum GraphRequest {
    /// Selects command tags in place of the selected ones, and the joints that carry them.
    Select(BTreeSet<Uid>),
    /// Puts nodes and folded frames to places.
    Move(Vec<(Uid, [f32; 2])>),
    /// Opens a frame, or folds it.
    Fold(Uid, bool),
    /// Tells whether the pointer is over the graph.
    Hover(bool),
}
