//! Runs of instances that remember results only, after an exchange of their program for one of the same layout: what no
//! difference reaches stands already.

use std::sync::Arc;

use super::{RigState, mark};
use crate::solve::program::RigProgram;

/// A run of a part of a program's operations: those that a difference reaches, and those that compute what these read.
/// Worked out once for all instances.
#[derive(Debug)]
pub(super) struct PartialRun {
    /// Operations in their order.
    pub ops: Vec<u32>,
    /// Registers of nodes, and of attributes and morph targets, whose values may be others.
    pub nodes: Vec<u32>,
    pub numbers: Vec<u32>,
}

impl PartialRun {
    /// The run after an exchange in which some operations are others, and some registers have other values at the start
    /// (transforms first). `None` for a program with springs, which move with every run, and where most operations have to
    /// run.
    pub fn of(program: &RigProgram, ops: &[u32], registers: impl Iterator<Item = usize>) -> Option<Self> {
        let layout = &program.layout;
        if !layout.spring_ops.is_empty() {
            return None;
        }
        let count = program.ops.len();
        let mut is_reached = vec![false; count];
        ops.iter().for_each(|op| is_reached[*op as usize] = true);
        let transforms = program.x.len();
        let mut numbers = Vec::new();
        for register in registers {
            layout.readers.get(register).iter().for_each(|op| is_reached[*op as usize] = true);
            numbers.extend(register.checked_sub(transforms).map(|number| number as u32));
        }
        // Readers come later in the list.
        for op in 0..count {
            if is_reached[op] {
                layout.op_readers.get(op).iter().for_each(|reader| is_reached[*reader as usize] = true);
            }
        }
        let mut is_needed = is_reached.clone();
        for op in (0..count).rev() {
            is_needed[op] |= layout.op_readers.get(op).iter().any(|reader| is_needed[*reader as usize]);
        }
        let ops: Vec<u32> = (0..count as u32).filter(|op| is_needed[*op as usize]).collect();
        if ops.len() * 4 > count * 3 {
            return None;
        }
        let mut nodes = Vec::new();
        for register in (0..count).filter(|op| is_reached[*op]).flat_map(|op| layout.written_by(op)) {
            match register.checked_sub(transforms) {
                Some(number) => numbers.push(number as u32),
                None => nodes.push(register as u32),
            }
        }
        nodes.retain(|register| *register as usize <= program.nodes.len());
        numbers.retain(|number| (*number as usize) < program.attributes.len() + program.morphs.len());
        Some(Self { ops, nodes, numbers })
    }
}

impl RigState {
    /// The run that brings the results up to date, if nothing has changed but the program.
    pub(super) fn due_run(&self) -> Option<&Arc<PartialRun>> {
        self.partial.as_ref().filter(|_| !self.any_dirty)
    }

    /// Marks the results as up to date after a run.
    pub(super) fn settle_partially(&mut self, run: &PartialRun) {
        self.settle();
        self.moved.fill(0);
        mark(&mut self.moved, &run.nodes);
    }
}
