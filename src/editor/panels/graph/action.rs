//! Actions of the graph, by name, with the reasons why they can do nothing at present.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{model::has_frames, state::GraphView};
use crate::{
    editor::{ActiveRig, actions::Action},
    rig::{Rig, TagKind},
};

/// An action of the graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum GraphAction {
    /// Forgets the places that nodes were moved to, and lays the graph out.
    LayOut,
    /// Brings all nodes into view.
    ShowAll,
    /// Brings the selected nodes into view.
    ShowSelected,
    /// Opens all frames.
    OpenFrames,
    /// Folds all frames.
    FoldFrames,
    /// Selects all commands.
    SelectAll,
    /// Selects no command.
    SelectNone,
    /// Turns the selected commands on, or off if all are on.
    Toggle,
    /// Deletes the selected commands.
    Delete,
}

impl GraphAction {
    /// Every action.
    pub const ALL: [Self; 9] = [
        Self::LayOut,
        Self::ShowAll,
        Self::ShowSelected,
        Self::OpenFrames,
        Self::FoldFrames,
        Self::SelectAll,
        Self::SelectNone,
        Self::Toggle,
        Self::Delete,
    ];

    /// Description in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::LayOut => "Lay the graph out again",
            Self::ShowAll => "Whole graph in the panel",
            Self::ShowSelected => "Selected commands in the panel",
            Self::OpenFrames => "Open all frames of the graph",
            Self::FoldFrames => "Fold all frames of the graph",
            Self::SelectAll => "Select all commands",
            Self::SelectNone => "Select no commands",
            Self::Toggle => "Selected commands on or off",
            Self::Delete => "Delete the selected commands",
        }
    }
}

/// The action of a key while the pointer is over the graph: what selects and deletes joints elsewhere selects and deletes
/// commands there, and what frames joints frames commands.
pub fn over_graph(action: Action) -> Action {
    let own = match action {
        Action::Delete => GraphAction::Delete,
        Action::SelectAll => GraphAction::SelectAll,
        Action::SelectNone => GraphAction::SelectNone,
        Action::FrameAll => GraphAction::ShowAll,
        Action::FrameSelected => GraphAction::ShowSelected,
        action => return action,
    };
    Action::Graph(own)
}

/// The reason why an action can do nothing at present, in a few words; `None` if it can.
pub fn obstacle(world: &World, action: GraphAction) -> Option<&'static str> {
    let Some(active) = world.get_resource::<ActiveRig>() else { return Some("no rig is open") };
    let rig = world.get::<Rig>(active.0)?;
    let view = world.get_resource::<GraphView>()?;
    let mut tags = rig.walk().flat_map(|joint| &joint.data.tags);
    if !tags.any(|tag| matches!(tag.kind, TagKind::Command { .. })) {
        return Some("no joint has commands: add tags, or a part");
    }
    match action {
        GraphAction::LayOut => view.moved.is_empty().then_some("no node was moved by hand"),
        GraphAction::ShowAll | GraphAction::SelectAll => None,
        GraphAction::OpenFrames | GraphAction::FoldFrames => {
            (!has_frames(rig)).then_some("no command is in a feature or a local group")
        }
        GraphAction::ShowSelected | GraphAction::SelectNone | GraphAction::Toggle | GraphAction::Delete => {
            view.selected.is_empty().then_some("no command is selected in the Graph")
        }
    }
}
