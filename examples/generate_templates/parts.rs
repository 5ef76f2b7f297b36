//! Parts: one a file, each with joints of its own and a function that puts its tags onto joints with those labels.

pub mod eye;
pub mod fk_chain;
pub mod jaw;
pub mod leg_3joint;
pub mod single_control;
pub mod spring_chain;
pub mod tail;
pub mod wing;

use super::writer::Writer;

/// Every part with its name.
pub const ALL: &[(&str, fn() -> Writer)] = &[
    ("eye", eye::part),
    ("fk_chain", fk_chain::part),
    ("jaw", jaw::part),
    ("leg_3joint", leg_3joint::part),
    ("single_control", single_control::part),
    ("spring_chain", spring_chain::part),
    ("tail", tail::part),
    ("wing", wing::part),
];
