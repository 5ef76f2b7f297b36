//! Frames of a range with their matched poses, and where other poses put the joints there.

use std::collections::BTreeMap;

use bevy::math::{Quat, Vec3};
use rayon::prelude::*;

use super::{MatchedTrack, SwitchNote, Values, set};
use crate::{
    mesh::model::Trs,
    rig::{
        BuiltRig, NodeType, PoseOffset, RigEdit, SwitchData, Uid,
        animation::{Property, RigClip, SampledPose, TrackTarget},
    },
    solve::{
        bake_clip::strike,
        keep_pose::Deviation,
        matching::{MatchError, angle_between, match_switch},
        program::RigState,
        reduction::JointPlace,
    },
};

/// Frames that one instance plays.
const BLOCK: usize = 16;

/// The frames of a range.
pub(super) struct Frames<'a> {
    /// Instance in the pose of the document.
    state: &'a RigState,
    switch: &'a SwitchData,
    value: f32,
    /// Slots of the joints.
    joints: Vec<usize>,
    pub times: Vec<f32>,
    /// Poses of the clip.
    poses: Vec<SampledPose>,
    /// Places of the joints in these poses.
    before: Vec<Vec<Trs>>,
    /// Offsets of the controls with which the switch is thrown.
    pub posed: Vec<BTreeMap<Uid, PoseOffset>>,
}

/// Pose of a clip at a moment. Properties of a node without keys are those of the document.
fn pose_at(state: &RigState, clip: &RigClip, time: f32) -> SampledPose {
    let mut pose = clip.sample(time);
    for (node, offset) in &mut pose.offsets {
        let own = own(state, *node);
        let has = |property: Property| clip.value(&TrackTarget { node: *node, property }, time).is_some();
        if !has(Property::Translation) {
            offset.translation = own.translation;
        }
        if !has(Property::Rotation) {
            offset.rotation = own.rotation;
        }
        if !has(Property::Scale) {
            offset.scale = own.scale;
        }
    }
    pose
}

fn own(state: &RigState, node: Uid) -> PoseOffset {
    state.program().node(node).map_or(PoseOffset::IDENTITY, |slot| state.offset_at(slot))
}

/// Results for each frame, in blocks that one instance plays.
fn each<T: Send>(state: &RigState, count: usize, of: impl Fn(&mut RigState, usize) -> T + Sync) -> Vec<T> {
    let blocks: Vec<usize> = (0..count).step_by(BLOCK).collect();
    let played: Vec<Vec<T>> = blocks
        .into_par_iter()
        .map(|start| {
            let mut state = state.clone();
            (start..(start + BLOCK).min(count)).map(|frame| of(&mut state, frame)).collect()
        })
        .collect();
    played.into_iter().flatten().collect()
}

impl<'a> Frames<'a> {
    /// Matches a switch at each of the moments of a clip.
    pub fn matched(
        rig: &BuiltRig,
        state: &'a RigState,
        switch: &'a SwitchData,
        value: f32,
        clip: &RigClip,
        times: Vec<f32>,
    ) -> Result<Self, MatchError> {
        let nodes = state.program().nodes();
        let joints: Vec<usize> = (0..nodes.len()).filter(|slot| nodes[*slot].kind == NodeType::Joint).collect();
        let found = each(state, times.len(), |played, frame| {
            let pose = pose_at(state, clip, times[frame]);
            strike(played, &pose);
            let before: Vec<Trs> = joints.iter().map(|joint| *played.global_at(*joint)).collect();
            let matched = match_switch(rig, played, switch, value);
            (pose, before, matched)
        });
        let mut frames =
            Self { state, switch, value, joints, times, poses: Vec::new(), before: Vec::new(), posed: Vec::new() };
        for (pose, before, matched) in found {
            let offset = |edit: RigEdit| match edit {
                RigEdit::SetOffset(node, offset) => Some((node, offset.unwrap_or_default())),
                _ => None,
            };
            frames.posed.push(matched?.edits.into_iter().filter_map(offset).collect());
            frames.poses.push(pose);
            frames.before.push(before);
        }
        Ok(frames)
    }

    /// Offset of a node in the pose of the document.
    pub fn own(&self, node: Uid) -> PoseOffset {
        own(self.state, node)
    }

    /// Offset of a node in the clip at a frame.
    pub fn offset(&self, frame: usize, node: Uid) -> PoseOffset {
        self.poses[frame].offsets.get(&node).copied().unwrap_or_else(|| self.own(node))
    }

    /// Places of the joints at each frame with the switch thrown; `values` are those of the tracks in their layers.
    pub fn play(&self, clip: &RigClip, tracks: &[MatchedTrack], values: &[Values]) -> Vec<Vec<JointPlace>> {
        each(self.state, self.times.len(), |state, frame| {
            let values: Vec<[f32; 4]> = values.iter().map(|of| of[frame]).collect();
            self.places(state, clip, frame, tracks, &values)
        })
    }

    fn places(
        &self,
        state: &mut RigState,
        clip: &RigClip,
        frame: usize,
        tracks: &[MatchedTrack],
        values: &[[f32; 4]],
    ) -> Vec<JointPlace> {
        let mut pose = self.poses[frame].clone();
        for (MatchedTrack { target, layer, .. }, value) in tracks.iter().zip(values) {
            let mixed = clip.value_with(*layer, target, self.times[frame], *value).unwrap_or(*value);
            let offset = pose.offsets.entry(target.node).or_insert_with(|| self.own(target.node));
            set(offset, &target.property, mixed);
        }
        let thrown = pose.values.entry(self.switch.control).or_default();
        thrown.insert(self.switch.attribute.to_string(), self.value);
        strike(state, &pose);
        let place = |joint: &usize| {
            let at = state.global_at(*joint);
            (at.translation, at.rotation)
        };
        self.joints.iter().map(place).collect()
    }

    /// Greatest way of a joint for one unit of each track, a degree for rotations: tried at three frames.
    pub fn reaches(&self, tracks: &[MatchedTrack], values: &[Values], clip: &RigClip) -> Vec<f32> {
        let count = self.times.len();
        let places = || self.before[0].iter().map(|at| at.translation);
        let first = places().next().unwrap_or_default();
        let small = 1e-3 * places().map(|at| at.distance(first)).fold(1e-3, f32::max);
        let mut state = self.state.clone();
        let mut reaches = vec![0.0_f32; tracks.len()];
        for frame in [0, count / 2, count - 1] {
            let mut at: Vec<[f32; 4]> = values.iter().map(|of| of[frame]).collect();
            let before = self.places(&mut state, clip, frame, tracks, &at);
            for (number, track) in tracks.iter().enumerate() {
                let value = at[number];
                for (tried, by) in tried(&track.target.property, value, small) {
                    at[number] = tried;
                    let after = self.places(&mut state, clip, frame, tracks, &at);
                    let ways = before.iter().zip(&after).map(|((from, _), (to, _))| from.distance(*to));
                    reaches[number] = reaches[number].max(ways.fold(0.0, f32::max) / by);
                }
                at[number] = value;
            }
        }
        reaches
    }

    /// Joints that another clip puts elsewhere at some frame, by more than a distance or an angle; in the order of the rig.
    pub fn notes(&self, next: &RigClip, distance: f32, angle: f32) -> Vec<SwitchNote> {
        let after = each(self.state, self.times.len(), |state, frame| -> Vec<Trs> {
            strike(state, &pose_at(self.state, next, self.times[frame]));
            self.joints.iter().map(|joint| *state.global_at(*joint)).collect()
        });
        let nodes = self.state.program().nodes();
        let mut notes: Vec<SwitchNote> = Vec::new();
        for (number, slot) in self.joints.iter().enumerate() {
            let mut worst: Option<(f32, SwitchNote)> = None;
            for (frame, time) in self.times.iter().enumerate() {
                let (was, is) = (&self.before[frame][number], &after[frame][number]);
                let (far, turned) = (was.translation.distance(is.translation), angle_between(was, is));
                if far <= distance && turned <= angle {
                    continue;
                }
                let size = (far / distance).max(turned / angle);
                let frames = worst.as_ref().map_or(0, |(_, note)| note.frames) + 1;
                if worst.as_ref().is_none_or(|(most, _)| size > *most) {
                    let label = nodes[*slot].label.as_deref().map(str::to_owned);
                    let deviation = Deviation { joint: nodes[*slot].uid, label, distance: far, angle: turned };
                    worst = Some((size, SwitchNote { time: *time, frames, deviation }));
                } else if let Some((_, note)) = &mut worst {
                    note.frames = frames;
                }
            }
            notes.extend(worst.map(|(_, note)| note));
        }
        notes
    }
}

/// Values near one, with how far they are from it.
fn tried(property: &Property, value: [f32; 4], small: f32) -> [([f32; 4], f32); 3] {
    std::array::from_fn(|axis| {
        let mut changed = value;
        if *property == Property::Rotation {
            let (sin, cos) = bevy::math::ops::sin_cos(0.5 * 1.0_f32.to_radians());
            let turn = Vec3::AXES[axis] * sin;
            changed = (Quat::from_array(value) * Quat::from_xyzw(turn.x, turn.y, turn.z, cos)).normalize().to_array();
            return (changed, 1.0);
        }
        changed[axis] += small;
        (changed, small)
    })
}
