//! State of the timeline: which clip is open, the playhead, the visible span of time, the selected keys. It belongs to the
//! window; no document has any of it.

use std::{collections::BTreeSet, sync::Arc};

use bevy::prelude::*;

use super::tolerance::ReductionTolerance;
use crate::{
    editor::ActiveRig,
    plugins::animation::ClipPlayer,
    rig::{
        Revision, Rig, Uid,
        animation::{ClipLayer, NodeNames, RigClip, TrackTarget},
        operations::{KeyClipboard, KeyTimes},
    },
};

/// State of the timeline of the active rig.
#[derive(Resource, Debug, Clone)]
pub struct Timeline {
    /// The rig that the state is of.
    pub rig: Option<Entity>,
    /// The open clip. It stays named while an undone step has taken it away.
    pub clip: Option<Uid>,
    /// Layer whose keys are shown and set; the topmost one if it is `None` or gone.
    pub layer: Option<Uid>,
    /// Second of the playhead.
    pub time: f32,
    /// True while the clip is played.
    pub playing: bool,
    /// True if the playback begins with the next frame: this one may have lasted as long as the window slept.
    pub(super) starting: bool,
    /// True once a clip was begun for a key that is set in the next frame.
    pub(super) begun: bool,
    /// First and last visible second.
    pub span: [f32; 2],
    /// True to set keys with each finished pose.
    pub auto_key: bool,
    /// True to stretch keys and markers with the range and the frame rate.
    pub stretch: bool,
    /// Largest differences that a reduction of keys may leave.
    pub tolerance: ReductionTolerance,
    /// Selected keys, times rising.
    pub keys: KeyTimes,
    /// Number of changes of the selected keys.
    pub changes: u64,
    /// Copied keys.
    pub copied: Option<Arc<KeyClipboard>>,
    /// Title of the panel of keys that the pointer is over, which then takes the keys that delete and select.
    pub hovered: Option<&'static str>,
    /// Names of all nodes that the rig has or had, for keys of nodes that are gone.
    pub names: NodeNames,
    /// State of the rig that the names were taken from last.
    pub(super) named: Option<Revision>,
}

impl Default for Timeline {
    fn default() -> Self {
        Self {
            rig: None,
            clip: None,
            layer: None,
            time: 0.0,
            playing: false,
            starting: false,
            begun: false,
            span: [0.0, 1.0],
            auto_key: false,
            stretch: false,
            tolerance: ReductionTolerance::default(),
            keys: KeyTimes::new(),
            changes: 0,
            copied: None,
            hovered: None,
            names: NodeNames::default(),
            named: None,
        }
    }
}

/// Request to change what the timeline shows. Requests never change a document.
#[derive(Message, Debug, Clone, PartialEq)]
pub enum TimelineRequest {
    /// Opens a clip, or none: then the rig shows its own pose.
    Open(Option<Uid>),
    /// Shows the keys of a layer.
    Layer(Uid),
    /// Puts the playhead to a second and halts the playback.
    Scrub(f32),
    /// Shows a span of time.
    Show([f32; 2]),
    /// Selects keys in place of the selected ones.
    Select(KeyTimes),
    /// Sets what a reduction of keys may change.
    Tolerance(ReductionTolerance),
    /// Tells whether the pointer is over the panel of keys with that title.
    Hover(&'static str, bool),
}

impl Timeline {
    /// Selects keys.
    pub(super) fn select(&mut self, mut keys: KeyTimes) {
        for times in keys.values_mut() {
            times.sort_by(f32::total_cmp);
            times.dedup();
        }
        keys.retain(|_, times| !times.is_empty());
        if self.keys != keys {
            self.keys = keys;
            self.changes += 1;
        }
    }
}

/// Span of time in which a whole clip is seen, with some room on both sides.
pub(super) fn fitted(clip: &RigClip) -> [f32; 2] {
    let [start, end] = clip.range;
    let room = ((end - start) * 0.04).max(2.0 / clip.frame_rate.max(1e-3));
    [start - room, end + room]
}

/// The open clip of the active rig.
#[derive(Clone, Copy)]
pub struct OpenClip<'w> {
    /// Entity of the rig.
    pub entity: Entity,
    /// The document.
    pub rig: &'w Rig,
    /// The clip.
    pub clip: &'w RigClip,
    /// Layer whose keys are shown and set; a clip may have none.
    pub layer: Option<&'w ClipLayer>,
    /// Second of the playhead.
    pub time: f32,
}

impl<'w> OpenClip<'w> {
    /// The open clip; `None` while there is none.
    pub fn of(world: &'w World) -> Option<Self> {
        let timeline = world.get_resource::<Timeline>()?;
        let entity = world.get_resource::<ActiveRig>()?.0;
        if timeline.rig != Some(entity) {
            return None;
        }
        let rig = world.get::<Rig>(entity)?;
        let clip = rig.clip(timeline.clip?)?;
        let layer = layer_of(clip, timeline.layer);
        let player = world.get::<ClipPlayer>(entity).filter(|player| player.clip == clip.uid);
        // The player moves time on before panels are drawn.
        let time = player.filter(|player| player.playing).map_or(timeline.time, |player| player.time);
        Some(Self { entity, rig, clip, layer, time })
    }

    /// Frame of the playhead, which may lie between frames.
    pub fn frame(&self) -> f32 {
        frames(self.clip, self.time)
    }
}

/// The layer with that uid, or else the topmost one.
pub(super) fn layer_of(clip: &RigClip, layer: Option<Uid>) -> Option<&ClipLayer> {
    layer.and_then(|layer| clip.layer(layer)).or(clip.layers.last())
}

/// Number of frames from second 0 to a time.
pub(super) fn frames(clip: &RigClip, time: f32) -> f32 {
    (f64::from(time) * f64::from(clip.frame_rate)) as f32
}

/// Whole frame that is nearest to a time.
pub(super) fn frame_at(clip: &RigClip, time: f32) -> i64 {
    (f64::from(time) * f64::from(clip.frame_rate)).round() as i64
}

/// Second of a frame.
pub(super) fn second_of(clip: &RigClip, frame: i64) -> f32 {
    (frame as f64 / f64::from(clip.frame_rate)) as f32
}

/// The nearest time that lies on a frame.
pub(super) fn snapped(clip: &RigClip, time: f32) -> f32 {
    second_of(clip, frame_at(clip, time))
}

/// True if a time is that of a frame but for rounding.
pub(super) fn is_on_frame(clip: &RigClip, time: f32) -> bool {
    (time - snapped(clip, time)).abs() * clip.frame_rate < 1e-3
}

/// All keys of a layer.
pub(super) fn all_keys(layer: &ClipLayer) -> KeyTimes {
    let times = |(target, track): (&TrackTarget, &Arc<crate::rig::animation::Track>)| {
        (target.clone(), track.keys.iter().map(|key| key.time).collect())
    };
    layer.tracks.iter().map(times).collect()
}

/// True if the layer has any of these keys.
pub(super) fn has_any(layer: &ClipLayer, keys: &KeyTimes) -> bool {
    keys.iter().any(|(target, times)| {
        let Some(track) = layer.tracks.get(target) else { return false };
        times.iter().any(|time| {
            let place = track.keys.partition_point(|key| key.time < *time);
            track.keys.get(place).is_some_and(|key| key.time == *time)
        })
    })
}

/// Adds keys to others, each once.
pub(in crate::editor::panels) fn add(to: &mut KeyTimes, more: &KeyTimes) {
    for (target, times) in more {
        let known = to.entry(target.clone()).or_default();
        known.extend(times);
        known.sort_by(f32::total_cmp);
        known.dedup();
    }
}

/// Takes keys out of others.
pub(super) fn subtract(from: &mut KeyTimes, less: &KeyTimes) {
    for (target, times) in less {
        if let Some(known) = from.get_mut(target) {
            let mut times = times.clone();
            times.sort_by(f32::total_cmp);
            known.retain(|time| times.binary_search_by(|other| other.total_cmp(time)).is_err());
        }
    }
    from.retain(|_, times| !times.is_empty());
}

/// True if all of these keys are among others.
pub(in crate::editor::panels) fn contains(keys: &KeyTimes, these: &KeyTimes) -> bool {
    these.iter().all(|(target, times)| {
        keys.get(target)
            .is_some_and(|known| times.iter().all(|time| known.binary_search_by(|other| other.total_cmp(time)).is_ok()))
    })
}

/// Times at which keys of some nodes stand, or of all nodes if none of these has keys; rising, each once.
pub(in crate::editor) fn key_times(clip: &RigClip, nodes: &[Uid]) -> Vec<f32> {
    let nodes: BTreeSet<Uid> = nodes.iter().copied().collect();
    let tracks = || clip.layers.iter().flat_map(|layer| &layer.tracks);
    let own = tracks().filter(|(target, _)| nodes.contains(&target.node));
    let mut times: Vec<f32> = own.flat_map(|(_, track)| &track.keys).map(|key| key.time).collect();
    if times.is_empty() {
        return clip.key_times();
    }
    times.sort_by(f32::total_cmp);
    times.dedup();
    times
}
