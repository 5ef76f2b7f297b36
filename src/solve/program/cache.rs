//! Cache of programs, shared by equal content.

use std::{
    collections::BTreeMap,
    sync::{Arc, Weak},
};

use super::{CompileOptions, ContentHash, ProgramError, RigProgram, hash::ConstraintHashes};
use crate::rig::BuiltRig;

/// Programs that are in use, by the hash of their content.
#[derive(Debug, Default)]
pub struct ProgramCache {
    programs: BTreeMap<ContentHash, Weak<RigProgram>>,
    hashes: ConstraintHashes,
}

impl ProgramCache {
    /// The program of a built rig: a cached one, or a compiled one. The cache forgets it when its last instance is
    /// dropped.
    ///
    /// # Errors
    ///
    /// See [`RigProgram::compile`].
    pub fn get(&mut self, rig: &BuiltRig, options: &CompileOptions) -> Result<Arc<RigProgram>, ProgramError> {
        let hash = self.hashes.of(rig, options);
        if let Some(program) = self.programs.get(&hash).and_then(Weak::upgrade) {
            return Ok(program);
        }
        self.programs.retain(|_, program| program.strong_count() > 0);
        let program = Arc::new(RigProgram::compile_hashed(rig, options, hash)?);
        self.programs.insert(hash, Arc::downgrade(&program));
        Ok(program)
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
