//! Algorithms, one a file: plain functions over slices, with their errors and sources.

pub mod control_size;
pub mod face;
pub mod fit;
pub mod fit_template;
pub mod kmeans;
pub mod linkage;
pub mod paint;
pub mod picking;
pub mod placement;
pub mod point_tree;
pub mod stroke;
pub mod transfer;
pub mod view;
pub mod weights;
