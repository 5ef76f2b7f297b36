#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod algo;
pub mod files;
pub mod mesh;
pub mod plugins;
pub mod rig;
