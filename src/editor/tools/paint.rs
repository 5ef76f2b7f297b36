//! Paint tool: a brush that changes the weights of the selected joint under the pointer.
//!
//! A stroke previews edits while the button is down, and its release makes one step of the history; Escape, or an undo during
//! the stroke, leaves the weights as they were. The brush is a ring of the size that it has on the surface. Distances are
//! measured on the mesh at rest, so a bent arm is painted as a straight one is.

pub mod brush;
mod cursor;
mod hover;
mod running_stroke;

use std::collections::BTreeSet;

use bevy::prelude::*;

use self::{
    brush::{BrushPlugin, PaintBrush, mode_of},
    cursor::CursorPainter,
    running_stroke::RunningStroke,
};
pub use self::{
    cursor::BrushCursor,
    hover::{PaintMeshes, PaintObstacle, PointedPlace},
};
use super::{
    Tool, ToolPointer, ToolSystems,
    scene::{EditedRig, Scene},
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        dock::ShowPanel,
        mode::Mode,
        notice::{Notice, StatusLine},
        panel::PanelApp,
        pointer::{ModifierKeys, PointerAct, ViewportArea},
    },
    plugins::{
        document::{Change, EditReport, EditRequest},
        painting::{CanvasUse, PaintCanvas},
        viewport::Sight,
    },
    rig::Uid,
};

/// Plugin of the paint tool.
pub struct PaintPlugin;

impl Plugin for PaintPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<BrushPlugin>() {
            app.add_plugins(BrushPlugin);
        }
        app.init_resource::<PaintTool>()
            .init_resource::<CanvasUse>()
            .add_message::<ShowPanel>()
            .add_systems(Update, paint.in_set(ToolSystems::Tools).after(super::stroke::draw))
            .add_systems(PostUpdate, show.in_set(ToolSystems::Show).after(super::weights::show_weights))
            .add_painter(CursorPainter);
    }
}

/// State of the paint tool.
#[derive(Resource, Default)]
pub struct PaintTool {
    /// The brush on the surface; `None` beside the mesh.
    pub cursor: Option<BrushCursor>,
    /// Mesh and point that were last under the pointer.
    pub under: Option<(Uid, u32)>,
    pointer: Option<Vec2>,
    stroke: Option<Box<RunningStroke>>,
    /// Marks a drag that selects points.
    selects: bool,
}

impl PaintTool {
    /// True while a stroke is painted.
    pub fn is_painting(&self) -> bool {
        self.stroke.is_some()
    }
}

/// Points of a mesh that people have selected, for the table of their weights. They are no part of the document.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct SelectedPoints {
    /// The mesh.
    pub mesh: Option<Uid>,
    /// The points.
    pub points: BTreeSet<u32>,
}

impl SelectedPoints {
    /// Adds points of a mesh; points of another one leave the selection.
    pub fn add(&mut self, mesh: Uid, points: impl IntoIterator<Item = u32>) {
        if self.mesh != Some(mesh) {
            *self = Self { mesh: Some(mesh), points: BTreeSet::new() };
        }
        self.points.extend(points);
    }

    /// Adds a point of a mesh, or takes it out if it was selected.
    pub fn toggle(&mut self, mesh: Uid, point: u32) {
        if self.mesh == Some(mesh) && self.points.remove(&point) {
            return;
        }
        self.add(mesh, [point]);
    }
}

fn paint(
    mut tool: ResMut<PaintTool>,
    (brush, mode): (Res<PaintBrush>, Res<Mode>),
    mut pointers: MessageReader<ToolPointer>,
    mut actions: MessageReader<ActionRequest>,
    mut edited: MessageReader<EditReport>,
    (scene, meshes): (Scene, PaintMeshes),
    mut selected: ResMut<SelectedPoints>,
    mut edits: MessageWriter<EditRequest>,
    mut notices: MessageWriter<Notice>,
) {
    let rig = scene.rig();
    let overtaken: Vec<Entity> = edited.read().filter(|edit| edit.committed.is_some()).map(|edit| edit.rig).collect();
    let is_cancelled = actions.read().filter(|action| action.0 == Action::Cancel).count() > 0;
    if let Some(stroke) = &tool.stroke
        && (is_cancelled || overtaken.contains(&stroke.rig) || rig.as_ref().is_none_or(|rig| rig.entity != stroke.rig))
    {
        edits.write(EditRequest { rig: stroke.rig, change: Change::CancelPreview });
        tool.stroke = None;
    }
    let found = rig.as_ref().zip(scene.sight());
    let mut is_painted = false;
    for ToolPointer { tool: who, pointer } in pointers.read() {
        if *who != Tool::Paint {
            if tool.pointer.is_some() {
                tool.pointer = None;
            }
            continue;
        }
        tool.pointer = (pointer.act != PointerAct::Left).then_some(pointer.at);
        let Some((rig, sight)) = &found else { continue };
        match pointer.act {
            PointerAct::Pressed if *mode == Mode::Paint && selects(pointer.held) => {
                tool.selects = true;
                pick(&meshes, rig, sight, pointer.at, &mut selected);
            }
            PointerAct::Pressed if *mode == Mode::Paint => {
                match RunningStroke::begin(rig, &meshes, sight, pointer.at, pointer.held, &brush) {
                    Ok(stroke) => {
                        tool.stroke = Some(Box::new(stroke));
                        is_painted = true;
                    }
                    Err(why) => {
                        notices.write(Notice::info(format!("Nothing was painted: {why}.")));
                    }
                }
            }
            PointerAct::Dragged if tool.selects => {
                select_within(&meshes, rig, sight, pointer.at, &brush, &mut selected);
            }
            PointerAct::Dragged => {
                if let Some(stroke) = &mut tool.stroke {
                    stroke.line_to(rig, &meshes, sight, pointer.at);
                    is_painted = true;
                }
            }
            PointerAct::Released { dragged, .. } => {
                tool.selects = false;
                let Some(mut stroke) = tool.stroke.take() else { continue };
                if dragged {
                    stroke.line_to(rig, &meshes, sight, pointer.at);
                }
                let (rig, change) = (stroke.rig, stroke.preview());
                if matches!(change, Change::CancelPreview) {
                    let why = "the points have these weights already, or no other free joint can take the rest";
                    notices.write(Notice::info(format!("Nothing was painted: {why}.")));
                }
                edits.write(EditRequest { rig, change });
                edits.write(EditRequest { rig, change: Change::Commit });
                is_painted = false;
            }
            PointerAct::Pressed | PointerAct::Moved | PointerAct::Left | PointerAct::Wheel(_) => {}
        }
    }
    if let Some(stroke) = tool.stroke.as_ref().filter(|_| is_painted) {
        edits.write(EditRequest { rig: stroke.rig, change: stroke.preview() });
    }
}

/// True if these keys make a press select points.
fn selects(held: ModifierKeys) -> bool {
    held.control && held.shift
}

/// Selects the point under the pointer, or takes it out of the selection.
fn pick(meshes: &PaintMeshes, rig: &EditedRig, sight: &Sight, at: Vec2, selected: &mut ResMut<SelectedPoints>) {
    let Ok(place) = meshes.at(rig, sight, at) else { return };
    if let Some(point) = meshes.point(&place) {
        selected.toggle(place.uid, point);
    }
}

/// Selects the points within the brush.
fn select_within(
    meshes: &PaintMeshes,
    rig: &EditedRig,
    sight: &Sight,
    at: Vec2,
    brush: &PaintBrush,
    selected: &mut ResMut<SelectedPoints>,
) {
    let Ok(place) = meshes.at(rig, sight, at) else { return };
    let Some((canvas, spot)) = meshes.spot(&place) else { return };
    let brush = brush.of_size(rig.size());
    let near = canvas.within(&spot, brush.radius, brush.reach);
    selected.add(place.uid, near.into_iter().map(|(point, _)| point));
}

/// Updates the ring of the brush, the point under the pointer, and the status line.
fn show(
    mut tool: ResMut<PaintTool>,
    mode: Res<Mode>,
    area: Option<Res<ViewportArea>>,
    brush: Res<PaintBrush>,
    (scene, meshes): (Scene, PaintMeshes),
    arrived: Query<(), Changed<PaintCanvas>>,
    mut wanted: ResMut<CanvasUse>,
    mut panels: MessageWriter<ShowPanel>,
    mut status: ResMut<StatusLine>,
) {
    let is_on = *mode == Mode::Paint || tool.is_painting();
    if mode.is_changed() && *mode == Mode::Paint {
        panels.write(ShowPanel("Weights"));
    }
    let rig = scene.rig();
    wanted.set_if_neq(CanvasUse(rig.as_ref().map(|rig| rig.entity).filter(|_| is_on)));
    if !is_on {
        if tool.cursor.is_some() || tool.pointer.is_some() {
            tool.cursor = None;
            tool.pointer = None;
        }
        return;
    }
    let is_changed = tool.is_changed() || mode.is_changed() || brush.is_changed() || !arrived.is_empty();
    if !(is_changed || scene.is_changed()) {
        return;
    }
    // The mode may have been changed by a key, under a resting pointer.
    let at = tool.pointer.or(area.as_ref().and_then(|area| area.pointer));
    let (Some(rig), Some(sight)) = (rig, scene.sight()) else { return };
    let place = at.map(|at| meshes.at(&rig, &sight, at));
    let size = brush.of_size(rig.size());
    let cursor = match (&place, at) {
        (Some(Ok(place)), Some(at)) => Some(BrushCursor::new(&rig, &sight, at, place.place, &size)),
        _ => None,
    };
    let under = place.as_ref().and_then(|place| place.as_ref().ok()).and_then(|place| {
        let point = meshes.point(place)?;
        Some((place.uid, point))
    });
    if tool.cursor != cursor {
        tool.cursor = cursor;
    }
    if under.is_some() && tool.under != under {
        tool.under = under;
    }
    if *mode != Mode::Paint {
        return;
    }
    let obstacle = match place {
        _ if tool.is_painting() => None,
        Some(Ok(place)) => RunningStroke::obstacle(&rig, &meshes, &place, &brush).map(|why| why.to_string()),
        Some(Err(why)) => Some(why.to_string()),
        None => None,
    };
    let hint = describe(&rig, &brush);
    let banner = status.banner.clone();
    status.set_if_neq(StatusLine { hint, obstacle, banner });
}

/// Description of the effect of a stroke, in a sentence or two.
fn describe(rig: &EditedRig, brush: &PaintBrush) -> String {
    let sized = brush.of_size(rig.size());
    let mode = mode_of(brush.mode, ModifierKeys::default());
    let joint = rig.selection.active().map_or_else(|| "a joint".to_owned(), |joint| rig.name(joint));
    let what = if mode.is_relative() && brush.all_joints { "all joints".to_owned() } else { joint };
    let both = if rig.symmetry.0.is_some() { ", on both sides" } else { "" };
    format!(
        "{} {what} by {:.2} within {:.3}{both}. Ctrl: the opposite. Shift: smooth. [ and ]: radius. Ctrl+Shift: select points.",
        mode.name(),
        sized.strength,
        sized.radius
    )
}
