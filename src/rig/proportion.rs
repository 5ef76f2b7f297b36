//! Proportion: the numbers that make sense on a node of a rig.
//!
//! Far away a place has no digits left, a factor near zero flattens what no later factor raises again, and an angle of many
//! turns is the same as a small one. The command line and the window refuse such numbers by the same rule.

/// Largest distance of a node, in sizes of the rig, and the largest factor of a scale; the least factor is its inverse.
pub const MOST: f32 = 1e4;
/// Largest angle in degrees: ten turns.
pub const MOST_DEGREES: f32 = 3600.0;

/// Kind of a number that a person sets.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Quantity {
    /// Number with limits of its own, or without any.
    #[default]
    Plain,
    /// Distance, on a rig of this size.
    Distance {
        /// Size of the rig, in its units.
        size: f32,
    },
    /// Angle in degrees.
    Degrees,
    /// Factor of a scale.
    Factor,
}

/// Reason why a number makes no sense on a rig.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ProportionError {
    /// A number that is infinite, or none.
    #[error("this is no finite number; write a smaller one")]
    NotFinite,
    /// A distance or factor that is too large.
    #[error("{value} is out of all proportion to the rig; write numbers up to {most}")]
    TooLarge {
        /// The number.
        value: f32,
        /// Largest number that is taken.
        most: f32,
    },
    /// An angle of too many turns.
    #[error("{value}° is more than ten turns; write angles up to {most}°")]
    TooManyTurns {
        /// The angle.
        value: f32,
        /// Largest angle that is taken.
        most: f32,
    },
    /// A factor that flattens.
    #[error("a scale of {value} flattens everything below; write a factor of at least {least}")]
    TooFlat {
        /// The factor.
        value: f32,
        /// Least factor that is taken.
        least: f32,
    },
}

impl Quantity {
    /// Refuses a number that makes no sense as this kind of number.
    ///
    /// # Errors
    /// See [`ProportionError`].
    pub fn check(self, value: f32) -> Result<(), ProportionError> {
        if !value.is_finite() {
            return Err(ProportionError::NotFinite);
        }
        let far = value.abs();
        match self {
            Self::Distance { size } if far > MOST * size => Err(ProportionError::TooLarge { value, most: MOST * size }),
            Self::Factor if far > MOST => Err(ProportionError::TooLarge { value, most: MOST }),
            Self::Factor if far < 1.0 / MOST => Err(ProportionError::TooFlat { value, least: 1.0 / MOST }),
            Self::Degrees if far > MOST_DEGREES => Err(ProportionError::TooManyTurns { value, most: MOST_DEGREES }),
            _ => Ok(()),
        }
    }
}
