//! Recent files: which of them can be opened.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

use bevy::{
    prelude::*,
    tasks::{IoTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::StartPage;
use crate::{
    editor::settings::EditorSettings,
    files::{Disk, RealDisk},
};

/// Reason why a recent file cannot be opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RecentProblem {
    /// The file is not in its folder.
    #[error("the file is not there any more")]
    Gone,
    /// The folder of the file does not exist.
    #[error("its folder is not there any more")]
    FolderGone,
    /// The system refuses to say what is there.
    #[error("it cannot be read: {0}")]
    Unreadable(ErrorKind),
}

/// A recent file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecentFile {
    /// The file.
    pub path: PathBuf,
    /// Reason why it cannot be opened, if so.
    pub problem: Option<RecentProblem>,
}

/// The recent files as they were when the start page was opened or its list changed.
#[derive(Resource, Default)]
pub struct RecentFiles {
    list: Vec<RecentFile>,
    task: Option<Task<Vec<RecentFile>>>,
    was_shown: bool,
}

impl RecentFiles {
    /// The files, the last one first.
    pub fn list(&self) -> &[RecentFile] {
        &self.list
    }
}

/// Looks for the files when the page is shown, and when another file is remembered or forgotten.
pub(super) fn look(
    page: Res<StartPage>,
    settings: Res<EditorSettings>,
    mut recent: ResMut<RecentFiles>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    let is_shown = page.is_shown();
    let opened = is_shown && !recent.was_shown;
    if recent.was_shown != is_shown {
        recent.was_shown = is_shown;
    }
    if !is_shown {
        return;
    }
    let is_other = recent.list.len() != settings.recent.len()
        || recent.list.iter().zip(&settings.recent).any(|(known, path)| known.path != *path);
    if recent.task.is_none() {
        if !opened && !is_other {
            return;
        }
        let paths = settings.recent.clone();
        // A folder of another machine may take long to answer.
        let task = async move { paths.into_iter().map(|path| RecentFile { problem: problem(&path), path }).collect() };
        recent.task = Some(IoTaskPool::get().spawn(task));
    }
    if let Some(list) = recent.bypass_change_detection().task.as_mut().and_then(check_ready) {
        recent.task = None;
        recent.list = list;
    }
    redraw.write(RequestRedraw);
}

fn problem(path: &Path) -> Option<RecentProblem> {
    match RealDisk.entry(path, true) {
        Ok(_) => None,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let has_folder = path.parent().is_some_and(|folder| RealDisk.entry(folder, true).is_ok());
            Some(if has_folder { RecentProblem::Gone } else { RecentProblem::FolderGone })
        }
        Err(error) => Some(RecentProblem::Unreadable(error.kind())),
    }
}
