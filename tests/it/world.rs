//! One world: the entities of a rig say what its document and its program say, whoever changed what.

mod counts;
pub mod deep_chains;
mod followers;
mod layers;
mod leftovers;
pub mod limits;
mod poses;
mod random;
mod refusals;
mod rig_entity;
mod springs;
mod switches;
mod visibility;
mod writes;
mod wrong_places;

use std::{path::PathBuf, sync::Arc};

use bevy::{
    math::{Affine3A, DAffine3},
    prelude::*,
};
use rigsmith::{
    files::{RealDisk, load_template},
    plugins::{
        commands::{BuildStep, BuiltEntities},
        runtime::RigRuntime,
    },
    prelude::*,
    rig::{BuiltNode, NodeType},
    solve::program::{CompileOptions, RigProgram, RigState},
};

use crate::bench::RigBench;

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

impl RigBench {
    /// A rig of which every command is in effect.
    pub fn of_built(rig: Rig) -> Self {
        let mut bench = Self::started(rig);
        bench.step(BuildStep::All);
        bench
    }

    pub fn runtime(&self) -> &RigRuntime {
        self.app.world().get::<RigRuntime>(self.rig).expect("a built rig runs")
    }

    /// The entity of a joint or created node.
    pub fn node(&self, uid: Uid) -> Option<Entity> {
        self.find(uid).or_else(|| self.get::<BuiltEntities>(self.rig)?.get(uid))
    }

    /// The node with that label.
    pub fn labelled_node(&self, label: &str) -> Entity {
        let built = self.built();
        self.node(built.find_label(label).unwrap_or_else(|| panic!("no {label}")).uid).unwrap()
    }

    /// The control with that name.
    pub fn control(&self, name: &str) -> Entity {
        let built = self.built();
        let is_meant = |node: &&BuiltNode| node.kind == NodeType::Control && *node.name == *name;
        let found = built.nodes.iter().find(is_meant).unwrap_or_else(|| panic!("no control {name}"));
        self.node(found.uid).unwrap()
    }

    /// Height of the authored skeleton at rest: its extent along Y, or along its longest axis where it lies flat (less
    /// than a tenth of that axis). Joints that all lie at one place have the height of what is built of them.
    pub fn height(&self) -> f32 {
        let extent = |places: &[Vec3]| {
            let low = places.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let high = places.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
            let extent = (high - low).max(Vec3::ZERO);
            let longest = extent.max_element();
            if extent.y >= 0.1 * longest { extent.y } else { longest }
        };
        let joints = self.rig().rest_globals().into_iter().map(|(_, rest)| rest.translation);
        let height = extent(&joints.collect::<Vec<Vec3>>());
        if height > 1e-3 {
            return height;
        }
        let nodes = self.runtime().state().globals().iter().map(|global| global.translation);
        extent(&nodes.collect::<Vec<Vec3>>()).max(1e-3)
    }

    /// Largest difference between the world transform of an entity and the transform that the program gives the node, in
    /// the rig's space, over all nodes: of places as a share of the rig's height, of axes as a share of their length.
    pub fn off(&self) -> f32 {
        let world = self.app.world();
        let built = self.built();
        let state = self.runtime().state();
        assert_eq!(state.program().nodes().len(), built.nodes.len(), "the program is that of the build");
        let exact = |affine: Affine3A| DAffine3 {
            matrix3: affine.matrix3.as_dmat3(),
            translation: affine.translation.as_dvec3(),
        };
        // In double precision, so that the comparison itself rounds nothing.
        let to_rig = exact(world.get::<GlobalTransform>(self.rig).unwrap().affine()).inverse();
        let height = f64::from(self.height());
        let mut worst = 0.0_f64;
        for node in &built.nodes {
            let entity = self.node(node.uid).unwrap_or_else(|| panic!("{} has no entity", node.name));
            let now = to_rig * exact(world.get::<GlobalTransform>(entity).unwrap().affine());
            let wanted = exact(state.global(node.uid).unwrap().affine());
            // A place in the world cannot be told more exactly than its coordinates are rounded.
            let world_place = world.get::<GlobalTransform>(entity).unwrap().translation();
            let rounding = f64::from(2.0 * f32::EPSILON * world_place.abs().max_element());
            let off = ((now.translation - wanted.translation).length() - rounding).max(0.0) / height;
            assert!(off.is_finite(), "{} is nowhere", node.name);
            worst = worst.max(off);
            for axis in 0..3 {
                let (a, b) = (now.matrix3.col(axis), wanted.matrix3.col(axis));
                worst = worst.max((a - b).length() / b.length().max(1e-6));
            }
        }
        worst as f32
    }

    /// Largest distance, as a share of the rig's height, between the running program and one compiled from nothing and
    /// posed as the document says.
    pub fn off_from_document(&self) -> f32 {
        let built = self.built();
        let program = RigProgram::compile(&built, &CompileOptions::default()).unwrap();
        let mut state = RigState::new(Arc::new(program));
        for (node, offset) in self.rig().pose() {
            let _ = state.set_offset(*node, *offset);
        }
        for (node, values) in self.rig().attribute_values() {
            for (name, value) in values {
                let _ = state.set_attribute(*node, name, *value);
            }
        }
        state.evaluate(0.0);
        let running = self.runtime().state();
        let height = self.height();
        let off = |node: &BuiltNode| {
            let (a, b) = (state.global(node.uid).unwrap(), running.global(node.uid).unwrap());
            a.translation.distance(b.translation) / height
        };
        built.nodes.iter().map(off).fold(0.0, f32::max)
    }
}

/// Differences below this share of the rig's height are rounding.
pub const NEAR: f32 = 1e-5;
