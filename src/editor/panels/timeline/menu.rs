//! Context menu of the keys.

use bevy::prelude::*;
use bevy_egui::egui::{Popup, PopupCloseBehavior, Response, Ui};

use super::{action::TimelineAction, bar::entry, state::Timeline, tolerance};
use crate::editor::panel::Requests;

/// Entries of the menu, group by group.
const GROUPS: [&[TimelineAction]; 6] = [
    &[TimelineAction::Stepped, TimelineAction::Linear, TimelineAction::Cubic],
    &[TimelineAction::Copy, TimelineAction::Paste, TimelineAction::Mirror, TimelineAction::Delete],
    &[TimelineAction::Slower, TimelineAction::Faster, TimelineAction::Reverse, TimelineAction::Snap],
    &[TimelineAction::Bake, TimelineAction::Reduce, TimelineAction::SwitchKinematics, TimelineAction::SwitchSpace],
    &[TimelineAction::Key, TimelineAction::KeyAll, TimelineAction::Marker],
    &[TimelineAction::SelectAll, TimelineAction::SelectNone, TimelineAction::Fit],
];

/// Draws the menu while it is open.
pub(in crate::editor::panels) fn show(response: &Response, world: &World, requests: &mut Requests) {
    // Fields are clicked without the menu being closed; entries close it.
    let menu = Popup::context_menu(response).close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    menu.show(|ui| entries(ui, world, requests));
}

fn entries(ui: &mut Ui, world: &World, requests: &mut Requests) {
    ui.set_min_width(190.0);
    for (number, group) in GROUPS.into_iter().enumerate() {
        if number > 0 {
            ui.separator();
        }
        for action in group {
            entry(ui, world, *action, requests);
            if *action == TimelineAction::Reduce
                && let Some(timeline) = world.get_resource::<Timeline>()
            {
                tolerance::fields(ui, timeline, requests);
            }
        }
    }
}
