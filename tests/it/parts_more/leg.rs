//! A hind leg with three bones.

use super::*;

const JOINTS: [&str; 4] = ["thigh_l", "shin_l", "metatarsus_l", "foot_l"];

fn places(stage: &Stage) -> [Vec3; 4] {
    JOINTS.map(|label| stage.place(label))
}

/// Distance of a joint before the line between its neighbours; below zero behind it.
fn before_line(upper: Vec3, joint: Vec3, lower: Vec3) -> f32 {
    let along = (lower - upper).normalize();
    let aside = (joint - upper) - along * (joint - upper).dot(along);
    aside.z
}

/// Where the goal is moved to in these tests, as shares of the leg's length.
fn goals() -> Vec<Vec3> {
    let mut list = Vec::new();
    for height in [-0.02, 0.0, 0.1, 0.2, 0.3] {
        for forth in [-0.25, -0.1, 0.0, 0.1, 0.25] {
            for aside in [-0.1, 0.0, 0.1] {
                list.push(Vec3::new(aside, height, forth));
            }
        }
    }
    list
}

#[test]
fn the_foot_reaches_its_goal_and_both_joints_bend_the_right_way() {
    let mut stage = Stage::new(part("leg_3joint"));
    let goal = stage.control("foot_l", "foot");
    let rest = places(&stage);
    let length: f32 = rest.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    for shift in goals() {
        stage.shift(goal, shift * length);
        let [hip, knee, hock, foot] = places(&stage);
        let wanted = stage.global(goal).translation;
        assert!(foot.distance(wanted) < 1e-4 * length, "{shift}: the foot is {} off", foot.distance(wanted));
        assert!(before_line(hip, knee, hock) > 0.01 * length, "{shift}: the knee bends back");
        assert!(before_line(knee, hock, foot) < -0.01 * length, "{shift}: the hock bends to the front");
        for (pair, was) in [hip, knee, hock, foot].windows(2).zip(rest.windows(2)) {
            let stretched = pair[0].distance(pair[1]) / was[0].distance(was[1]);
            assert!((stretched - 1.0).abs() < 1e-3, "{shift}: a bone is {stretched} times as long");
        }
        assert!(hip.distance(rest[0]) < 1e-6, "{shift}");
    }
}

#[test]
fn the_leg_moves_without_jumps() {
    let mut stage = Stage::new(part("leg_3joint"));
    let goal = stage.control("foot_l", "foot");
    let mut last: Option<[Vec3; 4]> = None;
    for step in 0..=200 {
        // A step of a walk: back on the ground, to the front through the air.
        let turn = step as f32 / 200.0 * std::f32::consts::TAU;
        stage.shift(goal, Vec3::new(0.0, 0.08 * turn.sin().max(0.0), 0.12 * turn.cos()));
        let now = places(&stage);
        if let Some(last) = last {
            for (label, (now, last)) in JOINTS.iter().zip(now.iter().zip(last)) {
                assert!(now.distance(last) < 0.012, "{label} jumps by {} at step {step}", now.distance(last));
            }
        }
        last = Some(now);
    }
}

#[test]
fn the_hock_sinks_as_the_leg_is_drawn_in_and_turns_by_hand() {
    let mut stage = Stage::new(part("leg_3joint"));
    let (goal, hock) = (stage.control("foot_l", "foot"), stage.control("foot_l", "ring_arrows"));
    let bend = |stage: &Stage| {
        let [_, knee, hock, foot] = places(stage);
        (knee - hock).angle_between(foot - hock).to_degrees()
    };
    let open = bend(&stage);
    stage.shift(goal, Vec3::new(0.0, 0.12, 0.0));
    assert!(bend(&stage) < open - 5.0, "the hock closes with the knee: {} of {open}", bend(&stage));
    stage.set("foot_l", "hock_follow", 0.0);
    let stiff = places(&stage);
    stage.set("foot_l", "hock_follow", 1.0);
    assert!(places(&stage)[2].y < stiff[2].y, "the hock sinks");
    // By hand it turns about the foot.
    let foot = stage.place("foot_l");
    let before = stage.place("metatarsus_l");
    stage.rotate(hock, Quat::from_rotation_x(0.3));
    assert!(stage.place("foot_l").distance(foot) < 1e-4);
    assert!(stage.place("metatarsus_l").distance(before) > 0.02);
}

#[test]
fn the_knee_turns_to_its_pole() {
    let mut stage = Stage::new(part("leg_3joint"));
    let pole = stage.control("shin_l", "diamond");
    let foot = stage.place("foot_l");
    for aside in [-0.2, 0.2] {
        stage.shift(pole, Vec3::new(aside, 0.0, 0.0));
        let [hip, knee, ..] = places(&stage);
        assert!((knee.x - hip.x) * aside > 0.0, "the knee goes to {}", knee - hip);
        assert!(stage.place("foot_l").distance(foot) < 1e-4, "the foot stays");
    }
}

#[test]
fn the_leg_moves_by_its_own_controls_too() {
    let mut stage = Stage::new(part("leg_3joint"));
    stage.set("foot_l", "ik_fk", 0.0);
    stage.check_rest("FK");
    let knee = stage.control("shin_l", "circle");
    let before = stage.place("foot_l");
    stage.rotate(knee, Quat::from_rotation_x(-0.5));
    let after = stage.place("foot_l");
    assert!(after.distance(before) > 0.05 && after.z < before.z, "the lower leg swings back: {before} to {after}");
    assert!(stage.place("shin_l").distance(Stage::new(part("leg_3joint")).place("shin_l")) < 1e-5);
    // The foot turns with its own control.
    let (control, foot) = (stage.control("foot_l", "circle"), stage.joint("foot_l"));
    let turned = stage.global(foot).rotation;
    stage.rotate(control, Quat::from_rotation_x(0.4));
    assert!((stage.global(foot).rotation.angle_between(turned) - 0.4).abs() < 1e-3);
}

#[test]
fn the_foot_turns_with_its_goal() {
    let mut stage = Stage::new(part("leg_3joint"));
    let (goal, foot) = (stage.control("foot_l", "foot"), stage.joint("foot_l"));
    let before = stage.global(foot);
    stage.rotate(goal, Quat::from_rotation_y(0.5));
    let after = stage.global(foot);
    assert!((after.rotation.angle_between(before.rotation) - 0.5).abs() < 2e-3);
    assert!(after.translation.distance(before.translation) < 1e-4);
}
