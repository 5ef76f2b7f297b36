//! Reasons why a face is not placed, or shows no expression.

use crate::{
    algo::face::{auto::FaceError, expression::MAX_STRENGTH},
    plugins::limits::{LimitError, OutOfTime},
};

/// Reason why no face was placed; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlaceFaceError {
    /// The entity of the request has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The rig was closed while the face was placed.
    #[error("the rig was closed meanwhile")]
    Closed,
    /// The joints were changed while the face was placed.
    #[error("the joints were changed while the face was placed; place it again")]
    Changed,
    /// Bones that were to stay are gone.
    #[error("facial bones were deleted meanwhile; place the face again")]
    Deleted,
    /// The computation failed or was cancelled.
    #[error(transparent)]
    Face(#[from] FaceError),
    /// The mesh has more points or triangles than [`RigLimits`](crate::plugins::limits::RigLimits) allows.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The computation took longer than [`RigLimits`](crate::plugins::limits::RigLimits) allows.
    #[error(transparent)]
    OutOfTime(#[from] OutOfTime),
}

/// Reason why a face shows no expression; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExpressError {
    /// The entity of the request has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The rig has no face.
    #[error("the rig has no facial bones; place a face first")]
    NoBones,
    /// The mesh has no weights.
    #[error("the mesh is not skinned; place a face first")]
    NotSkinned,
    /// A strength is infinite or undefined.
    #[error("the strength of \"{name}\" is not a number; write one from 0 to {MAX_STRENGTH}")]
    Strength {
        /// Name of the expression.
        name: String,
    },
    /// No expression or unit has the name.
    #[error("there is no expression \"{name}\"{nearest}")]
    Unknown {
        /// The name.
        name: String,
        /// Nearest names, as the rest of a sentence.
        nearest: String,
    },
    /// A rig without a mesh stores no pose of a unit.
    #[error(
        "the rig stores no pose of \"{unit}\" for \"{name}\"; `rigsmith face --arkit` writes a .rig.ron with poses"
    )]
    NoPose {
        /// Name of the expression or unit.
        name: String,
        /// The unit without a pose.
        unit: String,
    },
    /// The mesh cannot be analysed.
    #[error(transparent)]
    Face(#[from] FaceError),
}
