//! A progress bar for work that takes more than a second, on terminals only.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

/// Progress of one piece of work.
pub(super) struct Progress {
    what: &'static str,
    since: Instant,
    bar: Option<ProgressBar>,
    terminal: bool,
}

impl Progress {
    /// Starts the work; a bar is not shown yet.
    pub fn new(what: &'static str) -> Self {
        Self { what, since: Instant::now(), bar: None, terminal: std::io::stderr().is_terminal() }
    }

    /// Updates the finished share, 0 to 1.
    pub fn at(&mut self, part: f32) {
        if !self.terminal || self.since.elapsed() < Duration::from_secs(1) {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{msg} [{bar:32}] {percent}% {elapsed}");
            let bar = ProgressBar::new(1000).with_message(self.what);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
            bar
        });
        bar.set_position((part.clamp(0.0, 1.0) * 1000.0) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Runs work without known progress, with a spinner after the first second.
pub(super) fn spinning<T>(what: &'static str, work: impl FnOnce() -> T) -> T {
    if !std::io::stderr().is_terminal() {
        return work();
    }
    let (done, wait) = std::sync::mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            if wait.recv_timeout(Duration::from_secs(1)) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                let bar = ProgressBar::new_spinner().with_message(what);
                while wait.recv_timeout(Duration::from_millis(100)) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                    bar.tick();
                }
                bar.finish_and_clear();
            }
        });
        let result = work();
        drop(done);
        result
    })
}
