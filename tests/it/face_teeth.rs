//! Teeth and gums that are shells of their own: which of them the jaw moves.

use glam::Vec3;
use rigsmith::algo::face::{
    auto::{AutoSettings, FaceAnalysis},
    bones::FaceBoneKind,
    expression::ExpressionSet,
};

use crate::{face_eyes::add_bar, heads, prerequisites::test_data};

/// Adds a gum: a tube with four corners along some places.
fn add_gum((points, triangles): &mut heads::Mesh, places: &[Vec3], size: Vec3) {
    let first = points.len() as u32;
    for place in places {
        points.extend(
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[y, z]: [f32; 2]| *place + 0.5 * size * Vec3::new(0.0, y, z)),
        );
    }
    for section in 0..places.len() as u32 - 1 {
        for corner in 0..4 {
            let [a, b] = [corner, (corner + 1) % 4].map(|corner| first + 4 * section + corner);
            triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
}

/// Single teeth go with the gum above or below them, also those in the back, which are as far below the plane of the lips as
/// the front teeth of the other jaw. Of six at each side the last is not told from the other jaw's yet, and is left out.
#[test]
fn single_teeth_go_with_their_jaw() {
    let Some(data) = test_data() else { return };
    let mut mesh = heads::mesh(&data.join("heads/ict_neutral.obj"));
    let marks = heads::true_landmarks(&mesh.0, &heads::truth(&data));
    let eyes = marks.eye_distance();
    let middle = marks.points[60..68].iter().sum::<Vec3>() / 8.0;
    let half = 0.5 * (marks.points[48].x - marks.points[54].x).abs();
    let on_arch = |along: f32, up: f32, width: f32| {
        middle + Vec3::new(width * half * along, up * eyes, -0.05 * eyes - 0.81 * half * along * along)
    };
    let skin = mesh.0.len();
    for side in [1.0, -1.0] {
        for tooth in -5..=5_i8 {
            let at = on_arch(f32::from(tooth) / 6.0, 0.045 * side, 0.8);
            add_bar(&mut mesh, at, Vec3::new(0.12 * half, 0.08 * eyes, 0.04 * eyes));
        }
        let places: Vec<Vec3> = (-12..=12_i8).map(|at| on_arch(f32::from(at) / 12.0, 0.1 * side, 0.85)).collect();
        add_gum(&mut mesh, &places, 0.06 * eyes * Vec3::ONE);
    }
    let settings =
        AutoSettings { bones: 12, up: Some(Vec3::Y), forward: Some(Vec3::Z), whole: true, ..AutoSettings::default() };
    let analysis = FaceAnalysis::new(&mesh.0, &mesh.1, &settings, &|_, _| true).unwrap();
    let face = analysis.rig(&[], &settings, ExpressionSet::bundled(), &|_, _| true).unwrap();
    let jaw = 2 + face.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw).unwrap();
    let upper = skin + (mesh.0.len() - skin) / 2;
    for point in skin..mesh.0.len() {
        let share: f32 =
            face.weights.of(point).filter(|(joint, _)| *joint as usize == jaw).map(|(_, value)| value).sum();
        let wanted = if point < upper { 0.0 } else { 1.0 };
        assert!((share - wanted).abs() < 1e-3, "point {} of the teeth follows the jaw by {share}", point - skin);
    }
}
