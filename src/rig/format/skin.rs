//! The `*.skin` file: the weights of one mesh, by joint uid, with the hash of that mesh.
//!
//! Little endian: magic `RIGSKIN\0`, format version, flags, length of the file, hash of the mesh, counts; then joints
//! (uid, label, in format 2 the subject of a created joint), influences, optionally a copy of the mesh; then a checksum
//! of all before it. Counts are variable in length (7 bits a byte), weights are `f32` as they are, and a weight of
//! exactly one is implied, which keeps the file small and exact.

mod bytes;
mod data;
mod hash;
mod reader;

use std::collections::BTreeMap;

use glam::Vec3;

use crate::{
    mesh::model::Weights,
    rig::{Rig, SkinData, Uid},
};
use bytes::{put_signed, put_varint};
pub use data::{read_skin_data, skin_data_bytes};
pub use hash::{content_hash, mesh_hash};
pub use reader::SkinFileError;

/// First bytes of every skin file.
const MAGIC: [u8; 8] = *b"RIGSKIN\0";
/// Highest format that this version reads; written for weights of joints that commands created. Other weights are
/// written in format 1.
pub const SKIN_FORMAT: u32 = 2;
/// Format of weights that refer to joints of the document only.
const PLAIN_FORMAT: u32 = 1;
/// Bytes before the joints: magic, format, flags, length, mesh hash, four counts.
const HEADER: usize = 8 + 4 + 4 + 8 + 16 + 4 * 4;
/// Flag: a copy of the mesh follows the influences.
const HAS_MESH: u32 = 1;
/// Flag: a subject follows the label of each joint, zero for joints of the document. From format 2 on.
const HAS_SUBJECTS: u32 = 2;

/// A joint that weights refer to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SkinJoint {
    /// Uid of the joint, which identifies it.
    pub uid: u64,
    /// Label of the joint when the file was written, for people and for rigs with other uids.
    pub label: String,
    /// Uid of the node for which a command created the joint; `None` for joints of the document.
    pub subject: Option<u64>,
}

impl SkinJoint {
    /// The joints of weights, with the labels that the rig gives them.
    pub fn list(rig: &Rig, skin: &SkinData) -> Vec<Self> {
        let joint = |uid: &Uid| Self {
            uid: uid.0,
            label: rig.joint(*uid).and_then(|joint| joint.data.label.clone()).unwrap_or_default(),
            subject: skin.subjects.get(uid).map(|subject| subject.0).filter(|subject| *subject != 0),
        };
        skin.joints.iter().map(joint).collect()
    }

    /// The subjects of a file's joints, for [`SkinData::subjects`].
    pub fn subjects(joints: &[Self]) -> BTreeMap<Uid, Uid> {
        joints.iter().filter_map(|joint| Some((Uid(joint.uid), Uid(joint.subject?)))).collect()
    }
}

/// Copy of the mesh that weights were made for. Weights are transferred from it to a changed mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SkinMesh {
    /// Positions of the weighted points.
    pub points: Vec<Vec3>,
    /// Triangles, as indices into `points`.
    pub triangles: Vec<[u32; 3]>,
}

/// Checked weights of a mesh: every index in range, every weight positive and finite.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinFile {
    mesh_hash: u128,
    joints: Vec<SkinJoint>,
    weights: Weights,
    mesh: Option<SkinMesh>,
}

/// Reason why weights cannot become a skin file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SkinError {
    /// The mesh has other points than the weights.
    #[error("the mesh has {points} points but the weights are for {weights}; bind the mesh again")]
    PointCount {
        /// Points of the mesh.
        points: usize,
        /// Points of the weights.
        weights: usize,
    },
    /// The lists of the weights contradict each other.
    #[error("the weights of point {point} lie outside the list of influences; bind the mesh again")]
    Layout {
        /// The first such point.
        point: usize,
    },
    /// An influence by a joint that is not listed.
    #[error("point {point} is moved by joint {joint}, but there are only {joints}")]
    Joint {
        /// The point.
        point: usize,
        /// The joint's index.
        joint: u32,
        /// The number of joints.
        joints: usize,
    },
    /// A weight that is not a positive finite number.
    #[error("joint {joint} moves point {point} with weight {weight}; weights are positive numbers")]
    Weight {
        /// The point.
        point: usize,
        /// The joint's index.
        joint: u32,
        /// The weight, as text.
        weight: String,
    },
    /// A triangle of the mesh has a corner that does not exist.
    #[error("triangle {triangle} refers to point {point}, but there are only {points}")]
    Triangle {
        /// The triangle.
        triangle: usize,
        /// The point it refers to.
        point: u32,
        /// The number of points.
        points: usize,
    },
}

impl SkinFile {
    /// Weights of a mesh, over `joints`. With `keep_mesh` the file carries a copy of the mesh, without which weights
    /// cannot be transferred once the mesh has changed.
    ///
    /// # Errors
    /// [`SkinError`] if the parts do not fit together.
    pub fn new(
        mut joints: Vec<SkinJoint>,
        weights: Weights,
        points: &[Vec3],
        triangles: &[[u32; 3]],
        keep_mesh: bool,
    ) -> Result<Self, SkinError> {
        check_weights(&weights, joints.len())?;
        if weights.len() != points.len() {
            return Err(SkinError::PointCount { points: points.len(), weights: weights.len() });
        }
        check_triangles(triangles, points.len())?;
        joints.iter_mut().for_each(|joint| joint.subject = joint.subject.filter(|subject| *subject != 0));
        let mesh = keep_mesh.then(|| SkinMesh { points: points.to_vec(), triangles: triangles.to_vec() });
        Ok(Self { mesh_hash: mesh_hash(points, triangles), joints, weights: canonical(weights), mesh })
    }

    /// True for bytes that may be the first of a skin file.
    pub fn may_begin_with(bytes: &[u8]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    /// Reads a file. Memory stays within a small multiple of the file's length whatever its counts say.
    ///
    /// # Errors
    /// [`SkinFileError`] with the byte where reading failed: not a skin, a newer format, cut off, damaged.
    pub fn read(bytes: &[u8]) -> Result<Self, SkinFileError> {
        reader::read(bytes)
    }

    /// Bytes of the file. Reading them gives the same skin, and writing that skin gives the same bytes.
    pub fn write(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER + self.weights.values.len() * 5 + self.joints.len() * 24);
        out.extend(MAGIC);
        let has_subjects = self.joints.iter().any(|joint| joint.subject.is_some());
        out.extend(if has_subjects { SKIN_FORMAT } else { PLAIN_FORMAT }.to_le_bytes());
        let subjects = if has_subjects { HAS_SUBJECTS } else { 0 };
        out.extend((subjects | if self.mesh.is_some() { HAS_MESH } else { 0 }).to_le_bytes());
        out.extend([0; 8]);
        out.extend(self.mesh_hash.to_le_bytes());
        let triangles = self.mesh.as_ref().map_or(0, |m| m.triangles.len());
        for count in [self.joints.len(), self.weights.len(), self.weights.values.len(), triangles] {
            // Lists whose indices are `u32` cannot be longer.
            out.extend((count as u32).to_le_bytes());
        }
        for joint in &self.joints {
            out.extend(joint.uid.to_le_bytes());
            put_varint(&mut out, joint.label.len() as u64);
            out.extend(joint.label.as_bytes());
            if has_subjects {
                out.extend(joint.subject.unwrap_or(0).to_le_bytes());
            }
        }
        for point in 0..self.weights.len() {
            let rigid = is_rigid(self.weights.of(point));
            put_varint(&mut out, (self.weights.of(point).len() as u64) << 1 | u64::from(rigid));
            for (joint, value) in self.weights.of(point) {
                put_varint(&mut out, u64::from(joint));
                if !rigid {
                    out.extend(value.to_le_bytes());
                }
            }
        }
        if let Some(mesh) = &self.mesh {
            for point in &mesh.points {
                for x in point.to_array() {
                    out.extend(x.to_le_bytes());
                }
            }
            // Neighbouring triangles share corners, so differences are short.
            let mut last = 0;
            for &corner in mesh.triangles.as_flattened() {
                put_signed(&mut out, i64::from(corner) - last);
                last = i64::from(corner);
            }
        }
        let length = (out.len() + 8) as u64;
        out[16..24].copy_from_slice(&length.to_le_bytes());
        let checksum = content_hash(&out);
        out.extend(checksum.to_le_bytes());
        out
    }

    /// The hash of the mesh the weights were made for, see [`mesh_hash`].
    pub fn mesh_hash(&self) -> u128 {
        self.mesh_hash
    }

    /// True if the weights belong to exactly this mesh and can be used as they are.
    pub fn fits(&self, points: &[Vec3], triangles: &[[u32; 3]]) -> bool {
        points.len() == self.weights.len() && mesh_hash(points, triangles) == self.mesh_hash
    }

    /// The joints that the weights refer to.
    pub fn joints(&self) -> &[SkinJoint] {
        &self.joints
    }

    /// Influences of every point over [`SkinFile::joints`].
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// The copy of the mesh, if the file has one.
    pub fn mesh(&self) -> Option<&SkinMesh> {
        self.mesh.as_ref()
    }

    /// Joints, weights and mesh by value.
    pub fn into_parts(self) -> (Vec<SkinJoint>, Weights, Option<SkinMesh>) {
        (self.joints, self.weights, self.mesh)
    }
}

/// Weights in canonical form: an empty list of starts becomes a single start, so that equal skins have equal lists.
fn canonical(mut weights: Weights) -> Weights {
    if weights.starts.is_empty() {
        weights.starts.push(0);
    }
    weights
}

fn is_rigid(mut influences: impl ExactSizeIterator<Item = (u32, f32)>) -> bool {
    influences.len() == 1 && influences.next().is_some_and(|i| i.1.to_bits() == 1.0f32.to_bits())
}

fn check_weights(weights: &Weights, joints: usize) -> Result<(), SkinError> {
    let (listed, valued) = (weights.joints.len(), weights.values.len());
    let mut last = 0;
    for (i, &start) in weights.starts.iter().enumerate() {
        if start < last || start as usize > listed || start as usize > valued || (i == 0 && start != 0) {
            return Err(SkinError::Layout { point: i.saturating_sub(1) });
        }
        last = start;
    }
    if listed != valued || listed != last as usize {
        return Err(SkinError::Layout { point: weights.len().saturating_sub(1) });
    }
    for point in 0..weights.len() {
        for (joint, weight) in weights.of(point) {
            if joint as usize >= joints {
                return Err(SkinError::Joint { point, joint, joints });
            }
            if !(weight > 0.0 && weight.is_finite()) {
                return Err(SkinError::Weight { point, joint, weight: weight.to_string() });
            }
        }
    }
    Ok(())
}

fn check_triangles(triangles: &[[u32; 3]], points: usize) -> Result<(), SkinError> {
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&point) = corners.iter().find(|&&c| c as usize >= points) {
            return Err(SkinError::Triangle { triangle, point, points });
        }
    }
    Ok(())
}
