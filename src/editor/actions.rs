//! Everything a key, a menu or a button can ask for, by name.
//!
//! Keys are bound to actions in [`keys`](super::keys); whoever carries an action out reads [`ActionRequest`] messages.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::mode::Mode;

/// One thing a person can ask for with a key, a menu entry or a button.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Action {
    /// Changes the mode.
    Mode(Mode),
    /// An empty project.
    New,
    /// Asks for a file to open.
    Open,
    /// Saves the project where it was saved before, or asks.
    Save,
    /// Asks where to save the project.
    SaveAs,
    /// Asks where to export the character, or the template.
    Export,
    /// Closes the window, after asking about unsaved changes.
    Quit,
    /// Takes the last step back.
    Undo,
    /// Does the last undone step again.
    Redo,
    /// Deletes the selected joints; what hangs below them moves up.
    Delete,
    /// Deletes the selected joints and all that hangs below them.
    DeleteHierarchy,
    /// Selects all joints.
    SelectAll,
    /// Selects none.
    SelectNone,
    /// Makes the other side of the selected joints.
    MirrorSelected,
    /// Live symmetry on or off.
    Symmetry,
    /// Whether children move along with their parent.
    MoveChildren,
    /// Takes what is being drawn or dragged.
    Accept,
    /// Drops what is being drawn or dragged.
    Cancel,
    /// The next volume under the pointer.
    NextVolume,
    /// Computes weights for all meshes.
    Skin,
    /// Takes the pose of the selected joints back, or of all if none is selected.
    ResetPose,
    /// Keeps the pose under a name.
    StorePose,
    /// World, local or view axes for gizmos.
    GizmoSpace,
    /// Shows the selected joints, or everything if none is selected.
    FrameSelected,
    /// Shows everything.
    FrameAll,
    /// From the front.
    ViewFront,
    /// From behind.
    ViewBack,
    /// From the character's left.
    ViewLeft,
    /// From the character's right.
    ViewRight,
    /// From above.
    ViewTop,
    /// From below.
    ViewBottom,
    /// Perspective or orthographic.
    Projection,
    /// The mesh half transparent.
    XRay,
    /// The edges of the mesh.
    Wireframe,
    /// Labels of all joints.
    Labels,
    /// Axes of the selected joints.
    LocalAxes,
    /// The grid.
    Grid,
    /// The keys and what they do.
    Help,
}

/// Asks for an action.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActionRequest(pub Action);
