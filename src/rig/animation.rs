//! Animation: clips with keys on joints, controls and attributes.
//!
//! A key belongs to an identity: the [`Uid`] of a node and one of its properties. So renaming, reparenting or rebuilding
//! a node never touches its keys, and keys of a node that is gone stay in the document until the node returns. Values
//! are those of poses: offsets from the rest transform of a joint or from the built base of a created node
//! ([`PoseOffset`]), and values of attributes. Times are seconds.

mod check;
pub mod clip_extras;
pub mod file_clip;
pub mod four_legs;
pub mod humanoid;
pub mod joint_map;
pub mod motion;
mod names;
mod sample;
mod sampler;
mod splice;
mod tracks;

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    sync::Arc,
};

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

pub(in crate::rig) use self::check::{check_about, check_clip, check_keys, check_layer, check_tracks};
pub(in crate::rig) use self::sample::{cubic_slope, slerp};
pub use self::{
    check::{ClipFault, KeyFault},
    names::{NodeName, NodeNames, OrphanedKeys, keys_set_aside, orphaned_keys},
    sample::SampledPose,
    sampler::{ClipSampler, SampleCursor},
    splice::Splice,
};
use crate::rig::{PoseOffset, Rig, Uid};

/// Clip of a rig: layers of tracks over a range of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigClip {
    /// Identity.
    pub uid: Uid,
    /// The name people see.
    pub name: String,
    /// Frames a second, for people and exports; keys may lie between frames.
    pub frame_rate: f32,
    /// First and last second of the clip.
    pub range: [f32; 2],
    /// True if the clip is played over and over: its end is the same moment as its start.
    pub looped: bool,
    /// Named moments, by rising time.
    pub markers: Vec<Marker>,
    /// Layers from the bottom to the top; the first one is the base.
    pub layers: Vec<ClipLayer>,
    /// Names of animated nodes that the rig lacked when the clip came to it. Nodes with these names are offered for their
    /// keys.
    #[serde(default, skip_serializing_if = "NodeNames::is_empty")]
    pub names: NodeNames,
}

/// Named moment of a clip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Second in the clip.
    pub time: f32,
    /// Name, which events carry.
    pub name: String,
}

/// Layer of a clip: tracks that are mixed into the layers below.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipLayer {
    /// Identity.
    pub uid: Uid,
    /// The name people see.
    pub name: String,
    /// Combination of the layer's values with the ones below.
    pub mode: LayerMode,
    /// Weight of the layer from 0 to 1.
    pub weight: f32,
    /// Nodes that the layer concerns; empty for all.
    pub mask: Vec<Uid>,
    /// True if the layer has no effect at present.
    pub muted: bool,
    /// Tracks by what they animate; none of them is without keys.
    #[serde(with = "tracks")]
    pub tracks: BTreeMap<TrackTarget, Arc<Track>>,
}

/// Header of a clip: all of it but its layers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipAbout {
    /// The name people see.
    pub name: String,
    /// Frames a second.
    pub frame_rate: f32,
    /// First and last second of the clip.
    pub range: [f32; 2],
    /// True if the clip is played over and over.
    pub looped: bool,
    /// Named moments, by rising time.
    pub markers: Vec<Marker>,
}

/// Header of a layer: all of it but its tracks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LayerAbout {
    /// The name people see.
    pub name: String,
    /// Manner in which the values of the layer meet those below.
    pub mode: LayerMode,
    /// Weight of the layer from 0 to 1.
    pub weight: f32,
    /// Nodes that the layer concerns; empty for all.
    pub mask: Vec<Uid>,
    /// True if the layer has no effect at present.
    pub muted: bool,
}

/// Manner in which a layer's values meet those of the layers below.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum LayerMode {
    /// The layer's values take the place of those below, by its weight.
    #[default]
    Override,
    /// The layer's offsets are added to those below: rotations and scales multiply, translations and attributes add.
    Additive,
}

/// Animated property of a node.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TrackTarget {
    /// The joint or created node.
    pub node: Uid,
    /// Property of the node.
    pub property: Property,
}

/// Property that a track animates.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Property {
    /// Translation of the pose offset, in the node's own space at rest, in rig units.
    Translation,
    /// Rotation of the pose offset, a unit quaternion (x, y, z, w).
    Rotation,
    /// Scale factors of the pose offset.
    Scale,
    /// Attribute of that name; switches are attributes.
    Attribute(String),
}

impl fmt::Display for Property {
    /// The property in a word, an attribute by its name.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Translation => f.write_str("translation"),
            Self::Rotation => f.write_str("rotation"),
            Self::Scale => f.write_str("scale"),
            Self::Attribute(name) => write!(f, "attribute \"{name}\""),
        }
    }
}

impl Property {
    /// Count of numbers of a value.
    pub fn width(&self) -> usize {
        match self {
            Self::Translation | Self::Scale => 3,
            Self::Rotation => 4,
            Self::Attribute(_) => 1,
        }
    }

    /// Value of a node at rest; attributes have defaults of their own and give zero.
    pub fn rest(&self) -> [f32; 4] {
        match self {
            Self::Translation | Self::Attribute(_) => [0.0; 4],
            Self::Rotation => [0.0, 0.0, 0.0, 1.0],
            Self::Scale => [1.0, 1.0, 1.0, 0.0],
        }
    }
}

/// Keys of one property, by rising time, no two at the same time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Track {
    /// The keys.
    pub keys: Vec<Key>,
}

/// Value of a property at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Key {
    /// Second in the clip.
    pub time: f32,
    /// Value: the first [`Property::width`] numbers count, the others are zero.
    pub value: [f32; 4],
    /// Way from this key to the next.
    pub ease: Ease,
}

/// Interpolation from one key to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum Ease {
    /// The value stays until the next key.
    Stepped,
    /// Linear, for rotations spherical.
    #[default]
    Linear,
    /// Cubic Hermite spline with tangents in units a second, as in glTF; rotations are normalised afterwards. Between
    /// a cubic and another key, the segment is that of its first key, and a missing arriving tangent is zero.
    Cubic {
        /// Tangent with which the value arrives at this key.
        arrive: [f32; 4],
        /// Tangent with which the value leaves this key.
        leave: [f32; 4],
    },
}

impl RigClip {
    /// Clip without tracks: one base layer, 30 frames a second, one second long.
    pub fn new(uid: Uid, layer: Uid, name: impl Into<String>) -> Self {
        let base = ClipLayer { uid: layer, name: "Base".to_owned(), ..ClipLayer::empty(layer) };
        Self {
            uid,
            name: name.into(),
            frame_rate: 30.0,
            range: [0.0, 1.0],
            looped: false,
            markers: Vec::new(),
            layers: vec![base],
            names: NodeNames::default(),
        }
    }

    /// Seconds from the start to the end.
    pub fn duration(&self) -> f32 {
        self.range[1] - self.range[0]
    }

    /// Layer with that uid.
    pub fn layer(&self, uid: Uid) -> Option<&ClipLayer> {
        self.layers.iter().find(|layer| layer.uid == uid)
    }

    /// Header of the clip.
    pub fn about(&self) -> ClipAbout {
        let Self { name, frame_rate, range, looped, markers, .. } = self.clone();
        ClipAbout { name, frame_rate, range, looped, markers }
    }

    /// Exchanges the header of the clip; returns the former one.
    pub(in crate::rig) fn set_about(&mut self, about: &ClipAbout) -> ClipAbout {
        let before = self.about();
        let ClipAbout { name, frame_rate, range, looped, markers } = about.clone();
        let (layers, names) = (std::mem::take(&mut self.layers), std::mem::take(&mut self.names));
        *self = Self { name, frame_rate, range, looped, markers, uid: self.uid, layers, names };
        before
    }

    /// Animated nodes of all layers.
    pub fn nodes(&self) -> BTreeSet<Uid> {
        self.layers.iter().flat_map(|layer| layer.tracks.keys()).map(|target| target.node).collect()
    }

    /// Number of keys in all layers.
    pub fn key_count(&self) -> usize {
        self.layers.iter().flat_map(|layer| layer.tracks.values()).map(|track| track.keys.len()).sum()
    }

    /// Times of the keys of all layers, rising, each once.
    pub fn key_times(&self) -> Vec<f32> {
        let tracks = self.layers.iter().flat_map(|layer| layer.tracks.values());
        let mut times: Vec<f32> = tracks.flat_map(|track| &track.keys).map(|key| key.time).collect();
        times.sort_by(f32::total_cmp);
        times.dedup();
        times
    }

    /// The clip with other uids for nodes; what is mapped nowhere stays. Of two nodes that become one, the first track of
    /// a property stays.
    pub fn with_nodes(&self, map: impl Fn(Uid) -> Uid) -> Self {
        let mut clip = self.clone();
        for layer in &mut clip.layers {
            layer.mask.iter_mut().for_each(|node| *node = map(*node));
            for (target, track) in std::mem::take(&mut layer.tracks) {
                layer.tracks.entry(TrackTarget { node: map(target.node), ..target }).or_insert(track);
            }
        }
        clip
    }
}

/// Clips.
impl Rig {
    /// Clips in order.
    pub fn clips(&self) -> &[RigClip] {
        &self.clips
    }

    /// The clip with that uid.
    pub fn clip(&self, uid: Uid) -> Option<&RigClip> {
        self.clips.iter().find(|clip| clip.uid == uid)
    }
}

impl ClipLayer {
    /// Layer without tracks, in effect on all nodes.
    pub fn empty(uid: Uid) -> Self {
        Self {
            uid,
            name: String::new(),
            mode: LayerMode::Override,
            weight: 1.0,
            mask: Vec::new(),
            muted: false,
            tracks: BTreeMap::new(),
        }
    }

    /// Header of the layer.
    pub fn about(&self) -> LayerAbout {
        let Self { name, mode, weight, mask, muted, .. } = self;
        LayerAbout { name: name.clone(), mode: *mode, weight: *weight, mask: mask.clone(), muted: *muted }
    }

    /// Exchanges the header of the layer; returns the former one.
    pub(in crate::rig) fn set_about(&mut self, about: &LayerAbout) -> LayerAbout {
        let before = self.about();
        let LayerAbout { name, mode, weight, mask, muted } = about.clone();
        *self = Self { name, mode, weight, mask, muted, uid: self.uid, tracks: std::mem::take(&mut self.tracks) };
        before
    }

    /// True if the layer concerns that node.
    pub fn concerns(&self, node: Uid) -> bool {
        self.mask.is_empty() || self.mask.contains(&node)
    }
}

impl Key {
    /// Linear key of a translation or scale.
    pub fn vector(time: f32, value: Vec3) -> Self {
        Self { time, value: [value.x, value.y, value.z, 0.0], ease: Ease::Linear }
    }

    /// Linear key of a rotation.
    pub fn rotation(time: f32, value: Quat) -> Self {
        Self { time, value: value.to_array(), ease: Ease::Linear }
    }

    /// Linear key of an attribute.
    pub fn number(time: f32, value: f32) -> Self {
        Self { time, value: [value, 0.0, 0.0, 0.0], ease: Ease::Linear }
    }
}
