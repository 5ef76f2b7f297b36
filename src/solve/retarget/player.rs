//! Tracks played on a program, frame by frame, to see where they put the joints.

use std::{collections::BTreeSet, sync::Arc};

use bevy::math::{Quat, Vec3};
use rayon::prelude::*;

use crate::{
    rig::{
        NodeType, PoseOffset, Uid,
        animation::{Property, TrackTarget},
    },
    solve::{
        program::{RigProgram, RigState},
        reduction::{JointPlace, SampledTrack},
    },
};

/// Frames that one instance plays.
const BLOCK: usize = 32;

/// Joints that a track moves.
#[derive(Debug, Clone, Default)]
pub(super) struct TrackReach {
    /// Greatest way of a joint for one unit of the track, a degree for rotations.
    pub most: f32,
    /// Indices of the places that the track moves, in the list that [`Player::each`] hands over.
    pub places: BTreeSet<usize>,
}

/// Program with the slots that tracks write.
pub(super) struct Player {
    program: Arc<RigProgram>,
    /// Slots of nodes with their tracks for translation, rotation and scale.
    nodes: Vec<(usize, [Option<usize>; 3])>,
    /// Slots of attributes with their tracks.
    attributes: Vec<(usize, usize)>,
    /// Settings of the switches at which joints are looked at: as they are, and all the other way round.
    modes: Vec<Vec<(usize, f32)>>,
    /// Joints that tracks may move: those with tracks, those that commands drive, and all below them.
    joints: Vec<usize>,
}

impl Player {
    /// Player of tracks on these targets. `switches` are attributes from 0 to 1 with their values.
    pub fn new(program: &Arc<RigProgram>, targets: &[TrackTarget], switches: &[(Uid, String, f32)]) -> Self {
        let mut nodes: std::collections::BTreeMap<usize, [Option<usize>; 3]> = std::collections::BTreeMap::new();
        let mut attributes = Vec::new();
        for (track, TrackTarget { node, property }) in targets.iter().enumerate() {
            let part = match property {
                Property::Translation => 0,
                Property::Rotation => 1,
                Property::Scale => 2,
                Property::Attribute(name) => {
                    attributes.extend(program.attribute(*node, name).map(|slot| (slot, track)));
                    continue;
                }
            };
            if let Some(slot) = program.node(*node) {
                nodes.entry(slot).or_default()[part] = Some(track);
            }
        }
        let found: Vec<(usize, f32)> =
            switches.iter().filter_map(|(node, name, value)| Some((program.attribute(*node, name)?, *value))).collect();
        let other = found.iter().map(|(slot, value)| (*slot, 1.0 - value)).collect();
        let modes = if found.is_empty() { vec![found] } else { vec![found, other] };
        let mut is_moved = vec![false; program.nodes().len()];
        for (slot, node) in program.nodes().iter().enumerate() {
            let follows = node.parent.is_some_and(|parent| parent >= slot || is_moved[parent]);
            is_moved[slot] = follows || !node.is_plain() || nodes.contains_key(&slot);
        }
        let is_seen = |slot: &usize| is_moved[*slot] && program.nodes()[*slot].kind == NodeType::Joint;
        let joints = (0..program.nodes().len()).filter(is_seen).collect();
        Self { program: program.clone(), nodes: nodes.into_iter().collect(), attributes, modes, joints }
    }

    /// Places of the joints in each mode, with values of the tracks.
    fn places(&self, state: &mut RigState, values: &[[f32; 4]]) -> Vec<JointPlace> {
        for (slot, parts) in &self.nodes {
            let mut offset = PoseOffset::IDENTITY;
            if let Some([x, y, z, _]) = parts[0].map(|track| values[track]) {
                offset.translation = Vec3::new(x, y, z);
            }
            if let Some(turn) = parts[1].map(|track| values[track]) {
                offset.rotation = Quat::from_array(turn);
            }
            if let Some([x, y, z, _]) = parts[2].map(|track| values[track]) {
                offset.scale = Vec3::new(x, y, z);
            }
            state.set_offset_at(*slot, offset);
        }
        for (slot, track) in &self.attributes {
            state.set_attribute_at(*slot, values[*track][0]);
        }
        let mut places = Vec::with_capacity(self.modes.len() * self.joints.len());
        for mode in &self.modes {
            for (slot, value) in mode {
                state.set_attribute_at(*slot, *value);
            }
            state.evaluate(0.0);
            places.extend(self.joints.iter().map(|joint| {
                let at = state.global_at(*joint);
                (at.translation, at.rotation)
            }));
        }
        places
    }

    /// Results of a function of the joints' places, one for each of so many frames; `value` gives a track's value at a
    /// frame.
    pub fn each<T: Send>(
        &self,
        frames: usize,
        value: impl Fn(usize, usize) -> [f32; 4] + Sync,
        tracks: usize,
        of: impl Fn(usize, Vec<JointPlace>) -> T + Sync,
    ) -> Vec<T> {
        let blocks: Vec<usize> = (0..frames).step_by(BLOCK).collect();
        let played: Vec<Vec<T>> = blocks
            .into_par_iter()
            .map(|start| {
                let mut state = RigState::new(self.program.clone());
                let at = |frame: usize| {
                    let values: Vec<[f32; 4]> = (0..tracks).map(|track| value(track, frame)).collect();
                    of(frame, self.places(&mut state, &values))
                };
                (start..(start + BLOCK).min(frames)).map(at).collect()
            })
            .collect();
        played.into_iter().flatten().collect()
    }

    /// Number of places that a function of [`each`](Self::each) gets.
    pub fn width(&self) -> usize {
        self.modes.len() * self.joints.len()
    }

    /// Results of a function of the joints' places with either of two values of the tracks, one for each of so many frames. No
    /// places are held over the frames.
    pub fn each_pair<T: Send>(
        &self,
        frames: usize,
        values: [&(dyn Fn(usize, usize) -> [f32; 4] + Sync); 2],
        tracks: usize,
        of: impl Fn([Vec<JointPlace>; 2]) -> T + Sync,
    ) -> Vec<T> {
        let blocks: Vec<usize> = (0..frames).step_by(BLOCK).collect();
        let played: Vec<Vec<T>> = blocks
            .into_par_iter()
            .map(|start| {
                let mut states = [(); 2].map(|()| RigState::new(self.program.clone()));
                let at = |frame: usize| {
                    of([0, 1].map(|side: usize| {
                        let values: Vec<[f32; 4]> = (0..tracks).map(|track| values[side](track, frame)).collect();
                        self.places(&mut states[side], &values)
                    }))
                };
                (start..(start + BLOCK).min(frames)).map(at).collect()
            })
            .collect();
        played.into_iter().flatten().collect()
    }

    /// Reach of each track: tried at some frames, in all directions. `length` is a small distance on the figure.
    pub fn reaches(&self, tracks: &[SampledTrack], length: f32) -> Vec<TrackReach> {
        let count = tracks.first().map_or(0, |track| track.values.len());
        let mut frames = [0, count / 4, count / 2, 3 * count / 4, count.saturating_sub(1)].to_vec();
        frames.dedup();
        let mut reaches = vec![TrackReach::default(); tracks.len()];
        let mut state = RigState::new(self.program.clone());
        for frame in frames.into_iter().filter(|frame| *frame < count) {
            let mut values: Vec<[f32; 4]> = tracks.iter().map(|track| track.values[frame]).collect();
            let before = self.places(&mut state, &values);
            for (track, reach) in reaches.iter_mut().enumerate() {
                let value = values[track];
                for (changed, by) in tried(&tracks[track].property, value, length) {
                    values[track] = changed;
                    let after = self.places(&mut state, &values);
                    for (place, ((from, turn), (to, turned))) in before.iter().zip(&after).enumerate() {
                        let way = from.distance(*to);
                        reach.most = reach.most.max(way / by);
                        let angle = turn.inverse() * *turned;
                        // A hundredth of the way or the angle that was tried counts.
                        if way > 1e-2 * length || angle.xyz().length_squared() > 1e-8 {
                            reach.places.insert(place);
                        }
                    }
                }
                values[track] = value;
            }
        }
        reaches
    }
}

/// Values near one, with how far they are from it.
fn tried(property: &Property, value: [f32; 4], length: f32) -> Vec<([f32; 4], f32)> {
    let moved = |axis: usize, by: f32| {
        let mut changed = value;
        changed[axis] += by;
        (changed, by)
    };
    match property {
        Property::Translation => (0..3).map(|axis| moved(axis, length)).collect(),
        Property::Scale => (0..3).map(|axis| moved(axis, 0.01)).collect(),
        Property::Attribute(_) => vec![moved(0, 1.0)],
        Property::Rotation => {
            let (sin, cos) = bevy::math::ops::sin_cos(0.5 * 1.0_f32.to_radians());
            let turned = |axis: Vec3| {
                let turn = Quat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos);
                ((Quat::from_array(value) * turn).normalize().to_array(), 1.0)
            };
            [Vec3::X, Vec3::Y, Vec3::Z].map(turned).to_vec()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{modules, processor::Builder, rig::template::read_template, solve::program::CompileOptions};

    /// A motion of one arm on a rig of many joints takes memory for the joints of the arm.
    #[test]
    fn joints_that_no_track_moves_are_not_looked_at() {
        let others: String = (0..100).map(|number| format!("(label: \"o{number}\", parent: \"top\"), ")).collect();
        let text = format!(
            "(format: 2, name: \"n\", joints: [(label: \"top\"), {others}(label: \"arm\", parent: \"top\"), \
             (label: \"hand\", parent: \"arm\", translation: (0, 1, 0))])"
        );
        let rig = read_template(text.as_bytes()).unwrap().rig;
        let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
        let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
        let target =
            |label: &str| vec![TrackTarget { node: rig.labelled(label).unwrap(), property: Property::Rotation }];
        assert_eq!(Player::new(&program, &target("arm"), &[]).joints.len(), 2);
        assert_eq!(Player::new(&program, &target("top"), &[]).joints.len(), 103);
        let turned = Quat::from_xyzw(0.6, 0.0, 0.0, 0.8);
        let player = Player::new(&program, &target("arm"), &[]);
        let places = player.each(
            2,
            |_, frame| if frame == 0 { [0.0, 0.0, 0.0, 1.0] } else { turned.to_array() },
            1,
            |_, places| places,
        );
        assert_eq!((places[0].len(), places[1].len(), player.width()), (2, 2, 2));
        let turn = |_: usize, frame: usize| if frame == 0 { [0.0, 0.0, 0.0, 1.0] } else { turned.to_array() };
        let still = |_: usize, _: usize| [0.0, 0.0, 0.0, 1.0];
        let pairs = player.each_pair(2, [&turn, &still], 1, |pair| pair);
        let wanted = [places[0].clone(), places[1].clone()].map(|moved| [moved, places[0].clone()]);
        assert_eq!(pairs, wanted);
        assert!(places[0][1].0.distance(places[1][1].0) > 0.4, "{places:?}");
    }
}
