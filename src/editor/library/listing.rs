//! The list of templates, made in the background.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::{
    prelude::*,
    tasks::{IoTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use crate::{
    editor::{
        ActiveRig,
        files::{DocumentLanded, OpenDocument, SaveJob},
    },
    files::{
        HeaderMemory, ListedTemplate, RealDisk, SearchPaths, SiteError, TemplatePlace, VersionedTemplate, list_bundled,
        list_templates, newest_versions,
    },
};

/// Levels below the folder of the document that are listed: it may be somebody's home.
const DEPTH: usize = 2;

/// Request to list the templates again.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ListTemplates;

/// Folders of the site; those of this machine's site if `None`.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct LibraryFolders(pub Option<SearchPaths>);

impl LibraryFolders {
    /// The folders.
    pub(super) fn read(&self) -> Result<SearchPaths, SiteError> {
        self.0.clone().map_or_else(SearchPaths::of_site, Ok)
    }
}

/// A folder of the list.
#[derive(Debug, Clone)]
pub struct LibraryFolder {
    /// Name for people.
    pub name: String,
    /// The templates, in the order of their paths.
    pub templates: Vec<Arc<ListedTemplate>>,
    /// Reasons why something is left out, a sentence each.
    pub problems: Vec<String>,
}

/// Templates of all folders: of the document's, then of the site's, then those that come with Rigsmith.
#[derive(Debug, Clone, Default)]
pub struct LibraryListing {
    /// The folders.
    pub folders: Vec<LibraryFolder>,
    /// Number of the listing; every further listing has another number.
    pub number: u64,
}

impl LibraryListing {
    /// All templates, in the order of their folders.
    pub fn templates(&self) -> impl Iterator<Item = &Arc<ListedTemplate>> {
        self.folders.iter().flat_map(|folder| &folder.templates)
    }

    /// The template at a place.
    pub fn find(&self, place: &TemplatePlace) -> Option<&Arc<ListedTemplate>> {
        self.templates().find(|listed| listed.place == *place)
    }

    /// Version and place of a newer version of a listed template.
    pub fn newer(&self, listed: &ListedTemplate) -> Option<(&str, &TemplatePlace)> {
        let template = VersionedTemplate::of(listed.header.as_ref().ok()?);
        let is_version = |other: &&ListedTemplate| {
            other.header.as_ref().is_ok_and(|header| VersionedTemplate::of(header) == template)
        };
        let newest = newest_versions(self.templates().map(Arc::as_ref).filter(is_version));
        let (version, place) = newest.get(&template)?;
        let header = listed.header.as_ref().ok()?;
        // Those that come with the program are of one version.
        let is_alone = listed.place.path().is_none() && place.path().is_none();
        (!is_alone && **place != listed.place && crate::rig::version::compare(&header.version, version).is_lt())
            .then_some((*version, *place))
    }
}

/// The list of templates.
#[derive(Resource, Default)]
pub struct TemplateLibrary {
    listing: Arc<LibraryListing>,
    memory: HeaderMemory,
    task: Option<Task<(LibraryListing, HeaderMemory)>>,
    /// True if a request came while the list was being made.
    is_wanted: bool,
    is_begun: bool,
    was_saving: bool,
}

impl TemplateLibrary {
    /// The last finished list.
    pub fn listing(&self) -> &Arc<LibraryListing> {
        &self.listing
    }

    /// True once the list has been asked for.
    pub fn is_begun(&self) -> bool {
        self.is_begun
    }

    /// True while the list is being made.
    pub fn is_listing(&self) -> bool {
        self.task.is_some() || self.is_wanted
    }
}

/// Makes the list where it is asked for, and again after saves and for another document.
pub(super) fn list(
    mut requests: MessageReader<ListTemplates>,
    mut landed: MessageReader<DocumentLanded>,
    mut library: ResMut<TemplateLibrary>,
    (folders, saving): (Res<LibraryFolders>, Res<SaveJob>),
    active: Option<Res<ActiveRig>>,
    documents: Query<&OpenDocument>,
    mut commands: Commands,
) {
    let library = library.bypass_change_detection();
    let is_saving = saving.name().is_some();
    let is_saved = std::mem::replace(&mut library.was_saving, is_saving) && !is_saving;
    let is_asked = requests.read().count() > 0;
    let is_other = landed.read().count() > 0 || is_saved;
    library.is_wanted |= is_asked || is_other && library.is_begun;
    if library.task.is_none() && std::mem::take(&mut library.is_wanted) {
        library.is_begun = true;
        let own = active.and_then(|active| own_folder(documents.get(active.0).ok()?));
        let (folders, memory) = (folders.clone(), std::mem::take(&mut library.memory));
        let number = library.listing.number + 1;
        // A folder of another machine may take long to answer.
        library.task = Some(IoTaskPool::get().spawn(async move { make(own, &folders, memory, number) }));
    }
    let Some(task) = &mut library.task else { return };
    if let Some((listing, memory)) = check_ready(task) {
        library.task = None;
        library.listing = Arc::new(listing);
        library.memory = memory;
    }
    commands.write_message(RequestRedraw);
}

/// Folder of a document: that of its template, else of its project.
pub(super) fn own_folder(document: &OpenDocument) -> Option<PathBuf> {
    let path = document.template.as_ref().or(document.project.as_ref())?;
    path.parent().map(Path::to_path_buf)
}

fn make(
    own: Option<PathBuf>,
    folders: &LibraryFolders,
    mut memory: HeaderMemory,
    number: u64,
) -> (LibraryListing, HeaderMemory) {
    let mut listed = Vec::new();
    let mut seen: BTreeSet<TemplatePlace> = BTreeSet::new();
    let (site, problem) = match folders.read() {
        Ok(site) => (site, None),
        Err(error) => (SearchPaths::default(), Some(error.to_string())),
    };
    let wanted = own.iter().map(|folder| (folder, DEPTH)).chain(site.folders.iter().map(|folder| (folder, usize::MAX)));
    for (folder, depth) in wanted {
        let mut of_folder =
            LibraryFolder { name: folder.display().to_string(), templates: Vec::new(), problems: Vec::new() };
        match list_templates(&RealDisk, folder, depth, &site, &memory) {
            Ok(listing) => {
                memory.remember(&listing.templates);
                of_folder.problems.extend(listing.left_out.iter().map(ToString::to_string));
                let others = listing.templates.into_iter().filter(|one| seen.insert(one.place.clone()));
                of_folder.templates.extend(others.map(Arc::new));
            }
            Err(error) => of_folder.problems.push(error.to_string()),
        }
        listed.push(of_folder);
    }
    let bundled = list_bundled(true).into_iter().map(Arc::new).collect();
    listed.push(LibraryFolder {
        name: "Rigsmith".to_owned(),
        templates: bundled,
        problems: problem.into_iter().collect(),
    });
    (LibraryListing { folders: listed, number }, memory)
}
