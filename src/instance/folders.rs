//! A watched folder of forms, expressions and gestures: what is saved there is in use at once.
//!
//! `NAME.ui.ron` is the form of the module of that name, `*.expr.ron` and `*.units.ron` are expressions and units of faces beside
//! the bundled ones (a file takes the place of the bundled one with its name), `*.gestures.ron` are lists of gestures, which
//! are handed out as [`GesturesRead`]. A file that cannot be read changes nothing and is told ([`FolderFault`]).

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use crate::{
    algo::face::expression::{ExpressionError, ExpressionSet},
    files::{Disk, EntryKind, FileWatch, RealDisk, stem},
    plugins::{
        commands::RigModules,
        face::FaceExpressions,
        gesture::{Gesture, MAX_BYTES, read_gestures},
    },
    processor::FormError,
    rig::SourceError,
};

/// Plugin that watches a folder, with the folders in it.
#[derive(Debug, Clone)]
pub struct WatchedFolderPlugin {
    /// The folder. It need not be there yet.
    pub folder: PathBuf,
    /// Time between two looks at its files.
    pub look: Duration,
}

impl WatchedFolderPlugin {
    /// Plugin that looks at a folder four times a second.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), look: Duration::from_millis(250) }
    }
}

impl Plugin for WatchedFolderPlugin {
    fn build(&self, app: &mut App) {
        let files = Some(FolderFiles { folder: self.folder.clone(), watches: BTreeMap::new() });
        app.init_resource::<FaceExpressions>()
            .insert_resource(WatchedFolder { look: self.look, looked: None, files, task: None, faces: BTreeMap::new() })
            .add_message::<GesturesRead>()
            .add_message::<FolderRead>()
            .add_message::<FolderFault>()
            .add_systems(PreUpdate, follow_folder);
    }
}

/// A list of gestures was saved.
#[derive(Message, Debug, Clone, PartialEq)]
pub struct GesturesRead {
    /// The file.
    pub file: PathBuf,
    /// The gestures.
    pub gestures: Vec<Gesture>,
}

/// A file of the folder is in use as it is now, or is gone and not in use any more.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct FolderRead {
    /// The file.
    pub file: PathBuf,
}

/// A file of the folder cannot be read; what was in use before stays.
#[derive(Message, Debug, Clone, PartialEq)]
pub struct FolderFault {
    /// The file.
    pub file: PathBuf,
    /// The reason.
    pub error: FolderError,
}

/// Reason for which a file of a watched folder is not in use.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FolderError {
    /// The file is no form of its module.
    #[error(transparent)]
    Form(#[from] FormError),
    /// The file has no expressions or units.
    #[error(transparent)]
    Expression(#[from] ExpressionError),
    /// The file is no list of gestures.
    #[error(transparent)]
    Gestures(#[from] SourceError),
    /// The file is no text.
    #[error("the file is not UTF-8; save it as a text")]
    Text,
}

/// Files of a watched folder.
#[derive(Resource)]
struct WatchedFolder {
    look: Duration,
    looked: Option<Instant>,
    /// The files, unless a task looks at them.
    files: Option<FolderFiles>,
    task: Option<Task<(FolderFiles, Vec<SavedFile>)>>,
    /// Texts of expressions and units.
    faces: BTreeMap<PathBuf, String>,
}

/// Content of a saved file; `None` for one that is gone.
struct SavedFile {
    file: PathBuf,
    content: Option<Vec<u8>>,
}

struct FolderFiles {
    folder: PathBuf,
    watches: BTreeMap<PathBuf, FileWatch>,
}

/// Most files of a folder that are looked at.
const MOST: usize = 1000;

/// Kind of a file of the folder.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Form,
    Face,
    Gestures,
}

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let ends = |ending: &str| name.ends_with(ending);
        if ends(".ui.ron") {
            Some(Self::Form)
        } else if ends(".expr.ron") || ends(".units.ron") {
            Some(Self::Face)
        } else {
            ends(".gestures.ron").then_some(Self::Gestures)
        }
    }
}

impl FolderFiles {
    /// Looks at all files. Returns those with another content.
    fn look(&mut self) -> Vec<SavedFile> {
        let (mut found, mut folders) = (Vec::new(), vec![self.folder.clone()]);
        while let Some(folder) = folders.pop() {
            // A folder that is not there has no files.
            for name in RealDisk.list(&folder, MOST).unwrap_or_default() {
                let path = folder.join(&name);
                match RealDisk.entry(&path, true).map(|entry| entry.kind) {
                    Ok(EntryKind::Folder) if !name.to_string_lossy().starts_with('.') => folders.push(path),
                    Ok(EntryKind::File) if Kind::of(&path).is_some() && found.len() < MOST => found.push(path),
                    _ => {}
                }
            }
        }
        let mut saved = Vec::new();
        self.watches.retain(|file, _| {
            let is_there = found.contains(file);
            if !is_there {
                saved.push(SavedFile { file: file.clone(), content: None });
            }
            is_there
        });
        for file in found {
            let watch = self.watches.entry(file.clone()).or_insert_with(|| FileWatch::new(&file, MAX_BYTES as u64));
            if let Some(content) = watch.look(&RealDisk) {
                saved.push(SavedFile { content: Some(content.to_vec()), file });
            }
        }
        saved
    }
}

/// Takes over what was saved in the folder.
fn follow_folder(
    mut folder: ResMut<WatchedFolder>,
    mut modules: Option<ResMut<RigModules>>,
    mut expressions: ResMut<FaceExpressions>,
    mut gestures: MessageWriter<GesturesRead>,
    mut read: MessageWriter<FolderRead>,
    mut faults: MessageWriter<FolderFault>,
) {
    let folder = folder.bypass_change_detection();
    let is_due = folder.looked.is_none_or(|looked| looked.elapsed() >= folder.look);
    if let Some(mut files) = folder.files.take_if(|_| is_due) {
        folder.looked = Some(Instant::now());
        folder.task = Some(AsyncComputeTaskPool::get().spawn(async move {
            let saved = files.look();
            (files, saved)
        }));
    }
    let Some((files, saved)) = folder.task.as_mut().and_then(check_ready) else { return };
    folder.task = None;
    folder.files = Some(files);
    for SavedFile { file, content } in saved {
        let text = content.map(String::from_utf8).transpose().map_err(|_| FolderError::Text);
        let taken = text.and_then(|text| match (Kind::of(&file), text) {
            (Some(Kind::Form), Some(text)) => Ok(take_form(modules.as_deref_mut(), &file, &text)?),
            (Some(Kind::Face), text) => Ok(take_face(&mut folder.faces, &mut expressions, &file, text)?),
            (Some(Kind::Gestures), Some(text)) => {
                gestures.write(GesturesRead { file: file.clone(), gestures: read_gestures(text.as_bytes())? });
                Ok(())
            }
            // A form that is gone stays in use until the next start.
            _ => Ok(()),
        });
        match taken {
            Ok(()) => drop(read.write(FolderRead { file })),
            Err(error) => drop(faults.write(FolderFault { file, error })),
        }
    }
}

fn take_form(modules: Option<&mut RigModules>, file: &Path, text: &str) -> Result<(), FormError> {
    let name = stem(file);
    let name = name.strip_suffix(".ui").unwrap_or(&name);
    if let Some(known) = modules {
        let mut modules = (*known.0).clone();
        modules.set_form(name, text)?;
        known.0 = Arc::new(modules);
    }
    Ok(())
}

/// Takes over a file of expressions or units, or leaves out one that is gone.
fn take_face(
    faces: &mut BTreeMap<PathBuf, String>,
    expressions: &mut FaceExpressions,
    file: &Path,
    text: Option<String>,
) -> Result<(), ExpressionError> {
    let mut next = faces.clone();
    match text {
        Some(text) => drop(next.insert(file.to_owned(), text)),
        None => drop(next.remove(file)),
    }
    let called = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    let own: Vec<String> = next.keys().filter_map(|path| called(path)).collect();
    let bundled = ExpressionSet::bundled_files()
        .filter(|(name, _)| called(Path::new(name)).is_none_or(|name| !own.contains(&name)))
        .map(|(name, text)| (name.to_owned(), text.to_owned()));
    let own = next.iter().map(|(path, text)| (path.display().to_string(), text.clone()));
    let files: Vec<(String, String)> = bundled.chain(own).collect();
    let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    expressions.0 = Arc::new(ExpressionSet::parse(&files)?);
    *faces = next;
    Ok(())
}
