//! Bends: elbows and knees that bend the way the template's do.
//!
//! The centre line of a straight or stout limb bends anywhere by a little, and a joint that is off its true place by a share
//! of the limb's thickness bends a short limb by a lot. The way a limb can bend is known from the template, relative to the
//! body's front; what the mesh shows counts against it where it is clear.

use glam::{Quat, Vec3};

use super::limbs::{Limb, LimbKind, TemplateLimbs};

/// Distance of a joint from the line between its neighbours, as a share of their distance, above which the template bends.
const BENT: f32 = 0.004;
/// Cosine of the bend of a body's limb above which it is unclear: 25 degrees.
const CLEAR: f32 = 0.906;
/// Share of the limb's radius that a joint may be off the middle of the limb unseen.
const HIDDEN: f32 = 0.5;
/// Largest part of an unclear bend across the template's, as a factor of the part along it.
const ASIDE: f32 = 0.6;
/// Factor for a clear bend of a leg, whose knee turns with the hip.
const TURNED: f32 = 2.5;
/// Bend that is left to a joint that is bent the wrong way, as a share of the distance of its neighbours.
const STRAIGHT: f32 = 0.01;
/// Part of a knee's wrong bend for which its hip moves.
const HIP: f32 = 0.5;
/// Height above the lowest joint, as a share of the template's size, below which a leg's joint is a foot.
const STANDING: f32 = 0.1;
/// Number of chains that a hand has at least.
const FINGERS: usize = 3;

/// Moves the hinges of arms and legs to where the limb bends the way the template does. `turn` leads from the template's axes
/// to the body's; joints in `fixed` and their neighbours stay; `radius` is a limb's about a place.
pub(super) fn follow_template(
    template: &TemplateLimbs,
    turn: Quat,
    fixed: impl Fn(usize) -> bool,
    radius: impl Fn(usize, Vec3) -> f32,
    places: &mut [Vec3],
) {
    for (number, limb) in template.limbs.iter().enumerate() {
        // Hinges nearer to the trunk have the last word: they swing the longer bones.
        for joints in hinges(template, limb).rev() {
            let [before, here, after] = [joints[0], joints[1], joints[2]];
            if joints.iter().any(|joint| fixed(*joint)) {
                continue;
            }
            let around = [before, here, after].map(|joint| places[joint]);
            let rest = [before, here, after].map(|joint| template.positions[joint]);
            let Some(place) = bent(limb, rest, around, turn, radius(number, places[here])) else { continue };
            if limb.kind == LimbKind::Leg && before == limb.joints[0] && template.is_upright() {
                // The flesh of the trunk hides the hip, and the knee is where it shows: the hip takes a half.
                let share = 1.0 - (here_share(around)).clamp(0.2, 0.8);
                places[before] += (places[here] - place) * HIP / share;
            }
            let around = [before, here, after].map(|joint| places[joint]);
            if let Some(place) = bent(limb, rest, around, turn, radius(number, places[here])) {
                places[here] = place;
            }
        }
    }
}

/// Hinges of a limb with the joints before and after each: not the shoulder, which turns in all ways, nor the hand, nor a foot
/// that stands.
fn hinges<'a>(template: &TemplateLimbs, limb: &'a Limb) -> impl DoubleEndedIterator<Item = &'a [usize]> {
    let low = template.positions.iter().map(|place| place.y).fold(f32::INFINITY, f32::min);
    let is_end = |joint: usize| match limb.kind {
        LimbKind::Arm => template.parents.iter().filter(|parent| **parent == Some(joint)).count() >= FINGERS,
        LimbKind::Leg => template.positions[joint].y - low < STANDING * template.size,
        _ => true,
    };
    let ball = template.ball_joint(limb).unwrap_or(0).min(limb.joints.len());
    let end =
        limb.joints.iter().skip(ball).position(|joint| is_end(*joint)).map_or(limb.joints.len(), |at| ball + at + 1);
    limb.joints[ball..end].windows(3)
}

/// The place of a joint between two others at which it bends as the template does; `None` where it does or the mesh shows
/// that it does not.
fn bent(limb: &Limb, rest: [Vec3; 3], [from, here, to]: [Vec3; 3], turn: Quat, radius: f32) -> Option<Vec3> {
    let (was, _) = out_of_line(rest);
    let chord = to - from;
    if was.length() < BENT * rest[0].distance(rest[2]) {
        return None;
    }
    let (was_chord, is_chord) = ((turn * (rest[2] - rest[0])).try_normalize()?, chord.try_normalize()?);
    let way = (Quat::from_rotation_arc(was_chord, is_chord) * turn * was).try_normalize()?;
    let (out, foot) = out_of_line([from, here, to]);
    let along = out.dot(way);
    let across = out - way * along;
    let cosine = (here - from).normalize_or_zero().dot((to - here).normalize_or_zero());
    let is_clear = cosine < CLEAR && out.length() > HIDDEN * radius;
    let aside = match (is_clear, limb.kind) {
        // An arm turns in its shoulder in all ways.
        (true, LimbKind::Arm) => return None,
        (true, _) if along > 0.0 => TURNED,
        _ => ASIDE,
    };
    if along > 0.0 && across.length() <= aside * along {
        return None;
    }
    let along = along.max(STRAIGHT * chord.length());
    Some(foot + way * along + across.clamp_length_max(aside * along))
}

/// Share of the way between two places at which the one between them is.
fn here_share([from, here, to]: [Vec3; 3]) -> f32 {
    let chord = to - from;
    (here - from).dot(chord) / chord.length_squared().max(1e-12)
}

/// The way from the line between the first and the last place to the one between them, and where it begins.
fn out_of_line([from, here, to]: [Vec3; 3]) -> (Vec3, Vec3) {
    let chord = to - from;
    let foot = from + chord * ((here - from).dot(chord) / chord.length_squared().max(1e-12));
    (here - foot, foot)
}
