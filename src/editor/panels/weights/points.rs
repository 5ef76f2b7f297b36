//! Table of points: their influences as numbers, which can be dragged and typed.

use std::sync::{Arc, Weak};

use bevy::{ecs::change_detection::Tick, prelude::*};
use bevy_egui::egui::{Align, Layout, Rect, RichText, Sense, Ui, UiBuilder, vec2};

use super::in_area;
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        counts::counted,
        notice::Notice,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{CommonValue, Look, NumberEdit, Numbers},
            list::{self, List},
        },
        tools::paint::{PaintTool, SelectedPoints, brush::BrushAction},
    },
    plugins::{
        commands::BuildResult,
        document::{Change, EditRequest},
        painting::{PaintableJoint, locks, paintable, row_edit},
        surface::RigMesh,
    },
    rig::{SkinData, Uid, proportion::Quantity},
};

/// Table of points.
#[derive(Default)]
pub(super) struct PointTable {
    numbers: Numbers,
    made_from: Option<TableKey>,
    points: Vec<u32>,
    lines: Vec<Line>,
    /// Weights before a number was dragged: previews are edits of these.
    before: Option<(Uid, Arc<SkinData>)>,
}

/// State that the lines were made from.
struct TableKey {
    mesh: Uid,
    skin: Weak<SkinData>,
    listed: PointChoice,
    active: Option<Uid>,
}

/// Points that the table lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PointChoice {
    /// The selected ones, as of a change of the selection.
    Selected(Tick),
    /// The one that was last under the pointer.
    Under(u32),
}

impl PointChoice {
    /// The selected points, or else the one that was last under the pointer, with their mesh.
    fn of(world: &World) -> Option<(Uid, Self)> {
        let selected = world.get_resource_ref::<SelectedPoints>()?;
        if let (Some(mesh), false) = (selected.mesh, selected.points.is_empty()) {
            return Some((mesh, Self::Selected(selected.last_changed())));
        }
        let (mesh, point) = world.get_resource::<PaintTool>()?.under?;
        Some((mesh, Self::Under(point)))
    }

    fn points(self, world: &World) -> Vec<u32> {
        match self {
            Self::Selected(_) => {
                let selected = world.get_resource::<SelectedPoints>();
                selected.map(|selected| selected.points.iter().copied().collect()).unwrap_or_default()
            }
            Self::Under(point) => vec![point],
        }
    }
}

/// Line of the table.
#[derive(Debug, Clone, PartialEq)]
enum Line {
    /// Weight of the active joint at all points.
    All(PaintableJoint, CommonValue<f32>),
    /// Point that the following lines are about.
    Point(u32),
    /// Weight of a joint at a point.
    Weight(u32, PaintableJoint, f32),
}

/// Rows that are seen at once.
const ROWS: usize = 10;
/// Weight from 0 to 1.
const WEIGHT: Look = Look { speed: 0.005, decimals: 4, suffix: "", quantity: Quantity::Plain };

/// Edit of a weight: the joint, the points, and what people did to the number.
type WeightEdit = (PaintableJoint, Vec<u32>, NumberEdit);

impl PointTable {
    pub fn show(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        meshes: &[(Entity, &RigMesh)],
        requests: &mut Requests,
    ) {
        let Some((mesh, listed)) = PointChoice::of(world) else {
            ui.weak(
                "Points: in Paint mode, Ctrl+Shift and click selects some; else the one under the pointer is listed.",
            );
            return;
        };
        let is_there = meshes.iter().any(|(_, known)| known.uid == mesh);
        let Some(skin) = shown.rig.skin(mesh).filter(|_| is_there) else {
            ui.weak("The mesh of the points has no weights.");
            return;
        };
        self.refresh(world, shown, mesh, skin, listed);
        let count = self.points.len();
        ui.horizontal(|ui| {
            ui.strong(counted(count, "point", "points"));
            if ui.button("Select no points").clicked() {
                requests.send(ActionRequest(Action::Brush(BrushAction::NoPoints)));
            }
        });
        let height = ui.spacing().interact_size.y + 2.0;
        let rows = self.lines.len().min(ROWS) as f32;
        let mut edited: Option<WeightEdit> = None;
        let (numbers, lines, points) = (&mut self.numbers, &self.lines, &self.points);
        in_area(ui, "points", rows * height, |ui| {
            let list = List { id: "points", count: lines.len(), height, reveal: None, follow: false };
            list.show(ui, |ui, range, row| {
                for number in range {
                    let edit = draw(ui, row(number), &lines[number], numbers, shown, world);
                    edited = edited.take().or(edit.map(|(joint, edit)| {
                        let points = match lines[number] {
                            Line::All(..) => points.clone(),
                            Line::Point(point) | Line::Weight(point, ..) => vec![point],
                        };
                        (joint, points, edit)
                    }));
                }
            });
        });
        self.numbers.tell(requests);
        if let Some(edit) = edited {
            self.edit(shown, mesh, skin, edit, requests);
        }
        // A drag whose line has gone ends without an edit.
        if ui.ctx().dragged_id().is_none() {
            self.before = None;
        }
    }

    /// Lists the influences again after a change of the weights or of the points.
    fn refresh(&mut self, world: &World, shown: &DisplayedRig, mesh: Uid, skin: &Arc<SkinData>, listed: PointChoice) {
        if self.before.is_some() {
            // A dragged number stays in its line, even if others lose all of their weight to it.
            self.made_from = None;
            renew(&mut self.lines, skin);
            return;
        }
        let active = shown.selection.active();
        let is_same = |key: &TableKey| {
            key.mesh == mesh
                && std::ptr::eq(key.skin.as_ptr(), Arc::as_ptr(skin))
                && key.listed == listed
                && key.active == active
        };
        if self.made_from.as_ref().is_some_and(is_same) {
            return;
        }
        let built = world.get::<BuildResult>(shown.entity).map(|built| &*built.0);
        let chosen = active.and_then(|active| paintable(&shown.rig, built, active).ok());
        self.points = listed.points(world);
        self.lines = lines(skin, &self.points, chosen);
        self.made_from = Some(TableKey { mesh, skin: Arc::downgrade(skin), listed, active });
    }

    /// Sends the change of a weight.
    fn edit(
        &mut self,
        shown: &DisplayedRig,
        mesh: Uid,
        skin: &Arc<SkinData>,
        (joint, points, edit): WeightEdit,
        requests: &mut Requests,
    ) {
        let of =
            |skin: &SkinData, weight: f32| row_edit(&shown.rig, (mesh, skin), joint, points.iter().copied(), weight);
        let change = match edit {
            NumberEdit::Set(weight) => of(skin, weight).map(Change::Do),
            NumberEdit::Preview(weight) => {
                let known = self.before.take().filter(|(uid, _)| *uid == mesh);
                let (_, before) = self.before.insert(known.unwrap_or_else(|| (mesh, skin.clone())));
                Some(of(before, weight).map_or(Change::CancelPreview, Change::Preview))
            }
            NumberEdit::Commit | NumberEdit::Cancel => {
                self.before = None;
                Some(if edit == NumberEdit::Commit { Change::Commit } else { Change::CancelPreview })
            }
        };
        if change.is_none() && matches!(edit, NumberEdit::Set(_)) {
            let why = "no other free joint of the point can take the rest; give one a weight first";
            requests.send(Notice::warning(format!("The weight stays as it was: {why}.")));
        }
        if let Some(change) = change {
            requests.send(EditRequest { rig: shown.entity, change });
        }
    }
}

/// Lines of points: each with its influences in the order of the joints, so that a dragged number stays in its line.
fn lines(skin: &SkinData, points: &[u32], active: Option<PaintableJoint>) -> Vec<Line> {
    let mut lines = Vec::new();
    let mut common: Vec<f32> = Vec::new();
    for point in points.iter().copied().filter(|point| (*point as usize) < skin.weights.len()) {
        lines.push(Line::Point(point));
        let mut row: Vec<(u32, f32)> = skin.weights.of(point as usize).collect();
        row.sort_by_key(|(joint, _)| *joint);
        let mut of_active = 0.0;
        for (number, weight) in row {
            let Some(uid) = skin.joints.get(number as usize).copied() else { continue };
            if active.is_some_and(|active| active.uid == uid) {
                of_active = weight;
                continue;
            }
            lines.push(Line::Weight(point, PaintableJoint { uid, subject: skin.subjects.get(&uid).copied() }, weight));
        }
        if let Some(active) = active {
            // The active joint has a line even where it has no weight, so that it can get one.
            lines.push(Line::Weight(point, active, of_active));
            common.push(of_active);
        }
    }
    if let Some((active, value)) = active.zip(CommonValue::of(common.into_iter())).filter(|_| points.len() > 1) {
        lines.insert(0, Line::All(active, value));
    }
    lines
}

/// Updates the weights in lines of points.
fn renew(lines: &mut [Line], skin: &SkinData) {
    let weight = |point: u32, joint: Uid| {
        let number = skin.joints.iter().position(|other| *other == joint);
        let has_point = (point as usize) < skin.weights.len();
        let found = number
            .filter(|_| has_point)
            .and_then(|number| skin.weights.of(point as usize).find(|(other, _)| *other as usize == number));
        found.map_or(0.0, |(_, weight)| weight)
    };
    for line in lines {
        if let Line::Weight(point, joint, value) = line {
            *value = weight(*point, joint.uid);
        }
    }
}

/// Draws a line; returns the joint and the edit of its number.
fn draw(
    ui: &mut Ui,
    rect: Rect,
    line: &Line,
    numbers: &mut Numbers,
    shown: &DisplayedRig,
    world: &World,
) -> Option<(PaintableJoint, NumberEdit)> {
    let (joint, value, place) = match line {
        Line::Point(point) => {
            list::line(ui, rect, &format!("Point {point}"), ui.visuals().strong_text_color());
            return None;
        }
        Line::All(joint, value) => (joint, *value, "all points".to_owned()),
        Line::Weight(point, joint, weight) => (joint, CommonValue::from(*weight), format!("point {point}")),
    };
    let name = name_of(world, shown, joint.uid);
    let said = format!("Weight of {name} at {place}");
    let text = if matches!(line, Line::All(..)) { format!("{name}, {place}") } else { name };
    let layout = Layout::left_to_right(Align::Center);
    let mut ui = ui.new_child(UiBuilder::new().id_salt(&said).max_rect(rect.shrink2(vec2(4.0, 1.0))).layout(layout));
    let width = (ui.available_width() * 0.55).max(40.0);
    let (label, response) = ui.allocate_exact_size(vec2(width, ui.spacing().interact_size.y), Sense::hover());
    let is_locked = locks(&shown.rig, [(joint.uid, joint.subject)]).contains(&true);
    if list::line(&ui, label, &text, ui.visuals().text_color()) || is_locked {
        response.on_hover_text(if is_locked { format!("{text}: locked, its weights stay") } else { text });
    }
    if is_locked {
        ui.disable();
    }
    let size = vec2(ui.available_width().max(30.0), ui.spacing().interact_size.y);
    let edit = numbers.field(&mut ui, &said, RichText::new(""), value, WEIGHT, size)?;
    let is_weight = |weight: f32| (0.0..=1.0).contains(&weight);
    let edit = match edit {
        // A drag passes over numbers that are no weights.
        NumberEdit::Preview(weight) => NumberEdit::Preview(weight.clamp(0.0, 1.0)),
        NumberEdit::Set(weight) if !is_weight(weight) => {
            numbers.refuse_weight(&said, weight);
            return None;
        }
        edit => edit,
    };
    Some((*joint, edit))
}

/// Name of a joint of the document, or of one that a command made.
fn name_of(world: &World, shown: &DisplayedRig, joint: Uid) -> String {
    let built = world.get::<BuildResult>(shown.entity).filter(|_| shown.rig.joint(joint).is_none());
    let created = built.and_then(|built| Some(built.0.node(joint)?.name.to_string()));
    created.unwrap_or_else(|| shown.name(joint).into_owned())
}
