//! Evaluation of one instance that remembers results only, in registers that the instances of a thread share.

use super::{RigState, partial::PartialRun};
use crate::{
    mesh::model::Trs,
    solve::program::{
        op::Op,
        run::{Machine, Scratch, SingleRegisters},
    },
};

/// Registers and memory that instances of a thread share.
#[derive(Default)]
pub(super) struct Workspace {
    /// The program whose registers these are.
    serial: u64,
    /// True if the last run left out operations.
    is_partial: bool,
    x: Vec<Trs>,
    n: Vec<f32>,
    pub scratch: Scratch,
}

impl Workspace {
    /// Loads the inputs of an instance, and returns the first operation to run: operations that depend on attributes
    /// only are skipped if the instance before had the same attributes.
    pub fn take(&mut self, state: &RigState) -> usize {
        let program = &state.program;
        let mut is_same = self.serial == program.serial;
        if !is_same {
            self.x.clone_from(&program.x);
            self.n.clone_from(&program.n);
            self.serial = program.serial;
        }
        let nodes = program.nodes.len() + 1;
        self.x[nodes..state.x.len()].copy_from_slice(&state.x[nodes..]);
        for ((attribute, known), value) in program.attributes.iter().zip(&mut self.n).zip(&state.n) {
            if attribute.is_settable && known.to_bits() != value.to_bits() {
                *known = *value;
                is_same = false;
            }
        }
        let is_whole = !std::mem::take(&mut self.is_partial);
        if is_same && is_whole { program.layout.settings } else { 0 }
    }

    /// Stores the results in an instance.
    pub fn give(&self, state: &mut RigState) {
        let nodes = state.program.nodes.len() + 1;
        state.x[..nodes].copy_from_slice(&self.x[..nodes]);
        let numbers = state.n.len();
        state.n.copy_from_slice(&self.n[..numbers]);
        state.settle();
        state.moved.fill(u64::MAX);
    }

    /// Runs operations of the instance's program.
    pub fn run<'o>(&mut self, state: &mut RigState, ops: impl Iterator<Item = &'o Op>, dt: f32) {
        let registers = SingleRegisters::<false> {
            x: &mut self.x,
            n: &mut self.n,
            poses: &state.poses,
            changed: false,
            moved: &mut [],
        };
        let RigState { program, springs, frame, .. } = state;
        let (tables, scratch) = (&program.tables, &mut self.scratch);
        let mut machine = Machine { tables, registers, springs, scratch, dt, frame: *frame };
        ops.for_each(|op| machine.run(op));
    }

    /// Evaluates what a run reaches of an instance.
    pub fn run_partially(&mut self, state: &mut RigState, run: &PartialRun, dt: f32) {
        self.take(state);
        self.is_partial = true;
        let program = state.program.clone();
        self.run(state, run.ops.iter().map(|op| &program.ops[*op as usize]), dt);
        for register in run.nodes.iter().map(|register| *register as usize) {
            state.x[register] = self.x[register];
        }
        for number in run.numbers.iter().map(|number| *number as usize) {
            state.n[number] = self.n[number];
        }
        state.settle_partially(run);
    }
}
