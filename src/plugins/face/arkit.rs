//! Blend shapes of ARKit and poses of other units, baked from the facial bones.

use std::collections::BTreeMap;

use bevy::prelude::*;

use super::{
    ExpressError,
    pose::{Frame, analysed_weights, facial_bones},
};
use crate::{
    algo::face::{
        auto::FaceAnalysis,
        bones::FaceBoneKind,
        expression::{BonePose, ExpressionSet, Mix, Sides, Unit, apply},
    },
    mesh::{influences::keep_strongest, model::Weights},
    plugins::surface::RigMesh,
    rig::{PoseOffset, Rig, Uid},
};

/// Shape whose effect is that of itself with the jaw open, less that of the open jaw: lips that meet cannot come nearer.
const CLOSE: &str = "mouthClose";
const OPEN: &str = "jawOpen";
/// Longest displacement that counts as none, in eye distances: less than a hundredth of a millimetre on a head.
const STILL: f32 = 1e-4;

/// A blend shape as the facial bones make it.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceShape {
    /// Name in ARKit, or that of a unit and its side.
    pub name: String,
    /// Displacements of the points of the mesh that move, in the mesh's space and unit, by rising index of the point.
    pub offsets: Vec<(u32, Vec3)>,
    /// Pose of the facial joints.
    pub pose: BTreeMap<Uid, PoseOffset>,
}

impl FaceShape {
    /// Displacement of a point of the mesh; zero for one that does not move.
    pub fn offset(&self, point: u32) -> Vec3 {
        self.offsets.binary_search_by_key(&point, |(point, _)| *point).map_or(Vec3::ZERO, |at| self.offsets[at].1)
    }
}

/// The blend shapes of ARKit for which the set has units, in the order of the units, without those of the tongue on a face that
/// has none, as linear skinning by the facial bones with the strongest `influences` of each point gives them.
///
/// # Errors
/// [`ExpressError::NoBones`] and [`ExpressError::NotSkinned`].
pub fn arkit_shapes(
    rig: &Rig,
    mesh: &RigMesh,
    analysis: &FaceAnalysis,
    set: &ExpressionSet,
    influences: usize,
) -> Result<Vec<FaceShape>, ExpressError> {
    let names = set.unit_set().arkit_shapes().map(|(name, unit, side)| (name.to_owned(), unit, side));
    baked(rig, mesh, analysis, set, influences, &names.collect::<Vec<_>>())
}

/// The shapes of units that have no name in ARKit, as [`arkit_shapes`] makes those of the others: `cheek_raise_l` and
/// `cheek_raise_r`, for example.
///
/// # Errors
/// [`ExpressError::NoBones`] and [`ExpressError::NotSkinned`].
pub fn unit_shapes(
    rig: &Rig,
    mesh: &RigMesh,
    analysis: &FaceAnalysis,
    set: &ExpressionSet,
    influences: usize,
) -> Result<Vec<FaceShape>, ExpressError> {
    let others = set.units().iter().enumerate().filter(|(_, unit)| unit.arkit.is_empty());
    let names = others.flat_map(|(number, unit)| {
        let [left, right] = pose_names(unit);
        [(left, number, Sides::Left), (right, number, Sides::Right)]
    });
    baked(rig, mesh, analysis, set, influences, &names.collect::<Vec<_>>())
}

/// Names of the stored poses of a unit, of its left and its right side: those of ARKit, of which both sides may have the same,
/// or else the unit's own with `_l` and `_r`.
pub fn pose_names(unit: &Unit) -> [String; 2] {
    match unit.arkit.as_slice() {
        [both] => [both.clone(), both.clone()],
        [left, right] => [left.clone(), right.clone()],
        _ => ["l", "r"].map(|side| format!("{}_{side}", unit.name)),
    }
}

/// Bakes shapes: name, index of the unit, and side of each.
fn baked(
    rig: &Rig,
    mesh: &RigMesh,
    analysis: &FaceAnalysis,
    set: &ExpressionSet,
    influences: usize,
    names: &[(String, usize, Sides)],
) -> Result<Vec<FaceShape>, ExpressError> {
    let (face, skin) = facial_bones(rig, mesh)?;
    let weights = strongest(&analysed_weights(skin, &face, analysis), influences);
    let bones = face.face_bones(analysis);
    let units = set.unit_set();
    let fitted = analysis.fitted(&bones, &weights, units);
    let poses = |shapes: &[(usize, Sides)]| {
        let mut mix = Mix::rest(units);
        for (unit, side) in shapes {
            if let Some(unit) = units.units().get(*unit) {
                mix.add(&unit.name, *side, 1.0, units);
            }
        }
        fitted.pose(&mix)
    };
    let open = units.arkit(OPEN);
    let still = STILL * analysis.landmarks.eye_distance();
    let has_tongue = bones.iter().any(|bone| bone.kind == FaceBoneKind::Tongue);
    let is_of_tongue = |unit: usize| units.units().get(unit).is_some_and(|unit| unit.is_of_tongue());
    let known = names.iter().filter(|(_, unit, _)| has_tongue || !is_of_tongue(*unit));
    let shapes = known.map(|(name, unit, side)| {
        let mut own = poses(&[(*unit, *side)]);
        if let Some(open) = open.filter(|_| name == CLOSE) {
            for ((own, both), open) in own.iter_mut().zip(poses(&[(*unit, *side), open])).zip(poses(&[open])) {
                *own = BonePose { translation: both.translation - open.translation, ..BonePose::REST };
            }
        }
        let mut offsets = vec![Vec3::ZERO; analysis.mesh_points];
        let moved = apply(&analysis.points, &weights, &bones, &own);
        for (point, (moved, rest)) in moved.iter().zip(&analysis.points).enumerate() {
            let offset = *moved - *rest;
            if let Some(slot) = offsets.get_mut(analysis.mesh_point(point)).filter(|_| offset.length() > still) {
                *slot = analysis.to_mesh() * offset;
            }
        }
        let offsets = (0..).zip(offsets).filter(|(_, offset)| *offset != Vec3::ZERO).collect();
        let posed = face.joint_poses(analysis, &own);
        let pose = face.bones.iter().zip(&posed).filter_map(|(bone, pose)| {
            let offset = Frame::of(rig, bone.uid, analysis).offset(pose);
            (!offset.is_rest(1e-7)).then_some((bone.uid, offset))
        });
        FaceShape { name: name.clone(), offsets, pose: pose.collect() }
    });
    Ok(shapes.collect())
}

fn strongest(weights: &Weights, most: usize) -> Weights {
    let mut kept = Weights::default();
    for point in 0..weights.len() {
        // Joints of the body stand side by side here, each with the head's number, as a file counts them.
        let mut influences: Vec<(u32, f32)> = weights.of(point).collect();
        keep_strongest(&mut influences, most, 0.0);
        kept.push(influences);
    }
    kept
}
