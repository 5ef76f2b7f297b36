//! Picture of a template, as the viewport shows it: the mesh and the bones through the viewport's camera, on a transparent ground.

use std::{io::Cursor, sync::Arc};

use bevy::prelude::*;
use rayon::prelude::*;

use crate::{
    algo::view::{View, ViewPlane},
    editor::camera::ViewportSight,
    mesh::surface::Surface,
    plugins::{document::JointEntities, surface::RigSurface, viewport::Sight},
    rig::{Rig, Uid},
};

/// Pixels along a side.
const PIXELS: usize = 192;
/// Colour of the mesh.
const TONE: Vec3 = Vec3::new(206.0, 196.0, 186.0);
/// Colours of bones and joints.
const BONE: [u8; 4] = [90, 130, 190, 255];
const JOINT: [u8; 4] = [255, 158, 44, 255];

/// Error of a picture that cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[error("the picture cannot be encoded: {0}; leave it out")]
pub(super) struct PreviewError(#[from] image::ImageError);

/// Content of a picture, in the rig's space.
pub(super) struct Preview {
    sight: Sight,
    surface: Option<Arc<Surface>>,
    /// Joints, each with its parent's place.
    bones: Vec<(Vec3, Option<Vec3>)>,
}

impl Preview {
    /// The rig as the viewport shows it now; from the front where there is no viewport.
    pub fn of(world: &World, entity: Entity) -> Option<Self> {
        let rig = world.get::<Rig>(entity)?;
        let to_rig = world.get::<GlobalTransform>(entity).copied().unwrap_or_default().affine().inverse();
        let entities = world.get::<JointEntities>(entity);
        let place = |joint: Uid| {
            let posed = entities.and_then(|entities| world.get::<GlobalTransform>(entities.get(joint)?));
            posed.map_or_else(|| rig.position(joint), |posed| to_rig.transform_point3(posed.translation()))
        };
        let bones: Vec<(Vec3, Option<Vec3>)> =
            rig.walk().map(|joint| (place(joint.data.uid), joint.parent.map(place))).collect();
        let surface = world.get::<RigSurface>(entity).and_then(RigSurface::shared);
        let sight = world.get_resource::<ViewportSight>().and_then(|sight| sight.0);
        let sight = sight.unwrap_or_else(|| front(surface.as_deref(), &bones));
        Some(Self { sight, surface, bones })
    }

    /// The picture as the bytes of a PNG file.
    pub fn png(&self) -> Result<Vec<u8>, PreviewError> {
        let mut pixels = vec![[0_u8; 4]; PIXELS * PIXELS];
        if let Some(surface) = &self.surface {
            self.shade(surface, &mut pixels);
        }
        let at = |place: Vec3| self.sight.project(place).map(|pixel| self.inside(pixel));
        for (joint, parent) in &self.bones {
            if let (Some(from), Some(to)) = (at(*joint), parent.and_then(at)) {
                line(&mut pixels, from, to);
            }
        }
        for joint in self.bones.iter().filter_map(|(joint, _)| at(*joint)) {
            dot(&mut pixels, joint, JOINT);
        }
        let side = PIXELS as u32;
        let mut bytes = Cursor::new(Vec::new());
        if let Some(image) = image::RgbaImage::from_raw(side, side, pixels.concat()) {
            image.write_to(&mut bytes, image::ImageFormat::Png)?;
        }
        Ok(bytes.into_inner())
    }

    /// Logical pixels of the viewport along a side of the square in its middle.
    fn side(&self) -> f32 {
        self.sight.size.min_element()
    }

    /// Place in the picture of a pixel of the viewport.
    fn inside(&self, pixel: Vec2) -> Vec2 {
        ((pixel - self.sight.size * 0.5) / self.side() + 0.5) * PIXELS as f32
    }

    /// Pixel of the viewport at a place in the picture.
    fn outside(&self, place: Vec2) -> Vec2 {
        (place / PIXELS as f32 - 0.5) * self.side() + self.sight.size * 0.5
    }

    /// Shades what the rays of all pixels meet.
    fn shade(&self, surface: &Surface, pixels: &mut [[u8; 4]]) {
        let meet = |number: usize| {
            let place = Vec2::new((number % (PIXELS + 1)) as f32 + 0.5, (number / (PIXELS + 1)) as f32 + 0.5);
            let ray = self.sight.ray(self.outside(place));
            surface.closest(&ray).map(|hit| ray.origin + ray.direction * hit.distance)
        };
        // One more row and column, for the slopes of the last ones.
        let met: Vec<Option<Vec3>> = (0..(PIXELS + 1) * (PIXELS + 1)).into_par_iter().map(meet).collect();
        let plane = &self.sight.plane;
        let light = (plane.right * 0.25 + plane.up * 0.5 + plane.towards()).normalize_or_zero();
        for (number, pixel) in pixels.iter_mut().enumerate() {
            let at = number / PIXELS * (PIXELS + 1) + number % PIXELS;
            let Some(place) = met[at] else { continue };
            let slopes =
                met[at + 1].zip(met[at + PIXELS + 1]).map(|(right, below)| (place - below).cross(right - place));
            let normal = slopes.and_then(|normal| normal.try_normalize());
            let lit = 0.28 + 0.72 * normal.map_or(0.8, |normal| normal.dot(light).abs());
            let [red, green, blue] = (TONE * lit).to_array().map(|part| part as u8);
            *pixel = [red, green, blue, 255];
        }
    }
}

/// View of everything from the front.
fn front(surface: Option<&Surface>, bones: &[(Vec3, Option<Vec3>)]) -> Sight {
    let of_surface = surface.and_then(Surface::bounds);
    let points =
        bones.iter().map(|(joint, _)| *joint).chain(of_surface.into_iter().flat_map(|(low, high)| [low, high]));
    let (low, high) = points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let (low, high) = if low.cmple(high).all() { (low, high) } else { (Vec3::splat(-0.5), Vec3::splat(0.5)) };
    let plane = ViewPlane::orthographic(View::Front, [low, high]);
    let middle = 0.5 * (low + high);
    let size = Vec2::splat(PIXELS as f32);
    let extent = 1.12 * (high - low).max_element().max(1e-3);
    Sight { plane: ViewPlane { origin: middle, ..plane }, pixel: extent / size.x, size }
}

fn line(pixels: &mut [[u8; 4]], from: Vec2, to: Vec2) {
    let steps = from.distance(to).min(4.0 * PIXELS as f32).ceil().max(1.0) as usize;
    for step in 0..=steps {
        dot(pixels, from.lerp(to, step as f32 / steps as f32), BONE);
    }
}

/// Fills four pixels around a place, as far as they are in the picture.
fn dot(pixels: &mut [[u8; 4]], at: Vec2, color: [u8; 4]) {
    for [right, down] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        let place = at + Vec2::new(right, down) - 0.5;
        if place.min_element() >= 0.0 && place.max_element() < PIXELS as f32 {
            pixels[place.y as usize * PIXELS + place.x as usize] = color;
        }
    }
}
