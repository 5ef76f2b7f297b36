//! Work in the background: what the status line says of it, and its end if a person stops it.

use bevy::prelude::*;

use super::{
    ActiveRig,
    files::{LoadJob, SaveJob, attend},
    library::{LibraryJobs, TemplateSave},
    notice::Notice,
    panels::timeline::import::ClipImport,
};
use crate::plugins::{RigSystems, face::FaceJob, painting::WeightChangeJob, skinning::SkinningJob, surface::RigMeshes};

/// Plugin that carries out [`StopWork`].
pub struct RunningWorkPlugin;

impl Plugin for RunningWorkPlugin {
    fn build(&self, app: &mut App) {
        // Work that has ended in the meantime is not gone on with.
        app.add_message::<StopWork>()
            .add_message::<Notice>()
            .add_systems(Update, stop.after(attend).before(RigSystems::Edits));
    }
}

/// Kind of work that can be stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoppableWork {
    /// A document is being opened.
    Opening,
    /// A document is being saved or exported, or a template written with its picture.
    Saving,
    /// A template of the library is being read.
    Library,
    /// A file of motion is being read, or its motion put onto the rig.
    Motion,
    /// Weights of a mesh are being computed or changed.
    Weights,
    /// A face is being placed.
    Face,
}

/// Request to stop work of a kind; the document stays as it is.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct StopWork(pub StoppableWork);

/// Description of the work that runs, with its progress if it is known, and the kind of the work if a person can stop it.
pub fn running(world: &World) -> Option<(String, Option<StoppableWork>)> {
    let rig = world.get_resource::<ActiveRig>().map(|active| active.0);
    if let Some(what) = world.get_resource::<LoadJob>().and_then(LoadJob::name) {
        // Without an open document there is nothing that could stay.
        return Some((format!("Opening {what}"), rig.map(|_| StoppableWork::Opening)));
    }
    if let Some(what) = world.get_resource::<ClipImport>().and_then(ClipImport::name) {
        return Some((format!("Importing {what}"), Some(StoppableWork::Motion)));
    }
    if let Some(what) = world.get_resource::<LibraryJobs>().and_then(LibraryJobs::name) {
        return Some((format!("Reading {what}"), Some(StoppableWork::Library)));
    }
    let template = || world.get_resource::<TemplateSave>().and_then(TemplateSave::name);
    if let Some(what) = world.get_resource::<SaveJob>().and_then(SaveJob::name).or_else(template) {
        return Some((format!("Saving {what}"), Some(StoppableWork::Saving)));
    }
    let meshes: Vec<Entity> = world.get::<RigMeshes>(rig?)?.iter().collect();
    let skinning = meshes.iter().filter_map(|mesh| world.get::<SkinningJob>(*mesh));
    let skinning: Vec<&SkinningJob> = skinning.filter(|job| !job.waits()).collect();
    if let Some(share) = skinning.iter().map(|job| job.progress()).reduce(f32::min) {
        // Shares of late joints are computed unasked, and would begin anew.
        let kind = skinning.iter().any(|job| job.is_asked()).then_some(StoppableWork::Weights);
        return Some((format!("Skinning {:.0} %", share * 100.0), kind));
    }
    let faces = meshes.iter().filter_map(|mesh| world.get::<FaceJob>(*mesh)).filter(|job| !job.waits());
    if let Some(share) = faces.map(FaceJob::progress).reduce(f32::min) {
        return Some((format!("Placing the face {:.0} %", share * 100.0), Some(StoppableWork::Face)));
    }
    let changes = meshes.iter().filter_map(|mesh| world.get::<WeightChangeJob>(*mesh));
    let is_changing = changes.filter(|job| !job.waits()).count() > 0;
    is_changing.then(|| ("Changing weights".to_owned(), Some(StoppableWork::Weights)))
}

fn stop(mut requests: MessageReader<StopWork>, mut commands: Commands) {
    for StopWork(kind) in requests.read().copied() {
        commands.queue(move |world: &mut World| carry_out(world, kind));
    }
}

fn carry_out(world: &mut World, kind: StoppableWork) {
    let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    match kind {
        StoppableWork::Opening => {
            if let Some(name) = world.get_resource_mut::<LoadJob>().and_then(|mut job| job.stop()) {
                world.write_message(Notice::info(format!("{name} is not opened: it was stopped")).named());
            }
        }
        StoppableWork::Saving => {
            if let Some(saving) = world.get_resource::<SaveJob>() {
                saving.stop();
            }
            if let Some(saving) = world.get_resource::<TemplateSave>() {
                saving.stop();
            }
        }
        StoppableWork::Library => {
            if let Some(name) = world.get_resource_mut::<LibraryJobs>().and_then(|mut jobs| jobs.stop()) {
                world.write_message(Notice::info(format!("{name} is not used: it was stopped")).named());
            }
        }
        StoppableWork::Motion => {
            if let Some(name) = world.get_resource_mut::<ClipImport>().and_then(|mut import| import.stop()) {
                world.write_message(Notice::info(format!("{name} is not imported: it was stopped")).named());
            }
        }
        StoppableWork::Weights | StoppableWork::Face => {
            let meshes = world.get::<RigMeshes>(rig);
            let meshes: Vec<Entity> = meshes.map(|meshes| meshes.iter().collect()).unwrap_or_default();
            meshes.into_iter().for_each(|mesh| stop_of_mesh(world, mesh, kind));
        }
    }
}

/// Stops the work of a kind on a mesh; the jobs tell themselves that they were stopped.
fn stop_of_mesh(world: &mut World, mesh: Entity, kind: StoppableWork) {
    if kind == StoppableWork::Face {
        if let Some(job) = world.get::<FaceJob>(mesh).filter(|job| !job.waits()) {
            job.cancel();
        }
        return;
    }
    if let Some(job) = world.get::<SkinningJob>(mesh).filter(|job| !job.waits() && job.is_asked()) {
        job.cancel();
    }
    if let Some(mut job) = world.get_mut::<WeightChangeJob>(mesh).filter(|job| !job.waits()) {
        job.stop();
    }
}
