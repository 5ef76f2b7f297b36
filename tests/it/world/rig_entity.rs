//! The entity of a rig itself: its name is that of the document, both ways, and its uid is the document's for good.

use bevy::{
    ecs::{entity_disabling::Disabled, query::Allow},
    prelude::*,
};
use rigsmith::{
    plugins::{
        commands::{BuildResult, BuildStep, Processor},
        document::{ChangeError, EntityWriteError},
        runtime::RigRuntime,
        schema::{ConstraintKind, LocalGroup, NodeLabel, ParkedNode, TagOf},
    },
    prelude::*,
    rig::RigAbout,
    test_app::test_app,
};

use super::{NEAR, RigBench, shipped};

fn rig() -> Rig {
    Rig::new(Uid(1000), "rig")
}

/// Names of the entity and of the document, and the number of steps in effect.
fn names(stage: &RigBench) -> (String, String, usize) {
    let name = stage.get::<Name>(stage.rig).unwrap().as_str().to_owned();
    (name, stage.rig().about().name.clone(), stage.steps())
}

fn both(name: &str, steps: usize) -> (String, String, usize) {
    (name.to_owned(), name.to_owned(), steps)
}

fn refusals(stage: &mut RigBench) -> Vec<ChangeError> {
    let mut messages = stage.app.world_mut().resource_mut::<Messages<EditRefusal>>();
    messages.drain().map(|refusal| refusal.reason).collect()
}

#[test]
fn writing_the_name_of_a_rig_renames_it() {
    let mut stage = RigBench::started(rig());
    assert_eq!(names(&stage), both("rig", 0));
    let entity = stage.rig;
    stage.app.world_mut().entity_mut(entity).insert(Name::new("Hero"));
    stage.app.update();
    assert_eq!(names(&stage), both("Hero", 1));
    for _ in 0..3 {
        stage.app.update();
    }
    stage.app.world_mut().entity_mut(entity).insert(Name::new("Hero"));
    stage.app.update();
    assert_eq!(names(&stage), both("Hero", 1), "an equal name is no edit");
    stage.change(Change::Undo);
    assert_eq!(names(&stage), both("rig", 0));
    stage.change(Change::Redo);
    assert_eq!(names(&stage), both("Hero", 1));
    stage.apply_all(vec![RigEdit::SetAbout(Box::new(RigAbout {
        name: "Villain".into(),
        ..stage.rig().about().clone()
    }))]);
    assert_eq!(names(&stage), both("Villain", 2), "the entity follows the document");
    // A rig has a name.
    stage.app.world_mut().entity_mut(entity).remove::<Name>();
    stage.app.update();
    assert_eq!(names(&stage), both("Villain", 2));
    assert!(refusals(&mut stage).is_empty());
    // Undone in the frame in which it was written.
    stage.app.world_mut().entity_mut(entity).insert(Name::new("Nobody"));
    stage.change(Change::Undo);
    assert_eq!(names(&stage), both("Villain", 2));
}

/// A name that is spawned with the rig, or was there before it, is the rig's; undo brings back the one of the document.
#[test]
fn a_name_that_is_given_with_a_rig_wins() {
    for is_early in [false, true] {
        let mut app = test_app();
        let entity = app.world_mut().spawn(Name::new("Hero")).id();
        if is_early {
            app.update();
        }
        app.world_mut().entity_mut(entity).insert(rig());
        app.update();
        let mut stage = RigBench { app, rig: entity };
        assert_eq!(names(&stage), both("Hero", 1), "{is_early}");
        stage.change(Change::Undo);
        assert_eq!(names(&stage), both("rig", 0), "{is_early}");
    }
}

#[test]
fn the_uid_of_a_rig_is_put_back_and_told() {
    let check = |stage: &mut RigBench, what: &str| {
        stage.app.update();
        assert_eq!(stage.get::<Uid>(stage.rig), Some(&Uid(1000)), "{what}");
        let told = refusals(stage);
        assert_eq!(told.len(), 1, "{what}: {told:?}");
        let reason = EntityWriteError::Uid { entity: stage.rig, uid: Uid(1000) };
        assert_eq!(told[0], ChangeError::Entity(reason), "{what}");
        for _ in 0..3 {
            stage.app.update();
        }
        assert!(refusals(stage).is_empty(), "{what}: told again");
        assert_eq!(names(stage), both("rig", 0), "{what}");
    };
    let mut app = test_app();
    let entity = app.world_mut().spawn((rig(), Uid(5))).id();
    let mut stage = RigBench { app, rig: entity };
    check(&mut stage, "spawned with another one");
    // An equal one is no write that somebody has to hear of.
    stage.app.world_mut().entity_mut(entity).insert(Uid(1000));
    (0..2).for_each(|_| stage.app.update());
    assert!(refusals(&mut stage).is_empty());
    stage.app.world_mut().entity_mut(entity).insert(Uid(6));
    check(&mut stage, "written");
    stage.app.world_mut().entity_mut(entity).insert(Uid(1000));
    (0..2).for_each(|_| stage.app.update());
    stage.app.world_mut().entity_mut(entity).remove::<Uid>();
    check(&mut stage, "taken off");
}

/// Entities of the parts of rigs, parked nodes included.
type Parts = (
    Or<(With<NodeOf>, With<Joint>, With<TagOf>, With<LocalGroup>, With<ConstraintKind>, With<ParkedNode>)>,
    Allow<Disabled>,
);

/// An entity that loses its document loses what came of it and stays; another document on it begins anew, although its
/// parts have the same uids.
#[test]
fn a_document_that_is_taken_off_takes_its_entities_along() {
    let (_, document) = shipped().into_iter().find(|(name, _)| name == "arm").unwrap();
    let mut stage = RigBench::of_built(document.clone());
    let (entity, root) = (stage.rig, stage.rig().roots()[0]);
    stage.apply(RigEdit::SetLabel(root, Some("top".into())));
    stage.step(BuildStep::RollBack);
    stage.step(BuildStep::Forward);
    let parts = |stage: &mut RigBench| {
        let world = stage.app.world_mut();
        world.query_filtered::<Entity, Parts>().iter(world).count()
    };
    assert!(parts(&mut stage) > 50);
    stage.app.world_mut().entity_mut(entity).insert(Transform::from_xyz(1.0, 0.0, 0.0)).remove::<Rig>();
    stage.frames(2);
    assert_eq!(parts(&mut stage), 0);
    let has_build = (stage.get::<BuildResult>(entity).is_some(), stage.get::<Processor>(entity).is_some());
    assert_eq!((has_build, stage.get::<RigRuntime>(entity).is_some()), ((false, false), false));
    assert_eq!(stage.get::<Transform>(entity).unwrap().translation, Vec3::X);

    stage.app.world_mut().entity_mut(entity).insert(document);
    stage.app.update();
    assert_eq!(names(&stage), both("arm", 0));
    stage.step(BuildStep::All);
    assert!(stage.off() <= NEAR && stage.off_from_document() <= NEAR);
    let joint = stage.node(root).unwrap();
    stage.app.world_mut().entity_mut(joint).insert(NodeLabel("mine".into()));
    stage.app.update();
    assert_eq!(stage.rig().joint(root).unwrap().data.label.as_deref(), Some("mine"));
    assert_eq!(stage.steps(), 1);
    assert!(refusals(&mut stage).is_empty());
}
