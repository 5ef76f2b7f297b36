//! Switches over a range of a clip: the switch is matched at every frame, and the controls of the other side get keys.

mod frames;

use std::{collections::BTreeSet, sync::Arc};

use bevy::math::{Quat, Vec3};

use self::frames::Frames;
use super::MatchError;
use crate::{
    rig::{
        BuiltRig, NodeType, PoseOffset, RigEdit, SwitchData, Uid,
        animation::{Ease, Key, LayerMode, Property, RigClip, Splice, Track, TrackTarget},
        operations::KeyTolerance,
    },
    solve::{
        curve_fit::difference,
        keep_pose::Deviation,
        program::RigState,
        reduction::{CurveKind, FrameErrors, JointPlace, SampledTrack, errors_of, reduce_tracks, track_tolerance},
    },
};

/// Most frames that are matched at once.
const MOST_FRAMES: usize = 20_000;
/// Distance up to which a joint counts as held, in tolerances: 0.1 mm where keys may be off by 0.05 mm.
const HELD_DISTANCE: f32 = 2.0;
/// Angle up to which a joint counts as held, in tolerances: 0.05° where keys may be off by 0.01°.
const HELD_ANGLE: f32 = 5.0;
/// Share of the tolerance by which a value that nothing changed may be off through rounding.
const ROUNDING: f32 = 0.01;

/// Tolerance for a running rig of any size: that of a human in metres, by the greatest side of the box around the joints.
pub fn tolerance_of(state: &RigState) -> KeyTolerance {
    let nodes = state.program().nodes().iter().zip(state.globals());
    let joints = nodes.filter(|(node, _)| node.kind == NodeType::Joint).map(|(_, at)| at.translation);
    let [low, high] = joints.fold([Vec3::MAX, Vec3::MIN], |[low, high], at| [low.min(at), high.max(at)]);
    let size = (high - low).max_element();
    if size.is_finite() && size > 0.0 { KeyTolerance::default().for_height(size) } else { KeyTolerance::default() }
}

/// Error of a switch over a range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SwitchOverError {
    /// A range without frames.
    #[error("the range from {from} s to {to} s has no frames; give one that ends a frame or more after it begins")]
    Range {
        /// First second.
        from: f32,
        /// Last second.
        to: f32,
    },
    /// More frames than are matched at once.
    #[error("the range has {frames} frames, and no more than {most} are matched at once; give a shorter one")]
    TooLong {
        /// Number of frames.
        frames: u64,
        /// Largest number.
        most: usize,
    },
    /// The switch has the value already.
    #[error("the switch has that value in the whole range already; choose another value or range")]
    Already,
    /// No layer can take the keys of a node.
    #[error("clip \"{clip}\" has no layer for keys of node {node}; unmute one, give it weight, or widen its mask")]
    NoLayer {
        /// Name of the clip.
        clip: String,
        /// The node.
        node: Uid,
    },
    /// The switch cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
}

/// Range of a clip over which a switch is thrown.
#[derive(Debug, Clone, Copy)]
pub struct SwitchRange<'a> {
    /// The clip.
    pub clip: &'a RigClip,
    /// Layer for keys of what no layer in effect animates; the lowest one that can have them if it is `None` or cannot. What
    /// a layer animates gets its keys in the topmost such layer.
    pub layer: Option<Uid>,
    /// First and last second. Before it and from its end on the clip stays as it is; an end at that of the clip is included.
    pub span: [f32; 2],
    /// Distance and angle by which fewer keys may leave joints off, in the rig's units and in degrees.
    pub tolerance: KeyTolerance,
}

/// Joint that a switch over a range does not hold.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SwitchNote {
    /// Second at which the joint is off most.
    pub time: f32,
    /// Number of frames at which it is off.
    pub frames: usize,
    /// The joint, and by how much it is off.
    #[serde(flatten)]
    pub deviation: Deviation,
}

impl std::fmt::Display for SwitchNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Deviation { joint, label, distance, angle } = &self.deviation;
        let joint = label.as_deref().map_or_else(|| joint.to_string(), str::to_owned);
        let Self { time, frames, .. } = self;
        write!(
            f,
            "at {time:.2} s {joint} stands {distance:.4} units and {angle:.2}° from where it stood ({frames} frames)"
        )
    }
}

/// Edits that throw a switch over a range of a clip, and what they do not hold.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SwitchedRange {
    /// The edits of keys, as one step.
    pub edits: Vec<RigEdit>,
    /// Number of frames that were matched.
    pub frames: usize,
    /// Number of keys in the range, those of the switch with them.
    pub keys: usize,
    /// Joints that stand more than twice the distance, or five times the angle, of the tolerance from where they stood.
    pub notes: Vec<SwitchNote>,
}

/// Track that gets keys.
struct MatchedTrack {
    target: TrackTarget,
    /// Place of the layer.
    layer: usize,
    /// Keys before; one that holds the pose of the document where there are none.
    former: Vec<Key>,
}

/// The edits that give the attribute of a switch a value over a range of a clip, by steps at the ends of the range, and keys to
/// the controls that the switch matches, so that the joints move as before.
///
/// `state` is an instance of the rig in the pose of the document, compiled so that all controls can be posed; it is not
/// changed. Costs some tens of evaluations a frame, on all processors.
///
/// # Errors
/// See [`SwitchOverError`].
pub fn match_switch_over(
    rig: &BuiltRig,
    state: &RigState,
    switch: &SwitchData,
    value: f32,
    over: &SwitchRange<'_>,
) -> Result<SwitchedRange, SwitchOverError> {
    let clip = over.clip;
    let times = moments(over)?;
    let mut state = state.clone();
    let own = state.attribute(switch.control, &switch.attribute).unwrap_or_default();
    let thrown = TrackTarget { node: switch.control, property: Property::Attribute(switch.attribute.to_string()) };
    let value = {
        let mut tried = state.clone();
        tried.set_attribute(switch.control, &switch.attribute, value).map_err(MatchError::from)?;
        tried.attribute(switch.control, &switch.attribute).unwrap_or(value)
    };
    if times.iter().all(|time| clip.value(&thrown, *time).map_or(own, |known| known[0]) == value) {
        return Err(SwitchOverError::Already);
    }
    state.evaluate(0.0);
    let frames = Frames::matched(rig, &state, switch, value, clip, times)?;

    let splice = splice(over);
    let (tracks, samples) = tracks(over, &frames, &splice)?;
    let wanted = frames.play(clip, &tracks, &samples);
    let reaches = frames.reaches(&tracks, &samples, clip);
    let sampled: Vec<SampledTrack> = tracks
        .iter()
        .zip(&samples)
        .zip(reaches)
        .map(|((track, values), reach)| {
            let property = track.target.property.clone();
            let tolerance = track_tolerance(&property, reach, &over.tolerance);
            SampledTrack { property, values: values.clone(), tolerance }
        })
        .collect();
    let measure = |values: &[Vec<[f32; 4]>]| -> Vec<FrameErrors> {
        let played = frames.play(clip, &tracks, values);
        let worst = |(found, wanted): (&Vec<JointPlace>, &Vec<JointPlace>)| {
            let worst = errors_of(found, wanted, &over.tolerance).into_iter().fold(0.0, f32::max);
            FrameErrors { worst, of_tracks: Vec::new() }
        };
        played.iter().zip(&wanted).map(worst).collect()
    };
    let reduced = reduce_tracks(&frames.times, &sampled, CurveKind::Linear, measure);

    let mut done = SwitchedRange { frames: frames.times.len(), ..SwitchedRange::default() };
    let mut next = clip.clone();
    let mut change = |track: &MatchedTrack, keys: &[Key]| {
        let MatchedTrack { target, layer, former } = track;
        done.keys += keys.len();
        let after = splice.spliced(former, &target.property, keys);
        let layer = &mut next.layers[*layer];
        let before = layer.tracks.get(target).map_or(&[] as &[Key], |track| &track.keys);
        let known = |keys: &[Key], key: &Key| {
            let place = keys.partition_point(|other| other.time < key.time);
            keys.get(place) == Some(key)
        };
        let removed: Vec<f32> = before.iter().filter(|key| !known(&after, key)).map(|key| key.time).collect();
        let inserted: Vec<Key> = after.iter().filter(|key| !known(before, key)).copied().collect();
        if !removed.is_empty() || !inserted.is_empty() {
            let (clip, layer) = (clip.uid, layer.uid);
            done.edits.push(RigEdit::SetKeys { clip, layer, target: target.clone(), removed, inserted });
        }
        layer.tracks.insert(target.clone(), Arc::new(Track { keys: after }));
    };
    for (track, keys) in tracks.iter().zip(&reduced) {
        change(track, keys);
    }
    let step = matched(over, &splice, thrown, |_| [own, 0.0, 0.0, 0.0])?;
    let value = clip.value_for(step.layer, &step.target, splice.span[0], [value, 0.0, 0.0, 0.0]);
    change(&step, &[Key { time: splice.span[0], value, ease: Ease::Stepped }]);

    done.notes = frames.notes(&next, over.tolerance.distance * HELD_DISTANCE, over.tolerance.angle * HELD_ANGLE);
    Ok(done)
}

/// Seconds at which the switch is matched: the ends of the range, the frames between them, and the keys of the clip.
fn moments(over: &SwitchRange<'_>) -> Result<Vec<f32>, SwitchOverError> {
    let ([start, end], rate) = (over.span, over.clip.frame_rate);
    let near = gap(over) * 2.0;
    if !start.is_finite() || !end.is_finite() || end - start < 2.0 * near {
        return Err(SwitchOverError::Range { from: start, to: end });
    }
    let (first, last) = ((f64::from(start) * f64::from(rate)).ceil(), (f64::from(end) * f64::from(rate)).floor());
    let keys = over.clip.key_times();
    let frames = (last - first).max(0.0) + 1.0;
    if frames > MOST_FRAMES as f64 {
        return Err(SwitchOverError::TooLong { frames: frames as u64, most: MOST_FRAMES });
    }
    let at = |frame: u32| ((first + f64::from(frame)) / f64::from(rate)) as f32;
    let inside = (0..frames as u32).map(at).chain(keys).filter(|time| *time > start + near && *time < end - near);
    let mut times: Vec<f32> = inside.collect();
    times.sort_by(f32::total_cmp);
    times.dedup_by(|later, first| *later - *first < near);
    times.insert(0, start);
    times.push(end);
    Ok(times)
}

/// Seconds within which the clip goes from one side of the switch to the other: the two-hundredth part of a frame, or what can be
/// told apart so late in the clip.
fn gap(over: &SwitchRange<'_>) -> f32 {
    let late = over.span.into_iter().chain(over.clip.range).map(f32::abs).fold(0.0, f32::max);
    (0.005 / over.clip.frame_rate).max(1e-6 * late)
}

fn splice(over: &SwitchRange<'_>) -> Splice {
    let ([start, end], gap) = (over.span, gap(over));
    let [first, last] = over.clip.range;
    Splice { span: over.span, gap, keeps_before: start > first + 2.0 * gap, keeps_behind: end < last - 2.0 * gap }
}

/// A track with the layer and the former keys that it gets its keys in.
fn matched(
    over: &SwitchRange<'_>,
    splice: &Splice,
    target: TrackTarget,
    own: impl Fn(&Property) -> [f32; 4],
) -> Result<MatchedTrack, SwitchOverError> {
    let clip = over.clip;
    let layer = layer_for(over, &target)
        .ok_or_else(|| SwitchOverError::NoLayer { clip: clip.name.clone(), node: target.node })?;
    let former = match clip.layers[layer].tracks.get(&target) {
        Some(track) => track.keys.clone(),
        // Without keys the node has the pose of the document.
        None => {
            let time = clip.range[0].min(splice.span[0]);
            let value = clip.value_for(layer, &target, time, own(&target.property));
            vec![Key { time, value, ease: Ease::Stepped }]
        }
    };
    Ok(MatchedTrack { target, layer, former })
}

/// Topmost layer in effect that animates a target, else the layer that was asked for, else the lowest one that can have keys.
fn layer_for(over: &SwitchRange<'_>, target: &TrackTarget) -> Option<usize> {
    let layers = &over.clip.layers;
    let is_on = |place: &usize| {
        let layer = &layers[*place];
        !layer.muted && layer.weight > 0.0 && layer.concerns(target.node)
    };
    let places = || (0..layers.len()).filter(is_on);
    let known = places().rev().find(|place| layers[*place].tracks.contains_key(target));
    let asked = || places().find(|place| Some(layers[*place].uid) == over.layer);
    let whole = || places().find(|place| layers[*place].mode == LayerMode::Override);
    known.or_else(asked).or_else(whole).or_else(|| places().next())
}

/// Values of a track of a layer, one a frame.
type Values = Vec<[f32; 4]>;

/// Tracks that the matched poses change, with their values in the layers.
fn tracks(
    over: &SwitchRange<'_>,
    frames: &Frames<'_>,
    splice: &Splice,
) -> Result<(Vec<MatchedTrack>, Vec<Values>), SwitchOverError> {
    let (mut tracks, mut samples) = (Vec::new(), Vec::new());
    let nodes: BTreeSet<Uid> = frames.posed.iter().flat_map(|posed| posed.keys()).copied().collect();
    for node in nodes {
        for property in [Property::Translation, Property::Rotation] {
            let rounding = ROUNDING
                * match property {
                    Property::Rotation => over.tolerance.angle,
                    _ => over.tolerance.distance,
                };
            let before = |frame: usize| value_of(&frames.offset(frame, node), &property);
            let after = |frame: usize| {
                frames.posed[frame].get(&node).map_or_else(|| before(frame), |to| value_of(to, &property))
            };
            let count = frames.times.len();
            if (0..count).all(|frame| difference(&property, &before(frame), &after(frame)) <= rounding) {
                continue;
            }
            let target = TrackTarget { node, property: property.clone() };
            let track = matched(over, splice, target, |property| value_of(&frames.own(node), property))?;
            let mut values: Values = Vec::with_capacity(count);
            for (frame, time) in frames.times.iter().enumerate() {
                let mut value = over.clip.value_for(track.layer, &track.target, *time, after(frame));
                if let (Property::Rotation, Some(last)) = (&property, values.last()) {
                    let (turn, last) = (Quat::from_array(value), Quat::from_array(*last));
                    value = if turn.dot(last) < 0.0 { (-turn).to_array() } else { value };
                }
                values.push(value);
            }
            tracks.push(track);
            samples.push(values);
        }
    }
    Ok((tracks, samples))
}

/// Numbers of an offset for a property.
fn value_of(offset: &PoseOffset, property: &Property) -> [f32; 4] {
    let vector = |value: Vec3| [value.x, value.y, value.z, 0.0];
    match property {
        Property::Rotation => offset.rotation.to_array(),
        Property::Scale => vector(offset.scale),
        Property::Translation | Property::Attribute(_) => vector(offset.translation),
    }
}

/// Sets a property of an offset.
fn set(offset: &mut PoseOffset, property: &Property, value: [f32; 4]) {
    let vector = Vec3::new(value[0], value[1], value[2]);
    match property {
        Property::Translation => offset.translation = vector,
        Property::Rotation => offset.rotation = Quat::from_array(value),
        Property::Scale => offset.scale = vector,
        Property::Attribute(_) => {}
    }
}
