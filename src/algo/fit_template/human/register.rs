//! Registration: the model of the human figure brought onto the surface of a mesh.
//!
//! First bones follow the centre lines of limbs, then surface points and samples are matched both ways and the state
//! moves towards the matches (iterated closest points on an articulated, stretching model), from far to near.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::{
    model::{BONE_COUNT, HumanModel, bone},
    pose::{PosedModel, SHAPE, State},
    solve::{Holds, Place, Row, step},
};
use crate::{
    algo::fit_template::target::{Sample, Target},
    mesh::surface::{Surface, SurfacePoint},
};

/// Points handled at a time by one thread.
const CHUNK: usize = 128;

/// A wish for the start: a place of the model at a position.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Anchor {
    pub(in super::super) place: Place,
    pub(in super::super) position: Vec3,
    pub(in super::super) weight: f32,
}

/// The mesh that the model is brought onto.
pub(super) struct Goal<'a> {
    pub(super) surface: &'a Surface,
    pub(super) target: &'a Target,
}

impl Goal<'_> {
    fn closest_point(&self, place: Vec3) -> Option<SurfacePoint> {
        self.surface.closest_point_within(place, self.target.most_leaves).0
    }
}

/// Holds for a stage.
fn holds(components: f32, lengths: f32, girths: f32, turns: f32, fingers: bool, model: &HumanModel) -> Holds {
    let stiffness = |i: usize| {
        let bone = &model.bones[i];
        let factor = match bone.group {
            0 => 0.0,
            1 => 40.0,
            2 | 3 => 8.0,
            4 => 40.0,
            5 | 9 => 0.4,
            6 | 10 => 1.0,
            7 => 3.0,
            11 => 6.0,
            12 => 20.0,
            _ if !fingers => return f32::INFINITY,
            _ => 2.0,
        };
        factor * turns
    };
    Holds {
        components,
        lengths,
        girths,
        scale: 0.0,
        turns: std::array::from_fn(stiffness),
        rest_turns: [Quat::IDENTITY; BONE_COUNT],
        rest_shape: [0.0; SHAPE],
        damping: 1e-6,
        largest_turn: 0.35,
    }
}

/// Poses the body so that its places come near the anchors; `lengths` holds the lengths of its bones.
pub(super) fn pose_by_anchors(model: &HumanModel, state: &mut State, anchors: &[Anchor], lengths: f32, steps: usize) {
    let whole: f32 = anchors.iter().map(|a| a.weight).sum::<f32>().max(1e-9);
    let mut holds = holds(f32::INFINITY, lengths, f32::INFINITY, 2e-4, false, model);
    holds.damping = 1e-5;
    for _ in 0..steps {
        let skeleton = state.skeleton(model);
        let rows: Vec<Row> = anchors
            .iter()
            .flat_map(|anchor| {
                let place = match anchor.place {
                    Place::Point(point) => state.point(model, &skeleton, point),
                    Place::Joint(joint) => skeleton.joints[joint],
                };
                let away = anchor.position - place;
                [Vec3::X, Vec3::Y, Vec3::Z].map(|direction| Row {
                    place: anchor.place,
                    direction,
                    distance: away.dot(direction),
                    weight: anchor.weight / whole,
                })
            })
            .collect();
        step(model, state, &rows, &holds);
    }
}

/// Settings of a stage of closest points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    pub(super) steps: usize,
    /// Distance at which a match counts a quarter, at the first and the last step.
    pub(super) from: f32,
    pub(super) to: f32,
    pub(super) components: f32,
    pub(super) lengths: f32,
    pub(super) girths: f32,
    pub(super) turns: f32,
    pub(super) fingers: bool,
}

/// Brings the model onto the goal; `kept` are wishes that stay, such as markers. The state is held to the mean body at
/// rest, or to `near`.
pub(super) fn closest_points(
    model: &HumanModel,
    state: &mut State,
    goal: &Goal,
    samples: &[Sample],
    stage: &Stage,
    kept: &[Anchor],
    near: Option<&State>,
) {
    let mut holds = holds(stage.components, stage.lengths, stage.girths, stage.turns, stage.fingers, model);
    if let Some(near) = near {
        (holds.rest_shape, holds.rest_turns) = (near.shape, near.turns);
    }
    for i in 0..stage.steps {
        let share = i as f32 / (stage.steps.max(2) - 1) as f32;
        let reach = stage.from * bevy::math::ops::powf(stage.to / stage.from, share);
        let posed = state.posed(model);
        let mut rows = to_surface(model, &posed, goal, reach);
        rows.extend(to_model(model, &posed, samples, reach));
        for anchor in kept {
            let place = match anchor.place {
                Place::Point(point) => posed.points[point],
                Place::Joint(joint) => posed.joints[joint],
            };
            rows.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|direction| Row {
                place: anchor.place,
                direction,
                distance: (anchor.position - place).dot(direction),
                weight: anchor.weight,
            }));
        }
        step(model, state, &rows, &holds);
    }
}

fn robust(distance: f32, reach: f32) -> f32 {
    let q = distance / reach;
    let w = 1.0 / (1.0 + q * q);
    w * w
}

/// Rows that bring points of the model to the nearest surface that faces the same way.
fn to_surface(model: &HumanModel, posed: &PosedModel, goal: &Goal, reach: f32) -> Vec<Row> {
    let whole: f32 = model.points.iter().map(|p| p.importance).sum();
    let one = |i: usize| {
        let (place, normal) = (posed.points[i], posed.normals[i]);
        let mut row = Row { place: Place::Point(i), direction: normal, distance: 0.0, weight: 0.0 };
        let Some(hit) = goal.closest_point(place) else { return row };
        let (mut outward, thin) = goal.target.normals[hit.triangle as usize];
        if thin && outward.dot(normal) < 0.0 {
            outward = -outward;
        }
        let facing = outward.dot(normal);
        if facing <= 0.15 {
            return row;
        }
        row.direction = (outward + normal).normalize_or_zero();
        row.distance = row.direction.dot(hit.point - place);
        row.weight = model.points[i].importance / whole * robust(hit.distance, reach) * facing;
        row
    };
    (0..model.points.len().div_ceil(CHUNK))
        .into_par_iter()
        .flat_map_iter(|chunk| (chunk * CHUNK..((chunk + 1) * CHUNK).min(model.points.len())).map(one))
        .collect()
}

/// Rows that bring the nearest point of the model to each sample of the surface.
fn to_model(model: &HumanModel, posed: &PosedModel, samples: &[Sample], reach: f32) -> Vec<Row> {
    let each = 1.0 / samples.len().max(1) as f32;
    let one = |sample: &Sample| {
        let mut best = (f32::INFINITY, usize::MAX);
        for (i, (&place, &normal)) in posed.points.iter().zip(&posed.normals).enumerate() {
            let facing = normal.dot(sample.normal);
            let facing = if sample.thin { facing.abs() } else { facing };
            if facing < 0.2 {
                continue;
            }
            let squared = place.distance_squared(sample.point) * (1.5 - 0.5 * facing);
            if squared < best.0 {
                best = (squared, i);
            }
        }
        let (_, i) = best;
        if i == usize::MAX {
            return Row { place: Place::Point(0), direction: Vec3::X, distance: 0.0, weight: 0.0 };
        }
        let (place, normal) = (posed.points[i], posed.normals[i]);
        let outward = if sample.thin && normal.dot(sample.normal) < 0.0 { -sample.normal } else { sample.normal };
        let direction = (outward + normal).normalize_or_zero();
        let away = sample.point - place;
        let weight = each * robust(away.length() * 0.7, reach) * outward.dot(normal).max(0.0);
        let importance = model.points[i].importance.sqrt();
        Row { place: Place::Point(i), direction, distance: direction.dot(away), weight: weight * importance }
    };
    samples.par_chunks(CHUNK).flat_map_iter(|chunk| chunk.iter().map(one)).collect()
}

/// Mean distance between model and surface, both ways, cut off at `most`.
pub(super) fn residual(model: &HumanModel, state: &State, goal: &Goal, samples: &[Sample], most: f32) -> f32 {
    let posed = state.posed(model);
    let whole: f32 = model.points.iter().map(|p| p.importance).sum();
    let distance = |i: usize| {
        let hit = goal.closest_point(posed.points[i]);
        hit.map_or(most, |hit| {
            let (outward, thin) = goal.target.normals[hit.triangle as usize];
            let facing = outward.dot(posed.normals[i]);
            let facing = if thin { facing.abs() } else { facing };
            (hit.distance + (0.5 - 0.5 * facing) * 0.4 * most).min(most)
        })
    };
    let forth: f32 = (0..model.points.len()).map(|i| distance(i) * model.points[i].importance).sum::<f32>() / whole;
    let back: Vec<f32> = samples
        .par_iter()
        .map(|s| {
            let nearest = posed.points.iter().map(|p| p.distance_squared(s.point)).fold(f32::INFINITY, f32::min);
            nearest.sqrt().min(most)
        })
        .collect();
    forth + 0.7 * back.iter().sum::<f32>() / back.len().max(1) as f32
}

/// Bones of one side's limb.
pub(super) fn limb_bones(kind: &str, side: &str) -> Vec<usize> {
    let names: &[&str] = match kind {
        "arm" => &["clavicle", "upperarm", "lowerarm", "hand"],
        _ => &["thigh", "calf", "foot", "ball"],
    };
    names.iter().map(|n| bone(&format!("{n}_{side}"))).collect()
}

/// Distance between the model's points beyond which a sample has nothing near it.
const SPACING: f32 = 0.03;
/// Distances are cut off here.
const MOST: f32 = 0.1;

/// Distance between model and surface as a share of the height: over the whole, and around each bone.
pub(super) fn agreement(model: &HumanModel, state: &State, goal: &Goal, samples: &[Sample]) -> (f32, Vec<f32>) {
    let posed = state.posed(model);
    let mut sums = vec![(0.0f32, 0.0f32); BONE_COUNT];
    let forth: Vec<f32> = posed
        .points
        .par_iter()
        .zip(&posed.normals)
        .map(|(&place, &normal)| {
            let Some(hit) = goal.closest_point(place) else { return MOST };
            let (outward, thin) = goal.target.normals[hit.triangle as usize];
            let facing = outward.dot(normal);
            let facing = if thin { facing.abs() } else { facing };
            (hit.distance + (0.5 - facing).max(0.0) * 0.02).min(MOST)
        })
        .collect();
    for (point, distance) in model.points.iter().zip(&forth) {
        let sum = &mut sums[point.bones[0]];
        *sum = (sum.0 + distance, sum.1 + 1.0);
    }
    let back: Vec<(usize, f32)> = samples
        .par_iter()
        .map(|sample| {
            let squared = |i: usize| posed.points[i].distance_squared(sample.point);
            let nearest =
                (0..posed.points.len()).reduce(|a, b| if squared(b) < squared(a) { b } else { a }).unwrap_or(0);
            let away = sample.point - posed.points[nearest];
            let beside = away.dot(posed.normals[nearest]).abs();
            (nearest, beside.max(away.length() - SPACING).min(MOST))
        })
        .collect();
    for (nearest, distance) in back {
        let sum = &mut sums[model.points[nearest].bones[0]];
        *sum = (sum.0 + 0.7 * distance, sum.1 + 0.7);
    }
    let whole = sums.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    // A joint lies between its own bone and its parent's.
    let near = |bone: usize| {
        let (mut sum, mut count) = sums[bone];
        if let Some(parent) = model.bones[bone].parent {
            let share = (count / sums[parent].1.max(1.0)).clamp(0.1, 1.0);
            sum += sums[parent].0 * share;
            count += sums[parent].1 * share;
        }
        if count > 0.0 { sum / count } else { MOST }
    };
    (whole.0 / whole.1.max(1.0), (0..BONE_COUNT).map(near).collect())
}
