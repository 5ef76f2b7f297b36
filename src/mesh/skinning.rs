//! Linear blend skinning on the CPU, so that rays meet the posed mesh.

mod dual_quaternion;

use glam::{Affine3A, Vec3, Vec3A};
use rayon::prelude::*;

pub use dual_quaternion::{DualPoint, posed_model, skin_points_dual};

use super::model::Weights;

/// Points in a unit of parallel work.
const CHUNK: usize = 4096;

/// Moves every point by the weighted sum of the `matrices` of its joints.
///
/// `points` are in bind space; `weights` has an entry a point and its joints index `matrices`, each of which takes bind
/// space to posed space (pose times inverse bind). `out` is overwritten with as many points, in posed space. A point
/// without influences stays where it is, and so does one past the end of `weights`; influences of joints that
/// `matrices` does not have are skipped. The result is the same for any number of threads.
pub fn skin_points(points: &[Vec3], weights: &Weights, matrices: &[Affine3A], out: &mut Vec<Vec3>) {
    out.resize(points.len(), Vec3::ZERO);
    out.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).enumerate().for_each(|(chunk, (out, points))| {
        for (i, (out, &point)) in out.iter_mut().zip(points).enumerate() {
            *out = skin_point(chunk * CHUNK + i, point, weights, matrices);
        }
    });
}

/// Skins one point of a mesh: the same result, to the bit, as [`skin_points`] gives for it.
pub fn skin_point(index: usize, point: Vec3, weights: &Weights, matrices: &[Affine3A]) -> Vec3 {
    let (Some(&start), Some(&end)) = (weights.starts.get(index), weights.starts.get(index + 1)) else { return point };
    let range = start as usize..end as usize;
    let (Some(joints), Some(values)) = (weights.joints.get(range.clone()), weights.values.get(range)) else {
        return point;
    };
    let rest = Vec3A::from(point);
    let mut posed = Vec3A::ZERO;
    let mut moved = false;
    for (&joint, &value) in joints.iter().zip(values) {
        if let Some(matrix) = matrices.get(joint as usize) {
            posed += matrix.transform_point3a(rest) * value;
            moved = true;
        }
    }
    if moved { posed.into() } else { point }
}
