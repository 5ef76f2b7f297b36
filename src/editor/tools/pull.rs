//! Pull tool: in Pose mode a drag on a joint or a control takes it along with the pointer, and the joints above turn.
//!
//! A built rig is pulled by its controls, any other one by its joints. A drag only previews; the release makes one step of the
//! history, Escape restores the rig to the bit. A press that does not become a drag is a click like any other.

use bevy::prelude::*;

use super::{
    PullHover, Tool, ToolPointer, ToolSystems,
    click_wishes::{ClickWish, ClickWishes},
    gizmo::{Delta, GizmoDrag, GizmoFrame, Handle},
    pose::PosedJoint,
    scene::{EditedRig, Scene, joints},
    select::{self, DrawnControls, SelectTool},
    transform,
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        building::use_controls,
        counts::counted,
        mode::Mode,
        notice::{Notice, StatusLine},
        pointer::{PointerAct, ViewportPointer},
    },
    plugins::{
        controls::ControlsInUse,
        document::{Change, EditReport, EditRequest, HoveredNode},
        picking::{Pick, PickRequest},
        viewport::Sight,
    },
    rig::{PoseOffset, Uid, operations::Operation},
    solve::pull::{ControlPull, PullError, chain_above, pull},
};

/// Plugin of the pull tool.
pub struct PullPlugin;

impl Plugin for PullPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<PullTool>()
            .init_resource::<ClickWishes>()
            .init_resource::<SelectTool>()
            .init_resource::<ControlsInUse>()
            .add_systems(Update, aim.after(use_controls).before(ToolSystems::Route))
            .add_systems(Update, drag.in_set(ToolSystems::Tools).after(transform::drag).before(select::select));
    }
}

/// State of the pull tool.
#[derive(Resource, Debug, Default)]
pub struct PullTool {
    /// Places of the presses of a frame, with the joints or controls there.
    aims: Vec<(Vec2, Uid)>,
    held: Option<NodePress>,
    /// Marks that the banner describes a drag.
    has_banner: bool,
}

impl PullTool {
    /// The node that is being pulled.
    pub fn pulled(&self) -> Option<Uid> {
        self.held.as_ref().filter(|held| held.drag.is_some()).map(|held| held.node)
    }
}

/// A press on a node, and its drag.
#[derive(Debug)]
struct NodePress {
    rig: Entity,
    node: Uid,
    at: Vec2,
    /// Drag; `None` until the pointer has moved further than in a click, or if nothing moves the node.
    drag: Option<Drag>,
    /// Marks a node that nothing moves, about which people have been told.
    is_refused: bool,
}

#[derive(Debug)]
struct Drag {
    gizmo: GizmoDrag,
    name: String,
    step: f32,
    way: Way,
}

/// Way in which a node follows the pointer.
#[derive(Debug, Clone)]
pub(super) enum Way {
    /// Controls of a built rig, which move it.
    Controls(Box<ControlPull>),
    /// Joints above it, from the top, with their positions and its own.
    Joints(Vec<PosedJoint>, Vec<Vec3>),
    /// Movement of the node itself: a root.
    Itself(Vec<PosedJoint>),
}

/// Updates [`PullHover`] for the presses of this frame.
fn aim(
    mut pointers: MessageReader<ViewportPointer>,
    mode: Res<Mode>,
    (scene, controls): (Scene, DrawnControls),
    mut tool: ResMut<PullTool>,
    mut hover: ResMut<PullHover>,
) {
    let presses = pointers.read().filter(|pointer| pointer.act == PointerAct::Pressed).map(|pointer| pointer.at);
    let aim = |at: Vec2| (*mode == Mode::Pose).then(|| node_at(&scene, &controls, at)).flatten();
    let found: Vec<(Vec2, Option<Uid>)> = presses.map(|at| (at, aim(at))).collect();
    if found.is_empty() {
        return;
    }
    hover.set_if_neq(PullHover(found.iter().map(|(_, node)| node.is_some()).collect()));
    tool.aims = found.into_iter().filter_map(|(at, node)| Some((at, node?))).collect();
}

/// Distances that a hand does not tell apart, in pixels.
const SAME: f32 = 1.0;

/// The control whose outline is at a pixel, or the joint there unless it is farther: outlines of fingers pass over the joint of
/// the hand, and a press on that joint means the hand.
fn node_at(scene: &Scene, controls: &DrawnControls, at: Vec2) -> Option<Uid> {
    let (rig, sight) = (scene.rig()?, scene.sight()?);
    let control = controls.nearest(&rig, &sight, at);
    let joint = nearest_joint(scene, &rig, &sight, at);
    let is_joint = |(_, far): (Uid, f32)| joint.is_some_and(|(_, distance)| distance < far + SAME);
    let found = if control.is_none_or(is_joint) { joint } else { control };
    found.map(|(node, _)| node)
}

/// The joint nearest to a pixel within reach; the selected one of several at the same distance.
pub(super) fn joint_at(scene: &Scene, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<Uid> {
    nearest_joint(scene, rig, sight, at).map(|(joint, _)| joint)
}

/// Joint of [`joint_at`], with its distance from the pixel.
fn nearest_joint(scene: &Scene, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<(Uid, f32)> {
    let near = scene.posed(rig).into_iter().filter_map(|(joint, place)| {
        let distance = sight.project(place)?.distance(at);
        (distance <= select::REACH).then_some((joint, distance, rig.selection.active() != Some(joint)))
    });
    let nearest = near.min_by(|a, b| a.1.total_cmp(&b.1).then(a.2.cmp(&b.2)));
    nearest.map(|(joint, distance, _)| (joint, distance))
}

/// True if the joint under a pixel is pulled by other controls than the selected one.
pub(super) fn pulls_by_others(scene: &Scene, sight: &Sight, at: Vec2) -> bool {
    let Some(rig) = scene.rig() else { return false };
    let (Some(built), Some(runtime)) = (rig.built, rig.runtime.as_ref()) else { return false };
    let Some(joint) = joint_at(scene, &rig, sight, at) else { return false };
    let pull = ControlPull::find(&rig.rig, &built.0, runtime.state(), joint);
    pull.is_ok_and(|pull| rig.selection.active().is_none_or(|selected| !pull.handles().contains(&selected)))
}

fn drag(
    mut pointers: MessageReader<ToolPointer>,
    mut actions: MessageReader<ActionRequest>,
    mut edited: MessageReader<EditReport>,
    (scene, controls): (Scene, DrawnControls),
    (hover, hovered): (Res<SelectTool>, Query<&HoveredNode>),
    mut tool: ResMut<PullTool>,
    mut status: ResMut<StatusLine>,
    mut edits: MessageWriter<EditRequest>,
    mut wishes: ResMut<ClickWishes>,
    mut notices: MessageWriter<Notice>,
) {
    let rig = scene.rig();
    let overtaken: Vec<Entity> = edited.read().filter(|edit| edit.committed.is_some()).map(|edit| edit.rig).collect();
    let is_cancelled = actions.read().filter(|action| action.0 == Action::Cancel).count() > 0;
    if let Some(held) = &tool.held
        && (is_cancelled || overtaken.contains(&held.rig) || rig.as_ref().is_none_or(|rig| rig.entity != held.rig))
    {
        if held.drag.is_some() {
            edits.write(EditRequest { rig: held.rig, change: Change::CancelPreview });
        }
        tool.held = None;
    }
    let mut preview = None;
    for (ToolPointer { tool: who, pointer }, event) in pointers.read_with_id() {
        if *who != Tool::Pull {
            continue;
        }
        match pointer.act {
            PointerAct::Pressed => {
                let aim = tool.aims.iter().find(|(at, _)| *at == pointer.at).map(|(_, node)| *node);
                let pressed = aim.zip(rig.as_ref());
                tool.held = pressed.map(|(node, rig)| NodePress {
                    rig: rig.entity,
                    node,
                    at: pointer.at,
                    drag: None,
                    is_refused: false,
                });
            }
            PointerAct::Dragged => {
                let (Some(held), Some(rig), Some(sight)) = (&mut tool.held, &rig, scene.sight()) else { continue };
                if held.drag.is_none() && !held.is_refused {
                    match Drag::begin(rig, &sight, held.node, held.at) {
                        Ok(begun) => held.drag = Some(begun),
                        Err(reason) => {
                            held.is_refused = true;
                            let name = rig.name(held.node);
                            notices.write(Notice::info(format!("{name} cannot be pulled: {reason}.")).named());
                        }
                    }
                }
                let Some(drag) = &mut held.drag else { continue };
                drag.gizmo.to(pointer.at, pointer.held.control.then_some(drag.step));
                preview = Some(EditRequest { rig: held.rig, change: drag.preview() });
            }
            PointerAct::Released { dragged, count } => {
                let (Some(held), Some(rig)) = (tool.held.take(), &rig) else { continue };
                preview = None;
                match (held.drag, scene.sight()) {
                    (Some(mut drag), _) if dragged => {
                        // What was posed is what a key is set on, and what panels show.
                        let posed = drag.posed(held.node);
                        if !rig.selection.0.contains(&posed) {
                            let what = Pick::Joints(vec![posed]);
                            let request = PickRequest { rig: held.rig, what, add: pointer.held.shift };
                            wishes.add(event, ClickWish::Pick(request));
                        }
                        drag.gizmo.to(pointer.at, pointer.held.control.then_some(drag.step));
                        edits.write(EditRequest { rig: held.rig, change: drag.preview() });
                        edits.write(EditRequest { rig: held.rig, change: Change::Commit });
                    }
                    (None, Some(sight)) if !dragged => {
                        let pick = select::click_or_control(&scene, &controls, rig, &sight, held.at);
                        let under = hover.node_of_click(&hovered, &scene, &controls, rig, &sight, held.at);
                        wishes.add(event, ClickWish::Click { pick, held: pointer.held, count, under });
                    }
                    _ => {}
                }
            }
            PointerAct::Moved | PointerAct::Left | PointerAct::Wheel(_) => {}
        }
    }
    if let Some(preview) = preview {
        edits.write(preview);
    }
    let banner = tool.held.as_ref().and_then(|held| held.drag.as_ref()).map(Drag::banner);
    if (tool.has_banner || banner.is_some()) && status.banner != banner {
        tool.has_banner = banner.is_some();
        status.banner = banner;
    }
}

impl Way {
    /// Way in which a node of a rig follows, with its position.
    ///
    /// # Errors
    /// See [`PullError`].
    pub fn find(rig: &EditedRig, node: Uid) -> Result<(Vec3, Self), PullError> {
        let chain = chain_above(&rig.rig, node);
        let by_controls = match (rig.built, &rig.runtime) {
            (Some(built), Some(runtime)) => {
                let program = runtime.state().program();
                let turned = if chain.is_empty() { std::slice::from_ref(&node) } else { &chain };
                let is_plain = |joint: &Uid| program.node(*joint).is_some_and(|slot| program.nodes()[slot].is_plain());
                match ControlPull::find(&rig.rig, &built.0, runtime.state(), node) {
                    // Joints that no command drives are posed themselves.
                    Err(PullError::NoControl) if rig.rig.joint(node).is_some() && turned.iter().all(is_plain) => None,
                    found => Some(found?),
                }
            }
            _ => None,
        };
        Ok(match by_controls {
            Some(pull) => (pull.position(), Self::Controls(Box::new(pull))),
            None => {
                let place = |joint: &Uid| rig.posed_global(*joint).translation;
                let gathered = |joints: &[Uid]| PosedJoint::gather(rig, joints);
                let way = match chain.is_empty() {
                    true => Self::Itself(gathered(&[node])),
                    false => Self::Joints(gathered(&chain), chain.iter().chain([&node]).map(place).collect()),
                };
                (place(&node), way)
            }
        })
    }

    /// Offsets of the joints or controls with which the node is at a goal, or as near to it as they bring it; `by` is its
    /// movement to there.
    pub fn to(&self, goal: Vec3, by: Vec3) -> Vec<(Uid, PoseOffset)> {
        match self {
            Self::Controls(pull) => pull.to(goal),
            Self::Joints(joints, points) => turned(joints, points, goal),
            Self::Itself(roots) => {
                roots.iter().map(|root| (root.joint, root.dragged(&Delta::Move(by), None))).collect()
            }
        }
    }
}

impl Drag {
    fn begin(rig: &EditedRig, sight: &Sight, node: Uid, at: Vec2) -> Result<Self, PullError> {
        let (origin, way) = Way::find(rig, node)?;
        let axes = [sight.plane.right, sight.plane.up, sight.plane.towards()];
        Ok(Self {
            gizmo: GizmoDrag::new(Handle::MoveView, GizmoFrame { origin, axes }, *sight, at),
            name: rig.name(node),
            step: transform::step(rig),
            way,
        })
    }

    /// The pulled node, or the control next to it that moves it.
    fn posed(&self, node: Uid) -> Uid {
        match &self.way {
            Way::Controls(pull) => pull.handles().last().copied().unwrap_or(node),
            Way::Joints(..) | Way::Itself(_) => node,
        }
    }

    /// Movement of the pulled node.
    fn by(&self) -> Vec3 {
        match self.gizmo.delta() {
            Delta::Move(by) => by,
            Delta::Turn { .. } | Delta::Scale(_) => Vec3::ZERO,
        }
    }

    fn preview(&self) -> Change {
        let by = self.by();
        if by == Vec3::ZERO {
            return Change::CancelPreview;
        }
        Change::Preview(Operation::Pose(self.way.to(self.gizmo.frame.origin + by, by)))
    }

    /// Description of the pull, in a few words.
    fn banner(&self) -> String {
        let count = match &self.way {
            Way::Controls(pull) => pull.handles().len(),
            Way::Joints(joints, _) => joints.len(),
            Way::Itself(_) => return format!("Moving {}", self.name),
        };
        match &self.way {
            Way::Controls(_) => format!("Pulling {}: {}", self.name, counted(count, "control", "controls")),
            _ => format!("Pulling {}: {}", self.name, joints(count)),
        }
    }
}

/// Offsets of a chain's joints with which the end of the chain is at the goal.
fn turned(chain: &[PosedJoint], points: &[Vec3], goal: Vec3) -> Vec<(Uid, PoseOffset)> {
    let mut carried = Quat::IDENTITY;
    let mut turned = Vec::with_capacity(chain.len());
    for (joint, whole) in chain.iter().zip(pull(points, goal)) {
        turned.push((joint.joint, joint.carried(carried, (whole * carried.conjugate()).normalize())));
        carried = whole;
    }
    turned
}
