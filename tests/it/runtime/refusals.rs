//! Rigs without a program, and the texts of the errors.

use super::*;
use rigsmith::{
    rig::{Constraint, KeyEase, Output, Uid},
    solve::program::{ExposedNode, ExternalNode, Keep, ProgramError, StateError},
};

fn error(rig: &RigBuilder) -> ProgramError {
    match RigProgram::compile(&rig.rig, &CompileOptions::default()) {
        Ok(_) => panic!("it compiled"),
        Err(error) => error,
    }
}

fn point(rig: &RigBuilder, driven: &str, targets: Vec<Target>) -> Constraint {
    Constraint::Transform {
        driven: rig.uid(driven),
        targets,
        translate: [true; 3],
        rotate: [false; 3],
        scale: [false; 3],
        weight: Scalar::Value(1.0),
        keep_pose: false,
    }
}

#[test]
fn a_cycle_names_nodes_constraints_and_commands() {
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X), ("c", Vec3::Y)]);
    rig.node("below_c", NodeType::Null, "c", Vec3::Y);
    for (driven, goal) in [("a", "b"), ("b", "below_c"), ("c", "a")] {
        let constraint = point(&rig, driven, vec![target(&rig, goal, 1.0)]);
        rig.constrain(constraint);
    }
    let error = error(&rig);
    let of_error = error.commands().to_vec();
    let ProgramError::Cycle { loop_text, constraints, commands, nodes } = error else { panic!() };
    assert_eq!(of_error, commands);
    assert_eq!(constraints.len(), 3);
    assert_eq!(commands.len(), 3);
    for label in ["a", "b", "c", "below_c"] {
        assert!(loop_text.contains(&format!("{label} ({})", rig.uid(label))), "{loop_text} does not name {label}");
        assert!(nodes.contains(&rig.uid(label)));
    }
    for uid in constraints.iter().chain(&commands) {
        assert!(loop_text.contains(&uid.to_string()), "{loop_text} does not name {uid}");
    }
}

#[test]
fn only_what_is_read_counts_for_a_cycle() {
    // A bone that stretches by the distance from its own origin, and aims where it reads an origin only.
    let mut rig = controls(&[("goal", Vec3::Y)]);
    chain(&mut rig, &[("bone", Vec3::ZERO), ("end", Vec3::Y)]);
    rig.constrain(Constraint::Stretch {
        start: rig.uid("bone"),
        end: rig.uid("goal"),
        rest: 1.0,
        axis: Vec3::Y,
        volume: Scalar::Value(0.0),
        range: (0.1, 10.0),
        driven: vec![rig.uid("bone")],
        weight: Scalar::Value(1.0),
    });
    let mut state = state(&rig);
    pose(&mut state, "goal", moved(Vec3::Y));
    near(position(&state, "end"), Vec3::Y * 2.0, 1e-5);
    // A node that follows its own child cannot be.
    let mut rig = controls(&[("a", Vec3::ZERO)]);
    rig.node("child", NodeType::Null, "a", Vec3::Y);
    let constraint = point(&rig, "a", vec![target(&rig, "child", 1.0)]);
    rig.constrain(constraint);
    assert!(matches!(error(&rig), ProgramError::Cycle { .. }));
}

#[test]
fn attributes_can_be_part_of_a_cycle() {
    let mut rig = controls(&[("a", Vec3::ZERO)]);
    rig.attribute("a", "one", 0.0, (0.0, 1.0));
    rig.attribute("a", "two", 0.0, (0.0, 1.0));
    for (from, to) in [("one", "two"), ("two", "one")] {
        rig.constrain(Constraint::DrivenKey {
            driver: Scalar::attribute(rig.uid("a"), from),
            keys: vec![(0.0, 0.0)],
            ease: KeyEase::Linear,
            output: Output::Attribute(rig.uid("a"), to.into()),
        });
    }
    assert!(matches!(error(&rig), ProgramError::Cycle { .. }));
}

#[test]
fn what_is_missing_is_named() {
    let (constraint, command) = (Uid(500_000), Uid(700_000));
    let cases: [(&str, Vec<String>, fn(&mut RigBuilder)); 7] = [
        ("target", vec![Uid(9).to_string()], |rig| {
            let targets = vec![Target { node: Uid(9), weight: Scalar::Value(1.0), offset: Trs::IDENTITY }];
            let constraint = point(rig, "a", targets);
            rig.constrain(constraint);
        }),
        ("driven node", vec![Uid(9).to_string()], |rig| {
            let mut constraint = point(rig, "a", vec![target(rig, "b", 1.0)]);
            let Constraint::Transform { driven, .. } = &mut constraint else { panic!() };
            *driven = Uid(9);
            rig.constrain(constraint);
        }),
        ("attribute", vec!["\"wait\"".to_owned(), "\"weight\"".to_owned()], |rig| {
            let node = rig.uid("a");
            let targets =
                vec![Target { node: rig.uid("b"), weight: Scalar::attribute(node, "wait"), offset: Trs::IDENTITY }];
            let constraint = point(rig, "a", targets);
            rig.constrain(constraint);
        }),
        ("targets", vec!["at least 1".to_owned()], |rig| {
            let constraint = point(rig, "a", Vec::new());
            rig.constrain(constraint);
        }),
        ("child", vec!["list the joints in order".to_owned()], |rig| {
            let [root, mid, end] = ["a", "b", "c"].map(|label| rig.uid(label));
            rig.constrain(Constraint::TwoBone {
                root,
                mid,
                end,
                goal: root,
                pole: None,
                prefer: Vec3::Z,
                weight: Scalar::Value(1.0),
                soft: Scalar::Value(0.0),
                stretch: Scalar::Value(0.0),
                max_stretch: 1.0,
                twist: Scalar::Value(0.0),
                pin: Scalar::Value(0.0),
                orient_end: None,
            });
        }),
        ("column", vec!["fro".to_owned()], |rig| {
            rig.constrain(Constraint::Expression {
                text: "fro + 1".to_owned(),
                inputs: Vec::new(),
                output: Output::Morph("x".into()),
            });
        }),
        ("sort the keys", vec!["x = 1".to_owned()], |rig| {
            rig.constrain(Constraint::DrivenKey {
                driver: Scalar::Value(1.0),
                keys: vec![(2.0, 0.0), (1.0, 0.0)],
                ease: KeyEase::Linear,
                output: Output::Morph("x".into()),
            });
        }),
    ];
    for (text, others, build) in cases {
        let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X), ("c", Vec3::Y)]);
        rig.attribute("a", "weight", 0.0, (0.0, 1.0));
        build(&mut rig);
        let error = error(&rig);
        let message = error.to_string();
        assert_eq!(error.commands(), [command], "\"{message}\" names another command");
        for part in others.iter().map(String::as_str).chain([text, &constraint.to_string(), &command.to_string()]) {
            assert!(message.contains(part), "\"{message}\" does not say {part}");
        }
    }
}

#[test]
fn nodes_must_be_sound() {
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X)]);
    rig.rig.nodes[1].uid = rig.rig.nodes[0].uid;
    assert!(matches!(error(&rig), ProgramError::DuplicateNode { .. }));
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X)]);
    rig.rig.nodes[0].parent = Some(1);
    assert!(matches!(error(&rig), ProgramError::ParentOrder { .. }));
    let mut rig = controls(&[("a", Vec3::NAN)]);
    assert!(matches!(error(&rig), ProgramError::NotFinite { .. }));
    rig.rig.nodes[0].base = Trs { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..Trs::IDENTITY };
    assert!(matches!(error(&rig), ProgramError::NotFinite { .. }));
}

#[test]
fn outside_nodes_are_inputs() {
    let wheel = Uid(77);
    let mut rig = controls(&[("hand", Vec3::ZERO)]);
    let targets = vec![Target { node: wheel, weight: Scalar::Value(1.0), offset: Trs::IDENTITY }];
    let constraint = point(&rig, "hand", targets);
    rig.constrain(constraint);
    assert!(matches!(error(&rig), ProgramError::MissingNode { .. }));
    let rest = Trs { translation: Vec3::Z, ..Trs::IDENTITY };
    let options = CompileOptions { inputs: vec![ExternalNode { uid: wheel, rest }], ..CompileOptions::default() };
    for keep in [Keep::All, Keep::DeformAndExposed(vec![ExposedNode::Controls])] {
        let program = RigProgram::compile(&rig.rig, &CompileOptions { keep, ..options.clone() }).unwrap();
        let mut state = RigState::new(Arc::new(program));
        state.evaluate(0.0);
        near(position(&state, "hand"), Vec3::Z, 0.0);
        state.set_input(wheel, Trs { translation: Vec3::X, ..Trs::IDENTITY }).unwrap();
        assert!(state.evaluate(0.0));
        near(position(&state, "hand"), Vec3::X, 0.0);
        assert!(!state.evaluate(0.0), "nothing changed");
        assert_eq!(state.set_input(Uid(3), rest), Err(StateError::UnknownInput(Uid(3))));
    }
    let targets = vec![target(&rig, "hand", 1.0)];
    let Constraint::Transform { translate, rotate, scale, weight, .. } = point(&rig, "hand", targets.clone()) else {
        panic!()
    };
    rig.rig.constraints.clear();
    rig.constrain(Constraint::Transform { driven: wheel, targets, translate, rotate, scale, weight, keep_pose: false });
    assert!(matches!(RigProgram::compile(&rig.rig, &options), Err(ProgramError::DrivenInput { .. })));
}

#[test]
fn states_refuse_what_they_cannot_take() {
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X)]);
    rig.node("joint", NodeType::Joint, "b", Vec3::Y);
    rig.attribute("b", "value", 0.0, (0.0, 1.0));
    let keep = Keep::DeformAndExposed(vec![ExposedNode::Label("b".to_owned())]);
    let program = RigProgram::compile(&rig.rig, &CompileOptions { keep, ..CompileOptions::default() }).unwrap();
    let mut state = RigState::new(Arc::new(program));
    let (a, b, joint) = (rig.uid("a"), rig.uid("b"), rig.uid("joint"));
    assert_eq!(state.set_offset(a, moved(Vec3::X)), Err(StateError::UnknownNode(a)));
    assert_eq!(state.set_offset(joint, moved(Vec3::X)), Err(StateError::NotPosable(joint)));
    assert_eq!(state.set_offset(b, moved(Vec3::NAN)), Err(StateError::NotFinite(b)));
    assert_eq!(state.set_offset(b, moved(Vec3::X)), Ok(()));
    assert_eq!(state.set_attribute(b, "value", 7.0), Ok(()));
    assert_eq!(state.attribute(b, "value"), Some(1.0), "kept between its ends");
    assert!(matches!(state.set_attribute(b, "values", 7.0), Err(StateError::UnknownAttribute { .. })));
    assert_eq!(state.set_attribute(b, "value", f32::NAN), Err(StateError::NotFinite(b)));
    assert!(state.global(a).is_none());
    let keep = Keep::DeformAndExposed(vec![ExposedNode::Label("elbow".to_owned())]);
    let wrong = RigProgram::compile(&rig.rig, &CompileOptions { keep, ..CompileOptions::default() });
    assert!(matches!(wrong, Err(ProgramError::UnknownExposed { .. })));
}
