//! Shapes of joints and bones: sizes and corners, without colours.

use bevy::prelude::*;

/// Least radius of a ball, in pixels.
pub const LEAST_BALL: f32 = 4.0;
/// Usual radius of a ball in pixels, kept while its bone grows on the screen, until the view is near.
pub const USUAL_BALL: f32 = 8.0;

/// Radius in pixels of a joint's ball whose bone is `bone` pixels long.
///
/// The radius is a twelfth of the bone, at most a fifth; between [`LEAST_BALL`] and [`USUAL_BALL`], and growing again,
/// slowly, when a bone fills much of the view. `scale` multiplies everything but the least radius. Never less than
/// [`LEAST_BALL`], also for lengths that are not finite.
pub fn ball_radius(bone: f32, scale: f32) -> f32 {
    let bone = if bone.is_finite() { bone.max(0.0) } else { 0.0 };
    let wanted = (bone / 12.0).min(USUAL_BALL).max(bone / 40.0) * scale;
    wanted.min(bone * 0.2).max(LEAST_BALL)
}

/// An octahedral bone: thin at both ends, widest a tenth of the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Octahedron {
    /// Start of the bone.
    pub head: Vec3,
    /// End of the bone.
    pub tail: Vec3,
    /// The four corners of its widest section, in turn.
    pub waist: [Vec3; 4],
}

/// Corners of a face of an [`Octahedron`] and its outward normal (not of unit length).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Corners.
    pub corners: [Vec3; 3],
    /// Outward direction.
    pub normal: Vec3,
}

impl Octahedron {
    /// A bone between two points, with a waist `width` from its axis whose corners lie in the direction of `side`, as
    /// far as possible. `None` for a bone without length.
    pub fn new(head: Vec3, tail: Vec3, width: f32, side: Vec3) -> Option<Self> {
        let along = tail - head;
        let length = along.length();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let axis = along / length;
        let side = side - axis * side.dot(axis);
        let side = if side.length_squared() > 1e-6 { side.normalize() } else { axis.any_orthonormal_vector() };
        let other = axis.cross(side);
        let middle = head + along * 0.1;
        // The corners lie halfway between the axes: flat sides face the joint's axes.
        let (a, b) = ((side + other) * (width * 0.707), (other - side) * (width * 0.707));
        Some(Self { head, tail, waist: [middle + a, middle + b, middle - a, middle - b] })
    }

    /// The eight faces: first the four around the head, then the four around the tail, each over the same side of the
    /// waist.
    pub fn faces(&self) -> [Face; 8] {
        std::array::from_fn(|number| {
            let side = number % 4;
            let (a, b) = (self.waist[side], self.waist[(side + 1) % 4]);
            let corners = if number < 4 { [self.head, b, a] } else { [self.tail, a, b] };
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            Face { corners, normal }
        })
    }

    /// The twelve edges with the numbers of the two faces that meet there.
    pub fn edges(&self) -> [([Vec3; 2], [usize; 2]); 12] {
        std::array::from_fn(|number| {
            let side = number % 4;
            let (before, corner) = ((side + 3) % 4, self.waist[side]);
            match number / 4 {
                0 => ([self.head, corner], [before, side]),
                1 => ([corner, self.waist[(side + 1) % 4]], [side, side + 4]),
                _ => ([corner, self.tail], [before + 4, side + 4]),
            }
        })
    }
}
