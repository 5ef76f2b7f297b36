//! Model files that are saved while a game runs, in every way that programs save.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant, SystemTime},
};

use bevy::{ecs::message::MessageCursor, prelude::*};
use rigsmith::{
    files::{Disk, DiskFile, Entry, ModelWatch, RealDisk, SETTLE, load_model},
    instance::{
        FollowedModels, InstanceSkins, ModelFault, ModelFile, ModelFilesPlugin, RigInstance, RigInstancePlugin,
        RigSource, RigTemplate,
    },
    plugins::{
        document::{Change, EditRequest},
        mesh_reload::{ReloadAnswer, ReloadReport},
        skinning::InstanceSkin,
        surface::{RigMesh, SkinOf},
    },
    rig::{Rig, Uid},
};

use crate::{
    bench::{AppBench, HANG, save_whole, wait_with},
    disks::{entries_of_the_disk, no_changes},
};

/// A square column from a height of 0.9, that wide and high, with so many rings of points, as an OBJ.
pub fn column(width: f32, height: f32, rings: u32) -> String {
    let mut text = String::new();
    for ring in 0..rings {
        let y = 0.9 + height * ring as f32 / (rings - 1) as f32;
        for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            text.push_str(&format!("v {} {y} {}\n", x * width, z * width));
        }
    }
    for ring in 0..rings - 1 {
        for side in 0..4 {
            let (a, b) = (ring * 4 + side + 1, ring * 4 + (side + 1) % 4 + 1);
            text.push_str(&format!("f {a} {b} {} {}\n", b + 4, a + 4));
        }
    }
    text
}

/// A column around [`ARM`].
fn sleeve(width: f32, rings: u32) -> String {
    column(width, 0.7, rings)
}

const ARM: &[u8] = b"(format: 2, name: \"arm\", joints: [
    (label: \"upper\", translation: (0, 1, 0), tags: [control]),
    (label: \"lower\", parent: \"upper\", translation: (0, 0.3, 0)),
    (label: \"end\", parent: \"lower\", translation: (0, 0.3, 0)),
])";

/// A watch whose time passes as fast as a test wants it.
struct Watched {
    folder: tempfile::TempDir,
    watch: ModelWatch,
    now: Instant,
    /// Points of every version that was read; `None` for one that cannot be read.
    read: Vec<Option<usize>>,
}

impl Watched {
    fn new(name: &str, content: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let mut watch = ModelWatch::new(&path);
        watch.know(&RealDisk);
        let mut watched = Self { folder, watch, now: Instant::now(), read: Vec::new() };
        watched.pass(3 * SETTLE);
        assert_eq!(watched.read, []);
        watched
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn look(&mut self) {
        self.now += Duration::from_millis(10);
        if self.watch.look_at(&RealDisk, self.now)
            && let Some(model) = self.watch.read(&RealDisk)
        {
            self.read.push(model.ok().map(|model| model.points.len()));
        }
    }

    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.look();
        }
    }

    /// Looks until a version is as expected: the watch rests longer where the machine takes long to read.
    fn until(&mut self, what: &str, is_expected: impl Fn(&Option<usize>) -> bool) {
        let start = Instant::now();
        while !self.read.iter().any(&is_expected) {
            assert!(start.elapsed() < HANG, "{what}: {:?}", self.read);
            self.look();
        }
        self.pass(40 * SETTLE);
    }
}

#[test]
fn every_way_of_saving_is_one_version() {
    let (before, after) = (sleeve(0.1, 4), sleeve(0.1, 6));
    let half = after.len() / 2;
    let short = Duration::from_millis(100);
    type Save<'a> = &'a dyn Fn(&mut Watched);
    let beside = |watched: &Watched, name: &str| {
        fs::write(watched.at(name), &after).unwrap();
        fs::rename(watched.at(name), watched.at("a.obj")).unwrap();
    };
    let ways: [(&str, Save); 12] = [
        ("in place", &|watched| fs::write(watched.at("a.obj"), &after).unwrap()),
        ("emptied, filled after a pause", &|watched| {
            fs::write(watched.at("a.obj"), "").unwrap();
            watched.pass(3 * SETTLE);
            fs::write(watched.at("a.obj"), &after).unwrap();
        }),
        ("slowly, in pieces", &|watched| {
            for end in [half / 2, half, half + half / 2] {
                fs::write(watched.at("a.obj"), &after[..end]).unwrap();
                watched.pass(short);
            }
            fs::write(watched.at("a.obj"), &after).unwrap();
        }),
        ("beside, renamed", &|watched| beside(watched, "a.tmp")),
        ("beside, renamed, with an old time", &|watched| {
            fs::write(watched.at("a.tmp"), &after).unwrap();
            let file = fs::File::options().write(true).open(watched.at("a.tmp")).unwrap();
            file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000)).unwrap();
            fs::rename(watched.at("a.tmp"), watched.at("a.obj")).unwrap();
        }),
        ("moved away, written, removed", &|watched| {
            fs::rename(watched.at("a.obj"), watched.at("a.obj~")).unwrap();
            watched.pass(short);
            fs::write(watched.at("a.obj"), &after).unwrap();
            fs::remove_file(watched.at("a.obj~")).unwrap();
        }),
        ("a lock and a copy, then in place", &|watched| {
            fs::write(watched.at(".#a.obj"), "").unwrap();
            fs::copy(watched.at("a.obj"), watched.at("a.obj~")).unwrap();
            fs::write(watched.at("a.obj"), &after).unwrap();
        }),
        ("copies of the editor beside it", &|watched| {
            fs::write(watched.at("a.obj.bak"), &before).unwrap();
            beside(watched, ".a.obj.swp");
        }),
        ("twenty times in two seconds", &|watched| {
            for save in 0..20 {
                fs::write(watched.at("a.obj"), sleeve(0.2, 4 + save)).unwrap();
                watched.pass(short);
            }
            fs::write(watched.at("a.obj"), &after).unwrap();
        }),
        ("removed and made again", &|watched| {
            fs::remove_file(watched.at("a.obj")).unwrap();
            watched.pass(3 * SETTLE);
            fs::write(watched.at("a.obj"), &after).unwrap();
        }),
        ("as over a network, cut off for a moment", &|watched| {
            fs::write(watched.at("a.obj"), &after[..half]).unwrap();
            watched.pass(short);
            fs::write(watched.at("a.obj"), &after).unwrap();
            watched.pass(short);
        }),
        ("of the same length and time", &|watched| {
            let time = fs::metadata(watched.at("a.obj")).unwrap().modified().unwrap();
            // The last ring alone is another one: a name of the same length.
            fs::write(watched.at("a.obj"), before.replace("f 9 10", "f 10 9")).unwrap();
            fs::File::options().write(true).open(watched.at("a.obj")).unwrap().set_modified(time).unwrap();
        }),
    ];
    for (way, save) in ways {
        let mut watched = Watched::new("a.obj", &before);
        save(&mut watched);
        watched.until(way, Option::is_some);
        let points = if way == "of the same length and time" { 16 } else { 24 };
        let good: Vec<usize> = watched.read.iter().flatten().copied().collect();
        assert_eq!(good, [points], "{way}: {:?}", watched.read);
        watched.pass(40 * SETTLE);
        assert_eq!(watched.read.iter().flatten().count(), 1, "{way}: nothing more is told");
    }
}

#[test]
fn a_broken_file_is_told_once_and_the_next_good_one_is_read() {
    let mut watched = Watched::new("a.obj", &sleeve(0.1, 4));
    fs::write(watched.at("a.obj"), "v 1 2\nf 1 2 3 4 5 6 7 8 9\n").unwrap();
    watched.until("the broken file", Option::is_none);
    assert_eq!(watched.read, [None]);
    fs::write(watched.at("a.obj"), sleeve(0.1, 5)).unwrap();
    watched.until("the good file", Option::is_some);
    assert_eq!(watched.read, [None, Some(20)]);
}

/// A disk on which a file is saved right before the opening of a file with that number, from 1; it can only be read.
struct RacedDisk {
    file: PathBuf,
    content: String,
    number: usize,
    opened: AtomicUsize,
}

impl Disk for RacedDisk {
    entries_of_the_disk!();
    no_changes!();

    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        if self.opened.fetch_add(1, Ordering::Relaxed) + 1 == self.number {
            save_whole(&self.file, &self.content);
        }
        RealDisk.open(path)
    }
}

#[test]
fn a_version_that_is_saved_while_another_one_is_read_is_not_missed() {
    // Reads a version, while the next one is saved right before the opening of a file; the number of openings, too.
    let raced = |number: usize| {
        let mut watched = Watched::new("a.obj", &sleeve(0.1, 4));
        let file = watched.at("a.obj");
        save_whole(&file, sleeve(0.1, 5));
        let start = Instant::now();
        while !watched.watch.look_at(&RealDisk, watched.now) {
            assert!(start.elapsed() < HANG, "the version is not noticed");
            watched.now += Duration::from_millis(10);
        }
        let disk = RacedDisk { file, content: sleeve(0.1, 6), number, opened: AtomicUsize::new(0) };
        let model = watched.watch.read(&disk);
        watched.read.extend(model.map(|model| model.ok().map(|model| model.points.len())));
        (watched, disk.opened.into_inner())
    };
    let (alone, opened) = raced(0);
    assert_eq!(alone.read, [Some(20)]);
    assert!(opened > 1, "it is read, and hashed");
    for number in 1..=opened {
        let (mut watched, _) = raced(number);
        watched.until("the version that was saved meanwhile", |points| *points == Some(24));
        assert_eq!(watched.read.iter().filter(|points| **points == Some(24)).count(), 1, "{number} of {opened}");
    }
}

/// A triangle as `.gltf`, whose points are in `a.bin`.
const GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [9, 9, 9]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"uri": "a.bin", "byteLength": 36}]}"#;

#[test]
fn a_file_that_the_model_names_is_followed() {
    let points = |height: f32| {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, height, 0.0]];
        points.as_flattened().iter().flat_map(|number: &f32| number.to_le_bytes()).collect::<Vec<u8>>()
    };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.bin"), points(1.0)).unwrap();
    fs::write(at("a.gltf"), GLTF).unwrap();
    let mut watch = ModelWatch::new(&at("a.gltf"));
    watch.know(&RealDisk);
    fs::write(at("a.bin"), points(2.0)).unwrap();
    let (start, mut now) = (Instant::now(), Instant::now());
    while !watch.look_at(&RealDisk, now) {
        assert!(start.elapsed() < HANG, "the other buffer is not noticed");
        now += Duration::from_millis(10);
    }
    let model = watch.read(&RealDisk).unwrap().unwrap();
    assert_eq!(model.points.iter().map(|point| point.y).fold(0.0, f32::max), 2.0);
}

/// A game without window and renderer, whose meshes follow their files.
struct Game {
    base: AppBench,
    folder: tempfile::TempDir,
    answers: MessageCursor<ReloadAnswer>,
    reports: Vec<ReloadReport>,
    faults: MessageCursor<ModelFault>,
    told: Vec<String>,
}

impl Game {
    fn new(mut app: App) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("arm.obj"), sleeve(0.1, 4)).unwrap();
        app.add_plugins((
            RigInstancePlugin::default(),
            ModelFilesPlugin { look: Duration::from_millis(2), settle: Duration::from_millis(20) },
        ));
        app.finish();
        app.cleanup();
        let (answers, faults) = (MessageCursor::default(), MessageCursor::default());
        Self { base: AppBench::bare(app), folder, answers, reports: Vec::new(), faults, told: Vec::new() }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("arm.obj")
    }

    fn template(&mut self) -> Handle<RigTemplate> {
        self.base.app.world_mut().resource_mut::<Assets<RigTemplate>>().add(RigTemplate::read(ARM).unwrap())
    }

    fn mesh(&self) -> RigMesh {
        RigMesh::new(Uid(7), load_model(&RealDisk, &self.path()).unwrap(), Vec::new())
    }

    fn update(&mut self) {
        self.base.app.update();
        let world = self.base.app.world();
        let answers = self.answers.read(world.resource::<Messages<ReloadAnswer>>());
        self.reports.extend(answers.map(|answer| answer.result.clone().unwrap()));
        let faults = self.faults.read(world.resource::<Messages<ModelFault>>());
        self.told.extend(faults.map(|fault| fault.error.to_string()));
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        wait_with(self, what, Self::update, is_so, |game| game.told.clone());
    }

    /// Updates until the file is followed, and for a while in which nothing more has to happen.
    fn settle(&mut self) {
        let path = self.path();
        self.until("the first look", |game| game.base.app.world().resource::<FollowedModels>().is_followed(&path));
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(200) {
            std::thread::sleep(Duration::from_millis(1));
            self.update();
        }
    }

    fn save(&self, text: &str) {
        save_whole(&self.path(), text);
    }
}

#[test]
fn meshes_of_instances_follow_their_file_with_one_transfer_for_all() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin));
    let mut game = Game::new(app);
    let (template, mesh, file) = (game.template(), game.mesh(), ModelFile(game.path()));
    let meshes = [0, 1].map(|_| {
        let world = game.base.app.world_mut();
        let instance = world.spawn(RigInstance(template.clone())).id();
        world.spawn((mesh.clone(), SkinOf(instance), file.clone())).id()
    });
    let skin = |game: &Game, mesh: Entity| game.base.get::<InstanceSkin>(mesh).map(|skin| skin.0.clone());
    let points = |game: &Game, mesh: Entity| game.base.get::<RigMesh>(mesh).unwrap().rest.points.len();
    game.until("the weights", |game| meshes.iter().all(|mesh| skin(game, *mesh).is_some()));
    game.settle();
    game.save(&sleeve(0.2, 7));
    game.until("the next version", |game| meshes.iter().all(|mesh| points(game, *mesh) == 28));
    let skins = meshes.map(|mesh| skin(&game, mesh).unwrap());
    assert!(skins[0].weights.len() == 28 && Arc::ptr_eq(&skins[0], &skins[1]), "the weights come with the points");
    game.settle();
    assert_eq!(
        game.base.app.world().resource::<InstanceSkins>().computed(),
        1,
        "weights are transferred, not computed"
    );
    assert!(Arc::ptr_eq(&skin(&game, meshes[0]).unwrap(), &skins[0]));
    assert_eq!(game.reports.iter().map(|report| report.points).collect::<Vec<_>>(), [[16, 28]; 2]);
    assert!(game.reports.iter().all(|report| report.moved > 0.09 && report.weights.is_some()), "{:?}", game.reports);
    // A broken one changes nothing and is told for each mesh; the next good one is taken.
    game.save("v 1 2\nf 1 2 3 4 5 6 7 8 9\n");
    game.until("the error", |game| game.told.len() == 2);
    assert!(game.told[0].contains("arm.obj") && points(&game, meshes[1]) == 28, "{:?}", game.told);
    game.save(&sleeve(0.1, 5));
    game.until("the good version", |game| meshes.iter().all(|mesh| points(game, *mesh) == 20));
    // One that follows nothing any more stays as it is.
    game.base.app.world_mut().entity_mut(meshes[0]).remove::<ModelFile>();
    game.save(&sleeve(0.1, 6));
    game.until("the last version", |game| points(game, meshes[1]) == 24);
    assert_eq!(points(&game, meshes[0]), 20);
}

#[test]
fn a_mesh_of_a_document_follows_its_file_as_a_step_that_can_be_undone() {
    let mut game = Game::new(rigsmith::headless::headless_app(5));
    let (template, mesh, file) = (game.template(), game.mesh(), ModelFile(game.path()));
    let world = game.base.app.world_mut();
    let rig = world.spawn(RigSource::new(template)).id();
    let mesh = world.spawn((mesh, SkinOf(rig), file)).id();
    let weights = |game: &Game| Some(game.base.get::<Rig>(rig)?.skin(Uid(7))?.weights.len());
    let points = |game: &Game| game.base.get::<RigMesh>(mesh).unwrap().rest.points.len();
    game.until("the weights", |game| weights(game) == Some(16));
    game.settle();
    game.save(&sleeve(0.2, 7));
    game.until("the next version", |game| points(game) == 28);
    assert_eq!(weights(&game), Some(28));
    game.until("the report", |game| game.reports.len() == 1);
    game.base.app.world_mut().write_message(EditRequest { rig, change: Change::Undo });
    game.until("the version before", |game| points(game) == 16);
    assert_eq!(weights(&game), Some(16));
    game.settle();
    assert_eq!(points(&game), 16, "nothing is taken over until the file changes again");
}
