//! Gizmos as values: positions of their handles on the screen, hit tests, and the effect of a drag.
//!
//! A gizmo has a position in the rig's space and keeps its size on the screen. Its handles are lines in pixels; the
//! same lines are tested and painted. Gizmos do not know joints: a drag gives a movement, a rotation or factors.

pub mod drag;

use bevy::{math::ops, prelude::*};

pub use drag::{Delta, GizmoDrag};

use crate::plugins::viewport::Sight;

/// Length of arrows, in pixels.
pub const LENGTH: f32 = 90.0;
/// Length of arrows inside rings, in pixels.
const SHORT: f32 = 58.0;
/// Radius of the rings about the axes, in pixels.
pub const RING: f32 = 74.0;
/// Radius of the ring about the view, in pixels.
pub const VIEW_RING: f32 = 92.0;
/// Largest distance of the pointer from a line that it hits, in pixels.
pub const REACH: f32 = 6.0;
/// Radius of the handle in the middle, in pixels.
const CENTRE: f32 = 8.0;
/// Distance from the middle to the start of arrows, in pixels.
const GAP: f32 = 14.0;
/// Extent of the squares between two axes: start and end along both, in pixels.
const SQUARE: [f32; 2] = [26.0, 44.0];
/// Half a side of the boxes at the ends of scale handles, in pixels.
const BOX: f32 = 5.0;
/// Segments of a ring.
const SEGMENTS: usize = 72;
/// Least visible share of an arrow's length; shorter arrows point at the viewer and are left out.
const LEAST_SHARE: f32 = 0.18;
/// Least sine of the angle at which squares are seen; flatter ones are left out.
const LEAST_SLANT: f32 = 0.2;

/// Position and axes of a gizmo, in the rig's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GizmoFrame {
    /// Position of the middle.
    pub origin: Vec3,
    /// Axes of unit length, perpendicular, right-handed.
    pub axes: [Vec3; 3],
}

/// Parts of a gizmo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GizmoParts {
    /// Arrows, squares and a middle that move.
    pub moves: bool,
    /// Rings that turn.
    pub turns: bool,
    /// Boxes and a middle that scale.
    pub scales: bool,
}

/// A part of a gizmo that can be dragged. Numbers are those of axes: 0 is X.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Handle {
    /// Moves along an axis.
    MoveAxis(usize),
    /// Moves in the plane perpendicular to an axis.
    MovePlane(usize),
    /// Moves in the plane of the view, at constant depth.
    MoveView,
    /// Turns about an axis.
    Ring(usize),
    /// Turns about the direction of the view.
    ViewRing,
    /// Scales along an axis.
    ScaleAxis(usize),
    /// Scales uniformly.
    ScaleAll,
}

impl Handle {
    /// Index of the handle's axis.
    pub fn axis(self) -> Option<usize> {
        match self {
            Self::MoveAxis(axis) | Self::MovePlane(axis) | Self::Ring(axis) | Self::ScaleAxis(axis) => Some(axis),
            Self::MoveView | Self::ViewRing | Self::ScaleAll => None,
        }
    }

    /// Rank among handles under the same pixel: the lowest number wins.
    fn rank(self) -> u8 {
        match self {
            Self::MoveView | Self::ScaleAll => 0,
            Self::MoveAxis(_) | Self::ScaleAxis(_) | Self::MovePlane(_) => 1,
            Self::Ring(_) => 2,
            Self::ViewRing => 3,
        }
    }
}

/// A handle on the screen.
#[derive(Debug, Clone, PartialEq)]
pub struct HandleShape {
    /// The handle.
    pub handle: Handle,
    /// Lines of the handle.
    pub lines: Vec<HandleLine>,
    /// Largest distance of the pointer that hits, in pixels.
    pub reach: f32,
}

/// A line of a handle, in pixels of the viewport.
#[derive(Debug, Clone, PartialEq)]
pub struct HandleLine {
    /// Points of the line.
    pub points: Vec<Vec2>,
    /// Paint of the line.
    pub paint: LinePaint,
}

/// Paint of a line, which also decides whether it can be hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinePaint {
    /// A line.
    Line,
    /// A thin line behind the middle, which cannot be hit.
    Far,
    /// The outline of an area.
    Area,
}

impl GizmoFrame {
    /// The handles in a view, in the order of painting; none if the middle is behind the camera.
    pub fn shapes(&self, parts: GizmoParts, sight: &Sight) -> Vec<HandleShape> {
        let mut shapes = Vec::new();
        let unit = sight.pixel_at(self.origin);
        let Some(middle) = sight.project(self.origin).filter(|_| unit > 0.0 && unit.is_finite()) else { return shapes };
        if parts.turns {
            shapes.push(shape(Handle::ViewRing, vec![area_or_line(circle(middle, VIEW_RING, SEGMENTS), false)]));
            shapes.extend((0..3).map(|axis| shape(Handle::Ring(axis), self.ring(axis, unit, sight))));
        }
        if parts.moves {
            shapes.extend((0..3).filter_map(|axis| self.square(axis, unit, sight)));
        }
        let length = if parts.turns { SHORT } else { LENGTH };
        for axis in 0..3 {
            let Some(line) = self.arrow(axis, length, unit, sight, middle) else { continue };
            let end = line[1];
            if parts.moves {
                let lines = vec![area_or_line(line.to_vec(), false), area_or_line(head(line), true)];
                shapes.push(shape(Handle::MoveAxis(axis), lines));
            }
            if parts.scales {
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let square = corners.map(|(x, y)| end + BOX * Vec2::new(x, y)).to_vec();
                let lines = vec![area_or_line(line.to_vec(), false), area_or_line(square, true)];
                shapes.push(shape(Handle::ScaleAxis(axis), lines));
            }
        }
        if let Some(handle) = parts.moves.then_some(Handle::MoveView).or(parts.scales.then_some(Handle::ScaleAll)) {
            let disc = area_or_line(circle(middle, CENTRE, 20), true);
            shapes.push(HandleShape { handle, lines: vec![disc], reach: 1.0 });
        }
        shapes
    }

    /// The lines of a ring, split into pieces before and behind the middle.
    fn ring(&self, axis: usize, unit: f32, sight: &Sight) -> Vec<HandleLine> {
        let (across, up) = (self.axes[(axis + 1) % 3], self.axes[(axis + 2) % 3]);
        let towards = sight.towards(self.origin);
        let arm = |number: usize| {
            let (sin, cos) = ops::sin_cos(number as f32 / SEGMENTS as f32 * std::f32::consts::TAU);
            across * cos + up * sin
        };
        let mut lines: Vec<HandleLine> = Vec::new();
        for number in 0..SEGMENTS {
            let (from, to) = (arm(number), arm(number + 1));
            let ends = [from, to].map(|arm| sight.project(self.origin + arm * (RING * unit)));
            let [Some(start), Some(end)] = ends else { continue };
            let paint = if (from + to).dot(towards) < -1e-3 { LinePaint::Far } else { LinePaint::Line };
            match lines.last_mut() {
                Some(line) if line.paint == paint && line.points.last() == Some(&start) => line.points.push(end),
                _ => lines.push(HandleLine { points: vec![start, end], paint }),
            }
        }
        lines
    }

    fn square(&self, axis: usize, unit: f32, sight: &Sight) -> Option<HandleShape> {
        if self.axes[axis].dot(sight.towards(self.origin)).abs() < LEAST_SLANT {
            return None;
        }
        let (a, b) = (self.axes[(axis + 1) % 3], self.axes[(axis + 2) % 3]);
        let [near, far] = SQUARE;
        let corners = [(near, near), (far, near), (far, far), (near, far)];
        let corners = corners.map(|(x, y)| sight.project(self.origin + (a * x + b * y) * unit));
        let points: Option<Vec<Vec2>> = corners.into_iter().collect();
        Some(HandleShape { handle: Handle::MovePlane(axis), lines: vec![area_or_line(points?, true)], reach: 2.0 })
    }

    /// Start and end of an arrow in pixels; `None` if the arrow points at the viewer.
    fn arrow(&self, axis: usize, length: f32, unit: f32, sight: &Sight, middle: Vec2) -> Option<[Vec2; 2]> {
        let place = |pixels: f32| sight.project(self.origin + self.axes[axis] * (pixels * unit));
        let (start, end) = (place(GAP)?, place(length)?);
        (end.distance(middle) >= LEAST_SHARE * length).then_some([start, end])
    }
}

/// The handle under a pixel.
pub fn handle_at(shapes: &[HandleShape], at: Vec2) -> Option<Handle> {
    let near = shapes.iter().filter_map(|shape| {
        let lines = shape.lines.iter().filter(|line| line.paint != LinePaint::Far);
        let distance = lines.map(|line| line.distance(at)).reduce(f32::min)?;
        (distance <= shape.reach).then_some((shape.handle, distance))
    });
    near.min_by(|(a, near_a), (b, near_b)| a.rank().cmp(&b.rank()).then(near_a.total_cmp(near_b)))
        .map(|(handle, _)| handle)
}

impl HandleLine {
    /// Distance of a pixel from the line; 0 inside an area.
    fn distance(&self, at: Vec2) -> f32 {
        let is_area = self.paint == LinePaint::Area;
        let ends = self.points.iter().zip(self.points.iter().cycle().skip(1));
        let count = if is_area { self.points.len() } else { self.points.len().saturating_sub(1) };
        let ends: Vec<(Vec2, Vec2)> = ends.take(count).map(|(a, b)| (*a, *b)).collect();
        let crossed = ends
            .iter()
            .filter(|(a, b)| (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x));
        if is_area && crossed.count() % 2 == 1 {
            return 0.0;
        }
        ends.iter().map(|(a, b)| to_segment(at, *a, *b)).fold(f32::INFINITY, f32::min)
    }
}

fn to_segment(at: Vec2, a: Vec2, b: Vec2) -> f32 {
    let along = b - a;
    let share = (at - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
    at.distance(a + along * share.clamp(0.0, 1.0))
}

fn shape(handle: Handle, lines: Vec<HandleLine>) -> HandleShape {
    HandleShape { handle, lines, reach: REACH }
}

fn area_or_line(points: Vec<Vec2>, is_area: bool) -> HandleLine {
    HandleLine { points, paint: if is_area { LinePaint::Area } else { LinePaint::Line } }
}

fn circle(middle: Vec2, radius: f32, segments: usize) -> Vec<Vec2> {
    let point = |number: usize| {
        let (sin, cos) = ops::sin_cos(number as f32 / segments as f32 * std::f32::consts::TAU);
        middle + radius * Vec2::new(cos, sin)
    };
    (0..=segments).map(point).collect()
}

/// The head of an arrow.
fn head([start, end]: [Vec2; 2]) -> Vec<Vec2> {
    let along = (end - start).try_normalize().unwrap_or(Vec2::X);
    let aside = along.perp();
    vec![end + along * 6.0, end - along * 8.0 + aside * 5.0, end - along * 8.0 - aside * 5.0]
}
