//! `rigsmith info`: content of a file.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::{
    Failure, Report,
    limits::{self, Limit},
    progress::spinning,
    report::counted,
    sketch::describe_rig,
};
use crate::{
    files::{FileKind, RealDisk, load_animation, load_gestures, load_motion, load_packed_clips, load_skin},
    mesh::model::Model,
    rig::{
        Rig, Uid, UidSource,
        character::import_rig_text,
        part::{PartInstance, PartNeeds, PartOverride},
    },
};

/// Arguments of `rigsmith info`.
#[derive(Args, Debug)]
pub(super) struct InfoArgs {
    /// The file: a mesh (.obj, .gltf, .glb, .vrm), a rig (.rig.ron, .rig), a project (.rigsmith.ron), motion (.anim.ron,
    /// .bvh, .rigclip), weights (.skin) or a list of gestures (.ron)
    pub file: PathBuf,
}

pub(super) fn run(args: &InfoArgs) -> Result<Report, Failure> {
    let path = args.file.as_path();
    let mut report = Report::default();
    match FileKind::of(path) {
        Some(FileKind::Obj | FileKind::Gltf | FileKind::Glb | FileKind::Vrm) => {
            let model = spinning("reading", || limits::load_model(path))?;
            describe_model(&mut report, &model);
        }
        Some(FileKind::Template) => describe_template(&mut report, path)?,
        Some(FileKind::RigText) => describe_rig_text(&mut report, path)?,
        Some(FileKind::Project) => describe_project(&mut report, path)?,
        Some(FileKind::Skin) => describe_skin(&mut report, path)?,
        Some(FileKind::Animation) => describe_animation(&mut report, path)?,
        Some(FileKind::Bvh) => describe_motion(&mut report, path)?,
        Some(FileKind::PackedClips) => describe_packed_clips(&mut report, path)?,
        Some(FileKind::Gestures) => describe_gestures(&mut report, path)?,
        None if path.is_dir() => {
            return Err(Failure::Usage(format!("`{}` is a folder; give a file in it", path.display())));
        }
        None => {
            let message = format!(
                "`{}`: Rigsmith knows .obj, .gltf, .glb, .vrm, .rig, .rig.ron, .rigsmith.ron, .anim.ron, .rigclip, .bvh, .skin and .ron",
                path.display()
            );
            return Err(Failure::Usage(message));
        }
    }
    limits::check_time("reading the file")?;
    Ok(report)
}

/// Adds the content of a template to a report.
fn describe_template(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let template = limits::load_template(path)?;
    let about = template.rig.about();
    let title = format!("template \"{}\" {}", about.name, about.version);
    report.line(title.trim_end());
    if !about.description.is_empty() {
        report.line(about.description.clone());
    }
    report.set("kind", "template");
    report.set("about", serde_json::to_value(about).unwrap_or(Value::Null));
    report.notes(template.notes);
    for part in &template.instances {
        let place = match &part.parent {
            _ if !part.onto.is_empty() => format!(" on {}", part.onto.join(", ")),
            Some(parent) => format!(" below {parent}"),
            None => part.socket.as_ref().map_or_else(String::new, |socket| format!(" on socket {socket}")),
        };
        let side = if part.mirror { ", mirrored" } else { "" };
        let overrides = part.overrides();
        let different = if overrides.is_empty() { "" } else { ", changed here:" };
        report.line(format!("part {}: {}{place}{side}{different}", part.title(), part.part));
        for PartOverride { target, field, value } in overrides {
            report.line(format!("  {target}: {field} = {value}"));
        }
    }
    report.set("parts", template.instances.iter().map(|part| part.part.clone()).collect::<Vec<_>>());
    report.set("overrides", template.instances.iter().flat_map(overrides).collect::<Vec<_>>());
    for socket in &template.sockets {
        // Parts give their joints other labels than their files do.
        let joint = socket.joint.and_then(|joint| template.rig.joint(joint));
        let label = joint.and_then(|joint| joint.data.label.as_ref()).unwrap_or(&socket.label);
        report.line(format!("socket {} on {label}", socket.name));
    }
    report.set("sockets", template.sockets.iter().map(|socket| socket.name.clone()).collect::<Vec<_>>());
    if about.kind == "part" {
        let needs = PartNeeds::of(&template.rig);
        report.line(format!("needs joints: {}", needs.joints.join(", ")));
        let places: Vec<String> = needs.sockets.iter().map(ToString::to_string).collect();
        report.line(format!("hangs on: {}", places.join(", ")));
        report.set("needs", json!({ "joints": needs.joints, "sockets": places }));
    }
    for option in &template.options {
        let about = if option.description.is_empty() { "" } else { ": " };
        report.line(format!("option {} = {}{about}{}", option.name, option.default, option.description));
    }
    report.set("options", template.options.iter().map(|option| option.name.clone()).collect::<Vec<_>>());
    describe_joints(report, &template.rig);
    Ok(())
}

/// Adds the content of a skeleton in `.rig` text to a report.
fn describe_rig_text(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let text = limits::load_rig_text(path)?;
    let mut rig = Rig::new(Uid(1), "");
    for edit in import_rig_text(&text, &mut UidSource::seeded(super::SEED)).0 {
        rig.apply(&edit).map_err(|error| Failure::Input(format!("`{}`: {error}", path.display()).into()))?;
    }
    limits::check_rig(path, &rig)?;
    report.line("skeleton in .rig text");
    report.set("kind", "rig");
    describe_joints(report, &rig);
    Ok(())
}

/// Adds the content of a project to a report.
fn describe_project(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let project = spinning("reading", || limits::load_project(path))?;
    report.line(format!("project \"{}\": {}", project.name, counted(project.meshes.len(), "mesh", "meshes")));
    report.set("kind", "project");
    report.set("name", project.name);
    report.notes(project.notes);
    for mesh in &project.meshes {
        report.line(format!("mesh {}", mesh.path.display()));
    }
    for rig in &project.rigs {
        let posed = counted(rig.pose().len(), "joint", "joints");
        let stored = counted(rig.stored_poses().len(), "stored pose", "stored poses");
        report.line(format!("rig \"{}\": {posed} posed, {stored}", rig.about().name));
        describe_joints(report, rig);
    }
    Ok(())
}

/// Adds the content of a file of weights to a report.
fn describe_skin(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let skin = load_skin(&RealDisk, path)?;
    let (points, joints) = (skin.weights().len(), skin.joints().len());
    let copy = if skin.mesh().is_some() { "with" } else { "without" };
    report.line(format!(
        "weights of {} over {}, {copy} a copy of the mesh",
        counted(points, "point", "points"),
        counted(joints, "joint", "joints")
    ));
    report.set("kind", "skin");
    report.set("points", points);
    report.set("joints", joints);
    report.set("mesh_hash", format!("{:032x}", skin.mesh_hash()));
    Ok(())
}

/// Adds the content of a file of clips to a report.
fn describe_animation(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let read = load_animation(&RealDisk, path)?;
    report.notes(read.notes);
    for clip in &read.clips {
        let tracks: usize = clip.layers.iter().map(|layer| layer.tracks.len()).sum();
        let (tracks, keys) = (counted(tracks, "track", "tracks"), counted(clip.key_count(), "key", "keys"));
        report.line(format!("clip \"{}\": {:.2} s, {tracks}, {keys}", clip.name, clip.duration()));
    }
    report.set("kind", "animation");
    report.set("clips", read.clips.len());
    Ok(())
}

/// Adds the content of a motion of a skeleton to a report.
fn describe_motion(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let motion = load_motion(&RealDisk, path)?;
    let (joints, frames, seconds) = (motion.joints.len(), motion.frames(), motion.duration());
    report.line(format!(
        "motion of {}: {}, {seconds:.2} s",
        counted(joints, "joint", "joints"),
        counted(frames, "frame", "frames")
    ));
    report.notes(motion.notes);
    report.set("kind", "motion");
    report.set("joints", joints);
    report.set("frames", frames);
    report.set("seconds", seconds);
    Ok(())
}

/// Adds the content of a file of packed clips to a report.
fn describe_packed_clips(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let packed = load_packed_clips(&RealDisk, path)?;
    for clip in &packed.clips {
        let (frames, keys) = (counted(clip.frames(), "frame", "frames"), counted(clip.key_count(), "key", "keys"));
        report.line(format!("packed clip \"{}\": {frames}, {keys}", clip.name()));
    }
    report.line(counted(packed.nodes.len(), "joint", "joints"));
    report.set("kind", "packed_clips");
    report.set("joints", packed.nodes.len());
    report.set("clips", packed.clips.len());
    Ok(())
}

/// Adds the content of a list of gestures to a report.
fn describe_gestures(report: &mut Report, path: &Path) -> Result<(), Failure> {
    let gestures = load_gestures(&RealDisk, path)?;
    limits::check_gestures(path, &gestures)?;
    report.line(counted(gestures.len(), "gesture", "gestures"));
    report.set("kind", "gestures");
    report.set("gestures", gestures.len());
    Ok(())
}

/// Changes that an instance makes to its part, an object each.
fn overrides(part: &PartInstance) -> Vec<Value> {
    let listed = |PartOverride { target, field, value }| json!({ "part": part.title(), "target": target, "field": field, "value": value });
    part.overrides().into_iter().map(listed).collect()
}

fn describe_model(report: &mut Report, model: &Model) {
    let triangles: usize = model.parts.iter().map(|part| part.triangles.len()).sum();
    let faces = model.face_count();
    let vertices: usize = model.parts.iter().map(|part| part.vertices.len()).sum();
    let joints = model.nodes.iter().filter(|node| node.joint).count();
    let finite = model.points.iter().filter(|point| point.is_finite());
    let low = finite.clone().copied().reduce(glam::Vec3::min).unwrap_or_default();
    let high = finite.copied().reduce(glam::Vec3::max).unwrap_or_default();
    let unweighted =
        model.weights.as_ref().map(|weights| (0..weights.len()).filter(|p| weights.of(*p).len() == 0).count());
    let morphs: usize = model.objects.iter().map(|object| object.morph_names.len()).sum();
    report.line(format!(
        "{}, {} ({}), {}",
        counted(model.points.len(), "point", "points"),
        counted(faces, "face", "faces"),
        counted(triangles, "triangle", "triangles"),
        counted(vertices, "vertex", "vertices")
    ));
    report.line(format!("box {:.4} {:.4} {:.4} to {:.4} {:.4} {:.4}", low.x, low.y, low.z, high.x, high.y, high.z));
    let names: Vec<&str> = model.objects.iter().map(|object| object.name.as_str()).collect();
    let objects = counted(names.len(), "object", "objects");
    report.line(limits::message(&format!("{objects}: {}", names.join(", "))));
    report.line(format!(
        "{}, {}, {}, {}, {}",
        counted(model.material_set.materials.len(), "material", "materials"),
        counted(model.material_set.images.len(), "image", "images"),
        counted(morphs, "morph target", "morph targets"),
        counted(joints, "joint", "joints"),
        counted(model.clips.len(), "clip", "clips")
    ));
    if let Some(unweighted) = unweighted {
        report.line(format!("skinned; {} without weights", counted(unweighted, "point", "points")));
    }
    report.notes(model.notes.iter().cloned());
    report.set("kind", "mesh");
    report.set("points", model.points.len());
    report.set("vertices", vertices);
    report.set("faces", faces);
    report.set("triangles", triangles);
    report.set("box", json!([low.to_array(), high.to_array()]));
    report.set("objects", names.iter().map(|name| json!(name)).collect::<Vec<Value>>());
    report.set("materials", model.material_set.materials.len());
    report.set("images", model.material_set.images.len());
    report.set("morph_targets", morphs);
    report.set("joints", joints);
    report.set("clips", model.clips.iter().map(|clip| json!(clip.name)).collect::<Vec<Value>>());
    report.set("skinned", model.weights.is_some());
    report.set("unweighted", unweighted);
}

fn describe_joints(report: &mut Report, rig: &Rig) {
    report.line(format!(
        "{}, {}, {}",
        counted(rig.len(), "joint", "joints"),
        counted(rig.roots().len(), "root", "roots"),
        counted(rig.groups().len(), "local group", "local groups")
    ));
    let listed = limits::most(Limit::Listed);
    for joint in rig.walk().take(listed) {
        let depth = rig.ancestors(joint.data.uid).count();
        let label = joint.data.label.as_deref().unwrap_or("(no label)");
        let tags = match joint.data.tags.len() {
            0 => String::new(),
            count => format!("  {}", counted(count, "tag", "tags")),
        };
        report.line(format!("  {}{label}{tags}", "  ".repeat(depth.min(40))));
    }
    if rig.len() > listed {
        report.line(format!("  and {} more", rig.len() - listed));
    }
    describe_rig(report, rig);
}
