//! Syncing on a thread of its own, so that a slow disk does not keep changes from the kernel.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    thread,
    time::{Duration, Instant},
};

use super::JournalWriteError;
use crate::files::DiskFile;

/// Longest time for which changes wait to share a sync, unless a caller waits for it.
const GROUP: Duration = Duration::from_millis(50);

/// Result of a sync: `Err` with the reason for a failure.
pub(super) type SyncResult = Result<(), JournalWriteError>;

/// A thread that syncs one file.
pub(super) struct Syncer {
    orders: Sender<Option<Sender<SyncResult>>>,
    thread: thread::JoinHandle<()>,
}

impl Syncer {
    /// Starts the thread on a handle of the file. A failed sync ends the thread and calls `failed` with the reason.
    pub(super) fn start(
        file: Box<dyn DiskFile>,
        failed: impl FnOnce(JournalWriteError) + Send + 'static,
    ) -> Option<Self> {
        let (orders, inbox) = channel();
        let work = move || run(file, &inbox, failed);
        let thread = thread::Builder::new().name("journal sync".to_owned()).spawn(work).ok()?;
        Some(Self { orders, thread })
    }

    /// Waits for the last sync and closes this handle of the file.
    pub(super) fn end(self) {
        drop(self.orders);
        let _ = self.thread.join();
    }

    /// Requests a sync soon, after a write.
    pub(super) fn soon(&self) {
        let _ = self.orders.send(None);
    }

    /// Requests a sync at once, and its result through `answer`.
    pub(super) fn now(&self, answer: Sender<SyncResult>) {
        if let Err(refused) = self.orders.send(Some(answer))
            && let Some(answer) = refused.0
        {
            let _ = answer.send(Err(JournalWriteError::Earlier));
        }
    }
}

fn run(
    mut file: Box<dyn DiskFile>,
    inbox: &Receiver<Option<Sender<SyncResult>>>,
    failed: impl FnOnce(JournalWriteError),
) {
    let mut next = Instant::now();
    while let Ok(order) = inbox.recv() {
        let mut waiting: Vec<Sender<SyncResult>> = order.into_iter().collect();
        while waiting.is_empty() {
            match inbox.recv_timeout(next.saturating_duration_since(Instant::now())) {
                Ok(order) => waiting.extend(order),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
        waiting.extend(inbox.try_iter().flatten());
        let result = file.sync().map_err(JournalWriteError::from);
        next = Instant::now() + GROUP;
        for answer in waiting {
            let _ = answer.send(result.clone());
        }
        if let Err(reason) = result {
            failed(reason);
            return;
        }
    }
}
