//! Time that work may take.

use std::time::{Duration, Instant};

/// End of the time that a piece of work may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline {
    /// `None` for an end that no clock reaches.
    end: Option<Instant>,
    seconds: u64,
}

/// Error of work that took too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{work} took longer than {seconds} s and had to stop; simplify the input, or raise the limit `seconds`")]
pub struct OutOfTime {
    /// The work, as the subject of a sentence.
    pub work: &'static str,
    /// Time that the work was given.
    pub seconds: u64,
}

impl Deadline {
    /// Deadline of work that begins now.
    pub fn after(time: Duration) -> Self {
        Self { end: Instant::now().checked_add(time), seconds: time.as_secs() }
    }

    /// Refuses to go on with `work`, the subject of a sentence, once the time is over.
    ///
    /// # Errors
    /// [`OutOfTime`], from the end of the time on.
    pub fn check(&self, work: &'static str) -> Result<(), OutOfTime> {
        match self.end {
            Some(end) if Instant::now() >= end => Err(OutOfTime { work, seconds: self.seconds }),
            _ => Ok(()),
        }
    }
}
