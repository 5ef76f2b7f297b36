//! Pictures of a rigged character, without a window and without an interface.
//!
//! [`take_picture`] runs an app of its own: the same plugins that draw in the window draw into an image.

use std::{
    sync::OnceLock,
    time::{Duration, Instant},
};

use bevy::{
    app::PluginGroupBuilder,
    camera::RenderTarget,
    ecs::system::SystemState,
    log::LogPlugin,
    prelude::*,
    render::{
        RenderPlugin,
        pipelined_rendering::PipelinedRenderingPlugin,
        render_resource::TextureFormat,
        settings::{RenderCreation, WgpuSettings},
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
    time::TimeUpdateStrategy,
    window::ExitCondition,
};

use crate::{
    algo::view::View,
    plugins::{
        RigPlugins,
        commands::{BuildRequest, BuildStep},
        controls::{outline::ControlNodes, size::MeasuredShapes},
        display::{DisplayJob, DisplayPlugin, MeshDisplay, ViewportLights},
        document::EditRequest,
        document::Selection,
        drawing::{BACKGROUND, DrawingPlugin, RigDrawing},
        runtime::RigRuntime,
        schema::RigNodes,
        surface::{RigMesh, RigSurface, SkinOf},
        task_pools,
        viewport::{FIELD_OF_VIEW, RigViewport, framing},
    },
    rig::{Rig, RigEdit, Uid, operations::Operation},
    solve::program::RigState,
};

/// Settings of a picture.
#[derive(Debug, Clone)]
pub struct PictureSettings {
    /// Width and height in pixels.
    pub size: UVec2,
    /// Direction of the camera.
    pub view: View,
    /// Rotation from the axes that the view is about (Y up, facing +Z) to those of the character.
    pub turn: Quat,
    /// Orthographic projection if `true`.
    pub orthographic: bool,
    /// Display of the mesh.
    pub display: MeshDisplay,
    /// Drawing of the rig, and of the grid.
    pub drawing: RigDrawing,
    /// Joints shown as selected; the last one is the active one.
    pub selected: Vec<Uid>,
    /// Colour of the background.
    pub background: Color,
    /// True to build the rig and let it run before the picture is taken: controls are shown then.
    pub build: bool,
    /// Blend of the joints of a point.
    pub deform: Deform,
    /// State of the built rig in the picture, springs included. `None`, or a state of another program: the pose at rest.
    pub state: Option<RigState>,
    /// Least and greatest corner of the box that fills the picture, in the rig's space; the whole character, with the controls that
    /// are drawn, if `None`.
    pub bounds: Option<[Vec3; 2]>,
}

impl Default for PictureSettings {
    fn default() -> Self {
        Self {
            size: UVec2::new(1280, 720),
            view: View::Front,
            turn: Quat::IDENTITY,
            orthographic: false,
            display: MeshDisplay::default(),
            drawing: RigDrawing::default(),
            selected: Vec::new(),
            background: BACKGROUND,
            build: false,
            deform: Deform::default(),
            state: None,
            bounds: None,
        }
    }
}

/// Blend of the motions of the joints that move a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Deform {
    /// Linear blend skinning: what the window, exports and most engines do.
    #[default]
    Linear,
    /// Dual quaternion skinning: what an engine with it shows.
    DualQuaternion,
}

/// Error of taking a picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// No graphics adapter is available.
    #[error(
        "there is no graphics adapter, not even a software one; install a Vulkan driver (Debian: mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// The size is zero or too large.
    #[error("a picture of {0} x {1} pixels cannot be made; choose 1 to {MAX_SIZE} for both")]
    Size(u32, u32),
    /// The renderer did not finish in time.
    #[error("the renderer did not finish within {0} seconds; try a smaller picture or mesh")]
    Late(u64),
    /// The picture has a format that cannot be saved.
    #[error("the renderer's picture cannot be encoded: {0}")]
    Encode(String),
}

/// Largest width and height of a picture, in pixels.
pub const MAX_SIZE: u32 = 8192;

/// Time limit of a picture.
const LIMIT: Duration = Duration::from_secs(300);

/// Number of frames drawn after everything has loaded: a change of one frame appears in the next one, and uploads take
/// one more.
const SETTLE: usize = 4;

/// Takes a picture of a rig with its meshes in the rig's pose. The same input gives the same picture on the same
/// adapter.
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
        // No time passes in a picture, so that springs stand where they are on every machine.
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO))
        .init_resource::<CapturedPicture>();
    app.finish();
    app.cleanup();

    let world = app.world_mut();
    let has_mesh = !meshes.is_empty();
    let bundle = (rig, Selection(settings.selected.clone()));
    let entity = world.spawn(bundle).id();
    for mesh in meshes {
        world.spawn((mesh, SkinOf(entity)));
    }
    if settings.build {
        world.write_message(BuildRequest { rig: entity, step: BuildStep::All });
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
    // The surface gives the size of the posed mesh.
    let settle = |app: &mut App| loop {
        app.update();
        let world = app.world_mut();
        let loading = world.query::<&DisplayJob>().iter(world).next().is_some();
        let surface = world.get::<RigSurface>(entity);
        let surface = !has_mesh || surface.is_some_and(|surface| surface.ready().is_some() && !surface.is_stale());
        let measuring = world.get::<MeasuredShapes>(entity).is_some_and(MeasuredShapes::is_busy);
        if surface && !loading && !measuring {
            return Ok(());
        }
        if Instant::now() > deadline {
            return Err(late());
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    settle(&mut app)?;
    if let Some(state) = &settings.state
        && let Some(mut runtime) = app.world_mut().get_mut::<RigRuntime>(entity)
        && runtime.go_on_from(state)
    {
        app.update();
        settle(&mut app)?;
    }
    if has_mesh && settings.deform == Deform::DualQuaternion {
        freeze_dual(app.world_mut(), entity);
        settle(&mut app)?;
    }
    aim(app.world_mut(), entity, camera, settings);
    for _ in 0..SETTLE {
        app.update();
    }
    app.world_mut()
        .spawn(Screenshot::image(target))
        .observe(|shot: On<ScreenshotCaptured>, mut taken: ResMut<CapturedPicture>| taken.0 = Some(shot.image.clone()));
    while Instant::now() < deadline {
        app.update();
        if let Some(image) = app.world_mut().resource_mut::<CapturedPicture>().0.take() {
            return Ok(image);
        }
    }
    Err(late())
}

/// Replaces the meshes of a rig by what dual quaternions make of them in the present pose.
fn freeze_dual(world: &mut World, rig: Entity) {
    let Some(models) = world.get::<RigSurface>(rig).map(RigSurface::dual_quaternion_models) else { return };
    let mut meshes: Vec<(Uid, Entity)> =
        world.query::<(Entity, &RigMesh)>().iter(world).map(|(entity, mesh)| (mesh.uid, entity)).collect();
    meshes.sort_unstable();
    let mut edits = Vec::new();
    for ((uid, entity), model) in meshes.into_iter().zip(models) {
        edits.push(RigEdit::SetSkin(uid, None));
        world.entity_mut(entity).insert(RigMesh::new(uid, model, Vec::new()));
    }
    world.write_message(EditRequest::operation(rig, Operation::Edits(edits)));
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

/// Name of the graphics adapter, and whether it is a software renderer. `None` without an adapter.
pub fn adapter() -> Option<(String, bool)> {
    let mut list: Vec<(String, bool)> =
        adapters(backends()).into_iter().map(|info| (info.name, info.device_type == wgpu::DeviceType::Cpu)).collect();
    list.sort_by_key(|(_, software)| *software);
    list.into_iter().next()
}

/// Interfaces that pictures are drawn through: those that `WGPU_BACKEND` names, else the system's own ones.
///
/// OpenGL serves only where there is no other: a search for it complains on standard error where there is no display.
fn backends() -> wgpu::Backends {
    static FOUND: OnceLock<wgpu::Backends> = OnceLock::new();
    *FOUND.get_or_init(|| {
        let native = || {
            if adapters(wgpu::Backends::PRIMARY).is_empty() { wgpu::Backends::all() } else { wgpu::Backends::PRIMARY }
        };
        wgpu::Backends::from_env().unwrap_or_else(native)
    })
}

fn adapters(backends: wgpu::Backends) -> Vec<wgpu::AdapterInfo> {
    let descriptor = wgpu::InstanceDescriptor { backends, ..wgpu::InstanceDescriptor::new_without_display_handle() };
    let instance = wgpu::Instance::new(descriptor);
    let adapters = bevy::tasks::block_on(instance.enumerate_adapters(backends));
    adapters.iter().map(|adapter| adapter.get_info()).collect()
}

/// Bevy's own plugins for drawing without a window.
pub fn bevy_plugins() -> PluginGroupBuilder {
    let settings = WgpuSettings { backends: Some(backends()), ..default() };
    let render_creation = RenderCreation::Automatic(Box::new(settings));
    let plugins = DefaultPlugins
        .set(task_pools())
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() })
        .disable::<LogPlugin>()
        .disable::<PipelinedRenderingPlugin>();
    #[cfg(feature = "editor")]
    let plugins = plugins.disable::<bevy::winit::WinitPlugin>();
    plugins
}

/// The picture, once the renderer has returned it.
#[derive(Resource, Default)]
struct CapturedPicture(Option<Image>);

/// Least and greatest corner of the outlines of a rig's visible controls, in the rig's space; `None` without any.
fn control_bounds(world: &mut World, rig: Entity) -> Option<[Vec3; 2]> {
    let mut state: SystemState<(Query<(&GlobalTransform, Option<&RigNodes>)>, ControlNodes)> = SystemState::new(world);
    let (rigs, controls) = state.get(world).ok()?;
    let (place, nodes) = rigs.get(rig).ok()?;
    let outlines = controls.visible(nodes, place.affine().inverse());
    let points = outlines.iter().flat_map(|outline| &outline.lines).flatten().copied();
    points.map(|point| [point; 2]).reduce(|[low, high], [least, most]| [low.min(least), high.max(most)])
}

/// Points the camera so that the whole character is visible, with the controls that are drawn.
fn aim(world: &mut World, rig: Entity, camera: Entity, settings: &PictureSettings) {
    let mut bounds = match (settings.bounds, world.get::<RigSurface>(rig), world.get::<Rig>(rig)) {
        (Some(bounds), ..) => bounds,
        (None, Some(surface), _) => surface.bounds(),
        (None, None, Some(rig)) if !rig.is_empty() => {
            // Bones of last joints extend about as far beyond them as the bones before.
            let places = rig.walk().flat_map(|joint| {
                let place = rig.position(joint.data.uid);
                let above = joint.parent.filter(|_| joint.children.is_empty()).map(|parent| rig.position(parent));
                [place, above.map_or(place, |above| place + 0.4 * (place - above))]
            });
            places.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
        }
        _ => [Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5)],
    };
    let are_drawn = settings.build && settings.drawing.rig && settings.drawing.controls;
    if settings.bounds.is_none()
        && are_drawn
        && let Some([low, high]) = control_bounds(world, rig)
    {
        bounds = [bounds[0].min(low), bounds[1].max(high)];
    }
    let [right, up, towards] = settings.view.axes().map(|axis| settings.turn * axis);
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
