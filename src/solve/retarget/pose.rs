//! Poses of the target, frame by frame, of the joints that anything asks for.

use std::ops::Index;

use super::figure::Figure;
use crate::mesh::model::Trs;

/// Transforms of joints in the rig's space at a frame. A rig may have thousands of joints that a motion does not move, and that
/// no contact reads: of these a pose gives the transform at rest.
#[derive(Debug, Clone)]
pub(super) struct Pose<'b> {
    figure: &'b Figure,
    /// Joints with transforms of their own, in their order.
    joints: &'b [usize],
    transforms: Box<[Trs]>,
}

impl<'b> Pose<'b> {
    /// Pose of the `joints`, which are sorted; `globals` are the transforms of all joints of the figure.
    pub fn new(figure: &'b Figure, joints: &'b [usize], globals: &[Trs]) -> Self {
        Self { figure, joints, transforms: joints.iter().map(|joint| globals[*joint]).collect() }
    }
}

impl Index<usize> for Pose<'_> {
    type Output = Trs;

    fn index(&self, joint: usize) -> &Trs {
        match self.joints.binary_search(&joint) {
            Ok(place) => &self.transforms[place],
            Err(_) => &self.figure.joints[joint].rest,
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Quat, Vec3};

    use super::{super::figure::FigureJoint, *};
    use crate::rig::{Uid, animation::humanoid::HumanJoints};

    #[test]
    fn poses_hold_the_joints_that_are_asked_for() {
        let at = |x: f32| Trs { translation: Vec3::new(x, 0.0, 0.0), ..Trs::default() };
        let joint = |number: usize| FigureJoint {
            uid: Uid(number as u64),
            label: String::new(),
            parent: number.checked_sub(1),
            local: at(1.0),
            rest: at(number as f32),
        };
        let figure = Figure {
            joints: (0..1000).map(joint).collect(),
            bones: HumanJoints::new(),
            axes: Quat::IDENTITY,
            height: 1.0,
            leg: 1.0,
        };
        let globals: Vec<Trs> = (0..1000).map(|number| at(-(number as f32))).collect();
        let pose = Pose::new(&figure, &[3, 500], &globals);
        assert_eq!(pose.transforms.len(), 2);
        assert_eq!([3, 4, 500, 999].map(|joint| pose[joint].translation.x), [-3.0, 4.0, -500.0, 999.0]);
    }
}
