//! Corrections of a fit: a joint that is moved at rest stays where it was put, and the joints around it are fitted again.

use std::sync::Arc;

use bevy::prelude::*;

use super::{EndFit, FIT, FIT_AROUND, FitReport, FittedRig, centre, skeleton, template_joints};
use crate::{
    algo::fit_template::refit_template,
    plugins::{
        commands::RigModules,
        document::{Change, EditRequest, Edited},
        history::RigHistory,
    },
    rig::{Rig, Uid, operations::Operation, step::Committed, update::edits_between},
};

/// Distance, as a share of the body's height, from which on a joint has been moved.
const MOVED: f32 = 1e-4;

/// Fits the joints around those that a person has moved again, as a step of its own.
pub(super) fn follow_moves(
    mut edited: MessageReader<Edited>,
    mut rigs: Query<(&Rig, &mut FittedRig)>,
    modules: Res<RigModules>,
    mut commands: Commands,
) {
    for Edited { rig: entity, name, committed, .. } in edited.read() {
        // A fit that is undone can no longer be corrected.
        if *name == FIT && matches!(committed, Some(Committed::Undone(_))) {
            commands.entity(*entity).try_remove::<FittedRig>();
            continue;
        }
        let (Ok((rig, mut fitted)), Some(Committed::Done(_))) = (rigs.get_mut(*entity), committed) else { continue };
        if *name == FIT || *name == FIT_AROUND {
            continue;
        }
        let height = fitted.report.fit.height;
        let is_moved = |((uid, _), joint): (&(Uid, String), &crate::algo::fit_template::JointFit)| {
            let place = rig.joint(*uid).map(|_| rig.position(*uid))?;
            (place.distance(joint.position) > MOVED * height).then_some((*uid, place))
        };
        let report = fitted.report.clone();
        let moved: Vec<(Uid, Vec3)> = report.joints.iter().zip(&report.fit.joints).filter_map(is_moved).collect();
        // An edit of anything but places, or one that moves the whole skeleton, is no correction.
        if moved.is_empty() || 2 * moved.len() > report.joints.len() {
            continue;
        }
        fitted.markers.extend(top_of(rig, &moved));
        if let Some(operation) = refitted(rig, &mut fitted, &modules) {
            commands.write_message(EditRequest::operation(*entity, operation));
        }
    }
}

/// Moved joints that have not just gone along with a moved joint above them.
fn top_of(rig: &Rig, moved: &[(Uid, Vec3)]) -> Vec<(Uid, Vec3)> {
    let is_moved = |uid: Uid| moved.iter().any(|(moved, _)| *moved == uid);
    let is_top = |(uid, _): &&(Uid, Vec3)| !rig.ancestors(*uid).any(|above| is_moved(above.data.uid));
    moved.iter().filter(is_top).copied().collect()
}

fn refitted(rig: &Rig, fitted: &mut FittedRig, modules: &RigModules) -> Option<Operation> {
    let (uids, labels, parents, places) = skeleton(&fitted.template);
    let joints = template_joints(&labels, &parents, &places);
    let index = |uid: &Uid| uids.iter().position(|known| known == uid);
    fitted.settings.markers = fitted.markers.iter().filter_map(|(uid, place)| Some((index(uid)?, *place))).collect();
    let mut fit = refit_template(&fitted.analysis, &joints, &fitted.settings, &fitted.report.fit).ok()?;
    centre(&mut fit, &labels, &fitted.settings.markers);
    fitted.report = Arc::new(FitReport { fit, ..(*fitted.report).clone() });
    let target = fitted.target(&modules.0).ok()?;
    let edits = edits_between(rig, &target).ok()?;
    Some(Operation::Named { name: FIT_AROUND, edits })
}

/// Ends fits: accepted ones stay as they are, of cancelled ones every step since the fit is undone.
pub(super) fn end(mut commands: Commands, mut requests: MessageReader<EndFit>, rigs: Query<(&FittedRig, &RigHistory)>) {
    for EndFit { rig, cancel } in requests.read() {
        let Ok((fitted, history)) = rigs.get(*rig) else { continue };
        if *cancel {
            for _ in 0..history.steps_since(fitted.before.as_ref()) {
                commands.write_message(EditRequest { rig: *rig, change: Change::Undo });
            }
        }
        commands.entity(*rig).try_remove::<FittedRig>();
    }
}
