//! Expressions of faces in the folders of the site, beside those that come with Rigsmith.

use std::path::{Path, PathBuf};

use super::{Disk, EntryKind, ReadError, read_capped};
use crate::algo::face::expression::{ExpressionError, ExpressionSet};

/// Most bytes of a file of expressions or units that are read.
const MAX_BYTES: u64 = 1 << 20;

/// Most files, and most names of a folder, that are looked at.
const MOST: usize = 1000;

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
}

/// True for names of files of expressions, `*.expr.ron`, and of units, `*.units.ron`.
pub fn is_expression_file(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    name.ends_with(".expr.ron") || name.ends_with(".units.ron")
}

/// The expressions that come with Rigsmith, and those in folders: a file takes the place of one of its name in a later folder, or
/// of a bundled one. Files that cannot be used are left out, and the reasons come with the set.
pub fn load_expressions(disk: &dyn Disk, folders: &[PathBuf]) -> (ExpressionSet, Vec<ExpressionFileError>) {
    let below = |folder: &PathBuf| files_below(disk, folder, SITE_DEPTH, &is_expression_file);
    let mut found: Vec<PathBuf> = folders.iter().flat_map(below).collect();
    // Expressions may use units of other files.
    found.sort_by_key(|path| !path.to_string_lossy().ends_with(".units.ron"));
    let mut set = ExpressionSet::bundled().clone();
    let (mut own, mut faults) = (Vec::new(), Vec::new());
    for path in found {
        let text = match read_capped(disk, &path, MAX_BYTES).map(String::from_utf8) {
            Ok(Ok(text)) => text,
            Ok(Err(_)) => {
                faults.push(ExpressionFileError::Text { path });
                continue;
            }
            Err(error) => {
                faults.push(error.into());
                continue;
            }
        };
        own.push((path.display().to_string(), text));
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

/// Files with wanted names in a folder and up to so many levels below it, in the order of their paths. A folder that is not
/// there has none.
pub fn files_below(disk: &dyn Disk, top: &Path, depth: usize, is_wanted: &dyn Fn(&Path) -> bool) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![(top.to_owned(), depth)]);
    while let Some((folder, depth)) = folders.pop() {
        for name in disk.list(&folder, MOST).unwrap_or_default() {
            let path = folder.join(&name);
            let is_named = is_wanted(&path);
            let may_be_folder = depth > 0 && !name.to_string_lossy().starts_with('.');
            if !is_named && !may_be_folder {
                continue;
            }
            match disk.entry(&path, true).map(|entry| entry.kind) {
                Ok(EntryKind::Folder) if may_be_folder => folders.push((path, depth - 1)),
                Ok(EntryKind::File) if is_named && found.len() < MOST => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    found
}
