//! Pictures of the start page, drawn in the background when it is first shown.

use std::{collections::BTreeMap, sync::Arc};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};
use bevy_egui::egui::ColorImage;

use super::{BonePicture, StartPage};
use crate::{
    editor::{
        files::{BUNDLED_MODELS, BundledModel, loading::bundled_template},
        raster::{Raster, normals},
    },
    files::BUNDLED_CHARACTERS,
    mesh::model::Model,
};

/// Pixels along a side of a mesh's picture.
const PIXELS: usize = 160;
/// Colour of meshes.
const TONE: [f32; 3] = [206.0, 196.0, 186.0];

/// The pictures, by the names of what they show.
#[derive(Resource, Default)]
pub struct StartPictures {
    pictures: Pictures,
    task: Option<Task<Pictures>>,
    is_begun: bool,
}

#[derive(Default)]
struct Pictures {
    models: BTreeMap<&'static str, Arc<ColorImage>>,
    templates: BTreeMap<&'static str, BonePicture>,
}

impl StartPictures {
    /// Picture of a bundled mesh, once it is drawn.
    pub fn model(&self, name: &str) -> Option<&Arc<ColorImage>> {
        self.pictures.models.get(name)
    }

    /// Picture of a bundled template, once it is drawn.
    pub fn template(&self, name: &str) -> Option<&BonePicture> {
        self.pictures.templates.get(name)
    }
}

/// Draws the pictures.
pub(super) fn draw(
    page: Res<StartPage>,
    mut pictures: ResMut<StartPictures>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    if pictures.task.is_none() {
        if !page.is_shown() || pictures.is_begun {
            return;
        }
        pictures.is_begun = true;
        pictures.task = Some(AsyncComputeTaskPool::get().spawn(async { all() }));
    }
    if let Some(done) = pictures.bypass_change_detection().task.as_mut().and_then(check_ready) {
        pictures.task = None;
        pictures.pictures = done;
    }
    redraw.write(RequestRedraw);
}

fn all() -> Pictures {
    let model = |bundled: &'static BundledModel| Some((bundled.name, Arc::new(mesh(&bundled.read().ok()?))));
    let template =
        |(name, _): &(&'static str, &'static str)| Some((*name, BonePicture::of(&bundled_template(name).ok()?)));
    Pictures {
        models: BUNDLED_MODELS.iter().filter_map(model).collect(),
        templates: BUNDLED_CHARACTERS.iter().filter_map(template).collect(),
    }
}

/// A mesh from the front, turned a little to its left.
fn mesh(model: &Model) -> ColorImage {
    let turn = Quat::from_rotation_y(-0.45);
    let points: Vec<Vec3> = model.points.iter().map(|point| turn * *point).collect();
    let (low, high) =
        points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let middle = 0.5 * (low + high);
    let side = 1.1 * (high - low).truncate().max_element().max(f32::MIN_POSITIVE);
    let scale = PIXELS as f32 / side;
    let project = |point: Vec3| {
        Vec3::new((point.x - middle.x + 0.5 * side) * scale, (middle.y - point.y + 0.5 * side) * scale, point.z)
    };
    let triangles = model.point_triangles();
    let normals = normals(&points, &triangles);
    let mut raster = Raster::new(PIXELS);
    for triangle in &triangles {
        let corners = triangle.map(|corner| project(points[corner as usize]));
        raster.triangle(corners, triangle.map(|corner| normals[corner as usize]), TONE);
    }
    raster.image()
}
