//! The BVH reader: layouts that exporters write, transforms of frames, and errors with their lines.

use bevy::math::Vec3;
use rigsmith::{
    files::{FileKind, RealDisk, load_motion},
    rig::{
        animation::{
            humanoid::{BodySide, Finger, HumanBone, LimbBone, SkeletonJoint, by_names},
            motion::MotionChannel,
        },
        format::bvh::{BvhError, read_bvh},
    },
};

use crate::prerequisites::test_data;

const ARM: &str = "HIERARCHY
ROOT Upper Arm
{
	OFFSET 1 2 3
	CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
	JOINT Fore arm 1
	{
		OFFSET 0 2 0
		CHANNELS 1 Zrotation
		End Site
		{
			OFFSET 0 1 0
		}
	}
}
MOTION
Frames: 2
Frame Time: 0.5
1 2 3 0 0 0 0
5 0 0 90 90 0 90
";

#[test]
fn a_skeleton_moves_as_its_channels_say() {
    let motion = read_bvh(ARM.as_bytes(), "arm").unwrap();
    assert_eq!((motion.frames(), motion.width(), motion.duration()), (2, 7, 0.5));
    assert_eq!(motion.joints[0].name, "Upper Arm");
    assert_eq!(motion.joints[1].name, "Fore arm 1");
    assert_eq!(motion.joints[1].ends, [Vec3::Y]);
    assert_eq!(motion.joints[0].channels[3], MotionChannel::Rotation(2));
    assert_eq!(motion.rest_globals()[1].translation, Vec3::new(1.0, 4.0, 3.0));
    assert_eq!(motion.globals(0)[1].translation, Vec3::new(1.0, 4.0, 3.0));
    // The last rotation is that of the turned axes: about X first, then about Z.
    let globals = motion.globals(1);
    assert!(globals[1].translation.distance(Vec3::new(5.0, 0.0, 2.0)) < 1e-5, "{:?}", globals[1]);
    let tip = globals[1].transform_point(Vec3::Y);
    assert!(tip.distance(Vec3::new(5.0, -1.0, 2.0)) < 1e-5, "{tip}");
    let middle = motion.globals_at(0.25)[0];
    assert!(middle.translation.distance(Vec3::new(3.0, 1.0, 1.5)) < 1e-5);
    assert!(motion.notes.is_empty());
}

#[test]
fn layouts_of_other_exporters_give_the_same() {
    let expected = read_bvh(ARM.as_bytes(), "arm").unwrap();
    let layouts = [
        ARM.replace('\n', "\r\n"),
        ARM.replace('\n', "\r"),
        format!("\u{FEFF}{ARM}"),
        ARM.replace("Arm\n{", "Arm {").replace("1\n\t{", "1 {"),
        ARM.replace("HIERARCHY", "hierarchy").replace("Zrotation", "zROTATION"),
        ARM.replace("Frames: 2", "Frames:\t2").replace("Frame Time: 0.5", "Frame Time:\t.5"),
        ARM.replace("1 2 3 0 0", "\n\n  1\t2  3 0 0"),
        ARM.trim_end().to_owned(),
    ];
    for text in layouts {
        assert_eq!(read_bvh(text.as_bytes(), "arm").as_ref(), Ok(&expected), "{text}");
    }
}

#[test]
fn errors_say_where_and_what_to_do() {
    let check = |from: &str, to: &str, line: usize, told: &str| {
        let text = ARM.replacen(from, to, 1);
        let error = read_bvh(text.as_bytes(), "arm").unwrap_err();
        assert_eq!(error.line(), line, "{error}");
        assert!(error.to_string().contains(told), "{error}");
    };
    check("HIERARCHY", "hello", 1, "`hello`");
    check("OFFSET 1 2 3", "OFFSET 1 2 x", 4, "`x` is no number");
    check("OFFSET 1 2 3", "OFFSET 1 2 inf", 4, "`inf` is no number");
    check("\t\tOFFSET 0 2 0\n", "", 13, "without an OFFSET");
    check("Yrotation", "Wrotation", 5, "`Wrotation` is no channel");
    check("CHANNELS 6", "CHANNELS 600", 5, "0 to 12");
    check("Frames: 2", "Frame 2", 17, "`Frames:`");
    check("Time: 0.5", "Time: 0", 18, "above zero");
    check("5 0 0 90", "5 0 nan 90", 20, "`nan` is no number");
    check("5 0 0 90 90 0 90", "5 0 0 90", 20, "has 4 values, and the joints have 7");
    check("MOTION", "}", 16, "`}`");
    let cut = &ARM[..ARM.find("CHANNELS").unwrap()];
    assert!(matches!(read_bvh(cut.as_bytes(), "arm"), Err(BvhError::CutOff { line: 5, .. })));
    assert_eq!(read_bvh(b"\xFF\xFEH\0", "arm"), Err(BvhError::Utf16));

    let less = read_bvh(ARM.replace("Frames: 2", "Frames: 3").as_bytes(), "arm").unwrap();
    assert_eq!((less.frames(), less.notes.len()), (2, 1));
    assert!(less.notes[0].contains("line 17") && less.notes[0].contains("3 frames"), "{:?}", less.notes);
}

/// A chain of joints deeper than any stack of calls would be.
#[test]
fn a_deep_skeleton_is_read() {
    let depth = 15_000;
    let mut text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n".to_owned();
    (0..depth).for_each(|_| text.push_str("JOINT a\n{\nOFFSET 0 1 0\n"));
    text.push_str(&"}\n".repeat(depth + 1));
    text.push_str("MOTION\nFrames: 0\nFrame Time: 1\n");
    assert_eq!(read_bvh(text.as_bytes(), "deep").unwrap().joints.len(), depth + 1);
    let more = text.replacen("ROOT", &"ROOT a { OFFSET 0 0 0 }\n".repeat(6_000), 1);
    let error = read_bvh(more.replacen("}\n a", "}\nROOT a", 1).as_bytes(), "deep").unwrap_err();
    assert!(matches!(error, BvhError::TooManyJoints { .. }), "{error}");
}

/// Frames over several blocks have the values of their lines, and an error in the last block its line.
#[test]
fn a_long_file_keeps_the_order_of_its_frames() {
    let (head, _) = ARM.split_at(ARM.find("1 2 3 0 0").unwrap());
    let count = 100_000;
    let mut text = head.replace("Frames: 2", &format!("Frames: {count}"));
    (0..count).for_each(|frame| text.push_str(&format!("{frame} 2 3 0 0 0 {}\r\n", frame % 360)));
    let motion = read_bvh(text.as_bytes(), "long").unwrap();
    assert_eq!(motion.frames(), count);
    assert!((0..count).all(|frame| motion.values[frame * 7] == frame as f32));
    text.push_str("1 2");
    assert_eq!(read_bvh(text.as_bytes(), "long").unwrap_err().line(), 19 + count);
}

#[test]
fn all_files_of_the_data_folder_load() {
    let Some(data) = test_data() else { return };
    let wanted = [
        ("cmu_01_01", 31, 2752),
        ("makehuman_dance1", 75, 1),
        ("makehuman_tpose", 173, 1),
        ("makehuman_walk1", 75, 14),
    ];
    for (name, joints, frames) in wanted {
        let path = data.join("bvh").join(format!("{name}.bvh"));
        assert_eq!(FileKind::of(&path), Some(FileKind::Bvh));
        let motion = load_motion(&RealDisk, &path).unwrap();
        assert_eq!(motion.name, name);
        println!("{name}: {} joints, {} frames, {:?}", motion.joints.len(), motion.frames(), motion.notes);
        assert_eq!((motion.joints.len(), motion.frames()), (joints, frames), "{name}");
        let spread = motion.globals(frames - 1).iter().map(|at| at.translation.length()).fold(0.0, f32::max);
        assert!(spread.is_finite() && spread > 0.0);
    }
}

/// Skeletons of the kinds that people have, by the names of their joints alone.
#[test]
fn bones_are_found_by_the_names_of_many_programs() {
    let skeletons: [(&str, [&str; 13]); 11] = [
        (
            "Mixamo",
            [
                "mixamorig:Hips",
                "mixamorig:Spine",
                "mixamorig:Head",
                "mixamorig:LeftShoulder",
                "mixamorig:LeftArm",
                "mixamorig:LeftForeArm",
                "mixamorig:LeftHand",
                "mixamorig:LeftUpLeg",
                "mixamorig:LeftLeg",
                "mixamorig:LeftFoot",
                "mixamorig:LeftToeBase",
                "mixamorig:LeftHandIndex1",
                "mixamorig:RightHandThumb3",
            ],
        ),
        (
            "Unreal",
            [
                "pelvis",
                "spine_01",
                "head",
                "clavicle_l",
                "upperarm_l",
                "lowerarm_l",
                "hand_l",
                "thigh_l",
                "calf_l",
                "foot_l",
                "ball_l",
                "index_01_l",
                "thumb_03_r",
            ],
        ),
        (
            "VRoid",
            [
                "J_Bip_C_Hips",
                "J_Bip_C_Spine",
                "J_Bip_C_Head",
                "J_Bip_L_Shoulder",
                "J_Bip_L_UpperArm",
                "J_Bip_L_LowerArm",
                "J_Bip_L_Hand",
                "J_Bip_L_UpperLeg",
                "J_Bip_L_LowerLeg",
                "J_Bip_L_Foot",
                "J_Bip_L_ToeBase",
                "J_Bip_L_Index1",
                "J_Bip_R_Thumb3",
            ],
        ),
        (
            "VRM",
            [
                "hips",
                "spine",
                "head",
                "leftShoulder",
                "leftUpperArm",
                "leftLowerArm",
                "leftHand",
                "leftUpperLeg",
                "leftLowerLeg",
                "leftFoot",
                "leftToes",
                "leftIndexProximal",
                "rightThumbDistal",
            ],
        ),
        (
            "CMU",
            [
                "Hips",
                "Spine",
                "Head",
                "LeftShoulder",
                "LeftArm",
                "LeftForeArm",
                "LeftHand",
                "LeftUpLeg",
                "LeftLeg",
                "LeftFoot",
                "LeftToeBase",
                "LeftHandIndex1",
                "RightHandThumb3",
            ],
        ),
        (
            "MakeHuman",
            [
                "Root",
                "Spine1",
                "Head",
                "Clavicle_L",
                "UpArm_L",
                "LoArm_L",
                "Hand_L",
                "UpLeg_L",
                "LoLeg_L",
                "Foot_L",
                "Toe_L",
                "Index1_L",
                "Thumb3_R",
            ],
        ),
        (
            "MakeHuman default",
            [
                "root",
                "spine05",
                "head",
                "clavicle.L",
                "upperarm01.L",
                "lowerarm01.L",
                "wrist.L",
                "upperleg01.L",
                "lowerleg01.L",
                "foot.L",
                "toes.L",
                "finger2-1.L",
                "finger1-3.R",
            ],
        ),
        (
            "Rigify",
            [
                "DEF-hips",
                "DEF-spine",
                "DEF-head",
                "DEF-shoulder.L",
                "DEF-upper_arm.L",
                "DEF-forearm.L",
                "DEF-hand.L",
                "DEF-thigh.L",
                "DEF-shin.L",
                "DEF-foot.L",
                "DEF-toe.L",
                "DEF-f_index.01.L",
                "DEF-thumb.03.R",
            ],
        ),
        (
            "Rigify, numbered",
            [
                "DEF-spine",
                "DEF-spine.003",
                "DEF-spine.006",
                "DEF-shoulder.L",
                "DEF-upper_arm.L",
                "DEF-forearm.L",
                "DEF-hand.L",
                "DEF-thigh.L",
                "DEF-shin.L",
                "DEF-foot.L",
                "DEF-toe.L",
                "DEF-f_index.01.L",
                "DEF-thumb.03.R",
            ],
        ),
        (
            "MakeHuman, with toes",
            [
                "root",
                "spine01",
                "head",
                "clavicle.L",
                "upperarm01.L",
                "lowerarm01.L",
                "wrist.L",
                "upperleg01.L",
                "lowerleg01.L",
                "foot.L",
                "toe2-1.L",
                "finger2-1.L",
                "finger1-3.R",
            ],
        ),
        (
            "own",
            [
                "hips",
                "spine",
                "head",
                "clavicle_l",
                "upper_arm_l",
                "forearm_l",
                "hand_l",
                "thigh_l",
                "shin_l",
                "foot_l",
                "toe_l",
                "index_01_l",
                "thumb_03_r",
            ],
        ),
    ];
    let left = |bone| HumanBone::Limb(BodySide::Left, bone);
    let bones = [
        HumanBone::Hips,
        HumanBone::Spine,
        HumanBone::Head,
        left(LimbBone::Shoulder),
        left(LimbBone::UpperArm),
        left(LimbBone::LowerArm),
        left(LimbBone::Hand),
        left(LimbBone::UpperLeg),
        left(LimbBone::LowerLeg),
        left(LimbBone::Foot),
        left(LimbBone::Toes),
        HumanBone::Finger(BodySide::Left, Finger::Index, 1),
        HumanBone::Finger(BodySide::Right, Finger::Thumb, 3),
    ];
    // Parents of the joints in that order, then the right arm's and leg's joints.
    let parents =
        [None, Some(0), Some(1), Some(1), Some(3), Some(4), Some(5), Some(0), Some(7), Some(8), Some(9), Some(6)];
    for (kind, names) in skeletons {
        let mut joints: Vec<SkeletonJoint> = parents
            .iter()
            .zip(names)
            .map(|(parent, name)| SkeletonJoint { name: name.into(), parent: *parent, ..SkeletonJoint::default() })
            .collect();
        let right = |name: &str| {
            let pairs =
                [("Left", "Right"), ("left", "right"), ("_L_", "_R_"), ("_L", "_R"), ("_l", "_r"), (".L", ".R")];
            pairs
                .iter()
                .find(|(from, _)| name.contains(from))
                .map_or(name.to_owned(), |(from, to)| name.replace(from, to))
        };
        for at in 3..11 {
            let parent = parents[at].unwrap();
            let parent = if parent < 3 { parent } else { parent + 9 };
            joints.push(SkeletonJoint { name: right(names[at]), parent: Some(parent), ..SkeletonJoint::default() });
        }
        joints.push(SkeletonJoint { name: names[12].into(), parent: Some(15), ..SkeletonJoint::default() });
        let found = by_names(&joints);
        for (at, bone) in bones.iter().enumerate() {
            let expected = if at == 12 { joints.len() - 1 } else { at };
            let of = found.get(bone);
            assert!(
                of.is_some_and(|of| of.contains(&expected)),
                "{kind}: {bone} is {of:?}, not {}",
                joints[expected].name
            );
        }
        let wrist = HumanBone::Limb(BodySide::Right, LimbBone::Hand);
        assert_eq!(found[&wrist], [15], "{kind}");
    }
    assert!(by_names(&[SkeletonJoint::default()]).is_empty());
    for bone in HumanBone::all() {
        assert_eq!(bone.to_string().parse(), Ok(bone));
    }
}

/// A human whose left arm has no names.
#[test]
fn an_arm_without_names_is_found_by_its_chain() {
    let joints = |hair: f32| -> Vec<SkeletonJoint> {
        let mut list: Vec<SkeletonJoint> = Vec::new();
        let mut add = |name: &str, parent: Option<usize>, [x, y, z]: [f32; 3]| {
            let position = bevy::math::Vec3::new(x, y, z);
            list.push(SkeletonJoint { name: name.into(), parent, position, ..SkeletonJoint::default() });
            list.len() - 1
        };
        let hips = add("Hips", None, [0.0, 1.0, 0.0]);
        let chest = add("Spine", Some(hips), [0.0, 1.4, 0.0]);
        let head = add("Head", Some(chest), [0.0, 1.6, 0.0]);
        add("", Some(head), [0.0, 1.8, 0.0]);
        // Hair hangs on the left, too.
        let lock = add("", Some(chest), [0.05, 1.5, -0.1]);
        let lock = add("", Some(lock), [0.05, 1.5 - hair, -0.1]);
        add("", Some(lock), [0.05, 1.5 - 2.0 * hair, -0.1]);
        for (side, sign) in [("Left", 1.0), ("Right", -1.0)] {
            let mut at = hips;
            for (name, place) in [("UpLeg", [0.1, 0.95, 0.0]), ("Leg", [0.1, 0.5, 0.0]), ("Foot", [0.1, 0.1, 0.0])] {
                at = add(&format!("{side}{name}"), Some(at), [sign * place[0], place[1], place[2]]);
            }
            let mut at = chest;
            for (name, along) in [("Shoulder", 0.05), ("Arm", 0.2), ("ForeArm", 0.5), ("Hand", 0.75)] {
                let name = if side == "Left" { String::new() } else { format!("{side}{name}") };
                at = add(&name, Some(at), [sign * along, 1.4, 0.0]);
            }
        }
        list
    };
    let arm = [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand];
    let check = |list: &[SkeletonJoint]| {
        let found = by_names(list);
        for (bone, along) in arm.into_iter().zip([0.2, 0.5, 0.75]) {
            let joints = &found[&HumanBone::Limb(BodySide::Left, bone)];
            assert_eq!(list[joints[0]].position.x, along, "{bone:?}: {joints:?}");
            assert!(list[found[&HumanBone::Limb(BodySide::Right, bone)][0]].position.x < 0.0);
        }
    };
    check(&joints(0.05));
    // Without either arm's names, the leg tells how long an arm is.
    let mut nameless = joints(0.05);
    nameless.iter_mut().filter(|joint| joint.position.x < -0.1).for_each(|joint| joint.name.clear());
    nameless.iter_mut().filter(|joint| joint.name == "RightShoulder").for_each(|joint| joint.name.clear());
    check(&nameless);
    // A chain of another length is no arm.
    let mut short = joints(0.05);
    short.iter_mut().filter(|joint| joint.position.x > 0.15).for_each(|joint| joint.position.x = 0.15);
    assert!(!by_names(&short).contains_key(&HumanBone::Limb(BodySide::Left, LimbBone::UpperArm)));
}
