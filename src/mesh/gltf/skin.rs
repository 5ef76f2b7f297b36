//! Skins: bind poses, and influences put in order.

use std::mem::size_of;

use glam::{Mat4, Vec4};

use super::{
    GltfError,
    accessor::Source,
    budget::Notes,
    hierarchy::Hierarchy,
    primitive::{Attributes, Primitive},
};
use crate::mesh::model::SkinBinding;

/// Largest number of sets of four influences read; later sets are too weak to show.
const MAX_SETS: usize = 32;

/// Influence of a joint that the skin does not have.
#[derive(Debug, thiserror::Error)]
#[error("JOINTS_{set} of vertex {vertex} refers to joint {joint}, but the skin has {joints}")]
pub(super) struct NoSkinJoint {
    /// Number of the set of influences.
    set: usize,
    /// Vertex of the primitive.
    vertex: usize,
    /// Position in the skin that the influence names.
    joint: usize,
    /// Number of joints of the skin.
    joints: usize,
}

/// The bind pose of every skin.
pub(super) fn read_bindings(
    source: &Source,
    hierarchy: &Hierarchy,
    notes: &Notes,
) -> Result<Vec<SkinBinding>, GltfError> {
    let mut bindings = Vec::new();
    for skin in &source.document.skins {
        source.budget.take(skin.joints.len(), size_of::<Mat4>() + size_of::<usize>(), &skin.place)?;
        let joints: Vec<usize> = skin.joints.iter().filter_map(|&node| hierarchy.kept.get(node)).collect();
        let mut inverse_binds = match skin.inverse_binds {
            None => vec![Mat4::IDENTITY; joints.len()],
            Some(accessor) => source.matrices(accessor)?,
        };
        inverse_binds.truncate(joints.len());
        inverse_binds.shrink_to_fit();
        for matrix in &mut inverse_binds {
            if matrix.row(3) != Vec4::W {
                notes.add("The last row of an inverse bind matrix was not 0 0 0 1; it is now");
                let transpose = matrix.transpose();
                *matrix = Mat4::from_cols(transpose.x_axis, transpose.y_axis, transpose.z_axis, Vec4::W).transpose();
            }
        }
        bindings.push(SkinBinding { name: skin.name.to_owned(), joints, inverse_binds });
    }
    Ok(bindings)
}

/// The joints (as positions in the skin) and weights of all sets of a primitive, `4 * sets` a vertex.
pub(super) struct Influences {
    sets: Vec<(Vec<u32>, Vec<f32>)>,
}

impl Influences {
    /// Reads the sets `JOINTS_0`/`WEIGHTS_0` and on.
    pub(super) fn read(source: &Source, primitive: &Primitive) -> Result<Self, GltfError> {
        let mut sets = Vec::new();
        for set in 0..MAX_SETS {
            let joints = primitive.attribute(&format!("JOINTS_{set}"));
            let weights = primitive.attribute(&format!("WEIGHTS_{set}"));
            match (joints, weights) {
                (Some(joints), Some(weights)) => sets.push((source.uints(joints, 4)?, source.finite(weights, 4)?)),
                (None, None) => break,
                _ => {
                    let what = format!("JOINTS_{set} and WEIGHTS_{set} must both be there");
                    return Err(GltfError::at(format!("{}/attributes", primitive.place), what));
                }
            }
        }
        Ok(Self { sets })
    }

    /// The influences of a vertex over `joints`, normalised; negative weights are dropped and counted.
    pub(super) fn of(
        &self,
        vertex: usize,
        joints: &[usize],
        negative: &mut usize,
        out: &mut Vec<(u32, f32)>,
    ) -> Result<(), NoSkinJoint> {
        out.clear();
        for (set, (indices, weights)) in self.sets.iter().enumerate() {
            for i in vertex * 4..vertex * 4 + 4 {
                if weights[i] > 0.0 {
                    let Some(&node) = joints.get(indices[i] as usize) else {
                        let (joint, joints) = (indices[i] as usize, joints.len());
                        return Err(NoSkinJoint { set, vertex, joint, joints });
                    };
                    out.push((node as u32, weights[i]));
                } else if weights[i] < 0.0 {
                    *negative += 1;
                }
            }
        }
        settle(out);
        Ok(())
    }
}

/// Key of a primitive's vertices: all attributes that make up points and their influences.
pub(super) fn vertex_key<'a>(attributes: &Attributes<'a>) -> Vec<(&'a str, usize)> {
    let of_points = |name: &str| name == "POSITION" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
    attributes.iter().copied().filter(|(name, _)| of_points(name)).collect()
}

/// Normalises influences: one a joint, strongest first, summing to one. Weights that sum to one within a float's
/// precision keep their bits, so that normalising twice changes nothing. Influences of weight zero are dropped.
pub(super) fn settle(influences: &mut Vec<(u32, f32)>) {
    influences.retain(|(_, weight)| *weight > 0.0);
    influences.sort_by_key(|(joint, _)| *joint);
    influences.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 = (f64::from(kept.1) + f64::from(next.1)) as f32;
        }
        same
    });
    let strongest_first = |a: &(u32, f32), b: &(u32, f32)| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0));
    influences.sort_by(strongest_first);
    let sum = |influences: &[(u32, f32)]| influences.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>();
    let total = sum(influences);
    if influences.is_empty() || (total - 1.0).abs() <= 1e-7 * influences.len() as f64 {
        return;
    }
    for (_, weight) in influences.iter_mut() {
        *weight = (f64::from(*weight) / total) as f32;
    }
    influences.retain(|(_, weight)| *weight > 0.0);
    // The strongest influence takes the rounding error.
    let rest = 1.0 - sum(influences);
    if let Some((_, weight)) = influences.first_mut() {
        *weight = (f64::from(*weight) + rest) as f32;
    }
    influences.sort_by(strongest_first);
}
