//! Expressions of faces in the folders of the site, beside those that come with Rigsmith.

use std::path::{Path, PathBuf};

use super::{Disk, EntryKind, ReadError, read::is_missing, read_capped};
use crate::algo::face::expression::{ExpressionError, ExpressionSet};

/// Most bytes of a file of expressions or units that are read.
const MAX_BYTES: u64 = 1 << 20;

/// Most files that are looked at.
const MOST_FILES: usize = 1000;

/// Most names of a folder that are looked at.
const MOST_NAMES: usize = 10_000;

/// Levels below a folder of the site that are looked at.
pub const SITE_DEPTH: usize = 3;

/// Reason for leaving out a file of expressions or units.
#[derive(Debug, thiserror::Error)]
pub enum ExpressionFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file is no text.
    #[error("`{}` is not UTF-8; save it as a text", path.display())]
    Text {
        /// The file.
        path: PathBuf,
    },
    /// The file has no expressions or units that can be used.
    #[error(transparent)]
    Expression(#[from] ExpressionError),
    /// Files of a folder are not looked at.
    #[error(transparent)]
    LeftOut(#[from] LeftOut),
}

/// Part of a folder that is not looked at.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum LeftOut {
    /// The folder has too many names.
    #[error(
        "`{}` has more than {} names, and those after `{last}` are left out; move what is used to a folder of its own",
        folder.display(), MOST_NAMES
    )]
    Names {
        /// The folder.
        folder: PathBuf,
        /// Last name that is looked at.
        last: String,
    },
    /// The folder and those in it have too many files of the wanted kinds.
    #[error(
        "`{}` and its folders have more than {} files that are looked for, and `{}` and those after it are left out; \
         remove what is not used",
        folder.display(), MOST_FILES, first.display()
    )]
    Files {
        /// The folder.
        folder: PathBuf,
        /// First file that is left out.
        first: PathBuf,
    },
    /// The folder cannot be listed.
    #[error("`{}` cannot be listed: {reason}; allow reading it", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        reason: String,
    },
}

impl LeftOut {
    /// The folder.
    pub fn folder(&self) -> &Path {
        match self {
            Self::Names { folder, .. } | Self::Files { folder, .. } | Self::Folder { folder, .. } => folder,
        }
    }
}

/// Result of [`files_below`]: the files, and the reasons why others are left out.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FoundFiles {
    /// The files, in the order of their paths.
    pub files: Vec<PathBuf>,
    /// Folders with more than is looked at.
    pub left_out: Vec<LeftOut>,
}

/// True for names of files of expressions, `*.expr.ron`, and of units, `*.units.ron`.
pub fn is_expression_file(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    name.ends_with(".expr.ron") || name.ends_with(".units.ron")
}

/// The expressions that come with Rigsmith, and those in folders: a file takes the place of one of its name in a later folder, or
/// of a bundled one. Files that cannot be used are left out, and the reasons come with the set.
pub fn load_expressions(disk: &dyn Disk, folders: &[PathBuf]) -> (ExpressionSet, Vec<ExpressionFileError>) {
    let (mut found, mut faults) = (Vec::new(), Vec::new());
    for folder in folders {
        let FoundFiles { files, left_out } = files_below(disk, folder, SITE_DEPTH, &is_expression_file);
        found.extend(files);
        faults.extend(left_out.into_iter().map(ExpressionFileError::from));
    }
    // Expressions may use units of other files.
    found.sort_by_key(|path| !path.to_string_lossy().ends_with(".units.ron"));
    let texts = texts_of(disk, found, &mut faults);
    // All at once, and only where one has a fault, one after the other.
    if let Ok(set) = ExpressionSet::bundled_with(&texts) {
        return (set, faults);
    }
    let (mut set, mut own) = (ExpressionSet::bundled().clone(), Vec::new());
    for text in texts {
        own.push(text);
        match ExpressionSet::bundled_with(&own) {
            Ok(next) => set = next,
            Err(error) => {
                own.pop();
                faults.push(error.into());
            }
        }
    }
    (set, faults)
}

/// Names and texts of files that can be read.
fn texts_of(disk: &dyn Disk, files: Vec<PathBuf>, faults: &mut Vec<ExpressionFileError>) -> Vec<(String, String)> {
    let mut texts = Vec::new();
    for path in files {
        match read_capped(disk, &path, MAX_BYTES).map(String::from_utf8) {
            Ok(Ok(text)) => texts.push((path.display().to_string(), text)),
            Ok(Err(_)) => faults.push(ExpressionFileError::Text { path }),
            Err(error) => faults.push(error.into()),
        }
    }
    texts
}

/// Files with wanted names in a folder and up to so many levels below it: of each folder its files in order, then those of
/// the folders in it. A folder that is not there has none.
pub fn files_below(disk: &dyn Disk, top: &Path, depth: usize, is_wanted: &dyn Fn(&Path) -> bool) -> FoundFiles {
    let (mut found, mut folders) = (FoundFiles::default(), vec![(top.to_owned(), depth)]);
    'folders: while let Some((folder, depth)) = folders.pop() {
        let names = match disk.list(&folder, MOST_NAMES + 1) {
            Ok(names) => names,
            Err(error) if is_missing(&error) => continue,
            Err(error) => {
                found.left_out.push(LeftOut::Folder { folder, reason: error.to_string() });
                continue;
            }
        };
        if names.len() > MOST_NAMES {
            let last = names[MOST_NAMES - 1].to_string_lossy().into_owned();
            found.left_out.push(LeftOut::Names { folder: folder.clone(), last });
        }
        let known = folders.len();
        for name in names.into_iter().take(MOST_NAMES) {
            let path = folder.join(&name);
            let is_named = is_wanted(&path);
            let may_be_folder = depth > 0 && !name.to_string_lossy().starts_with('.');
            if !is_named && !may_be_folder {
                continue;
            }
            match disk.entry(&path, true).map(|entry| entry.kind) {
                Ok(EntryKind::Folder) if may_be_folder => folders.push((path, depth - 1)),
                Ok(EntryKind::File) if is_named && found.files.len() == MOST_FILES => {
                    found.left_out.push(LeftOut::Files { folder: top.to_owned(), first: path });
                    break 'folders;
                }
                Ok(EntryKind::File) if is_named => found.files.push(path),
                _ => {}
            }
        }
        // The first one is taken next.
        folders[known..].reverse();
    }
    found.files.sort();
    found
}
