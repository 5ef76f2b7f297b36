//! The whole human.

use bevy::math::{Quat, Vec3};
use rigsmith::rig::{NodeType, PoseOffset, TagKind};

use super::{Puppet, template};

#[test]
fn it_is_as_large_as_it_shall_be() {
    let puppet = Puppet::of("biped");
    let deform = puppet.built.nodes.iter().filter(|node| node.kind == NodeType::Joint).count();
    assert!(deform >= 60, "{deform} joints");
    assert!(puppet.created() >= 300, "{} created nodes", puppet.created());
    assert!(puppet.built.switches.len() >= 12, "{} switches", puppet.built.switches.len());
}

/// Joints and commands on the left are on the right, too, with references to the right.
#[test]
fn its_sides_are_mirror_images() {
    let rig = template("biped");
    let mut pairs = 0;
    for joint in rig.walk().filter(|joint| joint.data.label.as_deref().is_some_and(|label| label.ends_with("_l"))) {
        let right = rig.joint(joint.data.mirror.unwrap()).unwrap();
        assert_eq!(right.data.mirror, Some(joint.data.uid));
        assert_eq!(joint.data.tags.len(), right.data.tags.len());
        for (left, right) in joint.data.tags.iter().zip(&right.data.tags) {
            if let (TagKind::Command { module, params, .. }, TagKind::Command { module: other, params: mirrored, .. }) =
                (&left.kind, &right.kind)
            {
                assert_eq!(module, other);
                assert!(!mirrored.contains("_l#") && !mirrored.contains("_l\""), "{mirrored}");
                assert!(!params.contains("_r#") && !params.contains("_r\""), "{params}");
                pairs += 1;
            }
        }
    }
    assert!(pairs > 40, "{pairs}");
    let mut puppet = Puppet::new(rig);
    let flip = |place: Vec3| Vec3::new(-place.x, place.y, place.z);
    for (control, by) in [("hand_ik", Vec3::new(0.1, 0.2, 0.2)), ("foot_ik", Vec3::new(0.1, 0.15, 0.1))] {
        puppet.move_by(&format!("{control}_l"), by);
        puppet.move_by(&format!("{control}_r"), flip(by));
    }
    for side in ["_l", "_r"] {
        puppet.set(&format!("foot_ik{side}"), "roll", 30.0);
        puppet.set(&format!("foot_ik{side}"), "bank", 10.0);
        puppet.set(&format!("fingers{side}"), "curl", 0.7);
        puppet.set(&format!("fingers{side}"), "spread", 0.5);
    }
    for joint in puppet.rig.walk() {
        let Some(mirror) = joint.data.mirror else { continue };
        let [left, right] = [joint.data.uid, mirror].map(|joint| puppet.at(joint).translation);
        let off = left.distance(flip(right));
        assert!(off < 1e-4, "{:?} is off its mirror image by {off}", joint.data.label);
    }
}

#[test]
fn its_root_moves_turns_and_scales_all_of_it() {
    let rest = Puppet::of("biped");
    let mut puppet = Puppet::of("biped");
    let root = puppet.control("root");
    let offset = PoseOffset {
        translation: Vec3::new(1.0, 0.0, -2.0),
        rotation: Quat::from_rotation_y(0.6),
        scale: Vec3::splat(1.5),
    };
    puppet.state.set_offset(root, offset).unwrap();
    puppet.state.evaluate(0.0);
    for node in puppet.built.nodes.iter().filter(|node| node.kind != NodeType::Null) {
        let before = rest.at(node.uid).translation;
        let wanted = offset.translation + offset.rotation * (1.5 * before);
        let off = puppet.at(node.uid).translation.distance(wanted);
        assert!(off < 5e-4, "{} ({:?}) is off by {off}", node.name, node.kind);
        let scale = puppet.at(node.uid).scale;
        assert!(node.kind != NodeType::Joint || (scale - 1.5).abs().max_element() < 1e-3, "{}: {scale}", node.name);
    }
}

#[test]
fn its_hands_move_with_the_space_that_is_chosen() {
    let mut puppet = Puppet::of("biped");
    let rest = puppet.place("hand_l");
    puppet.move_by("torso", Vec3::new(0.0, -0.1, 0.0));
    assert!(puppet.place("hand_l").distance(rest) < 1e-4, "the hand stays in the world");
    for space in [1.0, 2.0, 3.0] {
        puppet.set("hand_ik_l", "space", space);
        let moved = puppet.place("hand_l") - rest;
        assert!(moved.distance(Vec3::new(0.0, -0.1, 0.0)) < 1e-3, "space {space}: the hand moves by {moved}");
    }
}
