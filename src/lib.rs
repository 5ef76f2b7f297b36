#![doc = include_str!("../README.md")]

pub mod algo;
pub mod files;
pub mod headless;
pub mod instance;
pub mod mesh;
pub mod modules;
pub mod plugins;
pub mod prelude;
pub mod processor;
pub mod rig;
pub mod solve;
pub mod test_app;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "editor")]
pub mod editor;
#[cfg(feature = "remote")]
pub mod remote;
#[cfg(feature = "render")]
pub mod render;
