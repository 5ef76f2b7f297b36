//! Watched folders of forms, expressions and gestures: what is saved there is in use at once.
//!
//! `NAME.ui.ron` is the form of the module of that name, `*.expr.ron` and `*.units.ron` are expressions and units of faces beside
//! the bundled ones (a file takes the place of the bundled one with its name), `*.gestures.ron` are lists of gestures, which
//! are handed out as [`GesturesRead`]. A file takes the place of one of its name in a later folder. A file that cannot be read changes nothing and is told ([`FolderFault`]).

use std::{
    collections::{BTreeMap, BTreeSet},
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
    files::{FileWatch, FoundFiles, LeftOut, RealDisk, files_below, is_expression_file, stem},
    plugins::{
        commands::RigModules,
        face::FaceExpressions,
        gesture::{Gesture, MAX_BYTES, read_gestures},
    },
    processor::FormError,
    rig::SourceError,
};

/// Plugin that watches folders.
#[derive(Debug, Clone)]
pub struct WatchedFolderPlugin {
    /// The folders at the start; [`WatchedFolders`] has others.
    pub folders: Vec<WatchedFolder>,
    /// Time between two looks at their files.
    pub look: Duration,
}

impl Default for WatchedFolderPlugin {
    /// Plugin that looks four times a second, at no folder yet.
    fn default() -> Self {
        Self { folders: Vec::new(), look: Duration::from_millis(250) }
    }
}

impl WatchedFolderPlugin {
    /// Plugin that looks at a folder, with the folders in it, four times a second.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folders: vec![WatchedFolder { path: folder.into(), depth: DEPTH }], ..Self::default() }
    }
}

impl Plugin for WatchedFolderPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FaceExpressions>()
            .insert_resource(WatchedFolders(self.folders.clone()))
            .insert_resource(FolderLooks {
                look: self.look,
                looked: None,
                files: Some(FolderFiles::default()),
                task: None,
                faces: BTreeMap::new(),
            })
            .add_message::<GesturesRead>()
            .add_message::<FolderRead>()
            .add_message::<FolderFault>()
            .add_systems(PreUpdate, follow_folders);
    }
}

/// Folder whose files are followed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WatchedFolder {
    /// The folder. It need not be there yet.
    pub path: PathBuf,
    /// Levels of folders in it that are followed, too.
    pub depth: usize,
}

/// Folders that are watched, first those whose files count first. Files of a folder that is taken out are gone.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct WatchedFolders(pub Vec<WatchedFolder>);

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
    /// The folder has more than is looked at.
    #[error(transparent)]
    LeftOut(#[from] LeftOut),
}

/// Looks at the files of watched folders.
#[derive(Resource)]
struct FolderLooks {
    look: Duration,
    looked: Option<Instant>,
    /// The files, unless a task looks at them.
    files: Option<FolderFiles>,
    task: Option<Task<(FolderFiles, Vec<SavedFile>, Vec<LeftOut>)>>,
    /// Texts of expressions and units.
    faces: BTreeMap<PathBuf, String>,
}

/// Content of a saved file; `None` for one that is gone.
struct SavedFile {
    file: PathBuf,
    content: Option<Vec<u8>>,
}

#[derive(Default)]
struct FolderFiles {
    watches: BTreeMap<PathBuf, FileWatch>,
    /// Parts of the folders that are not looked at.
    left_out: BTreeSet<LeftOut>,
}

/// Levels of folders in a folder that are followed unless somebody says otherwise.
const DEPTH: usize = 8;

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
        } else if is_expression_file(path) {
            Some(Self::Face)
        } else {
            ends(".gestures.ron").then_some(Self::Gestures)
        }
    }
}

impl FolderFiles {
    /// Looks at all files of the folders. Returns those with another content, and what is not looked at from now on.
    fn look(&mut self, folders: &[WatchedFolder]) -> (Vec<SavedFile>, Vec<LeftOut>) {
        let is_wanted = |path: &Path| Kind::of(path).is_some();
        // A folder may lie in another one.
        let (mut found, mut left_out) = (BTreeSet::new(), BTreeSet::new());
        for folder in folders {
            let below: FoundFiles = files_below(&RealDisk, &folder.path, folder.depth, &is_wanted);
            found.extend(below.files);
            left_out.extend(below.left_out);
        }
        let news = left_out.difference(&self.left_out).cloned().collect();
        self.left_out = left_out;
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
        // Expressions may use units that are saved with them.
        saved.sort_by_key(|saved| !saved.file.to_string_lossy().ends_with(".units.ron"));
        (saved, news)
    }
}

/// Takes over what was saved in the folders.
fn follow_folders(
    folders: Res<WatchedFolders>,
    mut looks: ResMut<FolderLooks>,
    mut modules: Option<ResMut<RigModules>>,
    mut expressions: ResMut<FaceExpressions>,
    mut gestures: MessageWriter<GesturesRead>,
    mut read: MessageWriter<FolderRead>,
    mut faults: MessageWriter<FolderFault>,
) {
    let looks = looks.bypass_change_detection();
    let is_due = looks.looked.is_none_or(|looked| looked.elapsed() >= looks.look);
    if let Some(mut files) = looks.files.take_if(|_| is_due) {
        looks.looked = Some(Instant::now());
        let folders = folders.0.clone();
        looks.task = Some(AsyncComputeTaskPool::get().spawn(async move {
            let (saved, left_out) = files.look(&folders);
            (files, saved, left_out)
        }));
    }
    let Some((files, saved, left_out)) = looks.task.as_mut().and_then(check_ready) else { return };
    looks.task = None;
    looks.files = Some(files);
    faults.write_batch(
        left_out.into_iter().map(|part| FolderFault { file: part.folder().to_owned(), error: part.into() }),
    );
    for SavedFile { file, content } in saved {
        let text = content.map(String::from_utf8).transpose().map_err(|_| FolderError::Text);
        let taken = text.and_then(|text| match (Kind::of(&file), text) {
            (Some(Kind::Form), Some(text)) => Ok(take_form(modules.as_deref_mut(), &file, &text)?),
            (Some(Kind::Face), text) => Ok(take_face(&mut looks.faces, &mut expressions, &folders, &file, text)?),
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
    folders: &WatchedFolders,
    file: &Path,
    text: Option<String>,
) -> Result<(), ExpressionError> {
    let mut next = faces.clone();
    match text {
        Some(text) => drop(next.insert(file.to_owned(), text)),
        None => drop(next.remove(file)),
    }
    let rank = |path: &Path| folders.0.iter().position(|folder| path.starts_with(&folder.path));
    let mut own: Vec<(&PathBuf, &String)> = next.iter().collect();
    own.sort_by_key(|(path, _)| rank(path).unwrap_or(usize::MAX));
    let own: Vec<(String, String)> =
        own.into_iter().map(|(path, text)| (path.display().to_string(), text.clone())).collect();
    expressions.0 = Arc::new(ExpressionSet::bundled_with(&own)?);
    *faces = next;
    Ok(())
}
