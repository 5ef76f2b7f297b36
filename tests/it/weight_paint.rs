//! Weights by hand: brushes on plain data, edits of the points that they touch, and changes of whole meshes in an app.

mod in_app;
mod landing;
mod points;

use std::{fs, sync::Arc};

use bevy::prelude::*;
use proptest::prelude::*;
use rigsmith::{
    algo::paint::{
        Brush, BrushError, BrushMode, BrushReach, Canvas, FalloffCurve, Mirror, PaintStroke, PruneError, PruneSettings,
        RowRules, assign, keep_locked, normalised, pruned, towards,
    },
    mesh::{
        model::{Model, Weights},
        obj::{ObjSettings, read_model},
    },
    plugins::{
        history::RigHistory,
        landing::ResultHeld,
        painting::{
            PaintableJoint, WeightChange, WeightChangeAnswer, WeightChangeError, WeightChangeJob, WeightChangeRequest,
            locks, row_edit, stroke_edit,
        },
        skinning::{BindAnswer, BindRequest, SkinningError, SkinningJob},
    },
    prelude::*,
    rig::{EditError, PatchFault, SkinData, WeightPatch, skin::skin_data_bytes, weight_edit},
};

use crate::{
    bench::{RigBench, begin_drag, undo_meanwhile},
    gestures::boxes,
};

const MESH: Uid = Uid(0x50);

fn brush(mode: BrushMode, radius: f32) -> Brush {
    Brush {
        mode,
        strength: 0.5,
        radius,
        falloff: radius,
        curve: FalloffCurve::Smooth,
        reach: BrushReach::Surface,
        all_joints: false,
    }
}

/// The bundled body.
fn body() -> Model {
    let text = fs::read("assets/models/biped.obj").unwrap();
    read_model(text.as_slice(), "biped", &ObjSettings::default(), &mut |_| None).unwrap()
}

/// A flat grid of points one apart, with its triangles.
fn grid(side: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let points = (0..side * side).map(|i| Vec3::new((i % side) as f32, (i / side) as f32, 0.0)).collect();
    let square = |i: u32| {
        let (a, b, c, d) = (i, i + 1, i + side, i + side + 1);
        [[a, b, d], [a, d, c]]
    };
    let corners = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| y * side + x));
    (points, corners.flat_map(square).collect())
}

fn same(count: usize, row: &[(u32, f32)]) -> Weights {
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    (0..count).for_each(|_| weights.push(row.iter().copied()));
    weights
}

fn sum(row: &[(u32, f32)]) -> f64 {
    row.iter().map(|(_, weight)| f64::from(*weight)).sum()
}

fn weight(row: &[(u32, f32)], joint: u32) -> f32 {
    row.iter().find(|(other, _)| *other == joint).map_or(0.0, |(_, weight)| *weight)
}

fn rows(weights: &Weights) -> Vec<Vec<(u32, f32)>> {
    (0..weights.len()).map(|point| weights.of(point).collect()).collect()
}

/// Weights after a stroke.
fn painted(stroke: &PaintStroke, before: &Weights) -> Weights {
    let (points, changed) = stroke.changed(before);
    let mut all = rows(before);
    for (number, point) in points.iter().enumerate() {
        all[*point as usize] = changed.of(number).collect();
    }
    let mut after = Weights { starts: vec![0], ..Weights::default() };
    all.into_iter().for_each(|row| after.push(row));
    after
}

#[test]
fn numbers_that_no_brush_has_are_refused_with_words() {
    let good = brush(BrushMode::Add, 1.0);
    assert_eq!(good.check(), Ok(()));
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = Brush { radius, falloff: 0.0, ..good }.check().unwrap_err();
        assert!(matches!(error, BrushError::Radius(_)), "{radius}: {error:?}");
        assert!(error.to_string().contains("use a radius above 0"), "{error}");
    }
    for falloff in [-0.1, 1.1, f32::NAN] {
        assert!(matches!(Brush { falloff, ..good }.check(), Err(BrushError::Falloff { .. })), "{falloff}");
    }
    for strength in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
        assert!(matches!(Brush { strength, ..good }.check(), Err(BrushError::Strength(_))), "{strength}");
    }
    let stroke = |brush, joint, most| PaintStroke::new(brush, joint, None, vec![false, true], most).err();
    assert_eq!(stroke(good, Some(0), 4), None);
    assert_eq!(stroke(good, Some(1), 4), Some(BrushError::Locked));
    assert_eq!(stroke(good, None, 4), Some(BrushError::NoJoint));
    assert_eq!(stroke(good, Some(2), 4), Some(BrushError::Joint { joint: 2, joints: 2 }));
    assert_eq!(stroke(good, Some(0), 0), Some(BrushError::Influences));
    let all = Brush { mode: BrushMode::Smooth, all_joints: true, ..good };
    assert_eq!(stroke(all, None, 4), None, "all joints need no chosen one");
    assert_eq!(
        stroke(Brush { radius: f32::NAN, ..all }, None, 4).map(|error| error.to_string().is_empty()),
        Some(false)
    );
}

#[test]
fn the_effect_fades_over_the_falloff() {
    for curve in FalloffCurve::ALL {
        let soft = Brush { curve, falloff: 1.5, ..brush(BrushMode::Add, 2.0) };
        let effects: Vec<f32> = (0..=40).map(|step| soft.effect(step as f32 * 0.06)).collect();
        assert!(effects.windows(2).all(|pair| pair[0] >= pair[1]), "{curve:?}: {effects:?}");
        assert!(effects.iter().all(|effect| (0.0..=1.0).contains(effect)));
        assert_eq!((soft.effect(0.5), soft.effect(2.0), soft.effect(9.0)), (1.0, 0.0, 0.0), "{curve:?}");
        assert!((0.01..0.99).contains(&soft.effect(1.25)), "{curve:?}");
        let hard = Brush { curve, falloff: 0.0, ..soft };
        assert_eq!((hard.effect(1.999), hard.effect(2.0)), (1.0, 0.0));
    }
}

#[test]
fn a_joint_takes_from_the_free_ones_and_gives_to_them() {
    let rules = RowRules { locked: &[false, false, true], most: 8 };
    let row = [(0, 0.5), (1, 0.25), (2, 0.25)];
    assert_eq!(assign(&row, &[(0, 0.25)], &rules), [(1, 0.5), (0, 0.25), (2, 0.25)]);
    assert_eq!(assign(&row, &[(0, 1.0)], &rules), [(0, 0.75), (2, 0.25)], "the locked share is out of reach");
    assert_eq!(assign(&row, &[(2, 1.0)], &rules), row, "a locked joint takes nothing");
    assert_eq!(assign(&row, &[(0, 1.0), (1, 1.0)], &rules), [(0, 0.375), (1, 0.375), (2, 0.25)]);
    assert_eq!(assign(&[(0, 1.0)], &[(0, 0.25)], &rules), [(0, 1.0)], "nobody could take the rest");
    assert_eq!(assign(&[], &[(0, 0.25)], &rules), [(0, 1.0)], "a point without weights goes to the joint");
    assert_eq!(assign(&[], &[(0, 0.0)], &rules), []);
    assert_eq!(assign(&[(2, 1.0)], &[(0, 0.5)], &rules), [(2, 1.0)]);
    assert_eq!(assign(&row, &[(0, f32::NAN)], &rules), row);
    let few = RowRules { most: 2, ..rules };
    assert_eq!(assign(&row, &[(0, 0.5)], &few), [(0, 0.75), (2, 0.25)], "the locked one stays, the weakest goes");
    let half = towards(&row, &[(1, 1.0)], 0.5, &rules);
    assert!((weight(&half, 0) - 0.25).abs() < 1e-6 && (weight(&half, 1) - 0.5).abs() < 1e-6, "{half:?}");
    assert_eq!(towards(&row, &[(1, 1.0)], 0.0, &rules), row);
    assert_eq!(towards(&row, &[(2, 1.0)], 1.0, &rules), row, "locked joints of neighbours do not count");
}

prop_compose! {
    fn any_row()(
        row in prop::collection::btree_map(0u32..6, prop_oneof![1e-6f32..1.0, Just(0.0), Just(f32::MIN_POSITIVE)], 0..6),
    ) -> Vec<(u32, f32)> {
        let total: f32 = row.values().sum();
        row.into_iter().map(|(joint, weight)| (joint, if total > 0.0 { weight / total } else { weight })).collect()
    }
}

proptest! {
    #[test]
    fn rows_sum_to_one_and_locked_joints_keep_theirs(
        row in any_row(),
        mean in any_row(),
        targets in prop::collection::vec((0u32..6, prop_oneof![0.0f32..=1.0, Just(f32::NAN), Just(-3.0), Just(9.0)]), 1..3),
        locked in prop::collection::vec(any::<bool>(), 6),
        most in 1usize..8,
        by in -1.0f32..=1.0,
    ) {
        let rules = RowRules { locked: &locked, most };
        let mean: Vec<(u32, f64)> = mean.into_iter().map(|(joint, weight)| (joint, weight.into())).collect();
        for next in [assign(&row, &targets, &rules), towards(&row, &mean, by, &rules)] {
            prop_assert!(next.iter().all(|(_, weight)| weight.is_finite() && *weight >= 0.0), "{next:?}");
            for (joint, weight) in row.iter().filter(|(joint, weight)| locked[*joint as usize] && *weight > 0.0) {
                prop_assert_eq!(next.iter().find(|(other, _)| other == joint), Some(&(*joint, *weight)));
            }
            if next != row {
                prop_assert!((sum(&next) - 1.0).abs() < 1e-5, "{next:?}");
                prop_assert!(next.windows(2).all(|pair| pair[0].1 >= pair[1].1), "{next:?}");
            }
        }
    }
}

#[test]
fn every_stroke_leaves_sums_of_one_and_locked_joints() {
    let (points, triangles) = grid(20);
    let canvas = Canvas::new(&points, &triangles);
    let mut before = Weights { starts: vec![0], ..Weights::default() };
    for point in &points {
        let t = (point.x / 19.0).clamp(0.05, 0.95) * 0.8;
        before.push([(0, 0.8 - t), (1, t), (2, 0.2)]);
    }
    for mode in BrushMode::ALL {
        for (all_joints, reach) in [(false, BrushReach::Surface), (true, BrushReach::Volume)] {
            let brush = Brush { all_joints, reach, ..brush(mode, 5.0) };
            let mut stroke = PaintStroke::new(brush, Some(0), None, vec![false, false, true], 8).unwrap();
            for step in 0..12 {
                let spot = canvas.nearest(Vec3::new(6.0 + step as f32 * 0.5, 9.5, 0.3)).unwrap();
                stroke.dab(&canvas, &before, &spot, None);
                let after = painted(&stroke, &before);
                for row in rows(&after) {
                    assert!((sum(&row) - 1.0).abs() < 1e-5, "{mode:?}: {row:?}");
                    assert_eq!(weight(&row, 2), 0.2, "{mode:?} touches a locked joint: {row:?}");
                }
            }
            let after = painted(&stroke, &before);
            let middle = 9 * 20 + 9;
            let [was, is] = [&before, &after].map(|weights| weight(&rows(weights)[middle], 0));
            match mode {
                BrushMode::Add => assert!(is > was + 0.2, "{was} {is}"),
                BrushMode::Subtract => assert!(is < was - 0.2, "{was} {is}"),
                BrushMode::Replace => assert!((is - 0.5).abs() < 0.1, "{was} {is}"),
                // A slope is its own mean; its ends are not.
                BrushMode::Smooth | BrushMode::Sharpen => assert!((is - was).abs() < 0.1, "{was} {is}"),
            }
        }
    }
}

#[test]
fn smoothing_levels_an_edge_and_sharpening_raises_it() {
    let (points, triangles) = grid(12);
    let canvas = Canvas::new(&points, &triangles);
    let mut before = Weights { starts: vec![0], ..Weights::default() };
    for point in &points {
        let share = if point.x < 5.5 { 0.8 } else { 0.2 };
        before.push([(0, share), (1, 1.0 - share)]);
    }
    let across = |mode, all_joints| {
        let brush = Brush { all_joints, ..brush(mode, 9.0) };
        let mut stroke = PaintStroke::new(brush, Some(0), None, vec![false; 2], 8).unwrap();
        for _ in 0..4 {
            stroke.dab(&canvas, &before, &canvas.nearest(Vec3::new(5.5, 5.5, 0.0)).unwrap(), None);
        }
        let after = rows(&painted(&stroke, &before));
        weight(&after[5 * 12 + 5], 0) - weight(&after[5 * 12 + 6], 0)
    };
    for all_joints in [false, true] {
        assert!(across(BrushMode::Smooth, all_joints) < 0.45, "{all_joints}");
        assert!(across(BrushMode::Sharpen, all_joints) > 0.65, "{all_joints}");
    }
}

#[test]
fn the_number_of_dabs_does_not_matter_and_seams_stay_closed() {
    let (mut points, mut triangles) = grid(10);
    // A second sheet that shares the places of the last column.
    let seam: Vec<u32> = (0..10).map(|row| row * 10 + 9).collect();
    let first = points.len() as u32;
    points.extend(seam.iter().map(|point| points[*point as usize]).collect::<Vec<_>>());
    points.extend((0..10).map(|row| Vec3::new(10.0, row as f32, 0.0)));
    triangles.extend((first..first + 9).flat_map(|i| [[i, i + 10, i + 11], [i, i + 11, i + 1]]));
    let canvas = Canvas::new(&points, &triangles);
    let before = same(points.len(), &[(0, 1.0)]);
    let run = |dabs: usize| {
        let mut stroke = PaintStroke::new(brush(BrushMode::Add, 3.0), Some(1), None, vec![false; 2], 8).unwrap();
        for _ in 0..dabs {
            stroke.dab(&canvas, &before, &canvas.nearest(Vec3::new(8.5, 5.0, 0.0)).unwrap(), None);
        }
        painted(&stroke, &before)
    };
    let once = run(1);
    assert_eq!(once, run(20));
    let all = rows(&once);
    for (number, point) in seam.iter().enumerate() {
        assert_eq!(all[*point as usize], all[first as usize + number], "the seam opens at {point}");
    }
    assert!(weight(&all[first as usize + 15], 1) > 0.0, "the brush goes on behind the seam");
}

#[test]
fn on_the_surface_a_brush_stays_on_its_leg_and_through_the_volume_it_does_not() {
    let model = body();
    let canvas = Canvas::new(&model.points, &model.point_triangles());
    let spot = canvas.nearest(Vec3::new(0.02, 0.3, 0.0)).unwrap();
    assert!(spot.place.x > 0.01, "the inner side of the left leg: {spot:?}");
    let radius = 3.0 * spot.place.x;
    let sides = |reach| {
        let near = canvas.within(&spot, radius, reach);
        let left = near.iter().filter(|(point, _)| model.points[*point as usize].x > 0.0).count();
        (left, near.len() - left)
    };
    let (left, right) = sides(BrushReach::Surface);
    assert!(left > 10 && right == 0, "{left} on the leg, {right} on the other");
    let (left, right) = sides(BrushReach::Volume);
    assert!(left > 10 && right > 10, "{left} on the leg, {right} on the other");
}

#[test]
fn mirrored_strokes_are_symmetric_on_the_bundled_body() {
    let model = body();
    let canvas = Canvas::new(&model.points, &model.point_triangles());
    let before = same(model.points.len(), &[(0, 0.9), (3, 0.1)]);
    let mirror = Mirror { point: Vec3::ZERO, normal: Vec3::X };
    let partner = |place: Vec3| model.points.iter().position(|other| *other == Vec3::new(-place.x, place.y, place.z));
    for reach in [BrushReach::Surface, BrushReach::Volume] {
        let brush = Brush { reach, ..brush(BrushMode::Add, 0.12) };
        let mut stroke = PaintStroke::new(brush, Some(1), Some(2), vec![false, false, false, true], 8).unwrap();
        for step in 0..10 {
            // From the shoulder to the middle of the chest, where both sides meet.
            let spot = canvas.nearest(Vec3::new(0.25 - 0.025 * step as f32, 1.3, 0.2)).unwrap();
            stroke.dab(&canvas, &before, &spot, Some(&mirror));
        }
        let (changed, _) = stroke.changed(&before);
        let after = rows(&painted(&stroke, &before));
        assert!(changed.len() > 100);
        for point in changed {
            let other = partner(model.points[point as usize]).expect("the body is its own mirror image");
            let (own, other) = (&after[point as usize], &after[other]);
            for (joint, image) in [(0, 0), (1, 2), (2, 1), (3, 3)] {
                let gap = (weight(own, joint) - weight(other, image)).abs();
                assert!(gap < 1e-5, "{reach:?}: point {point}: {own:?} against {other:?}");
            }
            assert_eq!(weight(own, 3), 0.1);
        }
    }
}

#[test]
fn meshes_that_are_not_their_own_image_are_painted_at_the_nearest_place() {
    let (points, triangles) = grid(21);
    let shifted: Vec<Vec3> = points.iter().map(|point| *point - Vec3::new(10.3, 0.0, 0.0)).collect();
    let canvas = Canvas::new(&shifted, &triangles);
    let before = same(shifted.len(), &[(0, 1.0)]);
    let mirror = Mirror { point: Vec3::ZERO, normal: Vec3::X };
    let mut stroke = PaintStroke::new(brush(BrushMode::Add, 2.5), Some(1), Some(2), vec![false; 3], 8).unwrap();
    stroke.dab(&canvas, &before, &canvas.nearest(Vec3::new(6.0, 10.0, 0.0)).unwrap(), Some(&mirror));
    let after = rows(&painted(&stroke, &before));
    let total = |joint| after.iter().map(|row| weight(row, joint)).sum::<f32>();
    assert!(total(1) > 1.0 && (total(1) - total(2)).abs() < 0.5 * total(1), "{} {}", total(1), total(2));
    // Where there is nothing on the other side, there is nothing to paint.
    let far = Mirror { point: Vec3::new(1e3, 0.0, 0.0), normal: Vec3::X };
    let mut stroke = PaintStroke::new(brush(BrushMode::Add, 2.5), Some(1), Some(2), vec![false; 3], 8).unwrap();
    stroke.dab(&canvas, &before, &canvas.nearest(Vec3::new(6.0, 10.0, 0.0)).unwrap(), Some(&far));
    assert!(rows(&painted(&stroke, &before)).iter().all(|row| weight(row, 2) == 0.0));
}

#[test]
fn strange_meshes_are_painted_without_harm() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(f32::NAN), Vec3::splat(1e30), Vec3::Z];
    let triangles = [[0, 1, 2], [0, 1, 3], [1, 2, 99], [0, 0, 0]];
    let canvas = Canvas::new(&points, &triangles);
    // Fewer weights than points, and one point without any.
    let before = Weights { starts: vec![0, 1, 1, 2], joints: vec![0, 0], values: vec![1.0, 1.0] };
    for reach in [BrushReach::Surface, BrushReach::Volume] {
        let brush = Brush { reach, ..brush(BrushMode::Add, f32::MAX) };
        let mut stroke = PaintStroke::new(brush, Some(1), None, vec![false; 2], 8).unwrap();
        stroke.dab(&canvas, &before, &canvas.nearest(Vec3::splat(0.1)).unwrap(), None);
        for row in rows(&painted(&stroke, &before)) {
            assert!((sum(&row) - 1.0).abs() < 1e-5, "{row:?}");
        }
    }
    assert_eq!(canvas.nearest(Vec3::splat(f32::NAN)), None);
    assert_eq!(canvas.spot(99, Vec3::X), None);
    let empty = Canvas::new(&[], &[]);
    assert_eq!(empty.nearest(Vec3::ZERO), None);
}

#[test]
fn whole_meshes_are_normalised_and_pruned() {
    let mut messy = Weights { starts: vec![0], ..Weights::default() };
    messy.push([(0, 0.5), (1, 0.1), (2, 0.2)]);
    messy.push([(1, 3.0), (0, 1.0)]);
    messy.push([]);
    messy.push([(0, 0.75), (1, 0.25)]);
    messy.push([(2, 0.7)]);
    let locked = [false, false, true];
    let tidy = normalised(&messy, &locked);
    let all = rows(&tidy);
    assert_eq!(weight(&all[0], 2), 0.2, "locked");
    assert!((weight(&all[0], 0) - 0.8 * 5.0 / 6.0).abs() < 1e-6, "{:?}", all[0]);
    assert_eq!(all[1], [(1, 0.75), (0, 0.25)]);
    assert_eq!(all[2], []);
    assert_eq!(all[3], [(0, 0.75), (1, 0.25)]);
    assert_eq!(all[4], [(2, 0.7)], "a locked joint alone stays as it is");
    assert_eq!(normalised(&tidy, &locked), tidy, "what is in order stays to the bit");

    let mut many = Weights { starts: vec![0], ..Weights::default() };
    many.push([(0, 0.5), (1, 0.3), (3, 0.15), (2, 0.04), (4, 0.01)]);
    many.push([(0, 1.0)]);
    let pruned_to = |below, most| pruned(&many, &locked, &PruneSettings { below, most });
    let few = rows(&pruned_to(0.05, 8).unwrap());
    assert_eq!(few[0].iter().map(|(joint, _)| *joint).collect::<Vec<_>>(), [0, 1, 3, 2], "a locked one stays");
    assert_eq!((weight(&few[0], 2), &few[1]), (0.04, &vec![(0, 1.0)]));
    let few = rows(&pruned_to(0.0, 2).unwrap());
    assert_eq!(few[0].iter().map(|(joint, _)| *joint).collect::<Vec<_>>(), [0, 2]);
    let strongest = rows(&pruned_to(1.0, 8).unwrap());
    assert!((sum(&strongest[0]) - 1.0).abs() < 1e-6 && strongest[0][0].0 == 0, "{strongest:?}");
    for below in [-0.1, 1.1, f32::NAN] {
        assert!(matches!(pruned_to(below, 4), Err(PruneError::Threshold(_))), "{below}");
    }
    assert_eq!(pruned_to(0.1, 0), Err(PruneError::Influences));

    let kept = rows(&keep_locked(&messy, &same(5, &[(1, 1.0)]), &locked));
    assert_eq!(kept[0], [(1, 0.8), (2, 0.2)]);
    assert_eq!(kept[3], [(1, 1.0)]);
}

/// A skin of a few points over two joints, the second of which a command made.
fn skin(points: u32) -> SkinData {
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for point in 0..points {
        match point % 3 {
            0 => weights.push([(0, 1.0)]),
            1 => weights.push([(0, 0.6), (1, 0.4)]),
            _ => weights.push([]),
        }
    }
    SkinData { joints: vec![Uid(1), Uid(2)], weights, at_rest: true, subjects: [(Uid(2), Uid(1))].into() }
}

fn bytes(rig: &Rig) -> Option<Vec<u8>> {
    skin_data_bytes(rig.skin(MESH)?)
}

/// An app with a rig of two joints and two boxes of the same size, the first of which has weights.
fn app() -> (RigBench, [Entity; 2], Vec<Uid>) {
    let mut bench = RigBench::new();
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let spawn = |bench: &mut RigBench, uid| {
        let model = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
        bench.app.world_mut().spawn((RigMesh::new(uid, model, Vec::new()), SkinOf(bench.rig))).id()
    };
    let meshes = [spawn(&mut bench, MESH), spawn(&mut bench, Uid(0x51))];
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    (0..8).for_each(|point| weights.push([(0, 0.6), (1, 0.2 + 0.01 * point as f32)]));
    let skin = SkinData { joints: joints.clone(), weights, at_rest: true, ..SkinData::default() };
    bench.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
    (bench, meshes, joints)
}

fn change(bench: &mut RigBench, mesh: Entity, change: WeightChange) -> Result<usize, WeightChangeError> {
    bench.messages::<WeightChangeAnswer>();
    bench.send(WeightChangeRequest { mesh, change });
    bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<WeightChangeAnswer>>().is_empty());
    bench.app.update();
    bench.messages::<WeightChangeAnswer>().remove(0).result
}
