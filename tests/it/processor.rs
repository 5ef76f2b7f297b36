//! The command processor: what runs, what is taken back, and that the result never depends on the way to it.

mod random;

use std::sync::Arc;

use bevy::reflect::Reflect;
use rigsmith::{
    mesh::model::Trs,
    processor::{
        BuildProblem, BuildRange, BuildScope, Builder, CommandState, Creation, ModuleError, Modules, NodeId, RigModule,
    },
    rig::{
        BuiltRig, Constraint, GroupData, JointData, NodeType, RestTransform, Rig, RigEdit, Scalar, TagData, TagKind,
        Target, Uid,
        reference::{NodeRef, NodeRefs, Source},
    },
};
use serde::{Deserialize, Serialize};

/// A null at every node that is named: a module from outside the crate.
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mark {
    at: NodeRefs,
    below: bool,
    up: f32,
    create: Creation,
}

impl Default for Mark {
    fn default() -> Self {
        Self { at: NodeRef::this().into(), below: false, up: 0.0, create: Creation::default() }
    }
}

impl RigModule for Mark {
    const NAME: &'static str = "mark";
    const DOC: &'static str = "Puts a null at nodes.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[];

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if !(0.0..=10.0).contains(&self.up) {
            return Err(ModuleError::parameter("up", "write a number from 0 to 10"));
        }
        for node in scope.resolve_some("at", &self.at)? {
            let mut global = scope.global(node);
            global.translation.y += self.up;
            let parent = self.below.then_some(node);
            scope.spawn_at(NodeType::Null, "mark", node, 0, parent, global, &self.create)?;
        }
        Ok(())
    }
}

/// One node follows others.
#[derive(Reflect, Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Follow {
    node: NodeRefs,
    targets: NodeRefs,
}

impl RigModule for Follow {
    const NAME: &'static str = "follow";
    const DOC: &'static str = "Lets a node follow others.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[];

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let driven = scope.resolve_one("node", &self.node)?;
        let targets = scope.resolve_some("targets", &self.targets)?;
        let target = |node: NodeId, scope: &mut BuildScope<'_>| Target {
            node: scope.uid(node),
            weight: Scalar::Value(1.0),
            offset: Trs::IDENTITY,
        };
        let targets = targets.into_iter().map(|node| target(node, scope)).collect();
        let constraint = Constraint::Transform {
            driven: scope.uid(driven),
            targets,
            translate: [true; 3],
            rotate: [true; 3],
            scale: [false; 3],
            weight: Scalar::Value(1.0),
            keep_pose: false,
        };
        scope.constrain("follow", driven, 0, constraint)?;
        Ok(())
    }
}

/// Moves a node of someone else, by as much as it has children.
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Nudge {
    node: NodeRefs,
    by: f32,
}

impl Default for Nudge {
    fn default() -> Self {
        Self { node: NodeRef::this().into(), by: 0.1 }
    }
}

impl RigModule for Nudge {
    const NAME: &'static str = "nudge";
    const DOC: &'static str = "Moves a node.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[];

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        for node in scope.resolve_some("node", &self.node)? {
            let mut base = scope.base(node);
            base.translation.x += self.by * scope.children(node).len() as f32;
            scope.set_base(node, base);
        }
        Ok(())
    }
}

pub fn modules() -> Arc<Modules> {
    let mut modules = rigsmith::modules::all();
    modules.add::<Mark>().add::<Follow>().add::<Nudge>();
    Arc::new(modules)
}

/// A chain of joints that lie one above the other, with uids from 1 and labels j1, j2, ...
fn chain(count: u64) -> Rig {
    let mut rig = Rig::new(Uid(1000), "rig");
    for number in 1..=count {
        let joint = JointData {
            uid: Uid(number),
            label: Some(format!("j{number}")),
            rest: RestTransform::from_translation([0.0, 1.0, 0.0].into()),
            ..Default::default()
        };
        let parent = (number > 1).then(|| Uid(number - 1));
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }).unwrap();
    }
    rig
}

fn command(uid: u64, module: &str, params: &str) -> Box<TagData> {
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    Box::new(TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind })
}

fn add(rig: &mut Rig, joint: u64, tag: Box<TagData>) {
    rig.apply(&RigEdit::AddTag { joint: Uid(joint), tag, index: usize::MAX }).unwrap();
}

fn started_builder(rig: &Rig) -> Builder {
    let mut builder = Builder::new(modules());
    builder.sync(rig);
    builder
}

fn change(rig: &mut Rig, builder: &mut Builder, edit: RigEdit) -> Vec<u64> {
    rig.apply(&edit).unwrap();
    builder.touch(rig, &edit);
    let report = builder.run_all();
    assert_eq!(report.error, None);
    assert_eq!(builder.built(), Builder::build(rig, &modules()).unwrap(), "as built from nothing");
    report.executed.iter().map(|uid| uid.0).collect()
}

fn names(built: &BuiltRig) -> Vec<String> {
    built.nodes.iter().map(|node| node.name.to_string()).collect()
}

/// j1 carries a mark on itself (101) and one on j3 that stands 2 above it (102); j2 nudges itself (103); j3 carries a
/// mark on the mark of 102 (104), and lets that follow the mark of 101 (105).
fn example() -> Rig {
    let mut rig = chain(3);
    add(&mut rig, 1, command(101, "mark", "()"));
    add(&mut rig, 1, command(102, "mark", r#"(at: "@joint #0000000000000003", up: 2.0)"#));
    add(&mut rig, 2, command(103, "nudge", "()"));
    add(&mut rig, 3, command(104, "mark", r#"(at: "@command #0000000000000066", below: true)"#));
    let follow = r#"(node: "@command #0000000000000068", targets: "@command #0000000000000065")"#;
    add(&mut rig, 3, command(105, "follow", follow));
    rig
}

#[test]
fn commands_run_parents_first_and_top_to_bottom() {
    let rig = example();
    let mut builder = started_builder(&rig);
    let list: Vec<u64> = builder.list().iter().map(|entry| entry.command.0).collect();
    assert_eq!(list, [101, 102, 103, 104, 105]);
    let report = builder.run_all();
    assert_eq!(report.executed, list.iter().map(|uid| Uid(*uid)).collect::<Vec<_>>());
    let built = builder.built();
    assert_eq!(names(&built), ["j1", "j2", "j3", "j1_mark", "j3_mark", "j3_mark_mark"]);
    assert_eq!(built.nodes[4].base.translation.y, 5.0);
    assert_eq!(built.nodes[5].parent, Some(4));
    assert_eq!(built.constraints.len(), 1);
    // Labels and groups are those of the joint that carries the tag.
    assert_eq!(built.nodes[4].label.as_deref(), Some("j1"));
}

#[test]
fn only_what_depends_on_an_edit_runs() {
    let mut rig = example();
    let mut builder = started_builder(&rig);
    builder.run_all();
    let set = |uid, module: &str, params: &str, joint| RigEdit::SetTag(Uid(joint), command(uid, module, params));
    let at_j3 = |up: &str| format!(r#"(at: "@joint #0000000000000003", up: {up})"#);
    // 103 comes after 102 and moves what 102 stood on before: it does not matter for 102.
    let cases: Vec<(RigEdit, Vec<u64>)> = vec![
        (set(102, "mark", &at_j3("3.0"), 1), vec![102, 104]),
        // The same again: nothing at all.
        (set(102, "mark", &at_j3("3.0"), 1), vec![]),
        // Written otherwise, with the same result: what follows is cut off.
        (set(102, "mark", &at_j3("3.00"), 1), vec![102]),
        (set(103, "nudge", "(by: 0.5)", 2), vec![103]),
        (RigEdit::SetRest(Uid(3), RestTransform::from_translation([0.0, 2.0, 0.0].into())), vec![102, 104]),
        // A label is not what anything here is found by; but nodes take it on.
        (RigEdit::SetLabel(Uid(3), Some("tip".into())), vec![104]),
        (
            RigEdit::SetOffset(
                Uid(3),
                Some(rigsmith::rig::PoseOffset::from_rotation(bevy::math::Quat::from_rotation_x(1.0))),
            ),
            vec![],
        ),
    ];
    for (edit, expected) in cases {
        assert_eq!(change(&mut rig, &mut builder, edit.clone()), expected, "{edit:?}");
    }
}

#[test]
fn stepping_back_and_forth_is_exact_and_runs_nothing_twice() {
    let rig = example();
    let mut builder = started_builder(&rig);
    let mut views = vec![builder.built()];
    for place in 1..=5 {
        let report = builder.step_forward();
        assert_eq!((report.executed.len(), report.cursor), (1, place));
        views.push(builder.built());
    }
    for place in (0..5).rev() {
        assert_eq!(builder.step_back().executed, []);
        assert_eq!(builder.built(), views[place]);
    }
    assert_eq!(builder.joint_forward().cursor, 2, "the two of the first joint");
    assert_eq!(builder.built(), views[2]);
    assert_eq!(builder.joint_forward().cursor, 3);
    assert_eq!(builder.joint_forward().cursor, 5);
    assert_eq!(builder.joint_back().cursor, 3);
    assert_eq!(builder.roll_back().cursor, 0);
    assert_eq!(builder.built(), views[0]);
    builder.set_breakpoint(Uid(103), true);
    assert_eq!(builder.run().cursor, 2, "before the breakpoint");
    assert_eq!(builder.run().cursor, 5, "and over it");
    assert_eq!(builder.built(), views[5]);
    assert_eq!(builder.status(Uid(103)).unwrap().runs, 1);
}

#[test]
fn a_failing_command_halts_the_build_where_it_is() {
    let mut rig = example();
    let mut builder = started_builder(&rig);
    builder.run_all();
    let bad = RigEdit::SetTag(Uid(2), command(103, "nudge", r#"(node: "@module mrak")"#));
    rig.apply(&bad).unwrap();
    builder.touch(&rig, &bad);
    let report = builder.run_all();
    let error = report.error.unwrap();
    assert_eq!((error.command, error.joint, &*error.module), (Uid(103), Uid(2), "nudge"));
    let text = error.to_string();
    assert!(text.contains("j2") && text.contains("@module mrak") && text.contains("mark"), "{text}");
    assert_eq!(builder.cursor(), 2);
    let states: Vec<CommandState> =
        builder.list().iter().map(|entry| builder.status(entry.command).unwrap().state).collect();
    use CommandState::{Done, Failed, Pending};
    assert_eq!(states, [Done, Done, Failed, Pending, Pending]);
    assert_eq!(names(&builder.built()), ["j1", "j2", "j3", "j1_mark", "j3_mark"], "what was before stands");
    // Nothing behind it ran, in a build from nothing neither.
    let mut fresh = started_builder(&rig);
    assert_eq!(fresh.run_all().executed.len(), 3);
    assert_eq!(fresh.built(), builder.built());
    // Mended: the others are still as they were, and need not run.
    assert_eq!(change(&mut rig, &mut builder, RigEdit::SetTag(Uid(2), command(103, "nudge", "()"))), [103]);
}

#[test]
fn errors_say_what_to_do() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("markk", "()", &["no module \"markk\"", "mark", "register it"]),
        ("mark", "(upp: 1.0)", &["line 1", "upp", "up"]),
        ("mark", "(up: true)", &["line 1, column 5"]),
        ("mark", "(up: 11.0)", &["up", "from 0 to 10"]),
        ("mark", r#"(at: "@joint #00000000000000ff")"#, &["at", "no joint 00000000000000ff", "deleted"]),
        (
            "mark",
            r#"(at: "@joint jj2#00000000000000ff")"#,
            &["@joint jj2#00000000000000ff", "the joint \"jj2\" is gone; did you mean \"j2\""],
        ),
        ("mark", r#"(at: "@none")"#, &["at", "is needed"]),
        ("mark", r#"(at: "@any rig:#0000000000000bad")"#, &["another rig", "merge"]),
        ("follow", r#"(node: "@joints", targets: "@this")"#, &["node", "3 nodes (j1, j2, j3)", "pick:START"]),
        ("mark", r#"(create: (global_group: "0000000000000bad"))"#, &["global_group", "another rig"]),
        ("follow", r#"(node: "@this", targets: "@joint #0000000000000003")"#, &["in a circle", "j3", "j2", "remove"]),
        ("mark", r#"(at: "@joints pick:7")"#, &["7", "3"]),
        ("mark", r#"(at: "joint")"#, &["line 1", "@"]),
    ];
    for (module, params, parts) in cases {
        let mut rig = chain(3);
        add(&mut rig, 2, command(101, module, params));
        let error = Builder::build(&rig, &modules()).unwrap_err();
        let text = error.to_string();
        assert!(parts.iter().all(|part| text.contains(part)), "{module} {params}: {text}");
    }
    let mut rig = chain(1);
    add(&mut rig, 1, command(101, "nothing_like_it", "()"));
    let error = Builder::build(&rig, &modules()).unwrap_err();
    assert!(matches!(error.problem, BuildProblem::NoModule { .. }));
}

#[test]
fn circles_that_an_earlier_command_closes_are_found() {
    // 101 lets a mark follow j1; then something makes j1 follow that mark: the later of the two is refused.
    let mut rig = chain(2);
    add(&mut rig, 1, command(101, "mark", "()"));
    add(
        &mut rig,
        2,
        command(102, "follow", r#"(node: "@joint #0000000000000001", targets: "@command #0000000000000065")"#),
    );
    add(
        &mut rig,
        2,
        command(103, "follow", r#"(node: "@command #0000000000000065", targets: "@joint #0000000000000002", )"#),
    );
    let error = Builder::build(&rig, &modules()).unwrap_err();
    assert_eq!(error.command, Uid(103), "{error}");
    // The same, closed by an edit of the earlier one.
    let mut rig = chain(3);
    add(&mut rig, 1, command(101, "mark", "()"));
    add(
        &mut rig,
        1,
        command(102, "follow", r#"(node: "@joint #0000000000000003", targets: "@command #0000000000000065")"#),
    );
    add(
        &mut rig,
        2,
        command(103, "follow", r#"(node: "@command #0000000000000065", targets: "@joint #0000000000000001")"#),
    );
    let mut builder = started_builder(&rig);
    assert_eq!(builder.run_all().error, None);
    let closing =
        command(102, "follow", r#"(node: "@joint #0000000000000001", targets: "@command #0000000000000065")"#);
    let edit = RigEdit::SetTag(Uid(1), closing);
    rig.apply(&edit).unwrap();
    builder.touch(&rig, &edit);
    let report = builder.run_all();
    assert_eq!(report.error.as_ref().map(|error| error.command), Some(Uid(103)));
    let fresh = Builder::build(&rig, &modules()).unwrap_err();
    assert_eq!(report.error, Some(fresh));
}

#[test]
fn features_and_groups_switch_commands() {
    let mut rig = example();
    let feature = |enabled| {
        let kind = TagKind::Feature {
            kind: "generic".into(),
            name: "extra".into(),
            switch: String::new(),
            choice: String::new(),
        };
        Box::new(TagData { uid: Uid(200), enabled, comment: String::new(), kind })
    };
    rig.apply(&RigEdit::AddTag { joint: Uid(1), tag: feature(true), index: 0 }).unwrap();
    let kind = TagKind::Command { module: "nudge".into(), params: "()".into(), feature: Some(Uid(200)) };
    let tag = TagData { uid: Uid(103), enabled: true, comment: String::new(), kind };
    rig.apply(&RigEdit::SetTag(Uid(2), Box::new(tag))).unwrap();
    let mut builder = started_builder(&rig);
    builder.run_all();
    assert_eq!(change(&mut rig, &mut builder, RigEdit::SetTag(Uid(1), feature(false))), [0; 0]);
    assert_eq!(builder.status(Uid(103)).unwrap().state, CommandState::Skipped);
    assert_eq!(change(&mut rig, &mut builder, RigEdit::SetTag(Uid(1), feature(true))), [103]);

    // A group that is off takes its joints and their commands out; what hangs on them stays where it is.
    let group = |enabled| GroupData { uid: Uid(300), name: "middle".into(), color: [1.0; 3], enabled };
    rig.apply(&RigEdit::AddLocalGroup(group(true), 0)).unwrap();
    rig.apply(&RigEdit::SetGroup(Uid(2), Some(Uid(300)))).unwrap();
    builder.sync(&rig);
    builder.run_all();
    change(&mut rig, &mut builder, RigEdit::SetLocalGroup(group(false)));
    let built = builder.built();
    assert!(!names(&built).contains(&"j2".to_owned()));
    let j3 = built.find_label("j3").unwrap();
    assert_eq!((j3.parent, j3.base.translation.y), (Some(0), 2.0));
    change(&mut rig, &mut builder, RigEdit::SetLocalGroup(group(true)));
    assert!(names(&builder.built()).contains(&"j2".to_owned()));
}

#[test]
fn identities_outlive_what_happens_around_them() {
    let mut rig = chain(4);
    add(&mut rig, 1, command(101, "mark", r#"(at: "@joints")"#));
    let mut builder = started_builder(&rig);
    builder.run_all();
    let marks = |builder: &Builder| -> Vec<(Uid, Uid)> {
        let built = builder.built();
        let marks = built.nodes.iter().filter_map(|node| Some((node.origin.as_ref()?.subject, node.uid)));
        let mut marks: Vec<_> = marks.collect();
        marks.sort();
        marks
    };
    let before = marks(&builder);
    assert_eq!(before.len(), 4);
    // A joint between the second and the third.
    let between = JointData { uid: Uid(50), label: Some("between".into()), ..Default::default() };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(between), parent: Some(Uid(2)), index: 0 }).unwrap();
    rig.apply(&RigEdit::SetParent { joint: Uid(3), parent: Some(Uid(50)), index: 0 }).unwrap();
    rig.apply(&RigEdit::SetLabel(Uid(4), Some("renamed".into()))).unwrap();
    builder.sync(&rig);
    builder.run_all();
    let after = marks(&builder);
    assert_eq!(after.len(), 5);
    assert!(before.iter().all(|mark| after.contains(mark)), "the marks of the others are the same nodes");
}

#[test]
fn references_by_label_outlive_renaming() {
    let mut rig = chain(3);
    add(&mut rig, 1, command(101, "mark", r#"(at: "@joints label:j3#0000000000000003", up: 1.0)"#));
    let mut builder = started_builder(&rig);
    builder.run_all();
    assert_eq!(change(&mut rig, &mut builder, RigEdit::SetLabel(Uid(3), Some("head".into()))), [0; 0]);
    assert_eq!(builder.built().nodes.len(), 4);
}

#[test]
fn a_part_of_the_rig_is_built_alone() {
    let rig = example();
    let ids = |builder: &Builder| builder.list().iter().map(|entry| entry.command.0).collect::<Vec<_>>();
    let mut builder = Builder::new(modules());
    builder.set_range(BuildRange::Joints([Uid(1)].into()));
    builder.sync(&rig);
    assert_eq!(ids(&builder), [101, 102]);
    builder.run_all();
    assert_eq!(builder.built().nodes.len(), 5);
    builder.set_range(BuildRange::Hierarchy([Uid(2)].into()));
    builder.sync(&rig);
    assert_eq!(ids(&builder), [103, 104, 105]);
    let error = builder.run_all().error.unwrap();
    assert_eq!(error.command, Uid(104), "what it needs is outside: {error}");
}

#[test]
fn forward_references_find_what_is_made_in_between() {
    // Written before the command that makes the nodes exists, but run after it.
    let mut rig = chain(2);
    let refs: NodeRefs = NodeRef::from(Source::Module("mark".into())).into();
    let params = format!("(node: {:?}, by: 1.0)", refs.to_string());
    add(&mut rig, 2, command(102, "nudge", &params));
    let mut builder = started_builder(&rig);
    assert!(builder.run_all().error.is_some());
    assert_eq!(
        change(&mut rig, &mut builder, RigEdit::AddTag { joint: Uid(1), tag: command(101, "mark", "()"), index: 0 }),
        [101, 102]
    );
}
