//! Parts: one a file, each with joints of its own and a function that puts its tags onto joints with those labels.

pub mod fk_chain;

use super::writer::Writer;

/// Every part with its name.
pub const ALL: &[(&str, fn() -> Writer)] = &[("fk_chain", fk_chain::part)];
