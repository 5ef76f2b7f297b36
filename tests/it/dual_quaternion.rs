//! Dual quaternion skinning: rigid parts move as their joints do, twisted limbs keep their radius.

use bevy::math::{Affine3A, Quat, Vec3};
use rigsmith::mesh::{
    model::{Model, Part, Weights},
    skinning::{posed_model, skin_points, skin_points_dual},
};

fn weights(rows: &[&[(u32, f32)]]) -> Weights {
    let mut weights = Weights::default();
    rows.iter().for_each(|row| weights.push(row.iter().copied()));
    weights
}

#[test]
fn one_joint_moves_its_points_as_its_matrix_does() {
    let turn = Quat::from_euler(bevy::math::EulerRot::XYZ, 0.4, -1.2, 2.5);
    let matrix = Affine3A::from_scale_rotation_translation(Vec3::new(1.5, 0.5, 2.0), turn, Vec3::new(3.0, -1.0, 0.2));
    let mirrored = Affine3A::from_scale_rotation_translation(Vec3::new(-1.0, 1.0, 1.0), turn, Vec3::Y);
    let points = [Vec3::new(0.3, 0.2, -0.7), Vec3::ZERO, Vec3::new(-4.0, 2.0, 1.0), Vec3::ONE];
    let rows: [&[(u32, f32)]; 4] = [&[(0, 1.0)], &[(0, 1.0)], &[(1, 1.0)], &[]];
    let moved = skin_points_dual(&points, &weights(&rows), &[matrix, mirrored]);
    for (point, (is, of)) in points.iter().zip(moved.iter().zip([Some(matrix), Some(matrix), Some(mirrored), None])) {
        let wanted = of.map_or(*point, |matrix| matrix.transform_point3(*point));
        assert!(is.position.distance(wanted) < 1e-5, "{} is not {wanted}", is.position);
    }
    assert!(moved[0].rotation.angle_between(turn) < 1e-3);
    // A pose without a matrix for a joint, and no weights at all.
    assert_eq!(skin_points_dual(&points, &weights(&rows), &[])[0].position, points[0]);
    assert_eq!(skin_points_dual(&points, &Weights::default(), &[matrix])[2].position, points[2]);
}

/// A tube along Y around two joints, the upper one of which twists: linear blending makes a candy wrapper of it.
#[test]
fn twisted_limbs_keep_their_radius() {
    let (mut points, mut rows) = (Vec::new(), Weights::default());
    for ring in 0..=10 {
        let share = ring as f32 / 10.0;
        for step in 0..12 {
            let angle = step as f32 * std::f32::consts::TAU / 12.0;
            points.push(Vec3::new(angle.cos(), share, angle.sin()));
            rows.push([(0, 1.0 - share), (1, share)].into_iter().filter(|(_, weight)| *weight > 0.0));
        }
    }
    let twist = Affine3A::from_quat(Quat::from_rotation_y(170_f32.to_radians()));
    let radius = |point: Vec3| (point.x * point.x + point.z * point.z).sqrt();
    let matrices = [Affine3A::IDENTITY, twist];
    let dual = skin_points_dual(&points, &rows, &matrices);
    let mut linear = Vec::new();
    skin_points(&points, &rows, &matrices, &mut linear);
    let thinnest = linear.iter().map(|point| radius(*point)).fold(1.0, f32::min);
    assert!(thinnest < 0.1, "linear blending keeps {thinnest}");
    for (point, at) in dual.iter().zip(&points) {
        assert!((radius(point.position) - 1.0).abs() < 1e-4 && (point.position.y - at.y).abs() < 1e-5);
    }
    // A bend and its own inverse half way is no bend; half a turn against half a turn stays finite.
    let flat = skin_points_dual(
        &points,
        &rows,
        &[twist.inverse(), Affine3A::from_quat(Quat::from_rotation_y(190_f32.to_radians()))],
    );
    assert!(flat.iter().all(|point| point.position.is_finite() && point.rotation.is_finite()));
}

#[test]
fn a_posed_model_has_turned_normals_and_no_weights() {
    let part =
        Part { vertices: vec![0, 1, 2], normals: vec![Vec3::Z; 3], triangles: vec![[0, 1, 2]], ..Part::default() };
    let rest = Model {
        points: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        objects: vec![Default::default()],
        parts: vec![part],
        weights: Some(weights(&[&[], &[], &[]])),
        ..Model::default()
    };
    let turn = Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let posed = posed_model(&rest, &weights(&[&[(0, 1.0)], &[(0, 1.0)], &[(0, 1.0)]]), &[turn]);
    assert!(posed.weights.is_none() && posed.points[2].distance(Vec3::Z) < 1e-6);
    assert!(posed.parts[0].normals.iter().all(|normal| normal.distance(-Vec3::Y) < 1e-6));
}
