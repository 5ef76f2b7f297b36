//! Refused writes: put back, and told once for each entity and component, however often they are repeated.

use std::sync::Arc;

use bevy::prelude::*;
use rigsmith::{
    headless::Workbench,
    plugins::{
        commands::{Attributes, BuildResult, BuildStep, BuiltEntities},
        controls::NodeVisible,
        document::{ChangeError, GroupEntities},
        runtime::RigRuntime,
        schema::{ConstraintTargets, Control, CreatedRole, GroupOf, InGroup, LocalGroup, NodeLabel},
    },
    prelude::*,
    rig::{BuiltRig, RestTransform},
};

use super::{NEAR, RigBench, shipped};

fn template(name: &str) -> Rig {
    shipped().into_iter().find(|(template, _)| template == name).unwrap().1
}

/// Components of the writes that were refused since the last call.
fn refused(stage: &mut RigBench) -> Vec<&'static str> {
    let mut messages = stage.app.world_mut().resource_mut::<Messages<EditRefusal>>();
    let components = messages.drain().map(|refusal| match refusal.reason {
        ChangeError::Entity(error) => error.component(),
        other => panic!("another refusal: {other}"),
    });
    components.collect()
}

type Write = fn(&mut EntityWorldMut, Entity, usize);

/// Writes in every frame, and in every third one, are told once.
#[test]
fn a_write_that_is_repeated_is_told_once() {
    let mut stage = RigBench::of_built(template("arm"));
    let stranger = stage.app.world_mut().spawn(Transform::default()).id();
    let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
    let control = stage.control("arm_fk_l");
    let joint = stage.node(stage.rig().roots()[0]).unwrap();
    let constraint = stage.get::<BuiltEntities>(stage.rig).unwrap().constraint(built.constraints[0].uid).unwrap();
    let group = stage.rig().groups()[0].uid;
    let group = stage.get::<GroupEntities>(stage.rig).unwrap().get(group).unwrap();
    let rig = stage.rig;
    let valued = built.nodes.iter().find(|node| !node.attributes.is_empty()).unwrap();
    let (valued, names) = (stage.node(valued.uid).unwrap(), valued.attributes.clone());
    let table: [(Entity, &str, Write); 15] = [
        (control, "NodeLabel", |node, _, round| {
            node.insert(NodeLabel(format!("mine {round}")));
        }),
        (control, "Name", |node, _, round| {
            node.insert(Name::new(format!("mine {round}")));
        }),
        (control, "RestTransform", |node, _, round| {
            node.insert(RestTransform::from_translation(Vec3::splat(1.0 + round as f32)));
        }),
        (control, "Control", |node, _, round| {
            let mut control = node.get::<Control>().unwrap().clone();
            control.0.size = 10.0 + round as f32;
            node.insert(control);
        }),
        (control, "CreatedRole", |node, _, _| {
            node.remove::<CreatedRole>();
        }),
        (control, "NodeVisible", |node, _, _| {
            let visible = node.get::<NodeVisible>().unwrap().0;
            node.insert(NodeVisible(!visible));
        }),
        (control, "Transform", |node, _, _| {
            node.remove::<Transform>();
        }),
        (valued, "Attributes", |node, _, _| {
            node.remove::<Attributes>();
        }),
        (joint, "ChildOf", |node, stranger, _| {
            node.insert(ChildOf(stranger));
        }),
        (joint, "InGroup", |node, stranger, _| {
            node.insert(InGroup(stranger));
        }),
        (joint, "Control", |node, _, _| {
            let control = node.world_scope(|world| {
                let mut controls = world.query::<&Control>();
                controls.iter(world).next().unwrap().clone()
            });
            node.insert(control);
        }),
        (constraint, "ConstraintTargets", |constraint, _, _| {
            constraint.remove::<ConstraintTargets>();
        }),
        (group, "LocalGroup", |group, _, _| {
            group.remove::<LocalGroup>();
        }),
        (rig, "Uid", |rig, _, round| {
            rig.insert(Uid(1 + round as u64));
        }),
        (rig, "BuildResult", |rig, _, _| {
            rig.insert(BuildResult::default());
        }),
    ];
    (0..2).for_each(|_| stage.app.update());
    assert_eq!(refused(&mut stage), Vec::<&str>::new(), "building tells nothing");
    for (entity, component, write) in table {
        let mut told = Vec::new();
        for round in 0..24 {
            // In every frame first, then in every third one.
            if round < 12 || round % 3 == 0 {
                write(&mut stage.app.world_mut().entity_mut(entity), stranger, round);
            }
            stage.app.update();
            told.extend(refused(&mut stage));
        }
        // What is whole for some frames counts as taken off anew.
        let is_anew = ["Transform", "Attributes"].contains(&component);
        let is_counted = if is_anew { (1..=5).contains(&told.len()) } else { told.len() == 1 };
        assert!(is_counted && told.iter().all(|of| *of == component), "{component}: {told:?}");
        let off = stage.off();
        assert!(off <= NEAR, "{component}: {off}");
    }
    let now = &stage.get::<BuildResult>(stage.rig).unwrap().0;
    assert_eq!(*now, built);
    let values = stage.get::<Attributes>(valued).unwrap();
    assert!(names.iter().all(|attribute| values.0.contains_key(&*attribute.name)), "{values:?}");
}

/// A created node that is despawned in every frame comes back each time, and is told once.
#[test]
fn a_node_that_is_despawned_again_is_told_once() {
    let mut stage = RigBench::of_built(template("arm"));
    refused(&mut stage);
    let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
    let is_leaf = |at: usize| built.nodes.iter().all(|node| node.parent != Some(at));
    let leaf = (0..built.nodes.len()).find(|at| built.nodes[*at].origin.is_some() && is_leaf(*at)).unwrap();
    let uid = built.nodes[leaf].uid;
    let mut told = Vec::new();
    for _ in 0..6 {
        let entity = stage.node(uid).unwrap();
        stage.app.world_mut().entity_mut(entity).despawn();
        stage.app.update();
        told.extend(refused(&mut stage));
    }
    assert_eq!(told, ["Entity"]);
    assert!(stage.off() <= NEAR);
}

/// A value that equals the right one, and a write that is accepted, let the next refusal be told.
#[test]
fn a_refusal_is_told_again_after_a_right_value() {
    let mut stage = RigBench::of_built(template("arm"));
    (0..2).for_each(|_| stage.app.update());
    refused(&mut stage);
    let control = stage.control("arm_fk_l");
    let right = stage.get::<Control>(control).unwrap().clone();
    for round in 0..3 {
        let mut wrong = right.clone();
        wrong.0.size += 1.0;
        stage.app.world_mut().entity_mut(control).insert(wrong);
        stage.app.update();
        assert_eq!(stage.get::<Control>(control), Some(&right), "in the same frame");
        assert_eq!(refused(&mut stage), ["Control"], "round {round}");
        stage.app.update();
        stage.app.world_mut().entity_mut(control).insert(right.clone());
        stage.app.update();
        assert_eq!(refused(&mut stage), Vec::<&str>::new(), "round {round}");
    }

    let stranger = stage.app.world_mut().spawn_empty().id();
    let joint = stage.node(stage.rig().roots()[0]).unwrap();
    let rig = stage.rig;
    let group = LocalGroup { name: "other".into(), color: [1.0, 0.0, 0.0], enabled: true };
    let group = stage.app.world_mut().spawn((group, GroupOf(rig))).id();
    stage.app.update();
    for round in 0..3 {
        stage.app.world_mut().entity_mut(joint).insert(InGroup(stranger));
        stage.app.update();
        assert_eq!(refused(&mut stage), ["InGroup"], "round {round}");
        // The group that was added, or none.
        let mut written = stage.app.world_mut().entity_mut(joint);
        if round % 2 == 0 {
            written.insert(InGroup(group))
        } else {
            written.remove::<InGroup>()
        };
        stage.app.update();
        assert_eq!(refused(&mut stage), Vec::<&str>::new(), "round {round}");
    }
}

/// A result that did not come from the build is put back in the same frame, before anything follows it.
#[test]
fn a_result_of_somebody_else_is_put_back() {
    let mut stage = RigBench::started(template("arm"));
    let rig = stage.rig;
    let foreign = || BuildResult(Arc::new(BuiltRig::default()));
    stage.app.world_mut().entity_mut(rig).insert(foreign());
    stage.app.update();
    assert!(stage.get::<BuildResult>(rig).is_none() && stage.get::<RigRuntime>(rig).is_none(), "nothing is built yet");
    assert_eq!(refused(&mut stage), ["BuildResult"]);
    stage.step(BuildStep::All);
    let built = stage.get::<BuildResult>(rig).unwrap().0.clone();
    let nodes: Vec<(Uid, Entity)> = stage.get::<BuiltEntities>(rig).unwrap().iter().collect();
    assert_eq!(refused(&mut stage), Vec::<&str>::new());
    for is_removed in [false, true] {
        let right = BuildResult(built.clone());
        stage.app.world_mut().entity_mut(rig).insert(right);
        stage.app.update();
        let mut entity = stage.app.world_mut().entity_mut(rig);
        if is_removed {
            entity.remove::<BuildResult>()
        } else {
            entity.insert(foreign())
        };
        stage.app.update();
        assert_eq!(refused(&mut stage), ["BuildResult"], "{is_removed}");
        assert_eq!(stage.get::<BuildResult>(rig).unwrap().0, built);
        let now: Vec<(Uid, Entity)> = stage.get::<BuiltEntities>(rig).unwrap().iter().collect();
        assert_eq!(now, nodes, "{is_removed}: the nodes are the same entities");
        assert!(stage.off() <= NEAR);
        stage.app.update();
    }
}

/// Visibility of a node that other code writes is put back in the same frame; entities that are no nodes are left
/// alone.
#[test]
fn a_visibility_of_somebody_else_is_put_back() {
    let mut stage = RigBench::of_built(template("arm"));
    stage.app.update();
    refused(&mut stage);
    let control = stage.control("arm_fk_l");
    let joint = stage.node(stage.rig().roots()[0]).unwrap();
    let before = stage.get::<NodeVisible>(control).copied().unwrap();
    stage.app.world_mut().entity_mut(control).insert(NodeVisible(!before.0));
    stage.app.world_mut().entity_mut(joint).insert(NodeVisible(false));
    let own = stage.app.world_mut().spawn(NodeVisible(false)).id();
    stage.app.update();
    assert_eq!(refused(&mut stage), ["NodeVisible", "NodeVisible"]);
    assert_eq!(stage.get::<NodeVisible>(control), Some(&before));
    assert_eq!(stage.get::<NodeVisible>(joint), None);
    stage.app.update();
    stage.app.world_mut().entity_mut(control).insert(before);
    stage.app.update();
    stage.app.world_mut().entity_mut(control).remove::<NodeVisible>();
    stage.app.update();
    assert_eq!(refused(&mut stage), ["NodeVisible"]);
    assert_eq!(stage.get::<NodeVisible>(control), Some(&before));
    assert_eq!(stage.get::<NodeVisible>(own), Some(&NodeVisible(false)));
}

/// A write that is refused in the frame of an operation is no answer to the operation.
#[test]
fn an_operation_is_refused_for_reasons_of_its_own() {
    let mut bench = Workbench::with_rig(7, template("arm"));
    bench.build(BuildStep::All);
    let control = bench.built().unwrap().nodes.iter().find(|node| node.control.is_some()).unwrap().uid;
    let (rig, root) = (bench.rig_entity(), bench.rig().roots()[0]);
    let world = bench.app_mut().world_mut();
    let entity = world.get::<BuiltEntities>(rig).unwrap().get(control).unwrap();
    world.entity_mut(entity).insert(NodeLabel("mine".to_owned()));
    assert_eq!(bench.operate(Operation::Lock(vec![root], true)), Ok(()));
    assert!(bench.rig().joint(root).unwrap().data.locked);
    assert!(bench.operate(Operation::Lock(vec![Uid(1)], true)).is_err());
}
