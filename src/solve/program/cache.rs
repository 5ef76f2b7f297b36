//! Cache of programs, shared by equal content.

use std::{
    collections::BTreeMap,
    sync::{Arc, Weak},
};

use bevy::platform::collections::HashMap;

use super::{CompileOptions, ContentHash, ProgramError, RigProgram, hash::of_constraint, layout::Layouts};
use crate::{
    rig::{BuiltRig, Constraint},
    solve::expression::Expression,
};

/// Programs that are in use, by the hash of their content.
#[derive(Debug, Default)]
pub struct ProgramCache {
    programs: BTreeMap<ContentHash, Weak<RigProgram>>,
    hashes: ByConstraint<u128>,
    expressions: ByConstraint<Arc<Expression>>,
    layouts: Layouts,
}

impl ProgramCache {
    /// The program of a built rig: a cached one, or a compiled one. The cache forgets it when its last instance is
    /// dropped.
    ///
    /// # Errors
    ///
    /// See [`RigProgram::compile`].
    pub fn get(&mut self, rig: &BuiltRig, options: &CompileOptions) -> Result<Arc<RigProgram>, ProgramError> {
        let hash =
            ContentHash::with(rig, options, |constraint| self.hashes.of(constraint, || of_constraint(constraint)));
        self.hashes.forget_unused();
        if let Some(program) = self.programs.get(&hash).and_then(Weak::upgrade) {
            return Ok(program);
        }
        self.programs.retain(|_, program| program.strong_count() > 0);
        let Self { expressions, layouts, .. } = self;
        let program = Arc::new(RigProgram::compile_hashed(rig, options, hash, expressions, layouts)?);
        self.expressions.forget_unused();
        self.programs.insert(hash, Arc::downgrade(&program));
        Ok(program)
    }

    /// Adds a program that was compiled elsewhere; later requests with equal content share it.
    pub fn adopt(&mut self, program: &Arc<RigProgram>) {
        let known = self.programs.entry(program.hash()).or_default();
        if known.strong_count() == 0 {
            *known = Arc::downgrade(program);
        }
    }

    /// Number of programs that are in use.
    pub fn len(&self) -> usize {
        self.programs.values().filter(|program| program.strong_count() > 0).count()
    }

    /// Returns `true` if no program is in use.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Results that follow from constraints in use, kept so that a change of one constraint does not make it for the others again.
#[derive(Debug)]
pub(super) struct ByConstraint<T> {
    /// Values by address of their constraints. The weak reference keeps the address from being given to another one.
    known: HashMap<usize, (Weak<Constraint>, T)>,
    /// Number of entries after the last removal of those out of use.
    kept: usize,
}

impl<T> Default for ByConstraint<T> {
    fn default() -> Self {
        Self { known: HashMap::default(), kept: 0 }
    }
}

impl<T: Clone> ByConstraint<T> {
    /// Kept result of a constraint, or the one that `make` gives.
    pub fn of(&mut self, constraint: &Arc<Constraint>, make: impl FnOnce() -> T) -> T {
        let known = self.known.entry(Arc::as_ptr(constraint).addr());
        known.or_insert_with(|| (Arc::downgrade(constraint), make())).1.clone()
    }

    /// Value of a constraint where making it may fail; nothing is kept of a failure.
    pub fn try_of<E>(&mut self, constraint: &Arc<Constraint>, make: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
        match self.known.get(&Arc::as_ptr(constraint).addr()) {
            Some((_, known)) => Ok(known.clone()),
            None => make().map(|made| self.of(constraint, || made)),
        }
    }

    /// Drops entries of constraints that are no longer in use, once they are many.
    pub fn forget_unused(&mut self) {
        if self.known.len() > 2 * self.kept + 64 {
            self.known.retain(|_, (constraint, _)| constraint.strong_count() > 0);
            self.kept = self.known.len();
        }
    }
}
