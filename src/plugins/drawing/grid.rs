//! The ground grid: lines whose spacing follows the zoom, and the world's axes.

use bevy::{math::ops, prelude::*};

use super::{
    ink::{Ink, Layer, Pen},
    theme::{Theme, Tint, fade},
};
use crate::plugins::viewport::Sight;

/// Number of lines each way.
const LINES: i32 = 48;
/// Number of pieces of a line, along which it fades.
const PIECES: i32 = 12;
/// Depth of a grid in the view plane: behind the scene.
const BEHIND: f32 = 1e-7;

/// A plane of the world for the grid: the directions of its lines and of its normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GridPlane {
    /// x and z: the ground.
    Ground,
    /// x and y: seen from the front or the back.
    Front,
    /// z and y: seen from a side.
    Side,
}

impl GridPlane {
    /// The plane for a view of the world: the view plane in an orthographic view straight along an axis, else the
    /// ground.
    pub fn of(sight: &Sight) -> Self {
        let towards = sight.plane.towards().abs();
        match sight.plane.eye {
            None if towards.z > 0.9999 => Self::Front,
            None if towards.x > 0.9999 => Self::Side,
            _ => Self::Ground,
        }
    }

    /// Numbers of the two axes in the plane.
    fn axes(self) -> [usize; 2] {
        match self {
            Self::Ground => [0, 2],
            Self::Front => [0, 1],
            Self::Side => [2, 1],
        }
    }
}

/// Spacing of the finest lines: a power of ten, at least 9 pixels apart at the camera's focus.
pub fn spacing(pixel: f32) -> f32 {
    let exponent = ops::log2(9.0 * pixel.max(1e-20)) / std::f32::consts::LOG2_10;
    ops::powf(10.0, exponent.ceil())
}

/// Draws the grid of the world into blended ink. `sight` sees the world.
pub fn draw_grid(sight: &Sight, theme: &Theme, ink: &mut Ink) {
    let plane = GridPlane::of(sight);
    let flat = sight.plane.eye.is_none() && (plane != GridPlane::Ground || sight.plane.towards().y.abs() > 0.9999);
    let mut pen = Pen::new(ink, sight);
    pen.layer = if flat { Layer::Fixed(BEHIND) } else { Layer::Scene };
    let grid = Grid { plane, flat, sight, centre: centre(sight, plane) };
    let fine = spacing(sight.pixel);
    for level in 0..3 {
        let step = fine * [1.0, 10.0, 100.0][level];
        grid.lines(&mut pen, step, level, theme.grid);
    }
    for axis in plane.axes() {
        let reach = fine * 100.0 * LINES as f32;
        let start = if axis == plane.axes()[0] { [grid.centre[0], 0.0] } else { [0.0, grid.centre[1]] };
        grid.line(&mut pen, start, axis == plane.axes()[0], reach, 1.6, theme.world_axes[axis], None);
    }
}

/// The point of the plane that the camera looks at.
fn centre(sight: &Sight, plane: GridPlane) -> [f32; 2] {
    let normal = match plane {
        GridPlane::Ground => Vec3::Y,
        GridPlane::Front => Vec3::Z,
        GridPlane::Side => Vec3::X,
    };
    let towards = sight.plane.towards();
    let origin = sight.plane.origin;
    let slope = towards.dot(normal);
    // The point along the view onto the plane, unless it is far away; then straight down.
    let along = if slope.abs() > 0.15 { origin - towards * (origin.dot(normal) / slope) } else { origin };
    plane.axes().map(|axis| along[axis])
}

struct Grid<'a> {
    plane: GridPlane,
    flat: bool,
    sight: &'a Sight,
    centre: [f32; 2],
}

impl Grid<'_> {
    fn point(&self, u: f32, v: f32) -> Vec3 {
        let mut point = Vec3::ZERO;
        let [a, b] = self.plane.axes();
        point[a] = u;
        point[b] = v;
        if self.flat {
            return point;
        }
        // The grid is a little behind the plane, so that feet on the ground stay in front of it.
        match self.sight.plane.eye {
            Some(eye) => point + (point - eye) * 2e-4,
            None => point - self.sight.plane.towards() * self.sight.pixel,
        }
    }

    fn lines(&self, pen: &mut Pen, step: f32, level: usize, tint: Tint) {
        let reach = step * LINES as f32;
        for along_first in [true, false] {
            let across = if along_first { self.centre[1] } else { self.centre[0] };
            let middle = (across / step).round();
            for number in -LINES..=LINES {
                let line = middle + number as f32;
                // Lines that an axis or the next level draws.
                if line == 0.0 || (level < 2 && line.rem_euclid(10.0) == 0.0) {
                    continue;
                }
                let at = line * step;
                let start = if along_first { [self.centre[0], at] } else { [at, self.centre[1]] };
                self.line(pen, start, along_first, reach, 1.0, tint, Some(step));
            }
        }
    }

    /// Draws a line through `start`, fading towards `reach` from the centre and, given the spacing of its kind, where
    /// lines get too dense.
    fn line(
        &self,
        pen: &mut Pen,
        start: [f32; 2],
        along_first: bool,
        reach: f32,
        width: f32,
        tint: Tint,
        step: Option<f32>,
    ) {
        let place = |part: f32| {
            let offset = part * reach;
            if along_first { [start[0] + offset, start[1]] } else { [start[0], start[1] + offset] }
        };
        let mut from: Option<(Vec3, Tint)> = None;
        for piece in -PIECES..=PIECES {
            // Pieces are shorter near the centre, where detail matters.
            let part = piece as f32 / PIECES as f32;
            let [u, v] = place(part * part.abs());
            let point = self.point(u, v);
            let distance = Vec2::new(u - self.centre[0], v - self.centre[1]).length() / reach;
            let mut alpha = (1.0 - distance * distance).max(0.0);
            if let Some(step) = step {
                alpha *= self.density(point, step);
            }
            let here = (point, fade(tint, alpha));
            if let Some(last) = from
                && (last.1[3] > 0 || here.1[3] > 0)
            {
                pen.blend_line([last.0, here.0], width, 0.0, [last.1, here.1]);
            }
            from = Some(here);
        }
    }

    /// Visibility of lines `step` apart at a point: 0 where they would be a few pixels apart, 1 where there is room.
    fn density(&self, point: Vec3, step: f32) -> f32 {
        let pixel = self.sight.pixel_at(point);
        if pixel <= 0.0 {
            return 0.0;
        }
        let normal = match self.plane {
            GridPlane::Ground => Vec3::Y,
            GridPlane::Front => Vec3::Z,
            GridPlane::Side => Vec3::X,
        };
        let slope = self.sight.towards(point).dot(normal).abs();
        let pixels = step / pixel * ops::powf(slope.max(1e-4), 0.85);
        let part = ((pixels - 6.0) / 60.0).clamp(0.0, 1.0);
        0.25 * (part * 16.0).min(1.0) + 0.75 * part
    }
}
