//! Symmetry: the plane between left and right of a fitted skeleton, and whether mesh and pose share it.

use glam::Vec3;

use super::{limbs::TemplateLimbs, volume::VoxelGraph};
use crate::mesh::voxels::Voxels;

/// Share of the volume that has to meet its mirror image.
const OVERLAP: f32 = 0.9;
/// Distance of a joint from its partner's image up to which a pose counts as symmetric, as a share of the mesh's side.
const SAME_POSE: f32 = 0.035;
/// Cosine of the angle between two planes up to which they are one.
const SAME_PLANE: f32 = 0.97;
/// Every so many nodes are looked at.
const STRIDE: usize = 5;

/// A point and the unit normal to the left of the plane that joints suggest; `None` without pairs.
pub(super) fn plane(template: &TemplateLimbs, places: &[Vec3]) -> Option<(Vec3, Vec3)> {
    let (mut normal, mut middle, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (joint, mirror) in template.mirror.iter().enumerate() {
        let Some(mirror) = mirror.filter(|_| template.positions[joint].x > 0.0) else { continue };
        let wide = template.positions[joint].x / template.size;
        normal += (places[joint] - places[mirror]).normalize_or_zero() * wide;
        middle += (places[joint] + places[mirror]) * 0.5 * wide;
        weight += wide;
    }
    let normal = normal.normalize_or_zero();
    (weight > 0.0 && normal != Vec3::ZERO).then(|| (middle / weight, normal))
}

/// The plane, moved to where the volume meets its mirror image best, if mesh and pose are symmetric.
pub(super) fn find(
    template: &TemplateLimbs,
    places: &[Vec3],
    graph: &VoxelGraph,
    voxels: &Voxels,
) -> Option<(Vec3, Vec3)> {
    let (point, normal) = plane(template, places)?;
    for (joint, mirror) in template.mirror.iter().enumerate() {
        let Some(mirror) = *mirror else { continue };
        let image = places[mirror] - normal * (2.0 * (places[mirror] - point).dot(normal));
        if image.distance(places[joint]) > SAME_POSE {
            return None;
        }
    }
    let overlap = |point: Vec3| {
        let (mut met, mut all) = (0usize, 0usize);
        for node in (0..graph.len()).step_by(STRIDE).filter(|&n| graph.body[n]) {
            let centre = graph.centres[node];
            let image = centre - normal * (2.0 * (centre - point).dot(normal));
            let cell = voxels.cell_at(voxels.to_grid(image));
            met += usize::from(cell.is_some_and(|c| voxels.solid_index(c).is_some()));
            all += 1;
        }
        met as f32 / all.max(1) as f32
    };
    (overlap(point) >= OVERLAP).then_some((point, normal))
}

/// Makes left and right alike: each joint and its partner's image meet in the middle, central joints go to the plane.
pub(super) fn make_symmetric(template: &TemplateLimbs, places: &mut [Vec3], (point, normal): (Vec3, Vec3)) {
    let image = |p: Vec3| p - normal * (2.0 * (p - point).dot(normal));
    let before = places.to_vec();
    for (joint, place) in places.iter_mut().enumerate() {
        let partner = template.mirror[joint].unwrap_or(joint);
        let central = template.mirror[joint].is_none() && template.positions[joint].x.abs() > 0.02 * template.size;
        if !central {
            *place = (before[joint] + image(before[partner])) * 0.5;
        }
    }
}

/// Moves the joints of the trunk to the plane of symmetry of a mesh whose limbs are posed, if the skeleton shares it.
pub(super) fn centre(template: &TemplateLimbs, places: &mut [Vec3], (point, normal): (Vec3, Vec3)) {
    let Some((_, left)) = plane(template, places) else { return };
    if left.dot(normal).abs() < SAME_PLANE {
        return;
    }
    for &joint in &template.trunk {
        let away = (places[joint] - point).dot(normal);
        if away.abs() < SAME_POSE {
            places[joint] -= normal * away;
        }
    }
}

/// Share of the volume that has to meet its mirror image for the mesh itself to have a plane of symmetry.
const MESH_OVERLAP: f32 = 0.8;

/// A point and the normal of the plane in which the volume meets its mirror image best, among planes through its middle
/// across its principal axes and the axes of the file.
pub(super) fn of_mesh(graph: &VoxelGraph, voxels: &Voxels, file_axes: [Vec3; 3]) -> Option<(Vec3, Vec3)> {
    let body: Vec<Vec3> = (0..graph.len()).filter(|&n| graph.body[n]).map(|n| graph.centres[n]).collect();
    let middle = body.iter().map(|p| p.as_dvec3()).sum::<glam::DVec3>() / body.len().max(1) as f64;
    let middle = middle.as_vec3();
    let overlap = |normal: Vec3| {
        let (mut met, mut all) = (0usize, 0usize);
        for &centre in body.iter().step_by(STRIDE) {
            let image = centre - normal * (2.0 * (centre - middle).dot(normal));
            let cell = voxels.cell_at(voxels.to_grid(image));
            met += usize::from(cell.is_some_and(|c| voxels.solid_index(c).is_some()));
            all += 1;
        }
        met as f32 / all.max(1) as f32
    };
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().chain(file_axes);
    let best = axes.map(|normal| (overlap(normal), normal)).reduce(|a, b| if b.0 > a.0 { b } else { a })?;
    (best.0 >= MESH_OVERLAP).then_some((middle, best.1))
}
