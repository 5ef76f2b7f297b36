//! Wavefront OBJ: read in parallel into arrays, made into a [`Model`], and written.
//!
//! [`read_obj`] fills [`ObjArrays`], which hold the file's statements and nothing else, and can be used again for the
//! next file without allocating. [`to_model`] makes a [`Model`] of them: it triangulates polygons, welds corners into
//! vertices, computes missing normals and translates materials to glTF's. [`read_model`] does both and asks its caller
//! for the files that an OBJ refers to. [`write_obj`] writes a model.
//!
//! The format is that of Wavefront's "Advanced Visualizer" manual, appendix B1, as far as polygons go, with two later
//! extensions of exporters: vertex colours after the position, and physically based materials. Curves, surfaces, lines
//! and points are left out with a note.

mod block;
mod collect;
mod color;
mod corner_grid;
mod corner_table;
mod error;
mod materials;
mod mtl;
mod names;
mod normals;
mod number;
mod paths;
mod pipeline;
mod scan;
mod statement;
mod triangulate;
mod weld;
mod write;
mod write_mtl;

use std::{io::Read, ops::Range};

use crate::mesh::model::Model;

pub use self::{
    error::{LineProblem, ObjError},
    materials::{Sidecar, SidecarFile},
    mtl::{ObjMaterial, ObjTexture, read_mtl},
    names::ObjNames,
    paths::{library_names, safe_relative_path},
    write::write_obj,
};

/// Marks a missing index or name: a corner without texture coordinate or normal, a face outside any object.
pub const NONE: u32 = u32::MAX;

/// Largest length of a list: one bit of each index is reserved.
pub const MAX_ELEMENTS: usize = i32::MAX as usize;

/// Largest number of parts: a file with more is noise and not a character.
const MOST_PARTS: usize = 1 << 16;

/// Number of parts that a file of any size may have.
const FREE_PARTS: usize = 1500;

/// Bytes of a file for each further part: a part costs some 20 KiB when it is written as glTF and read back, and memory is
/// bounded by the size of the file.
const BYTES_PER_PART: u64 = 2048;

/// Content of an OBJ file as flat lists.
///
/// Indices count from 0 and are all in range after a successful read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjArrays {
    /// `v`: positions in the file's units.
    pub positions: Vec<[f32; 3]>,
    /// Colours of the positions as the file gives them (white where it gives none); empty if it gives none at all.
    pub colors: Vec<[f32; 3]>,
    /// `vt`: texture coordinates, origin at the bottom left.
    pub texcoords: Vec<[f32; 2]>,
    /// `vn`: normals as the file gives them, of any length.
    pub normals: Vec<[f32; 3]>,
    /// Index in `corners` of the first corner of each face, and the number of corners at the end; empty without faces.
    pub face_starts: Vec<u32>,
    /// The position of each corner.
    pub corners: Vec<u32>,
    /// The texture coordinate of each corner or [`NONE`]; empty if no corner has one.
    pub corner_texcoords: Vec<u32>,
    /// The normal of each corner or [`NONE`]; empty if no corner has one.
    pub corner_normals: Vec<u32>,
    /// Runs of faces that share object, group, material and smoothing, in the order of the faces; the first starts at
    /// face 0.
    pub runs: Vec<ObjRun>,
    /// The names that the runs refer to.
    pub names: ObjNames,
    /// Text after each `mtllib` statement: often one file name, but see [`library_names`].
    pub material_libraries: Vec<String>,
    /// Sentences about content of the file that these arrays do not hold.
    pub notes: Vec<String>,
    file_size: pipeline::FileSize,
    spare: pipeline::SpareBlocks,
}

/// Faces that share object, group, material and smoothing group. A run ends where the next one starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObjRun {
    /// The first face.
    pub first_face: u32,
    /// The name given by `o`, or [`NONE`].
    pub object: u32,
    /// The name, or the names with blanks between them, given by `g`, or [`NONE`].
    pub group: u32,
    /// The name given by `usemtl`, or [`NONE`].
    pub material: u32,
    /// The number given by `s`, 0 for `off`, or [`NONE`] before the first `s`.
    pub smoothing: u32,
}

impl ObjArrays {
    /// Empties all lists and keeps their memory.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.colors.clear();
        self.texcoords.clear();
        self.normals.clear();
        self.face_starts.clear();
        self.corners.clear();
        self.corner_texcoords.clear();
        self.corner_normals.clear();
        self.runs.clear();
        self.names.clear();
        self.material_libraries.clear();
        self.notes.clear();
        self.file_size = pipeline::FileSize::default();
    }

    /// The number of faces.
    pub fn face_count(&self) -> usize {
        self.face_starts.len().saturating_sub(1)
    }

    /// The corners of a face, as a range of [`ObjArrays::corners`].
    pub fn face(&self, face: usize) -> Range<usize> {
        self.face_starts[face] as usize..self.face_starts[face + 1] as usize
    }

    /// The faces of a run.
    pub fn run_faces(&self, run: usize) -> Range<usize> {
        let end = self.runs.get(run + 1).map_or(self.face_count(), |next| next.first_face as usize);
        self.runs[run].first_face as usize..end
    }

    /// Checks that all lists fit together and all indices are in range, as after a successful read.
    pub fn is_consistent(&self) -> bool {
        let corners = self.corners.len();
        let [points, texcoords, normals] = [self.positions.len(), self.texcoords.len(), self.normals.len()];
        let optional = |list: &[u32], count: usize| {
            (list.is_empty() || list.len() == corners) && list.iter().all(|&at| at == NONE || (at as usize) < count)
        };
        let faces = self.face_count();
        let starts = &self.face_starts;
        points.max(texcoords).max(normals).max(corners) <= MAX_ELEMENTS
            && (self.colors.is_empty() || self.colors.len() == points)
            && starts.first().is_none_or(|first| *first == 0)
            && starts.last().map_or(0, |last| *last as usize) == corners
            && starts.windows(2).all(|pair| pair[1].checked_sub(pair[0]).is_some_and(|corners| corners >= 3))
            && self.corners.iter().all(|&at| (at as usize) < points)
            && optional(&self.corner_texcoords, texcoords)
            && optional(&self.corner_normals, normals)
            && self.runs.first().map_or(faces == 0, |run| run.first_face == 0)
            && self.runs.windows(2).all(|pair| pair[0].first_face < pair[1].first_face)
            && self.runs.last().is_none_or(|run| (run.first_face as usize) < faces)
    }

    /// Largest number of parts that the file may have.
    fn most_parts(&self) -> usize {
        let of_size = |size: u64| usize::try_from(size / BYTES_PER_PART).unwrap_or(MOST_PARTS);
        match self.file_size.0 {
            0 => MOST_PARTS,
            size => MOST_PARTS.min(of_size(size).saturating_add(FREE_PARTS)),
        }
    }

    /// Bytes in use by all lists.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.positions)
            + size_of_val(&*self.colors)
            + size_of_val(&*self.texcoords)
            + size_of_val(&*self.normals)
            + size_of_val(&*self.face_starts)
            + size_of_val(&*self.corners)
            + size_of_val(&*self.corner_texcoords)
            + size_of_val(&*self.corner_normals)
            + size_of_val(&*self.runs)
    }
}

/// Settings of [`read_obj`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjSettings {
    /// Threads for files larger than one block; 0 for as many as the machine has, up to 8. The result is the same.
    pub threads: usize,
    /// Bytes read and parsed at once. A few blocks a thread are the memory needed besides the arrays.
    pub block_bytes: usize,
}

impl Default for ObjSettings {
    fn default() -> Self {
        Self { threads: 0, block_bytes: 512 << 10 }
    }
}

/// Reads an OBJ file into `arrays`, replacing their content and keeping their memory.
///
/// The reader is read to its end in blocks of [`ObjSettings::block_bytes`], by several threads in turn if there is more
/// than one block; it needs no buffer of its own. Bytes are read as `&mut &bytes[..]` or just `&bytes[..]`.
///
/// Time and memory are linear in the file. Memory is that of the arrays, which are at most a quarter larger than their
/// content, and two to three blocks a thread.
///
/// # Errors
/// A malformed line, an index out of range, a coordinate that is not finite ([`ObjError::Line`]), a failing reader, or
/// a list of more than [`MAX_ELEMENTS`]. The arrays are empty then. A file without any statement is no error here.
pub fn read_obj(reader: impl Read + Send, arrays: &mut ObjArrays, settings: &ObjSettings) -> Result<(), ObjError> {
    pipeline::read(reader, arrays, settings)
}

/// Makes a model of arrays that [`read_obj`] filled.
///
/// - [`Model::points`] are all positions in the order of the file, used or not.
/// - Objects are those of `o`, or of `g` where the file has no `o`, in the order of their first faces; faces before the
///   first are in an object without name. Names that come again go on with the same object. A file of more objects than
///   its size can hold (1,500, and one for each 2 KiB of the file) is one object, because each costs memory.
/// - Parts are the faces of one object with one material. Their vertices are the different corners in the order of
///   their first use; [`Part::faces`](crate::mesh::model::Part::faces) are kept if any face is not a triangle.
///   Polygons, concave ones too, are cut into triangles along diagonals inside them.
/// - Normals are the file's, made to have length 1. Corners without, and with one of length 0, get smooth normals by
///   smoothing group, or flat ones after `s off`.
/// - Texture coordinates are turned upside down, to have their origin at the top left. Vertex colours are taken as sRGB
///   and made linear.
/// - Materials in use are translated to glTF's, `sidecar` being asked for their libraries and their PNG and JPEG
///   textures by safe paths ([`safe_relative_path`]). What it does not find is left out with a note.
///
/// Time and memory are linear in the arrays but for large concave polygons, whose triangulation takes `n log n` as a
/// rule. Polygons that cross themselves are cut short in proportion to their corners, and all of them after a second or so.
///
/// # Errors
/// [`ObjError::Inconsistent`] if the arrays are not as a successful read leaves them.
pub fn to_model(arrays: &ObjArrays, name: &str, sidecar: &mut Sidecar) -> Result<Model, ObjError> {
    if !arrays.is_consistent() {
        return Err(ObjError::Inconsistent);
    }
    Ok(weld::model(arrays, name, sidecar))
}

/// Reads an OBJ file into a model: [`read_obj`], then [`to_model`].
///
/// # Errors
/// Errors of [`read_obj`], and [`ObjError::NoGeometry`] for a file without any vertex. A file with vertices and without
/// faces is a model of points, with a note.
pub fn read_model(
    reader: impl Read + Send,
    name: &str,
    settings: &ObjSettings,
    sidecar: &mut Sidecar,
) -> Result<Model, ObjError> {
    let mut arrays = ObjArrays::default();
    read_obj(reader, &mut arrays, settings)?;
    if arrays.positions.is_empty() {
        return Err(ObjError::NoGeometry);
    }
    let mut model = to_model(&arrays, name, sidecar)?;
    if model.parts.is_empty() {
        model.notes.push("the file has no faces, only vertices".into());
    }
    Ok(model)
}
