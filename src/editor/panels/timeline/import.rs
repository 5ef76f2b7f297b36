//! Motion from files: clips of rigs, motion capture and the animations of models, put onto the rig in the background. All clips
//! of a file come as one step. Motion of another skeleton waits until people have seen which joints it goes to.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

pub use super::map_draft::MapDraft;
use super::{
    carry_out::open,
    map_file,
    motion_options::{MotionOptions, RateError, sentences},
};
use crate::{
    editor::{
        ActiveRig,
        counts::counted,
        dock::ShowPanel,
        files::dialog::{Dialog, Question},
        notice::Notice,
    },
    files::{FileKind, LoadError, RealDisk, load_animation, load_model, load_motion, load_packed_clips, stem},
    plugins::{
        commands::RigModules,
        document::EditRequest,
        history::RigHistory,
        landing::{HeldResult, JobOutcome, Landing},
        limits::{LimitError, RigLimits},
    },
    processor::{BuildError, Builder, Modules},
    rig::{
        BuiltRig, Rig, Uid, UidSource,
        animation::{
            RigClip,
            file_clip::{motion_of, numbered_clip, own_joints},
            joint_map::{JointMap, JointMapError},
            motion::Motion,
        },
        operations::{ClipOperation, Operation, OperationError},
    },
    solve::retarget::{MotionTarget, RetargetError, retarget},
};

/// Kinds of files that have motion.
pub const MOTION_FILES: &[FileKind] =
    &[FileKind::Bvh, FileKind::Animation, FileKind::PackedClips, FileKind::Glb, FileKind::Gltf, FileKind::Vrm];

/// Request to put the motion of a file onto the active rig. Motion of another skeleton waits for [`MapRequest::Accept`].
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct ImportRequest(pub PathBuf);

/// Change of the map of joints of motion that waits.
#[derive(Message, Debug, Clone, PartialEq)]
pub enum MapRequest {
    /// Gives a joint of the motion, by its number, another joint of the rig, or none.
    Set(usize, Option<Uid>),
    /// Chooses how the motion is put onto the rig; later imports begin with the same choices.
    Options(MotionOptions),
    /// Asks for a map file.
    AskFile,
    /// Takes the map of a file in place of the guess.
    File(PathBuf),
    /// Asks for a path to which the map is saved.
    AskSave,
    /// Writes the map to a file.
    Save(PathBuf),
    /// Puts the motion onto the rig by the map.
    Accept,
    /// Drops the motion.
    Cancel,
}

/// File of motion that is being read, or that waits until its map of joints is accepted.
#[derive(Resource, Default)]
pub struct ClipImport {
    job: Option<Job>,
    pub(super) draft: Option<MapDraft>,
    /// Choices of the last import.
    options: MotionOptions,
}

struct Job {
    rig: Entity,
    name: String,
    landing: Landing,
    work: Work,
}

/// Work of a job.
enum Work {
    Runs(Task<Result<ReadMotion, ImportError>>),
    /// Clips that wait to be put onto the rig.
    Waits(ImportedMotion),
}

/// Result of reading a file, or of retargeting.
enum ReadMotion {
    /// Clips of the rig.
    Clips(ImportedMotion),
    /// Motion of another skeleton.
    Draft(MapDraft),
}

impl ClipImport {
    /// Name of the file that is being read.
    pub fn name(&self) -> Option<&str> {
        self.job.as_ref().filter(|job| matches!(job.work, Work::Runs(_))).map(|job| job.name.as_str())
    }

    /// Name of the file that is read, but waits, because importing it would discard steps that can be redone.
    pub fn waits(&self) -> Option<&str> {
        self.job.as_ref().filter(|job| matches!(job.work, Work::Waits(_))).map(|job| job.name.as_str())
    }

    /// Drops clips that wait; returns the name of their file.
    pub fn drop_waiting(&mut self) -> Option<String> {
        self.job.take_if(|job| matches!(job.work, Work::Waits(_))).map(|job| job.name)
    }

    /// Stops reading or retargeting; returns the name of the file. Motion whose map was being carried out waits again.
    pub fn stop(&mut self) -> Option<String> {
        self.job.take_if(|job| matches!(job.work, Work::Runs(_))).map(|job| job.name)
    }

    /// Motion that waits until its map is accepted.
    pub fn draft(&self) -> Option<&MapDraft> {
        self.draft.as_ref()
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
    #[error("it is no file of motion; those end in .bvh, .anim.ron, .rigclip, .glb, .gltf or .vrm")]
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
    /// The frame rate leaves nothing of a motion.
    #[error(transparent)]
    Rate(#[from] RateError),
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
    if world.get_resource::<ClipImport>().is_some_and(|import| import.name().is_some()) {
        let text = format!("{name} has to wait: another file is being read. Import it then.");
        world.write_message(Notice::info(text).named());
        return;
    }
    let Some((rig, modules, landing)) = snapshot(world, entity) else { return };
    let (path, of_file) = (path.to_owned(), name.clone());
    let limits = world.get_resource::<RigLimits>().cloned().unwrap_or_default();
    let task = AsyncComputeTaskPool::get().spawn(async move { read(&path, &of_file, entity, &rig, &modules, &limits) });
    begun(world, Job { rig: entity, name, landing, work: Work::Runs(task) });
}

/// Takes note of a job; clips that wait are dropped for it.
fn begun(world: &mut World, job: Job) {
    let mut import = world.resource_mut::<ClipImport>();
    let dropped = import.drop_waiting();
    import.job = Some(job);
    if let Some(name) = dropped {
        let text = format!("{name} is not imported: another import was asked for while it waited");
        world.write_message(Notice::info(text));
    }
}

/// The rig without the preview of a current drag, the modules of its commands, and the landing of a job that starts now.
fn snapshot(world: &World, entity: Entity) -> Option<(Rig, Arc<Modules>, Landing)> {
    let modules = world.get_resource::<RigModules>().map(|modules| Arc::clone(&modules.0))?;
    let (rig, history) = (world.get::<Rig>(entity)?, world.get::<RigHistory>(entity)?);
    Some((history.settled(rig).into_owned(), modules, Landing::asked(history)))
}

/// Carries out changes of the map that waits.
pub(super) fn change_map(mut requests: MessageReader<MapRequest>, mut commands: Commands) {
    for request in requests.read() {
        let request = request.clone();
        commands.queue(move |world: &mut World| answer(world, &request));
    }
}

fn answer(world: &mut World, request: &MapRequest) {
    let mut import = world.resource_mut::<ClipImport>();
    if import.name().is_some() {
        return;
    }
    match request {
        MapRequest::Set(joint, target) => {
            let known = import.draft.as_mut().and_then(|draft| draft.targets.get_mut(*joint));
            if let Some(known) = known {
                *known = *target;
            }
        }
        MapRequest::Options(options) => {
            import.options = *options;
            if let Some(draft) = &mut import.draft {
                draft.options = *options;
            }
        }
        MapRequest::AskFile => map_file::ask(world),
        MapRequest::File(path) => map_file::load(world, path),
        MapRequest::AskSave => map_file::ask_save(world),
        MapRequest::Save(path) => map_file::save(world, path),
        MapRequest::Cancel => {
            import.draft = None;
            import.drop_waiting();
        }
        MapRequest::Accept => {
            let Some(draft) = import.draft.clone() else { return };
            let Some((rig, modules, landing)) = snapshot(world, draft.rig) else { return };
            let (entity, name) = (draft.rig, draft.name.clone());
            let task = AsyncComputeTaskPool::get()
                .spawn(async move { retargeted(&draft, &rig, &modules).map(ReadMotion::Clips) });
            begun(world, Job { rig: entity, name, landing, work: Work::Runs(task) });
        }
    }
}

/// Nodes of a rig that get keys.
pub(super) fn target_of(rig: &Rig) -> MotionTarget {
    let has_commands = rig.walk().any(|joint| !joint.data.tags.is_empty());
    if has_commands { MotionTarget::Controls } else { MotionTarget::Joints }
}

/// Clips of a file for a rig, or motion of another skeleton with a guess of the map.
fn read(
    path: &Path,
    name: &str,
    entity: Entity,
    rig: &Rig,
    modules: &Arc<Modules>,
    limits: &RigLimits,
) -> Result<ReadMotion, ImportError> {
    let mut imported = ImportedMotion { clips: Vec::new(), notes: Vec::new() };
    let mut motions = Vec::new();
    match FileKind::of(path) {
        Some(FileKind::Animation) => {
            let file = load_animation(&RealDisk, path)?;
            let bound = file.onto(rig, Some(&Builder::build(rig, modules)?));
            imported.notes.extend(file.notes);
            if !bound.missing.is_empty() {
                let (count, labels) = (bound.missing.len(), bound.missing_labels().join(", "));
                imported
                    .notes
                    .push(format!("the rig does not have {count} of its nodes; their keys are set aside: {labels}"));
            }
            imported.clips = bound.clips;
        }
        Some(FileKind::Bvh) => {
            let motion = load_motion(&RealDisk, path)?;
            limits.check_motion(name, &motion)?;
            motions.push(motion);
        }
        Some(kind) if kind == FileKind::PackedClips || kind.is_gltf() => {
            let model = match kind {
                FileKind::PackedClips => {
                    let packed = load_packed_clips(&RealDisk, path)?;
                    limits.check_packed(name, &packed)?;
                    packed.model(&stem(path))
                }
                _ => load_model(&RealDisk, path)?,
            };
            limits.check_model(name, &model)?;
            let joints = (target_of(rig) == MotionTarget::Joints).then(|| own_joints(&model, rig)).flatten();
            for (number, clip) in model.clips.iter().enumerate() {
                let name = if clip.name.trim().is_empty() { stem(path) } else { clip.name.trim().to_owned() };
                if let Some(joints) = &joints {
                    let own = numbered_clip(rig, &model, number, joints);
                    imported.clips.extend(own.map(|clip| RigClip { name, ..clip }));
                    continue;
                }
                let motion = Motion { name, ..motion_of(&model, clip) };
                if motion.frames() > 0 {
                    motions.push(motion);
                }
            }
        }
        _ => return Err(ImportError::Kind),
    }
    match (motions.is_empty(), imported.clips.is_empty()) {
        (false, _) => Ok(ReadMotion::Draft(MapDraft::new(entity, name, rig, motions))),
        (true, false) => Ok(ReadMotion::Clips(imported)),
        (true, true) => Err(ImportError::Empty),
    }
}

/// Motions of a draft on a rig, by its map.
fn retargeted(draft: &MapDraft, rig: &Rig, modules: &Arc<Modules>) -> Result<ImportedMotion, ImportError> {
    let built = Builder::build(rig, modules)?;
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let place = |target: Uid| joints.iter().position(|joint| *joint == target);
    let pairs = draft.targets.iter().enumerate();
    let pairs: Vec<(usize, usize)> = pairs.filter_map(|(from, to)| Some((from, place((*to)?)?))).collect();
    let mut imported = ImportedMotion { clips: Vec::new(), notes: draft.notes.clone() };
    for motion in draft.motions.iter() {
        draft.options.check_rate(motion)?;
        let map = JointMap::of_pairs(motion, rig, &pairs)?;
        imported.retarget(rig, &built, motion, &map, draft.options)?;
    }
    Ok(imported)
}

impl ImportedMotion {
    /// Adds the motion of another skeleton.
    fn retarget(
        &mut self,
        rig: &Rig,
        built: &BuiltRig,
        motion: &Motion,
        map: &JointMap,
        options: MotionOptions,
    ) -> Result<(), ImportError> {
        let done = retarget(rig, built, motion, map, &options.settings(target_of(rig)))?;
        let unmapped = map.unmapped_source(motion).len();
        let sentences = sentences(rig, built, map, &done)?;
        self.notes.extend(done.notes);
        self.notes.extend(sentences);
        self.notes.push(format!(
            "\"{}\": {} found; {} of the motion without effect",
            done.clip.name,
            counted(map.bones().count() + map.pairs.len(), "bone", "bones"),
            counted(unmapped, "joint", "joints"),
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
    let import = import.bypass_change_detection();
    let Some(mut job) = import.job.take() else { return };
    let result = match job.work {
        Work::Waits(imported) => Ok(ReadMotion::Clips(imported)),
        Work::Runs(mut task) => match check_ready(&mut task) {
            Some(result) => result,
            None => {
                commands.write_message(RequestRedraw);
                job.work = Work::Runs(task);
                import.job = Some(job);
                return;
            }
        },
    };
    let Job { rig, name, landing, .. } = job;
    commands.queue(move |world: &mut World| match result {
        Ok(ReadMotion::Clips(imported)) => put(world, rig, name, landing, imported),
        Ok(ReadMotion::Draft(draft)) => {
            let text = format!("{name}: check in the Timeline which joints its motion goes to, then import it.");
            world.write_message(Notice::info(text).at("Timeline"));
            world.write_message(ShowPanel("Timeline"));
            let mut import = world.resource_mut::<ClipImport>();
            let options = import.options;
            import.draft = Some(MapDraft { options, ..draft });
        }
        Err(error) => {
            world.write_message(Notice::error(format!("Could not import {name}: {error}")));
        }
    });
}

/// Puts clips onto the rig, now or once nothing is lost by it. Keys of joints that are gone meanwhile are set aside, so clips fit
/// whatever was edited.
fn put(world: &mut World, rig: Entity, name: String, mut landing: Landing, imported: ImportedMotion) {
    let is_active = world.get_resource::<ActiveRig>().is_some_and(|active| active.0 == rig);
    let Some(history) = world.get::<RigHistory>(rig).filter(|_| is_active) else {
        world.resource_mut::<ClipImport>().draft = None;
        let text = format!("{name} is not imported: another rig was opened meanwhile");
        world.write_message(Notice::info(text).named());
        return;
    };
    if let JobOutcome::Hold { is_news } = landing.decide(history, || true) {
        let mut import = world.resource_mut::<ClipImport>();
        import.bypass_change_detection().job = Some(Job { rig, name, landing, work: Work::Waits(imported) });
        if is_news {
            world.write_message(Notice::warning(HeldResult::Motion.sentence()));
        }
        return;
    }
    world.resource_mut::<ClipImport>().draft = None;
    add(world, rig, &name, imported);
}

fn add(world: &mut World, entity: Entity, name: &str, imported: ImportedMotion) {
    let Some(mut rig) = world.get::<Rig>(entity).cloned() else { return };
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
    let clips = counted(count, "clip", "clips");
    world.write_message(Notice::done(format!("Imported {clips} from {name}")));
    for note in imported.notes {
        world.write_message(Notice::info(note).quiet());
    }
}
