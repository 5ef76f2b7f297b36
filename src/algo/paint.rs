//! Painting of weights: brushes on a mesh at rest, and what they make of the influences of points.
//!
//! A stroke is a list of dabs at places of the mesh. Each point remembers the largest effect of the dabs on it and the
//! influences that it had before the stroke, so that neither the number of dabs nor the speed of the hand matters; only
//! smoothing and sharpening go on with every dab. Influences of a point sum to one after each dab, and those of locked joints
//! stay as they are: what a joint takes comes from the other free ones, in proportion, and what it gives goes to them.

mod canvas;
mod row;
mod stroke;
mod tidy;

use glam::Vec3;

pub use canvas::{Canvas, Spot};
pub use row::{RowRules, assign, towards};
pub use stroke::PaintStroke;
pub use tidy::{PruneError, PruneSettings, keep_locked, normalised, pruned};

/// Influences of a point: joints, as indices into the list that the owner of the weights has, and their weights.
pub type Row = Vec<(u32, f32)>;

/// Effect of a brush.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BrushMode {
    /// Adds to the weight of the joint.
    #[default]
    Add,
    /// Takes from the weight of the joint.
    Subtract,
    /// Moves the weight of the joint to the brush's strength.
    Replace,
    /// Moves weights to the mean of the neighbours.
    Smooth,
    /// Moves weights away from the mean of the neighbours.
    Sharpen,
}

impl BrushMode {
    /// Every mode, in the order of the panel.
    pub const ALL: [Self; 5] = [Self::Add, Self::Subtract, Self::Replace, Self::Smooth, Self::Sharpen];

    /// The name in the panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Add => "Add",
            Self::Subtract => "Subtract",
            Self::Replace => "Replace",
            Self::Smooth => "Smooth",
            Self::Sharpen => "Sharpen",
        }
    }

    /// The mode with the opposite effect; of replacing, taking away.
    pub fn opposite(self) -> Self {
        match self {
            Self::Add | Self::Replace => Self::Subtract,
            Self::Subtract => Self::Add,
            Self::Smooth => Self::Sharpen,
            Self::Sharpen => Self::Smooth,
        }
    }

    /// True for the modes that compare points with their neighbours.
    pub fn is_relative(self) -> bool {
        matches!(self, Self::Smooth | Self::Sharpen)
    }
}

/// Course of a brush's effect from the inner to the outer end of its falloff.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum FalloffCurve {
    /// Level at both ends.
    #[default]
    Smooth,
    /// Straight.
    Linear,
    /// Level at the inner end, steep at the outer one.
    Round,
    /// Steep at the inner end, level at the outer one.
    Sharp,
}

impl FalloffCurve {
    /// Every curve, in the order of the panel.
    pub const ALL: [Self; 4] = [Self::Smooth, Self::Linear, Self::Round, Self::Sharp];

    /// The name in the panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smooth => "Smooth",
            Self::Linear => "Linear",
            Self::Round => "Round",
            Self::Sharp => "Sharp",
        }
    }

    /// Effect at a share of the way from the outer to the inner end, both 0 to 1.
    pub fn at(self, share: f32) -> f32 {
        let t = share.clamp(0.0, 1.0);
        match self {
            Self::Smooth => t * t * (3.0 - 2.0 * t),
            Self::Linear => t,
            Self::Round => (t * (2.0 - t)).sqrt(),
            Self::Sharp => t * t,
        }
    }
}

/// Measure of distances from the middle of a brush.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BrushReach {
    /// Lengths of ways along the edges of the mesh: the other finger is far away.
    #[default]
    Surface,
    /// Distances through the volume: everything in a ball.
    Volume,
}

impl BrushReach {
    /// The other measure.
    pub fn other(self) -> Self {
        match self {
            Self::Surface => Self::Volume,
            Self::Volume => Self::Surface,
        }
    }
}

/// A brush. Lengths are in the units of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brush {
    /// Effect on the weights.
    pub mode: BrushMode,
    /// Size of the effect, 0 to 1; for replacing, the weight that the joint gets.
    pub strength: f32,
    /// Distance from the middle at which the effect ends.
    pub radius: f32,
    /// Length over which the effect fades to nothing, 0 to the radius. Within the rest of the radius it is whole.
    pub falloff: f32,
    /// Course of the effect over the falloff.
    pub curve: FalloffCurve,
    /// Measure of distances.
    pub reach: BrushReach,
    /// Smooths and sharpens the weights of all free joints together if `true`, those of one joint if `false`.
    pub all_joints: bool,
}

/// Plane across which strokes are mirrored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirror {
    /// A point of the plane.
    pub point: Vec3,
    /// Normal of the plane, of unit length.
    pub normal: Vec3,
}

impl Mirror {
    /// The mirror image of a place.
    pub fn image(&self, place: Vec3) -> Vec3 {
        place - self.normal * (2.0 * (place - self.point).dot(self.normal))
    }
}

/// Reason why a brush cannot paint; a sentence without its full stop.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BrushError {
    /// A radius that is no length.
    #[error("a brush with a radius of {0} reaches no point; use a radius above 0")]
    Radius(f32),
    /// A falloff outside of the radius.
    #[error("a falloff of {falloff} is not within the radius of {radius}; use one from 0 to the radius")]
    Falloff {
        /// The falloff.
        falloff: f32,
        /// The radius.
        radius: f32,
    },
    /// A strength that is no share.
    #[error("a strength of {0} is no share; use one from 0 to 1")]
    Strength(f32),
    /// A stroke without a joint.
    #[error("no joint is chosen to paint; choose one, or smooth all joints")]
    NoJoint,
    /// A locked joint.
    #[error("the weights of the joint are locked; unlock it, or choose another")]
    Locked,
    /// A joint that the locks say nothing of.
    #[error("joint number {joint} is not among the {joints} joints of the weights; choose another")]
    Joint {
        /// Number of the joint.
        joint: u32,
        /// Number of joints.
        joints: usize,
    },
    /// A stroke that leaves no influences.
    #[error("a point needs at least one influence; allow one or more")]
    Influences,
}

impl Brush {
    /// Refuses numbers that no brush can have.
    ///
    /// # Errors
    /// See [`BrushError`].
    pub fn check(&self) -> Result<(), BrushError> {
        let Self { radius, falloff, strength, .. } = *self;
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(BrushError::Radius(radius));
        }
        if !(0.0..=radius).contains(&falloff) {
            return Err(BrushError::Falloff { falloff, radius });
        }
        if !(0.0..=1.0).contains(&strength) {
            return Err(BrushError::Strength(strength));
        }
        Ok(())
    }

    /// Share of the effect at a distance from the middle, 0 to 1.
    pub fn effect(&self, distance: f32) -> f32 {
        let left = self.radius - distance;
        if left >= self.falloff && left > 0.0 {
            1.0
        } else if left > 0.0 {
            self.curve.at(left / self.falloff)
        } else {
            0.0
        }
    }
}
