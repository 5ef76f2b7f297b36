//! `rigsmith skin`: a skeleton and its meshes become a character.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use serde_json::json;

use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, SEED, WeightArgs,
    binding::{add_of_mesh, bind, chosen_parts},
    limits,
    progress::spinning,
};
use crate::{
    algo::transfer::{TransferMesh, TransferSettings, transfer_weights},
    files::{FileKind, RealDisk, load_skin, stage_skin, stem, store_owned_model},
    headless::Workbench,
    rig::{
        Rig, SkinData, Uid, UidSource,
        character::{import_rig_text, import_skeleton},
        skin::{SkinFile, SkinJoint},
    },
};

/// Arguments of `rigsmith skin`.
#[derive(Args, Debug)]
pub(super) struct SkinArgs {
    /// The skeleton: .rig.ron, .rig, or a .glb, .gltf or .vrm that has one
    rig: PathBuf,
    /// The mesh: .obj, .gltf, .glb or .vrm; several become one character, such as a body and its clothes. A skeleton in
    /// it is left aside
    #[arg(required = true, value_name = "MESH")]
    pub meshes: Vec<PathBuf>,
    /// Output file: .glb or .gltf, or only the weights as .skin
    #[arg(short, long)]
    output: Output,
    /// Take the weights from a .skin file: as they are if the mesh is the same, transferred if it has changed. Options that
    /// say how weights are made do not go with it
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["rigid", "blend", "method", "smoothing", "stored_influences", "bend_parts", "claim"]
    )]
    weights_from: Option<PathBuf>,
    /// Save the weights to a .skin file, too; it may be neither an input nor the output
    #[arg(long, value_name = "FILE")]
    save_weights: Option<PathBuf>,
    /// Let a part of the mesh move with one joint only: an object, or a part as the report names it, and a joint's label
    #[arg(long, value_name = "PART=JOINT")]
    rigid: Vec<String>,
    /// Let parts of the mesh bend, by the names in the report, although one joint holds all of them; may be repeated
    #[arg(long, visible_alias = "bend", value_name = "PART[,PART...]")]
    blend: Vec<String>,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn run(args: &SkinArgs) -> Result<Report, Failure> {
    if !matches!(FileKind::of(&args.output), Some(FileKind::Glb | FileKind::Gltf | FileKind::Skin)) {
        let message = format!("cannot skin into `{}`; write .glb, .gltf or .skin", args.output.display());
        return Err(Failure::Usage(message));
    }
    if let Some(path) = args.save_weights.as_ref().filter(|path| FileKind::of(path) != Some(FileKind::Skin)) {
        return Err(Failure::Usage(format!("--save-weights `{}`: weights are saved as .skin", path.display())));
    }
    check_number(args)?;
    let inputs = std::iter::once(&args.rig).chain(&args.meshes).chain(&args.weights_from);
    let inputs: Vec<&Path> = inputs.map(PathBuf::as_path).collect();
    let further: Vec<_> = args.save_weights.iter().map(|path| ("--save-weights", path.as_path())).collect();
    args.in_place.check(&inputs, Some(&args.output), &further)?;
    let mut report = Report::default();
    let rig = load_rig(&args.rig, &mut report)?;
    let mut bench = limits::workbench(rig);
    match &args.meshes[..] {
        [mesh] => skin(args, mesh, &mut bench, &mut report)?,
        several => {
            for mesh in several {
                let mut told = Report::default();
                skin(args, mesh, &mut bench, &mut told)?;
                told.set("file", mesh.display().to_string());
                let name = bench.mesh().map_or_else(|| stem(mesh), |mesh| mesh.file.name.clone());
                add_of_mesh(&mut report, &name, told);
            }
        }
    }
    let weights_file = if FileKind::of(&args.output) == Some(FileKind::Skin) { Some(&args.output) } else { None };
    let mut staged = Vec::new();
    for path in weights_file.into_iter().chain(&args.save_weights) {
        staged.push(stage_skin(&RealDisk, path, &skin_file(&bench)?)?);
    }
    // The character first: where it cannot be written, weights beside an older one stay as they belong to that.
    if weights_file.is_none() {
        let write = || store_owned_model(&RealDisk, &args.output, bench.character(), &args.export.settings());
        report.notes(spinning("writing", write)?);
        report.line(format!("wrote {}", args.output.display()));
    }
    for file in staged {
        let line = format!("wrote {}", file.path().display());
        file.put_in_place()?;
        report.line(line);
    }
    report.set("joints", bench.rig().len());
    report.set("output", args.output.display().to_string());
    Ok(report)
}

/// Refuses several meshes with options that are about a single one.
fn check_number(args: &SkinArgs) -> Result<(), Failure> {
    let given = [
        ("a .skin output", FileKind::of(&args.output) == Some(FileKind::Skin)),
        ("--weights-from", args.weights_from.is_some()),
        ("--save-weights", args.save_weights.is_some()),
        ("--rigid", !args.rigid.is_empty()),
        ("--blend", !args.blend.is_empty()),
    ];
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) if args.meshes.len() > 1 => {
            Err(Failure::Usage(format!("{option} is about one mesh, and {} are given; give one", args.meshes.len())))
        }
        _ => Ok(()),
    }
}

/// Opens a mesh on a workbench beside those that are there, and binds it.
fn skin(args: &SkinArgs, mesh: &Path, bench: &mut Workbench, report: &mut Report) -> Result<(), Failure> {
    let model = spinning("reading the mesh", || limits::load_model(mesh))?;
    report.notes(model.notes.iter().cloned());
    if model.points.is_empty() {
        return Err(Failure::Input(format!("`{}` has no points to skin; open another mesh", mesh.display()).into()));
    }
    bench.open(model, true)?;
    let parts = chosen_parts(&args.rigid, &args.blend, bench)?;
    match &args.weights_from {
        Some(path) => take_weights(bench, path, report),
        None => bind(bench, args.weights.settings(), &args.weights.claim, parts, report),
    }
}

/// Loads a rig from any file that holds one.
pub(super) fn load_rig(path: &Path, report: &mut Report) -> Result<Rig, Failure> {
    let mut uids = UidSource::seeded(SEED);
    let mut rig = Rig::new(uids.next_uid(), stem(path));
    let edits = match FileKind::of(path) {
        Some(FileKind::Template) => {
            let template = limits::load_template(path)?;
            report.notes(template.notes);
            return Ok(template.rig);
        }
        Some(FileKind::RigText) => import_rig_text(&limits::load_rig_text(path)?, &mut uids).0,
        Some(kind) if kind.is_gltf() => {
            let model = limits::load_model(path)?;
            report.notes(model.notes.iter().cloned());
            import_skeleton(&model, &mut uids).edits
        }
        _ => {
            let message = format!("`{}` holds no rig; give .rig.ron, .rig, .glb, .gltf or .vrm", path.display());
            return Err(Failure::Usage(message));
        }
    };
    for edit in edits {
        rig.apply(&edit).map_err(|error| Failure::Input(format!("`{}`: {error}", path.display()).into()))?;
    }
    limits::check_rig(path, &rig)?;
    Ok(rig)
}

/// Weights of the workbench's mesh, for a file.
pub(super) fn skin_file(bench: &Workbench) -> Result<SkinFile, Failure> {
    let (Some(mesh), Some(skin)) = (bench.mesh(), bench.weights()) else {
        return Err(Failure::Input("there are no weights to save; skin the mesh first".into()));
    };
    SkinFile::new(SkinJoint::list(bench.rig(), skin), skin.weights.clone(), &mesh.rest.points, &mesh.triangles, true)
        .map_err(|error| Failure::Input(Box::new(error)))
}

/// Binds the weights of a `.skin` file. Joints are found by uid, or by label where the rig has other uids.
fn take_weights(bench: &mut Workbench, path: &Path, report: &mut Report) -> Result<(), Failure> {
    let file = load_skin(&RealDisk, path)?;
    let rig = bench.rig();
    let mut joints = Vec::with_capacity(file.joints().len());
    let labelled = rig.joints_by_label();
    let found = |joint: &SkinJoint| {
        let by_label = || labelled.get(joint.label.as_str()).copied().filter(|_| !joint.label.is_empty());
        Some(Uid(joint.uid)).filter(|uid| rig.joint(*uid).is_some()).or_else(by_label)
    };
    // A joint that a command created is not in the document: its weights go to the joint that it was made for.
    let mut subjects = SkinJoint::subjects(file.joints());
    let by_uid: HashMap<u64, &SkinJoint> = file.joints().iter().rev().map(|joint| (joint.uid, joint)).collect();
    for subject in subjects.values_mut() {
        *subject = by_uid.get(&subject.0).copied().and_then(found).unwrap_or(*subject);
    }
    for joint in file.joints() {
        let created = || Some(Uid(joint.uid)).filter(|uid| subjects.contains_key(uid));
        let uid = found(joint).or_else(created).ok_or_else(|| {
            Failure::Input(
                format!(
                    "`{}`: the rig has no joint {} (\"{}\"); skin with the rig that the weights were made for",
                    path.display(),
                    Uid(joint.uid),
                    joint.label
                )
                .into(),
            )
        })?;
        joints.push(uid);
    }
    drop(labelled);
    let mesh = bench.mesh().ok_or_else(|| Failure::Input("no mesh is open".into()))?;
    let (points, triangles): (Arc<_>, _) = (mesh.rest.clone(), mesh.triangles.clone());
    let weights = if file.fits(&points.points, &triangles) {
        report.line(format!("took the weights of {} as they are", path.display()));
        report.set("weights", json!({ "exact": true }));
        file.weights().clone()
    } else {
        let source = file.mesh().ok_or_else(|| {
            Failure::Input(
                format!(
                    "`{}`: the weights are of another mesh, and the file has no copy of it to transfer them from",
                    path.display()
                )
                .into(),
            )
        })?;
        let source = TransferMesh { points: &source.points, triangles: &source.triangles };
        let target = TransferMesh { points: &points.points, triangles: &triangles };
        let settings = TransferSettings::default();
        let (weights, told) = spinning("transferring", || transfer_weights(source, file.weights(), target, &settings))
            .map_err(|error| Failure::Input(Box::new(error)))?;
        report.line(format!(
            "the mesh has changed: transferred the weights of {} ({} copied, {} matched, {} inpainted, {} nearest)",
            path.display(),
            told.copied,
            told.matched,
            told.inpainted,
            told.nearest
        ));
        report.set(
            "weights",
            json!({
                "exact": false, "copied": told.copied, "matched": told.matched,
                "inpainted": told.inpainted, "nearest": told.nearest,
            }),
        );
        weights
    };
    bench.bind(SkinData { joints, weights, at_rest: true, subjects })?;
    Ok(())
}
