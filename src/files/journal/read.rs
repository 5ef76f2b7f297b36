//! Reading a journal from bytes that may be anything.

use std::sync::Arc;

use super::{
    Content, Origin, SaveMark,
    encode::Header,
    frame::{Frames, JOURNAL_FORMAT, Kind, MAGIC, PRELUDE},
    text::{SkinsIn, read_rig, read_step, read_value},
};
use crate::rig::{
    Rig,
    skin::read_skin_data,
    step::{Committed, Replayed, Timeline, replay},
};

/// Bytes of a journal that are read.
pub const MAX_JOURNAL: u64 = 8 << 30;

/// Why bytes are not a journal at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JournalError {
    /// The file does not begin like a journal.
    #[error("this is not a journal: it does not begin with RIGJRNL")]
    NotAJournal,
    /// Written by a later version.
    #[error("the journal has format {found}, this version reads up to {known}: update to recover the work in it")]
    Newer {
        /// The file's format.
        found: u32,
        /// The highest format known.
        known: u32,
    },
    /// The first record is gone, so that nobody knows what the changes belong to.
    #[error("the journal is damaged at its very beginning: {0}; open the last saved file")]
    NoHeader(&'static str),
}

/// How a journal ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// With a whole record: the process ended, or is still at work.
    Open,
    /// With the word that nothing is to be recovered.
    Closed,
    /// With something that is no record; what came before it is sound.
    Torn {
        /// Where, in bytes from the start of the file.
        at: usize,
        /// Bytes from there to the end.
        lost: usize,
        /// What is wrong there.
        why: &'static str,
    },
}

/// What a journal holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovered {
    /// The session that wrote it.
    pub session: u64,
    /// The process that wrote it.
    pub process: u32,
    /// How it ends.
    pub ending: Ending,
    pub(super) content: Content,
}

/// What to replay a journal on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// The rig that the journal holds.
    Journal,
    /// The rig of the project file at [`Recovered::project`], which holds this many of the changes already.
    Project {
        /// How many of [`Recovered::changes`].
        contained: usize,
    },
    /// The project file was changed by someone else since, or is gone. Replaying all changes on what it holds now is a
    /// guess that people should confirm.
    Changed,
}

impl Recovered {
    /// What the work started from.
    pub fn origin(&self) -> &Origin {
        &self.content.origin
    }

    /// When the work started, in seconds since 1970.
    pub fn started(&self) -> u64 {
        self.content.started
    }

    /// The rig that the work started with; `None` if that is what the project file holds.
    pub fn base(&self) -> Option<&Rig> {
        self.content.base.as_deref()
    }

    /// The latest text given to [`Journal::context`](super::Journal::context).
    pub fn context(&self) -> &str {
        &self.content.context
    }

    /// The changes, in order.
    pub fn changes(&self) -> &[Committed] {
        &self.content.changes
    }

    /// Saves that were at least begun, in order.
    pub fn marks(&self) -> &[SaveMark] {
        &self.content.marks
    }

    /// The project file that was last saved or opened, if there is one.
    pub fn project(&self) -> Option<&std::path::Path> {
        let opened = match &self.content.origin {
            Origin::Project { path, .. } => Some(path.as_path()),
            _ => None,
        };
        self.content.marks.last().map(|mark| mark.path.as_path()).or(opened)
    }

    /// What to replay on. `hash` gives the hash of the file at a path as it is now, or `None` if it cannot be read.
    pub fn basis(&self, mut hash: impl FnMut(&std::path::Path) -> Option<u64>) -> Basis {
        if let Some(mark) = self.saved(&mut hash) {
            return Basis::Project { contained: self.contained(mark) };
        }
        match &self.content.origin {
            _ if self.content.base.is_some() => Basis::Journal,
            Origin::Project { path, hash: known } if hash(path) == Some(*known) => Basis::Project { contained: 0 },
            Origin::Project { .. } => Basis::Changed,
            _ => Basis::Journal,
        }
    }

    /// The latest save whose content is in the project file now.
    pub(super) fn saved(&self, hash: &mut impl FnMut(&std::path::Path) -> Option<u64>) -> Option<&SaveMark> {
        self.content.marks.iter().rev().find(|mark| hash(&mark.path) == Some(mark.hash))
    }

    fn contained(&self, mark: &SaveMark) -> usize {
        let contained = mark.position.saturating_sub(self.content.first);
        usize::try_from(contained).unwrap_or(usize::MAX).min(self.content.changes.len())
    }

    /// Makes the rig as it was: on the journal's own rig (an empty one if it has none) for [`Basis::Journal`], else on
    /// `project`, the rig that the project file holds now.
    pub fn replay(&self, basis: Basis, project: Option<Rig>) -> Replayed {
        match basis {
            Basis::Journal => replay(self.base().cloned().unwrap_or_default(), self.changes(), 0),
            Basis::Project { contained } => replay(project.unwrap_or_default(), self.changes(), contained),
            Basis::Changed => replay(project.unwrap_or_default(), self.changes(), 0),
        }
    }

    /// Reads frame after frame until one is torn, damaged or makes no sense.
    fn take(&mut self, frames: &mut Frames, total: usize) {
        let mut timeline = Timeline::default();
        let mut skins = SkinsIn::new();
        loop {
            let at = frames.offset();
            let torn = |at: usize, why| Ending::Torn { at, lost: total.saturating_sub(at), why };
            let (kind, payload) = match frames.next() {
                None => return,
                Some(Err(error)) => {
                    self.ending = torn(error.at, error.why);
                    return;
                }
                Some(Ok(frame)) => frame,
            };
            match self.take_frame(kind, payload, &mut timeline, &mut skins) {
                Some(true) => {}
                Some(false) => {
                    self.ending = Ending::Closed;
                    return;
                }
                None => {
                    self.ending = torn(at, "the record's content makes no sense");
                    return;
                }
            }
        }
    }

    /// Takes one record; false at the end of the journal, `None` if it makes no sense here.
    fn take_frame(&mut self, kind: Kind, payload: &[u8], timeline: &mut Timeline, skins: &mut SkinsIn) -> Option<bool> {
        let content = &mut self.content;
        let step = |skins: &SkinsIn| read_step(payload, skins).map(Arc::new);
        let committed = match kind {
            Kind::Done => Committed::Done(step(skins)?),
            Kind::UndoneOlder => Committed::Undone(step(skins)?),
            Kind::RedoneOlder => Committed::Redone(step(skins)?),
            Kind::Undone => Committed::Undone(timeline.done.last()?.clone()),
            Kind::Redone => Committed::Redone(timeline.undone.last()?.clone()),
            Kind::Skin => {
                let (hash, bytes) = payload.split_first_chunk::<8>()?;
                skins.insert(u64::from_le_bytes(*hash), Arc::new(read_skin_data(bytes)?));
                return Some(true);
            }
            Kind::Mark => {
                content.marks.push(read_value(payload)?);
                return Some(true);
            }
            Kind::Context => {
                content.context = std::str::from_utf8(payload).ok()?.to_owned();
                return Some(true);
            }
            Kind::Base if content.changes.is_empty() => {
                content.base = Some(Arc::new(read_rig(payload, skins)?));
                return Some(true);
            }
            Kind::Header | Kind::Base => return None,
            Kind::End => return Some(false),
        };
        timeline.follow(&committed);
        content.changes.push(committed);
        Some(true)
    }
}

/// Reads a journal as far as it is sound. Memory stays within a small multiple of the file's length.
///
/// # Errors
/// [`JournalError`] if not even its beginning can be read. Everything after that is no error: see [`Recovered::ending`].
pub fn recover(bytes: &[u8]) -> Result<Recovered, JournalError> {
    let (session, mut frames, header) = begin(bytes)?;
    let content = Content {
        generation: header.generation,
        started: header.started,
        origin: header.origin,
        first: header.first,
        ..Content::default()
    };
    let mut recovered = Recovered { session, process: header.process, ending: Ending::Open, content };
    recovered.take(&mut frames, bytes.len());
    Ok(recovered)
}

fn begin(bytes: &[u8]) -> Result<(u64, Frames<'_>, Header), JournalError> {
    if bytes.get(..MAGIC.len()) != Some(&MAGIC) {
        return Err(JournalError::NotAJournal);
    }
    let number = |at: usize| bytes.get(at..)?.first_chunk::<4>().copied().map(u32::from_le_bytes);
    let format = number(MAGIC.len()).ok_or(JournalError::NoHeader("it is cut off"))?;
    if format > JOURNAL_FORMAT {
        return Err(JournalError::Newer { found: format, known: JOURNAL_FORMAT });
    }
    let session = bytes.get(PRELUDE - 8..).and_then(|rest| rest.first_chunk::<8>());
    let session = session.copied().map(u64::from_le_bytes).ok_or(JournalError::NoHeader("it is cut off"))?;
    if format == 0 {
        return Err(JournalError::NoHeader("its format is 0"));
    }
    let mut frames = Frames::new(bytes, session);
    let header = match frames.next() {
        None => Err("it is cut off"),
        Some(Err(torn)) => Err(torn.why),
        Some(Ok((Kind::Header, payload))) => read_value(payload).ok_or("its first record makes no sense"),
        Some(Ok(_)) => Err("its first record is no header"),
    };
    Ok((session, frames, header.map_err(JournalError::NoHeader)?))
}

/// A journal's frames counted without reading what is in them: enough to list it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    pub session: u64,
    pub generation: u64,
    pub started: u64,
    pub origin: Origin,
    pub has_base: bool,
    pub first: u64,
    pub changes: usize,
    pub marks: Vec<SaveMark>,
    pub ending: Ending,
}

/// Counts what a journal holds.
pub(super) fn summarise(bytes: &[u8]) -> Result<Summary, JournalError> {
    let (session, mut frames, header) = begin(bytes)?;
    let mut summary = Summary {
        session,
        generation: header.generation,
        started: header.started,
        origin: header.origin,
        has_base: false,
        first: header.first,
        changes: 0,
        marks: Vec::new(),
        ending: Ending::Open,
    };
    while let Some(frame) = frames.next() {
        match frame {
            Err(torn) => {
                let lost = bytes.len().saturating_sub(torn.at);
                summary.ending = Ending::Torn { at: torn.at, lost, why: torn.why };
                break;
            }
            Ok((Kind::End, _)) => {
                summary.ending = Ending::Closed;
                break;
            }
            Ok((Kind::Mark, payload)) => summary.marks.extend(read_value::<SaveMark>(payload)),
            Ok((Kind::Base, _)) => summary.has_base = true,
            Ok((Kind::Header | Kind::Skin | Kind::Context, _)) => {}
            Ok((Kind::Done | Kind::Undone | Kind::Redone | Kind::UndoneOlder | Kind::RedoneOlder, _)) => {
                summary.changes += 1;
            }
        }
    }
    Ok(summary)
}
