//! Hands that hold something in the world, one another, or a part of the body, on a rig with longer arms.

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    modules,
    processor::Builder,
    rig::{
        Matching,
        animation::{
            Property, TrackTarget,
            motion::{Motion, MotionChannel, MotionJoint},
        },
    },
    solve::retarget::{Touch, TouchTarget, measure_hands},
};

use super::{PlayedRig, RetargetSettings, motion, shipped, test_data};

const RATE: f32 = 30.0;
const FRAMES: usize = 121;

/// Pose of a figure at a time: the place of its hips, and the turn of its spine.
type Moment = (Vec3, Quat);

fn at(translation: Vec3, rotation: Quat) -> Trs {
    Trs { translation, rotation, scale: Vec3::ONE }
}

/// A figure with arms of these lengths, at rest with its arms out, that moves as `moment` says and reaches with its wrists
/// for the places that `reach` gives for a side (1 for the left, -1 for the right), from the hips and the shoulder.
fn reaching(arm: [f32; 2], moment: impl Fn(f32) -> Moment, reach: impl Fn(f32, f32, &Trs, Vec3) -> Vec3) -> Motion {
    let mut joints: Vec<MotionJoint> = Vec::new();
    let mut add = |name: String, parent: Option<usize>, place: Vec3, is_turned: bool, end: Option<Vec3>| {
        let mut channels: Vec<MotionChannel> = Vec::new();
        if parent.is_none() {
            channels.extend((0..3).map(MotionChannel::Position));
        }
        if is_turned {
            channels.extend((0..4).map(MotionChannel::Turn));
        }
        let rest = at(place, Quat::IDENTITY);
        joints.push(MotionJoint { name, parent, rest, channels, ends: end.into_iter().collect() });
    };
    add("Hips".into(), None, Vec3::new(0.0, 0.96, 0.0), true, None);
    add("Spine".into(), Some(0), Vec3::new(0.0, 0.12, 0.0), true, None);
    add("Spine1".into(), Some(1), Vec3::new(0.0, 0.18, 0.0), false, None);
    add("Neck".into(), Some(2), Vec3::new(0.0, 0.2, 0.0), false, None);
    add("Head".into(), Some(3), Vec3::new(0.0, 0.1, 0.02), false, Some(Vec3::new(0.0, 0.15, 0.0)));
    for (side, name, first) in [(1.0, "Left", 5), (-1.0, "Right", 9)] {
        add(format!("{name}Shoulder"), Some(2), Vec3::new(0.03 * side, 0.15, 0.0), false, None);
        add(format!("{name}Arm"), Some(first), Vec3::new(0.13 * side, 0.0, 0.0), true, None);
        add(format!("{name}ForeArm"), Some(first + 1), Vec3::new(arm[0] * side, 0.0, 0.0), true, None);
        let end = Vec3::new(0.08 * side, 0.0, 0.0);
        add(format!("{name}Hand"), Some(first + 2), Vec3::new(arm[1] * side, 0.0, 0.0), false, Some(end));
    }
    for (side, name, first) in [(1.0, "Left", 13), (-1.0, "Right", 17)] {
        add(format!("{name}UpLeg"), Some(0), Vec3::new(0.09 * side, -0.04, 0.0), false, None);
        add(format!("{name}Leg"), Some(first), Vec3::new(0.0, -0.42, 0.01), false, None);
        add(format!("{name}Foot"), Some(first + 1), Vec3::new(0.0, -0.4, -0.01), false, None);
        let end = Vec3::new(0.0, 0.0, 0.06);
        add(format!("{name}ToeBase"), Some(first + 2), Vec3::new(0.0, -0.06, 0.12), false, Some(end));
    }
    let mut values = Vec::new();
    for frame in 0..FRAMES {
        let time = frame as f32 / RATE;
        let (place, turn) = moment(time);
        let hips = at(place, Quat::IDENTITY);
        let spine = hips * at(joints[1].rest.translation, turn);
        let chest = spine * joints[2].rest;
        values.extend(place.to_array());
        values.extend(Quat::IDENTITY.to_array());
        values.extend(turn.to_array());
        for (side, first) in [(1.0, 5), (-1.0, 9)] {
            let collar = chest * joints[first].rest;
            let root = collar.transform_point(joints[first + 1].rest.translation);
            let wanted = reach(time, side, &hips, root);
            let way = (wanted - root).clamp_length_max(0.995 * (arm[0] + arm[1]));
            let (line, far) = (way.normalize(), way.length());
            let down = Vec3::new(0.2 * side, -1.0, -0.4);
            let elbow = (down - line * down.dot(line)).normalize();
            let cosine = (arm[0] * arm[0] + far * far - arm[1] * arm[1]) / (2.0 * arm[0] * far);
            let angle = cosine.clamp(-1.0, 1.0).acos();
            let upper = line * angle.cos() + elbow * angle.sin();
            let lower = (way - upper * arm[0]).normalize();
            let [upper, lower] = [upper, lower].map(|bone| Quat::from_rotation_arc(Vec3::X * side, bone));
            values.extend((collar.rotation.inverse() * upper).to_array());
            values.extend((upper.inverse() * lower).to_array());
        }
    }
    Motion { name: "reach".into(), joints, frame_time: 1.0 / RATE, values, ..Motion::default() }
}

/// Share of a hold from one second to the third.
fn held(time: f32) -> f32 {
    let ramp = |from: f32| {
        let share = ((time - from) / 0.4).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    };
    ramp(0.6) - ramp(3.0)
}

/// A hand that swings beside the body.
fn swinging(time: f32, side: f32, shoulder: Vec3) -> Vec3 {
    shoulder + Vec3::new(0.05 * side, -0.29, 0.12 * (7.0 * time).sin())
}

fn swaying(time: f32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::PI * time).sin_cos();
    Vec3::new(0.06 * sin, 0.96 - 0.02 * (1.0 - cos), 0.0)
}

/// Plays a motion with hands held and free.
fn both(motion: &Motion) -> [PlayedRig; 2] {
    [true, false].map(|lock_hands| {
        let settings = RetargetSettings { travel: false, lock_hands, ..RetargetSettings::default() };
        PlayedRig::new(shipped("biped"), motion, &settings)
    })
}

fn near(touch: &Touch, thing: TouchTarget) -> bool {
    touch.thing == thing && (touch.span[0] - 1.0).abs() < 0.2 && (touch.span[1] - 3.0).abs() < 0.2
}

/// Frames of the hold.
fn times() -> Vec<f32> {
    (0..=60).map(|frame| 1.0 + frame as f32 / RATE).collect()
}

/// Largest distance from the first of some places.
fn slide(places: &[Vec3]) -> f32 {
    places.iter().map(|place| place.distance(places[0])).fold(0.0, f32::max)
}

/// Value of the switch between forward and inverse kinematics of the limb with a joint.
fn switch(played: &PlayedRig, joint: &str) -> f32 {
    let built = Builder::build(&played.rig, &Arc::new(modules::all())).unwrap();
    let joint = played.rig.find_label(joint).unwrap();
    let is_of = |matching: &Matching| matches!(matching, Matching::IkFk { joints, .. } if joints.contains(&joint));
    let switch = built.switches.iter().find(|switch| is_of(&switch.matching)).unwrap();
    let property = Property::Attribute(switch.attribute.to_string());
    let track = &played.done.clip.layers[0].tracks[&TrackTarget { node: switch.control, property }];
    assert_eq!(track.keys.len(), 1);
    track.keys[0].value[0]
}

#[test]
fn a_hand_on_a_rail_stays_there_while_the_body_sways() {
    let rail = Vec3::new(0.24, 1.25, 0.22);
    let motion = reaching(
        [0.2, 0.18],
        |time| (swaying(time), Quat::IDENTITY),
        |time, side, _, shoulder| {
            let free = swinging(time, side, shoulder);
            if side > 0.0 { free.lerp(rail, held(time)) } else { free }
        },
    );
    let [locked, free] = both(&motion);
    let [touch] = &locked.done.touches[..] else { panic!("{:?}", locked.done.touches) };
    assert!(touch.left && near(touch, TouchTarget::World), "{touch:?}");
    assert!(free.done.touches.is_empty());
    let slides = [&locked, &free].map(|played| {
        let places: Vec<Vec3> = played.globals(&times(), &["hand_l"]).iter().map(|pose| pose[0].translation).collect();
        100.0 * slide(&places) / played.height
    });
    println!("slides {slides:?} %");
    assert!(slides[0] < 0.12 && slides[1] > 1.0, "{slides:?}");
    let report =
        measure_hands(&locked.rig, &locked.program, &locked.done.clip, &locked.map.target, &locked.done.touches);
    assert!(report.touches == 1 && report.slide < 0.5, "{report:?}");
    // The rig's own inverse kinematics holds the hand; the other arm keeps its forward controls.
    assert_eq!([switch(&locked, "hand_l"), switch(&locked, "hand_r")], [1.0, 0.0]);
    assert_eq!([switch(&free, "hand_l"), switch(&free, "hand_r")], [0.0, 0.0]);
    assert!(locked.least_bend() > -1.0);

    // The hold begins and ends without a jump, and the other hand is as it was.
    let times = locked.times();
    let [poses, others] = [&locked, &free].map(|played| played.globals(&times, &["forearm_l", "hand_l", "hand_r"]));
    let jump = |poses: &[Vec<Trs>], joint: usize| {
        let jump = |three: &[Vec<Trs>]| {
            let [a, b, c] = [0, 1, 2].map(|frame| three[frame][joint].translation);
            (a - 2.0 * b + c).length()
        };
        poses.windows(3).map(jump).fold(0.0, f32::max)
    };
    for joint in 0..2 {
        // The made motion turns elbows quickly itself.
        let [held, free] = [&poses, &others].map(|poses| jump(poses, joint));
        println!("largest jump of joint {joint}: {held} held, {free} free");
        assert!(held < 1.05 * free + 0.002, "a jump of {held}, {free} without the hold");
    }
    for (pose, other) in poses.iter().zip(&others) {
        assert!(pose[2].translation.distance(other[2].translation) < 2e-3);
    }
}

#[test]
fn hands_that_hold_one_another_stay_together() {
    let motion = reaching(
        [0.2, 0.18],
        |time| (swaying(time), Quat::IDENTITY),
        |time, side, hips, shoulder| {
            let middle = hips.translation + Vec3::new(0.0, 0.3 + 0.08 * (6.0 * time).sin(), 0.24);
            swinging(time, side, shoulder).lerp(middle + Vec3::X * 0.06 * side, held(time))
        },
    );
    let [locked, free] = both(&motion);
    let touches = &locked.done.touches;
    assert!(touches.len() == 2 && touches.iter().all(|touch| near(touch, TouchTarget::OtherHand)), "{touches:?}");
    assert!(touches[0].left && !touches[1].left);
    // As far apart as in the source, by the ratio of the legs.
    let leg = |of: [&str; 3]| {
        let [a, b, c] = of.map(|label| locked.rig.position(locked.rig.find_label(label).unwrap()));
        a.distance(b) + b.distance(c)
    };
    let wanted = 0.12 * leg(["thigh_l", "shin_l", "foot_l"]) / (0.42_f32.hypot(0.01) + 0.4_f32.hypot(0.01));
    let off = [&locked, &free].map(|played| {
        let apart = |pose: &Vec<Trs>| (pose[0].translation.distance(pose[1].translation) - wanted).abs();
        played.globals(&times(), &["hand_l", "hand_r"]).iter().map(apart).fold(0.0, f32::max)
    });
    println!("off {off:?}, {wanted} apart");
    assert!(off[0] < 3e-3 && off[1] > 2.0 * off[0], "{off:?}");
}

#[test]
fn a_hand_on_the_hip_moves_with_the_hips() {
    let bending = |time: f32| (swaying(time), Quat::from_rotation_z(0.15 * (std::f32::consts::TAU * time).sin()));
    let motion = reaching([0.24, 0.22], bending, |time, side, hips, shoulder| {
        let free = swinging(time, side, shoulder);
        if side > 0.0 { free.lerp(hips.translation + Vec3::new(0.2, 0.05, 0.1), held(time)) } else { free }
    });
    let [locked, free] = both(&motion);
    let [touch] = &locked.done.touches[..] else { panic!("{:?}", locked.done.touches) };
    assert!(touch.left && near(touch, TouchTarget::Hips), "{touch:?}");
    let slides = [&locked, &free].map(|played| {
        let poses = played.globals(&times(), &["hips", "hand_l"]);
        let own = |pose: &Vec<Trs>| pose[0].rotation.inverse() * (pose[1].translation - pose[0].translation);
        slide(&poses.iter().map(own).collect::<Vec<Vec3>>())
    });
    println!("slides {slides:?}");
    assert!(slides[0] < 2.5e-3 && slides[1] > 2.0 * slides[0], "{slides:?}");
}

/// Hands that only swing touch nothing, in a made and in captured motion.
#[test]
fn hands_that_swing_touch_nothing() {
    let made = reaching(
        [0.2, 0.18],
        |time| (swaying(time), Quat::IDENTITY),
        |time, side, _, shoulder| swinging(time, side, shoulder),
    );
    assert!(both(&made)[0].done.touches.is_empty());
    let Some(data) = test_data() else { return };
    let played = PlayedRig::new(shipped("biped"), &motion(&data, "makehuman_walk1"), &RetargetSettings::default());
    assert!(played.done.touches.is_empty(), "{:?}", played.done.touches);
}
