//! A row of the tree.

use bevy_egui::egui::{
    Align2, CursorIcon, DragAndDrop, FontId, Id, LayerId, Order, PointerButton, Rect, Response, Sense, Stroke,
    StrokeKind, Ui, UiBuilder, WidgetInfo, WidgetType, containers::collapsing_header::paint_default_icon, pos2, vec2,
};

use super::{DraggedJoints, HierarchyPanel, Tree, menu, obstacle, reparent, row_tags, rows::Row, select, tops};
use crate::{
    editor::{
        counts::counted,
        library::{DraggedModule, DraggedTemplate, LibraryAct, LibraryRequest, attach, dropping},
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{self, Renaming},
            groups, list,
        },
    },
    rig::{NodeKind, Uid},
};

/// Draws a row and handles its input.
pub(super) fn show(
    panel: &mut HierarchyPanel,
    ui: &mut Ui,
    rect: Rect,
    tree: &Tree,
    number: usize,
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    let row = tree.rows[number];
    let id = ui.id().with(row.joint);
    if panel.rename.as_ref().is_some_and(|rename| rename.joint == row.joint) {
        rename(panel, ui, text_rect(ui, rect, tree, row), id, shown, requests);
        return;
    }
    let selected = panel.selected.1.contains(&row.joint);
    let name = shown.name(row.joint);
    let response = ui.interact(rect, id, Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, selected, &name));
    if response.hovered() {
        panel.under = Some(row.joint);
    }
    let fold = row.parent.then(|| fold_rect(ui, rect, tree, row));
    let fold = fold.map(|fold| ui.interact(fold, id.with("fold"), Sense::click()));
    if let Some(fold) = &fold {
        let said = format!("{} {name}", if row.open { "Fold" } else { "Unfold" });
        fold.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
    }
    let cut = paint(ui, rect, tree, row, selected, shown, &response, fold.as_ref());
    if fold.is_some_and(|fold| fold.clicked()) && panel.filter.trim().is_empty() {
        let deep = ui.input(|input| input.modifiers.shift || input.modifiers.command);
        panel.fold(row.joint, row.open, deep, shown);
        return;
    }
    let response = if cut { response.on_hover_text(name.as_ref()) } else { response };
    click(panel, ui, &response, tree, number, shown, requests);
    drag(panel, ui, &response, rect, row.joint, shown, requests);
    menu::show(panel, &response, shown, requests);
}

/// Indentation of a level: less in a narrow panel, so that names stay readable.
fn indent(ui: &Ui, rect: Rect, tree: &Tree) -> f32 {
    let room = rect.width() - 110.0;
    (room / tree.deepest.max(1) as f32).clamp(3.0, 14.0).min(ui.spacing().indent)
}

fn fold_rect(ui: &Ui, rect: Rect, tree: &Tree, row: Row) -> Rect {
    let left = rect.left() + indent(ui, rect, tree) * row.depth as f32;
    Rect::from_min_size(pos2(left, rect.top()), vec2(16.0, rect.height()))
}

fn dot_rect(ui: &Ui, rect: Rect, tree: &Tree, row: Row) -> Rect {
    fold_rect(ui, rect, tree, row).translate(vec2(15.0, 0.0))
}

fn text_rect(ui: &Ui, rect: Rect, tree: &Tree, row: Row) -> Rect {
    let left = dot_rect(ui, rect, tree, row).right() + 1.0;
    rect.with_min_x(left.min(rect.right() - 24.0))
}

/// Paints the row; returns `true` if the name did not fit.
fn paint(
    ui: &mut Ui,
    rect: Rect,
    tree: &Tree,
    row: Row,
    selected: bool,
    shown: &DisplayedRig,
    response: &Response,
    fold: Option<&Response>,
) -> bool {
    let visuals = ui.visuals().clone();
    let hovered = response.hovered() || shown.hovered == Some(row.joint);
    if selected {
        let active = shown.selection.active() == Some(row.joint);
        let fill = visuals.selection.bg_fill.gamma_multiply(if active { 1.0 } else { 0.55 });
        ui.painter().rect_filled(rect, 3.0, fill);
    }
    if hovered {
        ui.painter().rect_filled(rect, 3.0, visuals.widgets.hovered.bg_fill.gamma_multiply(0.35));
    }
    if let Some(fold) = fold {
        let small = fold.clone().with_new_rect(Rect::from_center_size(fold.rect.center(), vec2(11.0, 11.0)));
        let mut painter = ui.new_child(UiBuilder::new().max_rect(fold.rect));
        paint_default_icon(&mut painter, if row.open { 1.0 } else { 0.0 }, &small);
    }
    groups::dot(ui, dot_rect(ui, rect, tree, row), shown.color(row.joint));
    let data = shown.rig.joint(row.joint).map(|joint| &joint.data);
    let mut text = text_rect(ui, rect, tree, row);
    if data.is_some_and(|data| data.locked) {
        let lock = text.with_min_x(text.right() - 16.0);
        list::symbol(ui, lock, "🔒", visuals.weak_text_color());
        text.set_right(lock.left());
    }
    let labelled = data.is_some_and(|data| data.label.is_some() && data.kind == NodeKind::Joint);
    let color = match (selected, labelled && row.matches) {
        (true, _) => visuals.strong_text_color(),
        (false, true) => visuals.text_color(),
        (false, false) => visuals.weak_text_color(),
    };
    let name = shown.name(row.joint);
    let text = row_tags::show(ui, text, (row.joint, &*name), data.map_or(&[][..], |data| data.tags.as_slice()));
    list::line(ui, text, &name, color)
}

/// Handles clicks: a plain click selects the joint alone, Control adds or removes it, Shift selects the range from the
/// last one.
fn click(
    panel: &mut HierarchyPanel,
    ui: &Ui,
    response: &Response,
    tree: &Tree,
    number: usize,
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    let joint = tree.rows[number].joint;
    if response.double_clicked() {
        panel.start_rename(joint, shown);
        return;
    }
    if response.secondary_clicked() && !panel.selected.1.contains(&joint) {
        select(vec![joint], shown, requests);
    }
    if !response.clicked() {
        return;
    }
    let held = ui.input(|input| input.modifiers);
    let anchor = panel.anchor.and_then(|anchor| tree.rows.iter().position(|row| row.joint == anchor));
    match (held.shift, held.command) {
        (true, add) => {
            let from = anchor.unwrap_or(number);
            let range = tree.rows[from.min(number)..=from.max(number)].iter().map(|row| row.joint);
            let mut joints = if add { shown.selection.0.clone() } else { Vec::new() };
            let range: Vec<Uid> = range.filter(|other| *other != joint).collect();
            joints.retain(|other| *other != joint && !range.contains(other));
            joints.extend(range);
            joints.push(joint);
            select(joints, shown, requests);
        }
        (false, true) => {
            let mut joints = shown.selection.0.clone();
            joints.retain(|other| *other != joint);
            if !panel.selected.1.contains(&joint) {
                joints.push(joint);
            }
            panel.anchor = Some(joint);
            select(joints, shown, requests);
        }
        (false, false) => {
            panel.anchor = Some(joint);
            select(vec![joint], shown, requests);
        }
    }
}

/// Handles drags, which move joints below another.
fn drag(
    panel: &HierarchyPanel,
    ui: &Ui,
    response: &Response,
    rect: Rect,
    joint: Uid,
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    if DragAndDrop::has_payload_of_type::<DraggedModule>(ui.ctx()) {
        drop_module(ui, response, rect, joint, shown, requests);
        return;
    }
    if DragAndDrop::has_payload_of_type::<DraggedTemplate>(ui.ctx()) {
        drop_template(ui, response, rect, (joint, panel.is_for_both), shown, requests);
        return;
    }
    if response.drag_started_by(PointerButton::Primary) {
        let joints = match panel.selected.1.contains(&joint) {
            true => tops(&shown.rig, &shown.selection.0),
            false => vec![joint],
        };
        response.dnd_set_drag_payload(DraggedJoints(joints));
    }
    if let Some(dragged) = response.dnd_hover_payload::<DraggedJoints>() {
        let over_itself = dragged.0.contains(&joint);
        let refused = obstacle(&dragged.0, Some(joint), shown).filter(|_| !over_itself);
        let color = if refused.is_some() { ui.visuals().error_fg_color } else { ui.visuals().selection.stroke.color };
        if !over_itself {
            ui.painter().rect_stroke(rect.shrink(0.5), 3.0, Stroke::new(1.5, color), StrokeKind::Inside);
        }
        ui.ctx().set_cursor_icon(if refused.is_some() { CursorIcon::NotAllowed } else { CursorIcon::Grabbing });
        carried(ui, &dragged.0, shown, refused.as_deref());
    }
    if let Some(dragged) = response.dnd_release_payload::<DraggedJoints>() {
        reparent(&dragged.0, Some(joint), shown, requests);
    }
}

/// Marks the row under a template of the library, and uses the template there when it is let go.
fn drop_template(
    ui: &Ui,
    response: &Response,
    rect: Rect,
    (joint, both): (Uid, bool),
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    if let Some(dragged) = response.dnd_hover_payload::<DraggedTemplate>() {
        let color = ui.visuals().selection.stroke.color;
        ui.painter().rect_stroke(rect.shrink(0.5), 3.0, Stroke::new(1.5, color), StrokeKind::Inside);
        beside_pointer(ui, dropping(&shown.rig, &dragged, joint, both));
    }
    if let Some(dragged) = response.dnd_release_payload::<DraggedTemplate>() {
        requests.send(LibraryRequest { place: dragged.place.clone(), act: LibraryAct::Drop { joint } });
    }
}

/// Marks the row under a module of the library, and attaches a command to the joint when it is let go.
fn drop_module(ui: &Ui, response: &Response, rect: Rect, joint: Uid, shown: &DisplayedRig, requests: &mut Requests) {
    if let Some(dragged) = response.dnd_hover_payload::<DraggedModule>() {
        let color = ui.visuals().selection.stroke.color;
        ui.painter().rect_stroke(rect.shrink(0.5), 3.0, Stroke::new(1.5, color), StrokeKind::Inside);
        beside_pointer(ui, format!("{} on {}", dragged.0, shown.name(joint)));
    }
    if let Some(dragged) = response.dnd_release_payload::<DraggedModule>() {
        requests.send(attach(shown.entity, joint, dragged.0));
    }
}

/// Paints the dragged joints, or the reason why they cannot be dropped here, beside the pointer.
fn carried(ui: &Ui, joints: &[Uid], shown: &DisplayedRig, refused: Option<&str>) {
    let text = match (refused, joints) {
        (Some(refused), _) => refused.to_owned(),
        (None, [one]) => shown.name(*one).into_owned(),
        (None, more) => counted(more.len(), "joint", "joints"),
    };
    beside_pointer(ui, text);
}

fn beside_pointer(ui: &Ui, text: String) {
    let Some(pointer) = ui.input(|input| input.pointer.latest_pos()) else { return };
    let painter = ui.ctx().layer_painter(LayerId::new(Order::Tooltip, Id::new("dragged joints")));
    let visuals = ui.visuals();
    let font = FontId::proportional(12.0);
    let galley = painter.layout(text, font, visuals.strong_text_color(), 260.0);
    let window = ui.ctx().content_rect();
    let mut back = Rect::from_min_size(pointer + vec2(14.0, 10.0), galley.size() + vec2(10.0, 6.0));
    back = back.translate(vec2((window.right() - back.right()).min(0.0), (window.bottom() - back.bottom()).min(0.0)));
    painter.rect_filled(back, 3.0, visuals.window_fill);
    painter.rect_stroke(back, 3.0, visuals.window_stroke, StrokeKind::Inside);
    let at = Align2::LEFT_TOP.anchor_rect(Rect::from_min_size(back.min + vec2(5.0, 3.0), galley.size())).min;
    painter.galley(at, galley, visuals.strong_text_color());
}

/// Draws the text field in place of a name.
fn rename(panel: &mut HierarchyPanel, ui: &mut Ui, rect: Rect, id: Id, shown: &DisplayedRig, requests: &mut Requests) {
    let Some(rename) = panel.rename.as_mut() else { return };
    match fields::rename(ui, rect, id.with("rename"), "Rename", &mut rename.text, &mut rename.focused) {
        Renaming::Typing => {}
        Renaming::Dropped => panel.rename = None,
        Renaming::Accepted => panel.accept_rename(shown, requests),
    }
}
