//! Choices of how motion of another skeleton is put onto a rig, and facts about motion that was put onto one.

use std::sync::Arc;

use bevy_egui::egui::{Checkbox, Ui};

use crate::{
    editor::counted::counted,
    rig::{BuiltRig, Rig, animation::joint_map::JointMap},
    solve::{
        program::{CompileOptions, RigProgram},
        retarget::{MotionTarget, RetargetError, RetargetSettings, RetargetedMotion, measure_feet, measure_hands},
    },
};

/// Choices of how motion of another skeleton is put onto a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MotionOptions {
    /// True to let a figure travel that walks on the spot.
    pub travel: bool,
    /// True to put the travel over the ground onto the control that carries the whole figure, for the root motion of a game.
    pub root_motion: bool,
    /// True to hold standing feet in their places.
    pub lock_feet: bool,
    /// True to hold hands where they touch something.
    pub lock_hands: bool,
}

impl Default for MotionOptions {
    fn default() -> Self {
        let RetargetSettings { travel, root_motion, lock_feet, lock_hands, .. } = RetargetSettings::default();
        Self { travel, root_motion, lock_feet, lock_hands }
    }
}

impl MotionOptions {
    /// Settings with these choices.
    pub(super) fn settings(self, onto: MotionTarget) -> RetargetSettings {
        let Self { travel, root_motion, lock_feet, lock_hands } = self;
        RetargetSettings { onto, travel, root_motion, lock_feet, lock_hands, ..RetargetSettings::default() }
    }
}

/// Draws the choices; returns them as they are now. Keys go to nodes of the kind `onto`.
pub(super) fn choices(ui: &mut Ui, options: MotionOptions, onto: MotionTarget) -> MotionOptions {
    let mut now = options;
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
    });
    now
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
