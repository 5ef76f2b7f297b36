//! Saving and exporting, in the background, from a snapshot of the document.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bevy::{
    prelude::*,
    tasks::{Task, futures::check_ready},
};

use super::{
    FollowUp, active, after_asking,
    bundle::{BODY, BundledModel},
    dialog::Purpose,
    document::{MeshSource, OpenDocument, SavedAt, context, last_step, meshes, places},
    error::WriteError,
    export, file_name,
    open::spawn,
    view,
};
use crate::{
    editor::{
        notice::Notice,
        panels::timeline::{
            Timeline,
            import::{ClipImport, MapRequest},
        },
        settings::EditorSettings,
    },
    files::{
        Disk, FileKind, LoadError, MeshShape, MeshToSave, ProjectTemplate, ProjectToSave, RealDisk, StopSign,
        StoppableDisk,
        journal::{Journal, SaveMark},
        project_files, read_capped, save_atomic, save_set, stem,
    },
    instance::RigSource,
    plugins::history::RigHistory,
    rig::{
        Rig, Uid,
        animation::{NodeNames, RigClip},
        step::Step,
    },
};

/// Document that is being saved.
#[derive(Resource, Default)]
pub struct SaveJob {
    job: Option<Job>,
    waiting: VecDeque<(Purpose, PathBuf, Option<FollowUp>)>,
}

impl SaveJob {
    /// Name of the file that is being saved.
    pub fn name(&self) -> Option<&str> {
        self.job.as_ref().map(|job| job.name.as_str())
    }

    /// Has the writing stopped; the file stays as it was, unless it is replaced already.
    pub(in crate::editor) fn stop(&self) {
        if let Some(job) = &self.job {
            job.sign.stop();
        }
    }

    /// Takes a job up, while there is no other.
    pub(super) fn begin(&mut self, job: Job) {
        self.job = Some(job);
    }

    /// Lets a file wait until the current one is saved.
    pub(super) fn queue(&mut self, purpose: Purpose, path: PathBuf, then: Option<FollowUp>) {
        self.waiting.push_back((purpose, path, then));
    }

    /// Schedules `then` after the current saving; returns `false` if nothing is being saved.
    pub(super) fn wait_for(&mut self, then: FollowUp) -> bool {
        let Some(job) = &mut self.job else { return false };
        match self.waiting.back_mut() {
            Some((_, _, last)) => *last = Some(then),
            None => job.then = Some(then),
        }
        true
    }
}

pub(super) struct Job {
    pub name: String,
    pub rig: Entity,
    /// Last step in the snapshot.
    pub step: Option<Arc<Step>>,
    pub task: Task<Result<SavedContent, WriteError>>,
    /// Wish to stop.
    pub sign: StopSign,
    pub then: Option<FollowUp>,
}

/// Content that was written.
pub(super) enum SavedContent {
    Project {
        mark: SaveMark,
        notes: Vec<String>,
        bundled: Option<PathBuf>,
    },
    /// Export; `template` is the rig and its file, if that is the template that was opened, or the first one of a rig that
    /// has come from none.
    Export {
        /// Content that Rigsmith's own reader finds in the file.
        checked: Result<String, LoadError>,
        notes: Vec<String>,
        template: Option<(PathBuf, Arc<Rig>)>,
    },
}

/// Initial path in the dialog.
pub(super) fn suggestion(world: &World, rig: Entity, purpose: Purpose) -> PathBuf {
    let Some(document) = world.get::<OpenDocument>(rig) else { return PathBuf::new() };
    let beside = meshes(world, rig).into_iter().find_map(|(_, _, source)| match source {
        Some(MeshSource::File(path)) => path.parent().map(Path::to_path_buf),
        _ => None,
    });
    let folder = document.project.as_ref().and_then(|project| project.parent().map(Path::to_path_buf)).or(beside);
    let folder = folder.or_else(|| std::env::current_dir().ok()).unwrap_or_default();
    match (purpose, &document.project) {
        (Purpose::Save, Some(project)) => project.clone(),
        (Purpose::Save, None) => folder.join(format!("{}.rigsmith.ron", document.name)),
        (Purpose::Export, _) => folder.join(format!("{}.glb", document.name)),
        (Purpose::JointMap, _) => {
            let draft = world.get_resource::<ClipImport>().and_then(ClipImport::draft);
            let name = draft.map_or_else(|| document.name.clone(), |draft| stem(Path::new(&draft.name)));
            folder.join(format!("{name}.map.ron"))
        }
    }
}

/// A typed path, completed to an absolute path with an extension.
pub(super) fn completed(path: &Path, purpose: Purpose) -> PathBuf {
    let home = std::env::var_os("HOME").map(PathBuf::from);
    let path = match (path.strip_prefix("~"), home) {
        (Ok(rest), Some(home)) => home.join(rest),
        _ => path.to_owned(),
    };
    let mut path = std::path::absolute(&path).unwrap_or(path);
    // A name with an ending that is typed over the proposed name leaves the proposed ending behind it.
    let typed = path.extension().filter(|ending| *ending == "glb").map(|_| path.with_extension(""));
    if let Some(typed) = typed.filter(|typed| purpose == Purpose::Export && FileKind::of(typed).is_some()) {
        path = typed;
    }
    let kind = FileKind::of(&path);
    let ending = match purpose {
        Purpose::Save if kind == Some(FileKind::Project) => "",
        Purpose::Save => ".rigsmith.ron",
        Purpose::Export if kind.is_some() => "",
        Purpose::Export => ".glb",
        Purpose::JointMap if kind == Some(FileKind::Gestures) => "",
        Purpose::JointMap => ".map.ron",
    };
    if let (false, Some(name)) = (ending.is_empty(), path.file_name().map(|name| name.to_string_lossy().into_owned())) {
        let name = name.strip_suffix(".ron").filter(|_| purpose == Purpose::Save).unwrap_or(&name).to_owned();
        path.set_file_name(format!("{name}{ending}"));
    }
    path
}

/// Saves the project, exports the character, or writes a map of joints.
pub(super) fn to(world: &mut World, purpose: Purpose, path: PathBuf, then: Option<FollowUp>) {
    match purpose {
        Purpose::Save => project(world, path, then),
        Purpose::Export => export::export(world, path),
        Purpose::JointMap => {
            world.write_message(MapRequest::Save(path));
        }
    }
}

/// The rig without the preview of a current drag.
pub(in crate::editor) fn settled(world: &World, rig: Entity) -> Option<Rig> {
    let data = world.get::<Rig>(rig)?;
    Some(world.get::<RigHistory>(rig).map_or_else(|| data.clone(), |history| history.settled(data).into_owned()))
}

/// Names of animated nodes that are no joints, as the window knows them. In a file they stand beside the keys, so that those of
/// nodes that are gone are offered to others after the file was opened again, too.
pub(super) fn animated_names(world: &World, rig: &Rig) -> NodeNames {
    let Some(timeline) = world.get_resource::<Timeline>() else { return NodeNames::default() };
    let nodes = |clip: &RigClip| -> Vec<Uid> {
        let masked = clip.layers.iter().flat_map(|layer| layer.mask.iter().copied());
        clip.nodes().into_iter().chain(masked).collect()
    };
    let others = rig.clips().iter().flat_map(nodes).filter(|node| rig.joint(*node).is_none());
    let named = others.filter_map(|node| Some((node, timeline.names.0.get(&node)?.clone())));
    NodeNames(named.collect())
}

/// Snapshot of the document; returns with it the bundled mesh that is open, by name.
pub(in crate::editor) fn snapshot(world: &mut World, rig: Entity) -> Option<(ProjectToSave, Option<String>)> {
    let view = view::now(world);
    let document = world.get::<OpenDocument>(rig)?;
    let data = settled(world, rig)?;
    let mut bundled = None;
    let mut open: Vec<MeshToSave> = Vec::new();
    for (_, mesh, source) in meshes(world, rig) {
        let path = match source {
            Some(MeshSource::File(path)) => path.clone(),
            // The path is set once the project has a folder for it.
            source => {
                bundled = Some(match source {
                    Some(MeshSource::Bundled(name)) => name.clone(),
                    _ => BODY.to_owned(),
                });
                PathBuf::new()
            }
        };
        let shape = MeshShape::Open { rest: mesh.rest.clone(), triangles: mesh.triangles.clone() };
        open.push(MeshToSave { uid: mesh.uid, rig: data.uid(), path, nodes: mesh.nodes.clone(), shape });
    }
    open.extend(document.missing.iter().cloned());
    let name = document.name.clone();
    let base = world.get::<RigSource>(rig).and_then(RigSource::base_to_keep).or_else(|| document.base.clone());
    let followed = document.template.clone().zip(base);
    let templates = followed.map(|(path, base)| ProjectTemplate { rig: data.uid(), path, base }).into_iter().collect();
    let names = animated_names(world, &data);
    Some((ProjectToSave { name, rigs: vec![data], meshes: open, templates, view, journal: None, names }, bundled))
}

/// Saves the project.
pub(super) fn project(world: &mut World, path: PathBuf, then: Option<FollowUp>) {
    if world.resource::<SaveJob>().job.is_some() {
        world.resource_mut::<SaveJob>().waiting.push_back((Purpose::Save, path, then));
        return;
    }
    let Some(rig) = active(world) else { return };
    let Some((mut snapshot, bundled)) = snapshot(world, rig) else { return };
    let Some(journal) = world.get::<OpenDocument>(rig).map(|document| document.journal.clone()) else { return };
    snapshot.name = stem(&path);
    let position = journal.position();
    let (step, name) = (last_step(world, rig), file_name(&path));
    let sign = StopSign::default();
    let heeded = sign.clone();
    let task = spawn(move || {
        let disk = StoppableDisk::new(&RealDisk, heeded);
        store(&disk, snapshot, bundled.as_deref(), path, &journal, position)
    });
    world.resource_mut::<SaveJob>().job = Some(Job { name, rig, step, task, sign, then });
}

fn store(
    disk: &dyn Disk,
    mut project: ProjectToSave,
    bundled: Option<&str>,
    path: PathBuf,
    journal: &Journal,
    position: u64,
) -> Result<SavedContent, WriteError> {
    let bundled = bundled.map(|name| place_bundled(&path, name)).transpose()?;
    if let Some(bundled) = &bundled {
        for mesh in project.meshes.iter_mut().filter(|mesh| mesh.path.as_os_str().is_empty()) {
            mesh.path.clone_from(bundled);
        }
    }
    let files = project_files(disk, &path, &project)?;
    let mark = SaveMark { path, hash: files.hash(), position };
    if let Err(reason) = journal.saving(mark.clone(), Duration::from_secs(2)) {
        debug!("the save is not noted in the journal: {reason}");
    }
    save_set(disk, &files.set)?;
    Ok(SavedContent::Project { mark, notes: files.notes, bundled })
}

/// Copies a bundled mesh beside a project, so that the project can refer to it.
pub(in crate::editor) fn place_bundled(project: &Path, name: &str) -> Result<PathBuf, WriteError> {
    let Ok(model) = BundledModel::named(name) else { return Err(WriteError::NotBundled { name: name.to_owned() }) };
    let names = [format!("{name}.obj"), format!("{}.{name}.obj", stem(project))];
    let limit = model.bytes.len() as u64 + 1;
    for name in &names {
        let path = project.with_file_name(name);
        let disk: &dyn Disk = &RealDisk;
        match disk.entry(&path, true) {
            Err(_) => {
                save_atomic(disk, &path, model.bytes)?;
                return Ok(path);
            }
            Ok(_) if read_capped(disk, &path, limit).is_ok_and(|bytes| bytes == model.bytes) => return Ok(path),
            Ok(_) => {}
        }
    }
    Err(WriteError::Occupied { names: names.join(" and ") })
}

/// Reports the result of saving, and proceeds.
pub(super) fn poll(world: &mut World) {
    let mut saving = world.resource_mut::<SaveJob>();
    let Some(job) = &mut saving.bypass_change_detection().job else { return };
    let Some(result) = check_ready(&mut job.task) else { return };
    let Some(Job { name, rig, step, sign, then, .. }) = saving.job.take() else { return };
    let next = saving.waiting.pop_front();
    let is_done = result.is_ok();
    match result {
        Ok(SavedContent::Project { mark, notes, bundled }) => {
            saved(world, rig, step, mark, bundled);
            world.write_message(Notice::done(format!("Saved {name}")));
            tell(world, notes);
        }
        Ok(SavedContent::Export { checked, notes, template }) => {
            let begins = template.and_then(|(path, saved)| follow(world, rig, path, saved));
            world.write_message(match checked {
                Ok(found) if found.is_empty() => Notice::done(format!("Exported {name}")),
                Ok(found) => Notice::done(format!("Exported {name}; read back: {found}")),
                Err(error) => Notice::error(format!("Exported {name}, but it cannot be read back: {error}")),
            });
            tell(world, notes);
            if let Some(name) = begins {
                let text = format!("The rig follows {name} from now on: what is changed there comes to the Updater");
                world.write_message(Notice::info(text));
            }
        }
        Err(_) if sign.has_refused() => {
            world.write_message(Notice::info(format!("{name} is not written: it was stopped")).named());
        }
        Err(error) => {
            world.write_message(Notice::error(format!("Could not write {name}: {error}")));
        }
    }
    if let Some((purpose, path, then)) = next {
        to(world, purpose, path, then);
    }
    if let Some(then) = then.filter(|_| is_done) {
        // Changes may have been made while it was being saved.
        after_asking(world, then);
    }
}

/// Follows the template that the rig was saved to; returns the file's name if it did not follow it before.
fn follow(world: &mut World, rig: Entity, path: PathBuf, saved: Arc<Rig>) -> Option<String> {
    let mut document = world.get_mut::<OpenDocument>(rig)?;
    let Some(template) = &document.template else {
        let name = file_name(&path);
        (document.template, document.base) = (Some(path), Some(saved.into()));
        return Some(name);
    };
    // Another template may have been loaded meanwhile; what was saved is no base of that.
    let is_same = *template == path;
    if let Some(mut source) = world.get_mut::<RigSource>(rig).filter(|_| is_same) {
        source.rebase(saved);
    }
    None
}

fn tell(world: &mut World, notes: Vec<String>) {
    for note in notes {
        world.write_message(Notice::warning(note));
    }
}

/// The project is saved: the journal starts again from this state.
fn saved(world: &mut World, rig: Entity, step: Option<Arc<Step>>, mark: SaveMark, bundled: Option<PathBuf>) {
    let open: Vec<Entity> = meshes(world, rig).into_iter().map(|(entity, ..)| entity).collect();
    if let Some(path) = bundled {
        for entity in open {
            if let Some(mut source) =
                world.get_mut::<MeshSource>(entity).filter(|source| matches!(**source, MeshSource::Bundled(_)))
            {
                *source = MeshSource::File(path.clone());
            }
        }
    }
    let places = places(world, Some(mark.path.clone()));
    let context = context(world, rig, stem(&mark.path));
    world.resource_mut::<EditorSettings>().remember(mark.path.clone());
    let Some(mut document) = world.get_mut::<OpenDocument>(rig) else { return };
    document.saved = SavedAt::Step(step);
    document.name = stem(&mark.path);
    document.project = Some(mark.path.clone());
    document.journal.saved(mark, places);
    document.journal.context(context.text());
}
