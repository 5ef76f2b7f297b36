//! Bones of skeletons by names, by shape, and by maps that complete them.

use bevy::math::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    rig::{
        animation::{
            humanoid::{BodySide, HumanBone, LimbBone},
            joint_map::{FoundBy, JointMap, JointMapError},
            motion::{Motion, MotionChannel, MotionJoint},
        },
        format::bvh::read_bvh,
    },
};

use super::shipped;

/// Joints of a figure whose arms are stretched out, in centimetres from the parents.
const JOINTS: [(Option<usize>, [f32; 3]); 22] = [
    (None, [0.0, 95.0, 0.0]),
    (Some(0), [0.0, 10.0, 0.0]),
    (Some(1), [0.0, 12.0, 0.0]),
    (Some(2), [0.0, 12.0, 0.0]),
    (Some(3), [0.0, 15.0, 0.0]),
    (Some(4), [0.0, 10.0, 2.0]),
    (Some(3), [3.0, 10.0, 0.0]),
    (Some(6), [14.0, 0.0, 0.0]),
    (Some(7), [28.0, 0.0, 0.0]),
    (Some(8), [25.0, 0.0, 0.0]),
    (Some(3), [-3.0, 10.0, 0.0]),
    (Some(10), [-14.0, 0.0, 0.0]),
    (Some(11), [-28.0, 0.0, 0.0]),
    (Some(12), [-25.0, 0.0, 0.0]),
    (Some(0), [9.0, -4.0, 0.0]),
    (Some(14), [0.0, -42.0, 1.0]),
    (Some(15), [0.0, -40.0, -1.0]),
    (Some(16), [0.0, -6.0, 12.0]),
    (Some(0), [-9.0, -4.0, 0.0]),
    (Some(18), [0.0, -42.0, 1.0]),
    (Some(19), [0.0, -40.0, -1.0]),
    (Some(20), [0.0, -6.0, 12.0]),
];

/// Bones of that figure with their joints.
fn bones() -> Vec<(HumanBone, usize)> {
    let mut bones = vec![(HumanBone::Hips, 0), (HumanBone::Neck, 4), (HumanBone::Head, 5)];
    for (side, arm, leg) in [(BodySide::Left, 6, 14), (BodySide::Right, 10, 18)] {
        let of_arm = [LimbBone::Shoulder, LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand];
        let of_leg = [LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot, LimbBone::Toes];
        for at in 0..4 {
            bones.push((HumanBone::Limb(side, of_arm[at]), arm + at));
            bones.push((HumanBone::Limb(side, of_leg[at]), leg + at));
        }
    }
    bones
}

/// The figure with these names; its last joints have ends, as in a BVH, or a joint more, as in a glTF.
fn figure(names: &[String], has_ends: bool) -> Motion {
    let joint = |(at, (parent, place)): (usize, &(Option<usize>, [f32; 3]))| MotionJoint {
        name: names[at].clone(),
        parent: *parent,
        rest: Trs { translation: Vec3::from_array(*place), rotation: Quat::IDENTITY, scale: Vec3::ONE },
        channels: (0..4).map(MotionChannel::Turn).collect(),
        ends: Vec::new(),
    };
    let mut joints: Vec<MotionJoint> = JOINTS.iter().enumerate().map(joint).collect();
    if has_ends {
        for at in [5, 9, 13, 17, 21] {
            joints[at].ends.push(Vec3::new(0.0, 0.0, 6.0));
        }
    } else {
        let rest = Trs { translation: Vec3::Y * 18.0, rotation: Quat::IDENTITY, scale: Vec3::ONE };
        joints.push(MotionJoint { name: "x".into(), parent: Some(5), rest, ..MotionJoint::default() });
    }
    let values = JOINTS.iter().flat_map(|_| Quat::IDENTITY.to_array()).collect();
    Motion { name: "figure".into(), joints, frame_time: 0.1, values, ..Motion::default() }
}

fn check(motion: &Motion, found_by: FoundBy, what: &str) {
    let map = JointMap::new(motion, &shipped("biped"), &[]).unwrap();
    assert_eq!(map.found_by, found_by, "{what}");
    for (bone, joint) in bones() {
        assert_eq!(map.source.get(&bone).map(|joints| &joints[..]), Some(&[joint][..]), "{what}: {bone}");
    }
    assert_eq!(map.source[&HumanBone::Spine], [1, 2, 3], "{what}");
}

#[test]
fn bones_of_old_and_of_nameless_files_are_found() {
    let sided = |body: [&str; 6], arm: [&str; 4], leg: [&str; 4], sides: [&str; 2]| -> Vec<String> {
        let mut names = body.map(str::to_owned).to_vec();
        for of in [arm, leg] {
            names.extend(sides.iter().flat_map(|side| of.map(|word| format!("{side}{word}"))));
        }
        names
    };
    let old = sided(
        ["Hips", "Chest", "Chest2", "Chest3", "Neck", "Head"],
        ["Collar", "Shoulder", "Elbow", "Wrist"],
        ["Hip", "Knee", "Ankle", "Toe"],
        ["Left", "Right"],
    );
    let asf = sided(
        ["root", "lowerback", "upperback", "thorax", "lowerneck", "head"],
        ["clavicle", "humerus", "radius", "wrist"],
        ["femur", "tibia", "foot", "toes"],
        ["l", "r"],
    );
    let motive = sided(
        ["Hip", "Ab", "Chest", "Chest2", "Neck", "Head"],
        ["Shoulder", "UArm", "FArm", "Hand"],
        ["Thigh", "Shin", "Foot", "Toe"],
        ["L", "R"],
    );
    // The foot of SMPL is the ball, and its ankle carries it.
    let smpl = |prefix: &str| {
        let body = ["Pelvis", "Spine1", "Spine2", "Spine3", "Neck", "Head"];
        let names =
            sided(body, ["Collar", "Shoulder", "Elbow", "Wrist"], ["Hip", "Knee", "Ankle", "Foot"], ["L_", "R_"]);
        names.iter().map(|name| format!("{prefix}{name}")).collect::<Vec<String>>()
    };
    let nameless: Vec<String> = (0..JOINTS.len()).map(|at| format!("b{at}")).collect();
    check(&figure(&old, true), FoundBy::Names, "old names");
    check(&figure(&asf, true), FoundBy::Names, "names of ASF");
    check(&figure(&motive, true), FoundBy::Names, "names of Motive");
    check(&figure(&smpl(""), true), FoundBy::Names, "names of SMPL");
    check(&figure(&smpl("m_avg_"), true), FoundBy::Names, "names of SMPL in its FBX files");
    // The last joint is the head if a bone begins there, else the one before, whose bone is as long as a head.
    check(&figure(&nameless, true), FoundBy::Shape, "a shape with ends");
    check(&figure(&nameless, false), FoundBy::Shape, "a shape with a joint above the head");
}

/// Skeletons of Character Creator and Daz have their legs on a joint beside the spine.
#[test]
fn legs_on_a_joint_beside_the_spine_are_found_by_shape() {
    const HUB: usize = 14;
    let names: Vec<String> = (0..JOINTS.len()).map(|at| format!("b{at}")).collect();
    let mut motion = figure(&names, true);
    let shifted = |joint: usize| if joint < HUB { joint } else { joint + 1 };
    for (at, joint) in motion.joints.iter_mut().enumerate() {
        let is_thigh = at == 14 || at == 18;
        joint.parent = if is_thigh { Some(HUB) } else { joint.parent.map(shifted) };
    }
    let hub = MotionJoint { name: "hub".into(), parent: Some(0), rest: Trs::IDENTITY, ..MotionJoint::default() };
    motion.joints.insert(HUB, hub);
    let map = JointMap::new(&motion, &shipped("biped"), &[]).unwrap();
    assert_eq!(map.found_by, FoundBy::Shape);
    for (bone, joint) in bones() {
        let joint = if bone == HumanBone::Hips { HUB } else { shifted(joint) };
        assert_eq!(map.source.get(&bone).map(|joints| &joints[..]), Some(&[joint][..]), "{bone}");
    }
    assert_eq!(map.source[&HumanBone::Spine], [1, 2, 3]);
}

/// Web sites number the nodes of a file, and scenes of several rigs number those.
#[test]
fn numbers_of_nodes_and_of_rigs_are_passed_over() {
    let plain = "Hips Spine Spine1 Spine2 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm \
                 RightForeArm RightHand LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase";
    let check = |what: &str, name: fn(usize, &str) -> String| {
        let names: Vec<String> = plain.split_whitespace().zip(1..).map(|(joint, at)| name(at, joint)).collect();
        assert_eq!(names.len(), JOINTS.len());
        check(&figure(&names, true), FoundBy::Names, what);
    };
    check("Mixamo", |_, joint| format!("mixamorig:{joint}"));
    check("a numbered rig", |_, joint| format!("mixamorig9{joint}"));
    check("numbered nodes", |at, joint| format!("{joint}_{at:02}"));
    check("numbered nodes of Mixamo", |at, joint| format!("mixamorig:{joint}_{:03}", 10 * at));
}

#[test]
fn a_map_completes_names_that_say_too_little() {
    let text = include_str!("walker.bvh");
    let read = |text: &str| read_bvh(text.as_bytes(), "walker").unwrap();
    let (rig, plain, odd) = (shipped("biped"), read(text), read(&text.replace("RightUpLeg", "Right:UpLeg")));
    assert_eq!(JointMap::new(&odd, &rig, &[]), Err(JointMapError::Nothing));
    let given = [("Right:UpLeg".to_owned(), "thigh_r".to_owned())];
    let map = JointMap::new(&odd, &rig, &given).unwrap();
    let wanted = JointMap::new(&plain, &rig, &[]).unwrap();
    assert_eq!((&map.source, &map.target), (&wanted.source, &wanted.target));
    assert_eq!(map.found_by, FoundBy::Map);
}

/// An empty name beside a joint of the motion wins over its guess.
#[test]
fn a_map_lets_joints_move_nothing() {
    let motion = read_bvh(include_bytes!("walker.bvh"), "walker").unwrap();
    let rig = shipped("biped");
    let none = |name: &str| (name.to_owned(), String::new());
    let guessed = JointMap::new(&motion, &rig, &[]).unwrap();
    let map = JointMap::new(&motion, &rig, &[none("LeftLeg")]).unwrap();
    let shin = HumanBone::Limb(BodySide::Left, LimbBone::LowerLeg);
    assert!(guessed.source.contains_key(&shin) && !map.source.contains_key(&shin));
    assert_eq!(map.bones().count() + 1, guessed.bones().count());
    assert!(map.unmapped_source(&motion).contains(&"LeftLeg".to_owned()));
    assert_eq!(map.found_by, FoundBy::Map);
    let all: Vec<(String, String)> = motion.joints.iter().map(|joint| none(&joint.name)).collect();
    assert_eq!(JointMap::new(&motion, &rig, &all), Err(JointMapError::Nothing));
}
