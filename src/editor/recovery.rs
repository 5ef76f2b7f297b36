//! Recovery of unsaved work after a crash: found when the window opens, or when its project is opened, and offered to
//! the user.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use bevy::{
    prelude::*,
    tasks::{Task, futures::check_ready},
};

use super::{
    ActiveRig,
    counts::counted,
    files::{
        FollowUp, LoadJob, after_asking,
        dialog::{Answer, Dialog, Question},
        loading::{
            BundledModel, Context, LoadedDocument, LoadedFile, MeshSource, OpenError, Work, begin, describe_bundled,
            document, hash_of, places, project, spawn,
        },
    },
    notice::Notice,
    settings::EditorSettings,
};
use crate::{
    files::{
        Disk, FileKind, MeshShape, MeshToSave, RealDisk,
        journal::{
            Basis, Condition, MAX_JOURNAL, Origin, PendingJournal, RecordKind, RecoveredJournal, RestoredRig,
            journal_beside, pending_journal, pending_journals, project_beside, recover,
        },
        load_model, read_capped, stem,
    },
    plugins::surface::RigMesh,
    rig::{Rig, Uid},
};

/// Largest number of gaps and skipped changes that are listed one by one.
const MAX_TOLD: usize = 20;

/// State of the search for unsaved work after a crash.
#[derive(Resource, Default)]
pub struct Recovery {
    looking: Option<Task<Vec<PendingJournal>>>,
    found: Vec<PendingJournal>,
}

impl Recovery {
    /// True while the search for unsaved work is running.
    pub fn is_looking(&self) -> bool {
        self.looking.is_some()
    }

    /// Adds the work in a journal to those that are offered once no other question is open.
    pub(super) fn offer(&mut self, pending: PendingJournal) {
        if self.found.iter().all(|known| known.path != pending.path) {
            self.found.push(pending);
        }
    }
}

/// Starts the search for journals in their usual folders, and beside the projects that were opened lately.
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

/// Offers the found work once a document and no other question is open.
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
        || world.resource::<LoadJob>().name().is_some()
        || !world.contains_resource::<ActiveRig>()
    {
        return;
    }
    let mut found = std::mem::take(&mut world.resource_mut::<Recovery>().found);
    found.sort_by(|a, b| b.modified.cmp(&a.modified).then_with(|| a.path.cmp(&b.path)));
    world.resource_mut::<Dialog>().ask(Question::Recover(found));
}

/// Carries out the answer to the offer; the remaining work is offered again.
pub(super) fn answered(world: &mut World, mut list: Vec<PendingJournal>, answer: Answer) {
    match answer {
        Answer::Recover(journal) => {
            list.retain(|pending| pending.path != journal);
            world.resource_mut::<Recovery>().found = list;
            after_asking(world, FollowUp::Recover(journal));
        }
        Answer::Forget(journal) => {
            list.retain(|pending| pending.path != journal);
            if let Err(error) = RealDisk.remove(&journal) {
                world.write_message(
                    Notice::warning(format!("{} could not be deleted: {error}", journal.display())).named(),
                );
            }
            world.resource_mut::<Recovery>().found = list;
        }
        _ => {
            world.write_message(Notice::info("The unsaved work stays where it is, and is offered again next time"));
        }
    }
}

/// Description in one line of work that can be recovered: its document, its number of edits, and its damage.
pub fn describe(pending: &PendingJournal) -> String {
    let on = match &pending.origin {
        Origin::Bundled(name) => describe_bundled(name),
        Origin::Empty => "an empty rig".to_owned(),
        Origin::Mesh { path, .. } | Origin::Template { path, .. } | Origin::Project { path, .. } => stem(path),
        Origin::Unknown => {
            project_beside(&pending.path).map_or_else(|| "unknown work".to_owned(), |project| stem(&project))
        }
    };
    let edits = counted(pending.changes, "edit", "edits");
    match &pending.condition {
        Condition::Unreadable(error) => format!("{on}: {error}"),
        Condition::Damaged(_) => format!("{on}: {edits}, {}", pending.condition),
        Condition::Whole => format!("{on}: {edits}"),
    }
}

/// True if at least part of the work can be recovered.
pub fn can_recover(pending: &PendingJournal) -> bool {
    !matches!(pending.condition, Condition::Unreadable(_))
}

/// Starts the recovery in the background.
pub(super) fn start(world: &mut World, journal: PathBuf) {
    let task = spawn(move || restore(&journal));
    begin(world, "unsaved work".to_owned(), task);
}

/// Restores the document from its journal.
fn restore(journal: &Path) -> Result<LoadedFile, OpenError> {
    let bytes = read_capped(&RealDisk, journal, MAX_JOURNAL)?;
    let mut recovered = recover(&bytes).map_err(|source| OpenError::Journal { path: journal.to_owned(), source })?;
    if let Some(project) = project_beside(journal).filter(|project| project.is_file()) {
        recovered.assume_project(&project);
    }
    let basis = recovered.basis(hash_of);
    let (mut opened, base) = match (basis, recovered.project()) {
        (Basis::Project { .. } | Basis::Changed, Some(path)) => {
            let mut opened = project(path)?;
            let base = std::mem::take(&mut opened.rig);
            (opened, Some(base))
        }
        // A long journal starts from a rig of its own; everything else is still as the project file says.
        _ => (as_opened(&recovered).unwrap_or_else(|| without_meshes(&recovered)), None),
    };
    add_meshes(&recovered, &mut opened);
    let restored = recovered.restore(basis, base);
    tell_losses(&recovered, &restored, basis, &mut opened);
    set_removed_aside(&recovered, &restored, &mut opened);
    opened.pending = None;
    opened.origin = recovered.origin().clone();
    opened.rig = restored.replayed.rig.clone();
    let rig = opened.rig.uid();
    opened.missing.iter_mut().for_each(|mesh| mesh.rig = rig);
    tell_misfits(&mut opened);
    opened.work = Some(Box::new(Work { recovered, restored, journal: journal.to_owned() }));
    Ok(document(opened))
}

/// Sets the meshes aside that were not in the document when the work ended, for undo and redo.
fn set_removed_aside(recovered: &RecoveredJournal, restored: &RestoredRig, opened: &mut LoadedDocument) {
    let listed = context_of(recovered).meshes;
    let mut is_there: BTreeMap<Uid, bool> = listed.iter().map(|mesh| (mesh.uid, !mesh.is_set_aside)).collect();
    let skipped: BTreeSet<usize> = restored.skipped.iter().map(|skipped| skipped.change).collect();
    let made = if restored.replayed.refused.is_some() { restored.replayed.applied } else { usize::MAX };
    for (number, committed) in recovered.changes().iter().enumerate().take(made) {
        if !skipped.contains(&number) {
            committed.effect().0.iter().for_each(|edit| edit.mesh_changes(&mut is_there));
        }
    }
    let meshes = std::mem::take(&mut opened.meshes).into_iter();
    let stays = |mesh: Uid| is_there.get(&mesh).copied().unwrap_or(true);
    (opened.meshes, opened.set_aside) = meshes.partition(|(mesh, _)| stays(mesh.uid));
    opened.missing.retain(|mesh| stays(mesh.uid));
}

/// The project from which the work started, if its file is as it was then.
fn as_opened(recovered: &RecoveredJournal) -> Option<LoadedDocument> {
    match recovered.origin() {
        Origin::Project { path, hash } if hash_of(path) == Some(*hash) => project(path).ok(),
        _ => None,
    }
}

/// Adds warnings about lost work.
fn tell_losses(recovered: &RecoveredJournal, restored: &RestoredRig, basis: Basis, opened: &mut LoadedDocument) {
    if let Some(reason) = &restored.replayed.refused {
        let total = recovered.changes().len();
        opened.warnings.push(format!(
            "the weights and joints of the last {} of {} could not be made again: {reason}; their journal \
             is kept",
            total - restored.replayed.applied,
            counted(total, "change", "changes")
        ));
    }
    if !recovered.is_damaged() {
        return;
    }
    let (made, records) = (restored.replayed.applied, recovered.records());
    let edits = recovered.changes().len();
    let mut summary = format!(
        "the journal was damaged: {records} could be read, {made} of their {} were made",
        counted(edits, "edit", "edits")
    );
    if records.lost > 0 || !restored.skipped.is_empty() {
        summary.push_str("; look over the rig, the log lists what is missing");
    }
    opened.warnings.push(summary);
    if basis == Basis::Changed {
        opened
            .warnings
            .push("the project is not as it was when the work began, so some of it may be missing".to_owned());
    }
    if basis == Basis::Journal && recovered.base().is_none() {
        opened.warnings.push("the rig that the work started with is lost: what does not need it was made".to_owned());
    }
    let lost_context = recovered.gaps().iter().any(|gap| gap.kind == Some(RecordKind::Context));
    if opened.meshes.is_empty() && basis == Basis::Journal && lost_context {
        opened.warnings.push("the list of open meshes is lost; open the mesh again".to_owned());
    }
    let gaps = recovered.gaps().iter().map(ToString::to_string);
    let skipped = restored.skipped.iter();
    let skipped =
        skipped.map(|skipped| format!("edit {} ({}) is left out: {}", skipped.change + 1, skipped.name, skipped.why));
    let mut lines = gaps.chain(skipped);
    opened.notes.extend(lines.by_ref().take(MAX_TOLD));
    match lines.count() {
        0 => {}
        more => opened.notes.push(format!("and {more} more {}", if more == 1 { "place" } else { "places" })),
    }
}

/// Adds warnings about weights that are of another number of points than their mesh, whose file has changed.
fn tell_misfits(opened: &mut LoadedDocument) {
    for (mesh, _) in &opened.meshes {
        let (bound, points) = (opened.rig.skin(mesh.uid).map(|skin| skin.weights.len()), mesh.rest.points.len());
        if bound.is_some_and(|bound| bound != points) {
            opened.warnings.push(format!(
                "the mesh {:?} has changed since it was bound: it has {} now, for which its weights are not made; \
                 put the former file back and recover again, or bind it anew",
                mesh.file.name,
                counted(points, "point", "points")
            ));
        }
    }
}

/// Name and meshes of the document, as the journal has them.
fn context_of(recovered: &RecoveredJournal) -> Context {
    ron::from_str(recovered.context()).unwrap_or_default()
}

/// An empty rig under the name of the document.
fn without_meshes(recovered: &RecoveredJournal) -> LoadedDocument {
    let context = context_of(recovered);
    let name = match (context.name.is_empty(), recovered.origin().path()) {
        (false, _) => context.name,
        (true, Some(path)) => stem(path),
        (true, None) => "recovered".to_owned(),
    };
    LoadedDocument::named(name, Rig::default())
}

/// Adds the meshes that were open and are not in the document, as in a project that was not saved with them, if they can be
/// opened again.
fn add_meshes(recovered: &RecoveredJournal, opened: &mut LoadedDocument) {
    let mut known: BTreeSet<Uid> = opened.missing.iter().map(|mesh| mesh.uid).collect();
    known.extend(opened.meshes.iter().map(|(mesh, _)| mesh.uid));
    for mesh in context_of(recovered).meshes.into_iter().filter(|mesh| !known.contains(&mesh.uid)) {
        let model = match &mesh.source {
            MeshSource::Bundled(name) => BundledModel::named(name).and_then(BundledModel::read),
            MeshSource::File(path) => load_model(&RealDisk, path).map_err(OpenError::from),
        };
        match model {
            Ok(model) => {
                // A file with another number of nodes is not the one whose nodes became joints.
                let nodes = if mesh.nodes.len() == model.nodes.len() { mesh.nodes } else { Vec::new() };
                opened.meshes.push((RigMesh::new(mesh.uid, model, nodes), mesh.source));
            }
            Err(error) => {
                opened.warnings.push(format!(
                    "a mesh of the project is not there: {error}; the rig was recovered without it; to keep its weights, \
                     put the file back and recover again before you save"
                ));
                // A save goes on to name its file.
                if let MeshSource::File(path) = mesh.source {
                    let shape = MeshShape::Missing { hash: 0, skin: None };
                    let (rig, nodes) = (opened.rig.uid(), mesh.nodes.into());
                    opened.missing.push(MeshToSave { uid: mesh.uid, rig, path, nodes, shape });
                }
            }
        }
    }
}
