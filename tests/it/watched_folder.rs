//! A watched folder: forms, expressions and gestures that are saved there are in use at once.

use std::{fs, path::Path, time::Duration};

use bevy::{ecs::message::MessageCursor, prelude::*};
use rigsmith::{
    headless::headless_app,
    instance::{FolderFault, FolderRead, GesturesRead, WatchedFolderPlugin, WatchedFolders},
    plugins::{commands::RigModules, face::FaceExpressions},
};

use super::bench::{AppBench, wait_with};

struct WatchedFolder {
    base: AppBench,
    folder: tempfile::TempDir,
    cursors: (MessageCursor<FolderRead>, MessageCursor<FolderFault>, MessageCursor<GesturesRead>),
    read: Vec<String>,
    faults: Vec<String>,
    gestures: Vec<usize>,
}

impl WatchedFolder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut app = headless_app(1);
        app.add_plugins(WatchedFolderPlugin {
            look: Duration::from_millis(5),
            ..WatchedFolderPlugin::new(folder.path())
        });
        app.finish();
        app.cleanup();
        let cursors = Default::default();
        Self { base: AppBench::bare(app), folder, cursors, read: Vec::new(), faults: Vec::new(), gestures: Vec::new() }
    }

    fn save(&self, name: &str, text: &str) {
        let path = self.folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn frame(&mut self) {
        self.base.app.update();
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        let world = self.base.app.world();
        self.read.extend(self.cursors.0.read(world.resource()).map(|read| name(&read.file)));
        self.faults.extend(
            self.cursors.1.read(world.resource()).map(|fault| format!("{}: {}", name(&fault.file), fault.error)),
        );
        self.gestures.extend(self.cursors.2.read(world.resource()).map(|read| read.gestures.len()));
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        wait_with(self, what, Self::frame, is_so, |watched| (watched.read.clone(), watched.faults.clone()));
    }

    fn has(&self, expression: &str) -> bool {
        self.base.app.world().resource::<FaceExpressions>().0.get(expression).is_some()
    }
}

fn asset(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(path)).unwrap()
}

#[test]
fn expressions_of_a_folder_come_change_and_go() {
    let mut watched = WatchedFolder::new();
    let smile = asset("expressions/happiness.expr.ron").replace("\"happiness\"", "\"beaming\"");
    assert!(smile.contains("beaming") && !watched.has("beaming"));
    watched.save("faces/beaming.expr.ron", &smile);
    watched.until("the expression", |watched| watched.has("beaming"));
    assert!(watched.has("happiness"), "the bundled ones stay");
    // A broken one changes nothing and is told, and the next good save recovers.
    watched.save("faces/beaming.expr.ron", &smile[..smile.len() / 2]);
    watched.until("the fault", |watched| !watched.faults.is_empty());
    assert!(watched.has("beaming") && watched.faults[0].contains("beaming.expr.ron"), "{:?}", watched.faults);
    watched.save("faces/beaming.expr.ron", &smile.replace("beaming", "glowing"));
    watched.until("the other name", |watched| watched.has("glowing"));
    assert!(!watched.has("beaming"));
    // A file with the name of a bundled one takes its place; without it that is back.
    watched.save("happiness.expr.ron", &smile.replace("beaming", "cheer"));
    watched.until("the replacement", |watched| watched.has("cheer"));
    assert!(!watched.has("happiness"));
    fs::remove_file(watched.folder.path().join("happiness.expr.ron")).unwrap();
    watched.until("the bundled one", |watched| watched.has("happiness"));
    assert!(!watched.has("cheer") && watched.has("glowing"));
}

#[test]
fn a_form_of_a_folder_is_that_of_its_module() {
    let mut watched = WatchedFolder::new();
    let form = |watched: &WatchedFolder| {
        watched.base.app.world().resource::<RigModules>().0.get("control").unwrap().form.as_deref().unwrap().to_owned()
    };
    let text = asset("modules/control.ui.ron").replace("title: \"Control\"", "title: \"Handle\"");
    watched.save("control.ui.ron", &text);
    watched.until("the form", |watched| form(watched).contains("Handle"));
    for (name, text, message) in [
        ("control.ui.ron", text.replace("param: \"size\"", "param: \"sizes\""), "sizes"),
        ("contrl.ui.ron", text.clone(), "no module \"contrl\""),
    ] {
        let known = watched.faults.len();
        watched.save(name, &text);
        watched.until("the fault", |watched| watched.faults.len() > known);
        assert!(watched.faults[known].contains(message), "{:?}", watched.faults);
        assert!(form(&watched).contains("Handle"));
    }
}

#[test]
fn gestures_of_a_folder_are_handed_out_at_every_save() {
    let mut watched = WatchedFolder::new();
    let list = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/gestures")).unwrap();
    let text =
        fs::read_to_string(list.map(|entry| entry.unwrap().path()).find(|path| path.is_file()).unwrap()).unwrap();
    watched.save("draw.gestures.ron", &text);
    watched.until("the gestures", |watched| watched.gestures.len() == 1);
    assert!(watched.gestures[0] > 3, "{:?}", watched.gestures);
    watched.save("draw.gestures.ron", "[]");
    watched.until("the empty list", |watched| watched.gestures.len() == 2);
    assert_eq!(watched.gestures[1], 0);
    watched.save("draw.gestures.ron", "[Nothing(");
    watched.until("the fault", |watched| watched.faults.len() == 1);
    assert_eq!(watched.read.len(), 2);
}

#[test]
fn folders_come_and_go_and_the_first_of_them_counts() {
    let mut watched = WatchedFolder::new();
    let other = tempfile::tempdir().unwrap();
    let smile = asset("expressions/happiness.expr.ron");
    let named = |name: &str| smile.replace("\"happiness\"", &format!("\"{name}\""));
    fs::write(other.path().join("smile.expr.ron"), named("broad")).unwrap();
    watched.save("smile.expr.ron", &named("narrow"));
    watched.until("the first folder", |watched| watched.has("narrow"));
    let folders = |watched: &mut WatchedFolder, change: &dyn Fn(&mut WatchedFolders)| {
        change(&mut watched.base.app.world_mut().resource_mut::<WatchedFolders>());
    };
    let first = watched.base.app.world().resource::<WatchedFolders>().0[0].clone();
    let second = rigsmith::instance::WatchedFolder { path: other.path().to_owned(), depth: 0 };
    folders(&mut watched, &|folders| folders.0.push(second.clone()));
    watched.until("the file of the second", |watched| watched.read.len() == 2);
    assert!(watched.has("narrow") && !watched.has("broad"));
    folders(&mut watched, &|folders| folders.0 = vec![second.clone()]);
    watched.until("the second folder alone", |watched| watched.has("broad"));
    assert!(!watched.has("narrow"));
    folders(&mut watched, &|folders| folders.0 = vec![first.clone()]);
    watched.until("the first folder again", |watched| watched.has("narrow") && !watched.has("broad"));
    // What lies deeper than a folder is followed for is not looked at.
    fs::create_dir(other.path().join("deep")).unwrap();
    fs::write(other.path().join("deep/grin.expr.ron"), named("grin")).unwrap();
    folders(&mut watched, &|folders| folders.0 = vec![second.clone()]);
    watched.until("the second folder", |watched| watched.has("broad"));
    assert!(!watched.has("grin"));
}
