//! Clips played in blocks of frames, so that a long clip takes no more memory than a short one.
//!
//! A block holds as many frames as its memory allows: nodes that do not move are one value in it. Keys of a block are those of
//! a clip of its own, and blocks meet between two frames: the last key of one block and the first key of the next one are at
//! frames that follow one another.

use std::{ops::Range, sync::Arc};

use bevy::math::Quat;

use super::{BakedNode, strike};
use crate::{
    mesh::model::{Channel, ChannelTarget, Interpolation, Trs},
    rig::{animation::RigClip, operations::KeyTolerance},
    solve::{
        program::{RigProgram, RigState},
        reduction::{ReducedPart, SampledNode, reduce_skeleton},
    },
};

/// Bytes of memory that a block takes, about, while it is reduced to keys.
const BLOCK_BYTES: usize = 12 << 20;
/// Bytes of a frame of a part that moves: its value, that of its curve, and what of its tolerance is left and used.
const PART_BYTES: usize = 48;
/// Bytes of a frame of a node: its place.
const PLACE_BYTES: usize = 32;
/// Greatest difference of numbers, or share of numbers above 1, that is noise of their computation.
const NOISE: f32 = 1e-6;

/// Clip that is played for nodes, frame by frame.
pub(in crate::solve) struct PlayedClip<'a> {
    state: RigState,
    clip: &'a RigClip,
    nodes: &'a [BakedNode],
    /// Seconds of the frames from the clip's start.
    times: &'a [f32],
    /// Frame that is played next.
    next: usize,
    /// Rotation of each node at the frame before.
    turns: Vec<Quat>,
}

impl<'a> PlayedClip<'a> {
    /// Clip before its first frame.
    pub fn new(program: &Arc<RigProgram>, clip: &'a RigClip, nodes: &'a [BakedNode], times: &'a [f32]) -> Self {
        let turns = nodes.iter().map(|node| node.rest.rotation).collect();
        Self { state: RigState::new(program.clone()), clip, nodes, times, next: 0, turns }
    }

    /// True if all frames have been played.
    pub fn is_over(&self) -> bool {
        self.next >= self.times.len()
    }

    /// Next frames, with the nodes' transforms relative to their parents; `None` behind the last one.
    pub fn next_block(&mut self) -> Option<(Range<usize>, Vec<SampledNode>)> {
        if self.is_over() {
            return None;
        }
        let start = self.next;
        let empty = |(node, turn): (&BakedNode, &Quat)| SampledNode::new(node.parent, Some(*turn));
        let mut sampled: Vec<SampledNode> = self.nodes.iter().zip(&self.turns).map(empty).collect();
        let mut bytes = 0;
        while !self.is_over() && bytes <= BLOCK_BYTES {
            self.play_frame(&mut sampled);
            let moving: usize = sampled.iter().map(SampledNode::moving_parts).sum();
            bytes = (self.next - start) * (moving * PART_BYTES + sampled.len() * PLACE_BYTES);
        }
        for (turn, node) in self.turns.iter_mut().zip(&sampled) {
            *turn = node.turn().unwrap_or(*turn);
        }
        Some((start..self.next, sampled))
    }

    fn play_frame(&mut self, sampled: &mut [SampledNode]) {
        let time = self.clip.range[0] + self.times[self.next];
        strike(&mut self.state, &self.clip.sample(time));
        let globals: Vec<Option<Trs>> = self.nodes.iter().map(|node| self.state.global(node.uid)).collect();
        for (at, (node, sampled)) in self.nodes.iter().zip(sampled).enumerate() {
            sampled.push(match (globals[at], node.parent) {
                (Some(global), None) => global,
                (Some(global), Some(parent)) => globals[parent].map_or(node.rest, |parent| global.relative_to(&parent)),
                (None, _) => node.rest,
            });
        }
        self.next += 1;
    }
}

/// Linear keys of the parts of nodes, of all blocks of a clip. `fixed` marks what is played as it is, and gets no keys.
pub(in crate::solve) fn reduced_keys(
    mut played: PlayedClip,
    fixed: &[[bool; 3]],
    tolerance: &KeyTolerance,
) -> Vec<[JoinedKeys; 3]> {
    let mut joined: Vec<[JoinedKeys; 3]> = vec![Default::default(); fixed.len()];
    while let Some((frames, nodes)) = played.next_block() {
        let times = &played.times[frames];
        let reduced = reduce_skeleton(times, nodes, fixed, tolerance);
        let end = times.last().copied().unwrap_or_default();
        for (joined, reduced) in joined.iter_mut().flatten().zip(reduced.into_iter().flatten()) {
            joined.append(&reduced, end);
        }
    }
    joined
}

/// Linear keys of a part of a node, block after block.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::solve) struct JoinedKeys {
    times: Vec<f32>,
    values: Vec<[f32; 4]>,
    /// Time up to which the last value is held.
    held_until: f32,
    /// Least of the tolerances of the blocks.
    tolerance: f32,
}

impl JoinedKeys {
    /// Adds the keys of the next block, whose last frame is at `end`.
    fn append(&mut self, part: &ReducedPart, end: f32) {
        let Some(first) = part.keys.first() else { return };
        self.tolerance = if self.times.is_empty() { part.tolerance } else { self.tolerance.min(part.tolerance) };
        let last = self.times.last().copied().zip(self.values.last().copied());
        let is_held = part.keys.len() == 1 && last.is_some_and(|(_, value)| is_noise(&value, &first.value));
        if !is_held {
            if let Some((_, value)) = last.filter(|(time, _)| *time < self.held_until) {
                self.times.push(self.held_until);
                self.values.push(value);
            }
            self.times.extend(part.keys.iter().map(|key| key.time));
            self.values.extend(part.keys.iter().map(|key| key.value));
        }
        self.held_until = end;
    }

    /// Times and values of the keys.
    pub fn keys(&self) -> impl Iterator<Item = (f32, [f32; 4])> {
        self.times.iter().copied().zip(self.values.iter().copied())
    }

    /// Largest difference of a value with which its joints stay near: degrees for rotations.
    pub fn tolerance(&self) -> f32 {
        self.tolerance
    }

    /// Channel of the keys, whose values have `width` numbers.
    pub fn channel(self, target: ChannelTarget, width: usize) -> Channel {
        let values = self.values.iter().flat_map(|value| value[..width].iter().copied()).collect();
        Channel { target, interpolation: Interpolation::Linear, times: self.times, values }
    }
}

fn is_noise(a: &[f32; 4], b: &[f32; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= NOISE * a.abs().max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::animation::{Ease, Key};

    fn part(keys: &[(f32, f32)]) -> ReducedPart {
        let key = |(time, x): &(f32, f32)| Key { time: *time, value: [*x, 0.0, 0.0, 0.0], ease: Ease::Linear };
        ReducedPart { keys: keys.iter().map(key).collect(), tolerance: 1.0 }
    }

    #[test]
    fn values_are_held_up_to_the_end_of_their_block() {
        let mut joined = JoinedKeys::default();
        let blocks: [(&[(f32, f32)], f32); 6] = [
            (&[(0.0, 1.0)], 4.0),
            (&[(5.0, 1.0)], 9.0),
            (&[(10.0, 1.0), (14.0, 2.0)], 14.0),
            (&[(15.0, 2.0)], 19.0),
            (&[(20.0, 3.0)], 24.0),
            (&[(25.0, 3.0)], 29.0),
        ];
        for (keys, end) in blocks {
            joined.append(&part(keys), end);
        }
        let found: Vec<(f32, f32)> = joined.keys().map(|(time, value)| (time, value[0])).collect();
        assert_eq!(found, [(0.0, 1.0), (9.0, 1.0), (10.0, 1.0), (14.0, 2.0), (19.0, 2.0), (20.0, 3.0)]);
    }

    #[test]
    fn a_part_that_never_changes_has_one_key() {
        let mut joined = JoinedKeys::default();
        for block in 0..5_u8 {
            let start = 10.0 * f32::from(block);
            joined.append(&part(&[(start, 1.0 + 1e-7 * f32::from(block))]), start + 9.0);
        }
        assert_eq!(joined.keys().collect::<Vec<_>>(), [(0.0, [1.0, 0.0, 0.0, 0.0])]);
    }
}
