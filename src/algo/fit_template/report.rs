//! Report of a fit: places, confidences with their reasons, notes and errors.

use std::fmt;

use glam::{Mat3, Quat, Vec3};
use thiserror::Error;

use super::{assign::Hypothesis, human::FittedBody, limbs::LimbKind};

/// A template's skeleton in a mesh.
#[derive(Debug, Clone)]
pub struct FittedSkeleton {
    /// Up direction in the mesh's space, of unit length.
    pub up: Vec3,
    /// Direction that the figure faces in the mesh's space, unit length.
    pub forward: Vec3,
    /// Plane of symmetry of mesh and pose, where they have one, or the plane about which left and right were made alike as
    /// asked: a point and the unit normal to the figure's left.
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

    /// Rotation from the axes of the template (Y up, facing +Z) to those of the figure.
    pub fn turn(&self) -> Quat {
        let left = self.up.cross(self.forward).normalize_or(Vec3::X);
        Quat::from_mat3(&Mat3::from_cols(left, self.up, left.cross(self.up))).normalize()
    }

    /// True if mesh and pose have a plane of symmetry, or left and right were made alike as asked.
    pub fn is_symmetric(&self) -> bool {
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
    /// A person put its partner on the other side there.
    Partner,
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
            Self::Partner => "the mirror image of its partner, which was placed by hand",
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
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FitNote {
    /// Loose specks that were ignored.
    Specks(usize),
    /// Pieces of the volume that were tied to the body over gaps.
    Tied(usize),
    /// Pieces of the volume that are too far from the body.
    Loose(usize),
    /// Pieces that the figure stands on.
    Grounds(usize),
    /// Sheets about a body that is whole without them.
    Sheets(usize),
    /// Objects that hang on a bone and were left out: a hat, a weapon.
    Gear(usize),
    /// Objects beside the largest one that were left out: armour, clothes, weapons.
    Beside(usize),
    /// Branches that no limb of the template took: hair, clothes, weapons.
    UnusedBranches(usize),
    /// A limb of the template without a branch in the mesh.
    MissingLimb(LimbKind),
    /// The body model was used.
    BodyModel,
    /// The figure's front is uncertain.
    UncertainFront,
    /// The side of a part is uncertain.
    UncertainSide,
    /// Left and right were made alike.
    MadeSymmetric,
    /// Pairs of joints that were made alike as asked, in a mesh or pose that is not symmetric.
    ForcedSymmetric(usize),
    /// Label of a joint whose marker lies outside of the mesh's volume.
    MarkerOutside(String),
    /// Label of a joint that the mesh shows far from its marker.
    MarkerAgainst(String),
    /// Up direction that the mesh shows, other than the given one.
    OtherUp(String),
    /// Direction in which the mesh faces, other than the given one.
    OtherForward(String),
}

impl FitNote {
    /// True for notes that say what may be wrong, or what was left out; the others say how the fit was found.
    pub fn is_warning(&self) -> bool {
        !matches!(self, Self::BodyModel | Self::MadeSymmetric | Self::Tied(_))
    }

    /// True for notes about directions that contradict the mesh.
    pub fn is_of_direction(&self) -> bool {
        matches!(self, Self::OtherUp(_) | Self::OtherForward(_))
    }
}

/// Name of an axis for a direction along one, else its coordinates.
pub(super) fn axis_name(direction: Vec3) -> String {
    let axes =
        [(Vec3::X, "x"), (Vec3::Y, "y"), (Vec3::Z, "z"), (Vec3::NEG_X, "-x"), (Vec3::NEG_Y, "-y"), (Vec3::NEG_Z, "-z")];
    let axis = axes.iter().find(|(axis, _)| axis.dot(direction) > 0.99);
    axis.map_or_else(|| format!("{direction:.2}"), |(_, name)| (*name).to_owned())
}

fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

impl fmt::Display for FitNote {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Specks(count) => {
                f.write_str(&counted(*count, "loose speck was ignored", "loose specks were ignored"))
            }
            Self::Tied(count) => {
                let pieces = counted(*count, "piece of the volume was", "pieces of the volume were");
                write!(f, "{pieces} tied to the body over gaps")
            }
            Self::Loose(count) => {
                let pieces = counted(*count, "piece of the volume is", "pieces of the volume are");
                write!(f, "{pieces} too far from the body, and ignored")
            }
            Self::Grounds(count) => {
                let pieces = counted(
                    *count,
                    "flat piece that the figure stands on was",
                    "flat pieces that the figure stands on were",
                );
                write!(f, "{pieces} left out")
            }
            Self::Sheets(count) => {
                let sheets = counted(*count, "open sheet about the body", "open sheets about the body");
                let are = if *count == 1 { "was" } else { "were" };
                write!(f, "{sheets}, such as a cloak, {are} left out; name objects to fit to them")
            }
            Self::Gear(count) => {
                let objects = counted(*count, "object that hangs on a bone was", "objects that hang on a bone were");
                write!(f, "{objects} left out; name objects to fit to others")
            }
            Self::Beside(count) => {
                let objects =
                    counted(*count, "object beside the largest one was", "objects beside the largest one were");
                write!(f, "{objects} left out, with which no figure shows for sure; name objects to fit to others")
            }
            Self::UnusedBranches(count) => {
                let branches = counted(*count, "branch of the mesh belongs", "branches of the mesh belong");
                write!(f, "{branches} to no limb of the template")
            }
            Self::MissingLimb(kind) => write!(f, "the mesh shows no {kind} for one of the template"),
            Self::BodyModel => f.write_str("joints follow a model of the human body"),
            Self::UncertainFront => {
                f.write_str("the front is uncertain: give the forward axis if the skeleton faces backwards")
            }
            Self::UncertainSide => f.write_str(
                "the side of the part is uncertain: give a marker for one of its joints if it is the other one",
            ),
            Self::MadeSymmetric => f.write_str("left and right were made alike"),
            Self::ForcedSymmetric(pairs) => {
                let pairs = counted(*pairs, "pair of joints", "pairs of joints");
                write!(f, "left and right were made alike as asked, though mesh or pose is not symmetric: {pairs}")
            }
            Self::MarkerOutside(label) => {
                write!(f, "the marker of \"{label}\" lies outside of the mesh's volume; it moves its own limb alone")
            }
            Self::MarkerAgainst(label) => {
                write!(
                    f,
                    "the marker of \"{label}\" is far from where the mesh shows that joint; it moves its own limb alone"
                )
            }
            Self::OtherUp(axis) => write!(f, "the given up direction contradicts the mesh, which stands along {axis}"),
            Self::OtherForward(axis) => {
                write!(f, "the given forward direction contradicts the mesh, which faces along {axis}")
            }
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
    /// Up and forward are one line.
    #[error("the up and forward directions are parallel; give directions at right angles")]
    Parallel,
    /// A marker lies far outside of the mesh.
    #[error(
        "the marker of \"{label}\" at {place} is far outside of the mesh, which reaches from {low} to {high}; give a place in the mesh's space and unit"
    )]
    FarMarker {
        /// Label of the joint.
        label: String,
        /// The place.
        place: Vec3,
        /// Least corner of the mesh.
        low: Vec3,
        /// Greatest corner of the mesh.
        high: Vec3,
    },
    /// A joint came out without a finite place.
    #[error("the fit found no finite place for every joint; give the mesh in a usual unit, and markers that are in it")]
    NotFinite,
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
