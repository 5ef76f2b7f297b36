//! Bone segments: what a joint pulls with.

use glam::Vec3;

/// A straight piece of bone in the space of the points. A joint may have several (one towards each child) or, at the
/// end of a chain, one whose tail was estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoneSegment {
    /// Index of the joint that moves this bone.
    pub joint: u32,
    /// Position of the joint.
    pub head: Vec3,
    /// End of the bone; equal to `head` for a joint without extent.
    pub tail: Vec3,
}
