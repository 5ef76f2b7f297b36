//! Drags on joints and controls in Pose mode: they go where the pointer goes, and the joints above follow.

use bevy::ecs::system::RunSystemOnce;
use rigsmith::{
    editor::{
        notice::StatusLine,
        tools::{
            pull::PullTool,
            select::{REACH, SelectTool},
        },
    },
    plugins::{
        controls::{
            SwitchRequest,
            outline::{ControlNodes, control_at},
        },
        drawing::RigDrawing,
        schema::RigNodes,
    },
    solve::pull::{chain_above, pull},
};

use super::*;

fn pulled(bench: &Bench) -> Option<Uid> {
    bench.base.app.world().resource::<PullTool>().pulled()
}

fn banded(bench: &Bench) -> bool {
    bench.base.app.world().resource::<SelectTool>().band.is_some()
}

/// A way on the screen from one place to another, turned and shortened.
fn way(from: Vec2, to: Vec2, turn: f32, share: f32) -> Vec2 {
    Vec2::from_angle(turn).rotate(to - from) * share
}

#[test]
fn the_end_of_a_chain_goes_to_a_goal_within_reach() {
    let points = [
        vec![Vec3::ZERO, Vec3::new(0.0, 1.0, 0.0)],
        vec![Vec3::ZERO, Vec3::new(0.0, 1.0, 0.1), Vec3::new(0.0, 2.0, 0.0)],
        vec![Vec3::ZERO, Vec3::new(0.1, 1.0, 0.0), Vec3::new(0.0, 1.8, 0.2), Vec3::new(0.0, 2.5, 0.0)],
    ];
    let goals = [Vec3::new(0.6, 0.8, 0.0), Vec3::new(0.9, 0.6, 0.7), Vec3::new(-0.3, 1.2, 0.4), Vec3::splat(9.0)];
    for chain in &points {
        let lengths: Vec<f32> = chain.windows(2).map(|ends| ends[0].distance(ends[1])).collect();
        for goal in goals {
            let turns = pull(chain, goal);
            assert_eq!(turns.len(), lengths.len());
            let mut end = chain[0];
            for (turn, ends) in turns.iter().zip(chain.windows(2)) {
                end += *turn * (ends[1] - ends[0]);
            }
            let (whole, far) = (lengths.iter().sum::<f32>(), goal.length());
            let is_near = if lengths.len() == 1 { (far - whole).abs() < 1e-4 } else { far < whole };
            let wanted = if is_near { goal } else { goal.normalize() * whole };
            let off = if is_near || far > whole || lengths.len() == 1 { end.distance(wanted) } else { 0.0 };
            assert!(off < 5e-3, "{chain:?} to {goal}: {end}");
        }
    }
}

#[test]
fn chains_end_where_limbs_meet_and_collarbones_stay() {
    let rig = crate::bench::shipped("biped");
    let of = |label: &str| {
        let joint = rig.walk().find(|joint| joint.data.label.as_deref() == Some(label)).expect("a joint").data.uid;
        let name = |joint: Uid| rig.joint(joint).and_then(|joint| joint.data.label.clone()).unwrap_or_default();
        chain_above(&rig, joint).into_iter().map(name).collect::<Vec<_>>()
    };
    assert_eq!(of("hand_l"), ["upper_arm_l", "forearm_l"]);
    assert!(chain_above(&rig, rig.roots()[0]).is_empty());
}

#[test]
fn a_joint_goes_with_the_pointer_in_one_step() {
    for place in [Transform::IDENTITY, somewhere()] {
        for sight in sights(place) {
            let mut bench = Bench::new(sight, place);
            let [root, middle, tip] = chain(&mut bench);
            bench.mode(Mode::Pose);
            let (before, steps) = (bench.base.rig().clone(), bench.base.steps());
            let pixel =
                |bench: &Bench, joint: Uid| sight.project(bench.base.rig().posed_global(joint).translation).unwrap();
            let (from, to) = (pixel(&bench, tip), pixel(&bench, root));
            let by = way(from, to, 0.4, 0.3);
            bench.drag(from, by, ModifierKeys::default());
            assert_eq!((pulled(&bench), banded(&bench)), (Some(tip), false));
            assert!(pixel(&bench, tip).distance(from + by) < 1.0, "{} is not {}", pixel(&bench, tip), from + by);
            assert_eq!(bench.base.steps(), steps, "a preview is no step");
            bench.release(from + by);
            let rig = bench.base.rig().clone();
            assert!(pixel(&bench, tip).distance(from + by) < 1.0);
            assert_eq!((bench.base.steps(), bench.journaled()), (steps + 1, steps + 1));
            for joint in [root, middle, tip] {
                assert_eq!(rig.rest_global(joint), before.rest_global(joint), "the rest pose stays");
            }
            for (above, below) in [(root, middle), (middle, tip)] {
                let length =
                    |rig: &Rig| rig.posed_global(above).translation.distance(rig.posed_global(below).translation);
                assert!((length(&rig) - length(&before)).abs() < 1e-4, "bones keep their lengths");
            }
            bench.base.change(Change::Undo);
            assert_eq!(*bench.base.rig(), before);

            // Escape takes it back to the bit, and the drag does not go on.
            bench.drag(from, by, ModifierKeys::default());
            assert_ne!(*bench.base.rig(), before);
            bench.base.act(Action::Cancel);
            bench.pointer(from + by, PointerAct::Dragged, ModifierKeys::default());
            bench.release(from + by);
            assert_eq!((bench.base.rig(), bench.base.steps()), (&before, steps));
        }
    }
}

#[test]
fn a_root_moves_a_click_selects_and_a_drag_beside_joints_is_a_box() {
    let [sight, _] = sights(Transform::IDENTITY);
    let mut bench = Bench::new(sight, Transform::IDENTITY);
    let [root, _, tip] = chain(&mut bench);
    bench.base.select(&[]);
    bench.mode(Mode::Pose);
    let pixel = |bench: &Bench, joint: Uid| sight.project(bench.base.rig().posed_global(joint).translation).unwrap();
    let (steps, from) = (bench.base.steps(), pixel(&bench, root));
    let by = Vec2::new(60.0, 35.0);
    bench.drag(from, by, ModifierKeys::default());
    bench.release(from + by);
    assert!(pixel(&bench, root).distance(from + by) < 1.0);
    assert_eq!(bench.base.steps(), steps + 1);

    let at = pixel(&bench, tip);
    bench.pointer(at, PointerAct::Pressed, ModifierKeys::default());
    bench.pointer(at, PointerAct::Released { dragged: false, count: 1 }, ModifierKeys::default());
    bench.base.app.update();
    assert_eq!(bench.base.get::<Selection>(bench.base.rig).unwrap().0, [tip]);
    assert_eq!(bench.base.steps(), steps + 1, "a click poses nothing");

    bench.drag(Vec2::new(15.0, 15.0), Vec2::new(30.0, 20.0), ModifierKeys::default());
    assert_eq!((pulled(&bench), banded(&bench)), (None, true));
    bench.release(Vec2::new(45.0, 35.0));
    // In other modes a joint is not pulled.
    bench.mode(Mode::Select);
    bench.drag(at, Vec2::new(30.0, 20.0), ModifierKeys::default());
    assert_eq!((pulled(&bench), banded(&bench)), (None, true));
}

/// The hand of the bundled biped, by its goal and by its forward controls.
#[test]
fn a_built_rig_is_pulled_by_its_controls() {
    let [sight, _] = sights(Transform::IDENTITY);
    let mut app = headless_app(1);
    app.insert_resource(RigDrawing { controls: false, ..default() });
    let mut bench = Bench::built(app, crate::bench::shipped("biped"), sight);
    let rig = bench.base.rig;
    let built = bench.base.get::<BuildResult>(rig).expect("a built rig").0.clone();
    let [hand, shoulder] = ["hand_l", "upper_arm_l"].map(|label| built.find_label(label).expect("a joint").uid);
    let switch = built.switches.iter().find(|switch| match &switch.matching {
        Matching::IkFk { joints, .. } => joints.contains(&hand),
        Matching::Space { .. } => false,
    });
    let switch = switch.expect("a switch of the arm").clone();
    bench.mode(Mode::Pose);
    for value in [1.0, 0.0] {
        let (control, attribute) = (switch.control, switch.attribute.to_string());
        bench.base.app.world_mut().write_message(SwitchRequest { rig, control, attribute, value });
        for _ in 0..3 {
            bench.base.app.update();
        }
        let state = |bench: &Bench| bench.base.get::<RigRuntime>(rig).unwrap().state().clone();
        assert_eq!(state(&bench).attribute(switch.control, &switch.attribute), Some(value));
        let pixel = |bench: &Bench, node: Uid| sight.project(state(bench).global(node).unwrap().translation).unwrap();
        let (before, steps, from) = (bench.base.rig().clone(), bench.base.steps(), pixel(&bench, hand));
        let to = pixel(&bench, shoulder);
        let by = way(from, to, 0.8, 40.0 / from.distance(to));
        bench.drag(from, by, ModifierKeys::default());
        assert_eq!(pulled(&bench), Some(hand), "switch at {value}");
        bench.release(from + by);
        bench.base.app.update();
        let off = pixel(&bench, hand).distance(from + by);
        assert!(off < 5.0, "switch at {value}: the hand is {off} pixels off");
        assert_eq!(bench.base.steps(), steps + 1);
        let posed = bench.base.rig().pose().iter().filter(|(node, offset)| before.offset(**node) != Some(*offset));
        let posed: Vec<Uid> = posed.map(|(node, _)| *node).collect();
        assert!(
            !posed.is_empty() && posed.iter().all(|node| built.node(*node).is_some_and(|node| node.control.is_some()))
        );
        let is_goal = |node: &Uid| matches!(&switch.matching, Matching::IkFk { goal, .. } if goal == node);
        assert_eq!(posed.iter().any(is_goal), value == 1.0, "{posed:?}");
        bench.base.change(Change::Undo);
        bench.base.app.update();
        assert_eq!(*bench.base.rig(), before);
        assert!(pixel(&bench, hand).distance(from) < 0.5);
    }
}

/// A joint that its controls hold has no handles: their poses would move nothing, and rings would take the presses on the joints
/// around it.
#[test]
fn a_joint_that_controls_hold_has_no_handles_in_the_way_of_others() {
    let [sight, _] = sights(Transform::IDENTITY);
    let mut bench = Bench::built(headless_app(1), crate::bench::shipped("biped"), sight);
    let rig = bench.base.rig;
    let built = bench.base.get::<BuildResult>(rig).expect("a built rig").0.clone();
    let [hand, elbow] = ["hand_l", "forearm_l"].map(|label| built.find_label(label).expect("a joint").uid);
    bench.base.select(&[elbow]);
    bench.mode(Mode::Pose);
    bench.base.app.update();
    assert!(bench.shapes().is_empty(), "the elbow follows its controls");
    let hint = bench.base.app.world().resource::<StatusLine>().hint.clone();
    assert!(hint.starts_with("forearm_l follows its controls"), "{hint}");

    let pixel = |bench: &Bench| {
        let state = bench.base.get::<RigRuntime>(rig).unwrap().state();
        sight.project(state.global(hand).unwrap().translation).unwrap()
    };
    let (from, by) = (pixel(&bench), Vec2::new(-12.0, -24.0));
    bench.drag(from, by, ModifierKeys::default());
    assert_eq!(pulled(&bench), Some(hand));
    bench.release(from + by);
    bench.base.app.update();
    assert!(pixel(&bench).distance(from) > 10.0, "the hand moves");
    let is_control = |node: &Uid| built.node(*node).is_some_and(|node| node.control.is_some());
    assert!(bench.base.rig().pose().keys().all(is_control), "controls alone are posed");

    // What was pulled is selected: a control, which has handles.
    assert!(bench.base.selected().iter().all(is_control), "{:?}", bench.base.selected());
    assert!(!bench.shapes().is_empty());
}

/// Outlines of fingers pass over the joint of the hand: a press on a joint pulls that joint.
#[test]
fn a_press_on_a_joint_pulls_it_though_an_outline_passes_by() {
    let [sight, _] = sights(Transform::IDENTITY);
    let mut bench = Bench::built(headless_app(1), crate::bench::shipped("biped"), sight);
    let rig = bench.base.rig;
    bench.base.select(&[]);
    bench.mode(Mode::Pose);
    let visible = move |controls: ControlNodes, nodes: Query<&RigNodes>| {
        controls.visible(nodes.get(rig).ok(), bevy::math::Affine3A::IDENTITY)
    };
    let outlines = bench.base.app.world_mut().run_system_once(visible).unwrap();
    let state = bench.base.get::<RigRuntime>(rig).expect("a built rig").state();
    let has_outline = |at: &Vec2| control_at(&outlines, &sight.plane, sight.point(*at), REACH * sight.pixel).is_some();
    let place = |joint: Uid| sight.project(state.global(joint)?.translation);
    let labels = ["hand_l", "hand_r", "index_01_l", "middle_01_l", "pinky_01_r", "foot_l"];
    let joints = labels.map(|label| bench.base.rig().find_label(label).expect("a joint"));
    let crossed: Vec<Vec2> = joints.into_iter().filter_map(place).filter(has_outline).collect();
    assert!(!crossed.is_empty(), "no outline passes by any of the joints");
    let mut count = 0;
    for at in crossed {
        bench.drag(at, Vec2::new(9.0, -14.0), ModifierKeys::default());
        if let Some(node) = pulled(&bench) {
            assert!(bench.base.rig().joint(node).is_some(), "a control is pulled at {at}, where a joint is");
            count += 1;
        }
        bench.base.act(Action::Cancel);
        bench.release(at + Vec2::new(9.0, -14.0));
    }
    assert!(count > 0, "no joint is pulled");
}
