//! Recovery from rendering failures: the work is saved first, then rendering is tried again; the program never quits at
//! once.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, Once, PoisonError, Weak},
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    render::{
        error_handler::{RenderError, RenderErrorHandler, RenderErrorPolicy},
        settings::RenderCreation,
    },
};

use super::{
    ActiveRig,
    files::{
        OpenDocument, has_unsaved_changes,
        loading::{self, WriteError},
    },
    notice::Notice,
};
use crate::{
    files::{RealDisk, journal::Journal, store_project},
    plugins::journal::RigJournal,
    rig::step::{Commit, SinkError, StepSink},
};

/// Plugin that saves the work when the renderer or the program fails.
pub struct RenderErrorsPlugin;

impl Plugin for RenderErrorsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<RenderTrouble>().insert_resource(RenderErrorHandler(handle));
        flush_on_panic();
    }
}

/// Record of rendering failures.
#[derive(Resource, Debug, Default)]
pub struct RenderTrouble {
    /// Failures in a row, with less than a minute between them.
    failures: u32,
    latest: Option<Instant>,
    has_stopped: bool,
}

impl RenderTrouble {
    /// Returns `true` once rendering was given up.
    pub fn has_stopped(&self) -> bool {
        self.has_stopped
    }
}

/// Number of attempts after a failure.
const TRIES: u32 = 3;
/// Time without failures after which the count starts again.
const CALM: Duration = Duration::from_secs(60);
/// Longest wait for the disk.
const PATIENCE: Duration = Duration::from_secs(2);

/// Decides about a failure of the renderer.
fn handle(error: &RenderError, world: &mut World, _render_world: &mut World) -> RenderErrorPolicy {
    if world.get_resource_or_init::<RenderTrouble>().has_stopped {
        return RenderErrorPolicy::StopRendering;
    }
    let safe = make_safe(world);
    let mut trouble = world.get_resource_or_init::<RenderTrouble>();
    if trouble.latest.is_some_and(|latest| latest.elapsed() > CALM) {
        trouble.failures = 0;
    }
    trouble.latest = Some(Instant::now());
    trouble.failures += 1;
    let reason = format!("{:?}: {}", error.ty, error.description.lines().next().unwrap_or_default());
    if trouble.failures <= TRIES {
        warn!("drawing failed ({reason}) and is tried again; {safe}");
        world.write_message(Notice::warning(format!("Drawing failed and was started again; {safe}")));
        return RenderErrorPolicy::Recover(RenderCreation::Automatic(Box::default()));
    }
    trouble.has_stopped = true;
    // The window cannot show anything any more.
    error!("drawing failed {TRIES} times in a row ({reason}) and has stopped; {safe}. Start rigsmith again to go on");
    eprintln!("rigsmith: drawing has stopped ({reason}); {safe}. Start rigsmith again to go on.");
    RenderErrorPolicy::StopRendering
}

/// Saves all work, and returns a text about its place.
fn make_safe(world: &mut World) -> String {
    let Some(rig) = world.get_resource::<ActiveRig>().map(|rig| rig.0) else {
        return "nothing was open".to_owned();
    };
    let flushed = world.get::<RigJournal>(rig).map(|journal| journal.flush(PATIENCE));
    if !has_unsaved_changes(world) {
        return "all changes are saved".to_owned();
    }
    let journal = match flushed {
        Some(Ok(())) => "all changes are in the journal and are offered at the next start".to_owned(),
        Some(Err(reason)) => format!("the journal could not be written ({reason})"),
        None => "there is no journal".to_owned(),
    };
    match rescue(world, rig) {
        Ok(path) => format!("{journal}; a copy of the project is in {}", path.display()),
        Err(reason) => format!("{journal}; a copy of the project could not be written: {reason}"),
    }
}

/// Writes a copy of the project beside the journal.
fn rescue(world: &mut World, rig: Entity) -> Result<PathBuf, WriteError> {
    let (mut snapshot, bundled) = loading::snapshot(world, rig).ok_or(WriteError::NothingOpen)?;
    let document = world.get::<OpenDocument>(rig).ok_or(WriteError::NothingOpen)?;
    let journal = document.journal().path();
    let folder = journal.as_deref().and_then(std::path::Path::parent).map(std::path::Path::to_path_buf);
    let folder = folder.unwrap_or_else(std::env::temp_dir);
    let path = folder.join(format!("{}-rescue.rigsmith.ron", document.name));
    if let Some(name) = bundled {
        let bundled = loading::place_bundled(&path, &name)?;
        for mesh in snapshot.meshes.iter_mut().filter(|mesh| mesh.path.as_os_str().is_empty()) {
            mesh.path.clone_from(&bundled);
        }
    }
    store_project(&RealDisk, &path, &snapshot)?;
    Ok(path)
}

/// The journal of the open document, while there is one.
static WATCHED: Mutex<Weak<Journal>> = Mutex::new(Weak::new());

/// A journal that is flushed when the program panics.
struct WatchedJournal(Arc<Journal>);

impl StepSink for WatchedJournal {
    fn record(&self, committed: Commit) {
        self.0.record(committed);
    }

    fn trouble(&self) -> Option<SinkError> {
        StepSink::trouble(&*self.0)
    }

    fn flush(&self, limit: Duration) -> Result<(), SinkError> {
        StepSink::flush(&*self.0, limit)
    }
}

/// The component that writes into a journal, which is flushed when the program panics.
pub(super) fn watched(journal: Journal) -> RigJournal {
    let journal = Arc::new(journal);
    *WATCHED.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(&journal);
    RigJournal::new(WatchedJournal(journal))
}

/// Flushes the journal before the panic is handled.
fn flush_on_panic() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            before(info);
            let journal = WATCHED.try_lock().ok().and_then(|watched| watched.upgrade());
            if let Some(journal) = journal {
                let _ = journal.flush(Duration::from_millis(500));
            }
        }));
    });
}
