//! The engine as Bevy plugins: one plugin a file, each public, replaceable and usable alone where that makes sense.

pub mod commands;
#[cfg(feature = "draw")]
pub mod display;
pub mod document;
#[cfg(feature = "draw")]
pub mod drawing;
pub mod face;
pub mod gesture;
pub mod history;
pub mod journal;
pub mod picking;
pub mod placement;
pub mod runtime;
pub mod selection;
pub mod skinning;
pub mod stroke;
pub mod surface;
#[cfg(feature = "draw")]
pub mod viewport;

use bevy::{
    app::{AnimationSystems, PluginGroupBuilder, TaskPoolOptions},
    prelude::*,
    transform::systems::sync_simple_transforms,
};

/// Everything a rig needs, head-less.
///
/// | plugin | gives |
/// | --- | --- |
/// | [`document::DocumentPlugin`] | rigs, their joint entities, the one edit path, undo and redo |
/// | [`commands::CommandsPlugin`] | tags as entities, building, stepping and rolling back |
/// | [`surface::SurfacePlugin`] | the posed surface that rays meet |
/// | [`picking::PickingPlugin`] | selecting joints |
/// | [`placement::PlacementPlugin`] | placing joints with rays |
/// | [`stroke::StrokePlugin`] | chains from strokes |
/// | [`gesture::GesturePlugin`] | lists of gestures that drive all of the above |
/// | [`skinning::SkinningPlugin`] | automatic weights in the background |
/// | [`face::FacePlugin`] | faces: bones, weights and expressions |
/// | [`runtime::RuntimePlugin`] | compiled rigs that run each frame |
/// | [`journal::JournalPlugin`] | every change in a safe place, for rigs that ask for it |
pub struct RigPlugins;

impl PluginGroup for RigPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(document::DocumentPlugin)
            .add(commands::CommandsPlugin)
            .add(surface::SurfacePlugin)
            .add(picking::PickingPlugin)
            .add(placement::PlacementPlugin)
            .add(stroke::StrokePlugin)
            .add(gesture::GesturePlugin)
            .add(skinning::SkinningPlugin)
            .add(face::FacePlugin)
            .add(runtime::RuntimePlugin)
            .add(journal::JournalPlugin)
    }
}

/// When the systems of rigs run. Unless they say otherwise they are in `Update`, in this order.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RigSystems {
    /// Scripted gestures become requests.
    Script,
    /// Pick requests change selections.
    Pick,
    /// Place and stroke requests become edit requests.
    Gesture,
    /// Edit, undo and redo requests change rigs: the only place where rigs change.
    Edits,
    /// Joint entities follow their rig.
    Build,
    /// Meshes follow their weights; background skinning starts and lands.
    Bind,
    /// In `PostUpdate`, between Bevy's animation and its propagation of transforms: rigs run.
    Solve,
    /// In `PostUpdate`, at the end of the propagation of transforms: joints of instances in games get their place in the
    /// world.
    Scatter,
    /// In `PostUpdate`, after transforms have propagated: surfaces follow the pose.
    Surface,
}

/// Task pools in which a long task (weights, a file) does not keep a short one (the surface of a pose, a stroke) waiting:
/// at least four background threads, where Bevy takes one on a small machine. Set it on `MinimalPlugins` or
/// `DefaultPlugins` of the first app in a process.
pub fn task_pools() -> TaskPoolPlugin {
    let mut task_pool_options = TaskPoolOptions::default();
    task_pool_options.async_compute.min_threads = 4;
    TaskPoolPlugin { task_pool_options }
}

/// Orders [`RigSystems`]; added by every plugin of [`RigPlugins`], harmless when repeated.
pub(crate) fn configure_sets(app: &mut App) {
    app.configure_sets(
        Update,
        (
            RigSystems::Script,
            RigSystems::Pick,
            RigSystems::Gesture,
            RigSystems::Edits,
            RigSystems::Build,
            RigSystems::Bind,
        )
            .chain(),
    )
    .configure_sets(
        PostUpdate,
        (
            RigSystems::Solve.after(AnimationSystems).before(TransformSystems::Propagate),
            // Within, so that whatever runs after propagation sees these joints, too.
            RigSystems::Scatter.in_set(TransformSystems::Propagate).after(sync_simple_transforms),
            RigSystems::Surface.after(TransformSystems::Propagate),
        ),
    );
}
