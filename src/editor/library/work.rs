//! Work of the library: a template is read in the background and put onto the open rig, one request after the other.

use std::{collections::VecDeque, sync::Arc};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::{
    follow::{LoadSteps, PendingLoad},
    joints::{AdditionError, PartAddition, added, added_by},
    listing::{LibraryFolders, own_folder},
    sides::PartSides,
};
use crate::{
    editor::{
        ActiveRig,
        counts::counted,
        files::{
            OpenDocument,
            loading::{replacing, settled},
        },
        notice::Notice,
        panels::joint_name,
    },
    files::{
        DocumentBase, DocumentUpdate, LibraryError, RealDisk, SearchPaths, SiteError, TemplateBase, TemplatePlace,
        TemplateVersion, read_listed, update_with_known_parts,
    },
    instance::RigSource,
    plugins::{
        commands::RigModules,
        document::EditRequest,
        history::RigHistory,
        landing::{HeldResult, JobOutcome, Landing},
        surface::{RigMesh, RigMeshes},
    },
    processor::{Modules, keep_clips, keep_poses},
    rig::{
        EditError, Rig, RigEdit, Uid,
        operations::{Operation, TagOperation},
        part::{OccupiedJoint, Part, PartInstance, check_unoccupied},
        template::Template,
        update::{Take, Update, clip_edits, edits_between, pose_edits, update, with_identities},
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
    /// Puts a part onto joints, so that it stays a part; onto their partners, too, if [`PartSides`] says so.
    Part {
        /// The joints; of a single one, the chain that ends or begins there.
        joints: Vec<Uid>,
        /// Values of the part's options, as RON.
        options: Vec<(String, String)>,
    },
    /// Puts a part onto the chain at a joint, and onto its partner's as for `Part`; merges any other template below it.
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
    Addition(#[from] AdditionError),
    #[error(transparent)]
    Occupied(#[from] OccupiedJoint),
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
    landing: Landing,
    work: Work,
}

/// Work of a job.
enum Work {
    Runs(Task<Result<Ready, WorkError>>),
    /// Finished work that waits to be put onto the rig.
    Waits(Ready),
}

/// Finished work.
enum Ready {
    /// Edits that put a template in place of the rig, and what the rig has then come from.
    Load { edits: Vec<RigEdit>, base: TemplateBase, notes: Vec<String> },
    /// An operation, and what is to be said about it.
    Operation(Box<Operation>, Option<String>),
}

impl LibraryJobs {
    /// Name of the template that is being read.
    pub fn name(&self) -> Option<String> {
        let running = self.job.as_ref().filter(|job| matches!(job.work, Work::Runs(_)));
        running.map(|job| job.request.place.stem())
    }

    /// Name of the template that is read, but waits, because using it would discard steps that can be redone.
    pub fn waits(&self) -> Option<String> {
        let waiting = self.job.as_ref().filter(|job| matches!(job.work, Work::Waits(_)));
        waiting.map(|job| job.request.place.stem())
    }

    /// Stops reading a template; returns its name.
    pub(in crate::editor) fn stop(&mut self) -> Option<String> {
        let stopped = self.job.take_if(|job| matches!(job.work, Work::Runs(_)));
        stopped.map(|job| job.request.place.stem())
    }

    /// Drops a template that waits; returns its name.
    pub fn drop_waiting(&mut self) -> Option<String> {
        let dropped = self.job.take_if(|job| matches!(job.work, Work::Waits(_)));
        dropped.map(|job| job.request.place.stem())
    }
}

/// Snapshot of the open rig for the work.
pub(super) struct Snapshot {
    pub rig: Rig,
    pub modules: Arc<Modules>,
    folders: LibraryFolders,
    beside: Option<std::path::PathBuf>,
    /// Joints that the last step added.
    pub stroke: Vec<Uid>,
    /// True to put parts onto both sides.
    pub both: bool,
    /// The template that the rig follows, and the part instances that it has of that.
    followed: Option<(Uid, Vec<PartInstance>)>,
}

/// Starts the next request.
pub(super) fn start(
    mut requests: MessageReader<LibraryRequest>,
    mut jobs: ResMut<LibraryJobs>,
    mut commands: Commands,
) {
    let jobs = jobs.bypass_change_detection();
    jobs.waiting.extend(requests.read().cloned());
    // What waits for a redo would else be in the way of all that is asked for after it.
    if !jobs.waiting.is_empty()
        && let Some(name) = jobs.drop_waiting()
    {
        let text = format!("{name} is not used: another was asked for while it waited");
        commands.write_message(Notice::info(text).named());
    }
    if jobs.job.is_none()
        && let Some(request) = jobs.waiting.pop_front()
    {
        commands.queue(move |world: &mut World| begin(world, request));
    }
}

fn begin(world: &mut World, request: LibraryRequest) {
    let name = request.place.stem();
    let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else {
        let text = format!("{name} is not used: no rig is open; open or begin one first");
        world.write_message(Notice::error(text).named());
        return;
    };
    let (Some(snapshot), Some(history)) = (Snapshot::of(world, rig), world.get::<RigHistory>(rig)) else { return };
    let (landing, asked) = (Landing::asked(history), request.clone());
    let work = Work::Runs(AsyncComputeTaskPool::get().spawn(async move { snapshot.run(&asked) }));
    world.resource_mut::<LibraryJobs>().job = Some(Job { request, rig, landing, work });
    world.write_message(RequestRedraw);
}

impl Snapshot {
    /// Snapshot of a rig; `None` if it is none.
    pub(super) fn of(world: &World, rig: Entity) -> Option<Self> {
        let history = world.get::<RigHistory>(rig)?;
        Some(Self {
            rig: settled(world, rig)?,
            modules: world.get_resource::<RigModules>()?.0.clone(),
            folders: world.get_resource::<LibraryFolders>().cloned().unwrap_or_default(),
            beside: world.get::<OpenDocument>(rig).and_then(own_folder),
            stroke: added_by(history.last().map(Arc::as_ref)),
            both: PartSides::are_both(world),
            followed: world.get::<RigSource>(rig).and_then(|source| {
                let template = source.base()?.uid();
                Some((template, source.taken_over().parts.to_vec()))
            }),
        })
    }

    fn run(self, request: &LibraryRequest) -> Result<Ready, WorkError> {
        let site = self.folders.read()?;
        let template = read_listed(&RealDisk, &request.place, &site)?;
        let operation = match &request.act {
            LibraryAct::Load { keep } | LibraryAct::Fit { keep } => {
                return self.loaded(&request.place, template, *keep);
            }
            LibraryAct::Drop { joint } if template.rig.about().kind == "part" => {
                return Ok(self.part(&request.place, template, &site, &[*joint], &[])?);
            }
            LibraryAct::Drop { joint } => merging(template, Some(*joint)),
            LibraryAct::Merge { parent } => merging(template, *parent),
            LibraryAct::Inject { joints } => {
                let part = Part::from(template);
                if part.rig.about().kind == "part" {
                    check_unoccupied(&self.rig, self.instances(), &part, joints)?;
                }
                let (part, joints) = (Arc::new(part), joints.clone());
                Operation::Tags(TagOperation::Drop { part, joints, bindings: default() })
            }
            LibraryAct::Part { joints, options } => {
                return Ok(self.part(&request.place, template, &site, joints, options)?);
            }
        };
        Ok(Ready::Operation(Box::new(operation), None))
    }

    /// Part instances that the rig has of the template that it follows.
    pub(super) fn instances(&self) -> &[PartInstance] {
        self.followed.as_ref().map_or(&[][..], |(_, instances)| instances.as_slice())
    }

    fn part(
        &self,
        place: &TemplatePlace,
        template: Template,
        site: &SearchPaths,
        joints: &[Uid],
        options: &[(String, String)],
    ) -> Result<Ready, AdditionError> {
        let name = place.part_name(self.beside.as_deref(), site);
        let part = (name, Part::from(template));
        let joints = (joints, self.stroke.as_slice());
        let rig = (&self.rig, self.instances());
        let PartAddition { operation, lonely } = added(rig, joints, part, options, self.both, &self.modules)?;
        let note = lonely.and_then(|joint| self.rig.joint(joint)).map(|joint| {
            let (part, joint) = (place.stem(), joint_name(&joint.data));
            format!("{part} went onto one side only: {joint} has no partner on the other; mirror the joints first")
        });
        Ok(Ready::Operation(Box::new(Operation::Tags(operation)), note))
    }

    /// Edits that put a template in place of the rig. Where poses and keys are kept, things of the rig that the template has,
    /// too, stay the same things, and poses and keys mean the same as before.
    fn loaded(self, place: &TemplatePlace, template: Template, keep: bool) -> Result<Ready, WorkError> {
        let now = &self.rig;
        if !keep {
            let mut edits: Vec<RigEdit> = now.clips().iter().map(|clip| RigEdit::RemoveClip(clip.uid)).collect();
            edits.extend(replacing(now, &template.rig, 1.0));
            return Ok(Ready::Load { edits, base: Arc::new(template.rig).into(), notes: template.notes });
        }
        // Stored poses are a person's: a base without them lets them stay.
        let mut base = now.clone();
        for pose in now.stored_poses() {
            base.apply(&RigEdit::RemoveStoredPose(pose.uid))?;
        }
        let (mut updated, base) = self.updated(&base, place, &template);
        let mut notes = template.notes;
        notes.extend(keep_poses(now, &mut updated.rig, &self.modules)?.iter().map(ToString::to_string));
        notes.extend(keep_clips(now, &mut updated.rig, &self.modules)?.lines());
        let mut edits = edits_between(now, &updated.rig)?;
        edits.extend(pose_edits(now, &updated.rig));
        edits.extend(clip_edits(now, &updated.rig)?);
        Ok(Ready::Load { edits, base, notes })
    }

    /// The update that makes the rig the template, and the version that it has come from then. Part instances that have another
    /// name in another version of the template that the rig follows are the same ones.
    fn updated(&self, base: &Rig, place: &TemplatePlace, template: &Template) -> (Update, TemplateBase) {
        let of_parts = self.followed.as_ref().filter(|(uid, _)| *uid == template.rig.uid()).and_then(|(_, parts)| {
            let version = TemplateVersion::read(&RealDisk, place.path()?).ok()?;
            let known = DocumentBase { rig: Some(base), parts };
            update_with_known_parts(&RealDisk, known, &self.rig, &version, &Take::Theirs.into())
        });
        let (updated, taken) = match of_parts {
            Some(DocumentUpdate { update, base }) => (update, Some(base)),
            None => (update(Some(base), &self.rig, &template.rig, Take::Theirs), None),
        };
        let rig = taken.as_ref().map_or(&template.rig, TemplateVersion::rig);
        let rig = Arc::new(with_identities(rig, &updated.identities));
        let text = taken.as_ref().and_then(TemplateVersion::text_with_parts);
        (updated, TemplateBase { rig, text })
    }
}

fn merging(template: Template, parent: Option<Uid>) -> Operation {
    Operation::Merge { other: Arc::new(template.rig), parent }
}

/// Takes over finished work.
pub(super) fn land(mut jobs: ResMut<LibraryJobs>, mut commands: Commands) {
    let jobs = jobs.bypass_change_detection();
    let Some(mut job) = jobs.job.take() else { return };
    let result = match job.work {
        Work::Waits(ready) => Ok(ready),
        Work::Runs(mut task) => {
            commands.write_message(RequestRedraw);
            match check_ready(&mut task) {
                Some(result) => result,
                None => {
                    job.work = Work::Runs(task);
                    jobs.job = Some(job);
                    return;
                }
            }
        }
    };
    let Job { request, rig, landing, .. } = job;
    commands.queue(move |world: &mut World| match result {
        Ok(ready) => put(world, rig, request, landing, ready),
        Err(error) => {
            let name = request.place.stem();
            world.write_message(Notice::error(format!("{name} is not used: {error}")).named());
        }
    });
}

fn put(world: &mut World, rig: Entity, request: LibraryRequest, mut landing: Landing, ready: Ready) {
    let name = request.place.stem();
    let history = world.get::<RigHistory>(rig);
    let is_active = world.get_resource::<ActiveRig>().is_some_and(|active| active.0 == rig);
    let Some(history) = history.filter(|_| is_active) else {
        let text = format!("{name} is not used: another rig was opened meanwhile");
        world.write_message(Notice::info(text).named());
        return;
    };
    let is_as_before = landing.is_as_at_start(history);
    match landing.decide(history, || is_as_before) {
        JobOutcome::Hold { is_news } => {
            let mut jobs = world.resource_mut::<LibraryJobs>();
            jobs.bypass_change_detection().job = Some(Job { request, rig, landing, work: Work::Waits(ready) });
            if is_news {
                world.write_message(Notice::warning(HeldResult::Template.sentence()));
            }
            return;
        }
        // The rig was edited while the template was read: the work begins anew.
        JobOutcome::Drop => {
            world.resource_mut::<LibraryJobs>().waiting.push_front(request);
            return;
        }
        JobOutcome::Commit => {}
    }
    let (edits, base, notes) = match ready {
        Ready::Operation(operation, note) => {
            world.write_message(EditRequest::operation(rig, *operation));
            if let Some(note) = note {
                world.write_message(Notice::info(note));
            }
            return;
        }
        Ready::Load { edits, base, notes } => (edits, base, notes),
    };
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
    let joints = counted(base.rig.len(), "joint", "joints");
    let told = format!("Loaded {name}: {joints}; Ctrl+Z takes it back");
    let edit = EditRequest::operation(rig, Operation::Named { name: LOAD, edits });
    let request = world.resource_mut::<Messages<EditRequest>>().write(edit);
    world.resource_mut::<LoadSteps>().pending = Some(PendingLoad { request, template, base, mesh, told });
}

/// The mesh with the most points, which is the body: eyes and clothes lie in it or on it.
pub(super) fn body(world: &World, rig: Entity) -> Option<Entity> {
    let meshes = world.get::<RigMeshes>(rig)?;
    meshes.iter().max_by_key(|mesh| world.get::<RigMesh>(*mesh).map_or(0, |mesh| mesh.rest.points.len()))
}
