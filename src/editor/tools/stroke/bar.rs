//! The bar under a previewed stroke: number of joints, threshold, accept or cancel.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{StrokePreview, StrokeState, StrokeTool, StrokeTune, volumes};
use crate::{
    algo::stroke::ChainChoice,
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        panel::{Requests, ViewportPainter},
    },
    plugins::surface::RigSurface,
};

/// Shows the bar while there is a preview.
pub(super) struct StrokeBar;

/// Largest number of joints on the bar; the wheel goes further.
const MOST: usize = 60;

impl ViewportPainter for StrokeBar {
    fn paint(&mut self, _: &egui::Painter, _: egui::Rect, _: &World) {}

    fn widgets(&mut self, ui: &mut egui::Ui, area: egui::Rect, world: &World, requests: &mut Requests) {
        let Some(tool) = world.get_resource::<StrokeTool>() else { return };
        let StrokeState::Preview(preview) = &tool.state else { return };
        let active = world.get_resource::<ActiveRig>();
        let surface = active.and_then(|rig| world.get::<RigSurface>(rig.0));
        let size = surface.map_or(1.0, |surface| {
            let [low, high] = surface.bounds();
            (high - low).max_element()
        });
        egui::Area::new(egui::Id::new("stroke bar"))
            .order(egui::Order::Middle)
            // The bar is in a corner, where it hides no limb.
            .pivot(egui::Align2::LEFT_BOTTOM)
            .fixed_pos(area.left_bottom() + egui::vec2(12.0, -12.0))
            .constrain_to(area)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.horizontal(|ui| contents(ui, preview, size, requests));
                });
            });
    }
}

fn contents(ui: &mut egui::Ui, preview: &StrokePreview, size: f32, requests: &mut Requests) {
    let chain = preview.chain();
    let mut count = match preview.request.choice {
        ChainChoice::Joints(count) => count,
        ChainChoice::Threshold(_) | ChainChoice::Limb(_) => chain.map_or(2, |chain| chain.joints.len()),
    };
    let most = MOST.max(count);
    let drag = egui::DragValue::new(&mut count).range(2..=most).speed(0.05).suffix(" joints");
    let field = ui.add(drag).on_hover_text("Exactly so many joints (wheel)");
    ui.ctx().accesskit_node_builder(field.id, |node| node.set_label("Number of joints"));
    if field.changed() {
        requests.send(StrokeTune::Choice(ChainChoice::Joints(count)));
    }
    ui.separator();
    let mut share = match preview.request.choice {
        ChainChoice::Threshold(threshold) | ChainChoice::Limb(threshold) => 100.0 * threshold / size,
        ChainChoice::Joints(_) => 2.0,
    };
    let slider =
        egui::Slider::new(&mut share, 0.2..=10.0).logarithmic(true).fixed_decimals(1).suffix(" %").text("threshold");
    let hint = "Joints at corners of the stroke and bends of the limb that stray further than this share of the character's size from the bones";
    if ui.add(slider).on_hover_text(hint).changed() {
        requests.send(StrokeTune::Choice(ChainChoice::Limb(share * 0.01 * size)));
    }
    if let Some((volume, of)) = chain.and_then(volumes) {
        ui.separator();
        let text = format!("volume {volume} of {of}");
        if ui.button(text).on_hover_text("The stroke runs through several volumes here: take the next (Tab)").clicked()
        {
            requests.send(ActionRequest(Action::NextVolume));
        }
    }
    ui.separator();
    if ui.button("Accept").on_hover_text("Enter").clicked() {
        requests.send(ActionRequest(Action::Accept));
    }
    if ui.button("Cancel").on_hover_text("Esc").clicked() {
        requests.send(ActionRequest(Action::Cancel));
    }
}
