//! Sliders of expressions, each with a thumbnail.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_egui::egui::{self, CollapsingHeader, Slider, Ui, vec2};

use super::{set, thumbnail::Pictures};
use crate::{
    editor::panel::Requests,
    plugins::{
        face::{ExpressRequest, Expressions, Face},
        surface::RigMesh,
    },
    rig::Rig,
};

/// Side of a picture in points.
const SIDE: f32 = 56.0;

pub(super) fn show(
    ui: &mut Ui,
    world: &World,
    rig: (Entity, &Rig),
    (entity, mesh): (Entity, &RigMesh),
    (pictures, held): (&mut Pictures, &mut Option<BTreeMap<String, f32>>),
    requests: &mut Requests,
) {
    let set = set(world);
    let current = world.get::<Expressions>(entity).map(|shown| shown.0.clone()).unwrap_or_default();
    // While a slider is dragged, the last request may not be shown yet.
    let before = held.clone().unwrap_or(current);
    let mut next = before.clone();
    let mut dragging = false;
    let mut let_go = false;
    let face = world.get::<Face>(entity);
    pictures.renew(ui.ctx(), rig.1, mesh, face, &set.0);
    ui.horizontal(|ui| {
        ui.strong("Expressions");
        let posed = next.values().any(|strength| *strength > 0.0);
        if ui.add_enabled(posed, egui::Button::new("Reset").small()).clicked() {
            next.clear();
            let_go = true;
        }
    });
    for expression in set.0.six() {
        ui.horizontal(|ui| {
            match pictures.of(&expression.name) {
                Some(texture) => {
                    ui.add(egui::Image::new(texture).fit_to_exact_size(vec2(SIDE, SIDE)));
                }
                None => {
                    let (rect, _) = ui.allocate_exact_size(vec2(SIDE, SIDE), egui::Sense::hover());
                    ui.painter().rect_filled(rect, 4.0, ui.visuals().faint_bg_color);
                }
            }
            ui.vertical(|ui| {
                ui.add_space(6.0);
                ui.label(capital(&expression.name));
                let (drag, done) = strength(ui, &expression.name, &mut next);
                dragging |= drag;
                let_go |= done;
            });
        });
    }
    CollapsingHeader::new("Units").show(ui, |ui| {
        for name in set.0.units().iter().map(|unit| unit.name.as_str()) {
            ui.label(capital(&name.replace('_', " ")));
            let (drag, done) = strength(ui, name, &mut next);
            dragging |= drag;
            let_go |= done;
        }
    });
    next.retain(|_, strength| *strength > 0.0);
    if next != before || let_go {
        let preview = dragging && !let_go;
        *held = preview.then(|| next.clone());
        requests.send(ExpressRequest { mesh: entity, strengths: next, preview });
    }
}

/// Draws a slider; returns whether it is dragged, and whether it was released or typed into.
fn strength(ui: &mut Ui, name: &str, strengths: &mut BTreeMap<String, f32>) -> (bool, bool) {
    let mut value = strengths.get(name).copied().unwrap_or(0.0);
    ui.spacing_mut().slider_width = (ui.available_width() - 56.0).max(40.0);
    let slider = ui.push_id(name, |ui| ui.add(Slider::new(&mut value, 0.0..=1.0).max_decimals(2))).inner;
    if slider.changed() {
        strengths.insert(name.to_owned(), value);
    }
    let held = slider.dragged() || slider.is_pointer_button_down_on();
    let typed = slider.changed() && !held && !slider.drag_stopped();
    (held, slider.drag_stopped() || typed)
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
