//! Moving, turning and scaling joints with the handles of a gizmo: the rest pose, or the pose.
//!
//! A drag only previews; the release makes one step of the history, Escape restores the rig to the bit. A press on a
//! handle that does not become a drag is a click like any other: a handle never hides the next joint. In Move mode a joint is
//! a handle of its own, selected or not: it follows the pointer at its depth.

mod paint;
mod show;
mod target;

use bevy::{prelude::*, window::RequestRedraw};

pub use target::GizmoTarget;

use super::{
    GizmoHover, PointerOwner, Tool, ToolPointer, ToolSystems,
    click_wishes::{ClickWish, ClickWishes},
    gizmo::{Delta, GizmoDrag, GizmoFrame, Handle, HandleShape, handle_at},
    pose::PosedJoint,
    pull::{Way, joint_at, pulls_by_others},
    scene::{EditedRig, Scene, joints},
    select::{self, DrawnControls, REACH, SelectTool},
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        mode::Mode,
        notice::StatusLine,
        panel::PanelApp,
        pointer::{ModifierKeys, PointerAct, ViewportPointer},
        settings::{EditorSettings, GizmoSpace},
    },
    plugins::{
        controls::ControlsInUse,
        document::{Change, EditReport, EditRequest, HoveredNode},
        picking::{Pick, PickRequest},
    },
    rig::{
        Uid,
        operations::{MirrorPlane, Operation},
    },
    solve::pull::is_within_limb,
};

/// Plugin of gizmos for the modes Move, Rotate, Scale and Pose.
pub struct TransformPlugin;

impl Plugin for TransformPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GizmoTool>()
            .init_resource::<ClickWishes>()
            .init_resource::<SelectTool>()
            .init_resource::<ControlsInUse>()
            .init_resource::<PoseMoves>()
            .init_resource::<EditorSettings>()
            .add_message::<RequestRedraw>()
            .add_systems(Update, hover.before(ToolSystems::Route))
            .add_systems(Update, drag.in_set(ToolSystems::Tools).before(select::select))
            .add_systems(
                PostUpdate,
                (show::show_rest, show::show)
                    .chain()
                    .in_set(ToolSystems::Show)
                    .after(super::stroke::show)
                    .before(super::weights::show_weights),
            )
            .add_painter(paint::GizmoPainter);
    }
}

/// State of the gizmo.
#[derive(Resource, Debug, Clone, Default)]
pub struct GizmoTool {
    /// Handles on the screen, in the order of painting.
    pub shapes: Vec<HandleShape>,
    /// The handle under the pointer.
    pub hovered: Option<Handle>,
    pointer: Option<Vec2>,
    /// Places of the presses of a frame in Move mode, with the joints there, where no handle is.
    grabs: Vec<(Vec2, Uid)>,
    drag: Option<Drag>,
    /// Marks that the banner describes a drag.
    has_banner: bool,
}

impl GizmoTool {
    /// The handle that is being dragged.
    pub fn dragged(&self) -> Option<Handle> {
        self.drag.as_ref().map(|drag| drag.gizmo.handle)
    }

    /// True while a drag has changed something: a press alone changes nothing.
    pub fn is_moving(&self) -> bool {
        self.drag.as_ref().is_some_and(|drag| !drag.gizmo.delta().is_none())
    }
}

/// Shows arrows beside the rings in Pose mode for every joint if `true`, not only for roots. Joints of limbs are pulled by
/// them; others move by themselves.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PoseMoves(pub bool);

/// A press on a handle, and its drag.
#[derive(Debug, Clone)]
struct Drag {
    rig: Entity,
    gizmo: GizmoDrag,
    /// Joint that was pressed itself.
    grabbed: Option<Uid>,
    /// Index of the joint's own axis that every joint turns about, for local rings in Pose mode.
    own: Option<usize>,
    name: String,
    from: Start,
    /// Step of movements while Control is held: of the model's size at the press, which a drag may change.
    step: f32,
}

impl Drag {
    fn snap(&self, held: ModifierKeys) -> Option<f32> {
        held.control.then_some(self.step)
    }
}

/// The dragged joints in their state at the press.
#[derive(Debug, Clone)]
enum Start {
    /// Joints at rest, with their positions.
    Rest(Vec<(Uid, Vec3)>),
    /// Joints in their pose.
    Pose(Vec<PosedJoint>),
    /// Joints of limbs, with their positions, that those above bring along: arrows never stretch a limb.
    Pull(Vec<(Vec3, Way)>),
}

/// Step of movements while snapping, as a share of the model's height.
const MOVE_STEP: f32 = 0.01;

/// Returns `true` for the modes that edit the rest pose with a gizmo.
pub fn edits_rest(mode: Mode) -> bool {
    matches!(mode, Mode::Move | Mode::Rotate | Mode::Scale)
}

/// Updates [`GizmoHover`] for the pointer and the presses of this frame.
fn hover(
    mut pointers: MessageReader<ViewportPointer>,
    mode: Res<Mode>,
    settings: Res<EditorSettings>,
    moves: Res<PoseMoves>,
    owner: Res<PointerOwner>,
    scene: Scene,
    mut tool: ResMut<GizmoTool>,
    mut hover: ResMut<GizmoHover>,
) {
    if pointers.is_empty() {
        return;
    }
    let mut presses = Vec::new();
    let mut last = tool.pointer;
    for pointer in pointers.read() {
        last = (pointer.act != PointerAct::Left).then_some(pointer.at);
        if pointer.act == PointerAct::Pressed {
            presses.push(pointer.at);
        }
    }
    if tool.pointer != last {
        tool.pointer = last;
    }
    if presses.is_empty() && (tool.drag.is_some() || owner.0.is_some()) {
        return;
    }
    let handle = |at: Vec2| handle_of_press(&scene, *mode, settings.gizmo_space, moves.0, at);
    let is_grabbing = *mode == Mode::Move;
    let grabbed = |at: Vec2| joint_at(&scene, &scene.rig()?, &scene.sight()?, at).filter(|_| is_grabbing);
    let (mut hovered, mut grabs) = (last.filter(|_| presses.is_empty()).and_then(handle), Vec::new());
    let mut taken = GizmoHover { is_over: hovered.is_some(), presses: Vec::with_capacity(presses.len()) };
    for at in presses {
        hovered = handle(at);
        let joint = if hovered.is_none() { grabbed(at) } else { None };
        grabs.extend(joint.map(|joint| (at, joint)));
        taken.is_over = hovered.is_some() || joint.is_some();
        taken.presses.push(taken.is_over);
    }
    if tool.drag.is_none() && tool.hovered != hovered {
        tool.hovered = hovered;
    }
    if tool.grabs != grabs {
        tool.grabs = grabs;
    }
    hover.set_if_neq(taken);
}

/// The handle that a press at a pixel takes.
fn handle_of_press(scene: &Scene, mode: Mode, space: GizmoSpace, moves: bool, at: Vec2) -> Option<Handle> {
    let (aim, sight) = (GizmoTarget::new(mode, space, moves, scene)?, scene.sight()?);
    let handle = handle_at(&aim.frame.shapes(aim.parts, &sight), at)?;
    // Rings that are seen from the side run through the joint, which is pulled there; so does the middle of a control, which
    // moves nothing while its limb turns forwards.
    let yields = match handle {
        Handle::Ring(_) => mode == Mode::Pose,
        Handle::MoveView => mode == Mode::Pose && !moves && pulls_by_others(scene, &sight, at),
        _ => false,
    };
    let is_joint = yields && sight.project(aim.frame.origin).is_some_and(|middle| middle.distance(at) <= REACH);
    (!is_joint).then_some(handle)
}

pub(super) fn drag(
    mut pointers: MessageReader<ToolPointer>,
    mut actions: MessageReader<ActionRequest>,
    mut edited: MessageReader<EditReport>,
    (mode, settings, moves): (Res<Mode>, Res<EditorSettings>, Res<PoseMoves>),
    (scene, controls): (Scene, DrawnControls),
    (hover, hovered): (Res<SelectTool>, Query<&HoveredNode>),
    mut tool: ResMut<GizmoTool>,
    mut status: ResMut<StatusLine>,
    mut edits: MessageWriter<EditRequest>,
    mut wishes: ResMut<ClickWishes>,
) {
    let rig = scene.rig();
    // Another change of the rig has undone the preview; the drag began with a different rig.
    let overtaken: Vec<Entity> = edited.read().filter(|edit| edit.committed.is_some()).map(|edit| edit.rig).collect();
    let cancelled = actions.read().filter(|action| action.0 == Action::Cancel).count() > 0;
    if let Some(drag) = &tool.drag
        && (cancelled || overtaken.contains(&drag.rig) || rig.as_ref().is_none_or(|rig| rig.entity != drag.rig))
    {
        edits.write(EditRequest { rig: drag.rig, change: Change::CancelPreview });
        tool.drag = None;
    }
    let mut preview = None;
    for (ToolPointer { tool: who, pointer }, event) in pointers.read_with_id() {
        if *who != Tool::Gizmo {
            continue;
        }
        match pointer.act {
            PointerAct::Pressed => {
                let grabbed = tool.grabs.iter().find(|(at, _)| *at == pointer.at).map(|(_, joint)| *joint);
                tool.drag = match grabbed {
                    Some(joint) => grab(&scene, joint, pointer.at),
                    None => press(&scene, *mode, settings.gizmo_space, moves.0, pointer.at),
                };
            }
            PointerAct::Dragged => {
                let Some(drag) = &mut tool.drag else { continue };
                if let (Some(joint), Some(rig)) = (drag.grabbed, &rig)
                    && !rig.selection.0.contains(&joint)
                {
                    let request = PickRequest { rig: drag.rig, what: Pick::Joints(vec![joint]), add: false };
                    wishes.add(event, ClickWish::Pick(request));
                }
                drag.gizmo.to(pointer.at, drag.snap(pointer.held));
                preview = Some(drag.preview(settings.move_children));
            }
            PointerAct::Released { dragged, count } => {
                let (Some(mut drag), Some(rig)) = (tool.drag.take(), &rig) else { continue };
                let commit = if dragged {
                    drag.gizmo.to(pointer.at, drag.snap(pointer.held));
                    edits.write(EditRequest { rig: drag.rig, change: drag.preview(settings.move_children) });
                    Change::Commit
                } else {
                    let Some(sight) = scene.sight() else { continue };
                    let at = drag.gizmo.press();
                    let wish = if drag.grabbed.is_some() {
                        let pick = select::click(&scene, rig, &sight, at);
                        let under = hover.node_of_click(&hovered, &scene, &controls, rig, &sight, at);
                        ClickWish::Click { pick, held: pointer.held, count, under }
                    } else {
                        ClickWish::Handle { at, held: pointer.held, count }
                    };
                    wishes.add(event, wish);
                    Change::CancelPreview
                };
                edits.write(EditRequest { rig: drag.rig, change: commit });
                preview = None;
            }
            PointerAct::Moved | PointerAct::Left | PointerAct::Wheel(_) => {}
        }
    }
    if let (Some(change), Some(drag)) = (preview, &tool.drag) {
        edits.write(EditRequest { rig: drag.rig, change });
    }
    let banner = tool.drag.as_ref().filter(|drag| !drag.gizmo.delta().is_none()).map(Drag::banner);
    if (tool.has_banner || banner.is_some()) && status.banner != banner {
        tool.has_banner = banner.is_some();
        status.banner = banner;
    }
}

/// Starts a drag with a press on a handle.
fn press(scene: &Scene, mode: Mode, space: GizmoSpace, moves: bool, at: Vec2) -> Option<Drag> {
    let (rig, sight) = (scene.rig()?, scene.sight()?);
    let aim = GizmoTarget::new(mode, space, moves, scene)?;
    let handle = handle_at(&aim.frame.shapes(aim.parts, &sight), at)?;
    let name = match aim.joints.as_slice() {
        [only] => rig.name(*only),
        several => joints(several.len()),
    };
    let from = if mode == Mode::Pose {
        let is_moved = matches!(handle, Handle::MoveAxis(_) | Handle::MovePlane(_) | Handle::MoveView);
        let pulled = if is_moved { pulled(&rig, &aim.joints) } else { None };
        pulled.map_or_else(|| Start::Pose(PosedJoint::gather(&rig, &aim.joints)), Start::Pull)
    } else {
        Start::Rest(aim.joints.iter().map(|joint| (*joint, rig.rig.position(*joint))).collect())
    };
    let own = handle.axis().filter(|_| space == GizmoSpace::Local);
    Some(Drag {
        rig: rig.entity,
        gizmo: GizmoDrag::new(handle, aim.frame, sight, at),
        grabbed: None,
        own,
        name,
        from,
        step: step(&rig),
    })
}

/// Ways in which joints of limbs follow arrows; `None` if one of them is a control, no joint of a limb, below another one, or
/// moved by nothing above it.
fn pulled(rig: &EditedRig, joints: &[Uid]) -> Option<Vec<(Vec3, Way)>> {
    let is_pulled = |joint: &Uid| {
        let is_control = rig.built_node(*joint).is_some_and(|node| node.control.is_some());
        let is_carried = rig.rig.ancestors(*joint).any(|above| joints.contains(&above.data.uid));
        !is_control && !is_carried && is_within_limb(&rig.rig, *joint)
    };
    joints.iter().map(|joint| is_pulled(joint).then(|| Way::find(rig, *joint).ok()).flatten()).collect()
}

/// Starts a drag with a press on a joint: it moves as it is seen, and with it the others that are selected if it is.
fn grab(scene: &Scene, joint: Uid, at: Vec2) -> Option<Drag> {
    let (rig, sight) = (scene.rig()?, scene.sight()?);
    let selected = one_side(&rig, false, rig.symmetry.0.as_ref());
    let together = if selected.contains(&joint) { selected } else { vec![joint] };
    let name = match together.as_slice() {
        [only] => rig.name(*only),
        several => joints(several.len()),
    };
    let axes = [sight.plane.right, sight.plane.up, sight.plane.towards()];
    let frame = GizmoFrame { origin: rig.rig.position(joint), axes };
    Some(Drag {
        rig: rig.entity,
        gizmo: GizmoDrag::new(Handle::MoveView, frame, sight, at),
        grabbed: Some(joint),
        own: None,
        name,
        from: Start::Rest(together.into_iter().map(|joint| (joint, rig.rig.position(joint))).collect()),
        step: step(&rig),
    })
}

/// The step of movements while snapping, in the rig's units.
pub(super) fn step(rig: &EditedRig) -> f32 {
    let [low, high] = rig.bounds();
    let height = if high.y > low.y { high.y - low.y } else { rig.size() };
    height * MOVE_STEP
}

/// The pick of a click on a handle: the joint or the control that is nearest to that pixel, but for the active one, around which
/// the handles are; of a double click, all that hangs below the active joint there.
pub(super) fn clicked(
    (scene, controls): (&Scene, &DrawnControls),
    rig: &EditedRig,
    selected: &[Uid],
    at: Vec2,
    held: ModifierKeys,
    count: u8,
) -> Option<PickRequest> {
    let sight = scene.sight()?;
    let active = selected.last().copied();
    let near = scene.posed(rig).into_iter().filter_map(|(joint, place)| {
        let distance = sight.project(place)?.distance(at);
        (distance <= REACH).then_some((joint, distance))
    });
    let near: Vec<(Uid, f32)> = near.collect();
    let is_active_there = near.iter().any(|(joint, _)| Some(*joint) == active);
    let is_added = held.shift || held.control;
    if let Some(active) = active.filter(|_| count > 1 && is_active_there) {
        let what = Pick::Joints(select::hierarchy_below(rig, active));
        return Some(PickRequest { rig: rig.entity, what, add: is_added });
    }
    // The second click of a double click means what the first one took.
    let is_active = |node: Uid| Some(node) == active;
    if count > 1 && controls.nearest_among(is_active, rig, &sight, at).is_some() {
        return None;
    }
    let joints = near.into_iter().filter(|(joint, _)| !is_active(*joint));
    let control = controls.nearest_among(|control| !is_active(control), rig, &sight, at);
    // Controls are drawn over joints, so that one at the same distance is the one that is seen.
    let (node, _) = control.into_iter().chain(joints).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (what, add) = if held.control && selected.contains(&node) {
        (selected.iter().copied().filter(|other| *other != node).collect(), false)
    } else {
        (vec![node], is_added)
    };
    Some(PickRequest { rig: rig.entity, what: Pick::Joints(what), add })
}

impl Drag {
    /// The preview of the drag's result.
    fn preview(&self, with_children: bool) -> Change {
        let delta = self.gizmo.delta();
        if delta.is_none() {
            return Change::CancelPreview;
        }
        Change::Preview(match &self.from {
            Start::Rest(places) => rest_operation(places, &self.gizmo, &delta, with_children),
            Start::Pose(starts) => {
                Operation::Pose(starts.iter().map(|start| (start.joint, start.dragged(&delta, self.own))).collect())
            }
            Start::Pull(ways) => {
                let by = if let Delta::Move(by) = delta { by } else { Vec3::ZERO };
                Operation::Pose(ways.iter().flat_map(|(at, way)| way.to(*at + by, by)).collect())
            }
        })
    }

    /// Description of the movement, in a few words.
    fn banner(&self) -> String {
        let name = &self.name;
        match self.gizmo.delta() {
            Delta::Move(by) => format!("Moving {name}: {:.2}, {:.2}, {:.2}", by.x, by.y, by.z),
            Delta::Turn { angle, .. } => format!("Turning {name}: {:.1}°", angle.to_degrees()),
            Delta::Scale(by) if by.x == by.y && by.y == by.z => format!("Scaling {name}: {:.2}", by.x),
            Delta::Scale(by) => format!("Scaling {name}: {:.2}, {:.2}, {:.2}", by.x, by.y, by.z),
        }
    }
}

fn rest_operation(places: &[(Uid, Vec3)], gizmo: &GizmoDrag, delta: &Delta, with_children: bool) -> Operation {
    let joints = places.iter().map(|(joint, _)| *joint).collect();
    let pivot = Some(gizmo.frame.origin);
    match *delta {
        Delta::Move(by) => {
            let to = places.iter().map(|(joint, place)| (*joint, *place + by)).collect();
            Operation::Move { to, with_children }
        }
        Delta::Turn { axis, angle } => {
            let rotation = Quat::from_axis_angle(axis, angle).normalize();
            Operation::Rotate { joints, rotation, pivot, with_children }
        }
        Delta::Scale(scale) => {
            let [x, y, z] = gizmo.frame.axes;
            let is_even = scale.x == scale.y && scale.y == scale.z;
            let axes = if is_even { Quat::IDENTITY } else { Quat::from_mat3(&Mat3::from_cols(x, y, z)).normalize() };
            Operation::Scale { joints, scale, axes, pivot, with_children }
        }
    }
}

/// The selected joints that a gizmo moves, in Pose mode (`posing`) controls, too: with live mirroring only the active
/// joint's side; the other side follows.
fn one_side(rig: &EditedRig, posing: bool, plane: Option<&MirrorPlane>) -> Vec<Uid> {
    let is_there = |node: &Uid| if posing { rig.has_node(*node) } else { rig.rig.joint(*node).is_some() };
    let selected: Vec<Uid> = rig.selection.0.iter().copied().filter(is_there).collect();
    let (Some(plane), Some(active)) = (plane, rig.selection.active()) else { return selected };
    let side = |joint: Uid| match rig.rig.joint(joint) {
        Some(_) => plane.distance(rig.rig.position(joint)),
        None => plane.distance(rig.posed_global(joint).translation),
    };
    let sign = if side(active) < -plane.tolerance { -1.0 } else { 1.0 };
    let is_kept = |joint: &Uid| {
        let partner = rig.rig.joint(*joint).and_then(|found| found.data.mirror);
        partner.is_none_or(|partner| !selected.contains(&partner) || side(*joint) * sign > 0.0)
    };
    let kept: Vec<Uid> = selected.iter().copied().filter(is_kept).collect();
    if kept.is_empty() { selected } else { kept }
}
