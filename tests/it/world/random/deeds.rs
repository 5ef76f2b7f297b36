//! Deeds of somebody who writes to the entities of a rig, or asks for edits and builds.

use super::*;

/// Takes one of the components off that describe a rig.
fn take_off(entity: &mut EntityWorldMut, number: usize) {
    match number % 22 {
        0 => entity.remove::<Joint>(),
        1 => entity.remove::<Null>(),
        2 => entity.remove::<NodeOf>(),
        3 => entity.remove::<NodeLabel>(),
        4 => entity.remove::<InGroup>(),
        5 => entity.remove::<RestTransform>(),
        6 => entity.remove::<Transform>(),
        7 => entity.remove::<Name>(),
        8 => entity.remove::<Uid>(),
        9 => entity.remove::<ChildOf>(),
        10 => entity.remove::<Tag>(),
        11 => entity.remove::<CommandTag>(),
        12 => entity.remove::<FeatureTag>(),
        13 => entity.remove::<TagOf>(),
        14 => entity.remove::<InFeature>(),
        15 => entity.remove::<LocalGroup>(),
        16 => entity.remove::<GroupOf>(),
        17 => entity.remove::<(Control, NodeLayer)>(),
        18 => entity.remove::<(CreatedBy, CreatedRole)>(),
        19 => entity.remove::<(ConstraintKind, ConstraintTargets)>(),
        20 => entity.remove::<Constrains>(),
        _ => entity.remove::<Attributes>(),
    };
}

fn control() -> ControlData {
    ControlData {
        shape: "mine".into(),
        color: [1.0; 3],
        size: 1.0,
        offset: default(),
        channels: default(),
        limits: default(),
        fits: false,
    }
}

fn layer() -> LayerData {
    LayerData { name: "mine".into(), visible: false, display: default(), color: None }
}

/// Puts one of the components on that only a build or a document writes.
fn put_on(entity: &mut EntityWorldMut, number: usize, other: Entity) {
    match number % 10 {
        0 => entity.insert(NodeOf(other)),
        1 => entity.insert(ParkedNode),
        2 => entity.insert(Control(control())),
        3 => entity.insert(NodeLayer(layer())),
        4 => entity.insert(CreatedRole { role: "mine".into(), subject: Uid(1), number: 0 }),
        5 => entity.insert(CreatedBy(other)),
        6 => entity.insert(ConstraintKind("mine")),
        7 => entity.insert(ConstraintTargets(Vec::new())),
        8 => entity.insert(Constrains(other)),
        _ => entity.insert(Null),
    };
}

/// One random deed, of a build only where the rig may be built: its name, and whether the app has taken it up.
pub(super) fn step(stage: &mut RigBench, random: &mut Random, may_build: bool) -> (String, bool) {
    let (other_rig, other_joint, other_group) = stage.neighbour();
    let rig = stage.rig().clone();
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
        .get::<BuiltEntities>(stage.rig)
        .map(|built| built.iter().map(|(_, entity)| entity).filter(is_alive).collect())
        .unwrap_or_default();
    let number = random.below(1000);
    let constraints: Vec<Entity> =
        (stage.get::<BuildResult>(stage.rig).map(|built| built.0.clone()).unwrap_or_default().constraints.iter())
            .filter_map(|constraint| stage.get::<BuiltEntities>(stage.rig)?.constraint(constraint.uid))
            .filter(is_alive)
            .collect();
    let what = random.below(40);
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
        (21, ..) if may_build => {
            let steps = [BuildStep::All, BuildStep::RollBack, BuildStep::Forward, BuildStep::Back, BuildStep::Restart];
            stage.step(steps[number % 5].clone());
        }
        (22, ..) => {
            if let Some(joint) = joint {
                stage.apply(RigEdit::SetLabel(joint, Some(format!("e{number}"))));
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
        (24, _, _, Some(group)) => {
            let mut group = world.get_mut::<LocalGroup>(group).unwrap();
            match random.below(3) {
                0 => group.name = format!("n{number}"),
                1 => group.color = [random.unit(), random.unit(), random.unit()],
                _ => (group.name, group.color) = (String::new(), [number as f32, -1.0, f32::NAN]),
            }
        }
        (25, _, Some(tag), _) => {
            if let Some(mut command) = world.get_mut::<CommandTag>(tag) {
                match random.below(4) {
                    0 => command.params = "()".into(),
                    1 => command.params = format!("(size: {number}, shape: \"square\")"),
                    2 => command.params = "(at: ".into(),
                    _ => command.module = ["null", "control", "nothing"][number % 3].into(),
                }
            }
        }
        (26, _, Some(tag), _) => {
            if let Some(mut feature) = world.get_mut::<FeatureTag>(tag) {
                match random.below(4) {
                    0 => feature.name = format!("f{number}"),
                    1 => feature.switch = ["", "a", "b"][number % 3].into(),
                    2 => feature.choice = ["", "solver"][number % 2].into(),
                    _ => feature.kind = ["generic", "ik", "nothing"][number % 3].into(),
                }
            }
        }
        (27, _, Some(tag), _) => {
            if let Some(bearer) = world.get::<TagOf>(tag).map(|of| of.0) {
                let count = world.get::<Tags>(bearer).map_or(0, |tags| tags.len());
                world.entity_mut(bearer).insert_related::<TagOf>(number % count.max(1), &[tag]);
            }
        }
        (28, ..) => {
            let with: Vec<Entity> =
                created.iter().copied().filter(|entity| world.get::<Attributes>(*entity).is_some()).collect();
            if let Some(mut values) = random.of(&with).and_then(|entity| world.get_mut::<Attributes>(entity)) {
                let names: Vec<String> = values.0.keys().cloned().collect();
                if !names.is_empty() {
                    values.0.insert(random.pick(&names), 2.0 * random.signed());
                }
            }
        }
        (29, ..) => {
            let nodes: Vec<Uid> = (created.iter().filter_map(|entity| world.get::<Uid>(*entity)).copied())
                .chain(joints.iter().copied())
                .collect();
            if let Some(node) = random.of(&nodes) {
                let offset =
                    PoseOffset { translation: 0.02 * random.point(), rotation: random.rotation(), scale: Vec3::ONE };
                stage.change(Change::Do(Operation::Pose(vec![(node, offset)])));
            }
        }
        (30, ..) => {
            let built = stage.get::<BuildResult>(stage.rig).map(|built| built.0.clone()).unwrap_or_default();
            if !built.switches.is_empty() {
                let switch = random.pick(&built.switches);
                let request = SwitchRequest {
                    rig: rig_entity,
                    control: switch.control,
                    attribute: switch.attribute.to_string(),
                    value: (number % 3) as f32,
                };
                stage.app.world_mut().write_message(request);
            }
        }
        (31, ..) => {
            let features = combined_features(&rig);
            if !features.is_empty() {
                let feature = random.pick(&features);
                stage.apply_all(set_feature(&rig, &feature.key, random.chance(2)).unwrap_or_default());
            }
        }
        (32, ..) => {
            let entities = [entity, tag_entity, group_entity, random.of(&created), random.of(&constraints)];
            let pick = random.below(5);
            if let Some(entity) = entities[pick] {
                // What lost its place in a rig is a game's own entity from then on.
                take_off(&mut stage.app.world_mut().entity_mut(entity), number);
            }
        }
        (33, ..) => {
            let entities = [entity, random.of(&created), random.of(&constraints)];
            if let Some(entity) = entities[random.below(3)] {
                let other = random.of(&[other_rig, other_joint]).unwrap();
                put_on(&mut stage.app.world_mut().entity_mut(entity), number, other);
            }
        }
        (34, ..) if !constraints.is_empty() => {
            world.entity_mut(constraints[number % constraints.len()]).despawn();
        }
        (35, ..) => {
            let entity = if number.is_multiple_of(2) { entity } else { random.of(&created) };
            if let Some(mut transform) = entity.and_then(|entity| world.get_mut::<Transform>(entity)) {
                match number % 3 {
                    0 => transform.translation.x = f32::NAN,
                    1 => transform.rotation = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
                    _ => transform.scale = Vec3::splat(f32::INFINITY),
                }
            }
        }
        (36, Some(entity), ..) => {
            world.entity_mut(entity).insert(Name::new(format!("m{number}")));
        }
        (37, ..) if number.is_multiple_of(3) => {
            world.entity_mut(rig_entity).insert(Name::new(format!("m{number}")));
        }
        (37, ..) if number % 3 == 1 => {
            world.entity_mut(rig_entity).remove::<(Name, Uid)>();
        }
        (37, _, _, Some(group)) => {
            world.entity_mut(group).insert(Name::new(format!("m{number}")));
        }
        (38, Some(entity), ..) => {
            let is_null = world.get::<Null>(entity).is_some();
            let mut entity = world.entity_mut(entity);
            if is_null {
                entity.remove::<Null>()
            } else {
                entity.insert(Null)
            };
        }
        (39, ..) => match (number % 4, entity, tag_entity, group_entity) {
            (0, Some(entity), ..) => {
                world.entity_mut(entity).insert(ChildOf(other_joint));
            }
            (1, _, Some(tag), _) => {
                world.entity_mut(tag).insert(TagOf(other_joint));
            }
            (2, _, _, Some(group)) => {
                world.entity_mut(group).insert(GroupOf(other_rig));
            }
            (3, Some(entity), ..) => {
                world.entity_mut(entity).insert(InGroup(other_group));
            }
            _ => {}
        },
        _ => {}
    }
    // Sometimes several in one frame.
    let is_seen = random.below(4) > 0;
    if is_seen {
        stage.app.update();
        stage.app.update();
    }
    (format!("deed {what} ({number}) on joint {joint:?}, tag {tag:?}, group {group:?}"), is_seen)
}
