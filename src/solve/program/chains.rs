//! Operations on chains of joints.

use glam::{Quat, Vec3};

use super::{
    op::Link,
    run::{Machine, Registers, Scratch, place, share},
};
use crate::{
    mesh::model::Trs,
    solve::{
        ccd::{CcdChain, CcdJoint, ccd},
        fabrik::{IterationSettings, fabrik, rotations_from_points},
        rotate::{about, direction},
        spline::{ArcTable, Spline, SplineIk, SplineKind},
        twist::twist_angle,
        two_bone::TwoBone,
        weights::{mix, relative},
    },
};

/// Two-bone inverse kinematics.
pub(super) fn two_bone<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.two_bones[at as usize];
    let before = op.links.map(|link| machine.x(link.input));
    let weight = share(machine.n(op.weight));
    if weight <= 0.0 {
        return op.links.iter().zip(before).for_each(|(link, local)| machine.put(link.out, local));
    }
    let parent = machine.x(op.parent);
    let root = place(&parent, &before[0]);
    let mid = place(&root, &before[1]);
    let end = place(&mid, &before[2]);
    let goal = machine.x(op.goal);
    let solution = TwoBone {
        root: root.translation,
        mid: mid.translation,
        end: end.translation,
        root_rotation: root.rotation,
        mid_rotation: mid.rotation,
        goal: goal.translation,
        pole: op.pole.map(|pole| machine.x(pole).translation),
        preferred: root.rotation * op.prefer,
        soft: machine.n(op.soft),
        stretch: machine.n(op.stretch),
        max_stretch: op.max_stretch,
        pin: machine.n(op.pin),
    }
    .solve();
    let twist = machine.n(op.twist);
    let (mut upper, mut lower) = (solution.root_rotation, solution.mid_rotation);
    if twist != 0.0
        && twist.is_finite()
        && let Some(line) = direction(solution.end - root.translation)
    {
        let turn = about(line, twist.to_radians());
        (upper, lower) = (turn * upper, turn * lower);
    }
    let mut after = before;
    after[0].rotation = (parent.rotation.conjugate() * upper).normalize();
    after[1].rotation = (upper.conjugate() * lower).normalize();
    // Bones keep their direction in the joint above, whatever its scale.
    after[1].translation = before[1].translation * solution.lengths[0];
    after[2].translation = before[2].translation * solution.lengths[1];
    if let Some(offset) = op.orient_end {
        after[2].rotation = (lower.conjugate() * (goal.rotation * offset)).normalize();
    }
    for ((link, before), after) in op.links.iter().zip(before).zip(after) {
        machine.put(link.out, mix(&before, &after, weight));
    }
}

/// Writes the current rig transforms of a chain's joints into the scratch memory.
fn pose<R: Registers>(machine: &mut Machine<'_, R>, parent: Trs, links: &[Link]) {
    let Scratch { globals, points, rotations, .. } = &mut *machine.scratch;
    globals.clear();
    let mut above = parent;
    for link in links {
        above = place(&above, &machine.registers.x(link.input));
        globals.push(above);
    }
    points.clear();
    points.extend(globals.iter().map(|global| global.translation));
    rotations.clear();
    rotations.extend(globals.iter().map(|global| global.rotation));
}

/// Writes the lengths of the bones between points into the scratch memory; returns their sum.
fn measure(scratch: &mut Scratch) -> f32 {
    scratch.lengths.clear();
    scratch.lengths.extend(scratch.points.windows(2).map(|pair| pair[0].distance(pair[1])));
    scratch.lengths.iter().sum()
}

/// Inverse kinematics of a chain of any length.
pub(super) fn chain<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let tables = machine.tables;
    let op = &tables.chains[at as usize];
    let links = &tables.links[op.links.range()];
    let weight = share(machine.n(op.weight));
    if weight <= 0.0 {
        return copy(machine, links);
    }
    let (parent, goal) = (machine.x(op.parent), machine.x(op.goal));
    let pole = op.pole.map(|pole| machine.x(pole).translation);
    pose(machine, parent, links);
    let total = measure(machine.scratch);
    let root = machine.scratch.points[0];
    let settings = IterationSettings {
        tolerance: op.tolerance * total,
        iterations: op.iterations,
        bend: pole.map_or(Vec3::ZERO, |pole| pole - root),
    };
    if let Some(limits) = &op.limits {
        // The solver knows no scale, so bones are scaled by the joint above.
        let mut above = parent.scale;
        machine.scratch.joints.clear();
        machine.scratch.rotations.clear();
        for (at, link) in links.iter().enumerate() {
            let local = machine.x(link.input);
            let offset = above * local.translation;
            above *= local.scale;
            let rest = tables.bases[link.base as usize].rotation;
            let limit = limits.get(at).copied().unwrap_or_default();
            machine.scratch.joints.push(CcdJoint { offset, rest, limit });
            machine.scratch.rotations.push(local.rotation);
        }
        let last = links.len() - 1;
        let Scratch { joints, rotations, posed, .. } = &mut *machine.scratch;
        posed.clear();
        posed.resize(last, (Vec3::ZERO, Quat::IDENTITY));
        let end = joints[last].offset;
        let chain = CcdChain { joints: &joints[..last], end, position: parent.translation, rotation: parent.rotation };
        ccd(&chain, goal.translation, &settings, &mut rotations[..last], posed);
        // Rotations relative to the joint above become rotations in the rig.
        let mut above = parent.rotation;
        for rotation in rotations.iter_mut() {
            above = (above * *rotation).normalize();
            *rotation = above;
        }
    } else {
        let Scratch { points, before, lengths, rotations, .. } = &mut *machine.scratch;
        before.clear();
        before.extend_from_slice(points);
        fabrik(points, lengths, goal.translation, &settings);
        rotations_from_points(before, points, rotations);
    }
    if let Some(offset) = op.orient_end
        && let Some(last) = machine.scratch.rotations.last_mut()
    {
        *last = goal.rotation * offset;
    }
    let mut above = parent.rotation;
    for (at, link) in links.iter().enumerate() {
        let before = machine.x(link.input);
        let rotation = machine.scratch.rotations[at];
        let after = Trs { rotation: (above.conjugate() * rotation).normalize(), ..before };
        above = rotation;
        machine.put(link.out, mix(&before, &after, weight));
    }
}

/// A chain along a curve.
pub(super) fn spline<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let tables = machine.tables;
    let op = &tables.splines[at as usize];
    let links = &tables.links[op.links.range()];
    let registers = &tables.points[op.points.range()];
    let weight = share(machine.n(op.weight));
    let (true, [first, .., last]) = (weight > 0.0, registers) else { return copy(machine, links) };
    let (first, last) = (machine.x(*first).rotation, machine.x(*last).rotation);
    let parent = machine.x(op.parent);
    pose(machine, parent, links);
    measure(machine.scratch);
    machine.scratch.controls.clear();
    for point in registers {
        let point = machine.x(*point).translation;
        machine.scratch.controls.push(point);
    }
    // Twist of the last point since it was built, relative to the first one.
    let turned = (first * op.ends[0].conjugate()).conjugate() * (last * op.ends[1].conjugate());
    let twist = machine.n(op.twist).to_radians() + twist_angle(turned, op.along);
    let solver = SplineIk { twist_end: twist, ..frames(machine.n(op.stretch), first * op.up) };
    let Scratch { points, controls, lengths, rotations, .. } = &mut *machine.scratch;
    let curve = Spline { kind: SplineKind::Through, points: controls };
    solver.solve(&curve, &ArcTable::new(&curve), lengths, points, rotations);
    let mut above = parent;
    for (at, link) in links.iter().enumerate() {
        let before = machine.x(link.input);
        let rotation = machine.scratch.rotations[at] * op.corrections[at];
        let global = Trs { translation: machine.scratch.points[at], rotation, scale: above.scale * before.scale };
        let after = Trs { scale: before.scale, ..relative(&above, &global) };
        above = global;
        machine.put(link.out, mix(&before, &after, weight));
    }
}

/// The solver that gives frames along a curve: Y along it, Z up.
pub(super) fn frames(stretch: f32, up: Vec3) -> SplineIk {
    SplineIk { stretch, start: 0.0, up, twist_start: 0.0, twist_end: 0.0, axis: Vec3::Y, up_axis: Vec3::Z }
}

/// Leaves a chain in its pose.
fn copy<R: Registers>(machine: &mut Machine<'_, R>, links: &[Link]) {
    for link in links {
        let local = machine.x(link.input);
        machine.put(link.out, local);
    }
}
