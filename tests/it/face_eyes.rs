//! Eyes of a head among other balls and bars: those behind the lids are eyes, whatever else is round.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rigsmith::algo::face::{
    auto::{AutoSettings, FaceAnalysis},
    shells::ShellKind,
};

use crate::heads;

/// Adds a ball.
fn add_ball((points, triangles): &mut heads::Mesh, center: Vec3, radius: f32) {
    let (rings, sectors) = (12_u32, 16_u32);
    let first = points.len() as u32;
    points.extend([center + radius * Vec3::Y, center - radius * Vec3::Y]);
    for ring in 1..rings {
        let down = PI * ring as f32 / rings as f32;
        for sector in 0..sectors {
            let around = TAU * sector as f32 / sectors as f32;
            let way = Vec3::new(down.sin() * around.sin(), down.cos(), down.sin() * around.cos());
            points.push(center + radius * way);
        }
    }
    let at = |ring: u32, sector: u32| first + 2 + (ring - 1) * sectors + sector % sectors;
    for sector in 0..sectors {
        triangles.push([first, at(1, sector), at(1, sector + 1)]);
        triangles.push([first + 1, at(rings - 1, sector + 1), at(rings - 1, sector)]);
        for ring in 1..rings - 1 {
            triangles.push([at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1)]);
            triangles.push([at(ring, sector), at(ring + 1, sector + 1), at(ring, sector + 1)]);
        }
    }
}

/// Adds a box with eight corners.
pub fn add_bar((points, triangles): &mut heads::Mesh, center: Vec3, size: Vec3) {
    let first = points.len() as u32;
    for corner in 0..8_u32 {
        let side = |bit: u32| if corner & bit == 0 { -0.5 } else { 0.5 };
        points.push(center + size * Vec3::new(side(1), side(2), side(4)));
    }
    for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        triangles.extend([[a, b, c], [a, c, d]].map(|corners: [u32; 3]| corners.map(|corner| first + corner)));
    }
}

fn analysed((points, triangles): &heads::Mesh) -> FaceAnalysis {
    let settings = AutoSettings { up: Some(Vec3::Y), forward: Some(Vec3::Z), whole: true, ..AutoSettings::default() };
    FaceAnalysis::new(points, triangles, &settings, &|_, _| true).unwrap()
}

/// Points of the left and of the right eye.
fn eyes(analysis: &FaceAnalysis) -> [Vec<usize>; 2] {
    [ShellKind::LeftEye, ShellKind::RightEye].map(|kind| {
        let is_of_eye = |point: &usize| analysis.shells.kind(*point) == kind;
        (0..analysis.points.len()).filter(is_of_eye).collect()
    })
}

/// Adds the same on both sides.
fn with_pair(mesh: &heads::Mesh, at: Vec3, add: impl Fn(&mut heads::Mesh, Vec3)) -> heads::Mesh {
    let mut dressed = mesh.clone();
    add(&mut dressed, at);
    add(&mut dressed, at * Vec3::new(-1.0, 1.0, 1.0));
    dressed
}

/// Buns of hair and the temples of glasses are larger than the eyes, which stay the eyes.
#[test]
fn round_things_beside_the_eyes_are_none() {
    let mesh = heads::bundled();
    let plain = analysed(&mesh);
    let own = eyes(&plain);
    assert!(own.iter().all(|eye| eye.len() > 100), "the bundled head has eyes");
    // In metres.
    let buns = with_pair(&mesh, Vec3::new(0.062, 0.335, 0.005), |mesh, at| add_ball(mesh, at, 0.032));
    let temples = with_pair(&mesh, Vec3::new(0.085, 0.23, 0.03), |mesh, at| {
        add_bar(mesh, at, Vec3::new(0.004, 0.004, 0.12));
    });
    for (name, dressed) in [("buns", buns), ("temples", temples)] {
        let found = analysed(&dressed);
        assert!(eyes(&found) == own, "{name} are eyes");
        let pairs = found.landmarks.points.iter().zip(&plain.landmarks.points);
        let off = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max) / plain.landmarks.eye_distance();
        println!("{name}: landmarks {off:.4} eye distances off, confidence {}", found.landmarks.confidence);
        assert!(off < 0.05, "{name}: landmarks are {off} eye distances off");
    }
}

/// Earrings on a head without eyeballs do not turn with its gaze.
#[test]
fn earrings_are_no_eyes() {
    let (points, triangles) = heads::bundled();
    let whole = analysed(&(points.clone(), triangles.clone()));
    let is_eye = |point: usize| matches!(whole.shells.kind(point), ShellKind::LeftEye | ShellKind::RightEye);
    let kept: Vec<usize> = (0..points.len()).filter(|point| !is_eye(*point)).collect();
    let mut numbers = vec![0_u32; points.len()];
    for (number, point) in kept.iter().enumerate() {
        numbers[*point] = number as u32;
    }
    let skin = triangles.into_iter().filter(|corners| !is_eye(corners[0] as usize));
    let bare: Vec<[u32; 3]> = skin.map(|corners| corners.map(|corner| numbers[corner as usize])).collect();
    let mesh: heads::Mesh = (kept.iter().map(|point| points[*point]).collect(), bare);
    for radius in [0.008, 0.014] {
        let dressed = with_pair(&mesh, Vec3::new(0.095, 0.13, 0.0), |mesh, at| add_ball(mesh, at, radius));
        let found = analysed(&dressed);
        assert!(!found.shells.has_eyes(), "balls of {radius} at the ears are eyes");
        assert!(found.landmarks.confidence > 0.5, "confidence {}", found.landmarks.confidence);
    }
}
