//! Rasteriser of thumbnails: triangles filled on the processor, the nearest at each pixel, lit from above the camera.

use bevy::math::Vec3;
use bevy_egui::egui::{Color32, ColorImage};

/// A square picture that is being drawn. Places are in pixels from the upper left corner, y down; of two triangles at one
/// pixel the one with the larger z is in front.
pub(in crate::editor) struct Raster {
    side: usize,
    depth: Vec<f32>,
    pixels: Vec<Color32>,
}

impl Raster {
    /// An empty picture with so many pixels along a side.
    pub fn new(side: usize) -> Self {
        let count = side * side;
        Self { side, depth: vec![f32::NEG_INFINITY; count], pixels: vec![Color32::TRANSPARENT; count] }
    }

    /// Fills a triangle with a tone (red, green and blue, 0 to 255 each), shaded by the normals of its corners.
    pub fn triangle(&mut self, [a, b, c]: [Vec3; 3], [p, q, r]: [Vec3; 3], tone: [f32; 3]) {
        let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        if area.abs() < 1e-9 || !area.is_finite() {
            return;
        }
        let light = Vec3::new(0.25, 0.5, 1.0).normalize();
        let low = a.min(b).min(c).max(Vec3::ZERO);
        let high = a.max(b).max(c).min(Vec3::splat(self.side as f32 - 1.0));
        if high.x < low.x || high.y < low.y {
            return;
        }
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                let at = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0);
                let u = ((b.x - at.x) * (c.y - at.y) - (c.x - at.x) * (b.y - at.y)) / area;
                let v = ((c.x - at.x) * (a.y - at.y) - (a.x - at.x) * (c.y - at.y)) / area;
                let w = 1.0 - u - v;
                if u < 0.0 || v < 0.0 || w < 0.0 {
                    continue;
                }
                let z = u * a.z + v * b.z + w * c.z;
                let pixel = y * self.side + x;
                if z > self.depth[pixel] {
                    self.depth[pixel] = z;
                    let normal = (u * p + v * q + w * r).normalize_or_zero();
                    let lit = 0.28 + 0.72 * normal.dot(light).abs();
                    let [red, green, blue] = tone.map(|part| (part * lit) as u8);
                    self.pixels[pixel] = Color32::from_rgb(red, green, blue);
                }
            }
        }
    }

    /// The picture.
    pub fn image(self) -> ColorImage {
        ColorImage::new([self.side, self.side], self.pixels)
    }
}

/// Normals of points: sums of those of their triangles, weighted by area, of any length.
pub(in crate::editor) fn normals(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; points.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| points[corner as usize]);
        let normal = (b - a).cross(c - a);
        for corner in triangle {
            normals[*corner as usize] += normal;
        }
    }
    normals
}
