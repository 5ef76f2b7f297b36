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
    update::{check_companion, companion},
    vrm::AvatarDraft,
};
use crate::{
    algo::fit_template::{FitNote, FitSymmetry},
    files::{
        BUNDLED_CHARACTERS, BUNDLED_PARTS, FileKind, LoadError, ReadError, RealDisk, TemplateOrigin,
        bundled_characters, bundled_part, stage_file, stem, store_owned_model, store_rig_from, store_rig_over,
    },
    headless::Workbench,
    mesh::model::Model,
    plugins::{
        commands::BuildStep,
        fit::{
            FitPart, FitParts, FitRegion, FitReport, FitTemplate, FitTemplates,
            region::{triangles_held, triangles_in_box},
        },
    },
    rig::{Rig, nearest::did_you_mean, part::Part, template::write_template},
};

/// Kind of templates that are parts.
const PART: &str = "part";

/// Arguments of `rigsmith fit`.
#[derive(Args, Debug)]
pub(super) struct FitArgs {
    /// The mesh: .obj, .gltf, .glb or .vrm; a skeleton in it is ignored
    pub mesh: PathBuf,
    /// The template: biped, quadruped, bird, a part such as parts/hand, or a .rig.ron; the one whose limbs the mesh shows if
    /// left out. A part is mirrored where the mesh shows the other side
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
    /// Fit into a part of the mesh only: an object or a bone of the file's skin (with those below it) by its name, or a box by
    /// two corners; may be repeated
    #[arg(long = "region", value_name = "NAME|X,Y,Z,X,Y,Z", value_parser = region, allow_hyphen_values = true)]
    regions: Vec<RegionArg>,
    /// Output file: the fitted template as .rig.ron, with its parts (OUT.base beside it keeps the template for updates), the
    /// skinned character as .glb or .gltf, an avatar in VRM 1.0 as .vrm, or a picture from the figure's front as .png, with the
    /// doubtful joints highlighted
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

/// Part of a mesh to fit into.
#[derive(Debug, Clone)]
enum RegionArg {
    /// An object, or a bone of the file's skin.
    Name(String),
    /// Two corners of a box.
    Box([Vec3; 2]),
}

fn region(text: &str) -> Result<RegionArg, ArgumentError> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([a, b, c, d, e, f]) => {
            let corners = [Vec3::new(*a, *b, *c), Vec3::new(*d, *e, *f)];
            let is_finite = corners.iter().all(|corner| corner.is_finite());
            is_finite.then_some(RegionArg::Box(corners)).ok_or(ArgumentError::NoRegion)
        }
        Some([_, _, ..]) => Err(ArgumentError::NoRegion),
        _ if text.trim().is_empty() => Err(ArgumentError::NoRegion),
        _ => Ok(RegionArg::Name(text.to_owned())),
    }
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
    let is_bundled = |name: &str| bundled_name(name).is_some();
    let is_part = |name: &str| bundled_part(name).is_some();
    let file = args.template.as_deref().filter(|name| {
        let text = name.to_str().unwrap_or_default();
        !is_bundled(text) && (name.exists() || !is_part(text))
    });
    let inputs: Vec<&Path> = [Some(args.mesh.as_path()), file].into_iter().flatten().collect();
    args.in_place.check(&inputs, Some(&args.output), &[])?;
    if kind == Some(FileKind::Template) {
        check_companion(&args.output)?;
    }
    let mut report = Report::default();
    let template = template(args, &mut report)?;
    let model = spinning("reading the mesh", || limits::load_model(&args.mesh))?;
    report.notes(model.notes.iter().cloned());
    let region = chosen_region(args, &model)?;
    let mut bench = limits::empty_workbench(&stem(&args.mesh));
    bench.open(model, true)?;
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    bench.offer_parts(FitParts(Arc::new(bundled_part)));
    let mut progress = Progress::new("fitting");
    let fitted = bench.fit(
        |request| {
            request.template = template;
            (request.up, request.forward, request.markers) = (args.up, args.forward, args.markers.clone());
            request.region = region;
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
        picture(args, &bench, &fitted)?;
    } else if kind == Some(FileKind::Template) {
        let origin = origin(args, &fitted.template)?;
        store_made(&args.output, bench.rig(), origin, &mut report)?;
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
                draft.store(model, meta, &args.output, &settings, &mut report)?;
            }
            None => report.notes(spinning("writing", || store_owned_model(&RealDisk, &args.output, model, &settings))?),
        }
    }
    report.line(format!("wrote {}", args.output.display()));
    report.set("output", args.output.display().to_string());
    Ok(report)
}

/// The template that was fitted, whose name is `fitted`.
fn origin(args: &FitArgs, fitted: &str) -> Result<Option<TemplateOrigin>, Failure> {
    let Some(file) = &args.template else { return Ok(TemplateOrigin::bundled(fitted)) };
    let name = file.to_str().unwrap_or_default();
    if bundled_name(name).is_some() || !file.exists() && bundled_part(name).is_some() {
        return Ok(TemplateOrigin::bundled(name));
    }
    Ok(Some(TemplateOrigin::read(&RealDisk, file)?))
}

/// Saves a rig that was made from a template as changes of its text, so that parts stay parts, and keeps the template as it is
/// beside it: an update tells from that what has changed.
pub(super) fn store_made(
    output: &Path,
    rig: &Rig,
    origin: Option<TemplateOrigin>,
    report: &mut Report,
) -> Result<(), Failure> {
    let Some(origin) = origin else {
        report.notes(store_rig_over(&RealDisk, output, rig, &[])?);
        return Ok(());
    };
    check_companion(output)?;
    let rig = origin.adopted(rig).map_err(|error| Failure::Input(Box::new(error)))?;
    let base = companion(output);
    let staged = stage_file(&RealDisk, &base, write_template(origin.rig()).as_bytes())?;
    report.notes(store_rig_from(&RealDisk, output, &rig, &origin)?);
    staged.put_in_place()?;
    report.line(format!("wrote {}, the template as it is now, for `rigsmith update`", base.display()));
    report.set("base", base.display().to_string());
    Ok(())
}

fn bundled_name(name: &str) -> Option<&'static str> {
    BUNDLED_CHARACTERS.iter().map(|(known, _)| *known).find(|known| *known == name)
}

fn template(args: &FitArgs, report: &mut Report) -> Result<FitTemplate, Failure> {
    let Some(file) = &args.template else { return Ok(FitTemplate::Choose) };
    let name = file.to_str().unwrap_or_default();
    if let Some(name) = bundled_name(name) {
        return Ok(FitTemplate::Named(name.to_owned()));
    }
    // A file of one's own goes before a part that comes with the program.
    let known = if file.exists() { None } else { bundled_part(name) };
    let part = match known {
        Some(part) => part,
        None => {
            let template = limits::load_template(file).map_err(|failure| unknown_template(name, failure))?;
            report.notes(template.notes.iter().cloned());
            if template.rig.about().kind != PART {
                return Ok(FitTemplate::Rig(Arc::new(template.rig)));
            }
            Arc::new(Part::from(template))
        }
    };
    Ok(FitTemplate::Part { part: FitPart::Given(part), parent: None })
}

/// The failure to read a template, with the nearest names if neither a file nor a template is called so.
fn unknown_template(name: &str, failure: Failure) -> Failure {
    let is_missing = match &failure {
        Failure::Input(error) => {
            matches!(error.downcast_ref::<LoadError>(), Some(LoadError::Read(ReadError::Missing { .. })))
        }
        Failure::Usage(_) => false,
    };
    let parts = BUNDLED_PARTS.iter().map(|(part, _)| part.strip_suffix(".rig.ron").unwrap_or(part));
    let known = BUNDLED_CHARACTERS.iter().map(|(character, _)| *character).chain(parts);
    let nearest = did_you_mean(name, known);
    match is_missing && !nearest.is_empty() {
        true => Failure::Input(format!("there is no template and no file `{name}`{nearest}").into()),
        false => failure,
    }
}

fn chosen_region(args: &FitArgs, model: &Model) -> Result<FitRegion, Failure> {
    let object = |name: &String| model.objects.iter().position(|object| object.name == *name);
    let known = |option: &str, name: &str, bones: bool| {
        let objects = model.objects.iter().map(|object| &object.name);
        let joints = model.nodes.iter().filter(|node| bones && node.joint).map(|node| &node.name);
        let names: Vec<&str> = objects.chain(joints).map(String::as_str).filter(|name| !name.is_empty()).collect();
        let has = match (names.is_empty(), bones) {
            (true, true) => "nothing in it has a name, so give the corners of a box: --region X,Y,Z,X,Y,Z".to_owned(),
            (true, false) => "nothing in it has a name, so give a box: --region X,Y,Z,X,Y,Z".to_owned(),
            _ => format!("it has: {}", names.join(", ")),
        };
        Failure::Input(format!("--{option}: the mesh has no \"{name}\"; {has}").into())
    };
    let number = |name: &String| object(name).ok_or_else(|| known("object", name, false));
    let mut objects = args.objects.iter().map(number).collect::<Result<Vec<_>, _>>()?;
    if args.regions.is_empty() {
        return Ok(if objects.is_empty() { FitRegion::Whole } else { FitRegion::Objects(objects) });
    }
    let all = model.point_triangles();
    let mut triangles = Vec::new();
    for region in &args.regions {
        match region {
            RegionArg::Box(corners) => triangles.extend(triangles_in_box(&model.at_rest().points, &all, *corners)),
            RegionArg::Name(name) => match (object(name), model.nodes.iter().position(|node| node.name == *name)) {
                (Some(object), _) => objects.push(object),
                (None, Some(bone)) => triangles.extend(bone_triangles(model, &all, bone)),
                (None, None) => return Err(known("region", name, true)),
            },
        }
    }
    triangles.extend(model.triangles_of(|object| objects.contains(&object)));
    triangles.sort_unstable();
    triangles.dedup();
    Ok(FitRegion::Triangles(triangles))
}

/// Triangles that the file's skin binds to a bone and to those below it.
fn bone_triangles(model: &Model, triangles: &[[u32; 3]], bone: usize) -> Vec<u32> {
    let mut is_below = vec![false; model.nodes.len()];
    // Children stand behind their parents.
    for (at, node) in model.nodes.iter().enumerate() {
        is_below[at] = at == bone || node.parent.is_some_and(|parent| is_below.get(parent).copied().unwrap_or(false));
    }
    let weights = model.weights.as_ref();
    let is_wanted = |joint: u32| is_below.get(joint as usize).copied().unwrap_or(false);
    weights.map(|weights| triangles_held(triangles, weights, is_wanted)).unwrap_or_default()
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
        let (confidence, template) = (fit.confidence, &fitted.template);
        let wish = match fit.notes.iter().any(FitNote::is_of_direction) {
            true => "leave --up and --forward out, or look at it".to_owned(),
            false => format!("the mesh may be no {template}; look at it, name another --template, or give --marker"),
        };
        report.notes.push(format!("the fit is a guess (confidence {confidence:.2}): {wish}"));
    }
    report.set("template", fitted.template.as_str());
    report.set("choice", fitted.choice.as_str());
    // Zero has no sign in a report.
    report.set("up", json!((fit.up + Vec3::ZERO).to_array()));
    report.set("forward", json!((fit.forward + Vec3::ZERO).to_array()));
    report.set("symmetric", fit.is_symmetric());
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
fn picture(args: &FitArgs, bench: &Workbench, fitted: &FitReport) -> Result<(), Failure> {
    let is_part = !args.objects.is_empty() || !args.regions.is_empty();
    super::render::picture_of_fit(bench, fitted, is_part, &args.output)
}

#[cfg(not(feature = "render"))]
fn picture(args: &FitArgs, _: &Workbench, _: &FitReport) -> Result<(), Failure> {
    let reason = format!("cannot draw `{}`: this program was built without pictures", args.output.display());
    Err(Failure::Usage(reason))
}
