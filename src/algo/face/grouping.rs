//! Grouping: face, middle and back of a head by average linkage in depth.

use glam::Vec3;

use crate::algo::linkage::Dendrogram;

/// A part of the head by depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadGroup {
    /// The front.
    Face,
    /// Between front and back.
    Middle,
    /// The back.
    Back,
}

/// The groups of a head.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadGroups {
    /// The merge history of the depths.
    pub depth: Dendrogram,
    /// The number of groups where it was cut before front groups were joined.
    pub groups: usize,
    /// The group of each point.
    pub of: Vec<HeadGroup>,
    /// True for points of the facial mask: skin of the face group without the neck.
    pub mask: Vec<bool>,
    /// Mean of the upper half of the middle group.
    pub upper_mean: Vec3,
    /// Mean of the lower half of the middle group.
    pub lower_mean: Vec3,
    /// Height of the underside of the chin.
    pub chin: f32,
}
