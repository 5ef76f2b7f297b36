//! A stroke followed through a surface, kept with it: what a preview asks every frame.

use std::sync::Arc;

use bevy::prelude::*;

use crate::{
    algo::{
        stroke::{ChainChoice, StrokeChain, StrokeError, StrokeSamples, StrokeSettings},
        view::ViewPlane,
    },
    mesh::surface::Surface,
};

/// A stroke and the surface it was drawn on, as that stood then.
///
/// ```no_run
/// # use bevy::{prelude::*, tasks::{AsyncComputeTaskPool, Task}};
/// # use rigsmith::{algo::stroke::StrokeError, plugins::stroke::FollowedStroke, prelude::*};
/// /// On release, once. Poll the task with `check_ready`, then ask `chain` whenever the choice changes.
/// fn follow(
///     surface: &RigSurface, plane: ViewPlane, points: Vec<Vec2>,
/// ) -> Option<Task<Result<FollowedStroke, StrokeError>>> {
///     let surface = surface.shared()?; // `None`: not ready; try in the next frame.
///     let settings = StrokeSettings::default();
///     let follow = async move { FollowedStroke::new(surface, &plane, &points, settings) };
///     Some(AsyncComputeTaskPool::get().spawn(follow))
/// }
/// ```
#[derive(Debug, Clone)]
pub struct FollowedStroke {
    surface: Arc<Surface>,
    samples: StrokeSamples,
}

impl FollowedStroke {
    /// Follows `points` on `plane` through `surface` ([`RigSurface::shared`](crate::plugins::surface::RigSurface::shared)):
    /// milliseconds on a large mesh, so call it in a task.
    ///
    /// # Errors
    /// As [`StrokeSamples::new`].
    pub fn new(
        surface: Arc<Surface>,
        plane: &ViewPlane,
        points: &[Vec2],
        settings: StrokeSettings,
    ) -> Result<Self, StrokeError> {
        let samples = StrokeSamples::new(&surface, plane, points, settings)?;
        Ok(Self { surface, samples })
    }

    /// The chain that the stroke becomes, as [`StrokeSamples::chain`]: some ten microseconds a joint.
    pub fn chain(&self, choice: ChainChoice) -> StrokeChain {
        self.samples.chain(&self.surface, choice)
    }
}
