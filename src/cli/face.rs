//! `rigsmith face`: bones, weights and expressions for a head mesh.

mod fit_error;
mod loose_parts;
mod morphs;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::math::Vec3;
use clap::Args;
use serde_json::{Value, json};

use super::{
    ArgumentError, ExportArgs, Failure, InPlaceArgs, Output, Report, VrmArgs, expressions, limits,
    progress::{Progress, spinning},
    report::counted,
    vrm::AvatarDraft,
};
use crate::{
    algo::face::{
        auto::{AutoSettings, FaceStep},
        bones::FaceBoneKind,
        expression::{ExpressionSet, MAX_STRENGTH},
    },
    files::{FileKind, RealDisk, load_shapes, stem, store_model, store_owned_model, store_rig},
    headless::Workbench,
    mesh::shapes::Shapes,
    plugins::face::{FaceExpressions, FaceReport, FaceShape, mixed},
    rig::Rig,
};

/// Arguments of `rigsmith face`.
#[derive(Args, Debug)]
pub(super) struct FaceArgs {
    /// The mesh: a head, or a body whose head is found. .obj, .gltf, .glb or .vrm
    pub mesh: PathBuf,
    /// Number of bones on the facial skin, 500 at most: the density. Jaw and eyes come on top
    #[arg(long, value_name = "K", default_value_t = 40)]
    bones: usize,
    /// Up direction in the mesh, if the guess is wrong
    #[arg(long, value_name = "AXIS", value_parser = axis, allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// View direction of the face in the mesh, if the guess is wrong
    #[arg(long, value_name = "AXIS", value_parser = axis, allow_hyphen_values = true)]
    forward: Option<Vec3>,
    /// Seed of the first centroids; the same seed gives the same bytes
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Place the bones of both sides apart, not in pairs
    #[arg(long)]
    no_symmetry: bool,
    /// Leave out the bones of jaw and eyes
    #[arg(long)]
    skin_only: bool,
    /// Take the whole mesh for a head, even if it looks like a body
    #[arg(long)]
    whole: bool,
    /// An expression such as happiness or wink, or one of the units that expressions are made of, by its own name or that of
    /// ARKit, such as jawOpen, with a strength from 0 to 1.5; may be repeated
    #[arg(long, value_name = "NAME=STRENGTH", value_parser = strength)]
    expression: Vec<(String, f32)>,
    /// Move the bones to fit shapes: a .glb with morph targets, a folder of .obj files, or a .json beside its .f32. Each
    /// shape is kept as a stored pose; a vertex then follows at most as many joints as --influences says
    #[arg(long, value_name = "SHAPES")]
    fit: Option<PathBuf>,
    /// Add the blend shapes of ARKit, baked from the bones: 52, or 51 on a face without a tongue of its own. As morph
    /// targets and clips of one frame in .glb or .gltf, as stored poses in .rig.ron, with those of all other units
    #[arg(long)]
    arkit: bool,
    /// Output file: .glb or .gltf for the character, .vrm for an avatar in VRM 1.0 (of a body with its skeleton), .rig.ron for
    /// the rig, .png for a picture
    #[arg(short, long)]
    output: Output,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    vrm: VrmArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn axis(text: &str) -> Result<Vec3, ArgumentError> {
    let (sign, letter) = match text.strip_prefix('-') {
        Some(letter) => (-1.0, letter),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    match letter.to_ascii_lowercase().as_str() {
        "x" => Ok(Vec3::X * sign),
        "y" => Ok(Vec3::Y * sign),
        "z" => Ok(Vec3::Z * sign),
        _ => Err(ArgumentError::NoAxis),
    }
}

fn strength(text: &str) -> Result<(String, f32), ArgumentError> {
    let (name, strength) = text.split_once('=').ok_or(ArgumentError::NoStrength)?;
    match strength.trim().parse::<f32>() {
        Ok(number) if (0.0..=MAX_STRENGTH).contains(&number) => Ok((name.trim().to_owned(), number)),
        Ok(number) if number.is_finite() => Err(ArgumentError::Strength(number)),
        _ => Err(ArgumentError::NoStrength),
    }
}

/// Kind of output.
#[derive(Clone, Copy, PartialEq)]
enum OutputKind {
    Character,
    Rig,
    Picture,
}

pub(super) fn run(args: &FaceArgs) -> Result<Report, Failure> {
    let output_kind = output_kind(args)?;
    #[cfg(feature = "render")]
    if matches!(output_kind, OutputKind::Picture) {
        super::device_selection::restart_without();
    }
    if args.bones == 0 {
        return Err(Failure::Usage("--bones 0 makes no face; ask for at least 1".to_owned()));
    }
    let inputs: Vec<&Path> = std::iter::once(&args.mesh).chain(&args.fit).map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, Some(&args.output), &[])?;
    args.vrm.check(Some(&args.output))?;
    let mut report = Report::default();
    let model = spinning("reading the mesh", || limits::load_model(&args.mesh))?;
    report.notes(model.notes.iter().cloned());
    let read = |path: &PathBuf| limits::load(path, |disk| load_shapes(disk, path, &model));
    let shapes = args.fit.as_ref().map(|path| spinning("reading shapes", || read(path)));
    let shapes = shapes.transpose()?.map(Arc::new);
    let mut bench = limits::empty_workbench(&stem(&args.mesh));
    let set = expressions::of_site(&mut report)?;
    bench.app_mut().insert_resource(FaceExpressions(set.clone()));
    bench.open(model, false)?;
    let settings = AutoSettings {
        bones: args.bones,
        seed: args.seed,
        symmetric: !args.no_symmetry,
        extras: !args.skin_only,
        up: args.up,
        forward: args.forward,
        whole: args.whole,
        influences: args.export.settings().max_influences,
        ..AutoSettings::default()
    };
    let mut progress = Progress::new("placing the face");
    let fitted = shapes.clone();
    let placed = bench.face(settings, shapes, &mut |_: FaceStep, part| progress.at(part))?;
    drop(progress);
    describe(&mut report, &placed);
    loose_parts::describe(&mut report, &bench, &placed);
    tell_mended(&mut report, &spinning("measuring units", || bench.mended_shares()));
    if !args.expression.is_empty() {
        express(args, &mut bench, &mut report)?;
    }
    let shapes = match args.arkit {
        true => bake_arkit(args, output_kind, &set, &mut bench, &mut report)?,
        false => Vec::new(),
    };
    report.set("joints", bench.rig().len());
    match output_kind {
        OutputKind::Rig => {
            if !args.expression.is_empty() {
                store_expression(args, &mut bench, &mut report)?;
            }
            report.notes(store_rig(&RealDisk, &args.output, bench.rig())?);
        }
        OutputKind::Character => {
            let fit = fitted.as_ref().map(|shapes| (&**shapes, placed.points[0]));
            write_character(args, &bench, shapes, fit, &mut report)?;
        }
        OutputKind::Picture => picture(args, &bench, &mut report)?,
    }
    report.line(format!("wrote {}", args.output.display()));
    report.set("output", args.output.display().to_string());
    Ok(report)
}

/// Bakes the blend shapes of ARKit, and stores their poses in the rig; a rig gets those of all other units, too.
fn bake_arkit(
    args: &FaceArgs,
    output_kind: OutputKind,
    set: &ExpressionSet,
    bench: &mut Workbench,
    report: &mut Report,
) -> Result<Vec<FaceShape>, Failure> {
    let influences = args.export.settings().max_influences;
    let shapes = spinning("baking blend shapes", || bench.arkit_shapes(influences))?;
    tell_kept_morphs(bench, &shapes, report);
    let mut poses: Vec<_> = shapes.iter().map(|shape| (shape.name.clone(), shape.pose.clone())).collect();
    if output_kind == OutputKind::Rig {
        // Expressions of instances are made of all units.
        let others = bench.unit_shapes(influences)?;
        poses.extend(others.into_iter().map(|shape| (shape.name, shape.pose)));
    }
    bench.store_poses(poses)?;
    let is_baked = |name: &str| shapes.iter().any(|shape| shape.name == name);
    let names = set.unit_set().arkit_shapes().map(|(name, ..)| name);
    let left_out: Vec<&str> = names.filter(|name| !is_baked(name)).collect();
    let missing = match left_out.as_slice() {
        [] => String::new(),
        names => format!(", without {}: no tongue of its own was found in the mouth", names.join(", ")),
    };
    report.line(format!("{} blend shapes of ARKit{missing}", shapes.len()));
    report.set("arkit_left_out", left_out);
    report.set("arkit", shapes.iter().map(|shape| shape.name.as_str()).collect::<Vec<_>>());
    Ok(shapes)
}

/// Writes the character with its face and morph targets. `fit` has the shapes that the face was fitted to and the number of
/// points of the head: their error is measured in the file if it is there in the neutral pose.
fn write_character(
    args: &FaceArgs,
    bench: &Workbench,
    shapes: Vec<FaceShape>,
    fit: Option<(&Shapes, usize)>,
    report: &mut Report,
) -> Result<(), Failure> {
    let mut model = bench.character();
    morphs::add_morphs(&mut model, &shapes);
    drop(shapes);
    model.clips.extend(morphs::clips(bench.rig()));
    pose(&mut model.nodes, bench.rig());
    let settings = args.export.settings();
    let meta = args.vrm.meta(bench.rig(), &args.output)?;
    // Another pose, and clips of ARKit of the same names, would be measured.
    let is_plain = args.expression.is_empty() && !args.arkit && meta.is_none();
    let mut plain_model = None;
    match meta {
        Some(meta) => {
            let draft = AvatarDraft::new(bench.rig(), bench.built(), &mut model);
            draft.store(model, meta, &args.output, &settings, report)?;
        }
        None if is_plain => {
            report.notes(spinning("writing", || store_model(&RealDisk, &args.output, &model, &settings))?);
            plain_model = Some(model);
        }
        None => report.notes(spinning("writing", || store_owned_model(&RealDisk, &args.output, model, &settings))?),
    }
    let placed_face = bench.placed_face().filter(|_| is_plain);
    if let (Some(model), Some((shapes, points)), Some(mesh), Some(face)) = (plain_model, fit, bench.mesh(), placed_face)
    {
        let head: Vec<usize> = (0..points).map(|point| face.analysis.mesh_point(point)).collect();
        let rest = &mesh.rest.points;
        let error = spinning("reading back", || fit_error::fit_error(&args.output, &model, rest, shapes, &head))?;
        report_written_error(report, error);
    } else if fit.is_some() && !is_plain {
        let note = "the error of the fit is not measured in a file with other poses; write one without --arkit, \
                    --expression and .vrm";
        report.notes.push(note.to_owned());
    }
    Ok(())
}

/// Reports the error of the fit that the written file shows.
fn report_written_error(report: &mut Report, error: Option<f32>) {
    match error {
        Some(error) => {
            report.line(format!("the written file shows the shapes with an error of {error:.5} (root mean square)"));
            report.set("written_fit_error", error);
        }
        None => report.notes.push("the error of the fit was not measured in the file: its vertices are others".into()),
    }
}

fn output_kind(args: &FaceArgs) -> Result<OutputKind, Failure> {
    let is_png = args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    match FileKind::of(&args.output) {
        Some(FileKind::Glb | FileKind::Gltf | FileKind::Vrm) => Ok(OutputKind::Character),
        Some(FileKind::Template) => Ok(OutputKind::Rig),
        None if is_png && cfg!(feature = "render") => Ok(OutputKind::Picture),
        _ if is_png => Err(Failure::Usage("this build draws no pictures; write .glb, .gltf or .rig.ron".to_owned())),
        _ => {
            let message = format!("cannot write `{}`; give .glb, .gltf, .vrm, .rig.ron or .png", args.output.display());
            Err(Failure::Usage(message))
        }
    }
}

fn express(args: &FaceArgs, bench: &mut Workbench, report: &mut Report) -> Result<(), Failure> {
    let strengths: BTreeMap<String, f32> = args.expression.iter().cloned().collect();
    // A wrong name is wrong usage; a fault of the face is not.
    let known = expressions::of_site(report)?;
    mixed(&known, &strengths).map_err(|reason| Failure::Usage(format!("--expression: {reason}")))?;
    bench.express(strengths.clone())?;
    report.set("expressions", json!(strengths));
    Ok(())
}

/// Stores the expression as a pose of the rig: a template has no pose of the moment.
fn store_expression(args: &FaceArgs, bench: &mut Workbench, report: &mut Report) -> Result<(), Failure> {
    let names: Vec<&str> = args.expression.iter().map(|(name, _)| name.as_str()).collect();
    let name = names.join(", ");
    let pose = bench.rig().pose().clone();
    report.notes.push(format!("the expression is the stored pose \"{name}\" of the rig"));
    Ok(bench.store_poses(vec![(name, pose)])?)
}

/// Reports what mending of folds takes of each unit.
fn tell_mended(report: &mut Report, shares: &BTreeMap<String, f32>) {
    let percent = |share: f32| (f64::from(share) * 1000.0).round() / 10.0;
    let percent: BTreeMap<&str, f64> = shares.iter().map(|(unit, share)| (unit.as_str(), percent(*share))).collect();
    let (weakened, most) = percent
        .values()
        .filter(|taken| **taken > 0.0)
        .fold((0_usize, 0.0_f64), |(count, most), taken| (count + 1, most.max(*taken)));
    let units = counted(percent.len(), "unit", "units");
    report.line(format!("mending of folds weakens {weakened} of {units}, by {most} % at most; --json lists them"));
    report.set("mended_percent", json!(percent));
}

/// Reports morph targets of the mesh that have the names of shapes.
fn tell_kept_morphs(bench: &Workbench, shapes: &[FaceShape], report: &mut Report) {
    let Some(mesh) = bench.mesh() else { return };
    let is_kept = |shape: &&FaceShape| mesh.file.objects.iter().any(|object| object.morph_names.contains(&shape.name));
    let kept = shapes.iter().filter(is_kept).count();
    if kept > 0 {
        let targets = counted(kept, "morph target", "morph targets");
        report.notes.push(format!(
            "{targets} of the mesh with names of ARKit stay as they are, and the clips of these names show other shapes; \
             give the mesh without them"
        ));
    }
}

/// Sets the exported joints to their posed transforms; bind poses stay.
fn pose(nodes: &mut [crate::mesh::model::Node], rig: &Rig) {
    for (node, joint) in nodes.iter_mut().zip(rig.walk()) {
        if rig.offset(joint.data.uid).is_some() {
            node.rest = crate::rig::RestTransform::from(rig.posed_local(joint.data.uid)).into();
        }
    }
}

#[cfg(feature = "render")]
fn picture(args: &FaceArgs, bench: &Workbench, report: &mut Report) -> Result<(), Failure> {
    use bevy::math::UVec2;

    use crate::{
        algo::view::View,
        files::save_atomic,
        plugins::drawing::{LabelChoice, RigDrawing},
        render::{PictureSettings, adapter, png, take_picture},
    };

    let wrong = |error| Failure::Input(Box::new(error));
    let settings = PictureSettings {
        size: UVec2::new(900, 900),
        view: View::Front,
        bounds: bench.placed_face().map(|face| face.analysis.face_box()),
        // Bones would hide a face that shows an expression.
        drawing: RigDrawing {
            rig: args.expression.is_empty(),
            grid: false,
            labels: LabelChoice::None,
            ball_scale: 0.4,
            ..RigDrawing::default()
        },
        ..PictureSettings::default()
    };
    if let Some((name, true)) = adapter() {
        report.notes.push(format!("no graphics card: drawn in software ({name})"));
    }
    let Some(mesh) = bench.mesh() else { return Ok(()) };
    let (rig, mesh) = (bench.rig().clone(), mesh.clone());
    let image = spinning("drawing", || take_picture(rig, vec![mesh], &settings)).map_err(wrong)?;
    let bytes = png(image).map_err(wrong)?;
    save_atomic(&RealDisk, &args.output, &bytes).map_err(|error| Failure::Input(Box::new(error)))
}

#[cfg(not(feature = "render"))]
fn picture(_: &FaceArgs, _: &Workbench, _: &mut Report) -> Result<(), Failure> {
    Err(Failure::Usage("this build draws no pictures; write .glb, .gltf or .rig.ron".to_owned()))
}

/// Reports the placed face.
fn describe(report: &mut Report, placed: &FaceReport) {
    let [face, middle, back] = placed.groups;
    let [head, all] = placed.points;
    if placed.is_part {
        report.notes.push(format!(
            "the mesh is more than a head: the face was placed in its head part ({head} of {}); \
             --whole takes all of it for a head",
            counted(all, "point", "points")
        ));
    }
    if !placed.certain {
        report.notes.push("which way the head looks is a weak guess; say it with --up and --forward".to_owned());
    }
    if placed.confidence < 0.5 {
        report.notes.push(format!(
            "features of a human face were found with a confidence of {:.2} only; check where bones and regions are",
            placed.confidence
        ));
    }
    if placed.folds > placed.tolerated_folds {
        report.notes.push(format!(
            "{} over in the six expressions at full strength; try another --seed or density",
            counted(placed.folds, "triangle folds", "triangles fold")
        ));
    }
    let skin = placed.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).count();
    report.line(format!(
        "groups: face {face}, middle {middle}, back {}; facial mask {}",
        counted(back, "point", "points"),
        counted(placed.mask, "point", "points")
    ));
    report.line(format!(
        "{}, {} of jaw and eyes; square error {:.4} after {}",
        counted(skin, "facial bone", "facial bones"),
        placed.bones.len() - skin,
        placed.square_error,
        counted(placed.rounds, "round", "rounds")
    ));
    if let Some(error) = placed.fit_error {
        report.line(format!("fitted to the shapes with an error of {error:.5} (root mean square)"));
        report.set("fit_error", error);
    }
    let milliseconds = |time: &std::time::Duration| time.as_secs_f64() * 1000.0;
    let sum: f64 = placed.times.iter().map(|(_, time)| milliseconds(time)).sum();
    report.line(format!("placed in {sum:.0} ms"));
    report
        .set("groups", json!({ "face": face, "middle": middle, "back": back, "cut": placed.cut, "mask": placed.mask }));
    report.set("points", json!({ "head": head, "mesh": all }));
    report.set("heights", json!(placed.heights));
    report.set("confidence", placed.confidence);
    report.set("square_error", placed.square_error);
    report.set("rounds", placed.rounds);
    report.set("folds", placed.folds);
    report.set("kept", placed.kept);
    let bone = |bone: &crate::algo::face::bones::FaceBone| {
        json!({
            "label": bone.label,
            "kind": format!("{:?}", bone.kind).to_lowercase(),
            "region": format!("{:?}", bone.region).to_lowercase(),
            "side": format!("{:?}", bone.side).to_lowercase(),
            "position": bone.position.to_array(),
            "pair": bone.pair.and_then(|pair| placed.bones.get(pair)).map(|pair| pair.label.as_str()),
        })
    };
    report.set("bones", placed.bones.iter().map(bone).collect::<Vec<Value>>());
    let times = placed.times.iter().map(|(name, time)| ((*name).to_owned(), json!(milliseconds(time))));
    let mut times: serde_json::Map<String, Value> = times.collect();
    times.insert("sum".to_owned(), json!(sum));
    report.set("milliseconds", times);
}
