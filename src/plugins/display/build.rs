//! Bevy meshes from pieces of a model: positions, attributes, weights and weight colours.

use bevy::{
    asset::RenderAssetUsages,
    math::Vec3,
    mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues},
};

use super::{
    colors::Painter,
    plan::{EdgePlan, SurfacePlan, flat_normals},
};
use crate::{
    mesh::{influences::keep_strongest, model::Model},
    rig::SkinData,
};

/// Marks the rig itself in a palette; it holds points without influences.
pub(super) const RIG: u32 = u32::MAX;
/// Influences that the graphics card takes for each vertex.
const INFLUENCES: usize = 4;

/// A Bevy mesh for the renderer.
#[derive(Debug)]
pub(super) struct Piece {
    /// The mesh.
    pub mesh: Mesh,
    /// Index into the model's materials.
    pub material: Option<usize>,
    /// The joint for each joint index of the mesh: an index into [`SkinData::joints`], or [`RIG`]. `None` if the mesh
    /// is not skinned.
    pub palette: Option<Vec<u32>>,
    /// Marks vertices with colours.
    pub colored: bool,
    /// Approximate number of bytes of its vertices and indices.
    pub bytes: usize,
}

/// Makes a piece of the surface. With a `painter` its vertices have the colours of their weights instead of the file's.
pub(super) fn build_surface(
    model: &Model,
    plan: &SurfacePlan,
    skin: Option<&SkinData>,
    painter: Option<&Painter>,
    tangents: bool,
) -> Piece {
    let traits = &plan.traits;
    let points: Vec<u32> = plan.sources(model).map(|(part, vertex)| part.vertices[vertex]).collect();
    let positions: Vec<Vec3> = points.iter().map(|point| model.points[*point as usize]).collect();
    let normals: Vec<Vec3> = if traits.normals {
        plan.sources(model).map(|(part, vertex)| part.normals[vertex]).collect()
    } else {
        flat_normals(&positions, &plan.triangles)
    };
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD);
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    for (set, attribute) in [Mesh::ATTRIBUTE_UV_0, Mesh::ATTRIBUTE_UV_1].into_iter().enumerate() {
        if traits.uvs[set] {
            let uvs = plan.sources(model).map(|(part, vertex)| part.uvs[set][vertex].to_array());
            mesh.insert_attribute(attribute, uvs.collect::<Vec<_>>());
        }
    }
    let colors: Option<Vec<[f32; 4]>> = match painter {
        Some(painter) => Some(points.iter().map(|point| painter.color(skin, *point as usize)).collect()),
        None if traits.colors => {
            Some(plan.sources(model).map(|(part, vertex)| part.colors[vertex].to_array()).collect())
        }
        None => None,
    };
    let colored = colors.is_some();
    if let Some(colors) = colors {
        mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colors);
    }
    mesh.insert_indices(indices(plan.triangles.as_flattened()));
    if tangents && traits.tangents {
        let tangents = plan.sources(model).map(|(part, vertex)| part.tangents[vertex].to_array());
        mesh.insert_attribute(Mesh::ATTRIBUTE_TANGENT, tangents.collect::<Vec<_>>());
    } else if tangents && traits.uvs[0] {
        // Without tangents a normal map is not used; the surface is then as smooth as its normals.
        let _ = mesh.generate_tangents();
    }
    let palette = skin.map(|skin| insert_weights(&mut mesh, &points, skin));
    finish(mesh, traits.material, palette, colored)
}

/// Makes a piece of the wire.
pub(super) fn build_edges(model: &Model, plan: &EdgePlan, skin: Option<&SkinData>) -> Piece {
    let positions: Vec<Vec3> = plan.points.iter().map(|point| model.points[*point as usize]).collect();
    let mut mesh = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::RENDER_WORLD);
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    mesh.insert_indices(indices(plan.edges.as_flattened()));
    let palette = skin.map(|skin| insert_weights(&mut mesh, &plan.points, skin));
    finish(mesh, None, palette, false)
}

fn finish(mut mesh: Mesh, material: Option<usize>, palette: Option<Vec<u32>>, colored: bool) -> Piece {
    if palette.is_some() {
        // Bounds that follow the pose. A mesh without vertices has none and needs no culling.
        let _ = mesh.generate_skinned_mesh_bounds();
    }
    let bytes = mesh.get_vertex_buffer_size() + mesh.indices().map_or(0, |indices| indices.len() * 2);
    Piece { mesh, material, palette, colored, bytes }
}

/// Adds the four strongest influences of each point, which sum to one, over the joints that the piece uses.
fn insert_weights(mesh: &mut Mesh, points: &[u32], skin: &SkinData) -> Vec<u32> {
    let mut palette: Vec<u32> = Vec::new();
    let mut numbers: Vec<Option<u16>> = vec![None; skin.joints.len() + 1];
    let mut number = |joint: u32| {
        let slot = &mut numbers[if joint == RIG { skin.joints.len() } else { joint as usize }];
        *slot.get_or_insert_with(|| {
            palette.push(joint);
            (palette.len() - 1).min(usize::from(u16::MAX)) as u16
        })
    };
    let mut joints: Vec<[u16; 4]> = Vec::with_capacity(points.len());
    let mut weights: Vec<[f32; 4]> = Vec::with_capacity(points.len());
    let mut strongest = Vec::new();
    for point in points {
        strongest.clear();
        strongest.extend(influences(skin, *point as usize));
        keep_strongest(&mut strongest, INFLUENCES, 0.0);
        if strongest.is_empty() {
            strongest.push((RIG, 1.0));
        }
        let (mut own_joints, mut own_weights) = ([0; INFLUENCES], [0.0; INFLUENCES]);
        for (place, (joint, weight)) in strongest.iter().enumerate() {
            (own_joints[place], own_weights[place]) = (number(*joint), *weight);
        }
        joints.push(own_joints);
        weights.push(own_weights);
    }
    mesh.insert_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(joints));
    mesh.insert_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, weights);
    palette
}

/// The influences of a point by existing joints; none past the end of the weights.
pub(super) fn influences(skin: &SkinData, point: usize) -> impl Iterator<Item = (u32, f32)> {
    let weights = &skin.weights;
    let range = match (weights.starts.get(point), weights.starts.get(point + 1)) {
        (Some(start), Some(end)) => *start as usize..*end as usize,
        _ => 0..0,
    };
    let joints = weights.joints.get(range.clone()).unwrap_or_default();
    let values = weights.values.get(range).unwrap_or_default();
    let known = joints.iter().copied().zip(values.iter().copied());
    known.filter(|(joint, weight)| (*joint as usize) < skin.joints.len() && *weight > 0.0 && weight.is_finite())
}

/// Indices of two bytes, which are enough for a piece.
fn indices(indices: &[u32]) -> Indices {
    Indices::U16(indices.iter().map(|index| *index as u16).collect())
}
