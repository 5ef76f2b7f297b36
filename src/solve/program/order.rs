//! Order of operations, removal of unused ones, and separation of constant ones.

use std::{cmp::Reverse, collections::BinaryHeap};

use super::{
    ProgramError,
    error::describe,
    graph::{Graph, Step},
    name,
    op::{N, Operand, Tables, X},
};
use crate::rig::Uid;

/// Marks a register without a writer.
const NONE: u32 = u32::MAX;

/// Registers that each operation reads and writes, transforms first, then numbers.
struct Wires {
    reads: Vec<Vec<usize>>,
    /// The operation that writes each register.
    writer: Vec<u32>,
    is_posed: Vec<bool>,
}

impl Wires {
    fn of(steps: &mut [Step], tables: &mut Tables, transforms: usize, numbers: usize) -> Self {
        let mut reads = Vec::with_capacity(steps.len());
        let mut writer = vec![NONE; transforms + numbers];
        let mut is_posed = vec![false; steps.len()];
        for (at, step) in steps.iter_mut().enumerate() {
            let mut read = Vec::new();
            step.op.visit(tables, |operand| match operand {
                Operand::ReadX(X(register)) => read.push(*register as usize),
                Operand::ReadN(N(register)) => read.push(transforms + *register as usize),
                Operand::WriteX(X(register)) => writer[*register as usize] = at as u32,
                Operand::WriteN(N(register)) => writer[transforms + *register as usize] = at as u32,
                Operand::Pose(pose) => is_posed[at] |= *pose != super::op::Pose::NONE,
            });
            reads.push(read);
        }
        Self { reads, writer, is_posed }
    }

    /// Operations that must run before another.
    fn before(&self, step: usize) -> impl Iterator<Item = usize> {
        self.reads[step].iter().map(|register| self.writer[*register]).filter(|at| *at != NONE).map(|at| at as usize)
    }
}

/// Orders the operations so that each comes after those that it reads from, close to their nodes' order in the rig.
pub(super) fn sort(graph: &mut Graph<'_>) -> Result<(), ProgramError> {
    let (transforms, numbers) = (graph.x.len(), graph.n.len());
    let wires = Wires::of(&mut graph.steps, &mut graph.tables, transforms, numbers);
    let count = graph.steps.len();
    let mut waits = vec![0; count];
    let mut after: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (at, waits) in waits.iter_mut().enumerate() {
        for before in wires.before(at) {
            *waits += 1;
            after[before].push(at as u32);
        }
    }
    let key = |at: usize| Reverse((graph.steps[at].node, at));
    let mut ready: BinaryHeap<Reverse<(usize, usize)>> = (0..count).filter(|at| waits[*at] == 0).map(key).collect();
    let mut order = Vec::with_capacity(count);
    while let Some(Reverse((_, at))) = ready.pop() {
        order.push(graph.steps[at]);
        for next in &after[at] {
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
    let mut writes = vec![Vec::new(); graph.steps.len()];
    for (register, at) in wires.writer.iter().enumerate().filter(|(_, at)| **at != NONE) {
        writes[*at as usize].push(register);
    }
    let mut live = vec![false; graph.steps.len()];
    for at in (0..graph.steps.len()).rev() {
        live[at] = writes[at].iter().any(|register| needed[*register]);
        if live[at] {
            wires.reads[at].iter().for_each(|register| needed[*register] = true);
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
            || wires.reads[at].iter().any(|register| moves[*register]);
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
