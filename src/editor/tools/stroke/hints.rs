//! Hints of the stroke tool: before the button is released, before a preview is accepted, and afterwards.

use bevy::prelude::*;

use super::{AcceptedStroke, StrokePreview, StrokeState, StrokeTool};
use crate::{
    algo::stroke::{StrokeKind, StrokeNote},
    editor::{
        ActiveRig,
        notice::Notice,
        tools::scene::{EditedRig, joints},
    },
    plugins::{
        document::EditReport,
        stroke::{StrokeDone, StrokePlan, StrokeResult, stroke_kind},
    },
    rig::{Uid, operations::Operation},
};

/// Effect of a release, of Enter or of the next stroke, and the obstacle, if any.
pub(super) fn describe(
    tool: &StrokeTool,
    rig: &EditedRig,
    posed: &[(Uid, Vec3)],
    hovered: Option<Uid>,
) -> (String, Option<String>) {
    match &tool.state {
        StrokeState::Idle if !rig.has_mesh => {
            (String::new(), Some("the rig has no mesh to draw on; open one first (Ctrl+O)".to_owned()))
        }
        StrokeState::Idle => {
            let hint = match hovered {
                Some(joint) => {
                    let name = rig.name(joint);
                    format!("Draw from here to continue from {name}; click to select it.")
                }
                None => "Draw over the mesh: the stroke becomes a chain. A short tick across a bone puts a joint into \
                         it; a scribble over joints deletes them."
                    .to_owned(),
            };
            (hint, None)
        }
        StrokeState::Drawing(request) => {
            let name = |number: usize| posed.get(number).map(|(joint, _)| rig.name(*joint)).unwrap_or_default();
            let hint = match stroke_kind(request, &rig.rig, posed) {
                StrokeKind::Chain { start: Some(start), .. } => {
                    format!("Release to see the chain that continues from {}.", name(start))
                }
                StrokeKind::Chain { .. } => "Release to see the chain; nothing is changed yet.".to_owned(),
                StrokeKind::Insert { bone, .. } => {
                    format!("Release to put a joint into the bone above {}.", name(bone))
                }
                StrokeKind::Erase { joints: under } => format!("Release to delete {}.", joints(under.len())),
            };
            (hint, None)
        }
        StrokeState::Preview(preview) => describe_preview(preview, rig),
    }
}

fn describe_preview(preview: &StrokePreview, rig: &EditedRig) -> (String, Option<String>) {
    let keys = "Wheel: more or fewer. Enter accepts, Esc cancels.";
    let Some(StrokePlan::Ready { operation, result }) = &preview.plan else {
        return ("The stroke is being followed through the mesh\u{2026} Enter accepts, Esc cancels.".to_owned(), None);
    };
    match result {
        StrokeResult::Chain { chain, parent, why } => {
            let count = match operation.as_deref() {
                Some(Operation::Chain { positions, .. }) => positions.len(),
                _ => chain.joints.len(),
            };
            let parent = parent.map(|parent| rig.name(parent)).unwrap_or_default();
            let notes: String = chain.notes.iter().map(|note| format!(" {}", heard(note))).collect();
            (format!("{}; the chain {}.{notes} {keys}", joints(count), why.describe(&parent)), None)
        }
        StrokeResult::Nothing(why) => (keys.to_owned(), Some(why.to_string())),
        StrokeResult::Inserted { child } => {
            (format!("Enter puts a joint into the bone above {}.", rig.name(*child)), None)
        }
        StrokeResult::Erased(under) => (format!("Enter deletes {}.", joints(under.len())), None),
    }
}

fn heard(note: &StrokeNote) -> String {
    match note {
        StrokeNote::EndMoved { start: true } => "It begins where the mesh does.".to_owned(),
        StrokeNote::EndMoved { start: false } => "It ends where the mesh does.".to_owned(),
        StrokeNote::VolumeChosen { volume, of } => format!("In volume {volume} of {of}: Tab for another."),
        StrokeNote::JointsLeftOut { count } => format!("Without {} over a gap of the mesh.", joints(*count)),
    }
}

/// Sends notices about finished strokes. Edits are made in the frame of their stroke; what is refused is told with all
/// refusals.
pub(super) fn answer(
    mut done: MessageReader<StrokeDone>,
    mut edited: MessageReader<EditReport>,
    mut left: MessageReader<AcceptedStroke>,
    mut leaving: Local<Option<Entity>>,
    active: Option<Res<ActiveRig>>,
    mut notices: MessageWriter<Notice>,
) {
    *leaving = left.read().last().map(|left| left.0).or(*leaving);
    let changed: Vec<Entity> = edited.read().filter(|report| report.is_new_step()).map(|report| report.rig).collect();
    let Some(active) = active else { return done.clear() };
    for StrokeDone { rig, result, .. } in done.read() {
        if *rig != active.0 {
            continue;
        }
        let is_leaving = leaving.take_if(|left| *left == *rig).is_some();
        let notice = match result {
            StrokeResult::Nothing(why) => Notice::warning(format!("Nothing was drawn: {why}.")),
            _ if !changed.contains(rig) => continue,
            StrokeResult::Chain { chain, .. } if is_leaving => {
                let drawn = joints(chain.joints.len());
                Notice::info(format!("The stroke was accepted as you left its mode: {drawn}; Ctrl+Z takes them back."))
            }
            StrokeResult::Chain { chain, .. } => Notice::done(format!("Drew {}.", joints(chain.joints.len()))).quiet(),
            StrokeResult::Inserted { .. } => Notice::done("Put a joint into a bone.").quiet(),
            StrokeResult::Erased(under) => {
                Notice::done(format!("Deleted {}; Ctrl+Z brings back.", joints(under.len())))
            }
        };
        notices.write(notice);
    }
}
