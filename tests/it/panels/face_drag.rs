//! Work of a drag in the Face panel: frames visit no points of the head, however many it has.

mod requests;

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use bevy::{
    ecs::schedule::SingleThreadedExecutor,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task},
};
use bevy_egui::egui;
use rigsmith::{
    algo::face::expression::visited_points,
    editor::{
        ActiveRig,
        panels::{PanelsPlugin, face::FacePanel},
    },
    headless::headless_app,
    mesh::model::{Faces, Model, Object, Part},
    plugins::{
        face::{ExpressRequest, Expressions, Face, FaceExpressions, FacePosing, FacePreparation, expressed_points},
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    test_app::strict_app,
};

use super::{
    desk::{Desk, Sheet},
    face::{happiness, pictures, wait},
};
use crate::heads;

fn model((points, triangles): heads::Mesh) -> Model {
    let part = Part {
        vertices: (0..points.len() as u32).collect(),
        faces: Faces {
            starts: (0..=triangles.len() as u32).map(|number| 3 * number).collect(),
            corners: triangles.concat(),
        },
        triangles,
        ..default()
    };
    Model { points, objects: vec![Object::default()], parts: vec![part], ..default() }
}

/// The Face panel with a placed face, in an app whose systems all run on this thread.
fn with_face(model: Model) -> (Desk, Entity) {
    let mut app = headless_app(1);
    app.add_plugins(PanelsPlugin);
    let mut app = strict_app(app);
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    app.insert_resource(ActiveRig(rig));
    let mesh = app.world_mut().spawn((RigMesh::new(Uid(99), model, Vec::new()), SkinOf(rig))).id();
    let sheet = Sheet::Panel(Box::new(FacePanel::default()));
    let mut desk = Desk::of(app, rig, sheet, egui::vec2(320.0, 1400.0));
    desk.frames(2);
    desk.click("Place face");
    wait(&mut desk, mesh);
    desk.until("the prepared face", |desk| desk.app.world().get::<FacePosing>(mesh).is_some() && pictures(desk) == 6);
    (desk, mesh)
}

/// Points that frames visit while the slider of happiness is dragged and let go.
fn visits_of_a_drag(head: heads::Mesh) -> u64 {
    let count = head.0.len();
    let (mut desk, mesh) = with_face(model(head));
    let [slider, _] = happiness(&desk);
    let at = |share: f32| egui::pos2(slider.left() + share * slider.width(), slider.center().y);
    let strength = |desk: &Desk| {
        let shown = desk.app.world().get::<Expressions>(mesh).and_then(|shown| shown.0.get("happiness").copied());
        shown.unwrap_or_default()
    };
    let steps = desk.steps().0;
    let before = visited_points();
    desk.time += 1.0;
    desk.press(at(0.05));
    let mut last = 0.0;
    for share in [0.2, 0.4, 0.6] {
        desk.move_to(at(share));
        desk.until("the pose", |desk| !desk.app.world().get::<FacePosing>(mesh).unwrap().is_running());
        assert!(strength(&desk) > last + 0.1, "{count} points at {share}: {} after {last}", strength(&desk));
        assert!(!desk.rig().pose().is_empty() && desk.steps().0 == steps, "{count} points: a preview");
        last = strength(&desk);
    }
    // Let go while the last pose is computed: the step waits for it.
    desk.move_to(at(0.8));
    desk.release(at(0.8));
    desk.until("the step", |desk| desk.steps().0 > steps);
    desk.frames(4);
    let visits = visited_points() - before;
    assert!(strength(&desk) > last + 0.1 && desk.steps().0 == steps + 1, "{count} points: {}", strength(&desk));
    // The count is one of this thread, and sees what is done here.
    let world = desk.app.world();
    let (mesh, face) = (world.get::<RigMesh>(mesh).unwrap(), world.get::<Face>(mesh).unwrap());
    let set = world.resource::<FaceExpressions>().0.clone();
    let before = visited_points();
    let strengths = [("happiness".to_owned(), 1.0)].into();
    expressed_points(desk.rig(), mesh, &face.analysis, &set, &strengths).unwrap();
    let counted = visited_points() - before;
    assert!(counted > face.analysis.points.len() as u64, "{count} points: {counted} are counted");
    visits
}

#[test]
fn frames_of_a_drag_visit_no_points() {
    let head = heads::bundled();
    let finer = heads::subdivided(&head);
    assert!(finer.0.len() > 3 * head.0.len(), "{} and {} points", head.0.len(), finer.0.len());
    assert_eq!([head, finer].map(visits_of_a_drag), [0, 0]);
}

/// Points that frames visit while the pictures are drawn again after a change of weights.
fn visits_of_new_pictures(head: heads::Mesh) -> u64 {
    let (mut desk, _) = with_face(model(head));
    let skin = desk.rig().skin(Uid(99)).expect("the weights of the face").clone();
    let before = visited_points();
    let edits = vec![RigEdit::SetSkin(Uid(99), Some(Arc::new((*skin).clone())))];
    let (held, threads) = busy_threads();
    desk.edit(Operation::Named { name: "Bind", edits });
    desk.frames(2);
    assert_eq!(pictures(&desk), 0, "pictures of former weights are dropped");
    drop(held);
    desk.until("the pictures", |desk| pictures(desk) == 6);
    drop(threads);
    visited_points() - before
}

#[test]
fn frames_that_renew_pictures_visit_no_points() {
    let head = heads::bundled();
    let finer = heads::subdivided(&head);
    assert_eq!([head, finer].map(visits_of_new_pictures), [0, 0]);
}

/// Threads of the background, all kept busy until `held` is dropped, so that nothing else is computed there.
/// One test at a time keeps them: two that had half of them each would wait for each other.
pub(crate) fn busy_threads() -> (Arc<()>, (Vec<Task<()>>, MutexGuard<'static, ()>)) {
    static KEPT: Mutex<()> = Mutex::new(());
    let one = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let (pool, held) = (AsyncComputeTaskPool::get(), Arc::new(()));
    let busy = Arc::new(AtomicUsize::new(0));
    let waits = |_| -> Task<()> {
        let (held, busy) = (Arc::downgrade(&held), busy.clone());
        pool.spawn(async move {
            busy.fetch_add(1, Ordering::SeqCst);
            while held.strong_count() > 0 {
                std::thread::sleep(Duration::from_millis(1));
            }
        })
    };
    let threads: Vec<Task<()>> = (0..pool.thread_num()).map(waits).collect();
    // A task that is only queued holds no thread: what is spawned later may overtake it.
    while busy.load(Ordering::SeqCst) < pool.thread_num() {
        std::thread::sleep(Duration::from_millis(1));
    }
    (held, (threads, one))
}

/// An undo that comes while the step of a slider is computed is about that step.
#[test]
fn undo_waits_for_the_step_of_a_slider() {
    let (mut desk, mesh) = with_face(model(heads::bundled()));
    let express = |desk: &mut Desk, name: &str, strength: f32, preview: bool| {
        let strengths = [(name.to_owned(), strength)].into();
        desk.app.world_mut().write_message(ExpressRequest { mesh, strengths, preview });
        desk.frame();
    };
    let change = |desk: &mut Desk, change: Change| {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
    };
    let shown =
        |desk: &Desk| desk.app.world().get::<Expressions>(mesh).map(|shown| shown.0.clone()).unwrap_or_default();
    let posing = |desk: &Desk| desk.app.world().get::<FacePosing>(mesh).unwrap().is_running();
    express(&mut desk, "anger", 0.5, false);
    desk.until("anger", |desk| !posing(desk));
    desk.frames(2);
    let (before, anger, steps) = (desk.rig().clone(), shown(&desk), desk.steps());
    assert_eq!(anger.get("anger"), Some(&0.5));

    let (held, threads) = busy_threads();
    express(&mut desk, "happiness", 0.4, true);
    express(&mut desk, "happiness", 0.8, false);
    change(&mut desk, Change::Undo);
    desk.frames(2);
    assert!(posing(&desk));
    assert_eq!((desk.steps(), shown(&desk)), (steps, anger.clone()), "nothing is undone before the step is there");
    change(&mut desk, Change::Do(Operation::StorePose("after".to_owned())));
    desk.frames(2);
    assert_eq!((desk.steps(), shown(&desk)), ((steps.0 + 1, steps.1 + 1), anger.clone()));
    drop(held);
    desk.until("the step", |desk| !posing(desk));
    desk.frames(4);
    drop(threads);
    // The slider is back, and the step before it is as it was.
    assert_eq!((desk.steps(), shown(&desk)), ((steps.0 + 2, steps.1 + 1), anger.clone()));
    assert_eq!(desk.rig().stored_poses().len(), before.stored_poses().len() + 1);
    desk.undo(1);
    assert_eq!(*desk.rig(), before);

    // A redo of the step that was awaited brings it back.
    let (held, threads) = busy_threads();
    express(&mut desk, "happiness", 0.4, true);
    express(&mut desk, "happiness", 0.8, false);
    change(&mut desk, Change::Undo);
    desk.frame();
    drop(held);
    desk.until("the step", |desk| !posing(desk));
    desk.frames(4);
    drop(threads);
    assert_eq!((desk.steps(), shown(&desk)), ((steps.0 + 1, steps.1), anger));
    change(&mut desk, Change::Redo);
    desk.frames(3);
    assert_eq!(shown(&desk).get("happiness"), Some(&0.8));

    // Also one that came before the request of its step.
    let steps = desk.steps();
    change(&mut desk, Change::Undo);
    express(&mut desk, "sadness", 0.7, false);
    desk.until("sadness", |desk| !posing(desk));
    desk.frames(3);
    assert_eq!(shown(&desk).get("happiness"), Some(&0.8), "sadness is undone: {:?}", shown(&desk));
    assert_eq!(desk.steps(), (steps.0 + 1, steps.1));

    // Also in the frame in which the step is made: the pose of sadness was computed last.
    change(&mut desk, Change::Undo);
    express(&mut desk, "sadness", 0.7, false);
    assert!(!posing(&desk));
    desk.frames(3);
    assert_eq!(shown(&desk).get("happiness"), Some(&0.8), "sadness is undone: {:?}", shown(&desk));
    assert_eq!(desk.steps(), (steps.0 + 1, steps.1));
}

/// Gestures come after a step that is computed, and an undo that waits for one is not answered with the words of another.
#[test]
fn gestures_wait_for_the_step_of_a_slider() {
    let (mut desk, mesh) = with_face(model(heads::bundled()));
    let ask = |desk: &mut Desk, name: &str, strength: f32, preview: bool| {
        let strengths = [(name.to_owned(), strength)].into();
        desk.app.world_mut().write_message(ExpressRequest { mesh, strengths, preview });
    };
    let store = |desk: &mut Desk, name: &str| {
        let change = Change::Do(Operation::StorePose(name.to_owned()));
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
    };
    let play = |desk: &mut Desk, gesture: Gesture| {
        let rig = desk.rig;
        desk.app.world_mut().entity_mut(rig).insert(GestureScript::new([gesture]));
    };
    let script = |desk: &Desk| {
        let script = desk.app.world().get::<GestureScript>(desk.rig).expect("the script");
        (script.is_done(), script.answers.clone())
    };
    let posing = |desk: &Desk| desk.app.world().get::<FacePosing>(mesh).unwrap().is_running();
    let shown =
        |desk: &Desk| desk.app.world().get::<Expressions>(mesh).map(|shown| shown.0.clone()).unwrap_or_default();
    ask(&mut desk, "anger", 0.5, false);
    desk.frame();
    desk.until("anger", |desk| !posing(desk));
    desk.frames(2);
    let (anger, steps) = (shown(&desk), desk.steps().0);
    assert_eq!(anger.get("anger"), Some(&0.5));

    // The gesture comes while the step is computed, and in the frame in which it begins to be.
    // The last pose is kept, so each has another one.
    for (number, strength, is_before) in [(1, 0.8, false), (2, 0.7, true)] {
        let name = format!("between {number}");
        let (held, threads) = busy_threads();
        ask(&mut desk, "happiness", 0.4, true);
        desk.frame();
        if is_before {
            play(&mut desk, Gesture::Undo);
        }
        ask(&mut desk, "happiness", strength, false);
        desk.frames(2);
        if !is_before {
            play(&mut desk, Gesture::Undo);
        }
        store(&mut desk, &name);
        desk.frames(3);
        assert!(posing(&desk) && !script(&desk).0, "{name}: {:?}", script(&desk).1);
        drop(held);
        desk.until("the step", |desk| !posing(desk));
        desk.until("the answer", |desk| script(desk).0);
        drop(threads);
        let answers = script(&desk).1;
        assert!(answers.len() == 1 && answers[0].done && !answers[0].message.contains(&name), "{answers:?}");
        // The slider is back, and the stored pose stays.
        assert_eq!(shown(&desk), anger, "{name}");
        assert_eq!(desk.rig().stored_poses().len(), number, "{name}");
        assert_eq!(desk.steps().0, steps + 1 + number, "{name}");
    }
}

/// A preview that is computed for weights of before does not come back in place of a step.
#[test]
fn a_step_outlives_a_preview_for_other_weights() {
    let (mut desk, mesh) = with_face(model(heads::bundled()));
    let request = |strength: f32, preview: bool| ExpressRequest {
        mesh,
        strengths: [("happiness".to_owned(), strength)].into(),
        preview,
    };
    let (held, threads) = busy_threads();
    desk.app.world_mut().write_message(request(0.5, true));
    desk.frame();
    let skin = desk.rig().skin(Uid(99)).expect("the weights of the face").clone();
    let edits = vec![RigEdit::SetSkin(Uid(99), Some(Arc::new((*skin).clone())))];
    desk.edit(Operation::Named { name: "Bind", edits });
    assert!(!desk.rig().skin(Uid(99)).is_some_and(|now| Arc::ptr_eq(now, &skin)));
    let steps = desk.steps().1;
    desk.app.world_mut().write_message(request(1.0, false));
    desk.frames(2);
    drop(held);
    desk.until("the face for the weights of now", |desk| {
        let world = desk.app.world();
        world.get::<FacePreparation>(mesh).is_none() && !world.get::<FacePosing>(mesh).unwrap().is_running()
    });
    desk.frames(4);
    drop(threads);
    let shown = desk.app.world().get::<Expressions>(mesh).cloned().unwrap_or_default();
    assert_eq!(shown.0.get("happiness"), Some(&1.0), "{shown:?}");
    assert_eq!(desk.steps().1, steps + 1, "{shown:?}");
}
