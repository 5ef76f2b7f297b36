//! Errors about references as people wrote them: with the names that stand in the parameters, and the nearest ones
//! where a name has nobody left.

use std::borrow::Cow;

use super::{
    error::{BuildProblem, ModuleError},
    world::{NOWHERE, World},
};
use crate::rig::{
    Uid,
    reference::{NameKind, NameScope, Names, NodeRefs, nearest_to_gone, written_as},
};

/// The names in a world that is being built, as the commands before a place left it.
struct WorldNames<'a> {
    world: &'a World,
    place: u32,
}

impl Names for WorldNames<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        let node = || {
            let node = self.world.id(uid).filter(|node| self.world.exists(*node, self.place))?;
            Some(Cow::Borrowed(self.world.label(node, self.place).map_or("", |label| label)))
        };
        // A builder keeps the numbers of commands that are gone for a while.
        let is_there = |number: &u32| self.world.places[*number as usize] != NOWHERE;
        let command = || self.world.creator_of(uid).filter(is_there).map(|_| Cow::Borrowed(""));
        match kind {
            // What is built knows no names of these; the document watches over them.
            NameKind::Rig | NameKind::Group => Some(Cow::Borrowed("")),
            NameKind::Joint | NameKind::Input => node(),
            NameKind::Command => command(),
            NameKind::Label => node().or_else(command),
        }
    }

    fn find(&self, _: NameScope, _: NameKind, _: &str) -> Vec<Uid> {
        Vec::new()
    }

    fn all(&self, _: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        match kind {
            NameKind::Joint | NameKind::Label => {
                let there = self.world.joints.iter().filter(|node| self.world.exists(**node, self.place));
                there
                    .filter_map(|node| self.world.label(*node, self.place))
                    .map(|label| Cow::Borrowed(&**label))
                    .collect()
            }
            NameKind::Input => self.world.declared.iter().map(|input| Cow::Borrowed(&*input.name)).collect(),
            _ => Vec::new(),
        }
    }
}

/// A problem of a command with those parameters, with its reference as it is written there.
pub(super) fn as_written(problem: ModuleError, params: &str, world: &World, place: u32) -> BuildProblem {
    let ModuleError::Reference { parameter, reference, problem } = problem else { return problem.into() };
    let Ok(references) = reference.parse::<NodeRefs>() else {
        return ModuleError::Reference { parameter, reference, problem }.into();
    };
    let gone = nearest_to_gone(params, &references, &WorldNames { world, place });
    let reference = written_as(params, &references);
    ModuleError::Reference { parameter, reference, problem: problem + &gone }.into()
}
