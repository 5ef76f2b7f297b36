//! Generators and whole paths that the targets run: the files of the tests, built with coverage.

#[path = "../../tests/it/generate.rs"]
pub mod generate;
#[path = "../../tests/it/whole.rs"]
pub mod whole;
