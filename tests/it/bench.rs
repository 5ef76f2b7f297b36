//! An app, mostly with one rig: what tests of plugins edit, wait for and look at.

use std::{
    fmt::Debug,
    fs,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::prelude::*;
use rigsmith::{
    files::{RealDisk, load_template},
    plugins::{
        commands::{BuildRequest, BuildResult, BuildStep},
        document::JointEntities,
        history::RigHistory,
    },
    prelude::*,
    rig::{BuiltRig, operations::ClipOperation},
    test_app::test_app,
};

/// Time after which a wait counts as endless, far more than a busy machine needs.
pub const HANG: Duration = Duration::from_secs(120);

/// A template that comes with the program, such as `biped` or `parts/arm`.
pub fn shipped(name: &str) -> Rig {
    let path = format!("{}/assets/templates/{name}.rig.ron", env!("CARGO_MANIFEST_DIR"));
    load_template(&RealDisk, path.as_ref()).unwrap_or_else(|error| panic!("{error}")).rig
}

/// Saves a file beside its place and renames it: whoever watches the file sees it whole, whenever this thread is stopped.
pub fn save_whole(path: &Path, content: impl AsRef<[u8]>) {
    let beside = path.with_extension("saved");
    fs::write(&beside, content).unwrap();
    fs::rename(&beside, path).unwrap();
}

/// Runs frames until something holds, and gives background work some time between them.
#[track_caller]
pub fn wait<B>(bench: &mut B, what: &str, frame: impl Fn(&mut B), done: impl Fn(&B) -> bool) {
    wait_with(bench, what, frame, done, |_| ());
}

/// Runs frames as [`wait`] does; the message of a wait without end has a state in it.
#[track_caller]
pub fn wait_with<B, S: Debug>(
    bench: &mut B,
    what: &str,
    frame: impl Fn(&mut B),
    done: impl Fn(&B) -> bool,
    state: impl Fn(&B) -> S,
) {
    let started = Instant::now();
    while !done(bench) {
        assert!(started.elapsed() < HANG, "{what} does not come: {:?}", state(bench));
        std::thread::sleep(Duration::from_millis(1));
        frame(bench);
    }
}

/// A step that fits every rig, and that no job depends on.
pub fn new_clip(name: &str) -> Operation {
    Operation::Clips(ClipOperation::Create { name: name.to_owned(), frame_rate: 24.0, range: [0.0, 1.0] })
}

/// Begins a drag: until it ends, no result of a job lands.
pub fn begin_drag(app: &mut App, rig: Entity) {
    app.world_mut().write_message(EditRequest { rig, change: Change::Preview(new_clip("dragged")) });
    app.update();
}

/// Ends a drag with a step that is undone in the same frame.
pub fn undo_meanwhile(app: &mut App, rig: Entity, step: Operation) {
    for change in [Change::Do(step), Change::Undo] {
        app.world_mut().write_message(EditRequest { rig, change });
    }
    app.update();
}

/// An app, with one rig (`R` is its entity) or with none of the bench's own (`R` is `()`).
///
/// Tests of one subject add what only they do: as methods where the rig is all they have, else in a struct around the bench.
pub struct Bench<R> {
    pub app: App,
    pub rig: R,
}

/// An app with one rig.
pub type RigBench = Bench<Entity>;

/// An app without a rig, or one that opens rigs itself.
pub type AppBench = Bench<()>;

impl<R> Bench<R> {
    pub fn get<C: Component>(&self, entity: Entity) -> Option<&C> {
        self.app.world().get(entity)
    }

    pub fn messages<M: Message>(&mut self) -> Vec<M> {
        self.app.world_mut().resource_mut::<Messages<M>>().drain().collect()
    }

    /// Writes a message and runs a frame.
    pub fn send<M: Message>(&mut self, message: M) {
        self.app.world_mut().write_message(message);
        self.app.update();
    }

    pub fn frames(&mut self, count: usize) {
        (0..count).for_each(|_| self.app.update());
    }

    #[track_caller]
    pub fn wait(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        wait(self, what, |bench| bench.app.update(), done);
    }

    /// Runs frames until a message comes; the last one of its frame.
    #[track_caller]
    pub fn next_message<M: Message>(&mut self) -> M {
        let started = Instant::now();
        loop {
            self.app.update();
            if let Some(message) = self.messages::<M>().pop() {
                return message;
            }
            assert!(started.elapsed() < HANG, "{} does not come", std::any::type_name::<M>());
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Sends a request and waits for its answer.
    #[track_caller]
    pub fn ask<Q: Message, A: Message>(&mut self, request: Q) -> A {
        self.app.world_mut().write_message(request);
        self.next_message()
    }
}

impl AppBench {
    pub fn bare(app: App) -> Self {
        Self { app, rig: () }
    }
}

impl RigBench {
    /// An empty rig in an app with every plugin of `RigPlugins`.
    pub fn new() -> Self {
        Self::of(Rig::new(Uid(1), "rig"))
    }

    /// A rig in an app with every plugin of `RigPlugins`.
    pub fn of(rig: Rig) -> Self {
        Self::with(test_app(), rig)
    }

    /// A rig after its first frame.
    pub fn started(rig: Rig) -> Self {
        let mut bench = Self::of(rig);
        bench.app.update();
        bench
    }

    pub fn with(mut app: App, bundle: impl Bundle) -> Self {
        let rig = app.world_mut().spawn(bundle).id();
        Self { app, rig }
    }

    pub fn rig(&self) -> &Rig {
        self.app.world().get(self.rig).unwrap()
    }

    pub fn edit(&mut self, operation: Operation) {
        self.change(Change::Do(operation));
    }

    pub fn change(&mut self, change: Change) {
        self.send(EditRequest { rig: self.rig, change });
    }

    /// One edit as a step.
    pub fn apply(&mut self, edit: RigEdit) {
        self.apply_all(vec![edit]);
    }

    /// Edits as one step.
    pub fn apply_all(&mut self, edits: Vec<RigEdit>) {
        self.edit(Operation::Edits(edits));
    }

    pub fn step(&mut self, step: BuildStep) {
        self.send(BuildRequest { rig: self.rig, step });
    }

    /// Result of the last build.
    #[track_caller]
    pub fn built(&self) -> Arc<BuiltRig> {
        self.get::<BuildResult>(self.rig).expect("the rig is built").0.clone()
    }

    /// Names of the steps of the history, and the number of those in effect.
    pub fn history(&self) -> (Vec<String>, usize) {
        let (names, done) = self.get::<RigHistory>(self.rig).unwrap().steps();
        (names.into_iter().map(str::to_owned).collect(), done)
    }

    /// Number of the steps in effect.
    pub fn steps(&self) -> usize {
        self.get::<RigHistory>(self.rig).unwrap().steps().1
    }

    /// Adds a chain of joints; the uids of all joints.
    pub fn chain(&mut self, places: &[[f32; 3]]) -> Vec<Uid> {
        let positions = places.iter().map(|place| Vec3::from(*place)).collect();
        self.edit(Operation::Chain { positions, parent: None });
        self.rig().walk().map(|joint| joint.data.uid).collect()
    }

    /// The entity of a joint, if there is one.
    pub fn find(&self, joint: Uid) -> Option<Entity> {
        self.get::<JointEntities>(self.rig)?.get(joint)
    }

    #[track_caller]
    pub fn joint(&self, joint: Uid) -> Entity {
        self.find(joint).unwrap_or_else(|| panic!("{joint} has no entity"))
    }

    pub fn surface(&self) -> Option<&RigSurface> {
        self.get(self.rig)
    }
}
