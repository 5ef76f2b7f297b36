//! Choices of how motion of another skeleton is put onto a rig, and facts about motion that was put onto one.

use std::sync::Arc;

use bevy_egui::egui::{Checkbox, DragValue, Ui};

use crate::{
    editor::{
        counts::counted,
        panel::Requests,
        panels::fields::{TypedText, typed_field},
    },
    rig::{
        BuiltRig, Rig,
        animation::{joint_map::JointMap, motion::Motion},
    },
    solve::{
        program::{CompileOptions, RigProgram},
        retarget::{MotionTarget, RetargetError, RetargetSettings, RetargetedMotion, measure_feet, measure_hands},
    },
};

/// Frames a second that a frame rate of its own begins with.
const FIRST_RATE: f32 = 30.0;

/// Choices of how motion of another skeleton is put onto a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionOptions {
    /// True to let a figure travel that walks on the spot.
    pub travel: bool,
    /// True to put the travel over the ground onto the control that carries the whole figure, for the root motion of a game.
    pub root_motion: bool,
    /// True to hold standing feet in their places.
    pub lock_feet: bool,
    /// True to hold hands where they touch something.
    pub lock_hands: bool,
    /// True if the clip is played over and over; so is that of a motion which says so itself.
    pub looped: bool,
    /// Frames a second of the clip; those of the motion, but at most 60, if `None`.
    pub frame_rate: Option<f32>,
}

/// A frame rate leaves a single frame of a motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "the clip \"{clip}\" lasts {seconds} s, which is no frame more than the first at a frame rate of {rate}; give a higher one"
)]
pub(super) struct RateError {
    clip: String,
    seconds: f32,
    rate: f32,
}

impl Default for MotionOptions {
    fn default() -> Self {
        let RetargetSettings { travel, root_motion, lock_feet, lock_hands, looped, frame_rate, .. } =
            RetargetSettings::default();
        Self { travel, root_motion, lock_feet, lock_hands, looped, frame_rate }
    }
}

impl MotionOptions {
    /// Settings with these choices.
    pub(super) fn settings(self, onto: MotionTarget) -> RetargetSettings {
        let Self { travel, root_motion, lock_feet, lock_hands, looped, frame_rate } = self;
        let others = RetargetSettings::default();
        RetargetSettings { onto, travel, root_motion, lock_feet, lock_hands, looped, frame_rate, ..others }
    }

    /// Refuses a frame rate at which a motion would be a pose.
    ///
    /// # Errors
    /// The motion is shorter than a frame.
    pub(super) fn check_rate(self, motion: &Motion) -> Result<(), RateError> {
        let seconds = motion.duration();
        match self.frame_rate {
            Some(rate) if seconds > 0.0 && seconds * rate < 1.0 - 1e-3 => {
                Err(RateError { clip: motion.name.clone(), seconds, rate })
            }
            _ => Ok(()),
        }
    }
}

/// Draws the choices; returns them as they are now, and true if a field was left, as Escape does. Keys go to nodes of the kind
/// `onto`.
pub(super) fn choices(
    ui: &mut Ui,
    options: MotionOptions,
    onto: MotionTarget,
    requests: &mut Requests,
) -> (MotionOptions, bool) {
    let (mut now, mut is_left) = (options, false);
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut now.travel, "Travel")
            .on_hover_text("A figure that walks on the spot moves over the ground by its standing feet");
        let has_root = onto == MotionTarget::Controls;
        ui.add_enabled(has_root, Checkbox::new(&mut now.root_motion, "Root motion"))
            .on_hover_text(
                "The control that carries the whole rig gets the travel over the ground, which a game takes over",
            )
            .on_disabled_hover_text("The keys go to joints, of which the hips have the travel");
        ui.checkbox(&mut now.lock_feet, "Lock feet").on_hover_text("Standing feet are held in their places");
        ui.checkbox(&mut now.lock_hands, "Lock hands").on_hover_text("Hands are held where they touch something");
        ui.checkbox(&mut now.looped, "Loop").on_hover_text("The clip is played over and over");
        is_left = rate(ui, &mut now.frame_rate, requests);
    });
    (now, is_left)
}

/// Draws the choice of a frame rate; returns true if its field was left.
fn rate(ui: &mut Ui, chosen: &mut Option<f32>, requests: &mut Requests) -> bool {
    let mut is_own = chosen.is_some();
    ui.checkbox(&mut is_own, "Frame rate")
        .on_hover_text("The clip has a frame rate of its own; without, it has that of the file, but at most 60");
    *chosen = is_own.then(|| chosen.unwrap_or(FIRST_RATE));
    let Some(rate) = chosen else { return false };
    let (typed, said) = (TypedText::default(), "Frames a second of the clip");
    let number = DragValue::new(rate).range(1.0..=1000.0).speed(0.2).max_decimals(3).update_while_editing(false);
    let field = typed_field(ui, said, number.custom_parser(typed.reader(1.0..=1000.0, "")));
    let field = field.on_hover_text("Frames a second that the clip gets");
    typed.tell(&field, said, requests);
    field.lost_focus()
}

/// Sentences about motion that was put onto a rig: the control with its travel, and how well feet and hands stay in their places.
///
/// # Errors
/// The built rig does not run.
pub(super) fn sentences(
    rig: &Rig,
    built: &BuiltRig,
    map: &JointMap,
    done: &RetargetedMotion,
) -> Result<Vec<String>, RetargetError> {
    let program = Arc::new(RigProgram::compile(built, &CompileOptions::default())?);
    let clip = &done.clip;
    let mut sentences = Vec::new();
    if let Some(root) = done.root {
        let name = built.node(root).map_or_else(|| root.to_string(), |node| node.name.to_string());
        sentences.push(format!("\"{}\": the travel is on {name}, for root motion", clip.name));
    }
    let feet = measure_feet(rig, &program, clip, &map.target, &done.stances);
    if feet.stances > 0 {
        sentences.push(format!(
            "\"{}\": feet stand {}, slide {:.2} % and are off the ground by {:.2} % of the height at most",
            clip.name,
            counted(feet.stances, "time", "times"),
            feet.slide,
            feet.ankle
        ));
    }
    let hands = measure_hands(rig, &program, clip, &map.target, &done.touches);
    if hands.touches > 0 {
        sentences.push(format!(
            "\"{}\": hands touch something {}, and slide by {:.2} % of the height at most where they hold it",
            clip.name,
            counted(hands.touches, "time", "times"),
            hands.slide
        ));
    }
    Ok(sentences)
}
