//! Axes as parameters.

use bevy::prelude::{Reflect, ReflectDefault};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// One of the six directions along the axes of a node.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[reflect(Default)]
pub enum Axis {
    /// Direction of X.
    X,
    /// Direction of Y.
    #[default]
    Y,
    /// Direction of Z.
    Z,
    /// Direction opposite to X.
    NegX,
    /// Direction opposite to Y.
    NegY,
    /// Direction opposite to Z.
    NegZ,
}

impl Axis {
    /// Axis as a vector of length 1.
    pub fn vector(self) -> Vec3 {
        match self {
            Self::X => Vec3::X,
            Self::Y => Vec3::Y,
            Self::Z => Vec3::Z,
            Self::NegX => Vec3::NEG_X,
            Self::NegY => Vec3::NEG_Y,
            Self::NegZ => Vec3::NEG_Z,
        }
    }

    /// Axis of the node on the other side of the character, whose X is turned over.
    pub fn mirrored(self) -> Self {
        match self {
            Self::X => Self::NegX,
            Self::NegX => Self::X,
            other => other,
        }
    }

    /// True if both run along the same line.
    pub fn is_along(self, other: Self) -> bool {
        self.vector().dot(other.vector()) != 0.0
    }
}
