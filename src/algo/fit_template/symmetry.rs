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
/// Share of the volume, about its middle, that has to meet its mirror image for other places of that plane to be tried:
/// what a figure holds in one hand moves the middle.
const LOOKED_INTO: f32 = 0.5;
/// Distance from the middle up to which planes are tried, in cells.
const ASIDE: i32 = 12;

/// Plane of symmetry of a mesh.
#[derive(Debug, Clone, Copy)]
pub(super) struct MirrorPlane {
    /// Point on the plane, in unit space.
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
    /// Share of the volume that meets its mirror image.
    pub(super) overlap: f32,
}

impl MirrorPlane {
    /// True if all of the volume meets its image, so that its pose is symmetric, too, and the skeleton lies across the plane.
    pub(super) fn is_of(&self, template: &TemplateLimbs, places: &[Vec3]) -> bool {
        self.overlap >= SAME_POSE_OVERLAP
            && plane(template, places).is_some_and(|(_, left)| left.dot(self.normal).abs() >= SAME_PLANE)
    }

    /// Mirror image of a position.
    pub(super) fn image(&self, p: Vec3) -> Vec3 {
        p - self.normal * (2.0 * (p - self.point).dot(self.normal))
    }
}

/// The plane in which the volume meets its mirror image best, among planes near its middle across its principal axes and
/// the axes of the file.
pub(super) fn of_mesh(graph: &VoxelGraph, voxels: &Voxels, file_axes: [Vec3; 3]) -> Option<MirrorPlane> {
    let body: Vec<Vec3> = (0..graph.len()).filter(|&n| graph.body[n]).map(|n| graph.centres[n]).collect();
    let middle = body.iter().map(|p| p.as_dvec3()).sum::<glam::DVec3>() / body.len().max(1) as f64;
    let middle = middle.as_vec3();
    let at = |normal: Vec3, aside: i32| {
        let plane = MirrorPlane { point: middle + normal * (0.5 * graph.cell * aside as f32), normal, overlap: 0.0 };
        let (mut met, mut all) = (0usize, 0usize);
        for &centre in body.iter().step_by(STRIDE) {
            met += usize::from(is_solid(voxels, plane.image(centre)));
            all += 1;
        }
        MirrorPlane { overlap: met as f32 / all.max(1) as f32, ..plane }
    };
    let better = |a: MirrorPlane, b: MirrorPlane| if b.overlap > a.overlap { b } else { a };
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().chain(file_axes);
    let tried = axes.map(|normal| at(normal, 0)).map(|plane| {
        // A plane in which nearly all of the volume meets its image needs no other place.
        if !(LOOKED_INTO..SAME_POSE_OVERLAP).contains(&plane.overlap) {
            return plane;
        }
        (1..=2 * ASIDE).flat_map(|aside| [aside, -aside]).map(|aside| at(plane.normal, aside)).fold(plane, better)
    });
    tried.reduce(better).filter(|best| best.overlap >= MESH_OVERLAP)
}

fn is_solid(voxels: &Voxels, place: Vec3) -> bool {
    voxels.cell_at(voxels.to_grid(place)).is_some_and(|c| voxels.solid_index(c).is_some())
}

/// Share of the volume that meets its mirror image from which on nothing hangs on one side only.
const SAME_POSE_OVERLAP: f32 = 0.985;

/// Nodes of the body whose mirror image is solid, too, where the figure carries something on one side; `None` where all of
/// it is as good as symmetric.
pub(super) fn core(graph: &VoxelGraph, voxels: &Voxels, plane: &MirrorPlane) -> Option<VoxelGraph> {
    if plane.overlap >= SAME_POSE_OVERLAP {
        return None;
    }
    let is_kept = |node: usize| {
        let image = plane.image(graph.centres[node]);
        let around = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        graph.body[node] && around.iter().any(|way| is_solid(voxels, image + *way * graph.cell))
    };
    let kept: Vec<bool> = (0..graph.len()).map(is_kept).collect();
    Some(graph.of_nodes(&kept))
}
