//! Weights as colours, in Weights and Paint mode: the points that the active joint moves, or the colours of all joints.

use bevy::prelude::*;

use super::{
    ToolSystems,
    paint::brush::PaintBrush,
    scene::{EditedRig, Scene},
};
use crate::{
    editor::{counts::counted, mode::Mode, notice::StatusLine},
    plugins::display::{MeshDisplay, WeightColors},
    rig::Uid,
};

/// Plugin that shows weights in their mode.
pub struct WeightsPlugin;

impl Plugin for WeightsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MeshDisplay>()
            .init_resource::<WeightsTool>()
            .add_systems(PostUpdate, show_weights.in_set(ToolSystems::Show).after(super::stroke::show));
    }
}

/// Display settings before the mode was entered.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
pub struct WeightsTool {
    before: Option<WeightColors>,
}

pub(super) fn show_weights(
    mut tool: ResMut<WeightsTool>,
    mode: Res<Mode>,
    brush: Option<Res<PaintBrush>>,
    scene: Scene,
    mut display: ResMut<MeshDisplay>,
    mut status: ResMut<StatusLine>,
) {
    if !matches!(*mode, Mode::Weights | Mode::Paint) {
        if let Some(before) = tool.before.take() {
            display.weights = before;
        }
        return;
    }
    let is_other_brush = brush.as_ref().is_some_and(|brush| brush.is_changed());
    if !(mode.is_changed() || is_other_brush || scene.is_changed()) {
        return;
    }
    if tool.before.is_none() {
        tool.before = Some(display.weights);
    }
    let Some(rig) = scene.rig() else { return };
    let active = rig.selection.active().filter(|_| !brush.is_some_and(|brush| brush.all_colors));
    let wanted = active.map_or(WeightColors::AllJoints, WeightColors::Joint);
    if display.weights != wanted {
        display.weights = wanted;
    }
    // The paint tool says what a stroke would do.
    if *mode != Mode::Weights {
        return;
    }
    let (hint, obstacle) = describe(&rig);
    let banner = status.banner.clone();
    status.set_if_neq(StatusLine { hint, obstacle, banner });
}

/// Description of the active joint's weights, and the reason if it has none.
fn describe(rig: &EditedRig) -> (String, Option<String>) {
    if rig.rig.is_empty() {
        let why = "there are no joints; place some, or fit a skeleton (F)".to_owned();
        return ("Weights belong to joints.".to_owned(), Some(why));
    }
    if rig.rig.skins().next().is_none() {
        let why = "the mesh has no weights yet; compute them first (B)".to_owned();
        return ("Click a joint to see what it moves.".to_owned(), Some(why));
    }
    let Some(joint) = rig.selection.active() else {
        return ("Every joint in a colour of its own. Click a joint to see what it moves.".to_owned(), None);
    };
    let (moved, of) = points_moved(rig, joint);
    let name = rig.name(joint);
    let hint = match moved {
        0 => format!("{name} moves no point of {of}."),
        _ => format!("{name} moves {moved} of {}.", counted(of, "point", "points")),
    };
    (format!("{hint} Click another joint to see what it moves."), None)
}

/// Number of points of all bound meshes with an influence of a joint, and number of all points.
pub fn points_moved(rig: &EditedRig, joint: Uid) -> (usize, usize) {
    let mut moved = 0;
    let mut of = 0;
    for (_, skin) in rig.rig.skins() {
        of += skin.weights.len();
        let Some(number) = skin.joints.iter().position(|uid| *uid == joint) else { continue };
        // A point lists a joint at most once, and never with a weight of zero.
        moved += skin.weights.joints.iter().filter(|joint| **joint as usize == number).count();
    }
    (moved, of)
}
