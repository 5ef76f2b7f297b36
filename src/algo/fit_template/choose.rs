//! Choice of a template: the one whose limbs the mesh shows.

use std::fmt;

use glam::Vec3;

use super::{
    FitError, MeshAnalysis, TemplateJoint,
    assign::{self, Hypothesis},
    limbs::{LimbKind, TemplateLimbs, limbs},
};

/// Penalty of a template for a mesh, with the limbs that it is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateChoice {
    /// Index into the templates given.
    pub index: usize,
    /// Penalty; smaller is better.
    pub cost: f32,
    /// Limbs of each kind that the template has, and that the mesh shows.
    pub limbs: Vec<(LimbKind, usize, usize)>,
    /// Branches of the mesh that no limb took.
    pub unused: usize,
}

impl fmt::Display for TemplateChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for (i, (kind, wanted, found)) in self.limbs.iter().enumerate() {
            let (before, plural) = (if i > 0 { ", " } else { "" }, if *wanted == 1 { "" } else { "s" });
            write!(f, "{before}{found} of {wanted} {kind}{plural}")?;
        }
        if self.unused > 0 {
            write!(f, ", {} {} unused", self.unused, if self.unused == 1 { "branch" } else { "branches" })?;
        }
        Ok(())
    }
}

/// Weight of what remains of the alignment: figures may be posed, but a lying trunk is no standing one.
const REST: f32 = 2.0;

/// Penalty of a template without sides, whose chains fit much.
const ANY_SHAPE: f32 = 0.2;

/// Penalty of an up direction that is not the file's second axis, which most formats have for it.
const LYING: f32 = 0.12;
/// Penalty of a template with wings: figures that hold their arms out are far more frequent than birds.
const WINGED: f32 = 0.1;

/// A penalty that can be compared between templates with and without sides; `up` is the file's second axis.
fn comparable(best: &Hypothesis, template: &TemplateLimbs, up: Vec3) -> f32 {
    let lying = (1.0 - up.dot(best.alignment.rotation * Vec3::Y)).clamp(0.0, 1.0);
    let is_free = template.limbs.iter().all(|limb| limb.kind == LimbKind::Free);
    let is_winged = template.limbs.iter().any(|limb| limb.kind == LimbKind::Wing);
    let shape = if is_free { ANY_SHAPE } else { 0.0 } + if is_winged { WINGED } else { 0.0 };
    best.posed_cost() + (REST - assign::POSED) * best.rest + LYING * lying + shape
}

/// Ranks templates for a mesh, best first. Templates that cannot be fitted at all are left out.
///
/// # Errors
/// [`FitError::TooFewLimbs`] or another error of the last template if none can be fitted.
pub fn choose_template(
    analysis: &MeshAnalysis,
    templates: &[(&str, &[TemplateJoint])],
) -> Result<Vec<TemplateChoice>, FitError> {
    let up = analysis.mesh.space.direction_to_unit(Vec3::Y);
    let mut choices = Vec::new();
    let mut problem = FitError::NoChain;
    for (index, (_, joints)) in templates.iter().enumerate() {
        let Some(template) = limbs(joints).filter(|t| !t.limbs.is_empty()) else { continue };
        let hypotheses = match analysis.hypotheses(&template, &Default::default(), &[]) {
            Ok(hypotheses) => hypotheses,
            Err(error) => {
                problem = error;
                continue;
            }
        };
        let best = &hypotheses[0];
        let mut kinds: Vec<LimbKind> = template.limbs.iter().map(|l| l.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let of_kind = |kind: LimbKind| {
            let with_leaves = template.limbs.iter().zip(&best.leaves).filter(|(l, _)| l.kind == kind);
            with_leaves.fold((kind, 0, 0), |(k, wanted, found), (_, leaf)| {
                (k, wanted + 1, found + usize::from(leaf.is_some()))
            })
        };
        let shown = best.leaves.iter().filter(|l| l.is_some()).count();
        choices.push(TemplateChoice {
            index,
            cost: comparable(best, &template, up),
            limbs: kinds.into_iter().map(of_kind).collect(),
            unused: analysis.trees[best.tree].branches.leaves.len() - shown,
        });
    }
    choices.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.index.cmp(&b.index)));
    if choices.is_empty() { Err(problem) } else { Ok(choices) }
}
