//! Models that are joined, whose weights are of other numbers of points.

use bevy::math::Vec3;
use rigsmith::mesh::model::{Model, Weights};

/// Weights of a mesh that has lost or got points stay with that mesh.
#[test]
fn joined_models_keep_their_points_weights_apart() {
    let model = |points: usize, rows: &[(u32, f32)]| {
        let mut weights = Weights::default();
        rows.iter().for_each(|row| weights.push([*row]));
        Model { points: vec![Vec3::ZERO; points], weights: Some(weights), ..Model::default() }
    };
    let next = [(7, 1.0), (8, 0.5)];
    for rows in [0, 1, 2, 3] {
        let own: Vec<(u32, f32)> = (0..rows).map(|row| (row, 0.25)).collect();
        for more in [1, 2] {
            let mut joined = model(2, &own);
            joined.append(model(2, &next[..more]));
            joined.append(model(1, &[(9, 1.0)]));
            let weights = joined.weights.as_ref().expect("weights");
            assert_eq!((joined.points.len(), weights.len()), (5, 5));
            let of = |point: usize| weights.of(point).collect::<Vec<_>>();
            assert_eq!((0..2).flat_map(of).collect::<Vec<_>>(), own[..own.len().min(2)], "{rows} rows for 2 points");
            assert_eq!((2..4).flat_map(of).collect::<Vec<_>>(), next[..more]);
            assert_eq!(of(4), [(9, 1.0)]);
            assert_eq!([weights.joints.len(), weights.values.len()], [weights.starts[5] as usize; 2]);
        }
    }
}
