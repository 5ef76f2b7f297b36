//! Files that belong together, saved so that at every instant the main file on the disk refers to whole companions.

use std::{
    io,
    path::{Path, PathBuf},
};

use super::{
    SaveError, SaveStep, companion, record,
    target::{Target, saved_file},
    temp::{Temp, remove_stale_in_turn},
};
use crate::{files::disk::Disk, rig::skin::content_hash};

/// Largest number of names that are tried for a companion, so that a disk that refuses every name ends the search.
const MAX_COPIES: u32 = 100;

/// A main file and its companions: the files beside it that it refers to by name, such as the buffer of a `.gltf`, the
/// materials of an `.obj` or the weights of a project. If the main file is a link, they lie beside the file that it leads to,
/// since that is the one that is written.
///
/// [`add`](Self::add) chooses the name of a companion, which holds the hash of its content; the main file, which holds
/// those names, is [finished](Self::finish) last.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FileSet {
    path: PathBuf,
    bytes: Vec<u8>,
    companions: Vec<(String, Vec<u8>)>,
}

impl FileSet {
    /// A set without companions, whose main file is to be `path`.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_path_buf(), ..Self::default() }
    }

    /// Adds a companion that would be called `plain`, and returns the name that the main file has to refer to:
    /// `wood.0123456789abcdef.png` for `wood.png`. Nothing is written; a file of that name with other content gets the
    /// companion another name.
    pub fn add(&mut self, disk: &dyn Disk, plain: &str, bytes: Vec<u8>) -> String {
        let hash = content_hash(&bytes);
        let main = saved_file(disk, &self.path);
        let mut copy = 0;
        loop {
            let name = companion::name(plain, hash, copy);
            match self.companion(&name) {
                Some(known) if known == bytes => return name,
                Some(_) => {}
                None => {
                    let there = companion::holds(disk, &main.with_file_name(&name), &bytes);
                    if matches!(there, Ok(None | Some(true))) || copy == MAX_COPIES {
                        self.companions.push((name.clone(), bytes));
                        return name;
                    }
                }
            }
            copy += 1;
        }
    }

    /// Sets the content of the main file.
    pub fn finish(&mut self, bytes: Vec<u8>) {
        self.bytes = bytes;
    }

    /// Path of the main file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Content of the main file.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Content of the companion with this name.
    pub fn companion(&self, name: &str) -> Option<&[u8]> {
        self.companions.iter().find(|(known, _)| known == name).map(|(_, bytes)| bytes.as_slice())
    }

    /// Names of the companions.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.companions.iter().map(|(name, _)| name.as_str())
    }
}

/// Saves a set. Afterwards either the old main file or the finished one is in place, each with its companions, at
/// whatever point the save fails.
///
/// Companions are put in place first, unless they are there already; a file is never replaced by one. Then the main
/// file is renamed, as [`save_atomic`](super::save_atomic) does. Then the companions that only the former main file
/// referred to are removed: those whose names hold the hash of their content and that no other file mentions, in the
/// folder and in those right above and below it, so that a copy of the main file under another name keeps its own.
/// Costs what `save_atomic` costs for each file that is not there yet, and a search of these folders where a companion
/// is no more referred to.
///
/// # Errors
/// See [`SaveError`]; the only one after which the set is in place is [`SaveError::Unconfirmed`].
pub fn save_set(disk: &dyn Disk, set: &FileSet) -> Result<(), SaveError> {
    let place = Target::find(disk, &set.path)?.folder;
    // On file systems without folder locks, two saves at the same instant may conflict; consecutive saves never do.
    let _turn = disk.lock_folder(&place).ok().flatten();
    // The main file that is replaced is the one of now: a save that had its turn before may have made it.
    let target = Target::find(disk, &set.path)?;
    let folder = target.folder.as_path();
    // Left-over temporary files that cannot be removed are no reason not to save.
    let _ = remove_stale_in_turn(disk, folder);
    let mut missing = Vec::new();
    for companion in &set.companions {
        if !is_there(disk, &folder.join(&companion.0), &companion.1)? {
            missing.push(companion);
        }
    }
    let mut former = Vec::new();
    if target.exists {
        former = companion::referred(disk, folder, &target.file).map_err(|source| unseen(&set.path, source))?;
        former.retain(|name| set.companion(name).is_none());
    }
    if missing.is_empty() && former.is_empty() {
        let temp = target.stage(disk, &set.bytes)?;
        target.replace(temp, set.bytes.len())?;
        return target.confirm(disk);
    }

    let names = missing.iter().map(|(name, _)| name.as_str()).chain(former.iter().map(String::as_str));
    let text = record::text(names);
    let failed = |step, error| SaveError::new(&set.path, folder, text.len(), step, error);
    let mut record = Temp::anchor(disk, folder).map_err(|error| failed(SaveStep::Create, error))?;
    record.fill(&text, None).map_err(|(step, error)| failed(step, error))?;
    let mut placed = Vec::new();
    if let Err(error) = put_in_place(disk, set, &target, &record, &missing, &mut placed) {
        if placed.iter().rev().any(|path| disk.remove(path).is_err()) {
            // The next save finds the record and clears up.
            record.leave();
        }
        let all = set.bytes.len() + missing.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
        return Err(of_all(error, all));
    }
    // The old main file may come back until the disk confirms the rename, so its companions stay until then.
    let done = target.confirm(disk);
    if done.is_err() || companion::remove_unmentioned(disk, folder, &former).is_err() {
        record.leave();
    }
    done
}

/// Error of a save of so many bytes in all.
fn of_all(error: SaveError, bytes: usize) -> SaveError {
    match error {
        SaveError::NoSpace { path, source, .. } => SaveError::NoSpace { path, bytes: bytes as u64, source },
        error => error,
    }
}

/// Puts the missing companions in place, then the main file; lists in `placed` the companions to remove after a
/// failure.
fn put_in_place(
    disk: &dyn Disk,
    set: &FileSet,
    target: &Target,
    record: &Temp,
    missing: &[&(String, Vec<u8>)],
    placed: &mut Vec<PathBuf>,
) -> Result<(), SaveError> {
    let folder = target.folder.as_path();
    let main = target.stage(disk, &set.bytes)?;
    let mut staged = Vec::with_capacity(missing.len());
    for ((name, bytes), number) in missing.iter().zip(1..) {
        let path = folder.join(name);
        let failed = |step, error| SaveError::new(&path, folder, bytes.len(), step, error);
        let mut temp = Temp::member(record, number).map_err(|error| failed(SaveStep::Create, error))?;
        // Companions get the permissions of the main file, so that the same people may read both.
        let like = target.exists.then_some(target.file.as_path());
        temp.fill(bytes, like).map_err(|(step, error)| failed(step, error))?;
        temp.close();
        staged.push((temp, path, bytes));
    }
    for (temp, path, bytes) in staged {
        match temp.link_to(&path) {
            Ok(()) => placed.push(path),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => match is_there(disk, &path, bytes)? {
                true => {}
                false => return Err(SaveError::Occupied { path }),
            },
            Err(error) => return Err(SaveError::new(&path, folder, bytes.len(), SaveStep::Replace, error)),
        }
    }
    // The names that the main file refers to must reach the device before it.
    if !missing.is_empty() {
        disk.sync_folder(folder)
            .map_err(|error| SaveError::new(&set.path, folder, set.bytes.len(), SaveStep::Sync, error))?;
    }
    target.replace(main, set.bytes.len())
}

/// Tells whether a companion is in place.
fn is_there(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> Result<bool, SaveError> {
    match companion::holds(disk, path, bytes) {
        Ok(None) => Ok(false),
        Ok(Some(true)) => Ok(true),
        Ok(Some(false)) => Err(SaveError::Occupied { path: path.to_path_buf() }),
        Err(source) => Err(unseen(path, source)),
    }
}

fn unseen(path: &Path, source: io::Error) -> SaveError {
    SaveError::Io { path: path.to_path_buf(), step: SaveStep::Inspect, source }
}
