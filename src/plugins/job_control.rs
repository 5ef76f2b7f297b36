//! Progress of a background job and the wish to stop it, shared by the job's component and its task.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU32, Ordering},
};

/// The side of a job that an app sees. The task stops soon after this is dropped.
#[derive(Debug, Default)]
pub(super) struct JobControl(Arc<JobState>);

/// The side of a job that its task sees.
#[derive(Debug, Clone)]
pub(super) struct JobReporter(Arc<JobState>);

#[derive(Debug, Default)]
struct JobState {
    progress: AtomicU32,
    cancelled: AtomicBool,
}

impl JobControl {
    /// The side for the task.
    pub fn reporter(&self) -> JobReporter {
        JobReporter(Arc::clone(&self.0))
    }

    /// Finished share, 0 to 1.
    pub fn progress(&self) -> f32 {
        f32::from_bits(self.0.progress.load(Ordering::Relaxed))
    }

    /// Lets the task stop at its next report.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// True if the job is to stop.
    pub fn is_cancelled(&self) -> bool {
        self.0.cancelled.load(Ordering::Relaxed)
    }
}

impl Drop for JobControl {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl JobReporter {
    /// Tells the finished share; false if the task is to stop.
    pub fn report(&self, share: f32) -> bool {
        self.0.progress.store(share.to_bits(), Ordering::Relaxed);
        !self.0.cancelled.load(Ordering::Relaxed)
    }
}
