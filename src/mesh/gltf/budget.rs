//! The memory budget of one reading, and its notes for the user.

use std::cell::{Cell, RefCell};

use super::{GltfError, memory_limit};

/// Counter of the memory that reading a file takes; memory is charged before it is allocated.
///
/// Memory is never returned to the budget. This bounds the time as well, since all work here is linear in the memory it
/// charges.
pub(super) struct Budget {
    input: Cell<u64>,
    used: Cell<u64>,
}

/// Bytes of memory of a command besides what it reads, which count as used from the start.
const COMMAND: u64 = 12 << 20;

impl Budget {
    pub(super) fn new(input: u64) -> Self {
        Self { input: Cell::new(input), used: Cell::new(COMMAND) }
    }

    /// Adds another file's bytes to the input.
    pub(super) fn add_input(&self, bytes: u64) {
        self.input.set(self.input.get().saturating_add(bytes));
    }

    /// Charges `count` elements of `size` bytes to the object at `place`.
    pub(super) fn take(&self, count: usize, size: usize, place: &str) -> Result<(), GltfError> {
        let used = self.used.get().saturating_add((count as u64).saturating_mul(size as u64));
        let limit = memory_limit(self.input.get());
        if used > limit {
            return Err(GltfError::TooLarge { file: String::new(), place: place.to_owned(), limit });
        }
        self.used.set(used);
        Ok(())
    }
}

/// Sentences for the user, each once, with the number of occurrences.
#[derive(Default)]
pub(super) struct Notes(RefCell<Vec<(String, usize)>>);

/// Largest number of different sentences.
const MAX_NOTES: usize = 100;

impl Notes {
    pub(super) fn add(&self, sentence: impl Into<String>) {
        self.add_times(sentence, 1);
    }

    /// Adds `times` occurrences of a sentence; does nothing if zero.
    pub(super) fn add_times(&self, sentence: impl Into<String>, times: usize) {
        if times == 0 {
            return;
        }
        let sentence = sentence.into();
        let mut list = self.0.borrow_mut();
        if let Some((_, count)) = list.iter_mut().find(|(known, _)| *known == sentence) {
            *count += times;
        } else if list.len() < MAX_NOTES {
            list.push((sentence, times));
        }
    }

    pub(super) fn sentences(&self) -> Vec<String> {
        let list = self.0.borrow();
        let text = |(sentence, count): &(String, usize)| match count {
            1 => format!("{sentence}."),
            _ => format!("{sentence} ({count} times)."),
        };
        list.iter().map(text).collect()
    }
}
