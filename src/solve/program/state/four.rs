//! Evaluation of four instances of one program in step: each operation for all of them before the next.
//!
//! Registers hold the same number of all instances side by side. The most frequent operations work on all at once;
//! others, and those in which instances differ in their branches, on one instance after the other. Both give the same
//! bits, since the formulas are the same; see [`Place`].

use wide::f32x4;

use super::{RigState, SpringState, partial::PartialRun};
use crate::{
    mesh::model::Trs,
    rig::PoseOffset,
    solve::{
        program::{
            op::{N, Op, Pose, Span, Tables, X},
            places::{Place, Real, times, unit},
            run::{Machine, Registers, Scratch},
        },
        rotate::about,
    },
};

/// Instances that one thread runs in step.
pub const LANES: usize = 4;

/// Registers and memory of a thread.
#[derive(Default)]
pub(super) struct Four {
    /// The program whose registers these are.
    serial: u64,
    /// True if the last run left out operations.
    is_partial: bool,
    registers: Columns,
    scratch: Scratch,
}

#[derive(Default)]
struct Columns {
    x: Vec<Place<f32x4>>,
    n: Vec<[f32; LANES]>,
    poses: Vec<PoseLanes>,
}

/// Pose offsets, with a mask of the instances that have one.
#[derive(Clone, Copy)]
struct PoseLanes {
    offset: Place<f32x4>,
    is_posed: f32x4,
}

/// The registers of one of the instances.
struct Column<'a> {
    columns: &'a mut Columns,
    lane: usize,
}

/// Data of a run besides the registers.
struct RunContext<'a> {
    tables: &'a Tables,
    springs: [&'a mut [SpringState]; LANES],
    scratch: &'a mut Scratch,
    dt: f32,
    frames: [Option<Trs>; LANES],
}

impl Four {
    /// Evaluates instances of one program with [`Memory::Results`].
    pub fn evaluate(&mut self, mut states: [&mut RigState; LANES], dt: f32) {
        let first = self.take(&states);
        let program = states[0].program.clone();
        self.run(&mut states, &program.tables, program.ops[first..].iter(), dt);
        self.give(states);
    }

    /// Evaluates what a run reaches of instances of one program.
    pub fn evaluate_partially(&mut self, mut states: [&mut RigState; LANES], run: &PartialRun, dt: f32) {
        self.take(&states);
        self.is_partial = true;
        let program = states[0].program.clone();
        self.run(&mut states, &program.tables, run.ops.iter().map(|op| &program.ops[*op as usize]), dt);
        let Columns { x, n, .. } = &self.registers;
        for register in run.nodes.iter().map(|register| *register as usize) {
            for (state, place) in states.iter_mut().zip(apart(&x[register])) {
                state.x[register] = place;
            }
        }
        for (lane, state) in states.into_iter().enumerate() {
            for number in run.numbers.iter().map(|number| *number as usize) {
                state.n[number] = n[number][lane];
            }
            state.settle_partially(run);
        }
    }

    fn run<'o>(
        &mut self,
        states: &mut [&mut RigState; LANES],
        tables: &Tables,
        ops: impl Iterator<Item = &'o Op>,
        dt: f32,
    ) {
        let frames = states.each_ref().map(|state| state.frame);
        let springs = states.each_mut().map(|state| state.springs.as_mut_slice());
        let mut context = RunContext { tables, springs, scratch: &mut self.scratch, dt, frames };
        ops.for_each(|op| self.registers.run(op, &mut context));
    }

    /// Loads the inputs of the instances, and returns the first operation to run: operations that depend on attributes
    /// only are skipped if the instances before had the same attributes.
    fn take(&mut self, states: &[&mut RigState; LANES]) -> usize {
        let program = &states[0].program;
        let Columns { x, n, poses } = &mut self.registers;
        let mut is_same = self.serial == program.serial;
        if !is_same {
            x.clear();
            x.extend(program.x.iter().map(splat));
            n.clear();
            n.extend(program.n.iter().map(|value| [*value; LANES]));
            self.serial = program.serial;
        }
        let nodes = program.nodes.len() + 1;
        for (register, input) in x[nodes..nodes + program.inputs.len()].iter_mut().enumerate() {
            *input = together(states.each_ref().map(|state| Place::from(&state.x[nodes + register])));
        }
        for (at, _) in program.attributes.iter().enumerate().filter(|(_, attribute)| attribute.is_settable) {
            let values = states.each_ref().map(|state| state.n[at]);
            if n[at].map(f32::to_bits) != values.map(f32::to_bits) {
                n[at] = values;
                is_same = false;
            }
        }
        poses.clear();
        poses.extend((0..program.poses).map(|pose| {
            let offsets = states.each_ref().map(|state| &state.poses[pose]);
            let is_posed = offsets.map(|offset| *offset != PoseOffset::IDENTITY);
            PoseLanes { offset: together(offsets.map(Place::from)), is_posed: mask(is_posed) }
        }));
        let is_whole = !std::mem::take(&mut self.is_partial);
        if is_same && is_whole { program.layout.settings } else { 0 }
    }

    /// Stores the results in the instances.
    fn give(&self, states: [&mut RigState; LANES]) {
        let Columns { x, n, .. } = &self.registers;
        let [a, b, c, d] = states;
        let nodes = a.program.nodes.len() + 1;
        let rows = a.x[..nodes].iter_mut().zip(&mut b.x).zip(&mut c.x).zip(&mut d.x);
        for (place, (((a, b), c), d)) in x.iter().zip(rows) {
            let [ta, tb, tc, td] = apart(place);
            (*a, *b, *c, *d) = (ta, tb, tc, td);
        }
        for (lane, state) in [a, b, c, d].into_iter().enumerate() {
            for (value, four) in state.n.iter_mut().zip(n) {
                *value = four[lane];
            }
            state.settle();
            state.moved.fill(u64::MAX);
        }
    }
}

impl Columns {
    fn x(&self, X(register): X) -> &Place<f32x4> {
        &self.x[register as usize]
    }

    fn put(&mut self, X(register): X, place: Place<f32x4>) {
        self.x[register as usize] = place;
    }

    /// Runs one operation.
    #[inline]
    fn run(&mut self, op: &Op, context: &mut RunContext) {
        let bases = &context.tables.bases;
        match *op {
            Op::Node { pose, base, parent, out } => {
                let above = self.x(parent);
                let still = || if base == 0 { *above } else { above.place(&splat(&bases[base as usize])) };
                let global = match self.poses.get(pose.0 as usize) {
                    None => still(),
                    Some(posed) => {
                        let moved = above.place(&splat(&bases[base as usize]).with(&posed.offset));
                        posed.pick(&moved, still)
                    }
                };
                self.put(out, global);
            }
            Op::Local { pose, base, drives: Span { len: 0, .. }, out } => {
                let still = splat(&bases[base as usize]);
                let local = match self.poses.get(pose.0 as usize) {
                    None => still,
                    Some(posed) => posed.pick(&still.with(&posed.offset), || still),
                };
                self.put(out, local);
            }
            Op::Global { parent, local, out } => {
                let global = self.x(parent).place(self.x(local));
                self.put(out, global);
            }
            Op::Turn { input, axis, angle: N(angle), out } => {
                let (angles, axis) = (self.n[angle as usize], context.tables.axes[axis as usize]);
                let mut local = *self.x(input);
                let is_turned = angles.map(|angle| angle != 0.0 && angle.is_finite());
                let turns = angles.map(|angle| about(axis, angle.to_radians()).to_array());
                let turn = std::array::from_fn(|at| f32x4::new(turns.map(|turn| turn[at])));
                let (before, after) = (local.rotation, unit(times(local.rotation, turn)));
                let is_turned = mask(is_turned);
                local.rotation = std::array::from_fn(|at| f32x4::select(is_turned, after[at], before[at]));
                self.put(out, local);
            }
            Op::Transform(at) => {
                if self.follow(context.tables, at).is_none() {
                    self.run_each(op, context);
                }
            }
            _ => self.run_each(op, context),
        }
    }

    /// Runs one operation on one instance after the other.
    fn run_each(&mut self, op: &Op, context: &mut RunContext) {
        for (lane, springs) in context.springs.iter_mut().enumerate() {
            let registers = Column { columns: self, lane };
            let RunContext { tables, dt, frames, .. } = *context;
            let frame = frames[lane];
            let mut machine = Machine { tables, registers, springs, scratch: context.scratch, dt, frame };
            machine.run(op);
        }
    }

    /// Follows a target whole if all instances follow the same one; returns `None` otherwise.
    fn follow(&mut self, tables: &Tables, at: u32) -> Option<()> {
        let op = &tables.transforms[at as usize];
        let above = |N(register): N, least: f32| {
            let is_above = self.n[register as usize].map(|value| value >= least && value > 0.0);
            (is_above == [is_above[0]; LANES]).then_some(is_above[0])
        };
        let is_whole = above(op.weight, 1.0)?;
        if !is_whole || !matches!(op.rotate, [true, true, true] | [false, false, false]) {
            return None;
        }
        let mut followed = None;
        for target in &tables.targets[op.targets.range()] {
            if above(target.weight, 0.0)? && followed.replace(target).is_some() {
                return None;
            }
        }
        let target = followed?;
        let node = self.x(target.node);
        let goal = target.offset.as_ref().map_or(*node, |offset| node.place(&splat(offset)));
        let (input, parent) = (self.x(op.input), self.x(op.parent));
        let out = if op.is_global {
            let scale = std::array::from_fn(|axis| parent.scale[axis] * input.scale[axis]);
            if op.scale[0] { goal } else { Place { scale, ..goal } }
        } else {
            let mut local = parent.relative(&goal);
            if let Some(posed) = self.poses.get(op.pose.0 as usize) {
                local = posed.pick(&local.with(&posed.offset), || local);
            }
            let pick = |whole: [bool; 3], to: [f32x4; 3], from: [f32x4; 3]| {
                std::array::from_fn(|axis| if whole[axis] { to[axis] } else { from[axis] })
            };
            Place {
                translation: pick(op.translate, local.translation, input.translation),
                rotation: if op.rotate[0] { local.rotation } else { input.rotation },
                scale: pick(op.scale, local.scale, input.scale),
            }
        };
        self.put(op.out, out);
        Some(())
    }
}

impl PoseLanes {
    /// The transform `moved` for instances with a pose, `still` for those without.
    #[inline(always)]
    fn pick(&self, moved: &Place<f32x4>, still: impl FnOnce() -> Place<f32x4>) -> Place<f32x4> {
        if self.is_posed.all() { *moved } else { Place::select(self.is_posed, moved, &still()) }
    }
}

impl Registers for Column<'_> {
    #[inline]
    fn x(&self, register: X) -> Trs {
        one(self.columns.x(register), self.lane).into()
    }

    #[inline]
    fn n(&self, N(register): N) -> f32 {
        self.columns.n[register as usize][self.lane]
    }

    #[inline]
    fn put(&mut self, X(register): X, value: Trs) {
        let place = &mut self.columns.x[register as usize];
        let Place { translation, rotation, scale } = Place::from(&value);
        let put = |four: &mut f32x4, value: f32| four.as_array_mut()[self.lane] = value;
        place.translation.iter_mut().zip(translation).for_each(|(four, value)| put(four, value));
        place.rotation.iter_mut().zip(rotation).for_each(|(four, value)| put(four, value));
        place.scale.iter_mut().zip(scale).for_each(|(four, value)| put(four, value));
    }

    #[inline]
    fn put_n(&mut self, N(register): N, value: f32) {
        self.columns.n[register as usize][self.lane] = value;
    }

    #[inline]
    fn offset(&self, pose: Pose) -> Option<PoseOffset> {
        let PoseLanes { offset, .. } = self.columns.poses.get(pose.0 as usize)?;
        let Trs { translation, rotation, scale } = one(offset, self.lane).into();
        Some(PoseOffset { translation, rotation, scale })
    }
}

/// Transform for all four.
#[inline(always)]
fn splat(trs: &Trs) -> Place<f32x4> {
    let Place { translation, rotation, scale } = Place::from(trs);
    Place {
        translation: translation.map(f32x4::splat),
        rotation: rotation.map(f32x4::splat),
        scale: scale.map(f32x4::splat),
    }
}

/// Transforms of all instances, side by side.
#[inline(always)]
fn together(places: [Place<f32>; LANES]) -> Place<f32x4> {
    let [a, b, c, d] = places;
    let side = |a: f32, b: f32, c: f32, d: f32| f32x4::new([a, b, c, d]);
    let three = |a: [f32; 3], b: [f32; 3], c: [f32; 3], d: [f32; 3]| {
        std::array::from_fn(|axis| side(a[axis], b[axis], c[axis], d[axis]))
    };
    let [x, y, z, w] = f32x4::transpose([a.rotation, b.rotation, c.rotation, d.rotation].map(f32x4::new));
    Place {
        translation: three(a.translation, b.translation, c.translation, d.translation),
        rotation: [x, y, z, w],
        scale: three(a.scale, b.scale, c.scale, d.scale),
    }
}

/// The transform of each instance.
#[inline(always)]
fn apart(place: &Place<f32x4>) -> [Trs; LANES] {
    let rotations = f32x4::transpose(place.rotation);
    let [tx, ty, tz] = place.translation;
    let [sx, sy, sz] = place.scale;
    let moved = f32x4::transpose([tx, ty, tz, sx]);
    let (sy, sz) = (sy.to_array(), sz.to_array());
    std::array::from_fn(|lane| {
        let [x, y, z, sx] = moved[lane].to_array();
        Place { translation: [x, y, z], rotation: rotations[lane].to_array(), scale: [sx, sy[lane], sz[lane]] }.into()
    })
}

/// The transform of one instance.
#[inline(always)]
fn one(place: &Place<f32x4>, lane: usize) -> Place<f32> {
    let pick = |four: f32x4| four.as_array_ref()[lane];
    Place { translation: place.translation.map(pick), rotation: place.rotation.map(pick), scale: place.scale.map(pick) }
}

/// Mask with all bits set where `is_so` is.
#[inline(always)]
fn mask(is_so: [bool; LANES]) -> f32x4 {
    f32x4::new(is_so.map(|is_so| f32::from_bits(if is_so { u32::MAX } else { 0 })))
}
