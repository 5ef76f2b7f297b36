//! Loose parts on a face: glasses and rings keep their shape, lashes and brows go with the skin.

use std::{collections::BTreeMap, f32::consts::TAU, ops::Range};

use glam::Vec3;
use rigsmith::{
    algo::face::{
        auto::{AutoFace, AutoSettings, FaceAnalysis},
        expression::ExpressionSet,
        landmarks::Landmarks,
        shells::ShellKind,
    },
    mesh::model::Weights,
};

use crate::heads;

/// Number of corners of a wire.
const CORNERS: u32 = 6;

/// Adds a wire along some places, in a ring if it ends where it begins; returns its points.
fn add_wire((points, triangles): &mut heads::Mesh, places: &[Vec3], radius: f32, is_ring: bool) -> Range<usize> {
    let first = points.len() as u32;
    let count = places.len();
    for (at, place) in places.iter().enumerate() {
        let [before, after] = match is_ring {
            true => [(at + count - 1) % count, (at + 1) % count],
            false => [at.saturating_sub(1), (at + 1).min(count - 1)],
        };
        let (one, other) = (places[after] - places[before]).normalize().any_orthonormal_pair();
        points.extend((0..CORNERS).map(|corner| {
            let (sin, cos) = (TAU * corner as f32 / CORNERS as f32).sin_cos();
            *place + radius * (one * cos + other * sin)
        }));
    }
    let sections = if is_ring { count } else { count - 1 } as u32;
    for section in 0..sections {
        let next = (section + 1) % count as u32;
        for corner in 0..CORNERS {
            let beside = (corner + 1) % CORNERS;
            let [a, b] = [corner, beside].map(|corner| first + section * CORNERS + corner);
            let [d, c] = [corner, beside].map(|corner| first + next * CORNERS + corner);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    first as usize..points.len()
}

/// Places around an upright ring.
fn ring(middle: Vec3, radii: [f32; 2], turn: f32) -> Vec<Vec3> {
    let at = |step: u8| {
        let (sin, cos) = (turn + TAU * f32::from(step) / 24.0).sin_cos();
        middle + Vec3::new(radii[0] * cos, radii[1] * sin, 0.0)
    };
    (0..24).map(at).collect()
}

/// Adds a strip of skin-like cards that stand on a line; returns its points.
fn add_strip((points, triangles): &mut heads::Mesh, line: &[Vec3], to: Vec3) -> Range<usize> {
    let first = points.len() as u32;
    points.extend(line.iter().flat_map(|root| [*root, *root + to]));
    for section in 0..line.len() as u32 - 1 {
        let at = first + 2 * section;
        triangles.extend([[at, at + 1, at + 3], [at, at + 3, at + 2]]);
    }
    first as usize..points.len()
}

/// A line through some landmarks, finer than they are.
fn line_through(marks: &[Vec3]) -> Vec<Vec3> {
    let fine =
        marks.windows(2).flat_map(|ends| (0..4_u8).map(move |step| ends[0].lerp(ends[1], f32::from(step) / 4.0)));
    fine.chain(marks.last().copied()).collect()
}

fn analysed(mesh: &heads::Mesh) -> (FaceAnalysis, AutoFace) {
    let settings = AutoSettings { up: Some(Vec3::Y), forward: Some(Vec3::Z), whole: true, ..AutoSettings::default() };
    let analysis = FaceAnalysis::new(&mesh.0, &mesh.1, &settings, &|_, _| true).unwrap();
    let face = analysis.rig(&[], &settings, ExpressionSet::bundled(), &|_, _| true).unwrap();
    (analysis, face)
}

/// Landmarks of the bundled head, whose mesh is in head space.
fn bundled_landmarks(mesh: &heads::Mesh) -> Landmarks {
    analysed(mesh).0.landmarks
}

/// The most front place of a mesh near a place, seen from in front.
fn front(mesh: &heads::Mesh, at: Vec3, reach: f32) -> Vec3 {
    let near = mesh.0.iter().filter(|point| point.truncate().distance(at.truncate()) < reach);
    at.with_z(near.map(|point| point.z).fold(at.z, f32::max))
}

/// Largest difference of two points' weights, half the sum of the differences of all joints.
fn spread(weights: &Weights, points: Range<usize>) -> f32 {
    let row = |point: usize| weights.of(point).collect::<BTreeMap<u32, f32>>();
    let first = row(points.start);
    let off = |point: usize| {
        let own = row(point);
        let joints = first.keys().chain(own.keys().filter(|joint| !first.contains_key(*joint)));
        0.5 * joints.map(|joint| (value(&own, *joint) - value(&first, *joint)).abs()).sum::<f32>()
    };
    points.map(off).fold(0.0, f32::max)
}

fn value(row: &BTreeMap<u32, f32>, joint: u32) -> f32 {
    row.get(&joint).copied().unwrap_or(0.0)
}

/// Least weight of a joint in some points.
fn least(weights: &Weights, points: Range<usize>, joint: u32) -> f32 {
    let share = |point: usize| weights.of(point).filter(|(of, _)| *of == joint).map(|(_, value)| value).sum::<f32>();
    points.map(share).fold(1.0, f32::min)
}

/// Joint of the head.
const HEAD: u32 = 1;

/// Glasses whose bridge lies on the nose, and a monocle, ride with the head alone.
#[test]
fn glasses_ride_with_the_head() {
    let mut mesh = heads::bundled();
    let marks = bundled_landmarks(&mesh);
    let e = marks.eye_distance();
    let lens = |left: bool| front(&mesh, marks.eye_center(left), 0.05 * e) + 0.05 * e * Vec3::Z;
    let bridge = front(&mesh, marks.points[27], 0.05 * e);
    let (left, right) = (ring(lens(true), [0.26 * e, 0.2 * e], 0.5 * TAU), ring(lens(false), [0.26 * e, 0.2 * e], 0.0));
    let frame: Vec<Vec3> = left.into_iter().chain([bridge]).chain(right).collect();
    let monocle = ring(lens(true) - 0.03 * e * Vec3::Z, [0.2 * e, 0.2 * e], 0.0);
    let frame = add_wire(&mut mesh, &frame, 0.015 * e, false);
    let (_, face) = analysed(&mesh);
    let held = least(&face.weights, frame, HEAD);
    assert!(held > 0.999, "the frame follows the head by {held} only");

    mesh = heads::bundled();
    let monocle = add_wire(&mut mesh, &monocle, 0.012 * e, true);
    let (_, face) = analysed(&mesh);
    let held = least(&face.weights, monocle, HEAD);
    assert!(held > 0.999, "the monocle follows the head by {held} only");
}

/// Rings in the brow and the lip, and at the ear, move as one piece.
#[test]
fn rings_keep_their_shape() {
    let mut mesh = heads::bundled();
    let marks = bundled_landmarks(&mesh);
    let e = marks.eye_distance();
    let lip = front(&mesh, marks.points[57], 0.03 * e);
    let brow = front(&mesh, marks.points[19], 0.03 * e);
    let ear = marks.points[0].with_y(marks.points[30].y - 0.2 * e);
    let rings = [
        ("lip", add_wire(&mut mesh, &ring(lip, [0.04 * e, 0.06 * e], 0.0), 0.008 * e, true)),
        ("brow", add_wire(&mut mesh, &ring(brow, [0.04 * e, 0.06 * e], 0.0), 0.008 * e, true)),
        ("ear", add_wire(&mut mesh, &ring(ear, [0.03 * e, 0.2 * e], 0.0), 0.01 * e, true)),
    ];
    let (_, face) = analysed(&mesh);
    for (name, points) in rings {
        let spread = spread(&face.weights, points);
        assert!(spread < 1e-3, "weights of the ring at the {name} differ by {spread}");
    }
}

/// Lashes and brows that are strips of their own go with lids and brows, and not with the head alone.
#[test]
fn lashes_and_brows_go_with_the_skin() {
    let mut mesh = heads::bundled();
    let marks = bundled_landmarks(&mesh);
    let e = marks.eye_distance();
    let on_skin = |line: Vec<Vec3>| -> Vec<Vec3> {
        line.into_iter().map(|place| front(&mesh, place, 0.03 * e) + 0.005 * e * Vec3::Z).collect()
    };
    let lash = line_through(&marks.points[36..40]);
    let brow = on_skin(line_through(&marks.points[17..22]));
    let floating: Vec<Vec3> = brow.iter().map(|place| *place + 0.06 * e * Vec3::Z).collect();
    let strips = [
        ("lash", add_strip(&mut mesh, &lash, e * Vec3::new(0.0, 0.03, 0.1))),
        ("brow", add_strip(&mut mesh, &brow, e * Vec3::new(0.0, 0.06, 0.01))),
        ("floating brow", add_strip(&mut mesh, &floating, e * Vec3::new(0.0, 0.06, 0.01))),
    ];
    let (_, face) = analysed(&mesh);
    for (name, points) in strips {
        let middle = points.start + points.len() / 2;
        let held = least(&face.weights, middle..middle + 1, HEAD);
        assert!(held < 0.5, "the middle of the {name} follows the head by {held}");
    }
}

/// Adds a sheet of two layers through a grid of places, as thin as `thickness`; returns its points.
fn add_sheet((points, triangles): &mut heads::Mesh, rows: &[Vec<Vec3>], thickness: Vec3) -> Range<usize> {
    let first = points.len() as u32;
    let width = rows[0].len() as u32;
    let layer = width * rows.len() as u32;
    points.extend(rows.iter().flatten());
    points.extend(rows.iter().flatten().map(|place| *place + thickness));
    for row in 0..rows.len() as u32 - 1 {
        for column in 0..width - 1 {
            let at = first + row * width + column;
            let [a, b, c, d] = [at, at + 1, at + width + 1, at + width];
            triangles.extend([
                [a, b, c],
                [a, c, d],
                [a + layer, c + layer, b + layer],
                [a + layer, d + layer, c + layer],
            ]);
        }
    }
    let corners = [0, layer].map(|layer| [first + layer, first + layer + 1]);
    triangles.extend([[corners[0][0], corners[1][0], corners[0][1]], [corners[0][1], corners[1][0], corners[1][1]]]);
    first as usize..points.len()
}

/// Adds a dome of felt over the skull with a brim around it; returns its points.
fn add_hat(mesh: &mut heads::Mesh, marks: &Landmarks, brim: f32, rise: f32) -> Range<usize> {
    let e = marks.eye_distance();
    let base = marks.points[19].y + 0.35 * e;
    let around = mesh.0.iter().filter(|point| (point.y - base).abs() < 0.15 * e);
    let (low, high) = around.fold((Vec3::MAX, Vec3::MIN), |(low, high), point| (low.min(*point), high.max(*point)));
    let top = mesh.0.iter().map(|point| point.y).fold(f32::MIN, f32::max) + rise * e;
    let (middle, radii) = (0.5 * (low + high), 0.5 * (high - low) + 0.05 * e);
    let ring = |share: f32, y: f32| -> Vec<Vec3> {
        let at = |step: u8| {
            let (sin, cos) = (TAU * f32::from(step) / 36.0).sin_cos();
            Vec3::new(middle.x + share * radii.x * cos, y, middle.z + share * radii.z * sin)
        };
        (0..=36).map(at).collect()
    };
    let edge = [brim, 0.5 * (1.0 + brim)].map(|share| ring(share, base));
    let dome = (0..=10_u8).map(|step| {
        let (sin, cos) = (0.25 * TAU * f32::from(step) / 10.0).sin_cos();
        ring(cos.max(0.0).powf(0.7), base + (top - base) * sin)
    });
    let rows: Vec<Vec<Vec3>> = edge.into_iter().chain(dome).collect();
    add_sheet(mesh, &rows, 0.02 * e * Vec3::Y)
}

/// Adds dark glass in front of the skin, between two shares of the face's width from its middle; returns its points.
fn add_glass(mesh: &mut heads::Mesh, marks: &Landmarks, [from, to]: [f32; 2], gap: f32) -> Range<usize> {
    let e = marks.eye_distance();
    let width = (marks.points[0].x - marks.points[16].x).abs();
    let eyes = 0.5 * (marks.eye_center(true) + marks.eye_center(false));
    let row = |row: u8| {
        let y = eyes.y + e * (0.22 - 0.44 * f32::from(row) / 8.0);
        let at = |column: u8| marks.middle + width * (from + (to - from) * f32::from(column) / 24.0);
        (0..=24).map(|column| front(mesh, Vec3::new(at(column), y, eyes.z - e), 0.12 * e) + gap * e * Vec3::Z).collect()
    };
    let rows: Vec<Vec<Vec3>> = (0..=8).map(row).collect();
    add_sheet(mesh, &rows, 0.02 * e * Vec3::Z)
}

/// Hats with brims and dark glasses, as large as pieces of skin, are no skin: the landmarks under them are those of the
/// bare head, and they follow the head alone.
#[test]
fn hats_and_sunglasses_are_no_skin() {
    let mut wrong = Vec::new();
    for (head, bare) in heads::bundled_and("ict_identity_3") {
        let marks = analysed(&bare).0.landmarks;
        let e = marks.eye_distance();
        let worn = |parts: &dyn Fn(&mut heads::Mesh) -> Vec<Range<usize>>| {
            let mut mesh = bare.clone();
            let parts = parts(&mut mesh);
            (mesh, parts)
        };
        let cases = [
            ("cap", worn(&|mesh| vec![add_hat(mesh, &marks, 1.1, 0.05)])),
            ("hat", worn(&|mesh| vec![add_hat(mesh, &marks, 1.5, 0.2)])),
            ("sombrero", worn(&|mesh| vec![add_hat(mesh, &marks, 2.0, 0.3)])),
            ("glasses", worn(&|mesh| vec![add_glass(mesh, &marks, [-0.4, 0.4], 0.06)])),
            ("close glasses", worn(&|mesh| vec![add_glass(mesh, &marks, [-0.4, 0.4], 0.01)])),
            ("small glasses", worn(&|mesh| vec![add_glass(mesh, &marks, [-0.2, 0.2], 0.04)])),
            (
                "two lenses",
                worn(&|mesh| [[-0.42, -0.05], [0.05, 0.42]].map(|at| add_glass(mesh, &marks, at, 0.05)).into()),
            ),
            (
                "close lenses",
                worn(&|mesh| [[-0.42, -0.05], [0.05, 0.42]].map(|at| add_glass(mesh, &marks, at, 0.01)).into()),
            ),
        ];
        for (name, (mesh, parts)) in cases {
            let (analysis, face) = analysed(&mesh);
            let own = analysis.landmarks.points.iter().zip(&marks.points);
            let off = own.map(|(found, bare)| found.distance(*bare)).fold(0.0, f32::max) / e;
            let is_skin = parts.iter().any(|points| analysis.shells.kind(points.start) == ShellKind::Skin);
            let held = parts.into_iter().map(|points| least(&face.weights, points, HEAD)).fold(1.0, f32::min);
            println!("{head}, {name}: skin {is_skin}, follows the head by {held:.3}, landmarks off by {off:.4}");
            if is_skin || held < 0.999 || off > 0.01 {
                wrong.push(format!(
                    "{head}, {name}: skin {is_skin}, follows the head by {held}, landmarks off by {off}"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
