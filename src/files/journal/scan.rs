//! Scanner of a journal: every sound record, and the gaps between them.
//!
//! After a damaged record the scan continues at the end that the record's length gives. If no record stands there, it
//! searches byte by byte for a head with a known kind, a length that fits the file and a number that can come next, and
//! only then computes a checksum. The bytes of failed checksums are bounded by a multiple of the file's length, so that
//! a crafted file cannot stall a reader; a head that another one follows has a budget of its own.

use std::collections::{BTreeMap, VecDeque};

use super::{
    Damage, Gap, JournalError, RecordKind,
    frame::{Frame, HEAD, Head, JOURNAL_FORMAT, MAGIC, MAX_RECORD, PRELUDE, TAIL, read_frame},
};
use crate::rig::skin::content_hash;

/// Largest number of records in one gap; a head that implies more is no head.
const MAX_LOST: u64 = 1 << 24;
/// Highest format number of a later version; a greater number is damage.
const MAX_FORMAT: u32 = 1 << 10;
/// Largest size in bytes of a record whose damaged frame is repaired.
const MAX_MENDED: usize = 16 << 20;
/// Budget of failed checksums, as a multiple of the file's length.
const HASHED: usize = 8;
/// Budget of failed checksums in bytes for files of any length.
const HASHED_ANYWAY: usize = 1 << 20;

/// Part of a journal.
pub(super) enum Item<'a> {
    /// A record whose checksum fits or that was repaired: position in bytes, kind, payload.
    Record(usize, RecordKind, &'a [u8]),
    /// Bytes without a usable record; the number of changes before the gap is left at 0.
    Gap(Gap),
}

/// A journal's records and gaps, in the order of the file.
pub(super) struct Scan<'a> {
    bytes: &'a [u8],
    session: u64,
    at: usize,
    /// Number of the next record if none is missing.
    next: u64,
    /// Position in bytes where a search begins if the first record is not in its place.
    first: usize,
    /// Remaining budgets of failed checksums in bytes: for heads that another head follows, and for other heads.
    budget: [usize; 2],
    ready: VecDeque<Item<'a>>,
}

impl<'a> Scan<'a> {
    /// Starts a scan. The session is that of the prelude or, if that is damaged, the one that the records' checksums
    /// agree on.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, JournalError> {
        let has_magic = bytes.starts_with(&MAGIC);
        let prelude = bytes.get(MAGIC.len()..PRELUDE).and_then(|rest| rest.split_first_chunk::<4>());
        let (format, stored) = match prelude {
            Some((format, session)) => {
                let session = session.first_chunk::<8>().map_or(0, |bytes| u64::from_le_bytes(*bytes));
                (u32::from_le_bytes(*format), session)
            }
            None if has_magic => return Err(JournalError::NothingSound),
            None => return Err(JournalError::NotAJournal),
        };
        let fits = read_frame(bytes, PRELUDE, stored).is_ok();
        let voted = if fits { Some(stored) } else { vote(bytes, stored) };
        if has_magic && voted != Some(stored) && (JOURNAL_FORMAT + 1..MAX_FORMAT).contains(&format) {
            return Err(JournalError::Newer { found: format, known: JOURNAL_FORMAT });
        }
        if !has_magic && voted.is_none() {
            return Err(JournalError::NotAJournal);
        }
        let session = voted.unwrap_or(stored);
        let budget = [bytes.len().saturating_mul(HASHED).saturating_add(HASHED_ANYWAY); 2];
        let first = if has_magic { PRELUDE + 1 } else { 0 };
        let mut scan = Self { bytes, session, at: PRELUDE, next: 0, first, budget, ready: VecDeque::new() };
        if !has_magic || format != JOURNAL_FORMAT || session != stored {
            let damage = Damage::Prelude;
            scan.ready.push_back(Item::Gap(Gap {
                at: 0,
                bytes: PRELUDE,
                records: Some(0),
                kind: None,
                damage,
                changes: 0,
            }));
        }
        Ok(scan)
    }

    /// Session that all checksums depend on.
    pub(super) fn session(&self) -> u64 {
        self.session
    }

    /// Reads the frame at `at`, unless the budget of failed checksums is spent.
    fn read(&mut self, at: usize) -> Result<Frame<'a>, Damage> {
        let head = Head::at(self.bytes, at).ok_or(Damage::Cut)?;
        if head.length > MAX_RECORD {
            return Err(Damage::Length);
        }
        let end = head.end(at).filter(|end| *end <= self.bytes.len()).ok_or(Damage::Cut)?;
        let budget = &mut self.budget[usize::from(!is_followed(self.bytes, end, head.number))];
        let left = budget.checked_sub(end - at).ok_or(Damage::Checksum)?;
        let frame = read_frame(self.bytes, at, self.session);
        if frame.is_err() {
            *budget = left;
        }
        frame
    }

    /// Adds the next sound frame.
    fn take(&mut self, frame: Frame<'a>) {
        self.at = frame.end();
        self.next = frame.number.saturating_add(1);
        let bytes = frame.end() - frame.at;
        let gap = Gap { at: frame.at, bytes, records: Some(1), kind: None, damage: Damage::UnknownKind, changes: 0 };
        self.ready.push_back(match frame.kind {
            Some(kind) => Item::Record(frame.at, kind, frame.payload),
            None => Item::Gap(gap),
        });
    }

    /// Continues after a position where the next record is not sound.
    fn resume(&mut self, damage: Damage) {
        let (at, next) = (self.at, self.next);
        let head = Head::at(self.bytes, at).filter(|head| head.number == next && RecordKind::of(head.kind).is_some());
        let named_end = head.and_then(|head| head.end(at)).filter(|end| *end <= self.bytes.len());
        let follows = |frame: &Frame| frame.number == next.saturating_add(1);
        let after = named_end.and_then(|end| self.read(end).ok()).filter(follows);
        let from = if next == 0 { self.first } else { at + 1 };
        let found = after.or_else(|| self.search(from));
        let end = found.map_or(self.bytes.len(), |frame| frame.at);
        let at = at.min(end);
        let damage = if damage == Damage::Cut && found.is_some() { Damage::Length } else { damage };
        let mut gap = Gap { at, bytes: end - at, records: None, kind: None, damage, changes: 0 };
        gap.records = match found {
            Some(frame) => Some(frame.number - next),
            None => named_end.filter(|named| *named == end).map(|_| 1),
        };
        if gap.records == Some(1) || found.is_none() {
            let mended = self.mended(at, end);
            gap.kind = mended.map(|(kind, _)| kind).or(head.and_then(|head| RecordKind::of(head.kind)));
            if let Some((kind, payload)) = mended {
                gap = Gap { records: Some(0), damage: Damage::Frame, ..gap };
                self.ready.extend([Item::Gap(gap), Item::Record(at, kind, payload)]);
            } else {
                self.ready.push_back(Item::Gap(gap));
            }
        } else {
            self.ready.push_back(Item::Gap(gap));
        }
        self.at = end;
        if let Some(frame) = found {
            self.take(frame);
        }
    }

    /// Next sound record from `from` on with a number that can come next.
    fn search(&mut self, from: usize) -> Option<Frame<'a>> {
        for at in from..self.bytes.len().saturating_sub(HEAD + TAIL - 1) {
            if plausible(self.bytes, at, self.next).is_some()
                && let Ok(frame) = self.read(at)
            {
                return Some(frame);
            }
        }
        None
    }

    /// The single record between two positions, if only its head or one bit of its checksum is damaged: length and
    /// number follow from the records around it, and the checksum gives the kind.
    fn mended(&self, at: usize, end: usize) -> Option<(RecordKind, &'a [u8])> {
        let (whole, checksum) = self.bytes.get(at..end)?.split_last_chunk::<TAIL>()?;
        let payload = whole.get(HEAD..).filter(|payload| payload.len() <= MAX_MENDED.min(MAX_RECORD))?;
        let mut copy = whole.to_vec();
        copy.get_mut(..4)?.copy_from_slice(&(payload.len() as u32).to_le_bytes());
        copy.get_mut(5..HEAD)?.copy_from_slice(&self.next.to_le_bytes());
        let wanted = u64::from_le_bytes(*checksum) ^ self.session;
        RecordKind::ALL.into_iter().find_map(|kind| {
            *copy.get_mut(4)? = kind as u8;
            ((content_hash(&copy) ^ wanted).count_ones() <= 1).then_some((kind, payload))
        })
    }
}

impl<'a> Iterator for Scan<'a> {
    type Item = Item<'a>;

    fn next(&mut self) -> Option<Item<'a>> {
        if let Some(item) = self.ready.pop_front() {
            return Some(item);
        }
        if self.at >= self.bytes.len() {
            return None;
        }
        match self.read(self.at) {
            Ok(frame) if frame.number == self.next => self.take(frame),
            Ok(frame) if (self.next..self.next.saturating_add(MAX_LOST)).contains(&frame.number) => {
                let (at, records) = (frame.at, Some(frame.number - self.next));
                let gap = Gap { at, bytes: 0, records, kind: None, damage: Damage::Missing, changes: 0 };
                self.ready.push_back(Item::Gap(gap));
                self.take(frame);
            }
            Ok(_) => self.resume(Damage::Misplaced),
            Err(damage) => self.resume(damage),
        }
        self.ready.pop_front()
    }
}

/// Head at `at` and the end of its frame, if its values are possible for a record with a number from `next` on.
fn plausible(bytes: &[u8], at: usize, next: u64) -> Option<(Head, usize)> {
    RecordKind::of(*bytes.get(at + 4)?)?;
    let head = Head::at(bytes, at)?;
    if head.length > MAX_RECORD || !(next..next.saturating_add(MAX_LOST)).contains(&head.number) {
        return None;
    }
    let end = head.end(at).filter(|end| *end <= bytes.len())?;
    Some((head, end))
}

/// True if the file ends at `end`, or a possible record after `number` begins there.
fn is_followed(bytes: &[u8], end: usize, number: u64) -> bool {
    let next = number.saturating_add(1);
    end == bytes.len() || plausible(bytes, end, next).is_some_and(|(head, _)| head.number == next)
}

/// Session from the records themselves, because a checksum is the hash of its record mixed with the session: the first
/// session that two records agree on, or that one record shares with the prelude.
fn vote(bytes: &[u8], stored: u64) -> Option<u64> {
    let mut votes = BTreeMap::<u64, u32>::new();
    let mut budget = bytes.len().saturating_mul(HASHED).saturating_add(HASHED_ANYWAY);
    let mut at = 0;
    while at + HEAD + TAIL <= bytes.len() {
        let candidate = plausible(bytes, at, 0).filter(|(head, end)| is_followed(bytes, *end, head.number));
        at += 1;
        let Some((_, end)) = candidate else { continue };
        budget = budget.checked_sub(end - at)?;
        let Some((whole, checksum)) = bytes.get(at - 1..end).and_then(|frame| frame.split_last_chunk::<TAIL>()) else {
            continue;
        };
        let session = content_hash(whole) ^ u64::from_le_bytes(*checksum);
        let count = votes.entry(session).or_default();
        *count += 1;
        if session == stored || *count == 2 {
            return Some(session);
        }
        // If this is no record, the search continues within the next ones, which vote in their turn.
        at = end;
    }
    None
}
