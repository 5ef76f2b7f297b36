//! The command processor: from tags on joints to a built rig, stepwise, reversibly, and only where something changed.
//!
//! A [`Builder`] follows one rig. [`Builder::sync`] takes over what the document says, [`Builder::run_to`] carries out
//! commands up to a place in the list. The built world keeps what every command wrote side by side with what stood
//! there before, so looking at it as of an earlier command (rolling back, stepping) is exact and costs nothing; and as
//! what every command read is kept, too, a command runs again only if its parameters, its place or something that it
//! read has changed. When it writes the same as before, nothing after it runs (early cut-off).
//!
//! Modules see the world through a [`BuildScope`] only. Nothing here knows an `App`.

mod amount;
mod anchors;
mod attribute_list;
mod authoring;
mod axis;
mod builder;
mod creation;
mod deadline;
mod error;
mod error_references;
mod exclusion;
mod fit;
mod follow;
pub mod form;
mod ik;
mod keep_clips;
mod keep_moved_nodes;
mod keep_poses;
mod list;
mod listed_nodes;
mod mirror;
mod module;
mod parameter_faults;
mod parameters;
mod resolve;
mod review;
mod scope;
mod signal;
mod snapshot;
mod values;
mod visibility;
mod world;

pub use amount::Amount;
pub use attribute_list::AttributeList;
pub use authoring::{check_finite, check_limits};
pub use axis::Axis;
pub use builder::{Builder, CommandCounts, CommandDependency, CommandState, CommandStatus, FindError, RunReport};
pub use creation::Creation;
pub use deadline::{Deadline, OutOfTime};
pub use error::{BuildError, BuildProblem, ModuleError};
pub use exclusion::{Exclusion, SkipReason};
pub use fit::{Fitting, fitted_rig};
pub use follow::{FollowParams, TargetParams};
pub use ik::{Ik, IkSolver, JointAngles};
pub use keep_clips::{ClipNote, ClipReport, KeptClips, KeysSetAside, RigVersion, clips_between, keep_clips};
pub use keep_poses::{PoseNote, keep_poses};
pub use list::{BuildRange, ListEntry};
pub use listed_nodes::ListedNodes;
pub use mirror::{mirrored_angles, mirrored_direction, mirrored_limits, mirrored_line, opposite};
pub use module::{BuildLimits, DynModule, FormError, ModuleInfo, Modules, Parameter, Resize, RigModule};
pub use resolve::ResolveError;
pub use review::{SourceText, review, review_with, with_missing_name};
pub use scope::{BuildScope, Side};
pub use values::{ParameterValues, differing_params};
pub use world::{Aspect, NodeId, Value};
