//! Results of background jobs that wait for undone steps: what the status line says of them, and their end if a person
//! discards them.

use bevy::prelude::*;

use super::{ActiveRig, files::attend, library::LibraryJobs, notice::Notice, panels::timeline::import::ClipImport};
use crate::plugins::{
    face::FaceJob, fit::FitJob, history::RigHistory, landing::HeldResult, mesh_reload::ReloadJob,
    painting::WeightChangeJob, skinning::SkinningJob, surface::RigMeshes,
};

/// Plugin that carries out [`DiscardResult`].
pub struct HeldPlugin;

impl Plugin for HeldPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<DiscardResult>().add_message::<Notice>().add_systems(Update, discard.after(attend));
    }
}

/// Request to discard the results of a kind that wait; the rig stays as it is.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiscardResult(pub HeldResult);

/// Kind of a result that waits, and the words for it: "The face waits"; the first one if there are several.
pub fn waiting(world: &World) -> Option<(HeldResult, String)> {
    let rig = world.get_resource::<ActiveRig>()?.0;
    // While something is dragged results wait, too, for the end of the drag.
    if !world.get::<RigHistory>(rig)?.can_redo() {
        return None;
    }
    if let Some(name) = world.get_resource::<ClipImport>().and_then(ClipImport::waits) {
        return Some((HeldResult::Motion, format!("{name} waits")));
    }
    if let Some(name) = world.get_resource::<LibraryJobs>().and_then(LibraryJobs::waits) {
        return Some((HeldResult::Template, format!("{name} waits")));
    }
    let meshes = world.get::<RigMeshes>(rig)?;
    let found = meshes.iter().find_map(|mesh| of_mesh(world, mesh))?;
    let words = match found {
        HeldResult::Weights => "The weights wait",
        HeldResult::Face => "The face waits",
        HeldResult::Fit => "The fit waits",
        HeldResult::Mesh => "The changed mesh waits",
        HeldResult::Template | HeldResult::Motion => return None,
    };
    Some((found, words.to_owned()))
}

/// Kind of a mesh's result that waits.
fn of_mesh(world: &World, mesh: Entity) -> Option<HeldResult> {
    // Nobody asked for shares of late joints, so nobody has to decide about them.
    let has_weights = world.get::<SkinningJob>(mesh).is_some_and(|job| job.waits() && job.is_asked())
        || world.get::<WeightChangeJob>(mesh).is_some_and(WeightChangeJob::waits);
    let kinds = [
        (has_weights, HeldResult::Weights),
        (world.get::<FitJob>(mesh).is_some_and(FitJob::waits), HeldResult::Fit),
        (world.get::<FaceJob>(mesh).is_some_and(FaceJob::waits), HeldResult::Face),
        (world.get::<ReloadJob>(mesh).is_some_and(ReloadJob::waits), HeldResult::Mesh),
    ];
    kinds.into_iter().find_map(|(waits, kind)| waits.then_some(kind))
}

fn discard(mut requests: MessageReader<DiscardResult>, mut commands: Commands) {
    for DiscardResult(kind) in requests.read().copied() {
        commands.queue(move |world: &mut World| carry_out(world, kind));
    }
}

fn carry_out(world: &mut World, kind: HeldResult) {
    let dropped = match kind {
        HeldResult::Template => {
            world.get_resource_mut::<LibraryJobs>().and_then(|mut jobs| jobs.drop_waiting()).map(|name| (name, "used"))
        }
        HeldResult::Motion => world
            .get_resource_mut::<ClipImport>()
            .and_then(|mut import| import.drop_waiting())
            .map(|name| (name, "imported")),
        HeldResult::Weights | HeldResult::Face | HeldResult::Fit | HeldResult::Mesh => {
            discard_of_meshes(world, kind);
            None
        }
    };
    if let Some((name, what)) = dropped {
        world.write_message(Notice::info(format!("{name} is not {what}: it was discarded")).named());
    }
}

/// Discards what waits at the meshes of the open rig; the jobs answer that themselves.
fn discard_of_meshes(world: &mut World, kind: HeldResult) {
    let rig = world.get_resource::<ActiveRig>().map(|active| active.0);
    let meshes = rig.and_then(|rig| world.get::<RigMeshes>(rig));
    let meshes: Vec<Entity> = meshes.map(|meshes| meshes.iter().collect()).unwrap_or_default();
    for mesh in meshes {
        match kind {
            HeldResult::Weights => {
                if let Some(job) = world.get::<SkinningJob>(mesh).filter(|job| job.waits() && job.is_asked()) {
                    job.cancel();
                }
                if let Some(mut job) = world.get_mut::<WeightChangeJob>(mesh) {
                    job.discard();
                }
            }
            HeldResult::Face => {
                if let Some(job) = world.get::<FaceJob>(mesh).filter(|job| job.waits()) {
                    job.cancel();
                }
            }
            HeldResult::Fit => {
                if let Some(job) = world.get::<FitJob>(mesh).filter(|job| job.waits()) {
                    job.cancel();
                }
            }
            HeldResult::Mesh => {
                if let Some(mut job) = world.get_mut::<ReloadJob>(mesh) {
                    job.discard();
                }
            }
            HeldResult::Template | HeldResult::Motion => {}
        }
    }
}
