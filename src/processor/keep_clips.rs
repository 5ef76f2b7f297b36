//! Clips that mean the same after an update of their rig.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use super::{
    Modules,
    keep_moved_nodes::{carry_tracks, clip_without},
    keep_poses::built_program,
};
use crate::{
    rig::{
        BuiltRig, EditError, MovedNodes, PoseOffset, Rig, RigEdit, Uid,
        animation::{
            Ease, Key, LayerMode, NodeNames, OrphanedKeys, Property, RigClip, SampledPose, Track, TrackTarget,
            keys_set_aside,
        },
    },
    solve::{
        keep_pose::{Deviation, PoseKeeper},
        program::RigProgram,
    },
};

/// Rounds in which frames between keys get keys where the joints would leave their paths.
const ROUNDS: usize = 2;
/// Most frames between keys that are looked at.
const FRAMES: f32 = 100_000.0;

/// Joint that a clip could not hold on its path through an update.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ClipNote {
    /// The clip.
    pub clip: Uid,
    /// Name of the clip.
    pub name: String,
    /// Second at which the joint is off most.
    pub time: f32,
    /// Number of keys and frames at which the joint is off.
    pub frames: usize,
    /// The joint, and by how much it is off.
    #[serde(flatten)]
    pub deviation: Deviation,
}

impl std::fmt::Display for ClipNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Deviation { joint, label, distance, angle } = &self.deviation;
        let joint = label.as_deref().map_or_else(|| joint.to_string(), str::to_owned);
        let Self { name, time, frames, .. } = self;
        write!(
            f,
            "clip \"{name}\" at {time:.2} s: {joint} stands {distance:.4} units and {angle:.2}° from where it stood ({frames} frames)"
        )
    }
}

/// Keys that wait in a clip for a node which an update took away.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct KeysSetAside {
    /// Name of the clip.
    pub clip_name: String,
    /// Node that is gone, the number of its keys, and the node to which they may be given.
    #[serde(flatten)]
    pub keys: OrphanedKeys,
}

impl std::fmt::Display for KeysSetAside {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let OrphanedKeys { node, name, keys, .. } = &self.keys;
        let label = if name.label.is_empty() { node.to_string() } else { name.label.clone() };
        let (of, are) = if *keys == 1 { ("key", "is") } else { ("keys", "are") };
        write!(f, "clip \"{}\": {keys} {of} of {label} {are} set aside until the node is back", self.clip_name)
    }
}

/// Motion that clips could not keep through an update of their rig.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct ClipReport {
    /// Joints that do not move as before.
    pub notes: Vec<ClipNote>,
    /// Keys of nodes that are gone. They stay in their clips.
    pub set_aside: Vec<KeysSetAside>,
}

impl ClipReport {
    /// True if all joints move as before and all nodes with keys are there.
    pub fn is_empty(&self) -> bool {
        self.notes.is_empty() && self.set_aside.is_empty()
    }

    /// Sentences about joints, and then about keys.
    pub fn lines(&self) -> Vec<String> {
        let joints = self.notes.iter().map(ToString::to_string);
        joints.chain(self.set_aside.iter().map(ToString::to_string)).collect()
    }
}

/// Version of a rig, with the result of its commands and the compiled program.
#[derive(Debug, Clone, Copy)]
pub struct RigVersion<'a> {
    /// The document.
    pub rig: &'a Rig,
    /// Nodes and constraints.
    pub built: &'a BuiltRig,
    /// Program with all nodes, or with controls exposed: nodes that it cannot pose get no keys.
    pub program: &'a Arc<RigProgram>,
}

/// Clips that went through an update of their rig.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeptClips {
    /// The clips, in the order in which they were given.
    pub clips: Vec<RigClip>,
    /// Motion that they could not keep.
    pub report: ClipReport,
}

/// Re-expresses clips of one version of a rig for another one, so that the joints move as they did: at every key, and at the
/// frames between keys, which get keys where they are needed. Keys of nodes that are gone stay in the clips and are listed;
/// those of nodes whose command moved to another joint go along, as they are.
///
/// Clips stay as they are where nothing moved what they mean; others take some milliseconds for each key and frame.
pub fn clips_between(clips: &[RigClip], from: RigVersion<'_>, to: RigVersion<'_>) -> KeptClips {
    let keeper = PoseKeeper::between(from.program, to.program);
    let (was, is) = (NodeNames::of(from.rig, Some(from.built)), NodeNames::of(to.rig, Some(to.built)));
    let moved = MovedNodes::between((from.rig, from.built), (to.rig, to.built));
    let mut done = KeptClips::default();
    for clip in clips {
        let is_moved = !keeper.is_idle() && clip.key_count() > 0;
        let mut next = if moved.is_empty() { clip.clone() } else { clip_without(clip, &moved) };
        if is_moved {
            next = kept(&next, &keeper, &mut done.report.notes);
        }
        carry_tracks(&mut next, clip, &moved);
        let gone = keys_set_aside(&next, &was, &is);
        let named = gone.into_iter().map(|keys| KeysSetAside { clip_name: clip.name.clone(), keys });
        done.report.set_aside.extend(named);
        done.clips.push(next);
    }
    done
}

/// Re-expresses the clips of `after` that are those of `before`: see [`clips_between`]. Returns what they could not keep.
///
/// Clips stay as they are where one of the two rigs cannot be built. Builds both rigs if there are clips.
///
/// # Errors
/// If a clip is refused, which a valid rig's is not.
pub fn keep_clips(before: &Rig, after: &mut Rig, modules: &Arc<Modules>) -> Result<ClipReport, EditError> {
    let is_kept = |clip: &&RigClip| before.clip(clip.uid) == Some(clip) && clip.key_count() > 0;
    let clips: Vec<RigClip> = after.clips().iter().filter(is_kept).cloned().collect();
    if clips.is_empty() {
        return Ok(ClipReport::default());
    }
    let (Some(from), Some(to)) = (built_program(before, modules), built_program(after, modules)) else {
        return Ok(ClipReport::default());
    };
    let from = RigVersion { rig: before, built: &from.0, program: &from.1 };
    let KeptClips { clips: kept, report } =
        clips_between(&clips, from, RigVersion { rig: after, built: &to.0, program: &to.1 });
    for (clip, kept) in clips.into_iter().zip(kept) {
        if kept != clip {
            let index = after.clips().iter().position(|own| own.uid == clip.uid).unwrap_or(usize::MAX);
            after.apply(&RigEdit::RemoveClip(clip.uid))?;
            after.apply(&RigEdit::AddClip(Box::new(kept), index))?;
        }
    }
    Ok(report)
}

type Offsets = BTreeMap<Uid, PoseOffset>;

/// A clip with which the joints move as before.
fn kept(clip: &RigClip, keeper: &PoseKeeper, notes: &mut Vec<ClipNote>) -> RigClip {
    let mut poses: BTreeMap<Moment, Offsets> = BTreeMap::new();
    let mut resampled = |times: &[f32]| -> Option<RigClip> {
        for time in times {
            let SampledPose { offsets, values } = clip.sample(*time);
            poses.insert(Moment(*time), keeper.keep(&offsets, &values).offsets);
        }
        with_poses(clip, &poses)
    };
    let keys = clip.key_times();
    let mut next = resampled(&keys).unwrap_or_else(|| clip.clone());
    let frames = frames(clip, &keys);
    for _ in 0..ROUNDS {
        let off: Vec<f32> =
            frames.iter().copied().filter(|frame| !deviations(clip, &next, keeper, *frame).is_empty()).collect();
        if off.is_empty() {
            break;
        }
        next = resampled(&off).unwrap_or_else(|| clip.clone());
    }
    let mut worst: BTreeMap<Uid, ClipNote> = BTreeMap::new();
    for time in keys.into_iter().chain(frames) {
        for deviation in deviations(clip, &next, keeper, time) {
            let note = ClipNote { clip: clip.uid, name: clip.name.clone(), time, frames: 0, deviation };
            let size = |note: &ClipNote| note.deviation.distance + note.deviation.angle * 1e-3;
            let known = worst.entry(note.deviation.joint).or_insert_with(|| note.clone());
            let frames = known.frames + 1;
            if size(&note) > size(known) {
                *known = note;
            }
            known.frames = frames;
        }
    }
    notes.extend(worst.into_values());
    next
}

/// Time of a key, in order.
#[derive(Clone, Copy, PartialEq)]
struct Moment(f32);

impl Eq for Moment {}

impl PartialOrd for Moment {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Moment {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

fn deviations(was: &RigClip, is: &RigClip, keeper: &PoseKeeper, time: f32) -> Vec<Deviation> {
    let before = was.sample(time);
    keeper.deviations(&before.offsets, &is.sample(time).offsets, &before.values)
}

/// Frames between the first and the last key that have no key themselves.
fn frames(clip: &RigClip, keys: &[f32]) -> Vec<f32> {
    let (Some(first), Some(last)) = (keys.first(), keys.last()) else { return Vec::new() };
    let count = ((last - first) * clip.frame_rate).min(FRAMES) as u32;
    let frames = (1..=count).map(|frame| first + frame as f32 / clip.frame_rate);
    // Rounding puts a frame beside its key.
    let near = 1e-4 / clip.frame_rate;
    let is_free = |time: &f32| {
        let place = keys.partition_point(|key| key < time);
        keys[place.saturating_sub(1)..].iter().take(2).all(|key| (key - time).abs() > near)
    };
    frames.filter(|time| time < last).filter(is_free).collect()
}

/// The clip with keys at these times for all nodes whose offsets differ from the clip's; `None` if none do.
fn with_poses(clip: &RigClip, poses: &BTreeMap<Moment, Offsets>) -> Option<RigClip> {
    let at = |offsets: &Offsets, node: Uid| offsets.get(&node).copied().unwrap_or_default();
    let mut changed: BTreeSet<Uid> = BTreeSet::new();
    for (time, kept) in poses {
        let was = clip.sample(time.0).offsets;
        let nodes: BTreeSet<Uid> = was.keys().chain(kept.keys()).copied().collect();
        changed.extend(nodes.into_iter().filter(|node| at(&was, *node) != at(kept, *node)));
    }
    if changed.is_empty() {
        return None;
    }
    let mut next = clip.clone();
    for node in changed {
        let layer = layer_for(clip, node)?;
        for property in [Property::Translation, Property::Rotation, Property::Scale] {
            let target = TrackTarget { node, property };
            let wanted = poses.iter().map(|(time, kept)| (time.0, value_of(&at(kept, node), &target.property)));
            let is_rest = wanted.clone().all(|(_, value)| value == target.property.rest());
            let known = clip.layers[layer].tracks.get(&target);
            if known.is_none() && is_rest {
                continue;
            }
            let keys = wanted.map(|(time, value)| Key {
                time,
                value: clip.value_for(layer, &target, time, value),
                ease: ease_at(known.map(|track| &**track), time),
            });
            let keys = keys.collect();
            next.layers[layer].tracks.insert(target, Arc::new(Track { keys }));
        }
    }
    Some(next)
}

/// Topmost layer in effect that animates a node, else the lowest in effect that concerns it.
fn layer_for(clip: &RigClip, node: Uid) -> Option<usize> {
    let is_on = |place: &usize| {
        let layer = &clip.layers[*place];
        !layer.muted && layer.weight > 0.0 && layer.concerns(node)
    };
    let has = |place: &usize| clip.layers[*place].tracks.keys().any(|target| target.node == node);
    let is_whole = |place: &usize| clip.layers[*place].mode == LayerMode::Override;
    let places = 0..clip.layers.len();
    let known = places.clone().rev().filter(is_on).find(has);
    known.or_else(|| places.clone().filter(is_on).find(is_whole)).or_else(|| places.into_iter().find(is_on))
}

fn value_of(offset: &PoseOffset, property: &Property) -> [f32; 4] {
    match property {
        Property::Translation => [offset.translation.x, offset.translation.y, offset.translation.z, 0.0],
        Property::Rotation => offset.rotation.to_array(),
        Property::Scale => [offset.scale.x, offset.scale.y, offset.scale.z, 0.0],
        Property::Attribute(_) => [0.0; 4],
    }
}

/// Steps stay steps.
fn ease_at(track: Option<&Track>, time: f32) -> Ease {
    let before = track.and_then(|track| {
        let place = track.keys.partition_point(|key| key.time <= time).checked_sub(1)?;
        Some(track.keys[place].ease)
    });
    if before == Some(Ease::Stepped) { Ease::Stepped } else { Ease::Linear }
}
