//! File formats of rigs: text and bytes on one side, plain data on the other. No code here opens a file.
//!
//! Templates (`.rig.ron`), clips (`.anim.ron`), projects (`.rigsmith.ron`), skeleton text (`.rig`), weights (`.skin`) and
//! motion capture (`.bvh`), and results of commands (JSON).

pub mod animation;
pub mod bvh;
pub(super) mod commas;
pub mod json;
pub(super) mod layout;
mod poses;
pub mod project;
pub(super) mod scan;
pub mod skin;
pub(super) mod source;
pub mod template;
pub mod text;
pub(super) mod tree;
mod version;
