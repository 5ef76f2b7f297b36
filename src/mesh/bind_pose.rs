//! Poses in which meshes were bound to their joints.
//!
//! Files may hold their nodes in any pose, that of the frame at which they were saved for example. The inverse bind
//! matrices of a skin give the pose in which its mesh was bound, in the mesh's space: that may have other axes and
//! units than the space of the nodes.

use glam::{Mat3, Mat4, Quat, Vec3};

use super::model::{Model, SkinBinding, Trs};

/// Least mean of the squares of the cosines of half the angles between joints of both poses; below, the axes of the
/// mesh's space are unknown.
const LEAST_ALIKE: f32 = 0.65;
/// Cosine of half the angle by which joints of the same rotation differ at most: two degrees.
const SAME: f32 = 0.99985;

/// Joint in both poses.
struct BoundJoint {
    node: usize,
    /// Transform in the mesh's space when it was bound.
    bind: Trs,
    /// Transform in model space at rest.
    rest: Trs,
    /// Count of the nodes that it carries, and itself.
    count: f32,
}

impl Model {
    /// Transforms of all nodes to model space in the pose in which the mesh of the largest skin was bound. Other nodes
    /// are below their parents as at rest. `None` without a skin, where all of its joints are turned as at rest, and
    /// where its matrices tell no pose.
    pub fn bind_pose(&self) -> Option<Vec<Trs>> {
        let skin = self.skins.iter().max_by_key(|skin| skin.joints.len())?;
        let joints = self.bound_joints(skin);
        let turn = turn_to_nodes(&joints)?;
        if joints.iter().all(|joint| (turn * joint.bind.rotation).dot(joint.rest.rotation).abs() >= SAME) {
            return None;
        }
        let mut bound: Vec<Option<&BoundJoint>> = vec![None; self.nodes.len()];
        joints.iter().for_each(|joint| bound[joint.node] = Some(joint));
        let scale = self.scale_to_nodes(&bound)?;
        let root = joints.iter().max_by(|a, b| a.count.total_cmp(&b.count))?;
        let shift = root.rest.translation - turn * (root.bind.translation * scale);
        let mut pose: Vec<Trs> = Vec::with_capacity(self.nodes.len());
        for (node, joint) in self.nodes.iter().zip(&bound) {
            let place = match joint {
                Some(BoundJoint { bind, rest, .. }) => Trs {
                    translation: turn * (bind.translation * scale) + shift,
                    rotation: (turn * bind.rotation).normalize(),
                    scale: rest.scale,
                },
                None => node.parent.map_or(node.rest, |parent| pose[parent] * node.rest),
            };
            pose.push(place);
        }
        Some(pose)
    }

    /// Joints of a skin whose matrices have an inverse.
    fn bound_joints(&self, skin: &SkinBinding) -> Vec<BoundJoint> {
        let mut rest: Vec<Trs> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            rest.push(node.parent.map_or(node.rest, |parent| rest[parent] * node.rest));
        }
        let mut counts = vec![1.0_f32; self.nodes.len()];
        for (at, node) in self.nodes.iter().enumerate().rev() {
            let own = counts[at];
            if let Some(parent) = node.parent {
                counts[parent] += own;
            }
        }
        let bound = |(&node, inverse_bind): (&usize, &Mat4)| {
            let determinant = inverse_bind.determinant();
            if !determinant.is_finite() || determinant.abs() <= f32::MIN_POSITIVE {
                return None;
            }
            let (scale, rotation, translation) = inverse_bind.inverse().to_scale_rotation_translation();
            let is_usable = rotation.is_finite() && rotation.length_squared() > 0.5 && translation.is_finite();
            let bind = Trs { translation, rotation, scale };
            let rest = *rest.get(node)?;
            is_usable.then_some(BoundJoint { node, bind, rest, count: counts[node] })
        };
        skin.joints.iter().zip(&skin.inverse_binds).filter_map(bound).collect()
    }

    /// Units of the nodes' space in one of the mesh's space, by the lengths of bones; `None` without any.
    fn scale_to_nodes(&self, bound: &[Option<&BoundJoint>]) -> Option<f32> {
        let (mut of_bind, mut of_rest) = (0.0, 0.0);
        for (node, joint) in self.nodes.iter().zip(bound) {
            let (Some(joint), Some(Some(parent))) = (joint, node.parent.map(|parent| bound[parent])) else { continue };
            of_bind += joint.bind.translation.distance(parent.bind.translation);
            of_rest += joint.rest.translation.distance(parent.rest.translation);
        }
        let scale: f32 = of_rest / of_bind;
        (scale.is_finite() && scale > 0.0).then_some(scale)
    }
}

/// Rotation from the mesh's space to that of the nodes: the one between axes with which the joints of both poses are
/// turned most alike. Joints count by what they carry. `None` if they are alike with none.
fn turn_to_nodes(joints: &[BoundJoint]) -> Option<Quat> {
    let whole: f32 = joints.iter().map(|joint| joint.count).sum();
    let mut best = (0.0, Quat::IDENTITY);
    for turn in axis_turns() {
        let alike = |joint: &BoundJoint| {
            let cosine = (turn * joint.bind.rotation).dot(joint.rest.rotation);
            joint.count * cosine * cosine
        };
        let sum: f32 = joints.iter().map(alike).sum();
        if sum > best.0 {
            best = (sum, turn);
        }
    }
    (whole > 0.0 && best.0 >= LEAST_ALIKE * whole).then_some(best.1)
}

/// Rotations that bring axes onto axes, 24 of them; the first one is none.
fn axis_turns() -> impl Iterator<Item = Quat> {
    const AXES: [Vec3; 6] = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let pairs = AXES.into_iter().flat_map(|x| AXES.into_iter().map(move |y| (x, y)));
    let is_upright = |(x, y): &(Vec3, Vec3)| x.dot(*y) == 0.0;
    pairs.filter(is_upright).map(|(x, y)| Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y))))
}
