//! Choice of what a reduction of keys may change.

use bevy_egui::egui::{DragValue, Ui};

use super::state::{Timeline, TimelineRequest};
use crate::{
    editor::{
        panel::Requests,
        panels::fields::{TypedText, typed_field},
    },
    rig::{Rig, operations::KeyTolerance},
};

/// Millimetres of the usual tolerance, those of an export.
const USUAL: f32 = 0.05;

/// Largest differences that a reduction of keys may leave, on a figure of human size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReductionTolerance {
    /// Distance of translations in millimetres; scale factors and attributes go with it.
    pub millimetres: f32,
    /// Angle of rotations in degrees.
    pub degrees: f32,
}

impl Default for ReductionTolerance {
    fn default() -> Self {
        Self { millimetres: USUAL, degrees: KeyTolerance::default().angle }
    }
}

impl ReductionTolerance {
    /// Tolerance for the keys of a rig of any size and units. Numbers below zero, and such as are none, count as zero.
    pub fn of_keys(self, rig: &Rig) -> KeyTolerance {
        // A number that is none is no maximum either.
        let [millimetres, degrees] = [self.millimetres, self.degrees].map(|number| number.max(0.0));
        KeyTolerance { angle: degrees, ..KeyTolerance::default().scaled(millimetres / USUAL) }.for_rig(rig)
    }
}

/// Draws the choice.
pub(super) fn fields(ui: &mut Ui, timeline: &Timeline, requests: &mut Requests) {
    let mut now = timeline.tolerance;
    ui.horizontal(|ui| {
        ui.weak("Reduce within");
        let typed = [TypedText::default(), TypedText::default()];
        let distance = DragValue::new(&mut now.millimetres).range(0.0..=1000.0).speed(0.005).suffix(" mm");
        let distance = distance.custom_parser(typed[0].reader(0.0..=1000.0, "mm"));
        let angle = DragValue::new(&mut now.degrees).range(0.0..=180.0).speed(0.005).suffix("°");
        let angle = angle.custom_parser(typed[1].reader(0.0..=180.0, "°"));
        let by_distance = "Largest distance that a reduction may leave, in millimetres on a figure of human size; larger \
                           and smaller rigs in proportion, scales and attributes with it";
        let by_angle = "Largest angle that a reduction may leave, in degrees";
        let fields = [(distance, "Tolerance in millimetres", by_distance), (angle, "Tolerance in degrees", by_angle)];
        let drawn = fields.map(|(field, said, tip)| {
            let field = field.max_decimals(4).update_while_editing(false);
            (typed_field(ui, said, field).on_hover_text(tip), said)
        });
        for (typed, (response, said)) in typed.into_iter().zip(drawn) {
            typed.tell(&response, said, requests);
        }
    });
    if now != timeline.tolerance {
        requests.send(TimelineRequest::Tolerance(now));
    }
}
