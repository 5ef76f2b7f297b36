//! Shows a mesh file in a window, or writes a picture of it: the smallest app that uses the renderer without the editor.
//!
//! ```text
//! cargo run --example show_model -- assets/models/biped.obj
//! cargo run --example show_model -- assets/models/biped.obj --xray --wireframe -o biped.png
//! ```
//!
//! `--xray`, `--wireframe`, `--weights` (all joints) and `--joint NAME` choose what is shown; `--pose` bends all joints
//! a little; `--yaw DEGREES` looks from elsewhere; `--bind` computes weights for the bundled biped template.

use std::{f32::consts::PI, path::Path};

use bevy::{
    app::AppExit,
    camera::RenderTarget,
    prelude::*,
    render::{
        RenderPlugin,
        render_resource::TextureFormat,
        view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk},
    },
    window::ExitCondition,
    winit::WinitPlugin,
};
use rigsmith::{
    files::{RealDisk, load_model, load_template},
    plugins::{
        RigPlugins,
        display::{DisplayJob, DisplayPlugin, MeshDisplay, ViewportLights, WeightColors},
        document::Joint,
        skinning::SkinningJob,
        viewport::RigViewport,
    },
    prelude::*,
    rig::character::import_skeleton,
};

/// Settings from the command line.
#[derive(Resource, Clone, Default)]
struct ShowSettings {
    out: Option<String>,
    joint: Option<String>,
    pose: bool,
    yaw: f32,
    frames: u32,
}

fn main() -> AppExit {
    let mut wanted = ShowSettings::default();
    let mut display = MeshDisplay::default();
    let (mut file, mut bind) = (String::from("assets/models/biped.obj"), false);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--xray" => display.xray = true,
            "--wireframe" => display.wireframe = true,
            "--weights" => display.weights = WeightColors::AllJoints,
            "--joint" => wanted.joint = words.next(),
            "--pose" => wanted.pose = true,
            "--bind" => bind = true,
            "--yaw" => wanted.yaw = words.next().and_then(|word| word.parse().ok()).unwrap_or(0.0),
            "-o" => wanted.out = words.next(),
            _ => file = word,
        }
    }
    let model = match load_model(&RealDisk, Path::new(&file)) {
        Ok(model) => model,
        Err(error) => {
            eprintln!("{error}");
            return AppExit::error();
        }
    };

    let mut app = App::new();
    let plugins = DefaultPlugins.build();
    if wanted.out.is_some() {
        let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
        let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
        let runner = bevy::app::ScheduleRunnerPlugin::run_loop(std::time::Duration::ZERO);
        app.add_plugins((plugins.set(window).set(render).disable::<WinitPlugin>(), runner));
    } else {
        app.add_plugins(plugins);
    }
    app.add_plugins((RigPlugins, DisplayPlugin)).insert_resource(display);
    app.insert_resource(ClearColor(Color::srgb(0.232, 0.242, 0.262)));

    let low = model.points.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let high = model.points.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ONE);
    let world = app.world_mut();
    let mut uids = world.resource_mut::<UidSource>();
    let mesh_uid = uids.next_uid();
    let skeleton = import_skeleton(&model, &mut uids);
    let mut edits = skeleton.edits;
    edits.extend(skeleton.skin.map(|skin| RigEdit::SetSkin(mesh_uid, Some(skin))));
    let mut rig = Rig::new(Uid(1), "character");
    if bind {
        match load_template(&RealDisk, Path::new("assets/templates/biped.rig.ron")) {
            Ok(template) => rig = template.rig,
            Err(error) => eprintln!("{error}"),
        }
    }
    let rig = world.spawn(rig).id();
    let mesh = world.spawn((RigMesh::new(mesh_uid, model, skeleton.nodes), SkinOf(rig))).id();
    if !edits.is_empty() {
        world.write_message(EditRequest::operation(rig, Operation::Edits(edits)));
    }
    if bind {
        world.write_message(BindRequest::new(mesh));
    }
    let middle = (low + high) / 2.0;
    let size = (high - low).length().max(1e-3);
    let towards = Quat::from_rotation_y(wanted.yaw.to_radians()) * Vec3::new(0.35, 0.12, 1.0).normalize();
    let place = Transform::from_translation(middle + towards * size * 1.25).looking_at(middle, Vec3::Y);
    let projection = Projection::Perspective(PerspectiveProjection { fov: PI / 4.5, near: size * 0.01, ..default() });
    let viewport = RigViewport { focus: size * 1.25 };
    let camera =
        world.spawn((Camera3d::default(), projection, place, viewport, ViewportLights::default().bundle())).id();
    if wanted.out.is_some() {
        let target = Image::new_target_texture(1000, 1000, TextureFormat::Rgba8UnormSrgb, None);
        let target = world.resource_mut::<Assets<Image>>().add(target);
        world.entity_mut(camera).insert(RenderTarget::from(target));
    }
    app.insert_resource(wanted).add_systems(Update, (choose, picture)).run()
}

/// Chooses the joint to colour, and bends the joints once there are weights.
fn choose(
    wanted: Res<ShowSettings>,
    rigs: Query<&Rig>,
    mut display: ResMut<MeshDisplay>,
    mut joints: Query<&mut Transform, With<Joint>>,
    mut posed: Local<bool>,
) {
    for rig in &rigs {
        if let Some(joint) = wanted.joint.as_deref().and_then(|name| rig.find_label(name)) {
            let chosen = MeshDisplay { weights: WeightColors::Joint(joint), ..*display };
            display.set_if_neq(chosen);
        }
        if wanted.pose && !*posed && rig.skins().next().is_some() && !joints.is_empty() {
            *posed = true;
            for mut joint in &mut joints {
                joint.rotate_local_z(0.25);
            }
        }
    }
}

/// Takes the picture when all is on the screen.
fn picture(
    mut commands: Commands,
    mut wanted: ResMut<ShowSettings>,
    jobs: Query<(), Or<(With<DisplayJob>, With<SkinningJob>)>>,
    cameras: Query<&RenderTarget>,
) {
    let (Some(out), Ok(target)) = (wanted.out.clone(), cameras.single()) else { return };
    wanted.frames = if jobs.is_empty() { wanted.frames + 1 } else { 0 };
    if wanted.frames == 12
        && let Some(image) = target.as_image()
    {
        commands.spawn(Screenshot::image(image.clone())).observe(save_to_disk(out)).observe(
            |_: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
                exit.write(AppExit::Success);
            },
        );
    }
}
