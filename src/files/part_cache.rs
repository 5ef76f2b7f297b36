//! Parts, and parameters for the other side of characters, of one who reads the same templates again and again.

use std::{
    collections::{BTreeMap, HashMap},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

use crate::{processor::Modules, rig::part::Part};

/// Parts that were read from files, with the contents that these had, and parameters that were mirrored: for one who reads the
/// same templates again and again, with the same modules. Parts that have others in them are not among them.
#[derive(Debug, Default)]
pub struct PartCache {
    parts: BTreeMap<PathBuf, (Vec<u8>, Arc<Part>)>,
    pub(super) mirrored: Arc<MirroredParams>,
}

impl PartCache {
    pub(super) fn part(&self, path: &Path, content: &[u8]) -> Option<&Arc<Part>> {
        self.parts.get(path).filter(|(known, _)| known == content).map(|(_, part)| part)
    }

    pub(super) fn insert(&mut self, path: PathBuf, content: Vec<u8>, part: Arc<Part>) {
        self.parts.insert(path, (content, part));
    }

    /// Forgets the parts of all other files, and the parameters that were not asked for since the last time.
    pub fn keep<'f>(&mut self, files: impl IntoIterator<Item = &'f PathBuf>) {
        let mut known = std::mem::take(&mut self.parts);
        self.parts = files.into_iter().filter_map(|file| known.remove_entry(file)).collect();
        self.mirrored.forget_unused();
    }
}

/// Mirrored parameters by those of the first side, of each module; `None` for what the module cannot read.
type MirroredTexts = HashMap<String, HashMap<String, Option<String>>>;

/// Parameters of modules with the values that they have on the other side of a character: those that were asked for since the last
/// time that others were forgotten, and those from before.
#[derive(Debug, Default)]
pub(super) struct MirroredParams(Mutex<[MirroredTexts; 2]>);

impl MirroredParams {
    /// Parameters of a module for the other side; `None` if there is no such module, or it cannot read them.
    pub fn of(&self, modules: &Modules, module: &str, params: &str) -> Option<String> {
        let info = modules.get(module)?;
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let [now, before] = &mut *texts;
        if let Some(mirrored) = now.get(module).and_then(|texts| texts.get(params)) {
            return mirrored.clone();
        }
        let known = before.get_mut(module).and_then(|texts| texts.remove_entry(params));
        let (params, mirrored) = known.unwrap_or_else(|| (params.to_owned(), info.mirrored(params).ok()));
        now.entry(module.to_owned()).or_default().insert(params, mirrored.clone());
        mirrored
    }

    fn forget_unused(&self) {
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let [now, before] = &mut *texts;
        *before = std::mem::take(now);
    }
}
