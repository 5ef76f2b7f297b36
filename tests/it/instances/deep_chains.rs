//! Instances of chains that are deeper than a stack of calls would be.

use super::*;
use crate::world::deep_chains::{STACK, despawn_on_a_small_stack};

/// Joints of a chain.
const JOINTS: usize = 4_000;

/// A template with a chain of joints; saved in a folder.
fn deep(folder: &Path) -> PathBuf {
    let joint = |number: usize| match number.checked_sub(1) {
        Some(above) => format!("(label: \"j{number}\", parent: \"j{above}\", translation: (0, 0.01, 0))"),
        None => format!("(label: \"j{number}\")"),
    };
    let joints: Vec<String> = (0..JOINTS).map(joint).collect();
    saved(folder, &format!("(format: 2, name: \"deep\", joints: [{}])", joints.join(", ")))
}

#[test]
fn a_deep_instance_is_despawned_as_a_whole_and_without_its_game_object() {
    let folder = tempfile::tempdir().unwrap();
    let file = deep(folder.path());
    for is_whole in [true, false] {
        let mut game = AppBench::still_game();
        let instance = game.open(&file, InstanceMode::Hierarchy);
        let tip = game.node(instance, &format!("j{}", JOINTS - 1));
        let sword = game.app.world_mut().spawn((Transform::default(), ChildOf(tip))).id();
        game.app.update();
        assert_eq!(game.app.world().get::<RigNodes>(instance).map(|nodes| nodes.iter().count()), Some(JOINTS));
        if is_whole {
            despawn_on_a_small_stack(&mut game.app, instance);
        } else {
            let world = game.app.world_mut();
            std::thread::scope(|scope| {
                let leave = move || {
                    world.entity_mut(instance).remove::<RigInstance>();
                };
                let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, leave);
                thread.unwrap().join().unwrap();
            });
        }
        game.app.update();
        let is_there = |entity: Entity| game.app.world().get_entity(entity).is_ok();
        assert!(!is_there(tip) && is_there(instance) != is_whole && is_there(sword) != is_whole, "whole: {is_whole}");
    }
}

/// A rider whose own chain is deep is placed with the joint of the horse that it hangs on.
#[test]
fn a_deep_rider_follows_the_joint_that_it_hangs_on() {
    let folder = tempfile::tempdir().unwrap();
    let mut game = AppBench::still_game();
    let horse = game.open(&saved(folder.path(), TWO), InstanceMode::Direct);
    let back = game.node(horse, "a_end");
    let riders = tempfile::tempdir().unwrap();
    let rider = game.open(&deep(riders.path()), InstanceMode::Hierarchy);
    let tip = game.node(rider, &format!("j{}", JOINTS - 1));
    game.app.world_mut().entity_mut(rider).insert(ChildOf(back));
    game.frames(2);
    let place = game.app.world().get::<GlobalTransform>(tip).unwrap().translation();
    let expected = Vec3::new(0.0, 1.5 + 0.01 * (JOINTS - 1) as f32, 0.0);
    assert!(place.distance(expected) < 0.1, "{place}");
}
