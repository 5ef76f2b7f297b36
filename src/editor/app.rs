//! The window: its plugins, and the errors of opening it.

use std::{path::PathBuf, time::Duration};

use bevy::{
    asset::UnapprovedPathMode,
    camera::{CameraOutputMode, visibility::RenderLayers},
    ecs::system::SystemParam,
    prelude::*,
    render::{RenderPlugin, renderer::RenderAdapterInfo, settings::RenderCreation},
    window::{ExitCondition, RequestRedraw, WindowEvent, WindowResolution},
    winit::{EventLoopProxyWrapper, UpdateMode, WinitSettings, WinitUserEvent},
};
use bevy_egui::{
    EguiGlobalSettings, EguiInput, EguiPlugin, EguiPreUpdateSet, PrimaryEguiContext,
    egui::{Event, Modifiers},
};
use wgpu::BlendState;

use super::tools::stroke::StrokeTool;
use super::{
    camera::CameraPlugin,
    control_density::ControlDensityPlugin,
    dock::DockPlugin,
    files::{FilesPlugin, LoadJob},
    help::HelpPlugin,
    keys::KeysPlugin,
    labels::LabelsPlugin,
    mode::Mode,
    notice::{Notice, StatusLine},
    pointer::PointerPlugin,
    probe::DisplayError,
    report::ReportPlugin,
    screen::ScreenPlugin,
    settings::SettingsPlugin,
    start::StartPlugin,
};
use crate::instance::RigTemplates;
use crate::plugins::{
    RigPlugins,
    controls::size::MeasuredShapes,
    display::{DisplayJob, DisplayPlugin},
    document::EditReport,
    drawing::DrawingPlugin,
    face::{FacePosing, FacePreparation},
    fit::FitJob,
    limits::RigLimits,
    painting::{CanvasJob, WeightChangeJob},
    skinning::SkinningJob,
    surface::RigSurface,
    task_pools,
};

/// Options of opening the window.
#[derive(Debug, Clone, Default)]
pub struct EditorOptions {
    /// The file to open; the start page without one.
    pub file: Option<PathBuf>,
    /// Limits of what is opened, imported, built and computed.
    pub limits: RigLimits,
    /// Remote control.
    #[cfg(feature = "remote")]
    pub remote: Option<crate::remote::RemotePlugin>,
}

/// Error of opening the window, in one line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoWindow {
    /// The system offers no display.
    #[error("there is no display to open a window on ({0})")]
    Display(#[from] DisplayError),
    /// The system offers no graphics adapter.
    #[error(
        "there is no graphics adapter, not even a software one; install a Vulkan driver (Debian: mesa-vulkan-drivers)"
    )]
    Adapter,
    /// The window system refused the window.
    #[error("the window could not be opened: {0}")]
    Refused(String),
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// If there is no display or no adapter; nothing has been changed then, and the work can be done without a window.
pub fn run(options: EditorOptions) -> Result<AppExit, NoWindow> {
    super::probe::display()?;
    if crate::render::adapter().is_none() {
        return Err(NoWindow::Adapter);
    }
    // The event loop is created while plugins are built; if the display refuses it, Bevy panics.
    let built = std::panic::catch_unwind(|| {
        let mut app = App::new();
        app.add_plugins(EditorPlugin { options });
        app
    });
    match built {
        Ok(mut app) => Ok(app.run()),
        Err(cause) => {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or_else(|| cause.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            Err(NoWindow::Refused(text.unwrap_or_else(|| "the window system gave no reason".to_owned())))
        }
    }
}

/// The plugins of the window, Bevy's own included.
pub struct EditorPlugin {
    /// Options of the window.
    pub options: EditorOptions,
}

impl Plugin for EditorPlugin {
    fn build(&self, app: &mut App) {
        let window = Window {
            title: "Rigsmith".to_owned(),
            name: Some("rigsmith".to_owned()),
            resolution: WindowResolution::new(1280, 720),
            ..default()
        };
        app.add_plugins(
            DefaultPlugins
                .set(WindowPlugin {
                    primary_window: Some(window),
                    exit_condition: ExitCondition::OnPrimaryClosed,
                    close_when_requested: false,
                    ..default()
                })
                .set(task_pools())
                .set(RenderPlugin { render_creation: RenderCreation::Automatic(Box::default()), ..default() })
                .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Deny, ..default() }),
        )
        .add_plugins(EguiPlugin::default())
        .add_plugins((RigPlugins, DisplayPlugin, DrawingPlugin))
        .add_plugins(super::panels::PanelsPlugin)
        .add_plugins((
            (super::tools::ToolsPlugin, super::actions::ActionsPlugin),
            SettingsPlugin,
            (KeysPlugin, PointerPlugin),
            DockPlugin,
            (CameraPlugin, ControlDensityPlugin),
            ScreenPlugin,
            (HelpPlugin, super::palette::PalettePlugin, StartPlugin { file: self.options.file.clone() }),
            LabelsPlugin,
            ReportPlugin,
            FilesPlugin,
            super::building::BuildingPlugin,
            (super::fitting::FittingPlugin, super::mesh_watch::MeshWatchPlugin),
            (super::typing::TypingPlugin, super::clicks::ClicksPlugin),
            (super::follow::FollowPlugin, super::folder_watch::FolderWatchPlugin),
            super::render_errors::RenderErrorsPlugin,
        ))
        .insert_resource(WinitSettings {
            focused_mode: UpdateMode::reactive_low_power(Duration::from_secs(60)),
            unfocused_mode: UpdateMode::reactive_low_power(Duration::from_secs(60)),
        })
        .insert_resource(self.options.limits.clone())
        .init_resource::<Mode>()
        .init_resource::<StatusLine>()
        .add_message::<Notice>()
        .add_systems(Startup, (spawn_interface, say_adapter, wake_for_templates))
        .add_systems(
            PreUpdate,
            drop_old_modifiers.after(EguiPreUpdateSet::ProcessInput).before(super::clicks::hold_back),
        )
        .add_systems(Last, keep_drawing);
        #[cfg(feature = "remote")]
        if let Some(remote) = &self.options.remote {
            app.add_plugins(remote.clone()).add_systems(Startup, wake_for_calls);
        }
    }
}

/// Spawns the camera that draws the panels: above the other cameras, without a scene of its own.
fn spawn_interface(mut commands: Commands, mut settings: ResMut<EguiGlobalSettings>) {
    settings.auto_create_primary_context = false;
    commands.spawn((
        PrimaryEguiContext,
        super::typing::context_settings(),
        Camera2d,
        RenderLayers::none(),
        Camera {
            order: 100,
            output_mode: CameraOutputMode::Write {
                blend_state: Some(BlendState::ALPHA_BLENDING),
                clear_color: ClearColorConfig::None,
            },
            clear_color: ClearColorConfig::Custom(Color::NONE),
            ..default()
        },
    ));
}

/// Function that wakes the window, which sleeps while nothing happens.
fn waker(proxy: &EventLoopProxyWrapper) -> impl Fn() + Send + Sync + 'static {
    let proxy = (**proxy).clone();
    move || {
        // The window may have been closed.
        let _ = proxy.send_event(WinitUserEvent::WakeUp);
    }
}

/// Lets calls of remote control wake the window.
#[cfg(feature = "remote")]
fn wake_for_calls(server: Res<crate::remote::RemoteServer>, proxy: Res<EventLoopProxyWrapper>) {
    server.set_wake(waker(&proxy));
}

/// Lets files of templates that have changed wake the window.
fn wake_for_templates(templates: Res<RigTemplates>, proxy: Res<EventLoopProxyWrapper>) {
    templates.set_wake(waker(&proxy));
}

/// Sends a notice if a software renderer draws instead of a graphics card.
fn say_adapter(adapter: Option<Res<RenderAdapterInfo>>, mut notices: MessageWriter<Notice>) {
    let Some(adapter) = adapter else { return };
    if adapter.device_type == wgpu::DeviceType::Cpu {
        notices
            .write(Notice::info(format!("No graphics card: drawing in software ({}), which is slower", adapter.name)));
    }
}

/// Time that the window keeps drawing after the last event: the effect of a click appears some frames after it, and
/// panels fold and scroll that long.
const AFTERGLOW: Duration = Duration::from_millis(600);

/// Number of frames drawn after the last event if frames take long: panels are laid out, the viewport follows them, the
/// camera follows the viewport, and the skeleton is drawn again for it.
const AFTER_FRAMES: u32 = 8;

/// Drops unchanged modifier events. Panels receive Shift, Ctrl and Alt before every frame and draw another frame after
/// any event; without this filter the window would never sleep.
fn drop_old_modifiers(mut inputs: Query<&mut EguiInput>, mut last: Local<Option<Modifiers>>) {
    for mut input in &mut inputs {
        input.events.retain(|event| match event {
            Event::ModifiersChanged(modifiers) => last.replace(*modifiers) != Some(*modifiers),
            _ => true,
        });
    }
}

/// Background work on meshes.
#[derive(SystemParam)]
struct RunningJobs<'w, 's> {
    skinning: Query<'w, 's, &'static SkinningJob>,
    fits: Query<'w, 's, &'static FitJob>,
    changes: Query<'w, 's, &'static WeightChangeJob>,
    pictures: Query<'w, 's, (), Or<(With<DisplayJob>, With<CanvasJob>, With<FacePreparation>)>>,
    faces: Query<'w, 's, &'static FacePosing>,
}

impl RunningJobs<'_, '_> {
    /// True while something is computed. Results that wait for an undone step come with the event that brings it back.
    fn are_any(&self) -> bool {
        !self.pictures.is_empty()
            || self.faces.iter().any(FacePosing::is_running)
            || self.skinning.iter().any(|job| !job.waits())
            || self.fits.iter().any(|job| !job.waits())
            || self.changes.iter().any(|job| !job.waits())
    }
}

/// Keeps the window drawing after an event and while background work runs; otherwise it sleeps until the next event.
fn keep_drawing(
    mut events: MessageReader<WindowEvent>,
    mut edited: MessageReader<EditReport>,
    mut notices: MessageReader<Notice>,
    loading: Res<LoadJob>,
    jobs: RunningJobs,
    surfaces: Query<&RigSurface>,
    shapes: Query<&MeasuredShapes>,
    stroke: Res<StrokeTool>,
    time: Res<Time<Real>>,
    mut last: Local<(Duration, u32)>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    let happened = events.read().any(|event| !matches!(event, WindowEvent::RequestRedraw(_)));
    let told = edited.read().count() + notices.read().count() > 0;
    let surface = surfaces.iter().any(|surface| surface.is_stale() || surface.ready().is_none());
    let busy = loading.name().is_some()
        || jobs.are_any()
        || surface
        || stroke.is_busy()
        || shapes.iter().any(MeasuredShapes::is_busy);
    if happened || told || busy {
        trace!("drawing on: events {happened}, notices {told}, background {busy}");
        *last = (time.elapsed(), 0);
    }
    last.1 = last.1.saturating_add(1);
    if last.1 <= AFTER_FRAMES || time.elapsed().saturating_sub(last.0) <= AFTERGLOW {
        redraw.write(RequestRedraw);
    }
}
