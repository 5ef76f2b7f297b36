//! Plans of the pieces of a model: bounded in size, each with vertices of its own.
//!
//! The renderer gets a model piece by piece, so that no frame has to take a million triangles at once. Parts with equal
//! materials and attributes share pieces: an object of a thousand groups does not become a thousand draws.

use std::{collections::HashMap, ops::Range};

use bevy::math::Vec3;

use crate::mesh::{
    adjacency::weld,
    model::{Model, Part},
};

/// Largest number of triangles in a piece of the surface.
const PIECE_TRIANGLES: usize = 1 << 16;
/// Largest number of edges in a piece of the wire.
const PIECE_EDGES: usize = 1 << 17;
/// Largest number of vertices in any piece, so that indices take two bytes.
const PIECE_VERTICES: usize = u16::MAX as usize;
/// Marks a vertex that a piece does not have.
const ABSENT: u32 = u32::MAX;

/// Common properties of the parts of a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct PieceTraits {
    /// Index into the model's materials.
    pub material: Option<usize>,
    /// Presence of normals, tangents, two sets of texture coordinates, and colours in the file.
    pub normals: bool,
    pub tangents: bool,
    pub uvs: [bool; 2],
    pub colors: bool,
}

impl PieceTraits {
    fn of(part: &Part, materials: usize) -> Self {
        let vertices = part.vertices.len();
        let uv = |set: usize| part.uvs.get(set).is_some_and(|uvs| uvs.len() == vertices);
        Self {
            material: part.material.filter(|material| *material < materials),
            normals: part.normals.len() == vertices,
            tangents: part.tangents.len() == vertices,
            uvs: [uv(0), uv(1)],
            colors: part.colors.len() == vertices,
        }
    }
}

/// A piece of the surface.
#[derive(Debug)]
pub(super) struct SurfacePlan {
    /// Common properties of its parts.
    pub traits: PieceTraits,
    /// Part of the model that each range of vertices comes from.
    pub runs: Vec<(usize, Range<usize>)>,
    /// Index in its part of each vertex of the piece.
    pub vertices: Vec<u32>,
    /// Triangles over the piece's vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl SurfacePlan {
    /// The part and its vertex, for each vertex of the piece.
    pub fn sources<'a>(&'a self, model: &'a Model) -> impl Iterator<Item = (&'a Part, usize)> {
        self.runs.iter().flat_map(move |(part, range)| {
            let part = &model.parts[*part];
            self.vertices[range.clone()].iter().map(move |vertex| (part, *vertex as usize))
        })
    }
}

/// A piece of the wire: edges over points of the model.
#[derive(Debug, Default)]
pub(super) struct EdgePlan {
    /// Point of the model of each vertex of the piece.
    pub points: Vec<u32>,
    /// Edges over the piece's vertices.
    pub edges: Vec<[u32; 2]>,
}

/// Cuts the surface. Triangles with corners that do not exist are left out. A part without normals is flat, as glTF
/// has it: its triangles share no vertices.
pub(super) fn plan_surface(model: &Model) -> Vec<SurfacePlan> {
    let mut order: Vec<PieceTraits> = Vec::new();
    let mut alike: HashMap<PieceTraits, Vec<usize>> = HashMap::new();
    for (number, part) in model.parts.iter().enumerate() {
        let traits = PieceTraits::of(part, model.material_set.materials.len());
        let parts = alike.entry(traits).or_default();
        if parts.is_empty() {
            order.push(traits);
        }
        parts.push(number);
    }
    let most = model.parts.iter().map(|part| part.vertices.len()).max().unwrap_or(0);
    let mut local = vec![ABSENT; most];
    let mut pieces = Vec::new();
    for traits in order {
        let mut piece = SurfacePlan { traits, runs: Vec::new(), vertices: Vec::new(), triangles: Vec::new() };
        for &number in &alike[&traits] {
            let part = &model.parts[number];
            let whole =
                |corner: &u32| part.vertices.get(*corner as usize).is_some_and(|p| (*p as usize) < model.points.len());
            let mut first = piece.vertices.len();
            for triangle in part.triangles.iter().filter(|triangle| triangle.iter().all(whole)) {
                if piece.triangles.len() == PIECE_TRIANGLES || piece.vertices.len() + 3 > PIECE_VERTICES {
                    piece.close(number, first, &mut local);
                    let next = SurfacePlan { traits, runs: Vec::new(), vertices: Vec::new(), triangles: Vec::new() };
                    pieces.push(std::mem::replace(&mut piece, next));
                    first = 0;
                }
                let vertices = &mut piece.vertices;
                piece.triangles.push(triangle.map(|corner| {
                    let known = &mut local[corner as usize];
                    if *known == ABSENT || !traits.normals {
                        *known = vertices.len() as u32;
                        vertices.push(corner);
                    }
                    *known
                }));
            }
            piece.close(number, first, &mut local);
        }
        if !piece.triangles.is_empty() {
            pieces.push(piece);
        }
    }
    pieces
}

impl SurfacePlan {
    /// Ends the run of a part's vertices that began at `first`.
    fn close(&mut self, part: usize, first: usize, local: &mut [u32]) {
        let range = first..self.vertices.len();
        for vertex in &self.vertices[range.clone()] {
            local[*vertex as usize] = ABSENT;
        }
        if !range.is_empty() {
            self.runs.push((part, range));
        }
    }
}

/// Cuts the edges of all polygons (triangles where the file has no polygons) into pieces. Each edge appears once, also
/// along seams, where points of equal position meet.
pub(super) fn plan_edges(model: &Model) -> Vec<EdgePlan> {
    let (welded, _) = weld(&model.points);
    let mut edges: Vec<([u32; 2], [u32; 2])> = Vec::new();
    for part in &model.parts {
        let point = |corner: u32| {
            let point = *part.vertices.get(corner as usize)?;
            Some((*welded.get(point as usize)?, point))
        };
        let mut add = |a: u32, b: u32| {
            if let (Some(a), Some(b)) = (point(a), point(b))
                && a.0 != b.0
            {
                let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
                edges.push(([low.0, high.0], [low.1, high.1]));
            }
        };
        if part.faces.is_empty() {
            part.triangles
                .iter()
                .for_each(|&[a, b, c]| [(a, b), (b, c), (c, a)].into_iter().for_each(|(a, b)| add(a, b)));
        } else {
            for face in part.faces.iter() {
                let next = face.iter().cycle().skip(1);
                face.iter().zip(next).for_each(|(a, b)| add(*a, *b));
            }
        }
    }
    edges.sort_unstable();
    edges.dedup_by_key(|(key, _)| *key);

    let mut local = vec![ABSENT; model.points.len()];
    let (mut piece, mut pieces) = (EdgePlan::default(), Vec::new());
    for (_, ends) in edges {
        if piece.edges.len() == PIECE_EDGES || piece.points.len() + 2 > PIECE_VERTICES {
            piece.points.iter().for_each(|point| local[*point as usize] = ABSENT);
            pieces.push(std::mem::take(&mut piece));
        }
        let EdgePlan { points, edges } = &mut piece;
        edges.push(ends.map(|point| {
            let known = &mut local[point as usize];
            if *known == ABSENT {
                *known = points.len() as u32;
                points.push(point);
            }
            *known
        }));
    }
    if !piece.edges.is_empty() {
        pieces.push(piece);
    }
    pieces
}

/// Normals of a piece whose triangles share no vertices.
pub(super) fn flat_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::Y; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
        let normal = (b - a).cross(c - a).try_normalize().unwrap_or(Vec3::Y);
        triangle.iter().for_each(|corner| normals[*corner as usize] = normal);
    }
    normals
}
