//! The editing window: panels and tools over the plugins.
//!
//! The editor never changes a rig directly. Panels read the world and return [`Requests`](panel::Requests); tools read
//! pointer events of the viewport and write the same requests that gesture lists and games write.

pub mod actions;
pub mod app;
pub mod building;
pub mod camera;
pub mod clicks;
pub mod control_density;
pub mod counts;
pub mod dock;
pub mod files;
pub mod fitting;
pub mod folder_watch;
pub mod follow;
pub mod help;
pub mod keys;
pub mod labels;
pub mod library;
mod menu;
pub mod mesh_watch;
pub mod mode;
pub mod next_step;
pub mod notice;
pub mod onion;
pub mod palette;
pub mod panel;
pub mod panels;
pub mod pointer;
pub mod probe;
mod raster;
pub mod recovery;
pub mod render_errors;
pub mod report;
pub mod result_queue;
pub mod running_work;
pub mod screen;
pub mod settings;
mod skeleton_lines;
pub mod start;
mod status;
pub mod style;
mod toolbar;
pub mod tools;
pub mod typing;
pub mod viewport_bars;

use bevy::prelude::*;

/// The edited rig. Its meshes are in its [`RigMeshes`](crate::plugins::surface::RigMeshes).
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActiveRig(pub Entity);
