//! Weighted blends of targets, and offsets kept from them.
//!
//! Weights are relative: they are divided by their sum; negative and non-finite weights count as zero. Transforms are
//! multiplied as Bevy multiplies two `Transform`s: translations are scaled, turned and moved, rotations follow one
//! another, scales are multiplied axis by axis. So there is never any shear, and the way back is exact.

use bevy::math::{Quat, Vec3};

use crate::{
    mesh::model::Trs,
    solve::rotate::{slerp, unit},
};

/// A weight, or zero if it is negative or not finite.
#[inline]
fn usable(weight: f32) -> f32 {
    if weight > 0.0 && weight < f32::INFINITY { weight } else { 0.0 }
}

/// The weighted mean of points (or of scales); `None` without weight.
#[inline]
pub fn blend_points(targets: impl IntoIterator<Item = (Vec3, f32)>) -> Option<Vec3> {
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for (point, weight) in targets {
        let weight = usable(weight);
        if weight > 0.0 && point.is_finite() {
            sum += point * weight;
            total += weight;
        }
    }
    let mean = sum / total;
    (total > 0.0 && mean.is_finite()).then_some(mean)
}

/// The weighted mean of rotations; `None` without weight.
///
/// The normalised sum of the quaternions, each with the sign that is nearer to the first target (whatever its weight),
/// so the mean moves continuously with weights and with targets within half a turn of the first. It does not depend on
/// the order of targets that lie within a quarter turn of one another. For two targets it follows the shortest way. The
/// first target is the mean if the sum vanishes.
#[inline]
pub fn blend_rotations(targets: impl IntoIterator<Item = (Quat, f32)>) -> Option<Quat> {
    let (mut sum, mut total) = (Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), 0.0);
    let mut first = None;
    for (rotation, weight) in targets {
        let weight = usable(weight);
        if !rotation.is_finite() {
            continue;
        }
        let rotation = unit(rotation);
        let reference = *first.get_or_insert(rotation);
        let weight_signed = if reference.dot(rotation) < 0.0 { -weight } else { weight };
        sum += rotation * weight_signed;
        total += weight;
    }
    if total <= 0.0 || !total.is_finite() {
        return None;
    }
    let length = sum.length();
    if length > 1e-6 * total { Some(sum * (1.0 / length)) } else { first }
}

/// The weighted mean of transforms, part by part; `None` without weight.
#[inline]
pub fn blend<I>(targets: I) -> Option<Trs>
where
    I: IntoIterator<Item = (Trs, f32)>,
    I::IntoIter: Clone,
{
    let targets = targets.into_iter();
    Some(Trs {
        translation: blend_points(targets.clone().map(|(trs, weight)| (trs.translation, weight)))?,
        rotation: blend_rotations(targets.clone().map(|(trs, weight)| (trs.rotation, weight)))?,
        scale: blend_points(targets.map(|(trs, weight)| (trs.scale, weight)))?,
    })
}

/// The transform a share `t` (0 to 1) of the way from `a` to `b`: exactly `a` at 0 and `b` at 1; rotations by the
/// shortest way at constant speed.
#[inline]
pub fn mix(a: &Trs, b: &Trs, t: f32) -> Trs {
    if t >= 1.0 {
        return *b;
    }
    if t.is_nan() || t <= 0.0 {
        return *a;
    }
    Trs {
        translation: a.translation + (b.translation - a.translation) * t,
        rotation: slerp(a.rotation, b.rotation, t),
        scale: a.scale + (b.scale - a.scale) * t,
    }
}

/// The transform `child`, given relative to `parent`, in the space that `parent` is given in.
#[inline]
pub fn multiply(parent: &Trs, child: &Trs) -> Trs {
    Trs {
        translation: parent.translation + parent.rotation * (parent.scale * child.translation),
        rotation: (parent.rotation * child.rotation).normalize(),
        scale: parent.scale * child.scale,
    }
}

/// `transform` relative to `parent`: [`multiply`] of `parent` and the result is `transform`, for scales that are not zero.
/// Along an axis on which `parent` is scaled to zero, the translation is zero and the factor one.
///
/// A constraint keeps its offset so: `relative(target, driven)` when it is built, and `multiply(target, offset)` each
/// frame.
#[inline]
pub fn relative(parent: &Trs, transform: &Trs) -> Trs {
    let back = parent.rotation.conjugate();
    let moved = back * (transform.translation - parent.translation);
    // Most parents have a scale of one: dividing by it changes no bit.
    if parent.scale == Vec3::ONE {
        let rotation = (back * transform.rotation).normalize();
        return Trs { translation: moved, rotation, scale: transform.scale };
    }
    Trs {
        translation: divide(moved, parent.scale, Vec3::ZERO),
        rotation: (back * transform.rotation).normalize(),
        scale: divide(transform.scale, parent.scale, Vec3::ONE),
    }
}

/// The inverse from the right: `multiply(transform, inverse(transform))` is the identity.
///
/// Without shear a rotated and unevenly scaled transform has no inverse from the left; use [`relative`].
#[inline]
pub fn inverse(transform: &Trs) -> Trs {
    relative(transform, &Trs::IDENTITY)
}

/// Maps a point from the space of `transform` to its parent space.
#[inline]
pub fn transform_point(transform: &Trs, point: Vec3) -> Vec3 {
    transform.translation + transform.rotation * (transform.scale * point)
}

/// Division axis by axis, with the value `otherwise` for a divisor of zero.
#[inline]
fn divide(value: Vec3, by: Vec3, otherwise: Vec3) -> Vec3 {
    Vec3::select(by.cmpeq(Vec3::ZERO), otherwise, value / by)
}
