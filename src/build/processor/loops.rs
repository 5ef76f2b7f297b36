//! Circles: constraints that drive what they follow.

use std::collections::HashSet;

use super::Builder;
use crate::{
    build::{
        BuildProblem, ModuleError,
        world::{Aspect, NodeId, Value},
    },
    rig::Dependency,
};

impl Builder {
    /// The first command before `target` that closes a circle which was not there when it ran.
    pub(super) fn loop_before(&mut self, target: u32) -> Option<(u32, BuildProblem)> {
        let from = self.graph_changed.take()?;
        if (target as usize) < self.list.len() {
            self.graph_changed = Some(from.min(target));
        }
        let mut constraints: Vec<(u32, u32, NodeId)> = Vec::new();
        for place in from..target {
            let number = self.list[place as usize];
            let writes = self.commands[number as usize].trace.writes.iter();
            let own = writes.filter(|(_, aspect)| *aspect == Aspect::Constraint);
            constraints.extend(own.map(|(node, _)| (place, number, *node)));
        }
        for (place, number, constraint) in constraints {
            if let Err(problem) = self.check_loop(constraint, place + 1) {
                self.graph_changed = Some(from);
                return Some((number, problem.into()));
            }
        }
        None
    }

    /// Refuses a constraint whose input depends on what it drives.
    pub(super) fn check_loop(&self, constraint: NodeId, place: u32) -> Result<(), ModuleError> {
        let Some(Value::Constraint(_, data)) = self.world.read_at(constraint, Aspect::Constraint, place) else {
            return Ok(());
        };
        let drives = data.drives();
        let mut seen: HashSet<Dependency> = HashSet::new();
        let mut path: Vec<(Dependency, usize)> = data.reads().into_iter().map(|read| (read, 0)).collect();
        let mut trail: Vec<Dependency> = Vec::new();
        while let Some((at, depth)) = path.pop() {
            trail.truncate(depth);
            if drives.contains(&at) {
                trail.push(at);
                let names: Vec<String> = trail.iter().map(|at| self.dependency_name(at, place)).collect();
                let first = drives.first().map(|at| self.dependency_name(at, place)).unwrap_or_default();
                let shown = if names.first() == Some(&first) { String::new() } else { format!("{first} \u{2192} ") };
                return Err(ModuleError::Cycle(format!("{shown}{}", names.join(" \u{2192} "))));
            }
            if !seen.insert(at.clone()) {
                continue;
            }
            trail.push(at.clone());
            let depth = trail.len();
            let (Dependency::Node(uid) | Dependency::Attribute(uid, _)) = &at;
            let Some(node) = self.world.id(*uid) else { continue };
            if matches!(at, Dependency::Node(_))
                && let Some(parent) = self.world.parent(node, place)
            {
                path.push((Dependency::Node(self.world.uid(parent)), depth));
            }
            for driver in &self.world.slots[node.0 as usize].driven_by {
                if let Some(Value::Constraint(_, other)) = self.world.read_at(*driver, Aspect::Constraint, place)
                    && *driver != constraint
                    && other.drives().contains(&at)
                {
                    path.extend(other.reads().into_iter().map(|read| (read, depth)));
                }
            }
        }
        Ok(())
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
