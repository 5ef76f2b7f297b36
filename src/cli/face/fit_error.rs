//! Error of a fit as a written file shows it: read back, posed by its clips, compared with the shapes.

use std::path::Path;

use bevy::prelude::*;

use crate::{
    cli::report::Failure,
    files::{RealDisk, load_model},
    mesh::{
        model::{Channel, ChannelTarget, MaterialSet, Model, Part},
        shapes::Shapes,
    },
};

/// Root mean square distance, in the mesh's unit, between the points of `shapes` and those of the character at `path`
/// posed by its clip of the same name; over all shapes and the points `head` of the mesh, like the error of the fit itself.
///
/// `stored` is the character that was written; its points are those of `rest` and of the shapes. `None` if the file
/// holds other vertices.
///
/// # Errors
/// The file cannot be read back.
pub(super) fn fit_error(
    path: &Path,
    stored: &Model,
    rest: &[Vec3],
    shapes: &Shapes,
    head: &[usize],
) -> Result<Option<f32>, Failure> {
    let mut written = load_model(&RealDisk, path)?;
    let clips = std::mem::take(&mut written.clips);
    let rests: Vec<_> = written.nodes.iter().map(|node| node.rest).collect();
    // Points, weights and nodes are all that is posed here.
    written.material_set = MaterialSet::default();
    for part in &mut written.parts {
        *part = Part { object: part.object, vertices: std::mem::take(&mut part.vertices), ..Part::default() };
    }
    // Parts are written object by object, and the reader numbers their vertices in that order.
    let mut parts: Vec<&Part> = stored.parts.iter().filter(|part| !part.triangles.is_empty()).collect();
    parts.sort_by_key(|part| part.object);
    let vertices: Vec<u32> = parts.iter().flat_map(|part| part.vertices.iter().copied()).collect();
    if vertices.len() != written.points.len() {
        return Ok(None);
    }
    let mut first: Vec<Option<usize>> = vec![None; rest.len()];
    for (vertex, &point) in vertices.iter().enumerate() {
        if let Some(first) = first.get_mut(point as usize) {
            first.get_or_insert(vertex);
        }
    }
    let mut square = 0.0;
    for (name, moved) in shapes.names.iter().zip(&shapes.displacements) {
        for (node, rest) in written.nodes.iter_mut().zip(&rests) {
            node.rest = *rest;
        }
        // A shape that moves no bone has no clip: the file shows it as the character at rest.
        // Clips that the mesh brought along come before those of the fit.
        let channels = clips.iter().rfind(|clip| clip.name == *name).map_or(&[][..], |clip| &clip.channels);
        channels.iter().for_each(|channel| set(&mut written, channel));
        let posed = written.at_rest().points;
        for &point in head {
            let vertex = first.get(point).copied().flatten();
            let Some(((rest, moved), vertex)) = rest.get(point).zip(moved.get(point)).zip(vertex) else { continue };
            square += f64::from((*rest + *moved).distance_squared(posed[vertex]));
        }
    }
    let all = (head.len() * shapes.names.len()).max(1);
    Ok(Some((square / all as f64).sqrt() as f32))
}

/// Sets a node to the first value of a channel.
fn set(model: &mut Model, channel: &Channel) {
    let value = |index: usize| channel.values.get(index).copied().unwrap_or_default();
    let vector = Vec3::new(value(0), value(1), value(2));
    let (ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) | ChannelTarget::Scale(node)) =
        channel.target
    else {
        return;
    };
    let Some(node) = model.nodes.get_mut(node) else { return };
    match channel.target {
        ChannelTarget::Translation(_) => node.rest.translation = vector,
        ChannelTarget::Rotation(_) => node.rest.rotation = Quat::from_xyzw(value(0), value(1), value(2), value(3)),
        _ => node.rest.scale = vector,
    }
}
