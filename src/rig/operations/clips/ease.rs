//! Interpolation of keys: steps, straight ways, and curves whose tangents follow from the neighbouring keys.

use super::{KeyTimes, keys::Changes};
use crate::rig::animation::{ClipLayer, Ease, Key, Property};

/// Interpolation that keys get.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum KeyEase {
    /// The value stays until the next key.
    Stepped,
    /// Linear, for rotations spherical.
    Linear,
    /// A curve through the keys, without swinging beyond them: level where the values turn back.
    Cubic,
}

/// Sets the interpolation of keys.
pub(super) fn ease(layer: &ClipLayer, keys: &KeyTimes, ease: KeyEase, changes: &mut Changes) {
    for (target, times) in keys {
        let Some(track) = layer.tracks.get(target) else { continue };
        let mut times = times.clone();
        times.sort_by(f32::total_cmp);
        let mut next = track.keys.clone();
        if ease == KeyEase::Cubic && target.property == Property::Rotation {
            align(&mut next);
        }
        let mut is_any = false;
        for place in 0..next.len() {
            let at = times.partition_point(|time| *time < next[place].time);
            if times.get(at) != Some(&next[place].time) {
                continue;
            }
            is_any = true;
            next[place].ease = match ease {
                KeyEase::Stepped => Ease::Stepped,
                KeyEase::Linear => Ease::Linear,
                KeyEase::Cubic => {
                    let tangent = tangent(&next, place);
                    Ease::Cubic { arrive: tangent, leave: tangent }
                }
            };
        }
        if is_any {
            changes.insert(target, next);
        }
    }
}

/// Gives each rotation the sign that is nearer to the one before: curves between quaternions go by their numbers, and both
/// signs are the same rotation.
fn align(keys: &mut [Key]) {
    let minus = |value: [f32; 4]| value.map(|number| if number == 0.0 { 0.0 } else { -number });
    for place in 1..keys.len() {
        let (before, key) = (keys[place - 1].value, keys[place]);
        let dot: f32 = before.iter().zip(&key.value).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            let ease = match key.ease {
                Ease::Cubic { arrive, leave } => Ease::Cubic { arrive: minus(arrive), leave: minus(leave) },
                ease => ease,
            };
            keys[place] = Key { value: minus(key.value), ease, ..key };
        }
    }
}

/// Slope of a smooth curve through a key, number by number. It is zero at both ends of the track and where the values turn
/// back, and at most three times the smaller of the slopes on both sides, so that the curve stays between the keys.
fn tangent(keys: &[Key], place: usize) -> [f32; 4] {
    let Some(before) = place.checked_sub(1).map(|before| keys[before]) else { return [0.0; 4] };
    let Some(behind) = keys.get(place + 1) else { return [0.0; 4] };
    let key = keys[place];
    std::array::from_fn(|axis| {
        let rise = (key.value[axis] - before.value[axis]) / (key.time - before.time);
        let fall = (behind.value[axis] - key.value[axis]) / (behind.time - key.time);
        if rise * fall <= 0.0 {
            return 0.0;
        }
        let slope = (behind.value[axis] - before.value[axis]) / (behind.time - before.time);
        let most = 3.0 * rise.abs().min(fall.abs());
        slope.clamp(-most, most)
    })
}
