//! Clips of files on instances: loaded by the asset server, bound to the instance's nodes, played, with events at markers.

use std::{fs, path::Path, sync::Arc, time::Duration};

use bevy::{animation::AnimationPlugin, prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    instance::{
        ClipsBound, InstanceAnimations, InstanceClips, RigAnimation, RigAnimationLoader, RigInstance, RigInstancePlugin,
    },
    modules,
    plugins::{
        animation::{ClipPlayer, ClipPlugin, ClipTargets, MarkerReached, RigClips},
        runtime::InstanceMode,
    },
    processor::Builder,
    rig::{
        Uid,
        animation::{Key, Marker, NodeNames, Property, RigClip, Track, TrackTarget},
        format::animation::write_named,
        operations::KeyTolerance,
        template::read_template,
    },
    solve::{
        bake_clip::BakeSettings,
        packed_clip::{PackedSkeleton, pack_clip},
        program::{CompileOptions, RigProgram},
    },
};

use super::{AppBench, TWO, saved};

/// A node that no rig has.
const GONE: Uid = Uid(0xDEAD);

#[derive(Resource, Default)]
struct ClipMessages {
    bound: Vec<Vec<Uid>>,
    markers: Vec<(Entity, String)>,
}

/// A file in which the control `ctl_a` rises by `way` in a second, with nodes of other uids than any rig has.
fn file(way: f32) -> String {
    let rig = read_template(TWO.as_bytes()).unwrap().rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let control = built.nodes.iter().find(|node| &*node.name == "ctl_a").unwrap().uid;
    let keys = vec![Key::vector(0.0, Vec3::ZERO), Key::vector(1.0, Vec3::new(0.0, way, 0.0))];
    let mut clip = RigClip { looped: true, ..RigClip::new(Uid(0xC1), Uid(0xC2), "rise") };
    clip.markers = [(0.25, "low"), (0.75, "high")].map(|(time, name)| Marker { time, name: name.into() }).to_vec();
    for node in [control, GONE] {
        let target = TrackTarget { node, property: Property::Translation };
        clip.layers[0].tracks.insert(target, Arc::new(Track { keys: keys.clone() }));
    }
    let other = |uid: Uid| if uid == GONE { uid } else { Uid(uid.0 ^ 0x5A5A_0000_0000) };
    let names = NodeNames::of(&rig, Some(&built)).0.into_iter().map(|(uid, name)| (other(uid), name)).collect();
    write_named(Uid(0xF1), "two", &NodeNames(names), &[clip.with_nodes(other)])
}

fn game(folder: &Path) -> AppBench {
    let mut game = AppBench::game_with(RigInstancePlugin::default(), folder, |app| {
        app.add_plugins((AnimationPlugin, ClipPlugin))
            .init_resource::<ClipMessages>()
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)))
            .add_observer(|bound: On<ClipsBound>, mut told: ResMut<ClipMessages>| {
                told.bound.push(bound.missing.clone())
            })
            .add_observer(|reached: On<MarkerReached>, mut told: ResMut<ClipMessages>| {
                told.markers.push((reached.entity, reached.name.clone()));
            });
    });
    game.app.update();
    game
}

fn told(game: &AppBench) -> &ClipMessages {
    game.app.world().resource::<ClipMessages>()
}

/// Updates until clips were bound so many times.
fn bound(game: &mut AppBench, count: usize) {
    let start = std::time::Instant::now();
    while told(game).bound.len() < count {
        assert!(start.elapsed() < super::HANG, "the clips do not come");
        game.app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A game with an instance, and the file of a clip in which its control rises.
fn rising(folder: &Path, mode: InstanceMode) -> (AppBench, Handle<RigAnimation>, Entity) {
    let path = saved(folder, TWO);
    fs::write(folder.join("rise.anim.ron"), file(1.0)).unwrap();
    let mut game = game(folder);
    let clips = game.app.world().resource::<AssetServer>().load::<RigAnimation>("rise.anim.ron");
    let instance = game.open(&path, mode);
    (game, clips, instance)
}

#[test]
fn a_file_of_clips_plays_on_an_instance() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let (mut game, clips, instance) = rising(folder.path(), mode);
        game.app.world_mut().entity_mut(instance).insert(InstanceClips(clips.clone()));
        bound(&mut game, 1);
        assert_eq!(told(&game).bound, [vec![GONE]]);
        let clip = game.app.world().get::<RigClips>(instance).unwrap().0[0].clone();
        assert!(game.app.world().get::<InstanceAnimations>(instance).is_none());
        game.app.world_mut().entity_mut(instance).insert(ClipPlayer::new(&clip));
        for _ in 0..14 {
            game.app.update();
        }
        let player = *game.app.world().get::<ClipPlayer>(instance).unwrap();
        assert!((player.time - 0.4).abs() < 1e-3, "{}", player.time);
        let end = game.node(instance, "a_end");
        let height = |game: &AppBench| game.app.world().get::<GlobalTransform>(end).unwrap().translation().y;
        assert!((height(&game) - 1.9).abs() < 1e-3, "{mode:?}: {}", height(&game));
        let names: Vec<&str> = told(&game).markers.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["low", "high", "low"], "{mode:?}");
        assert!(told(&game).markers.iter().all(|(entity, _)| *entity == instance));

        // A changed file is bound anew, and the player goes on with it.
        let changed = RigAnimation::read(file(2.0).as_bytes()).unwrap();
        game.app.world_mut().resource_mut::<Assets<RigAnimation>>().insert(clips.id(), changed).unwrap();
        bound(&mut game, 2);
        game.app.world_mut().entity_mut(instance).insert(ClipPlayer { time: 0.5, playing: false, ..player });
        game.app.update();
        assert!((height(&game) - 2.5).abs() < 1e-3, "{mode:?}: {}", height(&game));
    }
}

#[test]
fn a_file_of_clips_becomes_animations_of_bevy() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let (mut game, clips, instance) = rising(folder.path(), mode);
        game.app.world_mut().entity_mut(instance).insert((InstanceClips(clips.clone()), ClipTargets));
        bound(&mut game, 1);
        let animations = game.app.world().get::<InstanceAnimations>(instance).unwrap().clone();
        assert_eq!(animations.0.len(), 1);
        let (graph, index) = AnimationGraph::from_clip(animations.0[0].clone());
        let graph = game.app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
        let mut player = AnimationPlayer::default();
        player.play(index).repeat();
        game.app.world_mut().entity_mut(instance).insert((player, AnimationGraphHandle(graph)));
        for _ in 0..30 {
            game.app.update();
        }
        let names: Vec<&str> = told(&game).markers.iter().map(|(_, name)| name.as_str()).collect();
        assert!(names.len() >= 4 && names.starts_with(&["low", "high", "low", "high"]), "{mode:?}: {names:?}");
        assert!(told(&game).markers.iter().all(|(entity, _)| *entity == instance));
        let halt = |game: &mut AppBench| {
            let mut player = game.app.world_mut().get_mut::<AnimationPlayer>(instance).unwrap();
            player.animation_mut(index).unwrap().pause().seek_to(0.5);
            for _ in 0..4 {
                game.app.update();
            }
            let end = game.node(instance, "a_end");
            game.app.world().get::<GlobalTransform>(end).unwrap().translation().y
        };
        let height = halt(&mut game);
        assert!((height - 2.0).abs() < 1e-3, "{mode:?}: {height}");

        // Handles stay when the file changes, so that graphs go on.
        let changed = RigAnimation::read(file(2.0).as_bytes()).unwrap();
        game.app.world_mut().resource_mut::<Assets<RigAnimation>>().insert(clips.id(), changed).unwrap();
        bound(&mut game, 2);
        assert_eq!(*game.app.world().get::<InstanceAnimations>(instance).unwrap(), animations);
        let height = halt(&mut game);
        assert!((height - 2.5).abs() < 1e-3, "{mode:?}: {height}");
    }
}

/// Packed clips are clips of the joints, markers and all.
#[test]
fn packed_clips_play_on_an_instance() {
    let folder = tempfile::tempdir().unwrap();
    let bare = TWO.replace(", tags: [control(creation: (name: \"ctl_a\"))]", "");
    let rig = read_template(bare.as_bytes()).unwrap().rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
    let mut clip = RigClip::new(Uid(0xC1), Uid(0xC2), "rise");
    clip.markers = vec![Marker { time: 0.25, name: "low".into() }];
    let target = TrackTarget { node: rig.find_label("a").unwrap(), property: Property::Translation };
    let keys = vec![Key::vector(0.0, Vec3::ZERO), Key::vector(1.0, Vec3::Y)];
    clip.layers[0].tracks.insert(target, Arc::new(Track { keys }));
    let mut packed = PackedSkeleton::of(&rig, &built);
    let nodes = packed.baked_nodes();
    packed.clips.push(pack_clip(&program, &clip, &nodes, &BakeSettings::new(30.0, KeyTolerance::default())).unwrap());
    fs::write(folder.path().join("rise.rigclip"), packed.to_bytes()).unwrap();

    let path = saved(folder.path(), &bare);
    let mut game = game(folder.path());
    let clips = game.app.world().resource::<AssetServer>().load::<RigAnimation>("rise.rigclip");
    let instance = game.open(&path, InstanceMode::Hierarchy);
    game.app.world_mut().entity_mut(instance).insert(InstanceClips(clips));
    bound(&mut game, 1);
    assert_eq!(told(&game).bound, [Vec::<Uid>::new()]);
    let own = game.app.world().get::<RigClips>(instance).unwrap().0[0].clone();
    assert_eq!((own.name.as_str(), &own.markers), ("rise", &clip.markers));
    let player = ClipPlayer { time: 0.5, playing: false, ..ClipPlayer::new(&own) };
    game.app.world_mut().entity_mut(instance).insert(player);
    game.app.update();
    let end = game.node(instance, "a_end");
    let height = game.app.world().get::<GlobalTransform>(end).unwrap().translation().y;
    assert!((height - 2.0).abs() < 1e-3, "{height}");
    assert!(RigAnimation::unpack(b"rigpack1", "cut").is_err());
}

#[test]
fn clips_of_a_file_go_through_versions_of_the_template() {
    let folder = tempfile::tempdir().unwrap();
    let (mut game, clips, instance) = rising(folder.path(), InstanceMode::Hierarchy);
    game.app.world_mut().entity_mut(instance).insert((InstanceClips(clips), ClipTargets));
    bound(&mut game, 1);
    let own = |game: &AppBench| game.app.world().get::<RigClips>(instance).unwrap().0.clone();
    let first = own(&game);
    let animations = game.app.world().get::<InstanceAnimations>(instance).unwrap().clone();
    let control = first[0].nodes().into_iter().find(|node| *node != GONE).unwrap();
    game.offer(instance, TWO.replace(", tags: [control(creation: (name: \"ctl_a\"))]", "").as_bytes());
    bound(&mut game, 2);
    let mut missing = told(&game).bound[1].clone();
    missing.sort_unstable_by_key(|node| *node != GONE);
    assert_eq!(missing, [GONE, control]);
    // The joint, which nothing drives any more, has the motion; the keys of the control wait.
    let now = own(&game);
    let tracks = |node: Uid| now[0].layers[0].tracks.keys().filter(|target| target.node == node).count();
    let joint = read_template(TWO.as_bytes()).unwrap().rig.find_label("a").unwrap();
    assert!(tracks(control) > 0 && tracks(joint) > 0, "{:?}", now[0].nodes());
    game.offer(instance, TWO.as_bytes());
    bound(&mut game, 3);
    assert_eq!(told(&game).bound[2], [GONE]);
    assert_eq!(own(&game), first);
    assert_eq!(*game.app.world().get::<InstanceAnimations>(instance).unwrap(), animations, "handles stay");
}

#[test]
fn a_file_without_clips_that_can_be_read_is_an_error() {
    let error = RigAnimation::read(b"(format: 1, rig: ").unwrap_err();
    assert!(!error.to_string().is_empty());
    assert_eq!(bevy::asset::AssetLoader::extensions(&RigAnimationLoader), ["anim.ron", "rigclip"]);
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), TWO);
    fs::write(folder.path().join("bad.anim.ron"), "(format: 1, rig: ").unwrap();
    let mut game = game(folder.path());
    let clips = game.app.world().resource::<AssetServer>().load::<RigAnimation>("bad.anim.ron");
    let instance = game.open(&path, InstanceMode::Direct);
    game.app.world_mut().entity_mut(instance).insert(InstanceClips(clips.clone()));
    game.wait("the refused file", |game| game.app.world().resource::<AssetServer>().load_state(&clips).is_failed());
    game.frames(4);
    assert!(told(&game).bound.is_empty() && game.app.world().get::<RigClips>(instance).is_none());
    assert!(game.app.world().get::<RigInstance>(instance).is_some());
}
