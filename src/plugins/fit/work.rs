//! Work of a fit in its task: the choice of a template, the fit, and the report.

use std::{
    collections::{BTreeMap, BTreeSet, HashSet},
    sync::Arc,
    time::Instant,
};

use bevy::prelude::*;

use super::{
    FinishedFit, FitFailure, FitPart, FitParts, FitRegion, FitReport, FitRequest, FitTemplate, FitTemplates, FittedRig,
    fitted_rig::FitExtent,
    part::{AddedPart, named_side, only, sides, with_hierarchies},
    region::middle,
};
use crate::{
    algo::fit_template::{
        FitError, FitNote, FitSettings, FittedSkeleton, MeshAnalysis, TemplateJoint, choose_template, fit_template,
    },
    plugins::surface::RigMesh,
    processor::Modules,
    rig::{NodeKind, Rig, Uid, label::label_side, nearest::did_you_mean, part::Part},
};

/// Distance from the plane of symmetry, as a share of the body's height, up to which a joint is on it.
const CENTRE: f32 = 0.003;
/// Difference of the penalties of a part's two sides below which the side is uncertain.
const SAME_SIDE: f32 = 0.03;
/// Confidence below which a mesh shows no figure, where the choice of the template is left to the fit.
const SHOWN: f32 = 0.2;
/// Confidence from which on a fit into all objects of a mesh is not tried without those beside the largest one.
const SURE: f32 = 0.7;
/// Longest side of an object, as a share of that of the whole mesh, from which on it may be a figure that wears the others.
const FIGURE: f32 = 0.6;
/// Distance of a region from the middle of the mesh, as a share of its width, from which on it lies on a side.
const ASIDE: f32 = 0.05;
/// Kind of templates that are parts.
const PART: &str = "part";

/// Work of a fit: plain data for a task.
pub(super) struct Work {
    pub(super) from: Arc<Rig>,
    pub(super) mesh: RigMesh,
    pub(super) request: FitRequest,
    pub(super) modules: Arc<Modules>,
    pub(super) templates: FitTemplates,
    pub(super) parts: FitParts,
    /// Places that a person chose for joints of the rig.
    pub(super) markers: BTreeMap<Uid, Vec3>,
}

/// Joints that may be fitted.
#[derive(Clone)]
struct Candidate {
    /// The joints as a rig of their own, before the fit.
    template: Arc<Rig>,
    extent: FitExtent,
}

impl Candidate {
    fn skeleton(template: Arc<Rig>) -> Self {
        Self { template, extent: FitExtent::Skeleton }
    }
}

/// Joints of a rig as the fit takes them, with their uids. Nulls are no part of the body.
pub(super) fn skeleton(rig: &Rig) -> (Vec<Uid>, Vec<String>, Vec<Option<usize>>, Vec<Vec3>) {
    let joints: Vec<Uid> =
        rig.walk().filter(|joint| joint.data.kind == NodeKind::Joint).map(|joint| joint.data.uid).collect();
    let label = |uid: &Uid| rig.joint(*uid).and_then(|joint| joint.data.label.clone()).unwrap_or_default();
    let parent = |uid: &Uid| rig.ancestors(*uid).find_map(|above| joints.iter().position(|j| *j == above.data.uid));
    let labels = joints.iter().map(label).collect();
    let parents = joints.iter().map(parent).collect();
    let places = joints.iter().map(|uid| rig.position(*uid)).collect();
    (joints, labels, parents, places)
}

/// Parameters of [`fit_template`] for a skeleton.
pub(super) fn template_joints<'a>(
    labels: &'a [String],
    parents: &[Option<usize>],
    places: &[Vec3],
) -> Vec<TemplateJoint<'a>> {
    let joints = labels.iter().zip(parents).zip(places);
    joints.map(|((label, parent), position)| TemplateJoint { label, parent: *parent, position: *position }).collect()
}

impl Work {
    /// Skeletons that may be fitted. Several are a choice by the limbs that the mesh shows, but for the sides of a part.
    fn candidates(&self) -> Result<Vec<Candidate>, FitFailure> {
        let from = &self.from;
        if let FitTemplate::Part { part, parent } = &self.request.template {
            return self.sides(part, *parent);
        }
        if !self.request.joints.is_empty() {
            let kept = with_hierarchies(from, &self.request.joints);
            let template = Arc::new(only(from, &kept)?);
            return match kept.is_empty() {
                true => Err(FitFailure::NoTemplate),
                false => Ok(vec![Candidate { template, extent: FitExtent::Joints }]),
            };
        }
        if from.walk().any(|joint| joint.data.kind == NodeKind::Joint) {
            return Ok(vec![Candidate::skeleton(from.clone())]);
        }
        if !from.is_empty() {
            return Err(FitFailure::NoTemplate);
        }
        match &self.request.template {
            FitTemplate::Rig(template) => Ok(vec![Candidate::skeleton(template.clone())]),
            FitTemplate::Named(name) => {
                let known = (self.templates.0)();
                match known.iter().find(|rig| rig.about().name == *name) {
                    Some(found) => Ok(vec![Candidate::skeleton(found.clone())]),
                    None => self.sides(&FitPart::Named(name.clone()), None),
                }
            }
            _ => Ok((self.templates.0)().into_iter().map(Candidate::skeleton).collect()),
        }
    }

    /// A part as it may hang on a joint: on one side, or on either of both.
    fn sides(&self, part: &FitPart, parent: Option<Uid>) -> Result<Vec<Candidate>, FitFailure> {
        let part = match part {
            FitPart::Given(part) => part.clone(),
            FitPart::Named(name) => (self.parts.0)(name).ok_or_else(|| {
                let known = (self.templates.0)();
                let nearest = did_you_mean(name, known.iter().map(|rig| rig.about().name.clone()));
                FitFailure::NoName { name: name.clone(), nearest }
            })?,
        };
        let candidate = |rig: Arc<Rig>| -> Result<Candidate, FitFailure> {
            if self.from.is_empty() {
                return Ok(Candidate::skeleton(rig));
            }
            let added = AddedPart { rig, parent };
            Ok(Candidate { template: Arc::new(added.in_rig(&self.from)?), extent: FitExtent::Part(added) })
        };
        sides(&part, &self.from, parent, &self.modules).into_iter().map(candidate).collect()
    }

    /// A part that was chosen as a skeleton of its own, on either side.
    fn either_side(&self, chosen: Candidate) -> Vec<Candidate> {
        let is_skeleton = self.from.is_empty() && matches!(chosen.extent, FitExtent::Skeleton);
        if !is_skeleton || chosen.template.about().kind != PART {
            return vec![chosen];
        }
        let part = Part::from((*chosen.template).clone());
        sides(&part, &self.from, None, &self.modules).into_iter().map(Candidate::skeleton).collect()
    }

    /// Refuses a marker of a joint that no candidate has, before any work is done for the mesh.
    fn check_markers(&self, candidates: &[Candidate]) -> Result<(), FitFailure> {
        let markers = &self.request.markers;
        if markers.is_empty() || candidates.is_empty() {
            return Ok(());
        }
        let variants = candidates.iter().flat_map(|candidate| self.either_side(candidate.clone()));
        let mut names = BTreeSet::new();
        let mut labels = BTreeSet::new();
        for variant in variants {
            let joints = variant.template.walk().filter(|joint| joint.data.kind == NodeKind::Joint);
            labels.extend(joints.map(|joint| joint.data.label.clone().unwrap_or_default()));
            names.insert(variant.template.about().name.clone());
        }
        let Some((label, _)) = markers.iter().find(|(label, _)| !labels.contains(label)) else { return Ok(()) };
        let (label, nearest) = (label.clone(), did_you_mean(label, &labels));
        match names.pop_first().filter(|_| names.is_empty()) {
            Some(template) => Err(FitFailure::NoJoint { template, label, nearest }),
            None => Err(FitFailure::NoJointOfAny { label, nearest }),
        }
    }

    pub(super) fn run(self, progress: &(dyn Fn(f32) -> bool + Sync)) -> Result<FinishedFit, FitFailure> {
        let begin = Instant::now();
        let (region, gear) = self.request.region.triangles(&self.mesh, &self.from);
        if region.as_ref().is_some_and(Vec::is_empty) {
            return Err(FitFailure::EmptyRegion);
        }
        let note = (gear > 0).then_some(FitNote::Gear(gear));
        let largest = match self.request.region {
            FitRegion::Whole => largest_object(&self.mesh),
            _ => None,
        };
        let Some((largest, others)) = largest else { return self.attempt(region, note, begin, progress) };
        let whole = self.attempt(region, note, begin, &|part| progress(0.5 * part));
        let is_sure = |fit: &FinishedFit| fit.fitted.report.fit.confidence >= SURE;
        match &whole {
            Err(FitFailure::Fit(FitError::Cancelled)) => return whole,
            Ok(fit) if is_sure(fit) => return whole,
            _ => {}
        }
        // Armour, a shield and a cloak together hide the figure that shows without them.
        let note = Some(FitNote::Beside(others));
        match self.attempt(Some(largest), note, begin, &|part| progress(0.5 + 0.5 * part)) {
            Err(FitFailure::Fit(FitError::Cancelled)) => Err(FitError::Cancelled.into()),
            Ok(fit) if is_sure(&fit) => Ok(fit),
            _ => whole,
        }
    }

    /// The fit into a region of the mesh, all of it if `None`, with a note about what is left out.
    fn attempt(
        &self,
        region: Option<Vec<u32>>,
        note: Option<FitNote>,
        begin: Instant,
        progress: &(dyn Fn(f32) -> bool + Sync),
    ) -> Result<FinishedFit, FitFailure> {
        let mut candidates = self.candidates()?;
        self.check_markers(&candidates)?;
        let points = &self.mesh.rest.points;
        let analysis =
            MeshAnalysis::new(points, &self.mesh.triangles, region.as_deref(), &|part| progress(0.5 * part))?;
        let Choice { best, words: choice, certainty } = choose(&analysis, &candidates, &self.request)?;
        // The sides of a part are all fitted: the order of its chains tells them apart, but not before.
        if let Some(best) = best {
            candidates = self.either_side(candidates.swap_remove(best));
        }
        let count = candidates.len() as f32;
        let mut found: Vec<(usize, FitSettings, FittedSkeleton)> = Vec::new();
        let mut refused: Option<FitFailure> = None;
        for (at, candidate) in candidates.iter().enumerate() {
            let share = |part: f32| progress(0.5 + 0.5 * (at as f32 + part) / count);
            match self.fitted(&analysis, &candidate.template, &share) {
                Ok((settings, fit)) => found.push((at, settings, fit)),
                Err(FitFailure::Fit(FitError::Cancelled)) => return Err(FitError::Cancelled.into()),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        let cost = |fit: &FittedSkeleton| fit.hypotheses.first().map_or(f32::INFINITY, |best| best.cost);
        found.sort_by(|a, b| cost(&a.2).total_cmp(&cost(&b.2)));
        let is_close = matches!(&found[..], [first, second, ..] if cost(&second.2) - cost(&first.2) < SAME_SIDE);
        if is_close {
            let side = self.side_of_region(region.as_deref());
            let is_of_side = |at: usize| side != 0 && named_side(&candidates[at].template) == Some(side);
            if !is_of_side(found[0].0) && is_of_side(found[1].0) {
                found.swap(0, 1);
            }
        }
        let Some((at, settings, mut fit)) = found.into_iter().next() else {
            return Err(refused.unwrap_or(FitFailure::NoTemplate));
        };
        fit.notes.extend(is_close.then_some(FitNote::UncertainSide));
        let Candidate { template, extent } = &candidates[at];
        let (uids, labels, ..) = skeleton(template);
        fit.confidence *= certainty;
        fit.notes.extend(note);
        let lowest = || points.iter().filter(|p| p.is_finite()).map(|p| p.dot(fit.up)).fold(f32::INFINITY, f32::min);
        let floor = analysis.floor(fit.up).unwrap_or_else(lowest);
        let name = match extent {
            FitExtent::Part(part) => part.rig.about().name.clone(),
            FitExtent::Skeleton | FitExtent::Joints => template.about().name.clone(),
        };
        let is_guess = self.from.is_empty() && matches!(self.request.template, FitTemplate::Choose);
        if is_guess && self.request.markers.is_empty() && fit.confidence < SHOWN {
            return Err(FitFailure::NoFigure { template: name, limbs: choice, confidence: fit.confidence });
        }
        let joints = uids.iter().copied().zip(labels).collect();
        let report = Arc::new(FitReport { template: name, choice, joints, fit, time: begin.elapsed() });
        let markers: BTreeMap<Uid, Vec3> =
            settings.markers.iter().map(|(joint, place)| (uids[*joint], *place)).collect();
        let fitted = FittedRig {
            first: report.clone(),
            begun: markers.clone(),
            places: report.fit.joints.iter().map(|joint| Some(joint.position)).collect(),
            report,
            markers,
            request: self.request.clone(),
            has_own_template: self.from.is_empty(),
            analysis: Arc::new(analysis),
            settings,
            template: template.clone(),
            extent: extent.clone(),
            floor,
            before: None,
            step: None,
            states: Vec::new(),
            applied: 0,
            replaced: None,
        };
        let target = fitted.target(&self.modules)?;
        Ok(FinishedFit { fitted, target })
    }

    /// Side of the mesh on which a region lies, in the directions of the request or of most files: 1 left, -1 right, 0 neither.
    fn side_of_region(&self, region: Option<&[u32]>) -> i32 {
        let (points, triangles) = (&self.mesh.rest.points, &self.mesh.triangles);
        let (up, forward) = (self.request.up.unwrap_or(Vec3::Y), self.request.forward.unwrap_or(Vec3::Z));
        let left = up.cross(forward).normalize_or(Vec3::X);
        let along = points.iter().filter(|point| point.is_finite()).map(|point| point.dot(left));
        let (low, high) = along.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
        let corners = region.into_iter().flatten().filter_map(|at| triangles.get(*at as usize));
        let middles = corners.filter_map(|corners| middle(points, corners)).filter(|middle| middle.is_finite());
        let (sum, count) = middles.fold((0.0f32, 0usize), |(sum, count), middle| (sum + middle.dot(left), count + 1));
        let aside = sum / count.max(1) as f32 - 0.5 * (low + high);
        match count > 0 && aside.abs() > ASIDE * (high - low) {
            true if aside > 0.0 => 1,
            true => -1,
            false => 0,
        }
    }

    /// Place of the joint that a part or chosen joints hang on.
    fn root(&self, template: &Rig) -> Option<Vec3> {
        let parent = match &self.request.template {
            FitTemplate::Part { parent, .. } if self.request.joints.is_empty() => *parent,
            _ => {
                let first = template.walk().next()?.data.uid;
                self.from.ancestors(first).map(|above| above.data.uid).find(|above| template.joint(*above).is_none())
            }
        };
        parent.filter(|parent| self.from.joint(*parent).is_some()).map(|parent| self.from.position(parent))
    }

    /// One skeleton in the mesh, with the settings that it was fitted by.
    fn fitted(
        &self,
        analysis: &MeshAnalysis,
        template: &Rig,
        progress: &(dyn Fn(f32) -> bool + Sync),
    ) -> Result<(FitSettings, FittedSkeleton), FitFailure> {
        let request = &self.request;
        let (uids, labels, parents, places) = skeleton(template);
        let joints = template_joints(&labels, &parents, &places);
        let marker = |(label, place): &(String, Vec3)| match labels.iter().position(|known| known == label) {
            Some(joint) => Ok((joint, *place)),
            None => {
                let nearest = did_you_mean(label, labels.iter());
                let template = template.about().name.clone();
                Err(FitFailure::NoJoint { template, label: label.clone(), nearest })
            }
        };
        let mut markers = request.markers.iter().map(marker).collect::<Result<Vec<_>, _>>()?;
        let is_second =
            |(at, (joint, _)): (usize, &(usize, Vec3))| markers[..at].iter().any(|(other, _)| other == joint);
        if let Some(at) = markers.iter().enumerate().position(is_second) {
            return Err(FitFailure::TwoMarkers { label: request.markers[at].0.clone() });
        }
        for (uid, place) in &self.markers {
            let joint = uids.iter().position(|known| known == uid);
            let is_given = joint.is_some_and(|joint| markers.iter().any(|(given, _)| *given == joint));
            markers.extend(joint.filter(|_| !is_given).map(|joint| (joint, *place)));
        }
        let settings = FitSettings {
            up: request.up,
            forward: request.forward,
            symmetry: request.symmetry,
            markers,
            root: self.root(template),
            ..FitSettings::default()
        };
        let mut fit = fit_template(analysis, &joints, &settings, progress)?;
        centre(&mut fit, &labels, &settings.markers);
        Ok((settings, fit))
    }
}

/// Triangles of the object of a mesh that has the most, and the number of the others; `None` where there are no others, or where
/// the object is too small for a figure that the others lie on.
fn largest_object(mesh: &RigMesh) -> Option<(Vec<u32>, usize)> {
    let others = mesh.rest.objects.len().checked_sub(1).filter(|others| *others > 0)?;
    let mut counts = vec![0_usize; others + 1];
    for part in &mesh.rest.parts {
        if let Some(count) = counts.get_mut(part.object) {
            *count += part.triangles.len();
        }
    }
    let gear: HashSet<usize> = mesh.file.gear().into_iter().collect();
    let figures = (0..=others).filter(|number| !gear.contains(number));
    // Of objects that are equally large, the first one.
    let largest = figures.reduce(|best, next| if counts[next] > counts[best] { next } else { best })?;
    let largest = mesh.rest.triangles_of(|object| object == largest);
    let extent = |corners: &mut dyn Iterator<Item = u32>| {
        let places =
            corners.filter_map(|corner| mesh.rest.points.get(corner as usize)).filter(|place| place.is_finite());
        let bounds = places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), at| (low.min(*at), high.max(*at)));
        bounds.1 - bounds.0
    };
    let own = largest.iter().filter_map(|at| mesh.triangles.get(*at as usize)).flatten();
    let (own, all) = (extent(&mut own.copied()), extent(&mut mesh.triangles.iter().flatten().copied()));
    let axis = all.max_position();
    (own[axis] >= FIGURE * all[axis]).then_some((largest, others))
}

/// Choice among candidates.
struct Choice {
    /// Number of the candidate; `None` where each has to be fitted to know.
    best: Option<usize>,
    /// Reason in words; empty without a choice.
    words: String,
    /// Factor of the confidence in the fit.
    certainty: f32,
}

impl Choice {
    fn of(best: Option<usize>) -> Self {
        Self { best, words: String::new(), certainty: 1.0 }
    }
}

/// The candidate whose limbs the mesh shows, in the directions and with the markers of the request.
fn choose(analysis: &MeshAnalysis, candidates: &[Candidate], request: &FitRequest) -> Result<Choice, FitFailure> {
    match candidates.len() {
        0 => return Err(FitFailure::NoTemplate),
        1 => return Ok(Choice::of(Some(0))),
        _ if !matches!(request.template, FitTemplate::Choose) => return Ok(Choice::of(None)),
        _ => {}
    }
    let skeletons: Vec<_> = candidates.iter().map(|candidate| skeleton(&candidate.template)).collect();
    let joints: Vec<Vec<TemplateJoint>> =
        skeletons.iter().map(|(_, labels, parents, places)| template_joints(labels, parents, places)).collect();
    let named: Vec<(&str, &[TemplateJoint])> = candidates
        .iter()
        .zip(&joints)
        .map(|(candidate, joints)| (candidate.template.about().name.as_str(), &joints[..]))
        .collect();
    let wishes = |labels: &[String]| {
        let marker = |(label, place): &(String, Vec3)| Some((labels.iter().position(|known| known == label)?, *place));
        let markers = request.markers.iter().filter_map(marker).collect();
        FitSettings { up: request.up, forward: request.forward, markers, ..FitSettings::default() }
    };
    let settings: Vec<FitSettings> = skeletons.iter().map(|(_, labels, ..)| wishes(labels)).collect();
    let ranked = choose_template(analysis, &named, &settings)?;
    // A template that has all joints of the markers goes before those that lack one.
    let has_all = |index: usize| settings[index].markers.len() == request.markers.len();
    let known = ranked.iter().find(|choice| has_all(choice.index));
    let best = known.or(ranked.first()).ok_or(FitFailure::NoTemplate)?;
    Ok(Choice { best: Some(best.index), words: best.to_string(), certainty: best.certainty() })
}

/// Puts joints of neither side that lie beside the rig's plane of symmetry by rounding of the mesh onto it, where mesh and pose
/// are symmetric about that plane: commands ask on which side of it a joint is.
pub(super) fn centre(fit: &mut FittedSkeleton, labels: &[String], markers: &[(usize, Vec3)]) {
    let tolerance = CENTRE * fit.height;
    let is_sagittal = |(point, normal): (Vec3, Vec3)| normal.x.abs() > 0.999 && point.dot(normal).abs() < tolerance;
    if !fit.symmetry.is_some_and(is_sagittal) {
        return;
    }
    for (number, (joint, label)) in fit.joints.iter_mut().zip(labels).enumerate() {
        let is_marked = markers.iter().any(|(marked, _)| *marked == number);
        if label_side(label) == 0 && joint.position.x.abs() < tolerance && !is_marked {
            joint.position.x = 0.0;
        }
    }
}
