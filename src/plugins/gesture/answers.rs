//! Answers to gestures: what people read of the edits, picks and strokes that gestures became.

use bevy::{ecs::system::SystemParam, prelude::*};

use super::{
    error::GestureError,
    script::{AwaitedAnswer, GestureScript, ScriptedRig},
    selection_run::told_selection,
};
use crate::{
    algo::{placement::Placement, stroke::StrokeNote},
    plugins::{
        document::{ChangeReport, EditRefusal, EditReport},
        fit::FitAnswer,
        history::quoted_name,
        picking::PickAnswer,
        placement::{PlaceAnswer, PlaceRefusal},
        stroke::{StrokeDone, StrokeResult},
        surface::SkinOf,
    },
    rig::{Rig, Uid},
};

/// Readers of the answers.
#[derive(SystemParam)]
pub(super) struct Answers<'w, 's> {
    edited: MessageReader<'w, 's, EditReport>,
    refused: MessageReader<'w, 's, EditRefusal>,
    picked: MessageReader<'w, 's, PickAnswer>,
    placed: MessageReader<'w, 's, PlaceAnswer>,
    reported: MessageReader<'w, 's, ChangeReport>,
    drawn: MessageReader<'w, 's, StrokeDone>,
    fitted: MessageReader<'w, 's, FitAnswer>,
    meshes: Query<'w, 's, &'static SkinOf>,
}

impl Answers<'_, '_> {
    /// Reads the answers to the last gestures of scripts. Answers to requests of other code are none of them.
    pub(super) fn collect(&mut self, scripts: &mut Query<ScriptedRig>) {
        for PickAnswer { rig: entity, request, joints } in self.picked.read() {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            if script.take_selection(*request, joints, rig) || !script.awaits(AwaitedAnswer::Pick(*request)) {
                continue;
            }
            if joints.is_empty() {
                script.fail(&GestureError::NothingToPick);
            } else {
                script.say(told_selection(joints, rig));
            }
            script.finish(None);
        }
        for PlaceAnswer { rig: entity, request, edit, placement, refusal, .. } in self.placed.read() {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            if !script.awaits(AwaitedAnswer::Place(*request)) {
                continue;
            }
            script.note_added(rig);
            script.tell_placement(placement, *refusal);
            script.finish(*edit);
        }
        for ChangeReport { rig: entity, request, step } in self.reported.read() {
            if let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) {
                script.take_report(*request, step, rig);
            }
        }
        for StrokeDone { rig: entity, request, edit, result } in self.drawn.read() {
            let Ok((_, mut script, rig, ..)) = scripts.get_mut(*entity) else { continue };
            if !script.awaits(AwaitedAnswer::Stroke(*request)) {
                continue;
            }
            script.note_added(rig);
            match result {
                StrokeResult::Nothing(why) => script.fail(&why.clone().into()),
                StrokeResult::Inserted { child } => {
                    script.say(format!("put a joint into the bone that ends at {}", quoted_name(rig, *child)));
                }
                StrokeResult::Erased(joints) => script.say(format!("deleted {} joints", joints.len())),
                StrokeResult::Chain { chain, parent, .. } => {
                    script.say(told_chain(rig, chain.joints.len(), *parent, &chain.notes));
                }
            }
            script.finish(*edit);
        }
        for FitAnswer { mesh, edit, result } in self.fitted.read() {
            let Ok(SkinOf(rig)) = self.meshes.get(*mesh) else { continue };
            let Ok((_, mut script, ..)) = scripts.get_mut(*rig) else { continue };
            if !script.awaits(AwaitedAnswer::Fit(*mesh)) {
                continue;
            }
            match (result, edit) {
                (Err(failure), _) => {
                    script.fail(&failure.clone().into());
                    script.finish(None);
                }
                // The edit of a fit answers for it.
                (Ok(_), Some(edit)) => script.awaited = Some(AwaitedAnswer::Edit(*edit)),
                (Ok(_), None) => script.finish(None),
            }
        }
        for EditReport { rig: entity, request, name, .. } in self.edited.read() {
            let (Ok((_, mut script, rig, ..)), Some(request)) = (scripts.get_mut(*entity), request) else { continue };
            if script.awaits(AwaitedAnswer::Edit(*request)) {
                script.note_added(rig);
                script.say(told_step(name, rig.len()));
                script.finish(None);
            }
        }
        for EditRefusal { rig: entity, request, reason } in self.refused.read() {
            let (Ok((_, mut script, ..)), Some(request)) = (scripts.get_mut(*entity), request) else { continue };
            // The edit of a click or a stroke is refused after these have told what they met.
            if script.awaited == Some(AwaitedAnswer::Edit(*request)) {
                script.fail(&reason.clone().into());
                script.finish(None);
            }
        }
    }
}

impl GestureScript {
    pub(super) fn fail(&mut self, error: &GestureError) {
        if let Some(answer) = self.answers.last_mut() {
            answer.done = false;
            answer.message = error.to_string();
        }
    }

    fn say(&mut self, message: String) {
        if let Some(answer) = self.answers.last_mut() {
            answer.message = message;
        }
    }

    /// Answers a click.
    pub(super) fn tell_placement(&mut self, placement: &Placement, refusal: Option<PlaceRefusal>) {
        match placement {
            Placement::Nothing => {
                self.fail(&refusal.map_or(GestureError::NothingThere, GestureError::from));
            }
            Placement::Single { position } => {
                self.say(format!("placed a joint on the surface at {}", point(*position)));
            }
            Placement::Between { position, volumes, volume, .. } => {
                let volumes = match volume {
                    None if *volumes > 1 => format!(", spanning {volumes} volumes (Volume(1) takes the near one)"),
                    Some(number) if *volumes > 1 => format!(", in volume {number} of {volumes}"),
                    _ => String::new(),
                };
                self.say(format!("placed a joint at {}{volumes}", point(*position)));
            }
        }
    }

    fn note_added(&mut self, rig: &Rig) {
        let before = self.state.joints_before;
        if let Some(answer) = self.answers.last_mut() {
            answer.joints_added = rig.len().saturating_sub(before);
        }
    }
}

fn point(position: Vec3) -> String {
    format!("({:.4}, {:.4}, {:.4})", position.x, position.y, position.z)
}

/// Sentence about a chain of so many joints along a stroke, and the joint of the rig that it hangs on.
pub(super) fn told_chain(rig: &Rig, joints: usize, parent: Option<Uid>, notes: &[StrokeNote]) -> String {
    let on = parent.map_or("as a root".to_owned(), |parent| format!("below {}", quoted_name(rig, parent)));
    let notes: String = notes.iter().map(|note| format!("; {}", heard(note))).collect();
    format!("drew a chain of {joints} joints {on}{notes}")
}

/// Sentence about a step, and the number of joints of the rig after it.
pub(super) fn told_step(name: &str, joints: usize) -> String {
    format!("{}: {joints} joints now", within_sentence(name))
}

/// The title of a step in the middle of a sentence; names in it keep their letters.
fn within_sentence(title: &str) -> String {
    let mut letters = title.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

fn heard(note: &StrokeNote) -> String {
    match note {
        StrokeNote::EndMoved { start: true } => "its start lies beside the mesh and was moved onto it".to_owned(),
        StrokeNote::EndMoved { start: false } => "its end lies beside the mesh and was moved onto it".to_owned(),
        StrokeNote::VolumeChosen { volume, of } => format!("in volume {volume} of {of} (Volume(n) takes another)"),
        StrokeNote::JointsLeftOut { count } => format!("{count} joints fell into a gap of the mesh and were left out"),
    }
}
