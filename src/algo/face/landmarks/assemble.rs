//! Assembly of the 68 landmarks: the mean face is bent until it passes through the measured features, and laid onto the
//! skin.

use bevy::math::ops;
use glam::{Vec2, Vec3, vec2, vec3};

use super::{
    eyes::EyeOpening,
    mirrored, mouth,
    prior::mean_landmarks,
    profile::{Curve, Profile},
    relief::Relief,
    search::{EyeHint, Pose, fit_height},
};

/// Measurements of one head.
pub(super) struct Measurements {
    /// Normalised places of the landmarks (u, v), and the depth of the mean face there.
    pub places: [Vec3; 68],
    /// Point half way between the eyes, in head space.
    pub center: Vec2,
    /// The eye distance.
    pub size: f32,
    /// Heights along the profile.
    pub profile: Profile,
    /// Marks that both eye openings were found.
    pub eyes: bool,
    /// Marks that the lips' line and both its ends were found.
    pub lips: bool,
}

/// Offset of the eye corner at the nose beyond and below the visible opening, as shares of the opening's width: the
/// opening narrows to a cleft there.
const CLEFT: Vec2 = vec2(0.12, 0.07);

/// Share of the deviation of a face's height from the mean, in logarithms, that is an error of its width, where lids are closed.
const UNUSUAL: f32 = 0.67;

/// Least quality of the match with the mean relief from which closed lids and open jaws are told from other shapes.
const HUMAN: f32 = 0.8;

/// Distances of an eye's inner corner from the middle, in eye distances of the mean relief. Closed lids bulge, with hollows
/// beside the nose and at the temples.
const INNER_CORNER: (f32, f32) = (0.14, 0.3);

/// Gaps between the lips, in eye distances, at which an open jaw begins to show and is certain. Lips that pout are apart, too.
const OPEN_JAW: (f32, f32) = (0.16, 0.3);

/// The corners of an eye from its opening: (outer, inner), in head space.
fn corners(eye: &EyeOpening) -> (Vec2, Vec2) {
    let along = eye.inner - eye.outer;
    let inner = eye.inner + vec2(along.x * CLEFT.x, -along.length() * CLEFT.y);
    (eye.outer - vec2(along.x * 0.015, 0.0), inner)
}

/// Returns `true` for lids that are closed: nothing but dents is seen, before eyeballs or where no eye can be.
fn are_closed(eyes: &[Option<EyeOpening>; 2], eyeballs: Option<EyeHint>, pose: &Pose) -> bool {
    if pose.worth < HUMAN || eyes.iter().flatten().any(|eye| !eye.is_dent) {
        return false;
    }
    let is_hollow = |eye: &EyeOpening| {
        let inner = (corners(eye).1.x - pose.center.x).abs() / pose.size;
        !(INNER_CORNER.0..=INNER_CORNER.1).contains(&inner)
    };
    eyeballs.is_some() || (eyes.iter().all(Option::is_some) && eyes.iter().flatten().any(is_hollow))
}

/// Openings of the eyes, if they were found and mirror each other closely.
fn symmetric_openings(eyes: &[Option<EyeOpening>; 2], pose: &Pose) -> Option<[EyeOpening; 2]> {
    let [Some(right), Some(left)] = eyes else { return None };
    let flip = |place: Vec2| vec2(2.0 * pose.center.x - place.x, place.y);
    let far = 0.09 * pose.size;
    let near = right.outer.distance(flip(left.outer)) < far && right.inner.distance(flip(left.inner)) < far;
    near.then(|| [right.clone(), left.clone()])
}

/// Bends the mean face through the features of the fine map. With `even`, both sides are made the same.
pub(super) fn measure(
    relief_map: &crate::algo::face::depth_map::DepthMap,
    pose: &Pose,
    eyes: &[Option<EyeOpening>; 2],
    eyeballs: Option<EyeHint>,
    even: bool,
) -> Measurements {
    let closed = are_closed(eyes, eyeballs, pose);
    let eyes = if closed { None } else { symmetric_openings(eyes, pose) };
    let (mut center, mut size) = (pose.center, pose.size);
    if let Some([right, left]) = &eyes {
        let ((a, b), (c, d)) = (corners(right), corners(left));
        size = a.distance(c);
        center = vec2(pose.center.x, (a.y + b.y + c.y + d.y) / 4.0);
    }
    if closed {
        // The relief tells heights well, but the width of a face only by its cheeks. Eyeballs behind closed lids tell both.
        size = eyeballs.map_or(size * ops::powf(pose.tall, UNUSUAL), |eyeballs| eyeballs.size);
        center.y = eyeballs.map_or(center.y, |eyeballs| eyeballs.center.y);
    }
    let mut tall = pose.tall * pose.size / size;
    if eyes.is_some() {
        tall = fit_height(relief_map, &Pose { center, size, tall, ..*pose });
    }
    let relief = Relief { map: relief_map, center, size };
    let profile = Curve::read(&relief).features(tall);
    let mean = mean_landmarks();
    let mut places = mean;
    // Brows rise with the upper face, which differs less than the lower.
    let upper = 0.5 + 0.5 * tall.clamp(0.7, 1.3);
    for place in &mut places[17..27] {
        place.y *= upper;
    }
    let tip = profile.tip + 0.08 * (profile.nasion - profile.tip);
    // A jaw that is open takes the chin down with the lower lip.
    let gap = profile.upper_edge - profile.lower_edge;
    let open = if pose.worth < HUMAN { 0.0 } else { (gap - OPEN_JAW.0) / (OPEN_JAW.1 - OPEN_JAW.0) };
    let usual = profile.subnasale - 0.745 * tall - gap * open.clamp(0.0, 1.0);
    let chin = 0.6 * profile.menton + 0.4 * usual;
    let stretch = chin / mean[8].y;
    for place in &mut places[0..17] {
        let part = (place.y / mean[8].y).clamp(0.0, 1.0);
        place.y *= 1.0 + (stretch - 1.0) * part;
    }
    places[27].y = profile.nasion;
    places[28].y = profile.nasion + (tip - profile.nasion) * 0.33;
    places[29].y = profile.nasion + (tip - profile.nasion) * 0.64;
    places[30].y = tip;
    for place in &mut places[31..36] {
        place.y += profile.subnasale - mean[33].y;
    }
    if let Some(eyes) = &eyes {
        for (eye, side) in eyes.iter().zip([0usize, 1]) {
            set_eye(&mut places, eye, side, center, size);
        }
    }
    let line = (profile.upper_edge + profile.lower_edge) / 2.0;
    let ends = [-1.0, 1.0].map(|side| {
        mouth::lip_corner(&relief, side, line, tall)
            .filter(|end| (0.16..0.45).contains(&end.0) && (end.1 - line).abs() < 0.12)
    });
    set_mouth(&mut places, &mean, &profile, ends, chin);
    if even {
        for index in 0..68 {
            let other = mirrored(index);
            if other > index {
                let (a, b) = (places[index], places[other]);
                let half = vec3((a.x - b.x) / 2.0, (a.y + b.y) / 2.0, (a.z + b.z) / 2.0);
                places[index] = half;
                places[other] = vec3(-half.x, half.y, half.z);
            } else if other == index {
                places[index].x = 0.0;
            }
        }
    }
    let lips = ends.iter().all(Option::is_some) && profile.slit > 0.008;
    Measurements { places, center, size, profile, eyes: eyes.is_some(), lips }
}

fn set_eye(places: &mut [Vec3; 68], eye: &EyeOpening, side: usize, center: Vec2, size: f32) {
    // Order: outer corner, upper lid from there, inner corner, lower lid back.
    let order: [usize; 6] = if side == 0 { [36, 37, 38, 39, 40, 41] } else { [45, 44, 43, 42, 47, 46] };
    let (outer, inner) = corners(eye);
    let along = |part: f32| eye.outer.x + (eye.inner.x - eye.outer.x) * part;
    let found = [
        outer,
        vec2(along(0.24), eye.lid(0.24).1),
        vec2(along(0.715), eye.lid(0.715).1),
        inner,
        vec2(along(0.735), eye.lid(0.735).0),
        vec2(along(0.248), eye.lid(0.248).0),
    ];
    for (index, place) in order.into_iter().zip(found) {
        let place = (place - center) / size;
        places[index] = place.extend(places[index].z);
    }
}

fn set_mouth(places: &mut [Vec3; 68], mean: &[Vec3; 68], profile: &Profile, ends: [Option<(f32, f32)>; 2], chin: f32) {
    let line = (profile.upper_edge + profile.lower_edge) / 2.0;
    let top = profile.subnasale + (profile.upper_edge - profile.subnasale) * 0.615;
    let low = 0.5 * (profile.lower_lip - 0.037) + 0.5 * (profile.lower_edge + 0.227 * (chin - profile.lower_edge));
    let (mean_line, mean_top, mean_low) = (-0.768, mean[51].y, mean[57].y);
    let usual = |end: Option<(f32, f32)>| end.unwrap_or((-mean[48].x, line + mean[48].y - mean_line));
    let other = |own: Option<(f32, f32)>, other: Option<(f32, f32)>| usual(own.or(other));
    let own = [other(ends[0], ends[1]), other(ends[1], ends[0])];
    // Mouths are nearly symmetric; half of the difference of the two ends is noise.
    let half = |a: f32, b: f32| 0.75 * a + 0.25 * b;
    let sides = [0, 1].map(|i| (half(own[i].0, own[1 - i].0), half(own[i].1, own[1 - i].1)));
    for index in 48..68 {
        let place = mean[index];
        let (reach, height) = if place.x <= 0.0 { sides[0] } else { sides[1] };
        let part = place.x / mean[54].x;
        let bend = part * part;
        let base = mean_line + (mean[48].y - mean_line) * bend;
        let above = place.y - base;
        let scale =
            if above > 0.0 { (top - line) / (mean_top - mean_line) } else { (low - line) / (mean_low - mean_line) };
        let gap = match index {
            61..=63 => (profile.upper_edge - line) * (1.0 - bend) + 0.006,
            65..=67 => (profile.lower_edge - line) * (1.0 - bend) - 0.006,
            _ => above * scale,
        };
        places[index].x = part * reach;
        places[index].y = line + (height - line) * bend + gap;
    }
}
