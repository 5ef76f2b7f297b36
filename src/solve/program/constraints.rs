//! Operations of constraints on one node.

use glam::{Quat, Vec3};

use super::{
    op::{SpringOp, TargetReg, UpReg},
    run::{Machine, Registers, beside, on, place, share},
    state::SpringState,
};
use crate::{
    mesh::model::Trs,
    solve::{
        aim::Up,
        collider::Capsule,
        rotate::{EulerOrder, arc, direction, slerp},
        spring::{PointSpring, Spring},
        weights::{blend, blend_points, relative},
    },
};

/// Follows weighted targets.
pub(super) fn transform<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.transforms[at as usize];
    let input = machine.x(op.input);
    let weight = share(machine.n(op.weight));
    let goal = if weight > 0.0 { followed(machine, &machine.tables.targets[op.targets.range()]) } else { None };
    if op.is_global {
        let global = match goal {
            Some(goal) if op.scale[0] => goal,
            Some(goal) => Trs { scale: machine.x(op.parent).scale * input.scale, ..goal },
            None => place(&machine.x(op.parent), &input),
        };
        return machine.put(op.out, global);
    }
    let Some(goal) = goal else { return machine.put(op.out, input) };
    let mut local = beside(&machine.x(op.parent), &goal);
    if let Some(offset) = machine.pose(op.pose) {
        local = on(&offset, &local);
    }
    let mut out = input;
    for axis in 0..3 {
        if op.translate[axis] {
            out.translation[axis] = mixed(input.translation[axis], local.translation[axis], weight);
        }
        if op.scale[axis] {
            out.scale[axis] = mixed(input.scale[axis], local.scale[axis], weight);
        }
    }
    match op.rotate {
        [false, false, false] => {}
        [true, true, true] => out.rotation = turned(input.rotation, local.rotation, weight),
        some => {
            let (own, wanted) = (EulerOrder::Xyz.angles(input.rotation), EulerOrder::Xyz.angles(local.rotation));
            let angles = Vec3::select(glam::BVec3::from_array(some), wanted, own);
            out.rotation = turned(input.rotation, EulerOrder::Xyz.rotation(angles), weight);
        }
    }
    machine.put(op.out, out);
}

/// The blend of targets in the rig's space; `None` without weight.
fn followed<R: Registers>(machine: &Machine<'_, R>, targets: &[TargetReg]) -> Option<Trs> {
    let place_of = |target: &TargetReg| {
        let node = machine.x(target.node);
        target.offset.as_ref().map_or(node, |offset| place(&node, offset))
    };
    let mut weighty = targets.iter().filter(|target| machine.n(target.weight) > 0.0);
    let (first, second) = (weighty.next()?, weighty.next());
    if second.is_none() {
        return Some(place_of(first));
    }
    blend(targets.iter().map(|target| (place_of(target), machine.n(target.weight))))
}

#[inline]
fn mixed(from: f32, to: f32, weight: f32) -> f32 {
    if weight >= 1.0 { to } else { from + (to - from) * weight }
}

#[inline]
fn turned(from: Quat, to: Quat, weight: f32) -> Quat {
    if weight >= 1.0 { to } else { slerp(from, to, weight) }
}

/// Points an axis at weighted targets.
pub(super) fn aim<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.aims[at as usize];
    let mut local = machine.x(op.input);
    let weight = share(machine.n(op.weight));
    let targets = machine.tables.targets[op.targets.range()].iter();
    let target = blend_points(targets.map(|target| (machine.x(target.node).translation, machine.n(target.weight))));
    if let Some(target) = target
        && weight > 0.0
    {
        let parent = machine.x(op.parent);
        let global = place(&parent, &local);
        let up = match op.up {
            UpReg::Direction(direction) => Up::Vector(direction),
            UpReg::Point(node) => Up::Point(machine.x(node).translation),
            UpReg::Axis(node, axis) => Up::Vector(machine.x(node).rotation * axis),
        };
        let aimed = op.aim.solve(global.translation, target, up, global.rotation) * op.offset;
        let wanted = (parent.rotation.conjugate() * aimed).normalize();
        local.rotation = turned(local.rotation, wanted, weight);
    }
    machine.put(op.out, local);
}

/// Limits a transform to bounds.
pub(super) fn limit<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.limits[at as usize];
    let (input, base) = (machine.x(op.input), &machine.tables.bases[op.base as usize]);
    let offset = relative(base, &input);
    let translation = op.translate.clamp(offset.translation);
    let rotation = op.rotate.clamp_rotation(offset.rotation, EulerOrder::Xyz);
    let scale = op.scale.clamp(offset.scale);
    let mut out = input;
    // A value within its bounds keeps its bits.
    if translation != offset.translation {
        out.translation = base.translation + base.rotation * (base.scale * translation);
    }
    if rotation.dot(offset.rotation).abs() < 1.0 - 1e-6 {
        out.rotation = (base.rotation * rotation).normalize();
    }
    if scale != offset.scale {
        out.scale = base.scale * scale;
    }
    machine.put(op.out, out);
}

/// Springs: the node lags behind, swings and settles.
pub(super) fn spring<R: Registers>(machine: &mut Machine<'_, R>, at: u32) {
    let op = &machine.tables.springs[at as usize];
    let input = machine.x(op.input);
    let parent = machine.x(op.parent);
    let weight = share(machine.n(op.weight));
    let motion = Spring { frequency: machine.n(op.frequency), damping: machine.n(op.damping) };
    let dt = machine.dt;
    let frame = machine.frame.map(|frame| (frame, share(machine.n(op.motion))));
    let bodies = &machine.tables.colliders[op.colliders.range()];
    let capsules = bodies.iter().map(|body| Capsule {
        start: machine.registers.x(body.start).translation,
        end: machine.registers.x(body.end).translation,
        radius: body.radius,
    });
    machine.scratch.capsules.clear();
    machine.scratch.capsules.extend(capsules);
    let state = &mut machine.springs[op.state as usize];
    if let Some((frame, felt)) = frame
        && felt > 0.0
    {
        state.origin.carry(frame.rotation, frame.translation, felt);
        state.tip.carry(frame.rotation, frame.translation, felt);
    }
    let wanted = place(&parent, &input);
    let sprung = swing(op, &motion, state, &wanted, dt, &machine.scratch.capsules);
    let local = if weight > 0.0 {
        let local = relative(&parent, &sprung);
        let mut out = input;
        if op.translate {
            out.translation = input.translation + (local.translation - input.translation) * weight;
        }
        if op.tip.is_some() {
            out.rotation = turned(input.rotation, local.rotation, weight);
        }
        out
    } else {
        input
    };
    machine.put(op.out, local);
}

/// Rig transform of a spring whose target is `wanted`.
fn swing(op: &SpringOp, motion: &Spring, state: &mut SpringState, wanted: &Trs, dt: f32, bodies: &[Capsule]) -> Trs {
    let mut out = *wanted;
    if !state.started {
        *state = SpringState { started: true, ..SpringState::default() };
        state.origin = PointSpring::at(wanted.translation);
        state.tip = PointSpring::at(wanted.transform_point(op.tip.unwrap_or(Vec3::ZERO)));
    }
    if op.translate {
        out.translation = advance(motion, &mut state.origin, wanted.translation, dt, 1.0);
    }
    if let Some(tip) = op.tip {
        let arm = wanted.rotation * (wanted.scale * tip);
        // Time passes from where the bodies left the point; without time nothing of it changes.
        if dt > 0.0 {
            stop_at(bodies, &mut state.tip, out.translation);
        }
        let free = advance(motion, &mut state.tip, out.translation + arm, dt, arm.length());
        let swung = match direction(free - out.translation) {
            Some(way) if !bodies.is_empty() => outside(bodies, out.translation + way * arm.length(), out.translation),
            _ => free,
        };
        if let (Some(from), Some(to)) = (direction(arm), direction(swung - out.translation)) {
            out.rotation = (arc(from, to, Vec3::ZERO) * wanted.rotation).normalize();
        }
    }
    out
}

/// Rounds in which a bone of fixed length leaves all bodies.
const ROUNDS: usize = 8;

/// The end of a bone of fixed length from `origin`, turned out of all bodies.
fn outside(bodies: &[Capsule], end: Vec3, origin: Vec3) -> Vec3 {
    let mut point = end;
    for _ in 0..ROUNDS {
        let before = point;
        point = bodies.iter().fold(point, |point, body| body.turn_out(origin, point));
        if point == before {
            break;
        }
    }
    point
}

/// Takes a point out of all bodies, and stops its motion into them.
fn stop_at(bodies: &[Capsule], state: &mut PointSpring, origin: Vec3) {
    for body in bodies {
        let pushed = body.push_out(state.position, state.position - origin);
        if let Some(way) = direction(pushed - state.position) {
            state.position = pushed;
            state.velocity -= way * state.velocity.dot(way).min(0.0);
        }
    }
}

/// Advances a point; stops it when its motion is too small to be seen.
fn advance(motion: &Spring, state: &mut PointSpring, target: Vec3, dt: f32, size: f32) -> Vec3 {
    let is_near = |state: &PointSpring| {
        let near = 1e-6 * (target.abs().max_element() + size);
        state.target == target
            && (state.position - target).abs().max_element() <= near
            && state.velocity.abs().max_element() <= 10.0 * near
    };
    // The point stops only as time passes: two runs in one frame must not differ from one.
    if dt > 0.0 && is_near(state) {
        *state = PointSpring::at(target);
        return target;
    }
    motion.point(state, target, dt)
}
