//! View planes: the plane that a user draws on, with the mapping from its points to rays into the model, and back.
//!
//! Points of a view plane are lengths along the view's right and up axes, in model units, from the plane's origin (for
//! clicks and strokes in files: the model's origin). An orthographic plane looks along its normal everywhere; a
//! perspective one looks from an eye through the point.

use bevy::math::ops;
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::mesh::ray::Ray;

/// Position of the camera, for a character that has Y up and faces +Z.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum View {
    /// The camera is on +Z and sees the face; right is +X, the character's left.
    #[default]
    Front,
    /// The camera is on -Z; right is -X.
    Back,
    /// The camera is on +X, the character's left; right is -Z.
    Left,
    /// The camera is on -X, the character's right; right is +Z.
    Right,
    /// The camera is on +Y; right is +X and up is -Z, so that the face looks down the screen.
    Top,
    /// The camera is on -Y; right is +X and up is +Z.
    Bottom,
    /// Yaw and pitch in degrees, starting from the front: a positive yaw moves the camera to the character's left
    /// (+X), a positive pitch moves it up. `Orbit(90, 0)` is [`View::Left`] and `Orbit(0, 90)` is [`View::Top`].
    Orbit(f32, f32),
}

impl View {
    /// The view's right, up and towards-the-camera axes: unit length, perpendicular, right-handed. Angles that are not
    /// finite count as zero.
    pub fn axes(self) -> [Vec3; 3] {
        match self {
            Self::Front => [Vec3::X, Vec3::Y, Vec3::Z],
            Self::Back => [Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z],
            Self::Left => [Vec3::NEG_Z, Vec3::Y, Vec3::X],
            Self::Right => [Vec3::Z, Vec3::Y, Vec3::NEG_X],
            Self::Top => [Vec3::X, Vec3::NEG_Z, Vec3::Y],
            Self::Bottom => [Vec3::X, Vec3::Z, Vec3::NEG_Y],
            Self::Orbit(yaw, pitch) => {
                let radians = |degrees: f32| if degrees.is_finite() { (degrees % 360.0).to_radians() } else { 0.0 };
                let (yaw, pitch) = (radians(yaw), radians(pitch));
                let (sin_yaw, cos_yaw) = (ops::sin(yaw), ops::cos(yaw));
                let (sin_pitch, cos_pitch) = (ops::sin(pitch), ops::cos(pitch));
                let right = Vec3::new(cos_yaw, 0.0, -sin_yaw);
                let towards = Vec3::new(sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch);
                [right, towards.cross(right), towards]
            }
        }
    }
}

/// A plane to draw on.
///
/// `right` and `up` have unit length and are perpendicular; the camera stands on the side of `right × up`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewPlane {
    /// The point of the plane with the coordinates (0, 0), in the surface's space.
    pub origin: Vec3,
    /// Direction of the first coordinate.
    pub right: Vec3,
    /// Direction of the second coordinate.
    pub up: Vec3,
    /// The camera's position for a perspective view; `None` for an orthographic one.
    pub eye: Option<Vec3>,
    /// Distance before the plane at which the rays of an orthographic view start: beyond the whole surface.
    pub standoff: f32,
}

impl ViewPlane {
    /// An orthographic plane through the model's origin. `bounds` are the least and greatest corner of the surface;
    /// empty or non-finite bounds count as the unit cube.
    pub fn orthographic(view: View, bounds: [Vec3; 2]) -> Self {
        let [right, up, towards] = view.axes();
        let [low, high] = if bounds[0].cmple(bounds[1]).all() && bounds[0].is_finite() && bounds[1].is_finite() {
            bounds
        } else {
            [Vec3::splat(-0.5), Vec3::splat(0.5)]
        };
        let nearest = Vec3::select(towards.cmpge(Vec3::ZERO), high, low);
        let standoff = nearest.dot(towards) + 0.1 * (high - low).length().max(f32::MIN_POSITIVE);
        Self { origin: Vec3::ZERO, right, up, eye: None, standoff }
    }

    /// A perspective plane: the camera stands at `eye` and its picture plane goes through `origin`, at right angles to
    /// the view's axis. Points on the plane have the same lengths as in the orthographic view of that plane.
    pub fn perspective(view: View, eye: Vec3, origin: Vec3) -> Self {
        let [right, up, _] = view.axes();
        Self { origin, right, up, eye: Some(eye), standoff: 0.0 }
    }

    /// The unit direction from the plane towards the camera.
    pub fn towards(&self) -> Vec3 {
        self.right.cross(self.up)
    }

    /// The point of space that lies on the plane at `point`.
    pub fn lift(&self, point: Vec2) -> Vec3 {
        self.origin + self.right * point.x + self.up * point.y
    }

    /// The ray of a click at `point`.
    pub fn ray(&self, point: Vec2) -> Ray {
        let on_plane = self.lift(point);
        let towards = self.towards();
        match self.eye {
            Some(eye) => Ray { origin: eye, direction: (on_plane - eye).try_normalize().unwrap_or(-towards) },
            None => Ray { origin: on_plane + towards * self.standoff, direction: -towards },
        }
    }

    /// Coordinates of `position` on the plane. `None` in a perspective view for a position level with or behind the
    /// eye.
    pub fn project(&self, position: Vec3) -> Option<Vec2> {
        let flat = |p: Vec3| Vec2::new((p - self.origin).dot(self.right), (p - self.origin).dot(self.up));
        let Some(eye) = self.eye else { return Some(flat(position)) };
        let towards = self.towards();
        let depth = (eye - position).dot(towards);
        let plane_depth = (eye - self.origin).dot(towards);
        (depth > 0.0).then(|| flat(eye + (position - eye) * (plane_depth / depth)))
    }
}
