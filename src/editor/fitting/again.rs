//! Fits that begin anew: with another template, or facing the other way.

use bevy::prelude::*;

use crate::plugins::fit::{EndFit, FitRequest, FittedRig};

/// Request to undo the fit that can be corrected, and to begin it anew.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct FitAgain {
    /// The rig.
    pub rig: Entity,
    /// Difference of the new fit.
    pub wish: FitWish,
}

/// Difference of a fit that begins anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FitWish {
    /// Another template, by its name.
    Template(String),
    /// The front is where the back was.
    TurnRound,
}

/// Takes fits back, and begins them anew one frame later: only then the rig is as it was before.
pub(super) fn begin_again(
    mut wishes: MessageReader<FitAgain>,
    rigs: Query<&FittedRig>,
    mut waiting: Local<Option<FitRequest>>,
    mut commands: Commands,
) {
    if let Some(request) = waiting.take() {
        commands.write_message(request);
    }
    let Some(FitAgain { rig, wish }) = wishes.read().last() else { return };
    let Ok(fitted) = rigs.get(*rig) else { return };
    *waiting = Some(match wish {
        FitWish::Template(name) => fitted.with_template(name),
        FitWish::TurnRound => fitted.turned_round(),
    });
    commands.write_message(EndFit { rig: *rig, cancel: true });
}
