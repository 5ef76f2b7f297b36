//! Thumbnails of expressions, drawn on the CPU from the rig's own bones and weights.

use std::{collections::BTreeMap, sync::Arc};

use bevy::math::Vec3;
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

/// Thumbnails of one face.
#[derive(Default)]
pub(super) struct Pictures {
    textures: BTreeMap<String, TextureHandle>,
    /// Analysis and weights that they were drawn from.
    of: Option<(Arc<FaceAnalysis>, Arc<SkinData>)>,
}

impl Pictures {
    /// The picture of an expression, once it is drawn.
    pub fn of(&self, name: &str) -> Option<&TextureHandle> {
        self.textures.get(name)
    }

    /// Draws one of the missing thumbnails, or all again after a change of bones or weights.
    pub fn renew(&mut self, ctx: &egui::Context, rig: &Rig, mesh: &RigMesh, face: Option<&Face>, set: &ExpressionSet) {
        let (Some(face), Some(skin)) = (face, rig.skin(mesh.uid)) else { return };
        let same = |(analysis, bound): &(Arc<FaceAnalysis>, Arc<SkinData>)| {
            Arc::ptr_eq(analysis, &face.analysis) && Arc::ptr_eq(bound, skin)
        };
        if !self.of.as_ref().is_some_and(same) {
            self.textures.clear();
            self.of = Some((face.analysis.clone(), skin.clone()));
        }
        let Some(expression) = set.six().find(|expression| !self.textures.contains_key(&expression.name)) else {
            return;
        };
        let strengths = [(expression.name.clone(), 1.0)].into();
        let Ok(points) = expressed_points(rig, mesh, &face.analysis, set, &strengths) else { return };
        let image = draw(&points, &face.analysis);
        let texture = ctx.load_texture(format!("face {}", expression.name), image, TextureOptions::LINEAR);
        self.textures.insert(expression.name.clone(), texture);
        // The next one is drawn in the next frame, so that no frame is long.
        ctx.request_repaint();
    }
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
