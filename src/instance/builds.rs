//! The thread that builds templates and watches their files.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use bevy::{asset::AssetId, log::error};

use super::{RigTemplate, TemplateError, exchange::NextVersion, template_file::TemplateFile};
use crate::{
    files::{PartCache, PartFiles, RealDisk, TemplateWatch},
    plugins::commands::NamedProgramError,
    processor::{BuildError, Builder, Modules, SourceText, with_missing_name},
    rig::{
        BuiltRig, NodeType, Rig, Uid,
        part::{PartInstance, PartSocket, have_same_fields},
        template,
        update::{Change, Take, update, with_identities},
    },
    solve::program::{CompileOptions, ExposedNode, Keep, ProgramCache, ProgramError, RigProgram},
};

/// Template with the results of its commands, compiled.
#[derive(Debug)]
pub struct BuiltTemplate {
    /// The template's rig. What got another name since the template was built first has its first uid.
    pub rig: Arc<Rig>,
    /// The rig as the file has it.
    source: Arc<Rig>,
    /// Nodes and constraints.
    pub built: Arc<BuiltRig>,
    /// Program with all nodes, for instances in [`InstanceMode::Hierarchy`](crate::plugins::runtime::InstanceMode).
    pub whole: Arc<RigProgram>,
    /// Program with joints and controls, for instances in [`InstanceMode::Direct`](crate::plugins::runtime::InstanceMode).
    pub lean: Arc<RigProgram>,
    /// Places that other things hang on.
    pub sockets: Arc<[PartSocket]>,
    /// Places that other things hang on, as the file has them.
    file_sockets: Arc<[PartSocket]>,
    /// Part instances, as the file has them.
    instances: Arc<[PartInstance]>,
    /// Programs with joints and some nodes, for instances with [`ExposedNodes`](super::ExposedNodes).
    some: Mutex<Vec<(Vec<ExposedNode>, Arc<RigProgram>)>>,
    /// Differences from the build before.
    pub changes: Arc<[Change]>,
    /// Tags of the commands that ran, in their order.
    pub ran: Arc<[Uid]>,
    /// Way from the build before to this one.
    pub(super) way: Option<NextVersion>,
    /// The file; `None` for a template that comes from none on this disk.
    pub(super) file: Option<Arc<TemplateFile>>,
}

impl BuiltTemplate {
    /// True if it was built from that content of a file.
    #[cfg(feature = "remote")]
    pub(crate) fn is_of(&self, template: &RigTemplate) -> bool {
        self.has_build_of(template) && have_same_fields(&self.instances, template.instances())
    }

    /// True if the content of a file gives the same build. Its part instances may have other fields, as the sides of parts that
    /// are the same on both.
    fn has_build_of(&self, template: &RigTemplate) -> bool {
        self.source == *template.rig() && self.file_sockets == *template.sockets()
    }

    /// The next version of the template, whose content gives the same build.
    fn with_content(self: &Arc<Self>, template: &RigTemplate, file: Option<Arc<TemplateFile>>) -> Arc<Self> {
        let some = self.some.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Arc::new(Self {
            rig: self.rig.clone(),
            source: self.source.clone(),
            built: self.built.clone(),
            whole: self.whole.clone(),
            lean: self.lean.clone(),
            sockets: self.sockets.clone(),
            file_sockets: self.file_sockets.clone(),
            instances: template.instances().clone(),
            some: Mutex::new(some),
            changes: Arc::from([]),
            ran: Arc::from([]),
            way: Some(NextVersion::between(self, (&*self.rig, &*self.built), std::iter::empty())),
            file,
        })
    }

    /// Program with joints, and those nodes besides. It is compiled once.
    ///
    /// # Errors
    /// A node that the rig does not have.
    pub fn exposing(&self, exposed: &[ExposedNode]) -> Result<Arc<RigProgram>, ProgramError> {
        let mut some = self.some.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = some.iter().find(|(known, _)| known == exposed) {
            return Ok(known.clone());
        }
        let program = Arc::new(RigProgram::compile(&self.built, &self.options(exposed.to_vec()))?);
        some.push((exposed.to_vec(), program.clone()));
        Ok(program)
    }

    fn options(&self, exposed: Vec<ExposedNode>) -> CompileOptions {
        lean_options(exposed, &self.rig, &self.sockets, &self.built)
    }
}

/// Options of a program with joints, sockets and those nodes. Joints that stored poses move, as those of a face, can be posed.
fn lean_options(mut exposed: Vec<ExposedNode>, rig: &Rig, sockets: &[PartSocket], built: &BuiltRig) -> CompileOptions {
    let moved: BTreeSet<Uid> = rig.stored_poses().iter().flat_map(|pose| pose.offsets.keys().copied()).collect();
    let posed = built.nodes.iter().filter(|node| node.kind == NodeType::Joint && moved.contains(&node.uid));
    exposed.extend(posed.map(|node| ExposedNode::Uid(node.uid)));
    let joints = sockets.iter().filter_map(|socket| socket.joint);
    let there = joints.filter(|joint| built.nodes.iter().any(|node| node.uid == *joint));
    exposed.extend(there.map(ExposedNode::Uid));
    CompileOptions { keep: Keep::DeformAndExposed(exposed), ..CompileOptions::default() }
}

type Id = AssetId<RigTemplate>;

/// Work for the thread.
pub(super) enum Work {
    /// Builds a template.
    Build { id: Id, template: RigTemplate, modules: Arc<Modules> },
    /// Reads and builds a template's file, and watches it if so wanted.
    Open { id: Id, file: PathBuf, modules: Arc<Modules>, is_watched: bool },
    /// Watches a template's file.
    Watch { id: Id, file: PathBuf, modules: Arc<Modules> },
    /// Takes a content for that of a template's file.
    Content { id: Id, content: Vec<u8>, modules: Arc<Modules> },
    /// Forgets a template.
    Forget { id: Id },
    /// Takes the function that lets an app which sleeps run a frame.
    Wake(Wake),
}

/// Function that is called after each result.
pub(super) type Wake = Box<dyn Fn() + Send>;

/// Result of some work.
pub(super) struct Outcome {
    pub id: Id,
    /// The template, if it was read from its file.
    pub template: Option<RigTemplate>,
    pub result: Result<Arc<BuiltTemplate>, TemplateError>,
}

/// The thread, seen from outside. It ends when this is dropped.
pub(super) struct Builds {
    work: Sender<Work>,
    outcomes: Mutex<Receiver<Outcome>>,
}

impl Builds {
    pub fn start(look: Duration, patience: Duration) -> Self {
        let (work, received) = channel();
        let (told, outcomes) = channel();
        let answers = Answers { told, wake: None };
        let mut thread = BuildThread { templates: BTreeMap::new(), answers, look, patience };
        if let Err(error) = thread::Builder::new().name("rig templates".to_owned()).spawn(move || thread.run(&received))
        {
            error!("templates cannot be built, because no thread can be started: {error}");
        }
        Self { work, outcomes: Mutex::new(outcomes) }
    }

    pub fn send(&self, work: Work) {
        // The thread lives as long as this; without it nothing is built, which was told when it could not be started.
        let _ = self.work.send(work);
    }

    /// Results of the work since the last call.
    pub fn outcomes(&self) -> Vec<Outcome> {
        self.outcomes.lock().unwrap_or_else(PoisonError::into_inner).try_iter().collect()
    }
}

/// Way of results to the app.
struct Answers {
    told: Sender<Outcome>,
    wake: Option<Wake>,
}

impl Answers {
    fn tell(&self, outcome: Outcome) {
        // Nobody hears it once the app has ended.
        let _ = self.told.send(outcome);
        if let Some(wake) = &self.wake {
            wake();
        }
    }
}

struct BuildThread {
    templates: BTreeMap<Id, TemplateBuild>,
    answers: Answers,
    look: Duration,
    patience: Duration,
}

/// A template that has been built.
struct TemplateBuild {
    modules: Arc<Modules>,
    builder: Builder,
    programs: ProgramCache,
    /// The last build that succeeded.
    good: Option<Arc<BuiltTemplate>>,
    file: Option<PathBuf>,
    watch: Option<TemplateWatch>,
    /// Parts that the file has used.
    parts: PartCache,
    /// Uids of things that got another name since they were built first, by those of their names now.
    identities: HashMap<Uid, Uid>,
    /// Reason for which the file's content was not taken over, and since when it has been so.
    fault: Option<(Instant, TemplateError)>,
}

/// Share of the time that looks at files may take: the pause is longer with more of them.
const PAUSE_FOR_EACH: Duration = Duration::from_micros(100);

impl BuildThread {
    fn run(&mut self, work: &Receiver<Work>) {
        loop {
            let watched = || self.templates.values().filter_map(|kept| kept.watch.as_ref());
            let watches: usize = watched().map(TemplateWatch::count).sum();
            let next = if watches == 0 {
                work.recv().map_err(|_| RecvTimeoutError::Disconnected)
            } else {
                let look = if watched().any(TemplateWatch::is_pending) { self.look / 2 } else { self.look };
                work.recv_timeout(look.max(PAUSE_FOR_EACH * watches as u32))
            };
            match next {
                Ok(work) => self.carry_out(work),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            let patience = self.patience;
            for (id, kept) in &mut self.templates {
                if let Some(outcome) = kept.look(*id, patience) {
                    self.answers.tell(outcome);
                }
            }
        }
    }

    fn carry_out(&mut self, work: Work) {
        let outcome = match work {
            Work::Build { id, template, modules } => Some(self.kept(id, &modules).build(id, template, false)),
            Work::Open { id, file, modules, is_watched } => {
                let mut watch = TemplateWatch::new(&file);
                let kept = self.kept(id, &modules);
                kept.file = Some(file);
                let content = watch.read(&RealDisk);
                kept.watch = is_watched.then_some(watch);
                Some(match content {
                    Ok(content) => kept.content(id, &content).unwrap_or_else(|error| refused(id, error)),
                    Err(error) => refused(id, TemplateError::Load(error.to_string())),
                })
            }
            Work::Watch { id, file, modules } => {
                let kept = self.kept(id, &modules);
                kept.watch = Some(TemplateWatch::new(&file));
                kept.file = Some(file);
                None
            }
            Work::Content { id, content, modules } => {
                let kept = self.kept(id, &modules);
                Some(kept.content(id, &content).unwrap_or_else(|error| refused(id, error)))
            }
            Work::Forget { id } => {
                self.templates.remove(&id);
                None
            }
            Work::Wake(wake) => {
                self.answers.wake = Some(wake);
                None
            }
        };
        if let Some(outcome) = outcome {
            self.answers.tell(outcome);
        }
    }

    fn kept(&mut self, id: Id, modules: &Arc<Modules>) -> &mut TemplateBuild {
        self.templates.entry(id).or_insert_with(|| TemplateBuild {
            modules: modules.clone(),
            builder: Builder::new(modules.clone()),
            programs: ProgramCache::default(),
            good: None,
            file: None,
            watch: None,
            parts: PartCache::default(),
            identities: HashMap::new(),
            fault: None,
        })
    }
}

fn refused(id: Id, error: TemplateError) -> Outcome {
    Outcome { id, template: None, result: Err(error) }
}

impl TemplateBuild {
    /// Looks at the file: takes over a new content, or tells why not once it has been so for a while.
    fn look(&mut self, id: Id, patience: Duration) -> Option<Outcome> {
        // A save after this moment is not seen by the look, so what the look finds cannot be told for longer.
        let now = Instant::now();
        let watch = self.watch.as_mut()?;
        let content = watch.look(&RealDisk);
        // Another content that may still be written decides first.
        let is_pending = watch.is_pending();
        let outcome = content.and_then(|content| match self.content(id, &content) {
            Ok(outcome) => {
                self.fault = None;
                Some(outcome)
            }
            Err(error) => {
                self.fault = Some((Instant::now(), error));
                None
            }
        });
        if outcome.is_none()
            && !is_pending
            && let Some((_, error)) = self.fault.take_if(|(since, _)| now.saturating_duration_since(*since) >= patience)
        {
            return Some(refused(id, error));
        }
        outcome
    }

    /// Reads and builds a content of the file. An error leaves everything as it is; it is told by the caller.
    fn content(&mut self, id: Id, content: &[u8]) -> Result<Outcome, TemplateError> {
        let parts = std::mem::take(&mut self.parts);
        let mut files = PartFiles::with_modules(&RealDisk, self.modules.clone()).with_cache(parts);
        let read = match &self.file {
            Some(file) => RigTemplate::read_with_parts(content, file, &mut files),
            None => RigTemplate::read(content),
        };
        self.parts = std::mem::take(&mut files.cache);
        if read.is_ok() {
            self.parts.keep(files.asked.keys());
        }
        if let Some(watch) = &mut self.watch {
            watch.follow(files.asked, read.is_ok());
        }
        let template = read.map_err(|source| TemplateError::Source { file: self.file.clone(), source })?;
        let outcome = self.build(id, template, true);
        match outcome.result {
            Err(error) => Err(error),
            Ok(_) => Ok(outcome),
        }
    }

    /// Builds a template; after a failure everything is as it was before.
    fn build(&mut self, id: Id, template: RigTemplate, is_of_file: bool) -> Outcome {
        let result = self.built(&template);
        if result.is_err()
            && let Some(good) = &self.good
        {
            self.builder.sync(&good.rig);
            self.builder.run_all();
        }
        if let Ok(built) = &result {
            self.good = Some(built.clone());
        }
        Outcome { id, template: is_of_file.then_some(template), result }
    }

    fn built(&mut self, template: &RigTemplate) -> Result<Arc<BuiltTemplate>, TemplateError> {
        let source = template.rig();
        if let Some(good) = self.good.as_ref().filter(|good| good.has_build_of(template)) {
            // Rigs with documents take over the fields of part instances, whatever comes of these.
            let is_same = have_same_fields(&good.instances, template.instances());
            return Ok(if is_same { good.clone() } else { good.with_content(template, self.file_of(template)) });
        }
        let mut identities = HashMap::new();
        let (rig, changes) = match &self.good {
            None => (source.clone(), Vec::new()),
            Some(good) => {
                let known = Some(&self.identities).filter(|known| !known.is_empty());
                let known = known.map(|known| Arc::new(with_identities(source, known)));
                let file = known.as_ref().unwrap_or(source);
                let updated = update(Some(&good.rig), &good.rig, file, Take::Theirs);
                let rig = if updated.identities.is_empty() { file.clone() } else { Arc::new(updated.rig) };
                identities = updated.identities;
                (rig, updated.changes)
            }
        };
        self.builder.sync(&rig);
        let report = self.builder.run_all();
        if let Some(error) = report.error {
            // The file knows its places by its own uids.
            let of_file = if rig == *source { None } else { Builder::build(source, &self.modules).err() };
            let error = match of_file {
                Some(error) => with_missing_name(source, &self.modules, error),
                None => with_missing_name(&rig, &self.modules, error),
            };
            return Err(self.placed(template, &error));
        }
        let built = self.builder.shared_built();
        self.identities.extend(identities);
        let file_sockets = template.sockets().clone();
        let sockets: Arc<[PartSocket]> = file_sockets.iter().map(|socket| self.named_first(socket, &rig)).collect();
        let mut program = |options: &CompileOptions| self.programs.get(&built, options);
        let programs: Result<_, ProgramError> = program(&CompileOptions::default()).and_then(|whole| {
            Ok((whole, program(&lean_options(vec![ExposedNode::Controls], &rig, &sockets, &built))?))
        });
        let (whole, lean) = programs
            .map_err(|error| NamedProgramError::new(error, &rig))
            .map_err(|source| TemplateError::CannotRun { file: self.file.clone(), source })?;
        let (source, changes, ran) = (source.clone(), changes.into(), report.executed.into());
        // What instances expose is compiled here, and not in the frame that takes the template over.
        let before = self.good.as_ref().map(|good| good.some.lock().unwrap_or_else(PoisonError::into_inner).clone());
        let (mut some, mut pairs) = (Vec::new(), Vec::new());
        for (exposed, program) in before.into_iter().flatten() {
            self.programs.adopt(&program);
            let options = lean_options(exposed.clone(), &rig, &sockets, &built);
            // A node that is gone is told by the instance that wants it.
            let Ok(now) = self.programs.get(&built, &options) else { continue };
            some.push((exposed, now.clone()));
            pairs.push((program, now));
        }
        let way = self.good.as_ref().map(|good| {
            let pairs = pairs.iter().map(|(before, now)| (before, now));
            let programs = [(&good.whole, &whole), (&good.lean, &lean)].into_iter().chain(pairs);
            NextVersion::between(good, (&*rig, &*built), programs)
        });
        let some = Mutex::new(some);
        let (instances, file) = (template.instances().clone(), self.file_of(template));
        Ok(Arc::new(BuiltTemplate {
            rig,
            source,
            built,
            whole,
            lean,
            sockets,
            file_sockets,
            instances,
            some,
            changes,
            ran,
            way,
            file,
        }))
    }

    /// The file of a template; `None` if it was made by code, or is in another file.
    fn file_of(&self, template: &RigTemplate) -> Option<Arc<TemplateFile>> {
        let is_of_file = self.file.as_deref().is_some_and(|file| file == template.file());
        is_of_file.then(|| Arc::new(TemplateFile::of(template.clone())))
    }

    /// A socket whose joint has the uid that it got first.
    fn named_first(&self, socket: &PartSocket, rig: &Rig) -> PartSocket {
        let renamed = socket.joint.filter(|joint| rig.joint(*joint).is_none());
        let first = renamed.and_then(|joint| self.identities.get(&joint).copied());
        PartSocket { joint: first.or(socket.joint), ..socket.clone() }
    }

    /// An error of a command at its place in the text.
    fn placed(&self, template: &RigTemplate, error: &BuildError) -> TemplateError {
        let explicit = template::explicit(template.text());
        let text = SourceText::new(&explicit);
        let source = text.locate_with_parts(template.rig(), error, template.origins());
        TemplateError::Source { file: self.file.clone(), source }
    }
}
