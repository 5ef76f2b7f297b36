//! Thread that owns the file of a journal.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, Sender},
    },
    time::{Duration, Instant},
};

use super::{
    Content, JournalPlaces, JournalWriteError, SaveMark,
    encode::Encoder,
    fold::Measure,
    place::is_there,
    sync::{SyncResult, Syncer},
    writer::{Order, WriterState},
};
use crate::files::{
    Disk, DiskFile,
    atomic::{folder_of, temp_name},
};

/// Pause before the next attempt after a disk has refused.
const RETRY: Duration = Duration::from_secs(2);
/// Number of bytes that are collected before a write while more changes wait.
const BLOCK: usize = 1 << 20;

/// Data of the thread.
pub(super) struct Writer {
    pub disk: Arc<dyn Disk>,
    pub shared: Arc<WriterState>,
    /// Sender to this thread's own inbox, for messages of the syncing thread.
    pub orders: Sender<Order>,
    pub session: u64,
    pub places: JournalPlaces,
    pub content: Content,
    /// Path of the former journal, which the new journal replaces.
    pub replaces: Option<PathBuf>,
}

/// Open file of a journal.
struct OpenJournal {
    path: PathBuf,
    file: Box<dyn DiskFile>,
    /// Syncing thread; `None` if the file offers no second handle, so that every write is synced by itself.
    syncer: Option<Syncer>,
    encoder: Encoder,
}

impl OpenJournal {
    /// Syncs and closes every handle, which unlocks the file.
    fn close(mut self) -> SyncResult {
        if let Some(syncer) = self.syncer.take() {
            syncer.end();
        }
        self.file.sync().map_err(JournalWriteError::from)
    }
}

/// The thread's data and its open file.
struct Work {
    writer: Writer,
    open: Option<OpenJournal>,
    /// Earliest time of the next attempt after a failure.
    retry: Instant,
    measure: Measure,
}

impl Writer {
    /// Carries out orders until one ends the thread.
    pub(super) fn run(self, inbox: &Receiver<Order>) {
        let measure = Measure::of(&self.content);
        self.shared.hold(self.content.changes.len());
        let mut work = Work { writer: self, open: None, retry: Instant::now(), measure };
        work.reopen();
        let mut block = Vec::new();
        while let Ok(order) = inbox.recv() {
            let mut next = Some(order);
            while let Some(order) = next {
                if !work.take(order, &mut block) {
                    return;
                }
                next = if block.len() < BLOCK { inbox.try_recv().ok() } else { None };
            }
            work.write(&mut block);
        }
    }
}

impl Work {
    /// Carries out an order; returns false to end the thread. Bytes to append are collected in `block`.
    fn take(&mut self, order: Order, block: &mut Vec<u8>) -> bool {
        match order {
            Order::Change(committed) => {
                let changes = &mut self.writer.content.changes;
                changes.push(committed.clone());
                let is_long = self.measure.add(&committed, changes.len());
                self.append(block, |encoder, out| encoder.change(out, &committed));
                if is_long {
                    self.write(block);
                    self.fold();
                }
                self.writer.shared.hold(self.writer.content.changes.len());
            }
            Order::Context(context) => {
                self.append(block, |encoder, out| encoder.context(out, &context));
                self.writer.content.context = context;
            }
            Order::Saving(mark, answer) => {
                self.append(block, |encoder, out| encoder.mark(out, &mark));
                self.writer.content.marks.push(mark);
                self.write(block);
                self.sync(answer);
            }
            Order::Saved(mark, places) => {
                self.write(block);
                self.rebase(&mark, places);
            }
            Order::Flush(answer) => {
                self.write(block);
                self.leave_removed_file();
                if self.open.is_none() {
                    self.reopen();
                }
                self.sync(answer);
            }
            Order::SyncFailed(path, reason) => {
                self.write(block);
                if self.open.as_ref().is_some_and(|open| open.path == path) {
                    // The content of the disk after a failed sync is unknown, so all is written again.
                    self.open = None;
                    self.report(path, reason);
                    self.reopen();
                }
            }
            Order::Finish(answer) => {
                self.write(block);
                let result = match self.open.take() {
                    Some(open) => open.close(),
                    None => Err(JournalWriteError::NotOpen),
                };
                let _ = answer.send(result);
                return false;
            }
            Order::Close(answer) => {
                self.write(block);
                let _ = answer.send(self.close());
                return false;
            }
        }
        true
    }

    /// Encodes a record for the open file; a record that its encoder refuses ends the file.
    fn append(
        &mut self,
        block: &mut Vec<u8>,
        put: impl FnOnce(&mut Encoder, &mut Vec<u8>) -> Result<(), JournalWriteError>,
    ) {
        let Some(open) = &mut self.open else { return };
        if let Err(reason) = put(&mut open.encoder, block) {
            // The records before the refused one are still worth writing.
            self.write(block);
            if let Some(open) = self.open.take() {
                self.report(open.path, reason);
            }
        }
    }

    /// Writes a block; after a failure, writes the whole journal to the next place that accepts it.
    fn write(&mut self, block: &mut Vec<u8>) {
        let Some(open) = &mut self.open else {
            block.clear();
            if Instant::now() >= self.retry && self.writer.shared.trouble().is_some() {
                self.reopen();
            }
            return;
        };
        if block.is_empty() {
            return;
        }
        let mut result = write_all(open.file.as_mut(), block);
        block.clear();
        if result.is_ok() {
            match &open.syncer {
                Some(syncer) => syncer.soon(),
                None => result = open.file.sync().map_err(JournalWriteError::from),
            }
        }
        if let Err(reason) = result {
            let path = open.path.clone();
            self.open = None;
            self.report(path, reason);
            self.reopen();
            return;
        }
        self.leave_removed_file();
    }

    /// Writes the whole journal anew if its file was removed, or its folder moved away: many systems let a file without a
    /// name take bytes, which nobody finds after a crash.
    fn leave_removed_file(&mut self) {
        let disk = self.writer.disk.as_ref();
        if self.open.as_ref().is_some_and(|open| matches!(is_there(disk, &open.path), Ok(false))) {
            self.open = None;
            self.reopen();
        }
    }

    fn sync(&mut self, answer: Sender<SyncResult>) {
        let Some(open) = &mut self.open else {
            let trouble = self.writer.shared.trouble();
            let _ = answer.send(Err(trouble.map_or(JournalWriteError::NotOpen, |trouble| (*trouble).clone())));
            return;
        };
        match &open.syncer {
            Some(syncer) => syncer.now(answer),
            None => {
                let _ = answer.send(open.file.sync().map_err(JournalWriteError::from));
            }
        }
    }

    /// Writes the whole journal to a new file, in the first place that accepts it.
    fn reopen(&mut self) {
        let writer = &mut self.writer;
        writer.content.generation += 1;
        let former = writer.shared.path();
        match create_somewhere(writer, &writer.content, &writer.places, former.as_deref()) {
            Ok(open) => self.adopt(open),
            Err((path, reason)) => {
                self.retry = Instant::now() + RETRY;
                self.report(path, reason);
            }
        }
    }

    /// Moves the oldest changes into the rig that the journal starts from, and starts a new file on it. If that cannot be
    /// written, the present file goes on, and so does what is held in memory for another place.
    fn fold(&mut self) {
        let writer = &mut self.writer;
        let mut content = writer.content.clone();
        content.generation += 1;
        let (mut is_folded, mut opened) = (content.fold(), None);
        if is_folded && self.open.is_some() {
            let former = writer.shared.path();
            opened = create_somewhere(writer, &content, &writer.places, former.as_deref()).ok();
            is_folded = opened.is_some();
        } else if is_folded {
            // Nothing can be written at the moment, but it must not be the rig that is too large to be.
            is_folded = Encoder::begin(writer.session, &content).is_ok();
        }
        if is_folded {
            writer.content = content;
        }
        self.measure = Measure::of(&writer.content);
        if !is_folded {
            self.measure.put_off();
        }
        if let Some(open) = opened {
            self.adopt(open);
        }
    }

    /// Starts a new file on a saved project. If that cannot be written, the present file goes on, since its mark
    /// identifies the save.
    fn rebase(&mut self, mark: &SaveMark, places: JournalPlaces) {
        let writer = &mut self.writer;
        if writer.content.base.is_some() && mark.position < writer.content.first {
            // The save took longer than it takes to fold: the project lacks changes that are in the rig of the journal alone.
            return;
        }
        let mut content = writer.content.clone();
        content.rebase(mark);
        content.generation += 1;
        let former = writer.shared.path();
        match create_somewhere(writer, &content, &places, former.as_deref()) {
            Ok(open) => {
                writer.content = content;
                writer.places = places;
                self.measure = Measure::of(&writer.content);
                writer.shared.hold(writer.content.changes.len());
                self.adopt(open);
            }
            Err((path, reason)) if self.open.is_none() => self.report(path, reason),
            Err(_) => {}
        }
    }

    /// Switches to a file that holds the whole journal, and removes the former one.
    fn adopt(&mut self, mut open: OpenJournal) {
        let writer = &mut self.writer;
        let former = writer.shared.settle(Some(open.path.clone()));
        // Windows removes a file at once only if it is closed.
        self.open = None;
        // Another window may have gone on with the same work, in its place.
        let replaced = writer.replaces.take().filter(|old| !is_in_use(writer.disk.as_ref(), old));
        for old in former.into_iter().chain(replaced).filter(|old| *old != open.path) {
            let _ = writer.disk.remove(&old);
        }
        open.syncer = open.file.another().ok().and_then(|file| {
            let (orders, path) = (writer.orders.clone(), open.path.clone());
            Syncer::start(file, move |reason| {
                let _ = orders.send(Order::SyncFailed(path, reason));
            })
        });
        self.open = Some(open);
    }

    /// Ends the journal: nothing is to be recovered.
    fn close(&mut self) -> SyncResult {
        let open = self.open.take();
        let path = self.writer.shared.settle(None);
        let Some(path) = path else { return Ok(()) };
        if let Some(mut open) = open {
            let mut out = Vec::new();
            // The end record matters if the file cannot be removed.
            if open.encoder.end(&mut out).is_ok() {
                let _ = write_all(open.file.as_mut(), &out);
            }
            let _ = open.close();
        }
        match self.writer.disk.remove(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(JournalWriteError::Remove { path, source: error.into() })
            }
            _ => Ok(()),
        }
    }

    fn report(&self, path: PathBuf, source: JournalWriteError) {
        self.writer.shared.fail(JournalWriteError::Place { path, source: source.into() });
    }
}

/// Creates the journal in the first place that accepts it; otherwise returns the first place with the reason for its
/// refusal.
fn create_somewhere(
    writer: &Writer,
    content: &Content,
    places: &JournalPlaces,
    former: Option<&Path>,
) -> Result<OpenJournal, (PathBuf, JournalWriteError)> {
    let mut first = None;
    for (number, path) in places.candidates(writer.session).into_iter().enumerate() {
        let folder = folder_of(&path);
        // The project's own folder is never created: the project could not be there without it.
        if number > 0 || places.project.is_none() {
            let _ = writer.disk.create_folder(folder);
        }
        let disk = writer.disk.as_ref();
        let own = former == Some(&path);
        let replaced = writer.replaces.as_ref() == Some(&path) && !is_in_use(disk, &path);
        let taken = if own || replaced { Ok(false) } else { is_there(disk, &path) };
        let created = match taken {
            Ok(false) => create(disk, &path, writer.session, content),
            // Another window works on this project, or unsaved work waits to be recovered.
            Ok(true) => Err(JournalWriteError::PathInUse),
            Err(error) => Err(error.into()),
        };
        match created {
            Ok(open) => return Ok(open),
            Err(reason) => first = first.or(Some((path, reason))),
        }
    }
    Err(first.unwrap_or_else(|| (PathBuf::new(), JournalWriteError::NoPlace)))
}

/// True unless it is known that no living process writes the journal at a path.
fn is_in_use(disk: &dyn Disk, path: &Path) -> bool {
    !matches!(disk.is_locked(path), Ok(false))
}

/// Writes a whole journal to a temporary file in the same folder, then renames it.
fn create(disk: &dyn Disk, path: &Path, session: u64, content: &Content) -> Result<OpenJournal, JournalWriteError> {
    let (encoder, bytes) = Encoder::begin(session, content)?;
    let temp = folder_of(path).join(temp_name());
    let mut file = disk.create(&temp).map_err(JournalWriteError::from)?;
    let mut fill = || {
        file.lock().map_err(JournalWriteError::from)?;
        write_all(file.as_mut(), &bytes)?;
        file.sync().map_err(JournalWriteError::from)?;
        disk.rename(&temp, path).map_err(JournalWriteError::from)
    };
    if let Err(reason) = fill() {
        drop(file);
        let _ = disk.remove(&temp);
        return Err(reason);
    }
    // Without this, a power cut may bring the former file back, which ends earlier.
    let _ = disk.sync_folder(folder_of(path));
    Ok(OpenJournal { path: path.to_owned(), file, syncer: None, encoder })
}

fn write_all(file: &mut dyn DiskFile, mut bytes: &[u8]) -> Result<(), JournalWriteError> {
    while !bytes.is_empty() {
        match file.write(bytes) {
            Ok(0) => return Err(JournalWriteError::Full),
            Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}
