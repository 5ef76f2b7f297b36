//! Clicks, strokes, names and undone steps of lists that nobody watches: the same result as one a frame, and work in
//! proportion to the length of the list.

use bevy::prelude::*;
use rigsmith::{
    headless::Workbench,
    plugins::{
        document::{GroupEntities, JointEntities},
        gesture::{Gesture, GestureAnswer, GestureScript, read_gestures},
        history::RigHistory,
        schema::LocalGroup,
        stroke::StrokeTips,
    },
    prelude::Selection,
    rig::{GroupData, Rig, RigEdit, Uid, operations::Operation, template::read_template},
};

use crate::gestures::boxes;

/// Largest growth for twice the length.
const GROWTH: f64 = 2.3;

/// A box, and another one beside it with a gap.
const BOXES: [[[f32; 3]; 2]; 2] = [[[-1.0, 0.0, -0.5], [1.0, 2.0, 0.5]], [[-1.0, 0.0, 1.0], [1.0, 1.0, 2.0]]];

fn bench() -> Workbench {
    bench_on(&BOXES)
}

/// A bench with a mesh of boxes.
pub fn bench_on(mesh: &[[[f32; 3]; 2]]) -> Workbench {
    let mut bench = Workbench::new(7, "test");
    bench.open(boxes(mesh), false).unwrap();
    bench
}

/// Carries out gestures one a frame, as in a window.
fn watched(bench: &mut Workbench, gestures: Vec<Gesture>) -> Vec<GestureAnswer> {
    let rig = bench.rig_entity();
    let app = bench.app_mut();
    app.world_mut().entity_mut(rig).insert(GestureScript::new(gestures));
    for _ in 0..10_000 {
        app.update();
        let script = app.world().get::<GestureScript>(rig).unwrap();
        if script.is_done() {
            return script.answers.clone();
        }
    }
    panic!("the gestures do not end");
}

fn steps(bench: &mut Workbench) -> (Vec<String>, usize, Vec<Uid>) {
    let rig = bench.rig_entity();
    let world = bench.app_mut().world();
    let (names, done) = world.get::<RigHistory>(rig).unwrap().steps();
    let names = names.into_iter().map(str::to_owned).collect();
    (names, done, world.get::<Selection>(rig).unwrap().0.clone())
}

#[track_caller]
fn check(script: &str, prepare: impl Fn(&mut Workbench)) -> Vec<GestureAnswer> {
    check_on(&BOXES, script, prepare)
}

/// Asserts that a list that nobody watches gives what its gestures give one a frame, and returns its answers.
#[track_caller]
pub fn check_on(mesh: &[[[f32; 3]; 2]], script: &str, prepare: impl Fn(&mut Workbench)) -> Vec<GestureAnswer> {
    let gestures = read_gestures(script.as_bytes()).unwrap();
    let (mut one, mut many) = (bench_on(mesh), bench_on(mesh));
    prepare(&mut one);
    prepare(&mut many);
    let answers = watched(&mut one, gestures.clone());
    assert_eq!(many.gestures(gestures), answers);
    assert_eq!(many.rig(), one.rig());
    assert_eq!(steps(&mut many), steps(&mut one));
    // Entities follow the document in both.
    for bench in [&mut one, &mut many] {
        let count = bench.rig().len();
        let world = bench.app_mut().world_mut();
        assert_eq!(world.query::<&rigsmith::plugins::document::Joint>().iter(world).count(), count);
    }
    answers
}

#[test]
fn runs_of_clicks_give_what_clicks_one_a_frame_give() {
    let answers = check(
        "[Click((0.0, 0.2)), Click((0.0, 0.6)), Click((5.0, 5.0)), Depth(0.1), Click((0.4, 0.8)), Volume(2), \
         Click((0.5, 0.9)), Volume(0), View(Left), Click((0.1, 1.0)), Reach(0.2), Undo, Click((0.2, 1.1)), \
         Label(\"tip\"), View(Front), Click((0.1, 1.2)), Click((0.0, 1.3)), Click((-0.3, 1.4)), Deselect, \
         Click((0.0, 0.3)), Undo, Undo, Redo, Mirror(true), Click((0.5, 1.0)), Click((0.6, 1.1)), Click((0.0, 0.1)), \
         Mirror(false), SelectLabel(\"tip\"), Click((0.3, 1.5)), Click((0.35, 1.6)), Rotate(10.0), Click((0.2, 1.7))]",
        |_| {},
    );
    assert!(answers.iter().filter(|answer| answer.gesture == "Click" && !answer.done).count() == 1, "{answers:?}");
    assert!(answers.iter().any(|answer| answer.joints_added == 2), "{answers:?}");
}

#[test]
fn refused_clicks_of_a_run_say_why() {
    let select = |bench: &mut Workbench| {
        let rig = bench.rig_entity();
        bench.app_mut().world_mut().get_mut::<Selection>(rig).unwrap().0 = vec![Uid(99)];
    };
    let script = "[Click((0.0, 0.2)), Click((9.0, 9.0)), Click((0.0, 0.6)), Deselect, Click((0.0, 0.6)), Lock(true)]";
    let answers = check(script, select);
    let done: Vec<bool> = answers.iter().map(|answer| answer.done).collect();
    assert_eq!(done, [false, false, false, true, true, true]);
    assert!(answers[0].message.contains("there is no joint"), "{answers:?}");
    assert!(answers[1].message.contains("meets nothing"), "{answers:?}");
    assert_eq!(answers[2].message, answers[0].message);
}

#[test]
fn runs_of_names_and_undone_steps_give_what_they_give_one_a_frame() {
    let answers = check(
        "[Label(\"none\"), Undo, Redo, Click((0.0, 0.2)), Label(\"hip\"), Click((0.0, 0.6)), Label(\"\"), Deselect, \
         Label(\"x\"), Click((0.3, 0.4)), Label(\"other\"), Undo, Undo, Redo, Label(\"again\"), Click((0.1, 0.5)), \
         Undo, Undo, Undo, Undo, Undo, Undo, Undo, Undo, Undo, Redo, Redo, Deselect, Redo, Redo, Redo, \
         Select((0.0, 0.2)), Deselect, Select((0.0, 0.2)), Select((0.0, 0.2)), Rotate(10.0), Undo, Label(\"last\"), \
         Click((0.1, 0.9)), Deselect, Deselect, Select((0.0, 0.2)), Delete, Undo, Undo, Undo, Label(\"first\")]",
        |_| {},
    );
    let told = |number: usize| (answers[number].done, answers[number].message.as_str());
    assert_eq!(told(0), (false, "no joint is selected; select one first"));
    assert_eq!(told(1), (false, "there is nothing to undo"));
    assert_eq!(told(2), (false, "there is nothing to redo"));
    assert_eq!(told(4), (true, "rename joints: 1 joints now"));
    assert_eq!(told(8), told(0));
    assert!(answers.iter().any(|answer| answer.gesture == "Redo" && answer.joints_added == 1), "{answers:?}");
}

#[test]
fn long_runs_give_what_clicks_one_a_frame_give() {
    let clicks: Vec<String> = (0..300).map(|number| format!("{:?}", click(number, 3))).collect();
    let answers = check(&format!("[{}]", clicks.join(", ")), |_| {});
    assert!(answers.iter().all(|answer| answer.done && answer.joints_added == 1));
}

/// Click on the box; each `side`-th lies in the middle, the others beside it.
fn click(number: usize, side: usize) -> Gesture {
    let across = if number.is_multiple_of(side) { 0.0 } else { 0.05 + 0.009 * (number * 37 % 100) as f32 };
    Gesture::Click((across, 0.1 + 0.018 * (number * 61 % 100) as f32))
}

/// Joints of the rigs that entities had to follow, over all frames.
#[derive(Resource, Default)]
struct FollowedJoints(u64);

fn count_followed(mut followed: ResMut<FollowedJoints>, rigs: Query<&Rig, Changed<Rig>>) {
    followed.0 += rigs.iter().map(|rig| rig.len() as u64).sum::<u64>();
}

/// Joints that gestures visit, and joints that entities follow. The rig has so many `joints` at the end.
fn work(gestures: Vec<Gesture>, joints: usize) -> [u64; 2] {
    let mut bench = bench();
    bench.app_mut().init_resource::<FollowedJoints>().add_systems(Last, count_followed);
    let count = gestures.len();
    let answers = bench.gestures(gestures);
    assert!(answers.len() == count && answers.iter().all(|answer| answer.done));
    assert_eq!(bench.rig().len(), joints);
    [bench.rig().visits(), bench.app_mut().world().resource::<FollowedJoints>().0]
}

#[track_caller]
fn check_growth(name: &str, works: &[[u64; 2]]) {
    for pair in works.windows(2) {
        for (less, more) in pair[0].into_iter().zip(pair[1]) {
            assert!(less > 0 && more as f64 <= GROWTH * less as f64, "{name}: {works:?}");
        }
    }
}

#[test]
fn clicks_take_work_in_proportion_to_their_number() {
    // A chain, and chains that begin anew with each other joint.
    for side in [usize::MAX, 2] {
        let clicks = |count: usize| -> Vec<Gesture> { (0..count).map(|number| click(number, side)).collect() };
        let works: Vec<[u64; 2]> = [1000, 2000, 4000].into_iter().map(|count| work(clicks(count), count)).collect();
        check_growth(&format!("every {side}th in the middle"), &works);
    }
}

/// Clicks, each with a name of its own, in chains of two.
fn named_clicks(count: usize) -> Vec<Gesture> {
    let named = |number: usize| [click(number, 3), Gesture::Label(format!("name{number}"))];
    (0..count)
        .flat_map(|number| named(number).into_iter().chain((!number.is_multiple_of(2)).then_some(Gesture::Deselect)))
        .collect()
}

#[test]
fn mixed_lists_take_work_in_proportion_to_their_length() {
    let works: Vec<[u64; 2]> = [1000, 2000, 4000].into_iter().map(|count| work(named_clicks(count), count)).collect();
    check_growth("names", &works);
}

#[test]
fn undone_lists_take_work_in_proportion_to_their_length() {
    // A click and a name are a step each, and a history holds two thousand.
    let undone = |count: usize| [named_clicks(count), vec![Gesture::Undo; 2 * count]].concat();
    let works: Vec<[u64; 2]> = [250, 500, 1000].into_iter().map(|count| work(undone(count), 0)).collect();
    check_growth("undone", &works);
}

#[test]
fn runs_of_groups_and_picks_give_what_they_give_one_a_frame() {
    let answers = check(
        "[Click((0.0, 0.2)), Click((0.3, 0.9)), Label(\"a\"), Click((-0.4, 1.5)), Deselect, Group(\"none\", None), \
         Lock(true), Select((0.0, 0.2)), Group(\"g\", None), Select((0.3, 0.9)), Lock(true), SelectLabel(\"a\"), \
         Group(\"h\", Some((1.0, 0.0, 0.0))), SelectLabel(\"missing\"), Group(\"g\", None), Select((-0.4, 1.5)), \
         Label(\"b\"), Select((-0.4, 1.5)), Select((-0.4, 1.5)), Group(\"\", None), Undo, Undo, Select((0.0, 0.2)), \
         Group(\"z\", None), Click((0.1, 0.5)), Select((0.1, 0.5)), Group(\"y\", None), Select((0.0, 0.2)), \
         Group(\"x\", None), Select((0.0, 0.2)), Select((0.0, 0.2)), Label(\"c\"), Lock(false), SelectLabel(\"c\"), \
         Click((0.2, 0.6)), SelectLabel(\"b\"), Group(\"g\", None)]",
        |_| {},
    );
    let told = |number: usize| (answers[number].done, answers[number].message.as_str());
    assert_eq!(told(5), (false, "no joint is selected; select one first"));
    assert_eq!(told(6), told(5));
    assert_eq!(told(11), (true, "selected \"a\""));
    assert_eq!(told(13), (false, "no joint has the label \"missing\""));
    assert!(answers[7].message.starts_with("selected "), "{answers:?}");
    assert_eq!(told(8).1, "assign group: 3 joints now");
}

/// Joint on a grid in the upper box, apart from all others.
fn on_grid(number: usize) -> (f32, f32) {
    (-0.95 + 0.03 * (number % 60) as f32, 0.05 + 0.03 * (number / 60) as f32)
}

/// Clicks, then picks of each joint, each put into a group of its own.
fn grouped(count: usize, pick: impl Fn(usize) -> Gesture) -> Vec<Gesture> {
    let clicks =
        (0..count).flat_map(|number| [Gesture::Click(on_grid(number)), Gesture::Label(format!("name{number}"))]);
    let group = |number: usize| [pick(number), Gesture::Group(format!("group{number}"), None)];
    clicks.chain((0..count).flat_map(group)).collect()
}

/// Work of gestures, with the joints and groups at which entities look to follow them.
fn work_of_groups(gestures: Vec<Gesture>, joints: usize) -> [u64; 4] {
    let mut bench = bench();
    bench.app_mut().init_resource::<FollowedJoints>().add_systems(Last, count_followed);
    let answers = bench.gestures(gestures);
    assert!(answers.iter().all(|answer| answer.done), "{:?}", answers.iter().find(|answer| !answer.done));
    assert_eq!((bench.rig().len(), bench.rig().groups().len()), (joints, joints));
    let (visits, rig) = (bench.rig().visits(), bench.rig_entity());
    let world = bench.app_mut().world();
    let (joints, groups) = (world.get::<JointEntities>(rig).unwrap(), world.get::<GroupEntities>(rig).unwrap());
    [visits, world.resource::<FollowedJoints>().0, joints.visits(), groups.visits()]
}

#[test]
fn picks_and_groups_take_work_in_proportion_to_their_number() {
    let picks: [(&str, fn(usize) -> Gesture); 2] = [
        ("labels", |number| Gesture::SelectLabel(format!("name{number}"))),
        ("clicks", |number| Gesture::Select(on_grid(number))),
    ];
    for (name, pick) in picks {
        let works: Vec<[u64; 4]> =
            [400, 800, 1600].into_iter().map(|count| work_of_groups(grouped(count, pick), count)).collect();
        for pair in works.windows(2) {
            for (less, more) in pair[0].into_iter().zip(pair[1]) {
                assert!(less > 0 && more as f64 <= GROWTH * less as f64, "{name}: {works:?}");
            }
        }
    }
}

#[test]
fn entities_follow_a_group_without_a_look_at_all_joints() {
    let mut bench = bench();
    watched(&mut bench, (0..40).map(|number| click(number, 3)).collect());
    let rig = bench.rig_entity();
    let looked = |bench: &mut Workbench| bench.app_mut().world().get::<JointEntities>(rig).unwrap().visits();
    let before = looked(&mut bench);
    let group = GroupData { uid: Uid(0x77), name: "new".into(), color: [0.5; 3], enabled: true };
    bench.operate(Operation::Edits(vec![RigEdit::AddLocalGroup(group, 0)])).unwrap();
    assert!(looked(&mut bench) - before < 10, "{}", looked(&mut bench) - before);
    let world = bench.app_mut().world_mut();
    assert_eq!(world.query::<&LocalGroup>().single(world).unwrap().name, "new");
}

/// Strokes through the upper half of the first box, each a chain of five joints below the one before.
fn strokes(count: usize) -> Vec<Gesture> {
    let stroke = |number: usize| {
        let (across, up) = (0.05 + 0.004 * (number * 37 % 100) as f32, 1.05 + 0.004 * (number * 61 % 100) as f32);
        let points = (0..8).map(|at| (across + 0.05 * at as f32, up + 0.06 * at as f32)).collect();
        Gesture::Stroke { points, threshold: None, joints: Some(5) }
    };
    (0..count).map(stroke).collect()
}

/// Joints that strokes visit, and joints at which entities look to follow them. At least so many joints come for each stroke.
fn work_of_strokes(mut bench: Workbench, gestures: Vec<Gesture>, least: usize) -> [u64; 2] {
    let count = gestures.len();
    let answers = bench.gestures(gestures);
    assert!(answers.len() == count && answers.iter().all(|answer| answer.done), "{answers:?}");
    assert!(bench.rig().len() > least * (count - 1), "{} joints", bench.rig().len());
    let rig = bench.rig_entity();
    let followed = bench.app_mut().world().get::<JointEntities>(rig).unwrap().visits();
    [bench.rig().visits(), followed]
}

#[test]
fn runs_of_strokes_give_what_strokes_one_a_frame_give() {
    let answers = check(
        "[Recentre(false), Stroke(points: [(-0.8, 0.2), (-0.4, 0.4)], joints: 3), \
         Stroke(points: [(-0.4, 0.4), (0.0, 0.5)], joints: 3), Click((0.4, 0.3)), \
         Stroke(points: [(0.4, 0.3), (0.7, 0.6)], joints: 2), Stroke(points: [(-0.8, 0.2), (-0.8, 0.6)], joints: 3), \
         Stroke(points: [(5.0, 5.0), (6.0, 5.0)], joints: 3), Deselect, \
         Stroke(points: [(0.5, 1.2), (0.9, 1.2)], joints: 4), Label(\"tip\"), \
         Stroke(points: [(0.9, 1.2), (0.9, 1.6)], joints: 3), Undo, Reach(0.3), \
         Stroke(points: [(0.8, 1.3), (0.2, 1.8)], joints: 3), Stroke(points: [(-0.6, 1.7), (-0.2, 1.7)], threshold: 0.1), \
         Reach(0.01), Recentre(true), Stroke(points: [(-0.2, 1.7), (0.0, 1.9)], joints: 2), View(Left), \
         Stroke(points: [(0.0, 0.1), (0.3, 0.1)], joints: 2), Click((0.1, 0.9)), Click((0.1, 0.9)), \
         Stroke(points: [(0.1, 0.9), (0.3, 0.7)], joints: 2), Mirror(true), View(Front), \
         Stroke(points: [(0.3, 1.0), (0.6, 1.1)], joints: 2), Mirror(false), \
         Stroke(points: [(0.3, 0.9), (0.6, 0.9)], joints: 1), SelectLabel(\"tip\"), \
         Stroke(points: [(-0.9, 0.9), (-0.6, 0.9)], joints: 2)]",
        |_| {},
    );
    let told = |number: usize| answers[number].message.as_str();
    assert!(told(1).starts_with("drew a chain of 3 joints as a root"), "{answers:?}");
    assert!([2, 4, 5].iter().all(|number| told(*number).contains("joints below \"")), "{answers:?}");
    assert!(!answers[6].done, "{answers:?}");
    assert!(told(8).contains("as a root") && told(10).contains("below \"tip\""), "{answers:?}");
}

#[test]
fn runs_of_strokes_without_a_number_of_joints_give_what_strokes_one_a_frame_give() {
    let answers = check(
        "[Recentre(false), Stroke(points: [(-0.8, 1.2), (-0.2, 1.2)], joints: 3), Deselect, \
         Stroke(points: [(-0.8, 1.8), (0.8, 1.8)], threshold: 0.01), \
         Stroke(points: [(-0.65, 1.1), (-0.65, 1.3)]), \
         Stroke(points: [(-0.5, 1.05), (-0.45, 1.95)], threshold: 0.05), \
         Stroke(points: [(-0.2, 1.2), (0.0, 1.3), (0.2, 1.25)], threshold: 0.02), \
         Stroke(points: [(0.3, 1.3), (0.4, 1.6), (0.7, 1.3)], threshold: 0.02), \
         Stroke(points: [(0.35, 1.05), (0.6, 1.05)], threshold: 0.02), Deselect, \
         Stroke(points: [(-0.4, 1.1), (-0.4, 1.28)]), Stroke(points: [(0.9, 1.1), (0.9, 1.3)], threshold: 0.02), \
         Stroke(points: [(-0.9, 1.15), (0.9, 1.25), (-0.9, 1.2), (0.9, 1.3), (-0.9, 1.25), (0.9, 1.35), (-0.9, 1.3)]), \
         Stroke(points: [(-0.9, 1.5), (0.9, 1.5)]), Undo]",
        |_| {},
    );
    let told = |words: &str| answers.iter().any(|answer| answer.message.starts_with(words));
    assert!(told("drew a chain") && told("put a joint") && told("deleted"), "{answers:?}");
}

#[test]
fn runs_of_strokes_note_their_tips() {
    let tips = |bench: &mut Workbench| {
        let rig = bench.rig_entity();
        bench.app_mut().world().get::<StrokeTips>(rig).cloned()
    };
    let (mut one, mut many) = (bench(), bench());
    watched(&mut one, strokes(20));
    many.gestures(strokes(20));
    assert!(tips(&mut many).is_some());
    assert_eq!(tips(&mut many), tips(&mut one));
}

/// Strokes that start apart from all joints, each a chain of five joints.
fn strokes_apart(count: usize) -> Vec<Gesture> {
    let stroke = |number: usize| {
        let share = |step: f64| (number as f64 * step).fract() as f32;
        let (across, up) = (-0.9 + 1.2 * share(0.618_034), 1.05 + 0.6 * share(0.754_877_7));
        Gesture::Stroke { points: vec![(across, up), (across + 0.4, up + 0.3)], threshold: None, joints: Some(5) }
    };
    let settings = [Gesture::Recentre(false), Gesture::Reach(1e-6)];
    settings.into_iter().chain((0..count).map(stroke)).collect()
}

#[test]
fn entities_follow_strokes_a_few_times() {
    for count in [100, 400] {
        let [_, followed] = work(strokes_apart(count), 5 * count);
        // One a frame, entities would follow half of the joints once for each stroke.
        assert!(followed > 0 && followed <= 8 * 5 * count as u64, "{followed} joints of {}", 5 * count);
    }
}

#[test]
fn strokes_are_followed_in_proportion_to_their_number() {
    let works = [100, 200, 400].map(|count| work_of_strokes(bench(), strokes(count), 3));
    check_growth("strokes", &works);
}

#[test]
fn mirrored_strokes_are_followed_in_proportion_to_their_number() {
    let mirrored = |count: usize| [vec![Gesture::Mirror(true)], strokes(count)].concat();
    let works = [100, 200, 400].map(|count| work_of_strokes(bench(), mirrored(count), 6));
    check_growth("mirrored strokes", &works);
}

#[test]
fn runs_of_mirrored_strokes_give_what_strokes_one_a_frame_give() {
    let answers = check(
        "[Mirror(true), Recentre(false), Stroke(points: [(0.0, 0.2), (0.0, 0.9)], joints: 3), \
         Stroke(points: [(0.0, 0.9), (0.4, 1.1)], joints: 3), Stroke(points: [(0.4, 1.1), (0.8, 1.3)], joints: 3), \
         Stroke(points: [(-0.4, 1.1), (-0.6, 0.6)], joints: 3), Click((0.5, 0.3)), \
         Stroke(points: [(-0.5, 0.3), (-0.8, 0.2)], joints: 3), Deselect, \
         Stroke(points: [(0.2, 1.6), (0.6, 1.8)], joints: 3), Stroke(points: [(-0.6, 1.8), (-0.8, 1.9)], joints: 3), \
         Stroke(points: [(-0.2, 1.4), (0.2, 1.4)], joints: 3), Stroke(points: [(0.3, 0.5), (0.7, 0.7)]), \
         Stroke(points: [(-0.8, 0.9), (-0.8, 1.1)]), View(Left), Stroke(points: [(0.2, 0.3), (0.3, 0.7)], joints: 2), \
         View(Front), Click((0.0, 1.9)), Stroke(points: [(0.1, 1.9), (0.5, 1.9)], joints: 2), Undo, Mirror(false), \
         Stroke(points: [(0.8, 1.3), (0.9, 1.6)], joints: 2)]",
        |_| {},
    );
    // Both sides of the two joints behind the one on which a stroke starts.
    assert!(answers.iter().any(|answer| answer.gesture == "Stroke" && answer.joints_added == 4), "{answers:?}");
}

/// A box with a rig that has a tag, which was not built.
fn tagged_bench() -> Workbench {
    let text = "(format: 2, name: \"tagged\", joints: [(label: \"hip\", translation: (0, 0.1, 0), \
                tags: [Command(module: \"null\", params: (at: \"@this\"))])])";
    let mut bench = Workbench::with_rig(7, read_template(text.as_bytes()).unwrap().rig);
    bench.open(boxes(&BOXES), false).unwrap();
    bench
}

#[test]
fn strokes_on_rigs_with_tags_are_followed_in_proportion_to_their_number() {
    let works = [100, 200, 400].map(|count| work_of_strokes(tagged_bench(), strokes(count), 3));
    check_growth("tagged", &works);
}

#[test]
fn runs_of_strokes_on_rigs_with_tags_give_what_strokes_one_a_frame_give() {
    check(
        "[Recentre(false), Stroke(points: [(0.0, 0.1), (0.0, 0.9)], joints: 3), Click((0.4, 0.3)), \
         Stroke(points: [(0.0, 0.9), (0.4, 1.1)], joints: 3), Undo, Stroke(points: [(0.4, 0.3), (0.8, 1.3)], joints: 3)]",
        |bench| *bench = tagged_bench(),
    );
}
