//! FABRIK: chains of any length that reach for a goal, solved on joint positions only.
//!
//! Aristidou and Lasenby, "FABRIK: A fast, iterative solver for the inverse kinematics problem", Graphical Models
//! 73(5), 2011: points are moved onto the goal from the end, then back onto the root, until the end is near enough.

use bevy::math::{Quat, Vec3};

use crate::solve::rotate::{arc, direction, perpendicular_or_any};

/// Settings of an iterative solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IterationSettings {
    /// Distance from end to goal at which the solver stops, in units of the rig's space.
    pub tolerance: f32,
    /// The greatest number of passes.
    pub iterations: u32,
    /// Direction of the bend of a chain that is straight and in line with its goal, which no pass would bend otherwise; any
    /// length, rig space. Zero: a direction that depends on the chain only.
    pub bend: Vec3,
}

impl Default for IterationSettings {
    fn default() -> Self {
        Self { tolerance: 1e-4, iterations: 16, bend: Vec3::ZERO }
    }
}

/// Result of an iterative solver.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IterationResult {
    /// Number of passes made.
    pub iterations: u32,
    /// Remaining distance from end to goal.
    pub distance: f32,
}

/// Moves the points of a chain so that the last is on `goal`, or as near as it can be; the first stays.
///
/// `lengths[i]` is the distance to keep between points `i` and `i + 1` (extra entries of longer lists are left alone).
/// A goal out of reach is aimed at by the straight chain. `O(points)` a pass. Points, lengths or a goal that are not
/// finite leave the chain unchanged.
pub fn fabrik(points: &mut [Vec3], lengths: &[f32], goal: Vec3, settings: &IterationSettings) -> IterationResult {
    let bones = lengths.len().min(points.len().saturating_sub(1));
    let lengths = &lengths[..bones];
    let finite = goal.is_finite()
        && points.iter().all(|point| point.is_finite())
        && lengths.iter().all(|length| length.is_finite() && *length >= 0.0);
    if bones == 0 || !finite {
        return IterationResult::default();
    }
    let points = &mut points[..=bones];
    let root = points[0];
    let total: f32 = lengths.iter().sum();
    let distance = root.distance(goal);
    if distance >= total {
        let aim = direction(goal - root).or_else(|| direction(points[bones] - root)).unwrap_or(Vec3::X);
        for i in 0..bones {
            points[i + 1] = points[i] + aim * lengths[i];
        }
        return IterationResult { iterations: 0, distance: points[bones].distance(goal) };
    }
    if in_line(points, goal) {
        bend(points, lengths, goal, settings.bend);
    }
    let mut iterations = 0;
    // Where two points coincide, the bone keeps the direction of the bone before it.
    let mut keep = direction(goal - root).unwrap_or(Vec3::X);
    while iterations < settings.iterations && !(iterations > 0 && points[bones].distance(goal) <= settings.tolerance) {
        points[bones] = goal;
        for i in (0..bones).rev() {
            keep = direction(points[i] - points[i + 1]).unwrap_or(keep);
            points[i] = points[i + 1] + keep * lengths[i];
        }
        points[0] = root;
        for i in 0..bones {
            keep = direction(points[i + 1] - points[i]).unwrap_or(keep);
            points[i + 1] = points[i] + keep * lengths[i];
        }
        iterations += 1;
    }
    IterationResult { iterations, distance: points[bones].distance(goal) }
}

/// Returns `true` if all points lie on the line from the first point to `goal`.
fn in_line(points: &[Vec3], goal: Vec3) -> bool {
    let root = points[0];
    let furthest = points
        .iter()
        .copied()
        .chain([goal])
        .max_by(|a, b| a.distance_squared(root).total_cmp(&b.distance_squared(root)));
    let Some((line, size)) = furthest.and_then(|p| Some((direction(p - root)?, p.distance(root)))) else { return true };
    let off = |p: Vec3| {
        let v = p - root;
        v - line * v.dot(line)
    };
    points.iter().copied().chain([goal]).all(|p| off(p).length() <= 1e-3 * size)
}

/// Bends a straight chain slightly, most in the middle.
fn bend(points: &mut [Vec3], lengths: &[f32], goal: Vec3, towards: Vec3) {
    let (root, total) = (points[0], lengths.iter().sum::<f32>());
    let line = direction(points[lengths.len()] - root).or_else(|| direction(goal - root)).unwrap_or(Vec3::X);
    let towards = perpendicular_or_any(line, &[towards]);
    let mut along = 0.0;
    for i in 0..lengths.len().saturating_sub(1) {
        along += lengths[i];
        let share = along / total;
        points[i + 1] += towards * (0.2 * total * share * (1.0 - share));
    }
}

/// Turns the joints of a chain as its points moved from `before` to `after`, with the least twist between neighbours.
///
/// `rotations` holds the joints' rotations in the rig's space at `before`, and then those at `after`: each joint turns
/// with the one above it, and then by the shortest rotation to its bone; the last joint turns with the one above it.
/// Lists are used as far as the shortest goes. A bone without length turns with the one above.
pub fn rotations_from_points(before: &[Vec3], after: &[Vec3], rotations: &mut [Quat]) {
    let count = before.len().min(after.len()).min(rotations.len());
    let mut turn = Quat::IDENTITY;
    for i in 0..count {
        if i + 1 < count {
            let ends = direction(before[i + 1] - before[i]).zip(direction(after[i + 1] - after[i]));
            if let Some((from, to)) = ends {
                turn = (arc(turn * from, to, Vec3::ZERO) * turn).normalize();
            }
        }
        rotations[i] = (turn * rotations[i]).normalize();
    }
}
