//! Layout of a program: the order of its operations, the numbers of its registers, and the operations that read each of them.
//!
//! It follows from the shape of the graph alone: from which operation reads and writes which register, not from the numbers in
//! constraints and bases. Rigs that differ in numbers only share one, so that it is worked out once.

use std::sync::Arc;

use super::{
    ProgramError,
    graph::{Graph, Step},
    lists::Lists,
    op::{N, Op, Operand, Pose, X},
    order::{self, Wires},
};

/// Most layouts that are kept.
const KEPT: usize = 8;

/// Layouts that were used last, the latest first.
#[derive(Debug, Default)]
pub(super) struct Layouts(Vec<Arc<Layout>>);

impl Layouts {
    /// The layout of a graph.
    pub fn of(&mut self, graph: &mut Graph<'_>, ends: Ends) -> Result<Arc<Layout>, ProgramError> {
        let shape = Shape::of(graph, ends);
        let layout = match self.0.iter().position(|known| known.shape == shape) {
            Some(at) => self.0.remove(at),
            None => Arc::new(Layout::new(graph, shape)?),
        };
        self.0.insert(0, Arc::clone(&layout));
        self.0.truncate(KEPT);
        Ok(layout)
    }
}

/// Registers and poses that a program has whatever its operations are, in the order in which they get their numbers.
#[derive(Debug, PartialEq)]
pub(super) struct Ends {
    /// Rig transforms of the kept nodes.
    pub results: Vec<X>,
    /// Registers of attributes and morph targets, and how many of them are attributes.
    pub numbers: Vec<N>,
    pub attributes: usize,
    /// Attributes that can be set.
    pub settable: Vec<N>,
    /// Pose of each kept node and the register of its driven local transform.
    pub nodes: Vec<(Pose, Option<X>)>,
}

/// Shape of a program, from which its layout follows.
#[derive(Debug, PartialEq)]
pub(super) struct Shape {
    pub wires: Wires,
    /// Node of each operation.
    pub nodes: Vec<u32>,
    /// Operations that only repeat their parent's transform, with it and with the register that they write.
    pub repeats: Vec<(u32, X, X)>,
    /// Springs with the number of their state.
    pub springs: Vec<(u32, u32)>,
    pub inputs: Vec<X>,
    pub ends: Ends,
}

impl Shape {
    fn of(graph: &mut Graph<'_>, ends: Ends) -> Self {
        let (transforms, numbers) = (graph.x.len(), graph.n.len());
        let wires = Wires::of(&mut graph.steps, &mut graph.tables, transforms, numbers);
        let (mut repeats, mut springs) = (Vec::new(), Vec::new());
        for (step, at) in graph.steps.iter().zip(0..) {
            match step.op {
                Op::Node { pose: Pose::NONE, base: 0, parent, out } if !graph.is_kept(step.node) => {
                    repeats.push((at, parent, out));
                }
                Op::Spring(state) => springs.push((at, state)),
                _ => {}
            }
        }
        let nodes = graph.steps.iter().map(|step| step.node as u32).collect();
        Self { wires, nodes, repeats, springs, inputs: graph.inputs.clone(), ends }
    }
}

/// See the [module](self).
#[derive(Debug)]
pub(super) struct Layout {
    shape: Shape,
    /// The steps that become operations, in their order, and those that run once.
    ops: Vec<u32>,
    fixed: Vec<u32>,
    /// Number of operations at the start that depend on attributes only: values that people set once rather than animate.
    pub settings: usize,
    /// Register to read in the stead of each register of transforms.
    same: Vec<X>,
    /// Final numbers of the registers and poses, and the registers in the order of their numbers.
    x: Numbers,
    n: Numbers,
    pose: Numbers,
    /// Operations that read each pose, attribute and input, each register (transforms first), and the registers that each
    /// operation writes.
    pub pose_readers: Lists,
    pub attribute_readers: Lists,
    pub input_readers: Lists,
    pub readers: Lists,
    pub op_readers: Lists,
    /// The operation of each spring.
    pub spring_ops: Vec<u32>,
}

impl Layout {
    fn new(graph: &Graph<'_>, shape: Shape) -> Result<Self, ProgramError> {
        let order = order::sort(graph, &shape)?;
        let mut same: Vec<X> = (0..graph.x.len() as u32).map(X).collect();
        // In the order of operations, parents come before those that repeat them.
        let mut repeated = vec![None; graph.steps.len()];
        shape.repeats.iter().for_each(|(at, parent, out)| repeated[*at as usize] = Some((*parent, *out)));
        for (X(parent), X(out)) in order.iter().filter_map(|at| repeated[*at as usize]) {
            same[out as usize] = same[parent as usize];
        }
        let order::Split { fixed, ops, settings } = order::split(&shape, &order, &same);
        let mut layout = Self {
            ops,
            fixed,
            settings,
            same,
            x: Numbers::new(graph.x.len()),
            n: Numbers::new(graph.n.len()),
            pose: Numbers::new(graph.rig.nodes.len()),
            pose_readers: Lists::default(),
            attribute_readers: Lists::default(),
            input_readers: Lists::default(),
            readers: Lists::default(),
            op_readers: Lists::default(),
            spring_ops: Vec::new(),
            shape,
        };
        layout.number();
        layout.connect();
        Ok(layout)
    }

    /// Hands out final numbers in the order in which registers are first seen; the rig's space stays the first.
    fn number(&mut self) {
        let Self { shape, ops, same, x, n, pose, .. } = self;
        x.of(X::RIG.0);
        shape.ends.results.iter().chain(&shape.inputs).for_each(|register| _ = x.of(register.0));
        shape.ends.numbers.iter().for_each(|register| _ = n.of(register.0));
        for (posed, local) in &shape.ends.nodes {
            if *posed != Pose::NONE {
                pose.of(posed.0);
            }
            local.iter().for_each(|local| _ = x.of(local.0));
        }
        let transforms = shape.wires.transforms as u32;
        for at in ops.iter().map(|at| *at as usize) {
            for register in shape.wires.read_by(at) {
                match register.checked_sub(transforms) {
                    Some(number) => n.of(number),
                    None => x.of(same[*register as usize].0),
                };
            }
            for register in shape.wires.written_by(at) {
                match register.checked_sub(transforms) {
                    Some(number) => n.of(number),
                    None => x.of(*register),
                };
            }
            if shape.wires.poses[at] != Pose::NONE {
                pose.of(shape.wires.poses[at].0);
            }
        }
    }

    /// Collects the operations that read each pose, attribute, input and register.
    fn connect(&mut self) {
        let Self { shape, ops, same, x, n, pose, .. } = &*self;
        let (transforms, before) = (x.order.len(), shape.wires.transforms as u32);
        let place = |register: u32| match register.checked_sub(before) {
            Some(number) => transforms as u32 + n.number(number),
            None => x.number(register),
        };
        let (mut poses, mut reads) = (Vec::new(), Vec::new());
        for (step, at) in ops.iter().map(|step| *step as usize).zip(0_u32..) {
            for register in shape.wires.read_by(step) {
                let register = if *register < before { same[*register as usize].0 } else { *register };
                reads.push((place(register), at));
            }
            if shape.wires.poses[step] != Pose::NONE {
                poses.push((pose.number(shape.wires.poses[step].0), at));
            }
        }
        let readers = Lists::new(transforms + n.order.len(), &reads);
        let pairs =
            |list: usize, register: usize| readers.get(register).iter().map(move |reader| (list as u32, *reader));
        let attributes: Vec<_> = (0..shape.ends.attributes).flat_map(|slot| pairs(slot, transforms + slot)).collect();
        let first = shape.ends.results.len() + 1;
        let inputs: Vec<_> = (0..shape.inputs.len()).flat_map(|input| pairs(input, first + input)).collect();
        let written = |(at, step): (usize, &u32)| {
            let registers = shape.wires.written_by(*step as usize).iter();
            registers.flat_map(move |register| pairs(at, place(*register) as usize))
        };
        let written: Vec<_> = ops.iter().enumerate().flat_map(written).collect();
        let mut spring_ops = Vec::new();
        let mut springs = vec![None; shape.nodes.len()];
        shape.springs.iter().for_each(|(step, state)| springs[*step as usize] = Some(*state as usize));
        for (step, at) in ops.iter().zip(0..) {
            let Some(state) = springs[*step as usize] else { continue };
            if spring_ops.len() <= state {
                spring_ops.resize(state + 1, u32::MAX);
            }
            spring_ops[state] = at;
        }
        let posable = shape.ends.nodes.iter().filter(|(pose, _)| *pose != Pose::NONE).count();
        let lists = [
            Lists::new(posable, &poses),
            Lists::new(shape.ends.attributes, &attributes),
            Lists::new(shape.inputs.len(), &inputs),
            Lists::new(ops.len(), &written),
            readers,
        ];
        [self.pose_readers, self.attribute_readers, self.input_readers, self.op_readers, self.readers] = lists;
        self.spring_ops = spring_ops;
    }

    /// The operations of a graph with this layout, with final numbers.
    pub fn ops(&self, graph: &mut Graph<'_>) -> Vec<Op> {
        let of = |graph: &mut Graph<'_>, step: u32| {
            let mut op = graph.steps[step as usize].op;
            op.visit(&mut graph.tables, |operand| match operand {
                Operand::ReadX(x) => *x = X(self.x.number(self.same[x.0 as usize].0)),
                Operand::WriteX(x) => *x = X(self.x.number(x.0)),
                Operand::ReadN(n) | Operand::WriteN(n) => *n = N(self.n.number(n.0)),
                Operand::Pose(pose) => *pose = self.posed(*pose),
            });
            op
        };
        self.ops.iter().map(|step| of(graph, *step)).collect()
    }

    /// The operations of a graph with this layout that run once, on the graph's registers.
    pub fn fixed(&self, graph: &mut Graph<'_>) -> Vec<Op> {
        let of = |graph: &mut Graph<'_>, step: u32| {
            let Step { mut op, .. } = graph.steps[step as usize];
            op.visit(&mut graph.tables, |operand| {
                if let Operand::ReadX(x) = operand {
                    *x = self.same[x.0 as usize];
                }
            });
            op
        };
        self.fixed.iter().map(|step| of(graph, *step)).collect()
    }

    /// Registers that an operation writes, by their final numbers: transforms first.
    pub fn written_by(&self, op: usize) -> impl Iterator<Item = usize> {
        let (transforms, before) = (self.x.order.len(), self.shape.wires.transforms as u32);
        let written = self.shape.wires.written_by(self.ops[op] as usize).iter();
        written.map(move |register| match register.checked_sub(before) {
            Some(number) => transforms + self.n.number(number) as usize,
            None => self.x.number(*register) as usize,
        })
    }

    /// Final number of a pose.
    pub fn posed(&self, pose: Pose) -> Pose {
        if pose == Pose::NONE { pose } else { Pose(self.pose.number(pose.0)) }
    }

    /// Final number of a register.
    pub fn placed(&self, X(register): X) -> X {
        X(self.x.number(register))
    }

    /// Number of poses.
    pub fn poses(&self) -> usize {
        self.pose.order.len()
    }

    /// Registers of a graph in the order of their final numbers.
    pub fn registers<T: Copy, V: Copy>(&self, x: &[T], n: &[V]) -> (Vec<T>, Vec<V>) {
        let transforms = self.x.order.iter().map(|register| x[*register as usize]);
        (transforms.collect(), self.n.order.iter().map(|register| n[*register as usize]).collect())
    }
}

/// Numbers handed out one after the other.
#[derive(Debug)]
struct Numbers {
    /// Number of each item; [`Numbers::NONE`] without one.
    of: Vec<u32>,
    /// Items in the order of their numbers.
    order: Vec<u32>,
}

impl Numbers {
    const NONE: u32 = u32::MAX;

    fn new(count: usize) -> Self {
        Self { of: vec![Self::NONE; count], order: Vec::new() }
    }

    /// The number of an item, which gets the next one if it has none.
    fn of(&mut self, item: u32) -> u32 {
        let number = &mut self.of[item as usize];
        if *number == Self::NONE {
            *number = self.order.len() as u32;
            self.order.push(item);
        }
        *number
    }

    /// The number that an item has.
    fn number(&self, item: u32) -> u32 {
        self.of[item as usize]
    }
}
