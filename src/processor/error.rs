//! Errors of a build: the tag at fault, the problem, and the remedy.

use super::{deadline::OutOfTime, exclusion::Exclusion};
use crate::rig::{SourceError, Uid, reference::NodeRefs};

/// Reason why a module could not do its work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModuleError {
    /// A reference found nothing, or not what is needed.
    #[error("{parameter}: {reference}: {problem}")]
    Reference {
        /// The parameter.
        parameter: String,
        /// The reference as text.
        reference: String,
        /// Problem, with the nearest matches.
        problem: String,
    },
    /// A parameter that is out of its range or makes no sense with the others.
    #[error("{parameter}: {problem}")]
    Parameter {
        /// The parameter.
        parameter: String,
        /// Problem, and what to write instead.
        problem: String,
    },
    /// A number outside of its range, whatever the other parameters are.
    #[error("{parameter}: is {}; write {needed}", number_text(*value))]
    OutOfRange {
        /// The parameter.
        parameter: String,
        /// The number.
        value: f32,
        /// Numbers that are allowed, in words.
        needed: String,
    },
    /// A reference that the command cannot do without means something that is off: no failure, the build passes the
    /// command over.
    #[error("{parameter}: {off}")]
    Off {
        /// The parameter.
        parameter: String,
        /// Switch that is off.
        off: Exclusion,
    },
    /// Problem of another kind, in words.
    #[error("{0}")]
    Other(String),
    /// More than [`BuildLimits`](super::BuildLimits) allows.
    #[error(
        "there would be more than {limit} {what}; make fewer (a reference like @any names what was made before, too), \
         or raise the limit `{name}`"
    )]
    TooMany {
        /// Name of what there is too much of.
        what: &'static str,
        /// Name of the limit, as `--limit` of the commands takes it.
        name: &'static str,
        /// The limit.
        limit: usize,
    },
    /// Nodes and constraints that drive each other in a circle.
    #[error("these drive each other in a circle: {0}; remove one of the constraints, or let it follow something else")]
    Cycle(String),
}

/// Text of a number for people: with an exponent where it would have many zeros.
pub(super) fn number_text(number: f32) -> String {
    let is_plain = number == 0.0 || !number.is_finite() || (1e-4..1e7).contains(&number.abs());
    if is_plain { number.to_string() } else { format!("{number:e}") }
}

impl ModuleError {
    /// A parameter that is out of its range or makes no sense with the others; `problem` says what to write.
    pub fn parameter(parameter: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Parameter { parameter: parameter.into(), problem: problem.into() }
    }

    /// A reference that cannot be used.
    pub fn reference(parameter: impl Into<String>, references: &NodeRefs, problem: impl Into<String>) -> Self {
        Self::Reference { parameter: parameter.into(), reference: references.to_string(), problem: problem.into() }
    }

    /// A problem of another kind, in words.
    pub fn other(problem: impl Into<String>) -> Self {
        Self::Other(problem.into())
    }
}

/// Problem of a command.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildProblem {
    /// No module is registered under the name.
    #[error("there is no module \"{module}\"{nearest}; register it, or disable the tag")]
    NoModule {
        /// The name.
        module: String,
        /// The nearest names, as the rest of a sentence; may be empty.
        nearest: String,
    },
    /// The parameters cannot be read.
    #[error("parameters, {0}")]
    Parameters(#[from] SourceError),
    /// The module says no.
    #[error(transparent)]
    Module(#[from] ModuleError),
    /// The time of the build was over before the command began.
    #[error(transparent)]
    OutOfTime(#[from] OutOfTime),
}

impl BuildProblem {
    /// The parameter that is wrong, as the module names it: a field, or a value in one. `None` where no parameter that
    /// can be read is at fault.
    pub fn parameter(&self) -> Option<&str> {
        match self {
            Self::Module(
                ModuleError::Reference { parameter, .. }
                | ModuleError::Parameter { parameter, .. }
                | ModuleError::OutOfRange { parameter, .. },
            ) => Some(parameter),
            _ => None,
        }
    }
}

/// A command that failed. What stood before it stands; nothing after it ran.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{module} on {joint_label}: {problem}")]
pub struct BuildError {
    /// The tag.
    pub command: Uid,
    /// The joint that carries it.
    pub joint: Uid,
    /// The joint's label, or its uid where it has none.
    pub joint_label: Box<str>,
    /// The module.
    pub module: Box<str>,
    /// Problem.
    pub problem: BuildProblem,
}
