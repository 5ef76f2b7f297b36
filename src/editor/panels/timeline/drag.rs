//! Drags of keys: to other frames, or scaled about the playhead. A drag previews one operation, and the release makes it one
//! step.

use super::state::{frame_at, is_on_frame, second_of, snapped};
use crate::rig::{
    animation::RigClip,
    operations::{KeyOperation, KeyTimes},
};

/// Keys that are being dragged.
#[derive(Debug, Clone)]
pub(in crate::editor::panels) struct KeyDrag {
    /// The keys as they were at the press.
    keys: KeyTimes,
    /// Time of the key that was pressed.
    grabbed: f32,
    /// Time of the pointer at the press.
    from: f32,
    /// Second about which times are scaled; `None` for keys that move.
    pivot: Option<f32>,
    /// The operation that is previewed, if the keys are elsewhere.
    pub shown: Option<KeyOperation>,
    /// The keys where they are shown.
    pub moved: KeyTimes,
}

impl KeyDrag {
    pub fn new(keys: KeyTimes, grabbed: f32, from: f32, pivot: Option<f32>) -> Self {
        Self { moved: keys.clone(), keys, grabbed, from, pivot, shown: None }
    }

    /// Drags to a time of the pointer; true if the preview has to change. Times fall on frames unless they are `free`.
    pub fn to(&mut self, clip: &RigClip, time: f32, free: bool) -> bool {
        let wanted = self.grabbed + (time - self.from);
        let (next, moved) = match self.pivot {
            Some(pivot) => self.scaled(clip, pivot, wanted, free),
            None => self.placed(clip, wanted, free),
        };
        let is_other = next != self.shown;
        (self.shown, self.moved) = (next, moved);
        is_other
    }

    fn placed(&self, clip: &RigClip, wanted: f32, free: bool) -> (Option<KeyOperation>, KeyTimes) {
        let frames = frame_at(clip, wanted) - frame_at(clip, self.grabbed);
        let by = if free { wanted - self.grabbed } else { second_of(clip, frame_at(clip, wanted)) - self.grabbed };
        let place = |time: f32| match !free && is_on_frame(clip, time) {
            true => second_of(clip, frame_at(clip, time) + frames),
            false => time + by,
        };
        let moved = self.mapped(place);
        if moved == self.keys {
            return (None, moved);
        }
        let pairs = |times: &Vec<f32>| times.iter().map(|time| [*time, place(*time)]).collect();
        let list = self.keys.iter().map(|(target, times)| (target.clone(), pairs(times))).collect();
        (Some(KeyOperation::Place(list)), moved)
    }

    fn scaled(&self, clip: &RigClip, pivot: f32, wanted: f32, free: bool) -> (Option<KeyOperation>, KeyTimes) {
        let to = if free { wanted } else { snapped(clip, wanted) };
        let factor = (to - pivot) / (self.grabbed - pivot);
        // Keys cannot all be put to one time.
        if !factor.is_finite() || factor.abs() < 1e-3 || factor == 1.0 {
            return (None, self.keys.clone());
        }
        let moved = self.mapped(|time| pivot + (time - pivot) * factor);
        (Some(KeyOperation::Scale { keys: self.keys.clone(), pivot, factor }), moved)
    }

    fn mapped(&self, place: impl Fn(f32) -> f32) -> KeyTimes {
        let mapped = |times: &Vec<f32>| times.iter().map(|time| place(*time)).collect();
        self.keys.iter().map(|(target, times)| (target.clone(), mapped(times))).collect()
    }
}
