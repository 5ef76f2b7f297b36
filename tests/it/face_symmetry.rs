//! Expressions of symmetric heads are symmetric.

use std::collections::BTreeMap;

use glam::Vec3;
use rigsmith::algo::face::{
    auto::{AutoSettings, FaceAnalysis},
    expression::{ExpressionSet, Mix, apply},
};

use crate::{
    heads::{self, HEADS},
    prerequisites::test_data,
};

/// Index of the mirrored point of each point that has one.
fn partners(points: &[Vec3], size: f32) -> Vec<Option<usize>> {
    let cell = |point: Vec3| (point / (1e-3 * size)).round().as_ivec3().to_array();
    let mut places: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
    for (index, point) in points.iter().enumerate() {
        places.entry(cell(*point)).or_default().push(index);
    }
    let partner = |point: &Vec3| {
        let mirrored = Vec3::new(-point.x, point.y, point.z);
        let [x, y, z] = cell(mirrored);
        let near = (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [x + a, y + b, z + c])));
        let near = near.filter_map(|cell| places.get(&cell)).flatten().copied();
        let nearest =
            near.min_by(|a, b| points[*a].distance_squared(mirrored).total_cmp(&points[*b].distance_squared(mirrored)));
        nearest.filter(|index| points[*index].distance(mirrored) < 1e-3 * size)
    };
    points.iter().map(partner).collect()
}

/// Expressions of a head.
struct Measured {
    /// Largest share, over the six, of the movement's root mean square that is not mirrored.
    lopsided: f32,
    /// Share of points that have a partner.
    paired: f32,
    /// Triangles that the six fold, and the most that nobody notices: a thousandth of the mask's in each.
    folds: [usize; 2],
}

fn measured(points: &[Vec3], triangles: &[[u32; 3]], bones: usize) -> Measured {
    let settings = AutoSettings { bones, up: Some(Vec3::Y), forward: Some(Vec3::Z), ..AutoSettings::default() };
    let analysis = FaceAnalysis::new(points, triangles, &settings, &|_, _| true).unwrap();
    let set = ExpressionSet::bundled();
    let face = analysis.rig(&[], &settings, set, &|_, _| true).unwrap();
    let fitted = analysis.fitted(&face.bones, &face.weights, set.unit_set());
    let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    let rest = &analysis.points;
    let partners = partners(rest, (high - low).length());
    let mut worst = 0.0f32;
    for expression in set.six() {
        let posed = fitted.pose(&Mix::of(&[(expression, 1.0)], set.unit_set()));
        let posed = apply(rest, &face.weights, &face.bones, &posed);
        let moved: Vec<Vec3> = posed.iter().zip(rest).map(|(posed, rest)| *posed - *rest).collect();
        let (mut off, mut all) = (0.0, 0.0);
        for (moved, partner) in moved.iter().zip(&partners).filter_map(|(moved, partner)| Some((*moved, (*partner)?))) {
            off += Vec3::new(-moved.x, moved.y, moved.z).distance_squared(posed[partner] - rest[partner]);
            all += moved.length_squared();
        }
        // Half of the difference is off on each side.
        worst = worst.max((0.25 * off / all).sqrt());
    }
    let paired = partners.iter().flatten().count() as f32 / partners.len() as f32;
    Measured { lopsided: worst, paired, folds: [face.folds, analysis.tolerated_folds()] }
}

#[test]
fn expressions_of_symmetric_heads_are_symmetric() {
    let mut all = vec![("the bundled head".to_owned(), heads::bundled())];
    if let Some(folder) = test_data() {
        let files = HEADS.into_iter().chain(["ict_identity_3"]);
        all.extend(files.map(|name| (name.to_owned(), heads::mesh(&folder.join(format!("heads/{name}.obj"))))));
    }
    let (mut wrong, mut symmetric) = (Vec::new(), 0);
    for (name, (points, triangles)) in &all {
        for bones in [20, 40, 80] {
            let Measured { lopsided, paired, .. } = measured(points, triangles, bones);
            let [lopsided, paired] = [lopsided, paired].map(|share| 100.0 * share);
            println!("{name}, {bones} bones: {lopsided:.2} % lopsided, {paired:.0} % of the points are paired");
            // Other heads are lopsided themselves.
            if paired > 95.0 {
                symmetric += 1;
                if lopsided > 0.3 {
                    wrong.push(format!("{name}, {bones} bones: {lopsided:.2} % lopsided"));
                }
            }
        }
    }
    assert!(wrong.is_empty() && symmetric >= 3, "{symmetric} symmetric heads and densities:\n{}", wrong.join("\n"));
}

#[test]
fn dense_heads_are_symmetric_and_hardly_fold() {
    let (points, triangles) = heads::subdivided(&heads::bundled());
    let Measured { lopsided, paired, folds: [folds, tolerated] } = measured(&points, &triangles, 40);
    println!("{} points: {lopsided:.4} lopsided, {folds} folds of {tolerated} at most", points.len());
    // Quads are cut along other diagonals on the two sides, and the middles of those have no partner: their weights are not the
    // mean of both sides.
    assert!(paired > 0.9 && lopsided < 0.025, "{paired} are paired, {lopsided} lopsided");
    assert!(folds <= tolerated, "{folds} triangles fold, {tolerated} may");
}
