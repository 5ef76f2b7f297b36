//! Built = seen: entities against the program, at every step of a build, after moves by whoever makes them.

use bevy::{
    animation::{AnimatedBy, AnimationTargetId, animated_field},
    prelude::*,
};
use rigsmith::{
    plugins::{
        commands::{Attributes, BuildStep, Built, Control},
        runtime::RigRuntime,
    },
    prelude::*,
    rig::{NodeType, PoseOffset},
};

use super::{NEAR, Stage, shipped};
use crate::random::Random;

#[test]
fn entities_stand_as_the_program_says_at_every_step() {
    for (name, rig) in shipped() {
        let mut stage = Stage::new(rig);
        stage.step(BuildStep::RollBack);
        let mut steps = 0;
        loop {
            let off = stage.off();
            assert!(off <= NEAR, "{name} after {steps} commands: {off}");
            stage.step(BuildStep::Forward);
            let cursor =
                stage.app.world().get::<rigsmith::plugins::commands::Processor>(stage.rig).unwrap().builder().cursor();
            if cursor == steps {
                break;
            }
            steps = cursor;
        }
        let whole = stage.app.world().get::<Built>(stage.rig).unwrap().clone();
        assert!(steps > 0, "{name} has commands");
        for back in (0..steps).rev() {
            stage.step(BuildStep::Back);
            let off = stage.off();
            assert!(off <= NEAR, "{name} back at {back} commands: {off}");
        }
        stage.step(BuildStep::All);
        assert_eq!(stage.app.world().get::<Built>(stage.rig).unwrap().0, whole.0, "{name}");
        assert!(stage.off() <= NEAR && stage.off_from_document() <= NEAR, "{name}");
    }
}

#[test]
fn a_rig_that_is_spawned_and_built_stands_as_it_was_drawn() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let rests: Vec<(Uid, Vec3)> = rig.rest_globals().into_iter().map(|(uid, rest)| (uid, rest.translation)).collect();
    let mut stage = Stage::built(rig);
    for _ in 0..4 {
        stage.app.update();
    }
    for (joint, rest) in rests {
        let entity = stage.node(joint).unwrap();
        let now = stage.get::<GlobalTransform>(entity).unwrap().translation();
        assert!(now.distance(rest) < 2e-5, "{joint} jumped from {rest} to {now}");
    }
}

#[test]
fn random_moves_keep_entities_and_program_together() {
    let rounds: usize = std::env::var("RIGSMITH_SEEDS").ok().and_then(|count| count.parse().ok()).unwrap_or(40);
    for (number, (name, rig)) in shipped().into_iter().enumerate() {
        let mut random = Random(number as u64 + 1);
        let mut stage = Stage::built(rig);
        let built = stage.app.world().get::<Built>(stage.rig).unwrap().0.clone();
        let controls: Vec<Uid> =
            built.nodes.iter().filter(|node| node.kind == NodeType::Control).map(|node| node.uid).collect();
        let attributes: Vec<(Uid, String)> = (built.nodes.iter())
            .flat_map(|node| node.attributes.iter().map(|attribute| (node.uid, attribute.name.to_string())))
            .collect();
        for round in 0..rounds {
            let turn = Quat::from_euler(EulerRot::XYZ, random.signed(), random.signed(), random.signed());
            let shift = 0.1 * Vec3::new(random.signed(), random.signed(), random.signed());
            let what = random.below(10);
            match what {
                0..4 if !controls.is_empty() => {
                    let entity = stage.node(controls[random.below(controls.len())]).unwrap();
                    let mut transform = stage.app.world_mut().get_mut::<Transform>(entity).unwrap();
                    transform.rotation *= turn;
                    transform.translation += shift;
                    stage.app.update();
                }
                4..6 if !controls.is_empty() => {
                    let control = controls[random.below(controls.len())];
                    let offset = PoseOffset { translation: shift, rotation: turn, scale: Vec3::ONE };
                    stage.change(Change::Do(Operation::Pose(vec![(control, offset)])));
                }
                6 if !attributes.is_empty() => {
                    let (node, attribute) = &attributes[random.below(attributes.len())];
                    let entity = stage.node(*node).unwrap();
                    let mut values = stage.app.world_mut().get_mut::<Attributes>(entity).unwrap();
                    values.0.insert(attribute.clone(), 2.0 * random.signed());
                    stage.app.update();
                }
                7 => stage.change(Change::Undo),
                8 => stage.change(Change::Redo),
                _ => {
                    let mut place = stage.app.world_mut().get_mut::<Transform>(stage.rig).unwrap();
                    place.translation += shift;
                    place.rotation *= turn;
                    stage.app.update();
                }
            }
            let off = stage.off();
            // Measured in shares of the size within the rig; the rig itself has walked away by then.
            assert!(off <= 2.0 * NEAR, "{name}, round {round}, {what}: {off}");
        }
    }
}

fn biped() -> Stage {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    Stage::built(rig)
}

fn place(stage: &Stage, entity: Entity) -> Vec3 {
    stage.get::<GlobalTransform>(entity).unwrap().translation()
}

#[test]
fn writing_the_transform_of_a_control_drives_the_rig_in_the_same_frame() {
    let mut stage = biped();
    let (hand, control) = hand_and_control(&stage);
    let before = place(&stage, hand);
    stage.app.world_mut().get_mut::<Transform>(control).unwrap().translation += Vec3::new(0.0, 0.05, 0.05);
    stage.app.update();
    let moved = place(&stage, hand) - before;
    assert!(moved.length() > 0.02, "the hand follows: {moved}");
    let written = *stage.get::<Transform>(control).unwrap();
    stage.app.update();
    assert_eq!(*stage.get::<Transform>(control).unwrap(), written, "and stays");
}

/// The left wrist and the control whose movement moves it most.
fn hand_and_control(stage: &Stage) -> (Entity, Entity) {
    let built = &stage.app.world().get::<Built>(stage.rig).unwrap().0;
    let labels: Vec<&str> = built.nodes.iter().filter_map(|node| node.label.as_deref()).collect();
    assert!(labels.contains(&"hand_l"), "{labels:?}");
    let hand = built.find_label("hand_l").unwrap().uid;
    let wrist = stage.runtime().state().global(hand).unwrap().translation;
    let mut best = (0.0, hand);
    for node in built.nodes.iter().filter(|node| node.kind == NodeType::Control) {
        let mut state = stage.runtime().state().clone();
        let offset = PoseOffset { translation: Vec3::new(0.0, 0.01, 0.01), ..PoseOffset::IDENTITY };
        if state.set_offset(node.uid, offset).is_err() {
            continue;
        }
        state.evaluate(0.0);
        let moved = state.global(hand).unwrap().translation.distance(wrist);
        let is_near = state.global(node.uid).unwrap().translation.distance(wrist) < 0.1;
        if moved > best.0 && is_near {
            best = (moved, node.uid);
        }
    }
    (stage.node(hand).unwrap(), stage.node(best.1).unwrap())
}

#[test]
fn an_animation_drives_controls_in_the_same_frame() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let mut app = rigsmith::headless::headless_app(1);
    app.add_plugins((bevy::asset::AssetPlugin::default(), bevy::animation::AnimationPlugin));
    app.finish();
    app.cleanup();
    let rig = app.world_mut().spawn(rig).id();
    app.update();
    let mut stage = Stage { app, rig };
    stage.step(BuildStep::All);
    let (hand, control) = hand_and_control(&stage);
    let before = place(&stage, hand);
    let at_rest = stage.get::<Transform>(control).unwrap().translation;
    let mut clip = AnimationClip::default();
    let id = AnimationTargetId::from_name(&Name::new("control"));
    let keys = [(0.0, at_rest + Vec3::new(0.0, 0.06, 0.04)), (10.0, at_rest + Vec3::new(0.0, 0.06, 0.04))];
    clip.add_curve_to_target(
        id,
        AnimatableCurve::new(animated_field!(Transform::translation), AnimatableKeyframeCurve::new(keys).unwrap()),
    );
    let clip = stage.app.world_mut().resource_mut::<Assets<AnimationClip>>().add(clip);
    let (graph, node) = AnimationGraph::from_clip(clip);
    let graph = stage.app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
    let mut player = AnimationPlayer::default();
    player.play(node).repeat();
    let rig = stage.rig;
    stage.app.world_mut().entity_mut(rig).insert((AnimationGraphHandle(graph), player));
    stage.app.world_mut().entity_mut(control).insert((id, AnimatedBy(rig)));
    for _ in 0..3 {
        stage.app.update();
    }
    assert!(place(&stage, hand).distance(before) > 0.02, "the hand follows the clip");
    assert!(stage.off() <= NEAR);
}

#[test]
fn posing_in_the_document_and_undoing_it_reaches_the_entity_of_the_control() {
    let mut stage = biped();
    let (_, control) = hand_and_control(&stage);
    let uid = *stage.get::<Uid>(control).unwrap();
    let before = *stage.get::<Transform>(control).unwrap();
    let offset = PoseOffset { translation: Vec3::new(0.0, 0.1, 0.0), ..PoseOffset::IDENTITY };
    stage.change(Change::Do(Operation::Pose(vec![(uid, offset)])));
    let posed = *stage.get::<Transform>(control).unwrap();
    assert!(posed.translation.distance(before.translation) > 0.05);
    // A rebuild keeps the pose, also where it replaces the program.
    let tag = stage.document().walk().flat_map(|joint| joint.data.tags.clone()).next().unwrap();
    let joint = stage.document().find_tag(tag.uid).unwrap().0.data.uid;
    let mut other = tag.clone();
    other.comment = "a remark".into();
    stage.edit(vec![RigEdit::SetTag(joint, Box::new(other))]);
    assert_eq!(*stage.get::<Transform>(control).unwrap(), posed);
    let moved = rigsmith::rig::RestTransform { translation: Vec3::new(0.0, 0.02, 0.0), ..default() };
    let root = stage.document().roots()[0];
    let rest = stage.document().joint(root).unwrap().data.rest;
    let rest = rigsmith::rig::RestTransform { translation: rest.translation + moved.translation, ..rest };
    stage.edit(vec![RigEdit::SetRest(root, rest)]);
    assert!(stage.off() <= NEAR && stage.off_from_document() <= NEAR);
    stage.change(Change::Undo);
    stage.change(Change::Undo);
    stage.change(Change::Undo);
    let back = *stage.get::<Transform>(control).unwrap();
    assert!(back.translation.distance(before.translation) < 1e-6, "{back:?} {before:?}");
    assert!(stage.off_from_document() <= NEAR);
}

#[test]
fn a_build_that_executes_nothing_writes_nothing() {
    let mut stage = biped();
    stage.app.update();
    stage.app.update();
    let tick = stage.app.world().read_change_tick();
    stage.step(BuildStep::All);
    let world = stage.app.world();
    let written: Vec<Entity> = world
        .iter_entities()
        .filter(|entity| {
            let since = |ticks: Option<bevy::ecs::change_detection::ComponentTicks>| {
                ticks.is_some_and(|ticks| ticks.is_changed(tick, world.read_change_tick()))
            };
            since(entity.get_change_ticks::<Transform>())
                || since(entity.get_change_ticks::<GlobalTransform>())
                || since(entity.get_change_ticks::<Built>())
                || since(entity.get_change_ticks::<RigRuntime>())
                || since(entity.get_change_ticks::<Control>())
                || since(entity.get_change_ticks::<Name>())
                || since(entity.get_change_ticks::<ChildOf>())
        })
        .map(|entity| entity.id())
        .collect();
    assert!(written.is_empty(), "{} entities were written", written.len());
}

/// A chain of three joints whose middle one has a control: it may only move along Y by up to a tenth, and turn about Z by
/// up to ten degrees.
fn limited() -> (Stage, Uid) {
    let mut stage = Stage::new(Rig::new(Uid(1000), "rig"));
    for number in 1..=3 {
        let joint = rigsmith::rig::JointData {
            uid: Uid(number),
            label: Some(format!("j{number}")),
            rest: rigsmith::rig::RestTransform::from_translation(Vec3::Y),
            ..default()
        };
        let parent = (number > 1).then(|| Uid(number - 1));
        stage.edit(vec![RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }]);
    }
    let params = "(channels: (translate: (false, true, false), rotate: (false, false, true), \
                  scale: (false, false, false)), \
                  limits: (translate: ((None, None), (-0.1, 0.1), (None, None)), \
                  rotate: ((None, None), (None, None), (-10.0, 10.0))))";
    let kind = rigsmith::rig::TagKind::Command { module: "control".into(), params: params.into(), feature: None };
    let tag = rigsmith::rig::TagData { uid: Uid(77), enabled: true, comment: String::new(), kind };
    stage.edit(vec![RigEdit::AddTag { joint: Uid(2), tag: Box::new(tag), index: 0 }]);
    stage.step(BuildStep::All);
    let built = &stage.get::<Built>(stage.rig).unwrap().0;
    let control = built.nodes.iter().find(|node| node.kind == NodeType::Control);
    let control = control.unwrap_or_else(|| panic!("no control in {:?}", built.nodes)).uid;
    (stage, control)
}

#[test]
fn channels_and_limits_hold_for_whoever_writes() {
    let far = PoseOffset {
        translation: Vec3::splat(5.0),
        rotation: Quat::from_rotation_z(core::f32::consts::FRAC_PI_2),
        scale: Vec3::splat(3.0),
    };
    let check = |stage: &Stage, control: Uid, who: &str| {
        let entity = stage.node(control).unwrap();
        let rest = *stage.get::<rigsmith::rig::RestTransform>(entity).unwrap();
        let offset = PoseOffset::between(&rest, stage.get::<Transform>(entity).unwrap());
        assert!(offset.translation.distance(Vec3::new(0.0, 0.1, 0.0)) < 1e-6, "{who}: {offset:?}");
        let angle = offset.rotation.angle_between(Quat::IDENTITY).to_degrees();
        assert!((angle - 10.0).abs() < 1e-3, "{who}: {angle}");
        assert!(offset.scale.distance(Vec3::ONE) < 1e-6, "{who}: {offset:?}");
        // The joint that follows the control is held, too.
        let tip = stage.get::<GlobalTransform>(stage.node(Uid(3)).unwrap()).unwrap().translation();
        let wanted = Vec3::new(-(10.0_f32.to_radians().sin()), 2.1 + 10.0_f32.to_radians().cos(), 0.0);
        assert!(tip.distance(wanted) < 1e-4, "{who}: {tip}, not {wanted}");
        assert!(stage.off() <= NEAR, "{who}");
    };

    let (mut stage, control) = limited();
    let entity = stage.node(control).unwrap();
    let rest = *stage.get::<rigsmith::rig::RestTransform>(entity).unwrap();
    *stage.app.world_mut().get_mut::<Transform>(entity).unwrap() = far.on(&rest);
    stage.app.update();
    check(&stage, control, "code");

    let (mut stage, control) = limited();
    stage.change(Change::Do(Operation::Pose(vec![(control, far)])));
    check(&stage, control, "an edit");
    stage.change(Change::Undo);
    let entity = stage.node(control).unwrap();
    let rest = *stage.get::<rigsmith::rig::RestTransform>(entity).unwrap();
    assert!(PoseOffset::between(&rest, stage.get::<Transform>(entity).unwrap()).translation.length() < 1e-6);

    // Limits that come later hold a pose that is there already.
    let (mut stage, control) = limited();
    let loose = {
        let mut tag = stage.document().find_tag(Uid(77)).unwrap().1.clone();
        tag.kind = rigsmith::rig::TagKind::Command { module: "control".into(), params: "()".into(), feature: None };
        tag
    };
    stage.edit(vec![RigEdit::SetTag(Uid(2), Box::new(loose))]);
    let entity = stage.node(control).unwrap();
    *stage.app.world_mut().get_mut::<Transform>(entity).unwrap() = far.on(&rest);
    stage.app.update();
    assert!(stage.get::<Transform>(entity).unwrap().translation.x > 4.0, "nothing holds it now");
    stage.change(Change::Undo);
    check(&stage, control, "limits that come back");
}

/// Controls whose kinematics has no effect are neither seen nor picked; a blend of both shows both.
#[test]
fn controls_without_effect_are_hidden() {
    let mut stage = biped();
    let built = stage.get::<Built>(stage.rig).unwrap().0.clone();
    let limbs = built.switches.iter().filter_map(|switch| match &switch.matching {
        rigsmith::rig::Matching::IkFk { fk, goal, .. } if *goal != switch.control => {
            Some((switch.control, switch.attribute.to_string(), fk.clone(), *goal))
        }
        _ => None,
    });
    let limbs: Vec<_> = limbs.collect();
    assert!(limbs.len() >= 4, "arms and legs");
    let visible = |stage: &Stage, node: Uid| {
        let entity = stage.node(node).unwrap();
        stage.get::<rigsmith::plugins::controls::NodeVisible>(entity).unwrap().0
    };
    // The control that carries a goal: a foot's goal hangs below its control.
    let index = built.index();
    let carrier = |goal: Uid| {
        let mut at = &built.nodes[index[&goal]];
        while at.kind != NodeType::Control {
            at = &built.nodes[at.parent.expect("a control carries the goal")];
        }
        at.uid
    };
    for (control, attribute, fk, goal) in limbs {
        for (value, forward, inverse) in [(0.0, true, false), (0.4, true, true), (1.0, false, true)] {
            let edit = RigEdit::SetAttributeValue(control, attribute.clone(), Some(value));
            stage.edit(vec![edit]);
            assert_eq!(visible(&stage, carrier(goal)), inverse, "the goal at {value}");
            for node in fk.iter().filter(|node| **node != control) {
                assert_eq!(visible(&stage, *node), forward, "a forward control at {value}");
            }
        }
    }
}

/// Entities of the rig with a component that was written after a tick, with the components' names.
fn written_since(stage: &Stage, tick: bevy::ecs::change_detection::Tick) -> Vec<(Entity, String)> {
    let world = stage.app.world();
    let now = world.read_change_tick();
    let mut found = Vec::new();
    for entity in world.iter_entities() {
        let is_of_rig = entity.contains::<rigsmith::plugins::schema::NodeOf>()
            || entity.contains::<rigsmith::plugins::schema::TagOf>()
            || entity.contains::<rigsmith::plugins::schema::GroupOf>()
            || entity.contains::<rigsmith::plugins::schema::Constrains>();
        if !is_of_rig {
            continue;
        }
        for component in entity.archetype().components() {
            let ticks = entity.get_change_ticks_by_id(*component);
            if ticks.is_some_and(|ticks| ticks.is_changed(tick, now)) {
                let name = world.components().get_name(*component).map(|name| name.to_string()).unwrap_or_default();
                found.push((entity.id(), name));
            }
        }
    }
    found
}

/// An edit of one tag writes the components of that tag and of what it made, and no other.
#[test]
fn an_edit_of_one_tag_touches_only_what_changed() {
    let mut stage = biped();
    (0..3).for_each(|_| stage.app.update());
    let tag = stage.document().walk().flat_map(|joint| joint.data.tags.clone()).find(|tag| {
        matches!(&tag.kind, rigsmith::rig::TagKind::Command { module, params, .. }
            if module == "control" && params.starts_with("()") | params.contains("shape_scale"))
    });
    let mut tag = tag.expect("a control with a scaled shape");
    let joint = stage.document().find_tag(tag.uid).unwrap().0.data.uid;
    let rigsmith::rig::TagKind::Command { params, .. } = &mut tag.kind else { unreachable!() };
    let start = params.find("shape_scale").unwrap();
    let end = start + params[start..].find(')').unwrap();
    params.replace_range(start..=end, "shape_scale: (1.5, 1.25, 1.75)");
    let uid = tag.uid;
    let built = stage.get::<Built>(stage.rig).unwrap().0.clone();
    let of_tag = |node: Uid| {
        let origin = built.node(node).and_then(|node| node.origin.clone());
        origin.is_some_and(|origin| origin.command == uid)
    };
    let tick = stage.app.world().read_change_tick();
    stage.edit(vec![RigEdit::SetTag(joint, Box::new(tag))]);
    let written = written_since(&stage, tick);
    let controls = written.iter().filter(|(_, name)| name.ends_with("schema::Control")).count();
    assert!(controls > 0, "the control's shape is written: {written:?}");
    for (entity, name) in &written {
        let node = *stage.get::<Uid>(*entity).unwrap();
        assert!(node == uid || of_tag(node), "{name} of {node}, which the tag did not make");
        assert!(!name.contains("Transform"), "{name} of {node}: nothing moved");
    }

    // A pose moves what hangs on it and touches nothing else.
    let (_, control) = hand_and_control(&stage);
    stage.app.update();
    let tick = stage.app.world().read_change_tick();
    stage.app.world_mut().get_mut::<Transform>(control).unwrap().translation.y += 0.01;
    stage.app.update();
    let written = written_since(&stage, tick);
    for (entity, name) in &written {
        assert!(name.contains("Transform"), "a pose writes {name} of {entity}");
    }
    let entities: std::collections::BTreeSet<Entity> = written.iter().map(|(entity, _)| *entity).collect();
    assert!(entities.len() < built.nodes.len() / 2, "{} of {} nodes", entities.len(), built.nodes.len());
}
