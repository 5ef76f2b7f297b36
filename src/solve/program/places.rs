//! Transforms of one instance, or of several in step.
//!
//! The formulas are written once for both, so that an instance gets the same bits alone and among others, on every
//! platform: adding, multiplying, dividing and roots are rounded the same everywhere.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::{Quat, Vec3};
use wide::f32x4;

use crate::{mesh::model::Trs, rig::PoseOffset};

/// A number, or one for each of several instances.
pub(super) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Result of a comparison, for each of the instances.
    type Mask: Copy;

    /// Number for each of the instances.
    fn all(value: f32) -> Self;

    /// The square root.
    fn root(self) -> Self;

    /// Mask of the numbers that are zero.
    fn is_zero(self) -> Self::Mask;

    /// `yes` where the mask is set, elsewhere `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

impl Real for f32 {
    type Mask = bool;

    #[inline(always)]
    fn all(value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn is_zero(self) -> bool {
        self == 0.0
    }

    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl Real for f32x4 {
    type Mask = Self;

    #[inline(always)]
    fn all(value: f32) -> Self {
        Self::splat(value)
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn is_zero(self) -> Self {
        wide::CmpEq::cmp_eq(self, Self::ZERO)
    }

    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        mask.blend(yes, no)
    }
}

/// A rotation as x, y, z, w.
pub(super) type Turn<T> = [T; 4];

/// A transform.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<T> {
    pub translation: [T; 3],
    pub rotation: Turn<T>,
    pub scale: [T; 3],
}

impl<T: Real> Place<T> {
    /// Maps `local`, a transform relative to `self`, to the space in which `self` is given.
    #[inline(always)]
    pub fn place(&self, local: &Self) -> Self {
        Self {
            translation: self.point(local.translation),
            rotation: times(self.rotation, local.rotation),
            scale: each(self.scale, local.scale, T::mul),
        }
    }

    /// Transform with a pose offset on top.
    #[inline(always)]
    pub fn with(&self, offset: &Self) -> Self {
        let Self { translation, rotation, scale } = self.place(offset);
        Self { translation, rotation: unit(rotation), scale }
    }

    /// A transform relative to this one, the inverse of [`Self::place`]. Where an axis of this one is scaled to zero,
    /// the translation is zero and the factor one.
    #[inline(always)]
    pub fn relative(&self, transform: &Self) -> Self {
        let back = conjugate(self.rotation);
        let moved = turned(back, each(transform.translation, self.translation, T::sub));
        Self {
            translation: divided(moved, self.scale, 0.0),
            rotation: unit(times(back, transform.rotation)),
            scale: divided(transform.scale, self.scale, 1.0),
        }
    }

    /// `yes` where the mask is set, elsewhere `no`.
    #[inline(always)]
    pub fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let pick = |yes, no| T::select(mask, yes, no);
        Self {
            translation: each(yes.translation, no.translation, pick),
            rotation: std::array::from_fn(|at| pick(yes.rotation[at], no.rotation[at])),
            scale: each(yes.scale, no.scale, pick),
        }
    }

    #[inline(always)]
    fn point(&self, point: [T; 3]) -> [T; 3] {
        each(self.translation, turned(self.rotation, each(self.scale, point, T::mul)), T::add)
    }
}

impl From<&Trs> for Place<f32> {
    #[inline(always)]
    fn from(trs: &Trs) -> Self {
        let Trs { translation, rotation, scale } = trs;
        Self { translation: translation.to_array(), rotation: rotation.to_array(), scale: scale.to_array() }
    }
}

impl From<&PoseOffset> for Place<f32> {
    #[inline(always)]
    fn from(offset: &PoseOffset) -> Self {
        let PoseOffset { translation, rotation, scale } = offset;
        Self { translation: translation.to_array(), rotation: rotation.to_array(), scale: scale.to_array() }
    }
}

impl From<Place<f32>> for Trs {
    #[inline(always)]
    fn from(place: Place<f32>) -> Self {
        Self {
            translation: Vec3::from_array(place.translation),
            rotation: Quat::from_array(place.rotation),
            scale: Vec3::from_array(place.scale),
        }
    }
}

#[inline(always)]
fn each<T: Copy>(a: [T; 3], b: [T; 3], f: impl Fn(T, T) -> T) -> [T; 3] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
}

#[inline(always)]
fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A vector turned by a unit quaternion: `v + w t + q × t` with `t = 2 q × v`.
#[inline(always)]
pub(super) fn turned<T: Real>([x, y, z, w]: Turn<T>, v: [T; 3]) -> [T; 3] {
    let axis = [x, y, z];
    let t = cross(axis, v).map(|value| value + value);
    let u = cross(axis, t);
    std::array::from_fn(|at| v[at] + w * t[at] + u[at])
}

/// The rotation `b`, then `a`.
#[inline(always)]
pub(super) fn times<T: Real>(a: Turn<T>, b: Turn<T>) -> Turn<T> {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        (aw * bx + ax * bw) + (ay * bz - az * by),
        (aw * by + ay * bw) + (az * bx - ax * bz),
        (aw * bz + az * bw) + (ax * by - ay * bx),
        (aw * bw - ax * bx) - (ay * by + az * bz),
    ]
}

#[inline(always)]
fn conjugate<T: Real>([x, y, z, w]: Turn<T>) -> Turn<T> {
    [-x, -y, -z, w]
}

/// The quaternion scaled to unit length.
#[inline(always)]
pub(super) fn unit<T: Real>(q: Turn<T>) -> Turn<T> {
    let [x, y, z, w] = q;
    let by = T::all(1.0) / ((x * x + y * y) + (z * z + w * w)).root();
    q.map(|value| value * by)
}

/// Division axis by axis, with the value `otherwise` for a divisor of zero.
#[inline(always)]
fn divided<T: Real>(value: [T; 3], by: [T; 3], otherwise: f32) -> [T; 3] {
    each(value, by, |value, by| T::select(by.is_zero(), T::all(otherwise), value / by))
}
