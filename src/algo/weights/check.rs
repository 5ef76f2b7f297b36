//! Validation of joints, meshes and settings before weights are computed.

use std::ops::Range;

use glam::Vec3;

use super::{Locks, TwistBone, WeightError, WeightJoint};

/// The first thing that is wrong.
pub(crate) fn input(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    joints: &[WeightJoint],
    rigid: &[(Range<u32>, u32)],
    locks: Option<&Locks>,
) -> Result<(), WeightError> {
    if joints.is_empty() {
        return Err(WeightError::NoJoints);
    }
    if points.len() >= u32::MAX as usize / 64 {
        return Err(WeightError::TooLarge);
    }
    if let Some(point) = points.iter().position(|p| !p.is_finite()) {
        return Err(WeightError::Point { point });
    }
    if let Some(joint) = joints.iter().position(|j| !j.head.is_finite() || j.tail.is_some_and(|t| !t.is_finite())) {
        return Err(WeightError::Joint { joint });
    }
    let is_broken = |twist: &TwistBone| {
        !twist.end.is_finite() || joints.get(twist.joint).is_none_or(|j| j.twist.is_some() || j.halves.is_some())
    };
    if let Some(joint) = joints.iter().position(|j| j.twist.as_ref().is_some_and(is_broken)) {
        return Err(WeightError::Twist { joint });
    }
    let is_half = |j: usize| joints.get(j).is_none_or(|j| j.twist.is_some() || j.halves.is_some());
    if let Some(joint) = joints.iter().position(|j| j.halves.is_some_and(is_half)) {
        return Err(WeightError::Half { joint });
    }
    if let Some(triangle) = triangles.iter().position(|t| t.iter().any(|&p| p as usize >= points.len())) {
        return Err(WeightError::Triangle { triangle });
    }
    if let Some(part) =
        rigid.iter().position(|(r, j)| r.start > r.end || r.end as usize > points.len() || *j as usize >= joints.len())
    {
        return Err(WeightError::Rigid { part });
    }
    if let Some(locks) = locks
        && (locks.weights.len() != points.len()
            || locks.joints.len() != joints.len()
            || locks.weights.joints.iter().any(|&j| j as usize >= joints.len()))
    {
        return Err(WeightError::Locks { points: locks.weights.len(), joints: locks.joints.len() });
    }
    match broken_parent(joints) {
        Some(joint) => Err(WeightError::Parent { joint }),
        None => Ok(()),
    }
}

/// The first joint that is to claim skin and does not exist.
pub(crate) fn claims(joints: &[WeightJoint], claims: &[usize]) -> Result<(), WeightError> {
    match claims.iter().find(|claim| **claim >= joints.len()) {
        Some(&joint) => Err(WeightError::Claim { joint, joints: joints.len() }),
        None => Ok(()),
    }
}

/// A joint whose parent does not exist or whose ancestors come back to itself.
fn broken_parent(joints: &[WeightJoint]) -> Option<usize> {
    // The walk in which each joint was reached first; meeting one's own walk again is a loop.
    let mut walk = vec![usize::MAX; joints.len()];
    for start in 0..joints.len() {
        let mut at = start;
        while walk[at] == usize::MAX {
            walk[at] = start;
            match joints[at].parent {
                None => break,
                Some(parent) if parent >= joints.len() => return Some(at),
                Some(parent) if walk[parent] == start => return Some(at),
                Some(parent) => at = parent,
            }
        }
    }
    None
}
