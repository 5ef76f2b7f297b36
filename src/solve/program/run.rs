//! Execution of operations.

use glam::{Quat, Vec3};

use super::{
    chains, constraints,
    op::{N, Op, Pose, Span, Tables, X},
    places::{Place, times, unit},
    readers,
    state::SpringState,
};
use crate::{
    mesh::model::Trs,
    rig::{Channel, PoseOffset},
    solve::{
        ccd::CcdJoint,
        collider::Capsule,
        foot::FootControls,
        rotate::{EulerOrder, about},
        stretch::Stretch,
        twist::twist_angle,
    },
};

/// Buffers of running operations; they grow to the size that a program needs and are kept.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    pub points: Vec<Vec3>,
    pub before: Vec<Vec3>,
    pub controls: Vec<Vec3>,
    pub lengths: Vec<f32>,
    pub rotations: Vec<Quat>,
    pub globals: Vec<Trs>,
    pub posed: Vec<(Vec3, Quat)>,
    pub joints: Vec<CcdJoint>,
    pub values: Vec<f32>,
    pub capsules: Vec<Capsule>,
}

/// Transforms and numbers of one instance.
pub(super) trait Registers {
    /// A transform.
    fn x(&self, register: X) -> Trs;

    /// A number.
    fn n(&self, register: N) -> f32;

    /// Writes a transform.
    fn put(&mut self, register: X, value: Trs);

    /// Writes a number.
    fn put_n(&mut self, register: N, value: f32);

    /// The pose offset of a slot; `None` where there is none.
    fn offset(&self, pose: Pose) -> Option<PoseOffset>;
}

/// The registers of a single instance. With `TRACK`, it notes whether an operation changed any bit of its results.
pub(super) struct SingleRegisters<'a, const TRACK: bool> {
    pub x: &'a mut [Trs],
    pub n: &'a mut [f32],
    pub poses: &'a [PoseOffset],
    /// Marks that the last operation changed a register.
    pub changed: bool,
    /// A bit for each of the first transforms, set when it changes.
    pub moved: &'a mut [u64],
}

impl<const TRACK: bool> Registers for SingleRegisters<'_, TRACK> {
    #[inline]
    fn x(&self, X(register): X) -> Trs {
        self.x[register as usize]
    }

    #[inline]
    fn n(&self, N(register): N) -> f32 {
        self.n[register as usize]
    }

    #[inline]
    fn put(&mut self, X(register): X, value: Trs) {
        let slot = &mut self.x[register as usize];
        if TRACK && !same_bits(slot, &value) {
            self.changed = true;
            if let Some(word) = self.moved.get_mut(register as usize / 64) {
                *word |= 1 << (register % 64);
            }
        }
        *slot = value;
    }

    #[inline]
    fn put_n(&mut self, N(register): N, value: f32) {
        let slot = &mut self.n[register as usize];
        if TRACK && slot.to_bits() != value.to_bits() {
            self.changed = true;
        }
        *slot = value;
    }

    #[inline]
    fn offset(&self, pose: Pose) -> Option<PoseOffset> {
        // Pose::NONE is past every list.
        self.poses.get(pose.0 as usize).copied()
    }
}

/// Runs operations on an instance.
pub(super) struct Machine<'a, R> {
    pub tables: &'a Tables,
    pub registers: R,
    pub springs: &'a mut [SpringState],
    pub scratch: &'a mut Scratch,
    /// Seconds since the last run.
    pub dt: f32,
    /// Map from the rig's space of the last run to that of now, both seen from the world; `None` if the rig stands still.
    pub frame: Option<Trs>,
}

impl<R: Registers> Machine<'_, R> {
    /// A transform.
    #[inline]
    pub fn x(&self, register: X) -> Trs {
        self.registers.x(register)
    }

    /// A number.
    #[inline]
    pub fn n(&self, register: N) -> f32 {
        self.registers.n(register)
    }

    /// Writes a transform.
    #[inline]
    pub fn put(&mut self, register: X, value: Trs) {
        self.registers.put(register, value);
    }

    /// Writes a number.
    #[inline]
    pub fn put_n(&mut self, register: N, value: f32) {
        self.registers.put_n(register, value);
    }

    /// The pose offset of a slot; `None` for the identity or without a pose.
    #[inline]
    pub fn pose(&self, pose: Pose) -> Option<PoseOffset> {
        self.registers.offset(pose).filter(|offset| *offset != PoseOffset::IDENTITY)
    }

    /// Runs one operation.
    #[inline]
    pub fn run(&mut self, op: &Op) {
        match *op {
            Op::Node { pose, base, parent, out } => {
                let offset = self.pose(pose);
                let above = self.x(parent);
                let global = match (offset, base) {
                    (None, 0) => above,
                    (None, _) => place(&above, &self.tables.bases[base as usize]),
                    (Some(offset), _) => place(&above, &on(&offset, &self.tables.bases[base as usize])),
                };
                self.put(out, global);
            }
            Op::Local { pose, base, drives, out } => {
                let mut local = self.tables.bases[base as usize];
                if drives.len > 0 {
                    local = on(&self.driven(drives), &local);
                }
                if let Some(offset) = self.pose(pose) {
                    local = on(&offset, &local);
                }
                self.put(out, local);
            }
            Op::Drive { input, drives, out } => {
                let local = on(&self.driven(drives), &self.x(input));
                self.put(out, local);
            }
            Op::Global { parent, local, out } => {
                let global = place(&self.x(parent), &self.x(local));
                self.put(out, global);
            }
            Op::Turn { input, axis, angle, out } => {
                let (mut local, angle) = (self.x(input), self.n(angle));
                if angle != 0.0 && angle.is_finite() {
                    let turn = about(self.tables.axes[axis as usize], angle.to_radians());
                    local.rotation = turned_on(local.rotation, turn);
                }
                self.put(out, local);
            }
            Op::Scale { input, axis, along, across, out } => {
                let (mut local, axis) = (self.x(input), self.tables.axes[axis as usize]);
                let (along, across) = (self.n(along), self.n(across));
                local.scale *= Vec3::splat(across) + axis * axis * (along - across);
                self.put(out, local);
            }
            Op::Linear { input, factor, add, out } => self.put_n(out, factor * self.n(input) + add),
            Op::Choice { input, value, out } => self.put_n(out, (1.0 - (self.n(input) - value).abs()).max(0.0)),
            Op::Channel { pose, channel, out } => {
                let offset = self.registers.offset(pose).unwrap_or_default();
                self.put_n(out, channel_of(&offset, channel));
            }
            Op::Product { a, b, out } => self.put_n(out, self.n(a) * self.n(b)),
            Op::Clamp { input, ends, out } => {
                let ([low, high, fallback], value) = (self.tables.ends[ends as usize], self.n(input));
                self.put_n(out, if value.is_finite() { value.min(high).max(low) } else { fallback });
            }
            Op::Sum { list, out } => {
                let sum = self.tables.numbers[list.range()].iter().map(|value| self.n(*value)).sum();
                self.put_n(out, sum);
            }
            Op::Key(at) => {
                let op = &self.tables.keys[at as usize];
                self.put_n(op.out, op.curve.evaluate(self.n(op.driver)));
            }
            Op::Expression(at) => {
                let op = &self.tables.expressions[at as usize];
                self.scratch.values.clear();
                let inputs = &self.tables.numbers[op.inputs.range()];
                self.scratch.values.extend(inputs.iter().map(|input| self.registers.n(*input)));
                let value = op.expression.evaluate(&self.scratch.values).value;
                self.put_n(op.out, value);
            }
            Op::Foot(at) => self.foot(at),
            Op::Twist(at) => {
                let op = &self.tables.twists[at as usize];
                let between = self.x(op.reference).rotation.conjugate() * self.x(op.source).rotation;
                self.put_n(op.out, twist_angle(op.rest * between, op.axis).to_degrees());
            }
            Op::Stretch(at) => {
                let op = &self.tables.stretches[at as usize];
                let length = self.x(op.start).translation.distance(self.x(op.end).translation);
                let stretch = Stretch { min: op.range.0, max: op.range.1, volume: self.n(op.volume) };
                let stretched = stretch.solve(op.rest, length);
                let weight = share(self.n(op.weight));
                self.put_n(op.along, 1.0 + weight * (stretched.along - 1.0));
                self.put_n(op.across, 1.0 + weight * (stretched.across - 1.0));
            }
            Op::Transform(at) => constraints::transform(self, at),
            Op::Aim(at) => constraints::aim(self, at),
            Op::TwoBone(at) => chains::two_bone(self, at),
            Op::Chain(at) => chains::chain(self, at),
            Op::Spline(at) => chains::spline(self, at),
            Op::Limit(at) => constraints::limit(self, at),
            Op::Spring(at) => constraints::spring(self, at),
            Op::Cone(at) => readers::cone(self, at),
            Op::Reader(at) => readers::poses(self, at),
            Op::Travel(at) => readers::travel(self, at),
            Op::Path(at) => readers::path(self, at),
            Op::Rivet(at) => readers::rivet(self, at),
        }
    }

    /// The offset made of the driven channels.
    fn driven(&self, drives: Span) -> PoseOffset {
        let mut offset = PoseOffset::IDENTITY;
        let mut angles = Vec3::ZERO;
        for (channel, value) in &self.tables.drives[drives.range()] {
            let value = self.n(*value);
            match *channel {
                Channel::TranslateX => offset.translation.x += value,
                Channel::TranslateY => offset.translation.y += value,
                Channel::TranslateZ => offset.translation.z += value,
                Channel::RotateX => angles.x += value,
                Channel::RotateY => angles.y += value,
                Channel::RotateZ => angles.z += value,
                Channel::ScaleX => offset.scale.x *= value,
                Channel::ScaleY => offset.scale.y *= value,
                Channel::ScaleZ => offset.scale.z *= value,
            }
        }
        if angles != Vec3::ZERO && angles.is_finite() {
            offset.rotation = EulerOrder::Xyz.rotation(Vec3::from(angles.to_array().map(f32::to_radians)));
        }
        offset
    }

    fn foot(&mut self, at: u32) {
        let op = &self.tables.feet[at as usize];
        let break_angle = self.n(op.break_angle);
        // The ball straightens over as wide an angle as it bends.
        let straight_angle = 2.0 * break_angle;
        let controls = FootControls { roll: self.n(op.roll), break_angle, straight_angle, ..FootControls::default() };
        let [heel, ball, toe] = controls.split();
        let bank = self.n(op.bank);
        let bank = if bank.is_finite() { bank } else { 0.0 };
        let angles = [heel, ball, toe, bank.min(0.0), bank.max(0.0)];
        for (out, angle) in op.outs.into_iter().zip(angles) {
            self.put_n(out, angle);
        }
    }
}

/// A weight clamped to 0 to 1; a NaN becomes 0.
#[inline]
pub(super) fn share(weight: f32) -> f32 {
    // The comparison handles NaN, too.
    if weight > 0.0 { weight.min(1.0) } else { 0.0 }
}

/// Maps a transform relative to `parent` to the parent space of `parent`.
#[inline]
pub(super) fn place(parent: &Trs, local: &Trs) -> Trs {
    Place::from(parent).place(&local.into()).into()
}

/// A pose offset on top of a transform.
#[inline]
pub(super) fn on(offset: &PoseOffset, base: &Trs) -> Trs {
    Place::from(base).with(&offset.into()).into()
}

/// A transform relative to `parent`.
#[inline]
pub(super) fn beside(parent: &Trs, transform: &Trs) -> Trs {
    Place::from(parent).relative(&transform.into()).into()
}

/// The rotation `first`, and `then` about the axes that it has turned.
#[inline]
fn turned_on(first: Quat, then: Quat) -> Quat {
    Quat::from_array(unit(times(first.to_array(), then.to_array())))
}

/// One channel of an offset; angles in degrees.
fn channel_of(offset: &PoseOffset, channel: Channel) -> f32 {
    let angle = |axis: usize| EulerOrder::Xyz.angles(offset.rotation)[axis].to_degrees();
    match channel {
        Channel::TranslateX => offset.translation.x,
        Channel::TranslateY => offset.translation.y,
        Channel::TranslateZ => offset.translation.z,
        Channel::RotateX => angle(0),
        Channel::RotateY => angle(1),
        Channel::RotateZ => angle(2),
        Channel::ScaleX => offset.scale.x,
        Channel::ScaleY => offset.scale.y,
        Channel::ScaleZ => offset.scale.z,
    }
}

/// Returns `true` if two transforms are equal bit by bit.
#[inline]
pub(super) fn same_bits(a: &Trs, b: &Trs) -> bool {
    let bits = |trs: &Trs| {
        let ([x, y, z], [i, j, k, w]) = (trs.translation.to_array(), trs.rotation.to_array());
        let [s, t, u] = trs.scale.to_array();
        [x, y, z, i, j, k, w, s, t, u].map(f32::to_bits)
    };
    bits(a) == bits(b)
}
