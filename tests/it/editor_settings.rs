//! The file of the settings: what cannot be read is not overwritten, and a save that fails is made up for.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    editor::{
        actions::ActionRequest,
        keys::KeyBindings,
        notice::Notice,
        settings::{EditorSettings, SettingsFile, SettingsPlugin},
    },
    files::{Disk, Fault, FaultPlan, FaultyDisk, RealDisk, save_atomic},
};

use crate::{
    bench::{AppBench, HANG},
    files_faults::{is_passing, plans},
};

/// A window's settings without the window. Every update is two seconds long.
struct Settings {
    base: AppBench,
    told: Vec<String>,
}

impl Settings {
    fn open(disk: Arc<dyn Disk>, path: &Path) -> Self {
        let mut settings = Self::begin(disk, path);
        // The text of the start is known after the first looks.
        (0..3).for_each(|_| settings.update());
        settings
    }

    fn begin(disk: Arc<dyn Disk>, path: &Path) -> Self {
        let mut app = App::new();
        app.insert_resource(SettingsFile::new(disk, Some(path.to_owned())))
            .add_plugins((MinimalPlugins, SettingsPlugin))
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs(2)))
            .init_resource::<KeyBindings>()
            .add_message::<ActionRequest>()
            .add_message::<AppExit>();
        Self { base: AppBench::bare(app), told: Vec::new() }
    }

    fn update(&mut self) {
        self.base.app.update();
        self.told.extend(self.base.messages::<Notice>().into_iter().map(|notice| notice.text));
    }

    fn remember(&mut self, name: &str) {
        self.base.app.world_mut().resource_mut::<EditorSettings>().remember(name.into());
    }

    fn close(mut self) {
        self.base.app.world_mut().write_message(AppExit::Success);
        self.update();
    }
}

/// The names of recent files in a file.
fn recent(path: &Path) -> Vec<String> {
    let settings = Settings::open(Arc::new(RealDisk), path);
    assert_eq!(settings.told, Vec::<String>::new());
    let recent = &settings.base.app.world().resource::<EditorSettings>().recent;
    recent.iter().map(|path| path.display().to_string()).collect()
}

/// A file with the settings of an earlier day.
fn earlier(folder: &Path) -> PathBuf {
    let path = folder.join("config").join("settings.ron");
    let mut settings = Settings::open(Arc::new(RealDisk), &path);
    settings.remember("earlier.glb");
    settings.close();
    assert_eq!(recent(&path), ["earlier.glb"]);
    path
}

#[test]
fn settings_that_cannot_be_read_are_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = earlier(folder.path());
    let good = fs::read(&path).unwrap();
    let long = [good.clone(), vec![b' '; 1 << 20]].concat();
    for content in [b"(settings: (recent: [\"by hand\")".to_vec(), b"\xff\xfe".to_vec(), long] {
        fs::write(&path, &content).unwrap();
        let mut settings = Settings::open(Arc::new(RealDisk), &path);
        assert!(settings.told.len() == 1 && settings.told[0].contains("settings.ron"), "{:?}", settings.told);
        settings.remember("later.glb");
        settings.update();
        settings.close();
        assert!(fs::read(&path).unwrap() == content);
    }
    // An empty file and none are as good as the defaults.
    for content in [Some(b""), None] {
        fs::remove_file(&path).unwrap();
        if let Some(content) = content {
            fs::write(&path, content).unwrap();
        }
        let mut settings = Settings::open(Arc::new(RealDisk), &path);
        settings.remember("later.glb");
        settings.close();
        assert_eq!(recent(&path), ["later.glb"]);
    }
}

/// Opens the settings on a disk, changes them and closes; returns what was told.
fn session(disk: &Arc<FaultyDisk>, path: &Path) -> Vec<String> {
    let mut settings = Settings::open(disk.clone(), path);
    settings.remember("later.glb");
    let told = settings.told.clone();
    settings.close();
    told
}

#[test]
fn settings_are_the_earlier_ones_or_the_later_ones_whatever_fails() {
    let folder = tempfile::tempdir().unwrap();
    let path = earlier(folder.path());
    let content = fs::read(&path).unwrap();
    let counted = Arc::new(FaultyDisk::new(RealDisk, None));
    assert_eq!(session(&counted, &path), Vec::<String>::new());
    assert_eq!(recent(&path), ["later.glb", "earlier.glb"]);
    for plan in plans(counted.operations()) {
        save_atomic(&RealDisk, &path, &content).unwrap();
        let disk = Arc::new(FaultyDisk::new(RealDisk, Some(plan)));
        let told = session(&disk, &path);
        let now = recent(&path);
        let context = format!("{plan:?}: {told:?}, {now:?}, {:?}", disk.log());
        let is_later = now == ["later.glb", "earlier.glb"];
        assert!(is_later || now == ["earlier.glb"], "{context}");
        // What was not read is not written either.
        assert!(told.is_empty() || !is_later, "{context}");
    }
}

#[test]
fn a_save_that_fails_is_told_once_and_made_up_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = earlier(folder.path());
    let content = fs::read(&path).unwrap();
    // Waits until the settings are saved while the window is open; returns what was told and the number of operations.
    let saved = |plan: Option<FaultPlan>| {
        save_atomic(&RealDisk, &path, &content).unwrap();
        let disk = Arc::new(FaultyDisk::new(RealDisk, plan));
        let mut settings = Settings::open(disk.clone(), &path);
        let opened = disk.operations();
        settings.remember("later.glb");
        let started = Instant::now();
        while fs::read(&path).unwrap() == content {
            assert!(started.elapsed() < HANG, "{plan:?}: {:?}", settings.told);
            settings.update();
        }
        settings.close();
        assert_eq!(recent(&path), ["later.glb", "earlier.glb"]);
        (opened, disk.operations())
    };
    let (opened, operations) = saved(None);
    for plan in plans(operations).filter(|plan| plan.at >= opened && is_passing(*plan)) {
        saved(Some(plan));
    }
    // A disk that stays full is told of once.
    save_atomic(&RealDisk, &path, &content).unwrap();
    let plan = FaultPlan { at: opened, fault: Fault::NoSpace, lasting: true };
    let disk = Arc::new(FaultyDisk::new(RealDisk, Some(plan)));
    let mut settings = Settings::open(disk.clone(), &path);
    settings.remember("later.glb");
    let started = Instant::now();
    // Each attempt begins with the folder.
    while disk.log().iter().filter(|name| **name == "create_folder").count() < 4 {
        assert!(started.elapsed() < HANG, "{:?}", disk.log());
        settings.update();
    }
    assert_eq!(settings.told.len(), 1, "{:?}", settings.told);
    settings.close();
    assert_eq!(fs::read(&path).unwrap(), content);
}

/// Changes before the first look at the file are kept like later ones.
#[test]
fn changes_of_the_first_second_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("settings.ron");
    let mut settings = Settings::begin(Arc::new(RealDisk), &path);
    settings.update();
    settings.remember("early.obj");
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < HANG, "the settings are not saved");
        settings.update();
    }
    settings.close();
    let again = Settings::open(Arc::new(RealDisk), &path);
    let recent = again.base.app.world().resource::<EditorSettings>().recent.clone();
    assert_eq!(recent, [PathBuf::from("early.obj")]);
}
