//! Curves of tracks: values over time, one curve a number, rotations as angles.

use bevy::{
    math::{EulerRot, Mat3, Vec4, ops},
    prelude::*,
};
use bevy_egui::egui::Color32;

use crate::{
    editor::panels::timeline::{Mark, TimeAxis, buckets},
    rig::animation::{ClipLayer, Ease, Key, Property, Track, TrackTarget},
};

/// Pixels from one sample to the next.
const STEP: f32 = 3.0;
/// Most samples of a curve.
const MOST: usize = 700;

/// Colours of the numbers of a value.
const COLORS: [Color32; 3] =
    [Color32::from_rgb(230, 96, 96), Color32::from_rgb(120, 190, 80), Color32::from_rgb(90, 150, 240)];
/// Colour of attributes.
const ATTRIBUTE: Color32 = Color32::from_rgb(214, 178, 92);

/// Curve of one number of a track.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The track.
    pub target: TrackTarget,
    /// Name for people.
    pub name: String,
    /// Number of the value, from zero.
    pub axis: usize,
    /// Colour.
    pub color: Color32,
    /// Times with values, by rising time.
    pub points: Vec<(f32, f32)>,
    /// Visible keys that stand apart from others.
    pub keys: Vec<CurveKey>,
}

impl Curve {
    /// Value at a visible time: that of a key there, or else on the line between the points beside it.
    pub fn value_at(&self, time: f32) -> Option<f32> {
        if let Some(key) = self.keys.iter().find(|key| key.key.time == time) {
            return Some(key.value);
        }
        let next = self.points.partition_point(|(at, _)| *at < time);
        let (end, value) = *self.points.get(next)?;
        if end == time {
            return Some(value);
        }
        let (start, before) = *self.points.get(next.checked_sub(1)?)?;
        Some(before + (value - before) * ((time - start) / (end - start)))
    }
}

/// Key on a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveKey {
    /// The key.
    pub key: Key,
    /// Value of the curve there.
    pub value: f32,
    /// Angles of a rotation in degrees; zero for others.
    pub angles: Vec3,
    /// Slopes before and behind a cubic key, in units a second; for rotations in degrees a second. `None` also where the angles
    /// of a rotation do not follow from its change, with the middle axis at a right angle.
    pub slopes: Option<[f32; 2]>,
}

impl CurveKey {
    /// The key with another value of its curve.
    pub fn with_value(&self, property: &Property, axis: usize, value: f32) -> Key {
        let mut key = self.key;
        if *property == Property::Rotation {
            let mut angles = self.angles;
            angles[axis.min(2)] = value;
            key.value = rotation(angles).to_array();
            // The sign that is nearer to the key as it was keeps the curve on both sides of it.
            let dot: f32 = key.value.iter().zip(&self.key.value).map(|(a, b)| a * b).sum();
            if dot < 0.0 {
                key.value = key.value.map(|number| -number);
            }
        } else if let Some(number) = key.value.get_mut(axis) {
            *number = value;
        }
        key
    }

    /// The key with other slopes. A rotation keeps those of its other angles.
    pub fn with_slopes(&self, property: &Property, axis: usize, slopes: [f32; 2]) -> Key {
        let mut key = self.key;
        let Ease::Cubic { arrive, leave } = &mut key.ease else { return key };
        if *property == Property::Rotation {
            let (Some(before), Some(by)) = (self.slopes, by_angles(&self.key, self.angles).get(axis).copied()) else {
                return key;
            };
            for (side, tangent) in [arrive, leave].into_iter().enumerate() {
                let turned = Vec4::from_array(*tangent) + by * (slopes[side] - before[side]);
                *tangent = turned.to_array();
            }
        } else if axis < arrive.len() {
            (arrive[axis], leave[axis]) = (slopes[0], slopes[1]);
        }
        key
    }
}

/// Curves of a track in the visible span of time.
pub fn curves(layer: &ClipLayer, target: &TrackTarget, node: &str, axis: &TimeAxis) -> Vec<Curve> {
    let Some(track) = layer.tracks.get(target) else { return Vec::new() };
    let property = &target.property;
    let keys = apart(track, axis);
    let times = sampled(track, &keys, axis);
    let is_turn = *property == Property::Rotation;
    let count = if is_turn { 3 } else { property.width() };
    let mut points: Vec<Vec<(f32, f32)>> = vec![Vec::with_capacity(times.len()); count];
    let mut found: Vec<Vec<CurveKey>> = vec![Vec::with_capacity(keys.len()); count];
    let mut angles = Vec3::ZERO;
    let mut next = keys.iter().peekable();
    for (number, time) in times.iter().enumerate() {
        let Some(value) = track.sample(property, *time) else { continue };
        let mut values = [value[0], value[1], value[2]];
        if is_turn {
            let turn = near_angles(Quat::from_array(value), if number == 0 { None } else { Some(angles) });
            (angles, values) = (turn, turn.to_array());
        }
        for (axis, points) in points.iter_mut().enumerate() {
            points.push((*time, values[axis]));
        }
        let Some(key) = next.next_if(|key| key.time == *time) else { continue };
        let turns = if is_turn { angle_slopes(key, angles) } else { None };
        for (axis, keys) in found.iter_mut().enumerate() {
            let slopes = match key.ease {
                Ease::Cubic { .. } if is_turn => turns.map(|turns| turns.map(|turn| turn[axis])),
                Ease::Cubic { arrive, leave } => Some([arrive[axis], leave[axis]]),
                Ease::Stepped | Ease::Linear => None,
            };
            keys.push(CurveKey { key: **key, value: values[axis], angles, slopes });
        }
    }
    let curve = |(axis, (points, keys)): (usize, (Vec<(f32, f32)>, Vec<CurveKey>))| {
        let (name, color) = match property {
            Property::Attribute(attribute) => (format!("{node} {attribute}"), ATTRIBUTE),
            _ => (format!("{node} {property} {}", ["X", "Y", "Z"][axis]), COLORS[axis]),
        };
        Curve { target: target.clone(), name, axis, color, points, keys }
    };
    points.into_iter().zip(found).enumerate().map(curve).collect()
}

/// Visible keys that stand apart from their neighbours on the screen.
fn apart<'a>(track: &'a Track, axis: &TimeAxis) -> Vec<&'a Key> {
    let marks: Vec<Mark> = track.keys.iter().map(Mark::from).collect();
    let single = buckets(&marks, axis).into_iter().filter(|bucket| bucket.count == 1);
    let key = |time: f32| {
        let place = track.keys.partition_point(|key| key.time < time);
        track.keys.get(place)
    };
    single.filter_map(|bucket| key(bucket.times[0])).collect()
}

/// Times at which a curve is drawn: even steps, keys, and the ends of steps.
fn sampled(track: &Track, keys: &[&Key], axis: &TimeAxis) -> Vec<f32> {
    let count = ((axis.x.span() / STEP).max(2.0) as usize).min(MOST);
    let [start, end] = axis.span;
    let mut times: Vec<f32> =
        (0..=count).map(|number| start + (end - start) * (number as f32 / count as f32)).collect();
    times.extend(keys.iter().map(|key| key.time));
    let pixel = 0.2 / axis.scale();
    for key in keys.iter().filter(|key| key.ease == Ease::Stepped) {
        let place = track.keys.partition_point(|other| other.time <= key.time);
        times.extend(track.keys.get(place).map(|next| (next.time - pixel).max(key.time)));
    }
    times.sort_by(f32::total_cmp);
    times.dedup();
    times
}

/// Rotation of angles about X, Y and Z in degrees.
fn rotation(angles: Vec3) -> Quat {
    let [x, y, z] = angles.to_array().map(f32::to_radians);
    Quat::from_euler(EulerRot::XYZ, x, y, z)
}

/// Changes of a key's quaternion by degrees of its angles about X, Y and Z.
fn by_angles(key: &Key, angles: Vec3) -> [Vec4; 3] {
    let degree = 1.0_f32.to_radians();
    let parts = angles.to_array().map(|angle| ops::sin_cos(0.5 * angle.to_radians()));
    let turn = |axis: usize, (sine, cosine): (f32, f32)| {
        let v = Vec3::AXES[axis] * sine;
        Quat::from_xyzw(v.x, v.y, v.z, cosine)
    };
    let product = |changed: usize| {
        let factor = |axis: usize| {
            let (sine, cosine) = parts[axis];
            // The derivative of half an angle's sine and cosine.
            if axis == changed {
                turn(axis, (0.5 * degree * cosine, -0.5 * degree * sine))
            } else {
                turn(axis, parts[axis])
            }
        };
        Vec4::from(factor(0) * factor(1) * factor(2))
    };
    // The quaternion of a key may be the negative one of the same rotation.
    let sign = if rotation(angles).dot(Quat::from_array(key.value)) < 0.0 { -1.0 } else { 1.0 };
    [0, 1, 2].map(|axis| product(axis) * sign)
}

/// Slopes of the angles before and behind a cubic key of rotations, in degrees a second.
fn angle_slopes(key: &Key, angles: Vec3) -> Option<[Vec3; 2]> {
    let Ease::Cubic { arrive, leave } = key.ease else { return None };
    let by = by_angles(key, angles);
    let scale = by[0].length_squared();
    let dots = |of: Vec4| Vec3::new(by[0].dot(of), by[1].dot(of), by[2].dot(of)) / scale;
    let squares = Mat3::from_cols(dots(by[0]), dots(by[1]), dots(by[2]));
    // With the middle axis at a right angle the outer two turn alike.
    if squares.determinant().abs() < 1e-3 {
        return None;
    }
    let (inverse, value) = (squares.inverse(), Vec4::from_array(key.value));
    // What changes the length of the quaternion turns nothing.
    let slopes = |tangent: [f32; 4]| {
        let tangent = Vec4::from_array(tangent);
        inverse * dots(tangent - value * value.dot(tangent))
    };
    Some([slopes(arrive), slopes(leave)])
}

/// Angles of a rotation in degrees. Of all angles with that rotation, those that are nearest to the ones before, so that curves
/// do not jump.
fn near_angles(rotation: Quat, before: Option<Vec3>) -> Vec3 {
    let (x, y, z) = rotation.to_euler(EulerRot::XYZ);
    let angles = Vec3::new(x, y, z).map(f32::to_degrees);
    let Some(before) = before else { return angles };
    let other = Vec3::new(angles.x + 180.0, 180.0 - angles.y, angles.z + 180.0);
    let near = |angles: Vec3| angles - ((angles - before) / 360.0).round() * 360.0;
    let (one, two) = (near(angles), near(other));
    if one.distance_squared(before) <= two.distance_squared(before) { one } else { two }
}
