//! Handle of a journal for its callers.

use std::{
    hash::{BuildHasher, RandomState},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
        mpsc::{RecvTimeoutError, Sender, channel},
    },
    thread,
    time::{Duration, SystemTime},
};

use super::{
    Content, JournalPlaces, JournalWriteError, Origin, RecoveredJournal, RestoredRig, SaveMark,
    place::{file_hash_at, set_aside},
    restore::SavedSteps,
    sync::SyncResult,
    thread::Writer,
};
use crate::{
    files::Disk,
    rig::{
        Rig,
        step::{Commit, SinkError, StepSink},
    },
};

/// Longest time that the last handle waits for pending writes.
const PATIENCE: Duration = Duration::from_secs(2);

/// A journal that is being written; handles are cheap to clone and work from any thread. If the last handle is dropped
/// without [`Journal::close`], the file stays, as after a crash.
#[derive(Clone)]
pub struct Journal {
    inner: Arc<Inner>,
}

/// Start of a journal.
#[derive(Debug, Clone, Default)]
pub struct JournalStart {
    /// Places to try for the file.
    pub places: JournalPlaces,
    /// Document that was opened.
    pub origin: Origin,
    /// Present rig; `None` if a project file holds exactly this rig, or the rig is empty and has no uid.
    pub rig: Option<Rig>,
    /// Text of the caller for the time after a crash, such as the paths of the open meshes. Recovery returns it unchanged.
    pub context: String,
    /// The rig that a project file holds, where `rig` is `None`. It is not written; a journal that knows it can fold, see
    /// [`MOST_CHANGES`](super::MOST_CHANGES).
    pub saved_rig: Option<Rig>,
}

/// A journal that continues recovered work.
pub struct ResumedJournal {
    /// The journal.
    pub journal: Journal,
    /// Path where the former file is kept, because it was damaged or some of its changes could not be applied.
    pub kept: Option<PathBuf>,
}

/// Orders to the thread.
pub(super) enum Order {
    Change(Commit),
    Context(String),
    Saving(SaveMark, Sender<SyncResult>),
    Saved(SaveMark, JournalPlaces),
    Flush(Sender<SyncResult>),
    SyncFailed(PathBuf, JournalWriteError),
    Finish(Sender<SyncResult>),
    Close(Sender<SyncResult>),
}

/// State that the thread publishes.
#[derive(Default)]
pub(super) struct WriterState {
    state: Mutex<State>,
    troubled: AtomicBool,
    held: AtomicUsize,
}

#[derive(Default)]
struct State {
    path: Option<PathBuf>,
    trouble: Option<Arc<JournalWriteError>>,
}

impl WriterState {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn path(&self) -> Option<PathBuf> {
        self.state().path.clone()
    }

    pub(super) fn trouble(&self) -> Option<Arc<JournalWriteError>> {
        // The atomic flag avoids the lock, since this is called in every frame.
        if self.troubled.load(Ordering::Acquire) { self.state().trouble.clone() } else { None }
    }

    /// Records the number of changes in memory.
    pub(super) fn hold(&self, changes: usize) {
        self.held.store(changes, Ordering::Release);
    }

    /// Records that the journal is written at `path` without trouble; returns the former path.
    pub(super) fn settle(&self, path: Option<PathBuf>) -> Option<PathBuf> {
        let mut state = self.state();
        state.trouble = None;
        self.troubled.store(false, Ordering::Release);
        std::mem::replace(&mut state.path, path)
    }

    /// Records a reason for trouble. The former one stays if it is equal, so that it counts as one occurrence.
    pub(super) fn fail(&self, reason: JournalWriteError) {
        let mut state = self.state();
        if state.trouble.as_deref() != Some(&reason) {
            state.trouble = Some(reason.into());
        }
        self.troubled.store(true, Ordering::Release);
    }
}

struct Inner {
    orders: Sender<Order>,
    shared: Arc<WriterState>,
    position: AtomicU64,
    closed: AtomicBool,
}

impl Journal {
    /// Starts a journal. [`Journal::trouble`] gives its errors.
    pub fn start(disk: Arc<dyn Disk>, start: JournalStart) -> Self {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let base = start.rig.map(Arc::new);
        let known = match &start.origin {
            _ if base.is_some() => base.clone(),
            Origin::Project { .. } => start.saved_rig.map(Arc::new),
            _ => Some(Arc::default()),
        };
        let content = Content {
            started: now.as_secs(),
            origin: start.origin,
            base,
            context: start.context,
            known,
            ..Content::default()
        };
        let session = RandomState::new().hash_one((SystemTime::now(), std::process::id()));
        Self::begin(disk, session, start.places, content, None)
    }

    /// Continues with the work that was recovered from the file `old` and [restored](RecoveredJournal::restore). The
    /// journal holds all unsaved changes from its start; once it is on the disk, `old` is removed.
    ///
    /// A damaged journal is kept under the ending `.damaged`, and one whose changes could not all be applied under the
    /// ending `.kept`. No search finds those files, and the program never removes them.
    pub fn resume(
        disk: Arc<dyn Disk>,
        places: JournalPlaces,
        recovered: &RecoveredJournal,
        restored: &RestoredRig,
        old: &Path,
    ) -> ResumedJournal {
        let ending = match recovered.is_damaged() {
            true => Some(".damaged"),
            false => restored.replayed.refused.is_some().then_some(".kept"),
        };
        // A file that cannot be renamed stays in its place, which the next journal then leaves alone.
        let (kept, replaces) = match ending.map(|ending| set_aside(disk.as_ref(), old, ending)) {
            None => (None, Some(old.to_owned())),
            Some(Ok((aside, old_is_there))) => (Some(aside), old_is_there.then(|| old.to_owned())),
            Some(Err(_)) => (Some(old.to_owned()), None),
        };
        let mut content = restored.content.clone();
        let held = content.changes.len();
        let saved = recovered.saved(&mut |path| file_hash_at(disk.as_ref(), path)).map(|(_, mark)| mark.clone());
        match (saved, restored.contained) {
            (Some(mark), SavedSteps::Marked) => content.rebase(&mark),
            (Some(mark), SavedSteps::Counted(contained)) => content.rebase_after(&mark, contained),
            (_, SavedSteps::Nothing) | (None, _) => {}
        }
        let is_start = held - content.changes.len() == restored.start.contained;
        content.known = is_start.then(|| restored.start.rig.clone());
        // The same session gives the same file name, so that the file replaces the old one in one step.
        ResumedJournal { journal: Self::begin(disk, recovered.session, places, content, replaces), kept }
    }

    fn begin(
        disk: Arc<dyn Disk>,
        session: u64,
        places: JournalPlaces,
        content: Content,
        replaces: Option<PathBuf>,
    ) -> Self {
        let (orders, inbox) = channel();
        let shared = Arc::new(WriterState::default());
        let position = AtomicU64::new(content.first.saturating_add(content.changes.len() as u64));
        let writer =
            Writer { disk, shared: shared.clone(), orders: orders.clone(), session, places, content, replaces };
        let spawned = thread::Builder::new().name("journal".to_owned()).spawn(move || writer.run(&inbox));
        if let Err(error) = spawned {
            shared.fail(JournalWriteError::Thread(error.into()));
        }
        Self { inner: Arc::new(Inner { orders, shared, position, closed: AtomicBool::new(false) }) }
    }

    /// Records one change. Returns at once; large weights are encoded by the journal's own thread.
    pub fn record(&self, committed: Commit) {
        self.inner.position.fetch_add(1, Ordering::AcqRel);
        self.order(Order::Change(committed));
    }

    /// Reason why changes cannot be stored at the moment, and what to do, for people; `None` while they are stored.
    pub fn trouble(&self) -> Option<Arc<JournalWriteError>> {
        self.inner.shared.trouble()
    }

    /// Waits until all changes so far are on the disk, at most for `limit`; after an earlier failure, tries again at
    /// once.
    ///
    /// # Errors
    /// The reason why the changes are not on the disk, for people.
    pub fn flush(&self, limit: Duration) -> Result<(), JournalWriteError> {
        self.ask(Order::Flush, limit)
    }

    /// Number of changes recorded since the work started, which is the state of the document for
    /// [`SaveMark::position`].
    pub fn position(&self) -> u64 {
        self.inner.position.load(Ordering::Acquire)
    }

    /// Number of changes that are held in memory, so that the whole journal can be written in another place: less than
    /// [`MOST_CHANGES`](super::MOST_CHANGES) while people do steps, whatever the number of changes since the last save.
    pub fn held(&self) -> usize {
        self.inner.shared.held.load(Ordering::Acquire)
    }

    /// Path of the journal; `None` before it is created, and if no place accepts it.
    pub fn path(&self) -> Option<PathBuf> {
        self.inner.shared.path()
    }

    /// Replaces the caller's text, for [`RecoveredJournal::context`].
    pub fn context(&self, context: impl Into<String>) {
        self.order(Order::Context(context.into()));
    }

    /// Records that the project file is about to get the content with that hash, and waits until the mark is on the
    /// disk. Call this before writing the file; if the write then fails, nothing needs to be done.
    ///
    /// # Errors
    /// The reason why the mark is not on the disk. The project can be saved nevertheless.
    pub fn saving(&self, mark: SaveMark, limit: Duration) -> Result<(), JournalWriteError> {
        self.ask(|answer| Order::Saving(mark, answer), limit)
    }

    /// Starts the journal again from the saved project file, with the changes since that save. Returns at once.
    pub fn saved(&self, mark: SaveMark, places: JournalPlaces) {
        self.order(Order::Saved(mark, places));
    }

    /// Ends the journal and removes its file, since all changes are saved or discarded. Changes recorded later are
    /// dropped.
    ///
    /// # Errors
    /// The reason why the file could not be removed; the file itself records that it holds nothing to recover.
    pub fn close(&self, limit: Duration) -> Result<(), JournalWriteError> {
        if self.inner.closed.swap(true, Ordering::AcqRel) {
            return Ok(());
        }
        self.ask(Order::Close, limit)
    }

    fn order(&self, order: Order) {
        // Sending fails only after the thread has ended, which was requested or reported.
        let _ = self.inner.orders.send(order);
    }

    fn ask(&self, order: impl FnOnce(Sender<SyncResult>) -> Order, limit: Duration) -> Result<(), JournalWriteError> {
        self.inner.ask(order, limit)
    }
}

impl Inner {
    fn ask(&self, order: impl FnOnce(Sender<SyncResult>) -> Order, limit: Duration) -> Result<(), JournalWriteError> {
        let (answer, inbox) = channel();
        let ended = || Err(JournalWriteError::Closed);
        if self.orders.send(order(answer)).is_err() {
            return ended();
        }
        match inbox.recv_timeout(limit) {
            Ok(result) => result,
            Err(RecvTimeoutError::Timeout) => Err(JournalWriteError::Late(limit)),
            Err(RecvTimeoutError::Disconnected) => ended(),
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        if !self.closed.load(Ordering::Acquire) {
            let _ = self.ask(Order::Finish, PATIENCE);
        }
    }
}

impl StepSink for Journal {
    fn record(&self, committed: Commit) {
        Journal::record(self, committed);
    }

    fn trouble(&self) -> Option<SinkError> {
        Journal::trouble(self).map(SinkError::new)
    }

    fn flush(&self, limit: Duration) -> Result<(), SinkError> {
        Journal::flush(self, limit).map_err(|error| SinkError::new(Arc::new(error)))
    }
}
