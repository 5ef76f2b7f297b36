//! What the pointer does in each mode: tools read it and write the same requests that gesture lists and games write.
//!
//! | tool | modes | does |
//! | --- | --- | --- |
//! | [`select`] | all but Place and Stroke | picks joints, a box of joints, a hierarchy |
//! | [`place`] | Place | shows where a joint would go, and puts it there |
//! | [`stroke`] | Stroke | draws, previews, accepts |
//! | [`transform`] | Move, Rotate, Scale, Pose | drags the handles of a [`gizmo`](mod@gizmo) |
//! | [`weights`] | Weights | shows what the selected joint moves |
//! | [`symmetry`] | all | the plane of live mirroring |
//!
//! What a tool is about to do lies in its resource, from which [`ghosts`] draws it; nothing of the rig changes before
//! the request.

pub mod actions;
pub mod ghosts;
pub mod gizmo;
pub mod place;
pub mod pose;
pub mod scene;
pub mod select;
pub mod stroke;
pub mod symmetry;
pub mod transform;
pub mod weights;

use bevy::prelude::*;

use super::{
    actions::ActionRequest,
    camera::ViewportSight,
    mode::Mode,
    notice::{Notice, StatusLine},
    pointer::{PointerAct, ViewportArea, ViewportPointer, WheelUse},
};
use crate::plugins::{RigSystems, drawing::DrawingSystems};

/// Adds the tools for selecting and sketching.
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Mode>()
            .init_resource::<WheelUse>()
            .init_resource::<StatusLine>()
            .init_resource::<ViewportArea>()
            .init_resource::<ViewportSight>()
            .init_resource::<PointerOwner>()
            .init_resource::<GizmoHover>()
            .add_message::<ViewportPointer>()
            .add_message::<ToolPointer>()
            .add_message::<ActionRequest>()
            .add_message::<Notice>()
            .configure_sets(
                Update,
                (ToolSystems::Route, ToolSystems::Actions, ToolSystems::Tools).chain().before(RigSystems::Script),
            )
            .configure_sets(PostUpdate, ToolSystems::Show.after(RigSystems::Surface).before(DrawingSystems))
            .add_systems(Update, route.in_set(ToolSystems::Route))
            .add_systems(PostUpdate, give_wheel.in_set(ToolSystems::Show).after(stroke::show))
            .add_plugins((
                actions::ToolActionsPlugin,
                symmetry::SymmetryPlugin,
                select::SelectPlugin,
                place::PlacePlugin,
                stroke::StrokeToolPlugin,
                weights::WeightsPlugin,
                transform::TransformPlugin,
                ghosts::GhostsPlugin,
            ));
    }
}

/// When tools run. The first three are in `Update`, before the systems of rigs, so that what a click does is seen in the
/// same frame; the last is in `PostUpdate`, where rigs, poses and surfaces are what they will be on the screen.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ToolSystems {
    /// What the pointer does goes to the tool that has it, as [`ToolPointer`].
    Route,
    /// Keys, menus and buttons that need no pointer.
    Actions,
    /// Tools write requests.
    Tools,
    /// Tools say what they are about to do: ghosts, the status line, who gets the wheel.
    Show,
}

/// Who has the pointer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Tool {
    /// Selecting, in every mode that does not draw.
    Select,
    /// Placing joints.
    Place,
    /// Drawing strokes.
    Stroke,
    /// A handle of a gizmo.
    Gizmo,
}

impl Tool {
    /// The tool of a mode where the pointer is over no gizmo.
    pub fn of(mode: Mode) -> Self {
        match mode {
            Mode::Place => Self::Place,
            Mode::Stroke => Self::Stroke,
            Mode::Select | Mode::Move | Mode::Rotate | Mode::Scale | Mode::Pose | Mode::Weights => Self::Select,
        }
    }
}

/// What the pointer did, with the tool that has it.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub struct ToolPointer {
    /// The tool.
    pub tool: Tool,
    /// What.
    pub pointer: ViewportPointer,
}

/// The tool that has the button: a drag stays with the tool it began with, whatever becomes of the mode.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PointerOwner(pub Option<Tool>);

/// True while the pointer is over a handle of a gizmo, so that a press is the gizmo's. Written by gizmos.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GizmoHover(pub bool);

fn route(
    mut pointers: MessageReader<ViewportPointer>,
    mode: Res<Mode>,
    gizmo: Res<GizmoHover>,
    mut owner: ResMut<PointerOwner>,
    mut routed: MessageWriter<ToolPointer>,
) {
    for pointer in pointers.read() {
        let free = if gizmo.0 { Tool::Gizmo } else { Tool::of(*mode) };
        let tool = owner.0.unwrap_or(free);
        match pointer.act {
            PointerAct::Pressed => owner.0 = Some(free),
            PointerAct::Released { .. } => owner.0 = None,
            _ => {}
        }
        let tool = if pointer.act == PointerAct::Pressed { free } else { tool };
        routed.write(ToolPointer { tool, pointer: *pointer });
    }
}

/// The wheel is the tool's where it changes what is shown, and zooms everywhere else.
fn give_wheel(
    mode: Res<Mode>,
    place: Res<place::PlaceTool>,
    stroke: Res<stroke::StrokeTool>,
    mut wheel: ResMut<WheelUse>,
) {
    let wanted = match *mode {
        Mode::Place => place.has_depth(),
        Mode::Stroke => matches!(stroke.state, stroke::StrokeState::Preview(_)),
        _ => false,
    };
    wheel.set_if_neq(if wanted { WheelUse::Tool } else { WheelUse::Zoom });
}
