//! A module from outside the crate: `cargo run --example custom_module`.
//!
//! A module is a type whose fields are the parameters of its tags, declared with `parameters!`. It writes only what building does; rolling back,
//! running again when something that it read has changed, and telling where a tag is wrong come with it.

use std::{error::Error, fmt::Write, sync::Arc};

use bevy::math::Vec3;
use rigsmith::{
    mesh::model::Trs,
    modules,
    processor::{BuildScope, Builder, Creation, ModuleError, RigModule},
    rig::{
        Constraint, NodeType, PoseOffset, Rig, Scalar, TagKind, Uid, UidSource,
        operations::{Operation, TagOperation},
        reference::{NodeRef, NodeRefs},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

rigsmith::parameters! {
    /// Hangs a weight below nodes, which swings as they move.
    pub struct Pendulum {
        /// The nodes that carry a weight.
        pub at: NodeRefs = NodeRef::this().into(),
        /// Distance below them, above 0, in the rig's units.
        pub length: f32 = 0.3,
        /// Name, groups and label; by default those of the node.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for Pendulum {
    const NAME: &'static str = "pendulum";
    const DOC: &'static str = "Hangs a weight below nodes, which swings as they move.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if !(self.length > 0.0 && self.length.is_finite()) {
            return Err(ModuleError::parameter("length", format!("is {}; write a number above 0", self.length)));
        }
        for (index, node) in scope.resolve_some("at", &self.at)?.into_iter().enumerate() {
            let creation = scope.creation_for(&self.creation, node, index);
            let here = Trs { translation: scope.position(node), ..Trs::IDENTITY };
            // Role, node and number are the identity of what is made: it stays the same from build to build.
            let pivot = scope.spawn_at(NodeType::Null, "pivot", node, 0, Some(node), here, &creation)?;
            let below = Trs { translation: Vec3::NEG_Y * self.length, ..Trs::IDENTITY };
            scope.spawn(NodeType::Joint, "weight", node, 0, Some(pivot), below, &creation)?;
            let spring = Constraint::Spring {
                driven: scope.uid(pivot),
                frequency: Scalar::Value(1.5),
                damping: Scalar::Value(0.2),
                weight: Scalar::Value(1.0),
                translate: false,
                rotate: true,
                motion: Scalar::Value(1.0),
                colliders: Vec::new(),
            };
            scope.constrain("swing", node, 0, spring)?;
        }
        Ok(())
    }
}

/// Builds a rig with the module, moves it, and tells what happened.
///
/// # Errors
/// None, unless somebody changes the example.
pub fn run() -> Result<String, Box<dyn Error>> {
    let mut out = String::new();
    let mut modules = modules::all();
    modules.add::<Pendulum>();
    let modules = Arc::new(modules);

    // Two joints, with a tag on the second.
    let mut uids = UidSource::seeded(7);
    let mut rig = Rig::new(uids.next_uid(), "lamp");
    let positions = vec![Vec3::ZERO, Vec3::Y];
    Operation::Chain { positions, parent: None }.run(&mut rig, &mut uids, None)?;
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let tag = |params: &str| TagKind::Command { module: "pendulum".into(), params: params.into(), feature: None };
    let add = |joint: Uid, params: &str| TagOperation::Add { joints: vec![joint], kind: tag(params), index: None };
    Operation::Tags(add(joints[1], "(length: 0.5)")).run(&mut rig, &mut uids, None)?;

    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    let report = builder.run_all();
    let built = builder.built();
    writeln!(out, "{} command ran, the rig has {} nodes", report.executed.len(), built.nodes.len())?;

    // Let it stand for a moment, push the lamp, and watch the weight lag behind.
    let mut state = RigState::new(Arc::new(RigProgram::compile(&built, &CompileOptions::default())?));
    state.evaluate(0.1);
    let weight = built.nodes.iter().find(|node| node.origin.as_ref().is_some_and(|origin| &*origin.role == "weight"));
    let weight = weight.ok_or("the module made no weight")?.uid;
    let push = PoseOffset { translation: Vec3::X * 0.4, ..PoseOffset::IDENTITY };
    state.set_offset(joints[0], push)?;
    for frame in 0..4 {
        state.evaluate(if frame == 3 { 0.5 } else { 0.05 });
        let lag = 0.4 - state.global(weight).unwrap_or_default().translation.x;
        writeln!(out, "the weight is {:+.3} behind", lag)?;
    }

    // A tag that is wrong says where, what, and what to do.
    Operation::Tags(add(joints[0], "(length: -1.0)")).run(&mut rig, &mut uids, None)?;
    builder.sync(&rig);
    if let Some(error) = builder.run_all().error {
        writeln!(out, "{error}")?;
    }
    Ok(out)
}

#[allow(dead_code)] // a test reads this file as a module
fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", run()?);
    Ok(())
}
