//! Whole animals.

use super::*;

const GOALS: [(&str, &str, [&str; 2]); 3] = [
    ("quadruped", "cube", ["carpus_l", "carpus_r"]),
    ("quadruped", "foot", ["foot_l", "foot_r"]),
    ("bird", "foot", ["foot_l", "foot_r"]),
];

#[test]
fn animals_are_symmetric_and_face_the_front() {
    for name in CHARACTERS {
        let stage = Stage::new(template(name));
        let mut pairs = 0;
        for joint in stage.rig.walk() {
            let place = stage.rig.position(joint.data.uid);
            match joint.data.mirror {
                Some(partner) => {
                    pairs += 1;
                    let other = stage.rig.position(partner);
                    assert!(other.distance(place * Vec3::new(-1.0, 1.0, 1.0)) < 1e-5, "{name}: {:?}", joint.data.label);
                    assert_eq!(stage.rig.joint(partner).unwrap().data.mirror, Some(joint.data.uid));
                }
                None => assert!(place.x.abs() < 1e-6, "{name}: {:?} is not in the middle", joint.data.label),
            }
        }
        assert!(pairs >= 20, "{name}: {pairs}");
        assert!(stage.place("head").z > stage.place("hips").z + 0.2, "{name} looks along Z");
        assert!(stage.place("head").y > 0.4 && stage.place("foot_l").y < 0.05, "{name} stands on the ground");
    }
}

#[test]
fn the_main_control_carries_everything() {
    for name in CHARACTERS {
        let mut stage = Stage::new(template(name));
        let main = stage.named("main");
        if name == "quadruped" {
            stage.set("tail_1", "swing", 0.0);
        }
        let (shift, turn) = (Vec3::new(0.8, 0.3, -1.1), Quat::from_rotation_y(2.0));
        stage.pose(main, PoseOffset { translation: shift, rotation: turn, scale: Vec3::ONE });
        for joint in stage.rig.walk() {
            let wanted = turn * stage.rig.position(joint.data.uid) + shift;
            let is = stage.global(joint.data.uid).translation;
            assert!(is.distance(wanted) < 2e-4, "{name}: {:?} is at {is} and not {wanted}", joint.data.label);
        }
    }
}

#[test]
fn feet_stay_while_the_body_moves() {
    for name in CHARACTERS {
        let mut stage = Stage::new(template(name));
        let body = stage.named("body");
        let feet: Vec<&str> = GOALS.iter().filter(|goal| goal.0 == name).flat_map(|goal| goal.2).collect();
        let before: Vec<Vec3> = feet.iter().map(|foot| stage.place(foot)).collect();
        stage.shift(body, Vec3::ZERO);
        // The body's control has the axes of its joint: move it down in the rig's space.
        let down = stage.global(body).rotation.inverse() * Vec3::new(0.0, -0.04, 0.01);
        stage.shift(body, down);
        for (foot, before) in feet.iter().zip(before) {
            assert!(
                stage.place(foot).distance(before) < 1e-4,
                "{name}: {foot} slides by {}",
                stage.place(foot) - before
            );
        }
        assert!(stage.place("head").y < Stage::new(template(name)).place("head").y - 0.03);
    }
}

#[test]
fn both_sides_do_the_same() {
    for (name, shape, [left, right]) in GOALS {
        let mut stage = Stage::new(template(name));
        let goals = [left, right].map(|foot| stage.control(foot, shape));
        stage.shift(goals[0], Vec3::new(0.02, 0.05, 0.04));
        stage.shift(goals[1], Vec3::new(-0.02, 0.05, 0.04));
        for (foot, goal) in [left, right].iter().zip(goals) {
            assert!(stage.place(foot).distance(stage.global(goal).translation) < 1e-4, "{name}: {foot}");
        }
        for joint in stage.rig.walk() {
            let Some(partner) = joint.data.mirror else { continue };
            let (one, other) = (stage.global(joint.data.uid).translation, stage.global(partner).translation);
            assert!(other.distance(one * Vec3::new(-1.0, 1.0, 1.0)) < 1e-4, "{name}: {:?}", joint.data.label);
        }
    }
}

#[test]
fn front_legs_bend_at_the_elbow_backwards() {
    let mut stage = Stage::new(template("quadruped"));
    let goal = stage.control("carpus_l", "cube");
    stage.shift(goal, Vec3::new(0.0, 0.08, 0.06));
    let [shoulder, elbow, wrist] = ["upper_arm_l", "forearm_l", "carpus_l"].map(|label| stage.place(label));
    let along = (wrist - shoulder).normalize();
    let aside = (elbow - shoulder) - along * (elbow - shoulder).dot(along);
    assert!(aside.z < -0.02, "{aside}");
}

#[test]
fn eyes_look_with_the_head() {
    for name in CHARACTERS {
        let mut stage = Stage::new(template(name));
        let head = stage.control("head", "circle");
        let before = ["eye_l", "eye_r"].map(|eye| axis(stage.global(stage.joint(eye)), Vec3::Y));
        let turn = Quat::from_rotation_y(0.5);
        let global = stage.global(head).rotation;
        // In the control's own axes, what is a turn about the rig's Y.
        stage.rotate(head, (global.inverse() * turn * global).normalize());
        for (eye, before) in ["eye_l", "eye_r"].iter().zip(before) {
            let after = axis(stage.global(stage.joint(eye)), Vec3::Y);
            assert!(after.distance(turn * before) < 1e-3, "{name}: {eye} looks along {after}");
        }
    }
}
