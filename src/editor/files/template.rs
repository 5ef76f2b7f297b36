//! Templates put onto the open mesh, as one step that undo takes back.

use std::sync::Arc;

use bevy::prelude::*;

use super::{
    DocumentLanded, active,
    dialog::{Dialog, Question},
    document::meshes,
    open::LoadedDocument,
};
use crate::{
    editor::{
        counts::counted,
        notice::Notice,
        panels::timeline::{TimelineAction, own_motion::own_file},
    },
    files::journal::Origin,
    plugins::document::EditRequest,
    rig::{PoseOffset, Rig, RigEdit, operations::Operation, step::edits_from_empty},
};

/// Largest ratio of sizes of a template and the mesh without a question.
const ALLOWED: f32 = 1.6;

/// A template, and a mesh of another size.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The template's name.
    pub name: String,
    /// Height of the template's joints, in its own units.
    pub rig_height: f32,
    /// Height of the mesh at rest.
    pub mesh_height: f32,
    pub(super) rig: Arc<Rig>,
}

impl Fit {
    /// The factor that makes the template as tall as the mesh.
    pub fn ratio(&self) -> f32 {
        self.mesh_height / self.rig_height
    }
}

/// Returns `true` if a mesh is open.
pub(super) fn has_mesh(world: &World) -> bool {
    active(world).is_some_and(|rig| !meshes(world, rig).is_empty())
}

/// Puts a template onto the mesh, or asks about their sizes.
pub(super) fn consider(world: &mut World, opened: LoadedDocument) {
    let Some(active) = active(world) else { return };
    for note in &opened.notes {
        world.write_message(Notice::info(note.clone()).quiet());
    }
    let points = meshes(world, active);
    let mesh_height = height(points.iter().flat_map(|(_, mesh, _)| mesh.rest.points.iter().copied()));
    let rig_height = height(opened.rig.walk().map(|joint| opened.rig.position(joint.data.uid)));
    let fit = Fit { name: opened.name, rig_height, mesh_height, rig: Arc::new(opened.rig) };
    let ratio = fit.ratio();
    if ratio.is_finite() && ratio > 0.0 && !(1.0 / ALLOWED..=ALLOWED).contains(&ratio) {
        let text = format!(
            "{} is for a mesh of another size: its joints are {} tall, this mesh {}. Scale it to the mesh, or take it as it is",
            fit.name,
            number(rig_height),
            number(mesh_height)
        );
        world.write_message(Notice::warning(text).named());
        world.resource_mut::<Dialog>().ask(Question::Fit(fit));
    } else {
        put(world, &fit, 1.0);
    }
}

/// Height with three digits.
pub(super) fn number(height: f32) -> String {
    match height {
        large if large >= 100.0 => format!("{large:.0}"),
        middle if middle >= 10.0 => format!("{middle:.1}"),
        small => format!("{small:.3}"),
    }
}

fn height(points: impl Iterator<Item = Vec3>) -> f32 {
    let (low, high) = points.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), p| (low.min(p.y), high.max(p.y)));
    (high - low).max(0.0)
}

/// Replaces the open rig by the template, scaled by `scale`, as one step.
pub(super) fn put(world: &mut World, fit: &Fit, scale: f32) {
    let Some(entity) = active(world) else { return };
    let Some(rig) = world.get::<Rig>(entity) else { return };
    let had = rig.len();
    let has_clips = had > 0 && rig.clips().iter().any(|clip| clip.key_count() > 0);
    let edits = replacing(rig, &fit.rig, scale);
    world.write_message(EditRequest::operation(entity, Operation::Edits(edits)));
    world.write_message(DocumentLanded { origin: Origin::Empty });
    let joints = counted(fit.rig.len(), "joint", "joints");
    let replaced =
        if had > 0 { format!(" instead of the {had} that were there; undo brings them back") } else { String::new() };
    let sized = if scale == 1.0 { String::new() } else { format!(", scaled by {scale:.3}") };
    world.write_message(Notice::done(format!("Put {} onto the mesh: {joints}{sized}{replaced}", fit.name)));
    if has_clips && own_file(world).is_some() {
        let text = format!(
            "The clips move joints that were replaced. \"{}\" in the Timeline puts them onto {}, once it fits the mesh",
            TimelineAction::ImportOwn.name(),
            fit.name
        );
        world.write_message(Notice::info(text).at("Timeline"));
    }
}

/// Edits that put a template, scaled by `scale`, in place of a rig. Weights of the template are left out.
pub(in crate::editor) fn replacing(rig: &Rig, template: &Rig, scale: f32) -> Vec<RigEdit> {
    let mut edits = clearing(rig);
    let of_template = edits_from_empty(template).into_iter().filter(|edit| !matches!(edit, RigEdit::SetSkin(..)));
    edits.extend(of_template.map(|edit| if scale == 1.0 { edit } else { scaled(edit, scale) }));
    edits
}

/// Edits that empty a rig.
fn clearing(rig: &Rig) -> Vec<RigEdit> {
    let mut edits: Vec<RigEdit> = rig.skins().map(|(mesh, _)| RigEdit::SetSkin(mesh, None)).collect();
    edits.extend(rig.stored_poses().iter().map(|pose| RigEdit::RemoveStoredPose(pose.uid)));
    let mut joints: Vec<RigEdit> = rig.walk().map(|joint| RigEdit::RemoveJoint(joint.data.uid)).collect();
    joints.reverse();
    edits.append(&mut joints);
    edits.extend(rig.groups().iter().map(|group| RigEdit::RemoveLocalGroup(group.uid)));
    edits
}

fn scaled(edit: RigEdit, scale: f32) -> RigEdit {
    let offset = |offset: PoseOffset| PoseOffset { translation: offset.translation * scale, ..offset };
    match edit {
        RigEdit::AddJoint { mut joint, parent, index } => {
            joint.rest.translation *= scale;
            RigEdit::AddJoint { joint, parent, index }
        }
        RigEdit::SetOffset(joint, Some(posed)) => RigEdit::SetOffset(joint, Some(offset(posed))),
        RigEdit::AddStoredPose(mut pose, index) => {
            pose.offsets.values_mut().for_each(|posed| *posed = offset(*posed));
            RigEdit::AddStoredPose(pose, index)
        }
        other => other,
    }
}
