//! Templates with parts: the files of the parts are found, and put into the template.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use super::{
    Disk, PartCache, ReadError, SearchPaths, SiteError, atomic::linked_file, part_error::PartFileError,
    read::is_missing, read_capped, similar_parts::similar_parts,
};
use crate::{
    modules,
    processor::Modules,
    rig::{
        Rig, SourceError,
        nearest::listed,
        part::{Part, PartInstance},
        template::{self, PartSource, Template, read_template, text_of},
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
    "bendy_limb",
    "eye",
    "fk_chain",
    "front_leg",
    "hand",
    "ikfk_chain",
    "jaw",
    "leg",
    "leg_3joint",
    "lips",
    "neck_chain",
    "neck_head",
    "single_control",
    "spine",
    "spring_chain",
    "tail",
    "tongue",
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
pub fn bundled_parts() -> Vec<(&'static str, Arc<Part>)> {
    let none = BTreeMap::new();
    let read = |(name, text): &(&'static str, &'static str)| {
        let template = PartFiles::given(&none).complete(Path::new(name), text.as_bytes()).ok()?;
        Some((*name, Arc::new(Part::from(template))))
    };
    BUNDLED_PARTS.iter().filter_map(read).collect()
}

/// Part that comes with Rigsmith, by its name: `parts/hand`, with or without the ending of its file.
pub fn bundled_part(name: &str) -> Option<Arc<Part>> {
    let name = format!("{}.rig.ron", name.strip_suffix(".rig.ron").unwrap_or(name));
    let whole = || bundled_parts().into_iter().find(|(known, _)| *known == name).map(|(_, part)| part);
    bundled_alone(&name).or_else(whole)
}

/// A part that comes with Rigsmith and uses no others, read once.
fn bundled_alone(name: &str) -> Option<Arc<Part>> {
    static READ: [OnceLock<Option<Arc<Part>>>; BUNDLED_PARTS.len()] = [const { OnceLock::new() }; BUNDLED_PARTS.len()];
    let place = BUNDLED_PARTS.iter().position(|(known, _)| *known == name)?;
    let read = || {
        let template = read_template(BUNDLED_PARTS[place].1.as_bytes()).ok()?;
        template.parts.is_empty().then(|| Arc::new(Part::from(template)))
    };
    READ[place].get_or_init(read).clone()
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
    /// Parts that another reader has found, by the places beside their templates.
    Found(&'a BTreeMap<PathBuf, FoundPart>),
}

/// File of a part that a reader has found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundPart {
    /// The file.
    pub path: PathBuf,
    /// Content of the file.
    pub content: Vec<u8>,
}

/// Reader of templates with their parts. A part is looked for beside its template, where that is a link also beside the file that
/// it leads to, then in the folders of the site ([`SearchPaths`]), then among those that come with Rigsmith. The reader notes the
/// files that it has asked for.
///
/// A template from elsewhere may name any file of the machine. An absolute path is one below the template's folder or a
/// folder of the site, or it is refused, as a project's meshes are; ways up (`../parts/arm.rig.ron`) lead to parts that
/// templates share.
pub struct PartFiles<'a> {
    source: Source<'a>,
    modules: Arc<Modules>,
    /// Paths at which the reader looked for parts, with the content of the files that it could read. The search for a part
    /// ends at the first file that exists.
    pub asked: BTreeMap<PathBuf, Option<Vec<u8>>>,
    /// Files of parts that no list has, in the order in which they were asked for.
    pub missing: Vec<PathBuf>,
    /// Parts that have files, by the places beside their templates, where they are looked for first.
    pub found: BTreeMap<PathBuf, FoundPart>,
    site: Option<SearchPaths>,
    known: BTreeMap<PathBuf, Arc<Part>>,
    /// Parts and mirrored parameters of readers before this one.
    pub cache: PartCache,
    /// Errors of parts that cannot be had, by the places beside their templates: a part that many others use is read once,
    /// and refused once.
    refused: BTreeMap<PathBuf, Arc<PartFileError>>,
    open: Vec<PathBuf>,
}

impl<'a> PartFiles<'a> {
    /// A reader that mirrors the parameters of Rigsmith's own modules.
    pub fn new(disk: &'a dyn Disk) -> Self {
        Self::with_modules(disk, modules::all())
    }

    /// A reader that mirrors the parameters of these modules.
    pub fn with_modules(disk: &'a dyn Disk, modules: impl Into<Arc<Modules>>) -> Self {
        Self::of(Source::Disk(disk), modules.into())
    }

    /// Reader that takes the contents of parts from a list, and bundled parts where the list has none. Files that the list
    /// lacks are [`missing`](Self::missing).
    pub fn given(files: &'a BTreeMap<PathBuf, Option<Vec<u8>>>) -> Self {
        Self::of(Source::Contents(files), modules::all().into())
    }

    /// Reader of the parts that another reader has [found](Self::found), and of bundled parts.
    pub fn known(found: &'a BTreeMap<PathBuf, FoundPart>, modules: impl Into<Arc<Modules>>) -> Self {
        Self::of(Source::Found(found), modules.into())
    }

    /// The modules whose parameters are mirrored.
    pub fn modules(&self) -> &Arc<Modules> {
        &self.modules
    }

    fn of(source: Source<'a>, modules: Arc<Modules>) -> Self {
        Self {
            source,
            modules,
            missing: Vec::new(),
            found: BTreeMap::new(),
            asked: BTreeMap::new(),
            site: None,
            known: BTreeMap::new(),
            cache: PartCache::default(),
            refused: BTreeMap::new(),
            open: Vec::new(),
        }
    }

    /// The reader with other folders than those of the site.
    pub fn with_site(self, site: SearchPaths) -> Self {
        Self { site: Some(site), ..self }
    }

    /// The reader with what others with the same modules have read.
    pub fn with_cache(self, cache: PartCache) -> Self {
        Self { cache, ..self }
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
        self.begin();
        let (modules, mirrored) = (self.modules.clone(), self.cache.mirrored.clone());
        let mirror = |module: &str, params: &str| mirrored.of(&modules, module, params);
        template.with_parts(text, &mut |part| self.part(path, part), &mirror)
    }

    /// Puts parts into a template, and lists all faults of parts that cannot be read or do not fit; these are left out.
    pub fn survey(&mut self, path: &Path, text: &str, template: Template) -> (Template, Vec<SourceError>) {
        if template.parts.is_empty() {
            return (template, Vec::new());
        }
        self.begin();
        let (modules, mirrored) = (self.modules.clone(), self.cache.mirrored.clone());
        let mirror = |module: &str, params: &str| mirrored.of(&modules, module, params);
        template.survey_parts(text, &mut |part| self.part(path, part), &mirror)
    }

    /// Every part instance of a template with its part, [fitted](PartInstance::fitted).
    ///
    /// # Errors
    /// A part that cannot be had or does not fit.
    pub fn fitted(&mut self, path: &Path, template: &Template) -> Result<Vec<(PartInstance, Rig)>, PartFileError> {
        let instances = template.parts.iter().chain(&template.instances);
        instances.map(|instance| Ok((instance.clone(), self.fitted_part(path, instance)?))).collect()
    }

    /// The part of an instance, [fitted](PartInstance::fitted), for the template whose file is `path`.
    ///
    /// # Errors
    /// A part that cannot be had or does not fit.
    pub fn fitted_part(&mut self, path: &Path, instance: &PartInstance) -> Result<Rig, PartFileError> {
        let part = self.of_instance(path, instance)?;
        let mirror = |module: &str, params: &str| self.cache.mirrored.of(&self.modules, module, params);
        Ok(instance.fitted(&part, &mirror)?)
    }

    /// Every part instance of a template with its part as far as a header tells of it: with as many joints as it has here, and
    /// with other names and values than here where nothing refers to them.
    ///
    /// # Errors
    /// A part that cannot be had, or that does not take so many joints.
    pub fn counted(&mut self, path: &Path, template: &Template) -> Result<Vec<(PartInstance, Rig)>, PartFileError> {
        let counted = template.parts.iter().map(|instance| {
            // Changes call tags by the names that they have here.
            if instance.changes.iter().any(|change| change.removed) {
                return Ok((instance.clone(), self.fitted_part(path, instance)?));
            }
            let part = self.of_instance(path, instance)?;
            Ok((instance.clone(), instance.sized(&part)?))
        });
        counted.collect()
    }

    fn of_instance(&mut self, path: &Path, instance: &PartInstance) -> Result<Arc<Part>, PartFileError> {
        self.part(path, &instance.part)
    }

    /// Begins with another template, unless it is one of the parts of the present one: what stands in the way of a part, such as
    /// the depth at which it is used, may be different there.
    fn begin(&mut self) {
        if self.open.is_empty() {
            self.refused.clear();
        }
    }

    /// The part of that name, beside its template, whose file is given, or elsewhere.
    fn part(&mut self, template: &Path, name: &str) -> Result<Arc<Part>, PartFileError> {
        let folder = template.parent().unwrap_or(Path::new(""));
        self.check_inside(folder, Path::new(name))?;
        let beside = folder.join(name);
        let is_known = self.known.contains_key(&beside);
        let linked = if is_known { None } else { self.beside_linked(template, &beside, name) };
        let first = &linked.unwrap_or(beside);
        if let Some(known) = self.known.get(first) {
            return Ok(known.clone());
        }
        if let Some(refused) = self.refused.get(first) {
            return Err(PartFileError::Again(refused.clone()));
        }
        self.read_part(first, name).map_err(|error| {
            let error = Arc::new(error);
            self.refused.insert(first.to_owned(), error.clone());
            PartFileError::Again(error)
        })
    }

    /// The place of a part beside the file to which its template is a link, if the part lies there and not beside the link.
    fn beside_linked(&mut self, template: &Path, beside: &Path, name: &str) -> Option<PathBuf> {
        let Source::Disk(disk) = self.source else { return None };
        if Path::new(name).is_absolute() || !disk.entry(beside, true).is_err_and(|error| is_missing(&error)) {
            return None;
        }
        let file = linked_file(disk, template);
        let place = file.parent()?.join(name);
        let is_there = file != template && place != beside && disk.entry(&place, true).is_ok();
        is_there.then(|| {
            // The part may come beside the link.
            self.asked.insert(beside.to_owned(), None);
            place
        })
    }

    /// Refuses an absolute path to a file that lies, links followed, neither below the template's folder nor below one of
    /// the site's. Contents and parts that are given were read by others.
    fn check_inside(&mut self, folder: &Path, name: &Path) -> Result<(), PartFileError> {
        let Source::Disk(disk) = self.source else { return Ok(()) };
        if !name.is_absolute() {
            return Ok(());
        }
        let target = disk.canonical(name).unwrap_or_else(|_| name.to_owned());
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let is_below = |folder: &Path| disk.canonical(folder).is_ok_and(|folder| target.starts_with(folder));
        if is_below(folder) || self.site()?.folders.iter().any(|folder| is_below(folder)) {
            return Ok(());
        }
        Err(PartFileError::Outside { path: name.to_owned(), folder: folder.to_owned() })
    }

    /// The folders of the site, read once.
    fn site(&mut self) -> Result<SearchPaths, SiteError> {
        Ok(match &self.site {
            Some(site) => site.clone(),
            None => self.site.insert(SearchPaths::of_site()?).clone(),
        })
    }

    /// Reads the part of that name, with those that it has itself.
    fn read_part(&mut self, first: &Path, name: &str) -> Result<Arc<Part>, PartFileError> {
        let (path, bytes) = match self.file(first, name)? {
            Some((path, content)) => {
                let part = FoundPart { path: path.clone(), content: content.clone() };
                self.found.insert(first.to_owned(), part);
                if let Some(part) = self.cache.part(&path, &content).cloned() {
                    self.known.insert(first.to_owned(), part.clone());
                    return Ok(part);
                }
                (path, content)
            }
            None => match (bundled_alone(name), bundled(name)) {
                (Some(part), _) => {
                    self.known.insert(first.to_owned(), part.clone());
                    return Ok(part);
                }
                (None, Some(text)) => (first.to_owned(), text.as_bytes().to_vec()),
                (None, None) => return Err(self.nowhere(first, name)),
            },
        };
        if self.open.contains(&path) || self.open.len() >= DEPTH {
            return Err(PartFileError::Cycle { path });
        }
        self.open.push(path.clone());
        let template = self.complete(&path, &bytes);
        self.open.pop();
        let template = match template {
            Ok(template) => template,
            Err(source) => return Err(PartFileError::Template { path, source }),
        };
        let (file, text) = (path.display().to_string(), text_of(&bytes).unwrap_or_default().to_owned());
        let source = PartSource { file, text, origins: template.origins.clone() };
        let is_alone = template.parts.is_empty() && template.instances.is_empty();
        let part = Arc::new(Part { source: Some(Arc::new(source)), ..Part::from(template) });
        if is_alone {
            self.cache.insert(path, bytes, part.clone());
        }
        self.known.insert(first.to_owned(), part.clone());
        Ok(part)
    }

    /// The file of a part and its content; `None` if no folder has it. A file that is there, and cannot be read, is an error.
    fn file(&mut self, first: &Path, name: &str) -> Result<Option<(PathBuf, Vec<u8>)>, PartFileError> {
        let disk = match self.source {
            Source::Disk(disk) => disk,
            Source::Found(found) => {
                return Ok(found.get(first).map(|part| (part.path.clone(), part.content.clone())));
            }
            Source::Contents(files) => {
                let known = files.get(first);
                if known.is_none() {
                    self.missing.push(first.to_owned());
                }
                let content = known.cloned().flatten();
                self.asked.insert(first.to_owned(), content.clone());
                return Ok(content.map(|content| (first.to_owned(), content)));
            }
        };
        if let Some(bytes) = self.read(disk, first)? {
            return Ok(Some((first.to_owned(), bytes)));
        }
        let site = self.site()?;
        for path in site.candidates(Path::new(name)) {
            if let Some(bytes) = self.read(disk, &path)? {
                return Ok(Some((path, bytes)));
            }
        }
        Ok(None)
    }

    /// Content of a file; `None` if there is none.
    fn read(&mut self, disk: &dyn Disk, path: &Path) -> Result<Option<Vec<u8>>, PartFileError> {
        let read = read_capped(disk, path, template::MAX_BYTES as u64);
        self.asked.insert(path.to_owned(), read.as_ref().ok().cloned());
        let error = match read {
            Ok(bytes) => return Ok(Some(bytes)),
            Err(error) => error,
        };
        match disk.entry(path, true) {
            // A file that cannot be reached is another matter: one of the same name elsewhere is another part.
            Err(reason) if is_missing(&reason) => Ok(None),
            _ => Err(error.into()),
        }
    }

    /// The error of a part that no folder has.
    fn nowhere(&self, first: &Path, name: &str) -> PartFileError {
        let disk = match self.source {
            Source::Disk(disk) => Some(disk),
            Source::Contents(_) | Source::Found(_) => None,
        };
        let nearest = similar_parts(disk, first, name);
        if !nearest.is_empty() {
            return PartFileError::Similar { path: first.to_owned(), nearest: listed(&nearest, "or") };
        }
        let missing = disk.and_then(|disk| read_capped(disk, first, 0).err());
        match (missing, self.site.as_ref().map_or(0, |site| site.folders.len())) {
            (None, _) => PartFileError::Missing { path: first.to_owned() },
            (Some(error), 0) => error.into(),
            (Some(source), folders) => PartFileError::Nowhere { source, folders },
        }
    }
}

/// A template that is called by its name: the file in a folder of the site, or one that comes with Rigsmith.
///
/// # Errors
/// A file of that name that cannot be read.
pub(super) fn named_template(disk: &dyn Disk, name: &Path) -> Result<Option<(PathBuf, Vec<u8>)>, ReadError> {
    if name.is_absolute() {
        return Ok(None);
    }
    let of_site = SearchPaths::of_site().ok().and_then(|site| site.find(disk, name));
    if let Some(path) = of_site {
        let bytes = read_capped(disk, &path, template::MAX_BYTES as u64)?;
        return Ok(Some((path, bytes)));
    }
    let named = super::site::with_ending(name);
    let Some(file) = named.to_str() else { return Ok(None) };
    let character = |(known, _): &&(&str, &str)| file.strip_suffix(".rig.ron") == Some(*known);
    let text = BUNDLED_CHARACTERS.iter().find(character).map(|(_, text)| *text).or_else(|| bundled(file));
    let bytes = text.map(|text| text.as_bytes().to_vec());
    Ok(bytes.map(|bytes| (named, bytes)))
}
