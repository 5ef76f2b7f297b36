//! Report of a fit: places, confidences with their reasons, notes and errors.

use std::fmt;

use glam::Vec3;
use thiserror::Error;

use super::{assign::Hypothesis, human::FittedBody, limbs::LimbKind};

/// A template's skeleton in a mesh.
#[derive(Debug, Clone)]
pub struct FittedSkeleton {
    /// Up direction in the mesh's space, of unit length.
    pub up: Vec3,
    /// Direction that the figure faces in the mesh's space, unit length.
    pub forward: Vec3,
    /// Plane of symmetry of mesh and pose, where they have one: a point and the unit normal to the figure's left.
    pub symmetry: Option<(Vec3, Vec3)>,
    /// Extent of the mesh along `up`, in its unit.
    pub height: f32,
    /// Confidence in the whole fit, 0 to 1; below one half something is wrong.
    pub confidence: f32,
    /// One entry for each joint of the template, in its order.
    pub joints: Vec<JointFit>,
    /// Assignments of limbs that were weighed, best first.
    pub hypotheses: Vec<HypothesisSummary>,
    /// Facts that a person should know.
    pub notes: Vec<FitNote>,
    /// The registered body and the assignments, for fits that follow.
    pub(super) body: Option<FittedBody>,
    pub(super) assignments: Vec<Hypothesis>,
}

impl FittedSkeleton {
    /// Mean distance between the body model and the surface as a share of the height, where a model was registered.
    pub fn body_residual(&self) -> Option<f32> {
        self.body.as_ref().map(|body| body.residual)
    }

    /// True if mesh and pose have a plane of symmetry.
    pub fn symmetric(&self) -> bool {
        self.symmetry.is_some()
    }
}

/// A joint in the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFit {
    /// Position in the mesh's space.
    pub position: Vec3,
    /// Confidence, 0 to 1; below one half the joint is doubtful.
    pub confidence: f32,
    /// Basis of the position and the confidence.
    pub reason: FitReason,
}

/// Basis of a joint's position, or of its doubt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitReason {
    /// A person put it there.
    Marker,
    /// The body model lies on the surface around it.
    Surface,
    /// The centre line of the limb.
    CentreLine,
    /// Proportions of the template between places that are known.
    Proportion,
    /// The surface around it is unlike the body model.
    UnlikeSurface,
    /// The mesh shows no limb for it.
    NoLimb,
    /// The joint lies outside of the mesh.
    Outside,
    /// Another assignment of limbs is nearly as good.
    Ambiguous,
}

impl fmt::Display for FitReason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Marker => "placed by hand",
            Self::Surface => "the surface around it agrees with the body model",
            Self::CentreLine => "on the centre line of its limb",
            Self::Proportion => "by the template's proportions",
            Self::UnlikeSurface => "the surface around it is unlike the body model",
            Self::NoLimb => "the mesh shows no limb for it",
            Self::Outside => "it lies outside of the mesh",
            Self::Ambiguous => "another assignment of limbs is nearly as good",
        })
    }
}

/// An assignment of the template's limbs to the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct HypothesisSummary {
    /// Penalty; smaller is better.
    pub cost: f32,
    /// Kind of each limb, and the position of its end in the mesh's space, if the mesh shows one.
    pub limbs: Vec<(LimbKind, Option<Vec3>)>,
}

/// Note about a fit for the person who asked for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitNote {
    /// Loose specks that were ignored.
    Specks(usize),
    /// Loose parts that were tied to the body over gaps.
    Tied(usize),
    /// Loose parts that are too far from the body.
    Loose(usize),
    /// Pieces that the figure stands on.
    Grounds(usize),
    /// Sheets about a body that is whole without them.
    Sheets(usize),
    /// Objects that hang on a bone and were left out: a hat, a weapon.
    Gear(usize),
    /// Branches that no limb of the template took: hair, clothes, weapons.
    UnusedBranches(usize),
    /// A limb of the template without a branch in the mesh.
    MissingLimb(LimbKind),
    /// The body model was used.
    BodyModel,
    /// The figure's front is uncertain.
    UncertainFront,
    /// Left and right were made alike.
    MadeSymmetric,
}

impl fmt::Display for FitNote {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Specks(count) => write!(f, "{count} loose specks were ignored"),
            Self::Tied(count) => write!(f, "{count} loose parts were tied to the body over gaps"),
            Self::Loose(count) => write!(f, "{count} loose parts are too far from the body and were ignored"),
            Self::Grounds(count) => write!(f, "{count} flat pieces that the figure stands on were left out"),
            Self::Sheets(count) => {
                write!(
                    f,
                    "{count} open sheets about the body, such as a cloak, were left out; name objects to fit to them"
                )
            }
            Self::Gear(count) => {
                write!(f, "{count} objects that hang on a bone were left out; name objects to fit to others")
            }
            Self::UnusedBranches(count) => write!(f, "{count} branches of the mesh belong to no limb of the template"),
            Self::MissingLimb(kind) => write!(f, "the mesh shows no {kind} for one of the template"),
            Self::BodyModel => f.write_str("joints follow a model of the human body"),
            Self::UncertainFront => {
                f.write_str("the front is uncertain: give the forward axis if the skeleton faces backwards")
            }
            Self::MadeSymmetric => f.write_str("left and right were made alike"),
        }
    }
}

impl fmt::Display for LimbKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Head => "neck and head",
            Self::Arm => "arm",
            Self::Leg => "leg",
            Self::Wing => "wing",
            Self::Tail => "tail",
            Self::Free => "chain",
        })
    }
}

/// Reason why there is no fit.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    /// No triangle has three finite corners and an area.
    #[error("the mesh has no usable triangle; give the surface of a figure")]
    NoSurface,
    /// The mesh has no volume to put a skeleton into.
    #[error("the mesh is flat; give the surface of a figure with a volume")]
    Flat,
    /// The template has no chain of joints.
    #[error("the template has no chain of joints to fit; choose one with at least two joints")]
    NoChain,
    /// A joint of the template is not finite.
    #[error("joint {joint} of the template has a position that is not finite")]
    Joint {
        /// Index of the joint.
        joint: usize,
    },
    /// A marker names no joint or has no position.
    #[error("marker {marker} refers to joint {joint} of {joints} or has a position that is not finite")]
    Marker {
        /// Index of the marker.
        marker: usize,
        /// The joint it names.
        joint: usize,
        /// Number of joints of the template.
        joints: usize,
    },
    /// The place that the skeleton hangs on is not finite.
    #[error("the place that the skeleton hangs on is not finite; give another or none")]
    Root,
    /// A chosen direction is not finite or has no length.
    #[error("the {0} direction is not finite or has no length")]
    Direction(&'static str),
    /// The mesh shows too few limbs.
    #[error(
        "the mesh shows {found} limbs where the template has {wanted}; choose another template or a part of the mesh"
    )]
    TooFewLimbs {
        /// Ends of branches in the mesh.
        found: usize,
        /// Limbs of the template.
        wanted: usize,
    },
    /// The progress callback asked to stop.
    #[error("the fit was cancelled")]
    Cancelled,
}
