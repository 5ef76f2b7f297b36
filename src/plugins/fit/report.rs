//! Report of a fit, and the reasons why there is none.

use std::time::Duration;

use crate::{
    algo::fit_template::{FitError, FitNote, FittedSkeleton, JointFit},
    plugins::limits::{LimitError, OutOfTime},
    rig::{EditError, Uid, operations::OperationError},
};

/// Report of a fit.
#[derive(Debug, Clone)]
pub struct FitReport {
    /// Name of the template; of the rig if its own joints were moved.
    pub template: String,
    /// Limbs that the chosen template has and that the mesh shows, in words; empty if there was no choice.
    pub choice: String,
    /// Uid and label of each joint, in the order of the fit.
    pub joints: Vec<(Uid, String)>,
    /// The fit, in the space of the mesh.
    pub fit: FittedSkeleton,
    /// Duration of analysis and fit.
    pub time: Duration,
}

impl FitReport {
    /// Confidence below which a joint is doubtful.
    pub const DOUBTFUL: f32 = 0.5;

    /// Notes that say what may be wrong, or what was left out; equal ones are told once.
    pub fn warnings(&self) -> impl Iterator<Item = &FitNote> {
        let notes = &self.fit.notes;
        notes
            .iter()
            .enumerate()
            .filter(|(at, note)| note.is_warning() && !notes[..*at].contains(*note))
            .map(|(_, note)| note)
    }

    /// Joints that the fit is not sure of.
    pub fn doubtful(&self) -> impl Iterator<Item = Uid> + '_ {
        self.doubts().map(|(uid, ..)| uid)
    }

    /// Joints that the fit is not sure of, with their labels, places and reasons.
    pub fn doubts(&self) -> impl Iterator<Item = (Uid, &str, &JointFit)> {
        let pairs = self.joints.iter().zip(&self.fit.joints);
        let doubted = pairs.filter(|(_, joint)| joint.confidence < Self::DOUBTFUL);
        doubted.map(|((uid, label), joint)| (*uid, label.as_str(), joint))
    }
}

/// Reason why a template was not fitted; a sentence for people without its full stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitFailure {
    /// The entity of the request has no mesh, or its mesh no rig.
    #[error("the mesh belongs to no rig; it may have been closed")]
    NoRig,
    /// The rig and the request have no joints.
    #[error("there is no skeleton to fit; name a template")]
    NoTemplate,
    /// No template has the name.
    #[error("there is no template \"{name}\"{nearest}")]
    NoName {
        /// Requested name.
        name: String,
        /// Nearest names, as the rest of a sentence.
        nearest: String,
    },
    /// A marker names no joint.
    #[error("no joint of \"{template}\" is called \"{label}\"{nearest}")]
    NoJoint {
        /// Name of the template.
        template: String,
        /// Requested label.
        label: String,
        /// Nearest labels, as the rest of a sentence.
        nearest: String,
    },
    /// A marker names a joint that none of the templates has that the fit may choose.
    #[error("no joint of any template is called \"{label}\"{nearest}")]
    NoJointOfAny {
        /// Requested label.
        label: String,
        /// Nearest labels, as the rest of a sentence.
        nearest: String,
    },
    /// Two markers are given for one joint.
    #[error("there are two markers for \"{label}\"; give one place for each joint")]
    TwoMarkers {
        /// Label of the joint.
        label: String,
    },
    /// The mesh shows none of the templates that the fit may choose.
    #[error(
        "the mesh shows no figure: it has {limbs} of the most similar template, \"{template}\" (confidence {confidence:.2}); choose the template yourself to fit it all the same"
    )]
    NoFigure {
        /// Name of the most similar template.
        template: String,
        /// Limbs that the template has and that the mesh shows, in words.
        limbs: String,
        /// Confidence in the fit that was left.
        confidence: f32,
    },
    /// No triangle of the mesh is in the region.
    #[error("no face of the mesh is in the region; choose faces, or joints that the mesh has weights of")]
    EmptyRegion,
    /// The mesh does not show the template.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The joints cannot be put there.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The part cannot be added to the rig.
    #[error(transparent)]
    Operation(#[from] OperationError),
    /// The rig was changed meanwhile.
    #[error("the joints were changed while the template was fitted; fit again")]
    Changed,
    /// The mesh has more points or triangles than [`RigLimits`](crate::plugins::limits::RigLimits) allows.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The fit took longer than [`RigLimits`](crate::plugins::limits::RigLimits) allows.
    #[error(transparent)]
    OutOfTime(#[from] OutOfTime),
}
