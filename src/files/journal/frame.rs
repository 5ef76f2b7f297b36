//! Frames: how records lie in the file, and how a reader notices that one is torn or damaged.

use crate::rig::skin::content_hash;

/// First bytes of every journal.
pub(super) const MAGIC: [u8; 8] = *b"RIGJRNL\0";
/// The format this version writes, and the highest it reads.
pub const JOURNAL_FORMAT: u32 = 1;
/// Bytes before the first frame: magic, format, session.
pub(super) const PRELUDE: usize = 8 + 4 + 8;
/// Bytes of a frame before its payload: length of the payload, kind, number.
const HEAD: usize = 4 + 1 + 8;
/// Bytes of the checksum after the payload.
const TAIL: usize = 8;
/// Bytes of the payload of one record, at most.
pub const MAX_RECORD: usize = 1 << 30;

/// What a frame holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Kind {
    /// Where the work started.
    Header = 1,
    /// The rig it started with.
    Base = 2,
    /// A step that was done.
    Done = 3,
    /// The last step in effect was undone.
    Undone = 4,
    /// The last step undone was done again.
    Redone = 5,
    /// A step from before the journal was undone.
    UndoneOlder = 6,
    /// A step from before the journal was done again.
    RedoneOlder = 7,
    /// Weights that later frames name by their hash.
    Skin = 8,
    /// The project file is about to get this content.
    Mark = 9,
    /// The caller's text.
    Context = 10,
    /// The work was given up or saved; nothing is to be recovered.
    End = 11,
}

impl Kind {
    const ALL: [Self; 11] = [
        Self::Header,
        Self::Base,
        Self::Done,
        Self::Undone,
        Self::Redone,
        Self::UndoneOlder,
        Self::RedoneOlder,
        Self::Skin,
        Self::Mark,
        Self::Context,
        Self::End,
    ];

    fn of(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }
}

/// The bytes before the first frame.
pub(super) fn put_prelude(out: &mut Vec<u8>, session: u64) {
    out.extend(MAGIC);
    out.extend(JOURNAL_FORMAT.to_le_bytes());
    out.extend(session.to_le_bytes());
}

/// Appends a frame; false if the payload is too long for one.
#[must_use]
pub(super) fn put_frame(out: &mut Vec<u8>, session: u64, number: u64, kind: Kind, payload: &[u8]) -> bool {
    if payload.len() > MAX_RECORD {
        return false;
    }
    let start = out.len();
    out.reserve(HEAD + payload.len() + TAIL);
    out.extend((payload.len() as u32).to_le_bytes());
    out.push(kind as u8);
    out.extend(number.to_le_bytes());
    out.extend(payload);
    let checksum = content_hash(&out[start..]) ^ session;
    out.extend(checksum.to_le_bytes());
    true
}

/// What the frames of a journal end with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Torn {
    /// Where the first frame that cannot be used begins.
    pub at: usize,
    /// What is wrong with it.
    pub why: &'static str,
}

/// Reads frames one after the other, up to the first that is not as it was written.
pub(super) struct Frames<'a> {
    bytes: &'a [u8],
    at: usize,
    session: u64,
    number: u64,
}

impl<'a> Frames<'a> {
    /// Frames of a file whose prelude has been checked.
    pub(super) fn new(bytes: &'a [u8], session: u64) -> Self {
        Self { bytes, at: PRELUDE, session, number: 0 }
    }

    /// Where the next frame begins.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    /// The next frame; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Option<Result<(Kind, &'a [u8]), Torn>> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        Some(self.read(rest).map_err(|why| Torn { at: self.at, why }))
    }

    fn read(&mut self, rest: &'a [u8]) -> Result<(Kind, &'a [u8]), &'static str> {
        const CUT: &str = "the record is cut off";
        let (length, after) = rest.split_first_chunk::<4>().ok_or(CUT)?;
        let (kind, after) = after.split_first().ok_or(CUT)?;
        let (number, after) = after.split_first_chunk::<8>().ok_or(CUT)?;
        let length = u32::from_le_bytes(*length) as usize;
        if length > MAX_RECORD {
            return Err("the record's length is damaged");
        }
        let payload = after.get(..length).ok_or(CUT)?;
        let checksum = after.get(length..).and_then(|tail| tail.first_chunk::<TAIL>()).ok_or(CUT)?;
        let whole = rest.get(..HEAD + length).ok_or(CUT)?;
        if u64::from_le_bytes(*checksum) != content_hash(whole) ^ self.session {
            return Err("the record is damaged: its checksum does not fit");
        }
        if u64::from_le_bytes(*number) != self.number {
            return Err("a record is missing before this one");
        }
        let kind = Kind::of(*kind).ok_or("the record is of a kind that this version does not know")?;
        self.number += 1;
        self.at += HEAD + length + TAIL;
        Ok((kind, payload))
    }
}
