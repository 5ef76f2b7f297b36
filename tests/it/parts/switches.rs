//! Switches that are thrown without a jump.

use bevy::math::{Quat, Vec3};
use rigsmith::{
    rig::{Matching, RigEdit, Uid},
    solve::matching::match_switch,
};

use super::Puppet;

/// Throws a switch: poses and attribute as the edits say.
fn thrown(puppet: &mut Puppet, control: Uid, attribute: &str, value: f32) {
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
            thrown(&mut puppet, settings, "ik_fk", value);
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
                thrown(&mut puppet, switch.control, &switch.attribute, value);
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
