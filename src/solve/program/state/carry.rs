//! Motion that goes on through a rebuild: inputs and springs of one instance for another program.

use super::RigState;

impl RigState {
    /// Takes over poses, attribute values, inputs and the motion of springs from an instance of another program of the
    /// same rig. Nodes, attributes and springs are matched by uid and name; what the other instance does not have stays
    /// as it was built.
    pub fn carry_over(&mut self, other: &Self) {
        for slot in 0..self.program.nodes.len() {
            let Some(from) = other.program.node(self.program.nodes[slot].uid) else { continue };
            self.set_offset_at(slot, other.offset_at(from));
        }
        for slot in 0..self.program.attributes.len() {
            let attribute = &self.program.attributes[slot];
            let node = self.program.nodes[attribute.node].uid;
            if let Some(from) = other.program.attribute(node, &attribute.name)
                && other.program.attributes[from].is_settable
            {
                self.set_attribute_at(slot, other.n[from]);
            }
        }
        for slot in 0..self.program.inputs.len() {
            if let Some(from) = other.program.input(self.program.inputs[slot]) {
                self.set_input_at(slot, other.x[other.program.nodes.len() + 1 + from]);
            }
        }
        for (own, op) in self.springs.iter_mut().zip(&self.program.tables.springs) {
            let from = other.program.tables.springs.iter().position(|known| known.constraint == op.constraint);
            if let Some(state) = from.and_then(|from| other.springs.get(from)) {
                *own = *state;
            }
        }
    }
}
