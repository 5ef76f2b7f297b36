//! Wings.

use super::*;

const FEATHERS: [&str; 6] = ["feather_1", "feather_2", "feather_3", "feather_4", "feather_5", "feather_6"];

fn out_of(stage: &Stage, feather: &str, side: &str) -> Vec3 {
    axis(stage.global(stage.joint(&format!("{feather}{side}"))), Vec3::Y)
}

#[test]
fn a_wing_folds() {
    for (mut stage, side, out) in [
        (Stage::new(part("wing")), "_l", 1.0),
        (Stage::new(template("bird")), "_l", 1.0),
        (Stage::new(template("bird")), "_r", -1.0),
    ] {
        let name = |label: &str| format!("{label}{side}");
        let shoulder = stage.place(&name("wing_1"));
        let reach = |stage: &Stage| {
            let feathers = FEATHERS.iter().map(|feather| stage.place(&name(feather)));
            feathers.map(|place| (place - shoulder).x * out).fold(0.0, f32::max)
        };
        let spread = reach(&stage);
        for feather in FEATHERS {
            assert!(out_of(&stage, feather, side).z < 0.0, "{feather} points back or out");
        }
        stage.set(&name("wing_1"), "fold", 0.5);
        let half = reach(&stage);
        stage.set(&name("wing_1"), "fold", 1.0);
        let folded = reach(&stage);
        assert!(folded < 0.35 * spread && half < spread && half > folded, "{spread} to {half} to {folded}");
        assert!(stage.place(&name("wing_1")).distance(shoulder) < 1e-6);
        for feather in FEATHERS {
            let angle = out_of(&stage, feather, side).angle_between(Vec3::NEG_Z).to_degrees();
            assert!(angle < 8.0, "{feather} is {angle} degrees from pointing back");
        }
        // Elbow back, wrist to the front: the shape of the letter Z.
        let [elbow, wrist] = ["wing_2", "wing_3"].map(|label| stage.place(&name(label)));
        assert!(elbow.z < shoulder.z - 0.1 && wrist.z > elbow.z + 0.1, "{shoulder} {elbow} {wrist}");
        assert!((elbow.x - shoulder.x) * out > 0.0, "the wing does not go into the body");
        stage.set(&name("wing_1"), "fold", 0.0);
        assert!((reach(&stage) - spread).abs() < 1e-5);
    }
}

#[test]
fn feathers_fan_out() {
    let mut stage = Stage::new(part("wing"));
    let between = |stage: &Stage| {
        let first = out_of(stage, FEATHERS[0], "_l");
        first.angle_between(out_of(stage, FEATHERS[5], "_l")).to_degrees()
    };
    let rest = between(&stage);
    stage.set("wing_1_l", "fan", 1.0);
    assert!(between(&stage) > rest + 30.0, "{} from {rest}", between(&stage));
    let hand = stage.place("wing_3_l");
    stage.set("wing_1_l", "fan", -1.0);
    assert!(between(&stage) < rest - 30.0, "{} from {rest}", between(&stage));
    assert_eq!(stage.place("wing_3_l"), hand, "the arm stays");
    // One by one, too.
    stage.set("wing_1_l", "fan", 0.0);
    let (feather, control) = (stage.joint("feather_3_l"), stage.control("feather_3_l", "pin"));
    let before = stage.global(feather).rotation;
    stage.rotate(control, Quat::from_rotation_x(0.2));
    assert!((stage.global(feather).rotation.angle_between(before) - 0.2).abs() < 1e-3);
}

#[test]
fn a_wing_flaps_and_reaches() {
    let mut stage = Stage::new(part("wing"));
    let arm = stage.control("wing_1_l", "circle");
    let before = stage.place("wing_3_l");
    // About its own front axis the arm goes up and down.
    stage.rotate(arm, Quat::from_rotation_z(0.5));
    let up = stage.place("wing_3_l");
    assert!((up.y - before.y).abs() > 0.15, "{before} to {up}");
    stage.rotate(arm, Quat::IDENTITY);
    stage.set("wing_3_l", "ik_fk", 1.0);
    stage.check_rest("wing by IK");
    let hand = stage.control("wing_3_l", "cube");
    for shift in [[-0.1, 0.1, 0.0], [-0.15, -0.1, 0.05], [-0.05, 0.0, -0.1]] {
        stage.shift(hand, shift.into());
        let off = stage.place("wing_3_l").distance(stage.global(hand).translation);
        assert!(off < 1e-5, "{shift:?}: the hand is {off} off");
        assert!(stage.place("wing_2_l").z < 0.06, "{shift:?}: the elbow stays behind");
    }
}
