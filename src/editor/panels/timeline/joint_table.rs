//! Table of the joints of imported motion with the joints of the rig that they move, before the motion is put onto the rig.

use bevy_egui::egui::{
    Align, Button, ComboBox, Key, Layout, Popup, Rect, Ui, UiBuilder, WidgetInfo, WidgetType, pos2, vec2,
};

use super::{
    import::{MapDraft, MapRequest, target_of},
    motion_options::choices,
};
use crate::{
    editor::{
        counts::counted,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            list::{self, List},
        },
        style,
    },
    rig::{NodeKind, Uid, animation::joint_map::FoundBy},
};

/// Choice of no joint.
const NOTHING: &str = "nothing";
/// Obstacle of everything in the table while the motion is being put onto the rig.
const IS_BUSY: &str = "The motion is being put onto the rig";
/// Obstacle of what takes a pair of joints.
const NO_PAIR: &str = "No joint of the motion moves one of the rig";

/// Draws the table with its buttons. `is_busy` while the motion is being put onto the rig.
pub(super) fn show(ui: &mut Ui, draft: &MapDraft, shown: &DisplayedRig, is_busy: bool, requests: &mut Requests) {
    // An open list of joints takes Escape for itself.
    let is_escaped = ui.input(|input| input.key_pressed(Key::Escape)) && !Popup::is_any_open(ui.ctx());
    let mut is_cancelled = false;
    let (mapped, all) = (draft.mapped(), draft.targets.len());
    ui.horizontal_wrapped(|ui| {
        let can_import = mapped > 0 && !is_busy;
        let import = ui.add_enabled(can_import, Button::new("Import motion"));
        let why_not = if is_busy { IS_BUSY } else { NO_PAIR };
        if import.on_disabled_hover_text(why_not).clicked() {
            requests.send(MapRequest::Accept);
        }
        let load = ui.add_enabled(!is_busy, Button::new("Load map…"));
        let load = load.on_hover_text("Takes pairs of joints from a map file, as --map of the command does");
        if load.on_disabled_hover_text(IS_BUSY).clicked() {
            requests.send(MapRequest::AskFile);
        }
        let save = ui.add_enabled(mapped > 0 && !is_busy, Button::new("Save map…"));
        let save = save.on_hover_text("Writes the pairs of joints to a map file, as --map-out of the command does");
        if save.on_disabled_hover_text(why_not).clicked() {
            requests.send(MapRequest::AskSave);
        }
        let cancel = ui.add_enabled(!is_busy, Button::new("Cancel import"));
        is_cancelled |= cancel.on_disabled_hover_text(IS_BUSY).clicked();
        let found = match draft.found_by {
            Some(FoundBy::Names) => "guessed from names",
            Some(FoundBy::Shape) => "guessed from the shape",
            Some(FoundBy::Labels) => "guessed from equal labels",
            Some(FoundBy::Map) => "of a map",
            None => "nothing could be guessed",
        };
        let motions = match draft.motions() {
            1 => String::new(),
            count => format!("{}, ", counted(count, "motion", "motions")),
        };
        ui.weak(format!(
            "{}: {motions}{mapped} of {} move a joint of the rig ({found}).",
            draft.name,
            counted(all, "joint", "joints")
        ));
    });
    let onto = target_of(&shown.rig);
    let chosen = ui.add_enabled_ui(!is_busy, |ui| choices(ui, draft.options, onto, requests));
    chosen.response.on_disabled_hover_text(IS_BUSY);
    let (options, is_left) = chosen.inner;
    // A field that is being typed into takes Escape for itself, too.
    is_cancelled |= is_escaped && !is_left;
    if options != draft.options {
        requests.send(MapRequest::Options(options));
    }
    if is_cancelled && !is_busy {
        requests.send(MapRequest::Cancel);
    }
    let joints = shown.rig.walk().filter(|joint| joint.data.kind == NodeKind::Joint);
    let joints: Vec<(Uid, String)> =
        joints.map(|joint| (joint.data.uid, shown.name(joint.data.uid).into_owned())).collect();
    let names: Vec<&str> = draft.joints().collect();
    let height = ui.spacing().interact_size.y + 2.0;
    let list = List { id: "joints of the motion", count: names.len(), height, reveal: None, follow: false };
    list.show(ui, |ui, range, place| {
        for number in range {
            row(ui, place(number), number, names[number], draft, &joints, is_busy, requests);
        }
    });
}

fn row(
    ui: &mut Ui,
    rect: Rect,
    number: usize,
    name: &str,
    draft: &MapDraft,
    joints: &[(Uid, String)],
    is_busy: bool,
    requests: &mut Requests,
) {
    let target = draft.targets[number];
    let split = rect.left() + (rect.width() * 0.45).min(260.0);
    let head = Rect::from_min_max(rect.min, pos2(split, rect.bottom())).shrink2(vec2(4.0, 0.0));
    let color = if target.is_some() { ui.visuals().text_color() } else { style::quiet(ui.visuals()) };
    list::line(ui, head, name, color);
    let label = ui.interact(head, ui.id().with(("joint", number)), bevy_egui::egui::Sense::hover());
    label.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, name));
    let foot = Rect::from_min_max(pos2(split, rect.top()), rect.max).shrink2(vec2(2.0, 1.0));
    let builder = UiBuilder::new().id_salt(number).max_rect(foot).layout(Layout::left_to_right(Align::Center));
    ui.scope_builder(builder, |ui| {
        let text = match target {
            None => NOTHING,
            Some(target) => joints.iter().find(|(uid, _)| *uid == target).map_or("gone", |(_, name)| name.as_str()),
        };
        let mut chosen = target;
        ui.add_enabled_ui(!is_busy, |ui| {
            let combo = ComboBox::from_id_salt(("target", number)).selected_text(text).width(foot.width().min(220.0));
            let response = combo.truncate().show_ui(ui, |ui| {
                ui.selectable_value(&mut chosen, None, NOTHING);
                for (uid, name) in joints {
                    ui.selectable_value(&mut chosen, Some(*uid), name);
                }
            });
            let said = format!("Joint for {name}");
            ui.ctx().accesskit_node_builder(response.response.id, |node| node.set_label(said.as_str()));
            response.response.on_disabled_hover_text(IS_BUSY);
        });
        if chosen != target {
            requests.send(MapRequest::Set(number, chosen));
        }
    });
}
