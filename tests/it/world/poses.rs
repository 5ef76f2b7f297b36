//! Built = seen: entities against the program, at every step of a build, after moves by whoever makes them.

use bevy::{
    animation::{AnimatedBy, AnimationTargetId, animated_field},
    prelude::*,
};
use rigsmith::{
    plugins::commands::{Attributes, BuildResult, BuildStep, Processor},
    prelude::*,
    rig::{
        NodeType, PoseOffset,
        feature::{combined_features, set_feature, set_switch},
    },
};

use super::{NEAR, RigBench, shipped};
use crate::random::Random;

#[test]
fn entities_stand_as_the_program_says_at_every_step() {
    for (name, rig) in shipped() {
        let mut stage = RigBench::started(rig);
        stage.step(BuildStep::RollBack);
        let mut steps = 0;
        loop {
            let off = stage.off();
            assert!(off <= NEAR, "{name} after {steps} commands: {off}");
            stage.step(BuildStep::Forward);
            let cursor = stage.get::<Processor>(stage.rig).unwrap().builder().cursor();
            if cursor == steps {
                break;
            }
            steps = cursor;
        }
        let whole = stage.app.world().get::<BuildResult>(stage.rig).unwrap().clone();
        assert!(steps > 0, "{name} has commands");
        for back in (0..steps).rev() {
            stage.step(BuildStep::Back);
            let off = stage.off();
            assert!(off <= NEAR, "{name} back at {back} commands: {off}");
        }
        stage.step(BuildStep::All);
        assert_eq!(stage.app.world().get::<BuildResult>(stage.rig).unwrap().0, whole.0, "{name}");
        assert!(stage.off() <= NEAR && stage.off_from_document() <= NEAR, "{name}");
    }
}

#[test]
fn a_rig_that_is_spawned_and_built_stands_as_it_was_drawn() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let rests: Vec<(Uid, Vec3)> = rig.rest_globals().into_iter().map(|(uid, rest)| (uid, rest.translation)).collect();
    let mut stage = RigBench::of_built(rig);
    for _ in 0..4 {
        stage.app.update();
    }
    for (joint, rest) in rests {
        let entity = stage.node(joint).unwrap();
        let now = stage.get::<GlobalTransform>(entity).unwrap().translation();
        assert!(now.distance(rest) < 2e-5, "{joint} jumped from {rest} to {now}");
    }
}

/// One random move of a rig: of its controls, attributes and place, of its document and its history, of what is switched
/// off, and of the build.
fn random_move(stage: &mut RigBench, random: &mut Random) -> &'static str {
    let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
    let controls: Vec<Uid> =
        built.nodes.iter().filter(|node| node.kind == NodeType::Control).map(|node| node.uid).collect();
    let attributes: Vec<(Uid, &str)> = (built.nodes.iter())
        .flat_map(|node| node.attributes.iter().map(|attribute| (node.uid, &*attribute.name)))
        .collect();
    let turn = Quat::from_euler(EulerRot::XYZ, random.signed(), random.signed(), random.signed());
    let shift = 0.1 * random.point();
    let control = random.of(&controls);
    match (random.below(16), control) {
        (0..5, Some(control)) => {
            let entity = stage.node(control).unwrap();
            let mut transform = stage.app.world_mut().get_mut::<Transform>(entity).unwrap();
            transform.rotation *= turn;
            transform.translation += shift;
            stage.app.update();
            "control"
        }
        (5..7, Some(control)) => {
            let offset = PoseOffset { translation: shift, rotation: turn, scale: Vec3::ONE };
            stage.change(Change::Do(Operation::Pose(vec![(control, offset)])));
            "pose"
        }
        (7, _) if !attributes.is_empty() => {
            let (node, attribute) = attributes[random.below(attributes.len())];
            let entity = stage.node(node).unwrap();
            let mut values = stage.app.world_mut().get_mut::<Attributes>(entity).unwrap();
            values.0.insert(attribute.to_owned(), 2.0 * random.signed());
            stage.app.update();
            "attribute"
        }
        (8, _) => {
            stage.change(Change::Undo);
            "undo"
        }
        (9, _) => {
            stage.change(Change::Redo);
            "redo"
        }
        (10, _) => {
            let mut place = stage.app.world_mut().get_mut::<Transform>(stage.rig).unwrap();
            place.translation += shift;
            place.rotation *= turn;
            stage.app.update();
            "place"
        }
        (11, _) if !stage.rig().groups().is_empty() => {
            let mut group = random.pick(stage.rig().groups());
            group.enabled = !group.enabled;
            stage.apply(RigEdit::SetLocalGroup(group));
            "group"
        }
        (12, _) => {
            let features = combined_features(stage.rig());
            if features.is_empty() {
                return "nothing";
            }
            let feature = random.pick(&features);
            let on = random.chance(2);
            let edits = match random.of(&feature.switches.iter().map(|switch| &*switch.name).collect::<Vec<&str>>()) {
                Some(switch) if random.chance(2) => set_switch(stage.rig(), &feature.key, switch, on),
                _ => set_feature(stage.rig(), &feature.key, on),
            };
            // A choice has no switch that is off.
            stage.apply_all(edits.unwrap_or_default());
            "feature"
        }
        (13, _) => {
            stage.step(BuildStep::Back);
            "back"
        }
        (14, _) => {
            stage.step(BuildStep::Forward);
            "forward"
        }
        _ => {
            let processor = stage.get::<Processor>(stage.rig).unwrap().builder();
            // Now and then a part of the commands, mostly all.
            let to = if random.chance(4) { random.below(processor.len() + 1) } else { usize::MAX };
            stage.step(if to == usize::MAX { BuildStep::All } else { BuildStep::To(to) });
            "build"
        }
    }
}

#[test]
fn random_moves_keep_entities_and_program_together() {
    let rounds: usize = std::env::var("RIGSMITH_SEEDS").ok().and_then(|count| count.parse().ok()).unwrap_or(60);
    let mut worst = (0.0_f32, String::new());
    for (number, (name, rig)) in shipped().into_iter().enumerate() {
        let mut random = Random(number as u64 + 1);
        let mut stage = RigBench::of_built(rig);
        for round in 0..rounds {
            let what = random_move(&mut stage, &mut random);
            let off = stage.off();
            assert!(off <= NEAR, "{name}, round {round}, {what}: {off}");
            if off > worst.0 {
                worst = (off, format!("{name}, round {round}, {what}"));
            }
        }
    }
    println!("largest difference: {worst:?}");
}

fn biped() -> RigBench {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    RigBench::of_built(rig)
}

fn place(stage: &RigBench, entity: Entity) -> Vec3 {
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
fn hand_and_control(stage: &RigBench) -> (Entity, Entity) {
    let built = &stage.app.world().get::<BuildResult>(stage.rig).unwrap().0;
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
    let mut stage = RigBench { app, rig };
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
    let tag = stage.rig().walk().flat_map(|joint| joint.data.tags.clone()).next().unwrap();
    let joint = stage.rig().find_tag(tag.uid).unwrap().0.data.uid;
    let mut other = tag.clone();
    other.comment = "a remark".into();
    stage.apply(RigEdit::SetTag(joint, Box::new(other)));
    assert_eq!(*stage.get::<Transform>(control).unwrap(), posed);
    let moved = rigsmith::rig::RestTransform { translation: Vec3::new(0.0, 0.02, 0.0), ..default() };
    let root = stage.rig().roots()[0];
    let rest = stage.rig().joint(root).unwrap().data.rest;
    let rest = rigsmith::rig::RestTransform { translation: rest.translation + moved.translation, ..rest };
    stage.apply(RigEdit::SetRest(root, rest));
    assert!(stage.off() <= NEAR && stage.off_from_document() <= NEAR);
    stage.change(Change::Undo);
    stage.change(Change::Undo);
    stage.change(Change::Undo);
    let back = *stage.get::<Transform>(control).unwrap();
    assert!(back.translation.distance(before.translation) < 1e-6, "{back:?} {before:?}");
    assert!(stage.off_from_document() <= NEAR);
}
