//! Sliders of expressions, each with a thumbnail.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_egui::egui::{self, CollapsingHeader, Slider, Ui, vec2};

use super::{set, thumbnail::Pictures};
use crate::{
    algo::face::expression::{Expression, MAX_STRENGTH},
    editor::{
        panel::Requests,
        panels::fields::{TypedText, typed_field},
    },
    plugins::{
        document::{Change, EditRequest},
        face::{ExpressRequest, Expressions, Face, FacePosing, FacePreparation},
        surface::RigMesh,
    },
    rig::{FaceBonePart, Rig},
};

/// Beginning of the names of visemes.
const VISEME: &str = "viseme_";
/// Side of a picture in points.
const SIDE: f32 = 56.0;

/// Strengths while a slider is dragged.
pub(super) struct HeldStrengths {
    /// Strengths at the press, to which Escape leads back.
    start: BTreeMap<String, f32>,
    /// Strengths that are previewed.
    shown: BTreeMap<String, f32>,
}

pub(super) fn show(
    ui: &mut Ui,
    world: &World,
    rig: (Entity, &Rig),
    (entity, mesh): (Entity, &RigMesh),
    (pictures, held): (&mut Pictures, &mut Option<HeldStrengths>),
    requests: &mut Requests,
) {
    let set = set(world);
    let posing = world.get::<FacePosing>(entity);
    // What was let go a moment ago may be computed yet.
    let shown = posing.and_then(FacePosing::strengths).or_else(|| Some(&world.get::<Expressions>(entity)?.0));
    let current = shown.cloned().unwrap_or_default();
    // While a slider is dragged, the last request may not be shown yet.
    let before = held.as_ref().map_or(current, |held| held.shown.clone());
    let mut next = before.clone();
    let mut dragging = false;
    let mut let_go = false;
    let face = world.get::<Face>(entity);
    pictures.renew(ui.ctx(), rig.1, mesh, face, &set.0);
    ui.horizontal(|ui| {
        ui.strong("Expressions");
        let posed = next.values().any(|strength| *strength > 0.0);
        let reset = ui.add_enabled(posed, egui::Button::new("Reset").small());
        if reset.on_disabled_hover_text("The face is at rest").clicked() {
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
                let (drag, done) = strength(ui, &expression.name, &mut next, requests);
                dragging |= drag;
                let_go |= done;
            });
        });
    }
    let mut row = |ui: &mut Ui, name: &str, words: &str, hint: String| {
        ui.label(capital(&words.replace('_', " "))).on_hover_text(hint);
        let (drag, done) = strength(ui, name, &mut next, requests);
        dragging |= drag;
        let_go |= done;
    };
    let six: Vec<&str> = set.0.six().map(|expression| expression.name.as_str()).collect();
    let is_other = |expression: &&Expression| !expression.units.is_empty() && !six.contains(&expression.name.as_str());
    let (visemes, others): (Vec<&Expression>, Vec<&Expression>) =
        set.0.expressions().iter().filter(is_other).partition(|expression| expression.name.starts_with(VISEME));
    for (title, list) in [("More expressions", others), ("Visemes", visemes)] {
        CollapsingHeader::new(title).show(ui, |ui| {
            for expression in list {
                let words = expression.name.strip_prefix(VISEME).unwrap_or(&expression.name);
                row(ui, &expression.name, words, expression.about.clone());
            }
        });
    }
    CollapsingHeader::new("Units").show(ui, |ui| {
        let is_tongue = |part: FaceBonePart| part == FaceBonePart::Tongue;
        let has_tongue = rig.1.walk().any(|joint| joint.data.face.as_ref().is_some_and(|face| is_tongue(face.part)));
        for unit in set.0.units().iter().filter(|unit| has_tongue || !unit.is_of_tongue()) {
            let facs = unit.facs.iter().map(|number| format!("AU {number}"));
            let names: Vec<String> = facs.chain(unit.arkit.iter().cloned()).collect();
            row(ui, &unit.name, &unit.name, format!("{}\n{}", unit.about, names.join(", ")));
        }
    });
    next.retain(|_, strength| *strength > 0.0);
    let dropped = held.take_if(|_| ui.input(|input| input.key_pressed(egui::Key::Escape)));
    if let Some(HeldStrengths { start, .. }) = dropped {
        requests.send(EditRequest { rig: rig.0, change: Change::CancelPreview });
        // What waits for the face to be prepared, or is being computed, would be shown yet.
        if world.get::<FacePreparation>(entity).is_some() || posing.is_some_and(FacePosing::is_running) {
            requests.send(ExpressRequest { mesh: entity, strengths: start, preview: false });
        }
    } else if next != before || let_go {
        let preview = dragging && !let_go;
        let start = held.take().map_or(before, |held| held.start);
        *held = preview.then(|| HeldStrengths { start, shown: next.clone() });
        requests.send(ExpressRequest { mesh: entity, strengths: next, preview });
    }
}

/// Draws a slider; returns whether it is dragged, and whether it was released or typed into.
fn strength(ui: &mut Ui, name: &str, strengths: &mut BTreeMap<String, f32>, requests: &mut Requests) -> (bool, bool) {
    let before = strengths.get(name).copied().unwrap_or(0.0);
    let mut value = before;
    ui.spacing_mut().slider_width = (ui.available_width() - 56.0).max(40.0);
    let typed = TypedText::default();
    let slider = Slider::new(&mut value, 0.0..=MAX_STRENGTH).max_decimals(2).update_while_editing(false);
    let slider = slider.custom_parser(typed.reader(0.0..=f64::from(MAX_STRENGTH), ""));
    let said = format!("Strength of {}", name.replace('_', " "));
    let slider = typed_field(ui, &said, slider);
    typed.tell(&slider, &said, requests);
    // The field of the number changes with each letter, its number when the field is left.
    let is_other = value != before;
    if is_other {
        strengths.insert(name.to_owned(), value);
    }
    let held = slider.dragged() || slider.is_pointer_button_down_on();
    let is_typed = is_other && !held && !slider.drag_stopped();
    (held, slider.drag_stopped() || is_typed)
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
