//! Weights of hair on the lower face: moustaches, beards and their strands, which ride along with the skin under them.

use glam::Vec3;

use super::{
    Face, Row,
    sides::{Rim, Sides},
    skin_columns::SkinColumns,
};

/// Largest distance of a strand's root from the skin, in distances of the eyes' outer corners.
const ROOT: f32 = 0.05;
/// Largest distance from the skin at which a vertex follows the skin below it; further off it follows the root.
const NEAR: f32 = 0.1;
/// Largest extent of hair on the face. Scarves and collars are larger.
const LONGEST: f32 = 1.5;
/// Number of vertices of a shell, at least, that are compared with the skin.
const SAMPLES: usize = 48;

/// Visible skin of a face, without the walls of a mouth that is open.
pub(crate) fn outer_skin<'a>(face: &'a Face) -> SkinColumns<'a> {
    let is_wall = |place: Vec3| {
        let (half, p) = face.map.fold(place);
        let (corner, e) = (half.lip_corner(), face.map.scale);
        p.x < 1.1 * corner.x && (p.y - corner.y).abs() < 0.3 * e && p.z < corner.z - 0.03 * e
    };
    SkinColumns::new(face, |v| face.map.trusted && !is_wall(face.places[v]))
}

/// Returns `true` for a shell most of which lies on the skin or in front of it; teeth lie behind the lips.
///
/// Linear in the vertices of the shell's surroundings.
pub(crate) fn is_on_skin(face: &Face, skin: &SkinColumns, members: &[usize]) -> bool {
    let e = face.map.scale;
    let (low, high) = bounds(face, members);
    let reach = Vec3::new(0.1 * e, 0.1 * e, f32::INFINITY);
    let skin: Vec<usize> = skin.within(low - reach, high + reach).collect();
    let (mut on, mut all) = (0, 0);
    for &v in members.iter().step_by((members.len() / SAMPLES).max(1)) {
        let place = face.places[v];
        let aside = |at: &Vec3| at.truncate().distance_squared(place.truncate());
        let below = skin.iter().map(|&s| (aside(&face.places[s]), s));
        let below = below.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        on += usize::from(below.is_some_and(|(_, skin)| place.z > face.places[skin].z - 0.01 * e));
        all += 1;
    }
    2 * on > all
}

/// Fills the rows of a shell that stands on the skin below the eyes with the weights of that skin; returns `false` for a
/// shell of another kind.
pub(crate) fn rows(face: &Face, sides: &Sides, skin: &SkinColumns, members: &[usize], rows: &mut [Row]) -> bool {
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
    // Skin that is further off than the margin decides nothing.
    let nearest = |v: usize| {
        let place = face.places[v];
        let skin = skin.within(place - margin, place + margin).filter(|&s| is_around || sides.lip(s) != other);
        let distances = skin.map(|s| (face.places[s].distance_squared(place), s));
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
