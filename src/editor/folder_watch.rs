//! Folders of the window: forms and expressions that are saved in the folder of the document, or in those of the site, are in use
//! with the next frame. A window at rest stays at rest; the first movement of the mouse brings a frame.

use bevy::prelude::*;

use super::{
    ActiveRig,
    files::{OpenDocument, attend},
    library::LibraryFolders,
    notice::Notice,
};
use crate::{
    files::{SITE_DEPTH, SearchPaths},
    instance::{FolderFault, WatchedFolder, WatchedFolderPlugin, WatchedFolders},
};

/// Plugin that watches the folder of the open document, and those of the site.
pub struct FolderWatchPlugin;

impl Plugin for FolderWatchPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(WatchedFolderPlugin::default())
            .init_resource::<LibraryFolders>()
            .add_message::<Notice>()
            .add_systems(Update, (watch_folders, tell_faults).chain().after(attend));
    }
}

/// Watches the folder of the open document, alone, as it may be somebody's home; then those of the site.
fn watch_folders(
    rig: Option<Res<ActiveRig>>,
    documents: Query<&OpenDocument>,
    library: Res<LibraryFolders>,
    mut site: Local<Option<Vec<WatchedFolder>>>,
    mut watched: ResMut<WatchedFolders>,
    mut commands: Commands,
) {
    if site.is_none() || library.is_changed() {
        let read = library.0.clone().map_or_else(SearchPaths::of_site, Ok);
        let paths = read.unwrap_or_else(|error| {
            commands.write_message(Notice::error(error.to_string()));
            SearchPaths::default()
        });
        *site = Some(paths.folders.into_iter().map(|path| WatchedFolder { path, depth: SITE_DEPTH }).collect());
    }
    let document = rig.and_then(|rig| documents.get(rig.0).ok());
    let file = document.and_then(|document| document.template.as_ref().or(document.project.as_ref()));
    let own = file.and_then(|file| file.parent()).map(|folder| WatchedFolder { path: folder.to_owned(), depth: 0 });
    let wanted: Vec<WatchedFolder> = own.into_iter().chain(site.iter().flatten().cloned()).collect();
    if watched.0 != wanted {
        watched.0 = wanted;
    }
}

fn tell_faults(mut faults: MessageReader<FolderFault>, mut commands: Commands) {
    for FolderFault { file, error } in faults.read() {
        commands.write_message(Notice::error(format!("{} is not in use: {error}", file.display())).named());
    }
}
