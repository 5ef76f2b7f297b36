//! `rigsmith` alone: the whole job on the bundled character.

use std::path::Path;

use super::{Failure, Report, SEED, sketch::skin_and_store};
use crate::{
    algo::weights::WeightSettings,
    files::{RealDisk, read_capped, save_atomic},
    headless::Workbench,
    mesh::{
        gltf::GltfWriteSettings,
        obj::{ObjSettings, read_model},
    },
    plugins::gesture::read_gestures,
    rig::template::write_template,
};

const MESH: &[u8] = include_bytes!("../../assets/models/biped.obj");
const GESTURES: &[u8] = include_bytes!("../../assets/gestures/biped.ron");

/// Does it without a window; `reason` says why.
pub(super) fn run(reason: Option<&str>) -> Result<Report, Failure> {
    let mut report = Report::default();
    if let Some(reason) = reason {
        report.line(format!("No window: {reason}. Doing the job without one."));
    }
    report.line("Rigging the bundled character; give a command to rig yours (see below).");
    let model = read_model(MESH, "biped", &ObjSettings::default(), &mut |_| None)
        .map_err(|error| Failure::Input(Box::new(error)))?;
    let faces = model.face_count();
    let gestures = read_gestures(GESTURES).map_err(|error| Failure::Input(Box::new(error)))?;
    let strokes = gestures.len();
    let mut bench = Workbench::new(SEED, "biped");
    bench.open(model, false)?;
    for answer in bench.gestures(gestures).iter().filter(|answer| !answer.done) {
        report.notes.push(format!("gesture {} ({}): {}", answer.number, answer.gesture, answer.message));
    }
    report.line(format!("sketched {} joints with {strokes} gestures into {faces} faces", bench.rig().len()));
    save_template(&bench, Path::new("biped.rig.ron"), &mut report)?;
    let glb = Path::new("biped.glb");
    skin_and_store(&mut bench, glb, WeightSettings::default(), &GltfWriteSettings::default(), &mut report)?;
    report.line("wrote biped.glb: drop it into any glTF viewer, Blender or a Bevy game");
    report.line("");
    report.line("Go on with:");
    report.line("  rigsmith info biped.glb                               what is in a file");
    report.line("  rigsmith sketch MESH.obj GESTURES.ron -o RIG.rig.ron  clicks and strokes become a skeleton");
    report.line("  rigsmith skin RIG.rig.ron MESH.obj -o OUT.glb         bind a mesh to a skeleton");
    report.line("  rigsmith convert IN OUT                               .obj .gltf .glb .rig .rig.ron");
    report.line("  rigsmith --help                                       everything else");
    report.set("joints", bench.rig().len());
    report.set("output", "biped.glb");
    Ok(report)
}

/// Writes the template, unless there is one that somebody has worked on.
fn save_template(bench: &Workbench, path: &Path, report: &mut Report) -> Result<(), Failure> {
    let text = write_template(bench.rig());
    match read_capped(&RealDisk, path, 64 << 20) {
        Ok(there) if there != text.as_bytes() => {
            report.notes.push(format!("kept the {} that is there, which differs", path.display()));
        }
        Ok(_) => report.line(format!("{} is there already", path.display())),
        Err(_) => {
            save_atomic(&RealDisk, path, text.as_bytes()).map_err(|error| Failure::Input(Box::new(error)))?;
            report.line(format!("wrote the template {}", path.display()));
        }
    }
    Ok(())
}
