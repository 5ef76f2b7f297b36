//! Reasons why the value of an argument is refused.

use crate::algo::face::expression::MAX_STRENGTH;

/// Reason why the value of an argument is refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum ArgumentError {
    /// The value has to be a positive number.
    #[error("write a number above zero")]
    NotPositive,
    /// The value has to name an axis.
    #[error("write x, y or z, or -x, -y or -z")]
    NoAxis,
    /// The value has to name a joint and its place.
    #[error("write LABEL=X,Y,Z, such as hand_l=0.5,1.1,0.2")]
    NoMarker,
    /// The value has to name a part of the mesh or give the corners of a box.
    #[error("write the name of an object or a bone, or two corners X,Y,Z,X,Y,Z, such as 0.5,0.7,-0.5,2,1.3,0.5")]
    NoRegion,
    /// The value has to name an expression and its strength.
    #[error("write NAME=STRENGTH, such as happiness=0.8")]
    NoStrength,
    /// The strength of an expression is out of its range.
    #[error("{0} is not from 0 to {MAX_STRENGTH}")]
    Strength(f32),
    /// The value has to name a limit and its number.
    #[error("write NAME=NUMBER, such as joints=2000; `rigsmith --help` lists the names")]
    NoLimit,
    /// The value has to be two angles.
    #[cfg(feature = "render")]
    #[error("write yaw and pitch in degrees, such as 30,15")]
    NoOrbit,
    /// The value has to be the size of a picture.
    #[cfg(feature = "render")]
    #[error("write width and height in pixels, such as 1280x720")]
    NoSize,
}
