//! Files in the window: opening, saving and exporting without loss of work.
//!
//! Files are read and written in the background, from a snapshot or into a document that replaces the open one only
//! when it is complete. Actions that would lose unsaved changes ask first; see [`dialog`] for the questions. Every
//! document has a journal from its first frame; see [`recovery`] for work left by a crash.

mod added_mesh;
mod bundle;
mod clips;
pub mod dialog;
mod dialog_view;
mod document;
mod error;
mod export;
mod file_drop;
mod load_job;
mod open;
mod save;
mod template;
mod view;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use bevy::{
    ecs::system::SystemState,
    prelude::*,
    window::{FileDragAndDrop, PrimaryWindow, RequestRedraw, WindowCloseRequested},
};

pub use self::{
    bundle::{BODY, BUNDLED_MODELS, BundledModel, HEAD},
    document::{MeshSource, OpenDocument, StateFolder},
    export::ExportOptions,
    load_job::LoadJob,
    save::SaveJob,
};
use self::{
    dialog::{Answer, Dialog, DialogAnswer, Purpose, Question},
    document::is_unsaved,
};
use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    camera::FrameWhenReady,
    notice::Notice,
    panel::PanelApp,
    panels::timeline::{
        TimelineRequest,
        import::{ImportRequest, MapRequest},
    },
    recovery,
    settings::EditorSettings,
};
use crate::{
    files::{FileKind, RealDisk, journal::Origin, remove_stale_temps},
    plugins::{RigSystems, document::EditReport, journal::JournalTrouble},
    rig::{Rig, Uid},
};

/// Plugin that opens, saves and exports files.
pub struct FilesPlugin;

impl Plugin for FilesPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<OpenRequest>()
            .add_message::<DialogAnswer>()
            .add_message::<DocumentLanded>()
            .add_message::<ActionRequest>()
            .add_message::<Notice>()
            .add_message::<JournalTrouble>()
            .add_message::<ImportRequest>()
            .add_message::<TimelineRequest>()
            .add_message::<MapRequest>()
            .add_message::<ExportRequest>()
            .add_message::<RemoveMeshRequest>()
            .add_message::<EditReport>()
            .add_message::<WindowCloseRequested>()
            .add_message::<FileDragAndDrop>()
            .init_resource::<LoadJob>()
            .init_resource::<SaveJob>()
            .init_resource::<Dialog>()
            .init_resource::<ExportOptions>()
            .init_resource::<StateFolder>()
            .init_resource::<recovery::Recovery>()
            .init_resource::<EditorSettings>()
            .init_resource::<FrameWhenReady>()
            .add_overlay(dialog_view::DialogView::default())
            .add_systems(Startup, (recovery::look, clear_leftovers).chain())
            .add_systems(Update, attend.before(RigSystems::Script));
    }
}

/// Request to open a document in place of the open one. A mesh without joints comes to an open rig that has no mesh.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub enum OpenRequest {
    /// The bundled character.
    Bundled,
    /// A bundled mesh, by name.
    Model(String),
    /// A bundled template, by name.
    Template(String),
    /// An empty rig without a mesh.
    Empty,
    /// A mesh, a template or a project.
    File(PathBuf),
    /// Several files as one document: the first as if it were alone, and once it is there, the others one after the other,
    /// meshes beside those that are open.
    Files {
        /// File that is opened first.
        first: PathBuf,
        /// Files that come to it, in order.
        others: Vec<PathBuf>,
    },
}

impl OpenRequest {
    /// Start of the document that a bundled template becomes.
    pub(super) fn origin_of_template(name: &str) -> Origin {
        Origin::Bundled(format!("{name} template"))
    }
}

/// Message that a document has taken the place of the open one, a template has been put onto the open mesh, or a mesh has come
/// to the open rig.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct DocumentLanded {
    /// Start of the document; a template on an open mesh and a mesh of an open rig have none of their own.
    pub origin: Origin,
}

/// Request to export to a file, as its ending says; a file that is there is replaced.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct ExportRequest(pub PathBuf);

/// Request to remove a mesh, by its uid, from the open rig; its file stays.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct RemoveMeshRequest(pub Uid);

/// Action that follows once unsaved changes are saved or discarded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FollowUp {
    /// Opens another document.
    Open(OpenRequest),
    /// Replaces the document by the one that was loaded in the meantime and is held.
    Land,
    /// Recovers a crashed session's work from its journal.
    Recover(PathBuf),
    /// Closes the window.
    Quit,
}

/// Parts shared with [`recovery`] and [`render_errors`](super::render_errors).
pub(super) mod loading {
    pub(in crate::editor) use super::{
        bundle::{BundledModel, describe as describe_bundled, template as bundled_template},
        document::{Context, MeshSource, places},
        error::{OpenError, WriteError},
        open::{LoadedDocument, LoadedFile, Work, begin, document, hash_of, project, spawn},
        save::{place_bundled, settled, snapshot},
        template::replacing,
    };
}

type Inbox<'w, 's> = (
    MessageReader<'w, 's, OpenRequest>,
    MessageReader<'w, 's, ActionRequest>,
    MessageReader<'w, 's, DialogAnswer>,
    MessageReader<'w, 's, WindowCloseRequested>,
    MessageReader<'w, 's, FileDragAndDrop>,
    MessageReader<'w, 's, JournalTrouble>,
    MessageReader<'w, 's, ExportRequest>,
    MessageReader<'w, 's, RemoveMeshRequest>,
    MessageReader<'w, 's, EditReport>,
);

/// Handles all file actions before this frame's edits, so that the saved state and the journal's count agree.
pub(super) fn attend(world: &mut World, inbox: &mut SystemState<Inbox<'static, 'static>>) {
    let open = active(world);
    let Ok((
        mut opens,
        mut actions,
        mut answers,
        mut closes,
        mut drops,
        mut troubles,
        mut exports,
        mut removals,
        mut reports,
    )) = inbox.get_mut(world)
    else {
        return;
    };
    let mut opens: Vec<OpenRequest> = opens.read().cloned().collect();
    let mut actions: Vec<Action> = actions.read().map(|request| request.0).collect();
    let answers: Vec<Answer> = answers.read().map(|answer| answer.0.clone()).collect();
    actions.extend(closes.read().map(|_| Action::Quit));
    let dropped = drops.read().filter_map(|drop| match drop {
        FileDragAndDrop::DroppedFile { path_buf, .. } => Some(path_buf.clone()),
        _ => None,
    });
    let dropped: Vec<PathBuf> = dropped.collect();
    let troubles: Vec<JournalTrouble> = troubles.read().cloned().collect();
    let exports: Vec<PathBuf> = exports.read().map(|request| request.0.clone()).collect();
    let removals: Vec<Uid> = removals.read().map(|request| request.0).collect();
    let mut changed_meshes: BTreeMap<Uid, bool> = BTreeMap::new();
    for EditReport { committed, .. } in reports.read().filter(|report| Some(report.rig) == open) {
        let edits = committed.iter().flat_map(|committed| committed.effect().0);
        edits.for_each(|edit| edit.mesh_changes(&mut changed_meshes));
    }
    added_mesh::follow(world, &changed_meshes);
    opens.extend(file_drop::requests(world, dropped));
    for trouble in troubles {
        world.write_message(match trouble.reason {
            Some(reason) => Notice::warning(reason.to_string()),
            None => Notice::done("Changes are kept safe again"),
        });
    }
    for answer in answers {
        let question = world.resource_mut::<Dialog>().take();
        if let Some(question) = question {
            dialog_answered(world, question, answer);
        }
    }
    for request in opens {
        request_open(world, request);
    }
    for path in exports {
        save::to(world, Purpose::Export, path, None);
    }
    for mesh in removals {
        added_mesh::remove(world, mesh);
    }
    for action in actions {
        act(world, action);
    }
    save::poll(world);
    open::poll(world);
    file_drop::open_next(world);
    recovery::poll(world);
    document::watch_places(world);
    show_title(world);
    let busy = world.resource::<LoadJob>().name().is_some()
        || world.resource::<SaveJob>().name().is_some()
        || world.resource::<recovery::Recovery>().is_looking();
    if busy && let Some(mut redraw) = world.get_resource_mut::<Messages<RequestRedraw>>() {
        redraw.write(RequestRedraw);
    }
}

/// Removes files that interrupted saves left in the folders where the editor saves.
fn clear_leftovers(settings: Res<EditorSettings>, state: Res<StateFolder>) {
    let recent = settings.recent.iter().filter_map(|path| path.parent());
    let folders: BTreeSet<PathBuf> = recent.map(Path::to_path_buf).chain(state.0.clone()).collect();
    let task = open::spawn(move || {
        for folder in folders {
            match remove_stale_temps(&RealDisk, &folder) {
                Ok(0) => {}
                Ok(count) => info!("removed {count} unfinished files from {}", folder.display()),
                // A recent folder may no longer exist.
                Err(error) => debug!("{} cannot be looked through: {error}", folder.display()),
            }
        }
    });
    task.detach();
}

/// The open document's entity.
fn active(world: &World) -> Option<Entity> {
    world.get_resource::<ActiveRig>().map(|rig| rig.0).filter(|rig| world.get::<OpenDocument>(*rig).is_some())
}

/// Name of a file, for people.
fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

fn act(world: &mut World, action: Action) {
    match action {
        Action::New => request_open(world, OpenRequest::Empty),
        Action::Open => world.resource_mut::<Dialog>().ask(Question::Open),
        Action::AddMesh => world.resource_mut::<Dialog>().ask(Question::Mesh),
        Action::Save => save(world, None),
        Action::SaveAs => ask_path(world, Purpose::Save, None),
        Action::Export => ask_path(world, Purpose::Export, None),
        Action::Quit => after_asking(world, FollowUp::Quit),
        _ => {}
    }
}

/// Opens a document; asks about unsaved changes first if it would replace the open one.
fn request_open(world: &mut World, request: OpenRequest) {
    if let OpenRequest::File(path) | OpenRequest::Files { first: path, .. } = &request {
        if matches!(FileKind::of(path), Some(FileKind::Bvh | FileKind::PackedClips | FileKind::Animation))
            && has_joints(world)
        {
            // Motion is no document; it is put onto the open rig.
            world.write_message(ImportRequest(path.clone()));
            return;
        }
        if let Err(error) = open::recognise(path) {
            world.write_message(Notice::error(error.to_string()));
            if active(world).is_none() && world.resource::<LoadJob>().name().is_none() {
                // The first file that the window was to open.
                open::start(world, OpenRequest::Empty);
            }
            return;
        }
        if open::is_rig_file(path) && template::has_mesh(world) {
            // A template is put onto the open mesh as one step, which can be undone, so no question is asked.
            open::start(world, request);
            return;
        }
        if added_mesh::is_mesh_file(path) && added_mesh::is_awaited(world) {
            // The mesh comes to the rig. Only one with joints of its own would take the rig's place, and is asked about then.
            open::start(world, request);
            world.resource_mut::<LoadJob>().ask_later();
            return;
        }
    }
    after_asking(world, FollowUp::Open(request));
}

/// Reads a mesh to put it beside those of the open rig.
fn request_mesh(world: &mut World, path: PathBuf) {
    if !added_mesh::is_mesh_file(&path) {
        let name = file_name(&path);
        let text = format!("{name} is no mesh; choose an .obj, .gltf, .glb or .vrm");
        world.write_message(Notice::error(text).named());
        return;
    }
    open::start(world, OpenRequest::File(path));
    world.resource_mut::<LoadJob>().add_to_open();
}

fn has_joints(world: &World) -> bool {
    active(world).and_then(|rig| world.get::<Rig>(rig)).is_some_and(|rig| !rig.is_empty())
}

/// Proceeds at once if no unsaved changes would be lost; otherwise asks.
pub(super) fn after_asking(world: &mut World, then: FollowUp) {
    match active(world).filter(|rig| is_unsaved(world, *rig)) {
        Some(rig) => {
            let name = world.get::<OpenDocument>(rig).map(|document| document.name.clone()).unwrap_or_default();
            world.resource_mut::<Dialog>().ask(Question::Unsaved { name, then });
        }
        None => proceed(world, then),
    }
}

/// Proceeds; unsaved changes are discarded.
fn proceed(world: &mut World, then: FollowUp) {
    match then {
        FollowUp::Open(request) => open::start(world, request),
        FollowUp::Land => open::land_held(world),
        FollowUp::Recover(journal) => recovery::start(world, journal),
        FollowUp::Quit => quit(world),
    }
}

/// Ends the journal, so that no recovery is offered the next time, and closes the window.
fn quit(world: &mut World) {
    if world.resource_mut::<SaveJob>().wait_for(FollowUp::Quit) {
        return;
    }
    document::close_journal(world, true);
    world.write_message(AppExit::Success);
}

/// Saves the project to its file, or asks for one.
fn save(world: &mut World, then: Option<FollowUp>) {
    let Some(rig) = active(world) else { return };
    match world.get::<OpenDocument>(rig).and_then(|document| document.project.clone()) {
        Some(path) => save::project(world, path, then),
        None => ask_path(world, Purpose::Save, then),
    }
}

/// Asks for a path to write to.
pub(in crate::editor) fn ask_path(world: &mut World, purpose: Purpose, then: Option<FollowUp>) {
    let Some(rig) = active(world) else { return };
    let suggestion = save::suggestion(world, rig, purpose);
    world.resource_mut::<Dialog>().ask(Question::Path { purpose, suggestion, then });
}

fn dialog_answered(world: &mut World, question: Question, answer: Answer) {
    match (question, answer) {
        (Question::Unsaved { then, .. }, Answer::Save) => save(world, Some(then)),
        (Question::Unsaved { then, .. }, Answer::Discard) => proceed(world, then),
        (Question::Unsaved { then: FollowUp::Land, .. }, _) => open::drop_held(world),
        (Question::Open, Answer::Path(path)) => request_open(world, OpenRequest::File(path)),
        (Question::Mesh, Answer::Path(path)) => request_mesh(world, path),
        (Question::Motion, Answer::Path(path)) => {
            world.write_message(ImportRequest(path));
        }
        (Question::JointMap, Answer::Path(path)) => {
            world.write_message(MapRequest::File(path));
        }
        (Question::Path { purpose, suggestion, then }, Answer::Path(path)) => {
            let path = save::completed(&path, purpose);
            let known = active(world).and_then(|rig| world.get::<OpenDocument>(rig)?.project.clone());
            if path.parent().is_none_or(|folder| !folder.is_dir()) {
                let folder = path.parent().map(|folder| folder.display().to_string()).unwrap_or_default();
                world.write_message(Notice::error(format!(
                    "There is no folder {folder}; create it first, or choose another place"
                )));
                world.resource_mut::<Dialog>().ask(Question::Path { purpose, suggestion: path, then });
            } else if path.exists() && known.as_ref() != Some(&path) {
                let _ = suggestion;
                world.resource_mut::<Dialog>().ask(Question::Replace { purpose, path, then });
            } else {
                save::to(world, purpose, path, then);
            }
        }
        (Question::Replace { purpose, path, then }, Answer::Save) => save::to(world, purpose, path, then),
        (Question::Replace { purpose, path, then }, _) => {
            world.resource_mut::<Dialog>().ask(Question::Path { purpose, suggestion: path, then });
        }
        (Question::Fit(fit), Answer::Fit) => template::put(world, &fit, fit.ratio()),
        (Question::Fit(fit), Answer::AsItIs) => template::put(world, &fit, 1.0),
        (Question::Recover(list), answer) => recovery::answered(world, list, answer),
        (Question::Path { then: Some(FollowUp::Land), .. }, _) => open::drop_held(world),
        _ => {}
    }
}

/// Sets the title to `name* - Rigsmith`, with the star while there are unsaved changes.
fn show_title(world: &mut World) {
    let mut windows = world.query_filtered::<&mut Window, With<PrimaryWindow>>();
    if windows.iter(world).next().is_none() {
        return;
    }
    let title = title(world);
    if let Ok(mut window) = windows.single_mut(world)
        && window.title != title
    {
        window.title = title;
    }
}

/// Title of the window.
pub fn title(world: &World) -> String {
    let Some(rig) = active(world) else { return "Rigsmith".to_owned() };
    let name = world.get::<OpenDocument>(rig).map(|document| document.name.as_str()).unwrap_or_default();
    let star = if is_unsaved(world, rig) { "*" } else { "" };
    format!("{name}{star} - Rigsmith")
}

/// Returns `true` if the open document has changes that are in no file.
pub fn has_unsaved_changes(world: &World) -> bool {
    active(world).is_some_and(|rig| is_unsaved(world, rig))
}
