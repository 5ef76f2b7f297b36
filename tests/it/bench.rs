//! One rig in an app: what tests of plugins edit, wait for and look at.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use rigsmith::{
    files::{RealDisk, load_template},
    plugins::document::JointEntities,
    prelude::*,
    rig::operations::ClipOperation,
    test_app::test_app,
};

/// Time after which a wait counts as endless, far more than a busy machine needs.
pub const HANG: Duration = Duration::from_secs(120);

/// A template that comes with the program, such as `biped` or `parts/arm`.
pub fn shipped(name: &str) -> Rig {
    let path = format!("{}/assets/templates/{name}.rig.ron", env!("CARGO_MANIFEST_DIR"));
    load_template(&RealDisk, path.as_ref()).unwrap_or_else(|error| panic!("{error}")).rig
}

/// Runs frames until something holds, and gives background work some time between them.
#[track_caller]
pub fn wait<B>(bench: &mut B, what: &str, frame: impl Fn(&mut B), done: impl Fn(&B) -> bool) {
    let started = Instant::now();
    while !done(bench) {
        assert!(started.elapsed() < HANG, "{what} does not come");
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

/// An app with one rig.
pub struct RigBench {
    pub app: App,
    pub rig: Entity,
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

    pub fn with(mut app: App, bundle: impl Bundle) -> Self {
        let rig = app.world_mut().spawn(bundle).id();
        Self { app, rig }
    }

    pub fn rig(&self) -> &Rig {
        self.app.world().get(self.rig).unwrap()
    }

    /// Writes a message and runs a frame.
    pub fn send<M: Message>(&mut self, message: M) {
        self.app.world_mut().write_message(message);
        self.app.update();
    }

    pub fn edit(&mut self, operation: Operation) {
        self.change(Change::Do(operation));
    }

    pub fn change(&mut self, change: Change) {
        self.send(EditRequest { rig: self.rig, change });
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

    pub fn get<C: Component>(&self, entity: Entity) -> Option<&C> {
        self.app.world().get(entity)
    }

    pub fn messages<M: Message>(&mut self) -> Vec<M> {
        self.app.world_mut().resource_mut::<Messages<M>>().drain().collect()
    }

    pub fn surface(&self) -> Option<&RigSurface> {
        self.get(self.rig)
    }

    #[track_caller]
    pub fn wait(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        wait(self, what, |bench| bench.app.update(), done);
    }
}
