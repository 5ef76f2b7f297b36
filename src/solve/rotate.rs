//! Rotations for the solvers: safe on any input, with the same bits on every machine.
//!
//! Trigonometry goes through [`bevy::math::ops`], so that it can be made equal on every platform in one place.

use bevy::math::{Mat3, Quat, Vec3, ops};

const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

/// Sine of the angle under which two directions count as parallel.
pub const PARALLEL: f32 = 1e-5;

/// The direction of `v` with unit length; `None` for a vector without one (zero, or not finite).
#[inline]
pub fn direction(v: Vec3) -> Option<Vec3> {
    let square = v.length_squared();
    if square > 1e-24 && square < 1e24 {
        return Some(v * (1.0 / square.sqrt()));
    }
    // Dividing first keeps squares of tiny and huge vectors in range. A sum, because a maximum may pass over NaN.
    let size = v.x.abs() + v.y.abs() + v.z.abs();
    (size > f32::MIN_POSITIVE && size < f32::INFINITY).then(|| (v / size).normalize())
}

/// The direction of the part of `v` that is perpendicular to the unit vector `axis`; `None` if they are parallel or `v`
/// has no direction.
#[inline]
pub fn perpendicular(v: Vec3, axis: Vec3) -> Option<Vec3> {
    let v = direction(v)?;
    let part = v - axis * v.dot(axis);
    let square = part.length_squared();
    if square <= PARALLEL * PARALLEL {
        return None;
    }
    let part = part * (1.0 / square.sqrt());
    if square > 0.01 {
        return Some(part);
    }
    // A second projection: the rest of a nearly parallel vector after the first subtraction is not yet perpendicular.
    direction(part - axis * part.dot(axis))
}

/// A unit vector perpendicular to the unit vector `axis`: along the first of `wanted` that is not parallel to it, else
/// one that depends on `axis` only.
#[inline]
pub fn perpendicular_or_any(axis: Vec3, wanted: &[Vec3]) -> Vec3 {
    wanted.iter().find_map(|v| perpendicular(*v, axis)).unwrap_or_else(|| axis.any_orthonormal_vector())
}

/// The rotation about the unit vector `axis` by `angle` in radians.
#[inline]
pub fn about(axis: Vec3, angle: f32) -> Quat {
    let (sin, cos) = ops::sin_cos(0.5 * angle);
    let v = axis * sin;
    Quat::from_xyzw(v.x, v.y, v.z, cos)
}

/// The shortest rotation that takes the unit vector `from` to the unit vector `to`.
///
/// For opposite vectors the result is half a turn about the part of `hint` that is perpendicular to `from`, else about
/// an axis that depends on `from` only.
#[inline]
pub fn arc(from: Vec3, to: Vec3, hint: Vec3) -> Quat {
    let dot = from.dot(to);
    if dot > -0.7 {
        let axis = from.cross(to);
        return Quat::from_xyzw(axis.x, axis.y, axis.z, 1.0 + dot).normalize();
    }
    // Near half a turn the formula above loses its digits: half a turn, then the small rest.
    let axis = from.cross(to);
    let axis = if axis.length_squared() > 1e-12 { axis } else { hint };
    let axis = perpendicular_or_any(from, &[axis]);
    let rest = (-from).cross(to);
    let rest = Quat::from_xyzw(rest.x, rest.y, rest.z, 1.0 - dot).normalize();
    (rest * Quat::from_xyzw(axis.x, axis.y, axis.z, 0.0)).normalize()
}

/// The rotation that takes X to `x` and Y to `y`, which are perpendicular and of unit length.
#[inline]
pub fn frame(x: Vec3, y: Vec3) -> Quat {
    Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y))).normalize()
}

/// The rotation that takes the perpendicular unit vectors `from` to the perpendicular unit vectors `to`.
#[inline]
pub fn between_frames(from: [Vec3; 2], to: [Vec3; 2]) -> Quat {
    let from = Mat3::from_cols(from[0], from[1], from[0].cross(from[1]));
    let to = Mat3::from_cols(to[0], to[1], to[0].cross(to[1]));
    Quat::from_mat3(&(to * from.transpose())).normalize()
}

/// A unit quaternion; a quaternion that is zero or not finite becomes the identity.
#[inline]
pub fn unit(q: Quat) -> Quat {
    let length = q.length_squared();
    if length > 1e-30 && length < f32::INFINITY { q * (1.0 / length.sqrt()) } else { Quat::IDENTITY }
}

/// The axis of a rotation times its angle in radians, at most half a turn.
#[inline]
pub fn scaled_axis(q: Quat) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let sin = q.xyz().length();
    if sin < 1e-6 {
        return 2.0 * q.xyz();
    }
    q.xyz() * (2.0 * ops::atan2(sin, q.w) / sin)
}

/// The rotation about the direction of `axis` by its length in radians: the inverse of [`scaled_axis`].
#[inline]
pub fn from_scaled_axis(axis: Vec3) -> Quat {
    let angle = axis.length();
    if angle < 1e-6 {
        let v = 0.5 * axis;
        return unit(Quat::from_xyzw(v.x, v.y, v.z, 1.0));
    }
    about(axis / angle, angle)
}

/// The rotation a share `t` of the shortest way from `a` to `b`, at constant speed (Shoemake 1985).
#[inline]
pub fn slerp(a: Quat, b: Quat, t: f32) -> Quat {
    let dot = a.dot(b);
    let (b, dot) = if dot < 0.0 { (-b, -dot) } else { (b, dot) };
    if dot > 0.9995 {
        return unit(a + (b - a) * t);
    }
    let angle = ops::acos(dot.min(1.0));
    let sum = a * ops::sin((1.0 - t) * angle) + b * ops::sin(t * angle);
    unit(sum)
}

/// An order of three rotations about the axes.
///
/// Rotations are about the turned axes (intrinsic), in the order of the name: `Xyz` is the product of the rotations
/// about X, Y and Z, the convention of glam's `EulerRot` of the same name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum EulerOrder {
    /// X, then the turned Y, then the turned Z.
    #[default]
    Xyz,
    /// X, Z, Y.
    Xzy,
    /// Y, X, Z.
    Yxz,
    /// Y, Z, X.
    Yzx,
    /// Z, X, Y.
    Zxy,
    /// Z, Y, X.
    Zyx,
}

impl EulerOrder {
    /// The axes in order, and the sign of their permutation.
    #[inline]
    fn axes(self) -> ([usize; 3], f32) {
        match self {
            Self::Xyz => ([0, 1, 2], 1.0),
            Self::Xzy => ([0, 2, 1], -1.0),
            Self::Yxz => ([1, 0, 2], -1.0),
            Self::Yzx => ([1, 2, 0], 1.0),
            Self::Zxy => ([2, 0, 1], 1.0),
            Self::Zyx => ([2, 1, 0], -1.0),
        }
    }

    /// The rotation with these angles in radians about X, Y and Z.
    pub fn rotation(self, angles: Vec3) -> Quat {
        let ([i, j, k], _) = self.axes();
        let turn = |axis: usize| about(AXES[axis], angles[axis]);
        (turn(i) * turn(j) * turn(k)).normalize()
    }

    /// The angles in radians about X, Y and Z of a rotation: the middle one within a quarter turn, the others within
    /// half a turn. Where the middle axis stands at a quarter turn, the last angle is zero.
    pub fn angles(self, rotation: Quat) -> Vec3 {
        let ([i, j, k], sign) = self.axes();
        let columns = Mat3::from_quat(rotation).to_cols_array_2d();
        let at = |row: usize, column: usize| columns[column][row];
        let sin = (sign * at(i, k)).clamp(-1.0, 1.0);
        let mut angles = Vec3::ZERO;
        // The cosine comes from two entries of the matrix: the arc sine alone is inaccurate near a quarter turn.
        let cos = (at(i, i) * at(i, i) + at(i, j) * at(i, j)).sqrt();
        angles[j] = ops::atan2(sin, cos);
        if cos > 1e-5 {
            angles[i] = ops::atan2(-sign * at(j, k), at(k, k));
            angles[k] = ops::atan2(-sign * at(i, j), at(i, i));
        } else {
            angles[i] = ops::atan2(sign * at(k, j), at(j, j));
        }
        angles
    }

    /// The other triple of angles of the same rotation, with the middle one past a quarter turn.
    pub(super) fn other(self, angles: Vec3) -> Vec3 {
        let ([i, j, k], _) = self.axes();
        let mut other = angles;
        other[i] += std::f32::consts::PI;
        other[j] = std::f32::consts::PI - angles[j];
        other[k] += std::f32::consts::PI;
        other
    }
}
