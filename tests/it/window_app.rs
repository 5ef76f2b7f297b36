//! A window without a window: the app that opens and saves documents, and its notices.

use std::path::PathBuf;

use bevy::{app::Plugins, ecs::message::MessageCursor, prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    editor::{
        ActiveRig,
        building::BuildingPlugin,
        dock::DockPlugin,
        files::{
            FilesPlugin, LoadJob, SaveJob, StateFolder,
            dialog::{Answer, Dialog, DialogAnswer, Question},
        },
        follow::FollowPlugin,
        help::HelpPlugin,
        library::LibraryFolders,
        notice::{Notice, Severity},
        palette::PalettePlugin,
        panels::PanelsPlugin,
        pointer::ViewportArea,
        screen::ScreenPlugin,
        settings::{SettingsFolder, SettingsPlugin},
        start::StartPlugin,
    },
    files::SearchPaths,
    headless::headless_app,
    test_app::strict_app,
};

use crate::bench::{AppBench, wait_with};

/// Declines offers of work that other tests left in the system's folder for temporary files, which all of them share.
pub fn decline_foreign_offers(app: &mut App) {
    app.add_systems(Last, decline);
}

fn decline(dialog: Option<Res<Dialog>>, mut commands: Commands) {
    let Some(Question::Recover(list)) = dialog.as_ref().and_then(|dialog| dialog.question()) else { return };
    let shared = std::env::temp_dir();
    if list.iter().all(|pending| pending.path.parent() == Some(shared.as_path())) {
        commands.write_message(DialogAnswer(Answer::Cancel));
    }
}

/// An app with the dock and the panels of the window, to which other plugins can be added before it is finished. Its journals
/// lie in `state`, its settings nowhere, and its library has these folders.
pub fn docked_app(state: PathBuf, folders: Vec<PathBuf>, time: TimeUpdateStrategy) -> App {
    let mut app = headless_app(7);
    app.insert_resource(time)
        .insert_resource(StateFolder(Some(state)))
        .insert_resource(SettingsFolder(None))
        .insert_resource(LibraryFolders(Some(SearchPaths { folders })))
        .init_resource::<ViewportArea>()
        .add_plugins((
            FilesPlugin,
            SettingsPlugin,
            ScreenPlugin,
            StartPlugin { file: None },
            HelpPlugin,
            PalettePlugin,
            PanelsPlugin,
            FollowPlugin,
            BuildingPlugin,
            DockPlugin,
        ))
        .add_message::<AppExit>();
    app
}

impl AppBench {
    /// An app with these plugins of the window, whose journals lie in a folder.
    pub fn with_files<M>(state: PathBuf, plugins: impl Plugins<M>) -> Self {
        let mut app = headless_app(7);
        app.insert_resource(StateFolder(Some(state))).add_plugins(plugins).add_plugins(decline_foreign_offers);
        app.add_message::<AppExit>();
        Self::bare(strict_app(app))
    }

    /// The entity of the open rig.
    pub fn open_rig(&self) -> Entity {
        self.app.world().resource::<ActiveRig>().0
    }

    /// True while a file is being read or written.
    pub fn has_file_jobs(&self) -> bool {
        let world = self.app.world();
        world.resource::<LoadJob>().name().is_some() || world.resource::<SaveJob>().name().is_some()
    }
}

/// Notices of an app since its start.
#[derive(Default)]
pub struct Notices {
    cursor: MessageCursor<Notice>,
    pub list: Vec<Notice>,
}

impl Notices {
    /// Takes over those of the last frame.
    pub fn read(&mut self, app: &App) {
        self.list.extend(self.cursor.read(app.world().resource::<Messages<Notice>>()).cloned());
    }

    /// True if there was one of this severity with this in its text.
    pub fn include(&self, severity: Severity, part: &str) -> bool {
        self.list.iter().any(|notice| notice.severity == severity && notice.text.contains(part))
    }
}

/// An app that opens and saves documents, and its notices.
pub struct WindowBench {
    pub base: AppBench,
    pub notices: Notices,
}

impl WindowBench {
    pub fn with_files<M>(state: PathBuf, plugins: impl Plugins<M>) -> Self {
        Self { base: AppBench::with_files(state, plugins), notices: Notices::default() }
    }

    pub fn world(&self) -> &World {
        self.base.app.world()
    }

    pub fn frame(&mut self) {
        self.base.app.update();
        self.notices.read(&self.base.app);
    }

    #[track_caller]
    pub fn until(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        wait_with(self, what, Self::frame, done, |window| window.notices.list.clone());
    }
}
