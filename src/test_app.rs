//! An app for tests of this crate and of its users: every plugin of [`RigPlugins`](crate::plugins::RigPlugins), no
//! window, no renderer, the same uids every time.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
};

use crate::headless::headless_app;

/// An app with [`RigPlugins`](crate::plugins::RigPlugins) that is ready for `app.update()`. Systems whose order is ambiguous are an error.
///
/// ```
/// use rigsmith::{prelude::*, test_app::test_app};
///
/// let mut app = test_app();
/// let rig = app.world_mut().spawn(Rig::default()).id();
/// app.world_mut().write_message(EditRequest::operation(
///     rig,
///     Operation::Place { position: [0.0, 1.0, 0.0].into(), parent: None },
/// ));
/// app.update();
/// assert_eq!(app.world().get::<Rig>(rig).map(Rig::len), Some(1));
/// ```
pub fn test_app() -> App {
    strict_app(headless_app(1))
}

/// An app whose plugins are all added, made ready for `app.update()`. Systems whose order is ambiguous are an error, in every
/// schedule.
pub fn strict_app(mut app: App) -> App {
    app.finish();
    app.cleanup();
    let strict = ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() };
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_build_settings(strict.clone());
    }
    app
}
