//! Numbers with the words for what they count, as every text of the window has them.

use crate::processor::Builder;

/// Number with the word for what it counts: `one` for a single one, `many` for any other number.
pub fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// Commands that are in effect of those that a build carries out, in words; commands that it passes over are told apart.
pub(super) fn built_commands(builder: &Builder) -> String {
    let counts = builder.counts();
    let off = if counts.off == 0 { String::new() } else { format!(", {} off", counts.off) };
    format!("{} of {}{off}", counts.built, counted(counts.all, "command", "commands"))
}
