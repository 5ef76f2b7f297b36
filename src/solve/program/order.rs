//! Order of operations, removal of unused ones, and separation of constant ones.

use std::{cmp::Reverse, collections::BinaryHeap};

use super::{
    ConstraintName, ProgramError,
    graph::{Graph, Step},
    layout::Shape,
    lists::Lists,
    name,
    op::{N, Operand, Pose, Tables, X},
};
use crate::rig::Uid;

/// Marks a register without a writer.
const NONE: u32 = u32::MAX;

/// Registers that each operation reads and writes, transforms first, then numbers.
#[derive(Debug, PartialEq)]
pub(super) struct Wires {
    /// Number of registers of transforms, and of all.
    pub transforms: usize,
    registers: usize,
    /// Registers that all operations read, and where each operation's begin.
    reads: Vec<u32>,
    starts: Vec<u32>,
    /// Registers that operations write, in the same form.
    writes: Vec<u32>,
    write_starts: Vec<u32>,
    /// Pose that each operation reads.
    pub poses: Vec<Pose>,
}

impl Wires {
    pub fn of(steps: &mut [Step], tables: &mut Tables, transforms: usize, numbers: usize) -> Self {
        let mut reads = Vec::with_capacity(4 * steps.len());
        let mut starts = Vec::with_capacity(steps.len() + 1);
        let mut writes = Vec::with_capacity(2 * steps.len());
        let mut write_starts = Vec::with_capacity(steps.len() + 1);
        let mut poses = vec![Pose::NONE; steps.len()];
        for (step, posed) in steps.iter_mut().zip(&mut poses) {
            starts.push(reads.len() as u32);
            write_starts.push(writes.len() as u32);
            step.op.visit(tables, |operand| match operand {
                Operand::ReadX(X(register)) => reads.push(*register),
                Operand::ReadN(N(register)) => reads.push(transforms as u32 + *register),
                Operand::WriteX(X(register)) => writes.push(*register),
                Operand::WriteN(N(register)) => writes.push(transforms as u32 + *register),
                Operand::Pose(pose) => *posed = *pose,
            });
        }
        starts.push(reads.len() as u32);
        write_starts.push(writes.len() as u32);
        Self { transforms, registers: transforms + numbers, reads, starts, writes, write_starts, poses }
    }

    /// Registers that an operation reads.
    pub fn read_by(&self, step: usize) -> &[u32] {
        &self.reads[self.starts[step] as usize..self.starts[step + 1] as usize]
    }

    /// Registers that an operation writes.
    pub fn written_by(&self, step: usize) -> &[u32] {
        &self.writes[self.write_starts[step] as usize..self.write_starts[step + 1] as usize]
    }

    /// The operation that writes each register.
    fn writers(&self) -> Vec<u32> {
        let mut writers = vec![NONE; self.registers];
        for step in 0..self.poses.len() {
            self.written_by(step).iter().for_each(|register| writers[*register as usize] = step as u32);
        }
        writers
    }

    /// Operations that must run before another.
    fn before(&self, writers: &[u32], step: usize) -> impl Iterator<Item = usize> {
        let writer = move |register: &u32| Some(writers[*register as usize] as usize).filter(|at| *at != NONE as usize);
        self.read_by(step).iter().filter_map(writer)
    }
}

/// The order of the operations in which each comes after those that it reads from, close to their nodes' order in the rig.
pub(super) fn sort(graph: &Graph<'_>, shape: &Shape) -> Result<Vec<u32>, ProgramError> {
    let wires = &shape.wires;
    let writers = wires.writers();
    let count = graph.steps.len();
    let pairs = (0..count).flat_map(|at| wires.before(&writers, at).map(move |before| (before as u32, at as u32)));
    let after = Lists::new(count, &pairs.collect::<Vec<_>>());
    let mut waits = vec![0; count];
    after.items.iter().for_each(|at| waits[*at as usize] += 1);
    let key = |at: usize| Reverse((shape.nodes[at], at as u32));
    let mut ready: BinaryHeap<Reverse<(u32, u32)>> = (0..count).filter(|at| waits[*at] == 0).map(key).collect();
    let mut order = Vec::with_capacity(count);
    while let Some(Reverse((_, at))) = ready.pop() {
        order.push(at);
        for next in after.get(at as usize) {
            let next = *next as usize;
            waits[next] -= 1;
            if waits[next] == 0 {
                ready.push(key(next));
            }
        }
    }
    if order.len() < count {
        return Err(cycle(graph, wires, &writers, &waits));
    }
    Ok(order)
}

/// Describes a cycle among the operations that were never ready.
fn cycle(graph: &Graph<'_>, wires: &Wires, writers: &[u32], waits: &[usize]) -> ProgramError {
    let first = waits.iter().position(|count| *count > 0).unwrap_or_default();
    // Each waiting operation waits for another, so the walk runs into itself.
    let mut path = vec![first];
    let start = loop {
        let last = path[path.len() - 1];
        let Some(next) = wires.before(writers, last).find(|at| waits[*at] > 0) else { break 0 };
        if let Some(start) = path.iter().position(|at| *at == next) {
            break start;
        }
        path.push(next);
    };
    let mut path = path.split_off(start);
    path.reverse();
    // The text begins with a constraint, so that it does not depend on the start of the walk.
    let begin = (0..path.len()).filter(|at| graph.steps[path[*at]].constraint.is_some());
    let begin = begin.min_by_key(|at| graph.steps[path[*at]].constraint).unwrap_or_default();
    path.rotate_left(begin);

    let rig = graph.rig;
    let (mut words, mut constraints, mut commands, mut nodes) = (Vec::new(), Vec::new(), Vec::new(), Vec::<Uid>::new());
    for step in path.iter().map(|at| &graph.steps[*at]) {
        let node = rig.nodes.get(step.node);
        if let Some(constraint) = step.constraint.map(|at| &rig.constraints[at]) {
            let text = match node {
                Some(_) => format!("{} drives {}", ConstraintName::from(constraint), name(rig, step.node)),
                None => ConstraintName::from(constraint).to_string(),
            };
            words.push(text);
            constraints.push(constraint.uid);
            commands.push(constraint.command);
        } else if let Some(node) = node
            && nodes.last() != Some(&node.uid)
        {
            words.push(format!("which {} hangs on or is", name(rig, step.node)));
        }
        nodes.extend(node.map(|node| node.uid));
    }
    words.dedup();
    for list in [&mut constraints, &mut commands, &mut nodes] {
        let mut seen = Vec::new();
        list.retain(|uid| {
            let is_first = !seen.contains(uid);
            seen.push(*uid);
            is_first
        });
    }
    let mut loop_text = words.join(", ");
    loop_text.push_str(", on which the first depends");
    ProgramError::Cycle { loop_text, constraints, commands, nodes }
}

/// Operations of a graph by when they run, in their order.
pub(super) struct Split {
    /// Operations that depend on no input, on no pose and on no attribute that can be set.
    pub fixed: Vec<u32>,
    /// All others; those that depend on attributes only come first.
    pub ops: Vec<u32>,
    /// The number of those.
    pub settings: usize,
}

/// Splits sorted operations by what they depend on, without those on which no result depends. `same` is the register to read
/// in the stead of each transform.
pub(super) fn split(shape: &Shape, order: &[u32], same: &[X]) -> Split {
    let wires = &shape.wires;
    let read = |register: &u32| same.get(*register as usize).map_or(*register, |same| same.0) as usize;
    let registers = |list: &[X], numbers: &[N]| {
        let mut marks = vec![false; wires.registers];
        list.iter().for_each(|X(register)| marks[*register as usize] = true);
        numbers.iter().for_each(|N(register)| marks[wires.transforms + *register as usize] = true);
        marks
    };
    let mut needed = registers(&shape.ends.results, &shape.ends.numbers);
    let mut is_live = vec![false; order.len()];
    for at in order.iter().rev().map(|at| *at as usize) {
        is_live[at] = wires.written_by(at).iter().any(|register| needed[*register as usize]);
        if is_live[at] {
            wires.read_by(at).iter().for_each(|register| needed[read(register)] = true);
        }
    }
    // A spring changes with time alone.
    let mut is_spring = vec![false; order.len()];
    shape.springs.iter().for_each(|(at, _)| is_spring[*at as usize] = true);
    let moving = |settable: &[N]| -> Vec<bool> {
        let mut moves = registers(&shape.inputs, settable);
        let mut moved = vec![false; order.len()];
        for at in order.iter().map(|at| *at as usize) {
            moved[at] = wires.poses[at] != Pose::NONE
                || is_spring[at]
                || wires.read_by(at).iter().any(|register| moves[read(register)]);
            if moved[at] {
                wires.written_by(at).iter().for_each(|register| moves[*register as usize] = true);
            }
        }
        moved
    };
    let (changes, plays) = (moving(&shape.ends.settable), moving(&[]));
    let of = |wanted: [bool; 2]| {
        let is_wanted = |at: &u32| {
            let at = *at as usize;
            is_live[at] && [changes[at], plays[at]] == wanted
        };
        order.iter().copied().filter(is_wanted).collect::<Vec<_>>()
    };
    let mut ops = of([true, false]);
    let settings = ops.len();
    ops.extend(of([true, true]));
    Split { fixed: of([false, false]), ops, settings }
}
