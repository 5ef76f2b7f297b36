//! Opening files into the window, in the background.

use std::path::PathBuf;

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{ActiveRig, camera::FrameWhenReady, notice::Notice, settings::EditorSettings};
use crate::{
    files::{FileKind, RealDisk, load_model, load_template},
    mesh::obj::{ObjSettings, read_model},
    plugins::{
        document::RigBundle,
        history::RigHistory,
        surface::{RigMesh, SkinOf},
    },
    rig::{Rig, RigEdit, UidSource, character::import_skeleton},
};

/// Opens files.
pub struct FilesPlugin;

impl Plugin for FilesPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<OpenRequest>().init_resource::<Loading>().add_systems(Update, (start_opening, land).chain());
    }
}

/// Asks to open something instead of what is open.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub enum OpenRequest {
    /// The character that comes with Rigsmith.
    Bundled,
    /// An empty rig without a mesh.
    Empty,
    /// A mesh, a template or a project.
    File(PathBuf),
}

/// What is being opened.
#[derive(Resource, Default)]
pub struct Loading {
    job: Option<(String, Task<Result<Opened, String>>)>,
}

impl Loading {
    /// The name of what is being opened.
    pub fn what(&self) -> Option<&str> {
        self.job.as_ref().map(|(name, _)| name.as_str())
    }
}

/// What was opened: a rig and its mesh.
struct Opened {
    name: String,
    rig: Option<Rig>,
    edits: Vec<RigEdit>,
    mesh: Option<RigMesh>,
    notes: Vec<String>,
}

const BUNDLED: &[u8] = include_bytes!("../../assets/models/biped.obj");

fn start_opening(
    mut requests: MessageReader<OpenRequest>,
    mut loading: ResMut<Loading>,
    mut uids: ResMut<UidSource>,
    mut settings: ResMut<EditorSettings>,
) {
    for request in requests.read() {
        let mut source = UidSource::seeded(uids.next_uid().0);
        let (name, task) = match request.clone() {
            OpenRequest::Bundled => ("the bundled character".to_owned(), spawn(move || bundled(&mut source))),
            OpenRequest::Empty => ("nothing".to_owned(), spawn(|| Ok(Opened::named("untitled")))),
            OpenRequest::File(path) => {
                settings.remember(path.clone());
                let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                (name, spawn(move || file(&path, &mut source)))
            }
        };
        loading.job = Some((name, task));
    }
}

fn spawn<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Task<T> {
    AsyncComputeTaskPool::get().spawn(async move { work() })
}

impl Opened {
    fn named(name: &str) -> Self {
        Self { name: name.to_owned(), rig: None, edits: Vec::new(), mesh: None, notes: Vec::new() }
    }

    fn model(model: crate::mesh::model::Model, uids: &mut UidSource) -> Self {
        let uid = uids.next_uid();
        let skeleton = import_skeleton(&model, uids);
        let mut edits = skeleton.edits;
        edits.extend(skeleton.skin.map(|skin| RigEdit::SetSkin(uid, Some(skin))));
        let name = model.name.clone();
        let notes = model.notes.clone();
        Self { name, rig: None, edits, mesh: Some(RigMesh::new(uid, model, skeleton.nodes)), notes }
    }
}

fn bundled(uids: &mut UidSource) -> Result<Opened, String> {
    let model = read_model(BUNDLED, "biped", &ObjSettings::default(), &mut |_| None).map_err(|e| e.to_string())?;
    Ok(Opened::model(model, uids))
}

fn file(path: &std::path::Path, uids: &mut UidSource) -> Result<Opened, String> {
    match FileKind::of(path) {
        Some(FileKind::Template) => {
            let template = load_template(&RealDisk, path).map_err(|error| error.to_string())?;
            Ok(Opened { rig: Some(template.rig), ..Opened::named("template") })
        }
        _ => {
            let model = load_model(&RealDisk, path).map_err(|error| error.to_string())?;
            Ok(Opened::model(model, uids))
        }
    }
}

fn land(
    mut commands: Commands,
    mut loading: ResMut<Loading>,
    active: Option<Res<ActiveRig>>,
    mut uids: ResMut<UidSource>,
    mut frame: ResMut<FrameWhenReady>,
    mut notices: MessageWriter<Notice>,
) {
    let Some((name, result)) = loading
        .bypass_change_detection()
        .job
        .as_mut()
        .and_then(|(name, task)| Some((name.clone(), check_ready(task)?)))
    else {
        return;
    };
    loading.job = None;
    match result {
        Ok(opened) => {
            if let Some(active) = active {
                commands.entity(active.0).despawn();
            }
            let mut rig = opened.rig.unwrap_or_else(|| Rig::new(uids.next_uid(), opened.name));
            for edit in &opened.edits {
                if let Err(error) = rig.apply(edit) {
                    notices.write(Notice::warning(error.to_string()));
                }
            }
            let entity = commands.spawn(RigBundle { rig, history: RigHistory::default(), ..default() }).id();
            if let Some(mesh) = opened.mesh {
                commands.spawn((mesh, SkinOf(entity)));
            }
            commands.insert_resource(ActiveRig(entity));
            frame.0 = true;
            notices.write(Notice::done(format!("Opened {name}")));
            for note in opened.notes {
                notices.write(Notice::info(note).quiet());
            }
        }
        Err(reason) => {
            notices.write(Notice::error(format!("Could not open {name}: {reason}")));
        }
    }
}
