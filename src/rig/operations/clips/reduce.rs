//! Reduction: fewer keys for the same motion within a tolerance.

use super::keys::Changes;
use crate::rig::animation::{ClipLayer, Ease, Key, Property, Track, TrackTarget};

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

/// Removes keys of tracks. Cubic tracks lose keys only where they are constant.
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
    let is_flat = |key: &Key| match key.ease {
        Ease::Cubic { arrive, leave } => [arrive, leave].as_flattened().iter().all(|number| *number == 0.0),
        Ease::Stepped | Ease::Linear => true,
    };
    if keys.iter().all(|key| is_flat(key) && distance(property, key.value, first.value) <= tolerance) {
        return vec![*first];
    }
    if keys.iter().any(|key| matches!(key.ease, Ease::Cubic { .. })) {
        return keys.clone();
    }
    let mut kept = vec![0];
    let mut at = 0;
    while at + 1 < keys.len() {
        // The furthest key that can follow: first in growing steps, then by halving.
        let (mut good, mut step) = (at + 1, 2);
        let mut bad = keys.len();
        while at + step < keys.len() {
            if can_follow(keys, at, at + step, property, tolerance) {
                good = at + step;
                step *= 2;
            } else {
                bad = at + step;
                break;
            }
        }
        if bad == keys.len() && can_follow(keys, at, keys.len() - 1, property, tolerance) {
            good = keys.len() - 1;
        }
        while bad - good > 1 && bad <= keys.len() {
            let middle = good.midpoint(bad);
            if can_follow(keys, at, middle, property, tolerance) { good = middle } else { bad = middle }
        }
        kept.push(good);
        at = good;
    }
    kept.into_iter().map(|place| keys[place]).collect()
}

/// True if the keys between two can be left out.
fn can_follow(keys: &[Key], from: usize, to: usize, property: &Property, tolerance: f32) -> bool {
    let (first, last) = (keys[from], keys[to]);
    if to == from + 1 {
        return true;
    }
    if keys[from..to].iter().any(|key| key.ease != first.ease) {
        return false;
    }
    let pair = Track { keys: vec![first, last] };
    let is_near = |key: &Key| {
        pair.sample(property, key.time).is_some_and(|value| distance(property, value, key.value) <= tolerance)
    };
    keys[from + 1..to].iter().all(is_near)
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
