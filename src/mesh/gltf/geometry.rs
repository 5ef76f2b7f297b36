//! Meshes placed by nodes become objects and parts.

use std::{collections::BTreeMap, mem::size_of};

use glam::Vec3;
use serde_json::Value;

use super::{
    GltfError,
    accessor::Source,
    attributes::{Decoder, fill_normals},
    budget::{Budget, Notes},
    hierarchy::Hierarchy,
    json::copy,
    matrix::Bake,
    primitive::{Mesh, Primitive, find, morph_weights},
    skin::{Influences, vertex_key},
};
use crate::mesh::model::{Model, Morph, Object, Part, Weights};

/// Texture coordinate sets read at most; the specification asks for two.
pub(super) const MAX_UV_SETS: usize = 16;

/// Reads the meshes of all nodes of the scene, in the order of the file's nodes. Returns the object of each node.
pub(super) fn read_objects(
    source: &Source,
    hierarchy: &Hierarchy,
    notes: &Notes,
    model: &mut Model,
) -> Result<Vec<Option<usize>>, GltfError> {
    let decoder = Decoder::new(source, notes);
    let mut weights = Weights { starts: vec![0], ..Default::default() };
    let mut objects = vec![None; source.document.nodes.len()];
    for (node, entry) in source.document.nodes.iter().enumerate() {
        let Some(mesh) = entry.mesh.filter(|_| hierarchy.visible[node]) else {
            continue;
        };
        let mesh = &source.document.meshes[mesh];
        let has_joints = mesh.primitives.iter().any(|primitive| primitive.attribute("JOINTS_0").is_some());
        match (entry.skin, has_joints) {
            (Some(_), false) => notes.add("A mesh with a skin has no joints and weights; it was read without the skin"),
            (None, true) => notes.add("Joints and weights of a mesh without a skin were not kept"),
            _ => {}
        }
        let at = entry.at(node);
        source.budget.take(mesh.targets, 2 * size_of::<String>(), &at.place)?;
        source.budget.take(1, size_of::<Object>() + entry.name.len() + mesh.name.len(), &at.place)?;
        let (morph_names, extras) = names_and_extras(mesh, source.budget, &at.place)?;
        let skin = entry.skin.filter(|_| has_joints);
        let object = Object {
            name: if entry.name.is_empty() { mesh.name } else { entry.name }.to_owned(),
            skin,
            node: if skin.is_some() { None } else { hierarchy.carrier.get(node) },
            morph_names,
            morph_weights: morph_weights(&at, mesh.targets)?.unwrap_or_else(|| mesh.weights.clone()),
            extras,
        };
        let mut uses = BTreeMap::new();
        for primitive in &mesh.primitives {
            *uses.entry(vertex_key(&primitive.attributes)).or_insert(0) += 1;
        }
        let before = model.parts.len();
        let points = BTreeMap::new();
        let mut reader =
            ObjectReader { decoder: &decoder, hierarchy, node, skin, points, model, weights: &mut weights };
        for primitive in &mesh.primitives {
            let shared = uses.get(&vertex_key(&primitive.attributes)) > Some(&1);
            reader.part(primitive, shared)?;
        }
        if model.parts.len() > before {
            objects[node] = Some(model.objects.len());
            model.objects.push(object);
        }
    }
    if model.parts.is_empty() {
        notes.add("There are no triangles");
    }
    if model.objects.iter().any(|object| object.skin.is_some()) {
        model.weights = Some(weights);
    }
    Ok(objects)
}

/// The names of a mesh's morph targets (by custom in `extras.targetNames`), and its other extras.
fn names_and_extras(mesh: &Mesh, budget: &Budget, place: &str) -> Result<(Vec<String>, Option<Value>), GltfError> {
    let mut extras = mesh.extras.map(|extras| copy(extras, budget, place)).transpose()?;
    let mut names = vec![String::new(); mesh.targets];
    if let Some(Value::Object(map)) = &mut extras
        && let Some(list) = map.get("targetNames").and_then(Value::as_array)
    {
        for (name, value) in names.iter_mut().zip(list) {
            value.as_str().unwrap_or_default().clone_into(name);
        }
        map.shift_remove("targetNames");
        if map.is_empty() {
            extras = None;
        }
    }
    Ok((names, extras))
}

/// Reads the primitives of one placed mesh.
struct ObjectReader<'a> {
    decoder: &'a Decoder<'a>,
    hierarchy: &'a Hierarchy,
    node: usize,
    skin: Option<usize>,
    /// Index of the first point, by the attributes and the transform of vertices that several primitives share.
    points: BTreeMap<Vec<(&'a str, usize)>, u32>,
    model: &'a mut Model,
    weights: &'a mut Weights,
}

impl<'a> ObjectReader<'a> {
    fn part(&mut self, primitive: &Primitive<'a>, shared: bool) -> Result<(), GltfError> {
        let notes = self.decoder.notes;
        let Some(accessor) = primitive.attribute("POSITION") else {
            notes.add("A primitive without positions was not kept");
            return Ok(());
        };
        if primitive.mode < 4 {
            notes.add("Points or lines were not kept");
            return Ok(());
        }
        let positions = self.decoder.all(accessor, 3)?;
        let (positions, _) = positions.as_chunks::<3>();
        if let Some(at) = positions.iter().position(|position| !Vec3::from_array(*position).is_finite()) {
            return Err(GltfError::at(format!("/accessors/{accessor}"), format!("position {at} is not finite")));
        }
        let mut triangles = self.triangles(primitive)?;
        if triangles.is_empty() {
            notes.add("A primitive without triangles was not kept");
            return Ok(());
        }
        let extent = positions.iter().flatten().fold(0.0_f32, |most, value| most.max(value.abs()));
        let bake = match self.skin {
            Some(_) => Bake::none(),
            None => Bake::new(self.hierarchy.world[self.node], f64::from(extent)),
        };
        if bake.flip {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let base = self.points(primitive, accessor, positions, &bake, shared)?;
        // A part has only those of the shared vertices that it uses.
        let pick = shared.then(|| compact(&mut triangles, positions.len()));
        let count = pick.as_ref().map_or(positions.len(), Vec::len);
        self.decoder.source.budget.take(count, size_of::<u32>(), &primitive.place)?;
        let vertices: Vec<u32> = match &pick {
            None => (base..base + count as u32).collect(),
            Some(pick) => pick.iter().map(|vertex| base + vertex).collect(),
        };
        let mut part = Part {
            object: self.model.objects.len(),
            material: primitive.material,
            vertices,
            triangles,
            ..Default::default()
        };
        self.attributes(primitive, pick.as_deref(), &bake, &mut part)?;
        self.model.parts.push(part);
        Ok(())
    }

    /// Appends the primitive's vertices to the model's points, once if they are shared. Returns the index of the first.
    fn points(
        &mut self,
        primitive: &Primitive<'a>,
        accessor: usize,
        positions: &[[f32; 3]],
        bake: &Bake,
        shared: bool,
    ) -> Result<u32, GltfError> {
        let key = vertex_key(&primitive.attributes);
        if let (true, Some(base)) = (shared, self.points.get(&key)) {
            return Ok(*base);
        }
        let Decoder { source, notes, .. } = *self.decoder;
        source.budget.take(positions.len(), size_of::<Vec3>() + size_of::<u32>(), &primitive.place)?;
        let base = self.model.points.len();
        if base + positions.len() > u32::MAX as usize {
            return Err(GltfError::at(&*primitive.place, "the file has more than four billion vertices"));
        }
        self.model.points.reserve(positions.len());
        self.weights.starts.reserve(positions.len());
        for (i, position) in positions.iter().enumerate() {
            let point = bake.point(Vec3::from_array(*position));
            if !point.is_finite() {
                return Err(GltfError::at(
                    format!("/accessors/{accessor}"),
                    format!("position {i} is not finite in model space"),
                ));
            }
            self.model.points.push(point);
        }
        let (mut negative, mut bare) = (0, 0);
        if let Some(skin) = self.skin {
            let influences = Influences::read(source, primitive)?;
            let joints = &self.model.skins[skin].joints;
            let mut list = Vec::new();
            for vertex in 0..positions.len() {
                let settled = influences.of(vertex, joints, &mut negative, &mut list);
                settled.map_err(|error| GltfError::at(&*primitive.place, error.to_string()))?;
                bare += usize::from(list.is_empty());
                source.budget.take(list.len(), 2 * size_of::<u32>(), &primitive.place)?;
                self.weights.push(list.iter().copied());
            }
        } else {
            (0..positions.len()).for_each(|_| self.weights.push([]));
        }
        notes.add_times("A negative weight was set to zero", negative);
        notes.add_times("A vertex of a skinned mesh has no weights", bare);
        self.points.insert(key, base as u32);
        Ok(base as u32)
    }

    /// The triangles of a primitive (section 3.7.2.1).
    fn triangles(&self, primitive: &Primitive) -> Result<Vec<[u32; 3]>, GltfError> {
        let Decoder { source, notes, .. } = *self.decoder;
        let count = primitive.count;
        let indices = match primitive.indices {
            Some(accessor) => source.uints(accessor, 1)?,
            None => {
                source.budget.take(count, size_of::<u32>(), &primitive.place)?;
                (0..count as u32).collect()
            }
        };
        if let Some((i, index)) = indices.iter().enumerate().find(|(_, index)| **index as usize >= count) {
            let what = format!("index {i} is {index}, but there are {count} vertices");
            return Err(GltfError::at(format!("{}/indices", primitive.place), what));
        }
        source.budget.take(indices.len(), size_of::<[u32; 3]>(), &primitive.place)?;
        // Strips repeat a vertex to jump from one place to another; triangles with a repeated vertex are no surface.
        let solid = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
        Ok(match primitive.mode {
            5 => {
                let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
                indices.windows(3).enumerate().map(turned).filter(solid).collect()
            }
            6 => {
                let (first, rest) = indices.split_first().unwrap_or((&0, &[]));
                rest.windows(2).map(|w| [w[0], w[1], *first]).filter(solid).collect()
            }
            _ => {
                let (triangles, left) = indices.as_chunks::<3>();
                notes.add_times(
                    "Indices at the end that make no whole triangle were not kept",
                    usize::from(!left.is_empty()),
                );
                triangles.to_vec()
            }
        })
    }

    /// Reads all attributes but positions and weights.
    fn attributes(
        &self,
        primitive: &Primitive,
        pick: Option<&[u32]>,
        bake: &Bake,
        part: &mut Part,
    ) -> Result<(), GltfError> {
        let Decoder { source, notes, .. } = *self.decoder;
        let count = part.vertices.len();
        let normals = primitive.attribute("NORMAL");
        let mut own_normals = match normals {
            Some(accessor) => self.decoder.normals(accessor, pick)?,
            None => {
                // The double-precision sums for the normals are charged, too.
                source.budget.take(count, 4 * size_of::<Vec3>(), &primitive.place)?;
                vec![Vec3::ZERO; count]
            }
        };
        if normals.is_some() {
            let absent = own_normals.iter().filter(|normal| **normal == Vec3::ZERO).count();
            notes.add_times("A normal without direction was computed", absent);
        }
        part.normals = own_normals.iter().map(|normal| bake.normal(*normal)).collect();
        let points = &self.model.points;
        fill_normals(&mut part.normals, &part.triangles, |vertex| points[part.vertices[vertex as usize] as usize]);
        if let (Some(_), Some(accessor)) = (normals, primitive.attribute("TANGENT")) {
            for (own, normal) in own_normals.iter_mut().zip(&part.normals).filter(|(own, _)| **own == Vec3::ZERO) {
                *own = *normal;
            }
            let sign = if bake.flip { -1.0 } else { 1.0 };
            part.tangents = self.decoder.tangents(accessor, pick, &own_normals)?;
            for (tangent, normal) in part.tangents.iter_mut().zip(&part.normals).filter(|_| !bake.identity) {
                let moved = bake.vector(tangent.truncate()).try_normalize();
                *tangent = moved.unwrap_or(normal.any_orthonormal_vector()).extend(tangent.w * sign);
            }
        }
        let mut other = 0;
        for (name, accessor) in &primitive.attributes {
            match name.split_once('_') {
                Some(("TEXCOORD", set)) => match set.parse::<usize>() {
                    Ok(set) if set < MAX_UV_SETS => {
                        while part.uvs.len() <= set {
                            part.uvs.push(Vec::new());
                        }
                        part.uvs[set] = self.decoder.uvs(*accessor, pick)?;
                    }
                    _ => other += 1,
                },
                Some(("COLOR", "0")) => part.colors = self.decoder.colors(*accessor, pick)?,
                Some(("COLOR", _)) => notes.add("Only the first set of vertex colours was kept"),
                Some(("JOINTS" | "WEIGHTS", _)) => {}
                _ => other += usize::from(!["POSITION", "NORMAL", "TANGENT"].contains(name)),
            }
        }
        notes.add_times("A vertex attribute of an unknown kind was not kept", other);
        for set in part.uvs.iter_mut().filter(|set| set.is_empty()) {
            source.budget.take(count, size_of::<glam::Vec2>(), &primitive.place)?;
            notes.add("A gap in the numbering of texture coordinates was filled with zeros");
            set.resize(count, glam::Vec2::ZERO);
        }
        self.morphs(primitive, pick, bake, &own_normals, part)
    }

    fn morphs(
        &self,
        primitive: &Primitive,
        pick: Option<&[u32]>,
        bake: &Bake,
        normals: &[Vec3],
        part: &mut Part,
    ) -> Result<(), GltfError> {
        let Decoder { source, notes, .. } = *self.decoder;
        source.budget.take(primitive.targets.len(), size_of::<Morph>(), &primitive.place)?;
        for target in &primitive.targets {
            let mut morph = Morph::default();
            if let Some(accessor) = find(target, "POSITION") {
                morph.positions = self.decoder.offsets(accessor, pick)?;
                morph.positions.iter_mut().for_each(|offset| *offset = bake.vector(*offset));
                if morph.positions.iter().any(|offset| !offset.is_finite()) {
                    return Err(GltfError::at(&*primitive.place, "a morph target is not finite in model space"));
                }
            }
            if let (Some(accessor), Some(_)) = (find(target, "NORMAL"), primitive.attribute("NORMAL")) {
                morph.normals = self.decoder.offsets(accessor, pick)?;
                for (offset, normal) in morph.normals.iter_mut().zip(normals) {
                    *offset = bake.normal_offset(*normal, *offset);
                }
            }
            if let (Some(accessor), false) = (find(target, "TANGENT"), part.tangents.is_empty()) {
                morph.tangents = self.decoder.offsets(accessor, pick)?;
                morph.tangents.iter_mut().for_each(|offset| *offset = bake.vector(*offset));
            }
            let other = target.iter().filter(|(name, _)| !["POSITION", "NORMAL", "TANGENT"].contains(name));
            notes.add_times("Morphing of texture coordinates or colours was not kept", other.count());
            part.morphs.push(morph);
        }
        Ok(())
    }
}

/// Renumbers triangles over the vertices they use; returns these vertices, in order.
pub(super) fn compact(triangles: &mut [[u32; 3]], count: usize) -> Vec<u32> {
    let mut place = vec![u32::MAX; count];
    for vertex in triangles.iter().flatten() {
        place[*vertex as usize] = 0;
    }
    let mut used = Vec::new();
    for (vertex, place) in place.iter_mut().enumerate().filter(|(_, place)| **place == 0) {
        *place = used.len() as u32;
        used.push(vertex as u32);
    }
    for vertex in triangles.iter_mut().flatten() {
        *vertex = place[*vertex as usize];
    }
    used
}
