//! Layers in an app: override and additive layers with weights and masks give the same motion in every kind of playback.

use std::sync::Arc;

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        animation::{ClipPlayer, ClipTargets, RigClips, animation_clip, target_id},
        runtime::{InstanceMode, RigRuntime, spawn_instance},
    },
    rig::{
        PoseOffset, RigEdit, Uid,
        animation::{ClipLayer, Key, LayerMode, Property, RigClip, Track},
    },
    solve::program::{RigProgram, RigState},
};

use super::{
    BASE, CLIP,
    app::{app, with_document},
    apply, biped, controls, program, target,
};

/// Controls that turn freely about Y.
fn free(program: &Arc<RigProgram>) -> Vec<Uid> {
    let turn = PoseOffset::from_rotation(Quat::from_rotation_y(1.0));
    let is_free = |node: &Uid| {
        let mut state = RigState::new(program.clone());
        state.set_offset(*node, turn).unwrap();
        state.offset_at(program.node(*node).unwrap()).rotation.angle_between(turn.rotation) < 1e-3
    };
    controls(program).into_iter().filter(is_free).collect()
}

/// A layer that turns nodes about Y by these angles.
fn layer(number: u64, mode: LayerMode, turns: &[(Uid, f32)]) -> ClipLayer {
    let mut layer = ClipLayer { name: format!("layer {number}"), mode, ..ClipLayer::empty(Uid(BASE.0 + number)) };
    for (node, angle) in turns {
        let keys = [0.0, 1.0].map(|time| Key::rotation(time, Quat::from_rotation_y(*angle))).to_vec();
        layer.tracks.insert(target(*node, Property::Rotation), Arc::new(Track { keys }));
    }
    layer
}

/// A clip of five layers on four nodes, and the angle that each node has through them.
fn layered([a, b, c, d]: [Uid; 4]) -> (RigClip, [(Uid, f32); 4]) {
    let base = layer(0, LayerMode::Override, &[(a, 0.4), (b, 0.4)]);
    // Half of the way from the base where there is one, else from rest; not on the second node.
    let half = layer(0x10, LayerMode::Override, &[(a, 1.0), (b, 1.0), (c, 0.6)]);
    let half = ClipLayer { weight: 0.5, mask: vec![a, c], ..half };
    let added = layer(0x20, LayerMode::Additive, &[(a, 0.2), (b, 0.2)]);
    let added = ClipLayer { weight: 0.5, ..added };
    let left_out = layer(0x30, LayerMode::Override, &[(d, 0.9)]);
    let left_out = ClipLayer { mask: vec![a], ..left_out };
    let muted = layer(0x40, LayerMode::Additive, &[(a, 0.9), (d, 0.9)]);
    let muted = ClipLayer { muted: true, ..muted };
    let layers = vec![base, half, added, left_out, muted];
    (RigClip { layers, ..RigClip::new(CLIP, BASE, "layers") }, [(a, 0.8), (b, 0.5), (c, 0.3), (d, 0.0)])
}

#[track_caller]
fn check(app: &App, rig: Entity, wanted: &[(Uid, f32)], what: &str) {
    let state = app.world().get::<RigRuntime>(rig).unwrap().state();
    for (number, (node, angle)) in wanted.iter().enumerate() {
        let turned = state.offset_at(state.program().node(*node).unwrap()).rotation;
        let off = turned.angle_between(Quat::from_rotation_y(*angle));
        assert!(off < 2e-3, "{what}: node {number} is off by {off} from {angle}");
    }
}

#[test]
fn layers_with_weights_and_masks_play_on_a_document_and_on_instances() {
    let mut rig = biped();
    let program = program(&rig);
    let nodes = free(&program);
    let (clip, wanted) = layered([nodes[0], nodes[1], nodes[2], nodes[3]]);
    let player = ClipPlayer { time: 0.5, playing: false, ..ClipPlayer::new(&clip) };
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let mut app = app();
        let entity = app.world_mut().spawn(Transform::IDENTITY).id();
        spawn_instance(app.world_mut(), entity, &program, mode);
        app.world_mut().entity_mut(entity).insert((RigClips([clip.clone()].into()), player));
        app.update();
        app.update();
        check(&app, entity, &wanted, &format!("{mode:?}"));
    }
    apply(&mut rig, RigEdit::AddClip(Box::new(clip), 0));
    let mut app = app();
    let entity = with_document(&mut app, rig);
    app.world_mut().entity_mut(entity).insert(player);
    app.update();
    app.update();
    check(&app, entity, &wanted, "a document");
}

/// Bevy's animation gets the mixed layers, and no curve of a node that no layer in effect concerns: other clips of a game's graph
/// move that node alone.
#[test]
fn layers_with_weights_and_masks_go_to_bevys_animation() {
    let program = program(&biped());
    let nodes = free(&program);
    let (clip, wanted) = layered([nodes[0], nodes[1], nodes[2], nodes[3]]);
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let for_bevy = animation_clip(&clip, &program, mode);
        let has_curve: Vec<bool> =
            wanted.iter().map(|(node, _)| for_bevy.curves_for_target(target_id(*node)).is_some()).collect();
        assert_eq!(has_curve, [true, true, true, false], "{mode:?}");
        let mut app = app();
        let entity = app.world_mut().spawn((Transform::IDENTITY, ClipTargets)).id();
        spawn_instance(app.world_mut(), entity, &program, mode);
        let handle = app.world_mut().resource_mut::<Assets<AnimationClip>>().add(for_bevy);
        let (graph, index) = AnimationGraph::from_clip(handle);
        let graph = app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
        let mut player = AnimationPlayer::default();
        player.play(index).pause().seek_to(0.5);
        app.world_mut().entity_mut(entity).insert((player, AnimationGraphHandle(graph)));
        for _ in 0..4 {
            app.update();
        }
        check(&app, entity, &wanted, &format!("{mode:?}"));
    }
}
