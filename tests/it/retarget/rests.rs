//! Rest poses of other programs: rolled bones, other units and another way up say the same motion.

use bevy::math::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    rig::{
        animation::motion::{Motion, MotionChannel, MotionJoint},
        format::bvh::read_bvh,
        operations::KeyTolerance,
    },
};

use super::{MotionTarget, PlayedRig, RetargetSettings, joints::strip, shipped};

/// The same motion on a skeleton that is turned as a whole, is so many times as large, and whose joints are rolled.
fn written_otherwise(motion: &Motion, turn: Quat, unit: f32, rolls: &[Quat]) -> Motion {
    let placed = |at: usize, local: Trs| {
        let above = motion.joints[at].parent.map_or(turn, |parent| rolls[parent].inverse());
        let rotation = (above * local.rotation * rolls[at]).normalize();
        Trs { translation: above * local.translation * unit, rotation, ..local }
    };
    let is_placed = |joint: &MotionJoint| joint.channels.iter().any(|of| matches!(of, MotionChannel::Position(_)));
    let channels = |joint: &MotionJoint| -> Vec<MotionChannel> {
        let places = (0..3).map(MotionChannel::Position).filter(|_| is_placed(joint));
        places.chain((0..4).map(MotionChannel::Turn)).collect()
    };
    let joint = |(at, joint): (usize, &MotionJoint)| MotionJoint {
        name: joint.name.clone(),
        parent: joint.parent,
        rest: placed(at, joint.rest),
        channels: channels(joint),
        ends: joint.ends.iter().map(|end| rolls[at].inverse() * *end * unit).collect(),
    };
    let joints: Vec<MotionJoint> = motion.joints.iter().enumerate().map(joint).collect();
    let mut values = Vec::new();
    for frame in 0..motion.frames() {
        for (at, local) in motion.locals(frame).into_iter().enumerate() {
            let local = placed(at, local);
            if is_placed(&motion.joints[at]) {
                values.extend(local.translation.to_array());
            }
            values.extend(local.rotation.to_array());
        }
    }
    Motion { joints, values, ..motion.clone() }
}

#[test]
fn rolled_bones_other_units_and_another_way_up_move_a_rig_alike() {
    let walk = read_bvh(include_bytes!("walker.bvh"), "walker").unwrap();
    let count = walk.joints.len();
    let (still, plain) = (vec![Quat::IDENTITY; count], Quat::IDENTITY);
    // Each joint is rolled about an axis of its own.
    let roll = |at: usize| {
        let axis = Vec3::new(1.0 + at as f32, 2.0, (at * at) as f32 - 3.0).normalize();
        Quat::from_axis_angle(axis, 0.7 + at as f32)
    };
    let rolls: Vec<Quat> = (0..count).map(roll).collect();
    let lying = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let others = [
        ("rolled", written_otherwise(&walk, plain, 1.0, &rolls)),
        ("in metres", written_otherwise(&walk, plain, 0.01, &still)),
        ("with Z up", written_otherwise(&walk, lying, 1.0, &still)),
        ("all of it", written_otherwise(&walk, lying, 0.01, &rolls)),
    ];
    for onto in [MotionTarget::Controls, MotionTarget::Joints] {
        let settings = RetargetSettings {
            onto,
            travel: false,
            lock_feet: false,
            tolerance: KeyTolerance::captured().scaled(0.1),
            ..RetargetSettings::default()
        };
        let put = |motion: &Motion| {
            let mut rig = shipped("biped");
            if onto == MotionTarget::Joints {
                strip(&mut rig);
            }
            PlayedRig::new(rig, motion, &settings)
        };
        let known = put(&walk);
        let times = known.times();
        let labels = ["hips", "head", "thigh_l", "shin_l", "foot_l", "toe_l", "thigh_r", "shin_r", "foot_r", "toe_r"];
        let wanted = known.globals(&times, &labels);
        let moved = wanted.iter().map(|pose| pose[4].translation.distance(wanted[0][4].translation));
        assert!(moved.fold(0.0, f32::max) > 0.1, "the feet walk");
        for (what, motion) in &others {
            let played = put(motion);
            assert_eq!(played.times(), times, "{what}");
            for (time, (was, is)) in times.iter().zip(wanted.iter().zip(played.globals(&times, &labels))) {
                for (label, (was, is)) in labels.iter().zip(was.iter().zip(&is)) {
                    let off = was.translation.distance(is.translation);
                    assert!(off < 1e-3, "{what}, {onto:?}: {label} at {time}: {off} m");
                    // A straight leg may turn about itself.
                    let turned = was.rotation.angle_between(is.rotation).to_degrees();
                    let is_free = ["thigh", "shin"].iter().any(|leg| label.starts_with(leg));
                    assert!(is_free || turned < 0.5, "{what}, {onto:?}: {label} at {time}: {turned}°");
                }
            }
        }
    }
}
