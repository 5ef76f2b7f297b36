//! Characters that Bevy loaded below an instance: their own clips and bind poses.

use bevy::{
    animation::{AnimatedBy, AnimationPlugin, AnimationTargetId, animated_field, graph::AnimationGraphHandle},
    mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes},
    prelude::*,
};
use rigsmith::{
    instance::{BoundTo, JointsHeld, RigInstance, RigInstancePlugin, RigTemplate, RunningTemplate},
    plugins::runtime::InstanceMode,
};

use std::{collections::BTreeSet, path::Path};

use super::{AppBench, TWO, saved};

/// Nodes of a file: names, parents and places, as those of [`TWO`].
const NODES: [(&str, Option<usize>, Vec3); 4] = [
    ("a", None, Vec3::new(0.0, 1.0, 0.0)),
    ("a_end", Some(0), Vec3::new(0.0, 0.5, 0.0)),
    ("b", None, Vec3::new(1.0, 1.0, 0.0)),
    ("b_end", Some(2), Vec3::new(0.0, 0.5, 0.0)),
];

/// Joints that were told as held.
#[derive(Resource, Default)]
struct Held(Vec<String>);

fn game() -> AppBench {
    let mut game = AppBench::game_with(RigInstancePlugin::default(), Path::new("assets"), |app| {
        app.add_plugins(AnimationPlugin).init_asset::<SkinnedMeshInverseBindposes>().init_resource::<Held>();
    });
    game.app.add_observer(|told: On<JointsHeld>, mut held: ResMut<Held>| held.0.extend(told.joints.clone()));
    game
}

/// Entities as Bevy's loader makes them of a file.
struct Loaded {
    nodes: Vec<Entity>,
    scene: Entity,
    mesh: Entity,
    bindposes: Handle<SkinnedMeshInverseBindposes>,
}

impl Loaded {
    /// The file below an instance, with inverse bind poses that were loaded before, or its own.
    fn below(game: &mut AppBench, instance: Entity, bindposes: Option<Handle<SkinnedMeshInverseBindposes>>) -> Self {
        let world = game.app.world_mut();
        let scene = world.spawn((Transform::default(), ChildOf(instance))).id();
        let (mut nodes, mut places) = (Vec::new(), Vec::new());
        for (name, parent, place) in NODES {
            let below = parent.map_or(scene, |parent: usize| nodes[parent]);
            nodes.push(world.spawn((Name::new(name), Transform::from_translation(place), ChildOf(below))).id());
            places.push(place + parent.map_or(Vec3::ZERO, |parent| places[parent]));
        }
        let bindposes = bindposes.unwrap_or_else(|| {
            let matrices: Vec<Mat4> = places.iter().map(|place| Mat4::from_translation(-*place)).collect();
            world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(matrices)
        });
        let skin = SkinnedMesh { inverse_bindposes: bindposes.clone(), joints: nodes.clone() };
        let mesh = world.spawn((skin, ChildOf(scene))).id();
        Self { nodes, scene, mesh, bindposes }
    }

    /// A clip of the file that moves all nodes upwards, played.
    fn play(&self, game: &mut AppBench) {
        let world = game.app.world_mut();
        let mut clip = AnimationClip::default();
        let player = self.scene;
        for (node, (name, _, place)) in self.nodes.iter().zip(NODES) {
            let target = AnimationTargetId::from_names([Name::new(name)].iter());
            let keys = [(0.0, place + Vec3::Y * 0.1), (100.0, place + Vec3::Y * 20.0)];
            let curve = AnimatableKeyframeCurve::new(keys).unwrap();
            clip.add_curve_to_target(target, AnimatableCurve::new(animated_field!(Transform::translation), curve));
            world.entity_mut(*node).insert((target, AnimatedBy(player)));
        }
        let clip = world.resource_mut::<Assets<AnimationClip>>().add(clip);
        let (graph, index) = AnimationGraph::from_clip(clip);
        let graph = world.resource_mut::<Assets<AnimationGraph>>().add(graph);
        let mut player = AnimationPlayer::default();
        player.play(index);
        world.entity_mut(self.scene).insert((player, AnimationGraphHandle(graph)));
    }
}

#[test]
fn a_clip_of_the_file_moves_the_joints_that_the_rig_leaves_free() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = game();
        let instance = game.open(&saved(folder.path(), TWO), mode);
        let loaded = Loaded::below(&mut game, instance, None);
        game.app.update();
        game.app.update();
        let joints = NODES.map(|(name, ..)| game.node(instance, name));
        let rest = joints.map(|joint| game.app.world().get::<GlobalTransform>(joint).unwrap().translation());
        assert_eq!(game.app.world().get::<SkinnedMesh>(loaded.mesh).unwrap().joints, joints);
        assert_eq!(game.app.world().resource::<Held>().0, Vec::<String>::new(), "nothing moves yet");
        loaded.play(&mut game);
        game.frames(6);
        let running = game.app.world().get::<RunningTemplate>(instance).unwrap().get().clone();
        let driven: BTreeSet<&str> = NODES
            .iter()
            .map(|(name, ..)| *name)
            .filter(|name| running.whole.nodes()[running.whole.find_label(name).unwrap()].is_driven)
            .collect();
        assert!(!driven.contains("a_end"), "{driven:?}");
        let told: Vec<String> = game.app.world().resource::<Held>().0.clone();
        assert_eq!(told.iter().map(String::as_str).collect::<BTreeSet<_>>(), driven, "{mode:?}");
        assert_eq!(told.len(), driven.len(), "each is told once");
        // A joint that is free stands, below its parent, as the file's node does below its own.
        let world = game.app.world();
        let place = |joint: Entity| world.get::<GlobalTransform>(joint).unwrap().translation();
        let local = world.get::<Transform>(loaded.nodes[1]).unwrap().translation;
        assert!(local.y > 0.55, "{mode:?}: the clip plays, {local}");
        assert!((place(joints[1]) - place(joints[0])).distance(local) < 1e-4, "{mode:?}: {}", place(joints[1]));
        assert!(place(joints[1]).y > rest[1].y + 0.05);
        for (number, (name, ..)) in NODES.iter().enumerate().filter(|(_, (name, ..))| driven.contains(name)) {
            assert!(place(joints[number]).distance(rest[number]) < 1e-5, "{mode:?}: {name} is the rig's own");
        }
    }
}

#[test]
fn bind_poses_fit_the_rest_of_the_template() {
    let higher = TWO
        .replace("parent: \"a\", translation: (0, 0.5, 0)", "parent: \"a\", translation: (0.1, 0.7, 0)")
        .replace("(label: \"b\", translation: (1, 1, 0)", "(label: \"b\", translation: (1.2, 1, 0)");
    for (text, is_other) in [(TWO, false), (higher.as_str(), true)] {
        for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
            let folder = tempfile::tempdir().unwrap();
            let mut game = game();
            let first = game.open(&saved(folder.path(), text), mode);
            let template = game.app.world().get::<RigInstance>(first).unwrap().0.clone();
            let second = game.spawn(template, mode);
            let one = Loaded::below(&mut game, first, None);
            let two = Loaded::below(&mut game, second, Some(one.bindposes.clone()));
            (0..3).for_each(|_| game.app.update());
            let world = game.app.world();
            let skins = [&one, &two].map(|loaded| world.get::<SkinnedMesh>(loaded.mesh).unwrap());
            assert_eq!(skins[0].inverse_bindposes, skins[1].inverse_bindposes, "instances share them");
            assert_eq!(skins[0].inverse_bindposes != one.bindposes, is_other);
            let assets = world.resource::<Assets<SkinnedMeshInverseBindposes>>();
            let matrices = assets.get(&skins[0].inverse_bindposes).unwrap();
            for (joint, matrix) in skins[0].joints.iter().zip(matrices.iter()) {
                // At rest the mesh stands as in the file.
                let whole = world.get::<GlobalTransform>(*joint).unwrap().to_matrix() * *matrix;
                assert!(whole.abs_diff_eq(Mat4::IDENTITY, 1e-5), "{mode:?}: {whole}");
            }
            let file = assets.get(&one.bindposes).unwrap();
            assert_eq!(file[1], Mat4::from_translation(Vec3::new(0.0, -1.5, 0.0)), "the file's own stay");
        }
    }
}

/// Template of [`TWO`] without a joint.
fn without(label: &str) -> String {
    let label = format!("label: \"{label}\"");
    TWO.lines().filter(|line| !line.contains(&label)).map(|line| format!("{line}\n")).collect()
}

/// Checks that the mesh is moved by the nodes of its instance, but for a joint that the instance does not have, and that it stands
/// as in the file.
#[track_caller]
fn check_bound(game: &mut AppBench, instance: Entity, loaded: &Loaded, missing: Option<&str>) {
    game.frames(3);
    for (number, (name, parent, _)) in NODES.into_iter().enumerate() {
        let above = parent.map(|parent| NODES[parent].0);
        let (joint, above) = if missing == Some(name) {
            (loaded.nodes[number], game.node(instance, above.unwrap()))
        } else {
            (game.node(instance, name), parent.map_or(loaded.scene, |parent| loaded.nodes[parent]))
        };
        let world = game.app.world();
        assert_eq!(world.get::<SkinnedMesh>(loaded.mesh).unwrap().joints[number], joint, "{name}");
        assert_eq!(world.get::<ChildOf>(loaded.nodes[number]).map(ChildOf::parent), Some(above), "{name}");
    }
    check_at_rest(game, loaded);
}

/// Checks that the mesh stands as in the file.
#[track_caller]
fn check_at_rest(game: &AppBench, loaded: &Loaded) {
    let world = game.app.world();
    let skin = world.get::<SkinnedMesh>(loaded.mesh).unwrap();
    let matrices = world.resource::<Assets<SkinnedMeshInverseBindposes>>().get(&skin.inverse_bindposes).unwrap();
    for (joint, matrix) in skin.joints.iter().zip(matrices.iter()) {
        let whole = world.get::<GlobalTransform>(*joint).unwrap().to_matrix() * *matrix;
        assert!(whole.abs_diff_eq(Mat4::IDENTITY, 1e-5), "{whole}");
    }
}

#[test]
fn a_loaded_mesh_follows_whatever_becomes_of_its_instance() {
    let modes = [InstanceMode::Hierarchy, InstanceMode::Direct];
    for (mode, other_mode) in [(modes[0], modes[1]), (modes[1], modes[0])] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = game();
        let instance = game.open(&saved(folder.path(), &without("b_end")), mode);
        let loaded = Loaded::below(&mut game, instance, None);
        let end = game.node(instance, "a_end");
        let sword = game.app.world_mut().spawn((Transform::default(), ChildOf(end))).id();
        check_bound(&mut game, instance, &loaded, Some("b_end"));
        // A saved template has the joint, and the next one has it no more.
        game.offer(instance, TWO.as_bytes());
        game.until("the joint", |told| told.updated.len() == 1);
        check_bound(&mut game, instance, &loaded, None);
        game.offer(instance, without("b_end").as_bytes());
        game.until("the joint is gone", |told| told.updated.len() == 2);
        check_bound(&mut game, instance, &loaded, Some("b_end"));
        // Another mode has other nodes; what hung on the former ones is there.
        game.app.world_mut().entity_mut(instance).insert(other_mode);
        game.until("the other mode", |told| told.built == 2);
        check_bound(&mut game, instance, &loaded, Some("b_end"));
        assert_eq!(game.app.world().get::<ChildOf>(sword).map(ChildOf::parent), Some(instance), "{mode:?}");
        // Another template.
        let other = RigTemplate::read(without("a_end").as_bytes()).unwrap();
        let other = game.app.world_mut().resource_mut::<Assets<RigTemplate>>().add(other);
        game.app.world_mut().entity_mut(instance).insert(RigInstance(other.clone()));
        game.until("the other template", |told| told.updated.len() == 3);
        check_bound(&mut game, instance, &loaded, Some("a_end"));
        // Without an instance the mesh is moved by its own joints, as it was loaded; and it is bound again by the next one.
        game.app.world_mut().entity_mut(instance).remove::<RigInstance>();
        game.frames(3);
        let skin = game.app.world().get::<SkinnedMesh>(loaded.mesh).unwrap();
        assert_eq!((&skin.joints, &skin.inverse_bindposes), (&loaded.nodes, &loaded.bindposes), "{mode:?}");
        assert!(game.app.world().get::<BoundTo>(loaded.mesh).is_none());
        check_at_rest(&game, &loaded);
        game.app.world_mut().entity_mut(instance).insert(RigInstance(other));
        game.until("the instance again", |told| told.built == 3);
        check_bound(&mut game, instance, &loaded, Some("a_end"));
    }
}

#[test]
fn a_loaded_mesh_follows_the_instance_that_it_is_put_below() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = game();
        let first = game.open(&saved(folder.path(), TWO), mode);
        let template = game.app.world().get::<RigInstance>(first).unwrap().0.clone();
        let second = game.spawn(template, mode);
        // Loaded elsewhere.
        let other = game.app.world_mut().spawn(Transform::default()).id();
        let loaded = Loaded::below(&mut game, other, None);
        game.frames(2);
        let joints = |game: &AppBench| game.app.world().get::<SkinnedMesh>(loaded.mesh).unwrap().joints.clone();
        assert_eq!(joints(&game), loaded.nodes);
        for instance in [first, second] {
            game.app.world_mut().entity_mut(loaded.scene).insert(ChildOf(instance));
            check_bound(&mut game, instance, &loaded, None);
        }
        game.app.world_mut().entity_mut(loaded.scene).remove::<ChildOf>();
        game.frames(3);
        assert_eq!(joints(&game), loaded.nodes, "{mode:?}");
        check_at_rest(&game, &loaded);
    }
}
