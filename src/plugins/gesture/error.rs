//! Reasons why gestures have no effect.

use crate::{
    plugins::{
        document::ChangeError, fit::FitFailure, limits::LimitError, placement::PlaceRefusal, stroke::StrokeFailure,
    },
    rig::proportion::ProportionError,
};

/// Reason why a gesture had no effect; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum GestureError {
    /// A click met no joint.
    #[error("there is no joint to pick")]
    NothingToPick,
    /// A click met no mesh.
    #[error("the ray meets nothing there: no joint was placed")]
    NothingThere,
    /// A click waited for the mesh, and was refused.
    #[error(transparent)]
    Place(#[from] PlaceRefusal),
    /// The gesture needs a selected joint.
    #[error("no joint is selected; select one first")]
    NoSelection,
    /// No joint has the label.
    #[error("no joint has the label \"{0}\"")]
    NoLabel(String),
    /// The rig has no mesh.
    #[error("there is no mesh to fit a template into; open one first")]
    NoMesh,
    /// The template was not fitted.
    #[error(transparent)]
    Fit(#[from] FitFailure),
    /// The list has more gestures, or the stroke more points, than is taken.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The gesture would put joints out of all proportion to the model.
    #[error(transparent)]
    Proportion(#[from] ProportionError),
    /// The gesture is no operation on joints.
    #[error("this gesture changes no joint")]
    NoOperation,
    /// The stroke had no effect.
    #[error(transparent)]
    Stroke(#[from] StrokeFailure),
    /// The change was refused.
    #[error(transparent)]
    Change(#[from] ChangeError),
}
