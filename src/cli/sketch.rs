//! `rigsmith sketch`: a skeleton from gestures on a mesh.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, WeightArgs,
    binding::bind,
    fit::store_made,
    limits,
    progress::spinning,
    report::{counted, is_json},
};
use crate::{
    files::{
        FileKind, RealDisk, TemplateOrigin, bundled_characters, bundled_part, load_gestures, stem, store_owned_model,
        store_rig,
    },
    headless::Workbench,
    plugins::{
        fit::{FitParts, FitTemplates},
        gesture::GestureAnswer,
    },
    rig::Rig,
};

/// Arguments of `rigsmith sketch`.
#[derive(Args, Debug)]
pub(super) struct SketchArgs {
    /// The mesh: .obj, .gltf, .glb or .vrm. The sketch begins with its skeleton, if it has one
    mesh: PathBuf,
    /// The gestures, a list in RON such as [Stroke(points: [(0.0, 0.9), (0.0, 1.4)], joints: 3)]
    pub gestures: PathBuf,
    /// Output file: .rig, .rig.ron, or the skinned character as .glb or .gltf
    #[arg(short, long)]
    output: Output,
    /// Ignore a skeleton in the mesh file
    #[arg(long)]
    mesh_only: bool,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn run(args: &SketchArgs) -> Result<Report, Failure> {
    let kind = output_kind(&args.output)?;
    args.in_place.check(&[&args.mesh, &args.gestures], Some(&args.output), &[])?;
    let gestures = load_gestures(&RealDisk, &args.gestures)?;
    limits::check_gestures(&args.gestures, &gestures)?;
    let model = spinning("reading the mesh", || limits::load_model(&args.mesh))?;
    let mut report = Report::default();
    report.notes(model.notes.iter().cloned());
    let mut bench = limits::empty_workbench(&stem(&args.mesh));
    bench.open(model, args.mesh_only)?;
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    bench.offer_parts(FitParts(Arc::new(bundled_part)));
    let answers = spinning("sketching", || bench.gestures(gestures));
    if let Some(last) = answers.last().filter(|last| last.out_of_time) {
        let (file, GestureAnswer { number, gesture, message, .. }) = (args.gestures.display(), last);
        return Err(Failure::Input(format!("`{file}`: gesture {number} ({gesture}): {message}").into()));
    }
    let missed = answers.iter().filter(|answer| !answer.done).count();
    for answer in &answers {
        if !answer.done {
            report.notes.push(format!("gesture {} ({}): {}", answer.number, answer.gesture, answer.message));
        } else if !answer.message.is_empty() {
            report.line(format!("{:>3} {:<8} {}", answer.number, answer.gesture, answer.message));
        }
    }
    if bench.rig().is_empty() && kind.is_gltf() {
        return Err(no_joint(&args.gestures, &answers));
    }
    let joints = bench.rig().len();
    report.line(format!(
        "{}, {missed} without effect; {}",
        counted(answers.len(), "gesture", "gestures"),
        counted(joints, "joint", "joints")
    ));
    let told = answers.iter().map(|answer| {
        let mut value = serde_json::to_value(answer).unwrap_or(Value::Null);
        value["message"] = limits::message(&answer.message).into();
        value
    });
    report.set_list("gestures", told);
    describe_rig(&mut report, bench.rig());
    save(&mut bench, &args.output, kind, args, &mut report)?;
    Ok(report)
}

/// Failure of gestures after which there is no joint, with the reason of the first one that had no effect.
fn no_joint(file: &Path, answers: &[GestureAnswer]) -> Failure {
    let missed = answers.iter().find(|answer| !answer.done).map(|answer| {
        let (number, gesture, message) = (answer.number, &answer.gesture, limits::message(&answer.message));
        format!(" (gesture {number}, {gesture}: {message})")
    });
    let (file, missed) = (file.display(), missed.unwrap_or_default());
    let text =
        format!("`{file}`: its gestures leave no joint to which the mesh could be bound{missed}; place at least one");
    Failure::Input(text.into())
}

fn output_kind(path: &Path) -> Result<FileKind, Failure> {
    match FileKind::of(path) {
        Some(kind @ (FileKind::RigText | FileKind::Template | FileKind::Glb | FileKind::Gltf)) => Ok(kind),
        _ => {
            Err(Failure::Usage(format!("cannot sketch into `{}`; write .rig, .rig.ron, .glb or .gltf", path.display())))
        }
    }
}

fn save(
    bench: &mut Workbench,
    path: &Path,
    kind: FileKind,
    args: &SketchArgs,
    report: &mut Report,
) -> Result<(), Failure> {
    match kind {
        // A gesture may have fitted a template.
        FileKind::Template => store_made(path, bench.rig(), TemplateOrigin::of(bench.rig()), report)?,
        FileKind::RigText => report.notes(store_rig(&RealDisk, path, bench.rig())?),
        _ => {
            bind(bench, args.weights.settings(), &args.weights.claim, Vec::new(), report)?;
            let write = || store_owned_model(&RealDisk, path, bench.character(), &args.export.settings());
            report.notes(spinning("writing", write)?);
        }
    }
    report.line(format!("wrote {}", path.display()));
    report.set("output", path.display().to_string());
    Ok(())
}

/// Joint as programs get it. Numbers are doubles, as all of a JSON value are.
#[derive(Serialize)]
struct JointFields<'r> {
    uid: String,
    parent: Option<String>,
    label: Option<&'r str>,
    position: [f64; 3],
}

/// Adds a description of the rig for programs.
pub(super) fn describe_rig(report: &mut Report, rig: &Rig) {
    if !is_json() {
        return;
    }
    let globals = rig.rest_globals();
    let joints = rig.walk().zip(&globals).map(|(joint, (uid, global))| JointFields {
        uid: uid.to_string(),
        parent: joint.parent.map(|parent| parent.to_string()),
        label: joint.data.label.as_deref(),
        position: global.translation.to_array().map(f64::from),
    });
    report.set_list("joints", joints);
}
