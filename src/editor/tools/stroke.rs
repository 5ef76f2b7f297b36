//! Stroke tool: a line that follows the pointer, and a preview of its chain until that is accepted or dropped.
//!
//! A background task follows the stroke through the mesh; choosing joints from its samples takes microseconds, so the
//! number of joints changes under the wheel at once. The accepted chain is the previewed one: both come from
//! [`plan_stroke`].

mod bar;
mod hints;

use std::sync::Arc;

use bevy::{
    ecs::system::SystemParam,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use hints::{answer, describe};

use super::{
    Tool, ToolPointer, ToolSystems,
    scene::{EditedRig, Scene},
};
use crate::{
    algo::stroke::{
        ChainChoice, MAX_JOINTS, StrokeChain, StrokeError, StrokeKind, StrokeNote, StrokeSettings, joint_at,
    },
    editor::{
        actions::{Action, ActionRequest},
        mode::Mode,
        notice::{Notice, StatusLine},
        panel::PanelApp,
        pointer::PointerAct,
    },
    mesh::surface::Surface,
    plugins::{
        document::HoveredNode,
        picking::{Pick, PickRequest},
        stroke::{
            FollowedStroke, StrokeParent, StrokePlan, StrokeRequest, StrokeResult, StrokeScene, StrokeTips,
            plan_stroke, stroke_kind,
        },
        viewport::Sight,
    },
    rig::{
        Uid,
        operations::{MirrorPlane, Operation},
    },
};

/// Plugin of the stroke tool.
pub struct StrokeToolPlugin;

impl Plugin for StrokeToolPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<StrokeTool>()
            .add_message::<StrokeTune>()
            .add_message::<AcceptedStroke>()
            .add_systems(Update, draw.in_set(ToolSystems::Tools).after(super::place::place))
            .add_systems(PostUpdate, (show, answer).chain().in_set(ToolSystems::Show).after(super::place::show))
            .add_painter(bar::StrokeBar);
    }
}

/// State of the stroke tool.
#[derive(Resource, Debug)]
pub struct StrokeTool {
    /// Stroke that is being drawn or previewed.
    pub state: StrokeState,
    /// Largest distance of a stroke from its bones, as a share of the character's size, for the next preview.
    pub threshold: f32,
    /// Number of joints that was chosen for the last chain; `None` if it followed from the stroke.
    pub count: Option<usize>,
}

impl Default for StrokeTool {
    fn default() -> Self {
        Self { state: StrokeState::Idle, threshold: 0.02, count: None }
    }
}

impl StrokeTool {
    /// Returns `true` while a stroke is being followed in the background.
    pub fn is_busy(&self) -> bool {
        matches!(&self.state, StrokeState::Preview(preview) if preview.is_followed() || preview.plan.is_none())
    }
}

/// Stage of a stroke.
#[derive(Debug, Default)]
pub enum StrokeState {
    /// The user draws no stroke.
    #[default]
    Idle,
    /// A stroke under the pressed button.
    Drawing(Box<StrokeRequest>),
    /// A finished stroke that waits to be accepted or dropped.
    Preview(Box<StrokePreview>),
}

/// A surface to draw on, with the mirror plane.
#[derive(Debug, Clone)]
struct DrawingSurface {
    surface: Arc<Surface>,
    symmetry: Option<MirrorPlane>,
}

/// A finished stroke that waits to be accepted or dropped.
#[derive(Debug)]
pub struct StrokePreview {
    /// Request of accepting the stroke, without a chain that is already computed.
    pub request: StrokeRequest,
    /// Result of accepting the stroke; `None` while it is being followed.
    pub plan: Option<StrokePlan>,
    followed: Option<FollowedStroke>,
    task: Option<Task<Result<FollowedStroke, StrokeError>>>,
    /// The surface through which the stroke was or is being followed.
    on: Option<DrawingSurface>,
    /// Fraction of a notch that the wheel has turned: trackpads turn in small steps.
    turned: f32,
}

impl StrokePreview {
    /// Returns `true` while the stroke is being followed through the mesh.
    pub fn is_followed(&self) -> bool {
        self.task.is_some() || self.on.is_none()
    }

    /// Operation of accepting the stroke, as far as it is known.
    pub fn operation(&self) -> Option<&Operation> {
        match self.plan.as_ref()? {
            StrokePlan::Ready { operation, .. } => operation.as_deref(),
            StrokePlan::NeedsChain => None,
        }
    }

    /// Chain of the stroke, with the joint it starts on, as far as it is known.
    pub fn chain(&self) -> Option<&StrokeChain> {
        match self.plan.as_ref()? {
            StrokePlan::Ready { result: StrokeResult::Chain { chain, .. }, .. } => Some(chain),
            _ => None,
        }
    }
}

/// Change of a stroke's preview.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub enum StrokeTune {
    /// Choice of the joints.
    Choice(ChainChoice),
    /// Volume of the stroke, counted from one; `None` for the automatic one.
    Volume(Option<u32>),
}

/// Largest distance from a joint at which a stroke starts or ends on it, in pixels.
const REACH: f32 = 10.0;

/// The request at the start of a stroke.
fn begin(rig: &EditedRig, sight: &Sight, at: Vec2, threshold: f32) -> StrokeRequest {
    StrokeRequest {
        rig: rig.entity,
        plane: sight.plane,
        points: vec![sight.point(at)],
        choice: ChainChoice::Limb(threshold * rig.size()),
        settings: StrokeSettings::default(),
        chain_only: false,
        reach: REACH * sight.pixel,
        parent: StrokeParent::Natural,
        chain: None,
    }
}

/// Stroke of a rig that was accepted because its mode was left. Whoever left is told once its chain is in the rig.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
struct AcceptedStroke(Entity);

/// Position of the press, and the view at that moment, which holds for the whole line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Press {
    sight: Sight,
    at: Vec2,
}

/// Output of the stroke tool.
#[derive(SystemParam)]
pub(super) struct Outcomes<'w> {
    strokes: MessageWriter<'w, StrokeRequest>,
    left: MessageWriter<'w, AcceptedStroke>,
    picks: MessageWriter<'w, PickRequest>,
    notices: MessageWriter<'w, Notice>,
}

pub(super) fn draw(
    mut tool: ResMut<StrokeTool>,
    mode: Res<Mode>,
    mut pointers: MessageReader<ToolPointer>,
    mut actions: MessageReader<ActionRequest>,
    mut tunes: MessageReader<StrokeTune>,
    scene: Scene,
    mut press: Local<Option<Press>>,
    mut hovering: Local<bool>,
    mut hovered: Query<&mut HoveredNode>,
    mut out: Outcomes,
) {
    // In a slow frame the button may be released beside the key: actions come first, so the preview is not there yet.
    let mut is_accepted = false;
    for ActionRequest(action) in actions.read() {
        match action {
            // Actions that save, compute or leave must not leave a drawing behind.
            Action::Accept
            | Action::Save
            | Action::SaveAs
            | Action::Export
            | Action::Skin
            | Action::Quit
            | Action::New
            | Action::Open => {
                is_accepted |= !matches!(tool.state, StrokeState::Preview(_));
                take(&mut tool, &mut out.strokes);
            }
            Action::Cancel if !matches!(tool.state, StrokeState::Idle) => {
                tool.state = StrokeState::Idle;
                *press = None;
                is_accepted = false;
            }
            Action::NextVolume => next_volume(&mut tool),
            _ => {}
        }
    }
    if *mode != Mode::Stroke
        && let StrokeState::Preview(preview) = &tool.state
    {
        out.left.write(AcceptedStroke(preview.request.rig));
        take(&mut tool, &mut out.strokes);
    }
    for change in tunes.read() {
        tune(&mut tool, *change, scene.rig());
    }
    let found = scene.rig().zip(scene.sight());
    for ToolPointer { tool: who, pointer } in pointers.read() {
        let Some((rig, sight)) = &found else { continue };
        let mut under = None;
        match (who, pointer.act) {
            (Tool::Stroke, PointerAct::Pressed) => *press = Some(Press { sight: *sight, at: pointer.at }),
            (Tool::Stroke, PointerAct::Dragged) => {
                let Some(Press { sight, at }) = &*press else { continue };
                if !matches!(tool.state, StrokeState::Drawing(_)) {
                    // Starting the next line accepts the preview.
                    take(&mut tool, &mut out.strokes);
                    tool.state = StrokeState::Drawing(Box::new(begin(rig, sight, *at, tool.threshold)));
                }
                if let StrokeState::Drawing(request) = &mut tool.state {
                    request.points.push(sight.point(pointer.at));
                }
                continue;
            }
            (Tool::Stroke, PointerAct::Released { dragged: true, .. }) => {
                *press = None;
                release(&mut tool, &scene, rig, &mut out.strokes);
                continue;
            }
            (Tool::Stroke, PointerAct::Released { dragged: false, .. }) => {
                *press = None;
                under = joint_under(&scene, rig, sight, pointer.at);
                let what = under.map(|joint| Pick::Joints(vec![joint]));
                let request = |what| PickRequest { rig: rig.entity, what, add: pointer.held.shift };
                out.picks.write_batch(what.map(request));
            }
            (Tool::Stroke, PointerAct::Wheel(notches)) => wheel(&mut tool, notches),
            (Tool::Stroke, PointerAct::Moved) => under = joint_under(&scene, rig, sight, pointer.at),
            (Tool::Stroke, PointerAct::Left) => {}
            _ => continue,
        }
        // A stroke that starts here continues from this joint; a click selects it.
        if let Ok(mut hovered) = hovered.get_mut(rig.entity) {
            hovered.set_if_neq(HoveredNode(under));
        }
        *hovering = under.is_some();
    }
    if is_accepted {
        take(&mut tool, &mut out.strokes);
    }
    if *mode != Mode::Stroke
        && std::mem::take(&mut *hovering)
        && let Some(mut hovered) = found.as_ref().and_then(|(rig, _)| hovered.get_mut(rig.entity).ok())
    {
        hovered.set_if_neq(HoveredNode(None));
    }
    let on = found.as_ref().and_then(|(rig, _)| {
        let surface = rig.surface.as_ref()?.shared()?;
        Some(DrawingSurface { surface, symmetry: rig.symmetry.0 })
    });
    follow(&mut tool, on, &mut out.notices);
}

/// The joint that a stroke from a pixel starts on.
fn joint_under(scene: &Scene, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<Uid> {
    let posed = scene.posed(rig);
    let flat: Vec<(Vec2, Option<usize>)> =
        posed.iter().map(|(_, place)| (sight.plane.project(*place).unwrap_or(Vec2::NAN), None)).collect();
    joint_at(sight.point(at), &flat, REACH * sight.pixel).map(|number| posed[number].0)
}

/// Accepts the preview as it is shown.
fn take(tool: &mut ResMut<StrokeTool>, strokes: &mut MessageWriter<StrokeRequest>) {
    if !matches!(tool.state, StrokeState::Preview(_)) {
        return;
    }
    let StrokeState::Preview(preview) = std::mem::take(&mut tool.state) else { return };
    tool.count = match preview.request.choice {
        ChainChoice::Joints(count) => Some(count),
        ChainChoice::Threshold(_) | ChainChoice::Limb(_) => None,
    };
    // The chain is left out while the stroke is still being followed: the engine then waits for the same result.
    let chain = preview.chain().filter(|_| !preview.is_followed()).cloned();
    strokes.write(StrokeRequest { chain, ..preview.request });
}

/// Ends the line: a chain is previewed, other strokes are carried out at once.
fn release(tool: &mut ResMut<StrokeTool>, scene: &Scene, rig: &EditedRig, strokes: &mut MessageWriter<StrokeRequest>) {
    let StrokeState::Drawing(mut request) = std::mem::take(&mut tool.state) else { return };
    let posed = scene.posed(rig);
    match stroke_kind(&request, &rig.rig, &posed) {
        StrokeKind::Chain { start, .. } if rig.has_mesh => {
            let beside = |count: &usize| start.is_some_and(|start| is_beside(*count, &request, rig, &posed, start));
            if let Some(count) = tool.count.filter(beside) {
                request.choice = ChainChoice::Joints(count);
            }
            let preview =
                StrokePreview { request: *request, plan: None, followed: None, task: None, on: None, turned: 0.0 };
            tool.state = StrokeState::Preview(Box::new(preview));
        }
        _ => {
            strokes.write(*request);
        }
    }
}

/// True if a stroke starts on a joint from which a chain of as many joints goes the same way already: it draws the next finger.
fn is_beside(count: usize, request: &StrokeRequest, rig: &EditedRig, posed: &[(Uid, Vec3)], start: usize) -> bool {
    let (Some(from), Some(to)) = (request.points.first(), request.points.last()) else { return false };
    let end_of = |child: Uid| {
        // The joint that it starts on counts, too.
        let (mut number, mut end) = (2, child);
        while let [next] = *rig.rig.children(Some(end)) {
            (number, end) = (number + 1, next);
        }
        (number, end)
    };
    rig.rig.children(Some(posed[start].0)).iter().any(|child| {
        let (number, end) = end_of(*child);
        let place = posed.iter().find(|(joint, _)| *joint == end).and_then(|(_, place)| request.plane.project(*place));
        number == count && place.is_some_and(|place| (place - *from).dot(*to - *from) > 0.0)
    })
}

fn tune(tool: &mut ResMut<StrokeTool>, change: StrokeTune, rig: Option<EditedRig>) {
    let StrokeState::Preview(preview) = &mut tool.state else { return };
    match change {
        StrokeTune::Choice(choice) => preview.request.choice = choice,
        StrokeTune::Volume(volume) => {
            preview.request.settings.place.volume = volume;
            preview.on = None;
        }
    }
    if let (StrokeTune::Choice(ChainChoice::Limb(threshold)), Some(rig)) = (change, rig) {
        tool.threshold = threshold / rig.size();
    }
}

/// Changes the number of joints by one per notch.
fn wheel(tool: &mut ResMut<StrokeTool>, notches: f32) {
    let StrokeState::Preview(preview) = &mut tool.state else { return };
    let count = match preview.request.choice {
        ChainChoice::Joints(count) => count,
        ChainChoice::Threshold(_) | ChainChoice::Limb(_) => preview.chain().map_or(2, |chain| chain.joints.len()),
    };
    preview.turned += notches;
    let steps = preview.turned.trunc();
    preview.turned -= steps;
    if steps == 0.0 {
        return;
    }
    let count = (count as f32 + steps).clamp(2.0, MAX_JOINTS as f32);
    preview.request.choice = ChainChoice::Joints(count as usize);
}

/// Takes the volume after the current one; after the last, the automatic one.
fn next_volume(tool: &mut ResMut<StrokeTool>) {
    if !matches!(tool.state, StrokeState::Preview(_)) {
        return;
    }
    let StrokeState::Preview(preview) = &mut tool.state else { return };
    let Some((taken, of)) = preview.chain().and_then(volumes) else { return };
    let volume = &mut preview.request.settings.place.volume;
    *volume = match *volume {
        None if taken > 1 => Some(1),
        None => Some(2),
        Some(number) if number < of => Some(number + 1),
        Some(_) => None,
    };
    preview.on = None;
}

/// The volume at the start of the stroke, and the number of volumes; `None` for a single one.
fn volumes(chain: &StrokeChain) -> Option<(u32, u32)> {
    chain.notes.iter().find_map(|note| match note {
        StrokeNote::VolumeChosen { volume, of } => Some((*volume, *of)),
        _ => None,
    })
}

/// Follows the previewed stroke through the surface in a task, again after a change of the surface.
fn follow(tool: &mut ResMut<StrokeTool>, on: Option<DrawingSurface>, notices: &mut MessageWriter<Notice>) {
    let StrokeState::Preview(preview) = &mut tool.bypass_change_detection().state else { return };
    let Some(on) = on else { return };
    let is_same = |was: &DrawingSurface| Arc::ptr_eq(&was.surface, &on.surface) && was.symmetry == on.symmetry;
    if !preview.on.as_ref().is_some_and(is_same) {
        let (plane, points, settings) =
            (preview.request.plane, preview.request.points.clone(), preview.request.settings);
        preview.on = Some(on.clone());
        let follow = async move { FollowedStroke::with_symmetry(on.surface, &plane, &points, settings, on.symmetry) };
        preview.task = Some(AsyncComputeTaskPool::get().spawn(follow));
    }
    let Some(followed) = preview.task.as_mut().and_then(check_ready) else { return };
    preview.task = None;
    match followed {
        Ok(followed) => preview.followed = Some(followed),
        Err(error) => {
            notices.write(Notice::warning(format!("No chain: {error}.")));
            tool.bypass_change_detection().state = StrokeState::Idle;
        }
    }
    tool.set_changed();
}

/// Plans the preview on the current rig, and updates the status line.
pub(super) fn show(
    mut tool: ResMut<StrokeTool>,
    mode: Res<Mode>,
    scene: Scene,
    tips: Query<&StrokeTips>,
    hovered: Query<Ref<HoveredNode>>,
    mut status: ResMut<StatusLine>,
) {
    let is_on = *mode == Mode::Stroke || matches!(tool.state, StrokeState::Drawing(_));
    let hover_changed = hovered.iter().any(|hovered| hovered.is_changed());
    if !is_on || !(tool.is_changed() || mode.is_changed() || scene.is_changed() || hover_changed) {
        return;
    }
    let Some(rig) = scene.rig() else { return };
    let posed = scene.posed(&rig);
    if let StrokeState::Preview(preview) = &mut tool.bypass_change_detection().state
        && let Some(surface) = &rig.surface
    {
        let on = StrokeScene {
            rig: &rig.rig,
            selection: &rig.selection,
            symmetry: &rig.symmetry,
            tips: tips.get(rig.entity).ok(),
            surface,
            posed: &posed,
        };
        let chain = preview.followed.as_ref().map(|followed| Ok(followed.chain(preview.request.choice)));
        preview.plan = Some(plan_stroke(&preview.request, &on, chain));
        tool.set_changed();
    }
    let (hint, obstacle) = describe(&tool, &rig, &posed, hovered.get(rig.entity).ok().and_then(|hovered| hovered.0));
    let banner = status.banner.clone();
    status.set_if_neq(StatusLine { hint, obstacle, banner });
}
