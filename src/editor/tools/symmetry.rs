//! Live mirroring, on and off.

use bevy::prelude::*;

use super::ToolSystems;
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        notice::Notice,
    },
    plugins::{document::Symmetry, surface::RigSurface},
    rig::{Rig, operations::MirrorPlane},
};

/// Plugin that switches live mirroring. Its plane is drawn while a rig's [`Symmetry`] holds one.
pub struct SymmetryPlugin;

impl Plugin for SymmetryPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, switch.in_set(ToolSystems::Actions).after(super::actions::act_on_selection));
    }
}

fn switch(
    mut actions: MessageReader<ActionRequest>,
    active: Option<Res<ActiveRig>>,
    mut rigs: Query<(&Rig, &mut Symmetry, Option<&RigSurface>)>,
    mut notices: MessageWriter<Notice>,
) {
    for _ in actions.read().filter(|request| request.0 == Action::Symmetry) {
        let Some((rig, mut symmetry, surface)) = active.as_ref().and_then(|rig| rigs.get_mut(rig.0).ok()) else {
            continue;
        };
        symmetry.0 = match symmetry.0 {
            Some(_) => None,
            None => Some(MirrorPlane::sagittal(height(rig, surface))),
        };
        let text = match symmetry.0 {
            Some(_) => "Symmetry is on: what you do on one side of x = 0 happens on the other, too.",
            None => "Symmetry is off.",
        };
        notices.write(Notice::info(text).quiet());
    }
}

/// Height of the character, from which the plane's tolerance follows.
fn height(rig: &Rig, surface: Option<&RigSurface>) -> f32 {
    if let Some(surface) = surface {
        let [low, high] = surface.bounds();
        return high.y - low.y;
    }
    let heights = rig.rest_globals().into_iter().map(|(_, joint)| joint.translation.y);
    let [low, high] = heights.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], y| [low.min(y), high.max(y)]);
    if high > low { high - low } else { 1.0 }
}
