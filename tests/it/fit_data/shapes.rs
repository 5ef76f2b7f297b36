//! Shapes that are no figures, made here: there is no fit, or one with a low confidence and the reason.

use std::f32::consts::{PI, TAU};

use bevy::math::{Vec3, ops};
use rigsmith::{
    algo::fit_template::{FitError, FitNote},
    files::bundled_characters,
};

use super::{fitted, variants::Mesh};

/// Points on each circle of a shape.
const AROUND: u32 = 24;

/// Skin over circles, each with its centre and radius, whose centres lie in a plane across Z.
fn swept(circles: &[(Vec3, f32)]) -> Mesh {
    let mut points = Vec::new();
    let last = circles.len() - 1;
    for (number, (centre, radius)) in circles.iter().enumerate() {
        let along = circles[(number + 1).min(last)].0 - circles[number.saturating_sub(1)].0;
        let across = along.try_normalize().unwrap_or(Vec3::Y).cross(Vec3::Z);
        for step in 0..AROUND {
            let (sin, cos) = ops::sin_cos(TAU * step as f32 / AROUND as f32);
            points.push(*centre + *radius * (cos * Vec3::Z + sin * across));
        }
    }
    (points, sheet(last as u32, AROUND, AROUND))
}

/// Triangles from `count` rows of `wide` points to the row after each, two at the first `around` points of a row.
fn sheet(count: u32, wide: u32, around: u32) -> Vec<[u32; 3]> {
    let faces = |row: u32| {
        (0..around).flat_map(move |step| {
            let (a, b) = (row * wide + step, row * wide + (step + 1) % wide);
            [[a, a + wide, b], [b, a + wide, b + wide]]
        })
    };
    (0..count).flat_map(faces).collect()
}

/// A belly with a lid and a knob, a spout, and a handle, each in a shell of its own.
pub fn teapot() -> Mesh {
    let profile: [(f32, f32); 13] = [
        (0.0, 0.0),
        (0.7, 0.0),
        (0.95, 0.3),
        (1.0, 0.6),
        (0.85, 1.0),
        (0.6, 1.2),
        (0.55, 1.25),
        (0.3, 1.38),
        (0.08, 1.42),
        (0.08, 1.5),
        (0.14, 1.56),
        (0.1, 1.66),
        (0.0, 1.68),
    ];
    let belly = profile.map(|(radius, y)| (Vec3::Y * y, radius));
    let spout: [(f32, f32, f32); 4] = [(0.8, 0.5, 0.22), (1.1, 0.6, 0.17), (1.35, 0.85, 0.12), (1.55, 1.2, 0.09)];
    let spout = spout.map(|(x, y, radius)| (Vec3::new(x, y, 0.0), radius));
    let handle: Vec<(Vec3, f32)> = (0..13)
        .map(|step| {
            let (sin, cos) = ops::sin_cos(PI * step as f32 / 12.0);
            (Vec3::new(-0.85 - 0.55 * sin, 0.62 + 0.42 * cos, 0.0), 0.09)
        })
        .collect();
    let (mut points, mut triangles) = swept(&belly);
    for (more, faces) in [swept(&spout), swept(&handle)] {
        let first = points.len() as u32;
        points.extend(more);
        triangles.extend(faces.into_iter().map(|corners| corners.map(|corner| corner + first)));
    }
    (points, triangles)
}

fn sphere() -> Mesh {
    let circles: Vec<(Vec3, f32)> = (0..17)
        .map(|step| {
            let (sin, cos) = ops::sin_cos(PI * step as f32 / 16.0);
            (Vec3::Y * (1.0 - cos), sin)
        })
        .collect();
    swept(&circles)
}

/// Fits every template that goes into the shape, and expects none that is trusted.
#[track_caller]
fn check(name: &str, (points, triangles): &Mesh) {
    for rig in bundled_characters() {
        let template = rig.about().name.clone();
        match fitted(points, triangles, &template) {
            Ok(fit) => {
                println!("{name}: {template} with a confidence of {:.2}, {:?}", fit.confidence, fit.notes);
                assert!(fit.confidence < 0.5, "{name}: {template} with {}", fit.confidence);
                let is_told = fit.notes.iter().any(|note| matches!(note, FitNote::MissingLimb(_)));
                assert!(is_told, "{name}: {template}: {:?}", fit.notes);
                // And the joints say it themselves.
                let doubtful = fit.joints.iter().filter(|joint| joint.confidence < 0.5).count();
                assert!(2 * doubtful > fit.joints.len(), "{name}: {doubtful} doubtful joints of {template}");
            }
            Err(error) => {
                println!("{name}: {template}: {error}");
                assert!(matches!(error, FitError::TooFewLimbs { .. }), "{name}: {template}: {error}");
            }
        }
    }
}

#[test]
fn a_teapot_is_no_figure() {
    check("teapot", &teapot());
}

#[test]
fn a_sphere_is_no_figure() {
    check("sphere", &sphere());
}

/// A triangle and a plane are flat, whatever the template.
#[test]
fn flat_shapes_are_refused() {
    let triangle: Mesh = (vec![Vec3::ZERO, Vec3::X, Vec3::new(0.3, 1.0, 0.2)], vec![[0, 1, 2]]);
    let points = (0..21 * 21).map(|i| Vec3::new((i % 21) as f32, 0.0, (i / 21) as f32)).collect();
    let plane: Mesh = (points, sheet(20, 21, 20));
    for (name, (points, triangles)) in [("triangle", triangle), ("plane", plane)] {
        for rig in bundled_characters() {
            let error = fitted(&points, &triangles, &rig.about().name).map(|fit| fit.confidence);
            assert!(matches!(error, Err(FitError::Flat | FitError::NoSurface)), "{name}: {error:?}");
        }
    }
}
