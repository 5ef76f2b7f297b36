//! Scenes drawn by Bevy's renderer with the painter of the window, into images. It needs a graphics adapter, be it a
//! software one.
//!
//! Bevy blends amounts of light where the stored pictures have blended values, so its pictures are held against those that
//! the rasteriser draws with [`Blending::Linear`]: the same triangles, textures and cuts.
//!
//! [`Blending::Linear`]: super::raster::Blending::Linear

use std::{collections::BTreeMap, sync::Arc, time::Instant};

use bevy::{
    camera::RenderTarget,
    prelude::*,
    render::{
        render_resource::TextureFormat,
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
};
use bevy_egui::{
    EguiGlobalSettings, EguiManagedTextures, EguiOutput, EguiPlugin, EguiRenderOutput,
    egui::{TextureOptions, TexturesDelta, epaint::ImageDelta},
};
use rigsmith::render::{adapter, bevy_plugins};

use super::{picture::Picture, raster::Scene};
use crate::{bench::HANG, prerequisites::skip};

/// Number of scenes that are drawn at once.
pub const AT_ONCE: usize = 12;

/// Frames until scenes are drawn: their textures come to the adapter after their triangles.
const SETTLE: usize = 4;

/// Pictures that the renderer has returned, by their cameras.
#[derive(Resource, Default)]
struct CapturedPictures(BTreeMap<Entity, Image>);

/// An app without a window that draws scenes.
pub struct BevyRenderer(App);

/// A camera, and the image into which it draws a scene.
struct Shutter<'a> {
    camera: Entity,
    target: Handle<Image>,
    scene: &'a Scene,
}

impl BevyRenderer {
    /// A renderer; `None`, with the reason told, where there is no graphics adapter.
    #[track_caller]
    pub fn new() -> Option<Self> {
        if adapter().is_none() {
            skip("there is no graphics adapter, not even a software one", "RIGSMITH_REQUIRE_GPU");
            return None;
        }
        let mut app = App::new();
        // The cameras get finished triangles; they need no interface of their own.
        app.insert_resource(EguiGlobalSettings { auto_create_primary_context: false, ..default() })
            .add_plugins((bevy_plugins(), EguiPlugin::default()))
            .init_resource::<CapturedPictures>();
        app.finish();
        app.cleanup();
        Some(Self(app))
    }

    /// Pictures of scenes, in their order.
    #[track_caller]
    pub fn draw(&mut self, scenes: &[Scene]) -> Vec<Picture> {
        let shutters: Vec<Shutter> = scenes.iter().map(|scene| self.aim(scene)).collect();
        for _ in 0..SETTLE {
            self.frame(&shutters);
        }
        for shutter in &shutters {
            let camera = shutter.camera;
            self.0.world_mut().spawn(Screenshot::image(shutter.target.clone())).observe(
                move |shot: On<ScreenshotCaptured>, mut captured: ResMut<CapturedPictures>| {
                    captured.0.insert(camera, shot.image.clone());
                },
            );
        }
        let started = Instant::now();
        while self.0.world().resource::<CapturedPictures>().0.len() < shutters.len() {
            assert!(started.elapsed() < HANG, "the renderer returns no pictures");
            self.frame(&shutters);
        }
        let world = self.0.world_mut();
        let mut captured = std::mem::take(&mut world.resource_mut::<CapturedPictures>().0);
        world.resource_mut::<EguiManagedTextures>().0.clear();
        let mut pictures = Vec::new();
        for shutter in shutters {
            world.despawn(shutter.camera);
            let image = captured.remove(&shutter.camera).expect("a picture of each camera");
            pictures.push(picture(image));
        }
        pictures
    }

    /// Spawns a camera for a scene.
    fn aim<'a>(&mut self, scene: &'a Scene) -> Shutter<'a> {
        let [width, height] = scene.size.map(|side| side as u32);
        let world = self.0.world_mut();
        let target = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        let target = world.resource_mut::<Assets<Image>>().add(target);
        let [red, green, blue, _] = scene.ground.to_array();
        let clear_color = ClearColorConfig::Custom(Color::srgb_u8(red, green, blue));
        let mut textures_delta = TexturesDelta::default();
        for (id, image) in scene.textures.iter() {
            textures_delta.push(id, ImageDelta::full(Arc::clone(image), TextureOptions::LINEAR));
        }
        let output = EguiOutput { pixels_per_point: scene.pixels_per_point, ..default() };
        let camera = world.spawn((
            Camera2d,
            Camera { clear_color, ..default() },
            Msaa::Off,
            RenderTarget::from(target.clone()),
            output,
            EguiRenderOutput { paint_jobs: Vec::new(), textures_delta },
        ));
        Shutter { camera: camera.id(), target, scene }
    }

    /// A frame of all cameras. The renderer takes their triangles away with it.
    fn frame(&mut self, shutters: &[Shutter]) {
        for shutter in shutters {
            let mut output = self.0.world_mut().get_mut::<EguiRenderOutput>(shutter.camera).expect("a camera");
            output.paint_jobs.clone_from(&shutter.scene.primitives);
        }
        self.0.update();
    }
}

fn picture(image: Image) -> Picture {
    let image = image.try_into_dynamic().expect("a picture that can be read").to_rgb8();
    Picture::new(image.width() as usize, image.height() as usize, image.into_raw())
}
