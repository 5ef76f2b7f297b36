//! Fit of a face's bones to given shapes.

use glam::Vec3;

use super::{AutoFace, FaceAnalysis, FaceError, FaceProgress, FaceStep, begin, within};
use crate::{
    algo::{
        face::expression::BonePose,
        fit::{BoneMove, FitError, FitSettings, fit},
    },
    mesh::model::Weights,
};

/// A face whose bones were moved to fit shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceFit {
    /// The face.
    pub face: AutoFace,
    /// Poses of all bones for each shape, in head space.
    pub poses: Vec<Vec<BonePose>>,
    /// Root mean square error over points and shapes, in the mesh's unit.
    pub error: f32,
}

impl FaceAnalysis {
    /// Moves the bones of a face and recomputes the weights, so that the bones can show given shapes.
    ///
    /// `shapes` are displacements, one a point of the *mesh*, in the mesh's space and unit; `locked` marks bones that
    /// must stay; no point is moved by more than `influences` joints (1 to 8). Returns the face, the poses of its bones in
    /// each shape (head space), and the root mean square error over points and shapes. About two seconds for 57 shapes of
    /// 11,000 points and 40 bones.
    ///
    /// # Errors
    /// [`FaceError::Fit`], or cancelled.
    pub fn refit(
        &self,
        face: &AutoFace,
        shapes: &[Vec<Vec3>],
        locked: &[bool],
        influences: usize,
        progress: FaceProgress,
    ) -> Result<FaceFit, FaceError> {
        begin(progress, FaceStep::Fit)?;
        let turn = self.axes.rotation();
        let own = |shape: &Vec<Vec3>| -> Vec<Vec3> {
            let moved = |point| shape.get(self.mesh_point(point)).map_or(Vec3::ZERO, |moved| turn * *moved);
            (0..self.points.len()).map(moved).collect()
        };
        let wrong = shapes.iter().position(|shape| shape.len() != self.mesh_points);
        if let Some(shape) = wrong {
            let (has, points) = (shapes[shape].len(), self.mesh_points);
            return Err(FaceError::Fit(FitError::ShapeLength { shape, has, points }));
        }
        let shapes: Vec<Vec<Vec3>> = shapes.iter().map(own).collect();
        let start: Vec<Vec3> = face.bones.iter().map(|bone| bone.position).collect();
        let settings = FitSettings { bones: start.len(), influences, start: &start, locked, ..FitSettings::default() };
        let found = fit(&self.points, &self.triangles, &shapes, &settings, &within(progress, FaceStep::Fit))
            .map_err(|error| if error == FitError::Cancelled { FaceError::Cancelled } else { FaceError::Fit(error) })?;
        let mut face = face.clone();
        for (bone, position) in face.bones.iter_mut().zip(&found.positions) {
            bone.position = *position;
        }
        face.weights = self.with_neck(&found.weights, &face.weights, influences);
        let pose = |moved: &BoneMove| BonePose { translation: moved.translation, rotation: moved.rotation };
        let poses = found.moves.iter().map(|moves| moves.iter().map(pose).collect()).collect();
        Ok(FaceFit { face, poses, error: found.error })
    }

    /// Converts weights over the head (0) and bones (from 1) to weights over neck, head and bones: the neck keeps its
    /// former part of the head's share, where a point has room for both among its `influences`.
    fn with_neck(&self, fitted: &Weights, before: &Weights, influences: usize) -> Weights {
        let mut weights = Weights::default();
        for point in 0..fitted.len() {
            let share = |joint: u32| before.of(point).filter(|(j, _)| *j == joint).map(|(_, w)| w).sum::<f32>();
            let (neck, head) = (share(0), share(1));
            let of_neck = match fitted.of(point).count() < influences {
                true if neck > 0.0 => neck / (neck + head),
                _ => f32::from(u8::from(neck > head)),
            };
            let mut list: Vec<(u32, f32)> = Vec::new();
            for (joint, weight) in fitted.of(point) {
                match joint {
                    0 => list.extend([(0, weight * of_neck), (1, weight * (1.0 - of_neck))]),
                    bone => list.push((bone + 1, weight)),
                }
            }
            list.retain(|(_, weight)| *weight > 0.0);
            list.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            weights.push(list);
        }
        weights
    }
}
