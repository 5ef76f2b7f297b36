//! Tools: in each mode a tool reads the pointer and writes the same requests that gesture lists and games write.
//!
//! | tool | modes | does |
//! | --- | --- | --- |
//! | [`select`] | all but Place, Stroke and Paint | picks joints, a box of joints, a hierarchy |
//! | [`place`] | Place | shows where a joint would go, and puts it there |
//! | [`stroke`] | Stroke | draws, previews, accepts |
//! | [`transform`] | Move, Rotate, Scale, Pose | drags the handles of a [`gizmo`](mod@gizmo) |
//! | [`pull`] | Pose | drags a joint or a control, and the joints above follow |
//! | [`weights`] | Weights, Paint | shows what the selected joint moves |
//! | [`paint`] | Paint | changes the weights of the selected joint with a brush |
//! | [`region`] | all, while it is open | chooses faces for a fit of a part of the mesh |
//! | [`symmetry`] | all | the plane of live mirroring |
//!
//! The planned action of a tool is in its resource, from which [`ghosts`] draws it; the rig does not change before the
//! request.

pub mod actions;
mod click_wishes;
pub mod ghosts;
pub mod gizmo;
pub mod paint;
pub mod place;
pub mod pose;
pub mod pull;
pub mod region;
pub mod scene;
pub mod select;
pub mod stroke;
pub mod symmetry;
pub mod transform;
pub mod weights;

use bevy::prelude::*;

use super::{
    actions::{Action, ActionRequest},
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
            .init_resource::<PullHover>()
            .add_message::<ViewportPointer>()
            .add_message::<ToolPointer>()
            .add_message::<ActionRequest>()
            .add_message::<Notice>()
            .configure_sets(
                Update,
                (ToolSystems::Route, ToolSystems::Actions, ToolSystems::Tools).chain().before(RigSystems::Script),
            )
            .configure_sets(PostUpdate, ToolSystems::Show.after(RigSystems::Surface).before(DrawingSystems))
            .add_systems(RunFixedMainLoop, end_instead_of_undo.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop))
            .add_systems(Update, route.in_set(ToolSystems::Route))
            .add_systems(PostUpdate, give_wheel.in_set(ToolSystems::Show).after(stroke::show))
            .add_plugins((
                actions::ToolActionsPlugin,
                symmetry::SymmetryPlugin,
                select::SelectPlugin,
                place::PlacePlugin,
                stroke::StrokeToolPlugin,
                weights::WeightsPlugin,
                paint::PaintPlugin,
                transform::TransformPlugin,
                pull::PullPlugin,
                region::RegionPlugin,
                ghosts::GhostsPlugin,
            ));
    }
}

/// Order of the tools. The first three sets are in `Update`, before the systems of rigs, so that the effect of a click
/// appears in the same frame; the last is in `PostUpdate`, when rigs, poses and surfaces have their final state of the
/// frame.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ToolSystems {
    /// Routes pointer events to their tool, as [`ToolPointer`].
    Route,
    /// Carries out actions of keys, menus and buttons that need no pointer.
    Actions,
    /// Runs the tools, which write requests.
    Tools,
    /// Shows the planned actions of tools: ghosts, the status line, the use of the wheel.
    Show,
}

/// Tool that owns the pointer.
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
    /// A joint or control that is pulled.
    Pull,
    /// Painting weights.
    Paint,
    /// Choosing faces.
    Region,
}

impl Tool {
    /// The tool of a mode where the pointer is over no gizmo.
    pub fn of(mode: Mode) -> Self {
        match mode {
            Mode::Place => Self::Place,
            Mode::Stroke => Self::Stroke,
            Mode::Paint => Self::Paint,
            Mode::Select | Mode::Move | Mode::Rotate | Mode::Scale | Mode::Pose | Mode::Weights => Self::Select,
        }
    }
}

/// A pointer event, with the tool that owns it.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub struct ToolPointer {
    /// The tool.
    pub tool: Tool,
    /// The pointer event.
    pub pointer: ViewportPointer,
}

/// Tool that has the button. A drag stays with the tool that it began with, even if the mode changes.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PointerOwner(pub Option<Tool>);

/// Share of gizmos in the pointer. Written by gizmos before presses are routed.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct GizmoHover {
    /// Marks that the pointer is over a handle, so that its movements belong to the gizmo.
    pub is_over: bool,
    /// Presses of this frame in their order, `true` for those on a handle or on a joint that follows the pointer.
    pub presses: Vec<bool>,
}

/// Presses of this frame in their order, `true` for those on a joint or control that a drag pulls. Written before presses are
/// routed.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct PullHover(pub Vec<bool>);

/// Turns an undo during a drag, or before a drawing is accepted, into a cancel: the drag is dropped and the last step stays.
/// Runs after keys are read and before actions are carried out.
fn end_instead_of_undo(
    stroke: Res<stroke::StrokeTool>,
    paint: Res<paint::PaintTool>,
    gizmo: Res<transform::GizmoTool>,
    pull: Res<pull::PullTool>,
    mut actions: MessageMutator<ActionRequest>,
) {
    let is_drawn = !matches!(stroke.state, stroke::StrokeState::Idle);
    if !(is_drawn || paint.is_painting() || gizmo.is_moving() || pull.pulled().is_some()) {
        return;
    }
    for request in actions.read().filter(|request| request.0 == Action::Undo) {
        request.0 = Action::Cancel;
    }
}

fn route(
    mut pointers: MessageReader<ViewportPointer>,
    mode: Res<Mode>,
    (gizmo, pull, region): (Res<GizmoHover>, Res<PullHover>, Res<region::RegionTool>),
    mut owner: ResMut<PointerOwner>,
    mut routed: MessageWriter<ToolPointer>,
) {
    let free = |is_gizmo: bool| match is_gizmo {
        _ if region.is_open() => Tool::Region,
        true => Tool::Gizmo,
        false => Tool::of(*mode),
    };
    // A slow frame has several presses, each at a place of its own.
    let (mut on_gizmos, mut on_nodes) = (gizmo.presses.iter(), pull.0.iter());
    for pointer in pointers.read() {
        let tool = match pointer.act {
            PointerAct::Pressed => {
                let [is_gizmo, is_pull] = [on_gizmos.next(), on_nodes.next()].map(|found| found.is_some_and(|on| *on));
                let tool = match free(is_gizmo) {
                    Tool::Select if is_pull => Tool::Pull,
                    other => other,
                };
                owner.0 = Some(tool);
                tool
            }
            PointerAct::Released { .. } => owner.0.take().unwrap_or_else(|| free(gizmo.is_over)),
            _ => owner.0.unwrap_or_else(|| free(gizmo.is_over)),
        };
        routed.write(ToolPointer { tool, pointer: *pointer });
    }
}

/// Gives the wheel to a tool that uses it; elsewhere it zooms.
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
