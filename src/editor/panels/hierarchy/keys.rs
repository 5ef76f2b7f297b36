//! Keys in the tree: arrows while the pointer is over it, F2 at any time.

use bevy_egui::egui::{Key, Modifiers, Ui};

use super::{HierarchyPanel, select};
use crate::editor::{panel::Requests, panels::displayed_rig::DisplayedRig};

/// Handles the tree's keys, unless a text field has the focus.
pub(super) fn press(panel: &mut HierarchyPanel, ui: &Ui, shown: &DisplayedRig, requests: &mut Requests) {
    if ui.ctx().egui_wants_keyboard_input() {
        return;
    }
    let key = |key: Key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    let active = shown.selection.active();
    if let Some(active) = active
        && key(Key::F2)
    {
        panel.start_rename(active, shown);
    }
    if !ui.rect_contains_pointer(ui.max_rect()) {
        return;
    }
    let row = active.and_then(|active| panel.row_of(active));
    let last = panel.tree.rows.len().saturating_sub(1);
    let step = if key(Key::ArrowDown) {
        Some(row.map_or(0, |row| (row + 1).min(last)))
    } else if key(Key::ArrowUp) {
        Some(row.map_or(last, |row| row.saturating_sub(1)))
    } else {
        None
    };
    if let Some(next) = step.and_then(|step| panel.tree.rows.get(step)) {
        panel.anchor = Some(next.joint);
        select(vec![next.joint], shown, requests);
        return;
    }
    let Some(row) = row.and_then(|row| panel.tree.rows.get(row)).copied() else { return };
    if key(Key::ArrowLeft) {
        let parent = shown.rig.joint(row.joint).and_then(|joint| joint.parent);
        match parent {
            _ if row.parent && row.open => panel.fold(row.joint, true, false, shown),
            Some(parent) => select(vec![parent], shown, requests),
            None => {}
        }
    }
    if key(Key::ArrowRight) {
        match shown.rig.children(Some(row.joint)) {
            [_, ..] if !row.open => panel.fold(row.joint, false, false, shown),
            [first, ..] => select(vec![*first], shown, requests),
            [] => {}
        }
    }
}
