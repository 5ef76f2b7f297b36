//! Pose: the model's state and the places of its bones and points in it.

use glam::{Quat, Vec3};

use super::model::{BONE_COUNT, COMPONENTS, GROUPS, HumanModel};

/// Parameters of the model beside the turns of its bones: the variation of bodies, lengths and girths.
pub(super) const SHAPE: usize = COMPONENTS + 2 * GROUPS;

/// State of the model.
#[derive(Debug, Clone, PartialEq)]
pub(in super::super) struct State {
    pub(super) offset: Vec3,
    /// Logarithm of the scale.
    pub(super) scale: f32,
    /// Components, then the logarithms of the lengths and of the girths of groups.
    pub(super) shape: [f32; SHAPE],
    /// Turn of each bone against its parent.
    pub(super) turns: [Quat; BONE_COUNT],
}

/// The model in a state.
#[derive(Debug, Clone)]
pub(super) struct PosedModel {
    pub(super) joints: Vec<Vec3>,
    pub(super) points: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
}

impl State {
    /// The mean body at rest.
    pub(super) fn rest(rotation: Quat, scale: f32, offset: Vec3) -> Self {
        let mut turns = [Quat::IDENTITY; BONE_COUNT];
        turns[0] = rotation;
        Self { offset, scale: bevy::math::ops::ln(scale), shape: [0.0; SHAPE], turns }
    }

    /// Places of bones in this state with given turns in the space of the parent; also the stretches of bones.
    pub(super) fn skeleton(&self, model: &HumanModel) -> Skeleton {
        let scale = bevy::math::ops::exp(self.scale);
        let mut skeleton = Skeleton {
            joints: Vec::with_capacity(BONE_COUNT),
            frames: Vec::with_capacity(BONE_COUNT),
            rest: Vec::with_capacity(BONE_COUNT),
            length: [0.0; GROUPS],
            girth: [0.0; GROUPS],
        };
        for g in 0..GROUPS {
            skeleton.length[g] = scale * bevy::math::ops::exp(self.shape[COMPONENTS + g]);
            skeleton.girth[g] = scale * bevy::math::ops::exp(self.shape[COMPONENTS + GROUPS + g]);
        }
        for (i, bone) in model.bones.iter().enumerate() {
            let rest = self.vary(bone.mean, &bone.components);
            let (place, frame) = match bone.parent {
                None => (self.offset, self.turns[i]),
                Some(parent) => {
                    let away = skeleton.stretched(model, parent, rest - skeleton.rest[parent]);
                    (
                        skeleton.joints[parent] + skeleton.frames[parent] * away,
                        (skeleton.frames[parent] * self.turns[i]).normalize(),
                    )
                }
            };
            skeleton.rest.push(rest);
            skeleton.joints.push(place);
            skeleton.frames.push(frame);
        }
        skeleton
    }

    fn vary(&self, mean: Vec3, components: &[Vec3; COMPONENTS]) -> Vec3 {
        (0..COMPONENTS).fold(mean, |v, k| v + components[k] * self.shape[k])
    }

    /// Place of a point as each of its bones carries it.
    pub(super) fn carried(&self, model: &HumanModel, skeleton: &Skeleton, point: usize) -> [Vec3; 3] {
        let p = &model.points[point];
        let rest = self.vary(p.mean, &p.components);
        std::array::from_fn(|k| {
            let bone = p.bones[k];
            let away = skeleton.stretched(model, bone, rest - skeleton.rest[bone]);
            skeleton.joints[bone] + skeleton.frames[bone] * away
        })
    }

    pub(super) fn point(&self, model: &HumanModel, skeleton: &Skeleton, point: usize) -> Vec3 {
        let carried = self.carried(model, skeleton, point);
        (0..3).map(|k| carried[k] * model.points[point].weights[k]).sum()
    }

    /// The model in this state.
    pub(super) fn posed(&self, model: &HumanModel) -> PosedModel {
        let skeleton = self.skeleton(model);
        let points = (0..model.points.len()).map(|i| self.point(model, &skeleton, i)).collect();
        let normals = model
            .points
            .iter()
            .map(|p| {
                let sum: Vec3 = (0..3).map(|k| skeleton.frames[p.bones[k]] * p.normal * p.weights[k]).sum();
                sum.normalize_or_zero()
            })
            .collect();
        PosedModel { joints: skeleton.joints, points, normals }
    }
}

/// Bones in a state.
#[derive(Debug, Clone)]
pub(super) struct Skeleton {
    pub(super) joints: Vec<Vec3>,
    pub(super) frames: Vec<Quat>,
    pub(super) rest: Vec<Vec3>,
    length: [f32; GROUPS],
    girth: [f32; GROUPS],
}

impl Skeleton {
    fn stretched(&self, model: &HumanModel, bone: usize, v: Vec3) -> Vec3 {
        let bone = &model.bones[bone];
        let along = bone.axis * bone.axis.dot(v);
        along * self.length[bone.group] + (v - along) * self.girth[bone.group]
    }
}
