//! Frames: the layout of records in the file, and the detection of torn or damaged ones.

use super::Damage;
use crate::rig::skin::content_hash;

/// First bytes of every journal.
pub(super) const MAGIC: [u8; 8] = *b"RIGJRNL\0";
/// Number of the journal format that Rigsmith writes, which is also the highest number that it reads.
///
/// A later format has to mix its number into the checksums, so that they reveal the format where the prelude is
/// damaged.
pub const JOURNAL_FORMAT: u32 = 1;
/// Bytes before the first frame: magic, format, session.
pub(super) const PRELUDE: usize = 8 + 4 + 8;
/// Bytes of a frame before its payload: length of the payload, kind, number.
pub(super) const HEAD: usize = 4 + 1 + 8;
/// Bytes of the checksum after the payload.
pub(super) const TAIL: usize = 8;
/// Largest number of bytes in the payload of one record.
pub const MAX_RECORD: usize = 1 << 30;

/// Kind of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum RecordKind {
    /// Start of the work.
    Header = 1,
    /// Rig at the start of the work.
    Base = 2,
    /// A step that was done.
    Done = 3,
    /// The last step in effect was undone.
    Undone = 4,
    /// The last undone step was redone.
    Redone = 5,
    /// A step from before the journal was undone.
    UndoneOlder = 6,
    /// A step from before the journal was redone.
    RedoneOlder = 7,
    /// Weights that later frames name by their hash.
    Skin = 8,
    /// The project file is about to get this content.
    Mark = 9,
    /// The caller's text.
    Context = 10,
    /// The work was discarded or saved; nothing is to be recovered.
    End = 11,
}

impl RecordKind {
    /// Kinds of records, by number.
    pub(super) const ALL: [Self; 11] = [
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

    /// Kind with this number.
    pub(super) fn of(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }

    /// True for the kinds that are counted as changes of the rig.
    pub fn is_change(self) -> bool {
        matches!(self, Self::Done | Self::Undone | Self::Redone | Self::UndoneOlder | Self::RedoneOlder)
    }
}

/// Appends the bytes before the first frame.
pub(super) fn put_prelude(out: &mut Vec<u8>, session: u64) {
    out.extend(MAGIC);
    out.extend(JOURNAL_FORMAT.to_le_bytes());
    out.extend(session.to_le_bytes());
}

/// Appends a frame; returns false if the payload is too long for one.
#[must_use]
pub(super) fn put_frame(out: &mut Vec<u8>, session: u64, number: u64, kind: RecordKind, payload: &[u8]) -> bool {
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

/// Head of a frame, as stored.
#[derive(Debug, Clone, Copy)]
pub(super) struct Head {
    pub length: usize,
    pub kind: u8,
    pub number: u64,
}

impl Head {
    /// The head at `at`; `None` if the file ends within it.
    pub(super) fn at(bytes: &[u8], at: usize) -> Option<Self> {
        let (length, rest) = bytes.get(at..)?.split_first_chunk::<4>()?;
        let (kind, rest) = rest.split_first()?;
        let number = rest.first_chunk::<8>()?;
        let length = u32::from_le_bytes(*length) as usize;
        Some(Self { length, kind: *kind, number: u64::from_le_bytes(*number) })
    }

    /// End of a frame that begins at `at` with this head; `None` if the end exceeds any file.
    pub(super) fn end(&self, at: usize) -> Option<usize> {
        at.checked_add(HEAD)?.checked_add(self.length)?.checked_add(TAIL)
    }
}

/// A frame whose checksum fits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame<'a> {
    pub at: usize,
    pub number: u64,
    /// Kind of the record; `None` for a kind that this version does not have.
    pub kind: Option<RecordKind>,
    pub payload: &'a [u8],
}

impl Frame<'_> {
    /// Position of the next frame, in bytes from the start of the file.
    pub(super) fn end(&self) -> usize {
        self.at + HEAD + self.payload.len() + TAIL
    }
}

/// Reads the frame at `at`.
pub(super) fn read_frame(bytes: &[u8], at: usize, session: u64) -> Result<Frame<'_>, Damage> {
    let head = Head::at(bytes, at).ok_or(Damage::Cut)?;
    if head.length > MAX_RECORD {
        return Err(Damage::Length);
    }
    let end = head.end(at).filter(|end| *end <= bytes.len()).ok_or(Damage::Cut)?;
    let (whole, checksum) = bytes.get(at..end).and_then(|frame| frame.split_last_chunk::<TAIL>()).ok_or(Damage::Cut)?;
    if u64::from_le_bytes(*checksum) != content_hash(whole) ^ session {
        return Err(Damage::Checksum);
    }
    let payload = whole.get(HEAD..).ok_or(Damage::Cut)?;
    Ok(Frame { at, number: head.number, kind: RecordKind::of(head.kind), payload })
}
