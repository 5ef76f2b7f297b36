//! Landmarks: the 68 points of the Multi-PIE scheme, found on a head mesh.
//!
//! The search uses the shape alone, whatever the topology, in three steps. A coarse depth map and the mean relief of a
//! face give the position and size of the face (`search`). Features are measured on a fine depth map: the eye openings
//! (`eyes`), nose, lips and chin along the profile (`profile`), and the ends of the lips (`mouth`). The mean face is
//! bent through them (`assemble`) and laid onto the skin (`surface`). Features that cannot be measured, such as brows
//! without hair or the eyes of a creature, keep their place on the mean face.

mod assemble;
mod eyes;
mod mouth;
mod prior;
mod profile;
mod relief;
mod search;
mod surface;
mod turn;

use bevy::math::ops;
use glam::{Quat, Vec3, vec2, vec3};

use self::{assemble::Measurements, relief::Relief, search::EyeHint};
use super::{
    depth_map::{DepthFrame, DepthMap, NO_TRIANGLE},
    shells::{ShellKind, Shells},
};

/// The 68 landmarks of a face, in head space.
#[derive(Debug, Clone, PartialEq)]
pub struct Landmarks {
    /// Positions in Multi-PIE order, on the skin.
    pub points: [Vec3; 68],
    /// Position of the plane of symmetry on the x axis.
    pub middle: f32,
    /// Marks a head that is the same on both sides.
    pub symmetric: bool,
    /// Confidence of the search, 0 to 1.
    pub confidence: f32,
    /// Marks a mesh whose lips are apart (a border or a slit between them), so that the mouth can open.
    pub mouth_open: bool,
}

impl Landmarks {
    /// The distance of the outer corners of the eyes.
    pub fn eye_distance(&self) -> f32 {
        self.points[36].distance(self.points[45])
    }

    /// The mean of the two corners of an eye: the character's left or right one.
    pub fn eye_center(&self, left: bool) -> Vec3 {
        let (a, b) = if left { (42, 45) } else { (36, 39) };
        (self.points[a] + self.points[b]) / 2.0
    }

    /// The lower edge of the chin.
    pub fn chin(&self) -> Vec3 {
        self.points[8]
    }
}

/// Error of the search for landmarks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LandmarkError {
    /// No points or triangles.
    #[error("the mesh has no skin triangles to find a face on; give a head mesh")]
    Empty,
    /// A coordinate that is not finite.
    #[error("point {point} is not finite; repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// No depth, no width or no height.
    #[error("the mesh is flat, a head has depth; check the axes and the mesh")]
    Flat,
    /// No part of the mesh that looks like a front.
    #[error("no face was found looking along -z; check which axis is forward, and that the mesh is a head")]
    NoFront,
}

/// Index of the mirrored landmark.
pub const fn mirrored(index: usize) -> usize {
    match index {
        0..=16 => 16 - index,
        17..=26 => 43 - index,
        31..=35 => 66 - index,
        36..=39 | 42..=45 => 81 - index,
        40 | 41 | 46 | 47 => 87 - index,
        48..=54 => 102 - index,
        55..=59 => 114 - index,
        60..=64 => 124 - index,
        65..=67 => 132 - index,
        _ => index,
    }
}

/// Finds the landmarks of a head.
///
/// `points` in head space (x to the character's left, y up, z to the front) in any unit and at any place; `shells`
/// tells skin and eyeballs apart. A head that is turned aside by up to 30 degrees or tilted is searched again from its
/// own front; on a head that nods by more than 10 degrees or has its mouth wide open errors grow. Every mesh with a
/// front gets landmarks; on anything but a human face their [`confidence`](Landmarks::confidence) is low.
///
/// Takes about 5 ms at 11,000 points and 15 ms at 45,000 for a head that is exactly symmetric, twice that for another,
/// and up to twelve times that where no face is clear at first.
///
/// # Errors
/// [`LandmarkError`] for a point that is not finite, no skin, skin without depth, and where nothing can be laid onto
/// the front.
pub fn find_landmarks(points: &[Vec3], triangles: &[[u32; 3]], shells: &Shells) -> Result<Landmarks, LandmarkError> {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (index, point) in points.iter().enumerate() {
        if !point.is_finite() {
            return Err(LandmarkError::NotFinite { point: index });
        }
        if shells.kind(index) == ShellKind::Skin {
            low = low.min(*point);
            high = high.max(*point);
        }
    }
    let size = high - low;
    if triangles.is_empty() || size.max_element() <= 0.0 {
        return Err(LandmarkError::Empty);
    }
    if size.min_element() < 1e-3 * size.max_element() {
        return Err(LandmarkError::Flat);
    }
    if let Some(middle) = search::exact_mirror(points, low, high) {
        return look(points, triangles, shells, Some(middle)).map(|(found, _)| found);
    }
    let attempt = |rotation: Quat| {
        let turned: Vec<Vec3> = points.iter().map(|&point| rotation * point).collect();
        look(&turned, triangles, shells, None).map(|(found, normal)| (found, normal, rotation))
    };
    let mut best = look(points, triangles, shells, None).map(|(found, normal)| (found, normal, Quat::IDENTITY));
    let sure = |found: &Result<Sighting, LandmarkError>| found.as_ref().map_or(-1.0, |found| found.0.confidence);
    let about = |axis: Vec3, degrees: f32| {
        let half = degrees.to_radians() / 2.0;
        Quat::from_vec4((axis * ops::sin(half)).extend(ops::cos(half)))
    };
    if sure(&best) < CLEAR {
        // The face may be turned aside. A mesh that is hardly a face from any side is taken in its given orientation.
        for degrees in [-14.0f32, 14.0, -28.0, 28.0] {
            let next = attempt(about(Vec3::Y, degrees));
            if sure(&next) > sure(&best).max(0.2) + 0.1 {
                best = next;
            }
        }
    }
    // A face that is turned aside is searched again from its own front, as long as the result is no less clear.
    let from_front = |(mut found, mut normal, mut rotation): Sighting| {
        for _ in 0..2 {
            if normal.x > LEAST_TURN {
                break;
            }
            match attempt(Quat::from_rotation_arc(normal, Vec3::X) * rotation) {
                Ok(next) if next.0.confidence >= found.confidence => (found, normal, rotation) = next,
                _ => break,
            }
        }
        (found, normal, rotation)
    };
    best = best.map(from_front);
    // Tilted views count only if they show a face.
    let tilts = [(0.0f32, -14.0f32), (0.0, 14.0), (-14.0, 14.0), (14.0, -14.0), (14.0, 14.0), (-14.0, -14.0)];
    for (turn, tilt) in tilts {
        if sure(&best) >= CLEAR {
            break;
        }
        let next = attempt(about(Vec3::Y, turn) * about(Vec3::Z, tilt));
        if sure(&next) >= CLEAR {
            best = next.map(from_front);
        }
    }
    let (mut found, _, rotation) = best?;
    if rotation != Quat::IDENTITY {
        let back = rotation.inverse();
        found.points = found.points.map(|point| back * point);
        found.middle = (found.points[27].x + found.points[33].x) / 2.0;
    }
    Ok(found)
}

/// Landmarks in a turned space, the normal of the plane of symmetry there, and the rotation into the space.
type Sighting = (Landmarks, Vec3, Quat);

/// Cosine of the largest turn of a face that is not searched again: 2 degrees.
const LEAST_TURN: f32 = 0.9994;

/// Confidence from which landmarks are those of a face.
pub(in crate::algo::face) const CLEAR: f32 = 0.5;

/// Confidence of landmarks where nothing looks like a face.
const GUESSED: f32 = 0.05;

/// Finds the landmarks of a face that looks along z, and the normal of its plane of symmetry. `exact` is the position
/// of that plane if the points mirror onto each other.
fn look(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shells: &Shells,
    exact: Option<f32>,
) -> Result<(Landmarks, Vec3), LandmarkError> {
    let kind = |triangle: usize| {
        let corner = triangles.get(triangle).map_or(u32::MAX, |corners| corners[0]);
        shells.kind(corner as usize)
    };
    let own = points.iter().enumerate().filter(|&(index, _)| shells.kind(index) == ShellKind::Skin);
    let (low, high) = own.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), (_, p)| (low.min(*p), high.max(*p)));
    let size = high - low;
    let coarse = DepthFrame::over(low.truncate(), high.truncate(), size.truncate().max_element() / 191.0, 192);
    let (coarse, solid) = front(coarse, points, triangles, |t| kind(t) != ShellKind::Inside);
    let hint = eye_hint(points, shells);
    let middles = match (exact, hint) {
        (Some(middle), _) => vec![middle],
        (None, Some(hint)) => vec![hint.center.x],
        (None, None) => {
            let (center, width, step) = ((low.x + high.x) / 2.0, size.x, coarse.frame.pixel * 2.0);
            let span = (center - 0.2 * width, center + 0.2 * width);
            search::mirror_axes(&coarse, span, step, 0.3 * width, (low.y, high.y), 0.1 * width, 3)
        }
    };
    let find = |hint| {
        let poses = middles.iter().filter_map(|&middle| search::find_face(&coarse, &solid, middle, hint));
        poses.max_by(|a, b| a.worth.total_cmp(&b.worth))
    };
    let with_hint = find(hint);
    // Eyeballs that no face fits are none.
    let eyeballs = hint.filter(|_| with_hint.is_some());
    let seen = with_hint.or_else(|| find(None));
    // If nothing looks like a face, the mean face of a person in the size of the front is used.
    let guessed = seen.is_none();
    let mut pose = seen.unwrap_or_else(|| search::guess(exact.unwrap_or((low.x + high.x) / 2.0), low, high));
    let (fine, _) = front(relief::close_up(&pose), points, triangles, |t| kind(t) != ShellKind::Inside);
    if exact.is_none() {
        let (x, y, d) = (pose.center.x, pose.center.y, pose.size);
        let rows = (y - 1.0 * d * pose.tall, y + 0.35 * d);
        let axes = search::mirror_axes(&fine, (x - 0.06 * d, x + 0.06 * d), 0.01 * d, 0.45 * d, rows, 0.06 * d, 1);
        pose.center.x = axes.first().copied().unwrap_or(x);
    }
    let normal = if exact.is_none() { turn::plane(&fine, &pose) } else { Vec3::X };
    let middle = pose.center.x;
    let eyeball = |t: u32| matches!(kind(t as usize), ShellKind::LeftEye | ShellKind::RightEye);
    let eyes = [-1.0, 1.0].map(|side| eyes::find_opening(&fine, &pose, side, eyeball));
    let measured = assemble::measure(&fine, &pose, &eyes, eyeballs, exact.is_some());
    let has_eyeballs = shells.kinds.iter().any(|kind| matches!(kind, ShellKind::LeftEye | ShellKind::RightEye));
    let skin = has_eyeballs.then(|| front(fine.frame, points, triangles, |t| kind(t) == ShellKind::Skin).0);
    let found = lay(
        &measured,
        skin.as_ref().unwrap_or(&fine),
        points,
        triangles,
        |point| shells.kind(point) == ShellKind::Skin,
        exact,
    );
    let mouth_open = opens(&measured, points, triangles, |t| kind(t) == ShellKind::Skin);
    let sure = |yes: bool| if yes { 0.2 } else { 0.0 };
    let nose = measured.profile.nose > 0.08;
    let confidence =
        0.6 * ((pose.worth - 0.4) / 0.5).clamp(0.0, 1.0) + sure(measured.eyes) + sure(measured.lips && nose);
    let confidence = if guessed { GUESSED } else { confidence };
    if !found.iter().all(|point| point.is_finite()) {
        return Err(LandmarkError::NoFront);
    }
    Ok((Landmarks { points: found, middle, symmetric: exact.is_some(), confidence, mouth_open }, normal))
}

/// Position and size of the face from eyeballs that are loose parts: their centres lie 0.7 outer corner distances
/// apart.
fn eye_hint(points: &[Vec3], shells: &Shells) -> Option<EyeHint> {
    let center = |wanted: ShellKind| {
        let own = points.iter().enumerate().filter(|&(index, _)| shells.kind(index) == wanted);
        let (low, high) =
            own.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), (_, p)| (low.min(*p), high.max(*p)));
        (low.x <= high.x).then(|| ((low + high) / 2.0).truncate())
    };
    let (left, right) = (center(ShellKind::LeftEye)?, center(ShellKind::RightEye)?);
    Some(EyeHint { center: (left + right) / 2.0, size: (left.x - right.x).abs() / 0.7 })
}

/// Lays the normalised places onto the skin: places visible in the front view by their depth there, the others at the
/// closest place of the skin.
fn lay(
    measured: &Measurements,
    skin: &DepthMap,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    is_skin: impl Fn(usize) -> bool,
    exact: Option<f32>,
) -> [Vec3; 68] {
    let relief = Relief { map: skin, center: measured.center, size: measured.size };
    let places = &measured.places;
    // Offset of the mean face's depths on this head: the median over places that the front view shows well.
    let mut offsets: Vec<f32> = [19, 21, 22, 24, 27, 31, 33, 35, 51, 57]
        .iter()
        .filter_map(|&i: &usize| places.get(i).and_then(|p| relief.at(p.x, p.y).map(|depth| depth - p.z)))
        .collect();
    offsets.sort_by(f32::total_cmp);
    let offset = offsets.get(offsets.len() / 2).copied().unwrap_or_default();
    let mut snapped = Vec::new();
    let mut laid: [Vec3; 68] = std::array::from_fn(|index| {
        let place = places[index];
        let seen = match index {
            0..=6 | 10..=16 => None,
            // Away from the rim, where there certainly is skin.
            37 | 38 | 43 | 44 => relief.at(place.x, place.y + 0.012),
            40 | 41 | 46 | 47 => relief.at(place.x, place.y - 0.012),
            61..=63 => relief.at(place.x, place.y + 0.004).map(|depth| depth - 0.03),
            65..=67 => relief.at(place.x, place.y - 0.004).map(|depth| depth - 0.02),
            _ => relief.at(place.x, place.y),
        };
        let seen = seen.filter(|depth| (depth - offset - place.z).abs() < 0.35);
        let front = matches!(index, 7..=9 | 17..=35 | 48..=60 | 64);
        // On a head that is the same on both sides, one side is enough.
        if !(front && seen.is_some()) && (exact.is_none() || index <= mirrored(index)) {
            snapped.push(index);
        }
        relief.place(place.x, place.y, seen.unwrap_or(place.z + offset))
    });
    let targets: Vec<Vec3> = snapped.iter().map(|&index| laid[index]).collect();
    let closest = surface::snap(&targets, points, triangles, is_skin);
    for (index, point) in snapped.into_iter().zip(closest) {
        laid[index] = point;
    }
    // Between closed lips the closest skin can be the other lip's: then the visible depth is used.
    for (upper, lower) in [(61, 67), (62, 66), (63, 65)] {
        if laid[upper].y < laid[lower].y {
            for index in [upper, lower] {
                let place = places[index];
                laid[index] = relief.place(place.x, place.y, relief.at(place.x, place.y).unwrap_or(place.z + offset));
            }
        }
    }
    if let Some(middle) = exact {
        for index in 0..68 {
            let (point, other) = (laid[index], mirrored(index));
            if other >= index {
                laid[other] = vec3(2.0 * middle - point.x, point.y, point.z);
            }
            if other == index {
                laid[index].x = middle;
            }
        }
    }
    laid
}

/// Returns `true` if there is a cavity close behind the lips, or no skin between them.
fn opens(measured: &Measurements, points: &[Vec3], triangles: &[[u32; 3]], skin: impl Fn(usize) -> bool) -> bool {
    let line = (measured.profile.upper_edge + measured.profile.lower_edge) / 2.0;
    let looks = [(0.02, 0.05), (-0.04, 0.05), (0.02, -0.05), (-0.04, -0.05), (0.05, 0.03)];
    let behind = looks.iter().filter(|&&(u, v)| {
        let place = measured.center + vec2(u, line + v) * measured.size;
        let depths = surface::depths_at(place, points, triangles, &skin);
        depths
            .first()
            .is_some_and(|first| depths.iter().any(|depth| (0.005..0.45).contains(&((first - depth) / measured.size))))
    });
    behind.count() >= 2 || measured.profile.upper_edge - measured.profile.lower_edge > 0.015
}

/// Depth map of the triangles that face the viewer, without the far wall seen through a hole, and the mask of covered
/// pixels.
fn front(
    frame: DepthFrame,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    keep: impl Fn(usize) -> bool,
) -> (DepthMap, Vec<bool>) {
    let mut map = DepthMap::draw(frame, points, triangles, keep);
    let facing: Vec<i8> = map
        .triangle
        .iter()
        .map(|&triangle| {
            let Some(corners) = triangles.get(triangle as usize).filter(|_| triangle != NO_TRIANGLE) else { return 0 };
            let [Some(a), Some(b), Some(c)] = corners.map(|corner| points.get(corner as usize)) else { return 0 };
            if (*b - *a).truncate().perp_dot((*c - *a).truncate()) >= 0.0 { 1 } else { -1 }
        })
        .collect();
    // A mesh with reversed winding shows its back faces throughout.
    let most = if facing.iter().map(|&side| i64::from(side)).sum::<i64>() >= 0 { 1 } else { -1 };
    let solid = map.triangle.iter().map(|&triangle| triangle != NO_TRIANGLE).collect();
    for ((depth, triangle), side) in map.depth.iter_mut().zip(&mut map.triangle).zip(facing) {
        if side == -most {
            *depth = f32::NEG_INFINITY;
            *triangle = NO_TRIANGLE;
        }
    }
    (map, solid)
}
