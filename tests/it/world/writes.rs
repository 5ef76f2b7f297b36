//! Writes of other code: writing, spawning and despawning entities is editing, undoable like any other edit.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        commands::{BuildResult, BuildStep, BuiltEntities},
        document::{ChangeError, EntityWriteError, GroupEntities, TagEntities},
        schema::{
            Attributes, CommandTag, Constrains, ConstraintTargets, CreatedBy, FeatureTag, GroupOf, InFeature, InGroup,
            Joint, LocalGroup, LocalGroups, NodeConstraints, NodeLabel, Tag, TagOf, Tags,
        },
    },
    prelude::*,
    rig::{PoseOffset, RestTransform, TagData, TagKind, template::write_template},
};

use super::{NEAR, RigBench, shipped};

fn chain() -> RigBench {
    let mut stage = RigBench::started(Rig::new(Uid(1000), "rig"));
    for number in 1..=3 {
        let joint = rigsmith::rig::JointData {
            uid: Uid(number),
            label: Some(format!("j{number}")),
            rest: RestTransform::from_translation(Vec3::Y),
            ..default()
        };
        let parent = (number > 1).then(|| Uid(number - 1));
        stage.apply_all(vec![RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }]);
    }
    stage
}

fn text(stage: &RigBench) -> String {
    write_template(stage.rig())
}

#[test]
fn writing_a_component_is_one_undoable_edit_and_an_equal_value_is_none() {
    let mut stage = chain();
    let before = (text(&stage), stage.steps());
    let joint = stage.node(Uid(2)).unwrap();
    let group = stage
        .app
        .world_mut()
        .spawn((LocalGroup { name: "arm".into(), color: [1.0, 0.0, 0.0], enabled: true }, GroupOf(stage.rig)));
    let group = group.id();
    stage.app.world_mut().entity_mut(joint).insert((
        NodeLabel("elbow".into()),
        RestTransform::from_translation(Vec3::new(0.0, 2.0, 0.0)),
        InGroup(group),
    ));
    stage.app.update();
    let data = &stage.rig().joint(Uid(2)).unwrap().data;
    assert_eq!((data.label.as_deref(), data.rest.translation.y), (Some("elbow"), 2.0));
    assert_eq!(stage.rig().group(data.group.unwrap()).unwrap().name, "arm");
    assert_eq!(stage.get::<Name>(joint).unwrap().as_str(), "elbow");
    assert_eq!(stage.get::<GlobalTransform>(joint).unwrap().translation().y, 3.0, "the pose follows the rest pose");
    assert_eq!(stage.steps(), before.1 + 1, "writes of one frame are one step");
    assert_eq!(stage.get::<GroupEntities>(stage.rig).unwrap().get(data.group.unwrap()), Some(group), "the same entity");

    // Equal values, and what the mirror wrote itself.
    stage.app.world_mut().entity_mut(joint).insert(NodeLabel("elbow".into()));
    for _ in 0..3 {
        stage.app.update();
    }
    assert_eq!(stage.steps(), before.1 + 1);

    // Colour and name of the group, then everything back.
    stage.app.world_mut().get_mut::<LocalGroup>(group).unwrap().color = [0.0, 1.0, 0.0];
    stage.app.update();
    assert_eq!(stage.rig().groups()[0].color, [0.0, 1.0, 0.0]);
    stage.change(Change::Undo);
    assert_eq!(stage.get::<LocalGroup>(group).unwrap().color, [1.0, 0.0, 0.0], "undo reaches the entity");
    stage.change(Change::Undo);
    assert_eq!(text(&stage), before.0);
    assert_eq!(stage.get::<NodeLabel>(joint), Some(&NodeLabel("j2".into())));
    assert!(stage.app.world().get_entity(group).is_err());
    stage.change(Change::Redo);
    assert_eq!(stage.get::<NodeLabel>(joint), Some(&NodeLabel("elbow".into())));
}

/// A value that a command drives is put back in the same frame, and told once, with the command. A build that writes its
/// defaults is told nothing.
#[test]
fn a_driven_attribute_is_put_back_and_told_once() {
    let mut rig = chain().rig().clone();
    let commands = [
        ("attribute", "(name: \"in\", default: 0.25)"),
        ("attribute", "(name: \"out\")"),
        ("driven_key", "(driver_attribute: \"in\", ease: Linear, output: \"@this\", output_attribute: \"out\")"),
    ];
    let tag = |uid: u64, (module, params): (&str, &str)| {
        let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
        Box::new(TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind })
    };
    for (index, command) in commands.into_iter().enumerate() {
        rig.apply(&RigEdit::AddTag { joint: Uid(2), tag: tag(70 + index as u64, command), index }).unwrap();
    }
    let mut stage = RigBench::of_built(rig);
    let joint = stage.node(Uid(2)).unwrap();
    let out = |stage: &RigBench| stage.get::<Attributes>(joint).unwrap().0["out"];
    let write = |stage: &mut RigBench, name: &str, value: f32| {
        stage.app.world_mut().get_mut::<Attributes>(joint).unwrap().0.insert(name.into(), value);
        stage.app.update();
    };
    let refused = |stage: &mut RigBench| -> Vec<EditRefusal> {
        stage.app.world_mut().resource_mut::<Messages<EditRefusal>>().drain().collect()
    };
    assert!((out(&stage) - 0.25).abs() < 1e-6, "{}", out(&stage));
    assert!(refused(&mut stage).is_empty());
    let mut told = Vec::new();
    for value in [0.5, 0.75, f32::NAN] {
        write(&mut stage, "out", value);
        assert!((out(&stage) - 0.25).abs() < 1e-6, "{value} became {}", out(&stage));
        told.extend(refused(&mut stage));
    }
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!(told[0].rig, stage.rig);
    let reason = &told[0].reason;
    assert!(matches!(reason, ChangeError::Entity(EntityWriteError::DrivenAttribute { .. })), "{reason:?}");
    let text = reason.to_string();
    assert!(text.contains("\"out\" of \"j2\" is driven by the command driven_key on joint j2"), "{text}");
    // Another value of the same node drives.
    write(&mut stage, "in", 1.0);
    assert!((out(&stage) - 1.0).abs() < 1e-6, "{}", out(&stage));
    stage.apply(RigEdit::SetTag(Uid(2), tag(71, ("attribute", "(name: \"out\", default: 0.5)"))));
    (0..3).for_each(|_| stage.app.update());
    assert!(refused(&mut stage).is_empty());
}

/// A value of an attribute that the node does not have is taken off in the same frame, and told once with the nearest
/// name; values beside it drive.
#[test]
fn an_unknown_attribute_is_taken_off_and_told_once() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "arm").unwrap();
    let mut stage = RigBench::of_built(rig);
    stage.frames(2);
    let control = stage.control("arm_settings_l");
    let before = stage.get::<Attributes>(control).unwrap().clone();
    stage.messages::<EditRefusal>();
    let mut told = Vec::new();
    for value in [0.0, 1.0, f32::NAN] {
        stage.app.world_mut().get_mut::<Attributes>(control).unwrap().0.insert("ik_fkk".into(), value);
        stage.app.update();
        assert_eq!(stage.get::<Attributes>(control), Some(&before), "{value}");
        told.extend(stage.messages::<EditRefusal>());
    }
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!(told[0].rig, stage.rig);
    let reason = &told[0].reason;
    assert!(matches!(reason, ChangeError::Entity(EntityWriteError::UnknownAttribute { .. })), "{reason:?}");
    let text = reason.to_string();
    assert!(text.contains("\"arm_settings_l\" has no attribute \"ik_fkk\"; did you mean \"ik_fk\""), "{text}");
    let mut values = stage.app.world_mut().get_mut::<Attributes>(control).unwrap();
    values.0.insert("ik_fk".into(), 0.25);
    values.0.insert("nothing".into(), 1.0);
    stage.app.update();
    let now = &stage.get::<Attributes>(control).unwrap().0;
    assert_eq!((now.len(), now["ik_fk"]), (before.0.len(), 0.25));
    assert_eq!(stage.messages::<EditRefusal>().len(), 1);
    let uid = *stage.get::<Uid>(control).unwrap();
    assert_eq!(stage.runtime().state().attribute(uid, "ik_fk"), Some(0.25));
    assert!(stage.off() <= NEAR);
}

/// An order of tags counts although one of them is despawned in the same frame.
#[test]
fn tags_are_reordered_beside_one_that_is_despawned() {
    let mut stage = chain();
    let joint = stage.node(Uid(2)).unwrap();
    let world = stage.app.world_mut();
    let tags: Vec<Entity> = (0..4)
        .map(|number| {
            let command = CommandTag { module: "null".into(), params: "()".into() };
            world.spawn((command, Tag { comment: format!("{number}"), ..default() }, TagOf(joint))).id()
        })
        .collect();
    stage.app.update();
    let before = text(&stage);
    let world = stage.app.world_mut();
    world.entity_mut(joint).insert_related::<TagOf>(0, &[tags[3]]);
    world.entity_mut(tags[1]).despawn();
    stage.app.update();
    let comments = |stage: &RigBench| -> Vec<String> {
        stage.rig().joint(Uid(2)).unwrap().data.tags.iter().map(|tag| tag.comment.clone()).collect()
    };
    assert_eq!(comments(&stage), ["3", "0", "2"]);
    let told: Vec<Entity> = stage.get::<Tags>(joint).unwrap().iter().collect();
    assert_eq!(told, [tags[3], tags[0], tags[2]]);
    stage.change(Change::Undo);
    assert_eq!(text(&stage), before);
    assert_eq!(stage.get::<Tags>(joint).unwrap().len(), 4);
    assert_eq!(comments(&stage), ["0", "1", "2", "3"]);
}

/// Names of the local groups, in the order of the relation; fails unless the document has the same order.
#[track_caller]
fn group_order(stage: &RigBench) -> Vec<String> {
    let groups = stage.get::<LocalGroups>(stage.rig).unwrap();
    let names: Vec<String> = groups.iter().map(|group| stage.get::<LocalGroup>(group).unwrap().name.clone()).collect();
    let wanted: Vec<&str> = stage.rig().groups().iter().map(|group| group.name.as_str()).collect();
    assert_eq!(names, wanted);
    names
}

/// A group that comes back stands where it stood, in the relation as in the document, and so does one that is put back.
#[test]
fn groups_stand_in_the_order_of_the_document() {
    let mut stage = chain();
    for name in ["a", "b", "c"] {
        let group = LocalGroup { name: name.into(), color: [1.0, 0.0, 0.0], enabled: true };
        stage.app.world_mut().spawn((group, GroupOf(stage.rig)));
        stage.app.update();
    }
    let first = |stage: &RigBench| stage.get::<LocalGroups>(stage.rig).unwrap().iter().next().unwrap();
    let group = first(&stage);
    stage.app.world_mut().entity_mut(group).despawn();
    stage.app.update();
    assert_eq!(group_order(&stage), ["b", "c"]);
    stage.change(Change::Undo);
    assert_eq!(group_order(&stage), ["a", "b", "c"]);
    // A group cannot leave its rig.
    let group = first(&stage);
    stage.app.world_mut().entity_mut(group).remove::<GroupOf>();
    stage.app.update();
    assert_eq!(group_order(&stage), ["a", "b", "c"]);
    // The order of the relation alone is no edit.
    let before = text(&stage);
    let rig = stage.rig;
    stage.app.world_mut().entity_mut(rig).insert_related::<GroupOf>(2, &[group]);
    stage.app.update();
    assert_eq!(group_order(&stage), ["a", "b", "c"]);
    assert_eq!(text(&stage), before);
}

/// Constraints on a node are listed in the order in which they run, when the tags that make them change places and when
/// one of them is put back.
#[test]
fn constraints_on_a_node_follow_the_order_of_their_tags() {
    let mut rig = chain().rig().clone();
    let tag = |uid: u64, params: &str| {
        let kind = TagKind::Command { module: "orient".into(), params: params.into(), feature: None };
        Box::new(TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind })
    };
    let tags = [
        tag(70, "(targets: \"@joint j1#0000000000000001\")"),
        tag(71, "(targets: \"@joint j1#0000000000000001\", weight: 0.5)"),
    ];
    for (index, tag) in tags.iter().enumerate() {
        rig.apply(&RigEdit::AddTag { joint: Uid(2), tag: tag.clone(), index }).unwrap();
    }
    let mut stage = RigBench::of_built(rig);
    let order = |stage: &RigBench| -> Vec<Uid> {
        let joint = stage.node(Uid(2)).unwrap();
        let constraints = stage.get::<NodeConstraints>(joint).unwrap();
        constraints
            .iter()
            .map(|constraint| *stage.get::<Uid>(stage.get::<CreatedBy>(constraint).unwrap().0).unwrap())
            .collect()
    };
    assert_eq!(order(&stage), [Uid(70), Uid(71)]);
    let again = RigEdit::AddTag { joint: Uid(2), tag: tags[0].clone(), index: 1 };
    stage.apply_all(vec![RigEdit::RemoveTag(Uid(2), Uid(70)), again]);
    assert_eq!(order(&stage), [Uid(71), Uid(70)]);
    stage.change(Change::Undo);
    assert_eq!(order(&stage), [Uid(70), Uid(71)]);
    let joint = stage.node(Uid(2)).unwrap();
    let first = stage.get::<NodeConstraints>(joint).unwrap().iter().next().unwrap();
    stage.app.world_mut().entity_mut(first).remove::<Constrains>();
    stage.app.update();
    assert_eq!(order(&stage), [Uid(70), Uid(71)]);
}

#[test]
fn spawning_and_despawning_adds_and_deletes() {
    let mut stage = chain();
    let before = text(&stage);
    let parent = stage.node(Uid(3)).unwrap();
    let world = stage.app.world_mut();
    let upper = world.spawn((Joint, Transform::from_xyz(0.0, 0.5, 0.0), ChildOf(parent), NodeLabel("new".into()))).id();
    let lower = world.spawn((Joint, Transform::from_xyz(0.0, 0.25, 0.0), ChildOf(upper))).id();
    let feature =
        FeatureTag { kind: "generic".into(), name: "extras".into(), switch: String::new(), choice: String::new() };
    let feature = world.spawn((feature, TagOf(upper))).id();
    let command = CommandTag { module: "control".into(), params: "()".into() };
    let command =
        world.spawn((command, Tag { enabled: false, comment: "later".into() }, InFeature(feature), TagOf(upper))).id();
    stage.app.update();
    let uid = *stage.get::<Uid>(upper).unwrap();
    let data = &stage.rig().joint(uid).unwrap().data;
    assert_eq!((data.label.as_deref(), data.rest.translation.y), (Some("new"), 0.5));
    assert_eq!(data.tags.len(), 2);
    let TagKind::Command { feature: of, .. } = &data.tags[1].kind else { panic!("{data:?}") };
    assert_eq!((*of, data.tags[1].enabled), (Some(data.tags[0].uid), false));
    assert_eq!(stage.get::<TagEntities>(stage.rig).unwrap().get(data.tags[1].uid), Some(command));
    assert_eq!(stage.rig().joint(*stage.get::<Uid>(lower).unwrap()).unwrap().parent, Some(uid));
    assert_eq!(stage.rig().len(), 5);

    // Tag order, and another joint for a tag.
    stage.app.world_mut().entity_mut(upper).insert_related::<TagOf>(0, &[command]);
    stage.app.update();
    let order = |stage: &RigBench| -> Vec<Uid> {
        stage.rig().joint(uid).unwrap().data.tags.iter().map(|tag| tag.uid).collect()
    };
    assert_eq!(order(&stage)[0], *stage.get::<Uid>(command).unwrap());
    stage.app.world_mut().entity_mut(command).insert(TagOf(lower));
    stage.app.update();
    assert_eq!(order(&stage).len(), 1);
    assert_eq!(stage.get::<Tags>(lower).unwrap().iter().collect::<Vec<_>>(), [command]);

    // A despawned subtree goes as one step, and its weights, tags and references with it.
    let with_new = text(&stage);
    stage.app.world_mut().entity_mut(upper).despawn();
    stage.app.update();
    assert_eq!(stage.rig().len(), 3);
    stage.change(Change::Undo);
    assert_eq!(text(&stage), with_new);
    assert!(stage.node(uid).is_some_and(|entity| entity != upper), "deleted entities come back as others");
    for _ in 0..3 {
        stage.change(Change::Undo);
    }
    assert_eq!(text(&stage), before);
}

#[test]
fn reparenting_an_entity_reparents_the_joint() {
    let mut stage = chain();
    let (one, three) = (stage.node(Uid(1)).unwrap(), stage.node(Uid(3)).unwrap());
    stage.app.world_mut().entity_mut(three).insert(ChildOf(one));
    stage.app.update();
    assert_eq!(stage.rig().joint(Uid(3)).unwrap().parent, Some(Uid(1)));
    stage.app.world_mut().entity_mut(three).remove::<ChildOf>();
    stage.app.update();
    assert_eq!(stage.rig().joint(Uid(3)).unwrap().parent, None);
    assert_eq!(stage.get::<ChildOf>(three).unwrap().parent(), stage.rig, "below the rig, as a root is");
    stage.change(Change::Undo);
    assert_eq!(stage.get::<ChildOf>(three).unwrap().parent(), one);

    // Below itself, below a stranger: refused aloud, once, and put back.
    let stranger = stage.app.world_mut().spawn(Transform::default()).id();
    stage.app.world_mut().entity_mut(one).insert(ChildOf(stranger));
    stage.app.world_mut().resource_mut::<Messages<EditRefusal>>().clear();
    let mut told = 0;
    for _ in 0..4 {
        stage.app.update();
        told += stage.app.world_mut().resource_mut::<Messages<EditRefusal>>().drain().count();
    }
    assert_eq!(told, 1);
    assert_eq!(stage.get::<ChildOf>(one).unwrap().parent(), stage.rig);
}

#[test]
fn nothing_that_happens_to_entities_panics_or_leaves_a_stale_handle() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let mut stage = RigBench::of_built(rig);
    let tag = stage.rig().walk().flat_map(|joint| joint.data.tags.iter()).next().unwrap().uid;
    let tag_entity = stage.get::<TagEntities>(stage.rig).unwrap().get(tag).unwrap();
    stage.app.world_mut().entity_mut(tag_entity).despawn();
    stage.apply_all(vec![RigEdit::SetLabel(stage.rig().roots()[0], Some("top".into()))]);
    assert!(stage.rig().find_tag(tag).is_none());
    assert!(stage.off() <= NEAR);
    stage.change(Change::Undo);
    stage.change(Change::Undo);

    // A created node is no edit: told, and back in the next frame, with the joints that went along.
    let nodes: Vec<(Uid, Entity)> = stage.get::<BuiltEntities>(stage.rig).unwrap().iter().collect();
    let joints = stage.rig().len();
    for (uid, _) in nodes.iter().step_by(37) {
        let entity = stage.node(*uid).unwrap();
        stage.app.world_mut().entity_mut(entity).despawn();
        stage.app.world_mut().resource_mut::<Messages<EditRefusal>>().clear();
        stage.app.update();
        assert!(!stage.app.world().resource::<Messages<EditRefusal>>().is_empty(), "it is told");
        assert_eq!(stage.rig().len(), joints, "and no joint is deleted");
        assert!(stage.node(*uid).is_some_and(|again| again != entity));
        assert!(stage.off() <= NEAR);
    }
    // What the build wrote stays as it was built.
    let control = stage.labelled_node("hand_l");
    let label = stage.get::<NodeLabel>(control).cloned();
    let node =
        nodes.iter().map(|(uid, _)| stage.node(*uid).unwrap()).find(|entity| stage.get::<NodeLabel>(*entity).is_some());
    let node = node.unwrap();
    let known = stage.get::<NodeLabel>(node).cloned();
    stage.app.world_mut().entity_mut(node).insert(NodeLabel("mine".into()));
    stage.app.update();
    stage.app.update();
    assert_eq!((stage.get::<NodeLabel>(node).cloned(), stage.get::<NodeLabel>(control).cloned()), (known, label));

    // The rig itself.
    let rig = stage.rig;
    stage.app.world_mut().entity_mut(rig).despawn();
    stage.app.update();
    assert_eq!(stage.app.world_mut().query::<&Joint>().iter(stage.app.world()).count(), 0);
}

#[test]
fn constraints_are_entities_that_name_their_nodes() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let mut stage = RigBench::of_built(rig);
    let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
    assert!(built.constraints.len() > 50);
    let known = |stage: &RigBench, uid: Uid| stage.get::<BuiltEntities>(stage.rig).unwrap().constraint(uid);
    for constraint in &built.constraints {
        let entity = known(&stage, constraint.uid).expect("a constraint has an entity");
        let by = stage.get::<CreatedBy>(entity).unwrap().0;
        assert_eq!(stage.get::<Uid>(by), Some(&constraint.command));
        let targets = stage.get::<ConstraintTargets>(entity).unwrap();
        assert!(targets.0.iter().all(|target| stage.get::<Uid>(target.node).is_some()));
        if let Some(Constrains(node)) = stage.get::<Constrains>(entity) {
            assert!(stage.get::<Uid>(*node).is_some());
        }
    }
    stage.step(BuildStep::RollBack);
    assert!(built.constraints.iter().all(|constraint| known(&stage, constraint.uid).is_none()));
    stage.step(BuildStep::All);
    assert!(built.constraints.iter().all(|constraint| known(&stage, constraint.uid).is_some()));
}

/// A step of motion that ends a preview of something else builds the rig as the document says, not as was previewed.
#[test]
fn a_pose_that_ends_a_preview_brings_the_build_back() {
    let mut stage = chain();
    stage.step(BuildStep::All);
    let rest = RestTransform::from_translation(Vec3::new(0.0, 3.0, 0.0));
    let preview = Operation::Edits(vec![RigEdit::SetRest(Uid(2), rest)]);
    stage.change(Change::Preview(preview));
    stage.app.update();
    let base = |stage: &RigBench| stage.get::<BuildResult>(stage.rig).unwrap().0.node(Uid(2)).unwrap().base.translation;
    assert_eq!(base(&stage), Vec3::new(0.0, 3.0, 0.0));
    let offset = PoseOffset::from_rotation(Quat::from_rotation_x(0.3));
    stage.change(Change::Do(Operation::Pose(vec![(Uid(1), offset)])));
    stage.app.update();
    assert_eq!(base(&stage), Vec3::Y, "the preview is gone from the build");
    assert!(stage.off() <= NEAR);
}

/// A node whose `Transform` other code takes off gets it back where it stood, and the take is told.
#[test]
fn a_transform_that_is_taken_off_comes_back_in_place() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "arm").unwrap();
    let mut stage = RigBench::of_built(rig);
    let (_, control) = stage.get::<BuiltEntities>(stage.rig).unwrap().iter().next().unwrap();
    stage.app.world_mut().get_mut::<Transform>(control).unwrap().translation += 0.05 * Vec3::Y;
    stage.app.update();
    let place = *stage.get::<Transform>(control).unwrap();
    stage.app.world_mut().entity_mut(control).remove::<Transform>();
    stage.app.update();
    assert_eq!(stage.get::<Transform>(control), Some(&place));
    assert!(stage.off() <= NEAR);
}
