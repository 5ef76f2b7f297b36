//! File formats of rigs: text and bytes on one side, plain data on the other. No code here opens a file.
//!
//! Templates (`.rig.ron`), projects (`.rigsmith.ron`), skeleton text (`.rig`) and weights (`.skin`).

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
