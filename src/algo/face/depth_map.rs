//! Depth map: the front view of a head as a picture of depths.
//!
//! An orthographic view down the z axis, rasterised on square pixels: each pixel holds the largest z of the triangles
//! over its centre, and the index of that triangle. Landmarks are read from it, since rows, columns and smoothing are
//! simple on a picture whatever the mesh's topology.

use glam::{Vec2, Vec3};

/// Marks a pixel without a triangle.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Frame of a depth map: a rectangle of the x-y plane cut into square pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthFrame {
    /// The centre of the first pixel (smallest x, smallest y), in head space.
    pub origin: Vec2,
    /// The side of a pixel, in head space.
    pub pixel: f32,
    /// Pixels along x.
    pub width: usize,
    /// Pixels along y.
    pub height: usize,
}

impl DepthFrame {
    /// A frame over the rectangle from `low` to `high` with pixels of side `pixel`, at most `most` of them each way.
    ///
    /// A rectangle that is too large for `most` pixels gets larger pixels.
    pub fn over(low: Vec2, high: Vec2, pixel: f32, most: usize) -> Self {
        let most = most.clamp(2, 8192);
        let size = (high - low).max(Vec2::ZERO);
        let pixel = pixel.max(size.max_element() / (most - 1) as f32).max(f32::MIN_POSITIVE);
        let count = |length: f32| (((length / pixel).ceil() as usize) + 1).clamp(1, most);
        Self { origin: low, pixel, width: count(size.x), height: count(size.y) }
    }

    /// The place of pixel (`column`, `row`), in head space.
    pub fn place(&self, column: usize, row: usize) -> Vec2 {
        self.origin + Vec2::new(column as f32, row as f32) * self.pixel
    }

    /// Coordinates of a place, in pixels from the first pixel's centre.
    pub fn pixels(&self, place: Vec2) -> Vec2 {
        (place - self.origin) / self.pixel
    }
}

/// Depths seen from the front.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Frame of the map.
    pub frame: DepthFrame,
    /// The largest z at each pixel, rows from the lowest y up; negative infinity without a triangle.
    pub depth: Vec<f32>,
    /// The triangle seen at each pixel or [`NO_TRIANGLE`].
    pub triangle: Vec<u32>,
}

impl DepthMap {
    /// Draws the triangles whose index `keep` accepts.
    ///
    /// Points in head space; triangles with an index out of range or a corner that is not finite are left out. Where
    /// two triangles are equally near, the one earlier in the list is kept. Time goes with the number of triangles plus
    /// the pixels they cover.
    pub fn draw(frame: DepthFrame, points: &[Vec3], triangles: &[[u32; 3]], keep: impl Fn(usize) -> bool) -> Self {
        let mut map = Self {
            frame,
            depth: vec![f32::NEG_INFINITY; frame.width * frame.height],
            triangle: vec![NO_TRIANGLE; frame.width * frame.height],
        };
        for (index, corners) in triangles.iter().enumerate() {
            if !keep(index) {
                continue;
            }
            let [Some(&a), Some(&b), Some(&c)] = corners.map(|corner| points.get(corner as usize)) else { continue };
            map.draw_triangle(a, b, c, index as u32);
        }
        map
    }

    fn draw_triangle(&mut self, a: Vec3, b: Vec3, c: Vec3, index: u32) {
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return;
        }
        let [pa, pb, pc] = [a, b, c].map(|corner| self.frame.pixels(corner.truncate()));
        let low = pa.min(pb).min(pc);
        let high = pa.max(pb).max(pc);
        let limit = Vec2::new(self.frame.width as f32 - 1.0, self.frame.height as f32 - 1.0);
        if high.x < 0.0 || high.y < 0.0 || low.x > limit.x || low.y > limit.y {
            return;
        }
        // Truncation rounds down, because all coordinates are positive after clamping. Most triangles of a fine mesh
        // cover no centre.
        let (low, high) = (low.max(Vec2::ZERO), high.min(limit));
        let up = |x: f32| x as usize + usize::from(x > (x as usize) as f32);
        let (columns, rows) = (up(low.x)..high.x as usize + 1, up(low.y)..high.y as usize + 1);
        let area = (pb - pa).perp_dot(pc - pa);
        if columns.is_empty() || rows.is_empty() || area.abs() < 1e-12 {
            return;
        }
        let inverse = 1.0 / area;
        // A little slack over the edge, so that no ray slips between two neighbours.
        let slack = -1e-5;
        // The weights are linear in x, so each row computes them once.
        let step_b = (pc.y - pa.y) * inverse;
        let step_c = -(pb.y - pa.y) * inverse;
        for row in rows {
            let from = Vec2::new(columns.start as f32, row as f32) - pa;
            let mut weight_b = from.perp_dot(pc - pa) * inverse;
            let mut weight_c = (pb - pa).perp_dot(from) * inverse;
            let start = row * self.frame.width;
            for column in columns.clone() {
                let weight_a = 1.0 - weight_b - weight_c;
                if weight_a >= slack && weight_b >= slack && weight_c >= slack {
                    let z = a.z * weight_a + b.z * weight_b + c.z * weight_c;
                    let pixel = start + column;
                    if z > self.depth[pixel] {
                        self.depth[pixel] = z;
                        self.triangle[pixel] = index;
                    }
                }
                weight_b += step_b;
                weight_c += step_c;
            }
        }
    }

    /// The depth at a pixel, if a triangle covers it.
    pub fn at(&self, column: usize, row: usize) -> Option<f32> {
        if column >= self.frame.width || row >= self.frame.height {
            return None;
        }
        self.depth.get(row * self.frame.width + column).copied().filter(|depth| depth.is_finite())
    }

    /// The depth at a place, interpolated between the covered ones of the four pixels around it.
    pub fn sample(&self, place: Vec2) -> Option<f32> {
        let at = self.frame.pixels(place);
        if !(at.x > -1.0 && at.y > -1.0 && at.x < self.frame.width as f32 && at.y < self.frame.height as f32) {
            return None;
        }
        // Adding and subtracting one makes truncation round down.
        let (column, row) = ((at.x + 1.0) as i64 - 1, (at.y + 1.0) as i64 - 1);
        let part = at - Vec2::new(column as f32, row as f32);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (dx, dy, share) in [
            (0, 0, (1.0 - part.x) * (1.0 - part.y)),
            (1, 0, part.x * (1.0 - part.y)),
            (0, 1, (1.0 - part.x) * part.y),
            (1, 1, part.x * part.y),
        ] {
            let (column, row) = (column + dx, row + dy);
            if column < 0 || row < 0 {
                continue;
            }
            if let Some(depth) = self.at(column as usize, row as usize) {
                sum += depth * share;
                weight += share;
            }
        }
        (weight > 1e-3).then(|| sum / weight)
    }

    /// Returns `true` if a triangle covers the pixel nearest to a place.
    pub fn is_covered(&self, place: Vec2) -> bool {
        let at = self.frame.pixels(place).round();
        at.x >= 0.0 && at.y >= 0.0 && self.at(at.x as usize, at.y as usize).is_some()
    }
}
