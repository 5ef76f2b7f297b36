//! Answers to gestures in an app in which other code makes requests, too: gestures take none of its answers for their own.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        document::{Change, EditRequest, JointPick},
        gesture::{Gesture, GestureAnswer, GestureScript, read_gestures},
        picking::{Pick, PickRequest},
    },
    rig::operations::Operation,
};

use crate::click_runs::bench_on;

const BOX: [[[f32; 3]; 2]; 1] = [[[-1.0, 0.0, -0.5], [1.0, 2.0, 0.5]]];

const LIST: &str = "[Click((0.0, 0.5)), Label(\"low\"), Click((0.0, 1.5)), Undo, Redo, Undo, \
     Stroke(points: [(-0.5, 0.2), (0.5, 1.8)], joints: 3), SelectAll, Deselect, SelectLabel(\"low\"), \
     MoveTo((0.1, 0.6, 0.0)), Undo, Redo]";

/// Answers to gestures on a box; other code makes requests in each frame.
fn answers(gestures: &[Gesture], is_unwatched: bool, ask: impl Fn(&mut World, Entity)) -> Vec<GestureAnswer> {
    let mut bench = bench_on(&BOX);
    let rig = bench.rig_entity();
    let gestures = gestures.to_vec();
    let script = if is_unwatched { GestureScript::unwatched(gestures) } else { GestureScript::new(gestures) };
    let app = bench.app_mut();
    app.world_mut().entity_mut(rig).insert(script);
    for _ in 0..10_000 {
        ask(app.world_mut(), rig);
        app.update();
        let script = app.world().get::<GestureScript>(rig).unwrap();
        if script.is_done() {
            return script.answers.clone();
        }
    }
    panic!("the gestures do not end");
}

#[track_caller]
fn check(ask: impl Fn(&mut World, Entity)) {
    let gestures = read_gestures(LIST.as_bytes()).unwrap();
    for is_unwatched in [false, true] {
        let alone = answers(&gestures, is_unwatched, |_, _| {});
        assert!(alone.iter().all(|answer| answer.done), "{alone:?}");
        assert_eq!(answers(&gestures, is_unwatched, &ask), alone, "unwatched: {is_unwatched}");
    }
}

#[test]
fn refusals_of_other_requests_are_no_answers() {
    check(|world, rig| {
        let change = Change::Pick(JointPick::Label("none".to_owned()));
        world.write_message(EditRequest { rig, change });
    });
}

#[test]
fn edits_of_other_requests_are_no_answers() {
    check(|world, rig| {
        let operation = Operation::Named { name: "Nothing to do", edits: Vec::new() };
        world.write_message(EditRequest::operation(rig, operation));
    });
}

#[test]
fn picks_of_other_requests_are_no_answers() {
    check(|world, rig| {
        world.write_message(PickRequest { rig, what: Pick::Joints(Vec::new()), add: true });
    });
}
