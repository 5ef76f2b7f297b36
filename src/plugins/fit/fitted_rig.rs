//! Fitted rigs: what corrections of a fit start from, and what undo and redo bring back of it.

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::*;

use super::{
    FitFailure, FitReport, FitRequest, FitTemplate,
    part::{AddedPart, changed_tags},
    refit::rests_of,
};
use crate::{
    algo::fit_template::{FitSettings, MeshAnalysis},
    processor::{Fitting, Modules, fitted_rig},
    rig::{EditError, Rig, RigEdit, Uid, step::Step, update::edits_between},
};

/// Number of fits of a rig that redo opens again.
const MOST_FITS: usize = 4;
/// Number of corrections of a fit whose reports undo and redo bring back.
const MOST_STATES: usize = 64;

/// Fit that can still be corrected, on the rig's entity: moving a joint at rest fits the joints around it again.
#[derive(Component, Reflect, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct FittedRig {
    /// Report of the present fit.
    pub report: Arc<FitReport>,
    /// Places that a person chose, by joint.
    pub markers: BTreeMap<Uid, Vec3>,
    /// Request that the fit answers.
    pub request: FitRequest,
    /// True if the rig was empty before the fit: another template may take the place of this one.
    pub has_own_template: bool,
    pub(super) analysis: Arc<MeshAnalysis>,
    pub(super) settings: FitSettings,
    /// Skeleton of the template at rest, before it was fitted.
    pub(super) template: Arc<Rig>,
    pub(super) extent: FitExtent,
    /// Report of the fit before corrections, from which every correction starts.
    pub(super) first: Arc<FitReport>,
    /// Markers of the fit before corrections.
    pub(super) begun: BTreeMap<Uid, Vec3>,
    /// Positions of the joints after the last edit, in the order of the report.
    pub(super) places: Vec<Option<Vec3>>,
    pub(super) floor: f32,
    /// Last step before the fit.
    pub(super) before: Option<Arc<Step>>,
    /// Step of the fit; `None` if it changed nothing.
    pub(super) step: Option<Arc<Step>>,
    pub(super) states: Vec<FitState>,
    /// Number of states whose steps are in effect.
    pub(super) applied: usize,
    /// Fit that could be corrected until this one took its place.
    pub(super) replaced: Option<Arc<FittedRig>>,
}

/// Joints that a fit moves.
#[derive(Debug, Clone)]
pub(super) enum FitExtent {
    /// All joints of the rig, or of a template in an empty one.
    Skeleton,
    /// Joints that were chosen, of the rig.
    Joints,
    /// Joints that the fit adds.
    Part(AddedPart),
}

/// Fit as it was after a correction.
#[derive(Clone)]
pub(super) struct FitState {
    step: Arc<Step>,
    report: Arc<FitReport>,
    markers: BTreeMap<Uid, Vec3>,
}

/// Places that a person chose for joints of the rig. The next fit starts from them, even where the last one was accepted.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct FitMarkers(pub BTreeMap<Uid, Vec3>);

/// Distance, as a share of the skeleton's size, within which a joint is where its marker is.
const AT_MARKER: f32 = 1e-4;

impl FitMarkers {
    /// Markers whose joints are where a person put them.
    pub fn held(&self, rig: &Rig) -> BTreeMap<Uid, Vec3> {
        let reach = |(_, global): &(Uid, bevy::math::Affine3)| global.translation.abs().max_element();
        let size = rig.rest_globals().iter().map(reach).fold(0.0, f32::max);
        let is_held = |joint: Uid, place: Vec3| {
            rig.joint(joint).is_some() && rig.position(joint).distance(place) <= AT_MARKER * size
        };
        let markers = self.0.iter().filter(|(joint, place)| is_held(**joint, **place));
        markers.map(|(joint, place)| (*joint, *place)).collect()
    }
}

/// Fit whose edit is under way.
#[derive(Component, Clone)]
pub(super) struct PendingFit(pub(super) FittedRig);

/// Fits whose steps may be redone, each as it was last.
#[derive(Component, Clone, Default)]
pub(super) struct PastFits(Vec<FittedRig>);

impl PastFits {
    /// Fit of a step.
    pub(super) fn of(&self, step: &Arc<Step>) -> Option<&FittedRig> {
        self.0.iter().find(|fitted| fitted.is_of(step))
    }

    /// Remembers a fit as it is now.
    pub(super) fn keep(&mut self, fitted: &FittedRig) {
        let Some(step) = &fitted.step else { return };
        self.0.retain(|known| !known.is_of(step));
        self.0.push(fitted.clone());
        let old = self.0.len().saturating_sub(MOST_FITS);
        self.0.drain(..old);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl FittedRig {
    pub(super) fn is_of(&self, step: &Arc<Step>) -> bool {
        self.step.as_ref().is_some_and(|own| Arc::ptr_eq(own, step))
    }

    /// Positions of its joints in a rig.
    pub(super) fn places_in(&self, rig: &Rig) -> Vec<Option<Vec3>> {
        let place = |uid: &Uid| rig.joint(*uid).map(|_| rig.position(*uid));
        self.report.joints.iter().map(|(uid, _)| place(uid)).collect()
    }

    /// Request for a fit of another template, by its name, to the same part of the mesh. The directions are left to the fit.
    pub fn with_template(&self, name: &str) -> FitRequest {
        FitRequest {
            template: FitTemplate::Named(name.to_owned()),
            up: None,
            forward: None,
            markers: Vec::new(),
            ..self.request.clone()
        }
    }

    /// Request for a fit of the same template that faces the other way.
    pub fn turned_round(&self) -> FitRequest {
        let fit = &self.report.fit;
        let template = match &self.request.template {
            FitTemplate::Choose if self.has_own_template => FitTemplate::Named(self.report.template.clone()),
            given => given.clone(),
        };
        FitRequest {
            template,
            up: Some(fit.up),
            forward: Some(-fit.forward),
            markers: Vec::new(),
            ..self.request.clone()
        }
    }

    /// Notes the present report and markers as those after a correction.
    pub(super) fn note(&mut self, step: &Arc<Step>) {
        let state = FitState { step: step.clone(), report: self.report.clone(), markers: self.markers.clone() };
        // Undone corrections can no longer be redone.
        self.states.truncate(self.applied);
        self.states.push(state);
        let old = self.states.len().saturating_sub(MOST_STATES);
        self.states.drain(..old);
        self.applied = self.states.len();
    }

    /// Takes back a correction that was undone. A joint that is still where a marker has put it keeps the marker.
    pub(super) fn go_back(&mut self, step: &Arc<Step>, is_there: impl Fn(Uid, Vec3) -> bool) {
        let at = self.states.iter().position(|state| Arc::ptr_eq(&state.step, step));
        self.applied = at.unwrap_or(0);
        let undone = std::mem::take(&mut self.markers);
        let before = at.and_then(|at| at.checked_sub(1)).and_then(|at| self.states.get(at));
        (self.report, self.markers) = match before {
            Some(state) => (state.report.clone(), state.markers.clone()),
            None => (self.first.clone(), self.begun.clone()),
        };
        for (joint, place) in undone.into_iter().filter(|(joint, place)| is_there(*joint, *place)) {
            self.markers.entry(joint).or_insert(place);
        }
    }

    /// Brings back a correction that was redone.
    pub(super) fn go_on(&mut self, step: &Arc<Step>) {
        let Some(at) = self.states.iter().position(|state| Arc::ptr_eq(&state.step, step)) else { return };
        let state = &self.states[at];
        self.applied = at + 1;
        (self.report, self.markers) = (state.report.clone(), state.markers.clone());
    }

    /// Brings the fit back as it was before corrections.
    pub(super) fn reopened(&self, rig: &Rig, replaced: Option<FittedRig>) -> Self {
        let mut fitted = self.clone();
        (fitted.report, fitted.markers) = (self.first.clone(), self.begun.clone());
        fitted.applied = 0;
        fitted.places = fitted.places_in(rig);
        fitted.replaced = replaced.map(Arc::new);
        fitted
    }

    /// The template in the body.
    pub(super) fn target(&self, modules: &Modules) -> Result<Rig, EditError> {
        self.placed(&self.template, modules)
    }

    /// The edits that put the template into a rig without joints, the rig's own joints to their places, or an added part below
    /// its parent. Whatever else the rig has, or has got while the fit ran, stays.
    pub(super) fn edits(&self, rig: &Rig, target: &Rig, modules: &Modules) -> Result<Vec<RigEdit>, FitFailure> {
        match &self.extent {
            FitExtent::Skeleton if !rig.is_empty() => Ok(edits_between(rig, &self.placed(rig, modules)?)?),
            FitExtent::Skeleton => {
                let mut edits = edits_between(rig, target)?;
                // Groups and poses that move are removed, too, and come back at once.
                edits.retain(|edit| match edit {
                    RigEdit::RemoveLocalGroup(uid) => target.group(*uid).is_some(),
                    RigEdit::RemoveStoredPose(uid) => target.stored_pose(*uid).is_some(),
                    _ => true,
                });
                Ok(edits)
            }
            FitExtent::Joints => {
                let mut edits = rests_of(rig, target)?;
                edits.extend(changed_tags(rig, target));
                Ok(edits)
            }
            FitExtent::Part(part) => {
                let mut whole = rig.clone();
                let mut edits = part.put_into(&mut whole)?.edits;
                edits.extend(rests_of(&whole, target)?);
                edits.extend(changed_tags(&whole, target));
                Ok(edits)
            }
        }
    }

    fn placed(&self, rig: &Rig, modules: &Modules) -> Result<Rig, EditError> {
        let fit = &self.report.fit;
        let places =
            self.report.joints.iter().zip(&fit.joints).map(|((uid, _), joint)| (*uid, joint.position)).collect();
        fitted_rig(rig, &Fitting { places, turn: fit.turn(), floor: self.floor }, modules)
    }
}
