//! Pictures of a rigged character, without a window and without an interface.
//!
//! [`take_picture`] runs an app of its own: the same plugins that draw in the window draw into an image.

use std::time::{Duration, Instant};

use bevy::{
    app::PluginGroupBuilder,
    camera::RenderTarget,
    log::LogPlugin,
    prelude::*,
    render::{
        RenderPlugin,
        pipelined_rendering::PipelinedRenderingPlugin,
        render_resource::TextureFormat,
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
    window::ExitCondition,
};

use crate::{
    algo::view::View,
    plugins::{
        RigPlugins,
        display::{DisplayJob, DisplayPlugin, MeshDisplay, ViewportLights},
        document::{RigBundle, Selection, Symmetry},
        drawing::{BACKGROUND, DrawingPlugin, RigDrawing},
        surface::{RigMesh, RigSurface, SkinOf},
        task_pools,
        viewport::{FIELD_OF_VIEW, RigViewport, framing},
    },
    rig::{Rig, Uid},
};

/// What a picture shows, and how.
#[derive(Debug, Clone)]
pub struct PictureSettings {
    /// Width and height in pixels.
    pub size: UVec2,
    /// From where.
    pub view: View,
    /// True for a picture without perspective.
    pub orthographic: bool,
    /// How the mesh is shown.
    pub display: MeshDisplay,
    /// What is drawn of the rig, and the grid.
    pub drawing: RigDrawing,
    /// Joints that are shown as selected; the last one is the active one.
    pub selected: Vec<Uid>,
    /// What is behind everything.
    pub background: Color,
    /// Least and greatest corner of the box that fills the picture, in the rig's space; all there is if `None`.
    pub bounds: Option<[Vec3; 2]>,
}

impl Default for PictureSettings {
    fn default() -> Self {
        Self {
            size: UVec2::new(1280, 720),
            view: View::Front,
            orthographic: false,
            display: MeshDisplay::default(),
            drawing: RigDrawing::default(),
            selected: Vec::new(),
            background: BACKGROUND,
            bounds: None,
        }
    }
}

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// No graphics adapter.
    #[error(
        "there is no graphics adapter, not even a software one; install a Vulkan driver (Debian: mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// The size makes no picture.
    #[error("a picture of {0} x {1} pixels cannot be made; choose 1 to {MAX_SIZE} for both")]
    Size(u32, u32),
    /// It took too long.
    #[error("the renderer did not finish within {0} seconds; try a smaller picture or mesh")]
    Late(u64),
    /// The picture came back in a form that cannot be saved.
    #[error("the renderer's picture cannot be encoded: {0}")]
    Encode(String),
}

/// Widest and highest picture, in pixels.
pub const MAX_SIZE: u32 = 8192;

/// How long a picture may take.
const LIMIT: Duration = Duration::from_secs(300);

/// Frames drawn after everything has arrived: what a frame changes is seen in the next one, and uploads take one more.
const SETTLE: usize = 4;

/// Takes a picture of a rig with its meshes as the rig's pose holds them. The same input gives the same picture on the
/// same adapter.
///
/// # Errors
/// See [`PictureError`].
pub fn take_picture(rig: Rig, meshes: Vec<RigMesh>, settings: &PictureSettings) -> Result<Image, PictureError> {
    let UVec2 { x: width, y: height } = settings.size;
    if !(1..=MAX_SIZE).contains(&width) || !(1..=MAX_SIZE).contains(&height) {
        return Err(PictureError::Size(width, height));
    }
    if adapter().is_none() {
        return Err(PictureError::NoAdapter);
    }
    let mut app = App::new();
    app.add_plugins((bevy_plugins(), RigPlugins, DisplayPlugin, DrawingPlugin))
        .insert_resource(settings.display)
        .insert_resource(settings.drawing.clone())
        .insert_resource(ClearColor(settings.background))
        .init_resource::<Taken>();
    app.finish();
    app.cleanup();

    let world = app.world_mut();
    let has_mesh = !meshes.is_empty();
    let bundle =
        RigBundle { rig, selection: Selection(settings.selected.clone()), symmetry: Symmetry(None), ..default() };
    let entity = world.spawn(bundle).id();
    for mesh in meshes {
        world.spawn((mesh, SkinOf(entity)));
    }
    let target = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
    let target = world.resource_mut::<Assets<Image>>().add(target);
    let camera = world
        .spawn((
            Camera3d::default(),
            RenderTarget::from(target.clone()),
            RigViewport::default(),
            ViewportLights::default().bundle(),
        ))
        .id();

    let deadline = Instant::now() + LIMIT;
    let late = || PictureError::Late(LIMIT.as_secs());
    // The surface says how large the posed mesh is.
    loop {
        app.update();
        let world = app.world_mut();
        let loading = world.query::<&DisplayJob>().iter(world).next().is_some();
        let surface = world.get::<RigSurface>(entity);
        let surface = !has_mesh || surface.is_some_and(|surface| surface.ready().is_some() && !surface.is_stale());
        if surface && !loading {
            break;
        }
        if Instant::now() > deadline {
            return Err(late());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    aim(app.world_mut(), entity, camera, settings);
    for _ in 0..SETTLE {
        app.update();
    }
    app.world_mut()
        .spawn(Screenshot::image(target))
        .observe(|shot: On<ScreenshotCaptured>, mut taken: ResMut<Taken>| taken.0 = Some(shot.image.clone()));
    while Instant::now() < deadline {
        app.update();
        if let Some(image) = app.world_mut().resource_mut::<Taken>().0.take() {
            return Ok(image);
        }
    }
    Err(late())
}

/// A picture as the bytes of a PNG file, without transparency.
///
/// # Errors
/// If the picture's format cannot be encoded.
pub fn png(image: Image) -> Result<Vec<u8>, PictureError> {
    let encode = |error: String| PictureError::Encode(error);
    let picture = image.try_into_dynamic().map_err(|error| encode(error.to_string()))?.to_rgb8();
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).map_err(|error| encode(error.to_string()))?;
    Ok(bytes.into_inner())
}

/// What there is to draw with: the adapter's name, and whether it is a program. `None` if there is nothing.
pub fn adapter() -> Option<(String, bool)> {
    let backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::all());
    let descriptor = wgpu::InstanceDescriptor { backends, ..wgpu::InstanceDescriptor::new_without_display_handle() };
    let instance = wgpu::Instance::new(descriptor);
    let adapters = bevy::tasks::block_on(instance.enumerate_adapters(backends));
    let mut list: Vec<(String, bool)> = adapters
        .iter()
        .map(|adapter| adapter.get_info())
        .map(|info| (info.name.clone(), info.device_type == wgpu::DeviceType::Cpu))
        .collect();
    list.sort_by_key(|(_, software)| *software);
    list.into_iter().next()
}

/// Bevy's own plugins for drawing without a window.
pub fn bevy_plugins() -> PluginGroupBuilder {
    let plugins = DefaultPlugins
        .set(task_pools())
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
        .disable::<LogPlugin>()
        .disable::<PipelinedRenderingPlugin>();
    #[cfg(feature = "editor")]
    let plugins = plugins.disable::<bevy::winit::WinitPlugin>();
    plugins
}

/// The picture, once it has come back.
#[derive(Resource, Default)]
struct Taken(Option<Image>);

/// Points the camera so that everything is seen.
fn aim(world: &mut World, rig: Entity, camera: Entity, settings: &PictureSettings) {
    let bounds = match (settings.bounds, world.get::<RigSurface>(rig), world.get::<Rig>(rig)) {
        (Some(bounds), ..) => bounds,
        (None, Some(surface), _) => surface.bounds(),
        (None, None, Some(rig)) if !rig.is_empty() => {
            // Bones of last joints reach about as far beyond them as those before.
            let places = rig.walk().flat_map(|joint| {
                let place = rig.position(joint.data.uid);
                let above = joint.parent.filter(|_| joint.children.is_empty()).map(|parent| rig.position(parent));
                [place, above.map_or(place, |above| place + 0.4 * (place - above))]
            });
            places.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
        }
        _ => [Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5)],
    };
    let [right, up, towards] = settings.view.axes();
    let aspect = settings.size.x as f32 / settings.size.y as f32;
    let (focus, distance) = framing(bounds, [right, up, towards], aspect);
    let projection = if settings.orthographic {
        Projection::Orthographic(OrthographicProjection {
            scaling_mode: bevy::camera::ScalingMode::FixedVertical {
                viewport_height: 2.0 * distance * bevy::math::ops::tan(FIELD_OF_VIEW * 0.5),
            },
            far: 4.0 * distance,
            ..OrthographicProjection::default_3d()
        })
    } else {
        let near = (distance * 0.01).clamp(1e-5, 0.1);
        Projection::Perspective(PerspectiveProjection { fov: FIELD_OF_VIEW, near, far: near * 1e6, ..default() })
    };
    let rotation = Quat::from_mat3(&Mat3::from_cols(right, up, towards));
    let place = Transform { translation: focus + towards * distance, rotation, ..default() };
    world.entity_mut(camera).insert((place, projection, RigViewport { focus: distance }));
}
