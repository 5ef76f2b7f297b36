//! Dual quaternion skinning on the CPU, for engines that blend joints so: limbs keep their thickness where they bend and
//! twist, and bulge at the outside of a bend.
//!
//! Source: Kavan, Collins, Žára and O'Sullivan, "Skinning with Dual Quaternions", 2007. Scale and shear of a joint act on
//! each point before the rigid motions are blended.

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec4};
use rayon::prelude::*;

use super::skin_point;
use crate::mesh::model::{Model, Weights};

/// Points in a unit of parallel work.
const CHUNK: usize = 4096;

/// A point moved by a blend of dual quaternions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DualPoint {
    /// Position in posed space.
    pub position: Vec3,
    /// Rotation from bind to posed space, for normals and tangents.
    pub rotation: Quat,
}

/// Moves every point by the blended rigid motion of its joints. Parameters, points without influences and the order of work
/// are those of [`skin_points`](super::skin_points).
pub fn skin_points_dual(points: &[Vec3], weights: &Weights, matrices: &[Affine3A]) -> Vec<DualPoint> {
    let rotations: Vec<Quat> = matrices.iter().map(|matrix| rotation(&matrix.matrix3)).collect();
    let mut out = vec![DualPoint { position: Vec3::ZERO, rotation: Quat::IDENTITY }; points.len()];
    out.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).enumerate().for_each(|(chunk, (out, points))| {
        for (at, (out, point)) in out.iter_mut().zip(points).enumerate() {
            *out = blended(chunk * CHUNK + at, *point, weights, matrices, &rotations);
        }
    });
    out
}

/// The model as a pose shows it with dual quaternions: without weights, skins and morph targets.
pub fn posed_model(rest: &Model, weights: &Weights, matrices: &[Affine3A]) -> Model {
    let moved = skin_points_dual(&rest.points, weights, matrices);
    let mut posed = Model { weights: None, skins: Vec::new(), clips: Vec::new(), ..rest.clone() };
    posed.points = moved.iter().map(|point| point.position).collect();
    for object in &mut posed.objects {
        (object.skin, object.node) = (None, None);
        object.morph_names.clear();
        object.morph_weights.clear();
    }
    for part in &mut posed.parts {
        part.morphs.clear();
        let turn = |vertex: usize| part.vertices.get(vertex).and_then(|point| moved.get(*point as usize));
        for (vertex, normal) in part.normals.iter_mut().enumerate() {
            *normal = turn(vertex).map_or(*normal, |point| point.rotation * *normal);
        }
        for (vertex, tangent) in part.tangents.iter_mut().enumerate() {
            let turned = turn(vertex).map_or(tangent.truncate(), |point| point.rotation * tangent.truncate());
            *tangent = turned.extend(tangent.w);
        }
    }
    posed
}

/// The rotation of a matrix without its scale; a mirrored matrix gives that of the matrix with X turned over.
fn rotation(matrix: &Mat3A) -> Quat {
    let x = Vec3::from(matrix.x_axis).normalize_or(Vec3::X);
    let y = Vec3::from(matrix.y_axis);
    let y = (y - x * y.dot(x)).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    let x = if matrix.determinant() < 0.0 { -x } else { x };
    Quat::from_mat3a(&Mat3A::from_cols(x.into(), y.into(), x.cross(y).into())).normalize()
}

fn blended(index: usize, point: Vec3, weights: &Weights, matrices: &[Affine3A], rotations: &[Quat]) -> DualPoint {
    let still = DualPoint { position: point, rotation: Quat::IDENTITY };
    if index + 1 >= weights.starts.len() {
        return still;
    }
    let mut pivot: Option<Quat> = None;
    let (mut real, mut dual) = (Vec4::ZERO, Vec4::ZERO);
    for (joint, weight) in weights.of(index) {
        let (Some(matrix), Some(turn)) = (matrices.get(joint as usize), rotations.get(joint as usize)) else {
            continue;
        };
        // The strongest influence comes first; of the two quaternions of each rotation the one near to it counts.
        let first = *pivot.get_or_insert(*turn);
        let turn = if first.dot(*turn) < 0.0 { -*turn } else { *turn };
        // A rigid motion that moves this point as the whole matrix does.
        let way = matrix.transform_point3(point) - turn * point;
        let moved = Quat::from_xyzw(way.x, way.y, way.z, 0.0) * turn;
        real += Vec4::from(turn) * weight;
        dual += Vec4::from(moved) * (0.5 * weight);
    }
    let length = real.length();
    if pivot.is_none() || length < 1e-6 {
        // Opposite rotations cancel out; the linear blend is what remains.
        return DualPoint { position: skin_point(index, point, weights, matrices), ..still };
    }
    let (real, dual) = (Quat::from_vec4(real / length), Quat::from_vec4(dual / length));
    let way = dual * real.conjugate();
    DualPoint { position: real * point + 2.0 * Vec3::new(way.x, way.y, way.z), rotation: real }
}
