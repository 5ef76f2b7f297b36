//! The document that is being opened, and the files that come behind it.

use std::{collections::VecDeque, path::PathBuf, sync::Arc};

use bevy::{prelude::*, tasks::Task};

use super::{
    error::OpenError,
    open::{LoadedDocument, LoadedFile},
};
use crate::rig::step::Step;

/// Document that is being opened.
#[derive(Resource, Default)]
pub struct LoadJob {
    pub(super) job: Option<Job>,
    /// Loaded document that waits for an answer about changes that were made while it loaded.
    pub(super) held: Option<HeldDocument>,
    /// Files that are opened next, each once the one before it is there.
    pub(super) further: VecDeque<PathBuf>,
}

pub(super) struct Job {
    pub name: String,
    pub task: Task<Result<LoadedFile, OpenError>>,
    /// Last step of the open document when its loss was accepted.
    pub confirmed: Option<Arc<Step>>,
    /// True if nobody has been asked yet about changes that would be lost.
    pub asks: bool,
    /// True for a mesh that comes to the open rig, whatever that has.
    pub adds: bool,
    /// Files that are opened once this one is there.
    pub behind: Vec<PathBuf>,
}

/// Loaded document, its name, and the files that come behind it.
pub(super) struct HeldDocument {
    pub name: String,
    pub opened: Box<LoadedDocument>,
    pub further: VecDeque<PathBuf>,
}

impl LoadJob {
    /// Name of the document that is being opened.
    pub fn name(&self) -> Option<&str> {
        self.job.as_ref().map(|job| job.name.as_str())
    }

    /// Stops opening; returns the name of the document, which is not opened, as those behind it are not.
    pub(in crate::editor) fn stop(&mut self) -> Option<String> {
        self.further.clear();
        self.job.take().map(|job| job.name)
    }

    /// Has unsaved changes asked about once it is known that they would be lost.
    pub(super) fn ask_later(&mut self) {
        if let Some(job) = &mut self.job {
            job.asks = true;
        }
    }

    /// Has the mesh that is being opened put beside those of the open rig.
    pub(super) fn add_to_open(&mut self) {
        if let Some(job) = &mut self.job {
            job.adds = true;
        }
    }
}
