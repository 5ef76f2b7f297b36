//! Users of templates: instances that come and go, take another template, and hang on one another.

use std::path::Path;

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    instance::{RigInstance, RigTemplate, RigTemplates, TemplateFiles},
    plugins::runtime::{ControlPose, InstanceMode},
};

use super::{AppBench, TWO, saved};

fn opened(game: &mut AppBench, file: &Path) -> Handle<RigTemplate> {
    let file = file.to_owned();
    game.app.world_mut().run_system_once(move |files: TemplateFiles| files.open(file.clone())).unwrap()
}

fn added(game: &mut AppBench, text: &str) -> Handle<RigTemplate> {
    let template = RigTemplate::read(text.as_bytes()).unwrap();
    game.app.world_mut().resource_mut::<Assets<RigTemplate>>().add(template)
}

#[test]
fn a_template_that_nobody_uses_is_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let file = saved(folder.path(), TWO);
    let mut game = AppBench::live_game();
    let count = |game: &AppBench| game.app.world().resource::<RigTemplates>().count();
    let handle = opened(&mut game, &file);
    let early = game.app.world_mut().spawn(RigInstance(handle)).id();
    game.app.world_mut().despawn(early);
    // Templates are built one after the other, so the one of before is there, too.
    let instance = game.open(&file, InstanceMode::Direct);
    game.frames(3);
    assert_eq!(count(&game), 1, "its instance was despawned while it was built");
    let handle = added(&mut game, TWO);
    game.frames(2);
    drop(handle);
    let other = game.open(&file, InstanceMode::Direct);
    game.frames(3);
    assert_eq!(count(&game), 2, "it was dropped while it was built");
    game.app.world_mut().despawn(instance);
    game.app.world_mut().despawn(other);
    game.frames(3);
    assert_eq!(count(&game), 0);
    assert_eq!(game.instance_report().failed.len(), 0);
}

#[test]
fn an_instance_that_comes_to_a_template_that_failed_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut game = AppBench::still_game();
    let broken = opened(&mut game, &saved(folder.path(), &TWO[..TWO.len() / 2]));
    let none = game.app.world().resource::<AssetServer>().load::<RigTemplate>("none.rig.ron");
    let mut count = 0;
    let mut failing = |game: &mut AppBench, template: &Handle<RigTemplate>| {
        let instance = game.app.world_mut().spawn(RigInstance(template.clone())).id();
        count += 1;
        game.until("the failure", |told| told.failed.len() == count);
        game.frames(2);
        assert_eq!(game.instance_report().failed.len(), count, "it is told once: {:?}", game.instance_report());
        instance
    };
    for template in [&broken, &none] {
        failing(&mut game, template);
        failing(&mut game, template);
    }
    let first = failing(&mut game, &broken);
    let told = &game.instance_report().failed;
    assert_eq!(told[0], told[4]);
    // A good content is there for all, and for those who come later.
    game.offer(first, TWO.as_bytes());
    game.until("the good content", |told| told.built == 3);
    game.spawn(broken, InstanceMode::Direct);
    assert_eq!(game.instance_report().failed.len(), 5);
}

#[test]
fn another_template_is_told_with_its_differences() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let mut game = AppBench::still_game();
        let first = added(&mut game, TWO);
        let higher = "parent: \"a\", translation: (0, 0.7, 0)";
        let second = added(&mut game, &TWO.replace("parent: \"a\", translation: (0, 0.5, 0)", higher));
        let instance = game.spawn(first.clone(), mode);
        let end = game.node(instance, "a_end");
        game.app.world_mut().entity_mut(instance).insert(RigInstance(second));
        game.until("the other template", |told| told.updated.len() == 1);
        assert_eq!(game.instance_report().updated, [1], "{mode:?}");
        assert_eq!(game.node(instance, "a_end"), end, "{mode:?}: what both have stays");
        game.app.update();
        let place = game.app.world().get::<GlobalTransform>(end).unwrap().translation();
        assert!(place.distance(Vec3::new(0.0, 1.7, 0.0)) < 1e-6, "{mode:?} {place}");
        game.app.world_mut().entity_mut(instance).insert(RigInstance(first.clone()));
        game.until("the way back", |told| told.updated.len() == 2);
        assert_eq!(game.instance_report().updated, [1, 1], "{mode:?}");
        // An asset that is removed leaves the instance as it is, until it is there again.
        game.app.world_mut().resource_mut::<Assets<RigTemplate>>().remove(&first);
        game.frames(3);
        assert_eq!(game.node(instance, "a_end"), end, "{mode:?}");
        let changed = RigTemplate::read(TWO.replace("(1, 1, 0)", "(2, 1, 0)").as_bytes()).unwrap();
        game.app.world_mut().resource_mut::<Assets<RigTemplate>>().insert(first.id(), changed).unwrap();
        game.until("the asset again", |told| told.updated.len() == 3);
        assert_eq!(game.instance_report().updated, [1, 1, 1], "{mode:?}");
    }
}

#[test]
fn an_instance_rides_on_a_joint_of_another() {
    let modes = [InstanceMode::Hierarchy, InstanceMode::Direct];
    for (horse_mode, mode) in modes.into_iter().flat_map(|horse| modes.map(|rider| (horse, rider))) {
        let mut game = AppBench::still_game();
        let template = added(&mut game, TWO);
        let horse = game.spawn(template.clone(), horse_mode);
        let (control, saddle) = (game.node(horse, "ctl_a"), game.node(horse, "a_end"));
        let rider = game.spawn(template, mode);
        let seat = Transform::from_xyz(0.0, 0.25, 1.0);
        game.app.world_mut().entity_mut(rider).insert((seat, ChildOf(saddle)));
        let end = game.node(rider, "a_end");
        for angle in [0.0, 0.5, 1.0] {
            let turned = Quat::from_rotation_z(angle);
            let world = game.app.world_mut();
            match horse_mode {
                InstanceMode::Hierarchy => world.get_mut::<Transform>(control).unwrap().rotation = turned,
                InstanceMode::Direct => world.get_mut::<ControlPose>(control).unwrap().rotation = turned,
            }
            game.frames(3);
            let place = |node: Entity| *game.app.world().get::<GlobalTransform>(node).unwrap();
            let wanted = place(saddle).transform_point(seat.translation + Vec3::new(0.0, 1.5, 0.0));
            let at = place(end).translation();
            assert!(at.distance(wanted) < 1e-5, "{mode:?} on {horse_mode:?}: {at} {wanted}");
        }
        let (place, wanted) =
            (game.app.world().get::<GlobalTransform>(saddle).unwrap().translation(), 1.0 + 0.5 * 1f32.cos());
        assert!((place.y - wanted).abs() < 1e-5, "the horse has moved: {place}");
    }
}

/// A mesh that is drawn in some pieces, moved by some joints.
#[cfg(feature = "draw")]
fn drawn(game: &mut AppBench, joints: &[Entity], pieces: usize) -> Entity {
    use bevy::mesh::skinning::SkinnedMesh;

    let world = game.app.world_mut();
    let of = world.spawn(Transform::default()).id();
    for _ in 0..pieces {
        let skin = SkinnedMesh { inverse_bindposes: Handle::default(), joints: joints.to_vec() };
        let material = MeshMaterial3d::<StandardMaterial>(Handle::default());
        world.spawn((Mesh3d(Handle::default()), material, skin, ChildOf(of)));
    }
    of
}

#[cfg(feature = "draw")]
#[test]
fn an_instance_shows_the_shared_mesh_that_it_has_now() {
    use bevy::mesh::skinning::SkinnedMesh;
    use rigsmith::instance::SharedMesh;

    let mut game = AppBench::still_game();
    let template = added(&mut game, TWO);
    let tailor = game.spawn(template.clone(), InstanceMode::Direct);
    let joints = ["a", "b_end"].map(|name| game.node(tailor, name));
    let (plain, armour) = (drawn(&mut game, &joints, 1), drawn(&mut game, &joints, 2));
    let instance = game.spawn(template, InstanceMode::Direct);
    let shown = |game: &mut AppBench| -> Vec<Vec<Entity>> {
        game.frames(3);
        let world = game.app.world();
        let children = world.get::<Children>(instance).map(|children| children.to_vec()).unwrap_or_default();
        let skins = children.into_iter().filter_map(|child| world.get::<SkinnedMesh>(child));
        skins.map(|skin| skin.joints.clone()).collect()
    };
    let own = |game: &mut AppBench| ["a", "b_end"].map(|name| game.node(instance, name)).to_vec();
    for (of, pieces) in [(plain, 1), (armour, 2), (plain, 1)] {
        game.app.world_mut().entity_mut(instance).insert(SharedMesh(of));
        assert_eq!(shown(&mut game), vec![own(&mut game); pieces]);
    }
    // Another mode has other nodes.
    let former = own(&mut game);
    game.app.world_mut().entity_mut(instance).insert(InstanceMode::Hierarchy);
    game.until("the other mode", |told| told.built == 3);
    assert_eq!(shown(&mut game), [own(&mut game)]);
    assert_ne!(own(&mut game), former);
    game.app.world_mut().entity_mut(instance).remove::<SharedMesh>();
    assert!(shown(&mut game).is_empty());
}
