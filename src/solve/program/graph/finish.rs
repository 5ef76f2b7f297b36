//! Completion of a graph: the operations that make the final values of nodes, attributes and morph targets.

use bevy::platform::collections::HashMap;

use super::{DrivenRegister, Graph, NodeState};
use crate::{
    rig::AttributeKind,
    solve::program::op::{N, Op, Operand, Span, X},
};

impl Graph<'_> {
    /// Ends every node, attribute and morph target with the operation that makes its final value. No node is looked up
    /// by its uid afterwards.
    ///
    /// Returns the driven register of each node.
    pub(in super::super) fn finish(&mut self) -> Vec<DrivenRegister> {
        for node in 0..self.rig.nodes.len() {
            self.close(node);
            let (parent, out) = (self.parent(node), self.global(node));
            if let Some(transform) = self.nodes[node].whole {
                let op = &mut self.tables.transforms[transform as usize];
                op.out = out;
                op.is_global = true;
                continue;
            }
            let op = match self.nodes[node].local {
                Some(local) => Op::Global { parent, local, out },
                None => Op::Node { pose: self.pose(node), base: self.base(node), parent, out },
            };
            self.push(op, node, None);
        }
        let mut moved: HashMap<X, X> = HashMap::default();
        for (node, register) in std::mem::take(&mut self.aliases) {
            let state = &self.nodes[node];
            match state.placed {
                Some(placed) if state.local != Some(placed) => {
                    self.push(Op::Global { parent: self.parent(node), local: placed, out: register }, node, None);
                }
                _ => {
                    moved.insert(register, self.global(node));
                }
            }
        }
        self.finish_attributes();
        self.finish_morphs();
        for step in &mut self.steps {
            step.op.visit(&mut self.tables, |operand| {
                if let Operand::ReadX(register) = operand
                    && let Some(to) = moved.get(register)
                {
                    *register = *to;
                }
            });
        }
        // What found nodes makes room for the program.
        self.index = HashMap::default();
        self.built = Vec::new();
        let driven = |state: &NodeState| match (state.local, state.whole) {
            (None, _) => DrivenRegister::Not,
            (Some(_), Some(_)) => DrivenRegister::Global,
            (Some(local), None) => DrivenRegister::Local(local),
        };
        self.nodes.iter().map(driven).collect()
    }

    fn finish_attributes(&mut self) {
        let mut driven: Vec<((usize, usize), N)> = self.driven.drain().collect();
        driven.sort_unstable();
        for ((node, number), input) in driven {
            let attribute = &self.rig.nodes[node].attributes[number];
            let (low, high) = match &attribute.kind {
                AttributeKind::Number { min, max } => (min.unwrap_or(f32::NEG_INFINITY), max.unwrap_or(f32::INFINITY)),
                AttributeKind::Choice(names) => (0.0, names.len().saturating_sub(1) as f32),
            };
            self.tables.ends.push([low, high, attribute.default]);
            let ends = self.tables.ends.len() as u32 - 1;
            let out = self.nodes[node].attributes[number];
            self.push(Op::Clamp { input, ends, out }, node, None);
        }
    }

    fn finish_morphs(&mut self) {
        for (name, terms) in std::mem::take(&mut self.morph_terms) {
            let out = self.new_n(0.0);
            let list = Span { start: self.tables.numbers.len() as u32, len: terms.len() as u32 };
            self.tables.numbers.extend(terms);
            self.push(Op::Sum { list, out }, self.rig.nodes.len(), None);
            self.morphs.push((name, out));
        }
    }
}
