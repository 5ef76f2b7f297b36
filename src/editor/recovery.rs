//! Work that a crash left: found when the window opens, or when its project does, and offered back.

use std::path::{Path, PathBuf};

use bevy::{
    prelude::*,
    tasks::{Task, futures::check_ready},
};

use super::{
    ActiveRig,
    files::{
        Loading, Then, after_asking,
        dialog::{Answer, Dialog, Question},
        parts::{
            Context, Landing, MeshSource, Opened, Work, begin, bundled_model, document, hash_of, places, project, spawn,
        },
    },
    notice::Notice,
    settings::EditorSettings,
};
use crate::{
    files::{
        Disk, FileKind, RealDisk,
        journal::{
            Basis, Ending, MAX_JOURNAL, PendingJournal, Recovered, journal_beside, pending_journal, pending_journals,
            recover,
        },
        load_model, read_capped, stem,
    },
    plugins::surface::RigMesh,
    rig::Rig,
};

/// What is known about work that a crash left.
#[derive(Resource, Default)]
pub struct Recovery {
    looking: Option<Task<Vec<PendingJournal>>>,
    found: Vec<PendingJournal>,
}

impl Recovery {
    /// True until it is known whether there is any.
    pub fn is_looking(&self) -> bool {
        self.looking.is_some()
    }

    /// Offers the work in a journal as soon as nothing else is asked.
    pub(super) fn offer(&mut self, pending: PendingJournal) {
        if self.found.iter().all(|known| known.path != pending.path) {
            self.found.push(pending);
        }
    }
}

/// Looks for journals in the folders where they may lie, and beside the projects that were opened lately.
pub(super) fn look(world: &mut World) {
    let folders = places(world, None).folders();
    let recent = world.get_resource::<EditorSettings>().map(|settings| settings.recent.clone()).unwrap_or_default();
    let task = spawn(move || {
        let disk: &dyn Disk = &RealDisk;
        let mut found: Vec<PendingJournal> = folders.iter().flat_map(|folder| pending_journals(disk, folder)).collect();
        let projects = recent.iter().filter(|path| FileKind::of(path) == Some(FileKind::Project));
        found.extend(projects.filter_map(|project| pending_journal(disk, &journal_beside(project))));
        found
    });
    world.resource_mut::<Recovery>().looking = Some(task);
}

/// Offers what was found, when something is open and nothing else is asked.
pub(super) fn poll(world: &mut World) {
    let mut recovery = world.resource_mut::<Recovery>();
    if let Some(found) = recovery.bypass_change_detection().looking.as_mut().and_then(check_ready) {
        recovery.looking = None;
        for pending in found {
            recovery.offer(pending);
        }
    }
    if world.resource::<Recovery>().found.is_empty()
        || world.resource::<Dialog>().question().is_some()
        || world.resource::<Loading>().what().is_some()
        || !world.contains_resource::<ActiveRig>()
    {
        return;
    }
    let mut found = std::mem::take(&mut world.resource_mut::<Recovery>().found);
    found.sort_by(|a, b| b.modified.cmp(&a.modified).then_with(|| a.path.cmp(&b.path)));
    world.resource_mut::<Dialog>().ask(Question::Recover(found));
}

/// Does what was answered to the offer; what is left over is offered again.
pub(super) fn answered(world: &mut World, mut list: Vec<PendingJournal>, answer: Answer) {
    match answer {
        Answer::Recover(journal) => {
            list.retain(|pending| pending.path != journal);
            world.resource_mut::<Recovery>().found = list;
            after_asking(world, Then::Recover(journal));
        }
        Answer::Forget(journal) => {
            list.retain(|pending| pending.path != journal);
            if let Err(error) = RealDisk.remove(&journal) {
                world.write_message(Notice::warning(format!("{} could not be deleted: {error}", journal.display())));
            }
            world.resource_mut::<Recovery>().found = list;
        }
        _ => {
            world.write_message(Notice::info("The unsaved work stays where it is, and is offered again next time"));
        }
    }
}

/// What a journal's work was on, for people.
pub(super) fn describe(pending: &PendingJournal) -> String {
    match pending.origin.path() {
        Some(path) => stem(path),
        None => match &pending.origin {
            crate::files::journal::Origin::Bundled(_) => "the bundled character".to_owned(),
            _ => "an empty rig".to_owned(),
        },
    }
}

/// Recovers in the background.
pub(super) fn start(world: &mut World, journal: PathBuf) {
    let task = spawn(move || restore(&journal));
    begin(world, "unsaved work".to_owned(), task);
}

/// Makes the document again as the journal has it.
fn restore(journal: &Path) -> Result<Landing, String> {
    let bytes = read_capped(&RealDisk, journal, MAX_JOURNAL).map_err(|error| error.to_string())?;
    let recovered = recover(&bytes).map_err(|error| format!("`{}`: {error}", journal.display()))?;
    let basis = recovered.basis(hash_of);
    let (mut opened, base) = match (basis, recovered.project()) {
        (Basis::Project { .. } | Basis::Changed, Some(path)) => {
            let mut opened = project(path)?;
            let base = std::mem::take(&mut opened.rig);
            (opened, Some(base))
        }
        _ => (with_meshes(&recovered), None),
    };
    let replayed = recovered.replay(basis, base);
    if let Some(reason) = &replayed.refused {
        let total = recovered.changes().len();
        opened.notes.push(format!(
            "the weights and joints of the last {} of {total} changes could not be made again: {reason}; their journal \
             is kept",
            total - replayed.applied
        ));
    }
    if let Ending::Torn { lost, .. } = recovered.ending {
        opened.notes.push(format!("the last {lost} bytes of the journal were damaged and are left out"));
    }
    opened.pending = None;
    opened.origin = recovered.origin().clone();
    opened.rig = replayed.rig.clone();
    opened.work = Some(Box::new(Work { recovered, replayed, journal: journal.to_owned() }));
    Ok(document(opened))
}

/// The meshes that were open, as far as they can be opened again.
fn with_meshes(recovered: &Recovered) -> Opened {
    let context: Context = ron::from_str(recovered.context()).unwrap_or_default();
    let name = match (context.name.is_empty(), recovered.origin().path()) {
        (false, _) => context.name,
        (true, Some(path)) => stem(path),
        (true, None) => "recovered".to_owned(),
    };
    let mut opened = Opened::named(name, Rig::default());
    for mesh in context.meshes {
        let model = match &mesh.source {
            MeshSource::Bundled => bundled_model(),
            MeshSource::File(path) => load_model(&RealDisk, path).map_err(|error| error.to_string()),
        };
        match model {
            Ok(model) => {
                // A file that has other nodes by now is not the one whose nodes became joints.
                let nodes = if mesh.nodes.len() == model.nodes.len() { mesh.nodes } else { Vec::new() };
                opened.meshes.push((RigMesh::new(mesh.uid, model, nodes), mesh.source));
            }
            Err(reason) => opened
                .notes
                .push(format!("a mesh of the project is not there: {reason}; the rig was recovered without it")),
        }
    }
    opened
}
