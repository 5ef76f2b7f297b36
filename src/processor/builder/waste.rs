//! Nodes and commands that are gone: they are kept, since undoing brings them back as they were, until they are most of what is
//! kept.

use super::Builder;
use crate::{
    processor::world::{Aspect, NOWHERE, NodeId},
    rig::Rig,
};

/// Number of kept nodes and commands up to which none is dropped.
pub(super) const FEW: usize = 8192;

impl Builder {
    /// Starts over where most of the kept nodes and commands are gone, so that a long day of edits takes no more memory than
    /// a short one. The commands that are in effect are carried out again, and so the same is built.
    pub(super) fn drop_waste(&mut self, rig: &Rig) {
        if self.kept() < self.next_count {
            return;
        }
        let alive = self.alive();
        self.next_count = FEW.max(2 * self.kept());
        if 2 * alive > self.kept() {
            return;
        }
        let place = self.cursor();
        let mut fresh = Self::new(self.modules.clone());
        fresh.range = self.range.clone();
        fresh.breakpoints = std::mem::take(&mut self.breakpoints);
        fresh.run = self.run;
        fresh.sync(rig);
        fresh.run_to(place);
        for (number, tag) in fresh.world.commands.iter().enumerate() {
            if let Some(before) = self.world.creator_of(*tag).map(|before| &self.commands[before as usize]) {
                let command = &mut fresh.commands[number];
                (command.runs, command.micros) = (before.runs, before.micros);
            }
        }
        // Carrying out again what was in effect is no news.
        fresh.world.visited = self.world.visited;
        fresh.world.followed = self.world.followed;
        (fresh.world.work, fresh.world.work_before) = (self.world.work, self.world.work_before);
        fresh.next_count = FEW.max(2 * fresh.kept());
        *self = fresh;
    }

    /// Number of nodes, constraints and switches that the document or a command in the list makes, and of those commands.
    fn alive(&self) -> usize {
        let is_there = |node: &NodeId| {
            let aspects = [Aspect::Birth, Aspect::Constraint, Aspect::Switch];
            aspects.into_iter().any(|aspect| self.world.read_at(*node, aspect, NOWHERE).is_some())
        };
        (0..self.world.slots.len() as u32).map(NodeId).filter(is_there).count() + self.list.len()
    }
}
