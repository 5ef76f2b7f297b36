//! The solvers of the runtime: one a file, plain functions over borrowed inputs and outputs.
//!
//! No solver allocates (building a curve or an expression does), keeps state or fails: the result of a degenerate input
//! (no length, parallel directions, a goal on the root, a scale of zero, a number that is not finite) is part of each
//! solver's documentation. Poses are in the rig's space and angles in radians unless said otherwise. The same input
//! gives the same bits.

pub mod aim;
pub mod avatar;
pub mod bake_clip;
pub mod ccd;
pub mod collider;
pub mod curve;
pub mod curve_fit;
pub mod expression;
pub mod fabrik;
pub mod foot;
mod human_axes;
pub mod keep_pose;
pub mod limit;
pub mod matching;
pub mod packed_clip;
pub mod pose_reader;
pub mod program;
pub mod pull;
pub mod reduction;
pub mod retarget;
pub mod rivet;
pub mod rotate;
pub mod spline;
pub mod spring;
pub mod stretch;
pub mod twist;
pub mod two_bone;
pub mod weights;
