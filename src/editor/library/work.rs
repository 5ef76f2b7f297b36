//! Work of the library: a template is read in the background and put onto the open rig, one request after the other.

use std::{collections::VecDeque, sync::Arc};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::{
    follow::{LoadSteps, PendingLoad},
    joints::{added, added_by},
    listing::{LibraryFolders, own_folder},
};
use crate::{
    editor::{
        ActiveRig,
        files::{
            OpenDocument,
            loading::{replacing, settled},
        },
        notice::Notice,
    },
    files::{LibraryError, RealDisk, SearchPaths, SiteError, TemplatePlace, read_listed},
    plugins::{
        commands::RigModules,
        document::{EditRequest, Symmetry},
        history::RigHistory,
        surface::{RigMesh, RigMeshes},
    },
    processor::{Modules, keep_clips, keep_poses},
    rig::{
        EditError, Rig, RigEdit, TagKind, Uid,
        operations::{Operation, TagOperation},
        part::{Part, PartError},
        step::Step,
        template::Template,
        update::{Take, clip_edits, edits_between, pose_edits, update, with_identities},
    },
};

/// Name of the step that puts a template in place of the rig.
pub const LOAD: &str = "Load template";

/// Request to do something with a template of the library on the open rig.
#[derive(Message, Debug, Clone, PartialEq)]
pub struct LibraryRequest {
    /// Place of the template.
    pub place: TemplatePlace,
    /// Use of the template.
    pub act: LibraryAct,
}

/// Use of a template on the open rig.
#[derive(Debug, Clone, PartialEq)]
pub enum LibraryAct {
    /// Puts it in place of the rig; the rig follows its file from then on.
    Load {
        /// True to keep poses, stored poses, keys and weights.
        keep: bool,
    },
    /// Puts it in place of the rig, and its skeleton into the open mesh.
    Fit {
        /// True to keep poses, stored poses, keys and weights.
        keep: bool,
    },
    /// Adds its joints to the rig.
    Merge {
        /// Joint that its roots hang on; they stay roots without one.
        parent: Option<Uid>,
    },
    /// Puts its tags onto joints in order.
    Inject {
        /// The joints.
        joints: Vec<Uid>,
    },
    /// Puts a part onto joints, so that it stays a part.
    Part {
        /// The joints; of a single one, the chain that ends or begins there.
        joints: Vec<Uid>,
        /// Values of the part's options, as RON.
        options: Vec<(String, String)>,
    },
    /// Puts a part onto the chain at a joint; merges any other template below it.
    Drop {
        /// The joint.
        joint: Uid,
    },
}

/// Reason why a template is not used.
#[derive(Debug, thiserror::Error)]
enum WorkError {
    #[error(transparent)]
    Library(#[from] LibraryError),
    #[error(transparent)]
    Site(#[from] SiteError),
    #[error(transparent)]
    Edit(#[from] EditError),
    #[error(transparent)]
    Part(#[from] PartError),
}

/// Requests that wait, and the one that is being worked on.
#[derive(Resource, Default)]
pub struct LibraryJobs {
    waiting: VecDeque<LibraryRequest>,
    job: Option<Job>,
}

struct Job {
    request: LibraryRequest,
    rig: Entity,
    /// Last step and number of undone steps of the rig that the work started from.
    from: (Option<Arc<Step>>, usize),
    task: Task<Result<Ready, WorkError>>,
}

/// Finished work.
enum Ready {
    /// Edits that put a template in place of the rig, and what the rig has then come from.
    Load { edits: Vec<RigEdit>, base: Arc<Rig>, notes: Vec<String> },
    /// An operation.
    Operation(Box<Operation>),
}

impl LibraryJobs {
    /// Name of the template that is being read.
    pub fn what(&self) -> Option<String> {
        self.job.as_ref().map(|job| job.request.place.stem())
    }
}

/// Snapshot of the open rig for the work.
struct Snapshot {
    rig: Rig,
    modules: Arc<Modules>,
    folders: LibraryFolders,
    beside: Option<std::path::PathBuf>,
    /// Joints that the last step added.
    stroke: Vec<Uid>,
    /// True if what is done on one side happens on the other, too.
    is_symmetric: bool,
}

/// Starts the next request.
pub(super) fn start(
    mut requests: MessageReader<LibraryRequest>,
    mut jobs: ResMut<LibraryJobs>,
    mut commands: Commands,
) {
    let jobs = jobs.bypass_change_detection();
    jobs.waiting.extend(requests.read().cloned());
    if jobs.job.is_none()
        && let Some(request) = jobs.waiting.pop_front()
    {
        commands.queue(move |world: &mut World| begin(world, request));
    }
}

fn begin(world: &mut World, request: LibraryRequest) {
    let name = request.place.stem();
    let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else {
        world.write_message(Notice::error(format!("{name} is not used: no rig is open; open or begin one first")));
        return;
    };
    let (Some(data), Some(modules)) = (settled(world, rig), world.get_resource::<RigModules>()) else { return };
    let history = world.get::<RigHistory>(rig);
    let snapshot = Snapshot {
        rig: data,
        modules: modules.0.clone(),
        folders: world.get_resource::<LibraryFolders>().cloned().unwrap_or_default(),
        beside: world.get::<OpenDocument>(rig).and_then(own_folder),
        stroke: added_by(history.and_then(RigHistory::last).map(Arc::as_ref)),
        is_symmetric: world.get::<Symmetry>(rig).is_some_and(|symmetry| symmetry.0.is_some()),
    };
    let from = history.map(|history| (history.last().cloned(), history.undone())).unwrap_or_default();
    let work = request.clone();
    let task = AsyncComputeTaskPool::get().spawn(async move { snapshot.run(&work) });
    world.resource_mut::<LibraryJobs>().job = Some(Job { request, rig, from, task });
    world.write_message(RequestRedraw);
}

impl Snapshot {
    fn run(self, request: &LibraryRequest) -> Result<Ready, WorkError> {
        let site = self.folders.read()?;
        let template = read_listed(&RealDisk, &request.place, &site)?;
        let operation = match &request.act {
            LibraryAct::Load { keep } | LibraryAct::Fit { keep } => return self.loaded(template, *keep),
            LibraryAct::Drop { joint } if template.rig.about().kind == "part" => {
                self.part(&request.place, template, &site, &[*joint], &[])?
            }
            LibraryAct::Drop { joint } => merging(template, Some(*joint)),
            LibraryAct::Merge { parent } => merging(template, *parent),
            LibraryAct::Inject { joints } => Operation::Tags(TagOperation::Drop {
                part: Arc::new(template.into()),
                joints: joints.clone(),
                bindings: default(),
            }),
            LibraryAct::Part { joints, options } => self.part(&request.place, template, &site, joints, options)?,
        };
        Ok(Ready::Operation(Box::new(operation)))
    }

    fn part(
        &self,
        place: &TemplatePlace,
        template: Template,
        site: &SearchPaths,
        joints: &[Uid],
        options: &[(String, String)],
    ) -> Result<Operation, PartError> {
        let name = place.part_name(self.beside.as_deref(), site);
        let part = (name, Part::from(template));
        Ok(Operation::Tags(self.added(joints, part, options)?))
    }

    fn added(
        &self,
        joints: &[Uid],
        part: (String, Part),
        options: &[(String, String)],
    ) -> Result<TagOperation, PartError> {
        added(&self.rig, (joints, &self.stroke), part, options, &self.modules, self.is_symmetric)
    }

    /// Edits that put a template in place of the rig. Where poses and keys are kept, things of the rig that the template has,
    /// too, stay the same things, and poses and keys mean the same as before.
    fn loaded(self, template: Template, keep: bool) -> Result<Ready, WorkError> {
        let now = &self.rig;
        if !keep {
            let mut edits: Vec<RigEdit> = now.clips().iter().map(|clip| RigEdit::RemoveClip(clip.uid)).collect();
            edits.extend(replacing(now, &template.rig, 1.0));
            return Ok(Ready::Load { edits, base: Arc::new(template.rig), notes: template.notes });
        }
        // Stored poses are a person's: a base without them lets them stay.
        let mut base = now.clone();
        for pose in now.stored_poses() {
            base.apply(&RigEdit::RemoveStoredPose(pose.uid))?;
        }
        let mut updated = update(Some(&base), now, &template.rig, Take::Theirs);
        let mut notes = template.notes;
        notes.extend(keep_poses(now, &mut updated.rig, &self.modules)?.iter().map(ToString::to_string));
        notes.extend(keep_clips(now, &mut updated.rig, &self.modules)?.iter().map(ToString::to_string));
        let mut edits = edits_between(now, &updated.rig)?;
        edits.extend(pose_edits(now, &updated.rig));
        edits.extend(clip_edits(now, &updated.rig)?);
        let base = Arc::new(with_identities(&template.rig, &updated.identities));
        Ok(Ready::Load { edits, base, notes })
    }
}

fn merging(template: Template, parent: Option<Uid>) -> Operation {
    Operation::Merge { other: Arc::new(template.rig), parent }
}

/// Takes over finished work.
pub(super) fn land(mut jobs: ResMut<LibraryJobs>, mut commands: Commands) {
    let jobs = jobs.bypass_change_detection();
    let Some(job) = &mut jobs.job else { return };
    commands.write_message(RequestRedraw);
    let Some(result) = check_ready(&mut job.task) else { return };
    let Some(Job { request, rig, from, .. }) = jobs.job.take() else { return };
    commands.queue(move |world: &mut World| match result {
        Ok(ready) => put(world, rig, request, &from, ready),
        Err(error) => {
            let name = request.place.stem();
            world.write_message(Notice::error(format!("{name} is not used: {error}")));
        }
    });
}

fn put(world: &mut World, rig: Entity, request: LibraryRequest, from: &(Option<Arc<Step>>, usize), ready: Ready) {
    let name = request.place.stem();
    if world.get_resource::<ActiveRig>().is_none_or(|active| active.0 != rig) {
        world.write_message(Notice::info(format!("{name} is not used: another rig was opened meanwhile")));
        return;
    }
    let (edits, base, notes) = match ready {
        Ready::Operation(operation) => {
            if let Some(warning) = doubled(world, rig, &name, &operation) {
                world.write_message(warning);
            }
            world.write_message(EditRequest::operation(rig, *operation));
            return;
        }
        Ready::Load { edits, base, notes } => (edits, base, notes),
    };
    let is_as_before = world.get::<RigHistory>(rig).is_some_and(|history| {
        let is_same = match (history.last(), &from.0) {
            (Some(now), Some(before)) => Arc::ptr_eq(now, before),
            (None, None) => true,
            _ => false,
        };
        is_same && history.undone() == from.1
    });
    if !is_as_before {
        // The rig was edited while the template was read: the work begins anew.
        world.resource_mut::<LibraryJobs>().waiting.push_front(request);
        return;
    }
    let is_fit = matches!(request.act, LibraryAct::Fit { .. });
    let mesh = if is_fit { body(world, rig) } else { None };
    if is_fit && mesh.is_none() {
        world.write_message(Notice::warning("There is no mesh to fit a skeleton into: open one first."));
        return;
    }
    for note in notes {
        world.write_message(Notice::info(note).quiet());
    }
    let template = request.place.path().map(std::path::Path::to_path_buf);
    let joints = base.len();
    world.resource_mut::<LoadSteps>().pending = Some(PendingLoad { rig, template, base, mesh });
    world.write_message(EditRequest::operation(rig, Operation::Named { name: LOAD, edits }));
    world.write_message(Notice::done(format!("Loaded {name}: {joints} joints; Ctrl+Z takes it back")));
}

/// Warning about a part that goes onto joints with commands of their own, which stay.
fn doubled(world: &World, rig: Entity, name: &str, operation: &Operation) -> Option<Notice> {
    let joints: Vec<Uid> = match operation {
        Operation::Tags(TagOperation::AddPart { joints, .. }) => joints.clone(),
        Operation::Tags(TagOperation::AddPair { sides, .. }) => {
            sides.iter().flat_map(|side| side.joints.iter().copied()).collect()
        }
        _ => return None,
    };
    let rig = world.get::<Rig>(rig)?;
    let tags = joints.iter().filter_map(|joint| rig.joint(*joint)).flat_map(|joint| &joint.data.tags);
    let count = tags.filter(|tag| matches!(tag.kind, TagKind::Command { .. })).count();
    (count > 0).then(|| {
        Notice::warning(format!(
            "{name} was added to joints that have {count} commands of their own, which stay. Ctrl+Z takes it back"
        ))
    })
}

/// The mesh with the most points, which is the body: eyes and clothes lie in it or on it.
pub(super) fn body(world: &World, rig: Entity) -> Option<Entity> {
    let meshes = world.get::<RigMeshes>(rig)?;
    meshes.iter().max_by_key(|mesh| world.get::<RigMesh>(*mesh).map_or(0, |mesh| mesh.rest.points.len()))
}
