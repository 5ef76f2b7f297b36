//! Weights of hair on the lower face: moustaches, beards and their strands, which ride along with the skin under them.

use glam::Vec3;

use super::{
    Face, Row,
    sides::{Rim, Sides},
};

/// Largest distance of a strand's root from the skin, in distances of the eyes' outer corners.
const ROOT: f32 = 0.05;
/// Largest distance from the skin at which a vertex follows the skin below it; further off it follows the root.
const NEAR: f32 = 0.1;
/// Largest extent of hair on the face. Scarves and collars are larger.
const LONGEST: f32 = 1.5;
/// Number of vertices of a shell, at least, that are compared with the skin.
const SAMPLES: usize = 48;

/// Returns `true` for a shell most of which lies on the skin or in front of it; teeth lie behind the lips.
///
/// Linear in the vertices of the face.
pub(crate) fn is_on_skin(face: &Face, members: &[usize]) -> bool {
    let e = face.map.scale;
    let (low, high) = bounds(face, members);
    let reach = Vec3::new(0.1 * e, 0.1 * e, f32::INFINITY);
    let skin = skin_within(face, low - reach, high + reach);
    let (mut on, mut all) = (0, 0);
    for &v in members.iter().step_by((members.len() / SAMPLES).max(1)) {
        let place = face.places[v];
        let aside = |at: &Vec3| at.truncate().distance_squared(place.truncate());
        let below = skin.iter().map(|&s| face.places[s]).min_by(|a, b| aside(a).total_cmp(&aside(b)));
        on += usize::from(below.is_some_and(|skin| place.z > skin.z - 0.01 * e));
        all += 1;
    }
    2 * on > all
}

/// Fills the rows of a shell that stands on the skin below the eyes with the weights of that skin; returns `false` for a
/// shell of another kind.
pub(crate) fn rows(face: &Face, sides: &Sides, members: &[usize], rows: &mut [Row]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let e = face.map.scale;
    let (low, high) = bounds(face, members);
    let middle = 0.5 * (low + high);
    let (half, _) = face.map.fold(middle);
    if high.y > half.eye().y || (high - low).max_element() > LONGEST * e {
        return false;
    }
    // A moustache does not follow the lower lip, nor what grows below the upper one.
    let lips = half.lip_corner().y;
    let is_around = low.y < lips - 0.1 * e && high.y > lips + 0.1 * e;
    let other = if middle.y > lips { Rim::Lower } else { Rim::Upper };
    let margin = Vec3::splat(NEAR * e);
    let mut skin = skin_within(face, low - margin, high + margin);
    skin.retain(|&s| is_around || sides.lip(s) != other);
    let nearest = |v: usize| {
        let place = face.places[v];
        let distances = skin.iter().map(|&s| (face.places[s].distance_squared(place), s));
        distances.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    };
    let found: Vec<Option<(f32, usize)>> = members.iter().map(|&v| nearest(v)).collect();
    let root = found.iter().flatten().copied().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let within = |distance: f32| move |(square, _): &(f32, usize)| *square <= distance * distance;
    let Some((_, root)) = root.filter(within(ROOT * e)) else { return false };
    for (&v, found) in members.iter().zip(found) {
        let skin = found.filter(within(NEAR * e)).map_or(root, |(_, skin)| skin);
        rows[v] = rows[skin].clone();
    }
    true
}

fn bounds(face: &Face, members: &[usize]) -> (Vec3, Vec3) {
    let places = members.iter().map(|&v| face.places[v]);
    places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)))
}

/// Visible skin of the face in a box, without the walls of a mouth that is open.
fn skin_within(face: &Face, low: Vec3, high: Vec3) -> Vec<usize> {
    let is_wall = |place: Vec3| {
        let (half, p) = face.map.fold(place);
        let (corner, e) = (half.lip_corner(), face.map.scale);
        p.x < 1.1 * corner.x && (p.y - corner.y).abs() < 0.3 * e && p.z < corner.z - 0.03 * e
    };
    let is_within = |&v: &usize| {
        let place = face.places[v];
        face.mask[v] && place.cmpge(low).all() && place.cmple(high).all() && !is_wall(place)
    };
    (0..face.places.len()).filter(is_within).collect()
}
