//! Bones from shapes: positions, weights and movements of bones with which a mesh follows given shapes.
//!
//! Smooth skinning decomposition with rigid bones (Le and Deng 2012, ACM Transactions on Graphics 31, 6): weights and
//! rigid transforms are found in turn by least squares, each with the other fixed. The problem is reduced to sums over
//! the points (`moves`) and to quadratic forms in a point's position (`share`), so that a round costs little more than
//! reading the shapes once. Bones that contribute little are moved to the regions with the largest remaining error.
//!
//! Joint 0 of the weights is the head: it does not move in any shape, and takes the weight that no bone takes.

mod bone_reseed;
mod convex;
mod moves;
mod place;
mod problem;
mod rotation;
mod share;
mod start;

use glam::{Quat, Vec3};

use crate::mesh::model::Weights;
use moves::{Moments, Rigid};
use problem::Problem;
use share::{Columns, ShareSettings, share};

/// Largest number of influences of a point.
pub const MAX_INFLUENCES: usize = 8;
/// Stiffness that holds bones at rest, as a share of their own mass.
const STIFFNESS: f64 = 1e-4;
/// Weights below this are dropped at the end.
const PRUNE: f64 = 1e-3;

/// Settings of [`fit`].
#[derive(Debug, Clone, PartialEq)]
pub struct FitSettings<'a> {
    /// The number of bones, without the head.
    pub bones: usize,
    /// The largest number of joints that move a point, the head included: 1 to 8.
    pub influences: usize,
    /// Number of rounds; each finds weights and transforms in turn.
    pub rounds: usize,
    /// Strength of the pull of a point's weights towards its neighbours': 0 none, 1 visible.
    pub smoothing: f32,
    /// First positions of bones, in the space of the points; bones beyond these are placed freely. Bones keep their
    /// order.
    pub start: &'a [Vec3],
    /// Marks entries of `start` that must stay; missing entries may move.
    pub locked: &'a [bool],
}

impl Default for FitSettings<'_> {
    fn default() -> Self {
        Self { bones: 40, influences: MAX_INFLUENCES, rounds: 30, smoothing: 0.01, start: &[], locked: &[] }
    }
}

/// Movement of a bone in one shape: a rotation about its own position, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoneMove {
    /// Rotation about the bone's position.
    pub rotation: Quat,
    /// Shift after the rotation, in the unit of the points.
    pub translation: Vec3,
}

impl BoneMove {
    /// The movement of a bone at rest.
    pub const REST: Self = Self { rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    /// Moves `point` with the bone at `position`.
    pub fn apply(&self, position: Vec3, point: Vec3) -> Vec3 {
        position + self.rotation * (point - position) + self.translation
    }
}

/// Bones that make a mesh follow shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Rest positions of the bones, in the space of the points.
    pub positions: Vec<Vec3>,
    /// Weights of all points: joint 0 is the head, `1 + i` is bone `i`.
    pub weights: Weights,
    /// Movements of all bones for each shape.
    pub moves: Vec<Vec<BoneMove>>,
    /// Root mean square, over all points and shapes, of the distance between the skinned point and the shape's point;
    /// in the unit of the points.
    pub error: f32,
}

/// Error of a fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No shapes to fit.
    #[error("there are no shapes to fit; give at least one")]
    NoShapes,
    /// A shape with another number of points than the mesh.
    #[error("shape {shape} has {has} points, the mesh {points}: shapes must be of the same mesh in the same order")]
    ShapeLength {
        /// Index of the first such shape.
        shape: usize,
        /// Number of points of the shape.
        has: usize,
        /// Number of points of the mesh.
        points: usize,
    },
    /// A displacement that is not finite.
    #[error("shape {shape} is not finite at point {point}; repair the shape")]
    Shape {
        /// Index of the first such shape.
        shape: usize,
        /// Index of the first such point.
        point: usize,
    },
    /// A point that is not finite.
    #[error("point {point} of the mesh is not finite; repair the mesh")]
    Point {
        /// Index of the first such point.
        point: usize,
    },
    /// A triangle with a corner that does not exist.
    #[error("triangle {triangle} has a corner past the last point: the mesh is damaged")]
    Triangle {
        /// Index of the first such triangle.
        triangle: usize,
    },
    /// Shapes that are all equal to the mesh at rest.
    #[error("no shape moves any point; give displacements from the rest mesh that are not all zero")]
    NothingMoves,
    /// A request for zero bones.
    #[error("no bones were asked for; ask for at least one")]
    NoBones,
    /// More bones than moving points.
    #[error("{bones} bones were asked for, but the shapes move {moving} points only; ask for fewer bones")]
    TooManyBones {
        /// Number of bones requested.
        bones: usize,
        /// Number of moving points.
        moving: usize,
    },
    /// Zero or too many influences.
    #[error("{influences} influences a point were asked for; ask for 1 to {MAX_INFLUENCES}")]
    Influences {
        /// Number of influences requested.
        influences: usize,
    },
    /// More positions than bones.
    #[error("{start} bones have a position to start from, but only {bones} were asked for")]
    TooManyStarts {
        /// Number of positions.
        start: usize,
        /// Number of bones requested.
        bones: usize,
    },
    /// A position that is not finite.
    #[error("bone {bone} is not at a finite place; move it first")]
    Start {
        /// Index of the first such bone.
        bone: usize,
    },
    /// Weights of another mesh or other bones.
    #[error("the weights are for {points} points and joint {joint}, the mesh or the bones are others; bind again")]
    Weights {
        /// Number of points of the weights.
        points: usize,
        /// Largest joint of the weights.
        joint: usize,
    },
    /// Cancelled by the progress callback.
    #[error("fitting was cancelled")]
    Cancelled,
}

/// Finds bones, weights and movements that bring the mesh `rest` as near as possible to all `shapes`.
///
/// `shapes` are displacements, one a point of `rest`, in the same space and unit, which may be any. `triangles` only
/// define the neighbours of points, for the smoothing. `progress` is called with the share of work done, 0 to 1, and
/// cancels by returning `false`.
///
/// Each point gets one to [`FitSettings::influences`] joints, strongest first, positive, summing to one; points that no
/// shape moves belong to the head alone. The result does not depend on the number of threads. Cost: a round is linear
/// in points times shapes times bones (some ten of them a point); 9,000 moving points, 57 shapes and 40 bones take
/// about three seconds on two cores.
///
/// # Errors
/// [`FitError`]: no shapes or movements, input that is not finite or inconsistent, or cancelled.
pub fn fit(
    rest: &[Vec3],
    triangles: &[[u32; 3]],
    shapes: &[impl AsRef<[Vec3]>],
    settings: &FitSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Fit, FitError> {
    check(settings)?;
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(FitError::Cancelled) };
    step(0.0)?;
    let problem = Problem::new(rest, triangles, shapes)?;
    let (bones, moving) = (settings.bones, problem.points.len());
    if bones > moving {
        return Err(FitError::TooManyBones { bones, moving });
    }
    let given: Vec<_> = settings.start.iter().map(|p| problem.inward(*p)).collect();
    let mut moves = start::groups(&problem, bones, &given, STIFFNESS);
    step(0.05)?;
    let rounds = settings.rounds.max(1);
    let smoothing = if settings.smoothing.is_finite() { settings.smoothing.clamp(0.0, 100.0) } else { 0.0 };
    let mut influences = vec![Vec::new(); moving];
    let mut centers = Vec::new();
    let mut renewed = Vec::new();
    for round in 0..rounds {
        let done = |part: f32| 0.05 + 0.9 * (round as f32 + part) / rounds as f32;
        let columns = Columns::new(&problem, &moves);
        let near =
            BoneCandidates { problem: &problem, centers: &centers, influences: &influences, bones, anywhere: &renewed };
        let candidates = |point: usize, out: &mut Vec<u32>| near.of(point, out);
        let smoothing = f64::from(smoothing) * 0.01;
        let sharing = ShareSettings { most: settings.influences, smoothing, candidates: &candidates };
        let left;
        (influences, left) = share(&problem, &columns, &influences, &sharing);
        step(done(0.5))?;
        let moments = Moments::new(&problem, &influences, bones, STIFFNESS);
        moments.improve(&mut moves, 1, 2);
        centers = (0..bones).map(|bone| moments.center(bone)).collect();
        renewed.clear();
        // A moved bone needs some rounds to settle.
        if round % 2 == 1 && 5 * round < 4 * rounds && round + 4 < rounds {
            let (first, most) = (settings.start.len(), bones.div_ceil(10));
            renewed = bone_reseed::renew(&problem, &columns, &mut influences, &mut moves, &left, first, most);
        }
        step(done(1.0))?;
    }
    let (positions, weights) = place::finish(&problem, settings, &influences, &moves);
    let moves = place::outward(&problem, &positions, &moves);
    let error = error(rest, &positions, &weights, shapes, &moves);
    step(1.0)?;
    Ok(Fit { positions, weights, moves, error })
}

/// Finds the movements of bones with known weights that bring the mesh `rest` as near as possible to each of `shapes`.
///
/// `positions` and `weights` are as in [`Fit`]. Returns the movements of all bones for each shape, and the error as in
/// [`Fit::error`].
///
/// # Errors
/// Errors of [`fit`], and [`FitError::Weights`].
pub fn fit_moves(
    rest: &[Vec3],
    positions: &[Vec3],
    weights: &Weights,
    shapes: &[impl AsRef<[Vec3]>],
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<(Vec<Vec<BoneMove>>, f32), FitError> {
    let step = |share: f32| if progress(share) { Ok(()) } else { Err(FitError::Cancelled) };
    step(0.0)?;
    if let Some(bone) = positions.iter().position(|p| !p.is_finite()) {
        return Err(FitError::Start { bone });
    }
    let joint = weights.joints.iter().fold(0, |most, &joint| most.max(joint as usize));
    if weights.len() != rest.len() || joint > positions.len() {
        return Err(FitError::Weights { points: weights.len(), joint });
    }
    let problem = Problem::new(rest, &[], shapes)?;
    let influences: Vec<Vec<(u32, f64)>> = problem
        .origin
        .iter()
        .map(|&p| weights.of(p as usize).filter(|e| e.0 > 0).map(|(j, w)| (j - 1, f64::from(w))).collect())
        .collect();
    let moments = Moments::new(&problem, &influences, positions.len(), STIFFNESS);
    let mut moves = vec![vec![Rigid::IDENTITY; shapes.len()]; positions.len()];
    for round in 0..10 {
        moments.improve(&mut moves, 4, 2);
        step(0.1 * (round + 1) as f32)?;
    }
    let moves = place::outward(&problem, positions, &moves);
    let error = error(rest, positions, weights, shapes, &moves);
    Ok((moves, error))
}

/// Skins all points of `rest` by linear blend skinning.
///
/// `positions`, `weights` and `moves` (of one shape) are as in [`Fit`] and must fit together.
pub fn skinned(rest: &[Vec3], positions: &[Vec3], weights: &Weights, moves: &[BoneMove]) -> Vec<Vec3> {
    let one = |(index, &point): (usize, &Vec3)| {
        let bones = weights.of(index).filter(|e| e.0 > 0).map(|(joint, weight)| (joint as usize - 1, weight));
        bones.fold(point, |sum, (bone, weight)| sum + (moves[bone].apply(positions[bone], point) - point) * weight)
    };
    rest.iter().enumerate().map(one).collect()
}

/// Computes [`Fit::error`] from the result itself.
fn error(
    rest: &[Vec3],
    positions: &[Vec3],
    weights: &Weights,
    shapes: &[impl AsRef<[Vec3]>],
    moves: &[Vec<BoneMove>],
) -> f32 {
    let mut sum = 0.0;
    for (shape, moves) in shapes.iter().zip(moves) {
        let found = skinned(rest, positions, weights, moves);
        for ((found, rest), moved) in found.iter().zip(rest).zip(shape.as_ref()) {
            sum += (found.as_dvec3() - rest.as_dvec3() - moved.as_dvec3()).length_squared();
        }
    }
    (sum / (rest.len() * shapes.len()).max(1) as f64).sqrt() as f32
}

fn check(settings: &FitSettings) -> Result<(), FitError> {
    let FitSettings { bones, influences, start, .. } = *settings;
    if bones == 0 {
        return Err(FitError::NoBones);
    }
    if !(1..=MAX_INFLUENCES).contains(&influences) {
        return Err(FitError::Influences { influences });
    }
    if start.len() > bones {
        return Err(FitError::TooManyStarts { start: start.len(), bones });
    }
    match start.iter().position(|p| !p.is_finite()) {
        Some(bone) => Err(FitError::Start { bone }),
        None => Ok(()),
    }
}

/// Candidate bones of a point.
struct BoneCandidates<'a> {
    problem: &'a Problem,
    /// Mass and centre of each bone; empty in the first round.
    centers: &'a [(f64, glam::DVec3)],
    influences: &'a [Vec<(u32, f64)>],
    bones: usize,
    /// Bones without points, which are candidates everywhere.
    anywhere: &'a [u32],
}

impl BoneCandidates<'_> {
    /// Collects the nearest bones, the bones of the point and of its neighbours, and bones without points; sorted.
    fn of(&self, point: usize, out: &mut Vec<u32>) {
        const NEAREST: usize = 8;
        if self.bones <= NEAREST || self.centers.is_empty() {
            out.extend(0..self.bones as u32);
            return;
        }
        let p = self.problem.points[point];
        let mut order: Vec<(f64, u32)> =
            self.centers.iter().enumerate().map(|(bone, c)| (c.1.distance_squared(p), bone as u32)).collect();
        let by_distance = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        order.select_nth_unstable_by(NEAREST - 1, by_distance);
        out.extend(order[..NEAREST].iter().map(|e| e.1));
        out.extend(self.influences[point].iter().map(|e| e.0));
        for &other in self.problem.around(point) {
            out.extend(self.influences[other as usize].iter().map(|e| e.0));
        }
        out.extend(self.anywhere);
        out.sort_unstable();
        out.dedup();
    }
}
