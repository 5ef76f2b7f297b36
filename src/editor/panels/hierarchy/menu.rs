//! Context menu of a row. It applies to all selected joints: the click that opens it selects its row.

use bevy_egui::egui::{Button, Response, Ui};

use super::{HierarchyPanel, select};
use crate::{
    editor::{
        panel::Requests,
        panels::{displayed_rig::DisplayedRig, groups},
    },
    plugins::document::EditRequest,
    rig::{Uid, operations::Operation},
};

/// Draws the menu while it is open.
pub(super) fn show(panel: &mut HierarchyPanel, response: &Response, shown: &DisplayedRig, requests: &mut Requests) {
    response.context_menu(|ui| {
        ui.set_min_width(170.0);
        let joints = shown.selection.0.clone();
        let mut ask = |operation: Operation| requests.send(EditRequest::operation(shown.entity, operation));
        let Some(active) = shown.selection.active() else { return };
        if entry(ui, "Rename", "F2") {
            panel.start_rename(active, shown);
        }
        let locked = shown.rig.joint(active).is_some_and(|joint| joint.data.locked);
        if entry(ui, if locked { "Unlock weights" } else { "Lock weights" }, "") {
            ask(Operation::Lock(joints.clone(), !locked));
        }
        if entry(ui, "Mirror", "") {
            ask(Operation::Mirror { joints: joints.clone() });
        }
        ui.menu_button("Group", |ui| {
            let current = current_group(shown, &joints);
            if let Some(name) = groups::choose(ui, &shown.rig, current, &mut panel.group) {
                ask(Operation::Group { joints: joints.clone(), name, color: None });
                ui.close();
            }
        });
        if entry(ui, "Make root", "") {
            ask(Operation::Reparent { joints: super::tops(&shown.rig, &joints), parent: None });
        }
        ui.separator();
        if entry(ui, "Delete", "") {
            ask(Operation::Delete { joints: joints.clone(), keep_children: true });
        }
        if entry(ui, "Delete hierarchy", "") {
            ask(Operation::Delete { joints: joints.clone(), keep_children: false });
        }
        ui.separator();
        if entry(ui, "Select hierarchy", "") {
            let mut all: Vec<Uid> =
                joints.iter().flat_map(|joint| shown.rig.hierarchy(*joint)).map(|joint| joint.data.uid).collect();
            let mut seen = std::collections::HashSet::new();
            all.retain(|joint| *joint != active && seen.insert(*joint));
            all.push(active);
            select(all, shown, requests);
        }
        if panel.top != Some(active) && entry(ui, "List this hierarchy only", "") {
            panel.list_below(Some(active));
        }
        if panel.top.is_some() && entry(ui, "List everything", "") {
            panel.list_below(None);
        }
        if entry(ui, "Show all built nodes", "") {
            panel.shows_built = true;
        }
    });
}

fn entry(ui: &mut Ui, text: &str, key: &str) -> bool {
    let button = Button::new(text);
    let button = if key.is_empty() { button } else { button.shortcut_text(key) };
    let clicked = ui.add(button).clicked();
    if clicked {
        ui.close();
    }
    clicked
}

/// Name of the group that all of `joints` are in, or an empty text if none has a group.
fn current_group<'a>(shown: &'a DisplayedRig, joints: &[Uid]) -> Option<&'a str> {
    let group = |joint: &Uid| shown.rig.joint(*joint).and_then(|joint| joint.data.group);
    let first = group(joints.first()?);
    if joints.iter().any(|joint| group(joint) != first) {
        return None;
    }
    Some(first.and_then(|group| shown.rig.group(group)).map_or("", |group| group.name.as_str()))
}
