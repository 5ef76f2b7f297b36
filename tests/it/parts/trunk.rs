//! Spine, neck and head.

use bevy::math::{Quat, Vec3};

use super::Puppet;

#[test]
fn a_spine_reaches_from_hips_to_chest() {
    for name in ["parts/spine", "biped"] {
        let mut puppet = Puppet::of(name);
        let rest = ["hips", "spine", "spine_1", "chest"].map(|joint| puppet.place(joint));
        for by in [Vec3::new(0.06, -0.02, 0.05), Vec3::new(-0.05, 0.05, 0.0), Vec3::new(0.0, -0.05, -0.08)] {
            let goal = rest[3] + by;
            puppet.move_to("chest_ik", goal);
            let places = ["hips", "spine", "spine_1", "chest"].map(|joint| puppet.place(joint));
            assert!(places[3].distance(goal) < 1e-4, "{name}: the chest is at {} of {goal}", places[3]);
            assert!(places[0].distance(rest[0]) < 1e-5 && places[1].distance(rest[1]) < 1e-5, "{name}: the hips move");
            let longest = places.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f32::max);
            assert!(longest < 0.25, "{name}: the spine tears: {places:?}");
        }
        puppet.turn("chest_ik", Quat::from_rotation_y(0.8));
        let [low, high] = ["spine", "chest"].map(|joint| puppet.axis(joint, Vec3::X));
        let rest = Puppet::of(name);
        let turned = |joint: &str, now: Vec3| now.angle_between(rest.axis(joint, Vec3::X));
        assert!(turned("chest", high) > 0.6, "{name}: the chest turns by {}", turned("chest", high));
        assert!(turned("spine", low) < 0.5 * turned("chest", high), "{name}: the twist is not shared");
    }
}

#[test]
fn the_torso_carries_everything() {
    let mut puppet = Puppet::of("biped");
    let rest = ["hips", "chest", "head", "hand_l", "foot_l"].map(|joint| puppet.place(joint));
    puppet.move_by("torso", Vec3::new(0.0, -0.1, 0.05));
    let places = ["hips", "chest", "head", "hand_l", "foot_l"].map(|joint| puppet.place(joint));
    for (now, rest) in places[..3].iter().zip(rest) {
        assert!((*now - rest).distance(Vec3::new(0.0, -0.1, 0.05)) < 1e-4, "{now} {rest}");
    }
    // Hands and feet stay on their goals.
    for (now, rest) in places[3..].iter().zip(&rest[3..]) {
        assert!(now.distance(*rest) < 1e-4, "{now} {rest}");
    }
}

#[test]
fn a_head_turns_with_its_space() {
    for (name, body, world) in [("parts/neck_head", "neck", 2.0), ("biped", "chest_ik", 1.0)] {
        let mut puppet = Puppet::of(name);
        let rest = puppet.axis("head", Vec3::Z);
        puppet.turn(body, Quat::from_rotation_x(0.5));
        assert!(puppet.axis("head", Vec3::Z).angle_between(rest) > 0.4, "{name}: the head does not go along");
        puppet.set("head", "space", world);
        assert!(puppet.axis("head", Vec3::Z).angle_between(rest) < 1e-3, "{name}: the head does not stay level");
    }
}
