//! Parts of a mesh: its objects and connected pieces, with the names by which people choose a binding for them.

use std::{
    collections::{BTreeMap, HashSet},
    ops::Range,
};

use crate::{
    mesh::{adjacency, model::Model},
    plugins::surface::RigMesh,
};

/// Part of a mesh that weights are chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MeshPart {
    /// Object of the model, by its number.
    Object(usize),
    /// Connected piece of the mesh, by its number in the order of the pieces' first points.
    Piece(usize),
}

/// Places with at least this many points make a piece; fewer have no surface.
const LEAST: usize = 3;
/// Number of points that belong to no piece or object.
const NONE: u32 = u32::MAX;

/// The objects and connected pieces of a mesh.
pub struct MeshParts {
    /// The piece of each point, or `NONE`.
    piece_of: Vec<u32>,
    /// Object of each piece: that of its first point.
    objects: Vec<Option<usize>>,
    /// Number of the pieces of each object.
    counts: Vec<usize>,
    /// Name of each piece.
    names: Vec<String>,
    /// Name of each object.
    object_names: Vec<String>,
}

impl MeshParts {
    /// Finds the pieces of a mesh. Near linear time.
    pub fn new(mesh: &RigMesh) -> Self {
        let model = &mesh.rest;
        let (piece_of, count) = pieces(model, &mesh.triangles);
        let object_of = object_of_points(model);
        let mut objects = vec![None; count];
        for (point, piece) in piece_of.iter().enumerate().rev().filter(|(_, piece)| **piece != NONE) {
            objects[*piece as usize] = Some(object_of[point]).filter(|object| *object != NONE).map(|o| o as usize);
        }
        let number = |piece: usize| format!("part {}", piece + 1);
        let mut names: Vec<String> = (0..count).map(number).collect();
        let object_names = object_names(model, &objects);
        let of_objects: HashSet<&String> = object_names.iter().collect();
        let mut of_pieces: HashSet<String> = names.iter().cloned().collect();
        for (piece, name) in material_names(model, &piece_of) {
            if !of_objects.contains(&name) && of_pieces.insert(name.clone()) {
                of_pieces.remove(&names[piece]);
                names[piece] = name;
            }
        }
        let mut counts = vec![0; model.objects.len()];
        for object in objects.iter().flatten() {
            if let Some(count) = counts.get_mut(*object) {
                *count += 1;
            }
        }
        Self { piece_of, objects, counts, names, object_names }
    }

    /// Part with a name, as [`MeshParts::name`] gives it; `part N` names the piece with that number, counted from 1.
    pub fn find(&self, name: &str) -> Option<MeshPart> {
        let object = self.object_names.iter().position(|known| known == name);
        let piece = || self.names.iter().position(|known| known == name);
        let number = || name.strip_prefix("part ")?.parse::<usize>().ok()?.checked_sub(1);
        let numbered = || number().filter(|piece| *piece < self.names.len());
        object.map(MeshPart::Object).or_else(|| piece().or_else(numbered).map(MeshPart::Piece))
    }

    /// Name of a part: the object's; for a piece, that of the material that it alone has, or `part N`.
    pub fn name(&self, part: MeshPart) -> String {
        let name = match part {
            MeshPart::Object(object) => self.object_names.get(object),
            MeshPart::Piece(piece) => self.names.get(piece),
        };
        name.cloned().unwrap_or_default()
    }

    /// Names of all parts: objects, then pieces that are no whole objects.
    pub fn all_names(&self) -> impl Iterator<Item = &str> {
        let is_own =
            |(piece, _): &(usize, &String)| self.objects[*piece].is_none_or(|object| self.pieces_of(object) > 1);
        let pieces = self.names.iter().enumerate().filter(is_own).map(|(_, name)| name);
        self.object_names.iter().chain(pieces).map(String::as_str)
    }

    /// The piece of a point as a part: the object if it consists of one piece. `None` for points without a surface.
    pub fn at(&self, point: usize) -> Option<MeshPart> {
        let piece = self.piece_of.get(point).copied().filter(|piece| *piece != NONE)? as usize;
        let object = self.objects[piece].filter(|object| self.pieces_of(*object) == 1);
        Some(object.map_or(MeshPart::Piece(piece), MeshPart::Object))
    }

    /// Object that a part is or belongs to; `None` for a piece that belongs to none.
    pub fn object(&self, part: MeshPart) -> Option<MeshPart> {
        match part {
            MeshPart::Object(_) => Some(part),
            MeshPart::Piece(piece) => self.objects.get(piece).copied().flatten().map(MeshPart::Object),
        }
    }

    /// Points of a part, as runs of following numbers.
    pub(super) fn points(&self, mesh: &RigMesh, part: MeshPart) -> Vec<Range<u32>> {
        match part {
            MeshPart::Object(object) => object_points(mesh, object),
            MeshPart::Piece(piece) => runs(&self.piece_of, piece as u32),
        }
    }

    fn pieces_of(&self, object: usize) -> usize {
        self.counts.get(object).copied().unwrap_or(0)
    }
}

/// Points of an object of a mesh, as runs of following numbers.
pub(super) fn object_points(mesh: &RigMesh, object: usize) -> Vec<Range<u32>> {
    let points = mesh.rest.parts.iter().filter(|part| part.object == object).flat_map(|part| &part.vertices);
    let mut points: Vec<u32> = points.copied().collect();
    points.sort_unstable();
    points.dedup();
    points.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[run.len() - 1] + 1).collect()
}

/// Runs of following places of a list that have a value.
pub(super) fn runs(list: &[u32], value: u32) -> Vec<Range<u32>> {
    let mut at = 0;
    let run = |same: &[u32]| {
        let start = at;
        at += same.len() as u32;
        (same[0] == value).then_some(start..at)
    };
    list.chunk_by(|a, b| a == b).filter_map(run).collect()
}

/// Runs of following places of a list by their values, those from `count` on left out.
pub(super) fn runs_by_value(list: &[u32], count: usize) -> Vec<Vec<Range<u32>>> {
    let mut runs = vec![Vec::new(); count];
    let mut at = 0;
    for same in list.chunk_by(|a, b| a == b) {
        let start = at;
        at += same.len() as u32;
        if let Some(runs) = runs.get_mut(same[0] as usize) {
            runs.push(start..at);
        }
    }
    runs
}

/// The piece of each point, or `NONE`, and the number of pieces.
fn pieces(model: &Model, triangles: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let (place, count) = adjacency::weld(&model.points);
    let welded: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|p| place[p as usize])).collect();
    let (islands, found) = adjacency::islands(&welded, count);
    let mut sizes = vec![0; found];
    islands.iter().for_each(|island| sizes[*island as usize] += 1);
    let mut next = 0;
    let number = |size: &usize| {
        if *size < LEAST {
            return NONE;
        }
        next += 1;
        next - 1
    };
    let numbers: Vec<u32> = sizes.iter().map(number).collect();
    (place.iter().map(|place| numbers[islands[*place as usize] as usize]).collect(), next as usize)
}

/// The object of each point, the first one of several, or `NONE`.
fn object_of_points(model: &Model) -> Vec<u32> {
    let mut object_of = vec![NONE; model.points.len()];
    for part in model.parts.iter().rev() {
        part.vertices.iter().for_each(|point| object_of[*point as usize] = part.object as u32);
    }
    object_of
}

/// Names of objects: their own if no earlier one has it, or else that of their only piece, or `object N`.
fn object_names(model: &Model, objects: &[Option<usize>]) -> Vec<String> {
    let mut pieces: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (piece, object) in objects.iter().enumerate() {
        pieces.entry(object.unwrap_or(usize::MAX)).or_default().push(piece);
    }
    let mut earlier: HashSet<&str> = HashSet::with_capacity(model.objects.len());
    let mut names = Vec::with_capacity(model.objects.len());
    for (number, object) in model.objects.iter().enumerate() {
        let is_first = earlier.insert(object.name.as_str());
        names.push(match pieces.get(&number).map(Vec::as_slice) {
            _ if !object.name.is_empty() && is_first => object.name.clone(),
            Some([piece]) => format!("part {}", piece + 1),
            _ => format!("object {}", number + 1),
        });
    }
    names
}

/// Names of materials that one piece alone has, of pieces with one material.
fn material_names(model: &Model, piece_of: &[u32]) -> Vec<(usize, String)> {
    let mut pieces: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    let mut materials: BTreeMap<u32, Vec<Option<usize>>> = BTreeMap::new();
    for part in &model.parts {
        let mut found: Vec<u32> = part.vertices.iter().map(|point| piece_of[*point as usize]).collect();
        found.sort_unstable();
        found.dedup();
        found.iter().for_each(|piece| materials.entry(*piece).or_default().push(part.material));
        part.material.iter().for_each(|material| pieces.entry(*material).or_default().extend(&found));
    }
    let name = |(material, pieces): (usize, Vec<u32>)| {
        let [piece] = pieces[..] else { return None };
        let is_only = piece != NONE && materials[&piece].len() == 1;
        let name = model.material_set.materials.get(material)?.get("name")?.as_str()?;
        (is_only && !name.is_empty()).then(|| (piece as usize, name.to_owned()))
    };
    pieces.into_iter().filter_map(name).collect()
}
