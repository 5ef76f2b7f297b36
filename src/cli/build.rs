//! `rigsmith build`: carries out the commands of a rig.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use serde_json::json;

use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, VrmArgs, WeightArgs,
    binding::{add_of_mesh, bind},
    convert::skeleton_model,
    explanation::Explanation,
    limits,
    report::{counted, is_json},
    skin,
    switches::SwitchArgs,
    vrm::AvatarDraft,
};
use crate::{
    files::{FileKind, RealDisk, StoreError, has_parts, store_owned_model, store_rig, store_rig_over},
    headless::{Workbench, posing::PoseError},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Trs},
    },
    plugins::{
        commands::{BuildStep, NamedProgramError, Processor},
        surface::RigMesh,
    },
    processor::{Builder, CommandState, RunReport, with_missing_name},
    rig::{
        BuiltRig, Rig, Uid,
        bake::baked,
        character::{Character, character, mark_joints},
        operations::Operation,
        update::edits_between,
    },
    solve::program::RigProgram,
};

/// Arguments of `rigsmith build`.
#[derive(Args, Debug)]
pub(super) struct BuildArgs {
    /// The rig: a .rig.ron
    pub rig: PathBuf,
    /// A mesh to bind to what is built; may be repeated, for all meshes of one character
    #[arg(long = "mesh", value_name = "MESH")]
    meshes: Vec<PathBuf>,
    #[command(flatten)]
    switches: SwitchArgs,
    /// Stops after so many commands
    #[arg(long, value_name = "N")]
    until: Option<usize>,
    /// Lists the commands with their state and time
    #[arg(long)]
    trace: bool,
    /// The file to write: .glb or .gltf for the character as posed, .vrm for an avatar in VRM 1.0 (at rest in a T-pose, with
    /// bones, expressions, gaze and springs), .rig.ron for the built skeleton
    #[arg(short, long)]
    output: Option<Output>,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    vrm: VrmArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn run(args: &BuildArgs) -> Result<Report, Failure> {
    if let Some(output) = &args.output
        && !FileKind::of(output).is_some_and(|kind| kind.is_gltf() || kind == FileKind::Template)
    {
        return Err(Failure::Usage(format!("cannot write `{}`; give .glb, .gltf, .vrm or .rig.ron", output.display())));
    }
    let is_character = args.output.as_deref().is_some_and(|path| FileKind::of(path) != Some(FileKind::Template));
    if !args.meshes.is_empty() && !is_character {
        return Err(Failure::Usage("--mesh is for a character; write one with -o NAME.glb".to_owned()));
    }
    args.vrm.check(args.output.as_deref())?;
    let inputs: Vec<&Path> = std::iter::once(&args.rig).chain(&args.meshes).map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, args.output.as_deref(), &[])?;
    let mut report = Report::default();
    let mut rig = skin::load_rig(&args.rig, &mut report)?;
    args.switches.apply(&mut rig)?;
    build(args, rig, &mut report)?;
    Ok(report)
}

/// Builds a rig, and writes what is built. An app, which takes several times the memory, is used for poses and meshes alone.
fn build(args: &BuildArgs, rig: Rig, report: &mut Report) -> Result<(), Failure> {
    let modules = Arc::new(limits::modules());
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    let mut outcome = match args.until {
        Some(count) => builder.run_to(count),
        None => builder.run_all(),
    };
    outcome.error = outcome.error.map(|error| with_missing_name(&rig, &modules, error));
    let built = builder.built();
    describe(args, report, &rig, &builder, &built, outcome);
    let has_commands = !builder.is_empty();
    drop(builder);
    if report.at_fault {
        return Ok(());
    }
    limits::check_time("building the rig")?;
    // Checked even if no file is written: a built rig that cannot run, such as one with a cycle of parents, is no rig.
    RigProgram::check(&built).map_err(|error| PoseError::CannotRun(NamedProgramError::new(error, &rig)))?;
    let Some(output) = &args.output else { return Ok(()) };
    let meta = args.vrm.meta(&rig, output)?;
    let is_plain = args.meshes.is_empty() && !has_commands && rig.pose().is_empty() && meta.is_none();
    let notes = if is_plain || FileKind::of(output) == Some(FileKind::Template) {
        store_at_rest(output, &args.rig, rig, built, &args.export, has_commands)?
    } else {
        drop(built);
        let mut bench = limits::workbench(rig);
        bench.build(args.until.map_or(BuildStep::All, BuildStep::To));
        let (mut model, settings) = character_of(&mut bench, &args.meshes, &args.weights, &args.export, report)?;
        match meta {
            Some(meta) => {
                let draft = AvatarDraft::new(bench.rig(), bench.built(), &mut model);
                draft.store(model, meta, output, &settings, report)?;
                Vec::new()
            }
            None => {
                drop(bench);
                store_owned_model(&RealDisk, output, model, &settings)?
            }
        }
    };
    report.notes(notes);
    report.line(format!("wrote {}", output.display()));
    report.set("output", output.display().to_string());
    Ok(())
}

/// Saves the built skeleton of a rig at rest, without a mesh, as a model or as a rig. Reading back what was written takes as
/// much memory as the rig, which is dropped before.
pub(super) fn store_at_rest(
    output: &Path,
    source: &Path,
    rig: Rig,
    built: BuiltRig,
    export: &ExportArgs,
    has_commands: bool,
) -> Result<Vec<String>, StoreError> {
    let skeleton = baked(&rig, &built);
    drop((rig, built));
    if FileKind::of(output) == Some(FileKind::Template) {
        return store_built(output, source, skeleton, has_commands);
    }
    let (model, settings) = model_of_skeleton(skeleton, export);
    store_owned_model(&RealDisk, output, model, &settings)
}

/// A skeleton at rest as a model without a mesh, and the settings for writing it.
pub(super) fn model_of_skeleton(skeleton: Rig, export: &ExportArgs) -> (Model, GltfWriteSettings) {
    let mut model = skeleton_model(&skeleton);
    mark_joints(&mut model, &skeleton);
    (model, GltfWriteSettings { all_joints: true, ..export.settings() })
}

/// Note about a template whose parts a skeleton cannot have.
const BUILT_ALONE: &str = "the file has the built skeleton alone, without commands and parts: what changes in the files of the \
                           template and its parts comes to it when it is built again";

/// Saves the skeleton that was built of a rig. Parts of the rig's file stay parts in it unless they have commands, which a
/// skeleton has no more.
pub(super) fn store_built(
    output: &Path,
    source: &Path,
    skeleton: Rig,
    has_commands: bool,
) -> Result<Vec<String>, StoreError> {
    let has_parts = has_parts(&RealDisk, source);
    if has_parts && !has_commands {
        return store_rig_over(&RealDisk, output, skeleton, &[source]);
    }
    let mut notes = store_rig(&RealDisk, output, skeleton)?;
    notes.extend(has_parts.then(|| BUILT_ALONE.to_owned()));
    Ok(notes)
}

/// Adds what a build came to. A command that stopped it is a fault of the input.
fn describe(args: &BuildArgs, report: &mut Report, rig: &Rig, builder: &Builder, built: &BuiltRig, outcome: RunReport) {
    trace(args, report, rig, builder, &outcome);
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
    }
}

/// Adds the commands to the report: a line each for people who ask for them, and a list for programs.
fn trace(args: &BuildArgs, report: &mut Report, rig: &Rig, builder: &Builder, outcome: &RunReport) {
    if !args.trace && !is_json() {
        return;
    }
    let executed: HashSet<Uid> = outcome.executed.iter().copied().collect();
    let mut lines = Vec::new();
    let told = builder.list().into_iter().filter_map(|entry| {
        let status = builder.status(entry.command)?;
        let state = match status.state {
            CommandState::Pending => "pending",
            CommandState::Done => "done",
            CommandState::Skipped => "skipped",
            CommandState::Failed => "failed",
        };
        let label = rig.joint(entry.joint).and_then(|joint| joint.data.label.clone());
        let skipped = status.skipped.as_ref().map(|reason| limits::message(&reason.to_string()));
        let stop = outcome.error.as_ref().filter(|error| error.command == entry.command);
        let error = stop.map(|error| &error.problem).or(status.error.as_ref());
        if args.trace {
            let name = label.clone().unwrap_or_else(|| entry.joint.to_string());
            let reason = skipped.as_ref().map_or_else(String::new, |reason| format!("  ({reason})"));
            lines.push(format!("{state:>8} {:>9.1} µs  {name}  {}{reason}", status.micros, entry.module));
        }
        Some(json!({
            "uid": entry.command.to_string(),
            "joint": entry.joint.to_string(),
            "label": label,
            "module": &*entry.module,
            "state": state,
            "micros": status.micros,
            "executed": executed.contains(&entry.command),
            "error": error.map(|error| limits::message(&error.to_string())),
            "skipped": skipped,
        }))
    });
    report.set_list("commands", told);
    report.lines.append(&mut lines);
}

/// Built skeleton of a workbench as posed, with the meshes of files skinned to it, and the settings for writing it.
/// Binding a mesh may change commands: the rig is built, and posed, as it is afterwards.
pub(super) fn character_of(
    bench: &mut Workbench,
    meshes: &[PathBuf],
    weights: &WeightArgs,
    export: &ExportArgs,
    report: &mut Report,
) -> Result<(Model, GltfWriteSettings), Failure> {
    match loaded(meshes, report)? {
        none if none.is_empty() => posed_skeleton(bench, export),
        meshes => character_with(bench, meshes, weights, export, report),
    }
}

/// Meshes of files.
pub(super) fn loaded(files: &[PathBuf], report: &mut Report) -> Result<Vec<MeshSource>, Failure> {
    let mut meshes = Vec::with_capacity(files.len());
    for file in files {
        let model = limits::load_model(file)?;
        report.notes(model.notes.iter().cloned());
        meshes.push(MeshSource::Model(Box::new(model)));
    }
    Ok(meshes)
}

/// Mesh for a rig.
pub(super) enum MeshSource {
    /// A file's mesh, which is bound to what is built.
    Model(Box<Model>),
    /// A mesh of a project, which keeps its weights if it has some.
    Open(Box<RigMesh>),
}

impl MeshSource {
    /// Puts the mesh on a workbench, whose rig is built, and binds it where it has no weights.
    pub fn open(self, bench: &mut Workbench, weights: &WeightArgs, report: &mut Report) -> Result<(), Failure> {
        match self {
            Self::Model(model) => bench.open(*model, true)?,
            Self::Open(mesh) => bench.attach(*mesh),
        }
        if bench.weights().is_some() {
            return Ok(());
        }
        bind(bench, weights.settings(), &weights.claim, Vec::new(), report)
    }

    fn name(&self) -> &str {
        match self {
            Self::Model(model) => &model.name,
            Self::Open(mesh) => &mesh.file.name,
        }
    }
}

/// Puts meshes on a workbench, whose rig is built, as [`MeshSource::open`] does. Of several, each is told by its name.
pub(super) fn open_all(
    meshes: Vec<MeshSource>,
    bench: &mut Workbench,
    weights: &WeightArgs,
    report: &mut Report,
) -> Result<(), Failure> {
    let is_only = meshes.len() == 1;
    for mesh in meshes {
        if is_only {
            return mesh.open(bench, weights, report);
        }
        let (name, mut told) = (mesh.name().to_owned(), Report::default());
        mesh.open(bench, weights, &mut told)?;
        add_of_mesh(report, &name, told);
    }
    Ok(())
}

/// Character as [`character_of`] makes it, with these meshes.
pub(super) fn character_with(
    bench: &mut Workbench,
    meshes: Vec<MeshSource>,
    weights: &WeightArgs,
    export: &ExportArgs,
    report: &mut Report,
) -> Result<(Model, GltfWriteSettings), Failure> {
    let own = bound_meshes(bench, meshes, weights, report)?;
    posed_character(bench, &own, export)
}

/// Workbench with meshes that are bound to the built rig of another one, which gets what binding changes.
pub(super) fn bound_meshes(
    bench: &mut Workbench,
    meshes: Vec<MeshSource>,
    weights: &WeightArgs,
    report: &mut Report,
) -> Result<Workbench, Failure> {
    // The meshes are bound elsewhere, so that no time passes for the pose.
    let mut own = limits::workbench(bench.rig().clone());
    own.build(match bench.processor().map(Processor::builder) {
        Some(builder) if builder.cursor() < builder.len() => BuildStep::To(builder.cursor()),
        _ => BuildStep::All,
    });
    open_all(meshes, &mut own, weights, report)?;
    let edits = edits_between(bench.rig(), own.rig()).map_err(|error| Failure::Input(Box::new(error)))?;
    if !edits.is_empty() {
        bench.operate(Operation::Edits(edits))?;
    }
    Ok(own)
}

/// Built skeleton of a workbench as posed, with the meshes that are bound to it in another one, and the settings for
/// writing it.
pub(super) fn posed_character(
    bench: &Workbench,
    own: &Workbench,
    export: &ExportArgs,
) -> Result<(Model, GltfWriteSettings), Failure> {
    let posed = bench.posed_nodes()?;
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    let joints: Vec<Uid> = baked(bench.rig(), built).walk().map(|joint| joint.data.uid).collect();
    let mut model = own.character();
    pose(&mut model, &joints, built, &posed);
    Ok((model, export.settings()))
}

/// Built skeleton of a workbench as posed, with meshes that have weights in its rig, and the settings for writing it.
pub(super) fn posed_meshes(
    bench: &Workbench,
    meshes: &[RigMesh],
    export: &ExportArgs,
) -> Result<(Model, GltfWriteSettings), Failure> {
    let posed = bench.posed_nodes()?;
    let (rig, built) = (bench.rig(), bench.built().ok_or(PoseError::NotBuilt)?);
    let joints: Vec<Uid> = baked(rig, built).walk().map(|joint| joint.data.uid).collect();
    let model_of = |mesh: &RigMesh| {
        let skin = rig.skin(mesh.uid).map(Arc::as_ref);
        character(&Character { rig, built: Some(built), file: &mesh.file, rest: &mesh.rest, nodes: &mesh.nodes, skin })
    };
    let mut models = meshes.iter().map(model_of);
    let Some(mut model) = models.next() else { return posed_skeleton(bench, export) };
    models.for_each(|more| model.append(more));
    pose(&mut model, &joints, built, &posed);
    Ok((model, export.settings()))
}

/// Built skeleton of a workbench as posed, without a mesh, and the settings for writing it.
pub(super) fn posed_skeleton(bench: &Workbench, export: &ExportArgs) -> Result<(Model, GltfWriteSettings), Failure> {
    let posed = bench.posed_nodes()?;
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    Ok(skeleton_in_pose(bench.rig(), built, &posed, export))
}

/// Built skeleton in a pose, without a mesh, and the settings for writing it.
pub(super) fn skeleton_in_pose(
    rig: &Rig,
    built: &BuiltRig,
    posed: &[Trs],
    export: &ExportArgs,
) -> (Model, GltfWriteSettings) {
    let skeleton = baked(rig, built);
    let joints: Vec<Uid> = skeleton.walk().map(|joint| joint.data.uid).collect();
    let (mut model, settings) = model_of_skeleton(skeleton, export);
    pose(&mut model, &joints, built, posed);
    (model, settings)
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
