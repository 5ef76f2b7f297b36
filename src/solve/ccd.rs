//! Cyclic coordinate descent: chains whose joints have limits.
//!
//! Wang and Chen, "A combined optimization method for solving the inverse kinematics problems of mechanical
//! manipulators", IEEE Transactions on Robotics and Automation 7(4), 1991: from the tip to the root, each joint turns
//! so that the end comes as near to the goal as that joint alone can bring it. Limits are applied after each turn.

use bevy::math::{Quat, Vec3};

use crate::solve::{
    fabrik::{IterationResult, IterationSettings},
    limit::JointLimit,
    rotate::{about, arc, direction, perpendicular_or_any, unit},
};

/// A joint of a chain, relative to the joint above it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CcdJoint {
    /// Position in the space of the joint above (for the first joint: of the chain's parent).
    pub offset: Vec3,
    /// Rotation at rest, from which limits count, a unit quaternion.
    pub rest: Quat,
    /// Limit of the rotation.
    pub limit: JointLimit,
}

/// Input of [`ccd`]: a chain and the space that it hangs in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CcdChain<'a> {
    /// Joints from root to tip.
    pub joints: &'a [CcdJoint],
    /// Position of the end in the space of the last joint.
    pub end: Vec3,
    /// Position of the parent space of the first joint, in the rig's space.
    pub position: Vec3,
    /// Rotation of the parent space of the first joint, in the rig's space.
    pub rotation: Quat,
}

/// First turn of a chain that is straight and in line with its goal, in radians.
const NUDGE: f32 = 0.1;

/// Turns the joints of a chain so that its end is on `goal` (rig space), or as near as limits allow.
///
/// `rotations` holds the joints' rotations relative to the joint above, and then the solved ones, always within the
/// limits. `posed` receives position and rotation of each joint in the rig's space; both are as long as the chain
/// (extra entries are left alone; a shorter list shortens the chain). `O(joints)` a pass. A goal that is not finite
/// leaves the rotations unchanged but for their limits.
pub fn ccd(
    chain: &CcdChain,
    goal: Vec3,
    settings: &IterationSettings,
    rotations: &mut [Quat],
    posed: &mut [(Vec3, Quat)],
) -> IterationResult {
    let count = chain.joints.len().min(rotations.len()).min(posed.len());
    let (joints, rotations, posed) = (&chain.joints[..count], &mut rotations[..count], &mut posed[..count]);
    for (rotation, joint) in rotations.iter_mut().zip(joints) {
        *rotation = limited(joint, *rotation);
    }
    let mut end = pose(chain, joints, rotations, posed);
    if count == 0 || !(goal.is_finite() && end.is_finite()) {
        return IterationResult::default();
    }
    let mut iterations = 0;
    if end.distance(goal) > settings.tolerance && in_line(posed, end, goal) {
        let line = direction(end - posed[0].0).or_else(|| direction(goal - posed[0].0)).unwrap_or(Vec3::X);
        let axis = line.cross(perpendicular_or_any(line, &[settings.bend]));
        for i in 0..count {
            // The first joint turns towards the bend and all others back.
            let angle = if i == 0 { NUDGE } else { -NUDGE };
            turn(chain, joints, rotations, posed, i, about(axis, angle));
        }
        end = pose(chain, joints, rotations, posed);
    }
    while iterations < settings.iterations && end.distance(goal) > settings.tolerance {
        for i in (0..count).rev() {
            let (position, _) = posed[i];
            let ends = direction(end - position).zip(direction(goal - position));
            let Some((from, to)) = ends else { continue };
            let turned = turn(chain, joints, rotations, posed, i, arc(from, to, settings.bend));
            end = position + turned * (end - position);
        }
        end = pose(chain, joints, rotations, posed);
        iterations += 1;
    }
    IterationResult { iterations, distance: end.distance(goal) }
}

/// The nearest local rotation that the joint's limit allows.
fn limited(joint: &CcdJoint, rotation: Quat) -> Quat {
    if joint.limit == JointLimit::Free {
        return unit(rotation);
    }
    let rest = unit(joint.rest);
    (rest * joint.limit.clamp(rest.conjugate() * rotation)).normalize()
}

/// Rotation of the space that joint `i` is relative to, in the rig's space.
fn above(chain: &CcdChain, posed: &[(Vec3, Quat)], i: usize) -> Quat {
    if i == 0 { unit(chain.rotation) } else { posed[i - 1].1 }
}

/// Turns joint `i` towards `by` (rig space) as far as its limit allows; returns the turn that it made. Joints below
/// keep their old poses.
fn turn(
    chain: &CcdChain,
    joints: &[CcdJoint],
    rotations: &mut [Quat],
    posed: &mut [(Vec3, Quat)],
    i: usize,
    by: Quat,
) -> Quat {
    let above = above(chain, posed, i);
    let before = posed[i].1;
    rotations[i] = limited(&joints[i], above.conjugate() * (by * before));
    posed[i].1 = (above * rotations[i]).normalize();
    (posed[i].1 * before.conjugate()).normalize()
}

/// Poses all joints; returns the position of the end.
fn pose(chain: &CcdChain, joints: &[CcdJoint], rotations: &[Quat], posed: &mut [(Vec3, Quat)]) -> Vec3 {
    let (mut position, mut rotation) = (chain.position, unit(chain.rotation));
    for (i, joint) in joints.iter().enumerate() {
        position += rotation * joint.offset;
        rotation = (rotation * rotations[i]).normalize();
        posed[i] = (position, rotation);
    }
    position + rotation * chain.end
}

/// Returns `true` if the joints and the end lie on the line from the first joint to `goal`.
fn in_line(posed: &[(Vec3, Quat)], end: Vec3, goal: Vec3) -> bool {
    let root = posed[0].0;
    let points = || posed.iter().map(|(position, _)| *position).chain([end, goal]);
    let furthest = points().max_by(|a, b| a.distance_squared(root).total_cmp(&b.distance_squared(root)));
    let line = furthest.and_then(|point| Some((direction(point - root)?, point.distance(root))));
    line.is_none_or(|(line, size)| {
        points().all(|point| {
            let v = point - root;
            (v - line * v.dot(line)).length() <= 1e-3 * size
        })
    })
}
