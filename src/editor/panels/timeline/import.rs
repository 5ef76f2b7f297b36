//! Motion from files: clips of rigs, motion capture and the animations of models, put onto the rig in the background. All clips
//! of a file come as one step.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::carry_out::open;
use crate::{
    editor::{
        ActiveRig,
        files::dialog::{Dialog, Question},
        notice::Notice,
    },
    files::{FileKind, LoadError, RealDisk, load_animation, load_model, load_motion, stem},
    plugins::{
        commands::RigModules,
        document::EditRequest,
        history::RigHistory,
        limits::{LimitError, RigLimits},
    },
    processor::{BuildError, Builder, Modules},
    rig::{
        BuiltRig, Rig, UidSource,
        animation::{
            RigClip,
            file_clip::{motion_of, numbered_clip, own_joints},
            joint_map::{JointMap, JointMapError},
            motion::Motion,
        },
        operations::{ClipOperation, Operation, OperationError},
    },
    solve::retarget::{MotionTarget, RetargetError, RetargetSettings, retarget},
};

/// Kinds of files that have motion.
pub const MOTION_FILES: &[FileKind] = &[FileKind::Bvh, FileKind::Animation, FileKind::Glb, FileKind::Gltf];

/// Request to put the motion of a file onto the active rig.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct ImportRequest(pub PathBuf);

/// File of motion that is being read.
#[derive(Resource, Default)]
pub struct ClipImport {
    job: Option<Job>,
}

struct Job {
    rig: Entity,
    name: String,
    task: Task<Result<ImportedMotion, ImportError>>,
}

impl ClipImport {
    /// Name of the file that is being read.
    pub fn what(&self) -> Option<&str> {
        self.job.as_ref().map(|job| job.name.as_str())
    }
}

/// Clips of a file on the rig.
struct ImportedMotion {
    clips: Vec<RigClip>,
    notes: Vec<String>,
}

/// Reason why the motion of a file is not put onto the rig.
#[derive(Debug, thiserror::Error)]
enum ImportError {
    /// The file's name has no ending of motion.
    #[error("it is no file of motion; those end in .bvh, .anim.ron, .glb or .gltf")]
    Kind,
    /// The file has no motion.
    #[error("it has no clips that move joints; choose a file with animations of its skeleton")]
    Empty,
    /// The file cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The file holds more than is taken.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The commands of the rig stop with an error.
    #[error("the rig cannot be built: {0}")]
    Build(#[from] BuildError),
    /// No joints correspond.
    #[error(transparent)]
    Map(#[from] JointMapError),
    /// The motion does not fit the rig.
    #[error(transparent)]
    Retarget(#[from] RetargetError),
}

/// Asks for a file.
pub(super) fn ask(world: &mut World) {
    if let Some(mut dialog) = world.get_resource_mut::<Dialog>() {
        dialog.ask(Question::Motion);
    }
}

/// Starts to read requested files.
pub(super) fn start(mut requests: MessageReader<ImportRequest>, mut commands: Commands) {
    for ImportRequest(path) in requests.read() {
        let path = path.clone();
        commands.queue(move |world: &mut World| begin(world, &path));
    }
}

fn begin(world: &mut World, path: &Path) {
    let Some(entity) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if world.get_resource::<ClipImport>().is_some_and(|import| import.what().is_some()) {
        world.write_message(Notice::info(format!("{name} has to wait: another file is being read. Import it then.")));
        return;
    }
    let Some(modules) = world.get_resource::<RigModules>().map(|modules| Arc::clone(&modules.0)) else { return };
    let Some(rig) = world.get::<Rig>(entity) else { return };
    let rig = world.get::<RigHistory>(entity).map_or_else(|| rig.clone(), |history| history.settled(rig).into_owned());
    let path = path.to_owned();
    let limits = world.get_resource::<RigLimits>().cloned().unwrap_or_default();
    let task = AsyncComputeTaskPool::get().spawn(async move { read(&path, &rig, &modules, &limits) });
    world.resource_mut::<ClipImport>().job = Some(Job { rig: entity, name, task });
}

/// Clips of a file on a rig, as `rigsmith animate` makes them.
fn read(path: &Path, rig: &Rig, modules: &Arc<Modules>, limits: &RigLimits) -> Result<ImportedMotion, ImportError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let built = Builder::build(rig, modules)?;
    let has_commands = rig.walk().any(|joint| !joint.data.tags.is_empty());
    let onto = if has_commands { MotionTarget::Controls } else { MotionTarget::Joints };
    let mut imported = ImportedMotion { clips: Vec::new(), notes: Vec::new() };
    match FileKind::of(path) {
        Some(FileKind::Animation) => {
            let file = load_animation(&RealDisk, path)?;
            let bound = file.onto(rig, Some(&built));
            imported.notes.extend(file.notes);
            if !bound.missing.is_empty() {
                let count = bound.missing.len();
                imported.notes.push(format!("the rig does not have {count} of its nodes; their keys are set aside"));
            }
            imported.clips = bound.clips;
        }
        Some(FileKind::Bvh) => {
            let motion = load_motion(&RealDisk, path)?;
            limits.check_motion(&name, &motion)?;
            imported.retarget(rig, &built, &motion, onto)?;
        }
        Some(FileKind::Glb | FileKind::Gltf) => {
            let model = load_model(&RealDisk, path)?;
            limits.check_model(&name, &model)?;
            let joints = (onto == MotionTarget::Joints).then(|| own_joints(&model, rig)).flatten();
            for (number, clip) in model.clips.iter().enumerate() {
                let name = if clip.name.trim().is_empty() { stem(path) } else { clip.name.trim().to_owned() };
                if let Some(joints) = &joints {
                    let own = numbered_clip(rig, &model, number, joints);
                    imported.clips.extend(own.map(|clip| RigClip { name, ..clip }));
                    continue;
                }
                let motion = Motion { name, ..motion_of(&model, clip) };
                if motion.frames() > 0 {
                    imported.retarget(rig, &built, &motion, onto)?;
                }
            }
        }
        _ => return Err(ImportError::Kind),
    }
    if imported.clips.is_empty() { Err(ImportError::Empty) } else { Ok(imported) }
}

impl ImportedMotion {
    /// Adds the motion of another skeleton.
    fn retarget(
        &mut self,
        rig: &Rig,
        built: &BuiltRig,
        motion: &Motion,
        onto: MotionTarget,
    ) -> Result<(), ImportError> {
        let map = JointMap::new(motion, rig, &[])?;
        let settings = RetargetSettings { onto, ..RetargetSettings::default() };
        let done = retarget(rig, built, motion, &map, &settings)?;
        let unmapped = map.unmapped_source(motion).len();
        self.notes.extend(motion.notes.iter().cloned().chain(done.notes));
        self.notes.push(format!(
            "\"{}\": {} bones were found; {unmapped} joints of the motion move nothing",
            done.clip.name,
            map.bones().count() + map.pairs.len(),
        ));
        if !done.unmoved.is_empty() {
            self.notes.push(format!("no control turns {}", done.unmoved.join(", ")));
        }
        self.clips.push(done.clip);
        Ok(())
    }
}

/// Takes over motion that has been read: one step of the history, and the first clip is open.
pub(super) fn land(mut import: ResMut<ClipImport>, mut commands: Commands) {
    let Some(job) = &mut import.bypass_change_detection().job else { return };
    let Some(result) = check_ready(&mut job.task) else {
        commands.write_message(RequestRedraw);
        return;
    };
    let Some(Job { rig, name, .. }) = import.job.take() else { return };
    commands.queue(move |world: &mut World| match result {
        Ok(imported) => add(world, rig, &name, imported),
        Err(error) => {
            world.write_message(Notice::error(format!("Could not import {name}: {error}")));
        }
    });
}

fn add(world: &mut World, entity: Entity, name: &str, imported: ImportedMotion) {
    let is_active = world.get_resource::<ActiveRig>().is_some_and(|active| active.0 == entity);
    let Some(mut rig) = world.get::<Rig>(entity).filter(|_| is_active).cloned() else { return };
    let count = imported.clips.len();
    let (mut edits, before) = (Vec::new(), rig.clips().len());
    let added: Result<(), OperationError> = imported.clips.into_iter().try_for_each(|clip| {
        let mut uids = world.resource_mut::<UidSource>();
        let outcome = Operation::Clips(ClipOperation::Add(Box::new(clip))).run(&mut rig, &mut uids, None)?;
        edits.extend(outcome.edits);
        Ok(())
    });
    if let Err(error) = added {
        world.write_message(Notice::error(format!("Could not import {name}: {error}")));
        return;
    }
    open(world, rig.clips().get(before));
    let step = if count == 1 { "Import clip" } else { "Import clips" };
    world.write_message(EditRequest::operation(entity, Operation::Named { name: step, edits }));
    let clips = if count == 1 { "1 clip".to_owned() } else { format!("{count} clips") };
    world.write_message(Notice::done(format!("Imported {clips} from {name}")));
    for note in imported.notes {
        world.write_message(Notice::info(note).quiet());
    }
}
