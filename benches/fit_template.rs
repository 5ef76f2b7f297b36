//! Errors and times of fitted templates on meshes whose joints are known.
//!
//! ```text
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features -- variants
//! ```
//!
//! Distances are hundredths of the mesh's height: of the joints of the body, of the fingers, and the largest one. `variants`
//! compares the fit of each mesh with those of the mesh turned, scaled, shuffled, decimated, subdivided and damaged.

use std::{error::Error, path::Path, time::Instant};

use glam::{Mat3, Quat, Vec3};
use rigsmith::{
    algo::fit_template::{FitError, FitSettings, FittedSkeleton, MeshAnalysis, TemplateJoint, fit_template},
    files::{RealDisk, bundled_characters, load_model},
    mesh::model::Model,
};

/// Meshes: file, template, and pairs of template label and name of the joint that is in its place. `@` stands for a side, as the
/// file writes it.
struct Known {
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

const HUMAN: &[(&str, &str)] = &[
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

const OTHERS: [Known; 6] = [
    Known {
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
    Known {
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
    Known {
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
    Known { file: "creatures/fox-fox.glb", template: "quadruped", joints: LEGS_OF_FOXES, sides: ["L", "R"] },
    Known { file: "creatures/fox-dog.glb", template: "quadruped", joints: LEGS_OF_FOXES, sides: ["L", "R"] },
    Known {
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

/// A mesh with the places of joints that a template should find.
struct Figure {
    name: String,
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    template: &'static str,
    truth: Vec<(String, Vec3)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("RIGSMITH_DATA") else {
        println!("skipped: RIGSMITH_DATA names no folder with test meshes");
        return Ok(());
    };
    let variants = std::env::args().any(|argument| argument == "variants");
    let characters = bundled_characters();
    println!("{:<28} {:>6} {:>8} {:>6} {:>22} {:>7} {:>11}", "mesh", "body", "fingers", "worst", "at", "doubt", "ms");
    for figure in figures(Path::new(&data))? {
        let rig = characters.iter().find(|rig| rig.about().name == figure.template).ok_or("no template")?;
        let walk: Vec<_> = rig.walk().collect();
        let parent = |uid| walk.iter().position(|joint| Some(joint.data.uid) == uid);
        let joints: Vec<TemplateJoint> = (walk.iter())
            .map(|joint| TemplateJoint {
                label: joint.data.label.as_deref().unwrap_or_default(),
                parent: parent(joint.parent),
                position: rig.position(joint.data.uid),
            })
            .collect();
        if variants {
            changed(&figure, &joints)?;
        } else {
            measured(&figure, &joints)?;
        }
    }
    Ok(())
}

fn figures(data: &Path) -> Result<Vec<Figure>, Box<dyn Error>> {
    let mut figures = Vec::new();
    for body in BODIES {
        let folder = data.join("bodies").join(body);
        let model = load_model(&RealDisk, &folder.join("body.obj"))?;
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("joints.json"))?)?;
        let place = |name: &str| {
            let head: [f32; 3] = serde_json::from_value(json["game_engine"][name]["head"].clone()).ok()?;
            Some(Vec3::from(head))
        };
        figures.push(Figure::new(body, &model, "biped", HUMAN, ["l", "r"], &place));
    }
    for Known { file, template, joints, sides } in OTHERS {
        let model = load_model(&RealDisk, &data.join(file))?;
        let globals = model.rest_globals();
        let place = |name: &str| {
            let node = model.nodes.iter().position(|node| node.name == name)?;
            Some(globals[node].translation.into())
        };
        figures.push(Figure::new(file, &model.at_rest(), template, joints, sides, &place));
    }
    Ok(figures)
}

impl Figure {
    fn new(
        name: &str,
        model: &Model,
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
        let (points, triangles) = (model.points.clone(), model.point_triangles());
        Self { name: name.to_owned(), points, triangles, template, truth }
    }
}

fn fit(points: &[Vec3], triangles: &[[u32; 3]], joints: &[TemplateJoint]) -> Result<(FittedSkeleton, f64), FitError> {
    let start = Instant::now();
    let analysis = MeshAnalysis::new(points, triangles, None, &|_| true)?;
    let fit = fit_template(&analysis, joints, &FitSettings::default(), &|_| true)?;
    Ok((fit, start.elapsed().as_secs_f64() * 1e3))
}

/// Prints how far the joints are from where they should be.
fn measured(figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let mut times = Vec::new();
    let mut fitted = None;
    for _ in 0..3 {
        let (fit, time) = fit(&figure.points, &figure.triangles, joints)?;
        times.push(time);
        fitted = Some(fit);
    }
    times.sort_by(f64::total_cmp);
    let fit = fitted.ok_or("no fit")?;
    let (mut body, mut fingers, mut worst) = (Vec::new(), Vec::new(), (0.0, ""));
    for (label, place) in &figure.truth {
        let Some(at) = joints.iter().position(|joint| joint.label == label) else { continue };
        let off = 100.0 * fit.joints[at].position.distance(*place) / fit.height;
        let is_finger = ["thumb", "index", "middle", "ring", "pinky"].iter().any(|finger| label.starts_with(finger));
        if is_finger { &mut fingers } else { &mut body }.push(off);
        if !is_finger && off > worst.0 {
            worst = (off, joints[at].label);
        }
    }
    let mean = |list: &[f32]| list.iter().fold(0.0, |sum, off| sum + off) / list.len().max(1) as f32;
    let doubtful = fit.joints.iter().filter(|joint| joint.confidence < 0.5).count();
    let (body, fingers) = (mean(&body), mean(&fingers));
    let name = &figure.name;
    println!("{name:<28} {body:>6.2} {fingers:>8.2} {:>6.2} {:>22} {doubtful:>7} {:>11.0}", worst.0, worst.1, times[1]);
    Ok(())
}

/// Prints how far joints move when the same figure is given in another way.
fn changed(figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let Figure { name, points, triangles, .. } = figure;
    let (base, _) = fit(points, triangles, joints)?;
    let furthest =
        |points: &[Vec3], triangles: &[[u32; 3]], back: &dyn Fn(Vec3) -> Vec3| match fit(points, triangles, joints) {
            Ok((fit, _)) => {
                let pairs = fit.joints.iter().zip(&base.joints);
                pairs.map(|(a, b)| 100.0 * back(a.position).distance(b.position) / base.height).fold(0.0, f32::max)
            }
            Err(_) => f32::INFINITY,
        };
    let turned = |turn: Quat| {
        let points: Vec<Vec3> = points.iter().map(|point| turn * *point).collect();
        furthest(&points, triangles, &|place| turn.inverse() * place)
    };
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let pairs = axes.iter().flat_map(|a| axes.iter().map(move |b| (*a, *b))).filter(|(a, b)| a.dot(*b) == 0.0);
    let right = pairs.map(|(a, b)| turned(Quat::from_mat3(&Mat3::from_cols(a, b, a.cross(b))))).fold(0.0, f32::max);
    let mut random = Random(12345);
    let odd = (0..10).map(|_| {
        let mut part = || random.share() - 0.5;
        Quat::from_xyzw(part(), part(), part(), part()).normalize()
    });
    let odd = odd.collect::<Vec<_>>().into_iter().map(turned).fold(0.0, f32::max);
    let scaled = [0.001, 1000.0].map(|scale| {
        let points: Vec<Vec3> = points.iter().map(|point| *point * scale).collect();
        furthest(&points, triangles, &|place| place / scale)
    });
    let mut faces = triangles.clone();
    random.shuffle(&mut faces);
    let faces = furthest(points, &faces, &|place| place);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    random.shuffle(&mut order);
    let mut others = points.clone();
    order.iter().zip(points).for_each(|(to, point)| others[*to as usize] = *point);
    let renamed: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(|corner| order[corner as usize])).collect();
    let order = furthest(&others, &renamed, &|place| place);
    let missing: Vec<[u32; 3]> = triangles.iter().copied().filter(|_| random.share() > 0.1).collect();
    let missing = furthest(points, &missing, &|place| place);
    println!(
        "{name:<28} turned {right:.2}, oddly {odd:.2}, scaled {:.2}, faces in another order {faces:.2}, points {order:.2}, a tenth \
         missing {missing:.2}",
        scaled[0].max(scaled[1])
    );
    Ok(())
}

/// Xorshift numbers: the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn share(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1_u64 << 24) as f32
    }

    fn shuffle<T>(&mut self, list: &mut [T]) {
        for at in (1..list.len()).rev() {
            list.swap(at, (self.next() % (at as u64 + 1)) as usize);
        }
    }
}
