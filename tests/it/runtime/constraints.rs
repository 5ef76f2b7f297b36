//! Each kind of constraint does what an animator expects.

mod chains;

use super::*;
use rigsmith::rig::{AimUp, ChainSolver, Channel, Constraint, KeyEase, Limits, Output, Uid};

const ON: [bool; 3] = [true; 3];
const OFF: [bool; 3] = [false; 3];

fn transform(driven: Uid, targets: Vec<Target>, [translate, rotate, scale]: [[bool; 3]; 3]) -> Constraint {
    Constraint::Transform { driven, targets, translate, rotate, scale, weight: Scalar::Value(1.0), keep_pose: false }
}

#[test]
fn parent_keeps_its_offset() {
    let mut rig = controls(&[("hand", Vec3::new(1.0, 2.0, 0.0)), ("sword", Vec3::new(1.5, 2.0, 0.0))]);
    let kept = rig.kept("sword", "hand", Scalar::Value(1.0));
    rig.follow("sword", vec![kept]);
    let mut state = state(&rig);
    near(position(&state, "sword"), Vec3::new(1.5, 2.0, 0.0), 1e-6);
    pose(&mut state, "hand", turned(Vec3::Z, 90.0));
    near(position(&state, "sword"), Vec3::new(1.0, 2.5, 0.0), 1e-6);
    near(global(&state, "sword").rotation * Vec3::X, Vec3::Y, 1e-6);
}

#[test]
fn point_takes_the_weighted_mean() {
    for (weights, wanted) in [([1.0, 1.0], 5.0), ([1.0, 3.0], 7.5), ([0.0, 1.0], 10.0), ([1.0, -2.0], 0.0)] {
        let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X * 10.0), ("driven", Vec3::new(3.0, 1.0, 0.0))]);
        let targets = vec![target(&rig, "a", weights[0]), target(&rig, "b", weights[1])];
        rig.constrain(transform(rig.uid("driven"), targets, [[true, false, true], OFF, OFF]));
        let mut state = state(&rig);
        // The axis that does not follow stays.
        near(position(&state, "driven"), Vec3::new(wanted, 1.0, 0.0), 1e-5);
        pose(&mut state, "a", turned(Vec3::Y, 40.0));
        assert_eq!(global(&state, "driven").rotation, Quat::IDENTITY);
    }
}

#[test]
fn nothing_is_followed_without_weight() {
    let mut rig = controls(&[("a", Vec3::ONE), ("driven", Vec3::X)]);
    let targets = vec![target(&rig, "a", 0.0)];
    rig.constrain(transform(rig.uid("driven"), targets, [ON, ON, ON]));
    near(position(&state(&rig), "driven"), Vec3::X, 0.0);
}

#[test]
fn orient_turns_and_stays() {
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X), ("driven", Vec3::Z)]);
    let targets = vec![target(&rig, "a", 1.0), target(&rig, "b", 1.0)];
    rig.constrain(transform(rig.uid("driven"), targets, [OFF, ON, OFF]));
    let mut state = state(&rig);
    pose(&mut state, "a", turned(Vec3::Y, 60.0));
    let found = global(&state, "driven");
    near(found.translation, Vec3::Z, 0.0);
    near(found.rotation * Vec3::X, Quat::from_rotation_y(30f32.to_radians()) * Vec3::X, 1e-5);
}

#[test]
fn orient_about_one_axis_only() {
    let mut rig = controls(&[("a", Vec3::ZERO), ("driven", Vec3::Z)]);
    let targets = vec![target(&rig, "a", 1.0)];
    rig.constrain(transform(rig.uid("driven"), targets, [OFF, [false, true, false], OFF]));
    let mut state = state(&rig);
    let both = Quat::from_rotation_x(0.3) * Quat::from_rotation_y(0.5);
    pose(&mut state, "a", PoseOffset::from_rotation(both));
    let found = global(&state, "driven").rotation;
    assert!(found.angle_between(Quat::from_rotation_y(0.5)) < 1e-3, "{found}");
}

#[test]
fn scale_is_relative_to_the_parent() {
    let mut rig = controls(&[("a", Vec3::ZERO), ("above", Vec3::ZERO)]);
    rig.node("driven", NodeType::Joint, "above", Vec3::Y);
    let targets = vec![target(&rig, "a", 1.0)];
    rig.constrain(transform(rig.uid("driven"), targets, [OFF, OFF, ON]));
    let mut state = state(&rig);
    pose(&mut state, "above", scaled(Vec3::splat(2.0)));
    pose(&mut state, "a", scaled(Vec3::new(3.0, 1.0, 1.0)));
    near(global(&state, "driven").scale, Vec3::new(3.0, 1.0, 1.0), 1e-6);
}

#[test]
fn a_switch_of_spaces_follows_its_attribute_and_keeps_the_pose() {
    let mut rig = controls(&[("root", Vec3::ZERO), ("head", Vec3::Y), ("settings", Vec3::ZERO)]);
    rig.node("eyes", NodeType::Control, "root", Vec3::new(0.0, 1.0, 5.0));
    rig.choice("settings", "space", &["root", "head"]);
    let node = rig.uid("settings");
    let weight = |value| Scalar::Choice { node, name: "space".into(), value };
    let targets = vec![rig.kept("eyes", "root", weight(0.0)), rig.kept("eyes", "head", weight(1.0))];
    let Constraint::Transform { driven, targets, translate, rotate, scale, weight, .. } =
        transform(rig.uid("eyes"), targets, [ON, ON, ON])
    else {
        unreachable!()
    };
    rig.constrain(Constraint::Transform { driven, targets, translate, rotate, scale, weight, keep_pose: true });
    let mut state = state(&rig);
    pose(&mut state, "head", turned(Vec3::Y, 90.0));
    pose(&mut state, "eyes", moved(Vec3::X));
    near(position(&state, "eyes"), Vec3::new(1.0, 1.0, 5.0), 1e-5);
    state.set_attribute(node, "space", 1.0).unwrap();
    state.evaluate(0.0);
    near(position(&state, "eyes"), Vec3::new(5.0, 1.0, -1.0), 1e-5);
}

#[test]
fn aim_points_and_keeps_up() {
    let mut rig =
        controls(&[("eye", Vec3::new(0.0, 1.0, 0.0)), ("goal", Vec3::new(0.0, 1.0, 4.0)), ("up", Vec3::X * 9.0)]);
    for world_up in [AimUp::Direction(Vec3::Y), AimUp::Node(rig.uid("up")), AimUp::Axis(rig.uid("up"), Vec3::Y)] {
        let mut rig = controls(&[("eye", Vec3::Y), ("goal", Vec3::new(0.0, 1.0, 4.0)), ("up", Vec3::X * 9.0)]);
        rig.constrain(Constraint::Aim {
            driven: rig.uid("eye"),
            targets: vec![target(&rig, "goal", 1.0)],
            aim: Vec3::Z,
            up: Vec3::Y,
            world_up: world_up.clone(),
            offset: Quat::IDENTITY,
            weight: Scalar::Value(1.0),
        });
        let mut state = state(&rig);
        pose(&mut state, "goal", moved(Vec3::new(3.0, -2.0, 1.0)));
        let (eye, goal) = (global(&state, "eye"), position(&state, "goal"));
        near(eye.rotation * Vec3::Z, (goal - eye.translation).normalize(), 1e-5);
        let up = if let AimUp::Node(_) = world_up { Vec3::X * 9.0 - eye.translation } else { Vec3::Y };
        assert!((eye.rotation * Vec3::Y).dot(up) > 0.0 && (eye.rotation * Vec3::X).dot(up).abs() < 1e-4);
    }
    // Half of the way.
    rig.constrain(Constraint::Aim {
        driven: rig.uid("eye"),
        targets: vec![target(&rig, "goal", 1.0)],
        aim: Vec3::X,
        up: Vec3::Y,
        world_up: AimUp::Direction(Vec3::Y),
        offset: Quat::IDENTITY,
        weight: Scalar::Value(0.5),
    });
    let eye = global(&state(&rig), "eye").rotation * Vec3::X;
    near(eye, Vec3::new(1.0, 0.0, 1.0).normalize(), 1e-5);
}

fn uid(state: &RigState, label: &str) -> Uid {
    state.program().nodes()[state.program().find_label(label).unwrap()].uid
}

#[test]
fn twist_is_shared() {
    let mut rig = controls(&[]);
    chain(&mut rig, &[("forearm", Vec3::ZERO), ("hand", Vec3::Y * 3.0)]);
    let first = rig.node("twist_1", NodeType::Joint, "forearm", Vec3::Y);
    let second = rig.node("twist_2", NodeType::Joint, "forearm", Vec3::Y * 2.0);
    rig.constrain(Constraint::Twist {
        source: rig.uid("hand"),
        reference: None,
        axis: Vec3::Y,
        driven: vec![(first, Scalar::Value(1.0 / 3.0)), (second, Scalar::Value(2.0 / 3.0))],
    });
    let mut state = state(&rig);
    let swing = Quat::from_rotation_x(0.4) * Quat::from_rotation_y(90f32.to_radians());
    pose(&mut state, "hand", PoseOffset::from_rotation(swing));
    for (label, degrees) in [("twist_1", 30f32), ("twist_2", 60.0)] {
        near(global(&state, label).rotation * Vec3::X, Quat::from_rotation_y(degrees.to_radians()) * Vec3::X, 1e-4);
    }
}

#[test]
fn stretch_keeps_the_volume() {
    let mut rig = controls(&[("goal", Vec3::Y)]);
    chain(&mut rig, &[("bone", Vec3::ZERO)]);
    rig.constrain(Constraint::Stretch {
        start: rig.uid("bone"),
        end: rig.uid("goal"),
        rest: 1.0,
        axis: Vec3::Y,
        volume: Scalar::Value(1.0),
        range: (0.5, 2.0),
        driven: vec![rig.uid("bone")],
        weight: Scalar::Value(1.0),
    });
    let mut state = state(&rig);
    for (goal, along) in [(1.0, 1.0), (1.5, 1.5), (9.0, 2.0), (0.1, 0.5)] {
        pose(&mut state, "goal", moved(Vec3::Y * (goal - 1.0)));
        let across = 1.0 / f32::sqrt(along);
        near(global(&state, "bone").scale, Vec3::new(across, along, across), 1e-4);
    }
}

#[test]
fn a_limit_stops_and_lets_through() {
    let mut rig = controls(&[("knee", Vec3::Y)]);
    let mut limits = Limits::default();
    limits.rotate[0] = (Some(0.0), Some(120.0));
    limits.translate[1] = (None, Some(0.5));
    rig.constrain(Constraint::Limit { driven: rig.uid("knee"), limits });
    let mut state = state(&rig);
    for (degrees, wanted) in [(60.0, 60.0), (150.0, 120.0), (-30.0, 0.0), (0.0, 0.0)] {
        pose(&mut state, "knee", turned(Vec3::X, degrees));
        let found = global(&state, "knee").rotation * Vec3::Y;
        near(found, Quat::from_rotation_x(f32::to_radians(wanted)) * Vec3::Y, 1e-4);
    }
    pose(&mut state, "knee", moved(Vec3::new(7.0, 2.0, 0.0)));
    near(position(&state, "knee"), Vec3::new(7.0, 1.5, 0.0), 1e-5);
}

#[test]
fn a_spring_lags_swings_and_settles() {
    let mut rig = controls(&[("head", Vec3::ZERO)]);
    rig.node("ear", NodeType::Joint, "head", Vec3::Y);
    rig.node("tip", NodeType::Joint, "ear", Vec3::Y * 2.0);
    rig.constrain(Constraint::Spring {
        driven: rig.uid("ear"),
        frequency: Scalar::Value(2.0),
        damping: Scalar::Value(0.2),
        weight: Scalar::Value(1.0),
        translate: false,
        rotate: true,
        motion: Scalar::Value(0.0),
        colliders: Vec::new(),
    });
    let mut state = state(&rig);
    assert!(!state.evaluate(0.1), "nothing moves, so nothing runs");
    pose(&mut state, "head", moved(Vec3::X));
    state.evaluate(1.0 / 60.0);
    near(position(&state, "ear"), Vec3::new(1.0, 1.0, 0.0), 1e-5);
    assert!(position(&state, "tip").x < 0.95, "the tip lags");
    let mut furthest = 0f32;
    let mut frames = 0;
    while state.evaluate(1.0 / 60.0) && frames < 2000 {
        furthest = furthest.max(position(&state, "tip").x);
        frames += 1;
    }
    assert!(furthest > 1.05, "it swings past");
    assert!((60..1000).contains(&frames), "it settles, after {frames} frames");
    near(position(&state, "tip"), Vec3::new(1.0, 2.0, 0.0), 1e-5);
}

#[test]
fn driven_keys_move_channels_attributes_and_morphs() {
    let mut rig = controls(&[("settings", Vec3::ZERO)]);
    rig.attribute("settings", "curl", 0.0, (0.0, 10.0));
    rig.attribute("settings", "half", 0.0, (0.0, 0.4));
    rig.node("finger", NodeType::Joint, "settings", Vec3::X);
    let driver = Scalar::attribute(rig.uid("settings"), "curl");
    let outputs = [
        Output::Channel(rig.uid("finger"), Channel::RotateZ),
        Output::Channel(rig.uid("finger"), Channel::TranslateY),
        Output::Channel(rig.uid("finger"), Channel::ScaleX),
        Output::Attribute(rig.uid("settings"), "half".into()),
        Output::Morph("fist".into()),
    ];
    let ends = [90.0, 2.0, 3.0, 1.0, 1.0];
    for (number, (output, end)) in outputs.into_iter().zip(ends).enumerate() {
        let keys = vec![(0.0, if number == 2 { 1.0 } else { 0.0 }), (10.0, end)];
        rig.constrain(Constraint::DrivenKey { driver: driver.clone(), keys, ease: KeyEase::Linear, output });
    }
    let mut state = state(&rig);
    near(position(&state, "finger"), Vec3::X, 0.0);
    state.set_attribute(rig.uid("settings"), "curl", 5.0).unwrap();
    state.evaluate(0.0);
    let finger = global(&state, "finger");
    near(finger.translation, Vec3::new(1.0, 1.0, 0.0), 1e-6);
    near(finger.rotation * Vec3::X, Quat::from_rotation_z(45f32.to_radians()) * Vec3::X, 1e-5);
    near(finger.scale, Vec3::new(2.0, 1.0, 1.0), 1e-6);
    assert_eq!(state.attribute(rig.uid("settings"), "half"), Some(0.4), "kept between the attribute's ends");
    assert_eq!(state.morphs(), [0.5]);
    assert_eq!(state.program().morph("fist"), Some(0));
    assert!(state.set_attribute(rig.uid("settings"), "half", 0.1).is_err(), "a driven attribute cannot be set");
}

#[test]
fn an_expression_reads_attributes_and_channels() {
    let mut rig = controls(&[("lever", Vec3::ZERO), ("door", Vec3::X)]);
    rig.attribute("lever", "gain", 2.0, (0.0, 9.0));
    rig.constrain(Constraint::Expression {
        text: "angle * gain + 1".to_owned(),
        inputs: vec![
            ("angle".to_owned(), Scalar::Channel { node: rig.uid("lever"), channel: Channel::RotateY }),
            ("gain".to_owned(), Scalar::attribute(rig.uid("lever"), "gain")),
        ],
        output: Output::Channel(rig.uid("door"), Channel::TranslateZ),
    });
    let mut state = state(&rig);
    pose(&mut state, "lever", turned(Vec3::Y, 30.0));
    near(position(&state, "door"), Vec3::new(1.0, 0.0, 61.0), 1e-3);
}

#[test]
fn a_foot_rolls_over_heel_ball_and_toe() {
    let mut rig = controls(&[("foot", Vec3::ZERO)]);
    for (attribute, ends) in [("roll", (-90.0, 90.0)), ("toes", (-90.0, 90.0)), ("bank", (-90.0, 90.0))] {
        rig.attribute("foot", attribute, 0.0, ends);
    }
    rig.node("heel", NodeType::Null, "foot", Vec3::new(0.0, 0.0, -0.1));
    rig.node("toe", NodeType::Null, "heel", Vec3::new(0.0, 0.0, 0.2));
    rig.node("ball", NodeType::Null, "toe", Vec3::new(0.0, 0.0, 0.1));
    rig.node("toes", NodeType::Null, "toe", Vec3::new(0.0, 0.0, 0.1));
    rig.node("toes_end", NodeType::Null, "toes", Vec3::new(0.0, 0.0, 0.2));
    rig.node("ankle", NodeType::Null, "ball", Vec3::new(0.0, 0.1, 0.0));
    let node = rig.uid("foot");
    rig.constrain(Constraint::Foot {
        heel: rig.uid("heel"),
        toe: rig.uid("toe"),
        ball: rig.uid("ball"),
        inner: None,
        outer: None,
        roll: Scalar::attribute(node, "roll"),
        break_angle: Scalar::Value(30.0),
        bank: Scalar::attribute(node, "bank"),
        toes: Some((rig.uid("toes"), Scalar::attribute(node, "toes"))),
        swivel: Scalar::Value(0.0),
    });
    let mut state = state(&rig);
    let at_rest = position(&state, "ankle");
    let mut roll = |value: f32| {
        state.set_attribute(node, "roll", value).unwrap();
        state.evaluate(0.0);
        ["heel", "ball", "toe", "ankle", "toes_end"].map(|label| position(&state, label))
    };
    let [_, ball, _, ankle, _] = roll(-20.0);
    assert!(ball.y > 0.01 && ankle.z < at_rest.z, "onto the heel: the ball lifts");
    let [heel, ball, toe, ankle, toes] = roll(20.0);
    assert!(ankle.y > at_rest.y && ankle.z > at_rest.z, "onto the ball: the ankle lifts and goes ahead");
    near(ball, Vec3::new(0.0, 0.0, 0.1), 1e-6);
    assert!(toe.y.abs() < 1e-6 && heel.y.abs() < 1e-6 && toes.y.abs() < 1e-6, "the toes stay on the ground");
    let [_, ball, toe, _, _] = roll(60.0);
    assert!(ball.y > 0.02, "then over the toe: the ball lifts, {ball}");
    near(toe, Vec3::new(0.0, 0.0, 0.2), 1e-6);
    roll(0.0);
    state.set_attribute(node, "toes", 30.0).unwrap();
    state.evaluate(0.0);
    assert!(position(&state, "toes_end").y > 0.04, "positive lifts the toes");
}

#[test]
fn constraints_of_one_node_run_in_order() {
    // A limit after a driven position stops it; before, it does not.
    for (limit_last, wanted) in [(true, 1.0), (false, 5.0)] {
        let mut rig = controls(&[("goal", Vec3::X * 5.0), ("driven", Vec3::ZERO)]);
        let follow = transform(rig.uid("driven"), vec![target(&rig, "goal", 1.0)], [ON, OFF, OFF]);
        let mut limits = Limits::default();
        limits.translate[0] = (None, Some(1.0));
        let limit = Constraint::Limit { driven: rig.uid("driven"), limits };
        for constraint in if limit_last { [follow, limit] } else { [limit, follow] } {
            rig.constrain(constraint);
        }
        near(position(&state(&rig), "driven"), Vec3::X * wanted, 1e-6);
    }
}

#[test]
fn others_are_read_where_they_end_up() {
    // The follower is listed before what drives its target.
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X), ("c", Vec3::Y)]);
    let follow = |rig: &RigBuilder, driven: &str, goal: &str| {
        transform(rig.uid(driven), vec![target(rig, goal, 1.0)], [ON, OFF, OFF])
    };
    let (first, second) = (follow(&rig, "c", "b"), follow(&rig, "b", "a"));
    rig.constrain(first);
    rig.constrain(second);
    let mut state = state(&rig);
    pose(&mut state, "a", moved(Vec3::Z * 4.0));
    near(position(&state, "c"), Vec3::Z * 4.0, 1e-6);
}
