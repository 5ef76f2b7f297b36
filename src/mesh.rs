//! Geometry on plain slices: models, their readers and writers, and the surface that rays meet.
//!
//! Nothing here knows Bevy's `App`, rendering or the file system: readers take bytes or `Read`, writers return bytes.

pub mod adjacency;
pub mod gltf;
pub mod model;
pub mod obj;
pub mod ray;
mod rest;
pub mod shapes;
pub mod skinning;
pub mod surface;
pub mod voxels;
