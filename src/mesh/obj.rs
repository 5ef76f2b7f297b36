//! Wavefront OBJ: read in parallel into arrays, made into a [`Model`], and written.
//!
//! [`read_obj`] fills [`ObjArrays`], which hold what the file says and nothing else, and can be used again for the next
//! file without allocating. [`to_model`] makes a [`Model`] of them: polygons triangulated, corners welded into
//! vertices, normals made where there are none, materials translated to glTF's. [`read_model`] does both and asks its
//! caller for the files that an OBJ refers to. [`write_obj`] is the way back.
//!
//! The format is that of Wavefront's "Advanced Visualizer" manual, appendix B1, as far as polygons go, and what
//! exporters made of it since: vertex colours after the position, physically based materials. Curves, surfaces, lines
//! and points are left out with a note.

mod block;
mod collect;
mod error;
mod names;
mod number;
mod pipeline;
mod statement;

use std::{io::Read, ops::Range};

pub use self::{
    error::{LineProblem, ObjError},
    names::ObjNames,
};

/// No index, no name: a corner without texture coordinate or normal, a face outside any object.
pub const NONE: u32 = u32::MAX;

/// No list may hold more: indices keep one bit to themselves.
pub const MAX_ELEMENTS: usize = i32::MAX as usize;

/// What an OBJ file says, as flat lists.
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
    /// Where each face's corners start, and one more at the end; empty if there are no faces.
    pub face_starts: Vec<u32>,
    /// The position of each corner.
    pub corners: Vec<u32>,
    /// The texture coordinate of each corner or [`NONE`]; empty if no corner has one.
    pub corner_texcoords: Vec<u32>,
    /// The normal of each corner or [`NONE`]; empty if no corner has one.
    pub corner_normals: Vec<u32>,
    /// What holds for which faces, in the order of the faces; the first run starts at face 0.
    pub runs: Vec<ObjRun>,
    /// The names that the runs refer to.
    pub names: ObjNames,
    /// What follows `mtllib`, one entry a statement: often one file name, but see [`ObjArrays::library_names`].
    pub material_libraries: Vec<String>,
    /// What the file holds and these arrays do not, a sentence each.
    pub notes: Vec<String>,
    spare: pipeline::Spare,
}

/// Faces that share object, group, material and smoothing group. It ends where the next one starts.
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

/// How to read.
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

/// Reads an OBJ file into `arrays`, replacing what they hold and keeping their memory.
///
/// The reader is read to its end in blocks of [`ObjSettings::block_bytes`], by several threads in turn if there is more
/// than one block; it needs no buffer of its own. Bytes are read as `&mut &bytes[..]` or just `&bytes[..]`.
///
/// Time and memory are linear in the file: besides the arrays, which grow by a quarter at most past what they hold, two
/// to three blocks a thread.
///
/// # Errors
/// A malformed line, an index out of range, a coordinate that is not finite ([`ObjError::Line`]), a failing reader, or
/// a list of more than [`MAX_ELEMENTS`]. The arrays are empty then. A file without any statement is no error here.
pub fn read_obj(reader: impl Read + Send, arrays: &mut ObjArrays, settings: &ObjSettings) -> Result<(), ObjError> {
    pipeline::read(reader, arrays, settings)
}
