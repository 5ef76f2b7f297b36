//! Skeletons at rest: their joints, the directions in which they stand and face, and their sizes.

use bevy::math::{Quat, Vec3};

use crate::{
    mesh::model::Trs,
    rig::{
        Rig, Uid,
        animation::{
            humanoid::{BodySide, HumanBone, HumanJoints, LimbBone},
            joint_map::JointMap,
            motion::Motion,
        },
    },
    solve::{human_axes::human_axes, rotate::direction},
};

/// Joint of a skeleton.
#[derive(Debug, Clone)]
pub(super) struct FigureJoint {
    pub uid: Uid,
    pub label: String,
    pub parent: Option<usize>,
    /// Transform at rest relative to the parent.
    pub local: Trs,
    /// Transform at rest in the skeleton's space.
    pub rest: Trs,
}

/// Skeleton at rest.
#[derive(Debug, Clone)]
pub(super) struct Figure {
    pub joints: Vec<FigureJoint>,
    pub bones: HumanJoints,
    /// Rotation from axes in which left is X, up is Y and forward is Z.
    pub axes: Quat,
    /// Height of the joints at rest.
    pub height: f32,
    /// Length of a leg from hip to ankle; the height for figures without legs.
    pub leg: f32,
}

impl Figure {
    /// Skeleton of a rig; `None` if it has no size.
    pub fn of_rig(rig: &Rig, map: &JointMap) -> Option<Self> {
        let globals = rig.rest_globals();
        let places: std::collections::BTreeMap<Uid, usize> =
            globals.iter().enumerate().map(|(at, (uid, _))| (*uid, at)).collect();
        let joint = |(joint, (uid, global)): (&crate::rig::RigJoint, &(Uid, glam::Affine3))| {
            let (scale, rotation, translation) = global.to_scale_rotation_translation();
            FigureJoint {
                uid: *uid,
                label: joint.data.label.clone().unwrap_or_else(|| uid.to_string()),
                parent: joint.parent.and_then(|parent| places.get(&parent).copied()),
                local: joint.data.rest.into(),
                rest: Trs { translation, rotation: rotation.normalize(), scale },
            }
        };
        let axes = map.axes.map(|[_, target]| target);
        Self::new(rig.walk().zip(&globals).map(joint).collect(), map.target.clone(), axes)
    }

    /// Skeleton of a motion; `None` if it has no size. It stands as at rest or, where that is more like the figure
    /// `beside` it, in the pose in which its mesh was bound: files may rest in any pose.
    pub fn of_motion(motion: &Motion, map: &JointMap, beside: &Self) -> Option<Self> {
        let rest = Self::of_places(motion, map, motion.rest_globals());
        if motion.bind_pose.len() != motion.joints.len() {
            return rest;
        }
        let bound = Self::of_places(motion, map, motion.bind_pose.clone());
        match (rest, bound) {
            (Some(rest), Some(bound)) if bound.likeness(beside) <= rest.likeness(beside) => Some(rest),
            (rest, None) => rest,
            (_, bound) => bound,
        }
    }

    /// Skeleton of a motion whose joints stand at places.
    fn of_places(motion: &Motion, map: &JointMap, places: Vec<Trs>) -> Option<Self> {
        let joint = |(joint, rest): (&crate::rig::animation::motion::MotionJoint, Trs)| FigureJoint {
            uid: Uid::default(),
            label: joint.name.clone(),
            parent: joint.parent,
            local: joint.rest,
            rest,
        };
        let axes = map.axes.map(|[source, _]| source);
        Self::new(motion.joints.iter().zip(places).map(joint).collect(), map.source.clone(), axes)
    }

    fn new(joints: Vec<FigureJoint>, bones: HumanJoints, axes: Option<Quat>) -> Option<Self> {
        let mut figure = Self { joints, bones, axes: Quat::IDENTITY, height: 0.0, leg: 0.0 };
        let place = |joint: usize| figure.joints[joint].rest.translation;
        figure.axes = axes.or_else(|| human_axes(&figure.bones, &place)).unwrap_or_default();
        let up = figure.axes * Vec3::Y;
        let heights = || figure.joints.iter().map(|joint| joint.rest.translation.dot(up));
        let (low, high) = (heights().fold(f32::MAX, f32::min), heights().fold(f32::MIN, f32::max));
        figure.height = high - low;
        if figure.height <= f32::MIN_POSITIVE || !figure.height.is_finite() {
            return None;
        }
        let legs: Vec<f32> = BodySide::BOTH.into_iter().filter_map(|side| figure.leg_length(side)).collect();
        figure.leg = if legs.is_empty() { figure.height } else { legs.iter().sum::<f32>() / legs.len() as f32 };
        (figure.leg > 0.0).then_some(figure)
    }

    /// Sum of the cosines between the directions of the trunk and of the limbs' bones of both figures.
    fn likeness(&self, other: &Self) -> f32 {
        let way = |figure: &Self, [from, to]: [HumanBone; 2]| {
            let way = figure.place(to)? - figure.place(from)?;
            direction(figure.axes.inverse() * way)
        };
        let limbs = BodySide::BOTH.into_iter().flat_map(|side| {
            let of = |bone: LimbBone| HumanBone::Limb(side, bone);
            let arm = [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand].map(of);
            let leg = [LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot].map(of);
            [[arm[0], arm[1]], [arm[1], arm[2]], [leg[0], leg[1]], [leg[1], leg[2]]]
        });
        let bones = limbs.chain([[HumanBone::Hips, HumanBone::Head]]);
        bones.filter_map(|bone| Some(way(self, bone)?.dot(way(other, bone)?))).sum()
    }

    /// First joint of a bone.
    pub fn first(&self, bone: HumanBone) -> Option<usize> {
        self.bones.get(&bone)?.first().copied()
    }

    /// First joint of a bone of a limb.
    pub fn limb(&self, side: BodySide, bone: LimbBone) -> Option<usize> {
        self.first(HumanBone::Limb(side, bone))
    }

    /// Position of a bone at rest.
    fn place(&self, bone: HumanBone) -> Option<Vec3> {
        self.first(bone).map(|joint| self.joints[joint].rest.translation)
    }

    fn leg_length(&self, side: BodySide) -> Option<f32> {
        let [hip, knee, ankle] = [LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot]
            .map(|bone| self.place(HumanBone::Limb(side, bone)));
        Some(hip?.distance(knee?) + knee?.distance(ankle?))
    }
}
