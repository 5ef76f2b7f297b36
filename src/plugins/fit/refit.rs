//! Corrections of a fit: a joint that is moved at rest stays where it was put, and the joints around it are fitted again.
//!
//! Undo and redo of a correction bring its report and its markers back; redo of a fit opens it for corrections again.

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
};

use bevy::prelude::*;

use super::{
    EndFit, FIT, FIT_AROUND, FitFailure, FitMarkers, FitReport, FittedRig, RefitFailed, RemoveMarker,
    fitted_rig::{PastFits, PendingFit},
    work::{centre, skeleton, template_joints},
};
use crate::{
    algo::fit_template::refit_template,
    plugins::{
        commands::RigModules,
        document::{Change, EditReport, EditRequest},
        history::RigHistory,
    },
    rig::{
        EditError, Rig, RigEdit, Uid,
        operations::Operation,
        step::{Commit, Step},
    },
};

/// Distance, as a share of the body's height, from which on a joint has been moved.
const MOVED: f32 = 1e-4;

/// Fits the joints around those that a person has moved again, as a step of its own.
pub(super) fn follow_moves(
    mut edited: MessageReader<EditReport>,
    rigs: Query<(&Rig, Option<&FittedRig>, Option<&PendingFit>, Option<&PastFits>, Option<&FitMarkers>)>,
    modules: Res<RigModules>,
    mut commands: Commands,
) {
    let mut by_rig: BTreeMap<Entity, Vec<&EditReport>> = BTreeMap::new();
    for report in edited.read() {
        by_rig.entry(report.rig).or_default().push(report);
    }
    for (entity, reports) in by_rig {
        let Ok((rig, fitted, pending, past, markers)) = rigs.get(entity) else { continue };
        if fitted.is_none() && pending.is_none() && past.is_none() && markers.is_none() {
            continue;
        }
        let mut followed = FitHistory {
            rig,
            fitted: fitted.cloned(),
            pending: pending.map(|pending| pending.0.clone()),
            past: past.cloned().unwrap_or_default(),
            markers: markers.cloned().unwrap_or_default(),
            is_changed: false,
            failures: Vec::new(),
        };
        for report in reports {
            if let Some(operation) = followed.follow(report, &modules) {
                commands.write_message(EditRequest::operation(entity, operation));
            }
        }
        for reason in followed.failures.drain(..) {
            commands.write_message(RefitFailed { rig: entity, reason });
        }
        followed.write(entity, &mut commands);
    }
}

/// The fits of a rig while edits are followed.
struct FitHistory<'a> {
    rig: &'a Rig,
    fitted: Option<FittedRig>,
    pending: Option<FittedRig>,
    past: PastFits,
    markers: FitMarkers,
    is_changed: bool,
    /// Reasons why joints were not fitted again.
    failures: Vec<FitFailure>,
}

impl FitHistory<'_> {
    fn follow(&mut self, report: &EditReport, modules: &RigModules) -> Option<Operation> {
        let is_fit = report.name == FIT;
        match &report.committed {
            None if !is_fit || report.preview => return None,
            // A fit that finds every joint where it is has no step.
            None => self.begin(None),
            Some(Commit::Done(step)) if is_fit => self.begin(Some(step)),
            Some(Commit::Done(step)) => {
                self.is_changed = true;
                return self.correct(&report.name, step, modules);
            }
            Some(Commit::Undone(step)) if is_fit => {
                let undone = self.past.of(step);
                let replaced = undone.and_then(|fitted| fitted.replaced.clone());
                self.markers.0 = undone.map(|fitted| fitted.begun.clone()).unwrap_or_default();
                self.markers.0.retain(|joint, _| self.rig.joint(*joint).is_some());
                self.fitted =
                    replaced.map(|fitted| FittedRig { places: fitted.places_in(self.rig), ..(*fitted).clone() });
            }
            Some(Commit::Redone(step)) if is_fit => {
                let replaced = self.fitted.take().map(|fitted| FittedRig { replaced: None, ..fitted });
                self.fitted = self.past.of(step).map(|fitted| fitted.reopened(self.rig, replaced));
            }
            Some(Commit::Undone(step)) => self.with_fitted(|rig, fitted| {
                let least = MOVED * fitted.report.fit.height;
                let is_there = |joint, place| is_at(rig, joint, place, least);
                if report.name == FIT_AROUND {
                    fitted.go_back(step, is_there);
                } else {
                    fitted.markers.retain(|joint, place| is_there(*joint, *place));
                }
            }),
            Some(Commit::Redone(step)) => self.with_fitted(|_, fitted| {
                if report.name == FIT_AROUND {
                    fitted.go_on(step);
                }
            }),
        }
        self.is_changed = true;
        None
    }

    fn with_fitted(&mut self, change: impl FnOnce(&Rig, &mut FittedRig)) {
        if let Some(fitted) = &mut self.fitted {
            change(self.rig, fitted);
            fitted.places = fitted.places_in(self.rig);
        }
    }

    /// Opens the fit whose edit was committed.
    fn begin(&mut self, step: Option<&Arc<Step>>) {
        let Some(mut fitted) = self.pending.take() else { return };
        fitted.step = step.cloned();
        fitted.places = fitted.places_in(self.rig);
        fitted.replaced = self.fitted.take().map(|fitted| Arc::new(FittedRig { replaced: None, ..fitted }));
        self.fitted = Some(fitted);
    }

    /// Fits the joints around those that a step has moved.
    fn correct(&mut self, name: &str, step: &Arc<Step>, modules: &RigModules) -> Option<Operation> {
        let is_place = step.forward.iter().all(is_rest);
        let rig = self.rig;
        let Some(fitted) = &mut self.fitted else {
            // Places that a person gives a joint after the fit was accepted are wishes for the next one.
            self.markers.0.retain(|joint, _| rig.joint(*joint).is_some());
            if is_place {
                self.markers.0.iter_mut().for_each(|(joint, place)| *place = rig.position(*joint));
            }
            return None;
        };
        let now = fitted.places_in(rig);
        let before = std::mem::replace(&mut fitted.places, now.clone());
        if name == FIT_AROUND {
            fitted.note(step);
            return None;
        }
        // Whoever goes on with something else than places has accepted the fit.
        if !is_place {
            self.fitted = None;
            return None;
        }
        let report = fitted.report.clone();
        let least = MOVED * report.fit.height;
        let is_moved = |(((uid, _), before), now): ((&(Uid, String), &Option<Vec3>), &Option<Vec3>)| {
            let (before, now) = ((*before)?, (*now)?);
            (before.distance(now) > least).then_some((*uid, now))
        };
        let moved: Vec<(Uid, Vec3)> = report.joints.iter().zip(&before).zip(&now).filter_map(is_moved).collect();
        // A move of the whole skeleton is no correction.
        if moved.is_empty() || 2 * moved.len() > report.joints.len() {
            return None;
        }
        // Of corrections that were undone no marker is left.
        fitted.markers.retain(|uid, place| is_at(rig, *uid, *place, least));
        let kept = fitted.markers.clone();
        fitted.markers.extend(top_of(rig, &moved));
        match refitted(rig, fitted, modules) {
            Ok(operation) => Some(operation),
            Err(reason) => {
                // A place that cannot be fitted to is none to start from.
                fitted.markers = kept;
                self.failures.push(reason);
                None
            }
        }
    }

    fn write(mut self, entity: Entity, commands: &mut Commands) {
        if !self.is_changed {
            return;
        }
        let mut rig = commands.entity(entity);
        match self.fitted {
            Some(fitted) => {
                let is_other = |joint: &Uid| fitted.report.joints.iter().all(|(own, _)| own != joint);
                self.markers.0.retain(|joint, _| is_other(joint));
                self.markers.0.extend(fitted.markers.iter().map(|(joint, place)| (*joint, *place)));
                self.past.keep(&fitted);
                rig.try_insert(fitted);
            }
            None => {
                rig.try_remove::<FittedRig>();
            }
        }
        if self.pending.is_none() {
            rig.try_remove::<PendingFit>();
        }
        if self.markers.0.is_empty() {
            rig.try_remove::<FitMarkers>();
        } else {
            rig.try_insert(self.markers);
        }
        if !self.past.is_empty() {
            rig.try_insert(self.past);
        }
    }
}

fn is_at(rig: &Rig, joint: Uid, place: Vec3, least: f32) -> bool {
    rig.joint(joint).is_some() && rig.position(joint).distance(place) <= least
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

fn refitted(rig: &Rig, fitted: &mut FittedRig, modules: &RigModules) -> Result<Operation, FitFailure> {
    let (uids, labels, parents, places) = skeleton(&fitted.template);
    let joints = template_joints(&labels, &parents, &places);
    let index = |uid: &Uid| uids.iter().position(|known| known == uid);
    fitted.settings.markers = fitted.markers.iter().filter_map(|(uid, place)| Some((index(uid)?, *place))).collect();
    let mut fit = refit_template(&fitted.analysis, &joints, &fitted.settings, &fitted.first.fit)?;
    centre(&mut fit, &labels, &fitted.settings.markers);
    fitted.report = Arc::new(FitReport { fit, ..(*fitted.report).clone() });
    let target = fitted.target(&modules.0)?;
    let edits = rests_of(rig, &target)?;
    Ok(Operation::Named { name: FIT_AROUND, edits })
}

/// The edits that put the joints of a rig where those of the same uid are in another. Joints that only the rig has go along
/// with their parents; nothing else changes.
pub(super) fn rests_of(rig: &Rig, target: &Rig) -> Result<Vec<RigEdit>, EditError> {
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

/// Ends fits: accepted ones stay as they are, of cancelled ones every step since the fit is undone, and no marker is left.
pub(super) fn end(mut commands: Commands, mut requests: MessageReader<EndFit>, rigs: Query<(&FittedRig, &RigHistory)>) {
    for EndFit { rig, cancel } in requests.read() {
        let Ok((fitted, history)) = rigs.get(*rig) else { continue };
        if *cancel {
            for _ in 0..history.steps_since(fitted.before.as_ref()) {
                commands.write_message(EditRequest { rig: *rig, change: Change::Undo });
            }
            commands.entity(*rig).try_remove::<FitMarkers>();
        }
        commands.entity(*rig).try_remove::<FittedRig>();
    }
}

/// Takes markers away, and fits the joints around them again while the fit can be corrected.
pub(super) fn remove_markers(
    mut commands: Commands,
    mut requests: MessageReader<RemoveMarker>,
    mut rigs: Query<(&Rig, Option<&mut FittedRig>, Option<&mut FitMarkers>)>,
    modules: Res<RigModules>,
) {
    for RemoveMarker { rig: entity, joint } in requests.read() {
        let Ok((rig, fitted, markers)) = rigs.get_mut(*entity) else { continue };
        if let Some(mut markers) = markers {
            markers.0.remove(joint);
        }
        if let Some(mut fitted) = fitted
            && fitted.markers.remove(joint).is_some()
        {
            match refitted(rig, &mut fitted, &modules) {
                Ok(operation) => {
                    commands.write_message(EditRequest::operation(*entity, operation));
                }
                Err(reason) => {
                    commands.write_message(RefitFailed { rig: *entity, reason });
                }
            }
        }
    }
}
