//! Triangles for pictures over the mesh: lines, discs and faces with sizes in pixels.
//!
//! All geometry is built on the processor for one view. That keeps sizes in pixels where tests can measure them, and
//! one mesh a rig is all that the renderer sees.

use std::f32::consts::TAU;

use bevy::{math::ops, prelude::*};

use super::theme::Tint;
use crate::plugins::viewport::Sight;

/// The part of the depth buffer that pictures over the mesh share: in front of everything else, yet ordered among
/// themselves (1 is the near plane). In a perspective view only objects that almost touch the camera share this range;
/// depth in an orthographic view is linear, so the range must be thin: with Bevy's range of a kilometre, a metre.
const FRONT: [f32; 2] = [0.9, 0.9998];
const FLAT_FRONT: [f32; 2] = [0.999, 0.9998];

/// Triangles with colours, in the rig's space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ink {
    /// Positions of the vertices.
    pub positions: Vec<[f32; 3]>,
    /// Depth of each vertex in the depth buffer, 0 far to 1 near; exactly 0 keeps the camera's depth.
    pub depths: Vec<f32>,
    /// Colours of the vertices.
    pub tints: Vec<Tint>,
    /// Three vertices a triangle, in no particular winding.
    pub indices: Vec<u32>,
}

impl Ink {
    /// Returns `true` without triangles.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// Empty ink with the capacity that `other` uses.
    pub fn with_capacity_of(other: &Self) -> Self {
        let (vertices, indices) = (other.positions.len(), other.indices.len());
        Self {
            positions: Vec::with_capacity(vertices),
            depths: Vec::with_capacity(vertices),
            tints: Vec::with_capacity(vertices),
            indices: Vec::with_capacity(indices),
        }
    }
}

/// Depth of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Layer {
    /// Place over the mesh, sorted among the pictures over it.
    Over,
    /// Place in the scene: nearer objects hide the picture.
    Scene,
    /// Exactly this depth (see [`Ink::depths`]).
    Fixed(f32),
}

/// Draws into [`Ink`] for one view.
pub struct Pen<'a> {
    /// Ink that it draws into.
    pub ink: &'a mut Ink,
    /// The view it draws for.
    pub sight: &'a Sight,
    /// Depth of its drawings.
    pub layer: Layer,
    towards: Vec3,
    focus: f32,
    span: f32,
}

impl<'a> Pen<'a> {
    /// A pen over the mesh.
    pub fn new(ink: &'a mut Ink, sight: &'a Sight) -> Self {
        let towards = sight.plane.towards();
        let focus = sight.plane.eye.map_or(1.0, |eye| (eye - sight.plane.origin).dot(towards)).max(1e-9);
        let span = sight.pixel * sight.size.max_element();
        Self { ink, sight, layer: Layer::Over, towards, focus, span }
    }

    /// Distance from the eye along the view; from the view plane in an orthographic view.
    pub fn distance(&self, position: Vec3) -> f32 {
        (self.sight.plane.eye.unwrap_or(self.sight.plane.origin) - position).dot(self.towards)
    }

    /// Depth of a point that lies `lift` nearer to the camera than `position`. Nearer points have greater depths.
    pub fn depth(&self, position: Vec3, lift: f32) -> f32 {
        let [far, near] = if self.sight.plane.eye.is_some() { FRONT } else { FLAT_FRONT };
        match self.layer {
            Layer::Scene => 0.0,
            Layer::Fixed(depth) => depth,
            Layer::Over => {
                let distance = self.distance(position) - lift;
                let part = match self.sight.plane.eye {
                    // The depth is affine in the reciprocal distance, so that flat faces stay flat in depth.
                    Some(_) if distance > 0.0 => (self.focus / 32.0 / distance).min(1.0),
                    Some(_) => 1.0,
                    None => 0.5 - 0.5 * distance / (distance.abs() + self.span),
                };
                far + (near - far) * part
            }
        }
    }

    /// Adds a vertex; `lift` brings it nearer in depth only.
    pub fn vertex(&mut self, position: Vec3, lift: f32, tint: Tint) -> u32 {
        let depth = self.depth(position, lift);
        let index = self.ink.positions.len() as u32;
        self.ink.positions.push(position.to_array());
        self.ink.depths.push(depth);
        self.ink.tints.push(tint);
        index
    }

    /// Draws a triangle of one colour.
    pub fn triangle(&mut self, corners: [Vec3; 3], lift: f32, tint: Tint) {
        let corners = corners.map(|corner| self.vertex(corner, lift, tint));
        self.ink.indices.extend(corners);
    }

    /// Draws a flat quad of one colour, corners in turn.
    pub fn quad(&mut self, corners: [Vec3; 4], lift: f32, tint: Tint) {
        let [a, b, c, d] = corners.map(|corner| self.vertex(corner, lift, tint));
        self.ink.indices.extend([a, b, c, a, c, d]);
    }

    /// Draws a line `width` pixels wide, facing the camera, with square ends. The part behind the camera is cut off.
    pub fn line(&mut self, ends: [Vec3; 2], width: f32, lift: f32, tint: Tint) {
        self.blend_line(ends, width, lift, [tint, tint]);
    }

    /// Draws a line with a colour gradient.
    pub fn blend_line(&mut self, ends: [Vec3; 2], width: f32, lift: f32, tints: [Tint; 2]) {
        let Some([from, to]) = self.before_eye(ends) else { return };
        let along = to - from;
        let halves = [from, to].map(|end| 0.5 * width * self.sight.pixel_at(end));
        let across = along.cross(self.sight.towards(from.midpoint(to))).normalize_or_zero();
        if across == Vec3::ZERO {
            return;
        }
        let along = along.normalize_or_zero();
        let [a, b] = [from - along * halves[0], to + along * halves[1]];
        let corners = [
            self.vertex(a - across * halves[0], lift, tints[0]),
            self.vertex(a + across * halves[0], lift, tints[0]),
            self.vertex(b + across * halves[1], lift, tints[1]),
            self.vertex(b - across * halves[1], lift, tints[1]),
        ];
        let [a, b, c, d] = corners;
        self.ink.indices.extend([a, b, c, a, c, d]);
    }

    /// The part of a line before the eye.
    fn before_eye(&self, ends: [Vec3; 2]) -> Option<[Vec3; 2]> {
        if self.sight.plane.eye.is_none() {
            return Some(ends);
        }
        let least = self.focus * 1e-3;
        let [a, b] = ends.map(|end| self.distance(end));
        let cut = |from: Vec3, to: Vec3, near: f32, far: f32| from.lerp(to, (least - near) / (far - near));
        match (a >= least, b >= least) {
            (true, true) => Some(ends),
            (false, false) => None,
            (false, true) => Some([cut(ends[0], ends[1], a, b), ends[1]]),
            (true, false) => Some([ends[0], cut(ends[1], ends[0], b, a)]),
        }
    }

    /// Number of corners with which a circle looks round.
    fn corners(&self, centre: Vec3, radius: f32) -> u32 {
        let pixels = radius / self.sight.pixel_at(centre).max(f32::MIN_POSITIVE);
        ((pixels.max(0.0).sqrt() * 5.0) as u32).clamp(8, 48)
    }

    /// Draws a disc that faces the camera, with a lighter spot up and to the left that makes it look like a ball.
    pub fn ball(&mut self, centre: Vec3, radius: f32, lift: f32, spot: Tint, rim: Tint) {
        let (right, up) = (self.sight.plane.right * radius, self.sight.plane.up * radius);
        let middle = self.vertex(centre - right * 0.32 + up * 0.32, lift, spot);
        let count = self.corners(centre, radius);
        let first = middle + 1;
        for (corner, at) in circle(count) {
            self.vertex(centre + right * at.x + up * at.y, lift, rim);
            self.ink.indices.extend([middle, first + corner, first + (corner + 1) % count]);
        }
    }

    /// Draws a ring that faces the camera, between two radii. `corners` of `None` makes it round.
    pub fn ring(&mut self, centre: Vec3, radii: [f32; 2], corners: Option<u32>, lift: f32, tint: Tint) {
        let (right, up) = (self.sight.plane.right, self.sight.plane.up);
        let count = corners.unwrap_or_else(|| self.corners(centre, radii[1]));
        let first = self.ink.positions.len() as u32;
        for (corner, at) in circle(count) {
            let outwards = right * at.x + up * at.y;
            self.vertex(centre + outwards * radii[0], lift, tint);
            self.vertex(centre + outwards * radii[1], lift, tint);
            let (here, next) = (first + 2 * corner, first + 2 * ((corner + 1) % count));
            self.ink.indices.extend([here, here + 1, next + 1, here, next + 1, next]);
        }
    }
}

/// Points around the unit circle with their numbers. A single sine gives all of them: balls have many corners.
fn circle(count: u32) -> impl Iterator<Item = (u32, Vec2)> {
    let (sin, cos) = ops::sin_cos(TAU / count as f32);
    let turn = Vec2::new(cos, sin);
    (0..count).scan(Vec2::X, move |next, number| {
        let at = *next;
        *next = at.rotate(turn);
        Some((number, at))
    })
}
