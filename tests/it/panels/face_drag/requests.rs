//! Expressions that no drag asks for: typed numbers, Reset, and what other code writes.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_egui::egui;
use rigsmith::{
    algo::face::{auto::AutoSettings, expression::visited_points},
    headless::Workbench,
    plugins::{
        face::{BackgroundPosing, ExpressRequest, Expressions, FacePosing},
        history::RigHistory,
        surface::RigMesh,
    },
    prelude::*,
    rig::template::write_template,
};

use super::{busy_threads, model, with_face};
use crate::{
    bench::wait,
    heads,
    panels::{desk::Desk, face::happiness},
};

type Strengths = BTreeMap<String, f32>;

fn strength(name: &str, strength: f32) -> Strengths {
    [(name.to_owned(), strength)].into()
}

fn shown(world: &World, mesh: Entity) -> Strengths {
    world.get::<Expressions>(mesh).map(|shown| shown.0.clone()).unwrap_or_default()
}

fn is_posing(world: &World, mesh: Entity) -> bool {
    world.get::<FacePosing>(mesh).is_some_and(FacePosing::is_running)
}

/// Runs frames until an expression has become the next step.
#[track_caller]
fn await_step(desk: &mut Desk, mesh: Entity, steps: (usize, usize), strengths: &Strengths) {
    desk.until("the step", |desk| desk.steps().0 > steps.0);
    desk.frames(4);
    assert_eq!((desk.steps(), shown(desk.app.world(), mesh)), ((steps.0 + 1, steps.1 + 1), strengths.clone()));
    assert_eq!(desk.rig().pose().is_empty(), strengths.is_empty(), "{strengths:?}");
}

/// Points that frames visit while expressions are typed, written and reset.
fn visits_of_requests(head: heads::Mesh) -> u64 {
    let (mut desk, mesh) = with_face(model(head));
    let [_, number] = happiness(&desk);
    let before = visited_points();

    let steps = desk.steps();
    desk.time += 1.0;
    desk.click_at(number.center());
    desk.frames(2);
    desk.type_text("0.75");
    desk.key(egui::Key::Enter);
    await_step(&mut desk, mesh, steps, &strength("happiness", 0.75));

    let (steps, written) = (desk.steps(), strength("surprise", 0.5));
    desk.app.world_mut().entity_mut(mesh).insert(Expressions(written.clone()));
    await_step(&mut desk, mesh, steps, &written);

    let (steps, strengths) = (desk.steps(), strength("anger", 0.5));
    let request = ExpressRequest { mesh, strengths: strengths.clone(), preview: false };
    desk.app.world_mut().write_message(request);
    await_step(&mut desk, mesh, steps, &strengths);

    let steps = desk.steps();
    desk.click("Reset");
    await_step(&mut desk, mesh, steps, &Strengths::new());
    visited_points() - before
}

#[test]
fn frames_of_requests_visit_no_points() {
    let head = heads::bundled();
    let finer = heads::subdivided(&head);
    assert_eq!([head, finer].map(visits_of_requests), [0, 0]);
}

/// An undo right after a Reset is about the Reset, and a redo after both, too.
#[test]
fn undo_waits_for_the_step_of_a_reset() {
    let (mut desk, mesh) = with_face(model(heads::bundled()));
    let (steps, strengths) = (desk.steps(), strength("happiness", 0.8));
    let request = ExpressRequest { mesh, strengths: strengths.clone(), preview: false };
    desk.app.world_mut().write_message(request);
    await_step(&mut desk, mesh, steps, &strengths);
    let (before, steps) = (desk.rig().clone(), desk.steps());
    let change = |desk: &mut Desk, change: Change| {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
    };

    let (held, threads) = busy_threads();
    desk.click("Reset");
    change(&mut desk, Change::Undo);
    desk.frames(2);
    assert!(is_posing(desk.app.world(), mesh));
    assert_eq!(desk.steps(), steps, "nothing is undone before the step is there");
    assert_eq!(*desk.rig(), before);
    assert!(!desk.find("Reset").enabled, "the panel shows the strengths that come");
    drop(held);
    desk.until("the step", |desk| !is_posing(desk.app.world(), mesh));
    desk.frames(4);
    drop(threads);
    assert_eq!((desk.steps(), shown(desk.app.world(), mesh)), ((steps.0 + 1, steps.1), strengths));
    assert_eq!(*desk.rig(), before);
    change(&mut desk, Change::Redo);
    desk.frames(3);
    assert!(desk.rig().pose().is_empty() && shown(desk.app.world(), mesh).is_empty());
    assert_eq!(desk.steps(), (steps.0 + 1, steps.1 + 1));
}

/// The second of two equal requests finds its strengths shown.
#[test]
fn equal_requests_of_a_frame_are_one_step() {
    let (mut desk, mesh) = with_face(model(heads::bundled()));
    let (steps, strengths) = (desk.steps(), strength("happiness", 0.8));
    for _ in 0..2 {
        let request = ExpressRequest { mesh, strengths: strengths.clone(), preview: false };
        desk.app.world_mut().write_message(request);
    }
    desk.frame();
    desk.until("both", |desk| !is_posing(desk.app.world(), mesh));
    await_step(&mut desk, mesh, steps, &strengths);
}

/// A workbench with a face of the bundled head.
fn workbench() -> (Workbench, Entity) {
    let mut bench = Workbench::new(1, "face");
    bench.open(model(heads::bundled()), true).unwrap();
    bench.face(AutoSettings { bones: 24, ..AutoSettings::default() }, None, &mut |_, _| {}).unwrap();
    let world = bench.app_mut().world_mut();
    let mesh = world.query_filtered::<Entity, With<RigMesh>>().single(world).unwrap();
    (bench, mesh)
}

/// A workbench waits for a pose of the background, and has what a frame computes, byte by byte.
#[test]
fn poses_of_the_background_are_those_of_the_frame() {
    let [mut of_frame, mut of_background] = [workbench().0, workbench().0];
    of_background.app_mut().insert_resource(BackgroundPosing);
    for strengths in [strength("happiness", 1.0), strength("surprise", 0.7), Strengths::new(), strength("anger", 1.5)] {
        let [first, second] = [&mut of_frame, &mut of_background].map(|bench| {
            bench.express(strengths.clone()).unwrap();
            let rig = bench.rig_entity();
            let steps = bench.app_mut().world().get::<RigHistory>(rig).unwrap().steps().0.len();
            (write_template(bench.rig()), bench.rig().pose().clone(), steps)
        });
        assert_eq!(first, second, "{strengths:?}");
        assert_eq!(first.1.is_empty(), strengths.is_empty());
    }
    let refused = of_background.express(strength("hapiness", 1.0)).unwrap_err().to_string();
    assert!(refused.contains("happiness"), "{refused}");
}

/// Of two expressions that are asked for in one frame, the second takes the place of the first, also without a window.
#[test]
fn expressions_of_one_frame_do_not_mix() {
    let ((mut bench, mesh), (mut other, _)) = (workbench(), workbench());
    for name in ["happiness", "sadness"] {
        let request = ExpressRequest { mesh, strengths: strength(name, 1.0), preview: false };
        bench.app_mut().world_mut().write_message(request);
    }
    let rig = bench.rig_entity();
    let steps = |app: &App| app.world().get::<RigHistory>(rig).unwrap().steps().0.len();
    let app = bench.app_mut();
    let before = steps(app);
    app.update();
    assert_eq!(steps(app), before + 1, "the first one shows in its frame");
    wait(app, "the second one", App::update, |app| !is_posing(app.world(), mesh));
    app.update();
    assert_eq!((steps(app), shown(app.world(), mesh)), (before + 2, strength("sadness", 1.0)));
    other.express(strength("sadness", 1.0)).unwrap();
    assert!(!other.rig().pose().is_empty());
    assert_eq!(bench.rig().pose(), other.rig().pose());
}

/// Without a background, an expression that follows a step of its frame comes in the next frame, in its order, however busy the
/// machine is.
#[test]
fn expressions_of_one_frame_come_one_a_frame() {
    let ((mut bench, mesh), (mut other, _)) = (workbench(), workbench());
    let (held, threads) = busy_threads();
    let names = ["happiness", "sadness", "anger"];
    for name in names {
        let request = ExpressRequest { mesh, strengths: strength(name, 1.0), preview: false };
        bench.app_mut().world_mut().write_message(request);
    }
    let rig = bench.rig_entity();
    let steps = |app: &App| app.world().get::<RigHistory>(rig).unwrap().steps().0.len();
    let app = bench.app_mut();
    let before = steps(app);
    for (number, name) in (1..).zip(names) {
        app.update();
        assert_eq!((steps(app), shown(app.world(), mesh)), (before + number, strength(name, 1.0)), "{name}");
    }
    assert!(!is_posing(app.world(), mesh));
    drop(held);
    drop(threads);
    other.express(strength("anger", 1.0)).unwrap();
    assert_eq!(bench.rig().pose(), other.rig().pose());
}

/// Code that asks for another expression in each frame gets some of them, and the last one, however long one takes.
#[test]
fn requests_that_wait_are_bounded_and_end_with_the_last() {
    let (mut desk, mesh) = with_face(model(heads::bundled()));
    let steps = desk.steps().0;
    let (held, threads) = busy_threads();
    for number in 1..=200 {
        let strengths = strength("anger", number as f32 / 200.0);
        desk.app.world_mut().write_message(ExpressRequest { mesh, strengths, preview: false });
        desk.frame();
    }
    drop(held);
    desk.until("the last one", |desk| {
        !is_posing(desk.app.world(), mesh) && shown(desk.app.world(), mesh) == strength("anger", 1.0)
    });
    drop(threads);
    desk.frames(4);
    let made = desk.steps().0 - steps;
    assert!((2..=40).contains(&made), "{made} steps");
}
