//! Views and placing: from a point on the view plane to a ray, from a ray's hits to a joint.

use glam::{Vec2, Vec3};
use rigsmith::{
    algo::{
        placement::{PlaceSettings, Placement, place},
        view::{View, ViewPlane},
    },
    mesh::surface::Surface,
};

const BOUNDS: [Vec3; 2] = [Vec3::splat(-2.0), Vec3::splat(2.0)];

/// Boxes from their least and greatest corners, wound outward.
fn boxes(corners: &[[Vec3; 2]]) -> Surface {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for [low, high] in corners {
        let first = points.len() as u32;
        points.extend((0..8).map(|i| {
            Vec3::new(
                if i & 1 == 0 { low.x } else { high.x },
                if i & 2 == 0 { low.y } else { high.y },
                if i & 4 == 0 { low.z } else { high.z },
            )
        }));
        for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            let q = q.map(|i| first + i);
            triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        }
    }
    Surface::build(&points, &triangles)
}

#[test]
fn views_look_from_where_they_say() {
    let check = |view: View, right: Vec3, up: Vec3, camera: Vec3| {
        for (found, expected) in view.axes().into_iter().zip([right, up, camera]) {
            assert!(found.distance(expected) < 1e-6, "{view:?}: {:?}", view.axes());
        }
    };
    check(View::Front, Vec3::X, Vec3::Y, Vec3::Z);
    check(View::Back, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z);
    check(View::Left, Vec3::NEG_Z, Vec3::Y, Vec3::X);
    check(View::Right, Vec3::Z, Vec3::Y, Vec3::NEG_X);
    check(View::Top, Vec3::X, Vec3::NEG_Z, Vec3::Y);
    check(View::Bottom, Vec3::X, Vec3::Z, Vec3::NEG_Y);
    for (orbit, named) in [
        (View::Orbit(0.0, 0.0), View::Front),
        (View::Orbit(180.0, 0.0), View::Back),
        (View::Orbit(90.0, 0.0), View::Left),
        (View::Orbit(-90.0, 0.0), View::Right),
        (View::Orbit(0.0, 90.0), View::Top),
        (View::Orbit(0.0, -90.0), View::Bottom),
        (View::Orbit(720.0, f32::NAN), View::Front),
    ] {
        let [right, up, camera] = named.axes();
        check(orbit, right, up, camera);
    }
    let [.., camera] = View::Orbit(30.0, 20.0).axes();
    assert!(camera.x > 0.1 && camera.y > 0.1 && camera.z > 0.1, "left, up and before the character: {camera}");
}

#[test]
fn rays_go_through_their_points() {
    let eye = Vec3::new(0.3, 1.2, 4.0);
    for view in [View::Front, View::Left, View::Top, View::Orbit(33.0, -21.0), View::Orbit(200.0, 80.0)] {
        let [.., camera] = view.axes();
        for plane in
            [ViewPlane::orthographic(view, BOUNDS), ViewPlane::perspective(view, camera * 5.0 + eye * 0.1, eye)]
        {
            for point in [Vec2::ZERO, Vec2::new(0.7, -0.4), Vec2::new(-1.5, 1.9)] {
                let ray = plane.ray(point);
                assert!((ray.direction.length() - 1.0).abs() < 1e-6);
                assert!(ray.direction.dot(plane.towards()) < 0.0, "{view:?} looks away from the camera");
                for distance in [0.5, 3.0, 20.0] {
                    let back = plane.project(ray.at(distance)).expect("before the camera");
                    assert!(back.distance(point) < 1e-4, "{view:?} {point}: {back}");
                }
            }
        }
    }
    let plane = ViewPlane::perspective(View::Front, Vec3::Z * 2.0, Vec3::ZERO);
    assert_eq!(plane.project(Vec3::Z * 3.0), None, "behind the eye");
}

#[test]
fn orthographic_rays_start_outside() {
    for bounds in [
        [Vec3::splat(1000.0), Vec3::splat(2000.0)],
        [Vec3::splat(-3e-3), Vec3::splat(-1e-3)],
        [Vec3::INFINITY, Vec3::NEG_INFINITY],
    ] {
        for view in [View::Front, View::Back, View::Left, View::Right, View::Top, View::Bottom, View::Orbit(40.0, 30.0)]
        {
            let plane = ViewPlane::orthographic(view, bounds);
            assert!(plane.standoff.is_finite());
            if bounds[0].is_finite() {
                for corner in [bounds[0], bounds[1], Vec3::new(bounds[0].x, bounds[1].y, bounds[0].z)] {
                    assert!(corner.dot(plane.towards()) < plane.standoff, "{view:?} {bounds:?}");
                }
            }
        }
    }
}

/// An arm from z = 2 to 3 before a torso from z = -1 to 1.
fn arm_and_torso() -> Surface {
    boxes(&[
        [Vec3::new(-1.0, -1.0, -1.0), Vec3::new(1.0, 1.0, 1.0)],
        [Vec3::new(-0.5, -0.5, 2.0), Vec3::new(0.5, 0.5, 3.0)],
    ])
}

#[test]
fn joints_go_between_hits() {
    let surface = arm_and_torso();
    let (low, high) = surface.bounds().expect("not empty");
    let plane = ViewPlane::orthographic(View::Front, [low, high]);
    let check = |x: f32, depth: f32, volume: Option<u32>, expected: Option<(f32, Option<u32>)>| {
        let placement = place(&surface, &plane.ray(Vec2::new(x, 0.1)), PlaceSettings { depth, volume });
        match (placement, expected) {
            (Placement::Nothing, None) => {}
            (Placement::Between { position, volume: taken, .. }, Some((z, number))) => {
                assert!(position.distance(Vec3::new(x, 0.1, z)) < 1e-5, "{x} {depth} {volume:?}: {position}");
                assert_eq!(taken, number, "{x} {depth} {volume:?}");
            }
            other => panic!("{x} {depth} {volume:?}: {other:?}"),
        }
    };
    check(0.7, 0.5, None, Some((0.0, None)));
    check(0.7, 0.0, None, Some((1.0, None)));
    check(0.7, 1.0, None, Some((-1.0, None)));
    check(0.7, 0.25, None, Some((0.5, None)));
    check(0.7, 7.0, None, Some((-1.0, None)));
    check(0.7, -7.0, None, Some((1.0, None)));
    check(0.7, f32::NAN, None, Some((0.0, None)));
    // Both: between the arm's near and the torso's far side.
    check(0.0, 0.5, None, Some((1.0, None)));
    check(0.0, 0.5, Some(1), Some((2.5, Some(1))));
    check(0.0, 0.5, Some(2), Some((0.0, Some(2))));
    check(0.0, 0.5, Some(3), Some((2.5, Some(1))));
    check(0.0, 0.5, Some(0), Some((2.5, Some(1))));
    check(0.0, 0.25, Some(2), Some((0.5, Some(2))));
    check(0.7, 0.5, Some(2), Some((0.0, Some(1))));
    check(1.5, 0.5, None, None);
    check(1.5, 0.5, Some(1), None);
    match place(&surface, &plane.ray(Vec2::ZERO), PlaceSettings::default()) {
        Placement::Between { near, far, volumes, .. } => {
            assert_eq!(volumes, 2, "worth a word to the user");
            assert!(near.distance(Vec3::Z * 3.0) < 1e-5 && far.distance(Vec3::NEG_Z) < 1e-5);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn one_hit_is_taken_itself() {
    let sheet = Surface::build(
        &[Vec3::new(-1.0, -1.0, 0.5), Vec3::new(1.0, -1.0, 0.5), Vec3::new(0.0, 1.0, 0.5)],
        &[[0, 1, 2]],
    );
    let plane = ViewPlane::orthographic(View::Front, BOUNDS);
    for settings in [
        PlaceSettings::default(),
        PlaceSettings { depth: 0.9, volume: None },
        PlaceSettings { depth: 0.1, volume: Some(2) },
    ] {
        match place(&sheet, &plane.ray(Vec2::ZERO), settings) {
            Placement::Single { position } => assert!(position.distance(Vec3::new(0.0, 0.0, 0.5)) < 1e-6),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(place(&sheet, &plane.ray(Vec2::splat(3.0)), PlaceSettings::default()), Placement::Nothing);
    assert_eq!(place(&Surface::default(), &plane.ray(Vec2::ZERO), PlaceSettings::default()).position(), None);
}
