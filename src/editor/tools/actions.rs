//! Actions on the selection that need no pointer.

use bevy::prelude::*;

use super::{
    ToolSystems,
    scene::{Scene, joints},
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        notice::{EditNotice, Notice},
    },
    plugins::{
        document::{EditRequest, titled},
        picking::{Pick, PickRequest},
    },
    rig::{Uid, operations::Operation},
};

/// Carries out deleting, selecting all or none, and mirroring.
pub struct ToolActionsPlugin;

impl Plugin for ToolActionsPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<EditNotice>().add_systems(Update, act_on_selection.in_set(ToolSystems::Actions));
    }
}

pub(super) fn act_on_selection(
    mut actions: MessageReader<ActionRequest>,
    scene: Scene,
    mut edits: MessageWriter<EditRequest>,
    mut picks: MessageWriter<PickRequest>,
    mut notices: MessageWriter<Notice>,
    mut done: MessageWriter<EditNotice>,
) {
    for ActionRequest(action) in actions.read() {
        let Some(rig) = scene.rig() else { continue };
        let pick = |what| PickRequest { rig: rig.entity, what, add: false };
        let is_joint = |node: &Uid| rig.rig.joint(*node).is_some();
        let selected: Vec<Uid> = rig.selection.0.iter().copied().filter(is_joint).collect();
        let count = selected.len();
        let operation = match action {
            Action::SelectAll => {
                picks.write(pick(Pick::All));
                continue;
            }
            Action::SelectNone => {
                picks.write(pick(Pick::None));
                continue;
            }
            Action::Delete => Operation::Delete { joints: selected, keep_children: true },
            Action::DeleteHierarchy => Operation::Delete { joints: selected, keep_children: false },
            Action::MirrorSelected => Operation::Mirror { joints: selected },
            _ => continue,
        };
        if count == 0 {
            notices.write(Notice::info("No joint is selected: click one first, or drag a box around some."));
            continue;
        }
        let what = joints(count);
        let told = match action {
            Action::MirrorSelected => format!("Made the other side of {what} and all below."),
            Action::Delete => format!("Deleted {what}; what hung below moved up."),
            _ => format!("Deleted {what} and all below."),
        };
        let step = titled(&operation, &rig.rig, rig.built);
        done.write(EditNotice { rig: rig.entity, step, notice: Notice::done(told).quiet() });
        edits.write(EditRequest::operation(rig.entity, operation));
    }
}
