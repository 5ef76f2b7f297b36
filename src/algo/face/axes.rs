//! Axes: the view direction of a head and the direction of its crown.
//!
//! Width is the direction across the plane that mirrors the head best. Up and forward are then one of four pairs of
//! directions, chosen by the shape: faces are rough, with eyes, nose and mouth, where the back of a head and its crown
//! are smooth; an open mesh ends at the neck; and eyeballs lie in front.

use glam::{Mat3, Quat, Vec3};
use thiserror::Error;

use super::{
    head_part::{Body, snout},
    sections::border,
    shells::{ShellKind, find_shells},
};

mod mirror;

/// Orientation of a head in the space of its mesh: unit vectors at right angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadAxes {
    /// Direction towards the crown.
    pub up: Vec3,
    /// View direction of the face.
    pub forward: Vec3,
}

impl HeadAxes {
    /// The rotation from the mesh's space to head space (+x the character's left, +y up, +z forward).
    pub fn rotation(&self) -> Quat {
        let left = self.up.cross(self.forward);
        if (self.up, self.forward) == (Vec3::Y, Vec3::Z) {
            return Quat::IDENTITY;
        }
        Quat::from_mat3(&Mat3::from_cols(left, self.up, self.forward).transpose()).normalize()
    }
}

/// Guessed axes, and whether the shape supports them clearly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesGuess {
    /// The axes.
    pub axes: HeadAxes,
    /// Certainty: `false` if a person should confirm the axes.
    pub certain: bool,
}

/// Error of guessing axes.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum AxesError {
    /// No points or triangles.
    #[error("the mesh has no points or no triangles; pick a mesh with a surface")]
    Empty,
    /// A coordinate that is not finite.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// A given direction without length.
    #[error("the given direction of up or forward has no length; name an axis such as +y")]
    NoDirection,
    /// Up and forward directions along one line.
    #[error("up and forward are along one line; they have to be at right angles, such as +y and +z")]
    Parallel,
}

/// Guesses the orientation of a head among the 24 orientations along the axes of its space, and respects given
/// directions.
///
/// `points` are in the mesh's space and any unit. A given `up` is kept; a given `forward` is made to be at right angles
/// to `up`, or kept where only it is given. For a shape without features, +y is up and +z forward, and the guess is not
/// certain.
///
/// # Errors
/// [`AxesError`]: no points or triangles, coordinates that are not finite, directions without length or along one line.
/// Linear time, a few milliseconds for 10,000 points.
pub fn guess_axes(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    up: Option<Vec3>,
    forward: Option<Vec3>,
) -> Result<AxesGuess, AxesError> {
    if points.is_empty() || triangles.is_empty() {
        return Err(AxesError::Empty);
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(AxesError::NotFinite { point });
    }
    let unit = |given: Option<Vec3>| match given {
        Some(given) => given.try_normalize().map(Some).ok_or(AxesError::NoDirection),
        None => Ok(None),
    };
    let (up, forward) = (unit(up)?, unit(forward)?);
    if let (Some(up), Some(forward)) = (up, forward) {
        let forward = forward.reject_from(up);
        if forward.length() < 1e-3 {
            return Err(AxesError::Parallel);
        }
        return Ok(AxesGuess { axes: HeadAxes { up, forward: forward.normalize() }, certain: true });
    }
    let Ranking { frame, turned, evidence, scored } = Ranking::new(points, triangles, up, forward);
    let (best, u, f) = scored.first().copied().unwrap_or((0.0, Vec3::Y, Vec3::Z));
    let margin = best - scored.get(1).map_or(f32::MIN, |next| next.0);
    let certain = evidence.symmetric && margin >= CLEAR;
    // A weak lead is not enough against the usual orientation of files, nor against the carriage of a quadruped's head.
    let (u, f) = if certain {
        (u, f)
    } else if forward.is_none()
        && let Some(forward) = quadruped_forward(&turned, triangles, &evidence)
    {
        (Vec3::Y, forward)
    } else {
        scored.iter().map(|way| (way.1, way.2)).fold((u, f), usual)
    };
    let axes = in_mesh(frame, (up, forward), (u, f));
    Ok(AxesGuess { axes, certain })
}

/// Orientations along the axes of the mesh's space other than `guess`, the most likely first, at most `most`. Given
/// directions are respected; none are left where both are given.
pub(super) fn other_axes(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    given: (Option<Vec3>, Option<Vec3>),
    guess: &HeadAxes,
    most: usize,
) -> Vec<HeadAxes> {
    let (up, forward) = (given.0.and_then(Vec3::try_normalize), given.1.and_then(Vec3::try_normalize));
    if up.is_some() && forward.is_some() {
        return Vec::new();
    }
    let Ranking { frame, scored, .. } = Ranking::new(points, triangles, up, forward);
    let all = scored.into_iter().map(|(_, u, f)| in_mesh(frame, (up, forward), (u, f)));
    let is_other = |axes: &HeadAxes| axes.up.dot(guess.up) < 0.9 || axes.forward.dot(guess.forward) < 0.9;
    all.filter(is_other).take(most).collect()
}

/// Axes in the mesh's space from those in a search `frame`; given directions are kept as they are.
fn in_mesh(frame: Quat, (up, forward): (Option<Vec3>, Option<Vec3>), (u, f): (Vec3, Vec3)) -> HeadAxes {
    let back = frame.inverse();
    HeadAxes { up: up.unwrap_or(back * u), forward: forward.unwrap_or(back * f) }
}

/// Possible orientations of a head in the order of their scores.
struct Ranking {
    /// Rotation from the mesh's space to the frame of the search, in which a given direction is an axis.
    frame: Quat,
    /// Points in that frame.
    turned: Vec<Vec3>,
    evidence: Evidence,
    /// Score, up and forward in that frame, the best first.
    scored: Vec<(f32, Vec3, Vec3)>,
}

impl Ranking {
    /// Ranks the orientations that respect a given direction of unit length.
    fn new(points: &[Vec3], triangles: &[[u32; 3]], up: Option<Vec3>, forward: Option<Vec3>) -> Self {
        let frame = match (up, forward) {
            (Some(up), _) => Quat::from_rotation_arc(up, Vec3::Y),
            (_, Some(forward)) => Quat::from_rotation_arc(forward, Vec3::Z),
            _ => Quat::IDENTITY,
        };
        let turned: Vec<Vec3> = points.iter().map(|point| frame * *point).collect();
        let evidence = Evidence::new(&turned, triangles);
        let possible =
            ways().filter(|(u, f)| up.is_none_or(|_| *u == Vec3::Y) && forward.is_none_or(|_| *f == Vec3::Z));
        let mut scored: Vec<(f32, Vec3, Vec3)> = possible.map(|(u, f)| (evidence.score(u, f), u, f)).collect();
        // The usual orientation comes first and wins ties, since sorting is stable.
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self { frame, turned, evidence, scored }
    }
}

/// The usual orientation, if it is among those possible.
fn usual(best: (Vec3, Vec3), way: (Vec3, Vec3)) -> (Vec3, Vec3) {
    if way == (Vec3::Y, Vec3::Z) { way } else { best }
}

/// View direction of a quadruped with +y up; `None` if the mesh is not one.
fn quadruped_forward(points: &[Vec3], triangles: &[[u32; 3]], evidence: &Evidence) -> Option<Vec3> {
    // The length runs along x only if x is clearly not the width.
    let along = if evidence.skew.x > 2.0 * evidence.skew.z + 0.05 { Vec3::X } else { Vec3::Z };
    let turned: Vec<Vec3> = match along == Vec3::X {
        true => points.iter().map(|point| Vec3::new(-point.z, point.y, point.x)).collect(),
        false => points.to_vec(),
    };
    let higher = snout::carriage(&Body::new(&turned, triangles))?;
    let says = higher + ROUGH * evidence.rough.dot(along);
    Some(if says < -FACES { -along } else { along })
}

/// Factor of the roughness beside the carriage of a quadruped's head.
const ROUGH: f32 = 1.0;
/// Least score for the unusual view direction of a quadruped.
const FACES: f32 = 0.05;

/// Lead in score from which a guess is certain.
const CLEAR: f32 = 0.25;

/// The 24 orientations as up and forward, the usual one first.
fn ways() -> impl Iterator<Item = (Vec3, Vec3)> {
    const AXES: [Vec3; 6] = [Vec3::Y, Vec3::Z, Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::NEG_X];
    const FORWARD: [Vec3; 6] = [Vec3::Z, Vec3::Y, Vec3::X, Vec3::NEG_Z, Vec3::NEG_Y, Vec3::NEG_X];
    AXES.into_iter().flat_map(|up| FORWARD.into_iter().filter(move |f| f.dot(up) == 0.0).map(move |f| (up, f)))
}

/// Evidence of the shape for directions.
struct Evidence {
    /// Asymmetry along each axis: 0 for a perfect mirror, 1 for none.
    skew: Vec3,
    symmetric: bool,
    /// Direction from the open end to the middle, which points to the crown. Length up to 1.
    crown: Vec3,
    /// Direction from the middle to the rough part of the surface.
    rough: Vec3,
    /// Direction from the middle to the eyes.
    eyes: Option<Vec3>,
    /// Third moment along each axis by extent: noses and snouts reach far.
    reach: Vec3,
}

impl Evidence {
    fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
        let half = ((high - low) * 0.5).max(Vec3::splat(f32::MIN_POSITIVE));
        let size = half.max_element();
        let (mut surface, mut area) = (Vec3::ZERO, 0.0_f32);
        let mut cloud = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let [Some(a), Some(b), Some(c)] = triangle.map(|corner| points.get(corner as usize).copied()) else {
                continue;
            };
            let (weight, at) = ((b - a).cross(c - a).length(), (a + b + c) / 3.0);
            surface += at * weight;
            area += weight;
            cloud.push(at);
        }
        let center = surface / area.max(f32::MIN_POSITIVE);
        let skew = mirror::skew(points, triangles, (low + high) * 0.5, size);
        // Modellers and scanners put small triangles at details.
        let dense = cloud.iter().copied().sum::<Vec3>() / cloud.len().max(1) as f32;
        let reach =
            Vec3::from_array([0, 1, 2].map(|axis| ((low[axis] + high[axis]) * 0.5 - center[axis]) / half[axis]));
        let end = border::largest(points, triangles).filter(|end| (end.high - end.low).max_element() > 0.3 * size);
        let crown = end.map_or(Vec3::ZERO, |end| (center - end.center) / size);
        let shells = find_shells(points, triangles);
        let mut balls = [(Vec3::ZERO, 0_u32); 2];
        for (point, place) in points.iter().enumerate() {
            let ball = match shells.kind(point) {
                ShellKind::LeftEye => &mut balls[0],
                ShellKind::RightEye => &mut balls[1],
                _ => continue,
            };
            *ball = (ball.0 + *place, ball.1 + 1);
        }
        let eyes = (balls[0].1 > 0 && balls[1].1 > 0).then(|| {
            let middle = (balls[0].0 / balls[0].1 as f32 + balls[1].0 / balls[1].1 as f32) * 0.5;
            (middle - center) / size
        });
        let symmetric = skew.min_element() < 0.35 && {
            let mut sorted = skew.to_array();
            sorted.sort_by(f32::total_cmp);
            sorted[1] - sorted[0] > 0.05
        };
        Self { skew, symmetric, crown, rough: (dense - center) / size, eyes, reach }
    }

    /// Score of an orientation; higher is better.
    fn score(&self, up: Vec3, forward: Vec3) -> f32 {
        let width = up.cross(forward).abs();
        let mut score = -4.0 * self.skew.dot(width);
        score += 1.0 * self.crown.dot(up);
        score += 3.0 * self.rough.dot(forward) - 0.5 * self.rough.dot(up).abs();
        score += 0.3 * self.reach.dot(forward);
        if let Some(eyes) = self.eyes {
            score += 2.0 * eyes.dot(forward) + 0.5 * eyes.dot(up);
        }
        score
    }
}
