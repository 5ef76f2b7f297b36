//! Bones from shapes: known rigs come back, what holds of every result, real shapes, bad input.

use glam::{Quat, Vec3};
use rigsmith::{
    algo::fit::{Fit, FitError, FitSettings, fit, fit_moves, skinned},
    files::{RealDisk, load_shapes},
    mesh::model::Weights,
};

use crate::{heads, prerequisites::test_data};

/// A flat sheet of `side` by `side` points, one unit wide.
fn sheet(side: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let at = |k: usize| k as f32 / (side - 1) as f32;
    let points = (0..side * side).map(|k| Vec3::new(at(k % side), at(k / side), 0.1 * at(k % side) * at(k / side)));
    let mut triangles = Vec::new();
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            let a = (y * side + x) as u32;
            let side = side as u32;
            triangles.extend([[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
        }
    }
    (points.collect(), triangles)
}

/// Shapes that three bones make of a sheet: smooth weights, turns and shifts of their own in each shape.
fn known_rig(points: &[Vec3], shapes: usize) -> Vec<Vec<Vec3>> {
    let bones = [Vec3::new(0.2, 0.2, 0.0), Vec3::new(0.8, 0.3, 0.0), Vec3::new(0.5, 0.8, 0.0)];
    (0..shapes)
        .map(|shape| {
            let moves: Vec<(Quat, Vec3)> = (0..3)
                .map(|bone| {
                    let k = (shape * 3 + bone) as f32;
                    let wave = |step: f32| (k * step).rem_euclid(1.0) - 0.5;
                    let turn = Quat::from_scaled_axis(Vec3::new(wave(0.618), wave(0.414), wave(0.732)) * 0.8);
                    (turn, Vec3::new(wave(0.236), wave(0.303), wave(0.317)) * 0.2)
                })
                .collect();
            points
                .iter()
                .map(|&p| {
                    let mut moved = Vec3::ZERO;
                    for (bone, (turn, shift)) in bones.iter().zip(&moves) {
                        let weight = (1.0 - 3.0 * bone.distance(p)).clamp(0.0, 0.5) * 2.0;
                        moved += weight * (*bone + *turn * (p - *bone) + *shift - p);
                    }
                    moved
                })
                .collect()
        })
        .collect()
}

fn run(points: &[Vec3], triangles: &[[u32; 3]], shapes: &[Vec<Vec3>], settings: &FitSettings) -> Fit {
    let found = fit(points, triangles, shapes, settings, &|_| true).unwrap();
    check_sound(&found, points, shapes, settings);
    found
}

/// Demands on every result.
fn check_sound(found: &Fit, points: &[Vec3], shapes: &[Vec<Vec3>], settings: &FitSettings) {
    check_weights(&found.weights, points.len(), settings);
    assert_eq!((found.positions.len(), found.moves.len()), (settings.bones, shapes.len()));
    assert!(found.positions.iter().all(|p| p.is_finite()));
    let mut sum = 0.0;
    for (shape, moves) in shapes.iter().zip(&found.moves) {
        assert_eq!(moves.len(), settings.bones);
        assert!(moves.iter().all(|m| m.rotation.is_normalized() && m.translation.is_finite()));
        let skinned = skinned(points, &found.positions, &found.weights, moves);
        sum += (0..points.len()).map(|p| f64::from((skinned[p] - points[p] - shape[p]).length_squared())).sum::<f64>();
    }
    let error = (sum / (points.len() * shapes.len()) as f64).sqrt() as f32;
    assert!((error - found.error).abs() <= 1e-3 * error.max(1e-6), "says {}, is {error}", found.error);
}

fn check_weights(weights: &Weights, points: usize, settings: &FitSettings) {
    assert_eq!(weights.len(), points);
    for point in 0..points {
        let row: Vec<(u32, f32)> = weights.of(point).collect();
        assert!(!row.is_empty() && row.len() <= settings.influences, "point {point}: {row:?}");
        assert!(row.iter().all(|e| e.0 as usize <= settings.bones && e.1 > 0.0), "point {point}: {row:?}");
        assert!((row.iter().map(|e| e.1).sum::<f32>() - 1.0).abs() < 1e-5, "point {point}: {row:?}");
        assert!(row.windows(2).all(|w| w[0].1 >= w[1].1), "point {point} is not sorted: {row:?}");
    }
}

/// The root mean square of all displacements.
fn size(shapes: &[Vec<Vec3>]) -> f32 {
    let count = shapes.iter().map(Vec::len).sum::<usize>();
    (shapes.iter().flatten().map(|d| d.length_squared()).sum::<f32>() / count as f32).sqrt()
}

#[test]
fn a_known_rig_comes_back_in_any_unit() {
    let (points, triangles) = sheet(24);
    let shapes = known_rig(&points, 8);
    for unit in [1.0f32, 1e-4, 1e5] {
        let points: Vec<Vec3> = points.iter().map(|p| *p * unit + Vec3::X * unit * 3.0).collect();
        let shapes: Vec<Vec<Vec3>> = shapes.iter().map(|s| s.iter().map(|d| *d * unit).collect()).collect();
        let settings = FitSettings { bones: 3, rounds: 40, smoothing: 0.0, ..FitSettings::default() };
        let found = run(&points, &triangles, &shapes, &settings);
        assert!(found.error < 0.02 * size(&shapes), "unit {unit}: {} of {}", found.error / unit, size(&shapes) / unit);
        for (true_place, other) in [([0.2, 0.2], 0), ([0.8, 0.3], 1), ([0.5, 0.8], 2)] {
            let place = Vec3::new(true_place[0] + 3.0, true_place[1], 0.0) * unit;
            let near = found.positions.iter().map(|p| p.distance(place)).fold(f32::INFINITY, f32::min);
            assert!(near < 0.15 * unit, "bone {other}: {}", near / unit);
        }
    }
}

#[test]
fn few_influences_and_points_that_stand_still() {
    let (points, triangles) = sheet(16);
    let shapes = known_rig(&points, 4);
    let still: Vec<usize> = (0..points.len()).filter(|&p| shapes.iter().all(|s| s[p] == Vec3::ZERO)).collect();
    assert!(!still.is_empty());
    for influences in [1, 2, 8] {
        let settings = FitSettings { bones: 5, influences, rounds: 6, ..FitSettings::default() };
        let found = run(&points, &triangles, &shapes, &settings);
        assert!(still.iter().all(|&p| found.weights.of(p).eq([(0, 1.0)])));
        assert!(found.error < 0.6 * size(&shapes));
    }
}

#[test]
fn moves_alone_fit_shapes_of_known_weights() {
    let (points, triangles) = sheet(16);
    let shapes = known_rig(&points, 10);
    let settings = FitSettings { bones: 3, rounds: 30, ..FitSettings::default() };
    let found = run(&points, &triangles, &shapes[..8], &settings);
    let (moves, error) = fit_moves(&points, &found.positions, &found.weights, &shapes[8..], &|_| true).unwrap();
    assert_eq!(moves.len(), 2);
    assert!(error < 0.1 * size(&shapes[8..]), "{error} of {}", size(&shapes[8..]));
    let stopped = fit_moves(&points, &found.positions, &found.weights, &shapes[8..], &|share| share < 0.3);
    assert_eq!(stopped, Err(FitError::Cancelled));
    let other = fit_moves(&points, &found.positions[1..], &found.weights, &shapes[8..], &|_| true);
    assert!(matches!(other, Err(FitError::Weights { joint: 3, .. })), "{other:?}");
}

#[test]
fn bones_begin_where_they_are_given_and_locked_ones_stay() {
    let (points, triangles) = sheet(24);
    let shapes = known_rig(&points, 6);
    let start = [Vec3::new(0.55, 0.75, 0.0), Vec3::new(0.25, 0.2, 0.0), Vec3::new(0.8, 0.35, 0.0)];
    let locked = [false, true];
    let settings = FitSettings { bones: 4, rounds: 15, start: &start, locked: &locked, ..FitSettings::default() };
    let found = run(&points, &triangles, &shapes, &settings);
    assert_eq!(found.positions[1], start[1]);
    for bone in [0, 2] {
        let apart = found.positions[bone].distance(start[bone]);
        assert!(apart > 0.0 && apart < 0.2, "bone {bone} moved by {apart}");
    }
    assert!(found.error < 0.1 * size(&shapes), "{} of {}", found.error, size(&shapes));
}

#[test]
fn threads_do_not_matter() {
    let (points, triangles) = sheet(20);
    let shapes = known_rig(&points, 5);
    let settings = FitSettings { bones: 14, rounds: 6, ..FitSettings::default() };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&points, &triangles, &shapes, &settings))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn progress_rises_and_cancels() {
    let (points, triangles) = sheet(10);
    let shapes = known_rig(&points, 2);
    let settings = FitSettings { bones: 3, rounds: 5, ..FitSettings::default() };
    let seen = std::sync::Mutex::new(Vec::new());
    let note = |share| {
        seen.lock().unwrap().push(share);
        true
    };
    fit(&points, &triangles, &shapes, &settings, &note).unwrap();
    let seen = seen.into_inner().unwrap();
    assert!(
        seen.windows(2).all(|w| w[0] <= w[1]) && seen.first() == Some(&0.0) && seen.last() == Some(&1.0),
        "{seen:?}"
    );
    for stop in [0.0, 0.05, 0.5, 1.0] {
        let stopped = fit(&points, &triangles, &shapes, &settings, &|share| share < stop);
        assert_eq!(stopped, Err(FitError::Cancelled));
    }
}

#[test]
fn bad_input_is_an_error() {
    let (points, triangles) = sheet(6);
    let shapes = known_rig(&points, 2);
    let ok = FitSettings { bones: 2, rounds: 2, ..FitSettings::default() };
    let check =
        |points: &[Vec3], triangles: &[[u32; 3]], shapes: &[Vec<Vec3>], settings: &FitSettings, wanted: FitError| {
            assert_eq!(fit(points, triangles, shapes, settings, &|_| true), Err(wanted));
        };
    check(&points, &triangles, &[], &ok, FitError::NoShapes);
    check(&[], &[], &[vec![]], &ok, FitError::NothingMoves);
    check(&points, &triangles, &vec![vec![Vec3::ZERO; 36]; 2], &ok, FitError::NothingMoves);
    let short = [shapes[0].clone(), vec![Vec3::X; 35]];
    check(&points, &triangles, &short, &ok, FitError::ShapeLength { shape: 1, has: 35, points: 36 });
    let mut damaged = shapes.clone();
    damaged[1][7].y = f32::NAN;
    check(&points, &triangles, &damaged, &ok, FitError::Shape { shape: 1, point: 7 });
    let mut endless = points.clone();
    endless[3].z = f32::INFINITY;
    check(&endless, &triangles, &shapes, &ok, FitError::Point { point: 3 });
    check(&points, &[[0, 1, 36]], &shapes, &ok, FitError::Triangle { triangle: 0 });
    check(&points, &triangles, &shapes, &FitSettings { bones: 0, ..ok.clone() }, FitError::NoBones);
    let none = FitSettings { influences: 0, ..ok.clone() };
    check(&points, &triangles, &shapes, &none, FitError::Influences { influences: 0 });
    let many = FitSettings { bones: 3, ..ok.clone() };
    let mut one = vec![Vec3::ZERO; 36];
    one[4] = Vec3::X;
    check(&points, &triangles, &[one.clone()], &many, FitError::TooManyBones { bones: 3, moving: 1 });
    let starts = FitSettings { start: &[Vec3::ZERO; 3], ..ok.clone() };
    check(&points, &triangles, &shapes, &starts, FitError::TooManyStarts { start: 3, bones: 2 });
    let lost = FitSettings { start: &[Vec3::ZERO, Vec3::NAN], ..ok.clone() };
    check(&points, &triangles, &shapes, &lost, FitError::Start { bone: 1 });
    // Odd, but no error: one point that moves, all points at one place, as many bones as points.
    run(&points, &triangles, &[one], &FitSettings { bones: 1, ..ok.clone() });
    run(&[Vec3::ONE; 36], &triangles, &shapes, &ok);
    run(&points, &[], &[vec![Vec3::X; 36]], &FitSettings { bones: 36, ..ok });
}

#[test]
fn true_shapes_of_a_head() {
    let Some(folder) = test_data() else { return };
    let model = heads::model(&folder.join("heads/ict_neutral.obj"));
    let shapes = load_shapes(&RealDisk, &folder.join("heads/ict_expressions.json"), &model).unwrap().displacements;
    assert_eq!(shapes.len(), 57);
    for (bones, millimetres) in [(10, 0.75), (20, 0.50)] {
        let settings = FitSettings { bones, rounds: 4, ..FitSettings::default() };
        let found = run(&model.points, &model.point_triangles(), &shapes, &settings);
        // The mesh is in centimetres.
        assert!(found.error * 10.0 <= millimetres, "{bones} bones: {} mm", found.error * 10.0);
    }
}
