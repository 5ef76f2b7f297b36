//! Meshes of instances: those that Rigsmith binds, and those that Bevy loaded with a skin and an animation.

use bevy::{
    animation::{AnimatedBy, AnimationPlugin, AnimationTargetId, animated_field, graph::AnimationGraphHandle},
    mesh::skinning::SkinnedMesh,
    prelude::*,
};
use rigsmith::{
    files::{RealDisk, load_model},
    instance::{InstanceSkins, RigInstance, RigInstancePlugin, RunningTemplate, SkinBound},
    mesh::{
        model::Trs,
        obj::{ObjSettings, read_model},
    },
    plugins::{
        runtime::InstanceMode,
        skinning::InstanceSkin,
        surface::{RigMesh, SkinOf},
    },
    rig::{Rig, RigEdit, Uid, UidSource, character::import_skeleton, template::write_template},
};

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{AppBench, Bindings, HANG, TWO, saved};
use crate::{bench::save_whole, prerequisites::test_data};

/// A tube around both chains of [`TWO`], as a mesh of an instance.
fn tube() -> RigMesh {
    let mut text = String::new();
    for side in [0.0, 1.0] {
        for ring in 0..6u8 {
            for turn in 0..4u8 {
                let angle = f32::from(turn) * std::f32::consts::FRAC_PI_2;
                let (x, z) = (side + 0.1 * angle.cos(), 0.1 * angle.sin());
                text.push_str(&format!("v {x} {} {z}\n", 0.9 + 0.15 * f32::from(ring)));
            }
        }
    }
    for half in 0..2 {
        for ring in 0..5 {
            for turn in 0..4 {
                let (a, b) = (half * 24 + ring * 4 + turn + 1, half * 24 + ring * 4 + (turn + 1) % 4 + 1);
                text.push_str(&format!("f {a} {b} {} {}\n", b + 4, a + 4));
            }
        }
    }
    let model = read_model(text.as_bytes(), "tube", &ObjSettings::default(), &mut |_| None).unwrap();
    RigMesh::new(Uid(4242), model, Vec::new())
}

#[test]
fn meshes_of_instances_are_bound_once_for_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), TWO);
    let mut game = AppBench::live_game();
    game.app.init_resource::<Bindings>();
    game.app.add_observer(|bound: On<SkinBound>, mut bindings: ResMut<Bindings>| {
        bindings.0.push((bound.instance, bound.unknown.clone()));
    });
    let first = game.open(&path, InstanceMode::Direct);
    let template = game.app.world().get::<RigInstance>(first).unwrap().0.clone();
    let second = game.spawn(template, InstanceMode::Hierarchy);
    let mesh = tube();
    let meshes = [first, second].map(|instance| game.app.world_mut().spawn((mesh.clone(), SkinOf(instance))).id());
    let skin = |game: &AppBench, mesh: Entity| game.app.world().get::<InstanceSkin>(mesh).map(|skin| skin.0.clone());
    let bound = |game: &mut AppBench| {
        let start = Instant::now();
        while meshes.iter().any(|mesh| skin(game, *mesh).is_none()) {
            assert!(start.elapsed() < HANG, "no weights come");
            game.go_on(Duration::from_millis(5));
        }
    };
    bound(&mut game);
    let skins = meshes.map(|mesh| skin(&game, mesh).unwrap());
    assert!(Arc::ptr_eq(&skins[0], &skins[1]));
    assert_eq!(game.app.world().resource::<InstanceSkins>().computed(), 1);
    assert_eq!(game.app.world().resource::<Bindings>().0.len(), 2);
    assert_eq!(skins[0].weights.len(), 48);
    for point in 0..48 {
        let sum: f32 = skins[0].weights.of(point).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-4, "point {point}: {sum}");
    }
    // The two limbs have their own joints.
    let running = game.app.world().get::<RunningTemplate>(first).unwrap().get().clone();
    let joint = |label: &str| running.rig.find_label(label).unwrap();
    let held = |point: usize, label: &str| {
        let place = skins[0].joints.iter().position(|uid| *uid == joint(label)).unwrap() as u32;
        skins[0].weights.of(point).find(|(joint, _)| *joint == place).map_or(0.0, |(_, weight)| weight)
    };
    assert!(held(1, "a") > 0.9 && held(25, "b") > 0.9 && held(1, "b") == 0.0, "{} {}", held(1, "a"), held(25, "b"));
    // A value of a control leaves the weights; another place of a joint at rest binds anew.
    save_whole(
        &path,
        TWO.replace("control(creation: (name: \"ctl_b\"))", "control(size: 0.7, creation: (name: \"ctl_b\"))"),
    );
    game.until("the update", |told| told.updated.len() == 2);
    game.go_on(Duration::from_millis(50));
    assert!(Arc::ptr_eq(&skin(&game, meshes[1]).unwrap(), &skins[1]));
    save_whole(
        &path,
        TWO.replace("parent: \"a\", translation: (0, 0.5, 0)", "parent: \"a\", translation: (0, 0.3, 0)"),
    );
    game.until("the other update", |told| told.updated.len() == 4);
    let start = Instant::now();
    while game.app.world().resource::<InstanceSkins>().computed() < 2 {
        assert!(start.elapsed() < HANG, "nothing is bound anew");
        game.go_on(Duration::from_millis(5));
    }
    assert!(!Arc::ptr_eq(&skin(&game, meshes[0]).unwrap(), &skins[0]));
    game.go_on(Duration::from_millis(50));
    assert_eq!(game.app.world().resource::<InstanceSkins>().computed(), 2);
}

#[test]
fn a_loaded_character_with_an_animation_of_its_own_is_moved_by_an_instance() {
    let Some(data) = test_data() else { return };
    let model = load_model(&RealDisk, &data.join("gltf_skinned/CesiumMan.glb")).unwrap();
    let uids = &mut UidSource::seeded(3);
    let mut rig = Rig::new(Uid(9), "man");
    import_skeleton(&model, uids).edits.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    // The rig does not have one of the hands, which the file goes on to animate.
    let leaf = rig.walk().filter(|joint| rig.children(Some(joint.data.uid)).is_empty()).last().unwrap().data.clone();
    let above = rig.joint(leaf.uid).unwrap().parent.unwrap();
    let above = rig.joint(above).unwrap().data.label.clone().unwrap();
    rig.apply(&RigEdit::RemoveJoint(leaf.uid)).unwrap();
    let leaf = leaf.label.unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), &write_template(&rig));
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let mut game = AppBench::game_with(RigInstancePlugin::default(), Path::new("assets"), |app| {
            app.add_plugins(AnimationPlugin);
        });
        game.app.init_resource::<Bindings>();
        game.app.add_observer(|bound: On<SkinBound>, mut bindings: ResMut<Bindings>| {
            bindings.0.push((bound.instance, bound.unknown.clone()));
        });
        let instance = game.open(&path, mode);
        // Entities as Bevy's loader makes them of the file: nodes with names, a player, animated nodes, a skin.
        let world = game.app.world_mut();
        let scene = world.spawn((Transform::default(), ChildOf(instance))).id();
        let mut nodes = Vec::new();
        for node in &model.nodes {
            let Trs { translation, rotation, scale } = node.rest;
            let below = node.parent.map_or(scene, |parent| nodes[parent]);
            let transform = Transform { translation, rotation, scale };
            nodes.push(world.spawn((Name::new(node.name.clone()), transform, ChildOf(below))).id());
        }
        let animated = nodes[model.nodes.iter().position(|node| node.name == leaf).unwrap()];
        let target = AnimationTargetId::from_names([Name::new(leaf.clone())].iter());
        let mut clip = AnimationClip::default();
        let keys = [(0.0, Vec3::ZERO), (1.0, Vec3::new(0.0, 5.0, 0.0))];
        let curve = AnimatableKeyframeCurve::new(keys).unwrap();
        clip.add_curve_to_target(target, AnimatableCurve::new(animated_field!(Transform::translation), curve));
        let clip = world.resource_mut::<Assets<AnimationClip>>().add(clip);
        let (graph, index) = AnimationGraph::from_clip(clip);
        let graph = world.resource_mut::<Assets<AnimationGraph>>().add(graph);
        let mut player = AnimationPlayer::default();
        player.play(index).repeat();
        let player = world.entity_mut(scene).insert((player, AnimationGraphHandle(graph))).id();
        world.entity_mut(animated).insert((target, AnimatedBy(player)));
        let joints: Vec<Entity> = model.skins[0].joints.iter().map(|node| nodes[*node]).collect();
        let skin = SkinnedMesh { inverse_bindposes: Handle::default(), joints };
        let mesh = world.spawn((skin, ChildOf(scene))).id();
        game.app.update();
        assert_eq!(game.app.world().resource::<Bindings>().0, [(instance, vec![leaf.clone()])], "{mode:?}");
        let bound = game.app.world().get::<SkinnedMesh>(mesh).unwrap().joints.clone();
        for (joint, node) in bound.iter().zip(&model.skins[0].joints) {
            let name = &model.nodes[*node].name;
            let expected = if *name == leaf { animated } else { game.node(instance, name) };
            assert_eq!(*joint, expected, "{mode:?} {name}");
        }
        // The rest pose of the rig is that of the file, so the character stands as it did.
        let hand = game.node(instance, &above);
        assert_eq!(game.app.world().get::<ChildOf>(animated).map(|of| of.0), Some(hand));
        game.frames(6);
        let played = game.app.world().get::<Transform>(animated).unwrap().translation;
        assert!(played.y > 0.0, "{mode:?}: the file's own animation goes on, {played}");
    }
}
