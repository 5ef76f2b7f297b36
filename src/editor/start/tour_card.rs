//! Card of the tour, in the viewport's upper left corner: the present step, and ways past it and out.

use bevy::prelude::*;
use bevy_egui::egui::{self, RichText};

use super::{Tour, TourStep};
use crate::editor::{
    actions::{Action, ActionRequest},
    help::describe,
    keys::KeyBindings,
    palette::obstacle,
    panel::{Requests, ViewportPainter},
    style,
};

pub(super) struct TourCard;

impl ViewportPainter for TourCard {
    fn paint(&mut self, _: &egui::Painter, _: egui::Rect, _: &World) {}

    fn widgets(&mut self, ui: &mut egui::Ui, area: egui::Rect, world: &World, requests: &mut Requests) {
        let Some(tour) = world.get_resource::<Tour>().filter(|tour| tour.is_on()) else { return };
        egui::Area::new(egui::Id::new("tour card"))
            .order(egui::Order::Middle)
            .fixed_pos(area.left_top() + egui::vec2(12.0, 12.0))
            .constrain_to(area)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.set_width((area.width() - 48.0).clamp(160.0, 290.0));
                    match tour.present() {
                        Some(step) => present(ui, world, tour, step, requests),
                        None => end(ui, world, requests),
                    }
                });
            });
    }
}

fn key_of(world: &World, action: Action) -> String {
    let key = world.get_resource::<KeyBindings>().and_then(|keys| keys.key(action));
    key.map_or_else(|| describe(action), ToString::to_string)
}

fn present(ui: &mut egui::Ui, world: &World, tour: &Tour, step: TourStep, requests: &mut Requests) {
    let number = TourStep::ALL.iter().position(|known| *known == step).unwrap_or_default() + 1;
    let title = format!("{number} of {}: {}", TourStep::ALL.len(), step.title());
    ui.label(RichText::new(title).strong().color(style::accent(ui.visuals())));
    let action = step.action();
    ui.label(format!("{} {}", key_of(world, action), step.about()));
    let why_not = obstacle(world, action);
    if let Some(why_not) = why_not {
        ui.weak(format!("Not yet: {why_not}."));
    }
    ui.horizontal_wrapped(|ui| {
        if ui.add_enabled(why_not.is_none(), egui::Button::new(describe(action))).clicked() {
            requests.send(ActionRequest(action));
        }
        if ui.button("Skip").clicked() {
            requests.set(tour.skip());
        }
        if ui.button("End the tour").clicked() {
            requests.set(Tour::default());
        }
    });
}

fn end(ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
    ui.label(RichText::new("From a mesh to a pose").strong().color(style::accent(ui.visuals())));
    let [save, export, all] = [Action::Save, Action::Export, Action::Palette].map(|action| key_of(world, action));
    ui.label(format!("{save} saves the project, {export} exports the character, {all} lists all actions."));
    if ui.button("End the tour").clicked() {
        requests.set(Tour::default());
    }
}
