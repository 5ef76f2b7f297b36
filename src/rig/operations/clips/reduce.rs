//! Reduction: fewer keys for the same motion within a tolerance.

use bevy::math::Vec3;

use super::keys::Changes;
use crate::rig::{
    Rig,
    animation::{ClipLayer, Ease, Key, Property, Track, TrackTarget},
};

/// Largest differences that a reduction may leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyTolerance {
    /// Distance of translations, in rig units.
    pub distance: f32,
    /// Angle of rotations, in degrees.
    pub angle: f32,
    /// Difference of scale factors.
    pub factor: f32,
    /// Difference of attributes.
    pub value: f32,
}

impl Default for KeyTolerance {
    /// Differences that nobody sees on a character of human size in metres: 0.05 mm and 0.01°.
    fn default() -> Self {
        Self { distance: 5e-5, angle: 0.01, factor: 1e-4, value: 1e-4 }
    }
}

impl KeyTolerance {
    /// Differences below the noise of motion capture of a human in metres: half a millimetre, and half a degree, which
    /// moves a point three centimetres beside a joint by a quarter of a millimetre.
    pub fn captured() -> Self {
        Self { distance: 5e-4, angle: 0.5, factor: 1e-3, value: 0.05 }
    }

    /// Tolerance with all differences multiplied.
    #[must_use]
    pub fn scaled(self, by: f32) -> Self {
        let Self { distance, angle, factor, value } = self;
        Self { distance: distance * by, angle: angle * by, factor: factor * by, value: value * by }
    }

    /// Tolerance for a figure of another height than a human's, whose distances are larger or smaller.
    #[must_use]
    pub fn for_height(self, height: f32) -> Self {
        Self { distance: self.distance * (height / 1.7).max(1e-6), ..self }
    }

    /// Tolerance for a rig of another size or in other units than a human in metres, by the longest edge of the box around
    /// its joints at rest.
    #[must_use]
    pub fn for_rig(self, rig: &Rig) -> Self {
        let globals = rig.rest_globals();
        let places = || globals.iter().map(|(_, at)| at.translation);
        let extent = places().reduce(Vec3::max).zip(places().reduce(Vec3::min));
        let size = extent.map_or(0.0, |(most, least)| (most - least).max_element());
        if size > 0.0 { self.for_height(size) } else { self }
    }

    /// Keys that are needed for a track to stay within the tolerance.
    pub fn reduced(&self, track: &Track, property: &Property) -> Vec<Key> {
        reduced(track, property, self.of(property))
    }

    fn of(&self, property: &Property) -> f32 {
        match property {
            Property::Translation => self.distance,
            Property::Rotation => self.angle,
            Property::Scale => self.factor,
            Property::Attribute(_) => self.value,
        }
    }
}

/// Equal parts of the way from a key to the next one, between which a cubic track is compared with fewer keys.
const BETWEEN: u16 = 8;

/// Removes keys of tracks; those that stay are as they were, tangents included.
pub(super) fn reduce(layer: &ClipLayer, targets: &[TrackTarget], tolerance: &KeyTolerance, changes: &mut Changes) {
    for target in targets {
        let Some(track) = layer.tracks.get(target) else { continue };
        let kept = reduced(track, &target.property, tolerance.of(&target.property));
        let mut next = kept.iter().peekable();
        let removed = track.keys.iter().filter(|key| next.next_if(|kept| kept.time == key.time).is_none());
        changes.remove(target, removed.map(|key| key.time));
    }
}

/// Keys that are needed for a track to stay within a tolerance.
fn reduced(track: &Track, property: &Property, tolerance: f32) -> Vec<Key> {
    let keys = &track.keys;
    let Some(first) = keys.first() else { return Vec::new() };
    let values = compared(keys, property);
    if values.iter().all(|(_, value)| distance(property, *value, first.value) <= tolerance) {
        return vec![*first];
    }
    let curve = Curve { keys, property, tolerance, values: &values };
    let mut kept = vec![0];
    let mut at = 0;
    while at + 1 < keys.len() {
        // The furthest key that can follow: first in growing steps, then by halving.
        let (mut good, mut step) = (at + 1, 2);
        let mut bad = keys.len();
        while at + step < keys.len() {
            if curve.can_follow(at, at + step) {
                good = at + step;
                step *= 2;
            } else {
                bad = at + step;
                break;
            }
        }
        if bad == keys.len() && curve.can_follow(at, keys.len() - 1) {
            good = keys.len() - 1;
        }
        while bad - good > 1 && bad <= keys.len() {
            let middle = good.midpoint(bad);
            if curve.can_follow(at, middle) { good = middle } else { bad = middle }
        }
        kept.push(good);
        at = good;
    }
    kept.into_iter().map(|place| keys[place]).collect()
}

/// Times at which a track is compared with fewer keys, by rising time, and its values there: those of its keys, and of
/// places between them where the way from one to the next is cubic.
fn compared(keys: &[Key], property: &Property) -> Vec<(f32, [f32; 4])> {
    let mut values = Vec::with_capacity(keys.len());
    for (place, key) in keys.iter().enumerate() {
        values.push((key.time, key.value));
        let (Some(next), Ease::Cubic { .. }) = (keys.get(place + 1), key.ease) else { continue };
        let pair = Track { keys: vec![*key, *next] };
        for step in 1..BETWEEN {
            let time = key.time + (next.time - key.time) * f32::from(step) / f32::from(BETWEEN);
            values.extend(pair.sample(property, time).map(|value| (time, value)));
        }
    }
    values
}

/// Track that loses keys.
struct Curve<'a> {
    keys: &'a [Key],
    property: &'a Property,
    tolerance: f32,
    values: &'a [(f32, [f32; 4])],
}

impl Curve<'_> {
    /// True if the keys between two can be left out.
    fn can_follow(&self, from: usize, to: usize) -> bool {
        let (first, last) = (self.keys[from], self.keys[to]);
        if to == from + 1 {
            return true;
        }
        let is_cubic = |key: &Key| matches!(key.ease, Ease::Cubic { .. });
        let is_alike = |key: &Key| if is_cubic(&first) { is_cubic(key) } else { key.ease == first.ease };
        if !self.keys[from..to].iter().all(is_alike) {
            return false;
        }
        let pair = Track { keys: vec![first, last] };
        let begin = self.values.partition_point(|(time, _)| *time <= first.time);
        let end = self.values.partition_point(|(time, _)| *time < last.time);
        let is_near = |(time, known): &(f32, [f32; 4])| {
            let value = pair.sample(self.property, *time);
            value.is_some_and(|value| distance(self.property, value, *known) <= self.tolerance)
        };
        self.values[begin..end].iter().all(is_near)
    }
}

/// Difference of two values: an angle in degrees for rotations, else a distance.
fn distance(property: &Property, a: [f32; 4], b: [f32; 4]) -> f32 {
    let dot: f32 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
    let sign = if *property == Property::Rotation && dot < 0.0 { -1.0 } else { 1.0 };
    let square: f32 = a.iter().zip(&b).map(|(a, b)| (a - b * sign) * (a - b * sign)).sum();
    if *property == Property::Rotation {
        // The chord between two unit quaternions is twice the sine of a quarter of the angle.
        return 4.0 * bevy::math::ops::asin((square.sqrt() * 0.5).min(1.0)).to_degrees();
    }
    square.sqrt()
}
