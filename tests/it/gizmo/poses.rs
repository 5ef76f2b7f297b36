//! Gizmos that pose joints and controls, and the rest pose while it is edited.

use bevy::ecs::system::RunSystemOnce;
use rigsmith::{
    editor::tools::select::REACH,
    plugins::{
        controls::outline::{ControlNodes, control_at},
        document::HoveredNode,
        schema::RigNodes,
    },
};

use super::*;
use crate::viewport_app::front;

#[test]
fn poses_leave_the_rest_pose_alone_and_follow_the_pointer() {
    for sight in sights(somewhere()) {
        let mut bench = Bench::new(sight, somewhere());
        let [root, middle, tip] = chain(&mut bench);
        bench.base.select(&[middle]);
        bench.mode(Mode::Pose);
        assert!(bench.shapes().iter().all(|shape| !matches!(shape.handle, Handle::MoveAxis(_))));
        let before = bench.base.rig().clone();
        let from = bench.grip(Handle::ViewRing);
        let centre = sight.project(before.position(middle)).unwrap();
        let turned = centre + Vec2::from_angle(0.5).rotate(from - centre);
        bench.drag(from, turned - from, ModifierKeys::default());
        bench.release(turned);
        let rig = bench.base.rig();
        for joint in [root, middle, tip] {
            assert_eq!(rig.rest_global(joint), before.rest_global(joint));
        }
        let (old, new) = (before.position(tip), rig.posed_global(tip).translation);
        let axis = sight.towards(before.position(middle));
        let arm = old - before.position(middle);
        let wanted = before.position(middle) + Quat::from_axis_angle(axis, -0.5) * arm;
        assert!(new.distance(wanted) < 1e-2, "{new} is not {wanted}");

        // A root can be moved as well, by its arrows or its middle.
        bench.base.select(&[root]);
        bench.mode(Mode::Pose);
        let from = bench.grip(Handle::MoveView);
        let start = sight.project(bench.base.rig().posed_global(root).translation).unwrap();
        bench.drag(from, Vec2::new(40.0, 25.0), ModifierKeys::default());
        bench.release(from + Vec2::new(40.0, 25.0));
        let now = sight.project(bench.base.rig().posed_global(root).translation).unwrap();
        assert!(now.distance(start + Vec2::new(40.0, 25.0)) < 1.0);
        assert_eq!(bench.base.rig().rest_global(root), before.rest_global(root));
    }
}

#[test]
fn rest_is_shown_while_it_is_edited() {
    let [sight, _] = sights(Transform::IDENTITY);
    let mut bench = Bench::new(sight, Transform::IDENTITY);
    let [_, middle, _] = chain(&mut bench);
    bench.base.edit(Operation::Pose(vec![(middle, PoseOffset::from_rotation(Quat::from_rotation_z(0.8)))]));
    let shown = |bench: &Bench| {
        let entity = bench.base.get::<JointEntities>(bench.base.rig).unwrap().get(middle).unwrap();
        *bench.base.get::<Transform>(entity).unwrap()
    };
    let (posed, pose) = (bench.base.rig().posed_local(middle), bench.base.rig().pose().clone());
    assert_eq!(shown(&bench), posed);
    bench.base.select(&[middle]);
    bench.mode(Mode::Move);
    assert_eq!(bench.base.get::<ShowRest>(bench.base.rig), Some(&ShowRest(true)));
    assert_eq!(shown(&bench), bench.base.rig().joint(middle).unwrap().data.rest.into());
    assert_eq!(*bench.base.rig().pose(), pose);
    bench.mode(Mode::Pose);
    assert_eq!(shown(&bench), posed);
}

/// The bundled biped in the window: its commands are carried out when it is opened, a click in Pose mode takes the control
/// of the hand, and the arrow of the gizmo moves control, hand and elbow as one step.
#[test]
fn a_click_takes_a_control_and_the_gizmo_moves_what_it_drives() {
    let rig = crate::bench::shipped("biped");
    for sight in sights(Transform::IDENTITY) {
        let mut bench = Bench::built(headless_app(1), rig.clone(), sight);
        let rig = bench.base.rig;
        let world = bench.base.app.world();
        let built = world.get::<BuildResult>(rig).expect("a rig with commands is built when it is opened").0.clone();
        assert!(world.get::<BuildFailure>(rig).is_none());
        let wrist = built.find_label("hand_l").unwrap().uid;
        let global = |bench: &Bench, node: Uid| {
            bench.base.get::<RigRuntime>(bench.base.rig).unwrap().state().global(node).unwrap().translation
        };
        let at_wrist = global(&bench, wrist);
        let goal = built.switches.iter().find_map(|switch| match &switch.matching {
            Matching::IkFk { goal, .. } if global(&bench, *goal).distance(at_wrist) < 0.05 => Some(*goal),
            _ => None,
        });
        let goal = goal.expect("the hand has a control of inverse kinematics");

        bench.mode(Mode::Pose);
        // Any place of the outline that no other control covers.
        let control = built.node(goal).unwrap().control.clone().unwrap();
        let place = bench.base.get::<RigRuntime>(rig).unwrap().state().global(goal).unwrap();
        let lines = lines_of(&control, place.affine());
        let mut picked = false;
        for point in lines.iter().flatten() {
            let at = sight.project(*point).unwrap();
            for act in [PointerAct::Moved, PointerAct::Pressed, PointerAct::Released { dragged: false, count: 1 }] {
                bench.pointer(at, act, ModifierKeys::default());
            }
            bench.base.app.update();
            if bench.base.get::<Selection>(rig).unwrap().0 == [goal] {
                picked = true;
                break;
            }
        }
        assert!(picked, "no click on its outline takes the control");
        bench.base.app.update();

        let (steps, hand, elbow) = (bench.base.steps(), at_wrist, built.find_label("lower_arm_l").map(|node| node.uid));
        let elbow = elbow.map(|elbow| (elbow, global(&bench, elbow)));
        let from = bench.grip(Handle::MoveAxis(1));
        bench.drag(from, Vec2::new(-20.0, -30.0), ModifierKeys::default());
        let during = global(&bench, wrist);
        bench.release(from + Vec2::new(-20.0, -30.0));
        bench.base.app.update();
        let moved = global(&bench, wrist);
        assert!(moved.distance(hand) > 0.02, "the hand stays at {moved}");
        assert!(moved.distance(during) < 1e-5, "the release keeps what was shown");
        assert!(moved.distance(global(&bench, goal)) < 1e-3, "the hand is where its control is");
        if let Some((elbow, before)) = elbow {
            assert!(global(&bench, elbow).distance(before) > 1e-3, "the elbow follows");
        }
        assert_eq!(bench.base.steps(), steps + 1);
        bench.base.change(Change::Undo);
        assert!(global(&bench, wrist).distance(hand) < 1e-5);

        // Drawing a skeleton, nobody takes a control by mistake.
        bench.mode(Mode::Move);
        assert!(!bench.base.app.world().resource::<ControlsInUse>().0);
    }
}

/// The bundled biped without its mesh: outlines go round the body, and most of them is far from any joint.
#[test]
fn a_click_on_an_outline_beside_the_body_takes_its_control() {
    let sight = front();
    let mut bench = Bench::built(headless_app(1), crate::bench::shipped("biped"), sight);
    let rig = bench.base.rig;
    let visible = move |controls: ControlNodes, nodes: Query<&RigNodes>| {
        controls.visible(nodes.get(rig).ok(), bevy::math::Affine3A::IDENTITY)
    };
    let outlines = bench.base.app.world_mut().run_system_once(visible).unwrap();
    let state = bench.base.get::<RigRuntime>(rig).expect("a built rig").state();
    let joints: Vec<Vec2> =
        bench.base.rig().walk().filter_map(|joint| sight.project(state.global(joint.data.uid)?.translation)).collect();
    // A place of each outline, with which no other outline is mistaken.
    let is_clear = |control: Uid, at: Vec2| {
        let met = control_at(&outlines, &sight.plane, sight.point(at), REACH * sight.pixel);
        met == Some(control) && joints.iter().all(|joint| joint.distance(at) > 30.0)
    };
    let places: Vec<(Uid, Vec2)> = outlines
        .iter()
        .filter_map(|outline| {
            let mut pixels = outline.lines.iter().flatten().filter_map(|place| sight.project(*place));
            Some((outline.uid, pixels.find(|at| is_clear(outline.uid, *at))?))
        })
        .collect();
    assert!(places.len() > 1, "no outlines are beside the body: {} outlines, {} joints", outlines.len(), joints.len());
    for mode in [Mode::Select, Mode::Pose] {
        bench.mode(mode);
        for (control, at) in &places {
            bench.base.select(&[]);
            bench.pointer(*at, PointerAct::Moved, ModifierKeys::default());
            assert_eq!(
                bench.base.get::<HoveredNode>(rig).unwrap().0,
                Some(*control),
                "{mode:?}: what a click would take"
            );
            // The second click of a double click, too: nothing of the document hangs below a control.
            for count in [1, 2] {
                bench.pointer(*at, PointerAct::Pressed, ModifierKeys::default());
                bench.pointer(*at, PointerAct::Released { dragged: false, count }, ModifierKeys::default());
                assert_eq!(bench.base.selected(), [*control], "{mode:?}, click {count}");
            }
        }
        // A box takes controls where people pose, and joints elsewhere; with Control it takes both away.
        bench.base.select(&[]);
        let [low, high] = [Vec2::splat(1.0), Vec2::splat(799.0)];
        let control = ModifierKeys { control: true, ..default() };
        for held in [ModifierKeys::default(), control] {
            bench.pointer(low, PointerAct::Pressed, held);
            bench.pointer(high, PointerAct::Dragged, held);
            bench.pointer(high, PointerAct::Released { dragged: true, count: 1 }, held);
            let boxed = bench.base.selected();
            let is_joint = |node: &Uid| bench.base.rig().joint(*node).is_some();
            match held.control {
                true => assert!(boxed.is_empty(), "{mode:?}: {} are left", boxed.len()),
                false => assert!(
                    boxed.len() >= places.len() && boxed.iter().all(|node| is_joint(node) != (mode == Mode::Pose)),
                    "{mode:?}: {boxed:?}"
                ),
            }
        }
        bench.pointer(Vec2::new(3.0, 3.0), PointerAct::Moved, ModifierKeys::default());
        assert_eq!(bench.base.get::<HoveredNode>(rig).unwrap().0, None, "{mode:?}: beside everything");
    }
}

/// The switch "Move joints, too" gives all joints arrows; those of limbs bring the limb along, so no bone gets longer.
#[test]
fn arrows_in_pose_mode_keep_the_lengths_of_limbs() {
    for sight in sights(Transform::IDENTITY) {
        let mut bench = Bench::new(sight, Transform::IDENTITY);
        let [root, middle, tip] = chain(&mut bench);
        let leaves = [[0.8, 1.3, 0.0], [0.8, 1.2, 0.2]].map(|place| bench.place(place, Some(tip)));
        bench.base.select(&[tip]);
        bench.mode(Mode::Pose);
        let has_arrows = |bench: &Bench| bench.shapes().iter().any(|shape| matches!(shape.handle, Handle::MoveAxis(_)));
        assert!(!has_arrows(&bench), "at first only roots have arrows");
        bench.base.app.insert_resource(PoseMoves(true));
        bench.base.app.update();
        assert!(has_arrows(&bench));
        let (before, steps) = (bench.base.rig().clone(), bench.base.steps());
        let place = |rig: &Rig, joint: Uid| rig.posed_global(joint).translation;
        // Back along the arrow, which is within reach.
        let backwards = |bench: &mut Bench, joint: Uid| {
            let from = bench.grip(Handle::MoveAxis(0));
            let by = (sight.project(place(bench.base.rig(), joint)).unwrap() - from).normalize() * 30.0;
            bench.drag(from, by, ModifierKeys::default());
            bench.release(from + by);
        };
        backwards(&mut bench, tip);
        let after = bench.base.rig().clone();
        assert_eq!(bench.base.steps(), steps + 1);
        assert!(place(&after, tip).distance(place(&before, tip)) > 1e-2, "the joint moves");
        for (above, below) in [(root, middle), (middle, tip)] {
            let length = |rig: &Rig| place(rig, above).distance(place(rig, below));
            assert!((length(&after) - length(&before)).abs() < 1e-4, "the bone becomes longer");
        }
        for joint in [root, middle, tip] {
            let moved = after.offset(joint).map_or(Vec3::ZERO, |offset| offset.translation);
            assert_eq!(moved, Vec3::ZERO, "joints turn, and none of them moves");
        }
        bench.base.change(Change::Undo);
        assert_eq!(*bench.base.rig(), before);

        // One of several that hang on a joint, as bones of a face do, moves by itself.
        bench.base.select(&leaves[..1]);
        bench.base.app.update();
        backwards(&mut bench, leaves[0]);
        let after = bench.base.rig().clone();
        assert!(place(&after, leaves[0]).distance(place(&before, leaves[0])) > 1e-2);
        assert_eq!(after.pose().keys().collect::<Vec<_>>(), [&leaves[0]], "nothing else is posed");
    }
}

/// Rings of a selected control lie over the controls and joints around it: a click on a ring takes what is there, and a drag turns.
#[test]
fn a_click_on_a_ring_takes_the_control_or_joint_under_it() {
    let [_, sight] = sights(Transform::IDENTITY);
    let mut bench = Bench::built(headless_app(1), crate::bench::shipped("biped"), sight);
    let rig = bench.base.rig;
    let visible = move |controls: ControlNodes, nodes: Query<&RigNodes>| {
        controls.visible(nodes.get(rig).ok(), bevy::math::Affine3A::IDENTITY)
    };
    let outlines = bench.base.app.world_mut().run_system_once(visible).unwrap();
    let state = bench.base.get::<RigRuntime>(rig).expect("a built rig").state().clone();
    let joints: Vec<(Uid, Vec2)> = bench
        .base
        .rig()
        .walk()
        .filter_map(|joint| Some((joint.data.uid, sight.project(state.global(joint.data.uid)?.translation)?)))
        .collect();
    let is_ring = |handle: &Handle| matches!(handle, Handle::Ring(_) | Handle::ViewRing);
    let (mut controls, mut nodes, mut turns) = (0, 0, 0);
    for selected in outlines.iter().map(|outline| outline.uid) {
        bench.base.select(&[selected]);
        bench.mode(Mode::Pose);
        let shapes = bench.shapes();
        let others: Vec<_> = outlines.iter().filter(|outline| outline.uid != selected).cloned().collect();
        let middle = sight.project(state.global(selected).unwrap().translation).unwrap();
        let rings = shapes.iter().filter(|shape| is_ring(&shape.handle)).flat_map(|shape| &shape.lines);
        let pixels = rings.filter(|line| line.paint != LinePaint::Far).flat_map(|line| &line.points).copied();
        // Places with one thing under the ring, and not two at almost the same distance.
        let under = |at: Vec2| {
            let joint = joints.iter().filter(|(_, place)| place.distance(at) <= REACH);
            let joint: Vec<Uid> = joint.map(|(uid, _)| *uid).collect();
            let control = control_at(&others, &sight.plane, sight.point(at), REACH * sight.pixel);
            match (joint.as_slice(), control) {
                ([], Some(control)) => Some((control, true)),
                ([joint], None) => Some((*joint, false)),
                _ => None,
            }
        };
        let is_on_ring = |at: &Vec2| handle_at(&shapes, *at).is_some_and(|handle| is_ring(&handle));
        let mut found = pixels.filter(|at| at.distance(middle) > 2.0 * REACH && is_on_ring(at));
        let Some((at, (node, is_control))) = found.find_map(|at| Some((at, under(at)?))) else { continue };
        bench.pointer(at, PointerAct::Pressed, ModifierKeys::default());
        bench.pointer(at, PointerAct::Released { dragged: false, count: 1 }, ModifierKeys::default());
        bench.base.app.update();
        assert_eq!(bench.base.selected(), [node], "the ring of {selected} blocks what is under it at {at}");
        if control_at(&outlines, &sight.plane, sight.point(at), REACH * sight.pixel) == Some(node) {
            // The second click of a double click leaves it selected.
            bench.pointer(at, PointerAct::Pressed, ModifierKeys::default());
            bench.pointer(at, PointerAct::Released { dragged: false, count: 2 }, ModifierKeys::default());
            bench.base.app.update();
            assert_eq!(bench.base.selected(), [node], "a double click at {at} goes on to something else");
        }
        (controls, nodes) = (controls + usize::from(is_control), nodes + usize::from(!is_control));

        // A drag from the same place turns what was selected.
        bench.base.select(&[selected]);
        bench.mode(Mode::Pose);
        let steps = bench.base.steps();
        bench.drag(at, Vec2::new(17.0, 23.0), ModifierKeys::default());
        bench.release(at + Vec2::new(17.0, 23.0));
        assert_eq!(bench.base.selected(), [selected], "a drag of a ring at {at} selects");
        if bench.base.steps() > steps {
            turns += 1;
            bench.base.change(Change::Undo);
            bench.base.app.update();
        }
    }
    assert!(controls > 3 && turns > 3, "{controls} controls and {nodes} joints under rings, {turns} turns");
}
