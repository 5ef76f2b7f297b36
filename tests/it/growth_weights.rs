//! Growth of the work of automatic weights, counted: which pieces of a mesh belong to which bones is found from those that are
//! near to each other.

use glam::Vec3;
use rigsmith::algo::weights::{WeightJoint, WeightSettings, skin_weights};

/// Largest growth for twice the size.
const GROWTH: f64 = 2.3;

/// Joints in a chain upwards, at `x` and `z`.
fn chain(count: usize, [x, z]: [f32; 2]) -> Vec<WeightJoint> {
    let joint = |number: usize| WeightJoint {
        head: Vec3::new(x, number as f32 / count as f32, z),
        parent: number.checked_sub(1),
        tail: None,
        deforms: true,
        twist: None,
        halves: None,
    };
    (0..count).map(joint).collect()
}

/// Pieces of a shape over each other, each turned a little against the one below.
fn stack(count: usize, shape: &[Vec3], corners: &[[u32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for number in 0..count {
        let first = points.len() as u32;
        let (sin, cos) = bevy::math::ops::sin_cos(0.1 * number as f32);
        let height = number as f32 / count as f32;
        points
            .extend(shape.iter().map(|at| Vec3::new(cos * at.x - sin * at.z, height + at.y, sin * at.x + cos * at.z)));
        triangles.extend(corners.iter().map(|corners| corners.map(|corner| first + corner)));
    }
    (points, triangles)
}

/// Comparisons in binding a chain of joints to so many pieces.
fn compared(joints: &[WeightJoint], (points, triangles): &(Vec<Vec3>, Vec<[u32; 3]>)) -> u64 {
    let settings = WeightSettings::default();
    let (weights, report) = skin_weights(points, triangles, joints, &[], None, &settings, &|_| true).unwrap();
    assert_eq!(weights.len(), points.len());
    report.comparisons
}

#[test]
fn stacks_of_pieces_are_compared_with_the_bones_near_to_them() {
    let flat = [Vec3::ZERO, Vec3::X, Vec3::Z];
    let triangle: &[[u32; 3]] = &[[0, 1, 2]];
    let around = [Vec3::new(-0.6, 0.0, -0.4), Vec3::new(0.6, 0.0, -0.4), Vec3::new(0.0, 0.0, 0.7)];
    for (shape, place, pieces) in [("beside", [0.0, 0.0], flat), ("through", [0.05, 0.05], around)] {
        let counts = [50, 100, 200].map(|count| compared(&chain(count, place), &stack(2 * count, &pieces, triangle)));
        for pair in counts.windows(2) {
            assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{shape}: {counts:?}");
        }
    }
}

/// Shells around all of a skeleton are around each of its bones. Beyond a number that no character has, they belong to all bones.
#[test]
fn shells_in_shells_are_compared_within_bounds() {
    let shell =
        [Vec3::new(0.0, 3.0, 0.0), Vec3::new(-3.0, -2.0, -2.0), Vec3::new(3.0, -2.0, -2.0), Vec3::new(0.0, -2.0, 4.0)];
    let corners = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
    let (joints, pieces) = (300, 300);
    let compared = compared(&chain(joints, [0.0, 0.0]), &stack(pieces, &shell, &corners));
    let bound = 32 * ((1 << 16) + 16 * (joints + pieces) as u64);
    assert!(compared > bound / 2 && compared <= 2 * bound, "{compared} of {bound}");
}
