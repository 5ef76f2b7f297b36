//! Keys put into a span of a track, while the curve before and behind the span stays.

use super::{
    Ease, Key, Property, Track,
    sample::{arrival, between, cubic_slope},
};
use glam::Quat;

/// Span of time in which a track gets other keys.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splice {
    /// First and last second.
    pub span: [f32; 2],
    /// Seconds within which one curve gives way to the other, far less than a frame: before the start and before the end.
    pub gap: f32,
    /// Marks a curve before the span that stays.
    pub keeps_before: bool,
    /// Marks a curve behind the span that stays. It begins at the end of the span.
    pub keeps_behind: bool,
}

impl Splice {
    /// Keys of a track with `keys`, linear or stepped ones, in the span. The first of them is at the start of the span. Without
    /// former keys there is nothing to keep.
    pub fn spliced(&self, former: &[Key], property: &Property, keys: &[Key]) -> Vec<Key> {
        let [start, end] = self.span;
        let mut out = match self.keeps_before && !former.is_empty() {
            true => self.before(former, property),
            false => former.iter().filter(|key| key.time < start).copied().collect(),
        };
        if self.keeps_behind && !former.is_empty() {
            let cut = end - self.gap;
            let inside = Track { keys: keys.to_vec() };
            out.extend(keys.iter().filter(|key| key.time < cut));
            let is_held = keys.iter().rfind(|key| key.time < cut).is_some_and(|last| last.ease == Ease::Stepped);
            if let Some(value) = inside.sample(property, cut).filter(|_| !is_held) {
                out.push(Key { time: cut, value, ease: Ease::Stepped });
            }
            if former.iter().all(|key| key.time != end) {
                out.extend(resumed(former, property, end));
            }
            out.extend(former.iter().filter(|key| key.time >= end));
            return out;
        }
        out.extend(keys);
        let behind = || former.iter().filter(|key| key.time > end);
        if let Some(last) = keys.last().filter(|last| last.time < end && behind().next().is_some()) {
            out.push(Key { time: end, ..*last });
        }
        out.extend(behind());
        out
    }

    /// Former keys before the span, and those that end their curve.
    fn before(&self, former: &[Key], property: &Property) -> Vec<Key> {
        let at = self.span[0] - self.gap;
        let mut out: Vec<Key> = former.iter().filter(|key| key.time < at).copied().collect();
        let next = former.get(out.len());
        let held = |value: [f32; 4], time: f32| Key { time, value, ease: Ease::Stepped };
        match (out.last_mut(), next) {
            (None, Some(first)) => out.push(held(first.value, at)),
            (Some(last), None) => {
                // What was held behind the last key has no tangent there.
                if let Ease::Cubic { leave, .. } = &mut last.ease {
                    *leave = [0.0; 4];
                }
                let last = *last;
                if last.ease != Ease::Stepped {
                    out.push(held(last.value, at));
                }
            }
            (Some(last), Some(next)) => {
                let last = *last;
                let (value, slope) = point(&last, next, property, at);
                match last.ease {
                    Ease::Stepped => {}
                    Ease::Linear => out.push(held(value, at)),
                    Ease::Cubic { .. } => {
                        out.push(Key { time: at, value, ease: Ease::Cubic { arrive: slope, leave: [0.0; 4] } });
                        out.push(held(value, at + 0.5 * self.gap));
                    }
                }
            }
            (None, None) => {}
        }
        out
    }
}

/// Key with which a curve goes on from a time at which it has none.
fn resumed(former: &[Key], property: &Property, time: f32) -> Option<Key> {
    let place = former.partition_point(|key| key.time <= time);
    let from = place.checked_sub(1).and_then(|before| former.get(before));
    Some(match (from, former.get(place)) {
        (None, first) => Key { time, value: first?.value, ease: Ease::Linear },
        (Some(last), None) => Key { time, value: last.value, ease: Ease::Linear },
        (Some(from), Some(to)) => {
            let (value, slope) = point(from, to, property, time);
            let ease = match from.ease {
                Ease::Cubic { .. } => Ease::Cubic { arrive: [0.0; 4], leave: slope },
                ease => ease,
            };
            Key { time, value, ease }
        }
    })
}

/// Value between two keys, and its change a second where the curve is cubic.
fn point(from: &Key, to: &Key, property: &Property, time: f32) -> ([f32; 4], [f32; 4]) {
    let value = between(from, to, property, time);
    let Ease::Cubic { leave, .. } = from.ease else { return (value, [0.0; 4]) };
    let slope = cubic_slope(from, to, time);
    if *property == Property::Rotation {
        let (arrive, span) = (arrival(to), to.time - from.time);
        let share = (time - from.time) / span;
        // The curve is normalised, and so is its tangent: what points along the value changes nothing.
        let plain: [f32; 4] = std::array::from_fn(|axis| {
            (2.0 * share - 3.0) * share * share * (from.value[axis] - to.value[axis])
                + from.value[axis]
                + (share - 1.0) * share * span * ((share - 1.0) * leave[axis] + share * arrive[axis])
        });
        let (value, slope) = (Quat::from_array(value), Quat::from_array(slope));
        let length = Quat::from_array(plain).length().max(1e-6);
        return (value.to_array(), ((slope - value * value.dot(slope)) * length.recip()).to_array());
    }
    (value, slope)
}
