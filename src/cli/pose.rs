//! `rigsmith pose`: the app on the command line. Builds a rig, writes the entities of its controls, and reports or
//! exports the resulting transforms.

mod rest;

use std::path::{Path, PathBuf};

use clap::Args;

pub(super) use self::rest::{built_with, is_still};

use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, SEED, WeightArgs,
    build::{self, MeshSource},
    limits,
    project_meshes::{check_output, own_meshes},
    report::counted,
    skin,
    switches::SwitchArgs,
};
use crate::{
    files::{FileKind, RealDisk, store_owned_model},
    headless::{
        Workbench,
        posing::{ControlWrite, HeldValue, PoseError, PosedNode, PosedRig},
    },
    plugins::{commands::BuildStep, surface::RigMesh},
    rig::{Rig, RigEdit, bake::baked, operations::Operation},
};

/// Pose of a rig on the command line; shared with `rigsmith render`.
#[derive(Args, Debug, Clone, Default)]
pub(super) struct PoseSteps {
    /// Writes one value: CONTROL.translate=(x,y,z), CONTROL.rotate=(x,y,z) in degrees, CONTROL.scale=(x,y,z), all
    /// relative to rest in the control's own axes, or NODE.ATTRIBUTE=value with a number or the name of a choice;
    /// CONTROL is a name, a label or a reference (@...); may be repeated
    #[arg(long = "set", value_name = "NODE.CHANNEL=VALUE", allow_hyphen_values = true)]
    pub set: Vec<String>,
    /// Throws a switch without a jump: NAME=ik, NAME=fk or NAME=SPACE, the name of a space. NAME is a local group, a control
    /// or a joint of the limb. Switches come after --set and keep the pose that it makes; controls that a switch moves
    /// still get the values that --set gives them. May be repeated
    #[arg(long = "switch", value_name = "NAME=VALUE")]
    pub switches: Vec<String>,
    /// Frames of a sixtieth of a second that pass afterwards, for springs
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub frames: u32,
    #[command(flatten)]
    pub parts: SwitchArgs,
}

impl PoseSteps {
    /// True if no step is requested.
    #[cfg(feature = "render")]
    pub(super) fn is_empty(&self) -> bool {
        self.set.is_empty() && self.switches.is_empty() && self.frames == 0 && self.parts.is_empty()
    }
}

/// Arguments of `rigsmith pose`.
#[derive(Args, Debug)]
pub(super) struct PoseArgs {
    /// The rig: a .rig.ron, or a project (.rigsmith.ron), whose pose is kept
    pub rig: PathBuf,
    /// A mesh to bind to what is built; may be repeated, for all meshes of one character
    #[arg(long = "mesh", value_name = "MESH")]
    meshes: Vec<PathBuf>,
    #[command(flatten)]
    steps: PoseSteps,
    /// A stored pose of a project to begin with
    #[arg(long, value_name = "NAME")]
    pose: Option<String>,
    /// The file to write: .glb or .gltf for the posed character, .rig.ron for the posed skeleton, .png for a picture
    #[arg(short, long)]
    output: Option<Output>,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
    #[cfg(feature = "render")]
    #[command(flatten)]
    deform: super::render::DeformArgs,
}

impl From<PoseError> for Failure {
    fn from(error: PoseError) -> Self {
        match error {
            PoseError::Syntax(_) => Self::Usage(error.to_string()),
            error => Self::Input(Box::new(error)),
        }
    }
}

pub(super) fn run(args: &PoseArgs) -> Result<Report, Failure> {
    let kind = args.output.as_deref().map(FileKind::of);
    let is_picture = args.output.as_deref().is_some_and(is_png);
    #[cfg(feature = "render")]
    if is_picture {
        super::device_selection::restart_without();
    }
    if let (Some(output), false) = (&args.output, is_picture)
        && !matches!(kind, Some(Some(FileKind::Glb | FileKind::Gltf | FileKind::Template)))
    {
        return Err(Failure::Usage(format!("cannot write `{}`; give .glb, .gltf, .rig.ron or .png", output.display())));
    }
    #[cfg(feature = "render")]
    if args.deform.is_for_pictures_only() && !is_picture {
        let reason = "--deform dqs shows what an engine with dual quaternions does; files have weights, not the way in \
                      which they are blended: write a .png";
        return Err(Failure::Usage(reason.to_owned()));
    }
    let inputs: Vec<&Path> = std::iter::once(&args.rig).chain(&args.meshes).map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, args.output.as_deref(), &[])?;
    let writes = parsed(&args.steps, &args.rig)?;
    if !args.meshes.is_empty() && (kind == Some(Some(FileKind::Template)) || kind.is_none()) {
        return Err(Failure::Usage(
            "--mesh is for a character or a picture; write one with -o NAME.glb or .png".to_owned(),
        ));
    }
    let mut report = Report::default();
    let (mut rig, own) = read(args, &mut report)?;
    args.steps.parts.apply(&mut rig)?;
    if !is_picture && rest::is_at_rest(args, &own, &rig) {
        rest::pose(args, rig, &mut report)?;
    } else {
        let mut bench = match !is_picture && rest::needs_no_processor(args, &own, &rig) {
            true => rest::built_bench(rig)?,
            false => limits::workbench(rig),
        };
        let held = run_steps(&mut bench, &args.steps, &writes)?;
        report.notes(held);
        tell_nodes(&mut report, bench.iter_nodes()?);
        match &args.output {
            Some(output) if is_picture => picture(args, own, output, &bench, &mut report)?,
            Some(output) => write(args, own, output, bench, &mut report)?,
            None => {}
        }
    }
    if let Some(output) = &args.output {
        report.line(format!("wrote {}", output.display()));
        report.set("output", output.display().to_string());
    }
    Ok(report)
}

/// Adds the nodes of a posed rig to a report, and how far entities are off the computed places.
fn tell_nodes(report: &mut Report, posed: impl Iterator<Item = PosedNode>) {
    let (mut nodes, mut error) = (0, 0.0_f32);
    let told = posed.inspect(|node| {
        nodes += 1;
        error = error.max(node.entity.translation.distance(node.program.translation));
    });
    report.set_list("nodes", told);
    let nodes = counted(nodes, "node", "nodes");
    report.line(format!("posed {nodes}; an app shows them within about {error:.0e} units of the computed places"));
    report.set("error", error);
}

fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

/// Parsed values of `--set` for the rig of a file; refuses more frames than are taken before anything is built.
pub(super) fn parsed(steps: &PoseSteps, rig: &Path) -> Result<Vec<ControlWrite>, Failure> {
    limits::check_frames(rig, steps.frames)?;
    steps.set.iter().map(|text| Ok(text.parse::<ControlWrite>()?)).collect()
}

/// Builds the rig unless it is built, writes values, throws switches, which keep that pose, writes the values again, for the
/// controls that the switches moved, and simulates frames.
///
/// Returns the values that locks and limits hold.
pub(super) fn run_steps(
    bench: &mut Workbench,
    steps: &PoseSteps,
    writes: &[ControlWrite],
) -> Result<Vec<HeldValue>, Failure> {
    if bench.built().is_none()
        && let Some(error) = bench.build(BuildStep::All).error
    {
        return Err(Failure::Input(Box::new(error)));
    }
    let mut switches = Vec::with_capacity(steps.switches.len());
    for switch in &steps.switches {
        let wrong = || Failure::Usage(format!("--switch {switch}: write NAME=VALUE, for example arm_l=fk"));
        let (name, value) = switch.split_once('=').ok_or_else(wrong)?;
        switches.push((name.trim(), value.trim()));
    }
    let held = bench.pose_through(writes, &switches)?;
    bench.frames(steps.frames).map_err(PoseError::from)?;
    Ok(held)
}

/// The rig, and the meshes that it has in a project.
fn read(args: &PoseArgs, report: &mut Report) -> Result<(Rig, Vec<RigMesh>), Failure> {
    let mut own = Vec::new();
    let mut rig = if FileKind::of(&args.rig) == Some(FileKind::Project) {
        let mut project = limits::load_project(&args.rig)?;
        check_output(&project, args.output.as_deref(), args.in_place)?;
        if args.meshes.is_empty() {
            limits::refuse_outside(&project)?;
        }
        report.notes(project.notes);
        if project.rigs.is_empty() {
            return Err(Failure::Input(format!("`{}` has no rig to pose", args.rig.display()).into()));
        }
        let rig = project.rigs.remove(0);
        for other in &project.rigs {
            report
                .notes
                .push(format!("the rig \"{}\" of the project is left out: the first one is posed", other.about().name));
        }
        let mut told = Report::default();
        own = own_meshes(project.meshes, &rig, &mut told);
        if args.meshes.is_empty() {
            report.notes(told.notes);
        } else if !own.is_empty() {
            own.clear();
            report.notes.push("--mesh stands in for the mesh of the project".to_owned());
        }
        rig
    } else {
        skin::load_rig(&args.rig, report)?
    };
    if let Some(name) = &args.pose {
        let stored = rig.stored_poses().iter().find(|pose| pose.name == *name).map(|pose| pose.uid);
        let stored = stored.ok_or_else(|| {
            let known: Vec<&str> = rig.stored_poses().iter().map(|pose| pose.name.as_str()).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            Failure::Input(format!("no stored pose is called \"{name}\"; stored poses: {known}").into())
        })?;
        let mut uids = crate::rig::UidSource::seeded(SEED);
        let applied = Operation::ApplyPose(stored).run(&mut rig, &mut uids, None);
        applied.map_err(|error| Failure::Input(Box::new(error)))?;
    }
    Ok((rig, own))
}

/// Writes the character, or the skeleton, in the pose of the entities.
fn write(
    args: &PoseArgs,
    mut own: Vec<RigMesh>,
    output: &Output,
    mut bench: Workbench,
    report: &mut Report,
) -> Result<(), Failure> {
    if FileKind::of(output) == Some(FileKind::Template) {
        let PosedRig { rig, built, nodes: posed } = bench.into_posed()?;
        let mut skeleton = baked(&rig, &built);
        let joints: Vec<_> = skeleton.walk().map(|joint| joint.data.uid).collect();
        let index = built.index();
        for joint in joints {
            if let Some(at) = index.get(&joint) {
                let set = RigEdit::SetRest(joint, posed[*at].into());
                skeleton.apply(&set).map_err(|error| Failure::Input(Box::new(error)))?;
            }
        }
        let has_commands = rig.walk().any(|joint| !joint.data.tags.is_empty());
        drop((index, rig, built));
        report.notes(build::store_built(output, &args.rig, skeleton, has_commands)?);
        return Ok(());
    }
    if own.is_empty() && args.meshes.is_empty() {
        let (model, settings) = {
            let PosedRig { rig, built, nodes } = bench.into_posed()?;
            build::skeleton_in_pose(&rig, &built, &nodes, &args.export)
        };
        report.notes(store_owned_model(&RealDisk, output, model, &settings)?);
        return Ok(());
    }
    let (model, settings) = match own.len() {
        0 => build::character_of(&mut bench, &args.meshes, &args.weights, &args.export, report)?,
        1 => {
            let mesh = MeshSource::Open(Box::new(own.swap_remove(0)));
            build::character_with(&mut bench, vec![mesh], &args.weights, &args.export, report)?
        }
        _ => build::posed_meshes(&bench, &own, &args.export)?,
    };
    // What is written is read back, which takes as much memory again.
    drop(bench);
    report.notes(store_owned_model(&RealDisk, output, model, &settings)?);
    Ok(())
}

#[cfg(feature = "render")]
fn picture(
    args: &PoseArgs,
    own: Vec<RigMesh>,
    output: &Output,
    bench: &Workbench,
    report: &mut Report,
) -> Result<(), Failure> {
    let meshes = match own.is_empty() {
        true => build::loaded(&args.meshes, report)?,
        false => own.into_iter().map(|mesh| MeshSource::Open(Box::new(mesh))).collect(),
    };
    super::render::picture_of(bench, meshes, &args.weights, args.deform, output, report)
}

#[cfg(not(feature = "render"))]
fn picture(_: &PoseArgs, _: Vec<RigMesh>, output: &Output, _: &Workbench, _: &mut Report) -> Result<(), Failure> {
    let reason = format!("cannot draw `{}`: this program was built without pictures", output.display());
    Err(Failure::Usage(reason))
}
