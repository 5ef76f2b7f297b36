//! Thumbnails of expressions, drawn on the CPU from the rig's own bones and weights.

use std::{collections::BTreeMap, sync::Arc};

use bevy::{
    math::Vec3,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};
use bevy_egui::egui::{self, ColorImage, TextureHandle, TextureOptions};

use crate::{
    algo::face::{auto::FaceAnalysis, expression::ExpressionSet, shells::ShellKind},
    editor::raster::{Raster, normals},
    plugins::{
        face::{Face, expressed_points},
        surface::RigMesh,
    },
    rig::{Rig, SkinData},
};

/// Pixels along a side.
const PIXELS: usize = 112;

/// Thumbnails of one face, drawn in the background.
#[derive(Default)]
pub(super) struct Pictures {
    textures: BTreeMap<String, TextureHandle>,
    /// Analysis and weights that they are drawn from.
    of: Option<(Arc<FaceAnalysis>, Arc<SkinData>)>,
    /// Pictures that are being drawn, by the names of their expressions.
    task: Option<Task<Vec<(String, ColorImage)>>>,
}

impl Pictures {
    /// The picture of an expression, once it is drawn.
    pub fn of(&self, name: &str) -> Option<&TextureHandle> {
        self.textures.get(name)
    }

    /// Takes over the thumbnails that are drawn, and starts to draw them again after a change of bones or weights.
    pub fn renew(
        &mut self,
        ctx: &egui::Context,
        rig: &Rig,
        mesh: &RigMesh,
        face: Option<&Face>,
        set: &Arc<ExpressionSet>,
    ) {
        let (Some(face), Some(skin)) = (face, rig.skin(mesh.uid)) else { return };
        let same = |(analysis, bound): &(Arc<FaceAnalysis>, Arc<SkinData>)| {
            Arc::ptr_eq(analysis, &face.analysis) && Arc::ptr_eq(bound, skin)
        };
        if !self.of.as_ref().is_some_and(same) {
            self.textures.clear();
            self.of = Some((face.analysis.clone(), skin.clone()));
            let (rig, mesh, analysis, set) = (rig.clone(), mesh.clone(), face.analysis.clone(), set.clone());
            // The task of another state is dropped with its pictures.
            let work = async move { images(&rig, &mesh, &analysis, &set) };
            self.task = Some(AsyncComputeTaskPool::get().spawn(work));
        }
        let Some(task) = &mut self.task else { return };
        let Some(images) = check_ready(task) else {
            ctx.request_repaint();
            return;
        };
        self.task = None;
        for (name, image) in images {
            let texture = ctx.load_texture(format!("face {name}"), image, TextureOptions::LINEAR);
            self.textures.insert(name, texture);
        }
    }
}

/// Pictures of the six expressions, by name. Cost: a fit of the face for each.
fn images(rig: &Rig, mesh: &RigMesh, analysis: &FaceAnalysis, set: &ExpressionSet) -> Vec<(String, ColorImage)> {
    let drawn = set.six().filter_map(|expression| {
        let strengths = [(expression.name.clone(), 1.0)].into();
        let points = expressed_points(rig, mesh, analysis, set, &strengths).ok()?;
        Some((expression.name.clone(), draw(&points, analysis)))
    });
    drawn.collect()
}

/// The face from the front: nearest triangle at each pixel, lit from above the camera.
fn draw(points: &[Vec3], analysis: &FaceAnalysis) -> ColorImage {
    let marks = &analysis.landmarks.points;
    let (low, high) =
        marks.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), mark| (low.min(*mark), high.max(*mark)));
    let middle = 0.5 * (low + high);
    let side = 1.25 * (high - low).truncate().max_element().max(f32::MIN_POSITIVE);
    let scale = PIXELS as f32 / side;
    let project = |point: Vec3| {
        Vec3::new((point.x - middle.x + 0.5 * side) * scale, (middle.y - point.y + 0.56 * side) * scale, point.z)
    };
    let mut raster = Raster::new(PIXELS);
    let normals = normals(points, &analysis.triangles);
    for triangle in &analysis.triangles {
        let corners = triangle.map(|corner| project(points[corner as usize]));
        let tone = tone(analysis.shells.kind(triangle[0] as usize));
        raster.triangle(corners, triangle.map(|corner| normals[corner as usize]), tone);
    }
    raster.image()
}

fn tone(kind: ShellKind) -> [f32; 3] {
    match kind {
        ShellKind::Skin => [226.0, 190.0, 170.0],
        ShellKind::LeftEye | ShellKind::RightEye => [240.0, 240.0, 240.0],
        ShellKind::Inside => [190.0, 150.0, 145.0],
        ShellKind::Tongue => [200.0, 120.0, 118.0],
    }
}
