//! Growth of the work for picks, counted: twice as many clicks on twice as many joints take about twice as much.

use bevy::prelude::*;
use rigsmith::{
    algo::{
        picking::{PickTree, candidates_at, in_box},
        view::{View, ViewPlane},
    },
    headless::Workbench,
    plugins::gesture::{Gesture, GestureAnswer, GestureScript},
    prelude::Selection,
    rig::{JointData, Rig, RigEdit, Uid, template::read_template},
};

use crate::gestures::boxes;

/// Largest growth for twice the size.
const GROWTH: f64 = 2.3;

const BOX: [[[f32; 3]; 2]; 1] = [[[-1.0, 0.0, -0.5], [1.0, 2.0, 0.5]]];

/// Numbers from 0 to 1 that look random.
fn spread(number: usize, prime: usize) -> f32 {
    (number * prime % 65_521) as f32 / 65_521.0
}

fn positions(count: usize) -> Vec<Vec3> {
    let position = |number: usize| {
        let [x, y, z] = [40_487, 24_571, 53_881].map(|prime| spread(number, prime));
        Vec3::new(2.0 * x - 1.0, 2.0 * y, z - 0.5)
    };
    let mut positions: Vec<Vec3> = (0..count).map(position).collect();
    // Some stand at one place, and one at none.
    for number in (0..count).step_by(9) {
        positions[number] = positions[number / 3];
    }
    positions[count / 2] = Vec3::NAN;
    positions
}

fn plane(view: View) -> ViewPlane {
    ViewPlane::orthographic(view, [Vec3::new(-1.0, 0.0, -0.5), Vec3::new(1.0, 2.0, 0.5)])
}

#[test]
fn trees_pick_what_a_look_at_all_joints_picks() {
    let positions = positions(300);
    let mut tree = PickTree::new(positions.clone());
    let perspective = ViewPlane::perspective(View::Front, Vec3::new(0.0, 1.0, 0.2), Vec3::Y);
    for round in 0..120 {
        let view = [View::Front, View::Left, View::Orbit(30.0, round as f32)][round % 3];
        let plane = if round % 7 == 0 { perspective } else { plane(view) };
        let point = Vec2::new(3.0 * spread(round, 40_487) - 1.5, 3.0 * spread(round, 24_571) - 0.5);
        let hit = (round % 2 == 0).then(|| Vec3::new(point.x, point.y, 0.5));
        for reach in [0.0, 0.05, f32::NAN, 10.0] {
            let expected = candidates_at(hit, &plane, point, &positions, reach);
            assert_eq!(tree.candidates_at(hit, &plane, point, reach), expected, "round {round}, reach {reach}");
            assert_eq!(tree.nearest_at(hit, &plane, point), expected.first().copied(), "round {round}");
        }
        let corners = [point, point + Vec2::new(spread(round, 53_881), -spread(round, 31_337))];
        assert_eq!(tree.in_box(&plane, corners), in_box(&plane, corners, &positions), "round {round}");
    }
    assert!(PickTree::new(Vec::new()).candidates_at(None, &perspective, Vec2::ZERO, 1.0).is_empty());
    assert_eq!(PickTree::new(vec![Vec3::NAN]).nearest_at(Some(Vec3::ZERO), &perspective, Vec2::ZERO), None);
}

#[test]
fn picks_look_at_few_joints() {
    let visits = |count: usize, is_beside: bool| {
        let mut tree = PickTree::new(positions(count));
        let plane = plane(View::Front);
        for number in 0..count {
            let point = Vec2::new(if is_beside { 3.0 } else { 0.2 }, 2.0 * spread(number, 24_571));
            let hit = (!is_beside).then(|| Vec3::new(point.x, point.y, 0.5));
            assert!(tree.nearest_at(hit, &plane, point).is_some());
        }
        tree.visits()
    };
    for is_beside in [false, true] {
        let visits = [4000, 8000, 16_000].map(|count| visits(count, is_beside));
        let most = GROWTH * GROWTH * visits[0] as f64;
        assert!(visits[0] > 0 && visits[2] as f64 <= most, "beside: {is_beside}: {visits:?}");
    }
}

/// Frames of an app.
#[derive(Resource, Default)]
struct FrameCount(usize);

/// Answers to gestures, the selection at the end, and the number of frames that they took; one a frame if `is_watched`.
fn run(gestures: Vec<Gesture>, is_watched: bool) -> (Vec<GestureAnswer>, Vec<Uid>, usize) {
    let mut bench = Workbench::new(7, "test");
    bench.open(boxes(&BOX), false).unwrap();
    let app = bench.app_mut();
    app.init_resource::<FrameCount>().add_systems(Last, |mut frames: ResMut<FrameCount>| frames.0 += 1);
    let rig = bench.rig_entity();
    let answers = if is_watched {
        let app = bench.app_mut();
        app.world_mut().entity_mut(rig).insert(GestureScript::new(gestures));
        for _ in 0..10_000 {
            app.update();
            if app.world().get::<GestureScript>(rig).unwrap().is_done() {
                break;
            }
        }
        app.world().get::<GestureScript>(rig).unwrap().answers.clone()
    } else {
        bench.gestures(gestures)
    };
    let world = bench.app_mut().world();
    (answers, world.get::<Selection>(rig).unwrap().0.clone(), world.resource::<FrameCount>().0)
}

/// Clicks that place so many joints, and so many selections of all kinds.
fn selections(count: usize) -> Vec<Gesture> {
    let click =
        |number: usize| Gesture::Click((1.8 * spread(number, 40_487) - 0.9, 0.1 + 1.8 * spread(number, 24_571)));
    let select = |number: usize| {
        let at = (1.8 * spread(number, 53_881) - 0.9, 0.1 + 1.8 * spread(number, 31_337));
        match number % 12 {
            0 => Gesture::Add(at),
            1 => Gesture::Box(at, (at.0 + 0.1, at.1 - 0.2)),
            2 => Gesture::Select((3.0, at.1)),
            3 => Gesture::Deselect,
            4 => Gesture::SelectLabel(format!("joint_{}", number % 40)),
            5 => Gesture::SelectAll,
            6 => Gesture::View([View::Left, View::Front][number / 12 % 2]),
            7 => Gesture::Box((8.0, 8.0), (9.0, 9.0)),
            8 => Gesture::Add((3.0, 1.0)),
            // Again at the spot of the one before.
            9 | 10 => Gesture::Select((0.2, 0.3)),
            _ => Gesture::Select(at),
        }
    };
    (0..count).map(click).chain((0..count).map(select)).collect()
}

#[test]
fn selections_of_one_frame_give_what_they_give_one_a_frame() {
    let (watched, selected, _) = run(selections(150), true);
    let (answers, also_selected, _) = run(selections(150), false);
    assert_eq!(answers, watched);
    assert_eq!(also_selected, selected);
    assert!(answers.iter().any(|answer| answer.gesture == "SelectLabel" && !answer.done), "{answers:?}");
    assert!(answers.iter().any(|answer| answer.gesture == "Box" && !answer.done), "{answers:?}");
    let told = |answer: &&GestureAnswer| answer.message.starts_with("selected ");
    assert!(answers.iter().filter(told).count() > 60, "{answers:?}");
}

#[test]
fn selections_share_frames() {
    let frames = run(selections(1000), false).2;
    assert!(frames < 200, "{frames}");
}

/// A click beside the mesh between two edits belongs to the run of the edits.
#[test]
fn picks_beside_the_mesh_share_frames_with_edits() {
    let named =
        |number: usize| [Gesture::Select((3.0, 2.0 * spread(number, 24_571))), Gesture::Label(format!("name{number}"))];
    let gestures = |count: usize| -> Vec<Gesture> {
        let click =
            |number: usize| Gesture::Click((1.8 * spread(number, 40_487) - 0.9, 0.1 + 1.8 * spread(number, 24_571)));
        (0..count).map(click).chain((0..count).flat_map(named)).collect()
    };
    let (watched, selected, _) = run(gestures(40), true);
    let (answers, also_selected, _) = run(gestures(40), false);
    assert_eq!((answers, also_selected), (watched, selected));
    // A frame for each, and more for clicks where two joints are about equally near.
    let frames = run(gestures(1000), false).2;
    assert!(frames < 1000, "{frames}");
}

/// The first joint of an equal label is known between edits, and looked for again after those that may change it.
#[test]
fn equal_labels_are_looked_for_once() {
    let looked = |count: usize| {
        let joint = |number: usize| format!("(uid: \"{:016x}\", label: \"arm\")", 0x1000 + number);
        let joints: Vec<String> = (0..count).map(joint).collect();
        let text = format!("(format: 2, name: \"n\", joints: [{}])", joints.join(","));
        let rig = read_template(text.as_bytes()).unwrap().rig;
        let before = rig.visits();
        for _ in 0..count {
            assert_eq!(rig.labelled("arm"), rig.find_label("arm"));
        }
        rig.visits() - before
    };
    let looks = [100, 200, 400].map(looked);
    for pair in looks.windows(2) {
        assert!(pair[0] > 0 && pair[1] as f64 <= GROWTH * pair[0] as f64, "{looks:?}");
    }
    let mut rig = Rig::new(Uid(1), "n");
    for number in 0..6 {
        let joint = JointData {
            uid: Uid(0x1000 + number),
            label: Some(if number < 4 { "arm" } else { "leg" }.to_owned()),
            ..Default::default()
        };
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 9 }).unwrap();
    }
    let uid = |number: u64| Uid(0x1000 + number);
    let edits = [
        RigEdit::SetParent { joint: uid(3), parent: None, index: 0 },
        RigEdit::SetParent { joint: uid(0), parent: Some(uid(5)), index: 0 },
        RigEdit::SetLabel(uid(3), Some("leg".to_owned())),
        RigEdit::RemoveJoint(uid(1)),
        RigEdit::SetLabel(uid(2), None),
        RigEdit::SetLabel(uid(4), Some("arm".to_owned())),
    ];
    for edit in edits {
        let before = ["arm", "leg"].map(|label| rig.labelled(label));
        let back = rig.apply(&edit).unwrap();
        for label in ["arm", "leg"] {
            assert_eq!(rig.labelled(label), rig.find_label(label), "{label} after {edit:?}");
        }
        rig.apply(&back).unwrap();
        assert_eq!(["arm", "leg"].map(|label| rig.labelled(label)), before, "{back:?}");
        rig.apply(&edit).unwrap();
    }
}
