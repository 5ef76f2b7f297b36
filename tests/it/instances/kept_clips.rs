//! Clips of instances whose templates change what keys mean: joints move as before, in every frame, and what cannot is told.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    instance::{RigInstance, RigInstancePlugin, RigUpdated, RunningTemplate},
    modules,
    plugins::{
        animation::{ClipPlayer, ClipPlugin, RigClips},
        runtime::InstanceMode,
    },
    processor::{Builder, ClipReport},
    rig::{
        Rig, RigEdit, Uid,
        animation::{Key, Property, RigClip, Track, TrackTarget},
        template::{read_template, write_template},
    },
};

use super::{AppBench, HANG, TWO, saved};
use crate::animation::keep::{NEAR, flip_all, gentle, joints_off};

/// Reports of updates about clips.
#[derive(Resource, Default)]
struct ClipReportLog(Vec<Arc<ClipReport>>);

fn game(folder: &Path) -> AppBench {
    AppBench::game_with(RigInstancePlugin::default(), folder, |app| {
        app.add_plugins(ClipPlugin)
            .init_resource::<ClipReportLog>()
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)))
            .add_observer(|updated: On<RigUpdated>, mut told: ResMut<ClipReportLog>| {
                told.0.push(updated.clips.clone())
            });
    })
}

fn told(game: &AppBench) -> &[Arc<ClipReport>] {
    &game.app.world().resource::<ClipReportLog>().0
}

/// The character, and a clip of its controls.
fn character() -> (Rig, RigClip) {
    let mut rig = gentle();
    let clip = rig.clips()[0].clone();
    rig.apply(&RigEdit::RemoveClip(clip.uid)).unwrap();
    (rig, clip)
}

fn clips(game: &AppBench, instance: Entity) -> Arc<[RigClip]> {
    game.app.world().get::<RigClips>(instance).unwrap().0.clone()
}

/// Places of the joints of a rig in the world.
fn joints(game: &AppBench, instance: Entity, rig: &Rig) -> BTreeMap<Uid, Vec3> {
    let places = game.places(instance);
    let joints = places.iter().filter(|(uid, _)| rig.joint(**uid).is_some());
    joints.map(|(uid, (place, _))| (*uid, place.translation())).collect()
}

/// Shows the clip at a second.
fn show(game: &mut AppBench, instance: Entity, time: f32) {
    game.app.world_mut().get_mut::<ClipPlayer>(instance).unwrap().time = time;
    game.app.update();
}

#[test]
fn a_reload_that_turns_axes_leaves_the_motion_in_every_frame() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let (before, clip) = character();
        let folder = tempfile::tempdir().unwrap();
        let path = saved(folder.path(), &write_template(&before));
        let mut game = game(folder.path());
        let instance = game.open(&path, mode);
        // Two instances with the same clips share what is made of them.
        let handle = game.app.world().get::<RigInstance>(instance).unwrap().0.clone();
        let other = game.spawn(handle, mode);
        let made: Arc<[RigClip]> = vec![clip.clone()].into();
        for entity in [instance, other] {
            let player = ClipPlayer { playing: false, ..ClipPlayer::new(&clip) };
            game.app.world_mut().entity_mut(entity).insert((RigClips(made.clone()), player));
        }
        let times = [0.0, 0.35, 0.5, 1.2, 1.75];
        let mut was = Vec::new();
        for time in times {
            show(&mut game, instance, time);
            was.push(joints(&game, instance, &before));
        }
        assert_ne!(was[0], was[2], "{mode:?}: the clip moves the joints");
        let running = game.app.world().get::<RunningTemplate>(instance).unwrap().get().clone();

        let mut after = before.clone();
        flip_all(&mut after);
        game.offer(instance, write_template(&after).as_bytes());
        let start = Instant::now();
        let held = joints(&game, instance, &before);
        while told(&game).len() < 2 {
            assert!(start.elapsed() < HANG, "the update does not come");
            game.app.update();
            if told(&game).is_empty() {
                assert_eq!(joints(&game, instance, &before), held, "{mode:?}: a frame shows something else");
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let report = told(&game)[0].clone();
        assert!(report.set_aside.is_empty());
        let listed: BTreeSet<Uid> = report.notes.iter().map(|note| note.deviation.joint).collect();
        assert!(listed.len() * 2 < before.len(), "{mode:?}: {} joints are not held", listed.len());
        assert_ne!(clips(&game, instance), made);
        assert!(Arc::ptr_eq(&clips(&game, instance), &clips(&game, other)));
        for (time, was) in times.into_iter().zip(&was) {
            show(&mut game, instance, time);
            for (joint, place) in joints(&game, instance, &before) {
                let off = place.distance(was[&joint]);
                // Between frames a motion may be off by a little more.
                assert!(listed.contains(&joint) || off < 5e-4, "{mode:?} at {time} s: {joint} is off by {off}");
            }
        }
        let now = game.app.world().get::<RunningTemplate>(instance).unwrap().get().clone();
        let frames: Vec<f32> = (0..=60).map(|frame| frame as f32 / clip.frame_rate).chain(clip.key_times()).collect();
        let shown = clips(&game, instance);
        for (joint, (distance, angle)) in joints_off((&running.whole, &clip), (&now.whole, &shown[0]), &frames) {
            let is_held = distance <= NEAR.0 && angle <= NEAR.1;
            assert!(is_held || listed.contains(&joint), "{mode:?}: {joint} is off by {distance} m and {angle}°");
        }
        let plain = joints_off((&running.whole, &clip), (&now.whole, &clip), &frames);
        assert!(plain.values().any(|(distance, _)| *distance > 0.01), "the change would move joints");

        // The way back starts from the clips as they were made.
        game.offer(instance, write_template(&before).as_bytes());
        game.until("the way back", |told| told.updated.len() == 4);
        assert_eq!(clips(&game, instance), made);
        assert!(told(&game)[2].is_empty() && game.instance_report().failed.is_empty());
    }
}

#[test]
fn keys_of_a_node_that_is_gone_wait_and_the_joints_move_on() {
    let rig = read_template(TWO.as_bytes()).unwrap().rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let control = built.nodes.iter().find(|node| &*node.name == "ctl_b").unwrap().uid;
    let turn = |time: f32, angle: f32| Key::rotation(time, Quat::from_rotation_z(angle));
    let mut clip = RigClip::new(Uid(0xC1), Uid(0xC2), "turn");
    let target = TrackTarget { node: control, property: Property::Rotation };
    clip.layers[0].tracks.insert(target, Arc::new(Track { keys: vec![turn(0.0, 0.0), turn(1.0, 1.2)] }));
    let without = TWO.replace(", tags: [control(creation: (name: \"ctl_b\"))]", "");
    assert_ne!(without, TWO);
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = game(folder.path());
        let instance = game.open(&saved(folder.path(), TWO), mode);
        let made: Arc<[RigClip]> = vec![clip.clone()].into();
        let player = ClipPlayer { playing: false, ..ClipPlayer::new(&clip) };
        game.app.world_mut().entity_mut(instance).insert((RigClips(made.clone()), player));
        show(&mut game, instance, 0.5);
        let was = joints(&game, instance, &rig);
        let [b, end] = ["b", "b_end"].map(|label| rig.find_label(label).unwrap());
        assert!(was[&end].distance(rig.position(end)) > 0.1, "{mode:?}: the clip moves the joint");

        game.offer(instance, without.as_bytes());
        game.until("the update", |told| told.updated.len() == 1);
        let report = told(&game)[0].clone();
        // A joint that is no exposed node cannot be posed.
        let listed: Vec<Uid> = report.notes.iter().map(|note| note.deviation.joint).collect();
        assert_eq!(listed.contains(&b), mode == InstanceMode::Direct, "{mode:?}: {:?}", report.notes);
        assert!(mode == InstanceMode::Direct || listed.is_empty(), "{:?}", report.notes);
        let [aside] = &report.set_aside[..] else { panic!("{:?}", report.set_aside) };
        assert_eq!((aside.keys.node, aside.keys.keys, aside.clip_name.as_str()), (control, 2, "turn"));
        assert!(report.lines().last().is_some_and(|line| line.contains("2 keys")), "{:?}", report.lines());
        let check = |game: &mut AppBench, listed: &[Uid]| {
            show(game, instance, 0.0);
            show(game, instance, 0.5);
            for (joint, place) in joints(game, instance, &rig).iter().filter(|(joint, _)| !listed.contains(joint)) {
                assert!(place.distance(was[joint]) < 1e-4, "{mode:?}, {joint}: {place} {}", was[joint]);
            }
        };
        check(&mut game, &listed);

        game.offer(instance, TWO.as_bytes());
        game.until("the way back", |told| told.updated.len() == 2);
        assert_eq!(clips(&game, instance), made);
        assert!(told(&game)[1].is_empty(), "{:?}", told(&game)[1]);
        check(&mut game, &[]);
    }
}
