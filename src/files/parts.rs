//! Templates with parts: the files of the parts are found, and put into the template.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{Disk, ReadError, read_capped};
use crate::{
    modules,
    processor::Modules,
    rig::{
        Rig, SourceError,
        part::{Part, PartError},
        template::{self, Template, read_template, text_of},
    },
};

macro_rules! bundled {
    ($($name:literal),* $(,)?) => {
        &[$((concat!("parts/", $name, ".rig.ron"), include_str!(concat!("../../assets/templates/parts/", $name, ".rig.ron")))),*]
    };
}

/// Parts that come with Rigsmith, by the names that templates call them.
pub const BUNDLED_PARTS: &[(&str, &str)] = bundled![
    "arm",
    "eye",
    "fk_chain",
    "front_leg",
    "hand",
    "ikfk_chain",
    "jaw",
    "leg",
    "leg_3joint",
    "neck_head",
    "single_control",
    "spine",
    "spring_chain",
    "tail",
    "wing",
];

/// Characters that come with Rigsmith, by name.
pub const BUNDLED_CHARACTERS: &[(&str, &str)] = &[
    ("biped", include_str!("../../assets/templates/biped.rig.ron")),
    ("bird", include_str!("../../assets/templates/bird.rig.ron")),
    ("hand", include_str!("../../assets/templates/hand.rig.ron")),
    ("quadruped", include_str!("../../assets/templates/quadruped.rig.ron")),
];

/// The characters that come with Rigsmith, with their parts.
pub fn bundled_characters() -> Vec<Arc<Rig>> {
    let none = BTreeMap::new();
    let read = |(name, text): &(&str, &str)| {
        let template = PartFiles::given(&none).complete(Path::new(name), text.as_bytes());
        template.ok().map(|template| Arc::new(template.rig))
    };
    BUNDLED_CHARACTERS.iter().filter_map(read).collect()
}

/// Parts that come with Rigsmith, by name.
pub fn bundled_parts() -> Vec<(&'static str, Arc<Rig>)> {
    let none = BTreeMap::new();
    let read = |(name, text): &(&'static str, &'static str)| {
        let template = PartFiles::given(&none).complete(Path::new(name), text.as_bytes()).ok()?;
        Some((*name, Arc::new(template.rig)))
    };
    BUNDLED_PARTS.iter().filter_map(read).collect()
}

/// Text of a part that comes with Rigsmith. It is used where no file has its name.
fn bundled(name: &str) -> Option<&'static str> {
    BUNDLED_PARTS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Largest depth of parts in parts.
const DEPTH: usize = 16;

/// Source of the files of parts.
enum Source<'a> {
    Disk(&'a dyn Disk),
    /// Contents that are there; `None` for files that there are not.
    Contents(&'a BTreeMap<PathBuf, Option<Vec<u8>>>),
}

/// Reason why a part of a template cannot be used.
#[derive(Debug, thiserror::Error)]
enum PartFileError {
    /// A part that uses itself, at any depth.
    #[error("`{}` is a part of itself; take it out of one of the files", path.display())]
    Cycle { path: PathBuf },
    /// A file that the list of contents does not have.
    #[error("there is no file `{}`", path.display())]
    Missing { path: PathBuf },
    /// A file that cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file that is no template, or has such a part itself.
    #[error("`{}`: {source}", path.display())]
    Template { path: PathBuf, source: SourceError },
    /// A part that does not fit.
    #[error(transparent)]
    Part(#[from] PartError),
}

/// Reader of templates with their parts. It notes the files of the parts that it has asked for.
pub struct PartFiles<'a> {
    source: Source<'a>,
    modules: Modules,
    /// Files of parts, with their content if they could be read.
    pub asked: BTreeMap<PathBuf, Option<Vec<u8>>>,
    /// Files of parts that no list has, in the order in which they were asked for.
    pub missing: Vec<PathBuf>,
    known: BTreeMap<PathBuf, Arc<Part>>,
    open: Vec<PathBuf>,
}

impl<'a> PartFiles<'a> {
    /// A reader that mirrors the parameters of Rigsmith's own modules.
    pub fn new(disk: &'a dyn Disk) -> Self {
        Self::with_modules(disk, modules::all())
    }

    /// A reader that mirrors the parameters of these modules.
    pub fn with_modules(disk: &'a dyn Disk, modules: Modules) -> Self {
        Self::of(Source::Disk(disk), modules)
    }

    /// A reader that takes contents of parts from a list, and parts that come with Rigsmith for those that are not there.
    /// Files that the list does not have are [`missing`](Self::missing).
    pub fn given(files: &'a BTreeMap<PathBuf, Option<Vec<u8>>>) -> Self {
        Self::of(Source::Contents(files), modules::all())
    }

    fn of(source: Source<'a>, modules: Modules) -> Self {
        Self { source, modules, missing: Vec::new(), asked: BTreeMap::new(), known: BTreeMap::new(), open: Vec::new() }
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
        template.with_parts(text, &mut |part| self.part(&folder.join(part), part), &mirror)
    }

    fn part(&mut self, path: &Path, name: &str) -> Result<Arc<Part>, PartFileError> {
        if let Some(known) = self.known.get(path) {
            return Ok(known.clone());
        }
        if self.open.iter().any(|open| open == path) || self.open.len() >= DEPTH {
            return Err(PartFileError::Cycle { path: path.to_owned() });
        }
        let (read, is_there) = match self.source {
            Source::Disk(disk) => {
                let read = read_capped(disk, path, template::MAX_BYTES as u64);
                (read.map_err(PartFileError::from), disk.entry(path, true).is_ok())
            }
            Source::Contents(files) => {
                let known = files.get(path);
                if known.is_none() {
                    self.missing.push(path.to_owned());
                }
                let read = known.cloned().flatten();
                let is_there = read.is_some();
                (read.ok_or_else(|| PartFileError::Missing { path: path.to_owned() }), is_there)
            }
        };
        self.asked.insert(path.to_owned(), read.as_ref().ok().cloned());
        let bytes = match (read, bundled(name)) {
            (Ok(bytes), _) => bytes,
            (Err(_), Some(text)) if !is_there => text.as_bytes().to_vec(),
            (Err(error), _) => return Err(error),
        };
        self.open.push(path.to_owned());
        let template = self.complete(path, &bytes);
        self.open.pop();
        let template = template.map_err(|source| PartFileError::Template { path: path.to_owned(), source })?;
        let part = Arc::new(Part { rig: template.rig, chains: template.chains });
        self.known.insert(path.to_owned(), part.clone());
        Ok(part)
    }
}
