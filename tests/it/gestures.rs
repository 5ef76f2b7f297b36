//! Gestures on a mesh, through the very plugins that a window drives.

use std::time::Duration;

use bevy::math::{Vec2, Vec3};
use rigsmith::{
    algo::weights::WeightSettings,
    headless::Workbench,
    mesh::model::{Faces, Model, Object, Part},
    plugins::gesture::{Gesture, GestureAnswer, read_gestures},
    processor::BuildLimits,
    rig::{Uid, template::write_template},
};

/// Boxes of quads from their least and greatest corners, each an object, wound outward.
pub fn boxes(corners: &[[[f32; 3]; 2]]) -> Model {
    let mut model = Model { name: "boxes".into(), ..Default::default() };
    for (object, [low, high]) in corners.iter().enumerate() {
        let first = model.points.len() as u32;
        model.points.extend(
            (0..8).map(|i| {
                Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] }))
            }),
        );
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        add_part(&mut model, object, (first..first + 8).collect(), &quads);
    }
    model
}

fn add_part(model: &mut Model, object: usize, vertices: Vec<u32>, quads: &[[u32; 4]]) {
    model.objects.push(Object { name: format!("object {object}"), ..Default::default() });
    model.parts.push(Part {
        object,
        vertices,
        faces: Faces { starts: (0..=quads.len() as u32).map(|i| 4 * i).collect(), corners: quads.concat() },
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
        ..Default::default()
    });
}

/// An upright tube of quads about the axis x = z = 0 from `low` to `high`, closed with pinched ends.
fn limb(radius: f32, low: f32, high: f32) -> Model {
    let (around, rings) = (24_u32, 40_u32);
    let mut model = Model { name: "limb".into(), ..Default::default() };
    for ring in 0..=rings {
        let y = low + (high - low) * ring as f32 / rings as f32;
        let radius = if ring == 0 || ring == rings { 1e-3 } else { radius };
        for step in 0..around {
            let (sin, cos) = (std::f32::consts::TAU * step as f32 / around as f32).sin_cos();
            model.points.push(Vec3::new(radius * sin, y, radius * cos));
        }
    }
    let quads: Vec<[u32; 4]> = (0..rings)
        .flat_map(|ring| {
            (0..around).map(move |step| {
                let (a, b) = (ring * around + step, ring * around + (step + 1) % around);
                [a, b, b + around, a + around]
            })
        })
        .collect();
    let vertices = (0..model.points.len() as u32).collect();
    add_part(&mut model, 0, vertices, &quads);
    model
}

const TWO_BOXES: [[[f32; 3]; 2]; 2] = [[[-1.0, -1.0, -2.0], [1.0, 1.0, -1.0]], [[-1.0, -1.0, 1.0], [1.0, 1.0, 2.0]]];
const ONE_BOX: [[[f32; 3]; 2]; 1] = [[[-1.0, 0.0, -0.5], [1.0, 2.0, 0.5]]];

fn bench(model: Model) -> Workbench {
    let mut bench = Workbench::new(7, "test");
    bench.open(model, false).unwrap();
    bench
}

#[track_caller]
fn make(bench: &mut Workbench, script: &str) -> Vec<GestureAnswer> {
    let gestures = read_gestures(script.as_bytes()).unwrap();
    let count = gestures.len();
    let answers = bench.gestures(gestures);
    assert_eq!(answers.len(), count);
    answers
}

/// Makes gestures that must all succeed.
#[track_caller]
fn done(bench: &mut Workbench, script: &str) -> Vec<GestureAnswer> {
    let answers = make(bench, script);
    assert!(answers.iter().all(|answer| answer.done), "{answers:?}");
    answers
}

/// Positions of all joints, parents first.
fn places(bench: &Workbench) -> Vec<Vec3> {
    bench.rig().rest_globals().iter().map(|(_, global)| global.translation).collect()
}

fn selected(bench: &mut Workbench) -> Vec<Uid> {
    let rig = bench.rig_entity();
    bench.app_mut().world().get::<rigsmith::prelude::Selection>(rig).unwrap().0.clone()
}

#[track_caller]
fn assert_near(found: Vec3, expected: [f32; 3]) {
    assert!(found.distance(expected.into()) < 1e-4, "{found} is not {expected:?}");
}

#[test]
fn a_click_goes_between_the_nearest_and_the_furthest_hit() {
    for (depth, z) in [("", 0.0), ("Depth(0), ", 0.5), ("Depth(1), ", -0.5), ("Depth(0.3), ", 0.2)] {
        let mut bench = bench(boxes(&ONE_BOX));
        let answers = done(&mut bench, &format!("[{depth}Click((0.25, 1.0))]"));
        assert_near(places(&bench)[0], [0.25, 1.0, z]);
        assert_eq!(answers.last().unwrap().joints_added, 1);
    }
    let mut bench = bench(boxes(&ONE_BOX));
    let answers = make(
        &mut bench,
        "[Click((3.0, 1.0)), View(Left), Click((0.25, 0.5)), Click((0.1, 1.0)), View(Top), Click((0.5, 0.1))]",
    );
    assert!(!answers[0].done && answers[0].joints_added == 0 && answers[0].message.contains("nothing"), "{answers:?}");
    let placed = places(&bench);
    assert_near(placed[0], [0.0, 0.5, -0.25]);
    assert_near(placed[1], [0.0, 1.0, -0.1]);
    assert_near(placed[2], [0.5, 1.0, -0.1]);
    assert_eq!(bench.rig().roots().len(), 1, "each hangs below the last");
    // A single sheet: on it.
    let mut sheet = boxes(&ONE_BOX);
    sheet.parts[0].triangles.truncate(2);
    let mut bench = self::bench(sheet);
    assert!(done(&mut bench, "[Click((0.0, 1.0))]")[0].message.contains("surface"));
    assert_near(places(&bench)[0], [0.0, 1.0, -0.5]);
}

#[test]
fn volumes_are_cycled_through() {
    for (volume, z) in [(0, 0.0), (1, 1.5), (2, -1.5), (3, 1.5)] {
        let mut bench = bench(boxes(&TWO_BOXES));
        done(&mut bench, &format!("[Volume({volume}), Click((0.0, 0.0))]"));
        assert_near(places(&bench)[0], [0.0, 0.0, z]);
    }
    let mut bench = bench(boxes(&TWO_BOXES));
    done(
        &mut bench,
        "[Volume(1), Deselect, Click((0, 0)), Volume(0), Deselect, Click((0.5, 0)), View(Back), Volume(1), Deselect, Click((0, 0.5))]",
    );
    assert_eq!(bench.rig().roots().len(), 3);
    assert_near(places(&bench)[1], [0.5, 0.0, 0.0]);
    assert_near(places(&bench)[2], [0.0, 0.5, -1.5]);
}

#[test]
fn strokes_become_chains_of_the_wanted_length() {
    let mut bench = bench(limb(0.1, 0.0, 2.0));
    let answers = done(&mut bench, "[Stroke(points: [(0.02, 0.2), (-0.03, 0.7), (0.03, 1.2), (0.0, 1.6)], joints: 3)]");
    assert_eq!(answers[0].joints_added, 3);
    let chain = places(&bench);
    assert!((chain[0].y - 0.2).abs() < 0.05 && (chain[2].y - 1.6).abs() < 0.05, "{chain:?}");
    assert!(chain.iter().all(|p| Vec2::new(p.x, p.z).length() < 0.01), "on the limb's axis: {chain:?}");
    assert!(bench.rig().walk().all(|joint| joint.children.len() <= 1));
    // From an existing joint: that joint is the first of the three.
    let last = bench.rig().walk().last().unwrap().data.uid;
    let at = bench.rig().position(last);
    let answers =
        done(&mut bench, &format!("[Deselect, Stroke(points: [({}, {}), (0.0, 1.9)], joints: 3)]", at.x, at.y));
    assert_eq!(answers[1].joints_added, 2);
    assert_eq!(bench.rig().children(Some(last)).len(), 1);
    assert_eq!(bench.rig().roots().len(), 1);
    // Below the selected joint, where it starts in the open.
    done(&mut bench, "[Select((0.0, 0.2)), Stroke(points: [(0.0, 0.5), (0.0, 0.8)], joints: 2)]");
    assert_eq!(bench.rig().children(Some(bench.rig().roots()[0])).len(), 2);
    let answers = make(
        &mut bench,
        "[Stroke(points: [(3.0, 0.5), (4.0, 0.8)], joints: 2), Stroke(points: [(0.0, 0.5)]), Stroke(points: [])]",
    );
    assert!(
        answers.iter().all(|answer| !answer.done && !answer.message.is_empty() && answer.joints_added == 0),
        "{answers:?}"
    );
}

#[test]
fn strokes_across_a_bone_insert_and_scribbles_delete() {
    let mut bench = bench(limb(0.1, 0.0, 2.0));
    done(&mut bench, "[Click((0.0, 0.2)), Click((0.0, 1.0)), Click((0.0, 1.8))]");
    let before = places(&bench);
    done(&mut bench, "[Stroke(points: [(-0.08, 0.6), (0.0, 0.6), (0.08, 0.6)])]");
    let after = places(&bench);
    assert_eq!(after.len(), 4);
    assert_near(after[1], [0.0, 0.6, 0.0]);
    assert_eq!([after[0], after[2], after[3]], before[..]);
    done(
        &mut bench,
        "[Stroke(points: [(-0.09, 0.9), (0.09, 0.93), (-0.09, 0.96), (0.09, 1.0), (-0.09, 1.03), (0.09, 1.06), (-0.09, 1.1)])]",
    );
    assert_eq!(bench.rig().len(), 3);
    assert!(places(&bench).iter().all(|p| p.y < 0.7 || p.y > 1.7));
    assert_eq!(bench.rig().walk().filter(|joint| joint.parent.is_none()).count(), 1, "what hung below moved up");
}

#[test]
fn absurd_numbers_of_joints_make_few() {
    let mut bench = bench(limb(0.1, 0.0, 2.0));
    make(
        &mut bench,
        "[Stroke(points: [(0.0, 0.2), (0.0, 1.6)], joints: 4000000000), Stroke(points: [(0.05, 0.2), (0.05, 1.6)], joints: 0), Depth(1e30), Volume(4294967295), Click((0.0, 1.0)), Scale(1e38), Scale(1e38), Scale(0), MoveTo((1e38, 1e38, 1e38)), Reach(-1), Stroke(points: [(0.0, 0.2), (0.0, 1.6)], threshold: -1)]",
    );
    let count = bench.rig().len();
    assert!(count < 10_000, "{count} joints were made");
    assert!(places(&bench).iter().all(|place| place.is_finite()));
}

/// Joints that are moved or scaled far out of a model would be at no finite place, which no other command takes.
#[test]
fn gestures_out_of_all_proportion_are_refused() {
    let mut bench = bench(boxes(&ONE_BOX));
    let answers = make(
        &mut bench,
        "[Click((0.0, 1.0)), MoveTo((1e38, 0, 0)), Move((0, -1e6)), Insert((3e38, 0)), Scale(1e38), Scale(0), \
         MoveTo((0.1, 1.5, 0)), Scale(2)]",
    );
    for refused in &answers[1..6] {
        let is_told = refused.message.contains("out of all proportion") || refused.message.contains("flattens");
        assert!(!refused.done && is_told, "{refused:?}");
    }
    assert!(answers[6].done && answers[7].done, "{answers:?}");
    assert_near(places(&bench)[0], [0.1, 1.5, 0.0]);
}

#[test]
fn picking_takes_the_nearest_then_the_next() {
    let mut bench = bench(boxes(&ONE_BOX));
    done(
        &mut bench,
        "[Click((-0.5, 1.0)), Label(\"a\"), Click((0.0, 1.0)), Label(\"b\"), Click((0.7, 1.0)), Label(\"c\")]",
    );
    let named = |bench: &mut Workbench| {
        let chosen = selected(bench);
        let labels = chosen.iter().map(|joint| bench.rig().joint(*joint).unwrap().data.label.clone().unwrap());
        labels.collect::<String>()
    };
    for (script, expected) in [
        ("[Select((-0.45, 1.0))]", "a"),
        ("[Select((0.05, 1.0)), Select((0.05, 1.0))]", "a"),
        ("[Deselect, Select((0.1, 1.0))]", "b"),
        ("[Add((0.7, 1.0))]", "bc"),
        ("[Add((0.0, 1.02))]", "cb"),
        ("[Box((-0.6, 0.9), (0.1, 1.1))]", "ab"),
        ("[SelectAll]", "abc"),
        ("[Select((9.0, 1.0))]", "c"),
        ("[SelectLabel(\"a\")]", "a"),
        ("[Deselect]", ""),
    ] {
        done(&mut bench, script);
        assert_eq!(named(&mut bench), expected, "{script}");
    }
    let answers = make(&mut bench, "[SelectLabel(\"none\"), Box((5, 5), (6, 6)), Label(\"x\"), Delete]");
    assert!(answers.iter().all(|answer| !answer.done && !answer.message.is_empty()), "{answers:?}");
    assert_eq!(bench.rig().len(), 3);
}

#[test]
fn undo_and_redo_bring_joints_and_selection_back() {
    let mut bench = bench(boxes(&ONE_BOX));
    done(&mut bench, "[Click((-0.5, 1.0)), Click((0.5, 1.0)), Label(\"tip\")]");
    let (rig, chosen) = (bench.rig().clone(), selected(&mut bench));
    done(&mut bench, "[Undo, Undo]");
    let first = bench.rig().roots()[0];
    assert_eq!((bench.rig().len(), selected(&mut bench)), (1, vec![first]));
    done(&mut bench, "[Redo, Redo]");
    assert_eq!((bench.rig(), &chosen), (&rig, &selected_of(&rig)));
    assert_eq!(selected(&mut bench), chosen);
    let answers = make(&mut bench, "[Redo, Undo, Undo, Undo, Undo]");
    assert_eq!(answers.iter().map(|answer| answer.done).collect::<Vec<_>>(), [false, true, true, true, false]);
    assert!(bench.rig().is_empty() && selected(&mut bench).is_empty());
    // Something else instead of the redo.
    done(&mut bench, "[Redo, Click((0.1, 0.5))]");
    assert!(!make(&mut bench, "[Redo]")[0].done);
}

/// The joint with the label that the test above gave.
fn selected_of(rig: &rigsmith::rig::Rig) -> Vec<Uid> {
    rig.find_label("tip").into_iter().collect()
}

#[test]
fn mirroring_makes_pairs_and_moving_keeps_depth() {
    let mut bench = bench(boxes(&ONE_BOX));
    done(
        &mut bench,
        "[Mirror(true), Click((0.01, 0.5)), Click((0.5, 1.0)), Label(\"wrist_l\"), Mirror(false), Depth(0.1), Click((0.8, 1.5))]",
    );
    assert_eq!(bench.rig().len(), 4);
    let (left, right) = (bench.rig().find_label("wrist_l").unwrap(), bench.rig().find_label("wrist_r").unwrap());
    assert_eq!(bench.rig().joint(left).unwrap().data.mirror, Some(right));
    assert_near(bench.rig().position(right), [-0.5, 1.0, 0.0]);
    assert_eq!(bench.rig().position(bench.rig().roots()[0]).x, 0.0);
    let active = selected(&mut bench)[0];
    assert_near(bench.rig().position(active), [0.8, 1.5, 0.4]);
    done(&mut bench, "[Move((0.6, 1.7))]");
    assert_near(bench.rig().position(active), [0.6, 1.7, 0.4]);
    done(&mut bench, "[View(Left), Move((0.3, 1.6))]");
    assert_near(bench.rig().position(active), [0.6, 1.6, -0.3]);
    done(&mut bench, "[Mirror(true), SelectLabel(\"wrist_r\"), MoveTo((-0.4, 1.1, 0.1))]");
    assert_near(bench.rig().position(left), [0.4, 1.1, 0.1]);
}

#[test]
fn every_other_gesture_does_what_it_says() {
    let mut bench = bench(boxes(&ONE_BOX));
    done(
        &mut bench,
        "[Click((0, 0.5)), Label(\"root\"), Click((0.5, 0.5)), Label(\"mid\"), Click((0.5, 1.0)), Label(\"tip\"),
        SelectLabel(\"root\"), Rotate(90)]",
    );
    let at = |bench: &Workbench, label: &str| bench.rig().position(bench.rig().find_label(label).unwrap());
    assert_near(at(&bench, "mid"), [0.0, 1.0, 0.0]);
    assert_near(at(&bench, "tip"), [-0.5, 1.0, 0.0]);
    done(&mut bench, "[Scale(2.0)]");
    assert_near(at(&bench, "mid"), [0.0, 1.5, 0.0]);
    done(
        &mut bench,
        "[SelectLabel(\"tip\"), Insert((-0.5, 1.5)), Label(\"in\"), SelectAll, Orient(Y), Lock(true), Group(\"body\", Some((1, 0, 0)))]",
    );
    assert_near(at(&bench, "in"), [-0.5, 1.5, 0.0]);
    assert_near(at(&bench, "tip"), [-1.0, 1.5, 0.0]);
    assert!(bench.rig().walk().all(|joint| joint.data.locked && joint.data.group == Some(bench.rig().groups()[0].uid)));
    done(&mut bench, "[SelectLabel(\"tip\"), Unparent]");
    assert_eq!(bench.rig().roots().len(), 2);
    done(&mut bench, "[SelectLabel(\"tip\"), Box((-2, -2), (2, 2)), SelectLabel(\"root\"), MirrorSelected]");
    done(&mut bench, "[SelectLabel(\"tip\"), Delete]");
    assert_eq!(bench.rig().find_label("tip"), None);
    done(&mut bench, "[SelectLabel(\"mid\"), DeleteHierarchy]");
    assert!(bench.rig().find_label("mid").is_none() && bench.rig().find_label("root").is_some());
}

const EXAMPLE: &str = r#"[View(Front), Stroke(points: [(0.2,1.4),(0.7,1.1)], threshold: 0.02), Stroke(points: [(0.0,0.9),(0.0,1.4)], joints: 3), Select((0.0,1.0)), Click((0.0,1.2)), Depth(0.3),
    Mirror(true), Volume(1), Undo, Redo, Label("wrist_l")]"#;

#[test]
fn the_same_script_gives_the_same_bytes() {
    let run = || {
        let mut bench = bench(boxes(&ONE_BOX));
        done(&mut bench, EXAMPLE);
        assert!(bench.rig().find_label("wrist_l").is_some());
        write_template(bench.rig())
    };
    assert_eq!(run(), run());
}

#[test]
fn settings_hold_within_a_list_only() {
    let mut bench = bench(boxes(&ONE_BOX));
    done(&mut bench, "[Depth(0.0), View(Back), Click((0.0, 1.0))]");
    done(&mut bench, "[Click((0.5, 1.0))]");
    assert_near(places(&bench)[1], [0.5, 1.0, 0.0]);
}

#[test]
fn gestures_are_read_strictly() {
    let gestures = read_gestures(EXAMPLE.as_bytes()).unwrap();
    assert_eq!(gestures.len(), 11);
    let written = ron::to_string(&gestures).unwrap();
    assert_eq!(read_gestures(written.as_bytes()), Ok(gestures));
    let group = read_gestures(b"[Group(\"g\", None), Group(\"h\", (1, 0.5, 0))]").unwrap();
    assert_eq!(group[1], Gesture::Group("h".into(), Some((1.0, 0.5, 0.0))));
    for (script, line, about) in [
        ("[Undo,\n Clik((0, 0))]", 2, "Clik"),
        ("[Undo,\n\n Click((0, \"a\"))]", 3, "float"),
        ("[Click((0, 0, 0))]", 1, ""),
        ("[Stroke(\npoints: [(0, 0)],\ncolour: 3)]", 3, "colour"),
        ("[Stroke(threshold: 1)]", 1, "points"),
        ("[Undo, // (\n Label(\"a, [\"),\n Depth(NaN)]", 3, "gesture 3"),
        ("[Undo,\n Stroke(points: [(0, 0), (1, inf)])]", 2, "gesture 2"),
        ("[\n\nMoveTo((0, 1e39, 0)),]", 3, "gesture 1"),
        ("[View(Orbit(NaN, 0))]", 1, "gesture 1"),
        ("[View(Frnt)]", 1, "Frnt"),
        ("[Volume(-1)]", 1, "integer"),
        ("[Mirror(1)]", 1, "bool"),
        ("[Undo", 1, ""),
        ("(Undo)", 1, ""),
        ("", 1, "empty"),
    ] {
        let error = read_gestures(script.as_bytes()).unwrap_err();
        assert_eq!(error.line, line, "{script}: {error}");
        assert!(error.message.to_lowercase().contains(&about.to_lowercase()), "{script}: {error}");
    }
    assert!(read_gestures(&[b'[', 0xFF]).is_err());
    assert!(read_gestures("[".repeat(10_000).as_bytes()).is_err());
    assert!(read_gestures(&vec![b' '; 17 << 20]).is_err());
}

/// A gesture that was refused says so in its answer; it is not taken for the result of what is done next.
#[test]
fn a_refused_gesture_does_not_fail_the_skinning_after_it() {
    let mut bench = bench(limb(0.1, 0.0, 2.0));
    let answers = make(&mut bench, "[Stroke(points: [(0.0, 0.1), (0.0, 1.9)], joints: 4), Redo, Redo]");
    assert!(answers[0].done && !answers[1].done && !answers[2].done, "{answers:?}");
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
}

/// Gestures that are done when the time is over count, and only the others are given up.
#[test]
fn gestures_are_given_up_when_the_time_is_over() {
    let mut bench = Workbench::new(7, "test");
    bench.set_limits(BuildLimits::default(), Duration::ZERO);
    let done = bench.gestures(vec![Gesture::Recentre(true)]);
    assert!(done.len() == 1 && done[0].done && !done[0].out_of_time, "{done:?}");
    // Settings are taken together, and so is what picks; undone steps come in the frame after it.
    let cut = bench.gestures(vec![Gesture::Deselect, Gesture::Undo, Gesture::Undo]);
    assert!(cut.len() == 2 && cut[0].done && !cut[0].out_of_time, "{cut:?}");
    assert!(!cut[1].done && cut[1].out_of_time && cut[1].message.contains("`seconds`"), "{cut:?}");
}
