//! Weights for vertices that have none.

use glam::Vec3;
use rigsmith::{
    algo::weights::{
        bone::BoneSegment,
        fill::{FillReport, fill_unweighted},
    },
    mesh::model::Weights,
};

fn bone(joint: u32, head: [f32; 3], tail: [f32; 3]) -> BoneSegment {
    BoneSegment { joint, head: Vec3::from_array(head), tail: Vec3::from_array(tail) }
}

/// A strip of quads along x from 0 to 1, two points a step.
fn strip(steps: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let points = (0..=steps).flat_map(|i| [0.0, 0.1].map(|y| Vec3::new(i as f32 / steps as f32, y, 0.0))).collect();
    let triangles = (0..steps).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]).collect();
    (points, triangles)
}

fn weights(points: usize, of: impl Fn(usize) -> Vec<(u32, f32)>) -> Weights {
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for p in 0..points {
        weights.push(of(p));
    }
    weights
}

fn share(weights: &Weights, point: usize, joint: u32) -> f32 {
    weights.of(point).find(|w| w.0 == joint).map_or(0.0, |w| w.1)
}

fn whole(weights: &Weights, points: usize) {
    assert_eq!(weights.len(), points);
    for p in 0..points {
        let sum: f32 = weights.of(p).map(|w| w.1).sum();
        assert!((sum - 1.0).abs() < 1e-4, "point {p} sums to {sum}");
        assert!(weights.of(p).all(|w| w.1 > 0.0 && w.1.is_finite()));
    }
}

#[test]
fn a_gap_is_bridged_evenly() {
    let (points, triangles) = strip(20);
    let ends = weights(points.len(), |p| match points[p].x {
        x if x < 0.01 => vec![(4, 1.0)],
        x if x > 0.99 => vec![(9, 1.0)],
        _ => vec![],
    });
    let (filled, report) = fill_unweighted(&points, &triangles, &ends, &[]);
    whole(&filled, points.len());
    assert_eq!(report, FillReport { by_solve: 38, by_nearest: 0 });
    for (p, place) in points.iter().enumerate() {
        assert!((share(&filled, p, 9) - place.x).abs() < 0.02, "{place}: {}", share(&filled, p, 9));
    }
}

#[test]
fn given_weights_stay_to_the_bit() {
    let (points, triangles) = strip(5);
    let given = weights(points.len(), |p| if p % 3 == 0 { vec![] } else { vec![(p as u32, 0.3), (99, 0.2)] });
    let (filled, _) = fill_unweighted(&points, &triangles, &given, &[]);
    for p in (0..points.len()).filter(|p| p % 3 != 0) {
        assert!(filled.of(p).eq(given.of(p)));
    }
    let (same, report) = fill_unweighted(&points, &triangles, &filled, &[]);
    assert_eq!((same, report), (filled, FillReport::default()));
}

#[test]
fn unwelded_vertices_count_as_one() {
    let (corners, faces) = strip(10);
    let points: Vec<Vec3> = faces.iter().flatten().map(|&c| corners[c as usize]).collect();
    let triangles: Vec<[u32; 3]> = (0..faces.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let given = weights(points.len(), |p| match p {
        0 => vec![(0, 1.0)],
        p if p + 1 == points.len() => vec![(1, 1.0)],
        _ => vec![],
    });
    let (filled, report) = fill_unweighted(&points, &triangles, &given, &[]);
    whole(&filled, points.len());
    assert_eq!(report.by_nearest, 0);
    for p in 0..points.len() {
        for q in 0..points.len() {
            if points[p] == points[q] {
                assert!(filled.of(p).eq(filled.of(q)), "{} has two answers", points[p]);
            }
        }
    }
    assert!(share(&filled, 3, 0) > share(&filled, points.len() - 4, 0));
}

#[test]
fn small_islands_move_rigidly_and_far_ones_go_to_the_nearest_bone() {
    let (mut points, mut triangles) = strip(20);
    let body = points.len();
    let mut tetrahedron = |at: Vec3, size: f32| {
        let base = points.len() as u32;
        points.extend([Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|corner| at + corner * size));
        triangles.extend([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].map(|t| t.map(|c| c + base)));
        base as usize
    };
    let near = tetrahedron(Vec3::new(0.52, 0.05, 0.03), 0.01);
    let far = tetrahedron(Vec3::new(0.9, 4.0, 0.0), 0.01);
    points.push(Vec3::new(0.1, 0.05, 0.02));
    points.push(Vec3::NAN);
    let given = weights(body, |p| vec![(0, 0.99 - points[p].x * 0.9), (1, points[p].x * 0.9 + 0.01)]);
    let bones = [bone(0, [0.0; 3], [0.5, 0.0, 0.0]), bone(1, [0.5, 0.0, 0.0], [1.0, 0.0, 0.0])];
    let (filled, report) = fill_unweighted(&points, &triangles, &given, &bones);
    whole(&filled, points.len());
    assert_eq!(report, FillReport { by_solve: 5, by_nearest: 5 });
    for island in [near, far] {
        assert!((1..4).all(|i| filled.of(island + i).eq(filled.of(island))), "an island bends");
    }
    assert!((share(&filled, near, 1) - 0.47).abs() < 0.06, "{}", share(&filled, near, 1));
    assert_eq!(filled.of(far).collect::<Vec<_>>(), [(1, 1.0)]);
    assert!((share(&filled, points.len() - 2, 1) - 0.09).abs() < 0.06);
}

#[test]
fn a_large_loose_island_bends_with_what_it_lies_on() {
    let (body, faces) = strip(30);
    let mut points = body.clone();
    points.extend(body.iter().map(|p| *p + Vec3::new(0.003, 0.0, 0.02)));
    let count = body.len() as u32;
    let triangles: Vec<[u32; 3]> = faces.iter().copied().chain(faces.iter().map(|t| t.map(|c| c + count))).collect();
    let given = weights(body.len(), |p| {
        vec![(0, 1.001 - body[p].x), (1, body[p].x - 0.001)]
            .into_iter()
            .filter(|w| w.1 > 0.0)
            .map(|w| (w.0, w.1.min(1.0)))
            .collect()
    });
    let (filled, report) = fill_unweighted(&points, &triangles, &given, &[]);
    whole(&filled, points.len());
    assert_eq!(report.by_solve, body.len());
    for (p, place) in points.iter().enumerate().skip(body.len()) {
        assert!((share(&filled, p, 1) - place.x).abs() < 0.06, "{place}: {}", share(&filled, p, 1));
    }
}

#[test]
fn hostile_input_gets_an_answer() {
    let bones = [bone(7, [0.0; 3], [1.0, 0.0, 0.0])];
    let none = Weights::default();
    // Nothing known: bones decide; no bones either: nothing to give, and no panic.
    let (points, triangles) = strip(4);
    let (filled, report) = fill_unweighted(&points, &triangles, &none, &bones);
    whole(&filled, points.len());
    assert_eq!(report, FillReport { by_solve: 0, by_nearest: points.len() });
    let (filled, report) = fill_unweighted(&points, &triangles, &none, &[]);
    assert_eq!((filled.len(), report), (points.len(), FillReport::default()));
    assert_eq!(fill_unweighted(&[], &[], &none, &[]).0.len(), 0);
    // A crowd at one point, triangles out of range or without area, corners that are not finite, extreme units.
    let crowd = vec![Vec3::ONE; 200_000];
    let one = weights(1, |_| vec![(3, 1.0)]);
    let (filled, report) = fill_unweighted(&crowd, &[[0, 0, 1], [5, 6, 999_999_999]], &one, &bones);
    assert_eq!((filled.len(), report.by_solve), (crowd.len(), crowd.len() - 1));
    for scale in [1e-42f32, 1e-20, 1e20, 3e38] {
        let points: Vec<Vec3> = points.iter().map(|p| *p * scale).collect();
        let some = weights(points.len(), |p| if p == 0 { vec![(0, 1.0)] } else { vec![] });
        whole(&fill_unweighted(&points, &triangles, &some, &bones).0, points.len());
        whole(&fill_unweighted(&points, &[], &some, &bones).0, points.len());
    }
    let mut wild = points.clone();
    wild[3] = Vec3::new(f32::INFINITY, 0.0, f32::NAN);
    let some = weights(points.len(), |p| if p == 0 { vec![(0, 1.0)] } else { vec![] });
    let odd = [bone(1, [f32::NAN; 3], [0.0; 3])];
    for bones in [&bones[..], &odd[..]] {
        whole(&fill_unweighted(&wild, &triangles, &some, bones).0, points.len());
    }
}
