//! Choice of a template: the one whose limbs the mesh shows.

use std::fmt;

use glam::Vec3;

use super::{
    FitError, FitSettings, MeshAnalysis, TemplateJoint,
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
    /// Difference to the penalty of the next template; infinite without another.
    pub margin: f32,
    /// Limbs of each kind that the template has, and that the mesh shows.
    pub limbs: Vec<(LimbKind, usize, usize)>,
    /// Branches of the mesh that no limb took.
    pub unused: usize,
}

impl TemplateChoice {
    /// Factor of the confidence in a fit of this template: less than one if another template is nearly as like.
    pub fn certainty(&self) -> f32 {
        LEAST_CERTAINTY + (1.0 - LEAST_CERTAINTY) * (self.margin / CERTAIN).clamp(0.0, 1.0)
    }
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

/// Share of the limbs' mean direction that is across the trunk, from which on and up to which a figure stands on all fours.
const ON_FOURS: (f32, f32) = (0.3, 0.7);
/// Share of a limb's free length from its end at which it is still outside of the trunk.
const ROOT: f32 = 0.75;
/// Misfit of trunk and limbs from which on the file's axes are not asked.
const MISFIT: f32 = 0.5;

/// Margin of a choice from which on it is certain, and the factor of the confidence that is left without one.
const CERTAIN: f32 = 0.05;
const LEAST_CERTAINTY: f32 = 0.7;

/// A penalty that can be compared between templates with and without sides, without a word about up.
fn comparable(found: &Hypothesis, template: &TemplateLimbs) -> f32 {
    let is_free = template.limbs.iter().all(|limb| limb.kind == LimbKind::Free);
    let is_winged = template.limbs.iter().any(|limb| limb.kind == LimbKind::Wing);
    let shape = if is_free { ANY_SHAPE } else { 0.0 } + if is_winged { WINGED } else { 0.0 };
    found.posed_cost() + (REST - assign::POSED) * found.rest + shape
}

fn up_of(found: &Hypothesis) -> Vec3 {
    found.alignment.rotation * Vec3::Y
}

/// Deviation of the lie of the mesh's trunk from the template's, 0 to 1, whichever way the file is turned: limbs of an
/// animal on all fours are across its trunk, those of an upright figure along it. `None` without two pairs of them.
fn misfit(analysis: &MeshAnalysis, found: &Hypothesis, template: &TemplateLimbs) -> Option<f32> {
    let lines = &analysis.trees[found.tree].lines;
    // Sums of the roots of hind limbs and of fore limbs, with their counts, and of all limbs' directions.
    let mut roots = [(Vec3::ZERO, 0.0f32); 2];
    let mut ways = Vec3::ZERO;
    for (limb, leaf) in template.limbs.iter().zip(&found.leaves) {
        let Some(leaf) = leaf.filter(|_| matches!(limb.kind, LimbKind::Arm | LimbKind::Leg)) else { continue };
        let (root, end) = (lines[leaf].at(lines[leaf].free * ROOT), lines[leaf].at(0.0));
        let fore = usize::from(template.trunk.first() != Some(&limb.attach));
        roots[fore].0 += root;
        roots[fore].1 += 1.0;
        ways += (end - root).normalize_or_zero();
    }
    let [(hind, hind_count), (fore, fore_count)] = roots;
    if hind_count < 2.0 || fore_count < 2.0 {
        return None;
    }
    let trunk = (fore / fore_count - hind / hind_count).normalize_or_zero();
    let mean = ways / (hind_count + fore_count);
    let across = (mean - trunk * mean.dot(trunk)).length();
    let on_fours = ((across - ON_FOURS.0) / (ON_FOURS.1 - ON_FOURS.0)).clamp(0.0, 1.0);
    Some(if template.is_upright() { on_fours } else { 1.0 - on_fours })
}

/// A template with the assignments of its limbs, best first.
struct Candidate {
    index: usize,
    template: TemplateLimbs,
    hypotheses: Vec<Hypothesis>,
    cost: f32,
}

impl Candidate {
    fn choice(&self, analysis: &MeshAnalysis, margin: f32) -> TemplateChoice {
        let (template, best) = (&self.template, &self.hypotheses[0]);
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
        TemplateChoice {
            index: self.index,
            cost: self.cost,
            margin,
            limbs: kinds.into_iter().map(of_kind).collect(),
            unused: analysis.trees[best.tree].branches.leaves.len() - shown,
        }
    }
}

fn rank(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.index.cmp(&b.index)));
}

/// Ranks templates for a mesh, best first. Templates that cannot be fitted at all are left out.
///
/// `settings` are the wishes for each template, in the same order: directions and markers are heeded; templates past their end
/// have none.
///
/// # Errors
/// [`FitError::TooFewLimbs`] or another error of the last template if none can be fitted.
pub fn choose_template(
    analysis: &MeshAnalysis,
    templates: &[(&str, &[TemplateJoint])],
    settings: &[FitSettings],
) -> Result<Vec<TemplateChoice>, FitError> {
    let space = &analysis.mesh.space;
    let without = FitSettings::default();
    let mut candidates = Vec::new();
    let mut problem = FitError::NoChain;
    let mut is_up_known = false;
    for (index, (_, joints)) in templates.iter().enumerate() {
        let Some(template) = limbs(joints).filter(|t| !t.limbs.is_empty()) else { continue };
        let wishes = settings.get(index).unwrap_or(&without);
        match analysis.hypotheses(&template, wishes, &analysis.markers(wishes)) {
            Ok(hypotheses) => {
                is_up_known |= wishes.up.is_some();
                let up = space.direction_to_unit(wishes.up.unwrap_or(Vec3::Y));
                let lying = (1.0 - up.dot(up_of(&hypotheses[0]))).clamp(0.0, 1.0);
                let cost = comparable(&hypotheses[0], &template) + LYING * lying;
                candidates.push(Candidate { index, template, hypotheses, cost });
            }
            Err(error) => problem = error,
        }
    }
    rank(&mut candidates);
    let is_doubtful =
        |best: &Candidate| misfit(analysis, &best.hypotheses[0], &best.template).is_some_and(|misfit| misfit > MISFIT);
    if !is_up_known && candidates.first().is_some_and(is_doubtful) {
        // An animal as a figure that sits with its arms ahead, or the other way round: the file may be turned, and each
        // template is judged by how the mesh's trunk lies to its limbs.
        let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|d| space.direction_to_unit(d));
        for candidate in &mut candidates {
            let template = &candidate.template;
            // A turn is no reason for a template that fits much.
            let unknown = if template.limbs.iter().all(|limb| limb.kind == LimbKind::Free) { 1.0 } else { 0.5 };
            let in_own_frame = |found: &Hypothesis| {
                let lying = misfit(analysis, found, template).unwrap_or(unknown);
                comparable(found, template) - assign::unusual_up(up_of(found), axes) + LYING * lying
            };
            candidate.cost = candidate.hypotheses.iter().map(in_own_frame).fold(f32::INFINITY, f32::min);
        }
        rank(&mut candidates);
    }
    let next = candidates.iter().skip(1).map(|c| c.cost).chain([f32::INFINITY]);
    let choices: Vec<TemplateChoice> =
        candidates.iter().zip(next).map(|(c, next)| c.choice(analysis, next - c.cost)).collect();
    if choices.is_empty() { Err(problem) } else { Ok(choices) }
}
