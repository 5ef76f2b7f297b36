//! Rigs at rest: where nothing is written to a rig without commands, its nodes are told and saved without an app, whose
//! entities take several times the memory. Frames move nothing of such a rig. One in a pose is built before its app begins.

use std::sync::Arc;

use bevy::{
    math::Affine3A,
    prelude::{GlobalTransform, Transform},
};

use super::{PoseArgs, tell_nodes};
use crate::{
    cli::{Failure, Report, build, limits},
    headless::{
        Workbench,
        posing::{PoseError, PosedNode},
    },
    plugins::{commands::NamedProgramError, runtime::is_same_place, surface::RigMesh},
    processor::{Builder, Modules},
    rig::{BuiltRig, Rig},
    solve::program::RigProgram,
};

/// True if the command writes no values and binds no meshes, and the rig has neither commands nor a pose: whatever frames
/// pass then, nothing moves.
pub(super) fn is_at_rest(args: &PoseArgs, own: &[RigMesh], rig: &Rig) -> bool {
    let steps = &args.steps;
    let is_plain = steps.set.is_empty() && steps.switches.is_empty();
    is_plain && args.meshes.is_empty() && own.is_empty() && is_still(rig)
}

/// True if a rig has neither commands nor a pose: its entities are where its joints rest.
pub(in crate::cli) fn is_still(rig: &Rig) -> bool {
    !rig.has_tags() && rig.pose().is_empty()
}

/// True if the command asks for no node by its name, for no mesh and no picture, and the rig has no commands: nothing then asks
/// a processor.
pub(super) fn needs_no_processor(args: &PoseArgs, own: &[RigMesh], rig: &Rig) -> bool {
    let names_nothing = args.steps.set.is_empty() && args.steps.switches.is_empty();
    names_nothing && args.meshes.is_empty() && own.is_empty() && !rig.has_tags()
}

/// A workbench with a rig that is built, and without the values that a processor keeps for its next build.
pub(super) fn built_bench(rig: Rig) -> Result<Workbench, Failure> {
    let built = built(&rig)?;
    let mut bench = limits::workbench(rig);
    bench.set_built(Arc::new(built));
    Ok(bench)
}

/// Result of the commands of a rig, without an app.
fn built(rig: &Rig) -> Result<BuiltRig, Failure> {
    let built = built_with(rig, limits::modules())?;
    limits::check_time("building the rig")?;
    Ok(built)
}

/// Result of the commands of a rig with these modules, without an app.
pub(in crate::cli) fn built_with(rig: &Rig, modules: Modules) -> Result<BuiltRig, Failure> {
    let mut builder = Builder::new(Arc::new(modules));
    builder.sync(rig);
    let outcome = builder.run_all();
    let built = builder.built();
    drop(builder);
    outcome.error.map_or(Ok(built), |error| Err(Failure::Input(Box::new(error))))
}

/// Tells the nodes of a rig at rest, and saves it if that is asked for.
pub(super) fn pose(args: &PoseArgs, rig: Rig, report: &mut Report) -> Result<(), Failure> {
    let built = built(&rig)?;
    tell(&rig, &built, report)?;
    if let Some(output) = &args.output {
        report.notes(build::store_at_rest(output, &args.rig, rig, built, &args.export, false)?);
    }
    Ok(())
}

/// Tells the nodes of a built rig, as entities show them and as the program computes them.
fn tell(rig: &Rig, built: &BuiltRig, report: &mut Report) -> Result<(), PoseError> {
    let (places, height) =
        RigProgram::places_at_rest(built).map_err(|error| PoseError::CannotRun(NamedProgramError::new(error, rig)))?;
    let mut shown: Vec<GlobalTransform> = Vec::with_capacity(built.nodes.len());
    for (node, place) in built.nodes.iter().zip(&places) {
        if !place.translation.is_finite() {
            return Err(PoseError::NotFinite { node: node.name.to_string() });
        }
        let above = node.parent.map_or(GlobalTransform::IDENTITY, |parent| shown[parent]);
        let base = node.base;
        shown.push(above.mul_transform(Transform {
            translation: base.translation,
            rotation: base.rotation,
            scale: base.scale,
        }));
    }
    let posed = built.nodes.iter().zip(&shown).zip(&places).map(|((node, shown), place)| {
        // Below an unevenly scaled joint matrices shear, which an app corrects.
        let (now, wanted) = (shown.affine(), place.affine());
        let shown = if is_same_place(&now, &wanted, height) { now } else { wanted };
        let (translation, rotation, scale) = (place.translation, place.rotation, place.scale);
        PosedNode {
            node: node.clone(),
            parent: node.parent.map(|parent| built.nodes[parent].uid),
            // The rig is where the world is.
            entity: GlobalTransform::from(Affine3A::IDENTITY * shown).compute_transform(),
            program: Transform { translation, rotation, scale },
        }
    });
    tell_nodes(report, posed);
    Ok(())
}
