//! Geometry on plain slices: models, their readers and writers, and the surface for ray queries.
//!
//! This module does not depend on Bevy's `App`, rendering or the file system: readers take bytes or `Read`, writers
//! return bytes.

pub mod adjacency;
mod bind_pose;
mod gear;
pub mod gltf;
pub mod influences;
mod joining;
pub mod model;
pub mod obj;
pub mod ray;
mod rest;
pub mod shapes;
pub mod similarity;
pub mod skinning;
pub mod surface;
pub mod voxels;
pub mod vrm;

/// Takes a companion of the file that is written (a buffer, an image, a material library) with the name that it would have
/// alone, and returns the name that it gets.
pub type CompanionSink<'a> = dyn FnMut(&str, Vec<u8>) -> String + 'a;
