//! Bones of a rig in any of its poses, as lines: for small pictures and for ghosts.

use std::collections::HashMap;

use bevy::{math::Affine3A, prelude::*};

use crate::{
    plugins::runtime::RigRuntime,
    rig::{NodeType, Rig, Uid, operations::WholePose},
    solve::program::RigState,
};

/// Bones in a pose, in the rig's space: from each joint to its parent. A joint without bones is a line without length.
pub(super) fn bones(rig: &Rig, runtime: Option<&RigRuntime>, pose: &WholePose) -> Vec<[Vec3; 2]> {
    match runtime {
        Some(runtime) => of_program(runtime.state(), pose),
        None => of_document(rig, pose),
    }
}

fn of_document(rig: &Rig, pose: &WholePose) -> Vec<[Vec3; 2]> {
    let mut globals: HashMap<Uid, Affine3A> = HashMap::with_capacity(rig.len());
    let mut lines = Vec::with_capacity(rig.len());
    for joint in rig.walk() {
        let uid = joint.data.uid;
        let offset = pose.offsets.get(&uid).copied().unwrap_or_default();
        let above = joint.parent.and_then(|parent| globals.get(&parent)).copied();
        let global = above.unwrap_or(Affine3A::IDENTITY) * offset.on(&joint.data.rest).compute_affine();
        let place = Vec3::from(global.translation);
        lines.push([above.map_or(place, |above| above.translation.into()), place]);
        globals.insert(uid, global);
    }
    without_points(lines)
}

fn of_program(state: &RigState, pose: &WholePose) -> Vec<[Vec3; 2]> {
    let mut state = state.clone();
    let program = state.program().clone();
    for (slot, node) in program.nodes().iter().enumerate().filter(|(_, node)| node.is_posable()) {
        state.set_offset_at(slot, pose.offsets.get(&node.uid).copied().unwrap_or_default());
    }
    for (slot, attribute) in program.attributes().iter().enumerate() {
        let of = pose.values.get(&program.nodes()[attribute.node].uid);
        let value = of.and_then(|of| of.get(&*attribute.name)).copied().unwrap_or(attribute.default);
        state.set_attribute_at(slot, value);
    }
    state.evaluate(0.0);
    let nodes = program.nodes();
    let joints = nodes.iter().enumerate().filter(|(_, node)| node.kind == NodeType::Joint);
    let lines = joints.map(|(slot, node)| {
        let above = std::iter::successors(node.parent, |above| nodes[*above].parent);
        let parent = above.into_iter().find(|above| nodes[*above].kind == NodeType::Joint);
        let place = |slot: usize| state.global_at(slot).translation;
        [place(parent.unwrap_or(slot)), place(slot)]
    });
    without_points(lines.collect())
}

/// Lines with length, or all if none has.
fn without_points(lines: Vec<[Vec3; 2]>) -> Vec<[Vec3; 2]> {
    let long: Vec<[Vec3; 2]> = lines.iter().copied().filter(|[a, b]| a != b).collect();
    if long.is_empty() { lines } else { long }
}
