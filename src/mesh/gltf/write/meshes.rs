//! Meshes and nodes of objects and parts.

use glam::{DAffine3, Vec3, Vec4};
use serde_json::{Map, Value};

use super::{
    buffer::{Bin, Target},
    floats, insert_list, insert_name,
    materials::uv_sets,
    skeleton::{Skeleton, insert_transform},
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
pub(super) struct Meshes {
    pub(super) meshes: Vec<Value>,
    /// The glTF node of each object that is written.
    pub(super) node_of_object: Vec<Option<usize>>,
}

/// Writes all objects that have triangles, appending their nodes.
pub(super) fn write(
    model: &Model,
    skeleton: &Skeleton,
    bin: &mut Bin,
    nodes: &mut Vec<Map<String, Value>>,
    scene_nodes: &mut Vec<usize>,
) -> Result<Meshes, GltfError> {
    let mut meshes = Vec::new();
    let mut node_of_object = vec![None; model.objects.len()];
    let mut parts_of = vec![Vec::new(); model.objects.len()];
    for part in model.parts.iter().filter(|part| !part.triangles.is_empty()) {
        parts_of[part.object].push(part);
    }
    let mut added_children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    for (index, (object, parts)) in model.objects.iter().zip(&parts_of).enumerate() {
        if parts.is_empty() {
            continue;
        }
        let at = nodes.len();
        node_of_object[index] = Some(at);
        let mut node = Map::new();
        insert_name(&mut node, &object.name);
        node.insert("mesh".to_owned(), meshes.len().into());
        let carrier = object.node.filter(|_| object.skin.is_none());
        let mut bake = Bake::none();
        match carrier {
            Some(carrier) => {
                let (trs, moved) = placement(model, carrier, parts);
                insert_transform(&mut node, &trs);
                bake = moved;
                if let Some(parent) = skeleton.node_of[carrier] {
                    added_children[parent].push(at);
                }
            }
            None => {
                if let Some(skin) = object.skin.and_then(|skin| skeleton.skin_of[skin]) {
                    node.insert("skin".to_owned(), skin.into());
                }
                scene_nodes.push(at);
            }
        }
        nodes.push(node);
        let mut primitives = Vec::new();
        for part in parts {
            primitives.push(primitive(model, skeleton, object, part, &bake, bin)?);
        }
        meshes.push(mesh(object, primitives));
    }
    for (node, added) in nodes.iter_mut().zip(added_children) {
        if added.is_empty() {
            continue;
        }
        let mut children = node.get("children").and_then(Value::as_array).cloned().unwrap_or_default();
        children.extend(added.into_iter().map(Value::from));
        node.insert("children".to_owned(), children.into());
    }
    Ok(Meshes { meshes, node_of_object })
}

fn mesh(object: &Object, primitives: Vec<Value>) -> Value {
    let mut mesh = Map::new();
    insert_name(&mut mesh, &object.name);
    insert_list(&mut mesh, "primitives", primitives);
    if !object.morph_weights.is_empty() {
        mesh.insert("weights".to_owned(), floats(&object.morph_weights));
    }
    let mut extras = object.extras.clone();
    if object.morph_names.iter().any(|name| !name.is_empty()) {
        let names: Value = object.morph_names.iter().map(|name| Value::from(name.as_str())).collect();
        // Extras that are not an object cannot hold names.
        if let Value::Object(map) = extras.get_or_insert_with(|| Map::new().into()) {
            map.insert("targetNames".to_owned(), names);
        }
    }
    if let Some(extras) = extras {
        mesh.insert("extras".to_owned(), extras);
    }
    mesh.into()
}

/// Transform of a rigid part below its node. If the carrier's rest transform is invertible, the vertices stay in model
/// space and the mesh's node undoes it; else the vertices are moved into the carrier's space.
fn placement(model: &Model, carrier: usize, parts: &[&Part]) -> (Trs, Bake) {
    let mut world = DAffine3::IDENTITY;
    let mut node = Some(carrier);
    while let Some(at) = node {
        world = matrix::affine(&model.nodes[at].rest) * world;
        node = model.nodes[at].parent;
    }
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
    if finite && matrix::is_identity(&(world * matrix::affine(&trs)), f64::from(extent)) {
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
) -> Result<Value, GltfError> {
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
    let mut attributes = Map::new();
    let mut put = |name: &str, accessor: usize| drop(attributes.insert(name.to_owned(), accessor.into()));
    put("POSITION", bin.positions(&positions));
    let up = |normal: Vec3| if normal == Vec3::ZERO { Vec3::Y } else { normal };
    let normals: Vec<Vec3> = pick(&part.normals, &used).map(|normal| up(bake.normal(up(unit(normal))))).collect();
    if !normals.is_empty() {
        put("NORMAL", bin.floats(&normals.iter().map(Vec3::to_array).collect::<Vec<_>>(), Target::Vertices));
    }
    if !part.tangents.is_empty() && !normals.is_empty() {
        let sign = if bake.flip { -1.0 } else { 1.0 };
        let one = |(tangent, normal): (Vec4, &Vec3)| {
            let moved = unit(if bake.identity { tangent.truncate() } else { unit(bake.vector(tangent.truncate())) });
            let moved = if moved == Vec3::ZERO { normal.any_orthonormal_vector() } else { moved };
            moved.extend(if tangent.w < 0.0 { -sign } else { sign }).to_array()
        };
        let tangents: Vec<[f32; 4]> = pick(&part.tangents, &used).zip(&normals).map(one).collect();
        put("TANGENT", bin.floats(&tangents, Target::Vertices));
    }
    // An empty set below other sets, or one that the material's textures need, is written as zeros.
    let own_sets = part.uvs.iter().rposition(|uvs| !uvs.is_empty()).map_or(0, |last| last + 1);
    let sets = own_sets.max(part.material.map_or(0, |material| uv_sets(&model.material_set.materials[material])));
    for set in 0..sets {
        let mut uvs: Vec<[f32; 2]> =
            part.uvs.get(set).map_or(vec![], |uvs| pick(uvs, &used).map(|uv| uv.to_array()).collect());
        uvs.resize(used.len(), [0.0; 2]);
        put(&format!("TEXCOORD_{set}"), bin.floats(&uvs, Target::Vertices));
    }
    if !part.colors.is_empty() {
        let clamp = |channel: f32| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, 1.0) };
        let colors: Vec<[f32; 4]> = pick(&part.colors, &used).map(|color| color.to_array().map(clamp)).collect();
        put("COLOR_0", bin.floats(&colors, Target::Vertices));
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
            put(&format!("JOINTS_{set}"), bin.joints(&joints, skeleton.joint_count(skin)));
            put(&format!("WEIGHTS_{set}"), bin.floats(&weights, Target::Vertices));
        }
    }
    let targets = morphs(part, &used, &normals, bake, bin);
    let indices: Vec<u32> = triangles.into_iter().flatten().collect();

    let mut map = Map::new();
    map.insert("attributes".to_owned(), attributes.into());
    map.insert("indices".to_owned(), bin.indices(&indices, used.len()).into());
    if let Some(material) = part.material {
        map.insert("material".to_owned(), material.into());
    }
    insert_list(&mut map, "targets", targets);
    Ok(map.into())
}

fn pick<'a, T: Copy>(list: &'a [T], used: &'a [u32]) -> impl Iterator<Item = T> + 'a {
    // A list that is empty stays empty.
    used.iter().filter_map(|vertex| list.get(*vertex as usize).copied())
}

fn morphs(part: &Part, used: &[u32], normals: &[Vec3], bake: &Bake, bin: &mut Bin) -> Vec<Value> {
    let mut targets = Vec::new();
    let own_normals: Vec<Vec3> = pick(&part.normals, used).collect();
    for morph in &part.morphs {
        let mut target = Map::new();
        let mut positions: Vec<Vec3> = pick(&morph.positions, used).map(|offset| bake.vector(offset)).collect();
        // The target gets zero positions if it has none, because some programs refuse a target without positions.
        positions.resize(used.len(), Vec3::ZERO);
        target.insert("POSITION".to_owned(), bin.displacements(&positions).into());
        if !morph.normals.is_empty() && !normals.is_empty() {
            let moved = pick(&morph.normals, used).zip(&own_normals);
            let moved: Vec<[f32; 3]> =
                moved.map(|(offset, normal)| bake.normal_offset(*normal, offset).to_array()).collect();
            target.insert("NORMAL".to_owned(), bin.floats(&moved, Target::Vertices).into());
        }
        if !morph.tangents.is_empty() && !part.tangents.is_empty() && !normals.is_empty() {
            let moved: Vec<[f32; 3]> =
                pick(&morph.tangents, used).map(|offset| bake.vector(offset).to_array()).collect();
            target.insert("TANGENT".to_owned(), bin.floats(&moved, Target::Vertices).into());
        }
        targets.push(target.into());
    }
    targets
}
