//! Corrections of a fit: a joint that is moved at rest stays where it was put, and the joints around it are fitted again.

use std::{collections::HashMap, sync::Arc};

use bevy::prelude::*;

use super::{
    EndFit, FIT, FIT_AROUND, FitReport, FittedRig,
    work::{centre, skeleton, template_joints},
};
use crate::{
    algo::fit_template::refit_template,
    plugins::{
        commands::RigModules,
        document::{Change, EditReport, EditRequest},
        history::RigHistory,
    },
    rig::{EditError, Rig, RigEdit, Uid, operations::Operation, step::Commit},
};

/// Distance, as a share of the body's height, from which on a joint has been moved.
const MOVED: f32 = 1e-4;

/// Fits the joints around those that a person has moved again, as a step of its own.
pub(super) fn follow_moves(
    mut edited: MessageReader<EditReport>,
    mut rigs: Query<(&Rig, &mut FittedRig)>,
    modules: Res<RigModules>,
    mut commands: Commands,
) {
    for EditReport { rig: entity, name, committed, .. } in edited.read() {
        // A fit that is undone can no longer be corrected.
        if *name == FIT && matches!(committed, Some(Commit::Undone(_))) {
            commands.entity(*entity).try_remove::<FittedRig>();
            continue;
        }
        let (Ok((rig, mut fitted)), Some(committed)) = (rigs.get_mut(*entity), committed) else { continue };
        let report = fitted.report.clone();
        let now: Vec<Option<Vec3>> =
            report.joints.iter().map(|(uid, _)| rig.joint(*uid).map(|_| rig.position(*uid))).collect();
        let before = std::mem::replace(&mut fitted.places, now.clone());
        let Commit::Done(step) = committed else { continue };
        if *name == FIT || *name == FIT_AROUND {
            continue;
        }
        // Whoever goes on with something else than places has accepted the fit.
        if !step.forward.iter().all(is_rest) {
            commands.entity(*entity).try_remove::<FittedRig>();
            continue;
        }
        let least = MOVED * report.fit.height;
        let is_moved = |(((uid, _), before), now): ((&(Uid, String), &Option<Vec3>), &Option<Vec3>)| {
            let (before, now) = ((*before)?, (*now)?);
            (before.distance(now) > least).then_some((*uid, now))
        };
        let moved: Vec<(Uid, Vec3)> = report.joints.iter().zip(&before).zip(&now).filter_map(is_moved).collect();
        // A move of the whole skeleton is no correction.
        if moved.is_empty() || 2 * moved.len() > report.joints.len() {
            continue;
        }
        // Of corrections that were undone no marker is left.
        fitted.markers.retain(|uid, place| rig.joint(*uid).is_some() && rig.position(*uid).distance(*place) <= least);
        fitted.markers.extend(top_of(rig, &moved));
        if let Some(operation) = refitted(rig, &mut fitted, &modules) {
            commands.write_message(EditRequest::operation(*entity, operation));
        }
    }
}

/// True for edits that change nothing but rest transforms.
fn is_rest(edit: &RigEdit) -> bool {
    match edit {
        RigEdit::SetRest(..) => true,
        RigEdit::Batch(edits) => edits.iter().all(is_rest),
        _ => false,
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
    let mut fit = refit_template(&fitted.analysis, &joints, &fitted.settings, &fitted.first.fit).ok()?;
    centre(&mut fit, &labels, &fitted.settings.markers);
    fitted.report = Arc::new(FitReport { fit, ..(*fitted.report).clone() });
    let target = fitted.target(&modules.0).ok()?;
    let edits = rests_of(rig, &target).ok()?;
    Some(Operation::Named { name: FIT_AROUND, edits })
}

/// The edits that put the joints of a rig where those of the same uid are in another. Joints that only the rig has go along
/// with their parents; nothing else changes.
fn rests_of(rig: &Rig, target: &Rig) -> Result<Vec<RigEdit>, EditError> {
    let globals: HashMap<Uid, _> = target.rest_globals().into_iter().collect();
    let mut placed = rig.clone();
    let mut edits = Vec::new();
    for joint in rig.walk() {
        let uid = joint.data.uid;
        let Some(global) = globals.get(&uid) else { continue };
        let rest = placed.local_rest(joint.parent, global);
        if joint.data.rest != rest {
            let edit = RigEdit::SetRest(uid, rest);
            placed.apply(&edit)?;
            edits.push(edit);
        }
    }
    Ok(edits)
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
