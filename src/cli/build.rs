//! `rigsmith build`: carries out the commands of a rig.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use serde_json::{Value, json};

use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, SEED, WeightArgs, binding::bind, convert::mark_joints,
    explanation::Explanation, report::counted, skin, switches::SwitchArgs,
};
use crate::{
    files::{FileKind, RealDisk, load_model, store_model, store_rig},
    headless::{Workbench, posing::PoseError},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Trs},
    },
    plugins::commands::BuildStep,
    processor::{Builder, CommandState},
    rig::{BuiltRig, Rig, Uid, bake::baked, operations::Operation, update::edits_between},
};

/// Arguments of `rigsmith build`.
#[derive(Args, Debug)]
pub(super) struct BuildArgs {
    /// The rig: a .rig.ron
    pub rig: PathBuf,
    /// A mesh to bind to what is built
    #[arg(long)]
    mesh: Option<PathBuf>,
    #[command(flatten)]
    switches: SwitchArgs,
    /// Stops after so many commands
    #[arg(long, value_name = "N")]
    until: Option<usize>,
    /// Lists the commands with their state and time
    #[arg(long)]
    trace: bool,
    /// The file to write: .glb or .gltf for the character as posed, .rig.ron for the built skeleton
    #[arg(short, long)]
    output: Option<Output>,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn run(args: &BuildArgs) -> Result<Report, Failure> {
    if let Some(output) = &args.output
        && !matches!(FileKind::of(output), Some(FileKind::Glb | FileKind::Gltf | FileKind::Template))
    {
        return Err(Failure::Usage(format!("cannot write `{}`; give .glb, .gltf or .rig.ron", output.display())));
    }
    if args.mesh.is_some() && args.output.as_deref().is_none_or(|path| FileKind::of(path) == Some(FileKind::Template)) {
        return Err(Failure::Usage("--mesh is for a character; write one with -o NAME.glb".to_owned()));
    }
    let inputs: Vec<&Path> =
        [Some(&args.rig), args.mesh.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, args.output.as_deref(), &[])?;
    let mut report = Report::default();
    let mut rig = skin::load_rig(&args.rig, &mut report)?;
    args.switches.apply(&mut rig)?;
    let mut bench = Workbench::with_rig(SEED, rig);
    let outcome = bench.build(args.until.map_or(BuildStep::All, BuildStep::To));
    let (rig, built) = (bench.rig(), bench.built().ok_or(PoseError::NotBuilt)?);
    let builder = bench.processor().ok_or(PoseError::NotBuilt)?.builder();
    let lines = trace(&mut report, rig, builder, &outcome.executed);
    if args.trace {
        report.lines.extend(lines);
    }
    let created = built.nodes.iter().filter(|node| node.origin.is_some()).count();
    report.line(format!(
        "{} of {}, {}, {}, {}",
        outcome.cursor,
        counted(builder.len(), "command", "commands"),
        counted(rig.len(), "joint", "joints"),
        counted(created, "created node", "created nodes"),
        counted(built.constraints.len(), "constraint", "constraints")
    ));
    report.set("commands_done", outcome.cursor);
    report.set("nodes", built.nodes.len());
    report.set("created", created);
    report.set("constraints", built.constraints.len());
    if let Some(error) = outcome.error {
        report.at_fault = true;
        report.notes.push(format!("`{}`: {error} (tag {})", args.rig.display(), error.command));
        report.fault = Some(Explanation::at(args.rig.display().to_string(), &error.to_string()));
        return Ok(report);
    }
    // Checked even if no file is written: a built rig that cannot run, such as one with a cycle of parents, is no rig.
    bench.posed_nodes()?;
    if let Some(output) = &args.output {
        let notes = write(args, output, &mut bench, &mut report)?;
        report.notes(notes);
        report.line(format!("wrote {}", output.display()));
        report.set("output", output.display().to_string());
    }
    Ok(report)
}

/// Adds the commands to the report for programs, and returns them for people, a line each.
fn trace(report: &mut Report, rig: &Rig, builder: &Builder, executed: &[Uid]) -> Vec<String> {
    let mut lines = Vec::new();
    let mut list = Vec::new();
    for entry in builder.list() {
        let Some(status) = builder.status(entry.command) else { continue };
        let state = match status.state {
            CommandState::Pending => "pending",
            CommandState::Done => "done",
            CommandState::Skipped => "skipped",
            CommandState::Failed => "failed",
        };
        let label = rig.joint(entry.joint).and_then(|joint| joint.data.label.clone());
        let error = status.error.as_ref().map(ToString::to_string);
        let skipped = status.skipped.as_ref().map(ToString::to_string);
        let name = label.clone().unwrap_or_else(|| entry.joint.to_string());
        let reason = skipped.as_ref().map_or_else(String::new, |reason| format!("  ({reason})"));
        lines.push(format!("{state:>8} {:>9.1} µs  {name}  {}{reason}", status.micros, entry.module));
        list.push(json!({
            "uid": entry.command.to_string(),
            "joint": entry.joint.to_string(),
            "label": label,
            "module": &*entry.module,
            "state": state,
            "micros": status.micros,
            "executed": executed.contains(&entry.command),
            "error": error,
            "skipped": skipped,
        }));
    }
    report.set("commands", Value::Array(list));
    lines
}

fn write(
    args: &BuildArgs,
    output: &Output,
    bench: &mut Workbench,
    report: &mut Report,
) -> Result<Vec<String>, Failure> {
    if FileKind::of(output) == Some(FileKind::Template) {
        let built = bench.built().ok_or(PoseError::NotBuilt)?;
        return Ok(store_rig(&RealDisk, output, &baked(bench.rig(), built))?);
    }
    let (model, settings) = character_of(bench, args.mesh.as_deref(), &args.weights, &args.export, report)?;
    Ok(store_model(&RealDisk, output, &model, &settings)?)
}

/// Built skeleton of a workbench as posed, with a mesh skinned to it if there is one, and the settings for writing it.
/// Binding the mesh may change commands: the rig is built, and posed, as it is afterwards.
pub(super) fn character_of(
    bench: &mut Workbench,
    mesh: Option<&Path>,
    weights: &WeightArgs,
    export: &ExportArgs,
    report: &mut Report,
) -> Result<(Model, GltfWriteSettings), Failure> {
    // The mesh is bound elsewhere, so that no time passes for the pose.
    let mut own = Workbench::with_rig(SEED, bench.rig().clone());
    if let Some(built) = bench.built() {
        own.set_built(Arc::new(built.clone()));
    }
    if let Some(mesh) = mesh {
        let model = load_model(&RealDisk, mesh)?;
        report.notes(model.notes.iter().cloned());
        own.open(model, true)?;
        bind(&mut own, weights.settings(), &weights.claim, Vec::new(), report)?;
        let edits = edits_between(bench.rig(), own.rig()).map_err(|error| Failure::Input(Box::new(error)))?;
        if !edits.is_empty() {
            bench.operate(Operation::Edits(edits))?;
        }
    }
    let posed = bench.posed_nodes()?;
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    let skeleton = baked(bench.rig(), built);
    let joints: Vec<Uid> = skeleton.walk().map(|joint| joint.data.uid).collect();
    own.set_built(Arc::new(built.clone()));
    let mut model = own.character();
    if mesh.is_none() {
        mark_joints(&mut model, &skeleton);
    }
    pose(&mut model, &joints, built, &posed);
    let mut settings = export.settings();
    settings.all_joints |= mesh.is_none();
    Ok((model, settings))
}

/// Moves the nodes of an exported model to the pose; bind poses stay.
fn pose(model: &mut Model, joints: &[Uid], built: &BuiltRig, posed: &[Trs]) {
    let index = built.index();
    for (node, uid) in model.nodes.iter_mut().zip(joints) {
        if let Some(at) = index.get(uid) {
            node.rest = posed[*at];
        }
    }
}
