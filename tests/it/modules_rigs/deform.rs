//! Joints that keep the shape of the skin: twist joints and half joints.

use bevy::{math::Quat, prelude::Vec3};
use rigsmith::rig::{NodeType, Uid};

use super::{ARM, Bench, Play, degrees, joint};

#[test]
fn twist_joints_take_their_share() {
    for (counter, shares) in [(false, [1.0 / 3.0, 2.0 / 3.0]), (true, [0.0, 0.5])] {
        let mut bench = Bench::new(&ARM);
        let tag =
            bench.tag(3, "twist", &format!("(start: \"{}\", end: \"{}\", counter: {counter})", joint(2), joint(3)));
        let mut play = bench.play();
        let twists: Vec<Uid> = play.built.find_role(Uid(tag), "twist").map(|node| node.uid).collect();
        assert_eq!(twists.len(), 2);
        assert!(play.built.node(twists[0]).unwrap().kind == NodeType::Joint);
        let bone = Vec3::new(0.3, 0.0, -0.05).normalize();
        let rest: Vec<Quat> = twists.iter().map(|twist| play.at(*twist).rotation).collect();
        let turned = if counter { 2 } else { 3 };
        play.pose(Uid(turned), [0.0; 3], Quat::from_axis_angle(bone, 60f32.to_radians()));
        for ((twist, share), rest) in twists.iter().zip(shares).zip(rest) {
            let now = play.at(*twist).rotation;
            let angle = degrees(rest, now);
            assert!((angle - 60.0 * share).abs() < 0.1, "counter {counter}: {angle} and not {}", 60.0 * share);
        }
    }
}

#[test]
fn half_joints_take_half_of_a_bend_and_stay_on_it() {
    for share in [0.5_f32, 0.25] {
        let mut bench = Bench::new(&ARM);
        let tag = bench.tag(4, "half_joint", &format!("(at: \"{} + {}\", share: {share})", joint(2), joint(3)));
        let mut play = bench.play();
        let of = |subject: u64| {
            let mut made = play.built.find_role(Uid(tag), "half");
            made.find(|node| node.origin.as_ref().is_some_and(|origin| origin.subject == Uid(subject))).unwrap().uid
        };
        let halves = [of(2), of(3)];
        let rest: Vec<Quat> = halves.iter().map(|half| play.at(*half).rotation).collect();
        let bend = Quat::from_axis_angle(Vec3::new(0.3, 1.0, -0.2).normalize(), 90f32.to_radians());
        play.pose(Uid(3), [0.0, 0.02, 0.0], bend);
        let (upper, lower) =
            (degrees(rest[0], play.at(halves[0]).rotation), degrees(rest[1], play.at(halves[1]).rotation));
        assert!(upper < 0.1, "nothing bends at the upper joint: {upper}");
        // Rotations are blended linearly and made unit length: exact in the middle, a degree off elsewhere.
        let near = 0.1 + 4.0 * (share - 0.5).abs();
        assert!((lower - 90.0 * share).abs() < near, "{lower} and not {}", 90.0 * share);
        let (at, half) = (play.joint(3).translation, play.at(halves[1]).translation);
        assert!(at.distance(half) < 1e-6, "it stays on the bend");
    }
}

/// The tip of an elbow: a pushed joint leaves the bend on the outside, by the sine of half the angle.
#[test]
fn half_joints_are_pushed_out_of_a_bend() {
    let mut bench = Bench::new(&ARM);
    let params = format!("(at: \"{}\", push: 0.2, creation: (name: \"tip\", label: \"tip\"))", joint(3));
    let tag = bench.tag(4, "half_joint", &params);
    let mut play = bench.play();
    let half = play.built.find_role(Uid(tag), "half").next().unwrap().uid;
    let labelled = play.built.nodes.iter().filter(|node| node.label.as_deref() == Some("tip")).map(|node| node.uid);
    assert_eq!(labelled.collect::<Vec<_>>(), [half]);
    let on = (play.joint(3).translation - play.joint(2).translation).normalize();
    let outwards = |play: &mut Play| {
        let [middle, lower] = [3, 4].map(|number| play.joint(number).translation);
        let back = (middle - lower).normalize();
        (middle + 0.1 * middle.distance(lower) * (on + back), play.at(half).translation, middle)
    };
    for angle in [0.0_f32, 45.0, 90.0, 135.0] {
        // A limb that stretches moves its joints.
        let bend = Quat::from_axis_angle(Vec3::new(0.3, 1.0, -0.2).normalize(), angle.to_radians());
        play.pose(Uid(3), [0.002 * angle, 0.0, 0.0], bend);
        let (expected, found, middle) = outwards(&mut play);
        assert!(found.distance(expected) < 1e-5, "{angle}°: {found}, not {expected}");
        assert!(angle < 90.0 || found.distance(middle) > 0.02, "{angle}°: {found} is at {middle}");
    }
    let mut far = Bench::new(&ARM);
    far.tag(4, "half_joint", &format!("(at: \"{}\", push: 2.0)", joint(3)));
    assert!(far.error().contains("push"), "{}", far.error());
}
