//! Library of templates: those of folders and those that come with Rigsmith, listed by their headers alone.
//!
//! A listing remembers the headers that follow from one file, by the file's length and time, so that a folder of hundreds is
//! listed again without reading what has not changed.

use std::{
    cmp::Ordering,
    collections::BTreeMap,
    fmt, io,
    path::{Path, PathBuf},
    time::SystemTime,
};

use rayon::prelude::*;

use super::{
    BUNDLED_CHARACTERS, BUNDLED_PARTS, Disk, Entry, EntryKind, FileKind, PartFiles, ReadError, SearchPaths,
    read_capped, template_origin::way,
};
use crate::rig::{
    SourceError, Uid,
    template::{self, Template, TemplateHeader},
    version::compare,
};

/// Bytes of a file that are read first: a header of usual length.
const FIRST_BYTES: u64 = 8 << 10;

/// Most names of a folder that are listed.
const MOST_NAMES: usize = 10_000;

/// Place of a template.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum TemplatePlace {
    /// A file.
    File(PathBuf),
    /// One that comes with Rigsmith, by name: `biped`, `parts/arm.rig.ron`.
    Bundled(&'static str),
}

impl fmt::Display for TemplatePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Bundled(name) => f.write_str(name),
        }
    }
}

impl TemplatePlace {
    /// Name of the file without folder and ending.
    pub fn stem(&self) -> String {
        match self {
            Self::File(path) => super::stem(path),
            Self::Bundled(name) => super::stem(Path::new(name)),
        }
    }

    /// The file; `None` for what comes with Rigsmith.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Bundled(_) => None,
        }
    }

    /// Name of this file as a part of a template in the folder `beside`: relative to that folder or to a folder of the
    /// site, with `/` between folders. A file that is in neither has its way from `beside` as its name
    /// (`../limbs/arm.rig.ron`), since absolute paths out of the folders are refused; without a folder, or on another drive,
    /// the name is its whole path.
    pub fn part_name(&self, beside: Option<&Path>, site: &SearchPaths) -> String {
        let path = match self {
            Self::Bundled(name) => return (*name).to_owned(),
            Self::File(path) => path,
        };
        let folders = beside.into_iter().chain(site.folders.iter().map(PathBuf::as_path));
        let inside = folders.filter(|folder| !folder.as_os_str().is_empty());
        let short = inside.filter_map(|folder| path.strip_prefix(folder).ok()).next();
        let parts: Vec<_> = match short {
            Some(short) => short.components().map(|part| part.as_os_str().to_string_lossy()).collect(),
            None => {
                let on_the_way = || way(&std::path::absolute(beside?).ok()?, &std::path::absolute(path).ok()?);
                return on_the_way().unwrap_or_else(|| path.to_string_lossy().into_owned());
            }
        };
        parts.join("/")
    }
}

/// Reason why a template cannot be listed.
#[derive(Debug, thiserror::Error)]
pub enum HeaderError {
    /// A file that cannot be read.
    #[error(transparent)]
    Read(#[from] io::Error),
    /// A file that is no template.
    #[error(transparent)]
    Template(#[from] SourceError),
}

/// Folder that cannot be listed.
#[derive(Debug, thiserror::Error)]
#[error("`{}` cannot be listed: {source}", folder.display())]
pub struct FolderListError {
    /// The folder.
    pub folder: PathBuf,
    /// The reason.
    pub source: io::Error,
}

/// Reason why names of a folder are left out.
#[derive(Debug, thiserror::Error)]
#[error(
    "it has more than {} names, and what comes after them is left out; move its templates to a folder of their own",
    MOST_NAMES
)]
struct TooManyNames;

/// State of a file, which tells whether its header has to be read again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileState {
    /// Length in bytes.
    pub len: u64,
    /// Time of the last change.
    pub modified: SystemTime,
}

impl FileState {
    /// State of an entry; `None` where the file system keeps no times.
    pub fn of(entry: &Entry) -> Option<Self> {
        Some(Self { len: entry.len, modified: entry.modified? })
    }
}

/// A template by its header.
#[derive(Debug)]
pub struct ListedTemplate {
    /// Place of the template.
    pub place: TemplatePlace,
    /// The header, or the reason why there is none.
    pub header: Result<TemplateHeader, HeaderError>,
    /// State of the file; `None` for what comes with Rigsmith.
    pub state: Option<FileState>,
    /// True if the header follows from the file alone, not from its parts.
    is_own: bool,
}

impl ListedTemplate {
    /// Name for people: that of the header, else that of the file.
    pub fn name(&self) -> String {
        let named = self.header.as_ref().ok().map(|header| header.name.clone());
        named.filter(|name| !name.is_empty()).unwrap_or_else(|| self.place.stem())
    }

    /// True for a part, which goes onto joints of another rig.
    pub fn is_part(&self) -> bool {
        self.header.as_ref().is_ok_and(|header| header.kind == "part")
    }

    /// True if name, kind, author, version, description or file contain all words.
    pub fn has_words(&self, words: &str) -> bool {
        let mut text = format!("{} {}", self.name().replace('_', " "), self.place);
        if let Ok(TemplateHeader { name, version, kind, author, description, .. }) = &self.header {
            for part in [name, version, kind, author, description] {
                text.push(' ');
                text.push_str(part);
            }
        }
        let text = text.to_lowercase();
        words.split_whitespace().all(|word| text.contains(&word.to_lowercase()))
    }
}

/// Headers that are known, with the states of the files that they were read from.
#[derive(Debug, Default)]
pub struct HeaderMemory(BTreeMap<PathBuf, (FileState, TemplateHeader)>);

impl HeaderMemory {
    /// Takes the headers of listed templates into the memory.
    pub fn remember<'a>(&mut self, listed: impl IntoIterator<Item = &'a ListedTemplate>) {
        for one in listed {
            if let (TemplatePlace::File(path), Ok(header), Some(state), true) =
                (&one.place, &one.header, one.state, one.is_own)
            {
                self.0.insert(path.clone(), (state, header.clone()));
            }
        }
    }

    fn find(&self, path: &Path, state: Option<FileState>) -> Option<&TemplateHeader> {
        let (known, header) = self.0.get(path)?;
        (Some(*known) == state).then_some(header)
    }
}

/// Templates of a folder.
#[derive(Debug, Default)]
pub struct FolderListing {
    /// The templates, in the order of their paths.
    pub templates: Vec<ListedTemplate>,
    /// Folders below it that are left out.
    pub left_out: Vec<FolderListError>,
}

/// The templates in a folder and in those up to `depth` levels below it. Parts of templates are looked for beside them and in the folders of the
/// site; headers of files that `known` has, unchanged, are not read.
///
/// # Errors
/// A folder that cannot be listed.
pub fn list_templates(
    disk: &dyn Disk,
    top: &Path,
    depth: usize,
    site: &SearchPaths,
    known: &HeaderMemory,
) -> Result<FolderListing, FolderListError> {
    let mut found: Vec<(PathBuf, Option<FileState>)> = Vec::new();
    let mut left_out = Vec::new();
    let mut folders = vec![(top.to_owned(), depth)];
    while let Some((folder, depth)) = folders.pop() {
        let mut names = match disk.list(&folder, MOST_NAMES + 1) {
            Ok(names) => names,
            Err(source) if folder == top => return Err(FolderListError { folder, source }),
            Err(source) => {
                left_out.push(FolderListError { folder, source });
                continue;
            }
        };
        if names.len() > MOST_NAMES {
            names.truncate(MOST_NAMES);
            let source = io::Error::other(TooManyNames);
            left_out.push(FolderListError { folder: folder.clone(), source });
        }
        for name in names {
            let path = folder.join(&name);
            match disk.entry(&path, false) {
                Ok(entry)
                    if entry.kind == EntryKind::Folder && depth > 0 && !name.to_string_lossy().starts_with('.') =>
                {
                    folders.push((path, depth - 1));
                }
                Ok(entry) if entry.kind == EntryKind::File && FileKind::of(&path) == Some(FileKind::Template) => {
                    found.push((path, FileState::of(&entry)));
                }
                _ => {}
            }
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    // Each share of the files reads a part once; more shares than threads would only read parts more often.
    let share = found.len().div_ceil(rayon::current_num_threads()).max(1);
    let listed = found.par_chunks(share).flat_map_iter(|share| {
        let mut files = PartFiles::new(disk).with_site(site.clone());
        let list = |(path, state): &(PathBuf, Option<FileState>)| {
            let read = match known.find(path, *state) {
                Some(header) => Ok((header.clone(), true)),
                None => read_header(disk, path, &mut files),
            };
            let is_own = read.as_ref().is_ok_and(|(_, is_own)| *is_own);
            let header = read.map(|(header, _)| header);
            ListedTemplate { place: TemplatePlace::File(path.clone()), header, state: *state, is_own }
        };
        share.iter().map(list).collect::<Vec<_>>()
    });
    Ok(FolderListing { templates: listed.collect(), left_out })
}

/// The templates that come with Rigsmith, by name; `is_whole` with what only all of a template tells.
pub fn list_bundled(is_whole: bool) -> Vec<ListedTemplate> {
    let all: Vec<&(&'static str, &'static str)> = BUNDLED_CHARACTERS.iter().chain(BUNDLED_PARTS).collect();
    let listed = all.into_par_iter().map(|(name, text)| {
        let header = template::read_header(text.as_bytes()).map_err(HeaderError::from).map(|mut header| {
            let none = BTreeMap::new();
            if is_whole
                && is_unknown(&header)
                && let Ok(template) = PartFiles::given(&none).complete(Path::new(name), text.as_bytes())
            {
                header.complete_from(&template.rig);
            }
            header
        });
        ListedTemplate { place: TemplatePlace::Bundled(name), header, state: None, is_own: true }
    });
    let mut listed: Vec<ListedTemplate> = listed.collect();
    listed.sort_by(|a, b| a.place.cmp(&b.place));
    listed
}

/// Template of which there may be several versions. Files are versions of one template if uid and kind agree; where the uid only
/// follows from the name, which many templates may have, the author, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VersionedTemplate<'a> {
    uid: Uid,
    kind: &'a str,
    /// Empty where the uid is the template's own.
    author: &'a str,
}

impl<'a> VersionedTemplate<'a> {
    /// The template of which a file with that header is a version.
    pub fn of(header: &'a TemplateHeader) -> Self {
        let author = if header.has_uid_of_name() { header.author.as_str() } else { "" };
        Self { uid: header.uid, kind: &header.kind, author }
    }
}

/// Newest version of each template, and where it is.
pub type NewestVersions<'a> = BTreeMap<VersionedTemplate<'a>, (&'a str, &'a TemplatePlace)>;

/// The newest version of each template, and where it is.
pub fn newest_versions<'a>(all: impl Iterator<Item = &'a ListedTemplate>) -> NewestVersions<'a> {
    let mut newest: NewestVersions<'a> = BTreeMap::new();
    for ListedTemplate { place, header, .. } in all {
        let Ok(header) = header else { continue };
        let known = newest.entry(VersionedTemplate::of(header)).or_insert((&header.version, place));
        if compare(known.0, &header.version) == Ordering::Less {
            *known = (&header.version, place);
        }
    }
    newest
}

/// Reason why a listed template cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// A file that cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file that is no template.
    #[error("`{place}`: {source}")]
    Template {
        /// Place of the template.
        place: TemplatePlace,
        /// Place in the file, and the reason.
        source: SourceError,
    },
    /// A name that no bundled template has.
    #[error("no template \"{0}\" comes with Rigsmith; list the templates again")]
    NotBundled(&'static str),
}

/// Reads a listed template with its parts, which are looked for as in [`list_templates`].
///
/// # Errors
/// [`LibraryError`].
pub fn read_listed(disk: &dyn Disk, place: &TemplatePlace, site: &SearchPaths) -> Result<Template, LibraryError> {
    let fault = |source| LibraryError::Template { place: place.clone(), source };
    match place {
        TemplatePlace::File(path) => {
            let bytes = read_capped(disk, path, template::MAX_BYTES as u64)?;
            PartFiles::new(disk).with_site(site.clone()).complete(path, &bytes).map_err(fault)
        }
        TemplatePlace::Bundled(name) => {
            let found = BUNDLED_CHARACTERS.iter().chain(BUNDLED_PARTS).find(|(known, _)| known == name);
            let (_, text) = found.ok_or(LibraryError::NotBundled(name))?;
            PartFiles::given(&BTreeMap::new()).complete(Path::new(name), text.as_bytes()).map_err(fault)
        }
    }
}

/// Header of a file: of its beginning if that is enough, else of all of it, else of the template with its parts; with it,
/// whether it follows from the file alone.
fn read_header(disk: &dyn Disk, path: &Path, files: &mut PartFiles) -> Result<(TemplateHeader, bool), HeaderError> {
    let read = |limit: u64| -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        io::Read::read_to_end(&mut io::Read::take(disk.open(path)?, limit), &mut bytes)?;
        Ok(bytes)
    };
    let first = read(FIRST_BYTES)?;
    let is_whole = (first.len() as u64) < FIRST_BYTES;
    let mut header = match template::read_header(&first) {
        Ok(header) if is_whole || header.joint_count > 0 => header,
        _ => template::read_header(&read(template::MAX_BYTES as u64)?)?,
    };
    // What parts bring, and what a part needs, only the whole template tells, unless its author wrote it down.
    let mut is_own = true;
    if header.kind == "part" && header.needs.is_none() {
        if let Ok(template) = files.complete(path, &read(template::MAX_BYTES as u64)?) {
            is_own = template.instances.is_empty();
            header.complete_from(&template.rig);
        } else {
            is_own = false;
        }
    } else if header.joint_count == 0
        && let Ok(template) = template::read_template(&read(template::MAX_BYTES as u64)?)
    {
        is_own = template.parts.is_empty();
        // What is wrong with a part is told where the template is used.
        if let Ok(parts) = files.counted(path, &template) {
            header.complete_from_parts(&template.rig, &parts);
        }
    }
    Ok((header, is_own))
}

/// True for what only the whole template tells, unless its author wrote it down: what parts bring, and what a part needs.
fn is_unknown(header: &TemplateHeader) -> bool {
    header.joint_count == 0 || header.kind == "part" && header.needs.is_none()
}
