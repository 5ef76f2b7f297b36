//! Settings stored between runs: recent files, switches, keys and the layout of panels.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bevy::{
    prelude::*,
    tasks::{IoTaskPool, Task, block_on, futures::check_ready},
};
use serde::{Deserialize, Serialize};

use super::{
    actions::{Action, ActionRequest},
    dock::Layout,
    keys::KeyBindings,
    notice::Notice,
    panel::Panels,
};
use crate::files::{Disk, ReadError, RealDisk, SaveError, read_capped, save_atomic};

/// Plugin of the settings, their switches, and their file.
pub struct SettingsPlugin;

impl Plugin for SettingsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<EditorSettings>()
            .init_resource::<SettingsFile>()
            .add_message::<Notice>()
            .add_systems(PreStartup, read)
            .add_systems(Update, switch)
            .add_systems(Last, write);
    }
}

/// Stored switches and lists.
#[derive(Resource, Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(default)]
pub struct EditorSettings {
    /// Recently opened files, the last one first.
    pub recent: Vec<PathBuf>,
    /// Moves children along with their parent if `true`.
    pub move_children: bool,
    /// The axes of gizmos.
    pub gizmo_space: GizmoSpace,
}

/// Axes along which gizmos move, turn and scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum GizmoSpace {
    /// Axes of the world.
    #[default]
    World,
    /// Axes of the joint.
    Local,
    /// Axes of the screen.
    View,
}

impl GizmoSpace {
    /// The name on the toolbar.
    pub fn name(self) -> &'static str {
        match self {
            Self::World => "World",
            Self::Local => "Local",
            Self::View => "View",
        }
    }

    /// The next setting in the cycle.
    pub fn next(self) -> Self {
        match self {
            Self::World => Self::Local,
            Self::Local => Self::View,
            Self::View => Self::World,
        }
    }
}

impl EditorSettings {
    /// Adds a file at the top of the recent files; ten are kept.
    pub fn remember(&mut self, path: PathBuf) {
        self.recent.retain(|known| *known != path);
        self.recent.insert(0, path);
        self.recent.truncate(10);
    }
}

/// File of the settings, and whether it can be written.
#[derive(Resource)]
pub struct SettingsFile {
    disk: Arc<dyn Disk>,
    path: Option<PathBuf>,
    /// True if the file holds what could not be read, and would be lost with a save.
    refused: bool,
    /// True from a save that failed to the next one that succeeds.
    failed: bool,
    /// Text that was last saved, or found at the start.
    text: Option<String>,
    looked: Duration,
    saving: Option<Task<Result<(), SettingsError>>>,
}

impl SettingsFile {
    /// A file on a disk; without a path, settings are not kept.
    pub fn new(disk: Arc<dyn Disk>, path: Option<PathBuf>) -> Self {
        Self { disk, path, refused: false, failed: false, text: None, looked: Duration::ZERO, saving: None }
    }
}

impl Default for SettingsFile {
    fn default() -> Self {
        Self::new(Arc::new(RealDisk), folder().map(|folder| folder.join("settings.ron")))
    }
}

/// Reason why the settings are not read or not saved.
#[derive(Debug, thiserror::Error)]
enum SettingsError {
    /// The file cannot be read.
    #[error("the settings are neither read nor saved: {0}")]
    Read(#[from] ReadError),
    /// The file is no UTF-8 text.
    #[error("{}: {source}: the settings are neither read nor saved; correct or delete the file", path.display())]
    Utf8 {
        /// The file.
        path: PathBuf,
        /// Place of the wrong byte.
        source: std::string::FromUtf8Error,
    },
    /// The file holds no settings.
    #[error("{}:{source}: the settings are neither read nor saved; correct or delete the file", path.display())]
    Source {
        /// The file.
        path: PathBuf,
        /// Place and reason.
        source: ron::error::SpannedError,
    },
    /// The folder cannot be created.
    #[error("{}: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file cannot be saved.
    #[error(transparent)]
    Save(#[from] SaveError),
}

/// The content of the file.
#[derive(Serialize, Deserialize, Default)]
#[serde(default)]
struct SettingsContent {
    settings: EditorSettings,
    keys: Option<KeyBindings>,
    layout: Option<Layout>,
}

/// Largest number of bytes of settings that are read.
const MAX_BYTES: u64 = 1 << 20;
/// Interval of checks for changes while the window is in use.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Folder of the settings: `RIGSMITH_CONFIG`, or the user's configuration folder.
pub fn folder() -> Option<PathBuf> {
    let chosen = std::env::var_os("RIGSMITH_CONFIG").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    chosen.or_else(|| directories::ProjectDirs::from("", "", "rigsmith").map(|dirs| dirs.config_dir().to_owned()))
}

fn read(world: &mut World) {
    let file = world.resource::<SettingsFile>();
    let Some(path) = file.path.clone() else { return };
    match content(file.disk.as_ref(), &path) {
        Ok(None) => {}
        Ok(Some(kept)) => take(world, &path, kept),
        Err(error) => {
            world.write_message(Notice::warning(error.to_string()));
            world.resource_mut::<SettingsFile>().refused = true;
        }
    }
}

/// The content of a file; `None` if there is none yet.
fn content(disk: &dyn Disk, path: &Path) -> Result<Option<SettingsContent>, SettingsError> {
    let bytes = match read_capped(disk, path, MAX_BYTES) {
        Ok(bytes) => bytes,
        Err(ReadError::Missing { .. } | ReadError::Empty { .. }) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let text = String::from_utf8(bytes).map_err(|source| SettingsError::Utf8 { path: path.to_owned(), source })?;
    let kept = ron::from_str(&text).map_err(|source| SettingsError::Source { path: path.to_owned(), source })?;
    Ok(Some(kept))
}

fn take(world: &mut World, path: &Path, kept: SettingsContent) {
    world.insert_resource(kept.settings);
    if let Some(keys) = kept.keys {
        for chord in keys.doubles() {
            let text = format!("{}: {chord} is bound twice; the first one counts", path.display());
            world.write_message(Notice::warning(text));
        }
        world.insert_resource(keys);
    }
    if let Some(mut layout) = kept.layout {
        let titles: Vec<&'static str> = world
            .get_resource::<Panels>()
            .map(|panels| panels.panels.iter().map(|panel| panel.title()).collect())
            .unwrap_or_default();
        layout.repair(&titles);
        world.insert_resource(layout);
    }
}

fn switch(mut actions: MessageReader<ActionRequest>, mut settings: ResMut<EditorSettings>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::MoveChildren => settings.move_children = !settings.move_children,
            Action::GizmoSpace => settings.gizmo_space = settings.gizmo_space.next(),
            _ => {}
        }
    }
}

/// Saves changed settings, at most once a second, and at once when the window closes.
fn write(
    mut file: ResMut<SettingsFile>,
    settings: Res<EditorSettings>,
    keys: Res<KeyBindings>,
    layout: Option<Res<Layout>>,
    time: Res<Time<Real>>,
    exits: MessageReader<AppExit>,
    mut notices: MessageWriter<Notice>,
) {
    let file = file.bypass_change_detection();
    let closing = !exits.is_empty();
    let result =
        |task: &mut Task<Result<(), SettingsError>>| if closing { Some(block_on(task)) } else { check_ready(task) };
    if let Some(result) = file.saving.as_mut().and_then(result) {
        file.saving = None;
        let failed = std::mem::replace(&mut file.failed, result.is_err());
        if let (Err(reason), false) = (result, failed) {
            notices.write(Notice::warning(format!("Settings are not kept: {reason}")));
        }
    }
    if !closing && time.elapsed().saturating_sub(file.looked) < LOOK_EVERY {
        return;
    }
    file.looked = time.elapsed();
    let Some(path) = file.path.clone().filter(|_| !file.refused && file.saving.is_none()) else { return };
    let keys = (*keys != KeyBindings::default()).then(|| keys.clone());
    let kept = SettingsContent { settings: settings.clone(), keys, layout: layout.map(|layout| layout.clone()) };
    // A frame may move panels without any event, so a change is only visible in the text.
    let Ok(text) = ron::ser::to_string_pretty(&kept, ron::ser::PrettyConfig::default()) else { return };
    if file.text.as_ref() == Some(&text) && !file.failed {
        return;
    }
    let first = file.text.replace(text.clone()).is_none();
    if first && !closing {
        return;
    }
    if closing {
        if let Err(reason) = save(file.disk.as_ref(), &path, &text) {
            warn!("settings are not kept: {reason}");
        }
    } else {
        let disk = file.disk.clone();
        file.saving = Some(IoTaskPool::get().spawn(async move { save(disk.as_ref(), &path, &text) }));
    }
}

/// Saves a text of settings; the folder is created if it is missing.
fn save(disk: &dyn Disk, path: &Path, text: &str) -> Result<(), SettingsError> {
    if let Some(folder) = path.parent() {
        let refused = |source| SettingsError::Folder { folder: folder.to_owned(), source };
        disk.create_folder(folder).map_err(refused)?;
    }
    Ok(save_atomic(disk, path, text.as_bytes())?)
}
