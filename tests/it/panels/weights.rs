//! The Weights panel: every action is one step that undo takes back to the bit, or is refused with the reason.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_egui::egui::{Key, pos2};
use rigsmith::{
    algo::paint::{BrushMode, BrushReach, FalloffCurve},
    editor::{
        panels::weights::WeightsPanel,
        tools::paint::{SelectedPoints, brush::PaintBrush},
    },
    mesh::model::Weights,
    plugins::{
        commands::{BuildRequest, BuildStep},
        history::RigHistory,
        painting::WeightChangeJob,
    },
    prelude::*,
    rig::{SkinData, TagKind, operations::TagOperation, skin::skin_data_bytes},
};

use super::desk::Desk;
use crate::gestures::boxes;

const MESH: Uid = Uid(97);
const OTHER: Uid = Uid(98);

/// A desk with two joints and two boxes, the first of which has weights that do not sum to one.
fn desk() -> (Desk, Vec<Uid>) {
    let mut desk = Desk::new(WeightsPanel::default());
    desk.resize(320.0, 1600.0);
    let joints = desk.chain(&["low", "high"]);
    for uid in [MESH, OTHER] {
        let mesh = RigMesh::new(uid, boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]), Vec::new());
        desk.app.world_mut().spawn((mesh, SkinOf(desk.rig)));
    }
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    (0..8).for_each(|point| weights.push([(0, 0.6), (1, 0.2 + 0.01 * point as f32)]));
    let skin = SkinData { joints: joints.clone(), weights, at_rest: true, ..SkinData::default() };
    desk.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
    desk.select(&joints[1..]);
    (desk, joints)
}

fn bytes(desk: &Desk) -> [Option<Vec<u8>>; 2] {
    [MESH, OTHER].map(|mesh| skin_data_bytes(desk.rig().skin(mesh)?))
}

fn settle(desk: &mut Desk) {
    desk.frames(3);
    crate::bench::wait(desk, "the end of the job", Desk::frame, |desk| {
        let mut jobs = desk.app.world().try_query::<&WeightChangeJob>();
        jobs.as_mut().is_none_or(|jobs| jobs.iter(desk.app.world()).count() == 0)
    });
    desk.frames(3);
}

/// Does something that has to be one step, and takes it back.
#[track_caller]
fn one_step(desk: &mut Desk, what: &str, act: impl FnOnce(&mut Desk)) -> Rig {
    let before = (desk.rig().clone(), bytes(desk), desk.steps().1);
    act(desk);
    settle(desk);
    let names = desk.app.world().get::<RigHistory>(desk.rig).unwrap().steps().0;
    assert_eq!(desk.steps().1, before.2 + 1, "{what} is one step: {names:?} {:?}", desk.told());
    let after = desk.rig().clone();
    assert_ne!(after, before.0, "{what}");
    desk.undo(1);
    assert_eq!(desk.rig(), &before.0, "{what} is taken back");
    assert_eq!(bytes(desk), before.1, "{what} is taken back to the bit");
    after
}

#[test]
fn every_action_is_a_step_that_undo_takes_back() {
    let (mut desk, joints) = desk();
    let after = one_step(&mut desk, "Normalise", |desk| desk.click("Normalise"));
    let sum = |rig: &Rig, point: usize| rig.skin(MESH).unwrap().weights.of(point).map(|(_, w)| w).sum::<f32>();
    assert!((0..8).all(|point| (sum(&after, point) - 1.0).abs() < 1e-6));
    // What was undone could be redone: a step of another kind goes on from here.
    let (mut desk, _) = self::desk();
    desk.app.world_mut().resource_mut::<PaintBrush>().prune.most = 1;
    desk.frames(2);
    let after = one_step(&mut desk, "Prune", |desk| desk.click("Prune"));
    assert!((0..8).all(|point| after.skin(MESH).unwrap().weights.of(point).len() == 1));

    let (mut desk, _) = self::desk();
    let after = one_step(&mut desk, "Lock", |desk| desk.click("Lock weights of low"));
    assert!(after.joint(joints[0]).unwrap().data.locked);

    let (mut desk, _) = self::desk();
    desk.app.world_mut().resource_mut::<SelectedPoints>().add(MESH, [3, 5]);
    desk.frames(3);
    let after = one_step(&mut desk, "a weight of a point", |desk| {
        desk.click("Weight of high at point 3");
        desk.type_text("0.75");
        desk.key(Key::Enter);
    });
    let row: Vec<(u32, f32)> = after.skin(MESH).unwrap().weights.of(3).collect();
    assert_eq!(row, [(1, 0.75), (0, 0.25)]);
    let after = one_step(&mut desk, "a weight of all points", |desk| {
        desk.click("Weight of high at all points");
        desk.type_text("0.5");
        desk.key(Key::Enter);
    });
    for point in [3, 5] {
        assert!(after.skin(MESH).unwrap().weights.of(point).eq([(0, 0.5), (1, 0.5)]));
    }
    let after = one_step(&mut desk, "a dragged weight", |desk| {
        let at = desk.find("Weight of high at point 5").rect.center();
        desk.drag(at, at + bevy_egui::egui::vec2(60.0, 0.0));
    });
    let row: Vec<(u32, f32)> = after.skin(MESH).unwrap().weights.of(5).collect();
    assert!(row[0].0 == 1 && row[0].1 > 0.4 && (row.iter().map(|(_, w)| w).sum::<f32>() - 1.0).abs() < 1e-6, "{row:?}");
}

#[test]
fn weights_are_copied_from_the_other_mesh() {
    let (mut desk, _) = desk();
    // The second mesh has no weights: it is chosen as the one to change.
    desk.click("Mesh");
    desk.frames(2);
    desk.click("boxes (2)");
    desk.frames(3);
    let after = one_step(&mut desk, "Copy", |desk| desk.click("Copy weights"));
    assert_eq!(after.skin(OTHER).unwrap().weights, after.skin(MESH).unwrap().weights);
}

#[test]
fn the_brush_is_set_and_nonsense_is_refused_with_words() {
    let (mut desk, joints) = desk();
    let brush = |desk: &Desk| *desk.app.world().resource::<PaintBrush>();
    let rig = desk.rig().clone();
    for mode in BrushMode::ALL {
        desk.click(mode.name());
        desk.frames(2);
        assert_eq!(brush(&desk).mode, mode);
    }
    let type_into = |desk: &mut Desk, field: &str, text: &str| {
        desk.click(field);
        desk.type_text(text);
        desk.key(Key::Enter);
        desk.frames(2);
    };
    type_into(&mut desk, "Strength", "0.5");
    type_into(&mut desk, "Radius", "0.2");
    type_into(&mut desk, "Falloff", "0.05");
    type_into(&mut desk, "Influences", "3");
    assert_eq!((brush(&desk).strength, brush(&desk).radius, brush(&desk).most), (0.5, Some(0.2), 3));
    assert!((brush(&desk).of_size(1.0).falloff - 0.05).abs() < 1e-6);
    let before = brush(&desk);
    for (field, text, words) in [
        ("Radius", "0", "radius"),
        ("Radius", "-1", "radius"),
        ("Falloff", "0.3", "falloff"),
        ("Strength", "2", "strength"),
        ("Strength", "nan", "no number"),
        ("Influences", "0", "influence"),
        ("Prune below", "2", "weight from 0 to 1"),
        ("Prune to", "0", "weight from 0 to 1"),
    ] {
        type_into(&mut desk, field, text);
        assert_eq!(brush(&desk), before, "{field} {text}");
        let told = desk.told();
        assert!(told.last().is_some_and(|told| told.to_lowercase().contains(words)), "{field} {text}: {told:?}");
    }
    // A drag is felt at once, and Escape takes it back.
    let at = desk.find("Radius").rect.center();
    desk.time += 1.0;
    desk.press(at);
    desk.move_to(at + bevy_egui::egui::vec2(20.0, 0.0));
    desk.move_to(at + bevy_egui::egui::vec2(60.0, 0.0));
    desk.frames(1);
    assert!(brush(&desk).radius > Some(0.2));
    desk.key(Key::Escape);
    desk.release(at);
    desk.frames(2);
    assert_eq!(brush(&desk), before);
    desk.click("Volume");
    desk.frames(2);
    assert_eq!(brush(&desk).reach, BrushReach::Volume);
    desk.click("Falloff curve");
    desk.frames(2);
    desk.click("Sharp");
    desk.frames(2);
    assert_eq!(brush(&desk).curve, FalloffCurve::Sharp);
    desk.click("All colours");
    desk.frames(2);
    assert!(brush(&desk).all_colors);
    assert_eq!(desk.rig(), &rig, "the brush is no part of the document");
    // The name of a joint selects it.
    desk.click("low");
    desk.frames(2);
    assert_eq!(desk.selected(), &joints[..1]);
}

#[test]
fn what_cannot_be_done_is_grey_or_told() {
    let (mut desk, joints) = desk();
    desk.app.world_mut().resource_mut::<SelectedPoints>().add(MESH, [3]);
    desk.edit(Operation::Lock(vec![joints[0]], true));
    desk.frames(3);
    assert!(!desk.find("Weight of low at point 3").enabled, "locked");
    assert!(desk.find("Weight of high at point 3").enabled);
    let rig = desk.rig().clone();
    for (text, words) in [("2", "no weight"), ("-0.5", "no weight"), ("half", "no number")] {
        desk.click("Weight of high at point 3");
        desk.type_text(text);
        desk.key(Key::Enter);
        desk.frames(2);
        assert_eq!(desk.rig(), &rig, "{text}");
        assert!(desk.told().last().is_some_and(|told| told.contains(words)), "{text}: {:?}", desk.told());
    }
    // Nothing but the locked joint could take what this one loses.
    desk.click("Weight of high at point 3");
    desk.type_text("0.1");
    desk.key(Key::Enter);
    desk.frames(2);
    let sum: f32 = desk.rig().skin(MESH).unwrap().weights.of(3).map(|(_, weight)| weight).sum();
    assert!(desk.rig() == &rig || (sum - 1.0).abs() < 1e-6);

    let mut empty = Desk::new(WeightsPanel::default());
    empty.frames(2);
    assert!(empty.says("There is no mesh: open one first."), "{:?}", empty.seen);
}

/// Names of everything that can be clicked, dragged or typed into, in a window of the least size that is supported.
#[test]
fn the_joints_are_those_of_the_last_build() {
    let (mut desk, joints) = desk();
    let kind = TagKind::Command { module: "insert_joints".to_owned(), feature: None, params: "()".to_owned() };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joints[0]], kind, index: None }));
    let listed = |desk: &mut Desk, step: BuildStep| {
        desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step });
        desk.frames(4);
        desk.seen.iter().filter(|seen| seen.label.starts_with("Lock weights of ")).count()
    };
    assert_eq!(listed(&mut desk, BuildStep::All), 3, "the inserted joint is there");
    assert_eq!(listed(&mut desk, BuildStep::RollBack), 2, "it is gone, though the rig has not changed");
    assert_eq!(listed(&mut desk, BuildStep::All), 3);
}

#[test]
fn the_panel_rests_while_a_change_waits_for_an_undone_step() {
    let (mut desk, joints) = desk();
    let offset = PoseOffset { translation: Vec3::X, ..PoseOffset::default() };
    let step = Operation::Pose(vec![(joints[0], offset)]);
    crate::bench::begin_drag(&mut desk.app, desk.rig);
    desk.click("Normalise");
    crate::bench::undo_meanwhile(&mut desk.app, desk.rig, step);
    crate::bench::wait(&mut desk, "the change", Desk::frame, |desk| {
        let jobs = desk.app.world().try_query::<&WeightChangeJob>();
        jobs.is_some_and(|mut jobs| jobs.iter(desk.app.world()).any(WeightChangeJob::waits))
    });
    desk.move_to(pos2(1.0, 1599.0));
    desk.frames(60);
    assert!(desk.says("The weights of the mesh are being changed."));
    assert!(desk.wakes_in > std::time::Duration::from_secs(1), "it is drawn again after {:?}", desk.wakes_in);
}

#[test]
fn every_widget_has_a_name_at_the_least_size() {
    let (mut desk, _) = desk();
    desk.app.world_mut().resource_mut::<SelectedPoints>().add(MESH, 0..8);
    desk.resize(300.0, 1600.0);
    for name in [
        "Add",
        "Subtract",
        "Replace",
        "Smooth",
        "Sharpen",
        "Strength",
        "Radius",
        "Falloff",
        "Influences",
        "Falloff curve",
        "Surface",
        "Volume",
        "Mirror",
        "All joints",
        "All colours",
        "Mesh",
        "Copy from",
        "Normalise",
        "Prune",
        "Copy weights",
        "Prune below",
        "Prune to",
        "Find joint",
        "Lock weights of low",
        "low",
        "high",
        "Weight of high at all points",
        "Weight of low at point 0",
        "Select no points",
    ] {
        let found = desk.find(name);
        assert!(found.rect.width() > 1.0 && found.rect.right() <= 301.0, "{name}: {:?}", found.rect);
    }
}
