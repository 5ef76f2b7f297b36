//! Evidence: what the mesh shows of single joints, whatever the proportions of the rest of the figure are.

use std::ops::RangeInclusive;

use bevy::math::ops;
use glam::Vec3;

use crate::algo::fit_template::{
    align::Stretch,
    assign::Hypothesis,
    limbs::{Limb, LimbKind, TemplateLimbs},
    place::Placement,
    report::FitReason,
};

/// Share of the larger of two angles that the other one has at least where mesh and template bend alike.
const ALIKE: f32 = 0.75;
/// Least angle of the template at a hip, and at a hinge of an animal's leg, from which on it tells anything: 10 and 25 degrees.
const TURNED: f32 = 0.17;
const BENT: f32 = 0.44;
/// Length of the bone below the chest against the template's below which the spine is crushed.
const CRUSHED: f32 = 0.6;

/// Length of a bird's thigh against that of its shank where both lie in a trunk that is the right one, below a hock in its place;
/// femurs of birds are shorter than their tibiotarsi, and mostly longer than half of them. A longer thigh is that of a bird which
/// crouches, or whose legs are low: flesh covers the hock, too, and the one that is found lies above it.
const THIGH: RangeInclusive<f32> = 0.5..=0.65;
/// Likeness of the angle between pelvis and thigh to the template's below which a hip that the trunk hides is not where it should
/// be: the thigh then leads straight on from the pelvis.
const LED: f32 = 0.5;

/// Evidence for the joints of a placement, by joint.
pub(super) struct Evidence {
    /// True for joints that the mesh shows by themselves.
    pub(super) is_shown: Vec<bool>,
    /// True for joints that share out a length: nothing on the mesh tells where one bone ends and the next one begins.
    pub(super) is_shared_out: Vec<bool>,
    /// Factor of the confidence in each joint, less than one for what hangs on a chest that lies too low.
    pub(super) carried: Vec<f32>,
}

impl Evidence {
    /// Gathers the evidence for joints at `places`, by the assignment `best`.
    pub(super) fn of(template: &TemplateLimbs, placement: &Placement, best: &Hypothesis, places: &[Vec3]) -> Self {
        let stretch = Stretch::fit(&best.pairs, &best.alignment);
        let bends = Bends { template, places, stretch };
        let mut is_shown = vec![false; places.len()];
        let mut is_shared_out = vec![false; places.len()];
        for limb in &template.limbs {
            let shares_out = has_shared_length(template, limb);
            for (at, &joint) in limb.joints.iter().enumerate() {
                is_shown[joint] = bends.is_shown(limb, at, placement.reasons[joint]);
                is_shared_out[joint] = shares_out;
            }
        }
        // The tail of a bird begins where it leaves the trunk, on the plane of symmetry.
        let tails = template.limbs.iter().filter(|limb| limb.kind == LimbKind::Tail && template.has_hidden_knees());
        for first in tails.map(|limb| limb.joints[0]) {
            is_shown[first] = placement.reasons[first] == FitReason::CentreLine;
        }
        for limb in template.limbs.iter().filter(|limb| template.has_hidden_knee(limb)) {
            let [hip, knee, hock, foot, ..] = *limb.joints.as_slice() else { continue };
            let share = places[hip].distance(places[knee]) / places[knee].distance(places[hock]).max(1e-9);
            // A hock that bends stands over its foot, whatever flesh hides above it.
            is_shown[foot] |= is_shown[hock];
            is_shown[hock] &= share <= *THIGH.end();
            let has_thigh = is_shown[hock] && THIGH.contains(&share) && bends.likeness(limb, 0, TURNED) >= LED;
            [hip, knee].into_iter().for_each(|joint| is_shown[joint] |= has_thigh);
        }
        Self { is_shown, is_shared_out, carried: carried(template, best.alignment.scale, places) }
    }
}

/// True for the tail of an animal and the neck of a bird: their many bones bend evenly, and their lengths vary most.
fn has_shared_length(template: &TemplateLimbs, limb: &Limb) -> bool {
    match limb.kind {
        LimbKind::Tail => !template.is_upright(),
        LimbKind::Head => !template.is_upright() && !template.is_on_fours(),
        _ => false,
    }
}

/// Factors for arms, head and chest of an upright figure. The chest lies between the shoulders: arms that grow together with
/// the trunk leave it too low, and take the chest and all that it carries down with them.
fn carried(template: &TemplateLimbs, scale: f32, places: &[Vec3]) -> Vec<f32> {
    let mut factors = vec![1.0; places.len()];
    let [.., below, chest] = *template.trunk.as_slice() else { return factors };
    if !template.is_upright() {
        return factors;
    }
    let rest = template.positions[below].distance(template.positions[chest]) * scale;
    let share = (places[below].distance(places[chest]) / (CRUSHED * rest).max(1e-9)).min(1.0);
    let upper = template.limbs.iter().filter(|limb| matches!(limb.kind, LimbKind::Arm | LimbKind::Head));
    for &joint in upper.flat_map(|limb| &limb.joints).chain([&chest]) {
        factors[joint] = share;
    }
    factors
}

/// Bends of a placement beside those of its template.
struct Bends<'a> {
    template: &'a TemplateLimbs,
    places: &'a [Vec3],
    stretch: Stretch,
}

impl Bends<'_> {
    /// True for a joint of a limb that the mesh shows by itself.
    ///
    /// In upright figures a shoulder lies where its arm leaves the trunk, by the arm's thickness, and elbows, wrists and knees
    /// lie on centre lines where these bend or end. A hip is hidden: the angle of the leg to the pelvis tells if it is in its
    /// place, and the knee below depends on it. Ankles and toes go by lengths, and a big head has no neck. In animals flesh
    /// hides elbows and knees: a hinge is shown where the leg bends on its centre line by as much as the template does.
    fn is_shown(&self, limb: &Limb, at: usize, reason: FitReason) -> bool {
        let (is_on_line, is_placed) = (reason == FitReason::CentreLine, reason == FitReason::Proportion);
        let ball = self.template.ball_joint(limb).unwrap_or(0);
        match (limb.kind, self.template.is_upright()) {
            (LimbKind::Arm, true) => is_on_line && at >= ball || is_placed && at == ball,
            (LimbKind::Leg, true) => {
                let has_place = is_on_line && at <= ball + 1 || is_placed && at == ball;
                has_place && self.bends_alike(limb, ball, TURNED)
            }
            (LimbKind::Leg, false) => is_on_line && self.bends_alike(limb, at, BENT),
            _ => false,
        }
    }

    /// True if a limb of a template that bends by `least` radians or more at one of the limb's joints bends so in the mesh.
    fn bends_alike(&self, limb: &Limb, at: usize, least: f32) -> bool {
        self.likeness(limb, at, least) >= ALIKE
    }

    /// Share of the larger of the angles of template and mesh, at one of a limb's joints, that the other one has; zero where the
    /// template bends by less than `least` radians.
    fn likeness(&self, limb: &Limb, at: usize, least: f32) -> f32 {
        let (Some(&joint), Some(&after)) = (limb.joints.get(at), limb.joints.get(at + 1)) else { return 0.0 };
        let Some(before) = self.template.parents[joint] else { return 0.0 };
        let angle = |place: &dyn Fn(usize) -> Vec3| {
            let [from, here, to] = [before, joint, after].map(place);
            let cosine = (here - from).normalize_or_zero().dot((to - here).normalize_or_zero());
            ops::acos(cosine.clamp(-1.0, 1.0))
        };
        let mesh = angle(&|joint| self.places[joint]);
        let rest = angle(&|joint| self.stretch.apply(self.template.positions[joint]));
        if rest >= least { mesh.min(rest) / mesh.max(rest) } else { 0.0 }
    }
}
