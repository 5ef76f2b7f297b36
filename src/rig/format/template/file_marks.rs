//! Marks of a text file that are no content: the byte order mark, and the ends of its lines.

use std::borrow::Cow;

use crate::rig::format::scan::tokens;

const BYTE_ORDER_MARK: char = '\u{FEFF}';

/// Marks that a save keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct FileMarks {
    has_byte_order_mark: bool,
    /// True if every line ends with a carriage return.
    has_carriage_returns: bool,
}

impl FileMarks {
    /// Marks of a text, and the text without them.
    pub(crate) fn of(text: &str) -> (Self, Cow<'_, str>) {
        let plain = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
        let has_carriage_returns = ends_with_carriage_returns(plain);
        let marks = Self { has_byte_order_mark: plain.len() < text.len(), has_carriage_returns };
        match has_carriage_returns {
            true => (marks, Cow::Owned(plain.replace("\r\n", "\n"))),
            false => (marks, Cow::Borrowed(plain)),
        }
    }

    /// The text with the marks.
    pub(crate) fn put_on(self, mut text: String) -> String {
        if self.has_carriage_returns {
            // Parameters may have theirs still.
            text = text.replace("\r\n", "\n").replace('\n', "\r\n");
        }
        if self.has_byte_order_mark {
            text.insert(0, BYTE_ORDER_MARK);
        }
        text
    }
}

/// True if all lines end with a carriage return, and none of these is part of a value.
fn ends_with_carriage_returns(text: &str) -> bool {
    let is_every_end = text.contains('\n') && text.matches('\n').count() == text.matches("\r\n").count();
    is_every_end
        && text.matches('\r').count() == text.matches('\n').count()
        && !tokens(text).any(|token| token.text.contains('\n'))
}
