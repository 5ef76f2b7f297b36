//! Encoding of changes as frames.

use serde::{Deserialize, Serialize};

use super::{
    Content, JournalWriteError, Origin, SaveMark,
    frame::{RecordKind, put_frame, put_prelude},
    text::{SkinsOut, rig_text, step_text, value_text},
};
use crate::rig::step::{Commit, UndoStacks};

/// Payload of the header record.
#[derive(Serialize, Deserialize)]
pub(super) struct Header {
    pub generation: u64,
    pub started: u64,
    pub process: u32,
    pub origin: Origin,
    pub first: u64,
}

/// Encoder of changes to the bytes that are appended to one file.
pub(super) struct Encoder {
    session: u64,
    number: u64,
    /// History as a reader of the file will have it, so that steps it has need not be written again.
    stacks: UndoStacks,
    skins: SkinsOut,
}

impl Encoder {
    /// Bytes of a whole file with this content, and the encoder that appends to it.
    pub(super) fn begin(session: u64, content: &Content) -> Result<(Self, Vec<u8>), JournalWriteError> {
        let mut encoder = Self { session, number: 0, stacks: UndoStacks::default(), skins: SkinsOut::default() };
        let mut out = Vec::new();
        put_prelude(&mut out, session);
        let header = Header {
            generation: content.generation,
            started: content.started,
            process: std::process::id(),
            origin: content.origin.clone(),
            first: content.first,
        };
        encoder.put(&mut out, RecordKind::Header, value_text(&header)?.as_bytes())?;
        encoder.context(&mut out, &content.context)?;
        if let Some(rig) = &content.base {
            let text = rig_text(rig, &mut encoder.skins)?;
            encoder.put_with_skins(&mut out, RecordKind::Base, &text)?;
            // A second copy, because every change depends on this rig and no other record holds it. Readers take either
            // copy.
            encoder.put(&mut out, RecordKind::Base, text.as_bytes())?;
        }
        for committed in &content.changes {
            encoder.change(&mut out, committed)?;
        }
        for mark in &content.marks {
            encoder.mark(&mut out, mark)?;
        }
        Ok((encoder, out))
    }

    /// Appends a change. On failure `out` is unchanged, and neither this change nor a later one can be added to this
    /// file.
    pub(super) fn change(&mut self, out: &mut Vec<u8>, committed: &Commit) -> Result<(), JournalWriteError> {
        let (kind, whole) = match committed {
            Commit::Done(_) => (RecordKind::Done, true),
            Commit::Undone(step) if self.stacks.undoes(step) => (RecordKind::Undone, false),
            Commit::Undone(_) => (RecordKind::UndoneOlder, true),
            Commit::Redone(step) if self.stacks.redoes(step) => (RecordKind::Redone, false),
            Commit::Redone(_) => (RecordKind::RedoneOlder, true),
        };
        let text = if whole { step_text(committed.step(), &mut self.skins)? } else { String::new() };
        self.put_with_skins(out, kind, &text)?;
        self.stacks.follow(committed);
        Ok(())
    }

    /// Appends a mark that the project is about to be saved.
    pub(super) fn mark(&mut self, out: &mut Vec<u8>, mark: &SaveMark) -> Result<(), JournalWriteError> {
        self.put(out, RecordKind::Mark, value_text(mark)?.as_bytes())
    }

    /// Appends the caller's text.
    pub(super) fn context(&mut self, out: &mut Vec<u8>, context: &str) -> Result<(), JournalWriteError> {
        self.put(out, RecordKind::Context, context.as_bytes())
    }

    /// Appends the record that ends the journal: nothing is to be recovered.
    pub(super) fn end(&mut self, out: &mut Vec<u8>) -> Result<(), JournalWriteError> {
        self.put(out, RecordKind::End, &[])
    }

    fn put_with_skins(&mut self, out: &mut Vec<u8>, kind: RecordKind, text: &str) -> Result<(), JournalWriteError> {
        let (start, number) = (out.len(), self.number);
        let mut put = || {
            for (hash, bytes) in self.skins.take_fresh() {
                let payload = [&hash.to_le_bytes()[..], &bytes].concat();
                self.put(out, RecordKind::Skin, &payload)?;
            }
            self.put(out, kind, text.as_bytes())
        };
        let result = put();
        if result.is_err() {
            out.truncate(start);
            self.number = number;
        }
        result
    }

    fn put(&mut self, out: &mut Vec<u8>, kind: RecordKind, payload: &[u8]) -> Result<(), JournalWriteError> {
        if !put_frame(out, self.session, self.number, kind, payload) {
            return Err(JournalWriteError::LargeRecord { mebibytes: payload.len() >> 20 });
        }
        self.number += 1;
        Ok(())
    }
}
