//! Motion of other skeletons on rigs: measured on the clip as the rig's program plays it.

mod bind_poses;
mod bodies;
mod hands;
mod joints;
mod keyed_nodes;
mod maps;
mod names;
mod reduction;
mod rests;

use std::{path::Path, sync::Arc};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_motion},
    mesh::model::Trs,
    modules,
    processor::Builder,
    rig::{
        BuiltRig, Rig, RigEdit, TagData, TagKind,
        animation::{
            humanoid::{BodySide, HumanBone, LimbBone},
            joint_map::{JointMap, JointMapError, read_joint_map, write_joint_map},
            motion::Motion,
        },
    },
    solve::{
        bake_clip::strike,
        program::{CompileOptions, RigProgram, RigState},
        retarget::{MotionTarget, RetargetSettings, RetargetedMotion, measure_feet, retarget},
    },
};

use crate::{bench::shipped, prerequisites::test_data};

fn motion(data: &Path, name: &str) -> Motion {
    load_motion(&RealDisk, &data.join("bvh").join(format!("{name}.bvh"))).unwrap()
}

/// A rig with a motion on it.
struct PlayedRig {
    rig: Rig,
    program: Arc<RigProgram>,
    map: JointMap,
    done: RetargetedMotion,
    height: f32,
}

impl PlayedRig {
    fn new(rig: Rig, motion: &Motion, settings: &RetargetSettings) -> Self {
        let built: BuiltRig = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
        let map = JointMap::new(motion, &rig, &[]).unwrap();
        let done = retarget(&rig, &built, motion, &map, settings).unwrap();
        let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
        let heights = rig.rest_globals().into_iter().map(|(_, at)| at.translation.y).collect::<Vec<_>>();
        let height =
            heights.iter().copied().fold(f32::MIN, f32::max) - heights.iter().copied().fold(f32::MAX, f32::min);
        Self { rig, program, map, done, height }
    }

    fn times(&self) -> Vec<f32> {
        let clip = &self.done.clip;
        let count = (clip.duration() * clip.frame_rate).round() as usize;
        (0..=count).map(|frame| frame as f32 / clip.frame_rate).collect()
    }

    /// Transforms of joints at each time of the clip.
    fn globals(&self, times: &[f32], labels: &[&str]) -> Vec<Vec<Trs>> {
        let mut state = RigState::new(self.program.clone());
        let uids: Vec<_> = labels.iter().map(|label| self.rig.find_label(label).unwrap()).collect();
        let at = |time: &f32| {
            strike(&mut state, &self.done.clip.sample(*time));
            uids.iter().map(|uid| state.global(*uid).unwrap()).collect()
        };
        times.iter().map(at).collect()
    }

    /// Standing feet stay where they are and at their height, in hundredths of the height: largest slide and distance.
    fn feet(&self) -> [f32; 2] {
        let mut worst = [0.0_f32; 2];
        let (mut spans, mut seconds) = (0, 0.0);
        for stance in &self.done.stances {
            let label = match (stance.left, stance.flat) {
                (true, true) => "foot_l",
                (false, true) => "foot_r",
                (true, false) => "toe_l",
                (false, false) => "toe_r",
            };
            let count = ((stance.span[1] - stance.span[0]) * self.done.clip.frame_rate).round() as usize;
            let times: Vec<f32> =
                (0..=count).map(|frame| stance.span[0] + frame as f32 / self.done.clip.frame_rate).collect();
            let rest = self.rig.position(self.rig.find_label(label).unwrap());
            let places: Vec<Vec3> = self.globals(&times, &[label]).iter().map(|at| at[0].translation).collect();
            for place in &places {
                let slide = (*place - places[0]).with_y(0.0).length();
                worst[0] = worst[0].max(100.0 * slide / self.height);
                let off = (place.y - rest.y).abs();
                // A foot may stand on something.
                if stance.flat && off < 0.05 * self.height {
                    worst[1] = worst[1].max(100.0 * off / self.height);
                }
            }
            spans += 1;
            seconds += stance.span[1] - stance.span[0];
        }
        println!(
            "{spans} stances, {seconds:.2} s of {:.2} s, slide {:.3} %, ankles off {:.3} %",
            self.done.clip.duration(),
            worst[0],
            worst[1]
        );
        // Of two feet that walk, one stands nearly always.
        assert!(spans >= 2 && seconds > 0.8 * self.done.clip.duration(), "the feet hardly stand");
        worst
    }

    /// Least bend of knees and elbows in degrees; below zero is backwards. The hinge of a limb at rest is that about which a
    /// knee bends to the back and an elbow to the front.
    fn least_bend(&self) -> f32 {
        let rest = |label: &str| -> Trs {
            let global = self.rig.rest_global(self.rig.find_label(label).unwrap());
            let (scale, rotation, translation) = global.to_scale_rotation_translation();
            Trs { translation, rotation, scale }
        };
        let mut least = f32::MAX;
        for (limb, forward) in [
            (["thigh_l", "shin_l", "foot_l"], Vec3::NEG_Z),
            (["thigh_r", "shin_r", "foot_r"], Vec3::NEG_Z),
            (["upper_arm_l", "forearm_l", "hand_l"], Vec3::Z),
            (["upper_arm_r", "forearm_r", "hand_r"], Vec3::Z),
        ] {
            let at_rest = limb.map(rest);
            let hinge = (at_rest[1].translation - at_rest[0].translation).cross(forward).normalize();
            for pose in self.globals(&self.times(), &limb) {
                let turn: Quat = pose[0].rotation * at_rest[0].rotation.inverse();
                let u = (pose[1].translation - pose[0].translation).normalize();
                let f = (pose[2].translation - pose[1].translation).normalize();
                let across = u.cross(f);
                let signed = across.length().atan2(u.dot(f)).to_degrees() * across.dot(turn * hinge).signum();
                least = least.min(signed);
            }
        }
        println!("least bend {least:.2}°");
        least
    }
}

/// The directions of a figure that faces along -Y and stands along Z, in a rig's space.
fn from_z_up(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.z, -v.y)
}

#[test]
fn a_walk_on_the_spot_walks_on_the_biped() {
    let Some(data) = test_data() else { return };
    let motion = motion(&data, "makehuman_walk1");
    let played = PlayedRig::new(shipped("biped"), &motion, &RetargetSettings::default());
    println!("unmoved {:?}, notes {:?}, keys {:?}", played.done.unmoved, played.done.notes, played.done.keys);
    assert!(played.done.unmoved.is_empty(), "{:?}", played.done.unmoved);
    let [slide, off] = played.feet();
    assert!(slide <= 1.0 && off <= 1.5, "slide {slide}, off {off}");
    assert!(played.least_bend() > -1.0);

    // The figure travels: half a second of a fast walk is more than a metre.
    let times = played.times();
    let hips: Vec<Vec3> = played.globals(&times, &["hips"]).iter().map(|at| at[0].translation).collect();
    let way = hips[hips.len() - 1] - hips[0];
    println!("way {way}");
    assert!((0.4..2.0).contains(&way.z) && way.x.abs() < 0.15, "{way}");

    // Limbs have the directions of the source's.
    let joints = ["upper_arm_l", "forearm_l", "hand_l", "upper_arm_r", "forearm_r", "hand_r"];
    let of = ["UpArm_L", "LoArm_L", "Hand_L", "UpArm_R", "LoArm_R", "Hand_R"].map(|name| motion.find(name).unwrap());
    for (time, pose) in times.iter().zip(played.globals(&times, &joints)) {
        let source = motion.globals_at(*time);
        for (a, b) in [(0, 1), (1, 2), (3, 4), (4, 5)] {
            let is = (pose[b].translation - pose[a].translation).normalize();
            let was = from_z_up(source[of[b]].translation - source[of[a]].translation).normalize();
            let angle = is.dot(was).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(angle < 2.0, "{} at {time}: {angle}°", joints[a]);
        }
    }

    // In its place the hips stay, and the feet slide below them.
    let stay = RetargetSettings { travel: false, lock_feet: false, ..RetargetSettings::default() };
    let played = PlayedRig::new(shipped("biped"), &motion, &stay);
    let hips: Vec<Vec3> = played.globals(&times, &["hips"]).iter().map(|at| at[0].translation).collect();
    assert!(hips.iter().all(|place| (*place - hips[0]).with_y(0.0).length() < 0.1));
}

#[test]
fn captured_jumps_and_turns_move_the_biped() {
    let Some(data) = test_data() else { return };
    let motion = motion(&data, "cmu_01_01");
    let settings = RetargetSettings { frame_rate: Some(30.0), ..RetargetSettings::default() };
    let played = PlayedRig::new(shipped("biped"), &motion, &settings);
    println!("unmoved {:?}, notes {:?}, keys {:?}", played.done.unmoved, played.done.notes, played.done.keys);
    let [slide, off] = played.feet();
    assert!(slide <= 1.0 && off <= 1.5, "slide {slide}, off {off}");
    assert!(played.least_bend() > -1.0);
    // The report of the command is measured the same way.
    let report =
        measure_feet(&played.rig, &played.program, &played.done.clip, &played.map.target, &played.done.stances);
    assert!(report.slide <= slide + 1e-3 && report.stances > 10, "{report:?}");

    // Root motion: the way of the hips is that of the source, by the ratio of the legs.
    let leg = |of: &dyn Fn(&str) -> Vec3, names: [&str; 3]| {
        of(names[0]).distance(of(names[1])) + of(names[1]).distance(of(names[2]))
    };
    let rest = motion.rest_globals();
    let source = leg(&|name| rest[motion.find(name).unwrap()].translation, ["LeftUpLeg", "LeftLeg", "LeftFoot"]);
    let own = leg(&|label| played.rig.position(played.rig.find_label(label).unwrap()), ["thigh_l", "shin_l", "foot_l"]);
    for time in [3.0, 7.0, 12.0, 20.0] {
        let is = played.globals(&[0.0, time], &["hips"]);
        let is = is[1][0].translation - is[0][0].translation;
        let was = (motion.globals_at(time)[0].translation - motion.globals_at(0.0)[0].translation) * own / source;
        assert!((is - was).with_y(0.0).length() < 0.15, "at {time}: {is} for {was}");
    }
    // The same input gives the same clip.
    let again = PlayedRig::new(shipped("biped"), &motion, &settings);
    assert_eq!(again.done.clip, played.done.clip);
}

/// Both sides of the switches of legs hold the same pose, so that an animator can throw them.
#[test]
fn forward_and_inverse_controls_agree() {
    let Some(data) = test_data() else { return };
    let played = PlayedRig::new(shipped("biped"), &motion(&data, "makehuman_walk1"), &RetargetSettings::default());
    let labels = ["thigh_l", "shin_l", "foot_l", "thigh_r", "shin_r", "foot_r", "upper_arm_l", "forearm_l", "hand_l"];
    let uids = labels.map(|label| played.rig.find_label(label).unwrap());
    for time in played.times().into_iter().step_by(4) {
        let mut state = RigState::new(played.program.clone());
        let pose = played.done.clip.sample(time);
        strike(&mut state, &pose);
        let inverse = uids.map(|uid| state.global(uid).unwrap());
        for (node, values) in &pose.values {
            for (name, value) in values {
                state.set_attribute(*node, name, 1.0 - value).unwrap();
            }
        }
        state.evaluate(0.0);
        for (at, uid) in uids.iter().enumerate() {
            let off = state.global(*uid).unwrap().translation.distance(inverse[at].translation);
            assert!(off < 2e-3, "{} at {time}: {off}", labels[at]);
        }
    }
}

/// Shoulders that follow the goals of their hands are posed so that the motion is the same.
#[test]
fn shoulders_that_follow_their_hands_move_as_the_motion_says() {
    let Some(data) = test_data() else { return };
    let (motion, plain) = (motion(&data, "makehuman_walk1"), shipped("biped"));
    let mut automatic = plain.clone();
    let mut changed = 0;
    for joint in plain.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, feature } = &tag.kind else { continue };
            if module == "attribute" && params.contains("name: \"auto\"") {
                let params = params.replace("name: \"auto\"", "name: \"auto\", default: 1.0");
                let kind = TagKind::Command { module: module.clone(), params, feature: *feature };
                let tag = TagData { kind, ..tag.clone() };
                automatic.apply(&RigEdit::SetTag(joint.data.uid, Box::new(tag))).unwrap();
                changed += 1;
            }
        }
    }
    assert_eq!(changed, 2);
    let played = [plain, automatic].map(|rig| PlayedRig::new(rig, &motion, &RetargetSettings::default()));
    let labels = ["clavicle_l", "clavicle_r", "forearm_l", "forearm_r", "hand_l", "hand_r"];
    let times = played[0].times();
    let [wanted, found] = [0, 1].map(|at| played[at].globals(&times, &labels));
    for ((wanted, found), time) in wanted.iter().zip(&found).zip(&times) {
        for (at, label) in labels.iter().enumerate() {
            let off = found[at].translation.distance(wanted[at].translation);
            let turned = found[at].rotation.angle_between(wanted[at].rotation);
            assert!(off < 2e-3 && turned < 0.01, "{label} at {time}: {off} and {turned}");
        }
    }
}

#[test]
fn a_map_is_guessed_written_read_and_wins() {
    let Some(data) = test_data() else { return };
    let (rig, motion) = (shipped("biped"), motion(&data, "cmu_01_01"));
    let map = JointMap::new(&motion, &rig, &[]).unwrap();
    let pairs = map.names(&motion, &rig);
    let text = write_joint_map(&pairs);
    assert_eq!(read_joint_map(text.as_bytes()).unwrap(), pairs);
    let again = JointMap::new(&motion, &rig, &pairs).unwrap();
    assert_eq!((&again.source, &again.target), (&map.source, &map.target));
    assert!(pairs.contains(&("LeftUpLeg".into(), "thigh_l".into())), "{pairs:?}");

    let given = [("RightForeArm".to_owned(), "forearm_l".to_owned())];
    let other = JointMap::new(&motion, &rig, &given).unwrap();
    let forearm = HumanBone::Limb(BodySide::Left, LimbBone::LowerArm);
    assert_eq!(other.source[&forearm], [motion.find("RightForeArm").unwrap()]);
    let wrong = JointMap::new(&motion, &rig, &[("LeftUpLag".to_owned(), "thigh_l".to_owned())]).unwrap_err();
    assert!(matches!(&wrong, JointMapError::NoSource { name, .. } if name == "LeftUpLag"));
    assert!(wrong.to_string().contains("LeftUpLeg"), "{wrong}");

    // Without names the shape tells the bones.
    let mut nameless = motion.clone();
    nameless.joints.iter_mut().enumerate().for_each(|(at, joint)| joint.name = format!("bone {at}"));
    let shaped = JointMap::new(&nameless, &rig, &[]).unwrap();
    for side in BodySide::BOTH {
        for bone in [
            LimbBone::UpperLeg,
            LimbBone::LowerLeg,
            LimbBone::Foot,
            LimbBone::UpperArm,
            LimbBone::LowerArm,
            LimbBone::Hand,
        ] {
            let bone = HumanBone::Limb(side, bone);
            assert_eq!(shaped.source[&bone].last(), map.source[&bone].last(), "{bone}");
        }
    }
    for bone in [HumanBone::Neck, HumanBone::Head] {
        assert_eq!(shaped.source.get(&bone), map.source.get(&bone), "{bone}");
    }
}

#[test]
fn a_clip_onto_joints_moves_a_rig_without_commands() {
    let Some(data) = test_data() else { return };
    let mut rig = shipped("biped");
    joints::strip(&mut rig);
    let settings = RetargetSettings { onto: MotionTarget::Joints, ..RetargetSettings::default() };
    let played = PlayedRig::new(rig, &motion(&data, "makehuman_walk1"), &settings);
    let [slide, off] = played.feet();
    assert!(slide <= 1.0 && off <= 1.5, "slide {slide}, off {off}");
    assert!(played.least_bend() > -1.0);
    assert!(played.done.clip.layers[0].tracks.keys().all(|target| played.rig.joint(target.node).is_some()));
}
