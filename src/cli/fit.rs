//! `rigsmith fit`: a template's skeleton moved into a mesh by itself.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::math::Vec3;
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{
    ArgumentError, ExportArgs, Failure, InPlaceArgs, Output, Report, VrmArgs, WeightArgs,
    binding::bind,
    limits,
    progress::{Progress, spinning},
    report::counted,
    vrm::AvatarDraft,
};
use crate::{
    algo::fit_template::FitSymmetry,
    files::{BUNDLED_CHARACTERS, FileKind, RealDisk, bundled_characters, stem, store_model, store_rig},
    headless::Workbench,
    plugins::{
        commands::BuildStep,
        fit::{FitReport, FitTemplate, FitTemplates},
    },
};

/// Arguments of `rigsmith fit`.
#[derive(Args, Debug)]
pub(super) struct FitArgs {
    /// The mesh: .obj, .gltf, .glb or .vrm; a skeleton in it is ignored
    pub mesh: PathBuf,
    /// The template: biped, quadruped, bird or a .rig.ron; the one whose limbs the mesh shows if left out
    #[arg(long, value_name = "NAME|FILE")]
    template: Option<PathBuf>,
    /// Up direction in the mesh: x, y, z, -x, -y or -z; found if left out
    #[arg(long, value_name = "AXIS", value_parser = super::face::axis, allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// Direction in which the figure faces; found if left out
    #[arg(long, value_name = "AXIS", value_parser = super::face::axis, allow_hyphen_values = true)]
    forward: Option<Vec3>,
    /// A joint that is at a place, in the mesh's space: LABEL=x,y,z; may be repeated
    #[arg(long = "marker", value_name = "LABEL=X,Y,Z", value_parser = marker, allow_hyphen_values = true)]
    markers: Vec<(String, Vec3)>,
    /// Left and right alike: where mesh and pose are, always, or never
    #[arg(long, value_enum, default_value_t = SymmetryArg::Auto)]
    symmetry: SymmetryArg,
    /// Fit into one object of the mesh only, by its name; may be repeated
    #[arg(long = "object", value_name = "NAME")]
    objects: Vec<String>,
    /// Output file: the fitted template as .rig.ron, the skinned character as .glb or .gltf, an avatar in VRM 1.0 as .vrm, or
    /// a picture as .png
    #[arg(short, long)]
    output: Output,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    vrm: VrmArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum SymmetryArg {
    /// Symmetric if mesh and pose are
    Auto,
    /// Symmetric in any case
    On,
    /// Left and right fitted apart
    Off,
}

fn marker(text: &str) -> Result<(String, Vec3), ArgumentError> {
    let (label, place) = text.split_once('=').ok_or(ArgumentError::NoMarker)?;
    let numbers: Vec<f32> = place
        .trim_matches(|c| c == '(' || c == ')')
        .split(',')
        .map(|number| number.trim().parse().ok().filter(|number: &f32| number.is_finite()))
        .collect::<Option<_>>()
        .ok_or(ArgumentError::NoMarker)?;
    let place = <[f32; 3]>::try_from(numbers).map_err(|_| ArgumentError::NoMarker)?;
    Ok((label.trim().to_owned(), place.into()))
}

pub(super) fn run(args: &FitArgs) -> Result<Report, Failure> {
    let is_picture = args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    #[cfg(feature = "render")]
    if is_picture {
        super::device_selection::restart_without();
    }
    let kind = FileKind::of(&args.output);
    if !is_picture && !kind.is_some_and(|kind| kind.is_gltf() || kind == FileKind::Template) {
        let text = format!("cannot fit into `{}`; write .rig.ron, .glb, .gltf, .vrm or .png", args.output.display());
        return Err(Failure::Usage(text));
    }
    args.vrm.check(Some(&args.output))?;
    let file = args.template.as_deref().filter(|name| name.to_str().and_then(bundled_name).is_none());
    let inputs: Vec<&Path> = [Some(args.mesh.as_path()), file].into_iter().flatten().collect();
    args.in_place.check(&inputs, Some(&args.output), &[])?;
    let mut report = Report::default();
    let template = template(args, &mut report)?;
    let model = spinning("reading the mesh", || limits::load_model(&args.mesh))?;
    report.notes(model.notes.iter().cloned());
    let objects = objects(args, &model)?;
    let mut bench = limits::empty_workbench(&stem(&args.mesh));
    bench.open(model, true)?;
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    let mut progress = Progress::new("fitting");
    let fitted = bench.fit(
        |request| {
            request.template = template;
            (request.up, request.forward, request.markers) = (args.up, args.forward, args.markers.clone());
            request.objects = objects;
            request.symmetry = match args.symmetry {
                SymmetryArg::Auto => FitSymmetry::Auto,
                SymmetryArg::On => FitSymmetry::On,
                SymmetryArg::Off => FitSymmetry::Off,
            };
        },
        &mut |part| progress.at(part),
    )?;
    drop(progress);
    describe(&mut report, &fitted);
    if is_picture {
        picture(args, &bench)?;
    } else if kind == Some(FileKind::Template) {
        report.notes(store_rig(&RealDisk, &args.output, bench.rig())?);
    } else {
        // The file has the joints that commands make, too, as after a build.
        if let Some(error) = bench.build(BuildStep::All).error {
            return Err(Failure::Input(Box::new(error)));
        }
        bind(&mut bench, args.weights.settings(), &args.weights.claim, Vec::new(), &mut report)?;
        let (mut model, settings) = (bench.character(), args.export.settings());
        match args.vrm.meta(bench.rig(), &args.output)? {
            Some(meta) => {
                let draft = AvatarDraft::new(bench.rig(), bench.built(), &mut model);
                draft.store(&mut model, meta, &args.output, &settings, &mut report)?;
            }
            None => report.notes(spinning("writing", || store_model(&RealDisk, &args.output, &model, &settings))?),
        }
    }
    report.line(format!("wrote {}", args.output.display()));
    report.set("output", args.output.display().to_string());
    Ok(report)
}

fn bundled_name(name: &str) -> Option<&'static str> {
    BUNDLED_CHARACTERS.iter().map(|(known, _)| *known).find(|known| *known == name)
}

fn template(args: &FitArgs, report: &mut Report) -> Result<FitTemplate, Failure> {
    let Some(file) = &args.template else { return Ok(FitTemplate::Choose) };
    if let Some(name) = file.to_str().and_then(bundled_name) {
        return Ok(FitTemplate::Named(name.to_owned()));
    }
    let template = limits::load_template(file)?;
    report.notes(template.notes);
    Ok(FitTemplate::Rig(Arc::new(template.rig)))
}

fn objects(args: &FitArgs, model: &crate::mesh::model::Model) -> Result<Vec<usize>, Failure> {
    let number = |name: &String| {
        model.objects.iter().position(|object| object.name == *name).ok_or_else(|| {
            let names: Vec<&str> = model.objects.iter().map(|object| object.name.as_str()).collect();
            Failure::Input(format!("--object: the mesh has no object \"{name}\"; it has: {}", names.join(", ")).into())
        })
    };
    args.objects.iter().map(number).collect()
}

/// Adds a description of the fit.
fn describe(report: &mut Report, fitted: &FitReport) {
    let fit = &fitted.fit;
    let doubtful = fit.joints.iter().filter(|joint| joint.confidence < FitReport::DOUBTFUL).count();
    let choice = if fitted.choice.is_empty() { String::new() } else { format!(" ({})", fitted.choice) };
    report.line(format!(
        "{}{choice}: {}, {doubtful} doubtful, confidence {:.2}, {} ms",
        fitted.template,
        counted(fit.joints.len(), "joint", "joints"),
        fit.confidence,
        fitted.time.as_millis()
    ));
    for ((_, label), joint) in fitted.joints.iter().zip(&fit.joints) {
        if joint.confidence < FitReport::DOUBTFUL {
            report.line(format!("  {label}: {} ({:.2})", joint.reason, joint.confidence));
        }
    }
    report.notes(fit.notes.iter().map(ToString::to_string));
    if fit.confidence < FitReport::DOUBTFUL {
        let text = format!(
            "the fit is a guess (confidence {:.2}): the mesh may be no {}; look at it, name another --template, or give --marker",
            fit.confidence, fitted.template
        );
        report.notes.push(text);
    }
    report.set("template", fitted.template.as_str());
    report.set("choice", fitted.choice.as_str());
    report.set("up", json!(fit.up.to_array()));
    report.set("forward", json!(fit.forward.to_array()));
    report.set("symmetric", fit.symmetric());
    report.set("height", fit.height);
    report.set("confidence", fit.confidence);
    let hypotheses: Vec<Value> = (fit.hypotheses.iter())
        .map(|hypothesis| {
            let limbs = hypothesis.limbs.iter();
            let limbs: Vec<Value> = limbs
                .map(|(kind, end)| json!({ "limb": kind.to_string(), "end": end.map(|end| end.to_array()) }))
                .collect();
            json!({ "cost": hypothesis.cost, "limbs": limbs })
        })
        .collect();
    report.set("hypotheses", hypotheses);
    let joints: Vec<Value> = (fitted.joints.iter().zip(&fit.joints))
        .map(|((_, label), joint)| {
            json!({
                "label": label,
                "position": joint.position.to_array(),
                "confidence": joint.confidence,
                "reason": joint.reason.to_string(),
            })
        })
        .collect();
    report.set("joints", joints);
    report.set("notes", fit.notes.iter().map(ToString::to_string).collect::<Vec<_>>());
    report.set("millis", fitted.time.as_secs_f64() * 1e3);
}

#[cfg(feature = "render")]
fn picture(args: &FitArgs, bench: &Workbench) -> Result<(), Failure> {
    super::render::picture_of_bench(bench, &args.output)
}

#[cfg(not(feature = "render"))]
fn picture(args: &FitArgs, _: &Workbench) -> Result<(), Failure> {
    let reason = format!("cannot draw `{}`: this program was built without pictures", args.output.display());
    Err(Failure::Usage(reason))
}
