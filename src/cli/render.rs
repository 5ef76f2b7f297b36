//! `rigsmith render`: a picture of a mesh, a template, a character or a project.

use std::path::PathBuf;

use bevy::math::UVec2;
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{Failure, Output, Report, SEED, progress::spinning};
use crate::{
    algo::view::View,
    files::{FileKind, MeshState, RealDisk, load_model, load_project, load_rig_text, load_template, save_atomic},
    plugins::{
        display::{MeshDisplay, WeightColors},
        drawing::{LabelChoice, RigDrawing},
        surface::RigMesh,
    },
    render::{PictureSettings, adapter, png, take_picture},
    rig::{
        Rig, RigEdit, Uid, UidSource,
        character::{import_rig_text, import_skeleton},
        operations::Operation,
    },
};

/// Arguments of `rigsmith render`.
#[derive(Args, Debug)]
pub(super) struct RenderArgs {
    /// A mesh (.obj, .gltf, .glb), a skeleton (.rig.ron, .rig) or a project (.rigsmith.ron)
    file: PathBuf,
    /// The picture to write, a .png
    #[arg(short, long)]
    output: Output,
    /// From where
    #[arg(long, value_enum, default_value_t = ViewArg::Front)]
    view: ViewArg,
    /// From anywhere: yaw and pitch in degrees, starting from the front; YAW,PITCH
    #[arg(long, value_name = "YAW,PITCH", value_parser = orbit, allow_hyphen_values = true)]
    orbit: Option<(f32, f32)>,
    /// Without perspective
    #[arg(long)]
    orthographic: bool,
    /// Width and height in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size, default_value = "1280x720")]
    size: (u32, u32),
    /// The stored pose of a project to show; `rest` for the rest pose
    #[arg(long, value_name = "NAME")]
    pose: Option<String>,
    /// Without the rig
    #[arg(long)]
    no_rig: bool,
    /// Without the grid
    #[arg(long)]
    no_grid: bool,
    /// With the names of joints
    #[arg(long)]
    labels: bool,
    /// The mesh half transparent
    #[arg(long)]
    xray: bool,
    /// With the edges of the mesh
    #[arg(long)]
    wireframe: bool,
    /// Weights as colours: those of the joint with this label, or `all`
    #[arg(long, value_name = "JOINT")]
    weights: Option<String>,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum ViewArg {
    /// The face
    Front,
    /// From behind
    Back,
    /// The character's left side
    Left,
    /// The character's right side
    Right,
    /// From above
    Top,
    /// From below
    Bottom,
}

fn orbit(text: &str) -> Result<(f32, f32), String> {
    let wanted = || "write yaw and pitch in degrees, such as 30,15".to_owned();
    let (yaw, pitch) = text.split_once(',').ok_or_else(wanted)?;
    let number = |text: &str| text.trim().parse::<f32>().ok().filter(|number| number.is_finite()).ok_or_else(wanted);
    Ok((number(yaw)?, number(pitch)?.clamp(-90.0, 90.0)))
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let wanted = || "write width and height in pixels, such as 1280x720".to_owned();
    let (width, height) = text.split_once('x').ok_or_else(wanted)?;
    let number = |text: &str| text.trim().parse::<u32>().map_err(|_| wanted());
    Ok((number(width)?, number(height)?))
}

/// What is shown.
struct Scene {
    rig: Rig,
    meshes: Vec<RigMesh>,
}

pub(super) fn run(args: &RenderArgs) -> Result<Report, Failure> {
    if args.output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
        return Err(Failure::Usage(format!("cannot draw into `{}`; write a .png", args.output.display())));
    }
    let mut report = Report::default();
    let mut scene = read(args, &mut report)?;
    if let Some(pose) = &args.pose {
        strike(&mut scene.rig, pose)?;
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
        ..PictureSettings::default()
    };
    if let Some((name, true)) = adapter() {
        report.notes.push(format!("no graphics card: drawn in software ({name})"));
    }
    let picture = |error| Failure::Input(Box::new(error));
    let image = spinning("drawing", || Ok::<_, Failure>(take_picture(rig, meshes, &settings)))?.map_err(picture)?;
    let bytes = png(image).map_err(picture)?;
    save_atomic(&RealDisk, &args.output, &bytes).map_err(|error| Failure::Input(Box::new(error)))?;
    report.line(format!("wrote {} ({} x {} pixels)", args.output.display(), args.size.0, args.size.1));
    report.set("output", args.output.display().to_string());
    report.set("size", json!([args.size.0, args.size.1]));
    Ok(report)
}

fn read(args: &RenderArgs, report: &mut Report) -> Result<Scene, Failure> {
    let path = &args.file;
    let mut uids = UidSource::seeded(SEED);
    let refused = |error: crate::rig::EditError| Failure::Input(Box::new(error));
    match FileKind::of(path) {
        Some(FileKind::Template) => {
            let template = load_template(&RealDisk, path)?;
            report.notes(template.notes);
            Ok(Scene { rig: template.rig, meshes: Vec::new() })
        }
        Some(FileKind::RigText) => {
            let text = load_rig_text(&RealDisk, path)?;
            let mut rig = Rig::new(uids.next_uid(), "");
            for edit in import_rig_text(&text, &mut uids).0 {
                rig.apply(&edit).map_err(refused)?;
            }
            Ok(Scene { rig, meshes: Vec::new() })
        }
        Some(FileKind::Project) => {
            let mut project = spinning("reading", || load_project(&RealDisk, path))?;
            report.notes(project.notes);
            let empty = || Failure::Input(format!("`{}` has no rig to draw", path.display()).into());
            let rig = (!project.rigs.is_empty()).then(|| project.rigs.swap_remove(0)).ok_or_else(empty)?;
            let mut meshes = Vec::new();
            for mesh in project.meshes {
                if mesh.rig != rig.uid() {
                    continue;
                }
                match mesh.state {
                    // The notes name it already.
                    MeshState::Missing { .. } => {}
                    MeshState::Open { model, .. } => meshes.push(RigMesh::new(mesh.uid, *model, mesh.nodes)),
                }
            }
            Ok(Scene { rig, meshes })
        }
        _ => {
            let model = spinning("reading", || load_model(&RealDisk, path))?;
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
