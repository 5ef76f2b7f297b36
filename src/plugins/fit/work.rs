//! Work of a fit in its task: the choice of a template, the fit, and the report.

use std::{sync::Arc, time::Instant};

use bevy::prelude::*;

use super::{FinishedFit, FitFailure, FitReport, FitRequest, FitTemplate, FitTemplates, FittedRig};
use crate::{
    algo::fit_template::{
        FitNote, FitSettings, FittedSkeleton, MeshAnalysis, TemplateJoint, choose_template, fit_template,
    },
    plugins::surface::RigMesh,
    processor::Modules,
    rig::{NodeKind, Rig, Uid, label::label_side, nearest::did_you_mean},
};

/// Distance from the plane of symmetry, as a share of the body's height, up to which a joint is on it.
const CENTRE: f32 = 0.003;

/// Work of a fit: plain data for a task.
pub(super) struct Work {
    pub(super) from: Arc<Rig>,
    pub(super) mesh: RigMesh,
    pub(super) request: FitRequest,
    pub(super) modules: Arc<Modules>,
    pub(super) templates: FitTemplates,
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
    /// Rigs whose joints may be fitted.
    fn candidates(&self) -> Result<Vec<Arc<Rig>>, FitFailure> {
        if self.from.walk().any(|joint| joint.data.kind == NodeKind::Joint) {
            return Ok(vec![self.from.clone()]);
        }
        if !self.from.is_empty() {
            return Err(FitFailure::NoTemplate);
        }
        match &self.request.template {
            FitTemplate::Rig(template) => Ok(vec![template.clone()]),
            FitTemplate::Choose => Ok((self.templates.0)()),
            FitTemplate::Named(name) => {
                let known = (self.templates.0)();
                let nearest = || did_you_mean(name, known.iter().map(|rig| rig.about().name.clone()));
                let found = known.iter().find(|rig| rig.about().name == *name).cloned();
                let found = found.ok_or_else(|| FitFailure::NoName { name: name.clone(), nearest: nearest() })?;
                Ok(vec![found])
            }
        }
    }

    pub(super) fn run(self, progress: &(dyn Fn(f32) -> bool + Sync)) -> Result<FinishedFit, FitFailure> {
        let begin = Instant::now();
        let candidates = self.candidates()?;
        let Self { from: _, mesh, request, modules, .. } = self;
        let (region, gear) = region(&mesh, &request.objects);
        let points = &mesh.rest.points;
        let analysis = MeshAnalysis::new(points, &mesh.triangles, region.as_deref(), &|part| progress(0.5 * part))?;
        let skeletons: Vec<_> = candidates.iter().map(|rig| skeleton(rig)).collect();
        let joints: Vec<Vec<TemplateJoint>> =
            skeletons.iter().map(|(_, labels, parents, places)| template_joints(labels, parents, places)).collect();
        let (chosen, choice) = match joints.len() {
            0 => return Err(FitFailure::NoTemplate),
            1 => (0, String::new()),
            _ => {
                let named: Vec<(&str, &[TemplateJoint])> = candidates
                    .iter()
                    .zip(&joints)
                    .map(|(rig, joints)| (rig.about().name.as_str(), &joints[..]))
                    .collect();
                let ranked = choose_template(&analysis, &named)?;
                let best = ranked.first().ok_or(FitFailure::NoTemplate)?;
                (best.index, best.to_string())
            }
        };
        let (uids, labels, ..) = &skeletons[chosen];
        let template = candidates[chosen].clone();
        let name = template.about().name.clone();
        let marker = |(label, place): &(String, Vec3)| match labels.iter().position(|known| known == label) {
            Some(joint) => Ok((joint, *place)),
            None => {
                let nearest = did_you_mean(label, labels.iter());
                Err(FitFailure::NoJoint { template: name.clone(), label: label.clone(), nearest })
            }
        };
        let markers = request.markers.iter().map(marker).collect::<Result<Vec<_>, _>>()?;
        let settings = FitSettings {
            up: request.up,
            forward: request.forward,
            symmetry: request.symmetry,
            markers: markers.clone(),
            ..FitSettings::default()
        };
        let mut fit = fit_template(&analysis, &joints[chosen], &settings, &|part| progress(0.5 + 0.5 * part))?;
        centre(&mut fit, labels, &markers);
        fit.notes.extend((gear > 0).then_some(FitNote::Gear(gear)));
        let floor = points.iter().filter(|p| p.is_finite()).map(|p| p.dot(fit.up)).fold(f32::INFINITY, f32::min);
        let report = FitReport {
            template: name,
            choice,
            joints: uids.iter().copied().zip(labels.iter().cloned()).collect(),
            fit,
            time: begin.elapsed(),
        };
        let report = Arc::new(report);
        let fitted = FittedRig {
            first: report.clone(),
            places: report.fit.joints.iter().map(|joint| Some(joint.position)).collect(),
            report,
            markers: markers.iter().map(|(joint, place)| (uids[*joint], *place)).collect(),
            analysis: Arc::new(analysis),
            settings,
            template,
            floor,
            before: None,
        };
        let target = fitted.target(&modules)?;
        Ok(FinishedFit { fitted, target })
    }
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

/// Numbers of the triangles of some objects; `None` for all. Without a choice, gear that hangs on a bone is left out, and
/// counted.
fn region(mesh: &RigMesh, objects: &[usize]) -> (Option<Vec<u32>>, usize) {
    if !objects.is_empty() {
        return (Some(mesh.rest.triangles_of(|object| objects.contains(&object))), 0);
    }
    // The model at rest has no skins any more.
    let gear = mesh.file.gear();
    match gear.len() {
        0 => (None, 0),
        count => (Some(mesh.rest.triangles_of(|object| !gear.contains(&object))), count),
    }
}
