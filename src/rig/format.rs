//! File formats of rigs: text and bytes on one side, plain data on the other. No code here opens a file.
//!
//! Templates (`.rig.ron`), clips (`.anim.ron`), projects (`.rigsmith.ron`), skeleton text (`.rig`) and weights (`.skin`).

pub mod animation;
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
