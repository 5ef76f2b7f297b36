//! Summary of a journal: counts of its records, without reading their content.

use super::{
    Ending, Gap, JournalError, Origin, RecordCount, RecordKind, SaveMark,
    encode::Header,
    scan::{Item, Scan},
    tally::Tally,
    text::read_value,
};

/// Facts about a journal that are enough to list it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    pub session: u64,
    pub generation: u64,
    pub started: u64,
    pub origin: Origin,
    pub has_base: bool,
    pub first: u64,
    pub marks: Vec<SaveMark>,
    pub tally: Tally,
    pub ending: Ending,
    pub records: RecordCount,
    pub is_damaged: bool,
}

impl Summary {
    fn lose(&mut self, gap: &Gap) {
        self.is_damaged = true;
        self.tally.lose(gap);
        self.records.lose(gap);
        if gap.records != Some(0) {
            self.ending = Ending::Torn;
        }
    }

    fn count(&mut self, kind: RecordKind, payload: &[u8]) {
        self.records.sound += 1;
        self.ending = if kind == RecordKind::End { Ending::Closed } else { Ending::Open };
        match kind {
            RecordKind::Header if self.origin == Origin::Unknown => match read_value::<Header>(payload) {
                Some(header) => {
                    (self.generation, self.started) = (header.generation, header.started);
                    (self.origin, self.first) = (header.origin, header.first);
                    self.tally.begin(header.first);
                }
                None => self.is_damaged = true,
            },
            RecordKind::Mark => match read_value(payload) {
                Some(mark) => {
                    self.marks.push(mark);
                    self.tally.mark();
                }
                None => self.is_damaged = true,
            },
            RecordKind::Base => self.has_base = true,
            RecordKind::Header | RecordKind::Skin | RecordKind::Context | RecordKind::End => {}
            _ => self.tally.change(),
        }
    }

    /// Number of changes in the project that was saved at the mark with this index.
    pub(super) fn contained(&self, index: usize, mark: &SaveMark) -> usize {
        self.tally.contained(index, mark, self.first)
    }
}

/// Summarises a journal from its records.
pub(super) fn summarise(bytes: &[u8]) -> Result<Summary, JournalError> {
    let scan = Scan::new(bytes)?;
    let mut summary = Summary {
        session: scan.session(),
        generation: 0,
        started: 0,
        origin: Origin::Unknown,
        has_base: false,
        first: 0,
        marks: Vec::new(),
        tally: Tally::default(),
        ending: Ending::Open,
        records: RecordCount::default(),
        is_damaged: false,
    };
    for item in scan {
        match item {
            Item::Gap(gap) => summary.lose(&gap),
            Item::Record(_, kind, payload) => summary.count(kind, payload),
        }
    }
    summary.is_damaged |= summary.origin == Origin::Unknown;
    match summary.records.sound {
        0 => Err(JournalError::NothingSound),
        _ => Ok(summary),
    }
}
