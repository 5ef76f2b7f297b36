//! One world: the entities of a rig say what its document and its program say, whoever changed what.

mod poses;
mod random;
mod writes;

use std::{path::PathBuf, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    files::{RealDisk, load_template},
    plugins::{
        commands::{BuildRequest, BuildStep, Built, BuiltEntities},
        document::JointEntities,
        runtime::RigRuntime,
    },
    prelude::*,
    solve::program::{CompileOptions, RigProgram, RigState},
    test_app::test_app,
};

/// Every template and part that comes with the program, by its file's name.
pub fn shipped() -> Vec<(String, Rig)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    let mut files = Vec::new();
    for folder in [folder.clone(), folder.join("parts")] {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        files.extend(entries.filter(|path| path.to_string_lossy().ends_with(".rig.ron")));
    }
    files.sort();
    assert!(files.len() >= 18, "{files:?}");
    let read = |path: PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().replace(".rig.ron", "");
        (name, load_template(&RealDisk, &path).unwrap().rig)
    };
    files.into_iter().map(read).collect()
}

/// An app with one rig.
pub struct Stage {
    pub app: App,
    pub rig: Entity,
}

impl Stage {
    pub fn new(rig: Rig) -> Self {
        let mut app = test_app();
        let rig = app.world_mut().spawn(rig).id();
        app.update();
        Self { app, rig }
    }

    pub fn built(rig: Rig) -> Self {
        let mut stage = Self::new(rig);
        stage.step(BuildStep::All);
        stage
    }

    pub fn step(&mut self, step: BuildStep) {
        self.app.world_mut().write_message(BuildRequest { rig: self.rig, step });
        self.app.update();
    }

    pub fn edit(&mut self, edits: Vec<RigEdit>) {
        self.change(Change::Do(Operation::Edits(edits)));
    }

    pub fn change(&mut self, change: Change) {
        self.app.world_mut().write_message(EditRequest { rig: self.rig, change });
        self.app.update();
    }

    pub fn document(&self) -> &Rig {
        self.app.world().get::<Rig>(self.rig).unwrap()
    }

    pub fn runtime(&self) -> &RigRuntime {
        self.app.world().get::<RigRuntime>(self.rig).expect("a built rig runs")
    }

    /// The entity of a joint or created node.
    pub fn node(&self, uid: Uid) -> Option<Entity> {
        let joint = self.app.world().get::<JointEntities>(self.rig)?.get(uid);
        joint.or_else(|| self.app.world().get::<BuiltEntities>(self.rig)?.get(uid))
    }

    /// The node with that label.
    pub fn labelled(&self, label: &str) -> Entity {
        let built = &self.app.world().get::<Built>(self.rig).unwrap().0;
        self.node(built.find_label(label).unwrap_or_else(|| panic!("no {label}")).uid).unwrap()
    }

    pub fn get<C: Component>(&self, entity: Entity) -> Option<&C> {
        self.app.world().get::<C>(entity)
    }

    /// Largest distance, as a share of the rig's size, between the place of an entity and the place that the program gives
    /// the node, over all nodes; matrices included.
    pub fn off(&self) -> f32 {
        let world = self.app.world();
        let built = &world.get::<Built>(self.rig).expect("the rig is built").0;
        let state = self.runtime().state();
        assert_eq!(state.program().nodes().len(), built.nodes.len(), "the program is that of the build");
        let place = *world.get::<GlobalTransform>(self.rig).unwrap();
        let globals = || built.nodes.iter().map(|node| state.global(node.uid).unwrap());
        let size = globals().map(|global| global.translation.abs().max_element()).fold(1e-3, f32::max);
        let mut worst = 0.0_f32;
        for (node, global) in built.nodes.iter().zip(globals()) {
            let entity = self.node(node.uid).unwrap_or_else(|| panic!("{} has no entity", node.name));
            let now = world.get::<GlobalTransform>(entity).unwrap().affine();
            let wanted = place.affine() * global.affine();
            let off = (now.translation - wanted.translation).length() / size;
            assert!(off.is_finite(), "{} is nowhere", node.name);
            worst = worst.max(off);
            for (a, b) in [(now.matrix3.x_axis, wanted.matrix3.x_axis), (now.matrix3.y_axis, wanted.matrix3.y_axis)] {
                worst = worst.max((a - b).length() / b.length().max(1e-6));
            }
        }
        worst
    }

    /// Largest distance, as a share of the rig's size, between the running program and one compiled from nothing and
    /// posed as the document says.
    pub fn off_from_document(&self) -> f32 {
        let built = &self.app.world().get::<Built>(self.rig).unwrap().0;
        let program = RigProgram::compile(built, &CompileOptions::default()).unwrap();
        let mut state = RigState::new(Arc::new(program));
        for (node, offset) in self.document().pose() {
            let _ = state.set_offset(*node, *offset);
        }
        for (node, values) in self.document().attribute_values() {
            for (name, value) in values {
                let _ = state.set_attribute(*node, name, *value);
            }
        }
        state.evaluate(0.0);
        let running = self.runtime().state();
        let size = state.globals().iter().map(|global| global.translation.abs().max_element()).fold(1e-3, f32::max);
        let off = |node: &rigsmith::rig::BuiltNode| {
            let (a, b) = (state.global(node.uid).unwrap(), running.global(node.uid).unwrap());
            a.translation.distance(b.translation) / size
        };
        built.nodes.iter().map(off).fold(0.0, f32::max)
    }
}

/// Distances below this share of the size are rounding.
pub const NEAR: f32 = 1e-5;
