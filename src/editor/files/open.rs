//! Opening in the background; the open document stays until the next one is complete.

use std::path::{Path, PathBuf};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    DocumentLanded, FollowUp, OpenRequest, active, added_mesh,
    bundle::{self, BundledModel},
    dialog::{Dialog, Question},
    document::{
        Context, ContextMesh, MeshSource, OpenDocument, SavedAt, close_journal, disk, is_same, is_unsaved, last_step,
        places,
    },
    error::OpenError,
    file_name,
    load_job::{HeldDocument, Job, LoadJob},
    template, view,
};
use crate::{
    editor::{
        ActiveRig, camera::FrameWhenReady, counts::counted, notice::Notice, recovery::Recovery, render_errors::watched,
        settings::EditorSettings,
    },
    files::{
        Disk, FileKind, LoadError, LoadedMesh, MeshState, MeshToSave, ProjectNote, RealDisk, TemplateBase,
        journal::{
            Journal, JournalStart, Origin, PendingJournal, RecoveredJournal, RestoredRig, ResumedJournal, file_hash,
            journal_beside, pending_journal,
        },
        load_model, load_project, load_rig_text, load_template, read_capped, stem,
    },
    mesh::model::Model,
    plugins::{
        history::RigHistory,
        journal::replayed_bundle,
        limits::{Limit, RigLimits},
        selection::Selection,
        surface::{RigMesh, SkinOf},
    },
    rig::{
        Rig, RigEdit, Uid, UidSource,
        animation::file_clip::rig_clips,
        character::{import_rig_text, import_skeleton},
        project::ProjectView,
    },
};

/// Largest number of bytes of a file that are hashed.
const MAX_HASHED: u64 = 1 << 30;

/// Result of opening a file.
pub(in crate::editor) enum LoadedFile {
    /// A document that replaces the open one.
    Document(Box<LoadedDocument>),
    /// A rig: for the open mesh, or a document of its own.
    Template(Box<LoadedDocument>),
}

/// A loaded document.
pub(in crate::editor) struct LoadedDocument {
    pub name: String,
    pub rig: Rig,
    pub meshes: Vec<(RigMesh, MeshSource)>,
    pub missing: Vec<MeshToSave>,
    /// Meshes of recovered work that undo and redo bring back.
    pub set_aside: Vec<(RigMesh, MeshSource)>,
    pub view: Option<ProjectView>,
    pub project: Option<std::path::PathBuf>,
    /// Template that the rig of a project follows, and the version that it took over last.
    pub followed: Option<(std::path::PathBuf, TemplateBase)>,
    pub origin: Origin,
    pub notes: Vec<String>,
    /// Facts that people should look after.
    pub warnings: Vec<String>,
    /// Recovered work after a crash.
    pub work: Option<Box<Work>>,
    /// Journal left by a crash beside the project.
    pub pending: Option<PendingJournal>,
}

/// Recovered work.
pub(in crate::editor) struct Work {
    pub recovered: RecoveredJournal,
    pub restored: RestoredRig,
    pub journal: std::path::PathBuf,
}

impl LoadedDocument {
    pub fn named(name: impl Into<String>, rig: Rig) -> Self {
        Self {
            name: name.into(),
            rig,
            meshes: Vec::new(),
            missing: Vec::new(),
            set_aside: Vec::new(),
            view: None,
            project: None,
            followed: None,
            origin: Origin::Empty,
            notes: Vec::new(),
            warnings: Vec::new(),
            work: None,
            pending: None,
        }
    }

    fn model(model: Model, source: MeshSource, origin: Origin, uids: &mut UidSource) -> Self {
        let uid = uids.next_uid();
        let skeleton = import_skeleton(&model, uids);
        let mut edits = skeleton.edits;
        edits.extend(skeleton.skin.map(|skin| RigEdit::SetSkin(uid, Some(skin))));
        let mut opened = Self::named(&model.name, Rig::new(uids.next_uid(), &model.name));
        opened.notes.clone_from(&model.notes);
        for edit in &edits {
            opened.warnings.extend(opened.rig.apply(edit).err().map(|error| error.to_string()));
        }
        let joints: Vec<Option<Uid>> = skeleton.nodes.iter().copied().map(Some).collect();
        for clip in rig_clips(&opened.rig, &model, &joints) {
            let added = opened.rig.apply(&RigEdit::AddClip(Box::new(clip), usize::MAX));
            opened.warnings.extend(added.err().map(|error| error.to_string()));
        }
        opened.meshes.push((RigMesh::new(uid, model, skeleton.nodes), source));
        Self { origin, ..opened }
    }
}

/// Returns an error if a file's name already shows that it cannot be opened.
pub(super) fn recognise(path: &Path) -> Result<(), OpenError> {
    let name = || file_name(path);
    match FileKind::of(path) {
        Some(FileKind::Obj | FileKind::Gltf | FileKind::Glb | FileKind::Vrm) => Ok(()),
        Some(FileKind::RigText | FileKind::Template | FileKind::Project) => Ok(()),
        Some(FileKind::Skin) => Err(OpenError::WeightsAlone { name: name() }),
        Some(FileKind::Gestures) => Err(OpenError::Gestures { name: name() }),
        Some(FileKind::Animation) => Err(OpenError::ClipsAlone { name: name() }),
        Some(FileKind::Bvh | FileKind::PackedClips) => Err(OpenError::MotionAlone { name: name() }),
        None => Err(OpenError::Unknown { name: name() }),
    }
}

/// Returns `true` for files that hold a rig without a mesh.
pub(super) fn is_rig_file(path: &Path) -> bool {
    matches!(FileKind::of(path), Some(FileKind::Template | FileKind::RigText))
}

/// Starts opening in the background; a previous attempt is dropped.
pub(super) fn start(world: &mut World, request: OpenRequest) {
    let mut uids = UidSource::seeded(world.resource_mut::<UidSource>().next_uid().0);
    let mut behind = Vec::new();
    let (name, task) = match request {
        OpenRequest::Bundled => model(bundle::BODY.to_owned(), uids),
        OpenRequest::Model(name) => model(name, uids),
        OpenRequest::Template(name) => {
            (format!("the bundled {name} template"), spawn(move || template_document(&name)))
        }
        OpenRequest::Empty => {
            let open = move || Ok(document(LoadedDocument::named("untitled", Rig::new(uids.next_uid(), "untitled"))));
            ("an empty rig".to_owned(), spawn(open))
        }
        OpenRequest::File(path) => file_task(world, path, uids),
        OpenRequest::Files { first, others } => {
            behind = others;
            file_task(world, first, uids)
        }
    };
    begin(world, name, task);
    if let Some(job) = &mut world.resource_mut::<LoadJob>().job {
        job.behind = behind;
    }
}

/// Starts to read a file.
fn file_task(world: &World, path: PathBuf, mut uids: UidSource) -> (String, Task<Result<LoadedFile, OpenError>>) {
    let path = std::path::absolute(&path).unwrap_or(path);
    let limits = world.get_resource::<RigLimits>().cloned().unwrap_or_default();
    (file_name(&path), spawn(move || limited_file(&path, &mut uids, &limits)))
}

/// Registers `task` as the document that is being opened.
pub(in crate::editor) fn begin(world: &mut World, name: String, task: Task<Result<LoadedFile, OpenError>>) {
    let confirmed = active(world).and_then(|rig| last_step(world, rig));
    let mut loading = world.resource_mut::<LoadJob>();
    loading.job = Some(Job { name, task, confirmed, asks: false, adds: false, behind: Vec::new() });
    loading.held = None;
    loading.further.clear();
}

/// Runs long work on a background thread.
pub(in crate::editor) fn spawn<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Task<T> {
    AsyncComputeTaskPool::get().spawn(async move { work() })
}

pub(in crate::editor) fn document(opened: LoadedDocument) -> LoadedFile {
    LoadedFile::Document(Box::new(opened))
}

/// Starts to read a bundled mesh.
fn model(name: String, mut uids: UidSource) -> (String, Task<Result<LoadedFile, OpenError>>) {
    let about = bundle::describe(&name);
    let open = move || {
        let model = BundledModel::named(&name)?.read()?;
        let (source, origin) = (MeshSource::Bundled(name.clone()), Origin::Bundled(name));
        Ok(document(LoadedDocument::model(model, source, origin, &mut uids)))
    };
    (about, spawn(open))
}

/// Reads a bundled template, as a document of its own.
fn template_document(name: &str) -> Result<LoadedFile, OpenError> {
    let mut opened = LoadedDocument::named(name, bundle::template(name)?);
    opened.origin = OpenRequest::origin_of_template(name);
    Ok(document(opened))
}

/// Hash of a file's bytes; `None` if it cannot be read.
pub(in crate::editor) fn hash_of(path: &Path) -> Option<u64> {
    read_capped(&RealDisk, path, MAX_HASHED).ok().map(|bytes| file_hash(&bytes))
}

/// Opens a file that holds no more than the limits allow.
fn limited_file(path: &Path, uids: &mut UidSource, limits: &RigLimits) -> Result<LoadedFile, OpenError> {
    let opened = file(path, uids)?;
    let (LoadedFile::Document(inside) | LoadedFile::Template(inside)) = &opened;
    let name = file_name(path);
    for (mesh, _) in &inside.meshes {
        limits.check_model(&name, &mesh.file)?;
    }
    limits.check_rig(&name, &inside.rig)?;
    Ok(opened)
}

fn file(path: &Path, uids: &mut UidSource) -> Result<LoadedFile, OpenError> {
    let origin_of = |path: &Path| (path.to_owned(), hash_of(path).unwrap_or_default());
    match FileKind::of(path) {
        Some(FileKind::Project) => Ok(document(project(path)?)),
        Some(FileKind::Template) => {
            let template = load_template(&RealDisk, path)?;
            let (path, hash) = origin_of(path);
            let mut opened = LoadedDocument::named(stem(&path), template.rig);
            opened.notes = template.notes;
            opened.origin = Origin::Template { path, hash };
            Ok(LoadedFile::Template(Box::new(opened)))
        }
        Some(FileKind::RigText) => {
            let text = load_rig_text(&RealDisk, path)?;
            text.check_ways().map_err(|source| LoadError::RigText { path: path.into(), source })?;
            let (path, hash) = origin_of(path);
            let mut opened = LoadedDocument::named(stem(&path), Rig::new(uids.next_uid(), stem(&path)));
            for edit in &import_rig_text(&text, uids).0 {
                opened.rig.apply(edit)?;
            }
            opened.origin = Origin::Template { path, hash };
            Ok(LoadedFile::Template(Box::new(opened)))
        }
        _ => {
            let model = load_model(&RealDisk, path)?;
            let (path, hash) = origin_of(path);
            let source = MeshSource::File(path.clone());
            Ok(document(LoadedDocument::model(model, source, Origin::Mesh { path, hash }, uids)))
        }
    }
}

/// Opens a project; if it has several rigs, the first.
pub(in crate::editor) fn project(path: &Path) -> Result<LoadedDocument, OpenError> {
    let hash = hash_of(path).unwrap_or_default();
    let loaded = load_project(&RealDisk, path)?;
    let (serious, notes): (Vec<_>, Vec<_>) = loaded.notes.into_iter().partition(ProjectNote::is_serious);
    let mut rigs = loaded.rigs.into_iter();
    let rig = rigs.next().ok_or_else(|| OpenError::NoRig(path.to_owned()))?;
    if rigs.next().is_some() {
        return Err(OpenError::SeveralRigs(path.to_owned()));
    }
    let followed = loaded.templates.into_iter().find(|template| template.rig == rig.uid());
    let mut opened = LoadedDocument::named(stem(path), rig);
    opened.followed = followed.map(|template| (template.path, template.base));
    for LoadedMesh { uid, rig, path, nodes, shape } in loaded.meshes {
        match shape {
            MeshState::Open { model, .. } => {
                opened.meshes.push((RigMesh::new(uid, *model, nodes.to_vec()), MeshSource::File(path)));
            }
            MeshState::Missing { shape, .. } => opened.missing.push(MeshToSave { uid, rig, path, nodes, shape }),
        }
    }
    opened.notes = notes.iter().map(ToString::to_string).collect();
    opened.warnings = serious.iter().map(ToString::to_string).collect();
    opened.view = Some(loaded.view);
    opened.project = Some(path.to_owned());
    opened.origin = Origin::Project { path: path.to_owned(), hash };
    opened.pending = pending_journal(&RealDisk as &dyn Disk, &journal_beside(path));
    Ok(opened)
}

/// Takes over finished documents.
pub(super) fn poll(world: &mut World) {
    if world.resource::<Recovery>().is_looking() {
        // A journal that begins during the search could be taken for one left by a crash.
        return;
    }
    let mut loading = world.resource_mut::<LoadJob>();
    let Some(job) = &mut loading.bypass_change_detection().job else { return };
    let Some(result) = check_ready(&mut job.task) else { return };
    let Some(Job { name, confirmed, asks, adds, behind, .. }) = loading.job.take() else { return };
    let has_more = !behind.is_empty();
    if result.is_ok() {
        loading.further.extend(behind);
    }
    match result {
        Err(error) => {
            world.write_message(Notice::error(format!("Could not open {name}: {error}")));
            if has_more {
                world.write_message(Notice::info(format!("The files beside {name} were not opened, either")));
            }
            if active(world).is_none() {
                start(world, OpenRequest::Empty);
            }
        }
        Ok(LoadedFile::Template(opened)) if template::has_mesh(world) => template::consider(world, *opened),
        Ok(LoadedFile::Document(opened)) if adds && active(world).is_some() => added_mesh::add(world, &name, *opened),
        Ok(LoadedFile::Document(opened)) if added_mesh::is_alone(&opened) && added_mesh::is_awaited(world) => {
            added_mesh::put(world, &name, *opened);
        }
        Ok(LoadedFile::Document(opened) | LoadedFile::Template(opened)) => {
            let is_settled = |rig: Entity| !asks && is_same(&last_step(world, rig), &confirmed);
            let changed = active(world)
                .filter(|rig| is_unsaved(world, *rig) && !is_settled(*rig))
                .and_then(|rig| world.get::<OpenDocument>(rig));
            match changed.map(|document| document.name.clone()) {
                Some(document) => {
                    let mut loading = world.resource_mut::<LoadJob>();
                    let further = std::mem::take(&mut loading.further);
                    loading.held = Some(HeldDocument { name, opened, further });
                    world.resource_mut::<Dialog>().ask(Question::Unsaved { name: document, then: FollowUp::Land });
                }
                None => land(world, &name, *opened),
            }
        }
    }
}

/// Takes over the held document; the open one may be lost.
pub(super) fn land_held(world: &mut World) {
    let held = world.resource_mut::<LoadJob>().held.take();
    if let Some(HeldDocument { name, opened, further }) = held {
        land(world, &name, *opened);
        world.resource_mut::<LoadJob>().further = further;
    }
}

/// Drops the held document.
pub(super) fn drop_held(world: &mut World) {
    world.resource_mut::<LoadJob>().held = None;
}

fn land(world: &mut World, name: &str, opened: LoadedDocument) {
    let LoadedDocument {
        name: title,
        rig,
        meshes,
        missing,
        set_aside,
        view: kept,
        project,
        followed,
        origin,
        notes,
        mut warnings,
        work,
        pending,
    } = opened;
    if let Some(old) = world.get_resource::<ActiveRig>().map(|rig| rig.0) {
        // The next journal may be at the same place.
        let same = project.is_some() && world.get::<OpenDocument>(old).is_some_and(|old| old.project == project);
        close_journal(world, same);
        world.despawn(old);
    }
    if let Some(path) = origin.path() {
        world.resource_mut::<EditorSettings>().remember(path.to_owned());
    }
    let clips = if matches!(origin, Origin::Mesh { .. }) { rig.clips().len() } else { 0 };
    let listed = meshes.iter().map(|(mesh, source)| ContextMesh::of(mesh, source, false));
    let listed = listed.chain(set_aside.iter().map(|(mesh, source)| ContextMesh::of(mesh, source, true)));
    let context = Context { name: title.clone(), meshes: listed.collect() };
    world.write_message(DocumentLanded { origin: origin.clone() });
    // A journal left by a crash beside the project stays there until a person decides about it.
    let places = places(world, project.clone().filter(|_| pending.is_none()));
    let (is_recovered, is_project) = (work.is_some(), project.is_some());
    let opened = work.as_ref().map_or(&origin, |work| work.recovered.origin());
    let (template, base) = match (opened, followed) {
        (Origin::Template { path, .. }, _) => (Some(path.clone()), None),
        (_, Some((path, base))) => (Some(path), Some(base)),
        _ => (None, None),
    };
    let (bundle, journal) = match work {
        Some(work) => {
            let ResumedJournal { journal, kept } =
                Journal::resume(disk(), places, &work.recovered, &work.restored, &work.journal);
            warnings.extend(kept.map(|kept| format!("the former journal is kept as `{}`", kept.display())));
            journal.context(context.text());
            (replayed_bundle(&work.restored.replayed), journal)
        }
        None => {
            let (base, saved_rig) =
                if project.is_some() { (None, Some(rig.clone())) } else { (Some(rig.clone()), None) };
            let start = JournalStart { places, origin, rig: base, context: context.text(), saved_rig };
            ((rig, Selection::default(), RigHistory::default()), Journal::start(disk(), start))
        }
    };
    let sink = watched(journal.clone());
    let saved = if is_recovered { SavedAt::Nowhere } else { SavedAt::Step(None) };
    let document = OpenDocument {
        name: title.clone(),
        project,
        template,
        base,
        saved,
        journal,
        missing,
        set_aside,
        is_placed: false,
    };
    let entity = world.spawn((bundle, sink, document)).id();
    for (mesh, source) in meshes {
        world.spawn((mesh, source, SkinOf(entity)));
    }
    world.insert_resource(ActiveRig(entity));
    view::show_all(world);
    view::leave_weights(world, entity);
    if is_project {
        view::open_clip(world, entity, kept.as_ref());
    }
    let restored = kept.is_some_and(|kept| view::restore(world, &kept));
    world.resource_mut::<FrameWhenReady>().0 = !restored;
    world.write_message(match is_recovered {
        true => Notice::done(format!("Recovered {title}; save it to keep it")),
        false if clips > 0 => {
            let clips = counted(clips, "clip", "clips");
            Notice::done(format!("Opened {name} with {clips}, which the Timeline has")).at("Timeline")
        }
        false => Notice::done(format!("Opened {name}")),
    });
    for warning in warnings {
        world.write_message(Notice::warning(warning));
    }
    let most = world.get_resource::<RigLimits>().cloned().unwrap_or_default().most(Limit::Notes);
    let more = notes.len().saturating_sub(most);
    for note in notes.into_iter().take(most) {
        world.write_message(Notice::info(note).quiet());
    }
    if more > 0 {
        let are = counted(more, "more note is", "more notes are");
        let text = format!("{are} left out; --limit notes=N tells more");
        world.write_message(Notice::info(text).quiet());
    }
    if let Some(pending) = pending {
        world.resource_mut::<Recovery>().offer(pending);
    }
}
