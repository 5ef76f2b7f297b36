//! Feet, spines, driven numbers, and bones that keep their volume.

use super::*;

/// A left leg with a foot towards +Z; the right one has its X mirrored.
fn leg(side: f32) -> [(u64, u64, [f32; 3]); 5] {
    [
        (1, 0, [0.1 * side, 0.9, 0.0]),
        (2, 1, [0.1 * side, 0.5, 0.08]),
        (3, 2, [0.1 * side, 0.1, 0.0]),
        (4, 3, [0.1 * side, 0.03, 0.12]),
        (5, 4, [0.1 * side, 0.0, 0.2]),
    ]
}

fn foot(side: f32) -> (Bench, u64, u64) {
    let mut bench = Bench::new(&leg(side));
    let control = bench.tag(1, "knob", &format!("(at: ({}, 0.0, 0.05))", 0.1 * side));
    let foot = bench.tag(
        3,
        "reverse_foot",
        &format!("(ball: \"{}\", toe: \"{}\", control: \"{}\")", joint(4), joint(5), knob(control)),
    );
    let goal = format!("@command #{foot:016x} role:goal");
    bench.tag(5, "ik_handle", &format!("(start: \"{}\", end: \"{}\", goal: \"{goal}\")", joint(1), joint(3)));
    (bench, control, foot)
}

#[test]
fn a_foot_rolls_over_heel_ball_and_toe() {
    for side in [1.0, -1.0] {
        let (bench, control, foot) = foot(side);
        let mut play = bench.play();
        let knob = play.knob(control);
        let rest: BTreeMap<u64, Trs> = (3..=5).map(|joint| (joint, play.joint(joint))).collect();
        near(rest[&3].translation, Vec3::from(leg(side)[2].2), "the ankle stands as built");
        let names: Vec<String> =
            play.built.node(knob).unwrap().attributes.iter().map(|attribute| attribute.name.to_string()).collect();
        assert_eq!(names, ["roll", "bank", "toe", "swivel", "break_angle"]);

        play.value(knob, "roll", 30.0);
        near(play.joint(4).translation, rest[&4].translation, "the ball stays");
        near(play.joint(5).translation, rest[&5].translation, "the toes stay flat");
        assert!(play.joint(3).translation.y > 0.13, "the heel lifts: {}", play.joint(3).translation);

        play.value(knob, "roll", 70.0);
        near(play.joint(5).translation, rest[&5].translation, "the tip stays");
        assert!(play.joint(4).translation.y > 0.08, "the ball lifts");

        play.value(knob, "roll", -30.0);
        let heel = play.role(foot, "heel");
        let (at, built) = (play.at(heel).translation, play.built.node(heel).unwrap().base.translation);
        near(at, built + play.at(knob).translation, "the heel stays");
        assert!(play.joint(5).translation.y > 0.08, "the toes lift: {}", play.joint(5).translation);

        play.value(knob, "roll", 0.0);
        play.value(knob, "bank", 25.0);
        assert!(play.joint(3).translation.x * side > 0.11, "it tips outwards: {}", play.joint(3).translation);
        play.value(knob, "bank", -25.0);
        assert!(play.joint(3).translation.x * side < 0.09, "it tips inwards: {}", play.joint(3).translation);

        play.value(knob, "bank", 0.0);
        play.value(knob, "toe", 30.0);
        near(play.joint(4).translation, rest[&4].translation, "the ball stays");
        assert!(play.joint(5).translation.y > 0.03, "the toes bend up: {}", play.joint(5).translation);

        play.value(knob, "toe", 0.0);
        play.value(knob, "swivel", 40.0);
        near(play.joint(4).translation, rest[&4].translation, "it turns on the ball");
        assert!(play.joint(3).translation.distance(rest[&3].translation) > 0.05);
        let (toe, ball) = (play.joint(5).translation, play.joint(4).translation);
        assert!((toe - ball).angle_between(rest[&5].translation - rest[&4].translation) > 0.5, "the toes turn along");
    }
}

#[test]
fn a_spine_lies_along_its_curve() {
    let spine: Vec<(u64, u64, [f32; 3])> = (1..=5).map(|n| (n, n - 1, [0.0, 0.8 + 0.2 * n as f32, 0.0])).collect();
    let mut bench = Bench::new(&spine);
    let [a, b, c] = [1, 3, 5].map(|on| bench.tag(on, "knob", "()"));
    bench.tag(
        5,
        "spline_ik",
        &format!(
            "(start: \"@joint #0000000000000001\", end: \"{}\", points: \"{} + {} + {}\", stretch: \"stretch\", twist: \"twist\")",
            joint(5),
            knob(a),
            knob(b),
            knob(c)
        ),
    );
    let mut play = bench.play();
    let c = play.knob(c);
    near(play.joint(5).translation, Vec3::new(0.0, 1.8, 0.0), "as built");
    play.pose(c, [0.3, 0.1, 0.0], Quat::IDENTITY);
    let short = play.joint(5).translation;
    assert!(short.x > 0.1, "{short}");
    play.value(c, "stretch", 1.0);
    let goal = play.at(c).translation;
    assert!(play.joint(5).translation.distance(goal) < 1e-3, "stretched to the end of the curve");
    let before = play.joint(5).rotation;
    play.value(c, "twist", 40.0);
    let turned = degrees(before, play.joint(5).rotation);
    assert!((turned - 40.0).abs() < 8.0, "{turned}");
}

#[test]
fn numbers_drive_numbers() {
    let mut bench = Bench::new(&ARM);
    let hand = bench.tag(4, "knob", "()");
    bench.tag(4, "attribute", &format!("(node: \"{}\", name: \"curl\", min: 0.0, max: 1.0)", knob(hand)));
    bench.tag(
        4,
        "driven_key",
        &format!(
            "(driver: \"{}\", driver_attribute: \"curl\", keys: [(0.0, 0.0), (1.0, 80.0)], output: \"{} + {}\", \
             output_channel: RotateX)",
            knob(hand),
            joint(3),
            joint(4)
        ),
    );
    bench.tag(
        4,
        "expression",
        &format!(
            "(text: \"clamp(curl * 90, 0, 45) + x\", inputs: [(name: \"curl\", node: \"{0}\", attribute: \"curl\"), \
             (name: \"x\", node: \"{0}\", channel: TranslateX)], output: \"{1}\", output_channel: RotateZ)",
            knob(hand),
            joint(2)
        ),
    );
    bench.tag(4, "morph", &format!("(control: \"{}\", morph: \"smile\")", knob(hand)));
    let mut play = bench.play();
    let hand = play.knob(hand);
    play.value(hand, "curl", 1.0);
    play.pose(hand, [5.0, 0.0, 0.0], Quat::IDENTITY);
    play.value(hand, "smile", 0.75);
    let turned = play.joint(2).rotation;
    assert!((degrees(turned, Quat::IDENTITY) - 50.0).abs() < 0.01);
    let below = turned.conjugate() * play.joint(3).rotation;
    assert!((degrees(below, Quat::IDENTITY) - 80.0).abs() < 0.01);
    let smile = play.state.program().morph("smile").unwrap();
    assert_eq!(play.state.morphs()[smile], 0.75);
}

#[test]
fn a_bone_keeps_its_volume_and_a_tail_lags_behind() {
    let mut bench = Bench::new(&ARM);
    let (a, b) = (bench.tag(2, "knob", "()"), bench.tag(3, "knob", "()"));
    let root = bench.tag(1, "knob", "()");
    bench.tag(4, "stretch", &format!("(start: \"{}\", end: \"{}\")", knob(a), knob(b)));
    bench.tag(2, "spring", "(nodes: \"@joint #0000000000000002 + @joint #0000000000000003\", frequency: 3.0)");
    let mut play = bench.play();
    assert_eq!(play.built.constraints.len(), 3);
    let (b, _) = (play.knob(b), play.knob(root));
    let far = Vec3::new(0.3, 0.0, -0.05);
    play.pose(b, far.into(), Quat::IDENTITY);
    let scale = play.joint(4).scale;
    assert!((scale - Vec3::new(2.0, 0.5f32.sqrt(), 0.5f32.sqrt())).length() < 1e-3, "{scale}");

    let rest = play.joint(3).translation;
    play.pose(Uid(1), [0.0; 3], Quat::from_rotation_z(0.5));
    play.state.evaluate(1.0 / 60.0);
    let lagging = play.state.global(Uid(3)).unwrap().translation;
    for _ in 0..600 {
        play.state.evaluate(1.0 / 60.0);
    }
    let settled = play.state.global(Uid(3)).unwrap().translation;
    let turned = Vec3::Y + Quat::from_rotation_z(0.5) * (rest - Vec3::Y);
    near(settled, turned, "it settles");
    assert!(lagging.distance(settled) > 0.02, "it lags: {lagging} {settled}");
}
