//! Operations on selected joints in lists that nobody watches: the same result as one a frame, and frames in proportion to the
//! length of the list.

use std::time::Duration;

use bevy::prelude::*;
use rigsmith::{
    plugins::gesture::Gesture,
    processor::BuildLimits,
    rig::{Rig, operations::Axis},
};

use crate::click_runs::{bench_on, check_on};

/// Largest growth for twice the length.
const GROWTH: f64 = 2.3;

const BOX: [[[f32; 3]; 2]; 1] = [[[-1.0, 0.0, -0.5], [1.0, 2.0, 0.5]]];

#[test]
fn runs_of_operations_give_what_operations_one_a_frame_give() {
    let clicks = "Click((0.0, 0.2)), Label(\"a\"), Click((0.0, 0.6)), Label(\"b\"), Click((0.3, 0.9)), Label(\"c\"), \
                  Click((-0.4, 1.5)), Label(\"d\")";
    for operations in [
        "Move((0.1, 1.2)), Move((0.1, 1.2)), MoveTo((0.2, 1.1, 0.3)), Rotate(10.0), Rotate(-30.0), Scale(2.0), Undo, \
         Rotate(5.0), View(Left), Move((0.1, 1.0)), Insert((0.1, 0.9)), Label(\"e\"), Orient(X), Orient(Y), Undo, Undo",
        "SelectLabel(\"b\"), Delete, Delete, SelectLabel(\"c\"), Rotate(20.0), Delete, Label(\"none\"), \
         SelectLabel(\"missing\"), Move((0.0, 0.0)), SelectLabel(\"a\"), Insert((0.0, 0.1)), DeleteHierarchy, Undo",
        "SelectLabel(\"b\"), Unparent, SelectLabel(\"c\"), Parent, Add((0.0, 0.2)), Parent, Unparent, Lock(true), \
         SelectAll, Rotate(15.0), Orient(Z), Group(\"g\", None), Unparent, Delete, Rotate(3.0), Click((0.1, 0.4))",
        "Mirror(true), Click((0.5, 1.0)), Rotate(10.0), Move((0.6, 1.1)), Orient(X), Delete, SelectLabel(\"c\"), \
         MirrorSelected, Rotate(4.0), Deselect, Move((0.2, 0.2)), Select((0.0, 0.2)), Move((0.1, 0.3)), \
         Select((0.1, 0.3)), Move((0.1, 0.3)), Select((0.1, 0.3)), Delete",
        "MirrorSelected, MirrorSelected, Labels([\"p\", \"q\"]), Labels([]), SelectLabel(\"q\"), MirrorSelected, \
         Labels([\"x\", \"y\", \"z\", \"v\", \"w\", \"u\", \"t\"]), Rotate(4.0), Labels([\"r\"]), Undo, Labels([\"s\"]), \
         Deselect, MirrorSelected, Labels([\"none\"]), SelectLabel(\"s\"), MirrorSelected, Delete, Click((0.3, 0.4)), \
         Labels([\"new\"]), MirrorSelected",
    ] {
        let answers = check_on(&BOX, &format!("[{clicks}, {operations}]"), |_| ());
        assert!(answers.iter().filter(|answer| answer.done).count() > 8, "{answers:?}");
    }
    let answers = check_on(&BOX, "[Rotate(1.0), Delete, Click((0.0, 0.2)), Delete, Delete]", |_| ());
    assert_eq!(answers[0].message, "no joint is selected; select one first");
    assert_eq!(answers.iter().map(|answer| answer.done).collect::<Vec<_>>(), [false, false, true, true, false]);
}

/// Gestures of a run that is requested when the time is over are answered as what they did, and the next one is given up.
#[test]
fn a_run_that_the_time_ends_answers_for_what_it_did() {
    let clicks = |count: usize| -> Vec<Gesture> {
        (0..count).map(|number| Gesture::Click((0.3, 0.1 + 0.01 * number as f32))).collect()
    };
    let mut bench = bench_on(&BOX);
    assert!(bench.gestures(clicks(1))[0].done);
    bench.set_limits(BuildLimits::default(), Duration::ZERO);
    let answers = bench.gestures(clicks(100));
    let (last, done) = answers.split_last().unwrap();
    assert!(done.len() >= 2 && done.iter().all(|answer| answer.done && answer.joints_added == 1), "{answers:?}");
    assert_eq!(bench.rig().len(), done.len() + 1);
    assert!(last.out_of_time && !last.done && last.message.contains("`seconds`"), "{last:?}");
    assert_eq!((last.number, last.gesture.as_str()), (done.len() + 1, "Click"));
    // What the last run of a list has done is done.
    let answers = bench.gestures(vec![Gesture::Undo, Gesture::Undo]);
    assert!(
        answers.len() == 2 && answers.iter().all(|answer| answer.done && !answer.message.is_empty()),
        "{answers:?}"
    );
}

/// Joints of the rigs that entities had to follow, over all frames.
#[derive(Resource, Default)]
struct FollowedJoints(u64);

fn count_followed(mut followed: ResMut<FollowedJoints>, rigs: Query<&Rig, Changed<Rig>>) {
    followed.0 += rigs.iter().map(|rig| rig.len() as u64).sum::<u64>();
}

/// Joints that entities follow while a rig of so many joints, each with a name, is operated on so many times.
fn followed(count: usize, operations: impl Fn(usize) -> Vec<Gesture>) -> u64 {
    let mut bench = bench_on(&BOX);
    bench.app_mut().init_resource::<FollowedJoints>().add_systems(Last, count_followed);
    let place = |number: usize| {
        let at = (-0.95 + 0.03 * (number % 60) as f32, 0.05 + 0.03 * (number / 60) as f32);
        [Gesture::Click(at), Gesture::Label(format!("joint{number}"))]
    };
    bench.gestures((0..count).flat_map(place).collect());
    assert_eq!(bench.rig().len(), count);
    bench.app_mut().world_mut().resource_mut::<FollowedJoints>().0 = 0;
    let answers = bench.gestures((0..count).flat_map(operations).collect());
    assert!(answers.iter().all(|answer| answer.done), "{:?}", answers.iter().find(|answer| !answer.done));
    bench.app_mut().world().resource::<FollowedJoints>().0
}

#[test]
fn mirrored_and_named_chains_are_followed_in_proportion_to_their_number() {
    let lists: [(&str, &dyn Fn(usize) -> Vec<Gesture>); 2] = [
        ("mirrored joints", &|number| vec![Gesture::SelectLabel(format!("joint{number}")), Gesture::MirrorSelected]),
        ("names of chains", &|number| vec![Gesture::Labels(vec![format!("a{number}"), format!("b{number}")])]),
    ];
    for (name, list) in lists {
        let works = [100, 200, 400].map(|count| followed(count, list));
        for pair in works.windows(2) {
            assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{name}: {works:?}");
        }
    }
}

#[test]
fn operations_are_followed_in_proportion_to_their_number() {
    let place = |number: usize| (0.5, 1.0 + 0.0005 * number as f32);
    let named = |number: usize| Gesture::SelectLabel(format!("joint{number}"));
    let lists: [(&str, &dyn Fn(usize) -> Vec<Gesture>); 6] = [
        ("moves", &|number| vec![Gesture::Move(place(number))]),
        ("turns", &|_| vec![Gesture::Rotate(1.0)]),
        ("inserted joints", &|number| vec![Gesture::Insert(place(number))]),
        ("axes", &|_| vec![Gesture::Orient(Axis::X)]),
        ("roots", &|number| vec![named(number), Gesture::Unparent]),
        ("deleted joints", &|number| vec![named(number), Gesture::Delete]),
    ];
    for (name, list) in lists {
        let works = [400, 800, 1600].map(|count| followed(count, list));
        for pair in works.windows(2) {
            assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{name}: {works:?}");
        }
    }
}
