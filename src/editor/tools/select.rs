//! Select tool: a click picks a joint, a drag the joints in a box, a double click the hierarchy.
//!
//! The joint that a click would pick is highlighted before the click, by the same code.

use bevy::{ecs::system::SystemParam, prelude::*};
use bevy_egui::egui;

use super::{
    GizmoHover, Tool, ToolPointer, ToolSystems,
    click_wishes::{ClickWish, ClickWishes, answer},
    scene::{EditedRig, Scene, joints},
};
use crate::{
    algo::picking::{candidates_at, in_box},
    editor::{
        mode::Mode,
        notice::StatusLine,
        panel::{PanelApp, ViewportPainter},
        pointer::{ModifierKeys, PointerAct, ViewportArea},
    },
    plugins::{
        controls::{
            ControlsInUse,
            outline::{ControlNodes, ControlOutline, nearest_control},
        },
        document::HoveredNode,
        picking::{HoverRequest, Pick, PickRequest},
        schema::RigNodes,
        viewport::Sight,
    },
    rig::{LayerDisplay, Uid},
};

/// Plugin of the select tool.
pub struct SelectPlugin;

impl Plugin for SelectPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<SelectTool>()
            .init_resource::<ClickWishes>()
            .init_resource::<ControlsInUse>()
            .add_systems(Update, (select, answer).chain().in_set(ToolSystems::Tools))
            .add_systems(PostUpdate, say.in_set(ToolSystems::Show))
            .add_painter(BandPainter);
    }
}

/// State of the select tool.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct SelectTool {
    /// Opposite corners of the box that is being dragged, in pixels of the viewport.
    pub band: Option<[Vec2; 2]>,
    press: Option<Vec2>,
    pointer: Option<Vec2>,
    /// Rig, view and position of the last hover request.
    asked: Option<(Entity, Sight, Vec2)>,
}

impl SelectTool {
    /// The node that a click at a pixel picks: the highlighted one, where the pointer rested there before. Else that one lies
    /// under another place, from where the pointer has come within the frame.
    pub(super) fn node_of_click(
        &self,
        hovered: &Query<&HoveredNode>,
        scene: &Scene,
        controls: &DrawnControls,
        rig: &EditedRig,
        sight: &Sight,
        at: Vec2,
    ) -> Option<Uid> {
        let is_there = |(of, seen, place): (Entity, Sight, Vec2)| {
            of == rig.entity && seen == *sight && place.distance(at) <= BESIDE_HOVER
        };
        match self.asked.is_some_and(is_there) {
            true => hovered.get(rig.entity).ok().and_then(|hovered| hovered.0),
            false => node_under(scene, controls, rig, sight, at),
        }
    }
}

/// Largest distance of clicks at the same spot, in pixels.
pub const REACH: f32 = 8.0;
/// Largest distance of a click beside the mesh from the joint it picks, in pixels.
const BESIDE: f32 = 24.0;
/// Largest distance of a click from where the highlighted node was looked for, in pixels.
const BESIDE_HOVER: f32 = 4.0;

/// Outlines of controls, as far as they are drawn.
#[derive(SystemParam)]
pub(super) struct DrawnControls<'w, 's> {
    rigs: Query<'w, 's, &'static RigNodes>,
    nodes: ControlNodes<'w, 's>,
    in_use: Res<'w, ControlsInUse>,
}

impl DrawnControls<'_, '_> {
    /// Controls whose outlines have their middles between two corners of the view plane, in the order of the rig's nodes.
    fn within(&self, rig: &EditedRig, sight: &Sight, corners: [Vec2; 2]) -> Vec<Uid> {
        if !self.in_use.0 {
            return Vec::new();
        }
        let visible = self.nodes.visible(self.rigs.get(rig.entity).ok(), rig.place.affine().inverse());
        let middle = |control: &ControlOutline| {
            let points: Vec<Vec3> = control.lines.iter().flatten().copied().collect();
            points.iter().sum::<Vec3>() / points.len().max(1) as f32
        };
        let free: Vec<&ControlOutline> = visible.iter().filter(|it| it.display == LayerDisplay::Normal).collect();
        let middles: Vec<Vec3> = free.iter().map(|control| middle(control)).collect();
        in_box(&sight.plane, corners, &middles).into_iter().map(|number| free[number].uid).collect()
    }

    /// The control whose outline is at a pixel; `None` while a skeleton is drawn in place of controls.
    pub(super) fn at(&self, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<Uid> {
        self.nearest(rig, sight, at).map(|(control, _)| control)
    }

    /// The control whose outline is at a pixel, with the distance of the outline from there in pixels; `None` while a skeleton
    /// is drawn in place of controls.
    pub(super) fn nearest(&self, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<(Uid, f32)> {
        self.nearest_among(|_| true, rig, sight, at)
    }

    /// The control of [`nearest`](Self::nearest) among some controls.
    pub(super) fn nearest_among(
        &self,
        is_meant: impl Fn(Uid) -> bool,
        rig: &EditedRig,
        sight: &Sight,
        at: Vec2,
    ) -> Option<(Uid, f32)> {
        if !self.in_use.0 {
            return None;
        }
        let mut visible = self.nodes.visible(self.rigs.get(rig.entity).ok(), rig.place.affine().inverse());
        visible.retain(|control| is_meant(control.uid));
        let found = nearest_control(&visible, &sight.plane, sight.point(at), REACH * sight.pixel)?;
        Some((found.0, found.1 / sight.pixel))
    }
}

/// The pick of a click where no controls are drawn; `None` for a click beside the mesh and all joints.
pub fn click(scene: &Scene, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<Pick> {
    is_over(scene, rig, sight, at).then(|| pick_at(sight, at))
}

/// The pick of a click; `None` for a click beside the mesh, all joints and all outlines of controls.
pub(super) fn click_or_control(
    scene: &Scene,
    controls: &DrawnControls,
    rig: &EditedRig,
    sight: &Sight,
    at: Vec2,
) -> Option<Pick> {
    let is_met = is_over(scene, rig, sight, at) || controls.at(rig, sight, at).is_some();
    is_met.then(|| pick_at(sight, at))
}

fn pick_at(sight: &Sight, at: Vec2) -> Pick {
    Pick::Click { plane: sight.plane, point: sight.point(at), reach: REACH * sight.pixel }
}

/// Returns `true` if a pixel is over the mesh or near a joint.
fn is_over(scene: &Scene, rig: &EditedRig, sight: &Sight, at: Vec2) -> bool {
    let near = |place: Vec3| sight.project(place).is_some_and(|pixel| pixel.distance(at) <= BESIDE);
    let met = rig
        .surface
        .as_ref()
        .and_then(|surface| surface.ready())
        .is_some_and(|surface| surface.closest(&sight.ray(at)).is_some());
    met || scene.posed(rig).iter().any(|(_, place)| near(*place))
}

pub(super) fn select(
    mut shown: ResMut<SelectTool>,
    mut pointers: MessageReader<ToolPointer>,
    (scene, controls): (Scene, DrawnControls),
    (mode, area, gizmo): (Res<Mode>, Res<ViewportArea>, Res<GizmoHover>),
    hovered: Query<&HoveredNode>,
    mut wishes: ResMut<ClickWishes>,
    mut hovers: MessageWriter<HoverRequest>,
) {
    let (Some(rig), Some(sight)) = (scene.rig(), scene.sight()) else {
        pointers.clear();
        return;
    };
    // The box is all that is shown; the pointer's position does not count as a change.
    let band = shown.band;
    let tool = shown.bypass_change_detection();
    for (ToolPointer { tool: who, pointer }, event) in pointers.read_with_id() {
        if *who != Tool::Select {
            tool.pointer = None;
            continue;
        }
        tool.pointer = Some(pointer.at);
        match pointer.act {
            PointerAct::Left => tool.pointer = None,
            PointerAct::Pressed => tool.press = Some(pointer.at),
            PointerAct::Dragged => tool.band = tool.press.map(|press| [press, pointer.at]),
            PointerAct::Released { dragged, count } => {
                let band = tool.band.take();
                let Some(press) = tool.press.take() else { continue };
                let wish = match band.filter(|_| dragged) {
                    Some(band) => {
                        let corners = band.map(|corner| sight.point(corner));
                        // Where people pose, a box is for controls; joints are boxed where there are none in it.
                        let is_posing = *mode == Mode::Pose;
                        let found = if is_posing { controls.within(&rig, &sight, corners) } else { Vec::new() };
                        ClickWish::Pick(boxed(&scene, &rig, &sight, corners, found, pointer.held))
                    }
                    None => {
                        let pick = click_or_control(&scene, &controls, &rig, &sight, press);
                        let under = tool.node_of_click(&hovered, &scene, &controls, &rig, &sight, press);
                        ClickWish::Click { pick, held: pointer.held, count, under }
                    }
                };
                wishes.add(event, wish);
            }
            PointerAct::Moved | PointerAct::Wheel(_) => {}
        }
    }
    // The mode may have been changed by a key, under a resting pointer.
    let resting = area.pointer.filter(|_| Tool::of(*mode) == Tool::Select && !gizmo.is_over);
    let at = tool.pointer.or(resting).filter(|_| tool.press.is_none());
    let asked = at.map(|at| (rig.entity, sight, at));
    if asked != tool.asked {
        // The request is not repeated while another tool has the pointer, because that tool may have sent one.
        tool.asked = asked;
        let what = at.and_then(|at| match click_or_control(&scene, &controls, &rig, &sight, at) {
            Some(Pick::Click { plane, point, reach }) => Some((plane, point, reach)),
            _ => None,
        });
        hovers.write(HoverRequest { rig: rig.entity, what });
    }
    if tool.band != band {
        shown.set_changed();
    }
}

/// The node that a first click at a pixel picks.
fn node_under(scene: &Scene, controls: &DrawnControls, rig: &EditedRig, sight: &Sight, at: Vec2) -> Option<Uid> {
    if let Some(control) = controls.at(rig, sight, at) {
        return Some(control);
    }
    let posed = scene.posed(rig);
    let places: Vec<Vec3> = posed.iter().map(|(_, place)| *place).collect();
    let ray = sight.ray(at);
    let hit = rig.surface.as_ref().and_then(|surface| surface.ready()).and_then(|surface| surface.closest(&ray));
    let hit = hit.map(|hit| ray.at(hit.distance));
    let found = candidates_at(hit, &sight.plane, sight.point(at), &places, REACH * sight.pixel);
    found.first().map(|number| posed[*number].0)
}

/// The selection as the clicks of a frame leave it. Requests are answered later in the frame, but the next click of a slow frame
/// has to know what the one before it picks.
#[derive(Debug, Default)]
pub(super) struct ClickedSelection(Option<Vec<Uid>>);

impl ClickedSelection {
    /// The selected nodes, the active one last.
    pub(super) fn nodes<'a>(&'a self, rig: &'a EditedRig) -> &'a [Uid] {
        self.0.as_deref().unwrap_or(&rig.selection.0)
    }

    /// Takes over the request of a click, which picks the node `under` where it names none.
    pub(super) fn follow(&mut self, rig: &EditedRig, request: &PickRequest, under: Option<Uid>) {
        let found = match &request.what {
            Pick::Joints(nodes) => nodes.as_slice(),
            Pick::Click { .. } => under.as_slice(),
            Pick::Box { .. } | Pick::All | Pick::None => &[],
        };
        let before = if request.add { self.nodes(rig) } else { &[] };
        let kept = before.iter().filter(|node| !found.contains(*node));
        let after: Vec<Uid> = kept.chain(found).copied().collect();
        self.0 = Some(after);
    }

    /// The request of a click with what it meets; of a double click, with the hierarchy of the active joint. `under` is the node
    /// that the click picks.
    pub(super) fn request(
        &mut self,
        rig: &EditedRig,
        pick: Option<Pick>,
        held: ModifierKeys,
        count: u8,
        under: Option<Uid>,
    ) -> PickRequest {
        let request = clicked(rig, self.nodes(rig), pick, held, count, under);
        self.follow(rig, &request, under);
        request
    }
}

fn clicked(
    rig: &EditedRig,
    selected: &[Uid],
    pick: Option<Pick>,
    held: ModifierKeys,
    count: u8,
    under: Option<Uid>,
) -> PickRequest {
    let request = |what, add| PickRequest { rig: rig.entity, what, add };
    let active = selected.last().copied().filter(|active| count > 1 && rig.rig.joint(*active).is_some());
    if let Some(active) = active {
        return request(Pick::Joints(hierarchy_below(rig, active)), held.shift || held.control);
    }
    let Some(pick) = pick else {
        return if held.shift || held.control {
            request(Pick::Joints(Vec::new()), true)
        } else {
            request(Pick::None, false)
        };
    };
    match under {
        Some(joint) if held.control && selected.contains(&joint) => {
            request(Pick::Joints(selected.iter().copied().filter(|other| *other != joint).collect()), false)
        }
        _ => request(pick, held.shift || held.control),
    }
}

/// A joint with all below, itself last: as a selection, it stays the active one.
pub(super) fn hierarchy_below(rig: &EditedRig, joint: Uid) -> Vec<Uid> {
    let mut below: Vec<Uid> = rig.rig.hierarchy(joint).map(|joint| joint.data.uid).collect();
    below.reverse();
    below
}

/// The request of a box with the controls in it, or with its joints if there are none.
fn boxed(
    scene: &Scene,
    rig: &EditedRig,
    sight: &Sight,
    corners: [Vec2; 2],
    controls: Vec<Uid>,
    held: ModifierKeys,
) -> PickRequest {
    if !held.control {
        let what = match controls.is_empty() {
            true => Pick::Box { plane: sight.plane, corners },
            false => Pick::Joints(controls),
        };
        return PickRequest { rig: rig.entity, what, add: held.shift };
    }
    let posed = scene.posed(rig);
    let places: Vec<Vec3> = posed.iter().map(|(_, place)| *place).collect();
    let joints = in_box(&sight.plane, corners, &places).into_iter().map(|number| posed[number].0);
    let inside: Vec<Uid> = controls.into_iter().chain(joints).collect();
    let rest = rig.selection.0.iter().copied().filter(|joint| !inside.contains(joint)).collect();
    PickRequest { rig: rig.entity, what: Pick::Joints(rest), add: false }
}

/// Sets the status line to the effect of a click.
pub(super) fn say(
    mode: Res<Mode>,
    tool: Res<SelectTool>,
    scene: Scene,
    hovered: Query<Ref<HoveredNode>>,
    mut status: ResMut<StatusLine>,
) {
    let Some(rig) = scene.rig() else { return };
    let hovered = hovered.get(rig.entity).ok();
    let is_changed = tool.is_changed()
        || mode.is_changed()
        || scene.is_changed()
        || hovered.as_ref().is_some_and(|hovered| hovered.is_changed());
    if *mode != Mode::Select || !is_changed {
        return;
    }
    let hint = if tool.band.is_some() {
        "Release to select what is in the box; Shift adds, Ctrl takes away.".to_owned()
    } else if let Some(joint) = hovered.as_ref().and_then(|hovered| hovered.0) {
        let name = rig.name(joint);
        if rig.selection.active() == Some(joint) {
            format!("{name} is selected. Click again: the next nearest. Double click: all that hangs below.")
        } else {
            format!("Click selects {name}. Shift adds, Ctrl takes away. Drag: a box.")
        }
    } else if rig.rig.is_empty() {
        "There are no joints yet: press A to place one, S to draw a stroke.".to_owned()
    } else {
        let selected = rig.selection.0.len();
        let clear = if selected > 0 {
            format!(" Click beside the mesh: none ({} selected).", joints(selected))
        } else {
            String::new()
        };
        format!("Click a joint, or drag a box around some.{clear}")
    };
    status.set_if_neq(StatusLine { hint, obstacle: None, banner: status.banner.clone() });
}

/// Painter of the box that is being dragged.
struct BandPainter;

impl ViewportPainter for BandPainter {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let Some([a, b]) = world.get_resource::<SelectTool>().and_then(|tool| tool.band) else { return };
        let place = |at: Vec2| area.min + egui::vec2(at.x, at.y);
        let band = egui::Rect::from_two_pos(place(a), place(b));
        let color = egui::Color32::from_rgb(255, 170, 60);
        painter.rect_filled(band, 0.0, color.gamma_multiply(0.12));
        painter.rect_stroke(band, 0.0, egui::Stroke::new(1.0, color), egui::StrokeKind::Inside);
    }
}
