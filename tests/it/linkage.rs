//! Average linkage: bad input, agreement with the definition, order and threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec3;
use rigsmith::algo::linkage::{Dendrogram, LinkageError, average_linkage, average_linkage_1d, squared_linkage};

use crate::random::Random;

fn go(_: f32) -> bool {
    true
}

/// Points of the unit cube.
fn points(count: usize, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    (0..count).map(|_| Vec3::new(random.unit(), random.unit(), random.unit())).collect()
}

/// Points on a bent sheet, as those of a mesh are.
fn sheet(count: usize, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    let place = |a: f32, b: f32| Vec3::new(a, b, 0.3 * (a * a - b) + 0.1 * a * b) * 10.0;
    (0..count).map(|_| place(random.unit(), random.unit())).collect()
}

/// The definition: all distances, the least merges, means weighted by sizes.
fn naive(count: usize, distance: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut sizes = vec![1.0; count];
    let mut table: Vec<Vec<f64>> = (0..count).map(|a| (0..count).map(|b| distance(a, b)).collect()).collect();
    let mut alive: Vec<usize> = (0..count).collect();
    let mut heights = Vec::new();
    while alive.len() > 1 {
        let pairs = alive.iter().enumerate().flat_map(|(at, &a)| alive[at + 1..].iter().map(move |&b| (a, b)));
        let (a, b) = pairs.min_by(|x, y| table[x.0][x.1].total_cmp(&table[y.0][y.1])).unwrap();
        heights.push(table[a][b]);
        for &c in &alive {
            let mean = (sizes[a] * table[a][c] + sizes[b] * table[b][c]) / (sizes[a] + sizes[b]);
            (table[a][c], table[c][a]) = (mean, mean);
        }
        sizes[a] += sizes[b];
        alive.retain(|&c| c != b);
    }
    heights
}

#[track_caller]
fn assert_heights(tree: &Dendrogram, expected: &[f64]) {
    assert_eq!(tree.merges.len(), expected.len());
    for (at, (merge, &expected)) in tree.merges.iter().zip(expected).enumerate() {
        let error = (f64::from(merge.height) - expected).abs();
        assert!(error <= 1e-5 * expected, "merge {at}: {} instead of {expected}", merge.height);
    }
    assert_sound(tree);
}

/// Every cluster merges once, parts come before wholes, sizes add up, heights do not fall.
#[track_caller]
fn assert_sound(tree: &Dendrogram) {
    let mut sizes = vec![1_u32; tree.points];
    let mut used = vec![false; tree.points + tree.merges.len()];
    let mut last = 0.0;
    for (at, merge) in tree.merges.iter().enumerate() {
        assert!(merge.first < merge.second && (merge.second as usize) < tree.points + at);
        for part in [merge.first, merge.second] {
            assert!(!std::mem::replace(&mut used[part as usize], true), "cluster {part} merges twice");
        }
        assert_eq!(merge.size, sizes[merge.first as usize] + sizes[merge.second as usize]);
        assert!(merge.height >= last);
        last = merge.height;
        sizes.push(merge.size);
    }
    assert_eq!(tree.merges.len() + 1, tree.points);
}

#[test]
fn bad_input_is_an_error() {
    assert_eq!(average_linkage(&[], &go), Err(LinkageError::Empty));
    assert_eq!(squared_linkage(&[], &go), Err(LinkageError::Empty));
    assert_eq!(average_linkage_1d(&[], &go), Err(LinkageError::Empty));
    let points = [Vec3::ZERO, Vec3::new(0.0, f32::NAN, 0.0)];
    assert_eq!(average_linkage(&points, &go), Err(LinkageError::NotFinite { point: 1 }));
    assert_eq!(average_linkage_1d(&[f32::INFINITY], &go), Err(LinkageError::NotFinite { point: 0 }));
}

#[test]
fn one_point_has_no_merges() {
    for tree in
        [average_linkage(&[Vec3::ONE], &go), squared_linkage(&[Vec3::ONE], &go), average_linkage_1d(&[1.0], &go)]
    {
        let tree = tree.unwrap();
        assert_eq!((tree.points, tree.merges.len()), (1, 0));
        assert_eq!(tree.cut(3), [0]);
    }
}

#[test]
fn equal_points_merge_at_zero() {
    let tree = average_linkage(&[Vec3::splat(3.0); 1500], &go).unwrap();
    assert_sound(&tree);
    assert!(tree.merges.iter().all(|merge| merge.height == 0.0));
    let line = average_linkage_1d(&[-2.5; 900], &go).unwrap();
    assert_sound(&line);
    assert_eq!(line.heights(1), [0.0]);
}

#[test]
fn duplicates_keep_their_distance_to_others() {
    let mut points = points(150, 5);
    points.extend(points.clone());
    let tree = average_linkage(&points, &go).unwrap();
    assert_heights(&tree, &naive(300, |a, b| f64::from(points[a].distance(points[b]))));
}

#[test]
fn heights_are_those_of_the_definition() {
    for (seed, count) in [(1, 2), (2, 3), (3, 9), (4, 50), (5, 300)] {
        let points = points(count, seed);
        let exact = |a: usize, b: usize| points[a].as_dvec3().distance(points[b].as_dvec3());
        assert_heights(&average_linkage(&points, &go).unwrap(), &naive(count, exact));
        let square = |a: usize, b: usize| points[a].as_dvec3().distance_squared(points[b].as_dvec3());
        assert_heights(&squared_linkage(&points, &go).unwrap(), &naive(count, square));
    }
}

/// More points than go into the matrix at once, so that bounds, blocks and moments all take part.
#[test]
fn heights_of_a_sheet_are_those_of_the_definition() {
    let points = sheet(700, 9);
    let tree = average_linkage(&points, &go).unwrap();
    assert_heights(&tree, &naive(points.len(), |a, b| points[a].as_dvec3().distance(points[b].as_dvec3())));
}

/// The mean over all pairs of the two halves at the top, where moments stand for most of the pairs.
#[test]
fn top_of_a_large_sheet_is_the_mean_over_all_pairs() {
    let points = sheet(6000, 11);
    let tree = average_linkage(&points, &go).unwrap();
    let labels = tree.cut(2);
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, _) in points.iter().zip(&labels).filter(|(_, label)| **label == 0) {
        for (b, _) in points.iter().zip(&labels).filter(|(_, label)| **label == 1) {
            sum += f64::from(a.distance(*b));
            count += 1.0;
        }
    }
    let (height, mean) = (f64::from(tree.heights(1)[0]), sum / count);
    assert!((height - mean).abs() <= 2e-6 * mean, "{height} instead of {mean}");
}

#[test]
fn points_on_a_line_agree_with_one_dimension() {
    let mut random = Random(21);
    let values: Vec<f32> = (0..1200).map(|_| random.unit() * 7.0 - 3.0).collect();
    let points: Vec<Vec3> = values.iter().map(|&x| Vec3::new(x, 1.0, 2.0)).collect();
    let line = average_linkage_1d(&values, &go).unwrap();
    let space = average_linkage(&points, &go).unwrap();
    let expected: Vec<f64> = line.merges.iter().map(|merge| f64::from(merge.height)).collect();
    assert_heights(&space, &expected);
    let small: Vec<f32> = values[..200].to_vec();
    let exact = naive(200, |a, b| (f64::from(small[a]) - f64::from(small[b])).abs());
    assert_heights(&average_linkage_1d(&small, &go).unwrap(), &exact);
}

#[test]
fn size_of_the_unit_does_not_matter() {
    let points = sheet(600, 3);
    let tree = average_linkage(&points, &go).unwrap();
    for scale in [f32::powi(2.0, -100), f32::powi(2.0, 100)] {
        let scaled: Vec<Vec3> = points.iter().map(|point| *point * scale).collect();
        let other = average_linkage(&scaled, &go).unwrap();
        for (a, b) in tree.merges.iter().zip(&other.merges) {
            assert!((a.height - b.height / scale).abs() <= 1e-5 * a.height);
        }
    }
}

#[test]
fn order_of_points_does_not_matter_to_heights() {
    let points = sheet(2500, 13);
    let mut turned = points.clone();
    turned.rotate_left(777);
    turned.reverse();
    let (a, b) = (average_linkage(&points, &go).unwrap(), average_linkage(&turned, &go).unwrap());
    for (a, b) in a.merges.iter().zip(&b.merges) {
        assert!((a.height - b.height).abs() <= 2e-6 * a.height);
        assert_eq!(a.size, b.size);
    }
}

#[test]
fn threads_do_not_matter() {
    let mut points = sheet(4000, 17);
    points.extend((0..400).map(|at| Vec3::new((at % 20) as f32, (at / 20) as f32, 0.0)));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (average_linkage(&points, &go).unwrap(), squared_linkage(&points, &go).unwrap()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn chains_of_growing_gaps_are_fine() {
    let mut x = 0.0;
    let points: Vec<Vec3> = (0..3000)
        .map(|at| {
            x += 1.0 + at as f32 * 1e-3;
            Vec3::new(x, 0.0, 0.0)
        })
        .collect();
    assert_sound(&average_linkage(&points, &go).unwrap());
}

#[test]
fn cut_labels_by_first_point() {
    let values = [10.0, 0.0, 10.5, 1.2, 30.0];
    let tree = average_linkage_1d(&values, &go).unwrap();
    assert_eq!(tree.cut(3), [0, 1, 0, 1, 2]);
    assert_eq!(tree.cut(2), [0, 0, 0, 0, 1]);
    assert_eq!(tree.cut(1), [0; 5]);
    assert_eq!(tree.cut(0), [0; 5]);
    assert_eq!(tree.cut(9), [0, 1, 2, 3, 4]);
    assert_eq!(tree.heights(2).len(), 2);
    assert!(tree.heights(2)[0] > tree.heights(2)[1]);
}

#[test]
fn cancelling_stops() {
    let points = sheet(3000, 1);
    let calls = AtomicUsize::new(0);
    let stop = |_: f32| calls.fetch_add(1, Ordering::Relaxed) < 2;
    assert_eq!(average_linkage(&points, &stop), Err(LinkageError::Cancelled));
    assert_eq!(average_linkage_1d(&[1.0, 2.0], &|_| false), Err(LinkageError::Cancelled));
}

#[test]
fn progress_never_falls() {
    let last = std::sync::Mutex::new(0.0_f32);
    let progress = |part: f32| {
        let mut last = last.lock().unwrap();
        assert!(part >= *last && part <= 1.0);
        *last = part;
        true
    };
    average_linkage(&sheet(3000, 2), &progress).unwrap();
    assert_eq!(*last.lock().unwrap(), 1.0);
}
