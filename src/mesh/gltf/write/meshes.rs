//! Meshes and nodes of objects and parts.

use std::{borrow::Cow, collections::BTreeMap};

use glam::{DAffine3, Vec3, Vec4};
use serde_json::{Map, Value};

use super::{
    buffer::{Bin, Target},
    document::{Attribute, Attributes, Mesh, MorphTarget, Node, Primitive},
    materials::uv_sets,
    skeleton::Skeleton,
};
use crate::mesh::{
    gltf::{
        GltfError,
        attributes::unit,
        geometry::compact,
        matrix::{self, Bake},
    },
    model::{Model, Object, Part, Trs},
};

/// The written meshes.
pub(super) struct Meshes<'a> {
    pub(super) meshes: Vec<Mesh<'a>>,
    /// The glTF node of each object that is written.
    pub(super) node_of_object: Vec<Option<usize>>,
}

/// Writes all objects that have triangles, appending their nodes.
pub(super) fn write<'a>(
    model: &'a Model,
    skeleton: &Skeleton,
    bin: &mut Bin,
    nodes: &mut Vec<Node<'a>>,
    scene_nodes: &mut Vec<usize>,
) -> Result<Meshes<'a>, GltfError> {
    let mut meshes: Vec<Mesh> = Vec::new();
    // The first mesh of each list of accessors: objects that are alike share one.
    let mut mesh_of_accessors = BTreeMap::new();
    let mut node_of_object = vec![None; model.objects.len()];
    let mut parts: Vec<&Part> = model.parts.iter().filter(|part| !part.triangles.is_empty()).collect();
    parts.sort_by_key(|part| part.object);
    let mut worlds = None;
    for parts in parts.chunk_by(|a, b| a.object == b.object) {
        let index = parts[0].object;
        let object = &model.objects[index];
        let at = nodes.len();
        node_of_object[index] = Some(at);
        let mut node = Node { name: &object.name, ..Node::default() };
        let carrier = object.node.filter(|_| object.skin.is_none());
        let mut bake = Bake::none();
        match carrier {
            Some(carrier) => {
                let worlds = worlds.get_or_insert_with(|| node_worlds(model));
                let (trs, moved) = placement(model, &worlds[carrier], parts);
                node.set_transform(&trs);
                bake = moved;
                if let Some(parent) = skeleton.node_of[carrier] {
                    nodes[parent].children.push(at);
                }
            }
            None => {
                node.skin = object.skin.and_then(|skin| skeleton.skin_of[skin]);
                scene_nodes.push(at);
            }
        }
        bin.begin_mesh();
        let mut primitives = Vec::with_capacity(parts.len());
        for part in parts {
            primitives.push(primitive(model, skeleton, object, part, &bake, bin)?);
        }
        let accessors: Vec<usize> =
            primitives.iter().flat_map(|one| one.attributes.accessors().chain([one.indices])).collect();
        let own = mesh(object, primitives);
        let known = *mesh_of_accessors.entry(accessors).or_insert(meshes.len());
        match meshes.get(known) == Some(&own) {
            true => node.mesh = Some(known),
            false => {
                node.mesh = Some(meshes.len());
                meshes.push(own);
            }
        }
        nodes.push(node);
    }
    Ok(Meshes { meshes, node_of_object })
}

fn mesh(object: &Object, primitives: Vec<Primitive>) -> Mesh<'_> {
    let mut extras = object.extras.as_ref().map(Cow::Borrowed);
    if object.morph_names.iter().any(|name| !name.is_empty()) {
        let names: Value = object.morph_names.iter().map(|name| Value::from(name.as_str())).collect();
        let mut own = object.extras.clone().unwrap_or_else(|| Map::new().into());
        // Extras that are not an object cannot hold names.
        if let Value::Object(map) = &mut own {
            map.insert("targetNames".to_owned(), names);
        }
        extras = Some(Cow::Owned(own));
    }
    Mesh { name: &object.name, primitives, weights: &object.morph_weights, extras }
}

/// Rest transforms of all nodes to model space. Parents come first, so that one pass over them is enough, however deep
/// they hang and however many objects they carry.
pub(super) fn node_worlds(model: &Model) -> Vec<DAffine3> {
    let mut worlds: Vec<DAffine3> = Vec::with_capacity(model.nodes.len());
    for node in &model.nodes {
        let own = matrix::affine(&node.rest);
        worlds.push(node.parent.map_or(own, |parent| worlds[parent] * own));
    }
    worlds
}

/// Transform of a rigid part below its node, whose transform to model space is `world`. If that is invertible, the vertices
/// stay in model space and the mesh's node undoes it; else the vertices are moved into the node's space.
fn placement(model: &Model, world: &DAffine3, parts: &[&Part]) -> (Trs, Bake) {
    if world.matrix3.determinant() == 0.0 {
        return (Trs::IDENTITY, Bake::none());
    }
    let inverse = world.inverse();
    if !inverse.is_finite() {
        return (Trs::IDENTITY, Bake::none());
    }
    let vertices = parts.iter().flat_map(|part| &part.vertices);
    let extent = vertices.fold(0.0_f32, |most, point| most.max(model.points[*point as usize].abs().max_element()));
    let (trs, _) = matrix::decompose(inverse.into());
    let finite = trs.affine().is_finite();
    if finite && matrix::is_identity(&(*world * matrix::affine(&trs)), f64::from(extent)) {
        return (trs, Bake::none());
    }
    (Trs::IDENTITY, Bake::new(inverse, f64::from(extent)))
}

fn primitive(
    model: &Model,
    skeleton: &Skeleton,
    object: &Object,
    part: &Part,
    bake: &Bake,
    bin: &mut Bin,
) -> Result<Primitive, GltfError> {
    let mut triangles = part.triangles.clone();
    let used = compact(&mut triangles, part.vertices.len());
    if bake.flip {
        triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    let positions: Vec<Vec3> =
        used.iter().map(|vertex| bake.point(model.points[part.vertices[*vertex as usize] as usize])).collect();
    if positions.iter().any(|position| !position.is_finite()) {
        return Err(GltfError::model(format!("object \"{}\" is too far away to be written", object.name)));
    }
    let mut attributes = Attributes::default();
    attributes.put(Attribute::Position, bin.vertices(&positions));
    let up = |normal: Vec3| if normal == Vec3::ZERO { Vec3::Y } else { normal };
    let normals: Vec<Vec3> = pick(&part.normals, &used).map(|normal| up(bake.normal(up(unit(normal))))).collect();
    if !normals.is_empty() {
        attributes.put(
            Attribute::Normal,
            bin.floats(&normals.iter().map(Vec3::to_array).collect::<Vec<_>>(), Target::Vertices),
        );
    }
    if !part.tangents.is_empty() && !normals.is_empty() {
        let sign = if bake.flip { -1.0 } else { 1.0 };
        let one = |(tangent, normal): (Vec4, &Vec3)| {
            let moved = unit(if bake.identity { tangent.truncate() } else { unit(bake.vector(tangent.truncate())) });
            let moved = if moved == Vec3::ZERO { normal.any_orthonormal_vector() } else { moved };
            moved.extend(if tangent.w < 0.0 { -sign } else { sign }).to_array()
        };
        let tangents: Vec<[f32; 4]> = pick(&part.tangents, &used).zip(&normals).map(one).collect();
        attributes.put(Attribute::Tangent, bin.floats(&tangents, Target::Vertices));
    }
    // An empty set below other sets, or one that the material's textures need, is written as zeros.
    let own_sets = part.uvs.iter().rposition(|uvs| !uvs.is_empty()).map_or(0, |last| last + 1);
    let sets = own_sets.max(part.material.map_or(0, |material| uv_sets(&model.material_set.materials[material])));
    for set in 0..sets {
        let mut uvs: Vec<[f32; 2]> =
            part.uvs.get(set).map_or(vec![], |uvs| pick(uvs, &used).map(|uv| uv.to_array()).collect());
        uvs.resize(used.len(), [0.0; 2]);
        attributes.put(Attribute::TexCoord(set), bin.floats(&uvs, Target::Vertices));
    }
    if !part.colors.is_empty() {
        let clamp = |channel: f32| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, 1.0) };
        let colors: Vec<[f32; 4]> = pick(&part.colors, &used).map(|color| color.to_array().map(clamp)).collect();
        attributes.put(Attribute::Color, bin.floats(&colors, Target::Vertices));
    }
    if let Some(skin) = object.skin {
        let mut lists = Vec::with_capacity(used.len());
        for vertex in &used {
            lists.push(skeleton.influences(skin, part.vertices[*vertex as usize])?);
        }
        let sets = lists.iter().map(Vec::len).max().unwrap_or(0).div_ceil(4).max(1);
        for set in 0..sets {
            let (mut joints, mut weights) = (vec![[0; 4]; lists.len()], vec![[0.0; 4]; lists.len()]);
            for (vertex, list) in lists.iter().enumerate() {
                for (i, (joint, weight)) in list.iter().skip(set * 4).take(4).enumerate() {
                    joints[vertex][i] = *joint;
                    weights[vertex][i] = *weight;
                }
            }
            attributes.put(Attribute::Joints(set), bin.joints(&joints, skeleton.joint_count(skin)));
            attributes.put(Attribute::Weights(set), bin.floats(&weights, Target::Vertices));
        }
    }
    let targets = morphs(part, &used, &normals, bake, bin);
    let indices: Vec<u32> = triangles.into_iter().flatten().collect();

    let indices = bin.indices(&indices, used.len());
    Ok(Primitive { attributes, indices, material: part.material, targets })
}

fn pick<'a, T: Copy>(list: &'a [T], used: &'a [u32]) -> impl Iterator<Item = T> + 'a {
    // A list that is empty stays empty.
    used.iter().filter_map(|vertex| list.get(*vertex as usize).copied())
}

fn morphs(part: &Part, used: &[u32], normals: &[Vec3], bake: &Bake, bin: &mut Bin) -> Vec<MorphTarget> {
    let mut targets = Vec::with_capacity(part.morphs.len());
    let own_normals: Vec<Vec3> = pick(&part.normals, used).collect();
    for morph in &part.morphs {
        let mut positions: Vec<Vec3> = pick(&morph.positions, used).map(|offset| bake.vector(offset)).collect();
        // The target gets zero positions if it has none, because some programs refuse a target without positions.
        positions.resize(used.len(), Vec3::ZERO);
        let mut target = MorphTarget { position: bin.displacements(&positions), normal: None, tangent: None };
        if !morph.normals.is_empty() && !normals.is_empty() {
            let moved = pick(&morph.normals, used).zip(&own_normals);
            let moved: Vec<[f32; 3]> =
                moved.map(|(offset, normal)| bake.normal_offset(*normal, offset).to_array()).collect();
            target.normal = Some(bin.floats(&moved, Target::Vertices));
        }
        if !morph.tangents.is_empty() && !part.tangents.is_empty() && !normals.is_empty() {
            let moved: Vec<[f32; 3]> =
                pick(&morph.tangents, used).map(|offset| bake.vector(offset).to_array()).collect();
            target.tangent = Some(bin.floats(&moved, Target::Vertices));
        }
        targets.push(target);
    }
    targets
}
