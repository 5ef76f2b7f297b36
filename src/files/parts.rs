//! Templates with parts: the files of the parts are found, and put into the template.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{Disk, read_capped};
use crate::{
    modules,
    processor::Modules,
    rig::{
        Rig, SourceError,
        template::{self, Template, read_template, text_of},
    },
};

/// Largest depth of parts in parts.
const DEPTH: usize = 16;

/// Reader of templates with their parts. It notes the files of the parts that it has read.
pub struct PartFiles<'a> {
    disk: &'a dyn Disk,
    modules: Modules,
    /// Files of parts, with their content.
    pub read: BTreeMap<PathBuf, Vec<u8>>,
    known: BTreeMap<PathBuf, Arc<Rig>>,
    open: Vec<PathBuf>,
}

impl<'a> PartFiles<'a> {
    /// A reader that mirrors the parameters of Rigsmith's own modules.
    pub fn new(disk: &'a dyn Disk) -> Self {
        Self::with_modules(disk, modules::all())
    }

    /// A reader that mirrors the parameters of these modules.
    pub fn with_modules(disk: &'a dyn Disk, modules: Modules) -> Self {
        Self { disk, modules, read: BTreeMap::new(), known: BTreeMap::new(), open: Vec::new() }
    }

    /// Reads a template with its parts, whose files are relative to the folder of `path`, the template's own file.
    ///
    /// # Errors
    /// A template that is none; a part that cannot be read or does not fit, at its place in the template.
    pub fn complete(&mut self, path: &Path, bytes: &[u8]) -> Result<Template, SourceError> {
        let template = read_template(bytes)?;
        self.put_together(path, text_of(bytes)?, template)
    }

    /// Puts the parts into a template that has been read from a text.
    ///
    /// # Errors
    /// See [`complete`](Self::complete).
    pub fn put_together(&mut self, path: &Path, text: &str, template: Template) -> Result<Template, SourceError> {
        if template.parts.is_empty() {
            return Ok(template);
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let modules = self.modules.clone();
        let mirror = |module: &str, params: &str| modules.get(module)?.mirrored(params).ok();
        template.with_parts(text, &mut |part| self.part(&folder.join(part)), &mirror)
    }

    fn part(&mut self, path: &Path) -> Result<Arc<Rig>, String> {
        if let Some(known) = self.known.get(path) {
            return Ok(known.clone());
        }
        if self.open.iter().any(|open| open == path) || self.open.len() >= DEPTH {
            return Err(format!("`{}` is a part of itself; take it out of one of the files", path.display()));
        }
        let bytes = read_capped(self.disk, path, template::MAX_BYTES as u64).map_err(|error| error.to_string())?;
        self.open.push(path.to_owned());
        let template = self.complete(path, &bytes);
        self.open.pop();
        self.read.insert(path.to_owned(), bytes);
        let part = Arc::new(template.map_err(|error| format!("`{}`: {error}", path.display()))?.rig);
        self.known.insert(path.to_owned(), part.clone());
        Ok(part)
    }
}
