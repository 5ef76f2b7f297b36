//! Picking: the joint that a click, a second click, a click beside the mesh and a box mean.

use glam::{Vec2, Vec3};
use rigsmith::{
    algo::{
        picking::{PickCycle, candidates, in_box, nearest_on_plane},
        point_tree::PointTree,
        view::{View, ViewPlane},
    },
    mesh::surface::Surface,
};

/// A slab from z = -0.1 to 0.1, two by two.
fn slab() -> (Surface, ViewPlane) {
    let points: Vec<Vec3> = (0..8)
        .map(|i| {
            Vec3::new(
                if i & 1 == 0 { -1.0 } else { 1.0 },
                if i & 2 == 0 { -1.0 } else { 1.0 },
                if i & 4 == 0 { -0.1 } else { 0.1 },
            )
        })
        .collect();
    let mut triangles = Vec::new();
    for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    }
    (Surface::build(&points, &triangles), ViewPlane::orthographic(View::Front, [Vec3::splat(-1.0), Vec3::splat(1.0)]))
}

#[test]
fn nearest_to_the_first_hit() {
    let (surface, plane) = slab();
    // The second joint is right behind the click, but far away from where the ray meets the slab.
    let joints = [Vec3::new(0.3, 0.0, 0.0), Vec3::new(0.0, 0.0, -5.0), Vec3::new(-0.9, 0.5, 0.0), Vec3::NAN];
    let check = |point: Vec2, reach: f32, expected: &[usize]| {
        assert_eq!(candidates(&surface, &plane, point, &joints, reach), expected, "{point} {reach}");
    };
    check(Vec2::ZERO, 0.0, &[0, 2]);
    check(Vec2::ZERO, 100.0, &[0, 2, 1]);
    check(Vec2::new(-0.8, 0.5), 0.0, &[2, 0]);
    check(Vec2::new(-0.3, 0.2), f32::NAN, &[0, 2]);
    assert!(candidates(&surface, &plane, Vec2::ZERO, &[], 1.0).is_empty());
    assert_eq!(candidates(&surface, &plane, Vec2::ZERO, &joints[..1], 0.0), [0]);
}

#[test]
fn nearest_on_the_view_plane_beside_the_mesh() {
    let (surface, plane) = slab();
    let joints = [Vec3::new(0.9, 0.0, 0.0), Vec3::new(1.4, 0.0, -50.0), Vec3::new(0.0, 0.0, 0.0)];
    assert_eq!(candidates(&surface, &plane, Vec2::new(1.5, 0.0), &joints, 0.0), [1, 0]);
    assert_eq!(nearest_on_plane(&plane, Vec2::new(0.1, 0.0), &joints, 0.0), [2, 0]);
    let perspective = ViewPlane::perspective(View::Front, Vec3::Z * 3.0, Vec3::ZERO);
    let behind = [Vec3::Z * 4.0, Vec3::new(2.0, 2.0, 0.0)];
    assert_eq!(nearest_on_plane(&perspective, Vec2::ZERO, &behind, 0.0), [1], "what is behind the eye is not seen");
}

#[test]
fn clicking_again_cycles() {
    let mut cycle = PickCycle::default();
    let spot = Vec2::new(0.2, 0.3);
    let clicks: [(Vec2, &[usize], Option<usize>); 9] = [
        (spot, &[4, 7, 1], Some(4)),
        (spot, &[4, 7, 1], Some(7)),
        (spot + 0.005, &[7, 4, 1], Some(1)),
        (spot, &[4, 7, 1], Some(4)),
        (Vec2::ONE, &[4, 7, 1], Some(4)),
        (Vec2::ONE, &[7, 1], Some(7)),
        (Vec2::ONE, &[], None),
        (Vec2::ONE, &[7, 1], Some(7)),
        (Vec2::ONE, &[7, 1], Some(1)),
    ];
    for (i, (point, candidates, expected)) in clicks.into_iter().enumerate() {
        assert_eq!(cycle.click(point, 0.01, candidates), expected, "click {i}");
    }
    cycle.reset();
    assert_eq!(cycle.click(Vec2::ONE, 0.01, &[7, 1]), Some(7), "after a reset");
}

#[test]
fn boxes_take_what_they_show() {
    let (_, plane) = slab();
    let joints = [Vec3::ZERO, Vec3::new(0.5, 0.5, 9.0), Vec3::new(-0.5, 0.5, 0.0), Vec3::NAN, Vec3::new(0.6, 0.0, 0.0)];
    for (corners, expected) in [
        ([Vec2::splat(-0.1), Vec2::splat(0.5)], vec![0, 1]),
        ([Vec2::splat(0.5), Vec2::splat(-0.1)], vec![0, 1]),
        ([Vec2::new(-0.6, 0.6), Vec2::new(0.7, -0.1)], vec![0, 1, 2, 4]),
        ([Vec2::splat(5.0), Vec2::splat(6.0)], vec![]),
    ] {
        assert_eq!(in_box(&plane, corners, &joints), expected, "{corners:?}");
    }
}

#[test]
fn the_two_nearest_points_are_found_without_a_look_at_all() {
    let spread = |number: usize| {
        let part = |prime: usize| (number * prime % 4099) as f32 / 4099.0;
        Vec3::new(part(733), part(1289), part(2741))
    };
    let mut visits = Vec::new();
    for count in [1000, 4000] {
        let mut points: Vec<Vec3> = (0..count).map(spread).collect();
        points[7] = Vec3::NAN;
        let tree = PointTree::new(points.iter().copied());
        for number in 0..100 {
            let place = spread(number * 17) + Vec3::splat(0.003);
            let mut distances: Vec<(f32, usize)> =
                points.iter().map(|point| point.distance(place)).zip(0..).filter(|(far, _)| far.is_finite()).collect();
            distances.sort_by(|a, b| a.0.total_cmp(&b.0));
            let found = tree.nearest_two(place).map(|found| found.unwrap().0);
            assert_eq!(found, [distances[0].0, distances[1].0], "{number} of {count}");
        }
        visits.push(tree.visits());
    }
    assert!(visits[1] < 2 * visits[0], "{visits:?}");
    // Points at one place, and fewer than two.
    let one_place = PointTree::new(std::iter::repeat_n(Vec3::ONE, 100));
    assert_eq!(one_place.nearest_two(Vec3::ZERO).map(|found| found.unwrap().0), [Vec3::ONE.length(); 2]);
    assert_eq!(PointTree::default().nearest_two(Vec3::ZERO), [None, None]);
    let single = PointTree::new([Vec3::X]).nearest_two(Vec3::ZERO);
    assert_eq!(single, [Some((1.0, 0)), None]);
}
