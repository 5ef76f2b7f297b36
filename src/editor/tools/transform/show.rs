//! Display of the gizmo, and its hints in the status line.

use bevy::{prelude::*, window::RequestRedraw};

use super::{GizmoTarget, GizmoTool, PoseMoves, Start, edits_rest};
use crate::{
    editor::{
        ActiveRig,
        mode::Mode,
        notice::StatusLine,
        settings::EditorSettings,
        tools::{
            gizmo::{GizmoParts, Handle, handle_at},
            scene::{EditedRig, Scene, joints},
        },
    },
    plugins::{document::ShowRest, stage::RigStage},
    rig::Uid,
};

/// Shows the rest pose while it is edited.
pub(super) fn show_rest(
    mode: Res<Mode>,
    tool: Res<GizmoTool>,
    active: Option<Res<ActiveRig>>,
    mut rigs: Query<(Entity, &mut ShowRest, Option<&RigStage>)>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    let is_dragged = tool.drag.as_ref().map(|drag| matches!(drag.from, Start::Rest(_)));
    let wanted = is_dragged.unwrap_or(edits_rest(*mode));
    for (rig, mut show_rest, stage) in &mut rigs {
        let is_active = active.as_ref().is_some_and(|active| active.0 == rig);
        let is_edited = stage == Some(&RigStage::Edit);
        if show_rest.set_if_neq(ShowRest(is_edited || wanted && is_active)) {
            // Joints follow in the next frame, which has to be requested: otherwise it would come with the next
            // movement of the pointer.
            redraw.write(RequestRedraw);
        }
    }
}

/// Updates handles and the status line.
pub(super) fn show(
    mode: Res<Mode>,
    settings: Res<EditorSettings>,
    moves: Res<PoseMoves>,
    scene: Scene,
    mut tool: ResMut<GizmoTool>,
    mut status: ResMut<StatusLine>,
) {
    let is_on = edits_rest(*mode) || *mode == Mode::Pose;
    if !is_on {
        if !tool.shapes.is_empty() || tool.hovered.is_some() {
            tool.shapes = Vec::new();
            tool.hovered = None;
        }
        return;
    }
    let is_stale = mode.is_changed() || settings.is_changed() || moves.is_changed() || scene.is_changed();
    if !is_stale && !tool.is_changed() {
        return;
    }
    let aim = GizmoTarget::new(*mode, settings.gizmo_space, moves.0, &scene);
    let shapes = aim.as_ref().zip(scene.sight()).map(|(aim, sight)| aim.frame.shapes(aim.parts, &sight));
    let shapes = shapes.unwrap_or_default();
    let tool = tool.bypass_change_detection();
    if tool.drag.is_none() {
        tool.hovered = tool.pointer.and_then(|at| handle_at(&shapes, at));
    }
    tool.shapes = shapes;
    let Some(rig) = scene.rig() else { return };
    let handle = tool.dragged().or(tool.hovered);
    let hint = match &aim {
        Some(aim) => describe(&rig, *mode, aim, handle, &settings),
        None if rig.rig.is_empty() => "There are no joints yet: press A to place one, S to draw a stroke.".to_owned(),
        None if *mode == Mode::Pose => "Drag a joint or a control to pull it; click one to pose it.".to_owned(),
        None if *mode == Mode::Move => "Drag a joint to move it.".to_owned(),
        None => format!("Click a joint to {} it.", verb(*mode)),
    };
    let mut notes = Vec::new();
    if edits_rest(*mode) && !rig.rig.pose().is_empty() {
        notes.push("Rest pose: the pose is kept, and shown again in other modes.");
    }
    if *mode == Mode::Pose && rig.has_mesh && rig.rig.skins().next().is_none() {
        notes.push("Not skinned yet, so the mesh stays: B skins.");
    }
    notes.push(&hint);
    let hint = notes.join(" ");
    let banner = status.banner.clone();
    status.set_if_neq(StatusLine { hint, obstacle: None, banner });
}

fn verb(mode: Mode) -> &'static str {
    match mode {
        Mode::Rotate => "turn",
        Mode::Scale => "scale",
        Mode::Pose => "pose",
        _ => "move",
    }
}

/// Description of the effect of a drag.
fn describe(
    rig: &EditedRig,
    mode: Mode,
    aim: &GizmoTarget,
    handle: Option<Handle>,
    settings: &EditorSettings,
) -> String {
    let what = match aim.joints.as_slice() {
        [only] => rig.name(*only),
        several => joints(several.len()),
    };
    let is_control = |node: &Uid| rig.built_node(*node).is_some_and(|node| node.control.is_some());
    if aim.parts == GizmoParts::default() && !aim.joints.iter().any(is_control) {
        return match aim.joints.as_slice() {
            [_] => format!("{what} follows its controls: drag it to pull it by them, or drag a control."),
            _ => format!("{what} follow their controls: drag a joint to pull it by them, or drag a control."),
        };
    }
    let axis = |number: usize| ["X", "Y", "Z"][number % 3];
    let space = settings.gizmo_space.name().to_lowercase();
    let drag = match handle {
        Some(Handle::MoveAxis(number)) => format!("Drag moves {what} along {space} {}.", axis(number)),
        Some(Handle::MovePlane(number)) => {
            format!("Drag moves {what} along {space} {} and {}.", axis(number + 1), axis(number + 2))
        }
        Some(Handle::MoveView) => format!("Drag moves {what} as you see it; its depth stays."),
        Some(Handle::Ring(number)) => format!("Drag turns {what} about {space} {}.", axis(number)),
        Some(Handle::ViewRing) => format!("Drag turns {what} as you see it."),
        Some(Handle::ScaleAxis(number)) => format!("Drag scales {what} along {space} {}.", axis(number)),
        Some(Handle::ScaleAll) => format!("Drag right or up scales {what} evenly, left or down makes it smaller."),
        None if mode == Mode::Pose => {
            format!("Drag a handle to pose {what} ({space} axes: V), or any joint or control to pull it.")
        }
        None if mode == Mode::Move => format!("Drag a handle to move {what} ({space} axes: V), or any joint."),
        None => format!("Drag a handle to {} {what} ({space} axes: V).", verb(mode)),
    };
    let children = match (mode, settings.move_children) {
        (Mode::Pose, _) => "",
        (_, true) => " What hangs below comes along (C).",
        (_, false) => " What hangs below stays (C).",
    };
    format!("{drag} Ctrl: in steps.{children} Esc: as before.")
}
