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
    files::attend,
    help::describe,
    keys::{DoubleBinding, KeyBindings},
    notice::Notice,
    panel::Panels,
    panels::log::LogSystems,
    style::{Look, WindowTheme},
};
use crate::files::{Disk, ReadError, RealDisk, SaveError, read_capped, save_atomic};

/// Plugin of the settings, their switches, and their file.
pub struct SettingsPlugin;

impl Plugin for SettingsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<EditorSettings>()
            .init_resource::<SettingsFolder>()
            .init_resource::<SettingsFile>()
            .init_resource::<KeyBindings>()
            .add_message::<ActionRequest>()
            .add_message::<Notice>()
            .add_systems(PreStartup, read)
            .add_systems(Update, switch.before(attend))
            .add_systems(Last, write.before(LogSystems));
    }
}

/// Stored switches and lists.
#[derive(Resource, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EditorSettings {
    /// Recently opened files, the last one first.
    pub recent: Vec<PathBuf>,
    /// Moves children along with their parent if `true`.
    pub move_children: bool,
    /// The axes of gizmos.
    pub gizmo_space: GizmoSpace,
    /// Size of the interface; 1 is that of the system.
    pub ui_scale: f32,
    /// Dark or light.
    pub theme: WindowTheme,
    /// Shows text and lines with high contrast if `true`.
    pub high_contrast: bool,
}

impl Default for EditorSettings {
    fn default() -> Self {
        Self {
            recent: Vec::new(),
            move_children: false,
            gizmo_space: GizmoSpace::default(),
            ui_scale: 1.0,
            theme: WindowTheme::default(),
            high_contrast: false,
        }
    }
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

/// Sizes of the interface, as factors of the system's size.
pub static UI_SCALES: [f32; 9] = [0.75, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5];

impl EditorSettings {
    /// The largest number of recent files.
    pub const RECENT: usize = 12;

    /// Adds a file at the top of the recent files.
    pub fn remember(&mut self, path: PathBuf) {
        self.forget(&path);
        self.recent.insert(0, path);
        self.recent.truncate(Self::RECENT);
    }

    /// Removes a file from the recent files.
    pub fn forget(&mut self, path: &Path) {
        self.recent.retain(|known| known != path);
    }

    /// The look of the window.
    pub fn look(&self) -> Look {
        Look { theme: self.theme, high_contrast: self.high_contrast }
    }

    /// Makes the interface larger by a step, or smaller.
    fn step_scale(&mut self, larger: bool) {
        let now = self.ui_scale;
        let next = if larger {
            UI_SCALES.iter().find(|scale| **scale > now + 1e-3)
        } else {
            UI_SCALES.iter().rfind(|scale| **scale < now - 1e-3)
        };
        self.ui_scale = next.copied().unwrap_or(now);
    }

    /// Corrects values from a file that make no sense.
    fn repair(&mut self) {
        let [least, .., most] = UI_SCALES;
        self.ui_scale = if self.ui_scale.is_finite() { self.ui_scale.clamp(least, most) } else { 1.0 };
        self.recent.truncate(Self::RECENT);
    }
}

/// Folder of the settings; without one they are not stored.
#[derive(Resource, Debug, Clone, PartialEq, Eq)]
pub struct SettingsFolder(pub Option<PathBuf>);

impl Default for SettingsFolder {
    /// `RIGSMITH_CONFIG`, or the user's configuration folder.
    fn default() -> Self {
        let chosen = std::env::var_os("RIGSMITH_CONFIG").filter(|folder| !folder.is_empty()).map(PathBuf::from);
        Self(
            chosen.or_else(|| {
                directories::ProjectDirs::from("", "", "rigsmith").map(|dirs| dirs.config_dir().to_owned())
            }),
        )
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
    /// Settings and keys of the first frame, as text.
    start: Option<String>,
    /// Text that was last saved, or found at the first look.
    text: Option<String>,
    looked: Duration,
    saving: Option<Task<Result<(), SettingsError>>>,
}

impl SettingsFile {
    /// A file on a disk; without a path, the file is in the [`SettingsFolder`].
    pub fn new(disk: Arc<dyn Disk>, path: Option<PathBuf>) -> Self {
        Self {
            disk,
            path,
            refused: false,
            failed: false,
            start: None,
            text: None,
            looked: Duration::ZERO,
            saving: None,
        }
    }

    /// The file; `None` where settings are not stored.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }
}

impl Default for SettingsFile {
    fn default() -> Self {
        Self::new(Arc::new(RealDisk), None)
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

fn read(world: &mut World) {
    let folder = world.resource::<SettingsFolder>().0.clone();
    let mut file = world.resource_mut::<SettingsFile>();
    file.path = file.path.take().or_else(|| folder.map(|folder| folder.join("settings.ron")));
    let Some(path) = file.path.clone() else { return };
    let disk = file.disk.clone();
    match content(disk.as_ref(), &path) {
        Ok(None) => {}
        Ok(Some(kept)) => take(world, &path, kept),
        Err(error) => {
            world.write_message(Notice::warning(error.to_string()));
            // A file with manual edits is not overwritten.
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

fn take(world: &mut World, path: &Path, mut kept: SettingsContent) {
    kept.settings.repair();
    world.insert_resource(kept.settings);
    if let Some(mut keys) = kept.keys {
        for DoubleBinding { chord, kept, refused } in keys.refuse_doubles() {
            let text = format!(
                "{}: {chord} is bound to \"{}\" and not to \"{}\" as well; bind one of them to another key",
                path.display(),
                describe(kept),
                describe(refused)
            );
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

pub(super) fn switch(mut actions: MessageReader<ActionRequest>, mut settings: ResMut<EditorSettings>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::MoveChildren => settings.move_children = !settings.move_children,
            Action::GizmoSpace => settings.gizmo_space = settings.gizmo_space.next(),
            Action::UiLarger => settings.step_scale(true),
            Action::UiSmaller => settings.step_scale(false),
            Action::UiUsual => settings.ui_scale = 1.0,
            Action::Theme => settings.theme = settings.theme.other(),
            Action::Contrast => settings.high_contrast = !settings.high_contrast,
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
    mut commands: Commands,
) {
    let file = file.bypass_change_detection();
    let closing = !exits.is_empty();
    let result =
        |task: &mut Task<Result<(), SettingsError>>| if closing { Some(block_on(task)) } else { check_ready(task) };
    if let Some(result) = file.saving.as_mut().and_then(result) {
        file.saving = None;
        let failed = std::mem::replace(&mut file.failed, result.is_err());
        if let (Err(reason), false) = (result, failed) {
            commands.write_message(Notice::warning(format!("Settings are not kept: {reason}")));
        }
    }
    let text_of = |layout| {
        let keys = (*keys != KeyBindings::default()).then(|| keys.clone());
        let kept = SettingsContent { settings: settings.clone(), keys, layout };
        ron::ser::to_string_pretty(&kept, ron::ser::PrettyConfig::default()).ok()
    };
    if file.start.is_none() {
        file.start = text_of(None);
    }
    if !closing && time.elapsed().saturating_sub(file.looked) < LOOK_EVERY {
        return;
    }
    file.looked = time.elapsed();
    let Some(path) = file.path.clone().filter(|_| !file.refused && file.saving.is_none()) else { return };
    // A frame may move panels without any event, so a change is only visible in the text.
    let Some(text) = text_of(layout.map(|layout| layout.clone())) else { return };
    if file.text.as_ref() == Some(&text) && !file.failed {
        return;
    }
    let first = file.text.replace(text.clone()).is_none();
    // The first frames move panels by themselves; settings and keys that have changed by then were changed by somebody.
    if first && !closing && file.start == text_of(None) {
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
