//! Landmarks: where the 68 points lie on heads that tell, and what holds on those that do not.

use glam::{Quat, Vec3, vec3};
use rigsmith::algo::face::{
    depth_map::{DepthFrame, DepthMap},
    landmarks::{LandmarkError, Landmarks, find_landmarks, mirrored},
    shells::{ShellKind, Shells, find_shells},
};

use crate::{
    heads::{HEADS, Mesh, bundled, bundled_and, mesh, subdivided, truth},
    prerequisites::test_data,
};

fn find((points, triangles): &Mesh) -> Landmarks {
    find_landmarks(points, triangles, &find_shells(points, triangles)).unwrap()
}

/// Errors in percent of the eye distance.
fn errors(points: &[Vec3], truth: &[usize], found: &Landmarks) -> Vec<f32> {
    let eyes = points[truth[36]].distance(points[truth[45]]);
    truth.iter().zip(&found.points).map(|(&index, point)| 100.0 * points[index].distance(*point) / eyes).collect()
}

/// The largest distance between two sets of landmarks in percent of the eye distance.
fn apart(a: &[Vec3; 68], b: &[Vec3; 68]) -> f32 {
    let eyes = a[36].distance(a[45]);
    a.iter().zip(b).map(|(a, b)| 100.0 * a.distance(*b) / eyes).fold(0.0, f32::max)
}

/// Landmarks of any face: finite, left is left, and from brows to chin in order.
fn check_sensible(found: &Landmarks) {
    let p = &found.points;
    assert!(p.iter().all(|point| point.is_finite()));
    assert!((0.0..=1.0).contains(&found.confidence));
    for (right, left) in [(0, 16), (17, 26), (36, 45), (31, 35), (48, 54), (4, 12)] {
        assert!(p[right].x < p[left].x, "{right} lies left of {left}");
    }
    let order = [27, 30, 33, 51, 57, 8];
    assert!(order.windows(2).all(|pair| p[pair[0]].y > p[pair[1]].y), "the profile is out of order");
    assert!(p[19].y > p[37].y && p[37].y > p[41].y && p[36].x < p[39].x && p[39].x < p[42].x && p[42].x < p[45].x);
    assert!(p[62].y >= p[66].y);
}

#[test]
fn near_the_truth() {
    let Some(folder) = test_data() else { return };
    let truth = truth(&folder);
    for name in HEADS {
        let mesh = mesh(&folder.join(format!("heads/{name}.obj")));
        let found = find(&mesh);
        check_sensible(&found);
        let errors = errors(&mesh.0, &truth, &found);
        let mean = errors.iter().sum::<f32>() / 68.0;
        assert!(mean <= 3.0, "{name}: mean error {mean} %");
        for index in [19, 21, 22, 24, 31, 35, 37, 41, 44, 46, 48, 51, 54, 62, 66] {
            assert!(errors[index] <= 5.0, "{name}: landmark {index} is off by {} %", errors[index]);
        }
        assert!(found.mouth_open && found.confidence > 0.8);
        assert_eq!(found.symmetric, name == "ict_neutral");
    }
}

#[test]
fn the_bundled_head_has_a_face() {
    let found = find(&bundled());
    check_sensible(&found);
    assert!(found.symmetric && found.confidence > 0.5, "{}", found.confidence);
}

#[test]
fn stretched_heads() {
    let Some(folder) = test_data() else { return };
    let truth = truth(&folder);
    let (points, triangles) = mesh(&folder.join("heads/ict_identity_1.obj"));
    let pitch = |degrees: f32| Quat::from_rotation_x(degrees.to_radians());
    let bends: [(&str, &dyn Fn(Vec3) -> Vec3); 4] = [
        ("short", &|p| p * vec3(1.0, 0.85, 1.0)),
        ("tall", &|p| p * vec3(1.0, 1.15, 1.0)),
        ("flat", &|p| p * vec3(1.0, 1.0, 0.75)),
        ("pitched", &|p| pitch(8.0) * p),
    ];
    for (name, bend) in bends {
        let bent: Vec<Vec3> = points.iter().map(|&point| bend(point)).collect();
        let errors = errors(&bent, &truth, &find(&(bent.clone(), triangles.clone())));
        let mean = errors.iter().sum::<f32>() / 68.0;
        assert!(mean <= 6.0, "{name}: mean error {mean} %");
    }
}

#[test]
fn looking_aside() {
    let Some(folder) = test_data() else { return };
    let truth = truth(&folder);
    let (points, triangles) = mesh(&folder.join("heads/ict_identity_2.obj"));
    for (axis, degrees) in [(Vec3::Y, 8.0f32), (Vec3::Y, -24.0), (Vec3::Z, 12.0)] {
        let turn = Quat::from_axis_angle(axis, degrees.to_radians());
        let turned: Vec<Vec3> = points.iter().map(|&point| turn * point).collect();
        let errors = errors(&turned, &truth, &find(&(turned.clone(), triangles.clone())));
        let mean = errors.iter().sum::<f32>() / 68.0;
        assert!(mean <= 3.5, "{degrees} degrees about {axis}: mean error {mean} %");
    }
}

#[test]
fn any_unit_and_place() {
    for (name, (points, triangles)) in bundled_and("ict_identity_1") {
        let first = find(&(points.clone(), triangles.clone()));
        let eyes = first.eye_distance();
        for (scale, shift) in [(0.01, Vec3::ZERO), (100.0, Vec3::ZERO), (1.0, vec3(4.5, -7.5, 3.0) * eyes)] {
            let moved: Vec<Vec3> = points.iter().map(|&point| point * scale + shift).collect();
            let found = find(&(moved, triangles.clone()));
            let back = found.points.map(|point| (point - shift) / scale);
            let apart = apart(&first.points, &back);
            assert!(apart < 1.5, "{name} times {scale} plus {shift}: off by {apart} %");
        }
    }
}

#[test]
fn any_topology() {
    for (name, mesh) in bundled_and("ict_neutral") {
        let first = find(&mesh);
        let count = mesh.0.len() as u32;
        let backward: Vec<Vec3> = mesh.0.iter().rev().copied().collect();
        let triangles: Vec<[u32; 3]> =
            mesh.1.iter().rev().map(|corners| corners.map(|corner| count - 1 - corner)).collect();
        let inside_out: Vec<[u32; 3]> = mesh.1.iter().map(|&[a, b, c]| [a, c, b]).collect();
        for (change, other, most) in [
            ("subdivided", subdivided(&mesh), 1.0),
            ("reordered", (backward, triangles), 0.5),
            ("wound the other way", (mesh.0.clone(), inside_out), 0.5),
        ] {
            let apart = apart(&first.points, &find(&other).points);
            assert!(apart < most, "{name} {change}: {apart} %");
        }
    }
}

#[test]
fn same_on_both_sides() {
    for (name, mesh) in bundled_and("ict_neutral") {
        let found = find(&mesh);
        assert!(found.symmetric, "{name}");
        for index in 0..68 {
            let (a, b) = (found.points[index], found.points[mirrored(index)]);
            assert_eq!((2.0 * found.middle - a.x, a.y, a.z), (b.x, b.y, b.z), "{name}: landmark {index}");
        }
    }
}

#[test]
fn a_mirrored_head_has_mirrored_landmarks() {
    let Some(folder) = test_data() else { return };
    let (points, triangles) = mesh(&folder.join("heads/ict_identity_2.obj"));
    let found = find(&(points.clone(), triangles.clone()));
    let flipped: Vec<Vec3> = points.iter().map(|point| vec3(-point.x, point.y, point.z)).collect();
    let wound: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let other = find(&(flipped, wound));
    let back: [Vec3; 68] = std::array::from_fn(|index| {
        let point = other.points[mirrored(index)];
        vec3(-point.x, point.y, point.z)
    });
    assert!(apart(&found.points, &back) < 3.0, "mirrored: {} %", apart(&found.points, &back));
}

#[test]
fn scan() {
    let Some(folder) = test_data() else { return };
    let found = find(&mesh(&folder.join("heads/lee_perry_smith.obj")));
    check_sensible(&found);
    assert!(!found.symmetric && found.confidence > 0.5);
}

#[test]
fn cow() {
    let Some(folder) = test_data() else { return };
    let (points, triangles) = mesh(&folder.join("creatures/spot.obj"));
    // Its front is the other way.
    let turned: Vec<Vec3> = points.iter().map(|point| vec3(-point.x, point.y, -point.z)).collect();
    let found = find(&(turned, triangles));
    check_sensible(&found);
    assert!(found.symmetric && found.confidence < 0.5);
}

/// A sphere of `rings` rings.
fn sphere(rings: u32) -> Mesh {
    let around = rings * 2;
    let mut points = Vec::new();
    for ring in 0..=rings {
        let turn = std::f32::consts::PI * ring as f32 / rings as f32;
        for step in 0..around {
            let angle = std::f32::consts::TAU * step as f32 / around as f32;
            points.push(vec3(turn.sin() * angle.sin(), turn.cos(), turn.sin() * angle.cos()));
        }
    }
    let at = |ring: u32, step: u32| ring * around + step % around;
    let cells = (0..rings).flat_map(|ring| (0..around).map(move |step| (ring, step)));
    let quads = cells.flat_map(|(ring, step)| {
        let [a, b, c, d] = [at(ring, step), at(ring + 1, step), at(ring + 1, step + 1), at(ring, step + 1)];
        [[a, b, c], [a, c, d]]
    });
    let triangles = quads.collect();
    (points, triangles)
}

fn all_skin(points: &[Vec3]) -> Shells {
    Shells { shell_of: vec![0; points.len()], kinds: vec![ShellKind::Skin] }
}

#[test]
fn sphere_is_unsure() {
    let (points, triangles) = sphere(24);
    match find_landmarks(&points, &triangles, &all_skin(&points)) {
        Ok(found) => {
            assert!(found.points.iter().all(|point| point.is_finite()));
            assert!(found.confidence < 0.5, "sure of a sphere: {}", found.confidence);
        }
        Err(error) => assert_eq!(error, LandmarkError::NoFront),
    }
}

#[test]
fn bad_input() {
    let none = Shells::default();
    assert_eq!(find_landmarks(&[], &[], &none), Err(LandmarkError::Empty));
    let (mut points, triangles) = sphere(6);
    assert_eq!(find_landmarks(&points, &[], &all_skin(&points)), Err(LandmarkError::Empty));
    let flat: Vec<Vec3> = points.iter().map(|point| vec3(point.x, point.y, 0.0)).collect();
    assert_eq!(find_landmarks(&flat, &triangles, &all_skin(&flat)), Err(LandmarkError::Flat));
    let line: Vec<Vec3> = points.iter().map(|point| vec3(0.0, point.y, 0.0)).collect();
    assert_eq!(find_landmarks(&line, &triangles, &all_skin(&line)), Err(LandmarkError::Flat));
    let dot = vec![Vec3::ONE; points.len()];
    assert_eq!(find_landmarks(&dot, &triangles, &all_skin(&dot)), Err(LandmarkError::Empty));
    points[5].y = f32::NAN;
    assert_eq!(find_landmarks(&points, &triangles, &all_skin(&points)), Err(LandmarkError::NotFinite { point: 5 }));
    points[5].y = f32::INFINITY;
    assert_eq!(find_landmarks(&points, &triangles, &all_skin(&points)), Err(LandmarkError::NotFinite { point: 5 }));
    // Too few triangles for anything, corners that do not exist, a tetrahedron: an answer or an error, no panic.
    let (points, _) = sphere(6);
    for triangles in [vec![[0, 20, 40]], vec![[0, 1, 4_000_000]], vec![[7, 7, 7]], vec![[0, 30, 50], [30, 50, 60]]] {
        let _ = find_landmarks(&points, &triangles, &all_skin(&points));
    }
    let corners = [vec3(0.0, 1.0, 0.0), vec3(-1.0, -1.0, -1.0), vec3(1.0, -1.0, -1.0), vec3(0.0, -1.0, 1.0)];
    let _ = find_landmarks(&corners, &[[0, 1, 3], [0, 3, 2], [0, 2, 1], [1, 2, 3]], &all_skin(&corners));
}

#[test]
fn depth_map_of_a_slope() {
    // A square that rises to the right, in front of one further back.
    let points =
        [(-1.0, -1.0, 0.0), (1.0, -1.0, 2.0), (1.0, 1.0, 2.0), (-1.0, 1.0, 0.0)].map(|(x, y, z)| vec3(x, y, z));
    let mut all = points.to_vec();
    all.extend(points.map(|point| point - Vec3::Z));
    let triangles = [[4, 5, 6], [4, 6, 7], [0, 1, 2], [0, 2, 3]];
    let frame = DepthFrame::over(glam::Vec2::splat(-1.5), glam::Vec2::splat(1.5), 0.1, 100);
    let map = DepthMap::draw(frame, &all, &triangles, |_| true);
    for (x, y) in [(0.0, 0.0), (0.5, -0.7), (-0.9, 0.9), (0.333, 0.111)] {
        let depth = map.sample(glam::vec2(x, y)).unwrap();
        assert!((depth - (x + 1.0)).abs() < 1e-4, "{x} {y}: {depth}");
    }
    assert_eq!(map.sample(glam::vec2(1.3, 0.0)), None);
    assert_eq!(map.sample(glam::vec2(9.0, 9.0)), None);
    let seen = map.triangle.iter().filter(|&&triangle| triangle < 2).count();
    assert_eq!(seen, 0, "what lies behind shows");
    let behind = DepthMap::draw(frame, &all, &triangles, |index| index < 2);
    assert!((behind.sample(glam::Vec2::ZERO).unwrap() - 0.0).abs() < 1e-4);
}
