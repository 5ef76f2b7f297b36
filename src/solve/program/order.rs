//! Order of operations, removal of unused ones, and separation of constant ones.

use std::{cmp::Reverse, collections::BinaryHeap};

use super::{
    ProgramError,
    error::describe,
    graph::{Graph, Step},
    lists::Lists,
    name,
    op::{N, Operand, Tables, X},
};
use crate::rig::Uid;

/// Marks a register without a writer.
const NONE: u32 = u32::MAX;

/// Registers that each operation reads and writes, transforms first, then numbers.
struct Wires {
    /// Registers that all operations read, and where each operation's begin.
    reads: Vec<u32>,
    starts: Vec<u32>,
    /// The operation that writes each register.
    writer: Vec<u32>,
    is_posed: Vec<bool>,
}

impl Wires {
    fn of(steps: &mut [Step], tables: &mut Tables, transforms: usize, numbers: usize) -> Self {
        let mut reads = Vec::with_capacity(4 * steps.len());
        let mut starts = Vec::with_capacity(steps.len() + 1);
        let mut writer = vec![NONE; transforms + numbers];
        let mut is_posed = vec![false; steps.len()];
        for (at, step) in steps.iter_mut().enumerate() {
            starts.push(reads.len() as u32);
            step.op.visit(tables, |operand| match operand {
                Operand::ReadX(X(register)) => reads.push(*register),
                Operand::ReadN(N(register)) => reads.push(transforms as u32 + *register),
                Operand::WriteX(X(register)) => writer[*register as usize] = at as u32,
                Operand::WriteN(N(register)) => writer[transforms + *register as usize] = at as u32,
                Operand::Pose(pose) => is_posed[at] |= *pose != super::op::Pose::NONE,
            });
        }
        starts.push(reads.len() as u32);
        Self { reads, starts, writer, is_posed }
    }

    /// Registers that an operation reads.
    fn reads(&self, step: usize) -> impl Iterator<Item = usize> {
        let range = self.starts[step] as usize..self.starts[step + 1] as usize;
        self.reads[range].iter().map(|register| *register as usize)
    }

    /// Operations that must run before another.
    fn before(&self, step: usize) -> impl Iterator<Item = usize> {
        self.reads(step).map(|register| self.writer[register]).filter(|at| *at != NONE).map(|at| at as usize)
    }
}

/// Orders the operations so that each comes after those that it reads from, close to their nodes' order in the rig.
pub(super) fn sort(graph: &mut Graph<'_>) -> Result<(), ProgramError> {
    let (transforms, numbers) = (graph.x.len(), graph.n.len());
    let wires = Wires::of(&mut graph.steps, &mut graph.tables, transforms, numbers);
    let count = graph.steps.len();
    let pairs = (0..count).flat_map(|at| wires.before(at).map(move |before| (before as u32, at as u32)));
    let after = Lists::new(count, &pairs.collect::<Vec<_>>());
    let mut waits = vec![0; count];
    after.items.iter().for_each(|at| waits[*at as usize] += 1);
    let key = |at: usize| Reverse((graph.steps[at].node, at));
    let mut ready: BinaryHeap<Reverse<(usize, usize)>> = (0..count).filter(|at| waits[*at] == 0).map(key).collect();
    let mut order = Vec::with_capacity(count);
    while let Some(Reverse((_, at))) = ready.pop() {
        order.push(graph.steps[at]);
        for next in after.get(at) {
            let next = *next as usize;
            waits[next] -= 1;
            if waits[next] == 0 {
                ready.push(key(next));
            }
        }
    }
    if order.len() < count {
        return Err(cycle(graph, &wires, &waits));
    }
    graph.steps = order;
    Ok(())
}

/// Describes a cycle among the operations that were never ready.
fn cycle(graph: &Graph<'_>, wires: &Wires, waits: &[usize]) -> ProgramError {
    let first = waits.iter().position(|count| *count > 0).unwrap_or_default();
    // Each waiting operation waits for another, so the walk runs into itself.
    let mut path = vec![first];
    let start = loop {
        let last = path[path.len() - 1];
        let Some(next) = wires.before(last).find(|at| waits[*at] > 0) else { break 0 };
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
                Some(_) => format!("{} drives {}", describe(constraint), name(rig, step.node)),
                None => describe(constraint),
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

/// Drops operations whose results no register in `results` or `numbers` depends on.
pub(super) fn prune(graph: &mut Graph<'_>, results: &[X], numbers: &[N]) {
    let transforms = graph.x.len();
    let wires = Wires::of(&mut graph.steps, &mut graph.tables, transforms, graph.n.len());
    let mut needed = vec![false; transforms + graph.n.len()];
    results.iter().for_each(|X(register)| needed[*register as usize] = true);
    numbers.iter().for_each(|N(register)| needed[transforms + *register as usize] = true);
    // Registers without a writer belong to a list that does not exist.
    let written: Vec<_> = wires.writer.iter().enumerate().map(|(register, at)| (*at, register as u32)).collect();
    let writes = Lists::new(graph.steps.len(), &written);
    let mut live = vec![false; graph.steps.len()];
    for at in (0..graph.steps.len()).rev() {
        live[at] = writes.get(at).iter().any(|register| needed[*register as usize]);
        if live[at] {
            wires.reads(at).for_each(|register| needed[register] = true);
        }
    }
    let mut at = 0;
    graph.steps.retain(|_| {
        at += 1;
        live[at - 1]
    });
}

/// Splits off the operations that depend on no input, on no pose, and on none of the registers in `numbers`.
pub(super) fn split_fixed(graph: &mut Graph<'_>, numbers: &[N]) -> Vec<Step> {
    let transforms = graph.x.len();
    let wires = Wires::of(&mut graph.steps, &mut graph.tables, transforms, graph.n.len());
    let mut moves = vec![false; transforms + graph.n.len()];
    graph.inputs.iter().for_each(|X(register)| moves[*register as usize] = true);
    numbers.iter().for_each(|N(register)| moves[transforms + *register as usize] = true);
    let mut changes = vec![false; graph.steps.len()];
    for (at, change) in changes.iter_mut().enumerate() {
        // A spring changes with time alone.
        *change = wires.is_posed[at]
            || matches!(graph.steps[at].op, super::op::Op::Spring(_))
            || wires.reads(at).any(|register| moves[register]);
        if *change {
            let tables = &mut graph.tables;
            graph.steps[at].op.visit(tables, |operand| match operand {
                Operand::WriteX(X(register)) => moves[*register as usize] = true,
                Operand::WriteN(N(register)) => moves[transforms + *register as usize] = true,
                _ => {}
            });
        }
    }
    let mut at = 0;
    let mut fixed = Vec::new();
    graph.steps.retain(|step| {
        at += 1;
        if !changes[at - 1] {
            fixed.push(*step);
        }
        changes[at - 1]
    });
    fixed
}
