//! Fits of bodies that are not alone in their mesh: what they stand on, wear or have beside them is left out, and told.

use std::{fmt::Write, path::PathBuf};

use bevy::math::Vec3;
use serde_json::Value;

use crate::cli_build::rigsmith;

/// Points and faces that are added to the bundled body; numbers of points are from nought.
type Added = (Vec<Vec3>, Vec<Vec<usize>>);

/// The bundled body with other shells, as OBJ; `turn` maps its points.
fn mesh(others: &[Added], turn: impl Fn(Vec3) -> Vec3) -> String {
    let body = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj");
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for line in std::fs::read_to_string(body).unwrap().lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.take(3).map(|word| word.parse().unwrap()).collect();
                points.push(Vec3::from_slice(&numbers));
            }
            Some("f") => {
                let corner = |word: &str| word.split('/').next().unwrap().parse::<usize>().unwrap() - 1;
                faces.push(words.map(corner).collect::<Vec<_>>());
            }
            _ => {}
        }
    }
    for (own, corners) in others {
        let before = points.len();
        points.extend(own);
        faces.extend(corners.iter().map(|face| face.iter().map(|corner| corner + before).collect::<Vec<_>>()));
    }
    let mut text = String::new();
    for point in points.into_iter().map(turn) {
        writeln!(text, "v {} {} {}", point.x, point.y, point.z).unwrap();
    }
    for face in faces {
        let corners: Vec<String> = face.iter().map(|corner| (corner + 1).to_string()).collect();
        writeln!(text, "f {}", corners.join(" ")).unwrap();
    }
    text
}

fn cuboid(low: [f32; 3], high: [f32; 3]) -> Added {
    let corner = |number: usize| {
        Vec3::from_array([0, 1, 2].map(|axis| if number >> axis & 1 == 1 { high[axis] } else { low[axis] }))
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    ((0..8).map(corner).collect(), faces.map(Vec::from).into())
}

/// A sheet of so many by so many points.
fn sheet(across: usize, along: usize, is_closed: bool, place: impl Fn(f32, f32) -> Vec3) -> Added {
    let columns = if is_closed { across } else { across - 1 };
    let mut points = Vec::new();
    for row in 0..along {
        for column in 0..across {
            points.push(place(column as f32 / columns as f32, row as f32 / (along - 1) as f32));
        }
    }
    let mut faces = Vec::new();
    for row in 0..along - 1 {
        for column in 0..columns {
            let next = (column + 1) % across;
            let at = |row: usize, column: usize| row * across + column;
            faces.push(vec![at(row, column), at(row, next), at(row + 1, next), at(row + 1, column)]);
        }
    }
    (points, faces)
}

fn fitted(text: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("body.obj"), text).unwrap();
    let answer = rigsmith(folder.path(), &["--json", "fit", "body.obj", "-o", "out.rig.ron"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    answer.json()
}

fn places(fit: &Value) -> Vec<Vec3> {
    let joints = fit["joints"].as_array().unwrap();
    joints.iter().map(|joint| serde_json::from_value::<[f32; 3]>(joint["position"].clone()).unwrap().into()).collect()
}

#[test]
fn what_is_no_part_of_the_figure_is_left_out() {
    let same = |point: Vec3| point;
    let alone = fitted(&mesh(&[], same));
    let (body, height) = (places(&alone), alone["height"].as_f64().unwrap() as f32);
    let confidence = |fit: &Value| fit["confidence"].as_f64().unwrap();
    assert!(confidence(&alone) > 0.9, "{}", confidence(&alone));
    let cloak = sheet(9, 12, false, |u, v| Vec3::new(0.6 * (u - 0.5), 0.3 + 1.1 * v, -0.28 + 0.2 * (u - 0.5).powi(2)));
    let skirt = sheet(24, 8, true, |u, v| {
        let (turn, wide) = (std::f32::consts::TAU * u, 0.32 - 0.14 * v);
        Vec3::new(wide * turn.cos(), 0.15 + 0.85 * v, wide * turn.sin())
    });
    let (points, faces) = mesh_of_body();
    let second: Added = (points.iter().map(|point| *point + Vec3::X * 2.6).collect(), faces);
    let cases = [
        ("a ground", cuboid([-2.0, -0.05, -2.0], [2.0, -0.01, 2.0]), "that the figure stands on"),
        ("a ground that it touches", cuboid([-2.0, -0.05, -2.0], [2.0, 0.005, 2.0]), "that the figure stands on"),
        ("a pedestal", cuboid([-0.4, -0.3, -0.4], [0.4, 0.001, 0.4]), "that the figure stands on"),
        ("a box elsewhere", cuboid([2.0, 0.0, 0.0], [2.3, 0.3, 0.3]), "too far from the body"),
        ("a second figure", second, "too far from the body"),
        ("a cloak", cloak, "open sheet about"),
        ("a skirt", skirt, "open sheet about"),
    ];
    for (name, added, note) in cases {
        let fit = fitted(&mesh(&[added], same));
        assert_eq!(fit["template"].as_str(), Some("biped"), "{name}: {}", fit["choice"]);
        assert!(fit["notes"].to_string().contains(note), "{name}: {}", fit["notes"]);
        let off = places(&fit).iter().zip(&body).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max) / height;
        assert!(off < 0.003, "{name}: joints move by {off} of the height");
        assert!(confidence(&fit) > 0.9, "{name}: {}", confidence(&fit));
    }
}

/// A file with Z up has its ground below, too; a pack, which is no open sheet, stays.
#[test]
fn grounds_are_known_in_turned_files() {
    let ground = cuboid([-2.0, -0.05, -2.0], [2.0, -0.01, 2.0]);
    let fit = fitted(&mesh(&[ground], |point| Vec3::new(point.x, -point.z, point.y)));
    assert_eq!((fit["template"].as_str(), fit["up"][2].as_f64()), (Some("biped"), Some(1.0)));
    assert!(fit["notes"].to_string().contains("that the figure stands on"), "{}", fit["notes"]);

    let pack = cuboid([-0.15, 1.0, -0.35], [0.15, 1.4, -0.1]);
    let notes = fitted(&mesh(&[pack], |point: Vec3| point))["notes"].to_string();
    assert!(!notes.contains("sheets") && !notes.contains("stands on"), "{notes}");
}

/// The bundled body with other shells, each an object of its own, as OBJ.
fn objects(others: Vec<Added>) -> String {
    let (mut text, mut before) = (String::new(), 0);
    for (number, (points, faces)) in std::iter::once(mesh_of_body()).chain(others).enumerate() {
        writeln!(text, "o part_{number}").unwrap();
        for point in &points {
            writeln!(text, "v {} {} {}", point.x, point.y, point.z).unwrap();
        }
        for face in &faces {
            let corners: Vec<String> = face.iter().map(|corner| (corner + before + 1).to_string()).collect();
            writeln!(text, "f {}", corners.join(" ")).unwrap();
        }
        before += points.len();
    }
    text
}

/// A knight: helmet, sword, shield, belt, boots and a cloak in meshes of their own, which together look like a hand.
#[test]
fn a_figure_in_armour_is_fitted_without_it() {
    let cloak = sheet(9, 12, false, |u, v| Vec3::new(0.9 * (u - 0.5), 0.3 + 1.1 * v, -0.2 + 0.2 * (u - 0.5).powi(2)));
    let worn = vec![
        cuboid([-0.13, 1.5, -0.15], [0.13, 1.85, 0.2]),
        cuboid([0.58, 0.9, 0.0], [0.62, 0.94, 1.0]),
        cuboid([-0.85, 0.7, -0.1], [-0.6, 1.3, 0.4]),
        cuboid([-0.25, 0.95, -0.2], [0.25, 1.02, 0.25]),
        cuboid([0.03, 0.0, -0.15], [0.28, 0.12, 0.25]),
        cuboid([-0.28, 0.0, -0.15], [-0.03, 0.12, 0.25]),
        cloak,
    ];
    let (alone, fit) = (fitted(&objects(Vec::new())), fitted(&objects(worn)));
    assert_eq!(fit["template"].as_str(), Some("biped"), "{}", fit["choice"]);
    assert!(fit["confidence"].as_f64().unwrap() > 0.9, "{}", fit["confidence"]);
    assert!(fit["notes"].to_string().contains("7 objects beside the largest one were left out"), "{}", fit["notes"]);
    let pairs = places(&fit).into_iter().zip(places(&alone));
    let off = pairs.map(|(a, b)| a.distance(b)).fold(0.0, f32::max) / alone["height"].as_f64().unwrap() as f32;
    assert!(off < 0.003, "joints move by {off} of the height");
}

/// Points and faces of the bundled body alone.
fn mesh_of_body() -> Added {
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for line in mesh(&[], |point| point).lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.map(|word| word.parse().unwrap()).collect();
                points.push(Vec3::from_slice(&numbers));
            }
            _ => faces.push(words.map(|word| word.parse::<usize>().unwrap() - 1).collect()),
        }
    }
    (points, faces)
}
