//! Circles: constraints that drive what they follow.

use std::{collections::HashSet, sync::Arc};

use super::Builder;
use crate::{
    processor::{
        BuildProblem, ModuleError,
        world::{Aspect, NodeId, Value},
    },
    rig::{Constraint, Dependency},
};

/// Places on which the commands of a run depend that were looked at so far, with everything that these depend on: whoever
/// drives none of them closes no circle over them.
#[derive(Default)]
pub(super) struct SettledPlaces {
    places: HashSet<Dependency>,
    run: u32,
    /// Place of the next command in the list.
    next: u32,
}

impl SettledPlaces {
    /// Notes that a command is carried out. Commands that are left out between two of a run may have changed anything.
    pub fn begin(&mut self, run: u32, place: u32) {
        if (self.run, self.next) != (run, place) {
            self.places.clear();
        }
        (self.run, self.next) = (run, place + 1);
    }
}

impl Builder {
    /// Refuses constraints that a command wrote and that close a circle; `place` is that after the command.
    pub(super) fn check_loops(&mut self, writes: &[(NodeId, Aspect)], place: u32) -> Result<(), ModuleError> {
        let mut settled = std::mem::take(&mut self.settled.places);
        for (node, aspect) in writes {
            // A settled place with another parent or another driver depends on more than was looked at.
            let is_settled = match aspect {
                Aspect::Parent => settled.contains(&Dependency::Node(self.world.uid(*node))),
                Aspect::Constraint => self.drives_any(*node, place, &settled),
                _ => false,
            };
            if is_settled {
                settled.clear();
            }
        }
        for (constraint, _) in writes.iter().filter(|(_, aspect)| *aspect == Aspect::Constraint) {
            // An earlier constraint of the command may have looked at what this one drives.
            if self.drives_any(*constraint, place, &settled) {
                settled.clear();
            }
            let seen = self.check_loop(*constraint, place, &settled)?;
            self.world.visited += seen.len() as u64;
            settled.extend(seen);
        }
        self.settled.places = settled;
        Ok(())
    }

    fn drives_any(&self, constraint: NodeId, place: u32, among: &HashSet<Dependency>) -> bool {
        match self.world.read_at(constraint, Aspect::Constraint, place) {
            Some(Value::Constraint(_, data)) => data.drives().iter().any(|driven| among.contains(driven)),
            _ => false,
        }
    }

    /// The first command before `target` that closes a circle which was not there when it ran.
    pub(super) fn loop_before(&mut self, target: u32) -> Option<(u32, BuildProblem)> {
        let from = self.graph_changed.take()?;
        if (target as usize) < self.list.len() {
            self.graph_changed = Some(from.min(target));
        }
        let mut constraints: Vec<(u32, u32, NodeId)> = Vec::new();
        for place in from..target {
            let number = self.list[place as usize];
            let command = &self.commands[number as usize];
            // What ran just now was looked at when it ran.
            if command.ran_in == self.run {
                continue;
            }
            let writes = command.trace.writes.iter();
            let own = writes.filter(|(_, aspect)| *aspect == Aspect::Constraint);
            constraints.extend(own.map(|(node, _)| (place, number, *node)));
        }
        for (place, number, constraint) in constraints {
            if let Err(problem) = self.check_loop(constraint, place + 1, &HashSet::new()) {
                self.graph_changed = Some(from);
                return Some((number, problem.into()));
            }
        }
        None
    }

    /// Refuses a constraint whose input depends on what it drives, which is none of the settled places. Returns what its input
    /// depends on besides them.
    fn check_loop(
        &self,
        constraint: NodeId,
        place: u32,
        settled: &HashSet<Dependency>,
    ) -> Result<HashSet<Dependency>, ModuleError> {
        let mut seen: HashSet<Dependency> = HashSet::new();
        let Some(Value::Constraint(_, data)) = self.world.read_at(constraint, Aspect::Constraint, place) else {
            return Ok(seen);
        };
        let drives = data.drives();
        // Breadth first, in an order that only the rig decides: the shortest way round is told.
        let mut found: Vec<(Dependency, Option<usize>)> = data.reads().into_iter().map(|read| (read, None)).collect();
        let mut next = 0;
        while next < found.len() {
            let at = found[next].0.clone();
            if drives.contains(&at) {
                return Err(ModuleError::Cycle(self.trail(&found, next, place)));
            }
            if !settled.contains(&at) && seen.insert(at.clone()) {
                found.extend(self.depends_on(&at, constraint, place).into_iter().map(|read| (read, Some(next))));
            }
            next += 1;
        }
        Ok(seen)
    }

    /// Dependencies of a place: its parent, and everything that the constraints that drive it read.
    fn depends_on(&self, at: &Dependency, except: NodeId, place: u32) -> Vec<Dependency> {
        let (Dependency::Node(uid) | Dependency::Attribute(uid, _)) = at;
        let Some(node) = self.world.id(*uid) else { return Vec::new() };
        let parent = self.world.parent(node, place).filter(|_| matches!(at, Dependency::Node(_)));
        let mut needs: Vec<Dependency> =
            parent.into_iter().map(|parent| Dependency::Node(self.world.uid(parent))).collect();
        let driven_by = self.world.slots[node.0 as usize].driven_by.iter();
        let mut drivers: Vec<((u32, u32), &Arc<Constraint>)> = driven_by
            .filter(|driver| **driver != except)
            .filter_map(|driver| match self.world.read_at(*driver, Aspect::Constraint, place) {
                Some(Value::Constraint(number, other)) if other.drives().contains(at) => {
                    let creator = self.world.slots[driver.0 as usize].creator?;
                    Some(((self.world.places[creator as usize], *number), other))
                }
                _ => None,
            })
            .collect();
        drivers.sort_by_key(|(key, _)| *key);
        needs.extend(drivers.into_iter().flat_map(|(_, other)| other.reads()));
        needs
    }

    /// The circle in names: from what is driven over what it needs back to itself.
    fn trail(&self, found: &[(Dependency, Option<usize>)], end: usize, place: u32) -> String {
        let mut names = Vec::new();
        let mut at = Some(end);
        while let Some(index) = at {
            names.push(self.dependency_name(&found[index].0, place));
            at = found[index].1;
        }
        names.push(names[0].clone());
        names.reverse();
        names.join(" \u{2192} ")
    }

    fn dependency_name(&self, dependency: &Dependency, place: u32) -> String {
        let (Dependency::Node(uid) | Dependency::Attribute(uid, _)) = dependency;
        let name = self.world.id(*uid).map_or_else(|| uid.to_string(), |node| self.world.name(node, place));
        match dependency {
            Dependency::Node(_) => name,
            Dependency::Attribute(_, attribute) => format!("{name}.{attribute}"),
        }
    }
}
