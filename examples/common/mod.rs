//! Common code of the examples: an app with a window, or, with `--screenshot FILE`, one that takes a picture and ends.

use std::{path::PathBuf, time::Duration};

use bevy::{
    app::ScheduleRunnerPlugin,
    camera::RenderTarget,
    prelude::*,
    render::{
        render_resource::TextureFormat,
        view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk},
    },
    time::TimeUpdateStrategy,
};
use rigsmith::{
    plugins::{display::DisplayJob, skinning::SkinningJob},
    render::bevy_plugins,
};

/// Frames of a second, where pictures are taken: the same ones on every machine.
pub const FRAMES: u32 = 30;

/// Pictures to take: the number of the frame, counted while nothing loads, and the file.
#[derive(Resource)]
struct Pictures {
    due: Vec<(u32, PathBuf)>,
    frame: u32,
    is_waiting: bool,
}

/// Value of an option of the command line.
pub fn option(name: &str) -> Option<String> {
    let mut words = std::env::args().skip_while(|word| word != name);
    words.nth(1)
}

/// An app with a window. With `--screenshot FILE` it has none, takes pictures and ends: `pictures` has their times in seconds
/// and what is added to the name of the file.
pub fn app(pictures: &[(f32, &str)]) -> App {
    let mut app = App::new();
    match option("--screenshot").map(PathBuf::from) {
        None => {
            app.add_plugins(DefaultPlugins);
        }
        Some(file) => {
            let name = |suffix: &str| {
                let stem = file.file_stem().unwrap_or_default().to_string_lossy();
                file.with_file_name(format!("{stem}{suffix}.png"))
            };
            let due = pictures.iter().map(|(time, suffix)| ((time * FRAMES as f32) as u32, name(suffix))).collect();
            app.add_plugins((bevy_plugins(), ScheduleRunnerPlugin::run_loop(Duration::ZERO)))
                .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs(1) / FRAMES))
                .insert_resource(Pictures { due, frame: 0, is_waiting: false })
                .add_systems(Last, take_pictures);
        }
    }
    app.insert_resource(ClearColor(Color::srgb(0.23, 0.24, 0.26)));
    app
}

/// A camera with a light, which looks at a point from a distance.
pub fn camera(place: Vec3, at: Vec3) -> impl Bundle {
    let lights = rigsmith::plugins::display::ViewportLights::default().bundle();
    (Camera3d::default(), Transform::from_translation(place).looking_at(at, Vec3::Y), lights)
}

fn take_pictures(
    mut pictures: ResMut<Pictures>,
    jobs: Query<(), Or<(With<DisplayJob>, With<SkinningJob>)>>,
    cameras: Query<(Entity, &RenderTarget), With<Camera3d>>,
    mut images: ResMut<Assets<Image>>,
    mut commands: Commands,
) {
    let Ok((camera, target)) = cameras.single() else { return };
    let Some(image) = target.as_image() else {
        let image = images.add(Image::new_target_texture(1280, 720, TextureFormat::Rgba8UnormSrgb, None));
        commands.entity(camera).insert(RenderTarget::from(image));
        return;
    };
    if !jobs.is_empty() || pictures.is_waiting {
        return;
    }
    pictures.frame += 1;
    let Some((_, file)) = pictures.due.first().filter(|(frame, _)| *frame <= pictures.frame) else { return };
    commands.spawn(Screenshot::image(image.clone())).observe(save_to_disk(file.clone())).observe(
        |_: On<ScreenshotCaptured>, mut pictures: ResMut<Pictures>, mut exit: MessageWriter<AppExit>| {
            pictures.is_waiting = false;
            pictures.due.remove(0);
            if pictures.due.is_empty() {
                exit.write(AppExit::Success);
            }
        },
    );
    pictures.is_waiting = true;
}
