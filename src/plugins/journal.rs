//! Journals: every committed edit is stored at once.
//!
//! A rig with a [`RigJournal`] hands each change to a [`StepSink`] in the frame in which it was made: there is no timer
//! that a long gesture could hold up. The sink decides about the place; [`Journal`](crate::files::journal::Journal) is
//! an append-only file.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use bevy::prelude::*;

use super::{RigSystems, configure_sets, document::EditReport, history::RigHistory, selection::Selection};
use crate::rig::{
    Rig,
    step::{Commit, Replay, SinkError, StepSink},
};

/// Plugin of journals; does nothing for rigs without a [`RigJournal`].
pub struct JournalPlugin;

impl Plugin for JournalPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_message::<EditReport>().add_message::<JournalTrouble>().add_systems(
            Update,
            (record_edits.run_if(on_message::<EditReport>), report_trouble)
                .chain()
                .after(RigSystems::Edits)
                .before(RigSystems::Build),
        );
    }
}

/// Sink of the changes of a rig. Remove the component to stop.
#[derive(Component, Reflect, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct RigJournal {
    sink: Arc<dyn StepSink>,
    reported: Arc<Mutex<Option<SinkError>>>,
}

impl RigJournal {
    /// Sends the changes of the rig to `sink` from now on.
    pub fn new(sink: impl StepSink + 'static) -> Self {
        Self { sink: Arc::new(sink), reported: Arc::default() }
    }

    /// Hands over a change that was made outside the edit path of the plugins.
    pub fn record(&self, committed: Commit) {
        self.sink.record(committed);
    }

    /// Waits until every change so far is stored, at most for `limit`: before quitting, or when the renderer fails.
    ///
    /// # Errors
    /// The reason why changes are not stored, in words for people.
    pub fn flush(&self, limit: Duration) -> Result<(), SinkError> {
        self.sink.flush(limit)
    }

    /// The reason why changes cannot be stored at the moment; `None` while they can.
    pub fn trouble(&self) -> Option<SinkError> {
        self.sink.trouble()
    }
}

/// Message that a rig's changes can no longer be stored, or can be again. Sent once each time.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct JournalTrouble {
    /// The rig.
    pub rig: Entity,
    /// Description of the problem with a hint; `None` once all changes, the earlier ones included, are stored again.
    pub reason: Option<SinkError>,
}

fn record_edits(mut edited: MessageReader<EditReport>, journals: Query<&RigJournal>) {
    for EditReport { rig, committed, .. } in edited.read() {
        if let (Ok(journal), Some(committed)) = (journals.get(*rig), committed) {
            journal.record(committed.clone());
        }
    }
}

fn report_trouble(journals: Query<(Entity, &RigJournal)>, mut trouble: MessageWriter<JournalTrouble>) {
    for (rig, journal) in &journals {
        let reason = journal.trouble();
        let mut reported = journal.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if *reported != reason {
            reported.clone_from(&reason);
            trouble.write(JournalTrouble { rig, reason });
        }
    }
}

/// The components of a replayed rig: document, selection and history.
pub fn replayed_bundle(replayed: &Replay) -> (Rig, Selection, RigHistory) {
    (
        replayed.rig.clone(),
        Selection(replayed.selection.clone().unwrap_or_default()),
        RigHistory::restored(&replayed.stacks),
    )
}
