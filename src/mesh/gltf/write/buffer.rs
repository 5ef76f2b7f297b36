//! The binary buffer: accessors one after the other, each in a view of its own, aligned to four bytes. Accessors of the same
//! content are written once: thousands of skins or meshes may share theirs.

use std::{
    collections::{BTreeMap, BTreeSet},
    hash::{DefaultHasher, Hasher},
};

use glam::Vec3;
use serde::Serialize;

/// Content of a view, as the GPU uses it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Vertices,
    Indices,
    Other,
}

impl Target {
    /// Code of the target in a file, which data of other kinds do not have.
    fn code(self) -> Option<u32> {
        match self {
            Self::Vertices => Some(34962),
            Self::Indices => Some(34963),
            Self::Other => None,
        }
    }
}

/// Type of the elements of an accessor.
#[derive(Clone, Copy)]
struct Kind {
    target: Target,
    component: u32,
    elements: &'static str,
}

/// View of the buffer. A file may have hundreds of thousands, which take little memory so.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct View {
    buffer: u32,
    byte_offset: usize,
    byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<u32>,
}

/// Accessor, with its fields in the order of the file.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    #[serde(skip_serializing_if = "Option::is_none")]
    buffer_view: Option<usize>,
    component_type: u32,
    count: usize,
    #[serde(rename = "type")]
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    sparse: Option<Box<Sparse>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    min: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max: Option<Vec<f64>>,
}

/// Elements of a sparse accessor that are not zero.
#[derive(Serialize)]
struct Sparse {
    count: usize,
    indices: SparseIndices,
    values: SparseValues,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct SparseIndices {
    buffer_view: usize,
    component_type: u32,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct SparseValues {
    buffer_view: usize,
}

/// The buffer being written, with its views and accessors.
#[derive(Default)]
pub(super) struct Bin {
    bytes: Vec<u8>,
    views: Vec<View>,
    accessors: Vec<Accessor>,
    /// First accessor of each hash of type and content, and the same for key times, which have bounds.
    accessor_of_hash: BTreeMap<u64, usize>,
    times_of_hash: BTreeMap<u64, usize>,
    /// Accessors of positions in the mesh that is being written.
    mesh_positions: BTreeSet<usize>,
}

impl Bin {
    /// Appends bytes as a view; returns its index.
    pub(super) fn view(&mut self, bytes: &[u8], target: Target) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (byte_offset, byte_length, target) = (self.bytes.len(), bytes.len(), target.code());
        self.views.push(View { buffer: 0, byte_offset, byte_length, target });
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// Accessor of `count` elements: one that is written, or else a new one.
    fn accessor(&mut self, bytes: &[u8], kind: Kind, count: usize) -> usize {
        let key = content_hash(bytes, kind);
        let known = self.accessor_of_hash.get(&key).copied();
        if let Some(known) = known.filter(|known| self.holds(*known, bytes, kind)) {
            return known;
        }
        let index = self.append(bytes, kind, count);
        self.accessor_of_hash.entry(key).or_insert(index);
        index
    }

    /// Appends bytes as an accessor with a view of its own.
    fn append(&mut self, bytes: &[u8], kind: Kind, count: usize) -> usize {
        let buffer_view = Some(self.view(bytes, kind.target));
        let Kind { component: component_type, elements: kind, .. } = kind;
        self.push(Accessor { buffer_view, component_type, count, kind, sparse: None, min: None, max: None })
    }

    /// Returns `true` for an accessor of a type and content.
    fn holds(&self, index: usize, bytes: &[u8], kind: Kind) -> bool {
        let accessor = &self.accessors[index];
        let is_alike = accessor.component_type == kind.component && accessor.kind == kind.elements;
        let view = accessor.buffer_view.map(|view| &self.views[view]).filter(|_| is_alike && accessor.sparse.is_none());
        view.is_some_and(|view| {
            let own = view.byte_offset..view.byte_offset + view.byte_length;
            view.target == kind.target.code() && self.bytes[own] == *bytes
        })
    }

    fn push(&mut self, accessor: Accessor) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends floats, `N` an element; returns the accessor.
    pub(super) fn floats<const N: usize>(&mut self, elements: &[[f32; N]], target: Target) -> usize {
        let kind = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let bytes = little_endian(elements.as_flattened(), f32::to_le_bytes);
        self.accessor(&bytes, Kind { target, component: 5126, elements: kind }, elements.len())
    }

    /// Begins a mesh: its primitives have positions of their own, because a reader takes vertices with the same accessors for
    /// the same.
    pub(super) fn begin_mesh(&mut self) {
        self.mesh_positions.clear();
    }

    /// Appends positions of a primitive, with the bounds that glTF demands; returns the accessor.
    pub(super) fn vertices(&mut self, positions: &[Vec3]) -> usize {
        let index = self.positions(positions);
        if self.mesh_positions.insert(index) {
            return index;
        }
        let elements: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
        let bytes = little_endian(elements.as_flattened(), f32::to_le_bytes);
        let kind = Kind { target: Target::Vertices, component: 5126, elements: "VEC3" };
        let own = self.append(&bytes, kind, positions.len());
        let (min, max) = (self.accessors[index].min.clone(), self.accessors[index].max.clone());
        (self.accessors[own].min, self.accessors[own].max) = (min, max);
        self.mesh_positions.insert(own);
        own
    }

    /// Appends vectors with their bounds; returns the accessor.
    fn positions(&mut self, positions: &[Vec3]) -> usize {
        let elements: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
        let index = self.floats(&elements, Target::Vertices);
        let low = positions.iter().fold(Vec3::INFINITY, |low, position| low.min(*position));
        let high = positions.iter().fold(Vec3::NEG_INFINITY, |high, position| high.max(*position));
        self.bounds(index, &low.to_array(), &high.to_array());
        index
    }

    /// Appends displacements of a morph target, with their bounds: only those that are not zero where that is smaller
    /// (sparse accessor, section 3.6.2.3 of the specification); returns the accessor.
    pub(super) fn displacements(&mut self, offsets: &[Vec3]) -> usize {
        let moved: Vec<usize> = (0..offsets.len()).filter(|at| offsets[*at] != Vec3::ZERO).collect();
        let wide = offsets.len() > 65535;
        let index_size = if wide { 4 } else { 2 };
        if moved.is_empty() || moved.len() * (12 + index_size) + 128 > offsets.len() * 12 {
            return self.positions(offsets);
        }
        let places = match wide {
            true => little_endian(&moved, |at| (at as u32).to_le_bytes()),
            false => little_endian(&moved, |at| (at as u16).to_le_bytes()),
        };
        let values: Vec<[f32; 3]> = moved.iter().map(|at| offsets[*at].to_array()).collect();
        let values = little_endian(values.as_flattened(), f32::to_le_bytes);
        let (places, values) = (self.view(&places, Target::Other), self.view(&values, Target::Other));
        let sparse = Sparse {
            count: moved.len(),
            indices: SparseIndices { buffer_view: places, component_type: if wide { 5125 } else { 5123 } },
            values: SparseValues { buffer_view: values },
        };
        let index = self.push(Accessor {
            buffer_view: None,
            component_type: 5126,
            count: offsets.len(),
            kind: "VEC3",
            sparse: Some(Box::new(sparse)),
            min: None,
            max: None,
        });
        let low = offsets.iter().fold(Vec3::INFINITY, |low, offset| low.min(*offset));
        let high = offsets.iter().fold(Vec3::NEG_INFINITY, |high, offset| high.max(*offset));
        self.bounds(index, &low.to_array(), &high.to_array());
        index
    }

    /// Appends key times, rising; equal times are written once.
    pub(super) fn times(&mut self, times: &[f32]) -> usize {
        let bytes = little_endian(times, f32::to_le_bytes);
        let kind = Kind { target: Target::Other, component: 5126, elements: "SCALAR" };
        let key = content_hash(&bytes, kind);
        let known = self.times_of_hash.get(&key).copied();
        if let Some(known) = known.filter(|known| self.holds(*known, &bytes, kind)) {
            return known;
        }
        let index = self.append(&bytes, kind, times.len());
        self.bounds(index, &times[..1], &times[times.len() - 1..]);
        self.times_of_hash.entry(key).or_insert(index);
        index
    }

    /// Appends vertex indices below `vertices` in the smallest type; the largest value of each type is reserved.
    pub(super) fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        let (bytes, component) = match vertices <= 65535 {
            true => (little_endian(indices, |index| (index as u16).to_le_bytes()), 5123),
            false => (little_endian(indices, u32::to_le_bytes), 5125),
        };
        self.accessor(&bytes, Kind { target: Target::Indices, component, elements: "SCALAR" }, indices.len())
    }

    /// Appends joints of vertices, as bytes if the skin has few.
    pub(super) fn joints(&mut self, joints: &[[u16; 4]], of: usize) -> usize {
        let (bytes, component) = match of <= 256 {
            true => (little_endian(joints.as_flattened(), |joint| [joint as u8]), 5121),
            false => (little_endian(joints.as_flattened(), u16::to_le_bytes), 5123),
        };
        self.accessor(&bytes, Kind { target: Target::Vertices, component, elements: "VEC4" }, joints.len())
    }

    fn bounds(&mut self, accessor: usize, low: &[f32], high: &[f32]) {
        let floats = |ends: &[f32]| Some(ends.iter().map(|end| f64::from(*end)).collect());
        if let Some(accessor) = self.accessors.get_mut(accessor) {
            (accessor.min, accessor.max) = (floats(low), floats(high));
        }
    }

    /// Finishes the buffer: accessors, views and bytes.
    pub(super) fn finish(mut self) -> (Vec<Accessor>, Vec<View>, Vec<u8>) {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        (self.accessors, self.views, self.bytes)
    }
}

fn content_hash(bytes: &[u8], kind: Kind) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write_u32(kind.component);
    hasher.write_u32(kind.target.code().unwrap_or_default());
    hasher.write(kind.elements.as_bytes());
    hasher.write(bytes);
    hasher.finish()
}

fn little_endian<T: Copy, const N: usize>(values: &[T], bytes_of: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(values.len() * N);
    for value in values {
        bytes.extend_from_slice(&bytes_of(*value));
    }
    bytes
}
