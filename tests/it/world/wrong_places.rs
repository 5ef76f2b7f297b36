//! Parts of a rig that other code spawns or puts where no document can have them: told once, with the reason, and left
//! outside of the rig or put back.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        commands::BuiltEntities,
        document::{ChangeError, EntityWriteError, GroupEntities, TagEntities},
        schema::{
            CommandTag, Constrains, CreatedBy, FeatureTag, GroupOf, InFeature, InGroup, Joint, LocalGroup, NodeOf, Tag,
            TagOf,
        },
    },
    prelude::*,
    rig::{JointData, RestTransform, TagData, TagKind, template::write_template},
};

use super::{NEAR, RigBench, shipped};

/// Entities where something is put.
struct Places {
    rig: Entity,
    joint: Entity,
    control: Entity,
    command: Entity,
    group: Entity,
    constraint: Entity,
    /// Child of a joint that is no part of the rig.
    stranger: Entity,
    /// Another rig with a joint, a local group and a feature.
    other: Entity,
    foreign_joint: Entity,
    foreign_group: Entity,
    foreign_feature: Entity,
    /// Uids of the joint and of the command on it, and the kind of the constraint.
    root: Uid,
    tag: Uid,
    kind: &'static str,
}

/// A built arm beside another rig.
fn arm() -> (RigBench, Places) {
    let (_, document) = shipped().into_iter().find(|(name, _)| name == "arm").unwrap();
    let mut stage = RigBench::of_built(document);
    let rig = stage.rig;
    let root = stage.rig().roots()[0];
    let joint = stage.node(root).unwrap();
    let tag = stage.rig().joint(root).unwrap().data.tags[0].uid;
    let command = stage.get::<TagEntities>(rig).unwrap().get(tag).unwrap();
    let control = stage.control("arm_fk_l");
    let group_uid = stage.rig().groups()[0].uid;
    let group_entity = stage.get::<GroupEntities>(rig).unwrap().get(group_uid).unwrap();
    let built = stage.built();
    let kind = built.constraints[0].constraint.kind();
    let constraint = stage.get::<BuiltEntities>(rig).unwrap().constraint(built.constraints[0].uid).unwrap();
    let world = stage.app.world_mut();
    let stranger = world.spawn((Transform::default(), ChildOf(joint))).id();
    let other = world.spawn(Rig::new(Uid(0xBE51DE), "neighbour")).id();
    let foreign_joint = world.spawn((Joint, Transform::default(), ChildOf(other))).id();
    let foreign_group = world.spawn((group(), GroupOf(other))).id();
    let foreign_feature = world.spawn((feature("other"), TagOf(foreign_joint))).id();
    stage.frames(2);
    assert!(stage.get::<Uid>(foreign_group).is_some() && stage.get::<Uid>(foreign_feature).is_some());
    assert_eq!(refusals(&mut stage), NONE);
    let places = Places {
        rig,
        joint,
        control,
        command,
        group: group_entity,
        constraint,
        stranger,
        other,
        foreign_joint,
        foreign_group,
        foreign_feature,
        root,
        tag,
        kind,
    };
    (stage, places)
}

fn group() -> LocalGroup {
    LocalGroup { name: "mine".into(), color: [1.0, 0.0, 0.0], enabled: true }
}

fn feature(name: &str) -> FeatureTag {
    FeatureTag { kind: "generic".into(), name: name.into(), switch: String::new(), choice: String::new() }
}

fn null() -> CommandTag {
    CommandTag { module: "null".into(), params: "()".into() }
}

/// No refused write.
const NONE: [EntityWriteError; 0] = [];

/// Reasons of the writes that were refused since the last call; messages are kept for two frames.
fn refusals(stage: &mut RigBench) -> Vec<EntityWriteError> {
    let told = stage.messages::<EditRefusal>().into_iter().map(|refusal| match refusal.reason {
        ChangeError::Entity(error) => error,
        other => panic!("another refusal: {other}"),
    });
    told.collect()
}

/// Reasons of the writes that are refused in three further frames.
fn refusals_later(stage: &mut RigBench) -> Vec<EntityWriteError> {
    let mut told = Vec::new();
    for _ in 0..3 {
        stage.app.update();
        told.extend(refusals(stage));
    }
    told
}

type Spawn = fn(&mut World, &Places) -> Entity;

#[test]
fn what_is_spawned_in_a_wrong_place_is_told_and_stays_outside() {
    let (mut stage, places) = arm();
    let table: [(&str, EntityWriteError, Spawn); 10] = [
        ("a joint below a control", EntityWriteError::JointParent, |world, places| {
            world.spawn((Joint, Transform::default(), ChildOf(places.control))).id()
        }),
        ("a joint below a tag", EntityWriteError::JointParent, |world, places| {
            world.spawn((Joint, Transform::default(), ChildOf(places.command))).id()
        }),
        ("a joint below a stranger below a joint", EntityWriteError::JointParent, |world, places| {
            world.spawn((Joint, Transform::default(), ChildOf(places.stranger))).id()
        }),
        ("a command on a control", EntityWriteError::TagBearer, |world, places| {
            world.spawn((null(), TagOf(places.control))).id()
        }),
        ("a feature on the rig", EntityWriteError::TagBearer, |world, places| {
            world.spawn((feature("mine"), TagOf(places.rig))).id()
        }),
        ("a command in a feature of another rig", EntityWriteError::ForeignFeature, |world, places| {
            world.spawn((null(), InFeature(places.foreign_feature), TagOf(places.joint))).id()
        }),
        ("a command in a command", EntityWriteError::ForeignFeature, |world, places| {
            world.spawn((null(), InFeature(places.command), TagOf(places.joint))).id()
        }),
        ("a command that is a feature", EntityWriteError::TagKinds, |world, places| {
            world.spawn((null(), feature("mine"), TagOf(places.joint))).id()
        }),
        ("a group on a joint", EntityWriteError::GroupBearer, |world, places| {
            world.spawn((group(), GroupOf(places.joint))).id()
        }),
        ("a group on a control", EntityWriteError::GroupBearer, |world, places| {
            world.spawn((group(), GroupOf(places.control))).id()
        }),
    ];
    let before = (write_template(stage.rig()), stage.steps());
    for (what, reason, spawn) in table {
        let entity = spawn(stage.app.world_mut(), &places);
        stage.app.update();
        assert_eq!(refusals(&mut stage), [reason], "{what}");
        assert_eq!(refusals_later(&mut stage), NONE, "{what}: told again");
        let spawned = stage.app.world().get_entity(entity).unwrap_or_else(|_| panic!("{what}: the entity is gone"));
        let relations = (spawned.contains::<ChildOf>(), spawned.contains::<TagOf>(), spawned.contains::<GroupOf>());
        assert_eq!(relations, (false, false, false), "{what}: it is outside");
        assert!(!spawned.contains::<Uid>(), "{what}: it is no part");
        assert_eq!((write_template(stage.rig()), stage.steps()), before, "{what}");
    }
}

type Write = fn(&mut World, &Places);
type Reason = fn(&Places) -> EntityWriteError;

fn built_content(name: &str, component: &'static str) -> EntityWriteError {
    EntityWriteError::BuiltContent { name: name.to_owned(), component }
}

#[test]
fn what_is_put_into_a_wrong_place_is_put_back_and_told() {
    let table: [(&str, Write, Reason); 13] = [
        (
            "a joint without its marker",
            |world, at| {
                world.entity_mut(at.joint).remove::<Joint>();
            },
            |at| EntityWriteError::JointMarker(at.root),
        ),
        (
            "a joint in a group of another rig",
            |world, at| {
                world.entity_mut(at.joint).insert(InGroup(at.foreign_group));
            },
            |at| EntityWriteError::ForeignGroup(at.root),
        ),
        (
            "a tag on a joint of another rig",
            |world, at| {
                world.entity_mut(at.command).insert(TagOf(at.foreign_joint));
            },
            |at| EntityWriteError::TagJoint(at.tag),
        ),
        (
            "a tag on a control",
            |world, at| {
                world.entity_mut(at.command).insert(TagOf(at.control));
            },
            |at| EntityWriteError::TagJoint(at.tag),
        ),
        (
            "a tag on nothing",
            |world, at| {
                world.entity_mut(at.command).remove::<TagOf>();
            },
            |at| EntityWriteError::TagJoint(at.tag),
        ),
        (
            "a tag without content",
            |world, at| {
                world.entity_mut(at.command).remove::<CommandTag>();
            },
            |at| EntityWriteError::TagContent(at.tag),
        ),
        (
            "a command in a feature of another rig",
            |world, at| {
                world.entity_mut(at.command).insert(InFeature(at.foreign_feature));
            },
            |at| EntityWriteError::TagContent(at.tag),
        ),
        (
            "a group of another rig",
            |world, at| {
                world.entity_mut(at.group).insert(GroupOf(at.other));
            },
            |_| EntityWriteError::GroupRig { name: "arm_l".into() },
        ),
        (
            "a group without content",
            |world, at| {
                world.entity_mut(at.group).remove::<LocalGroup>();
            },
            |_| EntityWriteError::GroupContent { name: "arm_l".into() },
        ),
        (
            "a despawned constraint",
            |world, at| world.entity_mut(at.constraint).despawn(),
            |at| EntityWriteError::CreatedConstraint { kind: at.kind },
        ),
        (
            "a constraint on another node",
            |world, at| {
                world.entity_mut(at.constraint).insert(Constrains(at.stranger));
            },
            |at| built_content(at.kind, "Constrains"),
        ),
        (
            "a control of another command",
            |world, at| {
                world.entity_mut(at.control).insert(CreatedBy(at.stranger));
            },
            |_| built_content("arm_fk_l", "CreatedBy"),
        ),
        (
            "a control of another rig",
            |world, at| {
                world.entity_mut(at.control).insert(NodeOf(at.other));
            },
            |_| built_content("arm_fk_l", "NodeOf"),
        ),
    ];
    for (what, write, reason) in table {
        let (mut stage, places) = arm();
        let constraint = *stage.get::<Uid>(places.constraint).unwrap();
        let relations = |stage: &RigBench| {
            let built = stage.get::<BuiltEntities>(stage.rig).unwrap();
            let constraint = built.constraint(constraint).and_then(|entity| stage.get::<Constrains>(entity)).copied();
            (
                (stage.get::<InGroup>(places.joint).copied(), stage.get::<GroupOf>(places.group).copied()),
                (stage.get::<TagOf>(places.command).copied(), stage.get::<InFeature>(places.command).copied()),
                (stage.get::<CreatedBy>(places.control).copied(), stage.get::<NodeOf>(places.control).copied()),
                (stage.get::<CommandTag>(places.command).cloned(), constraint),
            )
        };
        let before = (write_template(stage.rig()), stage.steps(), relations(&stage));
        write(stage.app.world_mut(), &places);
        stage.app.update();
        assert_eq!(refusals(&mut stage), [reason(&places)], "{what}");
        assert_eq!(refusals_later(&mut stage), NONE, "{what}: told again");
        assert_eq!((write_template(stage.rig()), stage.steps(), relations(&stage)), before, "{what}");
        let markers = (stage.get::<Joint>(places.joint).is_some(), stage.get::<LocalGroup>(places.group).is_some());
        assert_eq!(markers, (true, true), "{what}");
        let off = stage.off();
        assert!(off <= NEAR, "{what}: {off}");
    }
}

/// A joint with a group of another rig is added without it, and that is told.
#[test]
fn a_joint_that_is_spawned_into_a_foreign_group_is_in_none() {
    let (mut stage, places) = arm();
    let spawned = (Joint, Transform::from_xyz(0.0, 0.1, 0.0), ChildOf(places.joint), InGroup(places.foreign_group));
    let joint = stage.app.world_mut().spawn(spawned).id();
    stage.app.update();
    let uid = *stage.get::<Uid>(joint).expect("the joint is added");
    assert_eq!(refusals(&mut stage), [EntityWriteError::ForeignGroup(uid)]);
    assert_eq!(refusals_later(&mut stage), NONE);
    assert_eq!(stage.rig().joint(uid).unwrap().data.group, None);
    assert_eq!(stage.get::<InGroup>(joint), None);
    // One of its own rig is an edit.
    let own = stage.rig().groups()[0].uid;
    let entity = stage.get::<GroupEntities>(stage.rig).unwrap().get(own).unwrap();
    stage.app.world_mut().entity_mut(joint).insert(InGroup(entity));
    stage.app.update();
    assert_eq!(stage.rig().joint(uid).unwrap().data.group, Some(own));
    assert_eq!(refusals(&mut stage), NONE);
}

const FEATURE: Uid = Uid(70);
const COMMAND: Uid = Uid(71);
const OTHER_FEATURE: Uid = Uid(72);
const OTHER_COMMAND: Uid = Uid(73);

/// Three joints; the first has two features, the second two commands in the first feature.
fn chain() -> RigBench {
    let mut rig = Rig::new(Uid(1000), "rig");
    for number in 1..=3 {
        let rest = RestTransform::from_translation(Vec3::Y);
        let joint = JointData { uid: Uid(number), label: Some(format!("j{number}")), rest, ..default() };
        let parent = (number > 1).then(|| Uid(number - 1));
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }).unwrap();
    }
    let feature = |name: &str| TagKind::Feature {
        kind: "generic".into(),
        name: name.into(),
        switch: String::new(),
        choice: String::new(),
    };
    let command = || TagKind::Command { module: "null".into(), params: "()".into(), feature: Some(FEATURE) };
    let tags = [
        (Uid(1), FEATURE, feature("one")),
        (Uid(1), OTHER_FEATURE, feature("two")),
        (Uid(2), COMMAND, command()),
        (Uid(2), OTHER_COMMAND, command()),
    ];
    for (joint, uid, kind) in tags {
        let tag = Box::new(TagData { uid, enabled: true, comment: String::new(), kind });
        rig.apply(&RigEdit::AddTag { joint, tag, index: usize::MAX }).unwrap();
    }
    let mut stage = RigBench::started(rig);
    stage.app.update();
    stage
}

fn tag(stage: &RigBench, uid: Uid) -> Entity {
    stage.get::<TagEntities>(stage.rig).unwrap().get(uid).unwrap()
}

/// The feature that a command is in, in the document.
fn feature_of(stage: &RigBench, command: Uid) -> Option<Uid> {
    match &stage.rig().find_tag(command).unwrap().1.kind {
        TagKind::Command { feature, .. } => *feature,
        TagKind::Feature { .. } => panic!("{command} is a feature"),
    }
}

#[test]
fn a_tag_is_a_command_or_a_feature() {
    let mut stage = chain();
    let before = (write_template(stage.rig()), stage.steps());
    let [one, command, two, other] = [FEATURE, COMMAND, OTHER_FEATURE, OTHER_COMMAND].map(|uid| tag(&stage, uid));
    let is_as_before = |stage: &mut RigBench, what: &str| {
        assert_eq!(refusals_later(stage), NONE, "{what}: told again");
        assert_eq!((write_template(stage.rig()), stage.steps()), before, "{what}");
        for (entity, is_command) in [(one, false), (two, false), (command, true), (other, true)] {
            let kinds = (stage.get::<CommandTag>(entity).is_some(), stage.get::<FeatureTag>(entity).is_some());
            assert_eq!(kinds, (is_command, !is_command), "{what}");
            let of = stage.get::<InFeature>(entity).copied();
            assert_eq!(of, is_command.then_some(InFeature(one)), "{what}");
        }
    };
    stage.app.world_mut().entity_mut(command).insert(feature("mine"));
    stage.app.update();
    assert_eq!(refusals(&mut stage), [EntityWriteError::TagKinds]);
    is_as_before(&mut stage, "a command becomes a feature, too");

    stage.app.world_mut().entity_mut(one).insert(null());
    stage.app.update();
    assert_eq!(refusals(&mut stage), [EntityWriteError::TagKinds]);
    is_as_before(&mut stage, "a feature becomes a command, too");

    stage.app.world_mut().entity_mut(two).insert(InFeature(one));
    stage.app.update();
    assert_eq!(refusals(&mut stage), [EntityWriteError::NestedFeature]);
    is_as_before(&mut stage, "a feature in a feature");

    stage.app.world_mut().entity_mut(other).insert(InFeature(command));
    stage.app.update();
    assert_eq!(refusals(&mut stage), [EntityWriteError::TagContent(OTHER_COMMAND)]);
    is_as_before(&mut stage, "a command in a command");

    // One in place of the other is an edit.
    stage.app.world_mut().entity_mut(command).remove::<(CommandTag, InFeature)>().insert(feature("mine"));
    assert_eq!(refusals_later(&mut stage), NONE);
    assert_eq!(stage.steps(), before.1 + 1);
    let kind = &stage.rig().find_tag(COMMAND).unwrap().1.kind;
    assert!(matches!(kind, TagKind::Feature { name, .. } if name == "mine"), "{kind:?}");
    stage.change(Change::Undo);
    is_as_before(&mut stage, "undone");
}

/// A feature that the document deletes takes the relation of its commands along. The commands name it on, so that undo
/// puts them back into it: that is no edit.
#[test]
fn a_deleted_feature_makes_no_edit_of_its_own() {
    let deletions = [
        Operation::Edits(vec![RigEdit::RemoveTag(Uid(1), FEATURE)]),
        Operation::Delete { joints: vec![Uid(1)], keep_children: true },
    ];
    for deletion in deletions {
        let mut stage = chain();
        let before = (write_template(stage.rig()), stage.steps());
        let command = tag(&stage, COMMAND);
        stage.change(Change::Do(deletion));
        stage.frames(3);
        assert!(stage.rig().find_tag(FEATURE).is_none());
        assert_eq!(stage.steps(), before.1 + 1, "the deletion alone is a step");
        assert_eq!((feature_of(&stage, COMMAND), stage.get::<InFeature>(command)), (Some(FEATURE), None));
        stage.change(Change::Undo);
        stage.frames(3);
        assert_eq!((write_template(stage.rig()), stage.steps()), before);
        assert_eq!(stage.get::<InFeature>(command), Some(&InFeature(tag(&stage, FEATURE))));
        stage.change(Change::Redo);
        stage.frames(3);
        assert_eq!(stage.steps(), before.1 + 1, "it can be redone");

        // A write to a command leaves the feature in its place; another feature is an edit.
        stage.app.world_mut().get_mut::<Tag>(command).unwrap().comment = "later".into();
        stage.frames(3);
        assert_eq!((feature_of(&stage, COMMAND), stage.steps()), (Some(FEATURE), before.1 + 2));
        stage.change(Change::Undo);
        stage.change(Change::Undo);
        let two = tag(&stage, OTHER_FEATURE);
        stage.app.world_mut().entity_mut(command).insert(InFeature(two));
        assert_eq!(refusals_later(&mut stage), NONE);
        assert_eq!((feature_of(&stage, COMMAND), stage.steps()), (Some(OTHER_FEATURE), before.1 + 1));
    }
}

/// A feature that other code spawns under the uid of one that the document deleted takes over its commands.
#[test]
fn a_feature_spawned_under_the_uid_of_a_deleted_one_gets_its_commands() {
    let mut stage = chain();
    let commands = [COMMAND, OTHER_COMMAND].map(|uid| tag(&stage, uid));
    let bearer = stage.node(Uid(1)).unwrap();
    stage.change(Change::Do(Operation::Edits(vec![RigEdit::RemoveTag(Uid(1), FEATURE)])));
    stage.frames(3);
    assert!(commands.iter().all(|command| stage.get::<InFeature>(*command).is_none()));

    // One more command of the same frame says itself that it is in the feature.
    let world = stage.app.world_mut();
    let back = world.spawn((feature("back"), FEATURE, TagOf(bearer))).id();
    let fresh = world.spawn((null(), Uid(0xF00), InFeature(back), TagOf(bearer))).id();
    stage.frames(3);
    assert_eq!(refusals_later(&mut stage), NONE);
    assert_eq!(tag(&stage, FEATURE), back);
    for command in [commands[0], commands[1], fresh] {
        assert_eq!(stage.get::<InFeature>(command), Some(&InFeature(back)));
    }
    let found = [COMMAND, OTHER_COMMAND, Uid(0xF00)].map(|uid| feature_of(&stage, uid));
    assert_eq!(found, [Some(FEATURE); 3]);
}
