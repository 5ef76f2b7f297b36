//! `rigsmith render`: a picture of a mesh, a template, a character or a project.

use std::path::{Path, PathBuf};

use bevy::math::{UVec2, Vec3};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{
    ArgumentError, Failure, InPlaceArgs, Output, Report, SEED, WeightArgs,
    build::{MeshSource, open_all},
    device_selection, limits,
    pose::{self, PoseSteps},
    progress::spinning,
};
use crate::{
    algo::view::View,
    files::{FileKind, MeshState, RealDisk, save_atomic},
    headless::Workbench,
    plugins::{
        commands::BuildStep,
        display::{MeshDisplay, WeightColors},
        drawing::{LabelChoice, RigDrawing},
        fit::FitReport,
        surface::RigMesh,
    },
    render::{Deform, PictureSettings, adapter, png, take_picture},
    rig::{
        Rig, RigEdit, Uid, UidSource,
        character::{import_rig_text, import_skeleton},
        operations::Operation,
    },
};

/// Room around the joints of a part in its picture, as a share of their extent.
const AROUND_PART: f32 = 0.4;

/// Arguments of `rigsmith render`.
#[derive(Args, Debug)]
pub(super) struct RenderArgs {
    /// A mesh (.obj, .gltf, .glb, .vrm), a skeleton (.rig.ron, .rig) or a project (.rigsmith.ron)
    pub file: PathBuf,
    /// The picture to write, a .png
    #[arg(short, long)]
    output: Output,
    /// View of the camera
    #[arg(long, value_enum, default_value_t = ViewArg::Front)]
    view: ViewArg,
    /// View from any direction: yaw and pitch in degrees, starting from the front; YAW,PITCH
    #[arg(long, value_name = "YAW,PITCH", value_parser = orbit, allow_hyphen_values = true)]
    orbit: Option<(f32, f32)>,
    /// Orthographic projection, without perspective
    #[arg(long)]
    orthographic: bool,
    /// Width and height in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size, default_value = "1280x720")]
    size: (u32, u32),
    /// The stored pose of a project to show; `rest` for the rest pose
    #[arg(long, value_name = "NAME")]
    pose: Option<String>,
    /// Hide the rig
    #[arg(long)]
    no_rig: bool,
    /// Hide the grid
    #[arg(long)]
    no_grid: bool,
    /// Show the names of joints
    #[arg(long)]
    labels: bool,
    /// Show the mesh half transparent
    #[arg(long)]
    xray: bool,
    /// Show the edges of the mesh
    #[arg(long)]
    wireframe: bool,
    /// Build the rig, and show its controls
    #[arg(long)]
    build: bool,
    #[command(flatten)]
    steps: PoseSteps,
    #[command(flatten)]
    deform: DeformArgs,
    /// Show weights as colours: those of the joint with this label, or `all`
    #[arg(long, value_name = "JOINT")]
    weights: Option<String>,
}

/// Skinning of a picture; shared with `rigsmith pose`.
#[derive(Args, Debug, Clone, Copy)]
pub(super) struct DeformArgs {
    /// Blend of the motions of joints in a picture
    #[arg(long, value_enum, default_value_t = DeformArg::Linear)]
    deform: DeformArg,
}

#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum DeformArg {
    /// Linear blend skinning, as in exported files
    Linear,
    /// Dual quaternion skinning, as in an engine that has it
    Dqs,
}

impl DeformArgs {
    /// True unless the blend is that of exported files.
    pub(super) fn is_for_pictures_only(self) -> bool {
        self.deform == DeformArg::Dqs
    }

    fn deform(self) -> Deform {
        match self.deform {
            DeformArg::Linear => Deform::Linear,
            DeformArg::Dqs => Deform::DualQuaternion,
        }
    }
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum ViewArg {
    /// The front, with the face
    Front,
    /// The back
    Back,
    /// The character's left side
    Left,
    /// The character's right side
    Right,
    /// The top
    Top,
    /// The bottom
    Bottom,
}

fn orbit(text: &str) -> Result<(f32, f32), ArgumentError> {
    let wanted = ArgumentError::NoOrbit;
    let (yaw, pitch) = text.split_once(',').ok_or(wanted)?;
    let number = |text: &str| text.trim().parse::<f32>().ok().filter(|number| number.is_finite()).ok_or(wanted);
    Ok((number(yaw)?, number(pitch)?.clamp(-90.0, 90.0)))
}

fn size(text: &str) -> Result<(u32, u32), ArgumentError> {
    let wanted = ArgumentError::NoSize;
    let (width, height) = text.split_once('x').ok_or(wanted)?;
    let number = |text: &str| text.trim().parse::<u32>().map_err(|_| wanted);
    Ok((number(width)?, number(height)?))
}

/// Content of the picture.
struct Scene {
    rig: Rig,
    meshes: Vec<RigMesh>,
}

pub(super) fn run(args: &RenderArgs) -> Result<Report, Failure> {
    device_selection::restart_without();
    if args.output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
        return Err(Failure::Usage(format!("cannot draw into `{}`; write a .png", args.output.display())));
    }
    InPlaceArgs::default().check(&[&args.file], Some(&args.output), &[])?;
    let mut report = Report::default();
    let mut scene = read(args, &mut report)?;
    limits::check_time("drawing the picture")?;
    if let Some(pose) = &args.pose {
        strike(&mut scene.rig, pose)?;
    }
    let mut state = None;
    let is_built = args.build || !args.steps.is_empty();
    if is_built {
        let writes = pose::parsed(&args.steps, &args.file)?;
        if scene.rig.walk().all(|joint| joint.data.tags.is_empty()) {
            report.notes.push("the file has no commands, so nothing is built and there are no controls".to_owned());
        }
        args.steps.parts.apply(&mut scene.rig)?;
        let mut bench = limits::workbench(scene.rig);
        report.notes(pose::run_steps(&mut bench, &args.steps, &writes)?);
        scene.rig = bench.posed_document()?;
        state = Some(bench.runtime()?.state().clone());
    }
    let (rig, meshes) = (scene.rig, scene.meshes);
    let (weights, selected) = match args.weights.as_deref() {
        None => (WeightColors::Off, Vec::new()),
        Some("all") => (WeightColors::AllJoints, Vec::new()),
        Some(label) => {
            let joint = rig.find_label(label).ok_or_else(|| {
                Failure::Input(format!("no joint is called \"{label}\"; `rigsmith info` lists them").into())
            })?;
            (WeightColors::Joint(joint), vec![joint])
        }
    };
    if weights != WeightColors::Off && rig.skins().next().is_none() {
        report.notes.push("nothing is skinned, so there are no weights to show".to_owned());
    }
    let view = match args.orbit {
        Some((yaw, pitch)) => View::Orbit(yaw, pitch),
        None => match args.view {
            ViewArg::Front => View::Front,
            ViewArg::Back => View::Back,
            ViewArg::Left => View::Left,
            ViewArg::Right => View::Right,
            ViewArg::Top => View::Top,
            ViewArg::Bottom => View::Bottom,
        },
    };
    let settings = PictureSettings {
        size: UVec2::from(args.size),
        view,
        orthographic: args.orthographic,
        display: MeshDisplay { xray: args.xray, wireframe: args.wireframe, weights, ..MeshDisplay::default() },
        drawing: RigDrawing {
            rig: !args.no_rig,
            grid: !args.no_grid,
            labels: if args.labels { LabelChoice::All } else { LabelChoice::None },
            ..RigDrawing::default()
        },
        selected,
        build: is_built,
        state,
        deform: args.deform.deform(),
        ..PictureSettings::default()
    };
    if let Some((name, true)) = adapter() {
        report.notes.push(format!("no graphics card: drawn in software ({name})"));
    }
    draw(rig, meshes, &settings, &args.output)?;
    report.line(format!("wrote {} ({} x {} pixels)", args.output.display(), args.size.0, args.size.1));
    report.set("output", args.output.display().to_string());
    report.set("size", json!([args.size.0, args.size.1]));
    Ok(report)
}

/// Draws a rig as it stands on a workbench, with meshes skinned to its built joints.
pub(super) fn picture_of(
    posed: &Workbench,
    meshes: Vec<MeshSource>,
    weights: &WeightArgs,
    deform: DeformArgs,
    output: &Path,
    report: &mut Report,
) -> Result<(), Failure> {
    let mut bench = limits::workbench(posed.posed_document()?);
    bench.build(BuildStep::All);
    open_all(meshes, &mut bench, weights, report)?;
    let meshes: Vec<RigMesh> = bench.meshes().cloned().collect();
    let state = Some(posed.runtime()?.state().clone());
    let settings = PictureSettings { build: true, state, deform: deform.deform(), ..PictureSettings::default() };
    draw(bench.rig().clone(), meshes, &settings, output)
}

/// Draws a rig that was fitted to the mesh of a workbench as it is at rest, seen from the figure's front, the mesh half
/// transparent; joints that the fit is not sure of are shown as selected, as in the window.
pub(super) fn picture_of_fit(
    bench: &Workbench,
    fitted: &FitReport,
    is_part: bool,
    output: &Path,
) -> Result<(), Failure> {
    let display = MeshDisplay { xray: true, ..MeshDisplay::default() };
    // The grid lies on the ground of the file's Y axis, which a figure that stands otherwise would hang beside.
    let drawing = RigDrawing { grid: fitted.fit.up == Vec3::Y, ..RigDrawing::default() };
    let selected = fitted.doubtful().collect();
    let bounds = is_part.then(|| surroundings(fitted));
    let turn = fitted.fit.turn();
    let settings = PictureSettings { display, drawing, selected, turn, bounds, ..PictureSettings::default() };
    draw(bench.rig().clone(), bench.mesh().cloned().into_iter().collect(), &settings, output)
}

/// Draws a picture and writes it, where time is left for each.
fn draw(rig: Rig, meshes: Vec<RigMesh>, settings: &PictureSettings, output: &Path) -> Result<(), Failure> {
    let picture = |error| Failure::Input(Box::new(error));
    limits::check_time("drawing the picture")?;
    let image = spinning("drawing", || Ok::<_, Failure>(take_picture(rig, meshes, settings)))?.map_err(picture)?;
    let bytes = png(image).map_err(picture)?;
    limits::check_time("drawing the picture")?;
    save_atomic(&RealDisk, output, &bytes).map_err(|error| Failure::Input(Box::new(error)))
}

/// Box around the joints of a fit, with some room: what a picture of a part shows.
fn surroundings(fitted: &FitReport) -> [Vec3; 2] {
    let places = fitted.fit.joints.iter().map(|joint| joint.position);
    let (low, high) = places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let room = Vec3::splat(AROUND_PART * (high - low).max_element());
    [low - room, high + room]
}

fn read(args: &RenderArgs, report: &mut Report) -> Result<Scene, Failure> {
    let path = &args.file;
    let mut uids = UidSource::seeded(SEED);
    let refused = |error: crate::rig::EditError| Failure::Input(format!("`{}`: {error}", path.display()).into());
    match FileKind::of(path) {
        Some(FileKind::Template) => {
            let template = limits::load_template(path)?;
            report.notes(template.notes);
            Ok(Scene { rig: template.rig, meshes: Vec::new() })
        }
        Some(FileKind::RigText) => {
            let text = limits::load_rig_text(path)?;
            let mut rig = Rig::new(uids.next_uid(), "");
            for edit in import_rig_text(&text, &mut uids).0 {
                rig.apply(&edit).map_err(refused)?;
            }
            limits::check_rig(path, &rig)?;
            Ok(Scene { rig, meshes: Vec::new() })
        }
        Some(FileKind::Project) => {
            let mut project = spinning("reading", || limits::load_project(path))?;
            limits::refuse_outside(&project)?;
            report.notes(project.notes);
            let empty = || Failure::Input(format!("`{}` has no rig to draw", path.display()).into());
            let rig = (!project.rigs.is_empty()).then(|| project.rigs.swap_remove(0)).ok_or_else(empty)?;
            let mut meshes = Vec::new();
            for mesh in project.meshes {
                if mesh.rig != rig.uid() {
                    continue;
                }
                match mesh.shape {
                    // The notes mention the missing mesh already.
                    MeshState::Missing { .. } => {}
                    MeshState::Open { model, .. } => meshes.push(RigMesh::new(mesh.uid, *model, mesh.nodes.to_vec())),
                }
            }
            Ok(Scene { rig, meshes })
        }
        _ => {
            let model = spinning("reading", || limits::load_model(path))?;
            report.notes(model.notes.iter().cloned());
            let mut rig = Rig::new(uids.next_uid(), model.name.clone());
            let uid = uids.next_uid();
            let skeleton = import_skeleton(&model, &mut uids);
            let skin = skeleton.skin.map(|skin| RigEdit::SetSkin(uid, Some(skin)));
            for edit in skeleton.edits.into_iter().chain(skin) {
                rig.apply(&edit).map_err(refused)?;
            }
            Ok(Scene { rig, meshes: vec![RigMesh::new(uid, model, skeleton.nodes)] })
        }
    }
}

/// Puts a rig into a stored pose, or into the rest pose.
fn strike(rig: &mut Rig, name: &str) -> Result<(), Failure> {
    let stored: Option<Uid> = rig.stored_poses().iter().find(|pose| pose.name == name).map(|pose| pose.uid);
    let operation = match (stored, name) {
        (Some(pose), _) => Operation::ApplyPose(pose),
        (None, "rest") => Operation::ResetPose(Vec::new()),
        (None, _) => {
            let known: Vec<&str> = rig.stored_poses().iter().map(|pose| pose.name.as_str()).collect();
            let known =
                if known.is_empty() { "there are none".to_owned() } else { format!("there are: {}", known.join(", ")) };
            return Err(Failure::Input(format!("no stored pose is called \"{name}\"; {known}").into()));
        }
    };
    let run = operation.run(rig, &mut UidSource::seeded(SEED), None);
    run.map(drop).map_err(|error| Failure::Input(Box::new(error)))
}
