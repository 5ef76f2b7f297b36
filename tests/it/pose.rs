//! Poses: on top of rest, mirrored in the rig's space, kept under names, and never mixed with rest.

use bevy::{math::Affine3, prelude::*};
use proptest::prelude::{ProptestConfig, prop_assert, proptest};
use rigsmith::{
    headless::Workbench,
    prelude::Change,
    rig::{
        EditError, PoseOffset, RestTransform, Rig, RigEdit, StoredPose, Uid,
        operations::{Axis, MirrorPlane, Operation, OperationError},
        template::{read_template, write_template},
    },
};

use crate::{bench::RigBench, edits::Bench};

fn turn(x: f32, y: f32, z: f32) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_euler(EulerRot::XYZ, x, y, z))
}

/// Hips on the plane, an arm of three joints and its mirror image; left joints, then right ones.
fn two_arms() -> (Bench, Uid, Vec<Uid>, Vec<Uid>) {
    let mut bench = Bench::new();
    let hips = bench.place([0.0, 1.0, 0.0], None);
    let left = bench.chain(&[[0.2, 1.4, 0.0], [0.5, 1.3, -0.1], [0.8, 1.3, 0.05]], Some(hips));
    bench.plane = Some(MirrorPlane::sagittal(2.0));
    bench.run(Operation::Mirror { joints: vec![left[0]] });
    let right = left.iter().map(|joint| bench.rig.joint(*joint).unwrap().data.mirror.unwrap()).collect();
    (bench, hips, left, right)
}

/// Movement that the pose gives a point of the mesh that is at rest and moves with the joint.
fn moves(rig: &Rig, joint: Uid) -> Affine3 {
    rig.posed_global(joint) * rig.rest_global(joint).inverse()
}

fn assert_near(a: &Affine3, b: &Affine3, what: &str) {
    assert!(a.abs_diff_eq(*b, 1e-5), "{what}\n{a}\n{b}");
}

#[test]
fn an_offset_is_found_again() {
    let rests = [
        RestTransform::default(),
        RestTransform {
            translation: Vec3::new(1.0, -2.0, 0.5),
            rotation: Quat::from_rotation_x(2.0),
            scale: Vec3::ONE,
        },
        RestTransform { translation: Vec3::X, rotation: Quat::from_rotation_z(-1.0), scale: Vec3::new(2.0, 0.5, -3.0) },
    ];
    let offsets = [
        PoseOffset::IDENTITY,
        turn(0.4, -1.0, 2.0),
        PoseOffset {
            translation: Vec3::new(0.1, 0.2, -0.3),
            rotation: Quat::from_rotation_y(1.0),
            scale: Vec3::splat(1.5),
        },
    ];
    for rest in &rests {
        for offset in &offsets {
            let again = PoseOffset::between(rest, &offset.on(rest));
            assert!(again.translation.distance(offset.translation) < 1e-5, "{again:?} {offset:?}");
            assert!(again.rotation.angle_between(offset.rotation) < 1e-3, "{again:?} {offset:?}");
            assert!(again.scale.distance(offset.scale) < 1e-5, "{again:?} {offset:?}");
        }
        assert_eq!(PoseOffset::IDENTITY.on(rest), Transform::from(*rest));
    }
    let flat = RestTransform { scale: Vec3::new(0.0, 1.0, 1.0), ..default() };
    assert!(PoseOffset::between(&flat, &Transform::from_xyz(1.0, 2.0, 3.0)).is_valid());
}

#[test]
fn posing_leaves_rest_alone_and_is_taken_back() {
    let (mut bench, hips, left, _) = two_arms();
    bench.plane = None;
    let before = bench.rig.clone();
    let outcome =
        bench.try_run(Operation::Pose(vec![(hips, turn(0.0, 0.0, 0.5)), (left[1], turn(0.3, 0.0, 0.0))])).unwrap();
    assert_eq!(bench.rig.pose().len(), 2);
    assert_eq!(bench.rig.rest_globals(), before.rest_globals());
    assert_eq!(bench.rig.posed_global(hips).translation, bench.at(hips));
    assert!(bench.rig.posed_global(left[2]).translation.distance(bench.at(left[2])) > 0.1);
    let globals: Vec<_> = bench.rig.walk().map(|joint| bench.rig.posed_global(joint.data.uid)).collect();
    for ((_, global), single) in bench.rig.posed_globals().iter().zip(&globals) {
        assert_near(global, single, "all at once");
    }
    for inverse in &outcome.inverses {
        bench.rig.apply(inverse).unwrap();
    }
    assert_eq!(bench.rig, before);

    bench.run(Operation::Pose(vec![(hips, turn(0.0, 0.0, 0.5)), (left[1], turn(0.3, 0.0, 0.0))]));
    bench.run(Operation::ResetPose(vec![left[1]]));
    assert_eq!(bench.rig.pose().keys().collect::<Vec<_>>(), [&hips]);
    bench.run(Operation::Pose(vec![(hips, PoseOffset::IDENTITY)]));
    assert_eq!(bench.rig, before, "what stands as it rests is in no pose");
    assert!(bench.try_run(Operation::ResetPose(Vec::new())).unwrap().edits.is_empty());
}

#[test]
fn what_is_no_pose_is_refused() {
    let (mut bench, hips, ..) = two_arms();
    let broken = PoseOffset { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.3), ..PoseOffset::IDENTITY };
    let nan = PoseOffset { translation: Vec3::NAN, ..PoseOffset::IDENTITY };
    let pose =
        |uid, offset| Box::new(StoredPose { uid, name: "p".into(), offsets: [(hips, offset)].into(), ..default() });
    bench.run(Operation::StorePose("kept".into()));
    let kept = bench.rig.stored_poses()[0].uid;
    bench.run(Operation::StorePose("other".into()));
    let before = bench.rig.clone();
    for (edit, error) in [
        (RigEdit::SetOffset(Uid(99), Some(nan)), EditError::BadTransform(Uid(99))),
        (RigEdit::SetAttributeValue(Uid(99), "a".into(), Some(f32::NAN)), EditError::BadValue(Uid(99), "a".into())),
        (RigEdit::SetOffset(hips, Some(broken)), EditError::BadTransform(hips)),
        (RigEdit::SetOffset(hips, Some(nan)), EditError::BadTransform(hips)),
        (RigEdit::AddStoredPose(pose(hips, PoseOffset::IDENTITY), 0), EditError::UidInUse(hips)),
        (RigEdit::AddStoredPose(pose(kept, PoseOffset::IDENTITY), 0), EditError::UidInUse(kept)),
        (RigEdit::AddStoredPose(pose(Uid(5), nan), 0), EditError::BadTransform(hips)),
        (RigEdit::SetStoredPose(pose(Uid(5), PoseOffset::IDENTITY)), EditError::NoPose(Uid(5))),
        (RigEdit::RemoveStoredPose(Uid(5)), EditError::NoPose(Uid(5))),
    ] {
        assert_eq!(bench.rig.apply(&edit), Err(error), "{edit:?}");
        assert_eq!(bench.rig, before);
    }
    for (operation, error) in [
        (Operation::StorePose(" ".into()), OperationError::NoName),
        (Operation::RenamePose(kept, String::new()), OperationError::NoName),
        (Operation::RenamePose(kept, "other".into()), OperationError::PoseName("other".into())),
        (Operation::ApplyPose(Uid(5)), EditError::NoPose(Uid(5)).into()),
        (Operation::DeletePose(Uid(5)), EditError::NoPose(Uid(5)).into()),
        (Operation::Pose(vec![(hips, turn(1.0, 0.0, 0.0)), (Uid(5), nan)]), EditError::BadTransform(Uid(5)).into()),
    ] {
        assert_eq!(bench.try_run(operation.clone()), Err(error), "{operation:?}");
        assert_eq!(bench.rig, before);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever way the joints of the other side are turned, the mesh there moves as the mirror image.
    #[test]
    fn a_mirrored_pose_is_a_mirror_image(numbers: [[i8; 3]; 6], scaled: bool, hips_turned: bool) {
        let (mut bench, hips, left, right) = two_arms();
        let plane = bench.plane.take().unwrap();
        let euler = |[x, y, z]: [i8; 3]| Quat::from_euler(EulerRot::YXZ, f32::from(x) / 40.0, f32::from(y) / 40.0, f32::from(z) / 40.0);
        let scale = if scaled { Vec3::splat(1.25) } else { Vec3::ONE };
        bench.run(Operation::Scale { joints: vec![hips], scale: scale * scale, axes: Quat::IDENTITY, pivot: None, with_children: true });
        for (number, joint) in right.iter().enumerate() {
            let rotation = euler(numbers[number]);
            bench.run(Operation::Rotate { joints: vec![*joint], rotation, pivot: None, with_children: false });
        }
        if hips_turned {
            bench.run(Operation::Pose(vec![(hips, PoseOffset::from_rotation(euler(numbers[0])))]));
        }
        bench.plane = Some(plane);
        for (number, joint) in left.iter().enumerate() {
            let translation = Vec3::from(numbers[number].map(f32::from)) / 1000.0;
            let offset = PoseOffset { translation, rotation: euler(numbers[number + 3]), scale };
            bench.run(Operation::Pose(vec![(*joint, offset)]));
        }
        let reflect = Affine3 { matrix3: plane.reflection(), translation: plane.mirrored(Vec3::ZERO) };
        let carried = moves(&bench.rig, hips).inverse();
        for (left, right) in left.iter().zip(&right) {
            let (here, there) = (carried * moves(&bench.rig, *left), carried * moves(&bench.rig, *right));
            let image = reflect * here * reflect;
            prop_assert!(there.abs_diff_eq(image, 1e-5), "{there}\n{image}");
            let place = bench.rig.posed_global(*right).translation;
            let other = reflect.transform_point3(carried.transform_point3(bench.rig.posed_global(*left).translation));
            prop_assert!(carried.transform_point3(place).distance(other) < 1e-5);
        }
        // Back to rest on both sides at once.
        bench.run(Operation::ResetPose(left));
        prop_assert!(right.iter().all(|joint| bench.rig.offset(*joint).is_none()));
    }
}

#[test]
fn scale_and_negative_axes_are_mirrored_where_axes_are_parallel() {
    let (mut bench, _, left, right) = two_arms();
    let plane = bench.plane.take().unwrap();
    // The other shoulder is turned by a quarter and mirrored by a negative scale, as some exporters do.
    let mut rest = bench.rig.joint(left[0]).unwrap().data.rest;
    rest.rotation = Quat::IDENTITY;
    bench.rig.apply(&RigEdit::SetRest(left[0], rest)).unwrap();
    let mut rest = bench.rig.joint(right[0]).unwrap().data.rest;
    rest.rotation = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    rest.scale = Vec3::new(1.0, -1.0, 1.0);
    bench.rig.apply(&RigEdit::SetRest(right[0], rest)).unwrap();
    bench.plane = Some(plane);
    let offset = PoseOffset { scale: Vec3::new(2.0, 1.0, 0.5), ..turn(0.3, 0.0, 0.0) };
    bench.run(Operation::Pose(vec![(left[0], offset)]));
    assert!(bench.rig.offset(right[0]).unwrap().scale.distance(Vec3::new(1.0, 2.0, 0.5)) < 1e-5);
    let reflect = Affine3::from_mat3(plane.reflection());
    let image = reflect * moves(&bench.rig, left[0]) * reflect;
    assert_near(&moves(&bench.rig, right[0]), &image, "the shoulder");

    // Below a negative scale, an axis of rotation points the other way.
    bench.run(Operation::Pose(vec![(left[1], turn(0.2, 0.4, -0.7))]));
    let relative = |shoulder: Uid, elbow: Uid| moves(&bench.rig, shoulder).inverse() * moves(&bench.rig, elbow);
    let turned =
        |motion: Affine3| (motion.matrix3.x_axis.x + motion.matrix3.y_axis.y + motion.matrix3.z_axis.z - 1.0) / 2.0;
    let (here, there) = (turned(relative(left[0], left[1])), turned(relative(right[0], right[1])));
    assert!((here - there).abs() < 1e-5, "{here} {there}");
}

#[test]
fn both_sides_listed_are_posed_as_they_are() {
    let (mut bench, _, left, right) = two_arms();
    let (here, there) = (turn(0.1, 0.2, 0.3), turn(-1.0, 0.0, 0.0));
    bench.run(Operation::Pose(vec![(left[0], here), (right[0], there)]));
    assert_eq!((bench.rig.offset(left[0]), bench.rig.offset(right[0])), (Some(&here), Some(&there)));
}

#[test]
fn turning_a_joint_along_its_bone_keeps_what_poses_do() {
    let (mut bench, _, left, _) = two_arms();
    bench.plane = None;
    bench.run(Operation::Pose(vec![(left[0], turn(0.3, 0.5, -0.2)), (left[1], turn(-0.4, 0.1, 0.9))]));
    bench.run(Operation::StorePose("bent".into()));
    let before: Vec<Affine3> = left.iter().map(|joint| moves(&bench.rig, *joint)).collect();
    let check = |bench: &Bench, what: &str| {
        for (joint, before) in left.iter().zip(&before) {
            assert_near(&moves(&bench.rig, *joint), before, what);
        }
    };
    bench.run(Operation::Orient { joints: left.clone(), along: Axis::X });
    check(&bench, "the current pose");
    bench.run(Operation::ResetPose(Vec::new()));
    bench.run(Operation::ApplyPose(bench.rig.stored_poses()[0].uid));
    check(&bench, "the stored pose");
    // Moving with its children keeps the offsets as they are: the pose stays on top.
    let offsets = bench.rig.pose().clone();
    bench.run(Operation::Move { to: vec![(left[0], Vec3::new(0.3, 1.5, 0.1))], with_children: true });
    assert_eq!(bench.rig.pose(), &offsets);
}

#[test]
fn poses_are_kept_under_names() {
    let (mut bench, hips, left, _) = two_arms();
    bench.plane = None;
    bench.run(Operation::StorePose("rest".into()));
    bench.run(Operation::Pose(vec![(hips, turn(0.0, 0.2, 0.0)), (left[0], turn(1.0, 0.0, 0.0))]));
    bench.run(Operation::StorePose(" wave ".into()));
    let names = |bench: &Bench| bench.rig.stored_poses().iter().map(|pose| pose.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&bench), ["rest", "wave"]);
    let [rest, wave] = [0, 1].map(|number| bench.rig.stored_poses()[number].uid);
    let waving = bench.rig.pose().clone();

    bench.run(Operation::Pose(vec![(left[1], turn(0.5, 0.0, 0.0))]));
    bench.run(Operation::ApplyPose(wave));
    assert_eq!(bench.rig.pose(), &waving, "joints that the pose does not name stand as they rest");
    assert!(bench.try_run(Operation::ApplyPose(wave)).unwrap().edits.is_empty(), "applied already");
    bench.run(Operation::ApplyPose(rest));
    assert!(bench.rig.pose().is_empty());

    // Storing under a name that there is replaces that pose, in its place and with its uid.
    bench.run(Operation::Pose(vec![(left[2], turn(0.5, 0.0, 0.0))]));
    bench.run(Operation::StorePose("rest".into()));
    assert_eq!(names(&bench), ["rest", "wave"]);
    assert_eq!(bench.rig.stored_pose(rest).unwrap().offsets, *bench.rig.pose());
    bench.run(Operation::RenamePose(rest, "bent".into()));
    bench.run(Operation::DeletePose(wave));
    assert_eq!(names(&bench), ["bent"]);
}

#[test]
fn a_deleted_joint_takes_its_part_of_the_pose_along_and_brings_it_back() {
    let (mut bench, hips, left, right) = two_arms();
    bench.run(Operation::Pose(vec![(hips, turn(0.0, 0.2, 0.0)), (left[2], turn(1.0, 0.0, 0.0))]));
    bench.run(Operation::StorePose("reach".into()));
    let reach = bench.rig.stored_poses()[0].clone();
    let before = bench.rig.clone();
    let outcome = bench.try_run(Operation::Delete { joints: vec![left[1]], keep_children: false }).unwrap();
    assert_eq!(bench.rig.pose().keys().collect::<Vec<_>>(), [&hips]);
    assert_eq!(bench.rig.stored_pose(reach.uid), Some(&reach), "what is stored stays, for when the joint comes back");
    let deleted = bench.rig.clone();
    bench.run(Operation::ResetPose(Vec::new()));
    bench.run(Operation::ApplyPose(reach.uid));
    assert_eq!(bench.rig.pose(), &reach.offsets, "what is posed waits for joints that are not there");
    bench.run(Operation::StorePose("reach".into()));
    assert!(bench.rig.stored_pose(reach.uid).unwrap().offsets.contains_key(&right[2]));
    bench.rig = deleted;
    for inverse in &outcome.inverses {
        bench.rig.apply(inverse).unwrap();
    }
    assert_eq!(bench.rig, before);
}

impl RigBench {
    fn transform(&self, joint: Uid) -> Transform {
        *self.get::<Transform>(self.joint(joint)).unwrap()
    }

    #[track_caller]
    fn assert_as_documented(&self) {
        for joint in self.rig().walk() {
            assert_eq!(self.transform(joint.data.uid), self.rig().posed_local(joint.data.uid));
        }
    }
}

#[test]
fn entities_stand_as_the_document_poses_them() {
    let (mut bench, hips, left, right) = two_arms();
    bench.run(Operation::Pose(vec![(left[0], turn(0.0, 0.0, 1.0))]));
    let mut app = RigBench::started(bench.rig.clone());
    app.assert_as_documented();
    assert_ne!(app.transform(right[0]).rotation, app.rig().joint(right[0]).unwrap().data.rest.rotation);

    app.edit(Operation::Pose(vec![(hips, turn(0.3, 0.0, 0.0)), (left[0], turn(0.0, 0.5, 0.0))]));
    app.assert_as_documented();
    app.change(Change::Undo);
    app.assert_as_documented();
    app.change(Change::Redo);
    app.edit(Operation::Delete { joints: vec![left[0]], keep_children: true });
    app.assert_as_documented();
    app.change(Change::Undo);
    app.assert_as_documented();
    assert_eq!(app.rig().pose().len(), 3);

    // Rest below the pose.
    let rotation = Quat::from_rotation_y(0.4);
    app.edit(Operation::Rotate { joints: vec![left[0]], rotation, pivot: None, with_children: true });
    app.assert_as_documented();
    app.edit(Operation::ResetPose(Vec::new()));
    app.assert_as_documented();
    assert!(app.rig().pose().is_empty());
}

#[test]
fn who_else_writes_a_pose_keeps_it_until_the_document_poses_that_joint() {
    let (bench, hips, left, _) = two_arms();
    let mut app = RigBench::started(bench.rig.clone());
    app.edit(Operation::Pose(vec![(hips, turn(0.3, 0.0, 0.0))]));
    let animated = turn(0.0, 0.7, 0.0);
    for joint in [hips, left[1]] {
        let pose = animated.on(&app.rig().joint(joint).unwrap().data.rest);
        let entity = app.joint(joint);
        *app.app.world_mut().get_mut::<Transform>(entity).unwrap() = pose;
    }
    let is_animated = |app: &RigBench, joint: Uid| {
        let expected = animated.on(&app.rig().joint(joint).unwrap().data.rest);
        let found = app.transform(joint);
        found.translation.distance(expected.translation) < 1e-5
            && found.rotation.angle_between(expected.rotation) < 1e-3
    };
    app.edit(Operation::Labels(vec![(hips, "hips".into())]));
    app.edit(Operation::Pose(vec![(left[0], turn(0.1, 0.0, 0.0))]));
    assert!(is_animated(&app, hips) && is_animated(&app, left[1]), "edits of others overwrite nothing");
    app.edit(Operation::Move { to: vec![(left[1], Vec3::new(0.6, 1.2, 0.0))], with_children: true });
    assert!(is_animated(&app, left[1]), "rest moves below what was put on top");
    app.edit(Operation::Pose(vec![(hips, turn(0.0, 0.0, 0.3))]));
    assert_eq!(app.transform(hips), app.rig().posed_local(hips));
    assert!(is_animated(&app, left[1]));
}

#[test]
fn templates_and_exports_hold_the_rest_pose_and_stored_ones() {
    let (bench, hips, left, _) = two_arms();
    let mut work = Workbench::with_rig(1, bench.rig.clone());
    let (text, before) = (write_template(work.rig()), work.character());
    work.operate(Operation::Pose(vec![(hips, turn(0.3, 0.0, 0.0)), (left[0], turn(0.0, 1.0, 0.0))])).unwrap();
    assert_eq!(write_template(work.rig()), text);
    work.operate(Operation::StorePose("bent".into())).unwrap();
    assert_eq!(work.rig().stored_poses()[0].offsets.len(), 2);
    let read = read_template(write_template(work.rig()).as_bytes()).unwrap();
    assert!(read.notes.is_empty() && read.rig.pose().is_empty());
    assert_eq!(read.rig.stored_poses(), work.rig().stored_poses());
    assert_eq!(work.character(), before);
}
