//! One algorithm a file: plain functions over slices, with their errors and sources.

pub mod picking;
pub mod placement;
pub mod stroke;
pub mod transfer;
pub mod view;
pub mod weights;
