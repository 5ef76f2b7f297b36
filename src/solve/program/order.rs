//! Order of operations, removal of unused ones, and separation of constant ones.

use std::{cmp::Reverse, collections::BinaryHeap};

use super::{
    ConstraintName, ProgramError,
    graph::{Graph, Step},
    lists::Lists,
    name,
    op::{N, Op, Operand, Pose, Tables, X},
};
use crate::rig::Uid;

/// Marks a register without a writer.
const NONE: u32 = u32::MAX;

/// Registers that each operation reads and writes, transforms first, then numbers.
struct Wires {
    /// Registers that all operations read, and where each operation's begin.
    reads: Vec<u32>,
    starts: Vec<u32>,
    /// The same of registers that operations write.
    writes: Vec<u32>,
    write_starts: Vec<u32>,
    /// The operation that writes each register.
    writer: Vec<u32>,
    is_posed: Vec<bool>,
}

impl Wires {
    fn of(steps: &mut [Step], tables: &mut Tables, transforms: usize, numbers: usize) -> Self {
        let mut reads = Vec::with_capacity(4 * steps.len());
        let mut starts = Vec::with_capacity(steps.len() + 1);
        let mut writes = Vec::with_capacity(2 * steps.len());
        let mut write_starts = Vec::with_capacity(steps.len() + 1);
        let mut writer = vec![NONE; transforms + numbers];
        let mut is_posed = vec![false; steps.len()];
        for (at, step) in steps.iter_mut().enumerate() {
            starts.push(reads.len() as u32);
            write_starts.push(writes.len() as u32);
            step.op.visit(tables, |operand| match operand {
                Operand::ReadX(X(register)) => reads.push(*register),
                Operand::ReadN(N(register)) => reads.push(transforms as u32 + *register),
                Operand::WriteX(X(register)) => writes.push(*register),
                Operand::WriteN(N(register)) => writes.push(transforms as u32 + *register),
                Operand::Pose(pose) => is_posed[at] |= *pose != Pose::NONE,
            });
            let start = write_starts[at] as usize;
            writes[start..].iter().for_each(|register| writer[*register as usize] = at as u32);
        }
        starts.push(reads.len() as u32);
        write_starts.push(writes.len() as u32);
        Self { reads, starts, writes, write_starts, writer, is_posed }
    }

    /// Registers that an operation reads.
    fn reads(&self, step: usize) -> impl Iterator<Item = usize> {
        let range = self.starts[step] as usize..self.starts[step + 1] as usize;
        self.reads[range].iter().map(|register| *register as usize)
    }

    /// Registers that an operation writes.
    fn writes(&self, step: usize) -> impl Iterator<Item = usize> {
        let range = self.write_starts[step] as usize..self.write_starts[step + 1] as usize;
        self.writes[range].iter().map(|register| *register as usize)
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

/// Drops operations on which no register in `results` or `numbers` depends, and splits off and returns those that depend on
/// no input, on no pose, and on no attribute in `settable`. Those that depend on attributes only are put first; their
/// number is returned, too.
pub(super) fn split(graph: &mut Graph<'_>, results: &[X], numbers: &[N], settable: &[N]) -> (Vec<Step>, usize) {
    let (transforms, count) = (graph.x.len(), graph.steps.len());
    let wires = Wires::of(&mut graph.steps, &mut graph.tables, transforms, graph.n.len());
    let registers = |list: &[X], numbers: &[N]| {
        let mut marks = vec![false; transforms + graph.n.len()];
        list.iter().for_each(|X(register)| marks[*register as usize] = true);
        numbers.iter().for_each(|N(register)| marks[transforms + *register as usize] = true);
        marks
    };
    let mut needed = registers(results, numbers);
    let mut is_live = vec![false; count];
    for at in (0..count).rev() {
        is_live[at] = wires.writes(at).any(|register| needed[register]);
        if is_live[at] {
            wires.reads(at).for_each(|register| needed[register] = true);
        }
    }
    let moving = |settable: &[N]| -> Vec<bool> {
        let mut moves = registers(&graph.inputs, settable);
        let moves_one = |at: usize| {
            // A spring changes with time alone.
            let is_spring = matches!(graph.steps[at].op, Op::Spring(_));
            let is_moved = wires.is_posed[at] || is_spring || wires.reads(at).any(|register| moves[register]);
            if is_moved {
                wires.writes(at).for_each(|register| moves[register] = true);
            }
            is_moved
        };
        (0..count).map(moves_one).collect()
    };
    let (changes, plays) = (moving(settable), moving(&[]));
    let steps = std::mem::take(&mut graph.steps);
    let of = |wanted: [bool; 2]| {
        let is_wanted = |at: &usize| is_live[*at] && [changes[*at], plays[*at]] == wanted;
        (0..count).filter(is_wanted).map(|at| steps[at]).collect::<Vec<_>>()
    };
    let fixed = of([false, false]);
    graph.steps.extend(of([true, false]));
    let settings = graph.steps.len();
    graph.steps.extend(of([true, true]));
    (fixed, settings)
}
