//! The processor: follows a document, carries out what has to be carried out, and knows how far it has come.

mod dependencies;
mod find;
mod finite;
mod follow;
mod loops;
mod status;
mod waste;

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashSet},
    sync::Arc,
    time::Instant,
};

pub use dependencies::CommandDependency;
pub use find::FindError;
use loops::SettledPlaces;
pub use status::{CommandCounts, CommandState, CommandStatus};

use super::{
    BuildError, BuildProblem, BuildRange, BuildScope, DynModule, ListEntry, ModuleError, Modules, error_references,
    exclusion::{CommandExclusion, SkipReason},
    resolve::Asker,
    scope::Trace,
    snapshot::{self, BuiltCache},
    world::{Aspect, NOWHERE, NodeId, Value, World, same},
};
use crate::rig::{BuiltRig, Rig, Uid};

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunReport {
    /// Commands that were executed, in order.
    pub executed: Vec<Uid>,
    /// The command that stopped it.
    pub error: Option<BuildError>,
    /// Number of commands in effect after the run.
    pub cursor: usize,
}

/// Work that a command needs before it counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum DueWork {
    Nothing,
    /// Input that the command read may have changed.
    Check,
    Run,
}

struct Command {
    joint: Uid,
    module: Arc<str>,
    params: Arc<str>,
    loaded: Option<Result<Arc<dyn DynModule>, BuildProblem>>,
    /// The tag's own switch, and its feature: with the group of the joint they decide whether it is active.
    enabled: bool,
    feature: Option<Uid>,
    active: bool,
    trace: Trace,
    /// True if it looked for nodes when it ran last.
    asks: bool,
    /// The run in which it ran last.
    ran_in: u32,
    due: DueWork,
    error: Option<BuildProblem>,
    micros: f32,
    runs: u32,
}

/// Builder of one rig. It keeps all values that commands read and wrote, so that a later build runs only commands whose
/// inputs changed.
pub struct Builder {
    modules: Arc<Modules>,
    range: BuildRange,
    rig: Uid,
    world: World,
    commands: Vec<Command>,
    list: Vec<u32>,
    due: BinaryHeap<Reverse<(u32, u32)>>,
    cursor: u32,
    failed: Option<u32>,
    breakpoints: HashSet<Uid>,
    /// First place from which something that can close a circle of constraints has changed.
    graph_changed: Option<u32>,
    settled: SettledPlaces,
    /// First place from which references may find other nodes than before.
    structure_changed: Option<u32>,
    /// Nodes that have moved, or have another parent, and whose readers in the rig's space are not marked yet.
    moved: Vec<NodeId>,
    /// Counts runs.
    run: u32,
    /// Result of the last run as plain data, with what has changed since.
    built: BuiltCache,
    /// Number of kept nodes and commands from which on those that are gone are counted.
    next_count: usize,
}

impl Builder {
    /// A builder that knows these modules.
    pub fn new(modules: Arc<Modules>) -> Self {
        Self {
            world: World::new(modules.limits),
            modules,
            range: BuildRange::Rig,
            rig: Uid(0),
            commands: Vec::new(),
            list: Vec::new(),
            due: BinaryHeap::new(),
            cursor: 0,
            failed: None,
            breakpoints: HashSet::new(),
            graph_changed: None,
            settled: SettledPlaces::default(),
            structure_changed: None,
            moved: Vec::new(),
            run: 0,
            built: BuiltCache::default(),
            next_count: waste::FEW,
        }
    }

    /// Builds all of a rig from nothing.
    ///
    /// # Errors
    /// The first command that fails.
    pub fn build(rig: &Rig, modules: &Arc<Modules>) -> Result<BuiltRig, BuildError> {
        let mut builder = Self::new(modules.clone());
        builder.sync(rig);
        match builder.run_all().error {
            Some(error) => Err(error),
            None => Ok(builder.built()),
        }
    }

    /// Commands of other joints are left out of the list from the next [`Builder::sync`] on.
    pub fn set_range(&mut self, range: BuildRange) {
        self.range = range;
    }

    /// Marks the later readers of a cell, whose content `writer` (`None`: the document) has changed, to be looked at.
    /// Readers in the rig's space wait for [`Builder::spread_moves`].
    /// `circles` is true if that may have closed a circle of constraints.
    fn changed(&mut self, node: NodeId, aspect: Aspect, writer: Option<u32>, circles: bool) {
        self.built.note(node, aspect);
        let from = writer.map(|writer| self.world.places[writer as usize]);
        let later = |world: &World, number: u32| {
            let place = world.places[number as usize];
            place != NOWHERE && from.is_none_or(|from| place > from)
        };
        let readers: Vec<u32> = self.world.cell(node, aspect).readers().to_vec();
        for number in readers {
            if later(&self.world, number) {
                self.mark(number, DueWork::Check);
            }
        }
        if matches!(aspect, Aspect::Base | Aspect::Parent) && self.world.global_reads > 0 {
            self.moved.push(node);
        }
        if aspect.is_structure() {
            let from = from.map_or(0, |from| from + 1);
            self.structure_changed = Some(self.structure_changed.map_or(from, |before| before.min(from)));
        }
        if circles {
            let from = from.unwrap_or(0);
            self.graph_changed = Some(self.graph_changed.map_or(from, |before| before.min(from)));
        }
    }

    /// Lets all commands that look for nodes look again, from where one of them may find others.
    fn spread_structure(&mut self) {
        let Some(from) = self.structure_changed.take() else { return };
        for at in from as usize..self.list.len() {
            let number = self.list[at];
            let command = &self.commands[number as usize];
            if command.due == DueWork::Nothing && command.asks {
                self.mark(number, DueWork::Check);
            }
        }
    }

    /// Value that a command wrote to a cell.
    fn own(&self, number: u32, node: NodeId, aspect: Aspect) -> Option<&Value> {
        let writes = self.world.cell(node, aspect).writes();
        writes.iter().find(|(writer, _)| *writer == number).map(|(_, value)| value)
    }

    /// The commands in order.
    pub fn list(&self) -> Vec<ListEntry> {
        let entry = |number: &u32| {
            let command = &self.commands[*number as usize];
            ListEntry {
                command: self.world.commands[*number as usize],
                joint: command.joint,
                module: command.module.clone(),
                active: command.active,
            }
        };
        self.list.iter().map(entry).collect()
    }

    /// The number of commands in the list.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// True if there is no command.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Number of commands in effect: the ones before this place in the list. After a change of the document that may be
    /// fewer than before, until the next run.
    pub fn cursor(&self) -> usize {
        let due = match self.due.peek() {
            Some(Reverse(first)) if !self.is_waiting(*first) => {
                self.due.iter().filter(|Reverse(entry)| self.is_waiting(*entry)).map(|Reverse((place, _))| *place).min()
            }
            first => first.map(|Reverse((place, _))| *place),
        };
        due.map_or(self.cursor, |due| due.min(self.cursor)) as usize
    }

    /// True for an entry of the heap whose command still needs work at that place.
    fn is_waiting(&self, (place, number): (u32, u32)) -> bool {
        self.commands[number as usize].due != DueWork::Nothing && self.world.places[number as usize] == place
    }

    /// A run with [`Builder::run`] stops before commands with a breakpoint.
    pub fn set_breakpoint(&mut self, tag: Uid, on: bool) {
        if on {
            self.breakpoints.insert(tag);
        } else {
            self.breakpoints.remove(&tag);
        }
    }

    /// Tags with a breakpoint.
    pub fn breakpoints(&self) -> &HashSet<Uid> {
        &self.breakpoints
    }

    /// Carries out all commands, whatever the breakpoints.
    pub fn run_all(&mut self) -> RunReport {
        self.run_to(self.list.len())
    }

    /// Goes on to the next breakpoint, or to the end. Starts over a breakpoint that it stands at.
    pub fn run(&mut self) -> RunReport {
        let from = (self.cursor() + 1).min(self.list.len());
        let stop = self.list[from..]
            .iter()
            .position(|number| self.breakpoints.contains(&self.world.commands[*number as usize]));
        self.run_to(stop.map_or(self.list.len(), |at| from + at))
    }

    /// Carries out the next command.
    pub fn step_forward(&mut self) -> RunReport {
        self.run_to(self.cursor() + 1)
    }

    /// Rolls the last command back.
    pub fn step_back(&mut self) -> RunReport {
        self.run_to(self.cursor().saturating_sub(1))
    }

    /// Carries out the rest of the commands of the joint whose turn it is.
    pub fn joint_forward(&mut self) -> RunReport {
        let at = self.cursor();
        let joint = self.list.get(at).map(|number| self.commands[*number as usize].joint);
        let same = |number: &&u32| Some(self.commands[**number as usize].joint) == joint;
        let count = self.list.get(at..).unwrap_or_default().iter().take_while(same).count();
        self.run_to(at + count)
    }

    /// Rolls back the commands of the joint that was last.
    pub fn joint_back(&mut self) -> RunReport {
        let at = self.cursor();
        let joint = at.checked_sub(1).map(|at| self.commands[self.list[at] as usize].joint);
        let same = |number: &&u32| Some(self.commands[**number as usize].joint) == joint;
        let count = self.list[..at].iter().rev().take_while(same).count();
        self.run_to(at - count)
    }

    /// Rolls everything back.
    pub fn roll_back(&mut self) -> RunReport {
        self.run_to(0)
    }

    /// Goes to a place in the list, forwards or backwards: commands before it are in effect then, unless one of them
    /// fails. Executes only what has not been executed as things stand now.
    pub fn run_to(&mut self, place: usize) -> RunReport {
        let target = place.min(self.list.len()) as u32;
        self.run = self.run.wrapping_add(1);
        self.world.work_before = self.world.work;
        let mut report = RunReport::default();
        let mut failed = None;
        while let Some(Reverse((place, number))) = self.due.peek().copied() {
            if place >= target {
                break;
            }
            self.due.pop();
            if !self.is_waiting((place, number)) {
                continue;
            }
            let due = self.commands[number as usize].due;
            if due == DueWork::Check && self.holds(number) {
                self.commands[number as usize].due = DueWork::Nothing;
                continue;
            }
            self.commands[number as usize].due = DueWork::Nothing;
            let result = self.execute(number);
            if self.commands[number as usize].active {
                report.executed.push(self.world.commands[number as usize]);
            }
            if let Err(problem) = result {
                failed = Some((number, problem));
                break;
            }
        }
        let reached = failed.as_ref().map_or(target, |(number, _)| self.world.places[*number as usize]);
        failed = self.loop_before(reached).or(failed);
        self.failed = None;
        self.cursor = target;
        if let Some((number, problem)) = failed {
            // It is tried again in the next run: whatever made it fail may be gone.
            self.mark(number, DueWork::Run);
            self.cursor = self.world.places[number as usize];
            self.failed = Some(number);
            self.commands[number as usize].error = Some(problem.clone());
            report.error = Some(self.error(number, problem));
        }
        // With an entry in effect at the top, the cursor is known without a search.
        while self.due.peek().is_some_and(|Reverse(first)| !self.is_waiting(*first)) {
            self.due.pop();
        }
        report.cursor = self.cursor as usize;
        report
    }

    fn error(&self, number: u32, problem: BuildProblem) -> BuildError {
        let command = &self.commands[number as usize];
        let joint = self.world.id(command.joint);
        let label = joint.and_then(|joint| self.world.label(joint, self.world.places[number as usize]));
        BuildError {
            command: self.world.commands[number as usize],
            joint: command.joint,
            joint_label: label.map_or_else(|| command.joint.to_string(), |label| label.to_string()).into(),
            module: (*command.module).into(),
            problem,
        }
    }

    fn asker(&self, number: u32) -> Option<Asker> {
        let joint = self.world.id(self.commands[number as usize].joint)?;
        Some(Asker { rig: self.rig, joint, place: self.world.places[number as usize] })
    }

    /// True if the command would read the same as before.
    fn holds(&self, number: u32) -> bool {
        let command = &self.commands[number as usize];
        command.error.is_none() && self.asker(number).is_some_and(|asker| command.trace.holds(&self.world, asker))
    }

    fn execute(&mut self, number: u32) -> Result<(), BuildProblem> {
        self.settled.begin(self.run, self.world.places[number as usize]);
        let old = std::mem::take(&mut self.commands[number as usize].trace);
        let before = self.take_back(number, &old);
        let mut trace = Trace::default();
        let started = Instant::now();
        let active = self.commands[number as usize].active;
        let outcome = if active { self.construct(number, &mut trace) } else { Ok(()) };
        let above = trace.above;
        if outcome.is_err() {
            let (reads, globals) = (std::mem::take(&mut trace.reads), std::mem::take(&mut trace.globals));
            self.take_back(number, &trace);
            trace = Trace { reads, globals, ..Trace::default() };
        }
        let result = match outcome {
            Err(BuildProblem::Module(ModuleError::Off { parameter, off })) => {
                let module = self.commands[number as usize].module.clone();
                let reason = SkipReason::Reference { parameter: parameter.into(), off };
                self.set_command_off(number, Some(CommandExclusion { module, reason, above }));
                Ok(())
            }
            outcome => {
                if active {
                    self.set_command_off(number, None);
                }
                outcome
            }
        };
        self.set_partial(number, trace.partial.clone());
        // Early cut-off: only what is not as before concerns others.
        for (node, aspect) in &trace.writes {
            let was = before.binary_search_by_key(&(*node, *aspect), |(node, aspect, _)| (*node, *aspect));
            let was = was.ok().map(|at| &before[at].2);
            let now = self.own(number, *node, *aspect);
            if !same(now, was) {
                let circles = *aspect == Aspect::Parent || *aspect == Aspect::Constraint && !drives_alike(now, was);
                self.changed(*node, *aspect, Some(number), circles);
            }
        }
        for (node, aspect, _) in &before {
            if self.own(number, *node, *aspect).is_none() {
                // Taking something away never closes a circle.
                self.changed(*node, *aspect, Some(number), *aspect == Aspect::Parent);
            }
        }
        let command = &mut self.commands[number as usize];
        command.asks = trace.asks();
        command.trace = trace;
        command.ran_in = self.run;
        if command.active {
            command.runs += 1;
            command.micros = started.elapsed().as_nanos() as f32 / 1000.0;
        }
        command.error = result.clone().err();
        self.spread_moves(Some(number));
        self.spread_structure();
        result
    }

    fn construct(&mut self, number: u32, trace: &mut Trace) -> Result<(), BuildProblem> {
        let Some(asker) = self.asker(number) else {
            return Err(ModuleError::other("the joint of the tag is not in the built rig").into());
        };
        let mut deadlines = self.modules.deadline.iter().chain(&self.world.deadline);
        deadlines.try_for_each(|deadline| deadline.check("building the rig"))?;
        let command = &mut self.commands[number as usize];
        let modules = &self.modules;
        let loaded = command.loaded.get_or_insert_with(|| modules.load(&command.module, &command.params));
        let module = loaded.clone()?;
        let name = command.module.clone();
        self.world.begin_command();
        let mut scope = BuildScope::new(&mut self.world, trace, asker, number, name);
        if let Err(problem) = module.construct(&mut scope) {
            let params = &self.commands[number as usize].params;
            return Err(error_references::as_written(problem, params, &self.world, asker.place));
        }
        self.world.check_work()?;
        Ok(self.check_writes(number, &trace.writes, asker.place + 1)?)
    }

    /// Removes what a command wrote, and returns it; unregisters what it read.
    fn take_back(&mut self, number: u32, trace: &Trace) -> Vec<(NodeId, Aspect, Value)> {
        for read in &trace.reads {
            if let super::scope::Read::Cell(node, aspect, _) = read {
                let readers = self.world.cell_mut(*node, *aspect).readers_mut();
                if let Ok(at) = readers.binary_search(&number) {
                    readers.remove(at);
                }
            }
        }
        for node in trace.globals.keys() {
            let readers = &mut self.world.slots[node.0 as usize].global_readers;
            if let Ok(at) = readers.binary_search(&number) {
                readers.remove(at);
                self.world.global_reads -= 1;
            }
        }
        let mut values = Vec::with_capacity(trace.writes.len());
        for (node, aspect) in &trace.writes {
            self.world.anchors.note_written(*node, *aspect);
            let writes = self.world.cell_mut(*node, *aspect).writes_mut();
            if let Some(at) = writes.iter().position(|(writer, _)| *writer == number) {
                values.push((*node, *aspect, writes.swap_remove(at).1));
            }
        }
        values.sort_unstable_by_key(|(node, aspect, _)| (*node, *aspect));
        values
    }

    /// The built rig as the commands before the cursor made it.
    pub fn built(&self) -> BuiltRig {
        snapshot::snapshot(&self.world, self.cursor() as u32)
    }

    /// Result of [`Builder::built`], shared: a rig in which nothing has changed since the last call is the same in
    /// memory, and of others only the nodes and constraints that have changed are read again.
    pub fn shared_built(&mut self) -> Arc<BuiltRig> {
        let place = self.cursor() as u32;
        self.built.refresh(&self.world, place)
    }
}

/// True if two constraints drive the same and read the same, so that none of them can close a circle that the other
/// does not.
fn drives_alike(now: Option<&Value>, was: Option<&Value>) -> bool {
    match (now, was) {
        (Some(Value::Constraint(_, now)), Some(Value::Constraint(_, was))) => {
            now.drives() == was.drives() && now.reads() == was.reads()
        }
        _ => false,
    }
}
