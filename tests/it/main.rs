//! All integration tests in one binary: one module a feature, through the public API.

mod files;
mod files_read;
mod files_set;
mod fuzz_rig_text;
mod mutate;
mod rig_text;
