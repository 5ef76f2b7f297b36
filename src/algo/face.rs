//! Faces: facial bones, weights and expressions from a head mesh, without manual placement.
//!
//! The method is that of "automatic placement of bones on face models": group the head in depth, put head and neck
//! bones through the means of the middle group, and one facial bone at each centroid of the facial mask.

pub mod auto;
pub mod axes;
pub mod bones;
pub mod depth_map;
pub mod expression;
pub mod grouping;
pub mod head_bones;
pub mod head_part;
pub mod landmarks;
pub mod sections;
pub mod shells;
pub mod weights;
