//! A tag that a saved template moves to another joint: instances go on with the poses, values and keys of what it made.

use std::sync::Arc;

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    instance::{ControlPoses, InstanceNodes},
    plugins::{
        animation::RigClips,
        runtime::{InstanceMode, RigRuntime},
    },
    rig::{
        Rig, Uid,
        animation::{Key, RigClip, Track},
        template::write_template,
    },
};

use super::{AppBench, saved};
use crate::moved_tags::{control, target, template, turned};

/// Angles at which the two controls are posed.
const ANGLES: [f32; 2] = [0.4, 0.2];

/// Controls of a chain of two joints.
fn controls(rig: &Rig, labels: [&str; 2]) -> [Uid; 2] {
    labels.map(|label| control(rig, label))
}

fn clip(nodes: [Uid; 2]) -> RigClip {
    let mut clip = RigClip::new(Uid(0xC21), Uid(0xC22), "nod");
    for (node, angle) in nodes.into_iter().zip(ANGLES) {
        let keys = [(0.0, 0.0), (1.0, angle)].map(|(time, angle)| Key::rotation(time, Quat::from_rotation_x(angle)));
        clip.layers[0].tracks.insert(target(node), Arc::new(Track { keys: keys.to_vec() }));
    }
    clip
}

/// Checks that an instance has the pose and the value at these controls, and the end of their chain where that puts it.
#[track_caller]
fn check_posed(game: &AppBench, instance: Entity, nodes: [Uid; 2], end: Uid, what: &str) {
    let state = game.app.world().get::<RigRuntime>(instance).unwrap().state();
    for (node, angle) in nodes.into_iter().zip(ANGLES) {
        let slot = state.program().node(node).unwrap_or_else(|| panic!("{what}: {node} is no node"));
        let (offset, wanted) = (state.offset_at(slot), turned(angle));
        assert!(offset.rotation.dot(wanted.rotation).abs() > 0.999_999, "{what}: {offset:?}");
    }
    assert_eq!(state.attribute(nodes[0], "amount"), Some(0.75), "{what}");
    let (place, _) = game.places(instance)[&end];
    let wanted = Vec3::Y + Quat::from_rotation_x(ANGLES[0]) * Vec3::Y;
    assert!(place.translation().distance(wanted) < 1e-4, "{what}: {} and not {wanted}", place.translation());
}

#[test]
fn a_tag_that_moves_takes_poses_values_and_keys_of_instances_along() {
    let (before, after) = (template("a", ""), template("b", ""));
    let (was, is) = (controls(&before, ["a", "a_tip"]), controls(&after, ["b", "b_tip"]));
    let [end, other_end] = ["a_tip", "b_tip"].map(|label| before.find_label(label).unwrap());
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), &write_template(&before)), mode);
        let made: Arc<[RigClip]> = vec![clip(was)].into();
        let world = game.app.world_mut();
        world.entity_mut(instance).insert(RigClips(made.clone()));
        for (uid, angle) in was.into_iter().zip(ANGLES) {
            let find = move |nodes: InstanceNodes| nodes.find_uid(instance, uid);
            let node = world.run_system_once(find).unwrap().unwrap();
            let pose = move |mut poses: ControlPoses| poses.set(node, turned(angle));
            assert!(world.run_system_once(pose).unwrap());
        }
        let mut runtime = world.get_mut::<RigRuntime>(instance).unwrap();
        runtime.state_mut().set_attribute(was[0], "amount", 0.75).unwrap();
        game.frames(3);
        check_posed(&game, instance, was, end, &format!("{mode:?}, before"));

        game.offer(instance, write_template(&after).as_bytes());
        game.until("the update", |told| told.updated.len() == 1);
        check_posed(&game, instance, is, other_end, &format!("{mode:?}, in the frame of the update"));
        game.frames(3);
        check_posed(&game, instance, is, other_end, &format!("{mode:?}, after"));
        let state = game.app.world().get::<RigRuntime>(instance).unwrap().state();
        assert!(was.iter().all(|node| state.program().node(*node).is_none()), "{mode:?}");
        let tracks = &game.app.world().get::<RigClips>(instance).unwrap().0[0].layers[0].tracks;
        for (was, is) in was.into_iter().zip(is) {
            assert!(!tracks.contains_key(&target(was)), "{mode:?}: nothing stays at the former node");
            assert_eq!(tracks.get(&target(is)), made[0].layers[0].tracks.get(&target(was)), "{mode:?}");
        }

        game.offer(instance, write_template(&before).as_bytes());
        game.until("the way back", |told| told.updated.len() == 2);
        game.frames(3);
        check_posed(&game, instance, was, end, &format!("{mode:?}, back"));
        assert_eq!(game.app.world().get::<RigClips>(instance).unwrap().0, made, "{mode:?}");
        assert_eq!(game.instance_report().failed, Vec::<String>::new());
    }
}
