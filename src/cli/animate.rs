//! `rigsmith animate`: a clip, or the motion of another skeleton, on a rig.

#[cfg(feature = "render")]
mod strip;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, WeightArgs, build, limits, positive, progress::spinning,
    report::counted, skin,
};
use crate::{
    files::{
        FileKind, RealDisk, load_animation, load_joint_map, load_motion, load_project, load_template, save_atomic,
        store_animation, store_model,
    },
    headless::{Workbench, posing::PoseError},
    mesh::model::{Clip, Model, Node},
    plugins::commands::BuildStep,
    rig::{
        BuiltRig, Rig, RigEdit, Uid,
        animation::{
            RigClip,
            humanoid::HumanBone,
            joint_map::{JointMap, JointMapError, write_joint_map},
            motion::Motion,
        },
        bake::baked,
        operations::{ClipOperation, KeyTolerance, Operation},
    },
    solve::{
        bake_clip::{BakedNode, bake_clip},
        retarget::{MotionTarget, RetargetError, RetargetSettings, RetargetedMotion, measure_feet, retarget},
    },
};

/// Arguments of `rigsmith animate`.
#[derive(Args, Debug)]
pub(super) struct AnimateArgs {
    /// The rig: a .rig.ron, a template by its name, a project (.rigsmith.ron), or a skeleton in a .glb, .gltf or .rig
    rig: PathBuf,
    /// The motion: clips of a rig (.anim.ron), or a motion capture file (.bvh) of any skeleton
    pub clip: PathBuf,
    /// A mesh to bind to the rig, for .glb and .png
    #[arg(long)]
    mesh: Option<PathBuf>,
    /// A map of joints for a .bvh: a RON list of pairs of names, [("LeftUpLeg", "thigh_l"), ...]; it wins over what is
    /// guessed
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Write the map that was used, to correct it and give it to --map
    #[arg(long, value_name = "FILE")]
    map_out: Option<PathBuf>,
    /// Frames a second of the clip; that of the file, but at most 60, if left out
    #[arg(long, value_name = "N", value_parser = positive)]
    fps: Option<f32>,
    /// Play the clip over and over
    #[arg(long = "loop")]
    looped: bool,
    /// Nodes that get the keys of a .bvh: controls if the rig has any, else joints, if left out
    #[arg(long, value_enum)]
    onto: Option<OntoArg>,
    /// Leave a figure that walks on the spot where it is
    #[arg(long)]
    in_place: bool,
    /// Let standing feet move as they do in the file
    #[arg(long)]
    free_feet: bool,
    /// The file to write: .glb or .gltf for the character with its animation, .anim.ron for the clip, .png for a strip of frames
    #[arg(short, long)]
    output: Output,
    /// Number of frames of a .png
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=64))]
    frames: u16,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
}

#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum OntoArg {
    /// Controls, so that an animator can go on
    Controls,
    /// Joints; the commands of the rig are left out
    Joints,
}

impl From<RetargetError> for Failure {
    fn from(error: RetargetError) -> Self {
        Self::Input(Box::new(error))
    }
}

impl From<JointMapError> for Failure {
    fn from(error: JointMapError) -> Self {
        Self::Input(Box::new(error))
    }
}

pub(super) fn run(args: &AnimateArgs) -> Result<Report, Failure> {
    let is_picture = args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    #[cfg(feature = "render")]
    if is_picture {
        super::device_selection::restart_without();
    }
    check(args, is_picture)?;
    let mut report = Report::default();
    let mut rig = read(args, &mut report)?;
    let is_motion = FileKind::of(&args.clip) == Some(FileKind::Bvh);
    let has_commands = rig.walk().any(|joint| !joint.data.tags.is_empty());
    let onto = match args.onto {
        Some(OntoArg::Joints) => MotionTarget::Joints,
        None if !has_commands => MotionTarget::Joints,
        Some(OntoArg::Controls) | None => MotionTarget::Controls,
    };
    if is_motion && onto == MotionTarget::Joints && has_commands {
        report
            .notes
            .push("--onto joints: the commands of the rig are left out, so that joints can have keys".to_owned());
        rig = without_commands(&rig)?;
    }
    let mut bench = limits::workbench(rig);
    if let Some(error) = bench.build(BuildStep::All).error {
        return Err(Failure::Input(Box::new(error)));
    }
    bench.runtime()?;
    let clips = if is_motion {
        moved(args, onto, &mut bench, &mut report)?
    } else {
        read_clips(args, &mut bench, &mut report)?
    };
    describe(&clips, &mut report);
    if is_picture {
        picture(args, &mut bench, &clips, &mut report)?;
    } else if FileKind::of(&args.output) == Some(FileKind::Animation) {
        store_animation(&RealDisk, &args.output, bench.rig(), bench.built(), &clips)?;
    } else {
        let (mut model, settings) =
            build::character_of(&mut bench, args.mesh.as_deref(), &args.weights, &args.export, &mut report)?;
        model.clips = spinning("baking", || exported(args, &bench, &model, &clips, &mut report))?;
        report.notes(spinning("writing", || store_model(&RealDisk, &args.output, &model, &settings))?);
    }
    report.line(format!("wrote {}", args.output.display()));
    report.set("output", args.output.display().to_string());
    Ok(report)
}

fn check(args: &AnimateArgs, is_picture: bool) -> Result<(), Failure> {
    let kind = FileKind::of(&args.output);
    if !is_picture && !matches!(kind, Some(FileKind::Glb | FileKind::Gltf | FileKind::Animation)) {
        let text = format!("cannot write `{}`; give .glb, .gltf, .anim.ron or .png", args.output.display());
        return Err(Failure::Usage(text));
    }
    if args.mesh.is_some() && kind == Some(FileKind::Animation) {
        return Err(Failure::Usage("--mesh is for a character; write one with -o NAME.glb".to_owned()));
    }
    let is_motion = FileKind::of(&args.clip) == Some(FileKind::Bvh);
    if !is_motion && FileKind::of(&args.clip) != Some(FileKind::Animation) {
        let text = format!("`{}` has no motion; give .bvh or .anim.ron", args.clip.display());
        return Err(Failure::Usage(text));
    }
    if !is_motion && (args.map.is_some() || args.map_out.is_some() || args.onto.is_some()) {
        let text = "--map, --map-out and --onto are for a .bvh; a clip of a rig knows its nodes";
        return Err(Failure::Usage(text.to_owned()));
    }
    let inputs = [Some(&args.rig), Some(&args.clip), args.mesh.as_ref(), args.map.as_ref()];
    let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
    let further: Vec<(&str, &Path)> = args.map_out.iter().map(|path| ("--map-out", path.as_path())).collect();
    InPlaceArgs::default().check(&inputs, Some(&args.output), &further)
}

fn read(args: &AnimateArgs, report: &mut Report) -> Result<Rig, Failure> {
    match FileKind::of(&args.rig) {
        Some(FileKind::Project) => {}
        Some(_) => return skin::load_rig(&args.rig, report),
        None => {
            let template = load_template(&RealDisk, &args.rig)?;
            report.notes(template.notes);
            return Ok(template.rig);
        }
    }
    let mut project = load_project(&RealDisk, &args.rig)?;
    report.notes(project.notes);
    let empty = || Failure::Input(format!("`{}` has no rig to animate", args.rig.display()).into());
    (!project.rigs.is_empty()).then(|| project.rigs.swap_remove(0)).ok_or_else(empty)
}

/// The rig with its joints alone, as it is before any command.
fn without_commands(rig: &Rig) -> Result<Rig, Failure> {
    let mut bare = rig.clone();
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
    let edits = tags.map(|(joint, tag)| RigEdit::RemoveTag(joint, tag)).collect();
    bare.apply(&RigEdit::Batch(edits)).map_err(|error| Failure::Input(Box::new(error)))?;
    Ok(bare)
}

/// Clips of a file, added to the rig as one would add them in the window.
fn read_clips(args: &AnimateArgs, bench: &mut Workbench, report: &mut Report) -> Result<Vec<RigClip>, Failure> {
    let read = load_animation(&RealDisk, &args.clip)?;
    report.notes(read.notes.iter().cloned());
    let bound = read.onto(bench.rig(), bench.built());
    if !bound.missing.is_empty() {
        report.notes.push(counted(
            bound.missing.len(),
            "node of the clips is not in the rig; its keys have no effect",
            "nodes of the clips are not in the rig; their keys have no effect",
        ));
    }
    if bound.clips.is_empty() {
        return Err(Failure::Input(format!("`{}` has no clips", args.clip.display()).into()));
    }
    let mut added = Vec::new();
    for mut clip in bound.clips {
        clip.looped |= args.looped;
        added.push(add(bench, clip)?);
    }
    Ok(added)
}

/// Adds a clip to the document; returns it as the document has it.
fn add(bench: &mut Workbench, clip: RigClip) -> Result<RigClip, Failure> {
    bench.operate(Operation::Clips(ClipOperation::Add(Box::new(clip.clone()))))?;
    Ok(bench.rig().clips().last().cloned().unwrap_or(clip))
}

/// A motion on the rig, with its clip added to the document.
fn moved(
    args: &AnimateArgs,
    onto: MotionTarget,
    bench: &mut Workbench,
    report: &mut Report,
) -> Result<Vec<RigClip>, Failure> {
    let motion = spinning("reading the motion", || load_motion(&RealDisk, &args.clip))?;
    report.notes(motion.notes.iter().cloned());
    let given = args.map.as_deref().map(|path| load_joint_map(&RealDisk, path)).transpose()?.unwrap_or_default();
    let map = JointMap::new(&motion, bench.rig(), &given)?;
    describe_map(&map, &motion, bench.rig(), report);
    if let Some(path) = &args.map_out {
        let text = write_joint_map(&map.names(&motion, bench.rig()));
        save_atomic(&RealDisk, path, text.as_bytes()).map_err(|error| Failure::Input(Box::new(error)))?;
        report.line(format!("wrote {}", path.display()));
    }
    let settings = RetargetSettings {
        frame_rate: args.fps,
        looped: args.looped,
        onto,
        travel: !args.in_place,
        lock_feet: !args.free_feet,
        ..RetargetSettings::default()
    };
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    let done = spinning("retargeting", || retarget(bench.rig(), built, &motion, &map, &settings))?;
    let RetargetedMotion { clip, keys, stances, unmoved, notes } = done;
    report.notes(notes);
    if !unmoved.is_empty() {
        report
            .notes
            .push(format!("no control turns {}: they keep their places at the joints above", unmoved.join(", ")));
    }
    let clip = add(bench, clip)?;
    let program = Arc::clone(bench.runtime()?.state().program());
    let feet = measure_feet(bench.rig(), &program, &clip, &map.target, &stances);
    report.line(format!(
        "{} instead of {} ({:.1} : 1); feet stand {}, slide {:.2} % and are off the ground by {:.2} % of the height at most",
        counted(keys[1], "key", "keys"),
        keys[0],
        keys[0] as f32 / keys[1].max(1) as f32,
        counted(feet.stances, "time", "times"),
        feet.slide,
        feet.ankle,
    ));
    report.set("onto", json!(onto));
    report.set("foot_slide", feet.slide);
    report.set("ankle_off", feet.ankle);
    report.set("stances", json!(stances));
    report.set("unmoved", unmoved);
    report.set("keys_before", keys[0]);
    report.set("keys_after", keys[1]);
    report.set("reduction", keys[0] as f32 / keys[1].max(1) as f32);
    Ok(vec![clip])
}

fn describe_map(map: &JointMap, motion: &Motion, rig: &Rig, report: &mut Report) {
    let labels: Vec<String> =
        rig.walk().map(|joint| joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string())).collect();
    let source = |joints: &[usize]| joints.iter().map(|joint| motion.joints[*joint].name.clone()).collect::<Vec<_>>();
    let target = |joints: &[usize]| joints.iter().map(|joint| labels[*joint].clone()).collect::<Vec<_>>();
    let entry = |(bone, from, to): (HumanBone, &[usize], &[usize])| json!({ "bone": bone.to_string(), "from": source(from), "to": target(to) });
    let mut mapped: Vec<Value> = map.bones().map(entry).collect();
    mapped.extend(map.pairs.iter().map(|(from, to)| json!({ "from": source(&[*from]), "to": target(&[*to]) })));
    let (from, to) = (map.unmapped_source(motion), map.unmapped_target(rig));
    report.line(format!(
        "{} mapped; {} of the motion and {} of the rig are not",
        counted(mapped.len(), "bone is", "bones are"),
        counted(from.len(), "joint", "joints"),
        to.len()
    ));
    report.set("found_by", json!(map.found_by));
    report.set("mapped", mapped);
    report.set("unmapped_source", from);
    report.set("unmapped_target", to);
}

fn describe(clips: &[RigClip], report: &mut Report) {
    let clip = |clip: &RigClip| {
        let tracks: usize = clip.layers.iter().map(|layer| layer.tracks.len()).sum();
        json!({
            "name": clip.name,
            "seconds": clip.duration(),
            "frame_rate": clip.frame_rate,
            "looped": clip.looped,
            "tracks": tracks,
            "keys": clip.key_count(),
        })
    };
    for clip in clips {
        let tracks: usize = clip.layers.iter().map(|layer| layer.tracks.len()).sum();
        report.line(format!(
            "clip \"{}\": {:.2} s, {}, {}",
            clip.name,
            clip.duration(),
            counted(tracks, "track", "tracks"),
            counted(clip.key_count(), "key", "keys")
        ));
    }
    report.set("clips", clips.iter().map(clip).collect::<Vec<_>>());
}

/// Clips baked for the nodes of an exported model.
fn exported(
    args: &AnimateArgs,
    bench: &Workbench,
    model: &Model,
    clips: &[RigClip],
    report: &mut Report,
) -> Result<Vec<Clip>, Failure> {
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    let program = bench.runtime()?.state().program();
    let nodes = baked_nodes(bench.rig(), built, model);
    // The tolerance is for humans in metres.
    let height = model.rest_globals().iter().map(|at| at.translation.y).fold(0.0, f32::max);
    let usual = KeyTolerance::default();
    let tolerance = KeyTolerance { distance: usual.distance * (height / 1.7).max(1e-6), ..usual };
    let mut baked = Vec::new();
    for clip in clips {
        let rate = args.fps.unwrap_or(clip.frame_rate);
        let done = bake_clip(program, clip, &nodes, rate, &tolerance);
        let keys: usize = done.channels.iter().map(|channel| channel.times.len()).sum();
        report.line(format!(
            "animation \"{}\": {}, {} at {rate} frames a second",
            done.name,
            counted(done.channels.len(), "channel", "channels"),
            counted(keys, "key", "keys")
        ));
        baked.push(done);
    }
    let channels: usize = baked.iter().map(|clip| clip.channels.len()).sum();
    report.set("channels", channels);
    Ok(baked)
}

/// Nodes of an exported model, which are those of the baked rig in their order.
fn baked_nodes(rig: &Rig, built: &BuiltRig, model: &Model) -> Vec<BakedNode> {
    let joints: Vec<Uid> = baked(rig, built).walk().map(|joint| joint.data.uid).collect();
    let node = |(uid, node): (Uid, &Node)| BakedNode { uid, parent: node.parent, rest: node.rest };
    joints.into_iter().zip(&model.nodes).map(node).collect()
}

#[cfg(feature = "render")]
fn picture(args: &AnimateArgs, bench: &mut Workbench, clips: &[RigClip], report: &mut Report) -> Result<(), Failure> {
    strip::draw(args, bench, clips, report)
}

#[cfg(not(feature = "render"))]
fn picture(args: &AnimateArgs, _: &mut Workbench, _: &[RigClip], _: &mut Report) -> Result<(), Failure> {
    let reason = format!("cannot draw `{}`: this program was built without pictures", args.output.display());
    Err(Failure::Usage(reason))
}
