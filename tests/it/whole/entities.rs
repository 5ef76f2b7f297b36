//! Entities: writes to the components of a rig in an app; after each frame the world says what the document and the program say.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        commands::{Attributes, BuildRequest, BuildResult, BuildStep, BuiltEntities, RigModules},
        document::{Change, EditRequest, GroupEntities, JointEntities, TagEntities},
        history::RigHistory,
        runtime::RigRuntime,
        schema::{CommandTag, CreatedRole, GroupOf, InGroup, Joint, LocalGroup, NodeLabel, Null, Tag, TagOf, Tags},
    },
    rig::{NodeKind, PoseOffset, RestTransform, Rig, TagKind, Uid, operations::Operation, template::write_template},
    test_app::test_app,
};

use super::limited;
use crate::generate::{Choices, edits::operation, edits::scene_of, params::command, template::template};

/// Deeds of one input, at most.
const MOST: usize = 24;

/// Greatest distance of an entity from where the program puts it, as a share of the rig's extent.
const NEAR: f32 = 1e-4;

/// An app with one rig.
pub struct LiveRig {
    pub app: App,
    pub rig: Entity,
}

impl LiveRig {
    /// An app with a rig, and the low limits of builds.
    pub fn new(rig: Rig) -> Self {
        let mut app = test_app();
        app.insert_resource(RigModules(limited()));
        let rig = app.world_mut().spawn(rig).id();
        app.update();
        Self { app, rig }
    }

    pub fn document(&self) -> &Rig {
        self.app.world().get::<Rig>(self.rig).expect("a rig")
    }

    fn get<C: Component>(&self, entity: Entity) -> Option<&C> {
        self.app.world().get::<C>(entity)
    }

    pub fn change(&mut self, change: Change) {
        self.app.world_mut().write_message(EditRequest { rig: self.rig, change });
    }

    pub fn build(&mut self, step: BuildStep) {
        self.app.world_mut().write_message(BuildRequest { rig: self.rig, step });
    }

    fn joint(&self, choices: &mut Choices) -> Option<Entity> {
        let joints: Vec<Uid> = self.document().walk().map(|joint| joint.data.uid).collect();
        let joint = choices.of(&joints)?;
        let entity = self.get::<JointEntities>(self.rig)?.get(joint)?;
        self.app.world().get_entity(entity).is_ok().then_some(entity)
    }

    fn tag(&self, choices: &mut Choices) -> Option<Entity> {
        let tags: Vec<Uid> =
            self.document().walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
        let tag = choices.of(&tags)?;
        let entity = self.get::<TagEntities>(self.rig)?.get(tag)?;
        self.app.world().get_entity(entity).is_ok().then_some(entity)
    }

    fn group(&self, choices: &mut Choices) -> Option<Entity> {
        let groups: Vec<Uid> = self.document().groups().iter().map(|group| group.uid).collect();
        let group = choices.of(&groups)?;
        let entity = self.get::<GroupEntities>(self.rig)?.get(group)?;
        self.app.world().get_entity(entity).is_ok().then_some(entity)
    }

    fn created(&self, choices: &mut Choices) -> Option<Entity> {
        let built = self.get::<BuiltEntities>(self.rig)?;
        let mut nodes: Vec<(Uid, Entity)> = built.iter().collect();
        nodes.sort_unstable();
        let (_, entity) = choices.of(&nodes)?;
        self.app.world().get_entity(entity).is_ok().then_some(entity)
    }

    /// One deed of somebody who writes to entities, or asks for edits and builds.
    fn deed(&mut self, choices: &mut Choices, number: u64) {
        let (joint, other) = (self.joint(choices), self.joint(choices));
        let (tag, group, created) = (self.tag(choices), self.group(choices), self.created(choices));
        let (rig, place) = (self.rig, 0.1 * choices.vector());
        let odd = choices.chance(8);
        let joints = self.document().len();
        match choices.below(20) {
            0 => self.build(BuildStep::All),
            1 => self.build(match choices.below(5) {
                0 => BuildStep::RollBack,
                1 => BuildStep::Forward,
                2 => BuildStep::Back,
                3 => BuildStep::Restart,
                _ => BuildStep::To(choices.below(9)),
            }),
            2 => self.change(Change::Undo),
            3 => self.change(Change::Redo),
            4 => {
                let document = self.document().clone();
                let operation = operation(choices, &document, &limited(), 1000 + number * 16);
                self.change(Change::Do(operation));
            }
            _ => {}
        }
        let world = self.app.world_mut();
        match (choices.below(18), joint) {
            (0, Some(joint)) => {
                world.entity_mut(joint).insert(NodeLabel(format!("l{number}")));
            }
            (1, Some(joint)) => {
                world.entity_mut(joint).remove::<NodeLabel>();
            }
            (2, Some(joint)) => {
                world.entity_mut(joint).insert(RestTransform::from_translation(place));
            }
            (3, Some(joint)) => {
                if let Some(group) = group {
                    world.entity_mut(joint).insert(InGroup(group));
                }
            }
            (4, parent) => {
                let parent = parent.unwrap_or(rig);
                world.spawn((Joint, Transform::from_translation(place), ChildOf(parent)));
            }
            (5, Some(joint)) if joints > 2 => {
                world.entity_mut(joint).despawn();
            }
            (6, Some(joint)) => {
                let parent = other.filter(|other| *other != joint).unwrap_or(rig);
                world.entity_mut(joint).insert(ChildOf(parent));
            }
            (7, Some(joint)) => {
                let document = world.get::<Rig>(rig).cloned().unwrap_or_default();
                let (module, params) = command(choices, &scene_of(&document), &limited());
                world.spawn((CommandTag { module, params }, TagOf(joint)));
            }
            (8, _) => {
                if let Some(tag) = tag {
                    world.entity_mut(tag).despawn();
                }
            }
            (9, _) => {
                if let Some(mut told) = tag.and_then(|tag| world.get_mut::<Tag>(tag)) {
                    told.enabled ^= true;
                }
            }
            (10, Some(joint)) => {
                if let Some(tag) = tag {
                    world.entity_mut(tag).insert(TagOf(joint));
                }
            }
            (11, _) => {
                let group = LocalGroup { name: format!("g{number}"), color: [0.5; 3], enabled: !odd };
                world.spawn((group, GroupOf(rig)));
            }
            (12, _) => {
                if let Some(mut told) = group.and_then(|group| world.get_mut::<LocalGroup>(group)) {
                    if odd { told.color = [f32::NAN; 3] } else { told.enabled ^= true }
                }
            }
            (13, _) => {
                if let Some(created) = created {
                    world.entity_mut(created).despawn();
                }
            }
            (14 | 15, joint) => {
                let entity = if choices.chance(2) { created } else { joint };
                if let Some(mut transform) = entity.and_then(|entity| world.get_mut::<Transform>(entity)) {
                    match (odd, choices.below(3)) {
                        (false, 0) => transform.translation += place,
                        (false, _) => transform.rotation *= choices.rotation(),
                        (true, 0) => transform.translation.x = f32::NAN,
                        (true, 1) => transform.rotation = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
                        (true, _) => transform.scale = Vec3::splat(f32::INFINITY),
                    }
                }
            }
            (16, _) => {
                if let Some(mut values) = created.and_then(|created| world.get_mut::<Attributes>(created)) {
                    let names: Vec<String> = values.0.keys().cloned().collect();
                    if !names.is_empty() {
                        let name = names[choices.below(names.len())].clone();
                        values.0.insert(name, choices.any_number());
                    }
                }
            }
            (17, Some(joint)) => {
                if world.get::<Null>(joint).is_some() {
                    world.entity_mut(joint).remove::<Null>();
                } else {
                    world.entity_mut(joint).insert(Null);
                }
            }
            _ => {}
        }
        if choices.chance(4) {
            let nodes: Vec<Uid> = self.document().walk().map(|joint| joint.data.uid).collect();
            if let Some(node) = choices.of(&nodes) {
                let offset = PoseOffset { translation: place, rotation: choices.rotation(), scale: Vec3::ONE };
                self.change(Change::Do(Operation::Pose(vec![(node, offset)])));
            }
        }
    }

    /// Fails unless the entities say what the document says, all of it and nothing else.
    pub fn check(&mut self) {
        let rig = self.document().clone();
        let joints = self.get::<JointEntities>(self.rig).expect("entities of joints");
        for joint in rig.walk() {
            let data = &joint.data;
            let entity = joints.get(data.uid).unwrap_or_else(|| panic!("joint {} has no entity", data.uid));
            assert_eq!(self.get::<Uid>(entity), Some(&data.uid));
            assert_eq!(self.get::<NodeLabel>(entity).map(|label| &label.0), data.label.as_ref(), "{}", data.uid);
            assert_eq!(self.get::<RestTransform>(entity), Some(&data.rest), "{}", data.uid);
            assert_eq!(self.get::<Null>(entity).is_some(), data.kind == NodeKind::Null, "{}", data.uid);
            let group = self.get::<InGroup>(entity).and_then(|group| self.get::<Uid>(group.0)).copied();
            assert_eq!(group, data.group, "the group of {}", data.uid);
            let tags = self.get::<Tags>(entity).map(|tags| tags.iter().collect::<Vec<Entity>>()).unwrap_or_default();
            let told: Vec<Option<Uid>> = tags.iter().map(|tag| self.get::<Uid>(*tag).copied()).collect();
            assert_eq!(told, data.tags.iter().map(|tag| Some(tag.uid)).collect::<Vec<_>>(), "tags of {}", data.uid);
            for (entity, tag) in tags.iter().zip(&data.tags) {
                assert_eq!(self.get::<Tag>(*entity).map(|told| told.enabled), Some(tag.enabled));
                if let TagKind::Command { module, params, .. } = &tag.kind {
                    let told = self.get::<CommandTag>(*entity).expect("a command");
                    assert_eq!((&told.module, &told.params), (module, params));
                }
            }
            assert!(self.get::<Transform>(entity).is_some_and(|at| at.is_finite()), "{} is nowhere", data.uid);
        }
        let world = self.app.world_mut();
        let mut authored = world.query_filtered::<Entity, (With<Joint>, Without<CreatedRole>)>();
        assert_eq!(authored.iter(world).count(), rig.len(), "joints without a document");
        assert_eq!(world.query::<&LocalGroup>().iter(world).count(), rig.groups().len(), "groups without a document");
        let tags: usize = rig.walk().map(|joint| joint.data.tags.len()).sum();
        assert_eq!(world.query::<&TagOf>().iter(world).count(), tags, "tags without a document");
        self.check_program();
    }

    /// Fails unless each node's entity stands where the program puts it.
    fn check_program(&self) {
        let (Some(runtime), Some(built)) =
            (self.get::<RigRuntime>(self.rig), self.get::<BuildResult>(self.rig).map(|built| built.0.clone()))
        else {
            return;
        };
        let state = runtime.state();
        let far = state.globals().iter().map(|at| at.translation.abs().max_element()).fold(1.0, f32::max);
        for node in &built.nodes {
            let joint = self.get::<JointEntities>(self.rig).and_then(|joints| joints.get(node.uid));
            let entity = joint.or_else(|| self.get::<BuiltEntities>(self.rig)?.get(node.uid));
            let entity = entity.unwrap_or_else(|| panic!("{} has no entity", node.name));
            let (Some(at), Some(wanted)) = (self.get::<GlobalTransform>(entity), state.global(node.uid)) else {
                continue;
            };
            if !wanted.translation.is_finite() {
                assert!(!at.translation().is_finite(), "{} is at {at:?}, and nowhere by the program", node.name);
                continue;
            }
            // Squares of far places are beyond single precision.
            let off = at.translation().as_dvec3().distance(wanted.translation.as_dvec3()) / f64::from(far);
            // Numbers that no float holds are compared with none.
            assert!(!far.is_finite() || off <= f64::from(NEAR), "{} is {off} off: {at:?}, {wanted:?}", node.name);
        }
    }
}

/// Carries writes to entities through all of it.
pub fn check(bytes: &[u8]) {
    let choices = &mut Choices::new(bytes);
    let made = template(choices, &limited(), false);
    let rig = made.read().map_or_else(|| Rig::new(Uid(1), "empty"), |template| template.rig);
    let mut live = LiveRig::new(rig);
    let first = write_template(live.document());
    live.check();
    live.build(BuildStep::All);
    live.app.update();
    for number in 0..MOST as u64 {
        if choices.is_over() {
            break;
        }
        live.deed(choices, number);
        // Several deeds in one frame now and then.
        if !choices.chance(4) {
            live.app.update();
            live.app.update();
            live.check();
        }
    }
    live.app.update();
    live.app.update();
    live.check();
    // No more steps than deeds, and those that their frames made.
    for _ in 0..8 * MOST {
        let before = live.get::<RigHistory>(live.rig).is_some_and(|h| h.last().is_some());
        if !before {
            break;
        }
        live.change(Change::Undo);
        live.app.update();
    }
    live.app.update();
    live.check();
    assert_eq!(write_template(live.document()), first, "not the first bytes");
}
