//! World and document, thousands of random steps of both kinds: equal after each, and undone to the first bytes.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        commands::BuildStep,
        document::{GroupEntities, JointEntities, TagEntities},
        history::RigHistory,
        runtime::RigRuntime,
        schema::{CommandTag, FeatureTag, GroupOf, InFeature, InGroup, Joint, LocalGroup, NodeLabel, Tag, TagOf, Tags},
    },
    prelude::*,
    rig::{RestTransform, TagKind, template::write_template},
};

use super::{NEAR, Stage, shipped};
use crate::random::Random;

/// Fails unless the entities say what the document says, all of it and nothing else.
fn check(stage: &mut Stage, what: &str) {
    let rig = stage.document().clone();
    let joints: Vec<Entity> = rig
        .walk()
        .map(|joint| {
            let entity = stage.get::<JointEntities>(stage.rig).unwrap().get(joint.data.uid);
            let entity = entity.unwrap_or_else(|| panic!("{what}: joint {} has no entity", joint.data.uid));
            let data = &joint.data;
            assert_eq!(stage.get::<Uid>(entity), Some(&data.uid), "{what}");
            assert_eq!(stage.get::<NodeLabel>(entity).map(|label| &label.0), data.label.as_ref(), "{what}");
            assert_eq!(stage.get::<RestTransform>(entity), Some(&data.rest), "{what}");
            let group = stage.get::<InGroup>(entity).map(|group| *stage.get::<Uid>(group.0).unwrap());
            assert_eq!(group, data.group, "{what}");
            let tags: Vec<Uid> = stage
                .get::<Tags>(entity)
                .map_or_else(Vec::new, |tags| tags.iter().map(|tag| *stage.get::<Uid>(tag).unwrap()).collect());
            assert_eq!(tags, data.tags.iter().map(|tag| tag.uid).collect::<Vec<_>>(), "{what}");
            for tag in &data.tags {
                let entity = stage.get::<TagEntities>(stage.rig).unwrap().get(tag.uid).unwrap();
                let told = stage.get::<Tag>(entity).unwrap();
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
    for group in rig.groups() {
        let entity = stage.get::<GroupEntities>(stage.rig).unwrap().get(group.uid).unwrap();
        let told = stage.get::<LocalGroup>(entity).unwrap();
        assert_eq!((&told.name, told.color, told.enabled), (&group.name, group.color, group.enabled), "{what}");
    }
    let world = stage.app.world_mut();
    let groups = world.query::<&LocalGroup>().iter(world).count();
    let tags = world.query::<&TagOf>().iter(world).count();
    let count = rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>();
    assert_eq!((groups, tags), (rig.groups().len(), count), "{what}: entities without a document");
    let authored = world.query_filtered::<Entity, (With<Joint>, Without<rigsmith::plugins::schema::CreatedRole>)>();
    let mut authored = authored;
    assert_eq!(authored.iter(world).count(), joints.len(), "{what}: joints without a document");
    if stage.get::<RigRuntime>(stage.rig).is_some() {
        let off = stage.off();
        assert!(off <= NEAR, "{what}: {off}");
    }
}

/// One random deed, and its name.
fn step(stage: &mut Stage, random: &mut Random) -> String {
    let rig = stage.document().clone();
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let tags: Vec<Uid> = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    let groups: Vec<Uid> = rig.groups().iter().map(|group| group.uid).collect();
    // A deed of the same frame may have despawned what the indices still name.
    let is_alive = |entity: &Entity| stage.app.world().get_entity(*entity).is_ok();
    let joint = random.of(&joints);
    let entity = joint.and_then(|joint| stage.node(joint)).filter(is_alive);
    let tag = random.of(&tags);
    let tag_entity = tag.and_then(|tag| stage.get::<TagEntities>(stage.rig).unwrap().get(tag)).filter(is_alive);
    let group = random.of(&groups);
    let group_entity =
        group.and_then(|group| stage.get::<GroupEntities>(stage.rig).unwrap().get(group)).filter(is_alive);
    let created: Vec<Entity> = stage
        .get::<rigsmith::plugins::commands::BuiltEntities>(stage.rig)
        .map(|built| built.iter().map(|(_, entity)| entity).filter(is_alive).collect())
        .unwrap_or_default();
    let number = random.below(1000);
    let what = random.below(24);
    let rig_entity = stage.rig;
    let world = stage.app.world_mut();
    let translation = Vec3::new(0.0, 0.1 + number as f32 * 1e-3, 0.02);
    match (what, entity, tag_entity, group_entity) {
        (0, Some(entity), ..) => {
            world.entity_mut(entity).insert(NodeLabel(format!("l{number}")));
        }
        (1, Some(entity), ..) => {
            world.entity_mut(entity).remove::<NodeLabel>();
        }
        (2, Some(entity), ..) => {
            world.entity_mut(entity).insert(RestTransform::from_translation(translation));
        }
        (3, Some(entity), _, Some(group)) => {
            world.entity_mut(entity).insert(InGroup(group));
        }
        (4, parent, ..) => {
            let parent = parent.unwrap_or(rig_entity);
            world.spawn((Joint, Transform::from_translation(translation), ChildOf(parent)));
        }
        (5, Some(entity), ..) if joints.len() > 8 => {
            world.entity_mut(entity).despawn();
        }
        (6, Some(entity), ..) => {
            let other = random.of(&joints).and_then(|other| stage.node(other));
            if let Some(other) = other.filter(|other| stage.app.world().get_entity(*other).is_ok()) {
                stage.app.world_mut().entity_mut(entity).insert(ChildOf(other));
            }
        }
        (7, Some(entity), ..) => {
            world.entity_mut(entity).insert(ChildOf(rig_entity));
        }
        (8, Some(entity), ..) => {
            let params = ["()", "(shape: \"cube\")", "(at: \"@label j1\")", "(at: "];
            let params = params[number % 4].to_owned();
            let module = ["control", "null", "control", "nothing"][number % 4].to_owned();
            world.spawn((CommandTag { module, params }, TagOf(entity)));
        }
        (9, _, Some(tag), _) => {
            world.entity_mut(tag).despawn();
        }
        (10, _, Some(tag), _) => {
            let mut told = world.get_mut::<Tag>(tag).unwrap();
            told.enabled = !told.enabled;
            told.comment = format!("c{number}");
        }
        (11, Some(entity), Some(tag), _) => {
            world.entity_mut(tag).insert(TagOf(entity));
        }
        (12, ..) => {
            let group = LocalGroup { name: format!("g{number}"), color: [0.5; 3], enabled: !number.is_multiple_of(3) };
            world.spawn((group, GroupOf(rig_entity)));
        }
        (13, _, _, Some(group)) => {
            world.entity_mut(group).despawn();
        }
        (14, _, _, Some(group)) => {
            world.get_mut::<LocalGroup>(group).unwrap().enabled ^= true;
        }
        (15, Some(entity), ..) => {
            let feature = FeatureTag {
                kind: "generic".into(),
                name: format!("f{number}"),
                switch: String::new(),
                choice: String::new(),
            };
            let feature = world.spawn((feature, TagOf(entity))).id();
            if let Some(tag) = tag_entity {
                world.entity_mut(tag).insert(InFeature(feature));
            }
        }
        (16, ..) if !created.is_empty() => {
            world.entity_mut(created[number % created.len()]).despawn();
        }
        (17, ..) if !created.is_empty() => {
            let entity = created[number % created.len()];
            world.get_mut::<Transform>(entity).unwrap().translation += 0.01 * Vec3::X;
        }
        (18, Some(entity), ..) => {
            world.entity_mut(entity).insert(Uid(number as u64));
        }
        (19, ..) => stage.change(Change::Undo),
        (20, ..) => stage.change(Change::Redo),
        (21, ..) => {
            let steps = [BuildStep::All, BuildStep::RollBack, BuildStep::Forward, BuildStep::Back, BuildStep::Restart];
            stage.step(steps[number % 5].clone());
        }
        (22, ..) => {
            if let Some(joint) = joint {
                stage.edit(vec![RigEdit::SetLabel(joint, Some(format!("e{number}")))]);
            }
        }
        (23, ..) => {
            if let Some(joint) = joint.filter(|_| joints.len() > 8) {
                stage.change(Change::Do(Operation::Delete {
                    joints: vec![joint],
                    keep_children: number.is_multiple_of(2),
                }));
            }
        }
        _ => {}
    }
    // Sometimes several in one frame.
    if random.below(4) > 0 {
        stage.app.update();
        stage.app.update();
    }
    format!("deed {what} ({number}) on joint {joint:?}, tag {tag:?}, group {group:?}")
}

#[test]
fn world_and_document_stay_equal_through_random_deeds() {
    let steps: usize = std::env::var("RIGSMITH_STEPS").ok().and_then(|count| count.parse().ok()).unwrap_or(1200);
    let templates = shipped();
    let starts =
        ["arm", "hand", "spine"].map(|start| templates.iter().find(|(name, _)| name == start).unwrap().1.clone());
    for (number, rig) in starts.into_iter().enumerate() {
        let mut random = Random(7 + number as u64);
        let mut stage = Stage::built(rig);
        let first = write_template(stage.document());
        let mut deeds: Vec<String> = Vec::new();
        for round in 0..steps / 3 {
            deeds.push(step(&mut stage, &mut random));
            if round % 2 == 0 {
                stage.app.update();
                stage.app.update();
                let last = deeds[deeds.len().saturating_sub(4)..].join("; ");
                check(&mut stage, &format!("rig {number}, round {round}, the last ones: {last}"));
            }
        }
        stage.app.update();
        while stage.get::<RigHistory>(stage.rig).unwrap().steps().1 > 0 {
            stage.change(Change::Undo);
        }
        check(&mut stage, "undone");
        assert_eq!(write_template(stage.document()), first, "rig {number} is back at its first bytes");
    }
}
