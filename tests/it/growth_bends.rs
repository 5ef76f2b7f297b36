//! Growth of the work for half joints and twist joints, counted: twice as many bends take about twice as much.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;
use rigsmith::{
    algo::weights::{
        WeightJoint,
        bends::{Bend, Flesh},
        late_shares,
    },
    mesh::model::Weights,
};

/// Largest growth for twice the size.
const GROWTH: f64 = 2.3;

/// Rings of the tube for each bone.
const RINGS: usize = 8;
/// Points of a ring.
const SIDES: usize = 8;

/// A chain of so many bones of unit length upwards, with a half joint for each joint but the first. Half joints come last.
fn joints(count: usize) -> Vec<WeightJoint> {
    let at = |height: usize| Vec3::new(0.0, height as f32, 0.0);
    let plain = |head, parent, halves| WeightJoint { head, parent, tail: None, deforms: true, twist: None, halves };
    let bones = (0..count).map(|number| plain(at(number), number.checked_sub(1), None));
    let halves = (1..count).map(|number| plain(at(number), Some(number), Some(number)));
    bones.chain(halves).collect()
}

/// A tube around such a chain: points and triangles.
fn tube(count: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for ring in 0..=RINGS * count {
        for side in 0..SIDES {
            let (sin, cos) = bevy::math::ops::sin_cos(std::f32::consts::TAU * side as f32 / SIDES as f32);
            points.push(Vec3::new(0.25 * cos, ring as f32 / RINGS as f32, 0.25 * sin));
        }
        if ring > 0 {
            for side in 0..SIDES {
                let [below, above] = [ring - 1, ring].map(|ring| (ring * SIDES) as u32);
                let [here, next] = [side, (side + 1) % SIDES].map(|side| side as u32);
                triangles.push([below + here, above + here, above + next]);
                triangles.push([below + here, above + next, below + next]);
            }
        }
    }
    (points, triangles)
}

/// Weights of a tube, blended around each joint; `has_halves` gives the half joints their part.
fn weights(points: &[Vec3], count: usize, has_halves: bool) -> Weights {
    let mut weights = Weights::default();
    for point in points {
        let joint = (point.y.round() as usize).clamp(1, count - 1);
        let lower = (0.5 + (point.y - joint as f32)).clamp(0.0, 1.0);
        let half = if has_halves { 2.0 * lower.min(1.0 - lower) } else { 0.0 };
        let row = [(joint, lower - 0.5 * half), (joint - 1, 1.0 - lower - 0.5 * half), (count + joint - 1, half)];
        weights.push(row.into_iter().filter(|(_, weight)| *weight > 0.0).map(|(joint, weight)| (joint as u32, weight)));
    }
    weights
}

/// Triangles and places that are looked at where each joint of a chain bends.
fn visited(count: usize) -> u64 {
    let (joints, (points, triangles)) = (joints(count), tube(count));
    let weights = weights(&points, count, true);
    let bend = |joint: usize| Bend {
        half: count + joint - 1,
        joint,
        axis: Vec3::X,
        angle: FRAC_PI_2,
        aside: None,
        above: Vec3::Y,
        below: Vec3::Y,
        section: 0.0,
        share: 0.5,
        push: [0.0, 0.3],
    };
    let bends: Vec<Bend> = (1..count).map(bend).collect();
    let mut flesh = Flesh::new(&points, &triangles, &joints, &weights, |_| false);
    let pushes = flesh.settle(&bends);
    assert!(pushes.iter().any(Option::is_some), "no bend has a section: {pushes:?}");
    let settled = flesh.weights(8, 0.0);
    for point in 0..points.len() {
        let sum: f32 = settled.of(point).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-3, "the weights of point {point} sum to {sum}");
    }
    flesh.visits()
}

#[test]
fn bends_look_at_the_flesh_around_them() {
    let visits: Vec<u64> = [10, 20, 40].into_iter().map(visited).collect();
    for pair in visits.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{visits:?}");
    }
}

/// Shares of half joints far down a chain are those at its beginning: whoever stands above a bend is known without a walk.
#[test]
fn half_joints_take_alike_along_a_chain() {
    let count = 600;
    let (joints, (points, _)) = (joints(count), tube(count));
    let is_late: Vec<bool> = joints.iter().map(|joint| joint.halves.is_some()).collect();
    let shared = late_shares(&points, &joints, &is_late, &weights(&points, count, false), &[], |_| false, 8);
    // Points around the second joint, and as many around each further one.
    let around = RINGS * SIDES;
    let row = |point: usize, back: usize| -> Vec<(u32, f32)> {
        let mut row: Vec<_> = shared.of(point).map(|(joint, weight)| (joint - back as u32, weight)).collect();
        row.sort_by_key(|(joint, _)| *joint);
        row
    };
    let mut is_shared = false;
    for bone in [1, 7, 300, count - 4] {
        for point in 0..around {
            // From half a bone below the joint to half a bone above it.
            let first = around + around / 2 + point;
            let (expected, found) = (row(first, 0), row(first + bone * around, bone));
            assert_eq!(found.len(), expected.len(), "bone {bone}, point {point}");
            for ((joint, weight), (other, as_there)) in found.into_iter().zip(expected) {
                assert_eq!(joint, other, "bone {bone}, point {point}");
                assert!((weight - as_there).abs() < 1e-4, "bone {bone}, point {point}: {weight} {as_there}");
                is_shared |= joint as usize >= count;
            }
        }
    }
    assert!(is_shared);
}
