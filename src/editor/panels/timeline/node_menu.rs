//! Menu of a node's row: its switches, for the pose and over the range of the selected keys, and what else concerns its keys.

use bevy_egui::egui::{Button, Response, Ui};

use super::{action::TimelineAction, bar::entry, row::RowContext};
use crate::{
    editor::{panel::Requests, panels::node_menu::switches},
    plugins::{commands::BuildResult, runtime::RigRuntime},
    rig::Uid,
};

/// Draws the menu of a node while it is open. `select_keys` asks for the selection of the node's keys.
pub(super) fn show(
    response: &Response,
    (node, name): (Uid, &str),
    context: &RowContext,
    requests: &mut Requests,
    select_keys: impl FnOnce(&mut Requests),
) {
    response.context_menu(|ui| {
        ui.set_min_width(190.0);
        ui.strong(name);
        if thrown(ui, node, context, requests) {
            ui.close();
        }
        ui.separator();
        if ui.add(Button::new("Select its keys")).clicked() {
            select_keys(requests);
            ui.close();
        }
        entry(ui, context.world, TimelineAction::Key, requests);
    });
}

/// Draws the switches that concern a node; true if one was thrown.
fn thrown(ui: &mut Ui, node: Uid, context: &RowContext, requests: &mut Requests) -> bool {
    let (world, rig) = (context.world, context.open.entity);
    match (world.get::<BuildResult>(rig), world.get::<RigRuntime>(rig)) {
        (Some(built), Some(runtime)) => switches(ui, world, &built.0, runtime.state(), (rig, node), requests),
        _ => false,
    }
}
