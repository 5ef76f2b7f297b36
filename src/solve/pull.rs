//! Pulling a joint: the joints above it turn so that it goes to a goal.
//!
//! A single bone aims, two bones are solved in closed form ([`TwoBone`]), longer chains by [`fabrik`]. A rig that is built is
//! pulled by its controls: see [`ControlPull`].

mod controls;

use bevy::math::{Quat, Vec3};

pub use controls::{ControlPull, PullError};

use super::{
    fabrik::{IterationSettings, fabrik},
    rotate::{arc, direction},
    two_bone::TwoBone,
};
use crate::rig::{Rig, Uid};

/// Length of a bone at the top of a chain, as a share of the next one, below which it is a collarbone and stays.
const COLLARBONE: f32 = 0.6;
/// Steps of a chain of more than two bones.
const STEPS: u32 = 48;

/// Rotations of the joints of a chain, in the rig's space and beyond their posed rotations, with which its end is at the
/// goal, or as near to it as bones reach. `points` are the posed positions of the joints from the top, and of the end.
pub fn pull(points: &[Vec3], goal: Vec3) -> Vec<Quat> {
    let turn = |from: Vec3, to: Vec3, hint: Vec3| match (direction(from), direction(to)) {
        (Some(from), Some(to)) => arc(from, to, hint),
        _ => Quat::IDENTITY,
    };
    match *points {
        [] | [_] => Vec::new(),
        [root, end] => vec![turn(end - root, goal - root, Vec3::ZERO)],
        [root, mid, end] => {
            let limb = TwoBone {
                root,
                mid,
                end,
                root_rotation: Quat::IDENTITY,
                mid_rotation: Quat::IDENTITY,
                goal,
                pole: None,
                preferred: Vec3::ZERO,
                soft: 0.0,
                stretch: 0.0,
                max_stretch: 1.0,
                pin: 0.0,
            };
            let solved = limb.solve();
            vec![solved.root_rotation, solved.mid_rotation]
        }
        _ => {
            let lengths: Vec<f32> = points.windows(2).map(|ends| ends[0].distance(ends[1])).collect();
            let total: f32 = lengths.iter().sum();
            let settings = IterationSettings { tolerance: 1e-5 * total, iterations: STEPS, ..Default::default() };
            let mut pulled = points.to_vec();
            fabrik(&mut pulled, &lengths, goal, &settings);
            let mut carried = Quat::IDENTITY;
            let bones = points.windows(2).zip(pulled.windows(2));
            bones
                .map(|(was, now)| {
                    carried = (turn(carried * (was[1] - was[0]), now[1] - now[0], Vec3::ZERO) * carried).normalize();
                    carried
                })
                .collect()
        }
    }
}

/// Joints that turn when a joint is pulled, from the top: those above it up to the next one from which several limbs go, but
/// for a collarbone. A joint right below such a one turns it alone; a root has none.
pub fn chain_above(rig: &Rig, joint: Uid) -> Vec<Uid> {
    let mut chain = limb_above(rig, joint);
    if let [first, second, ..] = chain[..] {
        let third = chain.get(2).copied().unwrap_or(joint);
        let length = |from: Uid, to: Uid| rig.position(from).distance(rig.position(to));
        if length(first, second) < COLLARBONE * length(second, third) {
            chain.remove(0);
        }
    }
    chain
}

/// True for a joint that goes on a limb: it is the only child of the joint above, or the only one that has children, as the
/// hand is beside a helper of the forearm. Such a joint is moved by joints above it, or its bone would become longer; bones of
/// a face, and the first joint of a limb, are not.
pub fn is_within_limb(rig: &Rig, joint: Uid) -> bool {
    let Some(above) = rig.joint(joint).and_then(|joint| joint.parent) else { return false };
    let has_children = |joint: Uid| !rig.children(Some(joint)).is_empty();
    let siblings = rig.children(Some(above));
    siblings.len() == 1 || has_children(joint) && siblings.iter().filter(|sibling| has_children(**sibling)).count() == 1
}

/// Joints above a joint up to the next one from which several limbs go, from the top.
fn limb_above(rig: &Rig, joint: Uid) -> Vec<Uid> {
    let has_children = |joint: &&Uid| !rig.children(Some(**joint)).is_empty();
    let is_branch = |joint: Uid| rig.children(Some(joint)).iter().filter(has_children).count() > 1;
    let mut chain = Vec::new();
    for above in rig.ancestors(joint).map(|above| above.data.uid) {
        if is_branch(above) {
            if chain.is_empty() {
                chain.push(above);
            }
            break;
        }
        chain.push(above);
    }
    chain.reverse();
    chain
}
