//! Progress of commands.

use super::{Builder, Command};
use crate::{
    processor::{BuildProblem, Deadline, SkipReason, scope::Trace, world::NOWHERE},
    rig::Uid,
};

/// State of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandState {
    /// Waiting to be carried out: for the first time, or again after it was rolled back.
    Pending,
    /// Carried out.
    Done,
    /// Passed over: its tag, its feature or its joint's group is off, or something that it cannot do without.
    Skipped,
    /// Failed; the build stands before it.
    Failed,
}

/// State, time and problem of a command.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandStatus {
    /// State of the command.
    pub state: CommandState,
    /// Duration of its last run, in microseconds.
    pub micros: f32,
    /// Number of its runs since the builder was made.
    pub runs: u32,
    /// Reason why the command failed, if it did.
    pub error: Option<BuildProblem>,
    /// Reason why the build passes the command over, if it does.
    pub skipped: Option<SkipReason>,
}

/// Numbers of the commands of a list, by whether a build carries them out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CommandCounts {
    /// Number of commands in effect.
    pub built: usize,
    /// Number of commands that a build carries out.
    pub all: usize,
    /// Number of commands that a build passes over, because something is off.
    pub off: usize,
}

impl Builder {
    /// Sets the end of the time in which commands may begin; those that would begin later fail and tell that. It holds for all
    /// runs until another one is set, beside that of the modules.
    pub fn set_deadline(&mut self, deadline: Deadline) {
        self.world.deadline = Some(deadline);
    }

    /// Numbers of commands: those in effect, those that a whole build carries out, and those that it passes over. References
    /// to something that is off are known from the first run on.
    pub fn counts(&self) -> CommandCounts {
        let cursor = self.cursor();
        let mut counts = CommandCounts::default();
        for (place, number) in self.list.iter().enumerate() {
            if !self.commands[*number as usize].active || self.world.off.commands.contains_key(number) {
                counts.off += 1;
            } else {
                counts.all += 1;
                counts.built += usize::from(place < cursor);
            }
        }
        counts
    }

    /// State, time and problem of a command; `None` if it is not in the list.
    pub fn status(&self, tag: Uid) -> Option<CommandStatus> {
        let number = self.world.creator_of(tag)?;
        let place = Some(self.world.places[number as usize]).filter(|place| *place != NOWHERE)?;
        let command = &self.commands[number as usize];
        let cursor = self.cursor() as u32;
        let off = self.world.off.commands.get(&number);
        let state = match off {
            _ if self.failed == Some(number) && place == cursor => CommandState::Failed,
            _ if place >= cursor => CommandState::Pending,
            Some(_) => CommandState::Skipped,
            None => CommandState::Done,
        };
        let error = command.error.clone().filter(|_| state == CommandState::Failed);
        let skipped = off.map(|off| off.reason.clone()).filter(|_| state == CommandState::Skipped);
        Some(CommandStatus { state, micros: command.micros, runs: command.runs, error, skipped })
    }

    /// Number of values that are kept to find out which commands have to run again: a measure of memory.
    pub fn traced(&self) -> usize {
        let trace = |command: &Command| {
            let Trace { reads, writes, globals, .. } = &command.trace;
            reads.len() + writes.len() + globals.len()
        };
        self.commands.iter().map(trace).sum()
    }

    /// Number of nodes, constraints and commands that are kept, with those that are gone and may come back: a measure of
    /// memory.
    pub fn kept(&self) -> usize {
        self.world.slots.len() + self.commands.len()
    }

    /// Number of nodes that were visited since the builder was made to find the commands that read where something is,
    /// and circles of constraints: a measure of work that is the same on every machine.
    pub fn visited(&self) -> u64 {
        self.world.visited
    }

    /// Number of joints that were compared with those of the document since the builder was made: a measure of work that is the
    /// same on every machine.
    pub fn followed(&self) -> u64 {
        self.world.followed
    }

    /// Number of values that commands have read and written since the builder was made: a measure of work that is the
    /// same on every machine.
    pub fn work(&self) -> u64 {
        self.world.work
    }
}
