//! What the editor remembers between runs.

use std::path::PathBuf;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::actions::{Action, ActionRequest};

/// Adds the settings and the switches in them.
pub struct SettingsPlugin;

impl Plugin for SettingsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<EditorSettings>().add_systems(Update, switch);
    }
}

/// Switches and lists that are kept.
#[derive(Resource, Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(default)]
pub struct EditorSettings {
    /// Files that were opened, the last one first.
    pub recent: Vec<PathBuf>,
    /// True to let children move along with their parent.
    pub move_children: bool,
    /// The axes of gizmos.
    pub gizmo_space: GizmoSpace,
}

/// The axes that gizmos move, turn and scale along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum GizmoSpace {
    /// Those of the world.
    #[default]
    World,
    /// Those of the joint.
    Local,
    /// Those of the screen.
    View,
}

impl GizmoSpace {
    /// The name on the toolbar.
    pub fn name(self) -> &'static str {
        match self {
            Self::World => "World",
            Self::Local => "Local",
            Self::View => "View",
        }
    }

    /// The next one.
    pub fn next(self) -> Self {
        match self {
            Self::World => Self::Local,
            Self::Local => Self::View,
            Self::View => Self::World,
        }
    }
}

impl EditorSettings {
    /// Puts a file at the top of the recent ones; ten are kept.
    pub fn remember(&mut self, path: PathBuf) {
        self.recent.retain(|known| *known != path);
        self.recent.insert(0, path);
        self.recent.truncate(10);
    }
}

fn switch(mut actions: MessageReader<ActionRequest>, mut settings: ResMut<EditorSettings>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::MoveChildren => settings.move_children = !settings.move_children,
            Action::GizmoSpace => settings.gizmo_space = settings.gizmo_space.next(),
            _ => {}
        }
    }
}
