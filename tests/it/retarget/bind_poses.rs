//! Files whose nodes rest in any pose: a figure stands as its mesh was bound, or as at rest where the rig stands so, too.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{EulerRot, Mat4, Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_model},
    mesh::model::{Channel, ChannelTarget, Clip, Interpolation, Model, Node, SkinBinding, Trs},
    rig::{
        Rig, Uid, UidSource,
        animation::{
            file_clip::motion_of,
            motion::{Motion, MotionJoint},
        },
        character::import_skeleton,
        format::bvh::read_bvh,
        operations::KeyTolerance,
    },
};

use super::{MotionTarget, PlayedRig, RetargetSettings, joints::strip, shipped, test_data};

fn walk() -> Motion {
    read_bvh(include_bytes!("walker.bvh"), "walker").unwrap()
}

/// Keys of all rotations, and of the place of the hips.
fn clip(walk: &Motion) -> Clip {
    let frames = 0..walk.frames();
    let times: Vec<f32> = frames.clone().map(|frame| frame as f32 * walk.frame_time).collect();
    let channel = |target: ChannelTarget, values: Vec<f32>| Channel {
        target,
        interpolation: Interpolation::Linear,
        times: times.clone(),
        values,
    };
    let turned = |joint: usize| {
        let values = frames.clone().flat_map(|frame| walk.locals(frame)[joint].rotation.to_array()).collect();
        channel(ChannelTarget::Rotation(joint), values)
    };
    let mut channels: Vec<Channel> = (0..walk.joints.len()).map(turned).collect();
    let places = frames.clone().flat_map(|frame| walk.locals(frame)[0].translation.to_array()).collect();
    channels.push(channel(ChannelTarget::Translation(0), places));
    Clip { name: "walk".into(), channels, extras: None }
}

/// Pose of somebody who crouches, looks down and turns aside.
fn crouched(name: &str) -> Quat {
    match name {
        "Hips" => Quat::from_euler(EulerRot::YXZ, 0.3, 0.2, 0.0),
        "Spine" => Quat::from_rotation_x(0.6),
        "Head" => Quat::from_rotation_x(-0.5),
        "LeftUpLeg" => Quat::from_rotation_x(-1.0),
        "RightUpLeg" => Quat::from_rotation_x(-0.4),
        "LeftLeg" | "RightLeg" => Quat::from_rotation_x(0.8),
        "LeftFoot" => Quat::from_rotation_x(0.4),
        _ => Quat::IDENTITY,
    }
}

fn standing(_: &str) -> Quat {
    Quat::IDENTITY
}

/// File of the walk whose nodes rest in a pose. Its mesh, if it has one, was bound as the walk's skeleton stands, in a
/// space of its own.
fn file(pose: fn(&str) -> Quat, space: Option<Mat4>) -> Model {
    let walk = walk();
    let node = |joint: &MotionJoint| Node {
        name: joint.name.clone(),
        parent: joint.parent,
        rest: Trs { rotation: pose(&joint.name), ..joint.rest },
        joint: true,
        extras: None,
    };
    let skin = |space: Mat4| SkinBinding {
        joints: (0..walk.joints.len()).collect(),
        inverse_binds: walk.rest_globals().iter().map(|at| (space * Mat4::from(at.affine())).inverse()).collect(),
        ..SkinBinding::default()
    };
    Model {
        nodes: walk.joints.iter().map(node).collect(),
        skins: space.map(skin).into_iter().collect(),
        clips: vec![clip(&walk)],
        ..Model::default()
    }
}

/// Space of a mesh in metres with Z up, beside a skeleton in centimetres with Y up.
fn elsewhere() -> Mat4 {
    let turn = Quat::from_rotation_x(FRAC_PI_2);
    Mat4::from_scale_rotation_translation(Vec3::splat(0.01), turn, Vec3::new(0.0, 0.5, 2.0))
}

fn motion(model: &Model) -> Motion {
    motion_of(model, &model.clips[0])
}

fn settings(onto: MotionTarget) -> RetargetSettings {
    let tolerance = KeyTolerance::captured().scaled(0.1);
    RetargetSettings { onto, travel: false, lock_feet: false, tolerance, ..RetargetSettings::default() }
}

#[test]
fn the_bind_pose_is_told_by_the_matrices() {
    let globals = walk().rest_globals();
    for space in [Mat4::IDENTITY, elsewhere()] {
        let pose = file(crouched, Some(space)).bind_pose().unwrap();
        assert_eq!(pose.len(), globals.len());
        for (is, was) in pose.iter().zip(&globals) {
            assert!(is.translation.distance(was.translation) < 1e-2, "{is:?} {was:?}");
            assert!(is.rotation.angle_between(was.rotation) < 5e-3, "{is:?} {was:?}");
        }
        // Nodes that rest as the mesh was bound.
        assert_eq!(file(standing, Some(space)).bind_pose(), None);
    }
    assert_eq!(file(crouched, None).bind_pose(), None);
    // Matrices of joints that are all at one place, or of none at all.
    for matrix in [Mat4::IDENTITY, Mat4::ZERO] {
        let mut model = file(crouched, Some(Mat4::IDENTITY));
        model.skins[0].inverse_binds.fill(matrix);
        assert_eq!(model.bind_pose(), None);
    }
}

/// Robot that rests with its fists up, in metres; its mesh was bound with level arms, in hundreds of metres with Z up.
#[test]
fn a_robot_with_its_fists_up_was_bound_with_level_arms() {
    let Some(data) = test_data() else { return };
    let model = load_model(&RealDisk, &data.join("gltf_skinned/RobotExpressive.glb")).unwrap();
    let pose = model.bind_pose().unwrap();
    let rest = model.rest_globals();
    let node = |name: &str| model.nodes.iter().position(|node| node.name == name).unwrap();
    for side in ["L", "R"] {
        let [from, to] = ["UpperArm", "Palm2"].map(|name| node(&format!("{name}.{side}")));
        let level = (pose[to].translation - pose[from].translation).normalize();
        assert!(level.x.abs() > 0.99, "{side}: {level}");
        let raised = (rest[to].translation - rest[from].translation).normalize();
        assert!(raised.x.abs() < 0.6, "{side}: {raised}");
    }
    let [hips, head] = ["Hips", "Head"].map(node);
    let trunk = pose[head].translation - pose[hips].translation;
    assert!(trunk.normalize().y > 0.99, "{trunk}");
}

#[test]
fn nodes_that_rest_in_some_pose_move_a_rig_as_those_that_stand() {
    let labels = ["hips", "head", "thigh_l", "shin_l", "foot_l", "thigh_r", "shin_r", "foot_r"];
    for onto in [MotionTarget::Controls, MotionTarget::Joints] {
        let put = |model: &Model| {
            let mut rig = shipped("biped");
            if onto == MotionTarget::Joints {
                strip(&mut rig);
            }
            let played = PlayedRig::new(rig, &motion(model), &settings(onto));
            played.globals(&played.times(), &labels)
        };
        // Largest distance, and angle in degrees of what is no leg: a straight one may turn about itself.
        let off = |a: &[Vec<Trs>], b: &[Vec<Trs>]| {
            let mut worst = [0.0_f32; 2];
            for (a, b) in a.iter().zip(b) {
                for (place, (a, b)) in a.iter().zip(b).enumerate() {
                    worst[0] = worst[0].max(a.translation.distance(b.translation));
                    if place < 2 {
                        worst[1] = worst[1].max(a.rotation.angle_between(b.rotation).to_degrees());
                    }
                }
            }
            worst
        };
        let wanted = put(&file(standing, None));
        for space in [Mat4::IDENTITY, elsewhere()] {
            let found = put(&file(crouched, Some(space)));
            assert_eq!(found.len(), wanted.len());
            let [distance, angle] = off(&found, &wanted);
            assert!(distance < 1e-3 && angle < 0.5, "{onto:?}: {distance} m, {angle}°");
        }
        // Without a mesh nobody knows how the figure stands.
        let [_, angle] = off(&put(&file(crouched, None)), &wanted);
        assert!(angle > 5.0, "{onto:?}: {angle}°");
    }
}

/// A character's own clip after a fit: the mesh is shown, and fitted, as its nodes rest.
#[test]
fn a_rig_that_stands_as_the_nodes_rest_moves_as_they_do() {
    let model = file(crouched, Some(elsewhere()));
    let mut rig = Rig::new(Uid(0xB1), "crouched");
    let skeleton = import_skeleton(&model, &mut UidSource::seeded(3));
    skeleton.edits.iter().for_each(|edit| {
        rig.apply(edit).unwrap();
    });
    let motion = motion(&model);
    let played = PlayedRig::new(rig, &motion, &settings(MotionTarget::Joints));
    let labels = ["Hips", "Spine", "Head"];
    let places = labels.map(|label| motion.find(label).unwrap());
    let times = played.times();
    assert!(times.len() > 30, "{}", times.len());
    for (time, found) in times.iter().zip(played.globals(&times, &labels)) {
        let wanted = motion.globals_at(*time);
        for (label, (is, place)) in labels.iter().zip(found.iter().zip(places)) {
            let turned = is.rotation.angle_between(wanted[place].rotation).to_degrees();
            assert!(turned < 0.5, "{label} at {time}: {turned}°");
        }
    }
}
