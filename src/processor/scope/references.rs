//! References of parameters: the nodes that they find, and the treatment of nodes that are off.
//!
//! | accessor | where nodes are off |
//! | --- | --- |
//! | [`BuildScope::resolve`], [`BuildScope::resolve_some`] | they are left out of the list; without any left, `resolve_some` gives [`ModuleError::Off`] |
//! | [`BuildScope::resolve_each`] | their places in the list stay empty, for lists that go with others |
//! | [`BuildScope::resolve_all`], [`BuildScope::resolve_one`] | [`ModuleError::Off`] |
//! | [`BuildScope::resolve_maybe`] | `None`, as if the parameter were left out |
//! | [`BuildScope::resolve_parent`] | what is nearest above them, else the root control, else the rig |
//!
//! A command that ends in [`ModuleError::Off`] has not failed: the build passes it over.

use super::{BuildScope, Read};
use crate::{
    processor::{
        ModuleError,
        exclusion::Gap,
        resolve::{self, Resolution},
        world::NodeId,
    },
    rig::reference::{NodeRefs, Source},
};

impl BuildScope<'_> {
    /// Nodes that references stand for, in order, each once. May be none.
    ///
    /// # Errors
    /// A reference to another rig, to a joint that is not there, or to a place past the end of a list.
    pub fn resolve(&mut self, parameter: &str, references: &NodeRefs) -> Result<Vec<NodeId>, ModuleError> {
        let found = self.resolution(parameter, references)?;
        self.leave_out(&found.gaps);
        Ok(found.nodes)
    }

    /// Nodes that references stand for, at least one; see [`BuildScope::resolve`].
    ///
    /// # Errors
    /// See [`BuildScope::resolve`]; nothing found, with the nearest matches; [`ModuleError::Off`] if all is off.
    pub fn resolve_some(&mut self, parameter: &str, references: &NodeRefs) -> Result<Vec<NodeId>, ModuleError> {
        let found = self.resolution(parameter, references)?;
        if !found.nodes.is_empty() {
            self.leave_out(&found.gaps);
            return Ok(found.nodes);
        }
        Err(self.nothing(parameter, references, &found.gaps))
    }

    /// Nodes that references stand for, at least one, with `None` in the place of each node that is off: for lists
    /// whose places go with those of another list.
    ///
    /// # Errors
    /// See [`BuildScope::resolve_some`].
    pub fn resolve_each(&mut self, parameter: &str, references: &NodeRefs) -> Result<Vec<Option<NodeId>>, ModuleError> {
        let Resolution { nodes, gaps } = self.resolution(parameter, references)?;
        if nodes.is_empty() {
            return Err(self.nothing(parameter, references, &gaps));
        }
        let mut list: Vec<Option<NodeId>> = nodes.into_iter().map(Some).collect();
        // From the end, so that the places before stay.
        gaps.iter().rev().for_each(|gap| list.insert(gap.at, None));
        Ok(list)
    }

    /// Nodes that references stand for, at least one, of which none may be off.
    ///
    /// # Errors
    /// See [`BuildScope::resolve_some`]; [`ModuleError::Off`] if a part of it is off.
    pub fn resolve_all(&mut self, parameter: &str, references: &NodeRefs) -> Result<Vec<NodeId>, ModuleError> {
        let found = self.resolution(parameter, references)?;
        if found.nodes.is_empty() || !found.gaps.is_empty() {
            return Err(self.nothing(parameter, references, &found.gaps));
        }
        Ok(found.nodes)
    }

    /// The one node that references stand for.
    ///
    /// # Errors
    /// See [`BuildScope::resolve_some`]; and more than one.
    pub fn resolve_one(&mut self, parameter: &str, references: &NodeRefs) -> Result<NodeId, ModuleError> {
        match self.resolve_some(parameter, references)?[..] {
            [node] => Ok(node),
            ref nodes => {
                let names: Vec<String> = nodes.iter().take(4).map(|node| self.name(*node)).collect();
                let more = if nodes.len() > 4 { ", ..." } else { "" };
                let problem = format!(
                    "finds {} nodes ({}{more}) where one is needed; narrow it down, for example with pick:START",
                    nodes.len(),
                    names.join(", ")
                );
                Err(ModuleError::reference(parameter, references, problem))
            }
        }
    }

    /// The one node that references stand for; `None` for an empty parameter and for a node that is off.
    ///
    /// # Errors
    /// See [`BuildScope::resolve_one`].
    pub fn resolve_maybe(&mut self, parameter: &str, references: &NodeRefs) -> Result<Option<NodeId>, ModuleError> {
        if references.is_empty() {
            return Ok(None);
        }
        match self.resolve_one(parameter, references) {
            Err(ModuleError::Off { parameter, off }) => {
                self.trace.optional_off = Some((parameter, off));
                Ok(None)
            }
            found => found.map(Some),
        }
    }

    /// The node that something stands on: `None` if the parameter is left out, `Some(None)` for the rig itself. For a
    /// node that is off it is the nearest one above it that is built, else the root control, else the rig.
    ///
    /// # Errors
    /// See [`BuildScope::resolve_one`].
    pub fn resolve_parent(
        &mut self,
        parameter: &str,
        references: &NodeRefs,
    ) -> Result<Option<Option<NodeId>>, ModuleError> {
        if references.is_empty() {
            return Ok(None);
        }
        let found = self.resolution(parameter, references)?;
        if !found.nodes.is_empty() {
            return self.resolve_one(parameter, references).map(|node| Some(Some(node)));
        }
        let means_root = references.iter().any(|reference| reference.source == Source::Root);
        match found.gaps.first() {
            Some(gap) => Ok(Some(gap.above.or_else(|| self.root_control()))),
            None if means_root => Ok(Some(None)),
            None => Err(self.nothing(parameter, references, &[])),
        }
    }

    /// The control that carries the rig: see [`Source::Root`].
    pub fn root_control(&mut self) -> Option<NodeId> {
        let found = self.resolution("root", &Source::Root.into()).ok()?;
        found.nodes.first().copied()
    }

    fn resolution(&mut self, parameter: &str, references: &NodeRefs) -> Result<Resolution, ModuleError> {
        let found = resolve::resolve(self.world, self.asker, references);
        self.world.work += found.as_ref().map_or(1, |found| 1 + found.nodes.len() as u64);
        self.trace.reads.push(Read::References(parameter.into(), references.clone(), found.clone().ok()));
        found.map_err(|error| ModuleError::reference(parameter, references, error.to_string()))
    }

    /// Notes that a list is shorter than it would be.
    fn leave_out(&mut self, gaps: &[Gap]) {
        if self.trace.partial.is_none() {
            self.trace.partial = gaps.first().cloned();
        }
    }

    /// Error of references that find nothing.
    fn nothing(&mut self, parameter: &str, references: &NodeRefs, gaps: &[Gap]) -> ModuleError {
        if let Some(gap) = gaps.first() {
            self.trace.above = gap.above;
            return ModuleError::Off { parameter: parameter.to_owned(), off: gap.off.clone() };
        }
        let nearest = resolve::nearest(self.world, self.asker, references);
        let problem = if references.is_empty() {
            "is needed; refer to a node, such as @this".to_owned()
        } else {
            format!("finds nothing{nearest}; refer to something that exists when this command runs")
        };
        ModuleError::reference(parameter, references, problem)
    }
}
