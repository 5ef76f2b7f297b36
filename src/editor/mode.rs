//! Modes: the action of the pointer in the viewport.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Mode of the pointer in the viewport. Tools run in their modes; changing the mode deletes nothing.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum Mode {
    /// Clicks select joints, drags select boxes.
    #[default]
    Select,
    /// Clicks place joints.
    Place,
    /// Strokes become chains.
    Stroke,
    /// A gizmo moves the selected joints at rest.
    Move,
    /// A gizmo turns the selected joints at rest.
    Rotate,
    /// A gizmo scales the selected joints at rest.
    Scale,
    /// A gizmo turns the selected joints on top of the rest pose, and drags pull joints; the rest pose stays.
    Pose,
    /// Shows the weights of the selected joint.
    Weights,
    /// A brush changes the weights of the selected joint.
    Paint,
}

impl Mode {
    /// Every mode, in the order of the toolbar.
    pub const ALL: [Self; 9] = [
        Self::Select,
        Self::Place,
        Self::Stroke,
        Self::Move,
        Self::Rotate,
        Self::Scale,
        Self::Pose,
        Self::Weights,
        Self::Paint,
    ];

    /// The name on the toolbar.
    pub fn name(self) -> &'static str {
        match self {
            Self::Select => "Select",
            Self::Place => "Place",
            Self::Stroke => "Stroke",
            Self::Move => "Move",
            Self::Rotate => "Rotate",
            Self::Scale => "Scale",
            Self::Pose => "Pose",
            Self::Weights => "Weights",
            Self::Paint => "Paint",
        }
    }
}

/// Run condition of tools: `mode` is the current one.
pub fn in_mode(mode: Mode) -> impl FnMut(Option<Res<Mode>>) -> bool + Clone {
    move |now| now.is_some_and(|now| *now == mode)
}
