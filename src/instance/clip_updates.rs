//! Clips of instances through changes of their templates.
//!
//! Clips that would mean something else are re-expressed in a task, once for all instances that share them. Until they are
//! there an instance goes on with the version of its template that it has, so that no frame shows another motion.

use std::sync::Arc;

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::BuiltTemplate;
use crate::{
    plugins::runtime::InstanceMode,
    processor::{ClipReport, KeptClips, RigVersion, clips_between},
    rig::animation::RigClip,
};

/// Clips of an instance as they were made: later versions of the template start from them, so that nothing is lost by many.
#[derive(Component, Clone)]
pub(super) struct ClipOrigin {
    /// The clips.
    clips: Arc<[RigClip]>,
    /// Version of the template that they were made for.
    built: Arc<BuiltTemplate>,
    /// Clips that the instance has of them. Where code gives it others, those are the origin.
    pub shown: Arc<[RigClip]>,
}

/// Clips of an instance for another version of its template.
pub(super) struct UpdatedClips {
    pub clips: Arc<[RigClip]>,
    /// The clips as they were made, where that is another thing.
    pub origin: Option<ClipOrigin>,
    pub report: Arc<ClipReport>,
}

/// Clips that are being re-expressed.
#[derive(Resource, Default)]
pub(super) struct ClipJobs(Vec<ClipJob>);

struct ClipJob {
    clips: Arc<[RigClip]>,
    from: Arc<BuiltTemplate>,
    to: Arc<BuiltTemplate>,
    mode: InstanceMode,
    state: JobState,
    /// True if an instance waits for it.
    is_wanted: bool,
}

enum JobState {
    Running(Task<KeptClips>),
    Done(Arc<[RigClip]>, Arc<ClipReport>),
}

impl ClipJobs {
    /// The clips of an instance for the next version of its template; `None` while they are being re-expressed.
    pub fn updated(
        &mut self,
        running: &Arc<BuiltTemplate>,
        to: &Arc<BuiltTemplate>,
        clips: &Arc<[RigClip]>,
        origin: Option<&ClipOrigin>,
        mode: InstanceMode,
    ) -> Option<UpdatedClips> {
        if to.way.as_ref().is_some_and(|way| way.holds_poses(running, to)) {
            return Some(UpdatedClips { clips: clips.clone(), origin: None, report: Arc::default() });
        }
        let origin = origin.filter(|origin| Arc::ptr_eq(&origin.shown, clips));
        let (made, from) = origin.map_or((clips, running), |origin| (&origin.clips, &origin.built));
        let is_it = |job: &ClipJob| {
            let is_between = Arc::ptr_eq(&job.from, from) && Arc::ptr_eq(&job.to, to);
            is_between && Arc::ptr_eq(&job.clips, made) && job.mode == mode
        };
        let number = self.0.iter().position(is_it).unwrap_or_else(|| {
            self.0.push(ClipJob::start(made, from, to, mode));
            self.0.len() - 1
        });
        let job = &mut self.0[number];
        job.is_wanted = true;
        if let JobState::Running(task) = &mut job.state {
            let KeptClips { clips: kept, report } = check_ready(task)?;
            let kept = if kept[..] == made[..] { made.clone() } else { kept.into() };
            job.state = JobState::Done(kept, Arc::new(report));
        }
        let JobState::Done(shown, report) = &job.state else { return None };
        let origin = ClipOrigin { clips: made.clone(), built: from.clone(), shown: shown.clone() };
        Some(UpdatedClips { clips: shown.clone(), origin: Some(origin), report: report.clone() })
    }

    /// Forgets what was handed out, and what no instance waits for any more.
    pub fn tidy(&mut self) {
        self.0.retain(|job| job.is_wanted && matches!(job.state, JobState::Running(_)));
        self.0.iter_mut().for_each(|job| job.is_wanted = false);
    }
}

impl ClipJob {
    fn start(clips: &Arc<[RigClip]>, from: &Arc<BuiltTemplate>, to: &Arc<BuiltTemplate>, mode: InstanceMode) -> Self {
        let work = (clips.clone(), from.clone(), to.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let (clips, from, to) = work;
            clips_between(&clips, version(&from, mode), version(&to, mode))
        });
        let (clips, from, to) = (clips.clone(), from.clone(), to.clone());
        Self { clips, from, to, mode, state: JobState::Running(task), is_wanted: true }
    }
}

/// A version of a template, with the nodes that an instance in that mode can pose.
fn version(template: &BuiltTemplate, mode: InstanceMode) -> RigVersion<'_> {
    let program = match mode {
        InstanceMode::Hierarchy => &template.whole,
        InstanceMode::Direct => &template.lean,
    };
    RigVersion { rig: &template.rig, built: &template.built, program }
}
