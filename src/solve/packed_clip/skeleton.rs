//! Skeletons with packed clips, as files have them: nodes with their uids, names and rests, and the clips of all of them.

use std::collections::HashMap;

use bevy::math::{Quat, Vec3};

use super::{MOST_NODES, MOST_TEXT, PackedClip, PackedClipError, Reader, write_number};
use crate::{
    mesh::model::{Model, Node, Trs},
    rig::{
        BuiltRig, JointData, Rig, RigEdit, Uid,
        animation::{NodeNames, file_clip::rig_clips},
        bake::baked,
        format::animation::ReadAnimation,
    },
    solve::bake_clip::BakedNode,
};

/// First bytes of a skeleton with packed clips.
const MAGIC: &[u8; 8] = b"rigpack1";
/// Most clips of a file.
const MOST_CLIPS: u32 = 1_000_000;

/// Node of a skeleton with packed clips.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedNode {
    /// The node of the rig.
    pub uid: Uid,
    /// Name of the node; may be empty.
    pub name: String,
    /// Place of the parent among the nodes, before the node's own.
    pub parent: Option<usize>,
    /// Transform relative to the parent at rest.
    pub rest: Trs,
}

/// Skeleton with packed clips.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PackedSkeleton {
    /// Nodes, parents before children.
    pub nodes: Vec<PackedNode>,
    /// Clips, each of which has the motion of all nodes.
    pub clips: Vec<PackedClip>,
}

impl PackedSkeleton {
    /// Skeleton of a built rig, as files of characters have it, without clips.
    pub fn of(rig: &Rig, built: &BuiltRig) -> Self {
        let skeleton = baked(rig, built);
        let places: HashMap<Uid, usize> = skeleton.walk().map(|joint| joint.data.uid).zip(0..).collect();
        let node = |joint: &crate::rig::RigJoint| PackedNode {
            uid: joint.data.uid,
            name: joint.data.label.clone().unwrap_or_default(),
            parent: joint.parent.and_then(|parent| places.get(&parent).copied()),
            rest: joint.data.rest.into(),
        };
        Self { nodes: skeleton.walk().map(node).collect(), clips: Vec::new() }
    }

    /// Nodes for [`pack_clip`](super::pack_clip).
    pub fn baked_nodes(&self) -> Vec<BakedNode> {
        let node = |node: &PackedNode| BakedNode { uid: node.uid, parent: node.parent, rest: node.rest };
        self.nodes.iter().map(node).collect()
    }

    /// The skeleton with its clips as a model without a mesh, whose nodes have the same places.
    pub fn model(&self, name: &str) -> Model {
        let node = |node: &PackedNode| Node {
            name: node.name.clone(),
            parent: node.parent,
            rest: node.rest,
            joint: true,
            extras: None,
        };
        Model {
            name: name.to_owned(),
            nodes: self.nodes.iter().map(node).collect(),
            clips: self.clips.iter().map(PackedClip::unpacked).collect(),
            ..Model::default()
        }
    }

    /// Bytes of memory that the clips take, about, while they are unpacked and become clips of a rig.
    pub fn unpacked_bytes(&self) -> u64 {
        self.clips.iter().map(PackedClip::unpacked_bytes).sum()
    }

    /// True if bytes begin as those of a skeleton with packed clips do.
    pub fn may_begin_with(bytes: &[u8]) -> bool {
        bytes.starts_with(MAGIC)
    }

    /// The clips with keys on the nodes, as a file of clips would have them for a rig of these nodes alone.
    pub fn animation(&self, name: &str) -> ReadAnimation {
        let mut rig = Rig::new(Uid::derived(["packed clips", name]), name);
        for node in &self.nodes {
            let label = Some(node.name.clone()).filter(|name| !name.is_empty());
            let joint = JointData { uid: node.uid, label, rest: node.rest.into(), ..JointData::default() };
            let parent = node.parent.and_then(|parent| self.nodes.get(parent)).map(|parent| parent.uid);
            // A uid that is there twice is refused.
            let _ = rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX });
        }
        let joints: Vec<Option<Uid>> = self.nodes.iter().map(|node| Some(node.uid)).collect();
        ReadAnimation {
            rig: rig.uid(),
            rig_name: name.to_owned(),
            clips: rig_clips(&rig, &self.model(name), &joints),
            names: NodeNames::of(&rig, None),
            notes: Vec::new(),
        }
    }

    /// Bytes of the skeleton and its clips.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        write_number(&mut out, self.nodes.len() as u32);
        for PackedNode { uid, name, parent, rest } in &self.nodes {
            out.extend(uid.0.to_le_bytes());
            write_number(&mut out, name.len() as u32);
            out.extend_from_slice(name.as_bytes());
            write_number(&mut out, parent.map_or(0, |parent| parent as u32 + 1));
            let Trs { translation, rotation, scale } = rest;
            let numbers = translation.to_array().into_iter().chain(rotation.to_array()).chain(scale.to_array());
            numbers.for_each(|number| out.extend(number.to_le_bytes()));
        }
        write_number(&mut out, self.clips.len() as u32);
        for clip in &self.clips {
            let bytes = clip.to_bytes();
            write_number(&mut out, bytes.len() as u32);
            out.extend(bytes);
        }
        out
    }

    /// Skeleton of bytes.
    ///
    /// # Errors
    /// See [`PackedClipError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PackedClipError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(PackedClipError::Other)?;
        let mut reader = Reader::new(rest, MAGIC.len());
        let count = reader.number("a count of nodes", MOST_NODES)?;
        let mut nodes = Vec::new();
        for place in 0..count {
            nodes.push(node(&mut reader, place)?);
        }
        let count = reader.number("a count of clips", MOST_CLIPS)?;
        let mut clips = Vec::new();
        for _ in 0..count {
            let length = reader.number("a length of a clip", u32::MAX)?;
            let begin = reader.at();
            let clip = PackedClip::from_bytes(reader.bytes(length as usize)?).map_err(|error| match error {
                PackedClipError::Other => PackedClipError::Damaged { what: "a beginning of a clip", at: begin },
                PackedClipError::CutOff(at) => PackedClipError::CutOff(begin + at),
                PackedClipError::Damaged { what, at } => PackedClipError::Damaged { what, at: begin + at },
            })?;
            if clip.node_count as usize != nodes.len() {
                return Err(PackedClipError::Damaged { what: "a clip of another skeleton", at: begin });
            }
            clips.push(clip);
        }
        if !reader.is_empty() {
            return Err(PackedClipError::Damaged { what: "more bytes", at: reader.at() });
        }
        Ok(Self { nodes, clips })
    }
}

/// Node that stands at a place among the nodes.
fn node(reader: &mut Reader, place: u32) -> Result<PackedNode, PackedClipError> {
    let mut uid = [0; 8];
    uid.copy_from_slice(reader.bytes(8)?);
    let length = reader.number("a length of a name", MOST_TEXT as u32)?;
    let at = reader.at();
    let name = std::str::from_utf8(reader.bytes(length as usize)?);
    let name = name.map_err(|_| PackedClipError::Damaged { what: "a name", at })?.to_owned();
    let parent = reader.number("a place of a parent", place)?.checked_sub(1).map(|parent| parent as usize);
    let at = reader.at();
    let mut numbers = [0.0; 10];
    for number in &mut numbers {
        *number = reader.float("a transform at rest")?;
    }
    let [x, y, z, i, j, k, w, a, b, c] = numbers;
    let rest =
        Trs { translation: Vec3::new(x, y, z), rotation: Quat::from_xyzw(i, j, k, w), scale: Vec3::new(a, b, c) };
    if (rest.rotation.length_squared() - 1.0).abs() > 1e-3 {
        return Err(PackedClipError::Damaged { what: "a rotation at rest", at });
    }
    Ok(PackedNode { uid: Uid(u64::from_le_bytes(uid)), name, parent, rest })
}
