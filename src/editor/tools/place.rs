//! Place tool: a ghost shows the position of the joint, and a click places it exactly there.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    Tool, ToolPointer, ToolSystems, click_wishes,
    scene::{EditedRig, Scene},
    select,
};
use crate::{
    algo::placement::{PlaceSettings, Placement},
    editor::{
        actions::{Action, ActionRequest},
        camera::ViewportSight,
        mode::Mode,
        notice::{Notice, StatusLine},
        panel::{PanelApp, ViewportPainter},
        pointer::{PointerAct, ViewportArea},
    },
    mesh::ray::Ray,
    plugins::{
        document::EditReport,
        picking::{HoverRequest, Pick, PickRequest},
        placement::{PlaceAnswer, PlaceRequest, PlacedJoint, joint_at},
        viewport::Sight,
    },
    rig::{Uid, operations::settle},
};

/// Plugin of the place tool.
pub struct PlacePlugin;

impl Plugin for PlacePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<PlaceTool>()
            .add_systems(Update, (tell_late, place).chain().in_set(ToolSystems::Tools).after(click_wishes::answer))
            .add_message::<PlaceAnswer>()
            .add_systems(PostUpdate, show.in_set(ToolSystems::Show).after(select::say))
            .add_painter(DepthPainter);
    }
}

/// State of the place tool.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct PlaceTool {
    /// Depth and volume of the next joint. The volume is kept until Tab has cycled through all; the depth is for one
    /// joint only.
    pub settings: PlaceSettings,
    /// The joint that a click would place.
    pub ghost: Option<PlaceGhost>,
    pointer: Option<Vec2>,
    press: Option<Press>,
    /// Marks that Control is held: a click selects.
    picks: bool,
    /// Marks that the last hover request was sent by this tool.
    hovers: bool,
}

impl PlaceTool {
    /// Returns `true` while the next joint has a depth to choose.
    pub fn has_depth(&self) -> bool {
        self.ghost.is_some_and(|ghost| matches!(ghost.placement, Placement::Between { .. }))
    }
}

/// A press of the button.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Press {
    at: Vec2,
    depth: f32,
    /// Marks a press that selects.
    picks: bool,
}

/// A joint that a click would place, in the rig's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceGhost {
    /// The ray under the pointer.
    pub ray: Ray,
    /// Placement of the joint by the ray.
    pub placement: Placement,
    /// Position of the joint: on the mirror plane, if near it.
    pub position: Vec3,
    /// Position of its mirrored joint.
    pub mirrored: Option<Vec3>,
    /// Parent of the joint.
    pub parent: Option<Uid>,
    /// Position of the parent.
    pub parent_place: Option<Vec3>,
    /// Position of the mirrored joint's parent.
    pub mirrored_parent: Option<Vec3>,
}

/// Reason why a click places nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PlaceObstacle {
    /// The window has no open rig.
    #[error("no rig is open; open a mesh first (Ctrl+O)")]
    NoRig,
    /// The rig has no mesh.
    #[error("the rig has no mesh to place joints in; open one first (Ctrl+O)")]
    NoMesh,
    /// The surface is still being built.
    #[error("the mesh is still being prepared; a click waits for it")]
    Preparing,
    /// The ray misses the mesh.
    #[error("the pointer is beside the mesh; move it over the mesh")]
    Beside,
}

/// Number of notches of the wheel from the near to the far end of the span.
const NOTCHES: f32 = 20.0;
/// Least and largest length of a drag from the near to the far end, in pixels.
const DRAG_SPAN: [f32; 2] = [80.0, 400.0];

/// The joint that a click at a pixel would place.
///
/// # Errors
/// The reason why it would place nothing.
pub fn ghost_at(
    scene: &Scene,
    rig: &EditedRig,
    sight: &Sight,
    at: Vec2,
    settings: PlaceSettings,
) -> Result<PlaceGhost, PlaceObstacle> {
    let surface = rig.surface.as_deref().filter(|surface| surface.ready().is_some());
    let surface = surface.ok_or(if rig.has_mesh { PlaceObstacle::Preparing } else { PlaceObstacle::NoMesh })?;
    let ray = sight.ray(at);
    let PlacedJoint { placement, parent, rest } = joint_at(&rig.rig, &rig.selection, Some(surface), &ray, settings);
    let rests = rest.ok_or(PlaceObstacle::Beside)?;
    let posed = scene.posed(rig);
    let place_of = |joint: Uid| posed.iter().find(|(uid, _)| *uid == joint).map(|(_, place)| *place);
    let other = rig.other_side(parent);
    let (position, mirrored) = settle(&[rests], rig.symmetry.0.as_ref()).first().copied().unwrap_or((rests, None));
    let position = rig.posed_below(parent, position);
    let mirrored = mirrored.map(|mirrored| rig.posed_below(other, mirrored));
    Ok(PlaceGhost {
        ray,
        placement,
        position,
        mirrored,
        parent,
        parent_place: parent.and_then(place_of),
        mirrored_parent: mirrored.and(other).and_then(place_of),
    })
}

pub(super) fn place(
    mut tool: ResMut<PlaceTool>,
    mode: Res<Mode>,
    mut pointers: MessageReader<ToolPointer>,
    mut actions: MessageReader<ActionRequest>,
    scene: Scene,
    mut places: MessageWriter<PlaceRequest>,
    mut picks: MessageWriter<PickRequest>,
    mut hovers: MessageWriter<HoverRequest>,
    mut notices: MessageWriter<Notice>,
) {
    let is_on = *mode == Mode::Place || tool.press.is_some();
    for ActionRequest(action) in actions.read() {
        match action {
            Action::NextVolume if is_on => next_volume(&mut tool),
            Action::Cancel if is_on && (tool.press.is_some() || tool.settings.depth != 0.5) => {
                tool.press = None;
                tool.settings.depth = 0.5;
            }
            _ => {}
        }
    }
    let found = scene.rig().zip(scene.sight());
    for ToolPointer { tool: who, pointer } in pointers.read() {
        if *who != Tool::Place {
            if tool.pointer.is_some() {
                tool.pointer = None;
            }
            continue;
        }
        let before = tool.picks;
        // The press decides for the whole drag.
        tool.picks = tool.press.map_or(pointer.held.control, |press| press.picks);
        tool.pointer = Some(pointer.at);
        match pointer.act {
            PointerAct::Left => tool.pointer = None,
            PointerAct::Moved => {}
            PointerAct::Pressed => {
                tool.press = Some(Press { at: pointer.at, depth: tool.settings.depth(), picks: tool.picks })
            }
            PointerAct::Dragged => {
                let span = found.as_ref().and_then(|(_, sight)| drag_span(&tool, sight)).unwrap_or(DRAG_SPAN[0]);
                if let Some(press) = tool.press.filter(|press| !press.picks) {
                    tool.settings.depth = (press.depth + (press.at.y - pointer.at.y) / span).clamp(0.0, 1.0);
                }
            }
            PointerAct::Wheel(notches) => {
                tool.settings.depth = (tool.settings.depth() + notches / NOTCHES).clamp(0.0, 1.0);
            }
            PointerAct::Released { dragged, count } => {
                let (Some(press), Some((rig, sight))) = (tool.press.take(), &found) else { continue };
                if press.picks {
                    let what = select::click(&scene, rig, sight, press.at).unwrap_or(Pick::None);
                    picks.write(PickRequest { rig: rig.entity, what, add: pointer.held.shift });
                    continue;
                }
                // The second click of a double click would put a joint into the one that the first has placed.
                if count > 1 && !dragged {
                    continue;
                }
                match ghost_at(&scene, rig, sight, press.at, tool.settings) {
                    Ok(_) | Err(PlaceObstacle::Preparing) => {
                        places.write(PlaceRequest {
                            rig: rig.entity,
                            ray: sight.ray(press.at),
                            settings: tool.settings,
                        });
                        tool.settings.depth = 0.5;
                    }
                    Err(why) => {
                        notices.write(Notice::info(format!("No joint was placed: {why}.")));
                    }
                }
            }
        }
        if before != tool.picks {
            tool.set_changed();
        }
    }
    // With Control a click selects; its joint is highlighted as in other modes.
    let hovering = tool.picks && is_on;
    if let Some((rig, sight)) = &found
        && (hovering || tool.hovers)
    {
        let at = tool.pointer.filter(|_| hovering);
        let what = at.and_then(|at| select::click(&scene, rig, sight, at));
        let what = what.and_then(|what| match what {
            Pick::Click { plane, point, reach } => Some((plane, point, reach)),
            _ => None,
        });
        if tool.is_changed() || scene.is_changed() {
            hovers.write(HoverRequest { rig: rig.entity, what });
        }
        if tool.hovers != hovering {
            tool.hovers = hovering;
        }
    }
}

/// Tells what became of clicks that waited for the mesh. Edits are made in the frame of their answer; what is refused is
/// told with all refusals.
fn tell_late(
    mut answers: MessageReader<PlaceAnswer>,
    mut edited: MessageReader<EditReport>,
    mut notices: MessageWriter<Notice>,
) {
    let changed: Vec<Entity> = edited.read().filter(|report| report.is_new_step()).map(|report| report.rig).collect();
    for PlaceAnswer { rig, placement, refusal, .. } in answers.read().filter(|answer| answer.waited) {
        notices.write(match (refusal, placement) {
            (Some(why), _) => Notice::info(format!("No joint was placed: {why}.")),
            (None, Placement::Nothing) => {
                Notice::info("No joint was placed: the click waited for the mesh, and is beside it.")
            }
            (None, _) if !changed.contains(rig) => continue,
            (None, _) => Notice::done("Placed the joint of the click that waited for the mesh.").quiet(),
        });
    }
}

/// Cycles from the whole span to the near volume, to the next ones, and back.
fn next_volume(tool: &mut PlaceTool) {
    let count = match tool.ghost.map(|ghost| ghost.placement) {
        Some(Placement::Between { volumes, .. }) => volumes,
        _ => 1,
    };
    tool.settings.volume = match tool.settings.volume {
        None if count > 1 => Some(1),
        Some(number) if number < count => Some(number + 1),
        _ => None,
    };
}

/// Length of a drag from the near to the far end in pixels: the length of the span on the screen, within [`DRAG_SPAN`].
fn drag_span(tool: &PlaceTool, sight: &Sight) -> Option<f32> {
    let Placement::Between { near, far, .. } = tool.ghost?.placement else { return None };
    let pixel = sight.pixel_at(near.midpoint(far));
    (pixel > 0.0).then(|| (near.distance(far) / pixel).clamp(DRAG_SPAN[0], DRAG_SPAN[1]))
}

/// Updates the ghost and the status line.
pub(super) fn show(
    mut tool: ResMut<PlaceTool>,
    mode: Res<Mode>,
    area: Res<ViewportArea>,
    scene: Scene,
    mut status: ResMut<StatusLine>,
) {
    let is_on = *mode == Mode::Place || tool.press.is_some();
    if !is_on {
        if tool.ghost.is_some() || tool.pointer.is_some() {
            tool.ghost = None;
            tool.pointer = None;
        }
        return;
    }
    if !(tool.is_changed() || mode.is_changed() || scene.is_changed()) {
        return;
    }
    // The mode may have been changed by a key, under a resting pointer.
    let pointer = tool.pointer.or(area.pointer);
    let at = tool.press.map(|press| press.at).or(pointer).filter(|_| !tool.picks);
    let found = match (scene.rig(), scene.sight(), at) {
        (None, ..) => Some(Err(PlaceObstacle::NoRig)),
        (Some(rig), Some(sight), Some(at)) => Some(ghost_at(&scene, &rig, &sight, at, tool.settings)),
        _ => None,
    };
    let ghost = found.and_then(Result::ok);
    if tool.ghost != ghost {
        tool.ghost = ghost;
    }
    if *mode != Mode::Place {
        return;
    }
    let hint = match (&ghost, scene.rig()) {
        _ if tool.picks => "Ctrl and click selects the joint that the next one hangs on.".to_owned(),
        (Some(ghost), Some(rig)) => describe(ghost, &rig, tool.settings),
        _ => "Click places a joint in the middle of the mesh; Ctrl and click selects its parent.".to_owned(),
    };
    let obstacle = found.and_then(Result::err).map(|why| why.to_string());
    let banner = status.banner.clone();
    status.set_if_neq(StatusLine { hint, obstacle, banner });
}

/// Description of the effect of a click, in a sentence or two.
fn describe(ghost: &PlaceGhost, rig: &EditedRig, settings: PlaceSettings) -> String {
    let below = ghost.parent.map_or("as a root".to_owned(), |parent| format!("below {}", rig.name(parent)));
    let both = if ghost.mirrored.is_some() { " on both sides" } else { "" };
    let what = format!("Click places a joint {below}{both}");
    let depth = (settings.depth() * 100.0).round();
    match ghost.placement {
        Placement::Between { volumes, volume: None, .. } if volumes > 1 => {
            format!("{what}, midway through {volumes} volumes: Tab for the near one. Wheel: depth ({depth} %).")
        }
        Placement::Between { volumes, volume: Some(number), .. } if volumes > 1 => {
            let next = if number < volumes { "the next" } else { "all of them" };
            format!("{what}, in volume {number} of {volumes}: Tab for {next}. Wheel: depth ({depth} %).")
        }
        Placement::Between { .. } => format!("{what}. Wheel, or drag up and down: depth ({depth} %)."),
        _ => format!("{what}, on the surface: the mesh has no other side here."),
    }
}

/// Painter of depth and volume beside the ghost, if they are not the defaults.
struct DepthPainter;

impl ViewportPainter for DepthPainter {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let Some(tool) = world.get_resource::<PlaceTool>() else { return };
        let Some(ghost) = tool.ghost else { return };
        let sight = world.get_resource::<ViewportSight>().and_then(|sight| sight.0);
        let Some(at) = sight.and_then(|sight| sight.project(ghost.position)) else { return };
        let Placement::Between { volume, volumes, .. } = ghost.placement else { return };
        let mut words = Vec::new();
        match volume {
            None if volumes > 1 => words.push(format!("{volumes} volumes: Tab")),
            Some(number) if volumes > 1 => words.push(format!("volume {number} of {volumes}")),
            _ => {}
        }
        if tool.settings.depth != 0.5 {
            words.push(format!("depth {:.0} %", 100.0 * tool.settings.depth()));
        }
        if words.is_empty() {
            return;
        }
        let color = egui::Color32::from_rgb(236, 238, 242);
        let text = painter.layout_no_wrap(words.join(", "), egui::FontId::proportional(13.0), color);
        let corner = area.min + egui::vec2(at.x + 16.0, at.y - 14.0 - text.size().y);
        let back = egui::Rect::from_min_size(corner, text.size()).expand2(egui::vec2(5.0, 2.0));
        painter.rect_filled(back, 3.0, egui::Color32::from_black_alpha(170));
        painter.galley(corner, text, color);
    }
}
