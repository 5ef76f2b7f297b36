//! World and document, thousands of random steps of both kinds: equal after each, and undone to the first bytes.

mod deeds;

use std::collections::BTreeMap;

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        commands::{Attributes, BuildResult, BuildStep, BuiltEntities},
        controls::SwitchRequest,
        document::{GroupEntities, JointEntities, TagEntities},
        history::RigHistory,
        runtime::RigRuntime,
        schema::{
            CommandTag, Constrains, ConstraintKind, ConstraintTargets, Control, CreatedBy, CreatedRole, FeatureTag,
            GroupOf, InFeature, InGroup, Joint, LocalGroup, LocalGroups, NodeConstraints, NodeLabel, NodeLayer, NodeOf,
            Null, ParkedNode, Tag, TagOf, Tags,
        },
    },
    prelude::*,
    rig::{
        BuiltRig, ControlData, LayerData, NodeKind, NodeType, PoseOffset, RestTransform, TagKind,
        feature::{combined_features, set_feature},
        template::write_template,
    },
};

use self::deeds::step;
use super::{NEAR, RigBench, shipped};
use crate::random::Random;

/// Fails unless the entities say what the document says, all of it and nothing else.
#[track_caller]
fn check(stage: &mut RigBench, what: &str) {
    let rig = stage.rig().clone();
    assert_eq!(
        stage.get::<Name>(stage.rig).map(Name::as_str),
        Some(rig.about().name.as_str()),
        "{what}: the rig's name"
    );
    assert_eq!(stage.get::<Uid>(stage.rig), Some(&rig.uid()), "{what}: the rig's uid");
    // Commands may put joints below other nodes.
    let built = stage.get::<BuildResult>(stage.rig).map(|built| built.0.clone()).unwrap_or_default();
    let parents: BTreeMap<Uid, Option<Uid>> =
        (built.nodes.iter()).map(|node| (node.uid, node.parent.map(|parent| built.nodes[parent].uid))).collect();
    let mut siblings: BTreeMap<Entity, Vec<Entity>> = BTreeMap::new();
    let joints: Vec<Entity> = rig
        .walk()
        .map(|joint| {
            let entity = stage.get::<JointEntities>(stage.rig).unwrap().get(joint.data.uid);
            let entity = entity.unwrap_or_else(|| panic!("{what}: joint {} has no entity", joint.data.uid));
            let data = &joint.data;
            let parent = parents.get(&data.uid).copied().unwrap_or(joint.parent);
            let parent = parent.map_or(stage.rig, |parent| stage.node(parent).unwrap());
            let above = stage.get::<ChildOf>(entity).map(ChildOf::parent);
            assert_eq!(above, Some(parent), "{what}: the parent of {}", data.uid);
            siblings.entry(parent).or_default().push(entity);
            let name = stage.get::<Name>(entity).map(Name::as_str);
            assert_eq!(name, data.label.as_deref(), "{what}: the name of {}", data.uid);
            assert_eq!(stage.get::<Uid>(entity), Some(&data.uid), "{what}");
            assert_eq!(stage.get::<NodeOf>(entity), Some(&NodeOf(stage.rig)), "{what}: the rig of {}", data.uid);
            let is_null = stage.get::<Null>(entity).is_some();
            assert_eq!(is_null, data.kind == NodeKind::Null, "{what}: the kind of {}", data.uid);
            assert_eq!(stage.get::<NodeLabel>(entity).map(|label| &label.0), data.label.as_ref(), "{what}");
            assert_eq!(stage.get::<RestTransform>(entity), Some(&data.rest), "{what}");
            let of_group = |group: &InGroup| {
                let uid = stage.get::<Uid>(group.0).copied();
                uid.unwrap_or_else(|| panic!("{what}: {} is in {}, which is no group", data.uid, group.0))
            };
            let group = stage.get::<InGroup>(entity).map(of_group);
            let is_there = data.group.map(|group| rig.group(group).is_some());
            assert_eq!(group, data.group, "{what}: the group of {}, which is there: {is_there:?}", data.uid);
            let of_tag = |tag: Entity| {
                let uid = stage.get::<Uid>(tag).copied();
                uid.unwrap_or_else(|| panic!("{what}: {} bears {tag}, which is no tag", data.uid))
            };
            let tags: Vec<Uid> =
                stage.get::<Tags>(entity).map_or_else(Vec::new, |tags| tags.iter().map(of_tag).collect());
            assert_eq!(tags, data.tags.iter().map(|tag| tag.uid).collect::<Vec<_>>(), "{what}");
            for tag in &data.tags {
                let entity = stage.get::<TagEntities>(stage.rig).unwrap().get(tag.uid).unwrap();
                let told = stage.get::<Tag>(entity).unwrap_or_else(|| panic!("{what}: {} is no tag", tag.uid));
                assert_eq!((told.enabled, &told.comment), (tag.enabled, &tag.comment), "{what}");
                match &tag.kind {
                    TagKind::Command { module, params, feature } => {
                        let command = stage.get::<CommandTag>(entity).unwrap();
                        assert_eq!((&command.module, &command.params), (module, params), "{what}");
                        let of = stage.get::<InFeature>(entity).map(|of| *stage.get::<Uid>(of.0).unwrap());
                        assert_eq!(of, feature.filter(|feature| rig.find_tag(*feature).is_some()), "{what}");
                    }
                    TagKind::Feature { kind, name, switch, choice } => {
                        let told = stage.get::<FeatureTag>(entity).unwrap();
                        assert_eq!(
                            (&told.kind, &told.name, &told.switch, &told.choice),
                            (kind, name, switch, choice),
                            "{what}"
                        );
                    }
                }
            }
            entity
        })
        .collect();
    for (parent, wanted) in &siblings {
        let children = stage.get::<Children>(*parent).unwrap();
        let order: Vec<Entity> = children.iter().filter(|child| wanted.contains(child)).collect();
        assert_eq!(&order, wanted, "{what}: the order of siblings");
    }
    check_built(stage, &built, what);
    let is_running = stage.get::<RigRuntime>(stage.rig).is_some();
    for node in built.nodes.iter().filter(|node| is_running && !node.attributes.is_empty()) {
        let values = stage.get::<Attributes>(stage.node(node.uid).unwrap()).unwrap();
        for attribute in node.attributes.iter() {
            let value = stage.runtime().state().attribute(node.uid, &attribute.name);
            assert_eq!(values.0.get(&*attribute.name).copied(), value, "{what}: {} of {}", attribute.name, node.name);
        }
    }
    for group in rig.groups() {
        let entity = stage.get::<GroupEntities>(stage.rig).unwrap().get(group.uid).unwrap();
        let told = stage.get::<LocalGroup>(entity).unwrap();
        assert_eq!((&told.name, told.color, told.enabled), (&group.name, group.color, group.enabled), "{what}");
        assert_eq!(stage.get::<Name>(entity).map(Name::as_str), Some(group.name.as_str()), "{what}");
    }
    let order: Vec<Entity> =
        stage.get::<LocalGroups>(stage.rig).map_or_else(Vec::new, |groups| groups.iter().collect());
    let known = stage.get::<GroupEntities>(stage.rig).unwrap();
    let wanted: Vec<Entity> = rig.groups().iter().filter_map(|group| known.get(group.uid)).collect();
    assert_eq!(order, wanted, "{what}: the order of groups");
    let world = stage.app.world_mut();
    let groups = world.query::<&LocalGroup>().iter(world).count();
    let tags = world.query::<&TagOf>().iter(world).count();
    let count = rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>();
    // The neighbour has one group, one tag and two joints.
    assert_eq!((groups, tags), (rig.groups().len() + 1, count + 1), "{what}: entities without a document");
    let authored = world.query_filtered::<Entity, (With<Joint>, Without<rigsmith::plugins::schema::CreatedRole>)>();
    let mut authored = authored;
    assert_eq!(authored.iter(world).count(), joints.len() + 2, "{what}: joints without a document");
    if stage.get::<RigRuntime>(stage.rig).is_some() {
        let off = stage.off();
        assert!(off <= NEAR, "{what}: {off}");
    }
}

/// Fails unless created nodes and constraints are told as they are built, whatever somebody else did to them.
fn check_built(stage: &RigBench, built: &BuiltRig, what: &str) {
    for node in &built.nodes {
        let entity = stage.node(node.uid).unwrap_or_else(|| panic!("{what}: {} has no entity", node.name));
        let pose = stage.get::<Transform>(entity).unwrap_or_else(|| panic!("{what}: {} has no place", node.name));
        assert!(pose.is_finite(), "{what}: {} is at {pose:?}", node.name);
        let layer = stage.get::<NodeLayer>(entity).map(|layer| &layer.0);
        assert_eq!(layer, node.layer.as_deref(), "{what}: the layer of {}", node.name);
        let Some(origin) = &node.origin else { continue };
        assert_eq!(stage.get::<Name>(entity).map(Name::as_str), Some(&*node.name), "{what}: the name of a node");
        assert_eq!(stage.get::<NodeOf>(entity), Some(&NodeOf(stage.rig)), "{what}: the rig of {}", node.name);
        let control = stage.get::<Control>(entity).map(|control| &control.0);
        assert_eq!(control, node.control.as_deref(), "{what}: the control {}", node.name);
        let kinds = (stage.get::<Joint>(entity).is_some(), stage.get::<Null>(entity).is_some());
        assert_eq!(kinds, (node.kind == NodeType::Joint, node.kind == NodeType::Null), "{what}: {}", node.name);
        let role = stage.get::<CreatedRole>(entity).map(|role| (&*role.role, role.subject, role.number));
        assert_eq!(role, Some((&*origin.role, origin.subject, origin.number)), "{what}: {}", node.name);
        let by = stage.get::<CreatedBy>(entity).and_then(|by| stage.get::<Uid>(by.0)).copied();
        assert_eq!(by, Some(origin.command), "{what}: the command of {}", node.name);
        assert!(stage.get::<ParkedNode>(entity).is_none(), "{what}: {} is parked", node.name);
    }
    let mut orders: BTreeMap<Entity, Vec<Entity>> = BTreeMap::new();
    for constraint in &built.constraints {
        let entity = stage.get::<BuiltEntities>(stage.rig).unwrap().constraint(constraint.uid);
        let entity = entity.unwrap_or_else(|| panic!("{what}: constraint {} has no entity", constraint.uid));
        let kind = stage.get::<ConstraintKind>(entity).map(|kind| kind.0);
        assert_eq!(kind, Some(constraint.constraint.kind()), "{what}: constraint {}", constraint.uid);
        let by = stage.get::<CreatedBy>(entity).and_then(|by| stage.get::<Uid>(by.0)).copied();
        assert_eq!(by, Some(constraint.command), "{what}: the command of constraint {}", constraint.uid);
        let targets = stage.get::<ConstraintTargets>(entity).unwrap();
        let is_there = |node: Entity| stage.app.world().get_entity(node).is_ok();
        assert!(targets.0.iter().all(|target| is_there(target.node)), "{what}: the targets of {}", constraint.uid);
        let is_of_rig = |of: &Constrains| stage.get::<NodeOf>(of.0) == Some(&NodeOf(stage.rig));
        let drives = !constraint.constraint.drives().is_empty();
        assert_eq!(stage.get::<Constrains>(entity).is_some_and(is_of_rig), drives, "{what}: {}", constraint.uid);
        if let Some(Constrains(node)) = stage.get::<Constrains>(entity) {
            orders.entry(*node).or_default().push(entity);
        }
    }
    for (node, wanted) in orders {
        let order: Vec<Entity> = stage.get::<NodeConstraints>(node).unwrap().iter().collect();
        assert_eq!(order, wanted, "{what}: the order of the constraints on a node");
    }
}

impl RigBench {
    /// Another rig of the same world, spawned when it is first asked for, with its first joint and its group.
    fn neighbour(&mut self) -> (Entity, Entity, Entity) {
        let name = Name::new("neighbour");
        let world = self.app.world_mut();
        let mut rigs = world.query_filtered::<(Entity, &Name), With<Rig>>();
        let found = rigs.iter(world).find(|(_, known)| **known == name).map(|(rig, _)| rig);
        let rig = match found {
            Some(rig) => rig,
            None => self.with_neighbour(),
        };
        let document = self.get::<Rig>(rig).unwrap();
        let (root, group) = (document.roots()[0], document.groups()[0].uid);
        let joint = self.get::<JointEntities>(rig).unwrap().get(root).unwrap();
        let group = self.get::<GroupEntities>(rig).unwrap().get(group).unwrap();
        (rig, joint, group)
    }

    fn with_neighbour(&mut self) -> Entity {
        let rig = self.app.world_mut().spawn(Rig::new(Uid(0xBE51DE), "neighbour")).id();
        self.app.update();
        let world = self.app.world_mut();
        let group = LocalGroup { name: "n".into(), color: [1.0; 3], enabled: true };
        world.spawn((group, GroupOf(rig)));
        let root = world.spawn((Joint, Transform::default(), ChildOf(rig))).id();
        world.spawn((Joint, Transform::from_xyz(0.0, 1.0, 0.0), ChildOf(root)));
        world.spawn((CommandTag { module: "null".into(), params: "()".into() }, TagOf(root)));
        self.app.update();
        rig
    }
}

#[test]
fn world_and_document_stay_equal_through_random_deeds() {
    let steps: usize = std::env::var("RIGSMITH_STEPS").ok().and_then(|count| count.parse().ok()).unwrap_or(10_000);
    let templates = shipped();
    // The second arm is edited for a while before it is built, the second hand is never built.
    let starts = [
        ("arm", true, true, steps / 4),
        ("hand", true, true, steps / 4),
        ("spine", true, true, steps / 4),
        ("arm", false, true, steps / 4),
        ("biped", true, true, steps / 50),
        ("hand", false, false, steps / 4),
    ];
    for (number, (start, is_built, may_build, rounds)) in starts.into_iter().enumerate() {
        let rig = templates.iter().find(|(name, _)| name == start).unwrap().1.clone();
        let mut random = Random(7 + number as u64);
        let mut stage = if is_built { RigBench::of_built(rig) } else { RigBench::started(rig) };
        let first = write_template(stage.rig());
        let (other, _, _) = stage.neighbour();
        let of_other = |stage: &RigBench| write_template(stage.get::<Rig>(other).unwrap());
        let beside = of_other(&stage);
        let mut deeds: Vec<String> = Vec::new();
        for round in 0..rounds {
            let (deed, is_seen) = step(&mut stage, &mut random, may_build);
            deeds.push(deed);
            if is_seen {
                let last = deeds[deeds.len().saturating_sub(4)..].join("; ");
                check(&mut stage, &format!("rig {number}, round {round}, the last ones: {last}"));
            }
        }
        stage.app.update();
        assert_eq!(of_other(&stage), beside, "rig {number}: another rig is not touched");
        loop {
            let (names, done) = stage.get::<RigHistory>(stage.rig).unwrap().steps();
            let Some(last) = done.checked_sub(1) else { break };
            let what = format!("rig {number}, step {last} undone: {}", names[last]);
            stage.change(Change::Undo);
            check(&mut stage, &what);
        }
        assert_eq!(write_template(stage.rig()), first, "rig {number} is back at its first bytes");
    }
}
