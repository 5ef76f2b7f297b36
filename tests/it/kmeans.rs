//! k-means: bad input, agreement with all distances, fixed centroids, seeds and threads.

use glam::Vec3;
use proptest::prelude::*;
use rigsmith::algo::kmeans::{KMeans, KMeansError, KMeansSettings, kmeans, kmeans_plain};

use crate::random::Random;

fn go(_: f32) -> bool {
    true
}

fn settings(groups: usize) -> KMeansSettings {
    KMeansSettings { groups, starts: 1, seed: 7, max_rounds: 1000 }
}

/// Points on a bent sheet, denser at one end.
fn sheet(count: usize) -> Vec<Vec3> {
    let mut random = Random(3);
    let mut noise = || random.unit();
    (0..count)
        .map(|_| {
            let (a, b) = (noise() * noise(), noise());
            Vec3::new(a, b, 0.4 * a * a - 0.2 * b) * 20.0 + Vec3::splat(5.0)
        })
        .collect()
}

/// Labels are nearest centroids, centroids their points' means, and the error is what it says.
#[track_caller]
fn assert_settled(points: &[Vec3], fixed: usize, answer: &KMeans) {
    let mut sums = vec![(glam::DVec3::ZERO, 0.0); answer.centroids.len()];
    let mut error = 0.0;
    for (point, &label) in points.iter().zip(&answer.labels) {
        let own = point.as_dvec3().distance_squared(answer.centroids[label as usize].as_dvec3());
        for centroid in &answer.centroids {
            assert!(own.sqrt() <= point.as_dvec3().distance(centroid.as_dvec3()) + 1e-5 * 20.0);
        }
        error += own;
        sums[label as usize].0 += point.as_dvec3();
        sums[label as usize].1 += 1.0;
    }
    for (centroid, (sum, count)) in answer.centroids.iter().zip(&sums).skip(fixed) {
        assert!(*count > 0.0, "a group is empty");
        assert!((*sum / *count).distance(centroid.as_dvec3()) < 1e-4);
    }
    assert!((error - answer.square_error).abs() <= 1e-4 * error + 1e-6);
}

#[test]
fn bad_input_is_an_error() {
    let points = sheet(10);
    let check = |points: &[Vec3], fixed: &[Vec3], groups| kmeans(points, fixed, &settings(groups), &go).unwrap_err();
    assert_eq!(check(&points, &[], 0), KMeansError::NoGroups);
    assert_eq!(check(&points, &[], 11), KMeansError::MoreGroupsThanPoints { groups: 11, points: 10 });
    assert_eq!(check(&[], &[], 1), KMeansError::MoreGroupsThanPoints { groups: 1, points: 0 });
    assert_eq!(check(&points, &[Vec3::ZERO; 3], 2), KMeansError::MoreFixedThanGroups { fixed: 3, groups: 2 });
    assert_eq!(check(&[Vec3::NAN], &[], 1), KMeansError::NotFinite { point: 0 });
    assert_eq!(check(&points, &[Vec3::INFINITY], 2), KMeansError::FixedNotFinite { centroid: 0 });
    let twice: Vec<Vec3> = points.iter().chain(&points).copied().collect();
    assert_eq!(check(&twice, &[], 11), KMeansError::MoreGroupsThanPlaces { groups: 11, distinct: 10 });
    assert_eq!(check(&[Vec3::ONE; 4], &[], 2), KMeansError::MoreGroupsThanPlaces { groups: 2, distinct: 1 });
}

#[test]
fn as_many_groups_as_points() {
    let points = sheet(60);
    let answer = kmeans(&points, &[], &settings(60), &go).unwrap();
    let mut labels = answer.labels.clone();
    labels.sort_unstable();
    assert_eq!(labels, (0..60).collect::<Vec<u32>>());
    assert!(answer.square_error < 1e-6);
    let twice: Vec<Vec3> = points.iter().chain(&points).copied().collect();
    assert!(kmeans(&twice, &[], &settings(60), &go).unwrap().square_error < 1e-6);
}

#[test]
fn one_group_is_the_mean() {
    let points = sheet(500);
    let answer = kmeans(&points, &[], &settings(1), &go).unwrap();
    let mean = points.iter().map(|point| point.as_dvec3()).sum::<glam::DVec3>() / 500.0;
    assert!(answer.centroids[0].as_dvec3().distance(mean) < 1e-5);
    assert_eq!(answer.labels, [0; 500]);
}

#[test]
fn bounds_change_nothing() {
    let points = sheet(6000);
    for (groups, fixed) in [(2, 0), (7, 2), (60, 0), (200, 5)] {
        let fixed: Vec<Vec3> = points.iter().step_by(501).take(fixed).map(|point| *point + Vec3::Z).collect();
        let settings = KMeansSettings { starts: 2, ..settings(groups) };
        let answer = kmeans(&points, &fixed, &settings, &go).unwrap();
        assert_eq!(answer, kmeans_plain(&points, &fixed, &settings, &go).unwrap());
        assert_settled(&points, fixed.len(), &answer);
    }
}

#[test]
fn equal_places_in_plenty_are_fine() {
    let points: Vec<Vec3> = (0..4000).map(|at| Vec3::new((at % 9) as f32, (at % 7) as f32, 0.0)).collect();
    for groups in [3, 20, 63] {
        let answer = kmeans(&points, &[], &settings(groups), &go).unwrap();
        assert_eq!(answer, kmeans_plain(&points, &[], &settings(groups), &go).unwrap());
        assert_settled(&points, 0, &answer);
    }
}

#[test]
fn fixed_centroids_stay() {
    let points = sheet(2000);
    let fixed = [points[3] + Vec3::new(0.1, 0.0, 0.0), Vec3::splat(500.0)];
    let answer = kmeans(&points, &fixed, &settings(12), &go).unwrap();
    assert_eq!(answer.centroids.len(), 12);
    assert_eq!(answer.centroids[..2], fixed);
    assert!(!answer.labels.contains(&1), "no point is nearest to a place far outside");
    assert_settled(&points, 2, &answer);
    let all = kmeans(&points, &fixed, &settings(2), &go).unwrap();
    assert_eq!(all.centroids, fixed);
}

/// Without the first rounds' jumps (too few groups for them) each round lowers the error.
#[test]
fn error_never_rises() {
    let points = sheet(3000);
    let mut last = f64::INFINITY;
    for max_rounds in 0..40 {
        let answer = kmeans(&points, &[], &KMeansSettings { max_rounds, ..settings(3) }, &go).unwrap();
        assert!(answer.square_error <= last * (1.0 + 1e-9));
        assert!(answer.rounds <= max_rounds);
        last = answer.square_error;
    }
}

#[test]
fn more_starts_are_no_worse() {
    let points = sheet(3000);
    let error = |starts| kmeans(&points, &[], &KMeansSettings { starts, ..settings(25) }, &go).unwrap().square_error;
    assert!(error(4) <= error(1));
}

#[test]
fn same_seed_same_answer_on_any_number_of_threads() {
    let points = sheet(9000);
    let on = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| kmeans(&points, &[], &KMeansSettings { seed, ..settings(50) }, &go).unwrap())
    };
    assert_eq!(on(1, 5), on(3, 5));
    assert_ne!(on(1, 5).centroids, on(1, 6).centroids);
}

#[test]
fn cancelling_stops() {
    let points = sheet(1000);
    assert_eq!(kmeans(&points, &[], &settings(9), &|_| false), Err(KMeansError::Cancelled));
    assert_eq!(kmeans(&points, &[], &settings(9), &|part| part < 0.1), Err(KMeansError::Cancelled));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_points_settle(
        points in prop::collection::vec((-3_i8..3, -3_i8..3, -1_i8..1), 1..200),
        groups in 1_usize..12,
    ) {
        let points: Vec<Vec3> =
            points.iter().map(|&(x, y, z)| Vec3::new(x.into(), y.into(), z.into())).collect();
        match kmeans(&points, &[], &settings(groups), &go) {
            Ok(answer) => {
                prop_assert_eq!(&answer, &kmeans_plain(&points, &[], &settings(groups), &go).unwrap());
                assert_settled(&points, 0, &answer);
            }
            Err(KMeansError::MoreGroupsThanPoints { .. } | KMeansError::MoreGroupsThanPlaces { .. }) => {}
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}
