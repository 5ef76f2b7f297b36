//! Characters of a game: instances of templates, and templates whose files are saved while they move.

mod clips;
mod deep_chains;
mod faces;
mod file_clips;
mod kept_clips;
mod meshes;
mod moved_tags;
mod reloads;
mod saves;
mod users;
mod work;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    thread::sleep,
    time::{Duration, Instant},
};

use bevy::{
    asset::{
        AssetPath, AssetPlugin,
        saver::{SavedAsset, save_using_saver},
    },
    ecs::system::RunSystemOnce,
    mesh::skinning::SkinnedMesh,
    prelude::*,
    tasks::block_on,
    time::TimeUpdateStrategy,
};
use rigsmith::{
    headless::Workbench,
    instance::{
        BoundTo, InstanceNodes, RigBuilt, RigFailed, RigInstance, RigInstancePlugin, RigTemplate, RigTemplateSaver,
        RunningTemplate, SkinBound, TemplateFiles,
    },
    plugins::{
        commands::{Attributes, BuildStep},
        document::JointEntities,
        runtime::{ControlPose, HandOver, InstanceMode, OutsideTransform, RigNodes, RigRuntime},
    },
    rig::{RestTransform, Uid, UidSource, template::read_template},
};

use super::{
    bench::{AppBench, HANG, save_whole, wait_with},
    mutate::Mutator,
    template_text::{CHAIN, Dice},
};

/// Reports of instances.
#[derive(Resource, Default, Debug)]
struct InstanceReport {
    built: usize,
    updated: Vec<usize>,
    ran: usize,
    failed: Vec<String>,
}

impl AppBench {
    /// A game without window and renderer, with instances.
    fn game(plugin: RigInstancePlugin, assets: &Path) -> Self {
        Self::game_with(plugin, assets, |_| {})
    }

    /// A game with more than instances.
    fn game_with(plugin: RigInstancePlugin, assets: &Path, more: impl FnOnce(&mut App)) -> Self {
        let mut app = App::new();
        let files = AssetPlugin { file_path: assets.display().to_string(), ..default() };
        app.add_plugins((MinimalPlugins, files, TransformPlugin, plugin)).init_resource::<InstanceReport>();
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
        more(&mut app);
        app.add_observer(|_: On<RigBuilt>, mut told: ResMut<InstanceReport>| told.built += 1)
            .add_observer(|failed: On<RigFailed>, mut told: ResMut<InstanceReport>| {
                told.failed.push(failed.error.to_string())
            })
            .add_observer(|updated: On<rigsmith::instance::RigUpdated>, mut told: ResMut<InstanceReport>| {
                told.updated.push(updated.changes.len());
                told.ran = updated.ran.len();
            });
        app.finish();
        app.cleanup();
        Self::bare(app)
    }

    fn live_game() -> Self {
        Self::game(RigInstancePlugin::live(), Path::new("assets"))
    }

    fn still_game() -> Self {
        Self::game(RigInstancePlugin::default(), Path::new("assets"))
    }

    fn instance_report(&self) -> &InstanceReport {
        self.app.world().resource::<InstanceReport>()
    }

    /// Updates until something is so.
    fn until(&mut self, what: &str, is_so: impl Fn(&InstanceReport) -> bool) {
        let done = |game: &Self| is_so(game.instance_report());
        let report = |game: &Self| format!("{:?}", game.instance_report());
        wait_with(self, what, |game| game.app.update(), done, report);
    }

    /// Updates for a while, in which nothing has to happen that is not there after four updates.
    fn go_on(&mut self, time: Duration) {
        let start = Instant::now();
        self.frames(4);
        while start.elapsed() < time {
            self.app.update();
            sleep(Duration::from_millis(1));
        }
    }

    fn open(&mut self, file: &Path, mode: InstanceMode) -> Entity {
        let file = file.to_owned();
        let handle =
            self.app.world_mut().run_system_once(move |files: TemplateFiles| files.open(file.clone())).unwrap();
        self.spawn(handle, mode)
    }

    fn spawn(&mut self, template: Handle<RigTemplate>, mode: InstanceMode) -> Entity {
        let built = self.instance_report().built;
        let instance = self.app.world_mut().spawn((RigInstance(template), mode)).id();
        self.until("the instance", |told| told.built > built);
        instance
    }

    fn node(&mut self, instance: Entity, name: &str) -> Entity {
        let name = name.to_owned();
        let found = self.app.world_mut().run_system_once(move |nodes: InstanceNodes| nodes.find(instance, &name));
        found.unwrap().unwrap()
    }

    fn offer(&mut self, instance: Entity, content: &[u8]) {
        let handle = self.app.world().get::<RigInstance>(instance).unwrap().0.clone();
        let content = content.to_vec();
        let offer = move |files: TemplateFiles| files.offer(&handle, content.clone());
        self.app.world_mut().run_system_once(offer).unwrap();
    }

    /// World places of the nodes of an instance, by uid, and poses of its controls.
    fn places(&self, instance: Entity) -> BTreeMap<Uid, (GlobalTransform, Option<ControlPose>)> {
        let world = self.app.world();
        let nodes = world.get::<RigNodes>(instance).unwrap();
        let place = |node: Entity| {
            let of = (*world.get::<GlobalTransform>(node)?, world.get::<ControlPose>(node).copied());
            Some((*world.get::<Uid>(node)?, of))
        };
        nodes.iter().filter_map(place).collect()
    }
}

/// A chain of three joints with a control, and another on its own.
const TWO: &str = r#"(
    format: 2,
    name: "two",
    joints: [
        (label: "a", translation: (0, 1, 0), tags: [control(creation: (name: "ctl_a"))]),
        (label: "a_end", parent: "a", translation: (0, 0.5, 0)),
        (label: "b", translation: (1, 1, 0), tags: [control(creation: (name: "ctl_b"))]),
        (label: "b_end", parent: "b", translation: (0, 0.5, 0), tags: [control(creation: (name: "ctl_b_end"))]),
    ],
)
"#;

fn saved(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("t.rig.ron");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn an_instance_is_built_posed_and_taken_away() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), TWO), mode);
        let (control, end) = (game.node(instance, "ctl_a"), game.node(instance, "a_end"));
        game.app.update();
        let place = |game: &AppBench| game.app.world().get::<GlobalTransform>(end).unwrap().translation();
        assert!(place(&game).distance(Vec3::new(0.0, 1.5, 0.0)) < 1e-6, "{mode:?} {:?}", place(&game));
        let turned = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let world = game.app.world_mut();
        match mode {
            InstanceMode::Hierarchy => world.get_mut::<Transform>(control).unwrap().rotation = turned,
            InstanceMode::Direct => world.get_mut::<ControlPose>(control).unwrap().rotation = turned,
        }
        game.app.update();
        assert!(place(&game).distance(Vec3::new(-0.5, 1.0, 0.0)) < 1e-5, "{mode:?} {:?}", place(&game));
        game.app.world_mut().entity_mut(instance).remove::<RigInstance>();
        game.app.update();
        assert!(game.app.world().get_entity(end).is_err() && game.app.world().get::<RigRuntime>(instance).is_none());
    }
}

#[test]
fn values_that_a_game_gives_to_a_node_count_from_the_first_one_on() {
    let valued = |name: &str, value: f32| {
        format!(", attribute(node: \"@command control/ctl_a role:control\", name: \"{name}\", default: {value:?})")
    };
    let own = "control(creation: (name: \"ctl_a\"))";
    let text = TWO.replace(own, &format!("{own}{}{}", valued("amount", 0.5), valued("more", 0.25)));
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), &text), mode);
        let control = game.node(instance, "ctl_a");
        game.frames(2);
        let uid = *game.app.world().get::<Uid>(control).unwrap();
        let held = |values: [f32; 2]| ["amount".to_owned(), "more".to_owned()].into_iter().zip(values).collect();
        game.app.world_mut().entity_mut(control).insert(Attributes(BTreeMap::from([("amount".to_owned(), 0.75)])));
        for amount in [0.75, 0.125] {
            game.app.world_mut().get_mut::<Attributes>(control).unwrap().0.insert("amount".to_owned(), amount);
            game.app.update();
            let state = game.app.world().get::<RigRuntime>(instance).unwrap().state();
            assert_eq!(state.attribute(uid, "amount"), Some(amount), "{mode:?}");
            assert_eq!(game.app.world().get::<Attributes>(control).unwrap(), &Attributes(held([amount, 0.25])));
        }
    }
}

/// The rest transform of a joint is that of the document in an app with documents, and the built one in a game.
#[test]
fn the_rest_of_a_joint_is_the_built_one_in_an_instance() {
    let tag = "translation: (0, 1, 0), tags: [insert_joints(count: 1), control(";
    let text = TWO.replace("translation: (0, 1, 0), tags: [control(", tag);
    let rest = |world: &World, joint: Entity| world.get::<RestTransform>(joint).unwrap().translation;
    let document = read_template(text.as_bytes()).unwrap().rig;
    let end = document.walk().find(|joint| joint.data.label.as_deref() == Some("a_end")).unwrap().data.uid;
    let mut bench = Workbench::with_rig(1, document);
    assert_eq!(bench.build(BuildStep::All).error, None);
    let rig = bench.rig_entity();
    let world = bench.app_mut().world();
    let joint = world.get::<JointEntities>(rig).unwrap().get(end).unwrap();
    assert_eq!(rest(world, joint), Vec3::new(0.0, 0.5, 0.0));
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), &text), mode);
        let joint = game.node(instance, "a_end");
        let built = rest(game.app.world(), joint);
        assert!(built.distance(Vec3::new(0.0, 0.25, 0.0)) < 1e-6, "{mode:?}: {built}");
    }
}

#[test]
fn a_saved_file_reaches_its_instances_and_leaves_the_rest_to_the_bit() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let path = saved(folder.path(), TWO);
        let mut game = AppBench::live_game();
        let instance = game.open(&path, mode);
        let (control, other) = (game.node(instance, "ctl_b_end"), game.node(instance, "b_end"));
        let turned = Quat::from_rotation_x(0.3);
        match mode {
            InstanceMode::Hierarchy => game.app.world_mut().get_mut::<Transform>(control).unwrap().rotation = turned,
            InstanceMode::Direct => game.app.world_mut().get_mut::<ControlPose>(control).unwrap().rotation = turned,
        }
        game.app.update();
        game.app.update();
        let before = game.places(instance);
        save_whole(
            &path,
            TWO.replace("parent: \"a\", translation: (0, 0.5, 0)", "parent: \"a\", translation: (0, 0.7, 0)"),
        );
        game.until("the update", |told| told.updated.len() == 1);
        let changed = game.app.world().get::<RunningTemplate>(instance).unwrap().get().rig.find_label("a_end").unwrap();
        let after = game.places(instance);
        assert_eq!(before.len(), after.len());
        for (uid, place) in &before {
            if *uid == changed {
                assert!((after[uid].0.translation().y - 1.7).abs() < 1e-6);
            } else {
                assert_eq!(place, &after[uid], "{mode:?}");
            }
        }
        assert_eq!(game.node(instance, "b_end"), other, "the entity stays");
        assert_eq!(game.instance_report().updated, [1]);
        // A comment is no change.
        save_whole(&path, fs::read_to_string(&path).unwrap().replace("(\n    format", "( // mine\n    format"));
        game.wait("the comment, which stays in what a save writes", |game| {
            let assets = game.app.world().resource::<Assets<RigTemplate>>();
            assets.iter().next().unwrap().1.text().contains("// mine")
        });
        game.go_on(Duration::from_millis(100));
        assert_eq!(game.instance_report().updated, [1]);
        assert!(game.instance_report().failed.is_empty());
    }
}

#[test]
fn nodes_come_and_go_and_what_others_hung_on_them_stays() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), TWO), mode);
        let (end, gone) = (game.node(instance, "b_end"), game.node(instance, "ctl_a"));
        let sword = game.app.world_mut().spawn((Transform::default(), ChildOf(gone))).id();
        let text = TWO.replace(", tags: [control(creation: (name: \"ctl_a\"))]", "").replace(
            "(label: \"b_end\", parent: \"b\"",
            "(label: \"between\", parent: \"b\"), (label: \"b_end\", parent: \"between\"",
        );
        game.offer(instance, text.as_bytes());
        game.until("the update", |told| told.updated.len() == 1);
        game.app.update();
        assert_eq!(game.node(instance, "b_end"), end);
        let world = game.app.world();
        assert!(world.get_entity(gone).is_err());
        assert_eq!(world.get::<ChildOf>(sword).map(ChildOf::parent), Some(instance));
        let between = game.node(instance, "between");
        if mode == InstanceMode::Hierarchy {
            let above: Vec<Entity> =
                game.app.world_mut().query::<&ChildOf>().query(game.app.world()).iter_ancestors(end).collect();
            assert!(above.contains(&between) && above.contains(&instance), "{above:?}");
        }
        let nodes = game.places(instance).len();
        game.offer(instance, TWO.as_bytes());
        game.until("the way back", |told| told.updated.len() == 2);
        assert!(game.app.world().get_entity(between).is_err() && nodes > 0);
        assert_eq!(game.node(instance, "b_end"), end);
    }
}

#[test]
fn the_asset_server_loads_templates_and_a_failed_first_load_is_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), "(format: 2, name: ");
    let mut game = AppBench::game(RigInstancePlugin::live(), folder.path());
    let handle = game.app.world().resource::<AssetServer>().load::<RigTemplate>("t.rig.ron");
    let instance = game.app.world_mut().spawn(RigInstance(handle)).id();
    game.until("the failure", |told| !told.failed.is_empty());
    assert!(game.app.world().get::<RigRuntime>(instance).is_none());
    save_whole(&path, TWO);
    game.until("the first good save", |told| told.built == 1);
    save_whole(&path, TWO.replace("(0, 1, 0)", "(0, 3, 0)"));
    game.until("the next", |told| told.updated.len() == 1);
    let place = game.node(instance, "a_end");
    assert!((game.app.world().get::<GlobalTransform>(place).unwrap().translation().y - 3.5).abs() < 1e-5);
    // A loaded template is not built twice, and code may change it, too.
    let good = folder.path().join("good.rig.ron");
    fs::write(&good, TWO).unwrap();
    let handle = game.app.world().resource::<AssetServer>().load::<RigTemplate>("good.rig.ron");
    let other = game.spawn(handle.clone(), InstanceMode::Hierarchy);
    game.go_on(Duration::from_millis(100));
    assert_eq!((game.instance_report().built, game.instance_report().updated.len()), (2, 1));
    let mut assets = game.app.world_mut().resource_mut::<Assets<RigTemplate>>();
    let mut template = assets.get_mut(&handle).unwrap();
    let mut rig = (**template.rig()).clone();
    let tip = rig.find_label("b_end").unwrap();
    let mut rest = rig.joint(tip).unwrap().data.rest;
    rest.translation.y = 0.75;
    rig.apply(&rigsmith::rig::RigEdit::SetRest(tip, rest)).unwrap();
    template.set_rig(rig);
    assert!(template.saved().contains("(0, 0.75, 0)") && template.saved().lines().count() == TWO.lines().count());
    drop(template);
    game.until("the change by code", |told| told.updated.len() == 2);
    let place = game.node(other, "b_end");
    game.app.update();
    assert!((game.app.world().get::<GlobalTransform>(place).unwrap().translation().y - 1.75).abs() < 1e-5);
}

#[test]
fn the_asset_server_saves_a_template_as_a_change_of_its_text() {
    let folder = tempfile::tempdir().unwrap();
    let text = TWO.replace("        (label: \"b\"", "        // The second.\n        (label: \"b\"");
    assert_ne!(text, TWO);
    saved(folder.path(), &text);
    let mut game = AppBench::game(RigInstancePlugin::live(), folder.path());
    let server = game.app.world().resource::<AssetServer>().clone();
    let handle = server.load::<RigTemplate>("t.rig.ron");
    game.spawn(handle.clone(), InstanceMode::Hierarchy);
    let mut template = game.app.world().resource::<Assets<RigTemplate>>().get(&handle).unwrap().clone();
    let mut rig = (**template.rig()).clone();
    let tip = rig.find_label("b_end").unwrap();
    let raised = RestTransform::from_translation(Vec3::Y * 0.75);
    rig.apply(&rigsmith::rig::RigEdit::SetRest(tip, raised)).unwrap();
    template.set_rig(rig);
    let path = AssetPath::from("copy.rig.ron");
    let asset = SavedAsset::from_asset(&template);
    block_on(save_using_saver(server.clone(), &RigTemplateSaver, &path, asset, &())).unwrap();
    let written = fs::read_to_string(folder.path().join("copy.rig.ron")).unwrap();
    let changed: Vec<(&str, &str)> = text.lines().zip(written.lines()).filter(|(was, is)| was != is).collect();
    assert!(matches!(changed[..], [(_, is)] if is.contains("0.75")), "{written}");
    assert_eq!(written.lines().count(), text.lines().count());
    // The loader reads it, with the settings that the server wrote beside it.
    let copy = game.spawn(server.load("copy.rig.ron"), InstanceMode::Hierarchy);
    let end = game.node(copy, "b_end");
    game.app.update();
    assert!((game.app.world().get::<GlobalTransform>(end).unwrap().translation().y - 1.75).abs() < 1e-5);
}

/// A skinned mesh as a loaded file has it below an entity: joints with names, and one that the rig does not have.
fn loaded_skin(app: &mut App, below: Entity) -> (Entity, Vec<Entity>) {
    let world = app.world_mut();
    let armature = world.spawn((Name::new("Armature"), Transform::default(), ChildOf(below))).id();
    let mut joints = Vec::new();
    let mut above = armature;
    for name in ["b", "b_end", "feather"] {
        above = world.spawn((Name::new(name), Transform::from_xyz(0.0, 0.3, 0.0), ChildOf(above))).id();
        joints.push(above);
    }
    let skin = SkinnedMesh { inverse_bindposes: Handle::default(), joints: joints.clone() };
    (world.spawn((skin, ChildOf(armature))).id(), joints)
}

/// Skins that were bound, each with the names of joints that the instance does not have.
#[derive(Resource, Default)]
struct Bindings(Vec<(Entity, Vec<String>)>);

#[test]
fn skinned_meshes_of_loaded_files_follow_an_instance() {
    let folder = tempfile::tempdir().unwrap();
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let mut game = AppBench::still_game();
        game.app.init_resource::<Bindings>();
        game.app.add_observer(|bound: On<SkinBound>, mut bindings: ResMut<Bindings>| {
            bindings.0.push((bound.instance, bound.unknown.clone()));
        });
        let instance = game.open(&saved(folder.path(), TWO), mode);
        let (mesh, joints) = loaded_skin(&mut game.app, instance);
        game.app.update();
        assert_eq!(game.app.world().resource::<Bindings>().0, [(instance, vec!["feather".to_owned()])]);
        assert_eq!(game.app.world().get::<BoundTo>(mesh), Some(&BoundTo(instance)));
        let bound = game.app.world().get::<SkinnedMesh>(mesh).unwrap().joints.clone();
        assert_eq!(bound[..2], [game.node(instance, "b"), game.node(instance, "b_end")], "{mode:?}");
        // A joint that the rig does not have hangs on the one above.
        assert_eq!(bound[2], joints[2]);
        assert_eq!(game.app.world().get::<ChildOf>(joints[2]).map(|of| of.0), Some(bound[1]));
    }
}

#[test]
fn joints_are_handed_over_and_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), TWO), mode);
        let joints = ["a", "b", "b_end"].map(|name| game.node(instance, name));
        game.frames(3);
        let places = |game: &AppBench| joints.map(|joint| *game.app.world().get::<GlobalTransform>(joint).unwrap());
        let before = places(&game);
        let to = Isometry3d::new(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_z(0.5));
        game.app.world_mut().entity_mut(joints[1]).insert(OutsideTransform(to));
        game.app.world_mut().entity_mut(instance).insert(HandOver { share: 1.0 });
        game.app.update();
        let over = places(&game);
        assert_eq!(over[0], before[0], "{mode:?}: the other joint is the rig's");
        let place = Vec3::from(to.translation);
        assert!(over[1].translation().distance(place) < 1e-6, "{mode:?} {:?}", over[1]);
        assert!(over[1].rotation().angle_between(to.rotation) < 1e-3);
        let below = place + to.rotation * Vec3::new(0.0, 0.5, 0.0);
        assert!(over[2].translation().distance(below) < 1e-5, "{mode:?}: what hangs on it follows");
        game.app.world_mut().entity_mut(instance).insert(HandOver { share: 0.5 });
        game.app.update();
        let half = (before[1].translation() + place) / 2.0;
        assert!(places(&game)[1].translation().distance(half) < 1e-6);
        // Taken back, everything stands as before; and so it does when nothing was to be handed over.
        game.app.world_mut().entity_mut(instance).remove::<HandOver>();
        for _ in 0..2 {
            game.app.update();
            for (now, before) in places(&game).iter().zip(&before) {
                assert!(now.translation().distance(before.translation()) < 1e-6, "{mode:?}");
            }
        }
    }
}

#[test]
fn the_asset_server_loads_parts_too() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("limbs")).unwrap();
    let limb = folder.path().join("limbs/limb.rig.ron");
    let part = "(format: 2, name: \"limb\", joints: [(label: \"knee\", translation: (0, 1, 0), tags: [control()])])";
    fs::write(&limb, part).unwrap();
    // One part of its own, one that comes with the program.
    let text = "(format: 2, name: \"doll\", joints: [(label: \"hip\")], parts: [(part: \"limbs/limb.rig.ron\", parent: \
                \"hip\"), (part: \"parts/jaw.rig.ron\", parent: \"hip\")])";
    saved(folder.path(), text);
    let mut game = AppBench::game(RigInstancePlugin::live(), folder.path());
    let handle = game.app.world().resource::<AssetServer>().load::<RigTemplate>("t.rig.ron");
    let instance = game.app.world_mut().spawn((RigInstance(handle), InstanceMode::Hierarchy)).id();
    game.until("the character", |told| told.built == 1);
    let height = |game: &mut AppBench| {
        let knee = game.node(instance, "knee");
        game.app.world().get::<GlobalTransform>(knee).unwrap().translation().y
    };
    game.frames(3);
    assert_eq!(height(&mut game), 1.0);
    game.node(instance, "jaw_tip");
    save_whole(&limb, part.replace("(0, 1, 0)", "(0, 3, 0)"));
    game.until("the part", |told| !told.updated.is_empty());
    game.frames(3);
    assert_eq!((height(&mut game), game.instance_report().failed.len()), (3.0, 0));
}
