//! Clips in an app: playback, events, Bevy's own animation, and keys set with each pose.

use std::{sync::Arc, time::Duration};

use bevy::{animation::AnimationPlugin, math::Affine3A, prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    headless::headless_app,
    plugins::{
        animation::{
            AutoKey, ClipPlayer, ClipTargets, EndPlayback, MarkerReached, RigClips, animation_clip, target_id,
        },
        commands::{BuildRequest, BuildStep},
        document::{Change, EditRequest},
        history::RigHistory,
        runtime::{InstanceMode, NodeSlot, RigRuntime, spawn_instance},
    },
    rig::{
        NodeType, PoseOffset, Rig, RigEdit, Uid,
        animation::{Key, Marker, Property, RigClip, Track},
        operations::Operation,
    },
    solve::program::{RigProgram, RigState},
    test_app::strict_app,
};

use super::{BASE, CLIP, animated, apply, biped, controls, keep::state, program, target};

#[derive(Resource, Default)]
struct Markers(Vec<(String, f32)>);

/// An app with frames of a tenth of a second.
pub fn app() -> App {
    let mut app = headless_app(1);
    app.add_plugins((AssetPlugin::default(), AnimationPlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)))
        .init_resource::<Markers>()
        .add_observer(|reached: On<MarkerReached>, mut markers: ResMut<Markers>| {
            markers.0.push((reached.name.clone(), reached.time));
        });
    strict_app(app)
}

/// A rig with a document, built and running.
pub fn with_document(app: &mut App, rig: Rig) -> Entity {
    let entity = app.world_mut().spawn(rig).id();
    app.update();
    app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    app.update();
    app.update();
    assert!(app.world().get::<RigRuntime>(entity).is_some());
    entity
}

/// Joints of a running rig in its space, as their entities stand.
pub fn joints(app: &mut App, rig: Entity) -> Vec<(Uid, Affine3A)> {
    let runtime = app.world().get::<RigRuntime>(rig).unwrap();
    let nodes = runtime.state().program().nodes();
    let slots = (0..nodes.len()).filter(|slot| nodes[*slot].kind == NodeType::Joint);
    let found: Vec<(Uid, Entity)> = slots.map(|slot| (nodes[slot].uid, runtime.entity(slot).unwrap())).collect();
    found.into_iter().map(|(uid, entity)| (uid, app.world().get::<GlobalTransform>(entity).unwrap().affine())).collect()
}

/// Joints where a clip puts them, by the program alone.
fn expected(program: &Arc<RigProgram>, clip: &RigClip, time: f32) -> RigState {
    state(program, Some(clip), time)
}

#[track_caller]
fn compare(app: &mut App, rig: Entity, program: &Arc<RigProgram>, clip: &RigClip, time: f32) {
    let state = expected(program, clip, time);
    let (mut most, mut moved) = (0.0f32, 0.0f32);
    for (uid, at) in joints(app, rig) {
        let slot = program.node(uid).unwrap();
        let wanted = state.global_at(slot);
        let off = at.translation.distance(wanted.translation.into());
        let turned = at.to_scale_rotation_translation().1.dot(wanted.rotation).abs();
        assert!(off < 2e-4 && turned > 1.0 - 1e-5, "{:?} at {time} s: {off}, {turned}", program.nodes()[slot].label);
        most = most.max(off);
        moved = moved.max(wanted.translation.distance(RigState::new(program.clone()).global_at(slot).translation));
    }
    assert!(moved > 0.05, "the clip moves nothing");
}

#[test]
fn a_clip_plays_on_the_entities_and_leaves_the_document() {
    let rig = animated();
    let (program, clip) = (program(&rig), rig.clip(CLIP).unwrap().clone());
    let mut app = app();
    let entity = with_document(&mut app, rig.clone());
    app.world_mut().entity_mut(entity).insert(ClipPlayer { time: 0.25, playing: false, ..ClipPlayer::new(&clip) });
    app.update();
    compare(&mut app, entity, &program, &clip, 0.25);
    app.world_mut().get_mut::<ClipPlayer>(entity).unwrap().playing = true;
    for _ in 0..4 {
        app.update();
    }
    let player = *app.world().get::<ClipPlayer>(entity).unwrap();
    assert!((player.time - 0.65).abs() < 1e-4, "{}", player.time);
    compare(&mut app, entity, &program, &clip, player.time);
    let document = app.world().get::<Rig>(entity).unwrap();
    assert_eq!((document.pose(), document.clips()), (rig.pose(), rig.clips()));
    assert_eq!(app.world().get::<RigHistory>(entity).unwrap().steps().1, 0);
    // A changed key shows in the next frame.
    let arm = controls(&program)[1];
    let mut keys = clip.layers[0].tracks[&target(arm, Property::Rotation)].keys.clone();
    let removed: Vec<f32> = keys.iter().map(|key| key.time).collect();
    keys.iter_mut().for_each(|key| *key = Key::rotation(key.time, Quat::from_rotation_y(0.9)));
    let edit =
        RigEdit::SetKeys { clip: CLIP, layer: BASE, target: target(arm, Property::Rotation), removed, inserted: keys };
    app.world_mut().get_mut::<ClipPlayer>(entity).unwrap().playing = false;
    app.world_mut().write_message(EditRequest::operation(entity, Operation::Edits(vec![edit])));
    app.update();
    let changed = app.world().get::<Rig>(entity).unwrap().clip(CLIP).unwrap().clone();
    assert_ne!(changed, clip);
    compare(&mut app, entity, &program, &changed, player.time);
}

#[test]
fn a_pose_on_top_of_a_halted_clip_stays_until_time_goes_on() {
    let rig = animated();
    let (program, clip) = (program(&rig), rig.clip(CLIP).unwrap().clone());
    let node = controls(&program)[1];
    let mut app = app();
    let entity = with_document(&mut app, rig);
    app.world_mut().entity_mut(entity).insert(ClipPlayer { time: 0.25, playing: false, ..ClipPlayer::new(&clip) });
    app.update();
    let at = |app: &App, node: Uid| {
        let state = app.world().get::<RigRuntime>(entity).unwrap().state();
        state.offset_at(state.program().node(node).unwrap())
    };
    let (other, shown) = (controls(&program)[6], at(&app, controls(&program)[6]));
    let mut wanted = expected(&program, &clip, 0.25);
    wanted.set_offset(node, PoseOffset::from_rotation(Quat::from_rotation_z(0.6))).unwrap();
    let wanted = wanted.offset_at(program.node(node).unwrap());
    assert!(wanted.rotation.angle_between(at(&app, node).rotation) > 0.05);
    let pose = Operation::Pose(vec![(node, PoseOffset::from_rotation(Quat::from_rotation_z(0.6)))]);
    app.world_mut().write_message(EditRequest::operation(entity, pose));
    for _ in 0..3 {
        app.update();
        assert!(wanted.rotation.angle_between(at(&app, node).rotation) < 1e-3);
        assert_eq!(at(&app, other), shown, "the clip poses the others");
    }
    // A key that is set for the node is its value; what is posed and not keyed stays.
    let edit =
        RigEdit::SetClipAbout(CLIP, Box::new(rigsmith::rig::animation::ClipAbout { looped: false, ..clip.about() }));
    app.world_mut().write_message(EditRequest::operation(entity, Operation::Edits(vec![edit])));
    app.update();
    assert!(wanted.rotation.angle_between(at(&app, node).rotation) < 1e-3);
    app.world_mut().get_mut::<ClipPlayer>(entity).unwrap().time = 0.5;
    app.update();
    compare(&mut app, entity, &program, &clip, 0.5);
}

#[test]
fn nodes_go_back_to_the_pose_of_the_document() {
    let mut rig = animated();
    let clip = rig.clip(CLIP).unwrap().clone();
    let node = controls(&program(&rig))[1];
    let bent = PoseOffset::from_rotation(Quat::from_rotation_z(0.4));
    apply(&mut rig, RigEdit::SetOffset(node, Some(bent)));
    let short = RigClip { layers: clip.layers[1..].to_vec(), ..RigClip::new(Uid(0xabc1), Uid(0xabc2), "short") };
    let short = RigClip {
        layers: vec![rigsmith::rig::animation::ClipLayer { uid: Uid(0xabc2), ..short.layers[0].clone() }],
        ..short
    };
    apply(&mut rig, RigEdit::AddClip(Box::new(short.clone()), 1));
    let program = program(&rig);
    let state = |clip: Option<&RigClip>| {
        let mut state = RigState::new(program.clone());
        let _ = state.set_offset(node, bent);
        for (node, offset) in clip.map(|clip| clip.sample(0.25)).unwrap_or_default().offsets {
            let _ = state.set_offset(node, offset);
        }
        state.evaluate(0.0);
        state
    };
    let mut app = app();
    let entity = with_document(&mut app, rig);
    let check = |app: &mut App, wanted: &RigState, when: &str| {
        for (uid, at) in joints(app, entity) {
            let place = wanted.global_at(program.node(uid).unwrap()).translation;
            assert!(at.translation.distance(place.into()) < 2e-4, "{when}: {uid}");
        }
        let shown = app.world().get::<RigRuntime>(entity).unwrap().state();
        for slot in 0..program.attributes().len() {
            assert!((shown.attribute_at(slot) - wanted.attribute_at(slot)).abs() < 1e-3, "{when}: attribute {slot}");
        }
    };
    check(&mut app, &state(None), "at the start");
    let player = ClipPlayer { time: 1.25, playing: false, ..ClipPlayer::new(&clip) };
    app.world_mut().entity_mut(entity).insert(player);
    app.update();
    compare(&mut app, entity, &program, &clip, 1.25);
    // Another clip, with fewer nodes and no attributes.
    app.world_mut().entity_mut(entity).insert(ClipPlayer { time: 0.25, playing: false, ..ClipPlayer::new(&short) });
    app.update();
    app.update();
    check(&mut app, &state(Some(&short)), "in the other clip");
    app.world_mut().entity_mut(entity).insert(player);
    app.update();
    app.world_mut().write_message(EndPlayback { rig: entity });
    app.update();
    app.update();
    assert!(app.world().get::<ClipPlayer>(entity).is_none());
    check(&mut app, &state(None), "after the end");
}

#[test]
fn instances_without_a_document_play_in_both_modes() {
    let rig = animated();
    let (program, clip) = (program(&rig), rig.clip(CLIP).unwrap().clone());
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let mut app = app();
        let entity = app.world_mut().spawn(Transform::IDENTITY).id();
        spawn_instance(app.world_mut(), entity, &program, mode);
        app.world_mut().entity_mut(entity).insert((RigClips([clip.clone()].into()), ClipPlayer::new(&clip)));
        for _ in 0..8 {
            app.update();
        }
        let time = app.world().get::<ClipPlayer>(entity).unwrap().time;
        assert!(time > 0.6);
        compare(&mut app, entity, &program, &clip, time);
    }
}

#[test]
fn bevys_own_animation_moves_the_joints_the_same() {
    let rig = animated();
    let (program, clip) = (program(&rig), rig.clip(CLIP).unwrap().clone());
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let mut app = app();
        let entity = app.world_mut().spawn((Transform::IDENTITY, ClipTargets)).id();
        spawn_instance(app.world_mut(), entity, &program, mode);
        let for_bevy = animation_clip(&clip, &program, mode);
        assert_eq!(for_bevy.duration(), clip.duration());
        let handle = app.world_mut().resource_mut::<Assets<AnimationClip>>().add(for_bevy);
        let (graph, index) = AnimationGraph::from_clip(handle);
        let graph = app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
        let mut player = AnimationPlayer::default();
        player.play(index).pause().seek_to(0.65);
        app.world_mut().entity_mut(entity).insert((player, AnimationGraphHandle(graph)));
        for _ in 0..4 {
            app.update();
        }
        compare(&mut app, entity, &program, &clip, 0.65);
    }
}

#[test]
fn bevys_masks_leave_nodes_out() {
    let rig = animated();
    let (program, clip) = (program(&rig), rig.clip(CLIP).unwrap().clone());
    // Controls that their channels and limits let follow the clip.
    let state = expected(&program, &clip, 0.65);
    let posed = |node: &Uid| state.offset_at(program.node(*node).unwrap()) != PoseOffset::IDENTITY;
    let nodes: Vec<Uid> = controls(&program).into_iter().filter(posed).collect();
    let (masked, other) = (nodes[0], nodes[1]);
    let mut app = app();
    let entity = app.world_mut().spawn((Transform::IDENTITY, ClipTargets)).id();
    spawn_instance(app.world_mut(), entity, &program, InstanceMode::Direct);
    let handle = app.world_mut().resource_mut::<Assets<AnimationClip>>().add(animation_clip(
        &clip,
        &program,
        InstanceMode::Direct,
    ));
    let mut graph = AnimationGraph::new();
    graph.add_target_to_mask_group(target_id(masked), 0);
    let index = graph.add_clip_with_mask(handle, 1, 1.0, graph.root);
    let graph = app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
    let mut player = AnimationPlayer::default();
    player.play(index).pause().seek_to(0.65);
    app.world_mut().entity_mut(entity).insert((player, AnimationGraphHandle(graph)));
    for _ in 0..4 {
        app.update();
    }
    let state = app.world().get::<RigRuntime>(entity).unwrap().state();
    assert_eq!(state.offset_at(program.node(masked).unwrap()), PoseOffset::IDENTITY);
    assert_ne!(state.offset_at(program.node(other).unwrap()), PoseOffset::IDENTITY);
    let mut slots = app.world_mut().query::<&NodeSlot>();
    assert!(slots.iter(app.world()).count() > 0);
}

/// Bevy's own graph blends two clips of a rig by their weights.
#[test]
fn bevys_graph_blends_two_clips() {
    let program = program(&biped());
    let node = controls(&program)[0];
    let still = |number: u64, place: Vec3, angle: f32| {
        let mut clip = RigClip::new(Uid(CLIP.0 + number), Uid(BASE.0 + number), "still");
        let keys = [0.0, 1.0].map(|time| Key::vector(time, place)).to_vec();
        clip.layers[0].tracks.insert(target(node, Property::Translation), Arc::new(Track { keys }));
        let keys = [0.0, 1.0].map(|time| Key::rotation(time, Quat::from_rotation_y(angle))).to_vec();
        clip.layers[0].tracks.insert(target(node, Property::Rotation), Arc::new(Track { keys }));
        clip
    };
    let clips = [still(0, Vec3::new(0.0, 0.0, 0.2), 0.4), still(0x10, Vec3::new(0.4, 0.0, 0.0), 0.8)];
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        for share in [0.0, 0.25, 0.5, 1.0] {
            let mut app = app();
            let entity = app.world_mut().spawn((Transform::IDENTITY, ClipTargets)).id();
            spawn_instance(app.world_mut(), entity, &program, mode);
            let mut graph = AnimationGraph::new();
            let blend = graph.add_blend(1.0, graph.root);
            let mut player = AnimationPlayer::default();
            for (clip, weight) in clips.iter().zip([1.0 - share, share]) {
                let for_bevy = animation_clip(clip, &program, mode);
                let handle = app.world_mut().resource_mut::<Assets<AnimationClip>>().add(for_bevy);
                let index = graph.add_clip(handle, 1.0, blend);
                player.play(index).set_weight(weight).pause().seek_to(0.5);
            }
            let graph = app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
            app.world_mut().entity_mut(entity).insert((player, AnimationGraphHandle(graph)));
            for _ in 0..4 {
                app.update();
            }
            let state = app.world().get::<RigRuntime>(entity).unwrap().state();
            let offset = state.offset_at(program.node(node).unwrap());
            let place = Vec3::new(0.0, 0.0, 0.2).lerp(Vec3::new(0.4, 0.0, 0.0), share);
            let off = offset.translation.distance(place);
            let turned = offset.rotation.angle_between(Quat::from_rotation_y(0.4 + 0.4 * share));
            assert!(off < 1e-4 && turned < 2e-3, "{mode:?}, {share}: {offset:?} is off by {off} and {turned}");
        }
    }
}

/// A clip of one second that walks half a metre, with markers.
pub fn walk(node: Uid) -> RigClip {
    let mut clip = RigClip { looped: true, ..RigClip::new(CLIP, BASE, "walk") };
    let way = vec![Key::vector(0.0, Vec3::ZERO), Key::vector(1.0, Vec3::new(0.0, 0.0, 0.5))];
    clip.layers[0].tracks.insert(target(node, Property::Translation), Arc::new(Track { keys: way }));
    clip.markers = [(0.0, "start"), (0.45, "left"), (0.95, "right")]
        .map(|(time, name)| Marker { time, name: name.into() })
        .to_vec();
    clip
}

#[test]
fn markers_are_told_once_each_lap() {
    let mut rig = biped();
    let root = rig.roots()[0];
    apply(&mut rig, RigEdit::AddClip(Box::new(walk(root)), 0));
    let clip = rig.clips()[0].clone();
    let mut app = app();
    let entity = app.world_mut().spawn(rig).id();
    app.update();
    app.world_mut().entity_mut(entity).insert(ClipPlayer::new(&clip));
    for _ in 0..25 {
        app.update();
    }
    let names =
        |app: &App| app.world().resource::<Markers>().0.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&app), ["start", "left", "right", "start", "left", "right", "start", "left"]);
    app.world_mut().resource_mut::<Markers>().0.clear();
    app.world_mut().entity_mut(entity).insert(ClipPlayer {
        time: 0.99,
        speed: -1.0,
        looped: false,
        ..ClipPlayer::new(&clip)
    });
    for _ in 0..25 {
        app.update();
    }
    assert_eq!(names(&app), ["right", "left", "start"]);
    let player = app.world().get::<ClipPlayer>(entity).unwrap();
    assert_eq!((player.time, player.playing), (0.0, false));
}

#[test]
fn a_pose_sets_keys_while_auto_key_is_on() {
    let rig = animated();
    let clip = rig.clip(CLIP).unwrap().clone();
    let node = controls(&program(&rig))[4];
    let mut app = app();
    let entity = with_document(&mut app, rig);
    let auto_key = AutoKey { on: true, clip: CLIP, layer: Some(BASE), time: 0.0 };
    app.world_mut()
        .entity_mut(entity)
        .insert((ClipPlayer { time: 0.4, playing: false, ..ClipPlayer::new(&clip) }, auto_key));
    app.update();
    assert_eq!(app.world().get::<AutoKey>(entity).unwrap().time, 0.4);
    let rotation = Quat::from_rotation_z(0.6);
    let pose = Operation::Pose(vec![(node, PoseOffset::from_rotation(rotation))]);
    app.world_mut().write_message(EditRequest { rig: entity, change: Change::Preview(pose.clone()) });
    app.update();
    app.world_mut().write_message(EditRequest { rig: entity, change: Change::Commit });
    app.update();
    let at = |app: &App| {
        let clip = app.world().get::<Rig>(entity).unwrap().clip(CLIP).unwrap();
        clip.layers[0].tracks[&target(node, Property::Rotation)].sample(&Property::Rotation, 0.4)
    };
    assert_eq!(at(&app), Some(rotation.to_array()));
    let steps = |app: &App| app.world().get::<RigHistory>(entity).unwrap().steps().1;
    assert_eq!(steps(&app), 1);
    app.world_mut().write_message(EditRequest { rig: entity, change: Change::Undo });
    app.update();
    assert_eq!(app.world().get::<Rig>(entity).unwrap().clip(CLIP), Some(&clip));
    app.world_mut().get_mut::<AutoKey>(entity).unwrap().on = false;
    app.world_mut().write_message(EditRequest::operation(entity, pose));
    app.update();
    assert_eq!(app.world().get::<Rig>(entity).unwrap().clip(CLIP), Some(&clip));
    assert_eq!(steps(&app), 1);
}
