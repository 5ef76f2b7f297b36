//! Modules that solve, switch and drive: each on a small rig, through the processor and the runtime.

mod body;
mod deform;
mod switches;

use std::{collections::BTreeMap, sync::Arc};

use bevy::{math::Quat, prelude::Vec3, reflect::Reflect};
use rigsmith::{
    mesh::model::Trs,
    processor::{BuildScope, Builder, Creation, ModuleError, Modules, RigModule, form::read_module_form},
    rig::{
        BuiltRig, ControlData, JointData, Limits, NodeType, PoseOffset, RestTransform, Rig, RigEdit, TagData, TagKind,
        Uid,
        reference::{NodeRef, NodeRefs},
        step::edits_from_empty,
    },
    solve::{
        matching::{MatchedSwitch, match_switch},
        program::{CompileOptions, RigProgram, RigState},
    },
};
use serde::{Deserialize, Serialize};

/// A control at a place of the rig's space, so that the modules are tested without those that make nodes.
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Knob {
    at: Vec3,
    turn: f32,
    below: NodeRefs,
    on: NodeRefs,
}

impl Default for Knob {
    fn default() -> Self {
        Self { at: Vec3::NAN, turn: 0.0, below: NodeRefs::NONE, on: NodeRef::this().into() }
    }
}

impl RigModule for Knob {
    const NAME: &'static str = "knob";
    const DOC: &'static str = "A control for tests.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[];

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let below = scope.resolve_maybe("below", &self.below)?;
        let on = scope.resolve_one("on", &self.on)?;
        let mut global = scope.global(on);
        if self.at.is_finite() {
            global.translation = self.at;
        }
        global.rotation *= Quat::from_rotation_z(self.turn.to_radians());
        let knob = scope.spawn_at(NodeType::Control, "knob", on, 0, below, global, &Creation::default())?;
        let control = ControlData {
            shape: "circle".into(),
            color: [1.0; 3],
            size: 0.1,
            offset: Trs::IDENTITY,
            fits: false,
            channels: Default::default(),
            limits: Limits::default(),
        };
        scope.set_control(knob, control);
        Ok(())
    }
}

fn modules() -> Arc<Modules> {
    let mut modules = rigsmith::modules::all();
    modules.add::<Knob>();
    Arc::new(modules)
}

/// A rig of joints (uid, parent, place in the rig's space) with tags from uid 100 on.
struct Bench {
    rig: Rig,
    next: u64,
}

impl Bench {
    fn new(joints: &[(u64, u64, [f32; 3])]) -> Self {
        let mut rig = Rig::new(Uid(1000), "rig");
        for (uid, parent, place) in joints {
            let parent = (*parent > 0).then_some(Uid(*parent));
            let above = parent.map_or(Vec3::ZERO, |parent| rig.position(parent));
            let rest = RestTransform::from_translation(Vec3::from(*place) - above);
            let joint = JointData { uid: Uid(*uid), label: Some(format!("j{uid}")), rest, ..Default::default() };
            let edit = RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX };
            rig.apply(&edit).unwrap();
        }
        Self { rig, next: 100 }
    }

    /// Adds a command to a joint; its tag.
    fn tag(&mut self, joint: u64, module: &str, params: &str) -> u64 {
        let uid = self.next;
        self.next += 1;
        let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
        let tag = TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind };
        self.rig.apply(&RigEdit::AddTag { joint: Uid(joint), tag: Box::new(tag), index: usize::MAX }).unwrap();
        uid
    }

    /// Builds, and checks that stepping back and forward gives the same.
    fn build(&self) -> BuiltRig {
        let mut builder = Builder::new(modules());
        builder.sync(&self.rig);
        let report = builder.run_all();
        assert_eq!(report.error, None, "{}", report.error.as_ref().unwrap());
        let built = builder.built();
        let mut states = vec![built.clone()];
        while builder.cursor() > 0 {
            builder.step_back();
            states.push(builder.built());
        }
        let bare: Vec<Uid> = states.last().unwrap().nodes.iter().map(|node| node.uid).collect();
        assert_eq!(bare, self.rig.walk().map(|joint| joint.data.uid).collect::<Vec<_>>(), "nothing is left behind");
        for state in states.iter().rev() {
            assert_eq!(builder.built(), *state);
            builder.step_forward();
        }
        assert_eq!(builder.built(), built);
        built
    }

    fn error(&self) -> String {
        Builder::build(&self.rig, &modules()).unwrap_err().to_string()
    }

    fn play(&self) -> Play {
        let built = self.build();
        let program = RigProgram::compile(&built, &CompileOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let mut state = RigState::new(Arc::new(program));
        state.evaluate(0.0);
        Play { built, state }
    }
}

/// A built rig that is posed.
struct Play {
    built: BuiltRig,
    state: RigState,
}

impl Play {
    fn role(&self, command: u64, role: &str) -> Uid {
        self.built.find_role(Uid(command), role).next().unwrap_or_else(|| panic!("no {role} of {command}")).uid
    }

    fn knob(&self, command: u64) -> Uid {
        self.role(command, "knob")
    }

    fn at(&mut self, node: Uid) -> Trs {
        self.state.evaluate(0.0);
        self.state.global(node).unwrap()
    }

    fn joint(&mut self, joint: u64) -> Trs {
        self.at(Uid(joint))
    }

    fn pose(&mut self, node: Uid, translation: [f32; 3], turn: Quat) {
        let offset = PoseOffset { translation: translation.into(), rotation: turn, scale: Vec3::ONE };
        self.state.set_offset(node, offset).unwrap();
    }

    fn value(&mut self, node: Uid, name: &str, value: f32) {
        self.state.set_attribute(node, name, value).unwrap();
    }

    /// Throws the first switch.
    fn match_switch(&mut self, value: f32) -> MatchedSwitch {
        let thrown = match_switch(&self.built, &self.state, &self.built.switches[0], value).unwrap();
        for edit in &thrown.edits {
            match edit {
                RigEdit::SetOffset(node, offset) => self.state.set_offset(*node, offset.unwrap_or_default()).unwrap(),
                RigEdit::SetAttributeValue(node, name, value) => {
                    self.state.set_attribute(*node, name, value.unwrap()).unwrap();
                }
                other => panic!("{other:?}"),
            }
        }
        thrown
    }
}

fn near(a: Vec3, b: Vec3, what: &str) {
    assert!(a.distance(b) < 2e-4, "{what}: {a} and not {b}");
}

fn degrees(a: Quat, b: Quat) -> f32 {
    let between = a.conjugate() * b;
    2.0 * between.xyz().length().atan2(between.w.abs()).to_degrees()
}

/// An arm along X, elbow slightly back.
const ARM: [(u64, u64, [f32; 3]); 4] =
    [(1, 0, [0.0, 1.0, 0.0]), (2, 1, [0.2, 1.4, 0.0]), (3, 2, [0.5, 1.4, -0.05]), (4, 3, [0.8, 1.4, 0.0])];

#[test]
fn every_module_tells_about_each_parameter() {
    for module in rigsmith::modules::all().iter() {
        assert!(!module.doc.is_empty(), "{}", module.name);
        for parameter in &module.parameters {
            assert!(parameter.doc.len() > 8, "{}: {} is not explained", module.name, parameter.name);
        }
        module.parse("()").unwrap_or_else(|error| panic!("{}: {error}", module.name));
        module.mirrored("()").unwrap_or_else(|error| panic!("{}: {error}", module.name));
        assert!(module.parse("(no_such_thing: 1)").is_err(), "{}", module.name);
    }
}

#[test]
fn forms_edit_what_modules_have() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/modules");
    let names = [
        "driven_key",
        "expression",
        "half_joint",
        "ik_fk_switch",
        "ik_handle",
        "morph",
        "reverse_foot",
        "space_switch",
        "spline_ik",
        "spring",
        "stretch",
        "twist",
    ];
    let modules = rigsmith::modules::all();
    for name in names {
        let module = modules.get(name).unwrap();
        let form = std::fs::read(folder.join(format!("{name}.ui.ron"))).unwrap();
        let form = read_module_form(&form, module).unwrap_or_else(|error| panic!("{name}: {error}"));
        let edited: Vec<&str> = form
            .elements()
            .iter()
            .filter_map(|e| e.bound())
            .map(|(param, _)| param.split('.').next().unwrap())
            .collect();
        for parameter in &module.parameters {
            assert!(edited.contains(&parameter.name), "{name}: nothing edits {}", parameter.name);
        }
        let icon = std::fs::read_to_string(folder.join(format!("{name}.svg"))).unwrap();
        assert!(icon.starts_with("<svg") && icon.contains("viewBox=\"0 0 24 24\""), "{name}");
    }
}

fn knob(tag: u64) -> String {
    format!("@command #{tag:016x} role:knob")
}

fn joint(uid: u64) -> String {
    format!("@joint #{uid:016x}")
}

#[test]
fn an_arm_reaches_its_goal_and_bends_to_its_pole() {
    for (end, solver) in [(4, "auto"), (4, "two_bone"), (4, "fabrik"), (4, "ccd")] {
        let mut bench = Bench::new(&ARM);
        let goal = bench.tag(4, "knob", "()");
        let pole = bench.tag(3, "knob", "(at: (0.5, 1.4, -0.6))");
        bench.tag(
            4,
            "ik_handle",
            &format!(
                "(start: \"@joint #0000000000000002\", end: \"{}\", goal: \"{}\", pole: \"{}\", solver: {solver}, weight: \"ik\", iterations: 200)",
                joint(end),
                knob(goal),
                knob(pole)
            ),
        );
        let mut play = bench.play();
        let rest = play.joint(4);
        near(rest.translation, Vec3::new(0.8, 1.4, 0.0), "as built");
        let (goal, pole) = (play.knob(goal), play.knob(pole));
        play.pose(goal, [-0.3, 0.1, 0.2], Quat::from_rotation_x(0.7));
        near(play.joint(4).translation, play.state.global(goal).unwrap().translation, solver);
        assert!(degrees(play.joint(4).rotation, Quat::from_rotation_x(0.7)) < 0.1, "{solver}: turns with the goal");
        if solver == "two_bone" {
            play.pose(pole, [0.0, 1.0, 0.6], Quat::IDENTITY);
            assert!(play.joint(3).translation.y > 1.45, "the elbow goes up to its pole");
        }
        play.value(goal, "ik", 0.0);
        near(play.joint(4).translation, rest.translation, "without weight");
    }
}

#[test]
fn a_straight_chain_has_to_be_told_where_it_bends() {
    let straight = [(1, 0, [0.0, 1.0, 0.0]), (2, 1, [0.0, 0.5, 0.0]), (3, 2, [0.0, 0.0, 0.0])];
    let build = |extra: &str| {
        let mut bench = Bench::new(&straight);
        let goal = bench.tag(3, "knob", "()");
        bench.tag(
            3,
            "ik_handle",
            &format!("(start: \"{}\", end: \"{}\", goal: \"{}\", {extra})", joint(1), joint(3), knob(goal)),
        );
        (bench, goal)
    };
    let error = build("").0.error();
    assert!(error.contains("straight") && error.contains("prefer"), "{error}");
    let error = build("prefer: (0, -1, 0)").0.error();
    assert!(error.contains("across"), "{error}");
    let (bench, goal) = build("prefer: (0, 0.2, 1)");
    let mut play = bench.play();
    let goal = play.knob(goal);
    play.pose(goal, [0.0, 0.3, 0.0], Quat::IDENTITY);
    assert!(play.joint(2).translation.z > 0.2, "the knee goes forwards");
    near(play.joint(3).translation, Vec3::new(0.0, 0.3, 0.0), "the ankle is on its goal");
}

#[test]
fn stretch_and_soft_follow_attributes() {
    let mut bench = Bench::new(&ARM);
    let goal = bench.tag(4, "knob", "()");
    bench.tag(
        4,
        "ik_handle",
        &format!(
            "(start: \"@joint #0000000000000002\", end: \"{}\", goal: \"{}\", stretch: \"stretch\", soft: \"soft\")",
            joint(4),
            knob(goal)
        ),
    );
    let mut play = bench.play();
    let goal = play.knob(goal);
    play.pose(goal, [0.3, 0.0, 0.0], Quat::IDENTITY);
    let length = 2.0 * Vec3::new(0.3, 0.0, 0.05).length();
    let reach = |play: &mut Play| play.joint(4).translation.distance(Vec3::new(0.2, 1.4, 0.0));
    assert!((reach(&mut play) - length).abs() < 1e-4);
    play.value(goal, "stretch", 1.0);
    assert!((reach(&mut play) - 0.9).abs() < 1e-4);
    play.value(goal, "stretch", 0.0);
    play.value(goal, "soft", 0.3);
    assert!(reach(&mut play) < length - 1e-3);
}

#[test]
fn mistakes_say_what_to_do() {
    let two = format!("{} + {}", joint(2), joint(3));
    let ends = format!("start: \"{}\", end: \"{}\"", joint(2), joint(4));
    let goal = |tag: u64| format!("goal: \"{}\"", knob(tag));
    // Module, parameters, and what the error names.
    let table: Vec<(&str, String, &[&str])> = vec![
        ("ik_handle", "()".into(), &["end", "is needed"]),
        ("ik_handle", format!("({ends})"), &["goal", "is needed"]),
        ("ik_handle", format!("({ends}, goal: \"{}\")", joint(3)), &["goal", "j3", "control"]),
        ("ik_handle", format!("({ends}, {}, soft: 2.0)", goal(100)), &["soft", "from 0 to 1"]),
        ("ik_handle", format!("({ends}, {}, max_stretch: 0.5)", goal(100)), &["max_stretch", "not below 1"]),
        ("ik_handle", format!("({ends}, {}, solver: fabrik, soft: 0.1)", goal(100)), &["soft", "two bones"]),
        ("ik_handle", format!("({ends}, {}, limits: [((1, 2), (), ())])", goal(100)), &["parameters"]),
        (
            "ik_handle",
            format!("({ends}, {}, limits: [((1.0, 2.0), (None, None), (None, None))])", goal(100)),
            &["limits", "ccd"],
        ),
        (
            "ik_handle",
            format!("({ends}, {}, solver: ccd, limits: [((3.0, 2.0), (None, None), (None, None))])", goal(100)),
            &["limits", "lower angle first"],
        ),
        (
            "ik_handle",
            format!("(start: \"{}\", end: \"{}\", {}, solver: two_bone)", joint(1), joint(4), goal(100)),
            &["solver", "4", "fabrik"],
        ),
        ("ik_handle", format!("(start: \"{}\", end: \"{}\", {})", joint(4), joint(2), goal(100)), &["not below"]),
        ("ik_fk_switch", format!("({ends}, {}, fk: \"{}\")", goal(100), knob(100)), &["fk", "1 controls", "3 joints"]),
        ("spline_ik", format!("({ends}, points: \"{}\")", knob(100)), &["points", "two or more"]),
        ("spline_ik", format!("({ends}, points: \"{two}\")"), &["points", "joint of the chain"]),
        ("space_switch", format!("(control: \"{}\", spaces: \"{two}\", names: [\"a\"])", knob(100)), &["names", "1"]),
        (
            "space_switch",
            format!("(control: \"{}\", spaces: \"{two}\", default: 2)", knob(100)),
            &["default", "0 to 1"],
        ),
        ("reverse_foot", format!("(ankle: \"{}\")", joint(2)), &["ball", "is needed"]),
        ("twist", format!("({ends}, count: 0)"), &["count", "1 to 64"]),
        ("twist", format!("({ends}, shares: [1.0])"), &["shares", "2 joints"]),
        ("stretch", format!("({ends}, min: 0.0)"), &["min"]),
        ("stretch", format!("(start: \"{}\", end: \"{}\")", joint(2), joint(2)), &["end", "apart"]),
        ("spring", "(rotate: false)".into(), &["rotate", "turn on"]),
        ("spring", "(frequency: \"hz\", nodes: \"@none\")".into(), &["nodes", "is needed"]),
        ("driven_key", format!("(driver: \"{}\")", knob(100)), &["driver", "RotateX"]),
        (
            "driven_key",
            format!("(driver: \"{}\", driver_attribute: \"crul\")", knob(100)),
            &["crul", "curl", "did you mean"],
        ),
        (
            "driven_key",
            format!("(driver: \"{}\", driver_channel: RotateX, keys: [(1.0, 0.0), (0.0, 1.0)])", knob(100)),
            &["keys", "sort"],
        ),
        (
            "driven_key",
            format!("(driver: \"{}\", driver_channel: RotateX, output: \"@this\")", knob(100)),
            &["output", "what is driven"],
        ),
        ("pole_vector", "(distance: 0.0)".into(), &["distance: is 0; write a number above 0"]),
        ("pole_vector", "(distance: -1e-9)".into(), &["distance: is -1e-9; write a number above 0"]),
        ("morph", "()".into(), &["morph", "empty"]),
        ("expression", "(text: \"a + \", output: \"@this\", output_channel: RotateX)".into(), &["text", "column"]),
        (
            "expression",
            "(text: \"clamp(a, 0)\", inputs: [(name: \"a\", node: \"@this\", channel: RotateX)])".into(),
            &["text", "clamp", "arguments"],
        ),
        ("expression", "(text: \"1\", inputs: [(name: \"2x\")])".into(), &["inputs", "2x"]),
    ];
    for (module, params, parts) in table {
        let mut bench = Bench::new(&ARM);
        bench.tag(4, "knob", "()");
        bench.tag(4, "attribute", &format!("(node: \"{}\", name: \"curl\")", knob(100)));
        bench.tag(4, module, &params);
        let error = bench.error();
        for part in parts {
            assert!(error.contains(part), "{module} {params}: {error} does not say {part}");
        }
    }
}

/// An arm with a switch; tags: three forward controls, goal, pole, the switch.
fn arm_with_switch(extra: &str) -> (Bench, [u64; 5]) {
    let mut bench = Bench::new(&ARM);
    let upper = bench.tag(2, "knob", &format!("(below: \"{}\", turn: 20)", joint(1)));
    let lower = bench.tag(3, "knob", &format!("(below: \"{}\", turn: -30)", knob(upper)));
    let hand = bench.tag(4, "knob", &format!("(below: \"{}\", turn: 10)", knob(lower)));
    let goal = bench.tag(4, "knob", "(turn: 45)");
    let pole = bench.tag(4, "knob", "(at: (0.5, 1.4, -0.6))");
    bench.tag(
        4,
        "ik_fk_switch",
        &format!(
            "(start: \"{}\", end: \"{}\", fk: \"{} + {} + {}\", goal: \"{}\"{extra})",
            joint(2),
            joint(4),
            knob(upper),
            knob(lower),
            knob(hand),
            knob(goal)
        ),
    );
    (bench, [upper, lower, hand, goal, pole])
}

#[test]
fn what_is_posed_waits_for_its_node() {
    let (mut bench, tags) = arm_with_switch("");
    let play = bench.play();
    let (goal, hand) = (play.knob(tags[3]), play.knob(tags[2]));
    let offset = PoseOffset { translation: Vec3::X, ..PoseOffset::IDENTITY };
    let edits = [
        RigEdit::SetOffset(goal, Some(offset)),
        RigEdit::SetAttributeValue(goal, "ik_fk".into(), Some(0.25)),
        RigEdit::SetAttributeValue(hand, "odd \"name\"".into(), Some(-0.0)),
        RigEdit::SetOffset(goal, None),
        RigEdit::SetAttributeValue(goal, "ik_fk".into(), None),
        RigEdit::SetOffset(hand, Some(offset)),
        RigEdit::SetAttributeValue(goal, "ik_fk".into(), Some(0.5)),
    ];
    let start = bench.rig.clone();
    let mut inverses = Vec::new();
    for edit in &edits {
        let before = bench.rig.clone();
        let inverse = bench.rig.apply(edit).unwrap();
        let after = bench.rig.clone();
        let again = bench.rig.apply(&inverse).unwrap();
        assert_eq!(bench.rig, before);
        bench.rig.apply(&again).unwrap();
        assert_eq!(bench.rig, after);
        inverses.push(inverse);
    }
    assert_eq!(bench.rig.attribute_value(goal, "ik_fk"), Some(0.5));
    assert_eq!(bench.rig.offset(hand), Some(&offset));
    // The commands are gone, and what was posed is not.
    for joint in [2, 3, 4] {
        for tag in bench.rig.joint(Uid(joint)).unwrap().data.tags.clone() {
            inverses.push(bench.rig.apply(&RigEdit::RemoveTag(Uid(joint), tag.uid)).unwrap());
        }
    }
    assert_eq!(bench.rig.offset(hand), Some(&offset));
    let mut copy = Rig::new(bench.rig.uid(), "");
    for edit in edits_from_empty(&bench.rig) {
        copy.apply(&edit).unwrap();
    }
    assert_eq!(copy, bench.rig);
    for inverse in inverses.iter().rev() {
        bench.rig.apply(inverse).unwrap();
    }
    assert_eq!(bench.rig, start);
}
