//! Meshes whose joints are known, with the places where a fitted template's joints should be.

use std::{error::Error, path::Path};

use glam::Vec3;
use rigsmith::{
    algo::fit_template::TemplateJoint,
    files::{RealDisk, load_model},
    mesh::model::Model,
    rig::Rig,
};

/// Mesh: file, template, and pairs of template label and name of the joint that is in its place. `@` stands for a side, as the
/// file writes it.
struct MeshWithJoints {
    file: &'static str,
    template: &'static str,
    joints: &'static [(&'static str, &'static str)],
    sides: [&'static str; 2],
}

const BODIES: [&str; 7] = [
    "baby",
    "female_heavy_tpose",
    "female_young",
    "female_young_armsdown",
    "male_muscular_action",
    "male_young",
    "male_child_tpose",
];

/// Labels of the biped's joints and the bones of the bodies' `game_engine` rig.
pub const HUMAN: &[(&str, &str)] = &[
    ("hips", "pelvis"),
    ("spine", "spine_01"),
    ("spine_1", "spine_02"),
    ("chest", "spine_03"),
    ("neck", "neck_01"),
    ("head", "head"),
    ("clavicle_@", "clavicle_@"),
    ("upper_arm_@", "upperarm_@"),
    ("forearm_@", "lowerarm_@"),
    ("hand_@", "hand_@"),
    ("thigh_@", "thigh_@"),
    ("shin_@", "calf_@"),
    ("foot_@", "foot_@"),
    ("toe_@", "ball_@"),
    ("thumb_01_@", "thumb_01_@"),
    ("thumb_02_@", "thumb_02_@"),
    ("thumb_03_@", "thumb_03_@"),
    ("index_01_@", "index_01_@"),
    ("index_02_@", "index_02_@"),
    ("index_03_@", "index_03_@"),
    ("middle_01_@", "middle_01_@"),
    ("middle_02_@", "middle_02_@"),
    ("middle_03_@", "middle_03_@"),
    ("ring_01_@", "ring_01_@"),
    ("ring_02_@", "ring_02_@"),
    ("ring_03_@", "ring_03_@"),
    ("pinky_01_@", "pinky_01_@"),
    ("pinky_02_@", "pinky_02_@"),
    ("pinky_03_@", "pinky_03_@"),
];

const LEGS_OF_FOXES: &[(&str, &str)] = &[
    ("hips", "Hips"),
    ("spine_1", "Spine_1"),
    ("spine_2", "Spine_2"),
    ("chest", "Spine_2.001"),
    ("neck", "Spine_3"),
    ("head", "Head"),
    ("upper_arm_@", "Front_Leg_Upper_@"),
    ("forearm_@", "Front_Leg_Lower_@"),
    ("carpus_@", "Front_Leg_Ankle_@"),
    ("paw_@", "Front_Leg_Foot_@"),
    ("thigh_@", "Back_Leg_Upper_@"),
    ("shin_@", "Back_Leg_Lower_@"),
    ("metatarsus_@", "Back_Leg_Ankle_@"),
    ("foot_@", "Back_Leg_Foot_@"),
    ("tail_1", "Tail_Base"),
    ("tail_6", "Tail_Tip"),
];

const OTHERS: [MeshWithJoints; 6] = [
    MeshWithJoints {
        file: "gltf_skinned/CesiumMan.glb",
        template: "biped",
        joints: &[
            ("hips", "Skeleton_torso_joint_1"),
            ("chest", "torso_joint_3"),
            ("neck", "Skeleton_neck_joint_1"),
            ("head", "Skeleton_neck_joint_2"),
            ("upper_arm_l", "Skeleton_arm_joint_L__4_"),
            ("forearm_l", "Skeleton_arm_joint_L__3_"),
            ("hand_l", "Skeleton_arm_joint_L__2_"),
            ("upper_arm_r", "Skeleton_arm_joint_R"),
            ("forearm_r", "Skeleton_arm_joint_R__2_"),
            ("hand_r", "Skeleton_arm_joint_R__3_"),
            ("thigh_@", "leg_joint_@_1"),
            ("shin_@", "leg_joint_@_2"),
            ("foot_@", "leg_joint_@_3"),
            ("toe_@", "leg_joint_@_5"),
        ],
        sides: ["L", "R"],
    },
    MeshWithJoints {
        file: "gltf_skinned/RobotExpressive.glb",
        template: "biped",
        joints: &[
            ("hips", "Hips"),
            ("chest", "Torso"),
            ("neck", "Neck"),
            ("head", "Head"),
            ("upper_arm_@", "UpperArm.@"),
            ("forearm_@", "LowerArm.@"),
            ("hand_@", "Palm2.@"),
            ("thigh_@", "UpperLeg.@"),
            ("shin_@", "LowerLeg.@"),
            ("foot_@", "Foot.@"),
        ],
        sides: ["L", "R"],
    },
    MeshWithJoints {
        file: "characters/Mage.glb",
        template: "biped",
        joints: &[
            ("hips", "hips"),
            ("spine", "spine"),
            ("chest", "chest"),
            ("head", "head"),
            ("upper_arm_@", "upperarm.@"),
            ("forearm_@", "lowerarm.@"),
            ("hand_@", "wrist.@"),
            ("thigh_@", "upperleg.@"),
            ("shin_@", "lowerleg.@"),
            ("foot_@", "foot.@"),
            ("toe_@", "toes.@"),
        ],
        sides: ["l", "r"],
    },
    MeshWithJoints { file: "creatures/fox-fox.glb", template: "quadruped", joints: LEGS_OF_FOXES, sides: ["L", "R"] },
    MeshWithJoints { file: "creatures/fox-dog.glb", template: "quadruped", joints: LEGS_OF_FOXES, sides: ["L", "R"] },
    MeshWithJoints {
        file: "creatures/bird-eagle.glb",
        template: "bird",
        joints: &[
            ("hips", "hips"),
            ("chest", "spine_1"),
            ("head", "head"),
            ("wing_1_@", "wing_1_@"),
            ("wing_2_@", "wing_2_@"),
            ("wing_3_@", "wing_3_@"),
            ("thigh_@", "UpperLeg_@"),
            ("shin_@", "LowerLeg_@"),
            ("metatarsus_@", "AnkleLeg_@"),
            ("foot_@", "Foot_@"),
            ("tail", "tail_1"),
        ],
        sides: ["L", "R"],
    },
];

/// Creature that no bound and no constant of the fit was chosen on.
const HELD_BACK: MeshWithJoints = MeshWithJoints {
    file: "gltf_skinned/Fox.glb",
    template: "quadruped",
    joints: &[
        ("hips", "b_Hip_01"),
        ("spine_1", "b_Spine01_02"),
        ("chest", "b_Spine02_03"),
        ("neck", "b_Neck_04"),
        ("head", "b_Head_05"),
        ("upper_arm_r", "b_RightUpperArm_06"),
        ("forearm_r", "b_RightForeArm_07"),
        ("carpus_r", "b_RightHand_08"),
        ("upper_arm_l", "b_LeftUpperArm_09"),
        ("forearm_l", "b_LeftForeArm_010"),
        ("carpus_l", "b_LeftHand_011"),
        ("tail_1", "b_Tail01_012"),
        ("thigh_l", "b_LeftLeg01_015"),
        ("shin_l", "b_LeftLeg02_016"),
        ("metatarsus_l", "b_LeftFoot01_017"),
        ("foot_l", "b_LeftFoot02_018"),
        ("thigh_r", "b_RightLeg01_019"),
        ("shin_r", "b_RightLeg02_020"),
        ("metatarsus_r", "b_RightFoot01_021"),
        ("foot_r", "b_RightFoot02_022"),
    ],
    sides: ["", ""],
};

/// Mesh with the places of joints that a template should find.
pub struct Figure {
    pub name: String,
    pub points: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    pub template: &'static str,
    pub truth: Vec<(String, Vec3)>,
}

/// All figures of the test data, bodies first.
pub fn figures(data: &Path) -> Result<Vec<Figure>, Box<dyn Error>> {
    let mut figures = Vec::new();
    for body in BODIES {
        let folder = data.join("bodies").join(body);
        let model = load_model(&RealDisk, &folder.join("body.obj"))?;
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("joints.json"))?)?;
        let place = |name: &str| {
            let head: [f32; 3] = serde_json::from_value(json["game_engine"][name]["head"].clone()).ok()?;
            Some(Vec3::from(head))
        };
        figures.push(Figure::new(body, (&model, &[]), "biped", HUMAN, ["l", "r"], &place));
    }
    for known in &OTHERS {
        figures.push(figure(data, known)?);
    }
    Ok(figures)
}

/// The creature that is held back from all tuning.
pub fn held_back(data: &Path) -> Result<Figure, Box<dyn Error>> {
    figure(data, &HELD_BACK)
}

fn figure(data: &Path, known: &MeshWithJoints) -> Result<Figure, Box<dyn Error>> {
    let MeshWithJoints { file, template, joints, sides } = *known;
    let model = load_model(&RealDisk, &data.join(file))?;
    let globals = model.rest_globals();
    let place = |name: &str| {
        let node = model.nodes.iter().position(|node| node.name == name)?;
        Some(globals[node].translation.into())
    };
    // As the app fits: without what hangs on a bone.
    Ok(Figure::new(file, (&model.at_rest(), &model.gear()), template, joints, sides, &place))
}

impl Figure {
    fn new(
        name: &str,
        (model, gear): (&Model, &[usize]),
        template: &'static str,
        joints: &[(&str, &str)],
        sides: [&str; 2],
        place: &dyn Fn(&str) -> Option<Vec3>,
    ) -> Self {
        let mut truth = Vec::new();
        for (label, known) in joints {
            for (own, side) in ["l", "r"].into_iter().zip(sides) {
                let label = label.replace('@', own);
                if let Some(place) = place(&known.replace('@', side))
                    && truth.iter().all(|(other, _)| *other != label)
                {
                    truth.push((label, place));
                }
            }
        }
        let all = model.point_triangles();
        let worn = model.triangles_of(|object| !gear.contains(&object));
        let (points, triangles) = (model.points.clone(), worn.iter().map(|at| all[*at as usize]).collect());
        Self { name: name.to_owned(), points, triangles, template, truth }
    }
}

/// Joints of a rig as a template.
pub fn template_joints(rig: &Rig) -> Vec<TemplateJoint<'_>> {
    let walk: Vec<_> = rig.walk().collect();
    let parent = |uid| walk.iter().position(|joint| Some(joint.data.uid) == uid);
    (walk.iter())
        .map(|joint| TemplateJoint {
            label: joint.data.label.as_deref().unwrap_or_default(),
            parent: parent(joint.parent),
            position: rig.position(joint.data.uid),
        })
        .collect()
}

/// True for joints of fingers.
pub fn is_finger(label: &str) -> bool {
    ["thumb", "index", "middle", "ring", "pinky"].iter().any(|finger| label.starts_with(finger))
}
