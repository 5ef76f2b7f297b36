//! An app for tests, ours and yours: every plugin of [`RigPlugins`](crate::plugins::RigPlugins), no window, no renderer, the same uids every time.

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
/// let rig = app.world_mut().spawn(RigBundle::default()).id();
/// app.world_mut().write_message(EditRequest::operation(
///     rig,
///     Operation::Place { position: [0.0, 1.0, 0.0].into(), parent: None },
/// ));
/// app.update();
/// assert_eq!(app.world().get::<Rig>(rig).map(Rig::len), Some(1));
/// ```
pub fn test_app() -> App {
    let mut app = headless_app(1);
    let strict = ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() };
    app.edit_schedule(Update, |schedule| {
        schedule.set_build_settings(strict.clone());
    });
    app.finish();
    app.cleanup();
    app
}
