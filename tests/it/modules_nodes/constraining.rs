//! Modules that make constraints.

use super::*;

#[test]
fn constraints_follow_weighted_targets_from_where_they_stand() {
    let targets = "targets: \"@command #0000000000000010\", control: \"@command #0000000000000010 pick:START\"";
    let rig = arm();
    for (module, channels) in [
        ("parent", [[true; 3], [true; 3], [false; 3]]),
        ("point", [[true; 3], [false; 3], [false; 3]]),
        ("orient", [[false; 3], [true; 3], [false; 3]]),
        ("scale", [[false; 3], [false; 3], [true; 3]]),
    ] {
        let mut rig = rig.clone();
        let params = format!("({targets}, weights: [\"second\"], weight: \"all\")");
        // Before the arm, so that it is there when the arm's commands run.
        tag(&mut rig, SHOULDER, 0x10, "null", "(at: \"@joint #0000000000000005\", world: true)");
        tag(&mut rig, TIP, 0x11, module, &params);
        let rig = Builder::build(&rig, &Arc::new(modules::all())).unwrap_or_else(|error| panic!("{module}: {error}"));
        let [null] = roles(&rig, 0x10, "null")[..] else { panic!() };
        let names: Vec<&str> = null.attributes.iter().map(|attribute| &*attribute.name).collect();
        assert_eq!(names, ["second", "all"]);
        let [constraint] = &rig.constraints[..] else { panic!() };
        let Constraint::Transform { driven, targets, translate, rotate, scale, weight, .. } = &*constraint.constraint
        else {
            panic!()
        };
        assert_eq!((*driven, [*translate, *rotate, *scale]), (TIP, channels));
        assert_eq!(*weight, Scalar::attribute(null.uid, "all"));
        assert_eq!(targets[0].weight, Scalar::attribute(null.uid, "second"));
        assert_near((global(&rig, null) * targets[0].offset).translation, Vec3::new(6.0, 4.0, 0.0));
    }
    let free = (SHOULDER, 0x10, "null", "(at: \"@joint #0000000000000005\", world: true)");
    for (params, expected) in [
        ("()", "targets"),
        ("(targets: \"@command #0000000000000010\", weights: [1.0, 2.0])", "one for each target"),
        ("(targets: \"@command #0000000000000010\", weights: [0.0])", "all 0"),
        ("(targets: \"@command #0000000000000010\", weights: [-1.0])", "weights"),
        ("(targets: \"@command #0000000000000010\", weights: [\"x\"])", "say which one with \"control\""),
        ("(targets: \"@command #0000000000000010\", weight: 2.0)", "from 0 to 1"),
        ("(targets: \"@this\")", "in a circle"),
        (
            "(targets: \"@command #0000000000000010\", translate: (false, false, false), rotate: (false, false, false))",
            "switch on at least one",
        ),
    ] {
        let message = error(&[free, (TIP, 0x11, "parent", params)]);
        assert!(message.contains(expected), "{params}: {message}");
    }
}

#[test]
fn an_aim_keeps_how_the_node_is_turned() {
    let free = (SHOULDER, 0x10, "null", "(at: \"@joint #0000000000000005\", world: true, translate: (0.0, 1.0, 4.0))");
    for params in [
        "(targets: \"@command #0000000000000010\")",
        "(targets: \"@command #0000000000000010\", up: node, up_node: \"@joint #0000000000000005\")",
        "(targets: \"@command #0000000000000010\", aim: z, up_axis: x, up_node: \"@joint #0000000000000005\")",
    ] {
        let rig = built(&[free, (TIP, 0x11, "aim", params)]);
        let [constraint] = &rig.constraints[..] else { panic!() };
        let Constraint::Aim { driven, targets, aim, up, world_up, offset, .. } = &*constraint.constraint else {
            panic!()
        };
        let (own, target) = (global_of(&rig, *driven), global_of(&rig, targets[0].node));
        let up_now = match world_up {
            AimUp::Direction(direction) => Up::Vector(*direction),
            AimUp::Node(node) => Up::Point(global_of(&rig, *node).translation),
            AimUp::Axis(node, axis) => Up::Vector(global_of(&rig, *node).rotation * *axis),
        };
        let solved = Aim { axis: *aim, up_axis: *up }.solve(own.translation, target.translation, up_now, own.rotation);
        assert!((solved * *offset).dot(own.rotation).abs() > 0.99999);
        assert!(offset.dot(Quat::IDENTITY).abs() < 0.999);
    }
    let message = error(&[free, (TIP, 0x11, "aim", "(targets: \"@command #0000000000000010\", aim: z, up_axis: z)")]);
    assert!(message.contains("one of the other two axes"), "{message}");
}

#[test]
fn a_pole_lies_where_the_chain_bends_to() {
    let chain = "chain: \"@hierarchy this pick:0,1,2\"";
    let rig = built(&[
        (SHOULDER, 0x10, "control", "(at: \"@joint #0000000000000002\", follow: false)"),
        (
            SHOULDER,
            0x11,
            "pole_vector",
            &format!("({chain}, pole: \"@command #0000000000000010 role:control\", distance: 0.5)"),
        ),
        (SHOULDER, 0x12, "pole_vector", &format!("({chain}, distance: 1.0, targets: \"@joint #0000000000000005\")")),
    ]);
    let length = 2.0 * Vec3::new(2.0, 0.0, 0.5).length();
    let [control] = roles(&rig, 0x10, "control")[..] else { panic!() };
    assert_eq!(control.base, Trs::IDENTITY);
    assert_near(global(&rig, control).translation, Vec3::new(3.0, 4.0, -0.5 - 0.5 * length));
    let [null] = roles(&rig, 0x12, "pole")[..] else { panic!() };
    assert_near(global(&rig, null).translation, Vec3::new(3.0, 4.0, -0.5 - length));
    assert_eq!(rig.constraints.len(), 1);
    assert!(matches!(&*rig.constraints[0].constraint, Constraint::Transform { keep_pose: true, .. }));

    for (params, expected) in [
        ("(chain: \"@hierarchy this pick:0,1\")", "at least 3"),
        ("(chain: \"@joint #0000000000000001 + @joint #0000000000000005 + @joint #0000000000000003\")", "is not below"),
        ("(chain: \"@hierarchy this\", pole: \"@joint #0000000000000003\")", "is not a control or null"),
        ("(chain: \"@hierarchy this\", distance: -1.0)", "distance"),
    ] {
        let message = error(&[(SHOULDER, 0x10, "pole_vector", params)]);
        assert!(message.contains(expected), "{params}: {message}");
    }
}

#[test]
fn a_straight_chain_bends_to_the_preferred_side() {
    let mut rig = arm();
    apply(&mut rig, RigEdit::SetRest(ELBOW, RestTransform::from_translation(Vec3::new(2.0, 0.0, 0.0))));
    apply(&mut rig, RigEdit::SetRest(HAND, RestTransform::from_translation(Vec3::new(2.0, 0.0, 0.0))));
    tag(
        &mut rig,
        SHOULDER,
        0x10,
        "pole_vector",
        "(chain: \"@hierarchy this pick:0,1,2\", distance: 1.0, prefer: (1.0, 1.0, 0.0))",
    );
    let rig = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let [null] = roles(&rig, 0x10, "pole")[..] else { panic!() };
    assert_near(global(&rig, null).translation, Vec3::new(3.0, 8.0, 0.0));
}

#[test]
fn a_blend_takes_lists_of_equal_length() {
    let copies = [
        (SHOULDER, 0x10, "duplicate_chain", "(suffix: \"fk\")"),
        (SHOULDER, 0x11, "duplicate_chain", "(suffix: \"ik\")"),
        (SHOULDER, 0x12, "control", "(at: \"@joint #0000000000000005\", follow: false)"),
    ];
    let lists = "nodes: \"@hierarchy this\", a: \"@command #0000000000000010\", b: \"@command #0000000000000011\"";
    let params = format!("({lists}, control: \"@command #0000000000000012 role:control\", blend: \"ik\")");
    let rig = built(&[copies[0], copies[1], copies[2], (SHOULDER, 0x13, "blend", &params)]);
    let control = roles(&rig, 0x12, "control")[0];
    assert_eq!(control.attributes.len(), 1);
    assert_eq!(rig.constraints.len(), 4);
    for (constraint, joint) in rig.constraints.iter().zip([SHOULDER, ELBOW, HAND, TIP]) {
        let Constraint::Transform { driven, targets, .. } = &*constraint.constraint else { panic!() };
        assert_eq!(*driven, joint);
        assert_eq!(targets[0].weight, Scalar::inverse(control.uid, "ik"));
        assert_eq!(targets[1].weight, Scalar::attribute(control.uid, "ik"));
        assert_near(targets[0].offset.translation, Vec3::ZERO);
    }
    let short = lists.replace("@hierarchy this", "@this");
    assert!(error(&[copies[0], copies[1], (SHOULDER, 0x13, "blend", &format!("({short})"))]).contains("one for each"));
}

#[test]
fn limits_have_ends_in_order() {
    let params = "(limits: (rotate: ((0.0, 150.0), (0.0, 0.0), (None, None))))";
    let rig = built(&[(ELBOW, 0x10, "limit", params)]);
    let Constraint::Limit { driven, limits } = &*rig.constraints[0].constraint else { panic!() };
    assert_eq!((*driven, limits.rotate[0]), (ELBOW, (Some(0.0), Some(150.0))));
    assert!(error(&[(ELBOW, 0x10, "limit", "()")]).contains("all open"));
    let wrong = params.replace("0.0, 150.0", "150.0, 0.0");
    assert!(error(&[(ELBOW, 0x10, "limit", &wrong)]).contains("exchange the two"));
}
