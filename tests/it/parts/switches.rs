//! Switches that are thrown without a jump.

use bevy::math::{Quat, Vec3};
use rigsmith::{
    rig::{Matching, RigEdit, Uid},
    solve::matching::match_switch,
};

use super::Puppet;

/// Throws a switch: poses and attribute as the edits say.
fn throw_switch(puppet: &mut Puppet, control: Uid, attribute: &str, value: f32) {
    let switch =
        puppet.built.switches.iter().find(|switch| switch.control == control && *switch.attribute == *attribute);
    let switch = switch.unwrap_or_else(|| panic!("no switch {attribute}")).clone();
    let thrown = match_switch(&puppet.built, &puppet.state, &switch, value).unwrap();
    for edit in thrown.edits {
        match edit {
            RigEdit::SetOffset(node, offset) => puppet.state.set_offset(node, offset.unwrap_or_default()).unwrap(),
            RigEdit::SetAttributeValue(node, name, value) => {
                puppet.state.set_attribute(node, &name, value.unwrap_or_default()).unwrap();
            }
            other => panic!("{other:?}"),
        }
    }
    puppet.state.evaluate(0.0);
}

#[test]
fn limbs_do_not_jump_between_forward_and_inverse_kinematics() {
    let limbs = [
        ("parts/arm", "arm_settings_l", "hand_ik_l", "arm_fk_l", ["upper_arm_l", "forearm_l", "hand_l"]),
        ("parts/leg", "leg_settings_l", "foot_ik_l", "leg_fk_l", ["thigh_l", "shin_l", "foot_l"]),
        ("biped", "arm_settings_r", "hand_ik_r", "arm_fk_r", ["upper_arm_r", "forearm_r", "hand_r"]),
        ("biped", "leg_settings_r", "foot_ik_r", "leg_fk_r", ["thigh_r", "shin_r", "foot_r"]),
    ];
    for (name, settings, goal, fk, joints) in limbs {
        let mut puppet = Puppet::of(name);
        let settings = puppet.control(settings);
        puppet.move_by(goal, Vec3::new(0.05, 0.12, 0.2));
        puppet.turn(goal, Quat::from_rotation_y(0.4));
        for value in [0.0, 1.0] {
            let before = joints.map(|joint| puppet.at(puppet.joint(joint)));
            throw_switch(&mut puppet, settings, "ik_fk", value);
            assert_eq!(puppet.state.attribute(settings, "ik_fk"), Some(value));
            for (joint, before) in joints.iter().zip(before) {
                let now = puppet.at(puppet.joint(joint));
                let off = now.translation.distance(before.translation);
                let turned = now.rotation.angle_between(before.rotation);
                assert!(off < 1e-3 && turned < 0.01, "{name}: {joint} jumps by {off} and {turned} to {value}");
            }
            if value == 0.0 {
                puppet.turn(fk, Quat::from_rotation_z(0.3));
            }
        }
    }
}

#[test]
fn controls_stay_where_they_are_while_their_space_changes() {
    for name in ["parts/arm", "parts/leg", "parts/neck_head", "parts/ikfk_chain", "biped"] {
        let mut puppet = Puppet::of(name);
        if name == "biped" {
            puppet.move_by("torso", Vec3::new(0.1, -0.1, 0.1));
            puppet.turn("torso", Quat::from_rotation_y(0.5));
            puppet.turn("chest_ik", Quat::from_rotation_x(0.3));
        }
        let switches = puppet.built.switches.clone();
        let mut spaces = 0;
        for switch in switches {
            let Matching::Space { control } = switch.matching else { continue };
            for value in [1.0, 0.0] {
                let before = puppet.at(control);
                throw_switch(&mut puppet, switch.control, &switch.attribute, value);
                let now = puppet.at(control);
                let off = now.translation.distance(before.translation);
                let turned = now.rotation.angle_between(before.rotation);
                assert!(off < 1e-3 && turned < 0.01, "{name}: a control jumps by {off} and {turned} to space {value}");
            }
            spaces += 1;
        }
        assert!(spaces > 0, "{name} has no spaces");
    }
}

/// Fails unless joints are where they were.
#[track_caller]
fn stand(puppet: &Puppet, before: &[(&str, rigsmith::mesh::model::Trs)], what: &str) {
    for (joint, before) in before {
        let now = puppet.at(puppet.joint(joint));
        let off = now.translation.distance(before.translation);
        let turned = now.rotation.angle_between(before.rotation);
        assert!(off < 1e-3 && turned < 0.01, "{what}: {joint} jumps by {off} and {turned}");
    }
}

/// Elbows and knees bend about the axis of their hinge however the limb was moved, so that forward controls can follow.
#[test]
fn limbs_that_were_straightened_and_turned_stay_within_their_hinges() {
    type Limb = (&'static str, &'static str, &'static str, [&'static str; 2], [&'static str; 3], f32);
    let limbs: [Limb; 5] = [
        (
            "parts/arm",
            "arm_settings_l",
            "hand_ik_l",
            ["arm_fk_l", "arm_fk_l_2"],
            ["upper_arm_l", "forearm_l", "hand_l"],
            -1.0,
        ),
        ("parts/leg", "leg_settings_l", "foot_ik_l", ["leg_fk_l", "leg_fk_l_2"], ["thigh_l", "shin_l", "foot_l"], 1.0),
        (
            "biped",
            "arm_settings_r",
            "hand_ik_r",
            ["arm_fk_r", "arm_fk_r_2"],
            ["upper_arm_r", "forearm_r", "hand_r"],
            -1.0,
        ),
        ("biped", "leg_settings_r", "foot_ik_r", ["leg_fk_r", "leg_fk_r_2"], ["thigh_r", "shin_r", "foot_r"], 1.0),
        (
            "parts/front_leg",
            "front_goal_l",
            "front_goal_l",
            ["front_fk_l", "front_fk_l_2"],
            ["upper_arm_l", "forearm_l", "carpus_l"],
            -1.0,
        ),
    ];
    for (template, settings, goal, [upper, lower], joints, straighten) in limbs {
        let mut puppet = Puppet::of(template);
        let control = puppet.control(settings);
        puppet.set(settings, "ik_fk", 0.0);
        puppet.turn(upper, Quat::from_rotation_z(0.3));
        // Further than the hinge lets it.
        puppet.turn(lower, Quat::from_rotation_x(straighten));
        let [root, mid, end] = joints.map(|joint| puppet.place(joint));
        assert!((mid - root).angle_between(end - mid) < 0.02, "{template}: the limb is straight");
        let places = |puppet: &Puppet| joints.map(|joint| (joint, puppet.at(puppet.joint(joint))));
        let before = places(&puppet);
        throw_switch(&mut puppet, control, "ik_fk", 1.0);
        stand(&puppet, &before, &format!("{template}, straight"));
        let length = root.distance(mid) + mid.distance(end);
        for by in [Vec3::new(0.1, 0.2, 0.15), Vec3::new(-0.3, 0.3, 0.2), Vec3::new(0.2, 0.1, -0.3)] {
            puppet.move_to(goal, end + (root - end) * 0.3 + by * length);
            let before = places(&puppet);
            throw_switch(&mut puppet, control, "ik_fk", 0.0);
            stand(&puppet, &before, &format!("{template}, by {by} to forward"));
            throw_switch(&mut puppet, control, "ik_fk", 1.0);
            stand(&puppet, &before, &format!("{template}, by {by} to inverse"));
        }
    }
}

#[test]
fn a_shoulder_that_follows_the_goal_stays_when_its_arm_is_switched() {
    for (template, side) in [("parts/arm", "l"), ("biped", "r")] {
        let mut puppet = Puppet::of(template);
        let name = |name: &str| format!("{name}_{side}");
        let joints = ["clavicle", "upper_arm", "forearm", "hand"].map(name);
        puppet.set(&name("shoulder"), "auto", 1.0);
        let raised = puppet.place(&joints[1]) + Vec3::new(if side == "l" { 0.1 } else { -0.1 }, 0.35, 0.1);
        puppet.move_to(&name("hand_ik"), raised);
        let before: Vec<_> = joints.iter().map(|joint| (&**joint, puppet.at(puppet.joint(joint)))).collect();
        let control = puppet.control(&name("arm_settings"));
        for value in [0.0, 1.0, 0.0] {
            throw_switch(&mut puppet, control, "ik_fk", value);
            stand(&puppet, &before, &format!("{template} to {value}"));
        }
    }
}

/// The control that carries a goal is that of the whole foot, whatever pivots are between.
#[test]
fn a_foot_whose_pivots_are_turned_stays_when_its_leg_is_switched() {
    for (template, side) in [("parts/leg", "l"), ("biped", "r")] {
        for role in ["heel_control", "toe_control", "inner_control", "outer_control"] {
            let mut puppet = Puppet::of(template);
            let joints = ["thigh", "shin", "foot"].map(|joint| format!("{joint}_{side}"));
            let foot = puppet.joint(&joints[2]);
            let pivot = puppet.built.nodes.iter().find(|node| {
                node.origin.as_ref().is_some_and(|origin| &*origin.role == role && origin.subject == foot)
            });
            let pivot = pivot.unwrap().uid;
            let turned = rigsmith::rig::PoseOffset::from_rotation(Quat::from_rotation_x(0.2));
            puppet.state.set_offset(pivot, turned).unwrap();
            puppet.state.evaluate(0.0);
            let before: Vec<_> = joints.iter().map(|joint| (&**joint, puppet.at(puppet.joint(joint)))).collect();
            let control = puppet.control(&format!("leg_settings_{side}"));
            for value in [0.0, 1.0] {
                throw_switch(&mut puppet, control, "ik_fk", value);
                stand(&puppet, &before, &format!("{template}, {role}, to {value}"));
            }
        }
    }
}
