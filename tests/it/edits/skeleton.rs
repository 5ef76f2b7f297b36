//! Operations on the skeleton, each on a small tree of joints.

use super::*;

#[test]
fn joints_are_placed_where_asked_below_whom_asked() {
    let (mut bench, joints) = tree();
    assert_eq!(bench.rig.roots(), &[joints[0]]);
    assert_eq!(bench.rig.children(Some(joints[0])), &[joints[1], joints[4]]);
    assert_at(&bench, joints[2], [1.0, 2.0, 0.5]);
    let root = bench.place([5.0, 5.0, 5.0], None);
    assert_eq!(bench.rig.roots(), &[joints[0], root]);
    let refused = bench.try_run(Operation::Place { position: Vec3::ZERO, parent: Some(Uid(77)) });
    assert_eq!(refused, Err(EditError::NoJoint(Uid(77)).into()));
}

#[test]
fn inserting_splits_a_bone_and_moves_nothing() {
    let (mut bench, joints) = tree();
    let inserted = bench.run(Operation::Insert { child: joints[1], position: Vec3::new(1.0, 0.5, 0.1) })[0];
    assert_at(&bench, inserted, [1.0, 0.5, 0.1]);
    assert_at(&bench, joints[1], [1.0, 1.0, 0.0]);
    assert_at(&bench, joints[3], [1.5, 3.0, 0.0]);
    assert_eq!(
        bench.rig.children(Some(joints[0])),
        &[inserted, joints[4]],
        "the bone keeps its place among its siblings"
    );
    assert_eq!(bench.rig.children(Some(inserted)), &[joints[1]]);
    let refused = bench.try_run(Operation::Insert { child: joints[0], position: Vec3::ZERO });
    assert_eq!(refused, Err(OperationError::NoBone(joints[0])));
}

#[test]
fn deleting_keeps_or_takes_what_hangs_below() {
    let (mut bench, joints) = tree();
    let selected = bench.run(Operation::Delete { joints: vec![joints[1]], keep_children: true });
    assert_eq!(bench.rig.children(Some(joints[0])), &[joints[2], joints[4]], "the child takes its parent's place");
    assert_at(&bench, joints[2], [1.0, 2.0, 0.5]);
    assert_at(&bench, joints[3], [1.5, 3.0, 0.0]);
    assert_eq!(selected, [joints[0]]);

    bench.run(Operation::Delete { joints: vec![joints[0]], keep_children: true });
    assert_eq!(bench.rig.roots(), &[joints[2], joints[4]]);
    assert_at(&bench, joints[3], [1.5, 3.0, 0.0]);
    assert_at(&bench, joints[4], [-1.0, 0.0, 0.0]);

    let (mut bench, joints) = tree();
    bench.run(Operation::Delete { joints: vec![joints[2], joints[1]], keep_children: false });
    let left: Vec<Uid> = bench.rig.walk().map(|joint| joint.data.uid).collect();
    assert_eq!(left, [joints[0], joints[4]]);
}

#[test]
fn moving_takes_children_along_or_leaves_them() {
    let (mut bench, joints) = tree();
    bench.run(Operation::Move { to: vec![(joints[1], Vec3::new(0.0, 1.0, 0.0))], with_children: false });
    assert_at(&bench, joints[1], [0.0, 1.0, 0.0]);
    assert_at(&bench, joints[2], [1.0, 2.0, 0.5]);
    bench.run(Operation::Move { to: vec![(joints[1], Vec3::new(0.0, 2.0, 0.0))], with_children: true });
    assert_at(&bench, joints[2], [1.0, 3.0, 0.5]);
    assert_at(&bench, joints[3], [1.5, 4.0, 0.0]);
    // Both a joint and its child: each goes where it is sent.
    let to = vec![(joints[2], Vec3::ONE), (joints[1], Vec3::ZERO)];
    bench.run(Operation::Move { to, with_children: true });
    assert_at(&bench, joints[1], [0.0; 3]);
    assert_at(&bench, joints[2], [1.0; 3]);
}

#[test]
fn rotating_and_scaling_go_about_the_pivot() {
    let quarter = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let rotate =
        |joints: Vec<Uid>, pivot, with_children| Operation::Rotate { joints, rotation: quarter, pivot, with_children };
    let mut bench = Bench::new();
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], None);
    bench.run(rotate(vec![joints[1]], None, true));
    assert_at(&bench, joints[1], [1.0, 0.0, 0.0]);
    assert_at(&bench, joints[2], [1.0, 1.0, 0.0]);
    bench.run(rotate(vec![joints[0]], None, false));
    assert_at(&bench, joints[2], [1.0, 1.0, 0.0]);
    // A child of a listed joint is carried, not turned twice.
    bench.run(rotate(vec![joints[2], joints[1]], Some(Vec3::ZERO), true));
    assert_at(&bench, joints[1], [0.0, 1.0, 0.0]);
    assert_at(&bench, joints[2], [-1.0, 1.0, 0.0]);

    let mut bench = Bench::new();
    let joints = bench.chain(&[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], None);
    let scale = |scale: Vec3, pivot| Operation::Scale {
        joints: vec![joints[0]],
        scale,
        axes: Quat::IDENTITY,
        pivot,
        with_children: true,
    };
    bench.run(scale(Vec3::splat(2.0), Some(Vec3::ZERO)));
    assert_at(&bench, joints[0], [2.0, 0.0, 0.0]);
    assert_at(&bench, joints[1], [4.0, 0.0, 0.0]);
    for wrong in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::splat(f32::NAN)] {
        assert!(matches!(bench.try_run(scale(wrong, None)), Err(OperationError::BadNumber(_))), "{wrong}");
    }
}

#[test]
fn reparenting_keeps_places_and_refuses_cycles() {
    let (mut bench, joints) = tree();
    bench.run(Operation::Reparent { joints: vec![joints[2]], parent: Some(joints[4]) });
    assert_eq!(bench.rig.children(Some(joints[4])), &[joints[2]]);
    assert_at(&bench, joints[2], [1.0, 2.0, 0.5]);
    assert_at(&bench, joints[3], [1.5, 3.0, 0.0]);
    bench.run(Operation::Reparent { joints: vec![joints[2]], parent: None });
    assert_eq!(bench.rig.roots(), &[joints[0], joints[2]]);
    assert_at(&bench, joints[3], [1.5, 3.0, 0.0]);
    let before = bench.rig.clone();
    for (joint, parent) in [(joints[0], joints[4]), (joints[2], joints[3]), (joints[1], joints[1])] {
        let refused = bench.try_run(Operation::Reparent { joints: vec![joint], parent: Some(parent) });
        assert_eq!(refused, Err(EditError::Cycle { joint, parent }.into()));
        assert_eq!(bench.rig, before);
    }
}

#[test]
fn orienting_points_an_axis_along_the_bone_and_moves_nothing() {
    for (along, axis) in [(Axis::X, Vec3::X), (Axis::Y, Vec3::Y), (Axis::Z, Vec3::Z)] {
        let (mut bench, joints) = tree();
        let before: Vec<Vec3> = joints.iter().map(|joint| bench.at(*joint)).collect();
        bench.run(Operation::Orient { joints: joints.clone(), along });
        for (joint, place) in joints.iter().zip(&before) {
            assert!(bench.at(*joint).distance(*place) < 1e-4, "{along:?}");
        }
        let rotation = |joint: Uid| bench.rig.rest_global(joint).to_scale_rotation_translation().1;
        for pair in [[1, 2], [2, 3]] {
            let bone = (before[pair[1]] - before[pair[0]]).normalize();
            assert!((rotation(joints[pair[0]]) * axis).distance(bone) < 1e-4, "{along:?}");
        }
        assert!(rotation(joints[3]).angle_between(rotation(joints[2])) < 2e-3, "a leaf turns like its parent");
        assert!(bench.rig.walk().all(|joint| joint.data.rest.is_valid()));
    }
    // An upright bone along Y is how Y-up characters stand: nothing is turned, and Z is to the front.
    let mut bench = Bench::new();
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], None);
    bench.run(Operation::Orient { joints, along: Axis::Y });
    assert!(bench.rig.walk().all(|joint| joint.data.rest.rotation.angle_between(Quat::IDENTITY) < 1e-3));
}
