//! Files in the window, without the window: opening, saving, asking, recovering.

mod crashes;
mod exporting;
mod failures;
mod joint_maps;
mod journals;
mod lost_meshes;
mod several_meshes;
mod views;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use bevy::{prelude::*, window::FileDragAndDrop};
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        files::{
            ExportOptions, FilesPlugin, OpenDocument, OpenRequest, StateFolder,
            dialog::{Answer, Dialog, DialogAnswer, Purpose, Question},
            has_unsaved_changes, title,
        },
        follow::FollowPlugin,
        notice::Severity,
        panels::PanelsPlugin,
        recovery::{Recovery, can_recover, describe},
        result_queue::HeldPlugin,
        settings::EditorSettings,
    },
    files::{
        Disk, RealDisk, bundled_characters, journal::journal_beside, load_animation, load_model, load_packed_clips,
        load_template, store_rig,
    },
    headless::headless_app,
    plugins::{
        document::{Change, EditRequest},
        history::RigHistory,
        limits::{Limit, RigLimits},
        surface::{RigMesh, RigMeshes},
    },
    prelude::*,
    rig::{
        animation::{Key, NodeNames, Property, RigClip, Track, TrackTarget, orphaned_keys},
        operations::Operation,
        skeleton_preset::SkeletonPreset,
        update::{diff, edits_between},
    },
};

use crate::{
    bench::{AppBench, HANG, wait},
    window_app::Notices,
};

struct Window {
    base: AppBench,
    folder: PathBuf,
    notices: Notices,
}

impl Window {
    /// A window without anything open; journals lie in `folder/state`.
    fn new(folder: &Path) -> Self {
        Self::with_state(folder, folder.join("state"))
    }

    fn with_state(folder: &Path, state: PathBuf) -> Self {
        Self::of(AppBench::with_files(state, FilesPlugin), folder)
    }

    /// A window with its panels.
    fn with_panels(folder: &Path) -> Self {
        let plugins = (FilesPlugin, FollowPlugin, PanelsPlugin, HeldPlugin);
        Self::of(AppBench::with_files(folder.join("state"), plugins), folder)
    }

    fn of(base: AppBench, folder: &Path) -> Self {
        let mut window = Self { base, folder: folder.to_owned(), notices: Notices::default() };
        window.settle();
        window
    }

    fn bundled(folder: &Path) -> Self {
        let mut window = Self::new(folder);
        window.open(OpenRequest::Bundled);
        window
    }

    fn world(&self) -> &World {
        self.base.app.world()
    }

    fn update(&mut self) {
        self.base.app.update();
        self.notices.read(&self.base.app);
        // Work that other tests left in the system's folder for temporary files is none of ours.
        let foreign = match self.question() {
            Some(Question::Recover(list)) => list.iter().all(|pending| !pending.path.starts_with(&self.folder)),
            _ => false,
        };
        if foreign {
            self.base.app.world_mut().write_message(DialogAnswer(Answer::Cancel));
        }
    }

    /// Runs frames until nothing goes on in the background.
    fn settle(&mut self) {
        let start = Instant::now();
        for _ in 0..3 {
            self.update();
        }
        while self.base.has_file_jobs() || self.world().resource::<Recovery>().is_looking() {
            assert!(start.elapsed() < HANG, "something never ends");
            std::thread::sleep(Duration::from_millis(2));
            self.update();
        }
        for _ in 0..3 {
            self.update();
        }
    }

    fn send<M: Message>(&mut self, message: M) {
        self.base.app.world_mut().write_message(message);
        self.settle();
    }

    fn open(&mut self, request: OpenRequest) {
        self.send(request);
    }

    fn open_file(&mut self, path: &Path) {
        self.open(OpenRequest::File(path.to_owned()));
    }

    fn act(&mut self, action: Action) {
        self.send(ActionRequest(action));
    }

    fn answer(&mut self, answer: Answer) {
        self.send(DialogAnswer(answer));
    }

    fn question(&self) -> Option<&Question> {
        self.world().resource::<Dialog>().question()
    }

    fn rig(&self) -> Rig {
        self.world().get::<Rig>(self.base.open_rig()).expect("a rig is open").clone()
    }

    fn change(&mut self, change: Change) {
        let rig = self.base.open_rig();
        self.send(EditRequest { rig, change });
    }

    fn place(&mut self, height: f32) {
        self.change(Change::Do(Operation::Place { position: Vec3::new(0.0, height, 0.0), parent: None }));
    }

    fn save_as(&mut self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        self.act(Action::SaveAs);
        self.answer(Answer::Path(path.clone()));
        path
    }

    fn export(&mut self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        self.act(Action::Export);
        self.answer(Answer::Path(path.clone()));
        path
    }

    fn is_unsaved(&self) -> bool {
        has_unsaved_changes(self.world())
    }

    fn mesh(&self) -> Option<&RigMesh> {
        let entity = self.world().get::<RigMeshes>(self.base.open_rig())?.iter().next()?;
        self.world().get::<RigMesh>(entity)
    }

    fn journal(&self) -> PathBuf {
        let document = self.world().get::<OpenDocument>(self.base.open_rig()).expect("a document is open");
        let start = Instant::now();
        loop {
            if let Some(path) = document.journal().path() {
                return path;
            }
            assert!(start.elapsed() < HANG, "the journal never begins");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder for the test")
}

/// Limits of the command line hold in the window, too: what goes over one is refused with a toast that names it.
#[test]
fn files_above_a_limit_are_refused_with_a_toast() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("three.rig"), "rig 1\njoint 0 -1 0 0 0 a\njoint 1 0 0 1 0 b\njoint 2 1 0 1 0 c\n").unwrap();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    std::fs::write(at("box.obj"), format!("{corners}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")).unwrap();
    let mut window = Window::new(folder.path());
    let limits = RigLimits::default().with(Limit::Joints, 2).with(Limit::Triangles, 3);
    window.base.app.insert_resource(limits);
    window.open(OpenRequest::Empty);
    let before = window.rig();
    for (file, told) in [("three.rig", "the rig has 3 joints"), ("box.obj", "the mesh has 4 triangles")] {
        window.open_file(&at(file));
        assert!(window.notices.include(Severity::Error, told), "{file}: {:?}", window.notices.list);
        assert!(window.notices.include(Severity::Error, "--limit "), "{file}: {:?}", window.notices.list);
        assert_eq!(window.rig(), before, "{file}");
    }
    window.base.app.insert_resource(RigLimits::default());
    window.open_file(&at("three.rig"));
    assert_eq!(window.rig().len(), 3);
}

#[test]
fn changes_are_unsaved_until_saved_and_clean_again_after_undo() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    assert_eq!(title(window.world()), "biped - Rigsmith");
    window.place(1.0);
    assert_eq!(title(window.world()), "biped* - Rigsmith");
    window.change(Change::Undo);
    assert!(!window.is_unsaved(), "undone to what was opened");
    window.change(Change::Redo);
    assert!(window.is_unsaved());
    let path = window.save_as("guy");
    assert_eq!(title(window.world()), "guy - Rigsmith", "{:?}", window.notices.list);
    assert!(!path.exists(), "the ending is added");
    let path = folder.path().join("guy.rigsmith.ron");
    assert!(path.exists() && folder.path().join("biped.obj").exists());
    window.change(Change::Undo);
    assert!(window.is_unsaved(), "before what was saved");
    window.change(Change::Redo);
    assert!(!window.is_unsaved(), "as it was saved");
    window.change(Change::Undo);
    window.place(0.5);
    assert!(window.is_unsaved(), "as many steps as were saved, but others");
    window.act(Action::Save);
    assert!(!window.is_unsaved() && window.question().is_none());
}

#[test]
fn a_mesh_outside_of_a_projects_folder_is_refused() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    let text = std::fs::read_to_string(window.save_as("guy.rigsmith.ron")).expect("the project was saved");
    assert!(text.contains("\"biped.obj\""), "the mesh lies beside the project");
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).expect("made");
    let project = inner.join("guy.rigsmith.ron");
    std::fs::write(&project, text.replace("\"biped.obj\"", "\"../biped.obj\"")).expect("written");
    let mut other = Window::new(folder.path());
    other.open_file(&project);
    assert!(other.mesh().is_none() && other.rig() == window.rig(), "{:?}", other.notices.list);
    assert!(other.notices.include(Severity::Warning, "is outside of"), "{:?}", other.notices.list);
    // A copy beside the project is taken.
    std::fs::copy(folder.path().join("biped.obj"), inner.join("biped.obj")).expect("copied");
    other.open_file(&project);
    assert!(other.mesh().is_some(), "{:?}", other.notices.list);
}

#[test]
fn what_was_saved_opens_the_same() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    window.place(0.5);
    let path = window.save_as("guy.rigsmith.ron");
    let (rig, mesh) = (window.rig(), window.mesh().map(|mesh| (mesh.uid, mesh.rest.points.clone())));
    let bytes = std::fs::read(&path).expect("the project was saved");
    let mut other = Window::new(folder.path());
    other.open_file(&path);
    assert_eq!(other.rig(), rig);
    assert_eq!(other.mesh().map(|mesh| (mesh.uid, mesh.rest.points.clone())), mesh);
    assert!(!other.is_unsaved());
    other.act(Action::Save);
    assert_eq!(std::fs::read(&path).expect("still there"), bytes);
}

#[test]
fn opening_something_else_asks_first() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    let rig = window.rig();
    for request in [OpenRequest::Empty, OpenRequest::Bundled] {
        window.open(request);
        assert!(matches!(window.question(), Some(Question::Unsaved { .. })));
        window.answer(Answer::Cancel);
        assert_eq!(window.rig(), rig);
    }
    window.act(Action::New);
    window.answer(Answer::Discard);
    assert!(window.rig().is_empty() && !window.is_unsaved());
    // The last one wins.
    window.base.app.world_mut().write_message(OpenRequest::Bundled);
    window.base.app.world_mut().write_message(OpenRequest::Empty);
    window.settle();
    assert!(window.mesh().is_none());
}

#[test]
fn what_dead_saves_left_is_cleared_at_the_start() {
    let (folder, projects) = (folder(), folder());
    let state = folder.path().join("state");
    std::fs::create_dir_all(&state).expect("a folder");
    let dead = [&state, projects.path()].map(|folder| folder.join(".rigsmith-0123456700000001.tmp"));
    dead.iter().for_each(|path| std::fs::write(path, "half").expect("written"));
    let living = projects.path().join(".rigsmith-7654321000000000.tmp");
    let mut file = RealDisk.create(&living).expect("created");
    file.lock().expect("locked");
    let mut settings = EditorSettings::default();
    settings.remember(projects.path().join("gone.rigsmith.ron"));
    let mut app = headless_app(7);
    app.insert_resource(StateFolder(Some(state))).insert_resource(settings);
    app.add_plugins(FilesPlugin).add_message::<bevy::app::AppExit>();
    app.finish();
    app.cleanup();
    wait(&mut app, "the end of what dead saves left", App::update, |_| dead.iter().all(|path| !path.exists()));
    assert!(living.exists(), "its process still saves");
}

#[test]
fn a_template_is_put_onto_the_mesh() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    let height = |window: &Window| {
        let rig = window.rig();
        rig.walk().map(|joint| rig.position(joint.data.uid).y).fold(f32::NEG_INFINITY, f32::max)
    };
    let mesh = window.mesh().map(|mesh| mesh.rest.points.iter().map(|p| p.y).fold(0.0, f32::max)).unwrap_or_default();
    for (name, scale) in [("fitting.rig.ron", 1.0), ("giant.rig.ron", 100.0)] {
        let mut rig = Rig::new(Uid(1), "template");
        for (number, at) in [0.0, 0.5, 1.0].into_iter().enumerate() {
            let mut joint = rigsmith::rig::JointData { uid: Uid(10 + number as u64), ..default() };
            joint.rest.translation = Vec3::Y * at * mesh * scale;
            let index = usize::MAX;
            rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index }).expect("a joint");
        }
        store_rig(&RealDisk, &folder.path().join(name), &rig).expect("written");
    }
    window.place(0.2);
    window.open_file(&folder.path().join("fitting.rig.ron"));
    assert!(window.question().is_none(), "it fits");
    assert_eq!(window.rig().len(), 3);
    window.change(Change::Undo);
    assert_eq!(window.rig().len(), 1, "one step, which can be taken back");
    let giant = folder.path().join("giant.rig.ron");
    window.open_file(&giant);
    assert!(matches!(window.question(), Some(Question::Fit(_))));
    assert!(window.notices.include(Severity::Warning, "another size"));
    window.answer(Answer::Cancel);
    assert_eq!(window.rig().len(), 1);
    window.open_file(&giant);
    window.answer(Answer::Fit);
    assert!((height(&window) / mesh - 1.0).abs() < 1e-4, "{} of {mesh}", height(&window));
    window.change(Change::Undo);
    window.open_file(&giant);
    window.answer(Answer::AsItIs);
    assert!((height(&window) / mesh / 100.0 - 1.0).abs() < 1e-4);
    assert!(window.mesh().is_some());
}

/// Who opens a mesh while a rig without one is open wants to see them together.
#[test]
fn a_mesh_comes_to_the_open_rig() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("box.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n").unwrap();
    let mut rig = Rig::new(Uid(1), "arm");
    let joint = rigsmith::rig::JointData { uid: Uid(10), ..default() };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 0 }).expect("a joint");
    store_rig(&RealDisk, &at("arm.rig.ron"), &rig).expect("written");
    let mut window = Window::new(folder.path());
    window.open_file(&at("arm.rig.ron"));
    window.place(0.5);
    let rig = window.rig();
    window.open_file(&at("box.obj"));
    assert!(window.question().is_none() && window.mesh().is_some(), "{:?}", window.notices.list);
    assert_eq!((rig.len(), window.rig()), (2, rig), "the rig is as it was");
    assert!(window.is_unsaved(), "no file has both");
    assert!(window.notices.include(Severity::Done, "Opened box.obj with the 2 joints"), "{:?}", window.notices.list);
    window.change(Change::Undo);
    assert!(window.mesh().is_none() && window.rig().len() == 2, "the mesh came as a step");
    window.change(Change::Undo);
    assert_eq!(window.rig().len(), 1, "the history goes on");
    window.change(Change::Redo);
    window.change(Change::Redo);

    let path = window.save_as("both.rigsmith.ron");
    assert!(!window.is_unsaved());
    let mut other = Window::new(folder.path());
    other.open_file(&path);
    assert!(other.mesh().is_some() && other.rig() == window.rig(), "{:?}", other.notices.list);
    // With a mesh there, another one is another document.
    std::fs::copy(at("box.obj"), at("crate.obj")).unwrap();
    other.open_file(&at("crate.obj"));
    assert!(other.rig().is_empty() && other.mesh().is_some_and(|mesh| mesh.file.name == "crate"));
}

/// A character of Rigsmith in a document's rig, as a fit puts it there, keeps its parts in the first file and in the next ones.
#[test]
fn what_a_fit_made_keeps_its_parts_in_its_first_file() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    let biped = bundled_characters().into_iter().find(|rig| rig.about().name == "biped").expect("the biped");
    let edits = edits_between(&window.rig(), &biped).expect("edits");
    window.change(Change::Do(Operation::Named { name: "Fit", edits }));
    for height in [0.25, 0.5] {
        let thigh = window.rig().find_label("thigh_l").expect("a thigh");
        let mut rest = window.rig().joint(thigh).expect("a thigh").data.rest;
        rest.translation.y = height;
        window.change(Change::Do(Operation::Edits(vec![RigEdit::SetRest(thigh, rest)])));
        let path = window.export("hero.rig.ron");
        if matches!(window.question(), Some(Question::Replace { .. })) {
            window.answer(Answer::Save);
        }
        let read = load_template(&RealDisk, &path).expect("a template");
        let parts: Vec<&str> = read.instances.iter().map(|instance| instance.part.as_str()).collect();
        assert_eq!((parts.len(), parts[0]), (8, "parts/spine.rig.ron"), "{:?}", window.notices.list);
        assert_eq!((read.rig.uid(), diff(&read.rig, &window.rig())), (window.rig().uid(), Vec::new()));
        assert_eq!(read.rig.joint(thigh).expect("a thigh").data.rest.translation.y, height);
    }
}
