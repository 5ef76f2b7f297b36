//! Modules of skeletons, nodes and constraints: what they build, how they refuse, and their forms.

mod constraining;
mod forms;

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    modules,
    processor::{
        Builder, ModuleInfo,
        form::{read_form, read_module_form},
    },
    rig::{
        AimUp, BuiltNode, BuiltRig, Constraint, GroupData, JointData, NodeType, RestTransform, Rig, RigEdit, Scalar,
        TagData, TagKind, Uid, shapes,
    },
    solve::aim::{Aim, Up},
};

const GROUP: Uid = Uid(0xb0);
const SHOULDER: Uid = Uid(1);
const ELBOW: Uid = Uid(2);
const HAND: Uid = Uid(3);
const TIP: Uid = Uid(4);
const HEAD: Uid = Uid(5);

fn apply(rig: &mut Rig, edit: RigEdit) {
    rig.apply(&edit).unwrap();
}

fn add(rig: &mut Rig, uid: Uid, label: &str, parent: Option<Uid>, at: Vec3) {
    let place = parent.map(|parent| rig.position(parent)).unwrap_or_default();
    let rest = RestTransform::from_translation(at - place);
    let joint = JointData { uid, label: Some(label.into()), group: Some(GROUP), rest, ..Default::default() };
    apply(rig, RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX });
}

/// A left arm that bends a little backwards, and a head beside it.
fn arm() -> Rig {
    let mut rig = Rig::new(Uid(0xff), "arm");
    let group = GroupData { uid: GROUP, name: "arm_l".into(), color: [0.0; 3], enabled: true };
    apply(&mut rig, RigEdit::AddLocalGroup(group, 0));
    add(&mut rig, SHOULDER, "shoulder_l", None, Vec3::new(1.0, 4.0, 0.0));
    add(&mut rig, ELBOW, "elbow_l", Some(SHOULDER), Vec3::new(3.0, 4.0, -0.5));
    add(&mut rig, HAND, "hand_l", Some(ELBOW), Vec3::new(5.0, 4.0, 0.0));
    add(&mut rig, TIP, "tip_l", Some(HAND), Vec3::new(6.0, 4.0, 0.0));
    add(&mut rig, HEAD, "head", None, Vec3::new(0.0, 6.0, 0.0));
    rig
}

fn tag(rig: &mut Rig, joint: Uid, uid: u64, module: &str, params: &str) {
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    let tag = TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind };
    apply(rig, RigEdit::AddTag { joint, tag: Box::new(tag), index: usize::MAX });
}

/// Builds an arm with commands on its joints: (joint, uid, module, parameters).
fn built(commands: &[(Uid, u64, &str, &str)]) -> BuiltRig {
    let mut rig = arm();
    for (joint, uid, module, params) in commands {
        tag(&mut rig, *joint, *uid, module, params);
    }
    let modules = Arc::new(modules::all());
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    assert_eq!(builder.run_all().error, None);
    let built = builder.built();
    // Rolled back and built again, and step by step from nothing, it is the same.
    builder.roll_back();
    assert!(builder.built().constraints.is_empty());
    builder.run_all();
    assert_eq!(builder.built(), built);
    let mut stepped = Builder::new(modules);
    stepped.sync(&rig);
    for _ in 0..stepped.len() {
        stepped.step_forward();
    }
    assert_eq!(stepped.built(), built);
    built
}

fn error(commands: &[(Uid, u64, &str, &str)]) -> String {
    let mut rig = arm();
    for (joint, uid, module, params) in commands {
        tag(&mut rig, *joint, *uid, module, params);
    }
    Builder::build(&rig, &Arc::new(modules::all())).unwrap_err().to_string()
}

fn global(rig: &BuiltRig, node: &BuiltNode) -> Trs {
    node.parent.map_or(node.base, |parent| global(rig, &rig.nodes[parent]) * node.base)
}

fn global_of(rig: &BuiltRig, uid: Uid) -> Trs {
    global(rig, rig.node(uid).unwrap())
}

fn roles<'a>(rig: &'a BuiltRig, command: u64, role: &str) -> Vec<&'a BuiltNode> {
    rig.find_role(Uid(command), role).collect()
}

fn parent_of<'a>(rig: &'a BuiltRig, node: &BuiltNode) -> Option<&'a BuiltNode> {
    node.parent.map(|parent| &rig.nodes[parent])
}

fn assert_near(a: Vec3, b: Vec3) {
    assert!(a.distance(b) < 1e-4, "{a} is not {b}");
}

#[test]
fn joints_are_inserted_evenly_and_the_child_hangs_below() {
    let rig = built(&[(SHOULDER, 0x10, "insert_joints", "(count: 3)")]);
    let joints = roles(&rig, 0x10, "joint");
    assert_eq!(joints.len(), 3);
    let (from, to) = (Vec3::new(1.0, 4.0, 0.0), Vec3::new(3.0, 4.0, -0.5));
    for (number, joint) in joints.iter().enumerate() {
        assert_eq!(joint.kind, NodeType::Joint);
        assert_near(global(&rig, joint).translation, from.lerp(to, (number + 1) as f32 / 4.0));
    }
    let elbow = rig.node(ELBOW).unwrap();
    assert_eq!(parent_of(&rig, elbow).unwrap().uid, joints[2].uid);
    assert_near(global(&rig, elbow).translation, to);
    assert_eq!(joints[0].group, Some(GROUP));

    assert!(error(&[(SHOULDER, 0x10, "insert_joints", "(count: 0)")]).contains("from 1 to 64"));
    assert!(error(&[(TIP, 0x10, "insert_joints", "()")]).contains("no joint below it"));
    let params = "(child: \"@joint #0000000000000003\")";
    assert!(error(&[(SHOULDER, 0x10, "insert_joints", params)]).contains("is not a child of"));
}

#[test]
fn mirrored_joints_stand_on_the_other_side_with_its_labels() {
    for opposed in [false, true] {
        let rig = built(&[(SHOULDER, 0x10, "mirror_joints", &format!("(opposed: {opposed})"))]);
        let copies = roles(&rig, 0x10, "joint");
        let labels: Vec<&str> = copies.iter().map(|copy| copy.label.as_deref().unwrap()).collect();
        assert_eq!(labels, ["shoulder_r", "elbow_r", "hand_r", "tip_r"]);
        assert_eq!(&*copies[1].name, "elbow_r");
        for (copy, source) in copies.iter().zip([SHOULDER, ELBOW, HAND, TIP]) {
            let (own, other) = (global(&rig, copy), global_of(&rig, source));
            assert_near(own.translation, other.translation * Vec3::new(-1.0, 1.0, 1.0));
            let reflected = |v: Vec3| (other.rotation * v) * Vec3::new(-1.0, 1.0, 1.0);
            let axis = |v: Vec3| if opposed { -v } else { v * Vec3::new(-1.0, 1.0, 1.0) };
            for v in [Vec3::X, Vec3::Y, Vec3::Z] {
                assert_near(own.rotation * v, reflected(axis(v)));
            }
        }
        assert_eq!(parent_of(&rig, copies[3]).unwrap().uid, copies[2].uid);
        assert_eq!(copies[0].parent, None);
    }
    assert!(error(&[(SHOULDER, 0x10, "mirror_joints", "(normal: (0.0, 0.0, 0.0))")]).contains("has no direction"));
}

#[test]
fn oriented_joints_point_along_their_bones_and_stay_in_place() {
    let before = built(&[]);
    for params in
        ["()", "(up: plane)", "(up: node, up_node: \"@joint #0000000000000005\")", "(along: neg_x, up_axis: y)"]
    {
        let rig = built(&[(SHOULDER, 0x10, "orient_joints", params)]);
        for joint in [SHOULDER, ELBOW, HAND, TIP] {
            assert_near(global_of(&rig, joint).translation, global_of(&before, joint).translation);
        }
        let axis = if params.contains("neg_x") { Vec3::NEG_X } else { Vec3::Y };
        for (joint, next) in [(SHOULDER, ELBOW), (ELBOW, HAND), (HAND, TIP)] {
            let (own, next) = (global_of(&rig, joint), global_of(&rig, next));
            assert_near(own.rotation * axis, (next.translation - own.translation).normalize());
            if params == "()" {
                assert!((own.rotation * Vec3::Z).z > 0.9);
            }
        }
        // The end goes on like the bone above.
        assert!(global_of(&rig, TIP).rotation.dot(global_of(&rig, HAND).rotation).abs() > 0.9999);
    }
    // The plane of the arm is level, so up is up or down: on the side of the direction.
    let rig = built(&[(SHOULDER, 0x10, "orient_joints", "(up: plane, direction: (0.0, -1.0, 0.2))")]);
    assert_near(global_of(&rig, SHOULDER).rotation * Vec3::Z, Vec3::NEG_Y);
    let message = error(&[(SHOULDER, 0x10, "orient_joints", "(along: y, up_axis: neg_y)")]);
    assert!(message.contains("one of the other two axes"), "{message}");
    assert!(error(&[(SHOULDER, 0x10, "orient_joints", "(up: node)")]).contains("is needed"));
}

#[test]
fn a_copied_chain_has_the_same_hierarchy() {
    let rig = built(&[(
        SHOULDER,
        0x10,
        "duplicate_chain",
        "(suffix: \"ik\", kind: joint, parent: \"@joint #0000000000000005\")",
    )]);
    let copies = roles(&rig, 0x10, "copy");
    assert_eq!(
        copies.iter().map(|copy| &*copy.name).collect::<Vec<_>>(),
        ["shoulder_l_ik", "elbow_l_ik", "hand_l_ik", "tip_l_ik"]
    );
    for (copy, source) in copies.iter().zip([SHOULDER, ELBOW, HAND, TIP]) {
        assert_near(global(&rig, copy).translation, global_of(&rig, source).translation);
        assert_eq!(copy.kind, NodeType::Joint);
    }
    assert_eq!(parent_of(&rig, copies[0]).unwrap().uid, HEAD);
    assert_eq!(parent_of(&rig, copies[2]).unwrap().uid, copies[1].uid);
}

#[test]
fn inserting_a_joint_keeps_the_identity_of_all_other_nodes() {
    let commands = [
        (SHOULDER, 0x10, "duplicate_chain", "()"),
        (SHOULDER, 0x11, "control", "(at: \"@hierarchy this\")"),
        (SHOULDER, 0x12, "mirror_joints", "()"),
        (SHOULDER, 0x13, "null", "(at: \"@hierarchy this\")"),
    ];
    let before = built(&commands);
    let mut rig = arm();
    for (joint, uid, module, params) in commands {
        tag(&mut rig, joint, uid, module, params);
    }
    add(&mut rig, Uid(9), "extra_l", Some(SHOULDER), Vec3::new(2.0, 4.0, -0.3));
    apply(&mut rig, RigEdit::SetParent { joint: ELBOW, parent: Some(Uid(9)), index: 0 });
    let after = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    assert_eq!(after.nodes.len(), before.nodes.len() + 1 + 5);
    for node in &before.nodes {
        let same = after.node(node.uid).unwrap();
        assert_eq!((&same.origin, &same.kind), (&node.origin, &node.kind));
    }
}

#[test]
fn nulls_stand_where_they_are_told() {
    let rig = built(&[
        (HAND, 0x10, "null", "(creation: (name: \"grip\", label: \"grip_label\"))"),
        (HAND, 0x11, "null", "(world: true, translate: (0.0, 1.0, 0.0), orient: false)"),
        (HAND, 0x12, "null", "(insert: true)"),
        (
            HAND,
            0x13,
            "null",
            "(at: \"@joint #0000000000000001 + @joint #0000000000000002\", parent: \"@command #0000000000000010\", creation: (name: \"n\"))",
        ),
    ]);
    let [below] = roles(&rig, 0x10, "null")[..] else { panic!() };
    assert_eq!(
        (&*below.name, below.label.as_deref(), below.group, below.kind),
        ("grip", Some("grip_label"), Some(GROUP), NodeType::Null)
    );
    assert_eq!(parent_of(&rig, below).unwrap().uid, ELBOW);
    let [free] = roles(&rig, 0x11, "null")[..] else { panic!() };
    assert_eq!(free.parent, None);
    assert_near(free.base.translation, Vec3::new(5.0, 5.0, 0.0));
    let [above] = roles(&rig, 0x12, "null")[..] else { panic!() };
    let hand = rig.node(HAND).unwrap();
    assert_eq!(parent_of(&rig, hand).unwrap().uid, above.uid);
    assert_eq!(hand.base, Trs::IDENTITY);
    let several = roles(&rig, 0x13, "null");
    assert_eq!(several.iter().map(|null| &*null.name).collect::<Vec<_>>(), ["n", "n_2"]);
    assert!(several.iter().all(|null| parent_of(&rig, null).unwrap().uid == below.uid));
    assert_eq!(several[1].label.as_deref(), Some("elbow_l"));

    let both = "(world: true, parent: \"@this\")";
    assert!(error(&[(HAND, 0x10, "null", both)]).contains("leave one of the two out"));
    let message = error(&[(HAND, 0x10, "null", "(parent: \"@hierarchy this\")")]);
    assert!(message.contains("where one is needed"), "{message}");
    assert!(error(&[(HAND, 0x10, "null", "(at: \"@module control\")")]).contains("finds nothing"));
}

#[test]
fn controls_take_the_places_of_their_nodes_which_follow() {
    let rig = built(&[
        (SHOULDER, 0x10, "control", "(at: \"@hierarchy this\", shape: \"cube\")"),
        (HEAD, 0x11, "control", "(offset_group: false, follow: false, size: 0.3, color: (0.1, 0.2, 0.3), axes: rig)"),
    ]);
    let (controls, offsets) = (roles(&rig, 0x10, "control"), roles(&rig, 0x10, "offset"));
    assert_eq!((controls.len(), offsets.len()), (4, 4));
    for (number, joint) in [SHOULDER, ELBOW, HAND, TIP].into_iter().enumerate() {
        let control = controls[number];
        assert_eq!((control.kind, control.base), (NodeType::Control, Trs::IDENTITY));
        assert_eq!(control.label, rig.node(joint).unwrap().label);
        assert_near(global(&rig, control).translation, global_of(&rig, joint).translation);
        assert_eq!(parent_of(&rig, control).unwrap().uid, offsets[number].uid);
        if number > 0 {
            assert_eq!(parent_of(&rig, offsets[number]).unwrap().uid, controls[number - 1].uid);
        }
        let data = control.control.as_ref().unwrap();
        assert_eq!((data.shape.as_str(), data.color), ("cube", rigsmith::modules::control::SIDE_COLORS[0]));
        let follows = rig.constraints.iter().any(|constraint| match &*constraint.constraint {
            Constraint::Transform { driven, targets, translate, rotate, scale, .. } => {
                *driven == joint
                    && targets[0].node == control.uid
                    && (*translate, *rotate, *scale) == ([true; 3], [true; 3], [false; 3])
            }
            // Below another one: as the control stands to that of the joint above.
            Constraint::Relative { driven, source, translate, rotate, .. } => {
                number > 0 && *driven == joint && *source == control.uid && *translate && *rotate
            }
            _ => false,
        });
        assert!(follows, "{joint}");
    }
    // The shape's Y lies along the bone, and its size follows from the bone's length.
    let shoulder = controls[0].control.as_ref().unwrap();
    let bone = Vec3::new(2.0, 0.0, -0.5);
    assert_near(shoulder.offset.rotation * Vec3::Y, bone.normalize());
    assert!((shoulder.size - 0.35 * bone.length()).abs() < 1e-5);
    let [head] = roles(&rig, 0x11, "control")[..] else { panic!() };
    let data = head.control.as_ref().unwrap();
    assert_eq!((data.size, data.color, head.parent), (0.3, [0.1, 0.2, 0.3], None));
    assert_eq!(rig.constraints.len(), 4);

    for (params, expected) in [
        ("(shape: \"circel\")", "did you mean \"circle\""),
        ("(size: 0.0)", "size"),
        ("(color: (0.0, 2.0, 0.0))", "color"),
        ("(limits: (rotate: ((10.0, -10.0), (None, None), (None, None))))", "exchange the two"),
        ("(colour: (1.0, 1.0, 1.0))", "colour"),
        ("(creation: (global_group: \"0000000000000123\"))", "another rig"),
    ] {
        let message = error(&[(HAND, 0x10, "control", params)]);
        assert!(message.contains(expected), "{params}: {message}");
    }
}

#[test]
fn controls_of_the_other_side_are_mirrored() {
    let modules = modules::all();
    let params = "(shape_translate: (1.0, 2.0, 3.0), color: (0.25, 0.55, 1.0), limits: (rotate: ((-1.0, 2.0), (-3.0, None), (None, None))))";
    let other = modules.get("control").unwrap().mirrored(params).unwrap().replace(' ', "");
    for expected in ["shape_translate:(-1.0,2.0,3.0)", "color:(1.0,0.3,0.27)", "(None,3.0)", "(-1.0,2.0)"] {
        assert!(other.contains(expected), "{expected}: {other}");
    }
}

#[test]
fn layers_take_nodes() {
    let rig = built(&[
        (SHOULDER, 0x10, "layer", "(name: \"arm\", display: template, color: (1.0, 0.0, 0.0), visible: false)"),
        (ELBOW, 0x11, "layer", "(name: \"arm\", use_existing: true)"),
        (HAND, 0x12, "layer", "(name: \"arm\", use_existing: false)"),
    ]);
    let layer = |uid| rig.node(uid).unwrap().layer.clone().unwrap();
    assert_eq!(layer(SHOULDER), layer(ELBOW));
    assert!(!layer(ELBOW).visible && layer(HAND).visible);
    assert!(error(&[(SHOULDER, 0x10, "layer", "(name: \" \")")]).contains("needs a name"));
}
