//! The other side: live mirroring, and mirroring afterwards.

use bevy::math::{Quat, Vec3, Vec3Swizzles};
use proptest::prelude::*;
use rigsmith::rig::{
    Uid,
    label::{label_side, mirrored_label},
    operations::{Axis, MirrorPlane, Operation, settle},
};

use crate::edits::{Bench, assert_at};

/// Live mirroring across x = 0 of a character of two units.
fn live() -> Bench {
    Bench { plane: Some(MirrorPlane::sagittal(2.0)), ..Bench::new() }
}

fn partner(bench: &Bench, joint: Uid) -> Uid {
    let other = bench.rig.joint(joint).unwrap().data.mirror.expect("no joint on the other side");
    assert_eq!(bench.rig.joint(other).unwrap().data.mirror, Some(joint), "pairs name each other");
    other
}

fn label(bench: &Bench, joint: Uid) -> Option<String> {
    bench.rig.joint(joint).unwrap().data.label.clone()
}

const FLIP: Vec3 = Vec3::new(-1.0, 1.0, 1.0);

#[test]
fn labels_swap_their_side_or_have_none() {
    for (left, right) in [
        ("hand_l", "hand_r"),
        ("hand_L", "hand_R"),
        ("hand.L", "hand.R"),
        ("hand.l", "hand.r"),
        ("hand-l", "hand-r"),
        ("hand.L.001", "hand.R.001"),
        ("thumb_01_l", "thumb_01_r"),
        ("arm_l_02", "arm_r_02"),
        ("L_hand", "R_hand"),
        ("Left", "Right"),
        ("LeftHand", "RightHand"),
        ("mixamorig:LeftHandThumb1", "mixamorig:RightHandThumb1"),
        ("leftArm", "rightArm"),
        ("handLeft", "handRight"),
        ("eye_left", "eye_right"),
        ("LEFT_ARM", "RIGHT_ARM"),
        ("手.L", "手.R"),
    ] {
        assert_eq!(mirrored_label(left).as_deref(), Some(right));
        assert_eq!(mirrored_label(right).as_deref(), Some(left));
        assert_eq!((label_side(left), label_side(right)), (1, -1), "{left}");
    }
    for none in [
        "",
        "l",
        "_l",
        "upright",
        "shoulder",
        "bright",
        "cleft",
        "copyright_1",
        "spine",
        "roll",
        "Leftover",
        "tail.001",
        "l1",
        "手",
    ] {
        assert_eq!(mirrored_label(none), None, "{none}");
        assert_eq!(label_side(none), 0, "{none}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mirroring_a_label_twice_gives_it_back(label in "([lrLR]|left|right|Left|Right|LEFT|a|B|é|[_.\\- ]|[0-9]){0,6}") {
        if let Some(other) = mirrored_label(&label) {
            prop_assert_eq!(mirrored_label(&other), Some(label));
        }
    }
}

#[test]
fn chains_grow_on_both_sides_and_share_the_middle() {
    let mut bench = live();
    let hips = bench.place([0.004, 1.0, 0.0], None);
    assert_eq!(bench.at(hips).x, 0.0, "put exactly onto the plane");
    assert_eq!(bench.rig.len(), 1);
    let leg = bench.chain(&[[0.1, 0.9, 0.0], [0.12, 0.5, 0.05], [0.1, 0.1, 0.0]], Some(hips));
    assert_eq!(bench.rig.len(), 7);
    assert_eq!(bench.rig.children(Some(hips)).len(), 2);
    for (number, joint) in leg.iter().enumerate() {
        let other = partner(&bench, *joint);
        assert!(bench.at(other).distance(bench.at(*joint) * FLIP) < 1e-6);
        let parent = bench.rig.joint(other).unwrap().parent;
        let expected = if number == 0 { hips } else { partner(&bench, leg[number - 1]) };
        assert_eq!(parent, Some(expected));
    }
    // A spine that wavers about the plane lies on it as a whole.
    let spine = bench.chain(&[[0.03, 1.1, 0.0], [-0.015, 1.2, 0.0], [0.0, 1.3, 0.0]], Some(hips));
    assert_eq!(bench.rig.len(), 10);
    assert!(
        spine.iter().all(|joint| bench.at(*joint).x == 0.0 && bench.rig.joint(*joint).unwrap().data.mirror.is_none())
    );
    // Continuing on the right continues the left, too.
    let other_foot = partner(&bench, leg[2]);
    let toe = bench.place([-0.1, 0.0, 0.1], Some(other_foot));
    assert_eq!(bench.rig.joint(partner(&bench, toe)).unwrap().parent, Some(leg[2]));
}

#[test]
fn changes_of_one_side_reach_the_other() {
    let mut bench = live();
    let root = bench.place([0.0, 1.0, 0.0], None);
    let arm = bench.chain(&[[0.2, 1.4, 0.0], [0.5, 1.3, 0.02], [0.8, 1.1, 0.0]], Some(root));
    let other: Vec<Uid> = arm.iter().map(|joint| partner(&bench, *joint)).collect();
    let symmetric = |bench: &Bench, what: &str| {
        for (joint, other) in arm.iter().zip(&other) {
            let apart = bench.at(*other).distance(bench.at(*joint) * FLIP);
            assert!(apart < 1e-6, "{what}: {apart}");
        }
    };
    for (name, expected) in [("arm_l", "arm_r"), ("Arm.R", "Arm.L"), ("LeftArm", "RightArm"), ("thing", "thing")] {
        bench.run(Operation::Labels(vec![(arm[0], name.into())]));
        assert_eq!(label(&bench, other[0]).as_deref(), Some(expected));
    }
    bench.run(Operation::Move { to: vec![(arm[1], Vec3::new(0.55, 1.2, -0.1))], with_children: false });
    symmetric(&bench, "move");
    bench.run(Operation::Move { to: vec![(other[0], Vec3::new(-0.25, 1.45, 0.0))], with_children: true });
    symmetric(&bench, "move of the right");
    let rotation = Quat::from_rotation_z(0.4) * Quat::from_rotation_y(0.3);
    bench.run(Operation::Rotate { joints: vec![arm[0]], rotation, pivot: None, with_children: true });
    symmetric(&bench, "rotate");
    bench.run(Operation::Scale {
        joints: vec![arm[1]],
        scale: Vec3::splat(1.5),
        axes: Quat::IDENTITY,
        pivot: None,
        with_children: true,
    });
    symmetric(&bench, "scale");
    bench.run(Operation::Orient { joints: arm.clone(), along: Axis::Y });
    symmetric(&bench, "orient");
    for side in [&arm, &other] {
        let bone = (bench.at(side[1]) - bench.at(side[0])).normalize();
        let axis = bench.rig.rest_global(side[0]).to_scale_rotation_translation().1 * Vec3::Y;
        assert!(axis.distance(bone) < 1e-4, "{axis} is not along {bone}");
    }
    bench.run(Operation::Move { to: vec![(root, Vec3::new(0.1, 1.1, 0.0))], with_children: false });
    assert_at(&bench, root, [0.0, 1.1, 0.0]);
    bench.run(Operation::Lock(vec![arm[2]], true));
    assert!(bench.rig.joint(other[2]).unwrap().data.locked);
    bench.run(Operation::Group { joints: vec![arm[0]], name: "arm_l".into(), color: None });
    let groups: Vec<&str> = bench.rig.groups().iter().map(|group| group.name.as_str()).collect();
    assert_eq!(groups, ["arm_l", "arm_r"]);
    let group = bench.rig.joint(other[0]).unwrap().data.group.and_then(|group| bench.rig.group(group)).unwrap();
    assert_eq!(group.name, "arm_r");

    let inserted = bench.run(Operation::Insert { child: arm[2], position: Vec3::new(0.7, 1.1, 0.0) })[0];
    let opposite = partner(&bench, inserted);
    assert_at(&bench, opposite, [-0.7, 1.1, 0.0]);
    assert_eq!(bench.rig.children(Some(opposite)), &[other[2]]);
    symmetric(&bench, "insert");
    bench.run(Operation::Reparent { joints: vec![arm[2]], parent: Some(arm[0]) });
    assert_eq!(bench.rig.joint(other[2]).unwrap().parent, Some(other[0]));
    symmetric(&bench, "reparent");
    bench.run(Operation::Delete { joints: vec![arm[0]], keep_children: false });
    assert_eq!(bench.rig.len(), 1);
}

#[test]
fn a_joint_put_into_a_bone_of_the_middle_is_on_the_plane() {
    let mut bench = live();
    let spine = bench.chain(&[[0.0, 1.0, 0.0], [0.0, 1.4, 0.0]], None);
    let inserted = bench.run(Operation::Insert { child: spine[1], position: Vec3::new(0.01, 1.2, 0.0) })[0];
    assert_eq!(bench.at(inserted).x, 0.0);
}

#[test]
fn deleting_a_half_pair_leaves_no_name_of_the_deleted() {
    let mut bench = live();
    let left = bench.place([0.5, 0.0, 0.0], None);
    let right = partner(&bench, left);
    bench.plane = None;
    bench.run(Operation::Delete { joints: vec![left], keep_children: true });
    assert_eq!(bench.rig.joint(right).unwrap().data.mirror, None);
}

#[test]
fn mirroring_afterwards_makes_the_other_side_and_renews_it() {
    let mut bench = Bench::new();
    let hips = bench.place([0.001, 1.0, 0.0], None);
    let leg = bench.chain(&[[0.1, 0.9, 0.0], [0.12, 0.5, 0.05], [0.1, 0.1, 0.0]], Some(hips));
    bench.place([0.0, 1.6, 0.0], Some(hips));
    bench.run(Operation::Labels(vec![(leg[0], "thigh.L.001".into())]));
    bench.run(Operation::Group { joints: vec![leg[1]], name: "Left leg".into(), color: None });
    bench.run(Operation::Group { joints: vec![leg[2]], name: "feet".into(), color: None });
    bench.run(Operation::Lock(vec![leg[2]], true));
    bench.run(Operation::Mirror { joints: vec![hips] });
    assert_eq!(bench.rig.len(), 8);
    assert_eq!(bench.at(hips).x, 0.0);
    let other: Vec<Uid> = leg.iter().map(|joint| partner(&bench, *joint)).collect();
    assert_eq!(bench.rig.joint(other[0]).unwrap().parent, Some(hips));
    assert_eq!(label(&bench, other[0]).as_deref(), Some("thigh.R.001"));
    assert!(bench.rig.joint(other[2]).unwrap().data.locked);
    let group = |joint: Uid| bench.rig.group(bench.rig.joint(joint).unwrap().data.group.unwrap()).unwrap().name.clone();
    assert_eq!((group(other[1]), group(other[2])), ("Right leg".to_owned(), "feet".to_owned()));

    // Changed on one side only, and both sides below the hips already: the first of each pair is the source.
    bench.run(Operation::Move { to: vec![(leg[1], Vec3::new(0.2, 0.6, 0.0))], with_children: false });
    bench.run(Operation::Lock(vec![leg[2]], false));
    bench.run(Operation::Reparent { joints: vec![leg[2]], parent: Some(leg[0]) });
    bench.run(Operation::Mirror { joints: vec![hips] });
    assert_eq!(bench.rig.len(), 8, "nothing is doubled");
    assert_at(&bench, other[1], [-0.2, 0.6, 0.0]);
    assert_at(&bench, leg[1], [0.2, 0.6, 0.0]);
    assert!(!bench.rig.joint(other[2]).unwrap().data.locked);
    assert_eq!(bench.rig.joint(other[2]).unwrap().parent, Some(other[0]));
    // And the other way round when the right is chosen.
    bench.run(Operation::Move { to: vec![(other[0], Vec3::new(-0.15, 0.95, 0.0))], with_children: false });
    bench.run(Operation::Mirror { joints: vec![other[0]] });
    assert_at(&bench, leg[0], [0.15, 0.95, 0.0]);
}

#[test]
fn both_sides_of_a_skeleton_without_pairs_are_paired_not_doubled() {
    let mut bench = Bench::new();
    let hips = bench.place([0.0, 1.0, 0.0], None);
    let left = bench.chain(&[[0.1, 0.9, 0.0], [0.1, 0.5, 0.0]], Some(hips));
    let right = bench.chain(&[[-0.101, 0.9, 0.0], [-0.1, 0.501, 0.0]], Some(hips));
    bench.run(Operation::Mirror { joints: vec![hips] });
    assert_eq!(bench.rig.len(), 5);
    assert_eq!((partner(&bench, left[0]), partner(&bench, left[1])), (right[0], right[1]));
    assert_at(&bench, right[0], [-0.1, 0.9, 0.0]);
}

#[test]
fn what_runs_along_the_plane_belongs_to_it_as_a_whole() {
    // Of two units: joints within 0.02 are on the plane, a line of the middle may stray to 0.1.
    let plane = MirrorPlane::sagittal(2.0);
    let check = |what: &str, places: &[[f32; 3]], on_plane: &[bool]| {
        let places: Vec<Vec3> = places.iter().map(|place| Vec3::from(*place)).collect();
        let settled = settle(&places, Some(&plane));
        let found: Vec<bool> = settled.iter().map(|(place, _)| place.x == 0.0).collect();
        assert_eq!(found, on_plane, "{what}: {settled:?}");
        for (before, (after, other)) in places.iter().zip(&settled) {
            assert!(before.yz() == after.yz() && (after.x == 0.0 || after.x == before.x), "{what}");
            assert_eq!(*other, (after.x != 0.0).then_some(*after * FLIP), "{what}");
        }
    };
    check("a spine", &[[0.05, 1.0, 0.0], [-0.06, 1.3, 0.1], [0.04, 1.7, 0.0]], &[true; 3]);
    check("a leg", &[[0.09, 1.0, 0.0], [0.08, 0.5, 0.0], [0.07, 0.1, 0.0]], &[false; 3]);
    check("a clavicle", &[[0.03, 1.4, 0.0], [0.15, 1.45, 0.0]], &[true, false]);
    check("an arm", &[[0.15, 1.4, 0.0], [0.4, 1.2, 0.0]], &[false; 2]);
    check("an eye", &[[0.03, 1.7, 0.1], [0.03, 1.7, 0.13]], &[false; 2]);
    check("one joint near the plane", &[[0.015, 1.0, 0.0]], &[true]);
    check("one joint beside it", &[[0.03, 1.0, 0.0]], &[false]);
    check("nothing", &[], &[]);
}

#[test]
fn any_plane_will_do() {
    let normal = Vec3::new(1.0, 2.0, -0.5).normalize();
    let plane = MirrorPlane { point: Vec3::new(0.3, -0.2, 1.0), normal, tolerance: 0.01 };
    for point in [Vec3::ZERO, Vec3::new(4.0, -3.0, 2.0)] {
        assert!(plane.distance(plane.onto(point)).abs() < 1e-5);
        assert!((plane.distance(point) + plane.distance(plane.mirrored(point))).abs() < 1e-5);
        assert!(plane.mirrored(plane.mirrored(point)).distance(point) < 1e-5);
    }
}
