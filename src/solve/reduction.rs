//! Reduction of sampled motion to few keys, bounded by what joints do in the rig's space.
//!
//! The error of a key matters by what hangs below its node: a tenth of a degree moves a head by nothing and a hand,
//! seen from the hips, by two millimetres. So tracks are fitted with a tolerance by their reach, the motion is played,
//! and where a joint is too far off, the tracks that move it are fitted more closely around those frames. A closer fit has its
//! keys elsewhere from there on, which may put other frames off, so in the end tracks keep the keys that they have and get more
//! at frames that are off: that ends, and only there costs keys.

use bevy::math::{Quat, Vec3};
use rayon::prelude::*;

use super::curve_fit::{fit_curve, fit_lines, sampled};
use crate::{
    mesh::model::Trs,
    rig::{
        animation::{Ease, Key, Property},
        operations::KeyTolerance,
    },
};

/// Most rounds of fitting.
const ROUNDS: usize = 48;
/// Round from which all tracks are fitted more closely, not only those that move what is off.
const TOGETHER: usize = 9;
/// Round from which tracks keep their keys, and those that move what is off get a key there.
const PINNED: usize = 12;
/// Round from which all tracks get a key where something is off.
const ALL_PINNED: usize = 32;
/// Frames on both sides of a frame that is off at which tracks are fitted more closely.
const AROUND: usize = 6;

/// Samples of a property of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledTrack {
    /// The property.
    pub property: Property,
    /// Values, one a frame.
    pub values: Vec<[f32; 4]>,
    /// Largest difference of a value at first: degrees for rotations.
    pub tolerance: f32,
}

/// Position and rotation of a joint in the rig's space.
pub type JointPlace = (Vec3, Quat);

/// Errors at a frame in tolerances: 1 is just allowed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameErrors {
    /// Greatest error of all places.
    pub worst: f32,
    /// Greatest error of the places that each track moves.
    pub of_tracks: Vec<f32>,
}

/// Curves that keys may make.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CurveKind {
    /// Cubic where that needs fewer numbers, else linear.
    #[default]
    Fewest,
    /// Linear alone, for files: many importers drop tangents (Blender's does), and joints whose tracks have their keys at
    /// different times are then centimetres off. Takes a sixth more numbers for captured motion.
    Linear,
}

impl CurveKind {
    fn fit(self, property: &Property, times: &[f32], values: &[[f32; 4]], tolerance: &[f32]) -> Vec<Key> {
        match self {
            Self::Fewest => fit_curve(property, times, values, tolerance),
            Self::Linear => fit_lines(property, times, values, tolerance)
                .into_iter()
                .map(|frame| linear_key((&times[frame], &values[frame])))
                .collect(),
        }
    }
}

/// Keys of tracks with which the motion stays within its bounds. `measure` plays values, a list a track, and gives the errors of
/// each frame.
pub fn reduce_tracks(
    times: &[f32],
    tracks: &[SampledTrack],
    curves: CurveKind,
    measure: impl Fn(&[Vec<[f32; 4]>]) -> Vec<FrameErrors>,
) -> Vec<Vec<Key>> {
    let fit = |track: &SampledTrack, tolerance: &[f32]| {
        let keys = curves.fit(&track.property, times, &track.values, tolerance);
        let values = sampled(&track.property, times, keys.clone());
        let frame = |key: &Key| times.binary_search_by(|time| time.total_cmp(&key.time)).ok();
        let frames = keys.iter().filter_map(frame).collect();
        FittedCurve { curve: keys, values, frames }
    };
    fit_within(tracks, measure, fit).unwrap_or_else(|| all_keys(times, tracks))
}

/// Linear keys at every frame.
fn all_keys(times: &[f32], tracks: &[SampledTrack]) -> Vec<Vec<Key>> {
    tracks.iter().map(|track| times.iter().zip(&track.values).map(linear_key).collect()).collect()
}

fn linear_key((time, value): (&f32, &[f32; 4])) -> Key {
    Key { time: *time, value: *value, ease: Ease::Linear }
}

/// Curve of a track within a tolerance.
pub(super) struct FittedCurve<K> {
    pub curve: K,
    /// Values of the curve, one a frame.
    pub values: Vec<[f32; 4]>,
    /// Frames of its keys; none of a curve with a value for each frame.
    pub frames: Vec<usize>,
}

/// Curves of tracks with which the motion stays within its bounds, as [`reduce_tracks`] finds them; `fit` gives a curve within
/// tolerances, one a frame, which has a key where the tolerance is zero. `None` if no curves do.
pub(super) fn fit_within<K: Send>(
    tracks: &[SampledTrack],
    measure: impl Fn(&[Vec<[f32; 4]>]) -> Vec<FrameErrors>,
    fit: impl Fn(&SampledTrack, &[f32]) -> FittedCurve<K> + Sync,
) -> Option<Vec<K>> {
    let mut shares: Vec<Vec<f32>> = tracks.iter().map(|track| vec![1.0; track.values.len()]).collect();
    for round in 0..ROUNDS {
        let fitted = |(track, shares): (&SampledTrack, &Vec<f32>)| {
            let tolerance: Vec<f32> = shares.iter().map(|share| share * track.tolerance).collect();
            fit(track, &tolerance)
        };
        let fitted: Vec<FittedCurve<K>> = tracks.par_iter().zip(&shares).map(fitted).collect();
        let (mut curves, mut values, mut frames) = (Vec::new(), Vec::new(), Vec::new());
        for found in fitted {
            curves.push(found.curve);
            values.push(found.values);
            frames.push(found.frames);
        }
        let errors = measure(&values);
        if errors.iter().all(|errors| errors.worst <= 1.0) {
            return Some(curves);
        }
        shares.par_iter_mut().zip(&frames).enumerate().for_each(|(track, (shares, frames))| {
            let own = |errors: &FrameErrors| match errors.of_tracks.get(track) {
                Some(own) if round < TOGETHER || (PINNED..ALL_PINNED).contains(&round) => *own,
                _ => errors.worst,
            };
            let errors: Vec<f32> = errors.iter().map(own).collect();
            if round < PINNED { tighten(shares, &errors) } else { pin(shares, frames, &errors) }
        });
    }
    None
}

/// Lowers the shares of the tolerance around frames that are off.
fn tighten(shares: &mut [f32], errors: &[f32]) {
    let before = shares.to_vec();
    for (frame, error) in errors.iter().enumerate().filter(|(_, error)| **error > 1.0) {
        let factor = (0.97 / error).max(0.5);
        for near in frame.saturating_sub(AROUND)..(frame + AROUND + 1).min(shares.len()) {
            shares[near] = shares[near].min(before[near] * factor);
        }
    }
}

/// Takes the tolerance from the frames of keys, which stay where they are, and from frames that are off.
fn pin(shares: &mut [f32], keys: &[usize], errors: &[f32]) {
    for key in keys {
        shares[*key] = 0.0;
    }
    for (share, _) in shares.iter_mut().zip(errors).filter(|(_, error)| **error > 1.0) {
        *share = 0.0;
    }
}

/// Errors of joints at a frame in tolerances: for each the greater one of its distance and its angle.
pub fn errors_of(found: &[JointPlace], wanted: &[JointPlace], tolerance: &KeyTolerance) -> Vec<f32> {
    let of = |((place, turn), (wanted, wanted_turn)): (&JointPlace, &JointPlace)| {
        let angle = super::curve_fit::difference(&Property::Rotation, &turn.to_array(), &wanted_turn.to_array());
        (place.distance(*wanted) / tolerance.distance).max(angle / tolerance.angle)
    };
    found.iter().zip(wanted).map(of).collect()
}

/// Tolerance of a track that moves joints by `reach` for one unit of its value, a degree for rotations.
pub fn track_tolerance(property: &Property, reach: f32, tolerance: &KeyTolerance) -> f32 {
    let by_reach = tolerance.distance / reach.max(1e-9);
    match property {
        Property::Rotation => by_reach.min(tolerance.angle),
        Property::Translation => by_reach.min(10.0 * tolerance.distance),
        Property::Scale => by_reach.min(tolerance.factor),
        Property::Attribute(_) => by_reach.min(tolerance.value),
    }
}

/// Part of a transform, frame by frame: a translation, rotation or scale. A part that does not change is one value.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampledPart(Vec<[f32; 4]>);

impl SampledPart {
    /// Part with a value for each frame, or with one for all.
    pub(super) fn new(values: Vec<[f32; 4]>) -> Self {
        Self(values)
    }

    /// Value at a frame.
    fn at(&self, frame: usize) -> [f32; 4] {
        match &self.0[..] {
            [only] => *only,
            values => values.get(frame).copied().unwrap_or_default(),
        }
    }

    /// Adds a value behind those of `frames` frames.
    fn push(&mut self, frames: usize, value: [f32; 4]) {
        match self.0.first().copied() {
            Some(first) if self.0.len() == 1 && first == value => return,
            Some(first) => self.0.resize(frames, first),
            None => {}
        }
        self.0.push(value);
    }

    fn is_moving(&self) -> bool {
        self.0.len() > 1
    }
}

/// Node of a skeleton with its transforms relative to the parent, frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledNode {
    /// Place of the parent among the nodes, before the node's own.
    pub parent: Option<usize>,
    /// Translation, rotation and scale relative to the parent.
    parts: [SampledPart; 3],
    /// Rotation at the last frame.
    turn: Option<Quat>,
    frames: usize,
}

impl SampledNode {
    /// Node without any frame. The first rotation lies on the side of `turn`, if there is one.
    pub fn new(parent: Option<usize>, turn: Option<Quat>) -> Self {
        Self { parent, parts: Default::default(), turn, frames: 0 }
    }

    /// Adds a frame; rotations each lie on the side of the one before.
    pub fn push(&mut self, local: Trs) {
        let is_across = self.turn.is_some_and(|turn| local.rotation.dot(turn) < 0.0);
        let rotation = if is_across { -local.rotation } else { local.rotation };
        self.turn = Some(rotation);
        for (part, numbers) in self.parts.iter_mut().zip(numbers_of(&Trs { rotation, ..local })) {
            part.push(self.frames, numbers);
        }
        self.frames += 1;
    }

    /// Rotation at the last frame.
    pub fn turn(&self) -> Option<Quat> {
        self.turn
    }

    /// Count of parts that change.
    pub fn moving_parts(&self) -> usize {
        self.parts.iter().filter(|part| part.is_moving()).count()
    }

    fn local(&self, frame: usize) -> Trs {
        transform_of(self.parts.each_ref().map(|part| part.at(frame)))
    }
}

/// Translation, rotation and scale of a transform.
fn numbers_of(local: &Trs) -> [[f32; 4]; 3] {
    let vector = |v: Vec3| [v.x, v.y, v.z, 0.0];
    [vector(local.translation), local.rotation.to_array(), vector(local.scale)]
}

fn transform_of([[x, y, z, _], rotation, [across, up, along, _]]: [[f32; 4]; 3]) -> Trs {
    Trs { translation: Vec3::new(x, y, z), rotation: Quat::from_array(rotation), scale: Vec3::new(across, up, along) }
}

/// Keys of a part of a node.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReducedPart {
    /// Linear keys; none for a part that is played as it is.
    pub keys: Vec<Key>,
    /// Largest difference of a value: degrees for rotations.
    pub tolerance: f32,
}

/// Linear keys of the transforms of a skeleton's nodes: translation, rotation and scale. Joints are within the tolerance of
/// where they were at every frame. `fixed` marks what is played as it is, and gets no keys.
pub fn reduce_skeleton(
    times: &[f32],
    nodes: Vec<SampledNode>,
    fixed: &[[bool; 3]],
    tolerance: &KeyTolerance,
) -> Vec<[ReducedPart; 3]> {
    let mut reduced: Vec<[ReducedPart; 3]> = vec![Default::default(); nodes.len()];
    let Some(start) = times.first() else { return reduced };
    let skeleton = SampledSkeleton::new(times.len(), nodes, fixed, tolerance);
    let found = reduce_tracks(times, &skeleton.tracks, CurveKind::Linear, |samples| skeleton.errors(samples));
    for (((at, part), track), keys) in skeleton.owners.iter().zip(&skeleton.tracks).zip(found) {
        reduced[*at][*part] = ReducedPart { keys, tolerance: track.tolerance };
    }
    for RestingPart { node, part, value, tolerance } in &skeleton.resting {
        reduced[*node][*part] = ReducedPart { keys: vec![linear_key((start, value))], tolerance: *tolerance };
    }
    reduced
}

/// True if nodes whose parts have other values are within the tolerance of where they were at every frame.
pub(super) fn are_near(
    nodes: &[SampledNode],
    frames: usize,
    values: &[[SampledPart; 3]],
    tolerance: &KeyTolerance,
) -> bool {
    (0..frames).into_par_iter().all(|frame| {
        let wanted = places(nodes, |at| nodes[at].local(frame));
        let found = places(nodes, |at| transform_of(values[at].each_ref().map(|part| part.at(frame))));
        errors_of(&found, &wanted, tolerance).iter().all(|error| *error <= 1.0)
    })
}

/// Part of a node that does not change.
pub(super) struct RestingPart {
    pub node: usize,
    /// Place of the part in a transform.
    pub part: usize,
    pub value: [f32; 4],
    /// Largest difference of the value.
    pub tolerance: f32,
}

/// Tracks of a skeleton, with where they put its nodes.
pub(super) struct SampledSkeleton<'a> {
    /// Nodes, whose values are in the tracks where they have any.
    nodes: Vec<SampledNode>,
    tolerance: &'a KeyTolerance,
    truth: Vec<Vec<JointPlace>>,
    /// Parts that change.
    pub tracks: Vec<SampledTrack>,
    /// Parts that do not.
    pub resting: Vec<RestingPart>,
    /// Node and part of the transform of each track.
    pub owners: Vec<(usize, usize)>,
    track_of: Vec<[Option<usize>; 3]>,
}

impl<'a> SampledSkeleton<'a> {
    /// Skeleton of so many frames. `fixed` marks what is played as it is.
    pub fn new(frames: usize, nodes: Vec<SampledNode>, fixed: &[[bool; 3]], tolerance: &'a KeyTolerance) -> Self {
        let properties = [Property::Translation, Property::Rotation, Property::Scale];
        let truth: Vec<Vec<JointPlace>> =
            (0..frames).into_par_iter().map(|frame| places(&nodes, |at| nodes[at].local(frame))).collect();
        let reaches = reaches(&nodes, &truth);
        let track_of = vec![[None; 3]; nodes.len()];
        let (tracks, resting, owners) = (Vec::new(), Vec::new(), Vec::new());
        let mut skeleton = Self { nodes, tolerance, truth, tracks, resting, owners, track_of };
        for (at, reach) in reaches.into_iter().enumerate() {
            for (part, property) in properties.iter().enumerate().filter(|(part, _)| !fixed[at][*part]) {
                let reach = match property {
                    Property::Rotation => reach * 1.0_f32.to_radians(),
                    Property::Scale => reach,
                    Property::Translation | Property::Attribute(_) => 1.0,
                };
                let tolerance = track_tolerance(property, reach, tolerance);
                let sampled = &mut skeleton.nodes[at].parts[part];
                if !sampled.is_moving() {
                    let value = sampled.at(0);
                    skeleton.resting.push(RestingPart { node: at, part, value, tolerance });
                    continue;
                }
                let values = std::mem::take(&mut sampled.0);
                skeleton.track_of[at][part] = Some(skeleton.tracks.len());
                skeleton.tracks.push(SampledTrack { property: property.clone(), values, tolerance });
                skeleton.owners.push((at, part));
            }
        }
        skeleton
    }

    /// Errors of the nodes, frame by frame, with values of the tracks.
    pub fn errors(&self, samples: &[Vec<[f32; 4]>]) -> Vec<FrameErrors> {
        let at_frame = |frame: usize| {
            let local = |at: usize| {
                let mut local = self.nodes[at].local(frame);
                let value = |part: usize| self.track_of[at][part].map(|track: usize| samples[track][frame]);
                if let Some([x, y, z, _]) = value(0) {
                    local.translation = Vec3::new(x, y, z);
                }
                if let Some(turn) = value(1) {
                    local.rotation = Quat::from_array(turn);
                }
                if let Some([x, y, z, _]) = value(2) {
                    local.scale = Vec3::new(x, y, z);
                }
                local
            };
            let mut errors = errors_of(&places(&self.nodes, local), &self.truth[frame], self.tolerance);
            let worst = errors.iter().copied().fold(0.0, f32::max);
            // A node moves those below it.
            for (at, node) in self.nodes.iter().enumerate().rev() {
                if let Some(parent) = node.parent {
                    errors[parent] = errors[parent].max(errors[at]);
                }
            }
            FrameErrors { worst, of_tracks: self.owners.iter().map(|(at, _)| errors[*at]).collect() }
        };
        (0..self.truth.len()).into_par_iter().map(at_frame).collect()
    }
}

fn places(nodes: &[SampledNode], local: impl Fn(usize) -> Trs) -> Vec<JointPlace> {
    let mut globals: Vec<Trs> = Vec::with_capacity(nodes.len());
    for (at, node) in nodes.iter().enumerate() {
        let local = local(at);
        globals.push(node.parent.map_or(local, |parent| globals[parent] * local));
    }
    globals.iter().map(|at| (at.translation, at.rotation)).collect()
}

/// Greatest distance of a node below each node.
fn reaches(nodes: &[SampledNode], truth: &[Vec<JointPlace>]) -> Vec<f32> {
    let mut reaches = vec![0.0_f32; nodes.len()];
    // Distances change little within a few frames.
    for frame in truth.iter().step_by((truth.len() / 64).max(1)) {
        for (at, node) in nodes.iter().enumerate() {
            let mut above = node.parent;
            while let Some(parent) = above {
                reaches[parent] = reaches[parent].max(frame[at].0.distance(frame[parent].0));
                above = nodes[parent].parent;
            }
        }
    }
    reaches
}
