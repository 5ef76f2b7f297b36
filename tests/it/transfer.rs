//! Weights of one mesh for a changed one.

use glam::Vec3;
use rigsmith::{
    algo::transfer::{TransferError, TransferMesh, TransferReport, TransferSettings, transfer_weights},
    mesh::model::Weights,
};

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// A tube along x from 0 to 2 with radius 0.2 around (y, z), open at both ends.
fn tube(along: u32, around: u32, y: f32) -> Mesh {
    let mut points = Vec::new();
    for i in 0..=along {
        for j in 0..around {
            // A square cross-section walked in steps: no trigonometry needed.
            let t = j as f32 / around as f32 * 4.0;
            let (side, s) = (t as u32, t.fract() * 2.0 - 1.0);
            let (a, b) = [(s, -1.0), (1.0, s), (-s, 1.0), (-1.0, -s)][side as usize];
            let unit = Vec3::new(0.0, a, b).normalize() * 0.2;
            points.push(Vec3::new(i as f32 / along as f32 * 2.0, y, 0.0) + unit);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..along {
        for j in 0..around {
            let (a, b) = (i * around + j, i * around + (j + 1) % around);
            triangles.push([a, b + around, a + around]);
            triangles.push([a, b, b + around]);
        }
    }
    (points, triangles)
}

fn mesh(mesh: &Mesh) -> TransferMesh<'_> {
    TransferMesh { points: &mesh.0, triangles: &mesh.1 }
}

/// Joint 1 grows along x.
fn ramp(points: &[Vec3]) -> Weights {
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for p in points {
        let t = (p.x / 2.0).clamp(0.01, 0.99);
        weights.push([(0, 1.0 - t), (1, t)]);
    }
    weights
}

fn share(weights: &Weights, point: usize, joint: u32) -> f32 {
    weights.of(point).find(|w| w.0 == joint).map_or(0.0, |w| w.1)
}

fn run(source: &Mesh, weights: &Weights, target: &Mesh) -> (Weights, TransferReport) {
    let (result, report) = transfer_weights(mesh(source), weights, mesh(target), &TransferSettings::default()).unwrap();
    let total = report.copied + report.matched + report.inpainted + report.nearest + report.empty;
    assert_eq!((result.len(), total), (target.0.len(), target.0.len()));
    for (p, place) in target.0.iter().enumerate().filter(|(_, p)| p.is_finite()) {
        let sum: f32 = result.of(p).map(|w| w.1).sum();
        assert!((sum - 1.0).abs() < 1e-4, "{place} sums to {sum}");
    }
    (result, report)
}

#[test]
fn the_same_mesh_keeps_its_weights_exactly() {
    let source = tube(20, 16, 0.0);
    let weights = ramp(&source.0);
    let (result, report) = run(&source, &weights, &source);
    assert_eq!(result, weights);
    assert_eq!(report.copied, source.0.len());
    // Vertices in another order.
    let count = source.0.len() as u32;
    let turned: Mesh =
        (source.0.iter().rev().copied().collect(), source.1.iter().map(|t| t.map(|c| count - 1 - c)).collect());
    let (result, report) = run(&source, &weights, &turned);
    assert_eq!(report.copied, source.0.len());
    for p in 0..count as usize {
        assert!(result.of(p).eq(weights.of(count as usize - 1 - p)));
    }
}

#[test]
fn finer_coarser_and_inside_out_meshes_follow() {
    let source = tube(20, 16, 0.0);
    let weights = ramp(&source.0);
    let finer = tube(77, 40, 0.0);
    let coarser = tube(7, 8, 0.0);
    let inside_out: Mesh = (finer.0.clone(), finer.1.iter().map(|t| [t[0], t[2], t[1]]).collect());
    for (name, target) in [("finer", finer), ("coarser", coarser), ("inside-out", inside_out)] {
        let (result, report) = run(&source, &weights, &target);
        assert_eq!(report.nearest, 0, "{name}");
        assert!(report.matched + report.copied >= target.0.len() * 9 / 10, "{name}: {report:?}");
        for (p, place) in target.0.iter().enumerate() {
            let want = (place.x / 2.0).clamp(0.01, 0.99);
            assert!((share(&result, p, 1) - want).abs() < 0.03, "{name} {place}: {}", share(&result, p, 1));
        }
    }
}

#[test]
fn parts_that_are_far_are_inpainted_from_the_rest() {
    let source = tube(20, 16, 0.0);
    let weights = ramp(&source.0);
    // A sleeve in the middle bulges out to three times the radius.
    let mut target = tube(60, 16, 0.0);
    for p in &mut target.0 {
        let out = 1.0 + 2.0 * (1.0 - ((p.x - 1.0) / 0.4).abs()).max(0.0);
        *p = Vec3::new(p.x, p.y * out, p.z * out);
    }
    let (result, report) = run(&source, &weights, &target);
    assert!(report.inpainted > 50 && report.nearest == 0, "{report:?}");
    for (p, place) in target.0.iter().enumerate() {
        let want = (place.x / 2.0).clamp(0.01, 0.99);
        assert!((share(&result, p, 1) - want).abs() < 0.12, "{place}: {}", share(&result, p, 1));
    }
}

#[test]
fn layers_that_face_each_other_do_not_mix() {
    // Two limbs side by side, a hair apart, each with its own joint; the target's limbs are a bit thicker.
    let limbs = |thick: f32| {
        let (mut left, right) = (tube(16, 16, 0.0), tube(16, 16, 0.42));
        let count = left.0.len() as u32;
        left.0.extend(right.0);
        left.1.extend(right.1.iter().map(|t| t.map(|c| c + count)));
        for (i, p) in left.0.iter_mut().enumerate() {
            let y = if (i as u32) < count { 0.0 } else { 0.42 };
            *p = Vec3::new(p.x, y + (p.y - y) * thick, p.z * thick);
        }
        left
    };
    let source = limbs(1.0);
    let half = source.0.len() / 2;
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for p in 0..source.0.len() {
        weights.push([(u32::from(p >= half), 1.0)]);
    }
    // Thick enough to overlap: the closest surface of some points is the other limb's.
    let target = limbs(1.12);
    let (result, _) = run(&source, &weights, &target);
    for p in 0..target.0.len() {
        assert!(share(&result, p, u32::from(p >= half)) > 0.99, "{}", target.0[p]);
    }
}

#[test]
fn hostile_input_gets_an_answer() {
    let source = tube(4, 8, 0.0);
    let weights = ramp(&source.0);
    let settings = TransferSettings::default();
    let fewer = transfer_weights(mesh(&source), &ramp(&source.0[1..]), mesh(&source), &settings);
    assert!(matches!(fewer, Err(TransferError::WeightCount { .. })));
    let mut none = Weights { starts: vec![0], ..Weights::default() };
    source.0.iter().for_each(|_| none.push([]));
    assert_eq!(transfer_weights(mesh(&source), &none, mesh(&source), &settings), Err(TransferError::NoWeights));
    let empty: Mesh = Mesh::default();
    assert_eq!(
        transfer_weights(mesh(&empty), &Weights::default(), mesh(&source), &settings),
        Err(TransferError::NoWeights)
    );
    assert_eq!(run(&source, &weights, &empty).0.len(), 0);
    // No faces on either side, points that are not finite, triangles out of range, extreme units.
    let cloud = (source.0.clone(), vec![]);
    run(&cloud, &weights, &tube(9, 12, 0.0));
    let (_, report) = run(&source, &weights, &(tube(9, 12, 0.0).0, vec![]));
    assert_eq!(report.empty, 0);
    let wild = (
        vec![Vec3::NAN, Vec3::INFINITY, Vec3::splat(f32::MAX), Vec3::ZERO, Vec3::splat(1e-44)],
        vec![[0, 1, 2], [2, 3, 4], [3, 9, 4]],
    );
    let (_, report) = run(&source, &weights, &wild);
    assert_eq!(report.empty, 2);
    let mut ragged = source.clone();
    ragged.0[3] = Vec3::NAN;
    ragged.1.push([0, 1, u32::MAX]);
    run(&ragged, &weights, &tube(9, 12, 0.0));
    for scale in [1e-25f32, 1e-3, 1e3, 1e15] {
        let scaled = |m: &Mesh| (m.0.iter().map(|p| *p * scale).collect::<Vec<_>>(), m.1.clone());
        let (result, report) = run(&scaled(&source), &weights, &scaled(&tube(9, 12, 0.0)));
        let ends = (share(&result, 0, 1), share(&result, result.len() - 1, 1));
        assert!(ends.0 < 0.1 && ends.1 > 0.9, "unit {scale}: {ends:?} {report:?}");
    }
}
