//! Actions of keys, menus and buttons, by name.
//!
//! Keys are bound to actions in [`keys`](super::keys); the systems that carry actions out read [`ActionRequest`]
//! messages.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    ActiveRig,
    library::LibraryAction,
    mode::Mode,
    panels::{graph::GraphAction, timeline::TimelineAction},
    tools::paint::brush::BrushAction,
};
use crate::plugins::document::{Change, EditRequest};

/// Plugin that carries out changes of mode, undo and redo, once tools have taken an undo that ends their drag.
pub struct ActionsPlugin;

impl Plugin for ActionsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Mode>()
            .add_message::<ActionRequest>()
            .add_systems(RunFixedMainLoop, change_mode_or_history.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop));
    }
}

/// An action that a person can request with a key, a menu entry or a button.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Action {
    /// Changes the mode of the pointer.
    Mode(Mode),
    /// Begins an empty project.
    New,
    /// Asks for a file to open.
    Open,
    /// Asks for a mesh, and puts it beside the meshes of the open rig.
    AddMesh,
    /// Saves the project to its file, or asks for one.
    Save,
    /// Asks for a file and saves the project there.
    SaveAs,
    /// Asks for a file and exports the character, or the template.
    Export,
    /// Closes the window, after asking about unsaved changes.
    Quit,
    /// Undoes the last step.
    Undo,
    /// Redoes the last undone step.
    Redo,
    /// Deletes the selected joints; their children move up.
    Delete,
    /// Deletes the selected joints with their hierarchies.
    DeleteHierarchy,
    /// Selects all joints.
    SelectAll,
    /// Clears the selection.
    SelectNone,
    /// Makes or updates the other side of the selected joints.
    MirrorSelected,
    /// Turns live symmetry on or off.
    Symmetry,
    /// Turns the movement of children with their parent on or off.
    MoveChildren,
    /// Accepts the current drawing or drag.
    Accept,
    /// Drops the current drawing or drag.
    Cancel,
    /// Takes the next volume under the pointer.
    NextVolume,
    /// Puts a template into the mesh by itself.
    Fit,
    /// Chooses faces of the mesh, and puts a part or the selected joints into them.
    FitPart,
    /// Selects the next joint that the fit is not sure of.
    NextDoubt,
    /// Computes weights for all meshes.
    Skin,
    /// Resets the pose of the selected joints, or of all if none is selected.
    ResetPose,
    /// Puts the mirror image of the selected joints' pose onto the other side, or swaps the sides if none is selected.
    MirrorPose,
    /// Stores the pose under a name.
    StorePose,
    /// Carries out all commands of the rig.
    Build,
    /// Takes back all commands of the rig.
    RollBack,
    /// Carries out the next command.
    StepForward,
    /// Takes back the last command.
    StepBack,
    /// Switches gizmos between world, local and view axes.
    GizmoSpace,
    /// Frames the selected joints, or the whole character if none is selected.
    FrameSelected,
    /// Frames the whole character.
    FrameAll,
    /// Shows the front view.
    ViewFront,
    /// Shows the back view.
    ViewBack,
    /// Shows the view from the character's left.
    ViewLeft,
    /// Shows the view from the character's right.
    ViewRight,
    /// Shows the top view.
    ViewTop,
    /// Shows the bottom view.
    ViewBottom,
    /// Switches between perspective and orthographic projection.
    Projection,
    /// Makes the mesh half transparent, or opaque.
    XRay,
    /// Shows or hides the edges of the mesh.
    Wireframe,
    /// Shows or hides the labels of all joints.
    Labels,
    /// Shows or hides the axes of the selected joints.
    LocalAxes,
    /// Shows or hides the grid.
    Grid,
    /// Shows or hides the controls of the built rig.
    Controls,
    /// Shows or hides the help page.
    Help,
    /// Shows or hides the palette of all actions.
    Palette,
    /// Shows or hides the start page.
    StartPage,
    /// Shows or hides bones; those of selected joints are always shown.
    Bones,
    /// Shows or hides all meshes.
    Meshes,
    /// Colours the joints that move points of a mesh, or shows the colours of groups again.
    Deforming,
    /// Shows or hides the poses of the open clip before and after the playhead.
    OnionSkin,
    /// Makes the interface larger.
    UiLarger,
    /// Makes the interface smaller.
    UiSmaller,
    /// Makes the interface as large as usual.
    UiUsual,
    /// Switches between the dark and the light theme.
    Theme,
    /// Turns high contrast on or off.
    Contrast,
    /// An action of the timeline.
    Timeline(TimelineAction),
    /// An action of the graph.
    Graph(GraphAction),
    /// An action of the library of templates.
    Library(LibraryAction),
    /// An action of painting.
    Brush(BrushAction),
}

impl Action {
    /// All actions, modes first.
    pub fn all() -> Vec<Self> {
        let others = [
            Self::New,
            Self::Open,
            Self::Save,
            Self::SaveAs,
            Self::Export,
            Self::Quit,
            Self::Undo,
            Self::Redo,
            Self::Delete,
            Self::DeleteHierarchy,
            Self::SelectAll,
            Self::SelectNone,
            Self::MirrorSelected,
            Self::Symmetry,
            Self::MoveChildren,
            Self::Accept,
            Self::Cancel,
            Self::NextVolume,
            Self::Fit,
            Self::FitPart,
            Self::NextDoubt,
            Self::Skin,
            Self::ResetPose,
            Self::MirrorPose,
            Self::StorePose,
            Self::Build,
            Self::RollBack,
            Self::StepForward,
            Self::StepBack,
            Self::GizmoSpace,
            Self::FrameSelected,
            Self::FrameAll,
            Self::ViewFront,
            Self::ViewBack,
            Self::ViewLeft,
            Self::ViewRight,
            Self::ViewTop,
            Self::ViewBottom,
            Self::Projection,
            Self::XRay,
            Self::Wireframe,
            Self::Labels,
            Self::LocalAxes,
            Self::Grid,
            Self::Controls,
            Self::Help,
            Self::Palette,
            Self::StartPage,
            Self::Bones,
            Self::Meshes,
            Self::Deforming,
            Self::OnionSkin,
            Self::UiLarger,
            Self::UiSmaller,
            Self::UiUsual,
            Self::Theme,
            Self::Contrast,
            Self::AddMesh,
        ];
        let of_timeline = TimelineAction::ALL.into_iter().map(Self::Timeline);
        let of_graph = GraphAction::ALL.into_iter().map(Self::Graph);
        let of_library = LibraryAction::ALL.into_iter().map(Self::Library);
        let of_brush = BrushAction::ALL.into_iter().map(Self::Brush);
        let of_panels = of_timeline.chain(of_graph).chain(of_library).chain(of_brush);
        Mode::ALL.into_iter().map(Self::Mode).chain(others).chain(of_panels).collect()
    }
}

/// Request for an action.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActionRequest(pub Action);

/// Carries out changes of mode, undo and redo.
fn change_mode_or_history(
    mut actions: MessageReader<ActionRequest>,
    mut mode: ResMut<Mode>,
    rig: Option<Res<ActiveRig>>,
    mut edits: MessageWriter<EditRequest>,
) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::Mode(next) => {
                mode.set_if_neq(*next);
            }
            Action::Undo | Action::Redo => {
                let Some(rig) = &rig else { continue };
                let change = if *action == Action::Undo { Change::Undo } else { Change::Redo };
                edits.write(EditRequest { rig: rig.0, change });
            }
            _ => {}
        }
    }
}

/// Queues the requests of a panel, each for `answer`, and the actions that are its `own`, each for `act`: both need the whole
/// world, before the edits of the same frame.
pub(super) fn queue_requests<R: Message + Clone, A: Send + 'static>(
    mut requests: MessageReader<R>,
    answer: fn(&mut World, R),
    mut actions: MessageReader<ActionRequest>,
    own: fn(Action) -> Option<A>,
    act: fn(&mut World, A),
    mut commands: Commands,
) {
    for request in requests.read() {
        let request = request.clone();
        commands.queue(move |world: &mut World| answer(world, request));
    }
    for action in actions.read().filter_map(|request| own(request.0)) {
        commands.queue(move |world: &mut World| act(world, action));
    }
}
