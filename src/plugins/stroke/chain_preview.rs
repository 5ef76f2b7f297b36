//! Strokes followed through a surface, kept for the queries of a preview in every frame.
//!
//! With symmetry on, a spine drawn by hand deviates from the middle by a percent or two of the character's height, and
//! a section's centroid is not exactly there either. The course of the whole stroke decides, see
//! [`FollowedStroke::with_symmetry`].

use std::sync::Arc;

use bevy::prelude::*;

use crate::{
    algo::{
        stroke::{ChainChoice, HalfSpace, StrokeChain, StrokeError, StrokeSamples, StrokeSettings},
        view::ViewPlane,
    },
    mesh::{ray::Ray, surface::Surface},
    rig::operations::MirrorPlane,
};

/// A stroke with the surface it was drawn on, in the state of that moment.
///
/// ```no_run
/// # use bevy::{prelude::*, tasks::{AsyncComputeTaskPool, Task}};
/// # use rigsmith::{algo::stroke::StrokeError, plugins::stroke::FollowedStroke, prelude::*};
/// /// On release, once. Poll the task with `check_ready`, then ask `chain` whenever the choice changes.
/// fn follow(
///     surface: &RigSurface, plane: ViewPlane, points: Vec<Vec2>, symmetry: Symmetry,
/// ) -> Option<Task<Result<FollowedStroke, StrokeError>>> {
///     let surface = surface.shared()?; // `None`: not ready; try in the next frame.
///     let settings = StrokeSettings::default();
///     let follow = async move { FollowedStroke::with_symmetry(surface, &plane, &points, settings, symmetry.0) };
///     Some(AsyncComputeTaskPool::get().spawn(follow))
/// }
/// ```
#[derive(Debug, Clone)]
pub struct FollowedStroke {
    surface: Arc<Surface>,
    samples: StrokeSamples,
    /// The mirror plane that the stroke runs along, if any.
    middle: Option<MirrorPlane>,
}

/// Largest share of places along a central stroke with the surface between them and the mirror plane.
const BLOCKED: f32 = 0.25;

impl FollowedStroke {
    /// Follows `points` on `plane` through `surface`
    /// ([`RigSurface::shared`](crate::plugins::surface::RigSurface::shared)): milliseconds on a large mesh, so call it
    /// in a task.
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
        Ok(Self { surface, samples, middle: None })
    }

    /// Follows a stroke as [`FollowedStroke::new`] does, on a mesh whose two sides are equal.
    ///
    /// A stroke is central (a spine) if the middles of the volume under it [run along the plane of
    /// symmetry](MirrorPlane::runs_along) and the segments from them to that plane stay inside the mesh, unlike those
    /// of a leg beside the other. It is then taken as if drawn exactly on the plane, and so are its joints. Any other
    /// stroke that begins in a volume of both sides (a leg drawn from the side begins in the pelvis) is kept on its own
    /// side, see [`HalfSpace::of_stroke`].
    ///
    /// # Errors
    /// As [`StrokeSamples::new`].
    pub fn with_symmetry(
        surface: Arc<Surface>,
        plane: &ViewPlane,
        points: &[Vec2],
        settings: StrokeSettings,
        symmetry: Option<MirrorPlane>,
    ) -> Result<Self, StrokeError> {
        let drawn = Self::new(surface, plane, points, settings)?;
        let Some(mirror) = symmetry else { return Ok(drawn) };
        let middles: Vec<Vec3> = drawn.samples.middles().collect();
        if !mirror.runs_along(&middles) || blocked(&drawn.surface, &mirror, &middles) > BLOCKED {
            let crossings: Vec<[Vec3; 2]> = drawn.samples.crossings().collect();
            let half = HalfSpace::of_stroke(&crossings, mirror.point, mirror.normal, mirror.tolerance);
            if half.is_none() {
                return Ok(drawn);
            }
            // What the stroke meets on its own side alone may be nothing.
            let beside = StrokeSamples::within(&drawn.surface, plane, points, settings, half);
            return Ok(Self { samples: beside.unwrap_or(drawn.samples), ..drawn });
        }
        let on_plane: Vec<Vec2> = middles.iter().filter_map(|middle| plane.project(mirror.onto(*middle))).collect();
        // On the plane the stroke may be too short: seen along the line on which it runs.
        let samples = StrokeSamples::new(&drawn.surface, plane, &on_plane, settings).unwrap_or(drawn.samples);
        Ok(Self { surface: drawn.surface, samples, middle: Some(mirror) })
    }

    /// Returns `true` for a central stroke, whose chain has no other side.
    pub fn is_central(&self) -> bool {
        self.middle.is_some()
    }

    /// The chain of the stroke, as [`StrokeSamples::chain`]: some ten microseconds a joint.
    pub fn chain(&self, choice: ChainChoice) -> StrokeChain {
        let mut chain = self.samples.chain(&self.surface, choice);
        if let Some(mirror) = self.middle {
            for joint in &mut chain.joints {
                joint.position = mirror.onto(joint.position);
            }
        }
        chain
    }
}

/// Share of places, 0 to 1, whose segment to the plane crosses the surface.
fn blocked(surface: &Surface, mirror: &MirrorPlane, places: &[Vec3]) -> f32 {
    let mut hits = Vec::new();
    let crosses = |place: &&Vec3| {
        let distance = mirror.distance(**place);
        surface.hits(&Ray { origin: **place, direction: mirror.normal * -distance.signum() }, &mut hits);
        hits.first().is_some_and(|hit| hit.distance < distance.abs())
    };
    places.iter().filter(crosses).count() as f32 / places.len().max(1) as f32
}
