//! `rigsmith animate`: a clip, or the motion of another skeleton, on a rig.

mod animated_rig;
mod choice;
mod packed_clips;
mod source;
#[cfg(feature = "render")]
mod strip;
mod switch;

use std::path::{Path, PathBuf};

use bevy::math::Vec3A;
use clap::{Args, ValueEnum};
use serde::Serialize;

use self::animated_rig::{AnimatedRig, running};
use super::{
    ExportArgs, Failure, InPlaceArgs, Output, Report, VrmArgs, WeightArgs, build, limits, positive,
    progress::spinning,
    project_meshes::{check_output, own_meshes},
    report::counted,
    skin,
    vrm::AvatarDraft,
};
use crate::{
    files::{FileKind, RealDisk, store_animation, store_owned_model},
    headless::{Workbench, posing::PoseError},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Clip, Model, Node},
    },
    plugins::surface::RigMesh,
    rig::{
        BuiltRig, Rig, RigEdit, Uid,
        animation::RigClip,
        bake::baked,
        operations::KeyTolerance,
        skeleton_preset::{SkeletonPreset, apply_preset},
    },
    solve::{
        bake_clip::{BakePlan, BakeSettings, BakedNode},
        retarget::MotionTarget,
    },
};

/// Arguments of `rigsmith animate`.
#[derive(Args, Debug)]
pub(super) struct AnimateArgs {
    /// The rig: a .rig.ron, a template by its name, a project (.rigsmith.ron), or a skeleton in a .glb, .gltf, .vrm or .rig
    rig: PathBuf,
    /// The motion: clips of a rig (.anim.ron), motion capture (.bvh), packed clips (.rigclip) or the animations of a model
    /// (.glb, .gltf, .vrm) of any skeleton; several files become several animations
    #[arg(required = true, value_name = "CLIP")]
    pub clips: Vec<PathBuf>,
    /// A clip to take from the files, by its name or its number from 1; may be repeated; all, if left out
    #[arg(long = "clip", value_name = "NAME")]
    chosen: Vec<String>,
    /// A mesh to bind to the rig, for .glb, .vrm and .png; may be repeated, for all meshes of one character; a rig that is a
    /// .glb, .gltf, .vrm or project keeps its own meshes and weights in a .glb or .vrm
    #[arg(long = "mesh", value_name = "MESH")]
    meshes: Vec<PathBuf>,
    /// A map of joints for motion of another skeleton: a RON list of pairs of names, [("LeftUpLeg", "thigh_l"), ...];
    /// it wins over what is guessed, and "" beside a joint lets it move nothing
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Write the map that was used, to correct it and give it to --map
    #[arg(long, value_name = "FILE")]
    map_out: Option<PathBuf>,
    /// Frames a second of the clip; that of the file if left out, but at most 60 for motion of another skeleton
    #[arg(long, value_name = "N", value_parser = positive)]
    fps: Option<f32>,
    /// Distance by which a joint may be off its place through the removal of keys, in millimetres on a figure of 1.7 m;
    /// if left out, 0.5 for motion of other skeletons, and 0.05 in a .glb or .rigclip, where turns are kept to 0.01 degrees
    #[arg(long, value_name = "MM", value_parser = positive)]
    tolerance: Option<f32>,
    /// Play the clip over and over
    #[arg(long = "loop")]
    looped: bool,
    /// Nodes that get the keys of another skeleton: controls if the rig has any, else joints, if left out
    #[arg(long, value_enum)]
    onto: Option<OntoArg>,
    /// Leave a figure that walks on the spot where it is
    #[arg(long)]
    in_place: bool,
    /// Put the travel over the ground onto the control that carries the whole rig, for the root motion of a game
    #[arg(long)]
    root_motion: bool,
    /// Let standing feet move as they do in the file
    #[arg(long)]
    free_feet: bool,
    /// Let hands move as they do in the file where they touch something
    #[arg(long)]
    free_hands: bool,
    /// Names and axes of the bones in a .glb, .gltf or .vrm
    #[arg(long, value_enum, default_value = "plain")]
    preset: PresetArg,
    /// The file to write: .glb or .gltf for the character with its animation, .vrm for an avatar in VRM 1.0 (at rest in a
    /// T-pose, with bones, expressions, gaze and springs), .anim.ron for the clip, .rigclip for the motion of its joints in
    /// few bytes, .png for a strip of frames
    #[arg(short, long)]
    output: Output,
    /// Number of frames of a .png
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=64))]
    frames: u16,
    #[command(flatten)]
    switches: switch::SwitchOverArgs,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    vrm: VrmArgs,
}

#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum OntoArg {
    /// Controls, so that an animator can go on
    Controls,
    /// Joints; the commands of the rig are left out
    Joints,
}

#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum PresetArg {
    /// Names and axes of the rig
    Plain,
    /// Mixamo: names such as mixamorig:LeftUpLeg, Y along the bones
    Mixamo,
    /// Unreal: names such as thigh_l, X along the bones
    Unreal,
    /// Unity's humanoid: names such as LeftUpperLeg, axes of the model
    Unity,
    /// VRM: names such as leftUpperLeg, axes of the model
    Vrm,
}

pub(super) fn run(args: &AnimateArgs) -> Result<Report, Failure> {
    let is_picture = args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    #[cfg(feature = "render")]
    if is_picture {
        super::device_selection::restart_without();
    }
    check(args, is_picture)?;
    let mut report = Report::default();
    let (mut rig, own) = read(args, &mut report)?;
    let meta = args.vrm.meta(&rig, &args.output)?;
    let is_motion = args.clips.iter().any(|clip| is_motion(clip));
    let has_commands = rig.walk().any(|joint| !joint.data.tags.is_empty());
    let onto = match args.onto {
        Some(OntoArg::Joints) => MotionTarget::Joints,
        None if !has_commands => MotionTarget::Joints,
        Some(OntoArg::Controls) | None => MotionTarget::Controls,
    };
    let mut whole = None;
    if is_motion && onto == MotionTarget::Joints && has_commands {
        report
            .notes
            .push("--onto joints: the commands of the rig are left out, so that joints can have keys".to_owned());
        let bare = without_commands(&rig)?;
        if args.clips.iter().any(|clip| FileKind::of(clip) == Some(FileKind::Animation)) {
            whole = Some(running(rig)?);
        }
        rig = bare;
    }
    let needs_app = is_picture || !args.switches.is_empty() || !args.meshes.is_empty() || !own.is_empty();
    let mut animated = AnimatedRig::new(rig, needs_app)?;
    let (mut clips, map_file) = source::clips(args, onto, &mut animated, whole.as_ref(), &mut report)?;
    if let AnimatedRig::App(bench) = &mut animated {
        switch::throw(&args.switches, bench, &mut clips, &mut report)?;
    }
    describe(&clips, &mut report);
    if let (true, AnimatedRig::App(bench)) = (is_picture, &mut animated) {
        picture(args, bench, &clips, &mut report)?;
    } else if FileKind::of(&args.output) == Some(FileKind::Animation) {
        store_animation(&RealDisk, &args.output, animated.rig(), animated.built(), &clips)?;
    } else if FileKind::of(&args.output) == Some(FileKind::PackedClips) {
        packed_clips::store(args, &animated, &clips, &mut report)?;
    } else {
        let (mut model, settings) = match own_character(args, &animated, &mut report)? {
            Some(model) => {
                (model, GltfWriteSettings { all_joints: true, bind_unweighted: true, ..args.export.settings() })
            }
            None => character(args, &mut animated, own, &mut report)?,
        };
        let draft = meta.map(|meta| (AvatarDraft::new(animated.rig(), animated.built(), &mut model), meta));
        model.clips = spinning("baking", || exported(args, &animated, &model, &clips, &mut report))?;
        dress(args, &mut model, &mut report);
        match draft {
            Some((draft, meta)) => draft.store(model, meta, &args.output, &settings, &mut report)?,
            None => {
                // What is written is read back, which takes as much memory again.
                drop((animated, clips));
                report.notes(spinning("writing", || store_owned_model(&RealDisk, &args.output, model, &settings))?);
            }
        }
    }
    report.line(format!("wrote {}", args.output.display()));
    if let Some(file) = map_file {
        let line = format!("wrote {}", file.path().display());
        file.put_in_place()?;
        report.line(line);
    }
    report.set("output", args.output.display().to_string());
    Ok(report)
}

/// The character that clips move, and the settings for writing it.
fn character(
    args: &AnimateArgs,
    animated: &mut AnimatedRig,
    mut own: Vec<RigMesh>,
    report: &mut Report,
) -> Result<(Model, GltfWriteSettings), Failure> {
    let bench = match animated {
        AnimatedRig::Still(still) => return Ok(still.skeleton(&args.export)),
        AnimatedRig::App(bench) => bench,
    };
    match own.len() {
        0 => build::character_of(bench, &args.meshes, &args.weights, &args.export, report),
        1 => {
            let mesh = build::MeshSource::Open(Box::new(own.swap_remove(0)));
            build::character_with(bench, vec![mesh], &args.weights, &args.export, report)
        }
        _ => build::posed_meshes(bench, &own, &args.export),
    }
}

/// True if a file has the motion of a skeleton of its own.
fn is_motion(path: &Path) -> bool {
    FileKind::of(path).is_some_and(|kind| matches!(kind, FileKind::Bvh | FileKind::PackedClips) || kind.is_gltf())
}

fn check(args: &AnimateArgs, is_picture: bool) -> Result<(), Failure> {
    let kind = FileKind::of(&args.output);
    let is_character = kind.is_some_and(FileKind::is_gltf);
    let is_packed = kind == Some(FileKind::PackedClips);
    if !is_picture && !is_character && !is_packed && kind != Some(FileKind::Animation) {
        let text =
            format!("cannot write `{}`; give .glb, .gltf, .vrm, .anim.ron, .rigclip or .png", args.output.display());
        return Err(Failure::Usage(text));
    }
    if !args.meshes.is_empty() && (is_packed || kind == Some(FileKind::Animation)) {
        return Err(Failure::Usage("--mesh is for a character; write one with -o NAME.glb".to_owned()));
    }
    let is_known = |clip: &PathBuf| is_motion(clip) || FileKind::of(clip) == Some(FileKind::Animation);
    if let Some(clip) = args.clips.iter().find(|clip| !is_known(clip)) {
        let text = format!("`{}` has no motion; give .bvh, .glb, .gltf, .vrm, .rigclip or .anim.ron", clip.display());
        return Err(Failure::Usage(text));
    }
    args.vrm.check(Some(&args.output))?;
    if args.preset != PresetArg::Plain && !is_character {
        return Err(Failure::Usage("--preset is for a character; write one with -o NAME.glb".to_owned()));
    }
    let motions = args.clips.iter().filter(|clip| is_motion(clip)).count();
    if motions == 0 && (args.map.is_some() || args.map_out.is_some() || args.onto.is_some()) {
        let text = "--map, --map-out and --onto are for a .bvh, .glb, .gltf, .vrm or .rigclip; a clip of a rig knows its nodes";
        return Err(Failure::Usage(text.to_owned()));
    }
    if motions == 0 && (args.in_place || args.free_feet || args.free_hands || args.root_motion) {
        let text = "--in-place, --root-motion, --free-feet and --free-hands are for a .bvh, .glb, .gltf, .vrm or .rigclip; a clip of a rig moves as its keys say";
        return Err(Failure::Usage(text.to_owned()));
    }
    if motions == 0 && args.tolerance.is_some() && !is_character && !is_packed {
        let text = "--tolerance is for motion of another skeleton and for a .glb, .gltf, .vrm or .rigclip; the keys of a clip of a rig stay as they are in a .anim.ron or .png";
        return Err(Failure::Usage(text.to_owned()));
    }
    if motions > 1 && args.map_out.is_some() {
        let text = "--map-out is for one file of motion; give one .bvh, .glb, .gltf, .vrm or .rigclip";
        return Err(Failure::Usage(text.to_owned()));
    }
    let inputs = std::iter::once(&args.rig).chain(&args.meshes).chain(&args.map).chain(&args.clips);
    let inputs: Vec<&Path> = inputs.map(PathBuf::as_path).collect();
    let further: Vec<(&str, &Path)> = args.map_out.iter().map(|path| ("--map-out", path.as_path())).collect();
    InPlaceArgs::default().check(&inputs, Some(&args.output), &further)
}

/// The rig, and the meshes that it has in a project where they are to be written.
fn read(args: &AnimateArgs, report: &mut Report) -> Result<(Rig, Vec<RigMesh>), Failure> {
    match FileKind::of(&args.rig) {
        Some(FileKind::Project) => {}
        Some(_) => return Ok((skin::load_rig(&args.rig, report)?, Vec::new())),
        None => {
            let template = limits::load_template(&args.rig)?;
            report.notes(template.notes);
            return Ok((template.rig, Vec::new()));
        }
    }
    let mut project = limits::load_project(&args.rig)?;
    check_output(&project, Some(&args.output), InPlaceArgs::default())?;
    let is_character = args.meshes.is_empty() && FileKind::of(&args.output).is_some_and(FileKind::is_gltf);
    if is_character {
        limits::refuse_outside(&project)?;
    }
    report.notes(project.notes);
    let empty = || Failure::Input(format!("`{}` has no rig to animate", args.rig.display()).into());
    let rig = (!project.rigs.is_empty()).then(|| project.rigs.swap_remove(0)).ok_or_else(empty)?;
    let own = if is_character { own_meshes(project.meshes, &rig, report) } else { Vec::new() };
    Ok((rig, own))
}

/// The rig with its joints alone, as it is before any command.
fn without_commands(rig: &Rig) -> Result<Rig, Failure> {
    let mut bare = rig.clone();
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
    let edits = tags.map(|(joint, tag)| RigEdit::RemoveTag(joint, tag)).collect();
    bare.apply(&RigEdit::Batch(edits)).map_err(|error| Failure::Input(Box::new(error)))?;
    Ok(bare)
}

/// Clip as programs get it. Numbers are doubles, as all of a JSON value are.
#[derive(Serialize)]
struct ClipFields<'c> {
    name: &'c str,
    seconds: f64,
    frame_rate: f64,
    looped: bool,
    markers: usize,
    tracks: usize,
    keys: usize,
}

fn describe(clips: &[RigClip], report: &mut Report) {
    for clip in clips {
        report.line(format!(
            "clip \"{}\": {:.2} s, {}, {}",
            clip.name,
            clip.duration(),
            counted(track_count(clip), "track", "tracks"),
            counted(clip.key_count(), "key", "keys")
        ));
    }
    // A single clip is told without a list, too.
    if let [only] = clips {
        report.set("seconds", f64::from(only.duration()));
        report.set("tracks", track_count(only));
    }
    let told = clips.iter().map(|clip| ClipFields {
        name: &clip.name,
        seconds: f64::from(clip.duration()),
        frame_rate: f64::from(clip.frame_rate),
        looped: clip.looped,
        markers: clip.markers.len(),
        tracks: track_count(clip),
        keys: clip.key_count(),
    });
    report.set_list("clips", told);
}

/// Number of tracks of all layers.
fn track_count(clip: &RigClip) -> usize {
    clip.layers.iter().map(|layer| layer.tracks.len()).sum()
}

/// Character of the rig's own file, with its mesh and weights; `None` if the rig is no model or has no mesh, or if
/// another mesh is given.
fn own_character(args: &AnimateArgs, animated: &AnimatedRig, report: &mut Report) -> Result<Option<Model>, Failure> {
    if !args.meshes.is_empty() || !FileKind::of(&args.rig).is_some_and(FileKind::is_gltf) {
        return Ok(None);
    }
    let model = limits::load_model(&args.rig)?;
    let built = animated.built().ok_or(PoseError::NotBuilt)?;
    let skeleton = baked(animated.rig(), built);
    let is_alike = skeleton.len() == model.nodes.len()
        && skeleton
            .walk()
            .zip(&model.nodes)
            .all(|(joint, node)| joint.data.label.as_deref().unwrap_or_default() == node.name);
    if !is_alike && !model.points.is_empty() {
        report.notes.push(format!(
            "the built rig has other joints than `{}`: its mesh and weights are left out; give a mesh with --mesh",
            args.rig.display()
        ));
    }
    Ok((is_alike && !model.points.is_empty()).then_some(model))
}

/// Baked clip as programs get it. Numbers are doubles, as all of a JSON value are.
#[derive(Serialize)]
struct AnimationFields {
    name: String,
    channels: usize,
    keys_before: usize,
    keys_after: usize,
    reduction: f64,
}

/// Clips baked for the nodes of an exported model.
fn exported(
    args: &AnimateArgs,
    animated: &AnimatedRig,
    model: &Model,
    clips: &[RigClip],
    report: &mut Report,
) -> Result<Vec<Clip>, Failure> {
    let built = animated.built().ok_or(PoseError::NotBuilt)?;
    let program = animated.program()?;
    let nodes = baked_nodes(animated.rig(), built, model);
    let plan = BakePlan::new(program, &nodes);
    let tolerance = tolerance(args, size_of(model.rest_globals().iter().map(|at| at.translation)));
    let mut baked = Vec::new();
    let mut facts = Vec::new();
    let mut sums = [0, 0];
    for clip in clips {
        limits::check_time("baking the clips")?;
        let rate = args.fps.unwrap_or(clip.frame_rate);
        let done = plan
            .bake(clip, &bake_settings(rate, tolerance))
            .map_err(|error| Failure::Input(format!("clip \"{}\": {error}", clip.name).into()))?;
        let keys: usize = done.channels.iter().map(|channel| channel.times.len()).sum();
        report.line(format!(
            "animation \"{}\": {}, {} at {rate} frames a second",
            done.name,
            counted(done.channels.len(), "channel", "channels"),
            counted(keys, "key", "keys")
        ));
        // Without the reduction, each channel had a key at each frame.
        let frames = (clip.duration() * rate + 1e-3).floor() as usize + 1;
        sums = [sums[0] + frames * done.channels.len(), sums[1] + keys];
        facts.push(AnimationFields {
            name: done.name.clone(),
            channels: done.channels.len(),
            keys_before: frames * done.channels.len(),
            keys_after: keys,
            reduction: f64::from(reduction(frames * done.channels.len(), keys)),
        });
        baked.push(done);
    }
    report.set_list("animations", facts);
    // What retargeting has told is about the clips on the rig.
    if !report.json.contains_key("motions") {
        report.set("keys_before", sums[0]);
        report.set("keys_after", sums[1]);
        report.set("reduction", reduction(sums[0], sums[1]));
    }
    let channels: usize = baked.iter().map(|clip| clip.channels.len()).sum();
    report.set("channels", channels);
    Ok(baked)
}

/// Ratio of numbers of keys or bytes before and after a reduction.
fn reduction(before: usize, after: usize) -> f32 {
    before as f32 / after.max(1) as f32
}

/// Longest edge of the box around some places. Animals are longer than high, and skeletons may hang below the ground.
fn size_of(places: impl Iterator<Item = Vec3A> + Clone) -> f32 {
    let extent = places.clone().reduce(Vec3A::max).zip(places.reduce(Vec3A::min));
    extent.map_or(0.0, |(most, least)| (most - least).max_element())
}

/// Tolerance of baking for a figure of a size; the usual one is for humans in metres.
fn tolerance(args: &AnimateArgs, size: f32) -> KeyTolerance {
    KeyTolerance::default().scaled(args.tolerance.map_or(1.0, |most| most / 0.05)).for_height(size)
}

/// Manner of baking at a rate, within the limit of this process.
fn bake_settings(rate: f32, tolerance: KeyTolerance) -> BakeSettings {
    BakeSettings { rate, tolerance, most: limits::chosen().get(limits::Limit::Baked) }
}

/// Gives the model the names and axes of another program.
fn dress(args: &AnimateArgs, model: &mut Model, report: &mut Report) {
    let preset = match args.preset {
        PresetArg::Plain => return,
        PresetArg::Mixamo => SkeletonPreset::Mixamo,
        PresetArg::Unreal => SkeletonPreset::Unreal,
        PresetArg::Unity => SkeletonPreset::Unity,
        PresetArg::Vrm => SkeletonPreset::Vrm,
    };
    match apply_preset(model, preset) {
        Some(renamed) => report.set("renamed", renamed),
        None => report.notes.push("--preset: no human was found in the skeleton; names and axes stay".to_owned()),
    }
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
