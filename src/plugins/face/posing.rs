//! Poses of expressions that are computed in the background: those of a slider that is dragged in every app, and all others where
//! [`BackgroundPosing`] says so.
//!
//! Movements of bones are sums, but mending of folds looks at the skin that they move: its time grows with the mesh. A
//! preview shows as soon as its pose is computed; of those that come meanwhile, the last one counts. What is to become a
//! step of the history waits for its turn and is never left out.

use std::{
    collections::BTreeMap,
    sync::{Arc, Weak},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{ExpressRequest, preparation::PreparedParts};
use crate::algo::face::expression::{BonePose, Mix};

/// Mark of an app whose frames compute no poses of expressions, as that of a window: each is computed in the background, and its
/// step of the history is made when it is there. Undo and redo wait for it.
///
/// Without it an expression that is no preview shows in the frame in which it is asked for, or in the next one where another step of
/// that frame comes before it, so that the results of an app that waits for nothing do not depend on time.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BackgroundPosing;

/// Most requests that wait for a pose. A person makes a few; code that asks for another expression in each frame gets those that
/// can be computed, and the last one.
const MOST_WAITING: usize = 32;

/// Poses of a mesh's face for expressions: the last one that was computed, and the one that is being computed.
#[derive(Component, Default)]
pub struct FacePosing {
    last: Option<LastPose>,
    running: Option<RunningPose>,
}

struct LastPose {
    parts: Weak<PreparedParts>,
    strengths: BTreeMap<String, f32>,
    poses: Vec<BonePose>,
}

struct RunningPose {
    work: PoseWork,
    parts: Weak<PreparedParts>,
    request: ExpressRequest,
    /// Requests that came meanwhile, in their order.
    queue: Vec<ExpressRequest>,
}

/// Poses of a request.
enum PoseWork {
    /// Poses that are computed in the background.
    Task(Task<Vec<BonePose>>),
    /// Poses that are known, and shown in the next frame.
    Ready(Vec<BonePose>),
}

impl FacePosing {
    /// True while a pose is computed, or waits for the next frame.
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// Strengths that the face is going to have; `None` unless a pose is computed.
    pub fn strengths(&self) -> Option<&BTreeMap<String, f32>> {
        let running = self.running.as_ref()?;
        Some(&running.queue.last().unwrap_or(&running.request).strengths)
    }

    /// Pose for these strengths, if it was computed last.
    pub(super) fn posed(&self, parts: &Arc<PreparedParts>, strengths: &BTreeMap<String, f32>) -> Option<&[BonePose]> {
        let serves = |last: &&LastPose| last.parts.as_ptr() == Arc::as_ptr(parts) && last.strengths == *strengths;
        self.last.as_ref().filter(serves).map(|last| last.poses.as_slice())
    }

    /// True if what is computed, or waits, becomes a step of the history.
    pub(super) fn has_step(&self) -> bool {
        let is_step = |request: &ExpressRequest| !request.preview;
        self.running.as_ref().is_some_and(|running| is_step(&running.request) || running.queue.iter().any(is_step))
    }

    /// Starts to compute the pose of a request.
    pub(super) fn start(&mut self, parts: &Arc<PreparedParts>, mix: Mix, request: ExpressRequest) {
        let of_task = parts.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { of_task.fitted.pose(&mix) });
        let (work, parts) = (PoseWork::Task(task), Arc::downgrade(parts));
        self.running = Some(RunningPose { work, parts, request, queue: Vec::new() });
    }

    /// Holds the known pose of a request until the next frame.
    pub(super) fn hold(&mut self, parts: &Arc<PreparedParts>, poses: Vec<BonePose>, request: ExpressRequest) {
        let (work, parts) = (PoseWork::Ready(poses), Arc::downgrade(parts));
        self.running = Some(RunningPose { work, parts, request, queue: Vec::new() });
    }

    /// Lets a request wait for the pose that is being computed, in place of a preview that waits, or of the last request where
    /// [`MOST_WAITING`] do.
    pub(super) fn wait(&mut self, request: ExpressRequest) {
        let Some(running) = &mut self.running else { return };
        let is_full = running.queue.len() >= MOST_WAITING;
        running.queue.pop_if(|last| last.preview || is_full);
        running.queue.push(request);
    }

    /// Drops a pose that is being computed, and what waits for it: another one is shown.
    pub(super) fn stop(&mut self) {
        self.running = None;
    }

    /// Takes over a pose that is known. Returns its request and those that waited for it, each with true if they waited for the
    /// background.
    pub(super) fn land(&mut self) -> Vec<(ExpressRequest, bool)> {
        let Some(RunningPose { work, parts, request, queue }) = self.running.take() else { return Vec::new() };
        let (poses, is_of_background) = match work {
            PoseWork::Ready(poses) => (poses, false),
            PoseWork::Task(mut task) => match check_ready(&mut task) {
                Some(poses) => (poses, true),
                None => {
                    self.running = Some(RunningPose { work: PoseWork::Task(task), parts, request, queue });
                    return Vec::new();
                }
            },
        };
        self.last = Some(LastPose { parts, strengths: request.strengths.clone(), poses });
        std::iter::once(request).chain(queue).map(|request| (request, is_of_background)).collect()
    }
}
