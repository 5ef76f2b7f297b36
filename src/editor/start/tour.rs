//! Tour on the bundled body: steps that a person does, and that the window sees in the rig.

use std::collections::BTreeSet;

use bevy::prelude::*;

use crate::{
    editor::{ActiveRig, actions::Action, mode::Mode, next_step::has_weights},
    plugins::{
        commands::BuildResult,
        history::RigHistory,
        surface::{RigMesh, RigMeshes},
    },
    rig::{PoseOffset, Rig},
};

/// State of the tour.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct Tour {
    /// The rig on which the tour goes on; `None` while there is no tour.
    rig: Option<Entity>,
    skipped: BTreeSet<TourStep>,
    done: BTreeSet<TourStep>,
}

/// Step of the tour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum TourStep {
    /// The body gets joints.
    Joints,
    /// The mesh gets weights for them.
    Weights,
    /// A joint is posed.
    Pose,
}

impl TourStep {
    /// The steps, in their order.
    pub const ALL: [Self; 3] = [Self::Joints, Self::Weights, Self::Pose];

    /// Name of the step.
    pub fn title(self) -> &'static str {
        match self {
            Self::Joints => "Put a skeleton in",
            Self::Weights => "Skin it",
            Self::Pose => "Pose it",
        }
    }

    /// Instruction, without the key at its beginning.
    pub fn about(self) -> &'static str {
        match self {
            Self::Joints => {
                "finds the skeleton that this body shows, and fits it in. Joints in doubt get rings: drag them."
            }
            Self::Weights => "computes how much each joint moves each point of the mesh.",
            Self::Pose => "lets you click a hand or the head and drag a ring: the mesh follows.",
        }
    }

    /// The action that does the step, or begins it.
    pub fn action(self) -> Action {
        match self {
            Self::Joints => Action::Fit,
            Self::Weights => Action::Skin,
            Self::Pose => Action::Mode(Mode::Pose),
        }
    }
}

impl Tour {
    /// The beginning of the tour on a rig.
    pub fn on(rig: Entity) -> Self {
        Self { rig: Some(rig), ..Self::default() }
    }

    /// True while the tour goes on, or has come to its end and waits for a person to close it.
    pub fn is_on(&self) -> bool {
        self.rig.is_some()
    }

    /// The present step: the first that is neither done nor skipped; `None` at the end.
    pub fn present(&self) -> Option<TourStep> {
        TourStep::ALL.into_iter().find(|step| !self.done.contains(step) && !self.skipped.contains(step))
    }

    /// The tour without its present step.
    pub fn skip(&self) -> Self {
        let mut next = self.clone();
        next.skipped.extend(self.present());
        next
    }
}

/// Looks which steps are done. The tour ends when another document is opened.
pub(super) fn follow(
    mut tour: ResMut<Tour>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &RigHistory, Option<&RigMeshes>, Option<&BuildResult>)>,
    meshes: Query<&RigMesh>,
) {
    let Some(on) = tour.rig else { return };
    let Some((rig, history, own, built)) = active.filter(|active| active.0 == on).and_then(|_| rigs.get(on).ok())
    else {
        *tour = Tour::default();
        return;
    };
    // A drag shows a pose that may be dropped yet.
    if history.is_previewing() {
        return;
    }
    let own = own.iter().flat_map(|own| own.iter()).filter_map(|mesh| meshes.get(mesh).ok());
    let states = [
        (TourStep::Joints, !rig.is_empty()),
        (TourStep::Weights, has_weights(rig, built.map(|built| &*built.0), own)),
        (TourStep::Pose, rig.pose().values().any(|offset| *offset != PoseOffset::IDENTITY)),
    ];
    let done: BTreeSet<TourStep> = states.into_iter().filter(|(_, is_done)| *is_done).map(|(step, _)| step).collect();
    if tour.done != done {
        tour.done = done;
    }
}
