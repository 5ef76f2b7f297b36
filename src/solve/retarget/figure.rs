//! Skeletons at rest: their joints, the directions in which they stand and face, and their sizes.

use bevy::math::{Mat3, Quat, Vec3};

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
    solve::rotate::{direction, perpendicular_or_any},
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
        Self::new(rig.walk().zip(&globals).map(joint).collect(), map.target.clone())
    }

    /// Skeleton of a motion; `None` if it has no size.
    pub fn of_motion(motion: &Motion, map: &JointMap) -> Option<Self> {
        let joint = |(joint, rest): (&crate::rig::animation::motion::MotionJoint, Trs)| FigureJoint {
            uid: Uid::default(),
            label: joint.name.clone(),
            parent: joint.parent,
            local: joint.rest,
            rest,
        };
        Self::new(motion.joints.iter().zip(motion.rest_globals()).map(joint).collect(), map.source.clone())
    }

    fn new(joints: Vec<FigureJoint>, bones: HumanJoints) -> Option<Self> {
        let mut figure = Self { joints, bones, axes: Quat::IDENTITY, height: 0.0, leg: 0.0 };
        figure.axes = figure.find_axes();
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

    /// Axes of a human by its limbs; those of the space for any other figure.
    fn find_axes(&self) -> Quat {
        let limb = |side, bone| self.place(HumanBone::Limb(side, bone));
        let middle = |bone| Some(limb(BodySide::Left, bone)?.midpoint(limb(BodySide::Right, bone)?));
        let top =
            self.place(HumanBone::Head).or_else(|| self.place(HumanBone::Neck)).or_else(|| middle(LimbBone::UpperArm));
        let top = top.or_else(|| self.place(HumanBone::Hips));
        let feet = middle(LimbBone::Foot).or_else(|| middle(LimbBone::LowerLeg));
        let across = |bone| Some(limb(BodySide::Left, bone)? - limb(BodySide::Right, bone)?);
        let left = across(LimbBone::UpperLeg).or_else(|| across(LimbBone::UpperArm));
        let (Some(top), Some(feet), Some(left)) = (top, feet, left) else { return Quat::IDENTITY };
        let Some(up) = direction(top - feet) else { return Quat::IDENTITY };
        // Grounds are level: a figure that leans stands along the nearest axis.
        let up = snapped(up, 0.8);
        let left = snapped(perpendicular_or_any(up, &[left]), 0.985);
        let left = perpendicular_or_any(up, &[left]);
        Quat::from_mat3(&Mat3::from_cols(left, up, left.cross(up))).normalize()
    }
}

/// The axis next to a direction, if the cosine between them is large enough.
fn snapped(direction: Vec3, least: f32) -> Vec3 {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    axes.into_iter().find(|axis| axis.dot(direction) >= least).unwrap_or(direction)
}
