//! Generators of inputs for whole commands: bytes become choices, and choices become templates, models, clips, gestures,
//! edits and calls, most of them valid, the others bent in one place or a few.
//!
//! The tests here and the coverage-guided targets in `fuzz/` share these files, so the paths of the modules are written out.

#[path = "generate/calls.rs"]
pub mod calls;
#[path = "generate/choices.rs"]
pub mod choices;
#[path = "generate/clips.rs"]
pub mod clips;
#[path = "generate/edits.rs"]
pub mod edits;
#[path = "generate/gestures.rs"]
pub mod gestures;
#[path = "generate/models.rs"]
pub mod models;
#[path = "generate/params.rs"]
pub mod params;
#[path = "generate/template.rs"]
pub mod template;

pub use choices::Choices;
