//! The viewport's camera: conversion of pixels to rays and back.

use bevy::prelude::*;

use crate::{algo::view::ViewPlane, mesh::ray::Ray};

/// Vertical field of view of perspective cameras, in radians: approximately that of a 50 mm lens.
pub const FIELD_OF_VIEW: f32 = 0.55;

/// Target point of a camera and its distance from it with which a box fills the picture.
///
/// `bounds` are the box's least and greatest corner; `axes` the view's right, up and towards-the-camera axes; `aspect`
/// is the picture's width over its height. For an orthographic camera the same distance gives the same size at the
/// point, with a height of `2 tan(FIELD_OF_VIEW / 2)` times the distance.
pub fn framing(bounds: [Vec3; 2], axes: [Vec3; 3], aspect: f32) -> (Vec3, f32) {
    let [low, high] = bounds;
    let reach = (high - low) * 0.5;
    let [across, tall, before] = axes.map(|axis| reach.dot(axis.abs()));
    let half = bevy::math::ops::tan(FIELD_OF_VIEW * 0.5);
    let distance = 1.12 * (tall / half).max(across / (half * aspect.max(0.1))) + before;
    ((low + high) * 0.5, distance.max(1e-3))
}

/// Least share of a picture's height that a box is framed into beside bars.
const LEAST_FREE: f32 = 0.4;

/// [`framing`] in a picture of `size` pixels that bars cover in part: the box fills the room above the bars at the bottom.
///
/// A bar counts if it reaches into the middle half of the box, as it would be without bars; one in a corner covers nothing.
pub fn framing_beside(bounds: [Vec3; 2], axes: [Vec3; 3], size: Vec2, bars: &[Rect]) -> (Vec3, f32) {
    let aspect = if size.y > 0.0 { size.x / size.y } else { 1.5 };
    let (centre, distance) = framing(bounds, axes, aspect);
    let [across, tall, before] = axes.map(|axis| ((bounds[1] - bounds[0]) * 0.5).dot(axis.abs()));
    let half = bevy::math::ops::tan(FIELD_OF_VIEW * 0.5);
    let pixels = size.y / (2.0 * half * (distance - before).max(1e-6));
    let covers = |bar: &&Rect| {
        let apart = (bar.min.x - size.x * 0.5).max(size.x * 0.5 - bar.max.x);
        let is_beside = apart >= 0.5 * across * pixels || bar.min.y >= size.y * 0.5 + tall * pixels;
        bar.center().y > size.y * 0.5 && !is_beside
    };
    let covering = bars.iter().filter(covers);
    let free = covering.map(|bar| bar.min.y).fold(size.y, f32::min).max(LEAST_FREE * size.y);
    if free >= size.y {
        return (centre, distance);
    }
    let distance = 1.12 * (tall * size.y / (half * free)).max(across / (half * aspect.max(0.1))) + before;
    let distance = distance.max(1e-3);
    // Measured on the near side of the box, which looks largest.
    let shift = (size.y - free) * half * (distance - before) / size.y;
    (centre - axes[1] * shift, distance)
}

/// Movement of a camera across its view that goes with an approach, so that everything under a pixel stays under that pixel.
///
/// `axes` are the view's right and up axes, `at` is the pixel in a picture of `size` pixels, and `approach` is the length by
/// which the camera comes nearer to its focus, in any unit. The same movement holds for the orthographic cameras of [`framing`].
pub fn zoom_shift(axes: [Vec3; 2], at: Vec2, size: Vec2, approach: f32) -> Vec3 {
    let off = at - size * 0.5;
    let slope = 2.0 * bevy::math::ops::tan(FIELD_OF_VIEW * 0.5) / size.y.max(1.0);
    (axes[0] * off.x - axes[1] * off.y) * (slope * approach)
}

/// Marks the camera of the viewport.
#[derive(Component, Reflect, Debug, Clone, Copy)]
#[reflect(Component, Default)]
pub struct RigViewport {
    /// Distance from the camera of the point that it orbits, in world units. Strokes in a perspective view are measured
    /// on the plane at that distance.
    pub focus: f32,
}

impl Default for RigViewport {
    fn default() -> Self {
        Self { focus: 5.0 }
    }
}

/// View through a camera as numbers: enough to convert pixels to rays in a rig's space and positions to pixels.
///
/// Pixels are logical, from the viewport's top left corner, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// The plane perpendicular to the view through the camera's orbit point, in the rig's space.
    pub plane: ViewPlane,
    /// Length of a logical pixel on that plane, in the rig's units.
    pub pixel: f32,
    /// Size of the viewport in logical pixels.
    pub size: Vec2,
}

impl Sight {
    /// View through a camera of a rig at `place`.
    ///
    /// `size` is the viewport's in logical pixels. `None` if it is empty, or the projection is neither perspective nor
    /// orthographic.
    pub fn new(
        camera: &GlobalTransform,
        projection: &Projection,
        viewport: &RigViewport,
        size: Vec2,
        place: &GlobalTransform,
    ) -> Option<Self> {
        if !(size.x >= 1.0 && size.y >= 1.0) {
            return None;
        }
        let to_rig = place.affine().inverse();
        let direction = |d: Dir3| to_rig.transform_vector3(*d);
        let (right, up, back) = (direction(camera.right()), direction(camera.up()), direction(camera.back()));
        let unit = right.length();
        let eye = to_rig.transform_point3(camera.translation());
        let focus = viewport.focus.max(1e-6);
        let origin = eye - back * focus;
        let (plane_eye, height) = match projection {
            Projection::Perspective(perspective) => {
                (Some(eye), 2.0 * focus * bevy::math::ops::tan(perspective.fov * 0.5))
            }
            Projection::Orthographic(orthographic) => (None, orthographic.area.height()),
            Projection::Custom(_) => return None,
        };
        // Rays of an orthographic view start behind the camera as well, so that a near camera never cuts the mesh open.
        let standoff = unit * focus * 1e3;
        let plane = ViewPlane { origin, right: right / unit, up: up / unit, eye: plane_eye, standoff };
        let pixel = height * unit / size.y;
        (pixel > 0.0 && pixel.is_finite() && origin.is_finite()).then_some(Self { plane, pixel, size })
    }

    /// The point of the plane under a pixel.
    pub fn point(&self, at: Vec2) -> Vec2 {
        let centred = at - self.size * 0.5;
        Vec2::new(centred.x, -centred.y) * self.pixel
    }

    /// The pixel over a point of the plane.
    pub fn pixel_of(&self, point: Vec2) -> Vec2 {
        Vec2::new(point.x, -point.y) / self.pixel + self.size * 0.5
    }

    /// The ray under a pixel, in the rig's space.
    pub fn ray(&self, at: Vec2) -> Ray {
        self.plane.ray(self.point(at))
    }

    /// Pixel of a position in the rig's space; `None` behind the camera.
    pub fn project(&self, position: Vec3) -> Option<Vec2> {
        self.plane.project(position).map(|point| self.pixel_of(point))
    }

    /// Length in the rig's units of a logical pixel at a position.
    pub fn pixel_at(&self, position: Vec3) -> f32 {
        match self.plane.eye {
            None => self.pixel,
            Some(eye) => {
                let towards = self.plane.towards();
                let focus = (eye - self.plane.origin).dot(towards);
                let depth = (eye - position).dot(towards);
                self.pixel * (depth / focus).max(0.0)
            }
        }
    }

    /// The unit direction from a position towards the camera.
    pub fn towards(&self, position: Vec3) -> Vec3 {
        let fallback = self.plane.towards();
        self.plane.eye.map_or(fallback, |eye| (eye - position).try_normalize().unwrap_or(fallback))
    }
}
