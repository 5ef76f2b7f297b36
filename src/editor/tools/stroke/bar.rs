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
        panels::fields::{TypedText, typed_field},
        viewport_bars::STROKE_BAR,
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
        egui::Area::new(egui::Id::new(STROKE_BAR))
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
    let counted = match preview.request.choice {
        ChainChoice::Joints(count) => count,
        ChainChoice::Threshold(_) | ChainChoice::Limb(_) => chain.map_or(2, |chain| chain.joints.len()),
    };
    let (mut count, most, typed) = (counted, MOST.max(counted), TypedText::default());
    let drag = egui::DragValue::new(&mut count).range(2..=most).speed(0.05).suffix(" joints");
    let drag = drag.update_while_editing(false).custom_parser(typed.whole_reader(2.0..=most as f64, "joints"));
    let field = typed_field(ui, "Number of joints", drag).on_hover_text("Exactly so many joints (wheel)");
    typed.tell(&field, "The number of joints", requests);
    // A field changes with each letter, its number when the field is left.
    if count != counted {
        requests.send(StrokeTune::Choice(ChainChoice::Joints(count)));
    }
    ui.separator();
    let before: f32 = match preview.request.choice {
        ChainChoice::Threshold(threshold) | ChainChoice::Limb(threshold) => 100.0 * threshold / size,
        ChainChoice::Joints(_) => 2.0,
    };
    let before = before.clamp(0.2, 10.0);
    let (mut share, typed) = (before, TypedText::default());
    let slider =
        egui::Slider::new(&mut share, 0.2..=10.0).logarithmic(true).fixed_decimals(1).suffix(" %").text("threshold");
    let slider = slider.update_while_editing(false).custom_parser(typed.reader(0.2..=10.0, "%"));
    let hint = "Joints at corners of the stroke and bends of the limb that stray further than this share of the character's size from the bones";
    let field = typed_field(ui, "threshold", slider).on_hover_text(hint);
    typed.tell(&field, "The threshold", requests);
    if field.changed() && share != before {
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
