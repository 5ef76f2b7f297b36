//! Fields of the brush.

use bevy::prelude::*;
use bevy_egui::egui::{Checkbox, ComboBox, Ui};

use crate::{
    algo::paint::{BrushError, BrushMode, BrushReach, FalloffCurve},
    editor::{
        actions::{Action, ActionRequest},
        help::describe,
        keys::KeyBindings,
        notice::Notice,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{Look, NumberEdit, Numbers, labelled, named},
        },
        tools::paint::brush::{BrushAction, PaintBrush, rig_size},
    },
    plugins::{document::Symmetry, surface::RigSurface},
    rig::proportion::Quantity,
};

/// Fields of the brush; the brush is a setting of the window, not of the document.
#[derive(Default)]
pub(super) struct BrushForm {
    numbers: Numbers,
    /// The brush before a number was dragged.
    before: Option<PaintBrush>,
}

/// Largest number of influences that a brush may leave.
const MOST: f32 = 16.0;

const SHARE: Look = Look { speed: 0.005, decimals: 3, suffix: "", quantity: Quantity::Plain };
const COUNT: Look = Look { speed: 0.05, decimals: 0, suffix: "", quantity: Quantity::Plain };

impl BrushForm {
    pub fn show(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        let brush = world.get_resource::<PaintBrush>().copied().unwrap_or_default();
        let size = rig_size(&shown.rig, world.get::<RigSurface>(shown.entity));
        modes(ui, world, &brush, requests);
        let sized = brush.of_size(size);
        let length = Look { speed: f64::from(size) / 2000.0, decimals: 4, ..SHARE };
        let numbers = [
            ("Strength", sized.strength, SHARE),
            ("Radius", sized.radius, length),
            ("Falloff", sized.falloff, length),
            ("Influences", brush.most as f32, COUNT),
        ];
        for (name, value, look) in numbers {
            let Some(edit) = self.numbers.number(ui, name, value, look) else { continue };
            match edit {
                NumberEdit::Set(value) => match with(brush, size, name, value) {
                    Ok(next) => requests.set(next),
                    Err(error) => requests.send(Notice::warning(format!("{name} stays as it was: {error}."))),
                },
                NumberEdit::Preview(value) => {
                    let before = *self.before.get_or_insert(brush);
                    // A drag passes over numbers that make no sense.
                    if let Ok(next) = with(before, size, name, value) {
                        requests.set(next);
                    }
                }
                NumberEdit::Commit => self.before = None,
                NumberEdit::Cancel => self.before.take().into_iter().for_each(|before| requests.set(before)),
            }
        }
        self.numbers.tell(requests);
        let mut next = brush;
        labelled(ui, "Curve", |ui| {
            let combo = ComboBox::from_id_salt("curve").selected_text(brush.curve.name()).width(ui.available_width());
            let combo = combo.show_ui(ui, |ui| {
                for curve in FalloffCurve::ALL {
                    ui.selectable_value(&mut next.curve, curve, curve.name());
                }
            });
            named(ui, combo.response.id, "Falloff curve");
        });
        labelled(ui, "Distances", |ui| {
            // Both buttons stand beside each other in the narrowest panel, too.
            if ui.available_width() < 130.0 {
                ui.spacing_mut().item_spacing.x = 3.0;
                ui.spacing_mut().button_padding.x = 4.0;
            }
            for (reach, name, tip) in [
                (BrushReach::Surface, "Surface", "Along the edges of the mesh: other fingers are far away"),
                (BrushReach::Volume, "Volume", "Straight through: everything in a ball"),
            ] {
                let chosen = ui.selectable_label(brush.reach == reach, name).on_hover_text(tip).clicked();
                if chosen && brush.reach != reach {
                    requests.send(ActionRequest(Action::Brush(BrushAction::Reach)));
                }
            }
        });
        if next != brush {
            requests.set(next);
        }
        switches(ui, world, shown, &brush, requests);
    }
}

/// Draws the modes, one of which is chosen.
fn modes(ui: &mut Ui, world: &World, brush: &PaintBrush, requests: &mut Requests) {
    let keys = world.get_resource::<KeyBindings>();
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for mode in BrushMode::ALL {
            let action = Action::Brush(BrushAction::of_mode(mode));
            let label = ui.selectable_label(brush.mode == mode, mode.name());
            let key = keys.and_then(|keys| keys.key(action));
            let tip = key.map_or_else(|| describe(action), |key| format!("{} ({key})", describe(action)));
            if label.on_hover_text(tip).clicked() {
                requests.send(ActionRequest(action));
            }
        }
    });
}

/// The brush with another number.
fn with(brush: PaintBrush, size: f32, name: &str, value: f32) -> Result<PaintBrush, BrushError> {
    let mut next = brush;
    let sized = brush.of_size(size);
    match name {
        "Strength" => next.strength = value,
        "Radius" => next.radius = Some(value),
        "Falloff" if !(0.0..=sized.radius).contains(&value) => {
            return Err(BrushError::Falloff { falloff: value, radius: sized.radius });
        }
        "Falloff" => next.softness = (value / sized.radius).clamp(0.0, 1.0),
        _ if !(0.5..MOST + 0.5).contains(&value) => return Err(BrushError::Influences),
        _ => next.most = value.round() as usize,
    }
    next.of_size(size).check().map(|()| next)
}

/// Draws the switches: both sides, all joints, all colours.
fn switches(ui: &mut Ui, world: &World, shown: &DisplayedRig, brush: &PaintBrush, requests: &mut Requests) {
    let is_mirrored = world.get::<Symmetry>(shown.entity).is_some_and(|symmetry| symmetry.0.is_some());
    let all = BrushAction::AllJoints;
    let list = [
        (Action::Symmetry, "Mirror", is_mirrored, true, "What is painted on one side is painted on the other, too"),
        (
            Action::Brush(all),
            "All joints",
            brush.all_joints,
            brush.mode.is_relative(),
            "Smooth and Sharpen work on all joints together, not on the selected one alone",
        ),
        (
            Action::Brush(BrushAction::Colors),
            "All colours",
            brush.all_colors,
            true,
            "Every joint in its own colour, not the weights of the selected one",
        ),
    ];
    ui.horizontal_wrapped(|ui| {
        for (action, name, is_on, is_free, tip) in list {
            let mut on = is_on;
            let field = ui.add_enabled(is_free, Checkbox::new(&mut on, name));
            let tip = match world.get_resource::<KeyBindings>().and_then(|keys| keys.key(action)) {
                Some(key) => format!("{tip} ({key})"),
                None => tip.to_owned(),
            };
            if field.on_hover_text(&tip).on_disabled_hover_text(tip).clicked() {
                requests.send(ActionRequest(action));
            }
        }
    });
}
