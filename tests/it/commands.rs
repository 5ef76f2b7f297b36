//! The command processor in an app: tags and created nodes as entities, requests, reports.

use bevy::{ecs::entity_disabling::Disabled, prelude::*};
use rigsmith::{
    plugins::{
        commands::{
            BuildDone, BuildFailure, BuildStep, BuiltEntities, CommandReport, CommandTag, CreatedBy, CreatedRole,
            FeatureTag, InFeature, Null, ParkedNode, RegisterRigModule, TagEntities, TagOf, Tags,
        },
        document::{Change, JointEntities},
    },
    prelude::*,
    processor::CommandState,
    rig::{JointData, RestTransform, RigEdit, TagData, TagKind},
    test_app::test_app,
};

use crate::{
    bench::RigBench,
    processor::{Mark, Nudge},
};

impl RigBench {
    /// Three joints below one another, in an app with two modules of the tests.
    fn with_modules() -> Self {
        let mut app = test_app();
        app.register_rig_module::<Mark>().register_rig_module::<Nudge>();
        let mut bench = Self::with(app, Rig::new(Uid(1000), "rig"));
        for number in 1..=3 {
            let joint = JointData {
                uid: Uid(number),
                label: Some(format!("j{number}")),
                rest: RestTransform::from_translation(Vec3::Y),
                ..default()
            };
            let parent = (number > 1).then(|| Uid(number - 1));
            bench.apply(RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 });
        }
        bench
    }

    fn tag(&mut self, joint: u64, uid: u64, module: &str, params: &str, feature: Option<u64>) {
        let kind = TagKind::Command { module: module.into(), params: params.into(), feature: feature.map(Uid) };
        let tag = TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind };
        self.apply(RigEdit::AddTag { joint: Uid(joint), tag: Box::new(tag), index: usize::MAX });
    }

    fn tag_entity(&self, tag: u64) -> Entity {
        self.get::<TagEntities>(self.rig).unwrap().get(Uid(tag)).unwrap()
    }

    fn created_nodes(&self) -> Vec<(Uid, Entity)> {
        self.get::<BuiltEntities>(self.rig).map(|nodes| nodes.iter().collect()).unwrap_or_default()
    }
}

#[test]
fn tags_are_entities_below_their_joint_in_order() {
    let mut bench = RigBench::with_modules();
    let kind =
        TagKind::Feature { kind: "generic".into(), name: "marks".into(), switch: String::new(), choice: String::new() };
    let tag = TagData { uid: Uid(50), enabled: true, comment: "why".into(), kind };
    bench.apply(RigEdit::AddTag { joint: Uid(1), tag: Box::new(tag), index: 0 });
    bench.tag(1, 51, "mark", "()", Some(50));
    bench.tag(1, 52, "mark", "(up: 1.0)", None);
    let joint = bench.get::<JointEntities>(bench.rig).unwrap().get(Uid(1)).unwrap();
    let order = |bench: &RigBench| -> Vec<u64> {
        bench.get::<Tags>(joint).unwrap().iter().map(|tag| bench.get::<Uid>(tag).unwrap().0).collect()
    };
    assert_eq!(order(&bench), [50, 51, 52]);
    assert_eq!(bench.get::<FeatureTag>(bench.tag_entity(50)).unwrap().name, "marks");
    assert_eq!(bench.get::<CommandTag>(bench.tag_entity(52)).unwrap().params, "(up: 1.0)");
    assert_eq!(bench.get::<InFeature>(bench.tag_entity(51)).unwrap().0, bench.tag_entity(50));
    let kept = bench.tag_entity(52);

    // Another order, another joint, and gone.
    let tag = bench.get::<Rig>(bench.rig).unwrap().joint(Uid(1)).unwrap().data.tags[2].clone();
    bench.apply(RigEdit::Batch(vec![
        RigEdit::RemoveTag(Uid(1), Uid(52)),
        RigEdit::AddTag { joint: Uid(1), tag: Box::new(tag), index: 0 },
    ]));
    assert_eq!((order(&bench), bench.tag_entity(52)), (vec![52, 50, 51], kept));
    bench.apply(RigEdit::RemoveTag(Uid(1), Uid(51)));
    assert_eq!(order(&bench), [52, 50]);
    bench.change(Change::Undo);
    assert_eq!(order(&bench), [52, 50, 51]);
    assert_eq!(bench.get::<TagOf>(bench.tag_entity(51)).unwrap().0, joint);
}

#[test]
fn created_nodes_keep_their_entities_through_rolling_back() {
    let mut bench = RigBench::with_modules();
    bench.tag(1, 51, "mark", r#"(at: "@joints", below: true)"#, None);
    bench.tag(2, 52, "nudge", "()", None);
    assert!(bench.created_nodes().is_empty(), "nobody has asked for it to be built");
    bench.step(BuildStep::All);
    let nodes = bench.created_nodes();
    assert_eq!(nodes.len(), 3);
    let joints = bench.get::<JointEntities>(bench.rig).unwrap();
    for (_, entity) in &nodes {
        let role = bench.get::<CreatedRole>(*entity).unwrap();
        assert_eq!(role.role, "mark");
        assert_eq!(Some(bench.get::<ChildOf>(*entity).unwrap().parent()), joints.get(role.subject));
        assert_eq!(bench.get::<CreatedBy>(*entity).unwrap().0, bench.tag_entity(51));
        assert!(bench.get::<Null>(*entity).is_some());
    }
    bench.step(BuildStep::RollBack);
    for (uid, entity) in &nodes {
        assert!(bench.get::<ParkedNode>(*entity).is_some() && bench.get::<Disabled>(*entity).is_some());
        assert!(bench.get::<ChildOf>(*entity).is_none() && bench.get::<Null>(*entity).is_none());
        assert_eq!(bench.get::<BuiltEntities>(bench.rig).unwrap().any(*uid), Some(*entity));
    }
    assert!(bench.created_nodes().is_empty());
    bench.step(BuildStep::All);
    assert_eq!(bench.created_nodes(), nodes);
    assert!(bench.get::<ParkedNode>(nodes[0].1).is_none() && bench.get::<Null>(nodes[0].1).is_some());
    // An inserted joint leaves the others' nodes alone.
    let joint = JointData { uid: Uid(9), ..default() };
    bench.apply(RigEdit::AddJoint { joint: Box::new(joint), parent: Some(Uid(1)), index: 0 });
    let more = bench.created_nodes();
    assert_eq!(more.len(), 4);
    assert!(nodes.iter().all(|node| more.contains(node)));
}

#[test]
fn nodes_of_commands_that_left_the_history_are_despawned() {
    let mut bench = RigBench::with_modules();
    bench.tag(2, 52, "mark", "()", None);
    bench.step(BuildStep::All);
    let kept = bench.created_nodes();
    bench.tag(1, 51, "mark", "()", None);
    let added: Vec<_> = bench.created_nodes().into_iter().filter(|node| !kept.contains(node)).collect();
    assert_eq!(added.len(), 1);
    let (uid, entity) = added[0];
    let is_known = |bench: &RigBench| bench.get::<BuiltEntities>(bench.rig).unwrap().any(uid) == Some(entity);
    // Undone, it can come back; deleted in a step that can be undone, too.
    bench.change(Change::Undo);
    assert!(is_known(&bench) && bench.get::<ParkedNode>(entity).is_some());
    bench.change(Change::Redo);
    assert!(is_known(&bench) && bench.get::<ParkedNode>(entity).is_none());
    bench.apply(RigEdit::RemoveTag(Uid(1), Uid(51)));
    bench.apply(RigEdit::SetLabel(Uid(1), Some("other".into())));
    assert!(is_known(&bench) && bench.get::<ParkedNode>(entity).is_some());
    (0..3).for_each(|_| bench.change(Change::Undo));
    assert!(is_known(&bench), "a redo would restore the command");
    // A new step discards the undone ones, among them the only one that adds the command.
    bench.apply(RigEdit::SetLabel(Uid(1), Some("another".into())));
    assert!(!is_known(&bench) && bench.app.world().get_entity(entity).is_err());
    assert_eq!(bench.created_nodes(), kept);
}

#[test]
fn states_errors_and_times_are_on_the_tags() {
    let mut bench = RigBench::with_modules();
    bench.tag(1, 51, "mark", "()", None);
    bench.tag(2, 52, "mark", "(up: 99.0)", None);
    bench.tag(3, 53, "mark", "()", None);
    bench.step(BuildStep::All);
    let states = |bench: &RigBench| {
        [51, 52, 53].map(|tag| bench.get::<CommandReport>(bench.tag_entity(tag)).map(|report| report.0.state))
    };
    use CommandState::{Done, Failed, Pending};
    assert_eq!(states(&bench), [Some(Done), Some(Failed), Some(Pending)]);
    let report = bench.get::<CommandReport>(bench.tag_entity(52)).unwrap();
    assert!(report.0.error.as_ref().unwrap().to_string().contains("from 0 to 10"));
    assert_eq!(bench.get::<BuildFailure>(bench.rig).unwrap().0.command, Uid(52));
    assert_eq!(bench.created_nodes().len(), 1);

    // Mended by an edit: built at once.
    let kind = TagKind::Command { module: "mark".into(), params: "(up: 9.0)".into(), feature: None };
    let tag = TagData { uid: Uid(52), enabled: true, comment: String::new(), kind };
    bench.apply(RigEdit::SetTag(Uid(2), Box::new(tag)));
    assert_eq!(states(&bench), [Some(Done); 3]);
    assert!(bench.get::<BuildFailure>(bench.rig).is_none());
    let done: Vec<BuildDone> = bench.messages();
    let executed: Vec<u64> = done.last().unwrap().report.executed.iter().map(|tag| tag.0).collect();
    assert_eq!(executed, [52, 53]);

    // Stepped by hand it stays where it is, whatever is edited.
    bench.step(BuildStep::Back);
    bench.tag(1, 54, "nudge", "()", None);
    assert_eq!(states(&bench)[2], Some(Pending));
    bench.step(BuildStep::All);
    assert_eq!(states(&bench), [Some(Done); 3]);
}
