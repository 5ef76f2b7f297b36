//! Operations that read numbers from transforms, and those that put a node onto a curve or a triangle.

use super::run::{Machine, Registers, beside, place, share};
use crate::{
    mesh::model::Trs,
    solve::{
        aim::Up,
        rivet::triangle_frame,
        spline::{ArcTable, Spline, SplineKind},
        weights::mix,
    },
};

/// Nearness of a direction to the middle of a cone.
pub(super) fn cone<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.cones[at as usize];
    let looks = machine.x(op.source).rotation * op.axis;
    let towards = machine.x(op.reference).rotation * op.towards;
    machine.put_n(op.out, op.cone.read(towards, looks));
}

/// Nearness of a rotation to each of some poses.
pub(super) fn poses<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let tables = machine.tables;
    let op = &tables.readers[at as usize];
    let rotation = machine.x(op.reference).rotation.conjugate() * machine.x(op.source).rotation;
    for (pose, out) in op.outs.iter().copied().enumerate() {
        let value = op.reader.read(pose, rotation);
        machine.put_n(out, value);
    }
}

/// Distance that a node has gone along a direction.
pub(super) fn travel<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.travels[at as usize];
    let (source, reference) = (machine.x(op.source), machine.x(op.reference));
    let local = beside(&reference, &Trs { translation: source.translation, ..Trs::IDENTITY });
    let way = local.translation.dot(op.axis) - op.rest;
    machine.put_n(op.out, if way.is_finite() { way * op.factor } else { 0.0 });
}

/// Puts a node onto a curve.
pub(super) fn path<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let tables = machine.tables;
    let op = &tables.paths[at as usize];
    let input = machine.x(op.input);
    let weight = share(machine.n(op.weight));
    if weight <= 0.0 {
        return machine.put(op.out, input);
    }
    machine.scratch.controls.clear();
    for point in &tables.points[op.points.range()] {
        let point = machine.x(*point).translation;
        machine.scratch.controls.push(point);
    }
    let curve = Spline { kind: SplineKind::Through, points: &machine.scratch.controls };
    let table = ArcTable::new(&curve);
    let along = table.length() * share(machine.n(op.share));
    let translation = table.point(&curve, along);
    let tangent = curve.tangent(table.parameter(along));
    let parent = machine.x(op.parent);
    let now = place(&parent, &input);
    let rotation = match &op.aim {
        Some(aim) => aim.solve(translation, translation + tangent, Up::Vector(op.up), now.rotation),
        None => now.rotation,
    };
    let local = beside(&parent, &Trs { translation, rotation, scale: now.scale });
    machine.put(op.out, mix(&input, &Trs { scale: input.scale, ..local }, weight));
}

/// Puts a node onto a triangle.
pub(super) fn rivet<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.rivets[at as usize];
    let input = machine.x(op.input);
    let weight = share(machine.n(op.weight));
    let corners = op.corners.map(|corner| machine.x(corner).translation);
    let Some((translation, rotation)) = triangle_frame(corners, op.shares).filter(|_| weight > 0.0) else {
        return machine.put(op.out, input);
    };
    let frame = Trs { translation, rotation, ..Trs::IDENTITY };
    let local = beside(&machine.x(op.parent), &place(&frame, &op.offset));
    machine.put(op.out, mix(&input, &Trs { scale: input.scale, ..local }, weight));
}
