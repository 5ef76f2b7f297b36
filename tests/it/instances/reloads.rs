//! Reloads of many instances, of posed ones, and of files that are broken.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    thread::sleep,
    time::{Duration, Instant},
};

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    files::{RealDisk, load_template, store_rig_over},
    instance::{ControlPoses, InstanceNodes, RigInstance, RigInstancePlugin, RigTemplate},
    plugins::runtime::{ControlPose, InstanceMode},
    rig::{PoseOffset, RigEdit, Uid, UidSource, template::read_template},
};

use super::{AppBench, HANG, TWO, saved};
use crate::{
    bench::save_whole,
    mutate::Mutator,
    template_text::{CHAIN, Dice},
};

#[test]
fn a_thousand_broken_files_on_the_disk_change_nothing_and_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), CHAIN);
    let quick = RigInstancePlugin { look: Duration::from_millis(1), patience: Duration::from_millis(2), live: true };
    let mut game = AppBench::game(quick, Path::new("assets"));
    let instance = game.open(&path, InstanceMode::Direct);
    game.app.update();
    let before = game.places(instance);
    let mut mutator = Mutator::new(17, &[b"tags", b")", b"["], 1 << 16);
    let dice = &mut Dice(UidSource::seeded(18));
    let mut last = CHAIN.as_bytes().to_vec();
    let save = |content: &[u8]| save_whole(&path, content);
    let mut count = 0;
    while count < 1000 {
        let content = match dice.below(3) {
            0 => CHAIN.as_bytes()[..dice.below(CHAIN.len() as u64 - 3) as usize].to_vec(),
            1 => mutator.mutate(CHAIN.as_bytes(), TWO.as_bytes()),
            _ => CHAIN.replace("shape: \"cube\"", &format!("shape: \"nothing {count}\"")).into_bytes(),
        };
        // A mutation may be a good file after all, and the same broken one twice is one save.
        let is_good = read_template(&content).is_ok() && !content.windows(8).any(|text| text == b"nothing ");
        if is_good || content == last {
            continue;
        }
        save(&content);
        last = content;
        count += 1;
        let saved = String::from_utf8_lossy(&last);
        game.until(&format!("the report of {saved:?}"), |told| told.failed.len() == count);
    }
    assert!(game.instance_report().updated.is_empty());
    assert!(game.instance_report().failed.iter().all(|told| told.contains("t.rig.ron")), "each has its file");
    assert_eq!(game.places(instance), before);
    save(CHAIN.replace("(0, 1, 0)", "(0, 2, 0)").as_bytes());
    game.until("the next good save", |told| told.updated.len() == 1);
    assert_eq!(game.instance_report().failed.len(), 1000);
    game.app.update();
    assert_ne!(game.places(instance), before);
}

/// The bundled biped as a file, whose parts are the bundled ones.
fn biped(folder: &Path) -> PathBuf {
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    saved(folder, &fs::read_to_string(bundled).unwrap())
}

#[test]
fn no_frame_of_a_reload_shows_the_rest_pose_or_moves_an_untouched_limb() {
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let folder = tempfile::tempdir().unwrap();
        let path = biped(folder.path());
        let mut game = AppBench::live_game();
        let instance = game.open(&path, mode);
        game.app.update();
        let rest = game.places(instance);
        // Controls and joints of the whole body are posed.
        for (number, name) in
            ["hips", "spine_1", "upper_arm_l", "upper_arm_r", "thigh_l", "thigh_r", "head"].iter().enumerate()
        {
            let found = game.app.world_mut().run_system_once({
                let name = (*name).to_owned();
                move |nodes: InstanceNodes| {
                    let fk = [format!("{name}_fk"), format!("fk_{name}"), name.clone()];
                    fk.iter().find_map(|name| nodes.find(instance, name))
                }
            });
            let Some(node) = found.unwrap() else { continue };
            let turn = Quat::from_rotation_x(0.2 + 0.03 * number as f32);
            let offset = PoseOffset::from_rotation(turn);
            game.app.world_mut().run_system_once(move |mut poses: ControlPoses| poses.set(node, offset)).unwrap();
        }
        for control in ["hand_ik_l", "hand_ik_r", "foot_ik_l", "root"] {
            let found = game.app.world_mut().run_system_once(move |nodes: InstanceNodes| nodes.find(instance, control));
            let Some(node) = found.unwrap() else { continue };
            let offset = PoseOffset { translation: Vec3::new(0.05, 0.1, 0.03), ..PoseOffset::IDENTITY };
            game.app.world_mut().run_system_once(move |mut poses: ControlPoses| poses.set(node, offset)).unwrap();
        }
        game.frames(4);
        let posed = game.places(instance);
        let stands_off = |places: &BTreeMap<Uid, (GlobalTransform, Option<ControlPose>)>, uid: &Uid| {
            let (Some(now), Some(rest)) = (places.get(uid), rest.get(uid)) else { return false };
            now.0.translation().distance(rest.0.translation()) > 0.01
        };
        let moved: Vec<Uid> = posed.keys().filter(|uid| stands_off(&posed, uid)).copied().collect();
        assert!(moved.len() > 30, "{mode:?}: {} nodes are posed", moved.len());
        // The forearm of one side gets longer, which is saved as one line of the template.
        let rig = load_template(&RealDisk, &path).unwrap().rig;
        for (save, factor) in [1.1, 0.9, 1.2].into_iter().enumerate() {
            let hand = rig.find_label("hand_r").unwrap();
            let arm: Vec<Uid> = {
                let top = rig.find_label("clavicle_r").unwrap();
                rig.hierarchy(top).map(|joint| joint.data.uid).collect()
            };
            let untouched: Vec<Uid> = rig
                .walk()
                .map(|joint| joint.data.uid)
                .filter(|uid| !arm.contains(uid) && posed.contains_key(uid))
                .collect();
            assert!(untouched.len() > 25);
            let mut changed = rig.clone();
            let mut place = rig.joint(hand).unwrap().data.rest;
            place.translation *= factor;
            changed.apply(&RigEdit::SetRest(hand, place)).unwrap();
            assert_eq!(store_rig_over(&RealDisk, &path, &changed, &[&path]).unwrap(), Vec::<String>::new());
            let start = Instant::now();
            let mut after = 0;
            while after < 8 {
                assert!(start.elapsed() < HANG, "the save does not come");
                game.app.update();
                after += usize::from(game.instance_report().updated.len() > save);
                let now = game.places(instance);
                for uid in &untouched {
                    assert_eq!(now.get(uid), posed.get(uid), "{mode:?}, save {save}, frame {after}");
                }
                let at_rest = moved.iter().filter(|uid| !stands_off(&now, uid)).count();
                assert_eq!(at_rest, 0, "{mode:?}, save {save}, frame {after}: nodes at rest");
                sleep(Duration::from_millis(1));
            }
            assert_ne!(game.places(instance).get(&hand), posed.get(&hand), "the change is there");
        }
        assert_eq!(game.instance_report().failed, Vec::<String>::new());
    }
}

#[test]
fn a_thousand_instances_go_on_in_one_frame() {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(biped(folder.path())).unwrap();
    let mut game = AppBench::still_game();
    let handle =
        game.app.world_mut().resource_mut::<Assets<RigTemplate>>().add(RigTemplate::read(text.as_bytes()).unwrap());
    let spawned = (0..1000).map(|number| (RigInstance(handle.clone()), Transform::from_xyz(number as f32, 0.0, 0.0)));
    let crowd: Vec<Entity> = spawned.map(|one| game.app.world_mut().spawn((one, InstanceMode::Direct)).id()).collect();
    game.until("the crowd", |told| told.built > 0);
    assert_eq!(game.instance_report().built, 1000, "all at once");
    // The limbs stand where their parts say in the rig's space; the chest goes with the hips.
    let chests: Vec<Entity> = [0, 499, 999].iter().map(|at| game.node(crowd[*at], "chest")).collect();
    game.app.update();
    let place = |game: &AppBench, at: usize| game.app.world().get::<GlobalTransform>(chests[at]).unwrap().translation();
    let before = [place(&game, 0), place(&game, 1), place(&game, 2)];
    assert!((before[2] - before[0]).distance(Vec3::X * 999.0) < 1e-3);
    game.offer(crowd[0], text.replace("translation: (0, 0.955, -0.006)", "translation: (0, 1.055, -0.006)").as_bytes());
    game.until("the update", |told| !told.updated.is_empty());
    assert_eq!((game.instance_report().updated.len(), game.instance_report().failed.len()), (1000, 0), "in one frame");
    for (at, before) in before.into_iter().enumerate() {
        assert!((place(&game, at) - before).distance(Vec3::Y * 0.1) < 1e-4, "{at}");
    }
}

#[test]
fn what_a_part_with_another_name_brings_keeps_its_poses() {
    // The control refers to a command of the part, whose uid follows from the instance.
    let part = r#"(
    format: 2,
    name: "finger",
    kind: "part",
    joints: [
        (label: "one", tags: [null(creation: (name: "world"))]),
        (
            label: "two",
            parent: "one",
            translation: (0, 1, 0),
            tags: [control(parent: "@command null/world", follow: false, creation: (name: "tip"))],
        ),
    ],
)
"#;
    let text = r#"(
    format: 2,
    name: "hand",
    joints: [
        (label: "a"),
        (label: "b", parent: "a", translation: (0, 1, 0)),
    ],
    parts: [(part: "finger.rig.ron", name: "index", onto: ["a", "b"])],
)
"#;
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("finger.rig.ron"), part).unwrap();
        let path = saved(folder.path(), text);
        let mut game = AppBench::live_game();
        let instance = game.open(&path, mode);
        let control = game.node(instance, "tip");
        let turned = Quat::from_rotation_z(0.5);
        let world = game.app.world_mut();
        match mode {
            InstanceMode::Hierarchy => world.get_mut::<Transform>(control).unwrap().rotation = turned,
            InstanceMode::Direct => world.get_mut::<ControlPose>(control).unwrap().rotation = turned,
        }
        game.app.update();
        // A joint more tells when the version is there.
        let next =
            text.replace("index", "pointer").replace("(label: \"a\"),", "(label: \"a\"),\n        (label: \"c\"),");
        save_whole(&path, next);
        game.until("the other name", |told| !told.updated.is_empty());
        game.node(instance, "c");
        assert_eq!(game.node(instance, "tip"), control, "{mode:?}: the entity stays");
        let world = game.app.world();
        let rotation = match mode {
            InstanceMode::Hierarchy => world.get::<Transform>(control).unwrap().rotation,
            InstanceMode::Direct => world.get::<ControlPose>(control).unwrap().rotation,
        };
        assert!(rotation.angle_between(turned) < 1e-5, "{mode:?}: {rotation}");
        assert_eq!(game.instance_report().failed, Vec::<String>::new());
    }
}
