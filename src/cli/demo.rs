//! `rigsmith` without a command: the whole workflow on the bundled character.

use std::path::Path;

use super::{Failure, Report, WindowError, binding::bind, limits, outputs::check_places, report::counted};
use crate::{
    algo::weights::WeightSettings,
    files::{ReadError, RealDisk, new_template_text, read_capped, save_atomic},
    mesh::{
        gltf::{GltfWriteSettings, write_glb},
        obj::{ObjSettings, read_model},
    },
    plugins::gesture::read_gestures,
};

const MESH: &[u8] = include_bytes!("../../assets/models/biped.obj");
const GESTURES: &[u8] = include_bytes!("../../assets/gestures/biped.ron");

/// Files that are written into the working folder: the template and the character.
const OUTPUTS: [&str; 2] = ["biped.rig.ron", "biped.glb"];

/// Runs the workflow without a window; `reason` is the reason why no window opens.
pub(super) fn run(reason: Option<&WindowError>) -> Result<Report, Failure> {
    let mut report = Report::default();
    if let Some(reason) = reason {
        report.line(format!("No window: {reason}. Doing the job without one."));
    }
    let [rig_file, character_file] = OUTPUTS.map(Path::new);
    let (former_rig, former_character) = (content(rig_file)?, content(character_file)?);
    let missing = [(rig_file, &former_rig), (character_file, &former_character)];
    check_places(missing.into_iter().filter(|(_, former)| former.is_none()).map(|(path, _)| path))?;
    report.line("Rigging the bundled character; give a command to rig yours (see below).");
    let model = read_model(MESH, "biped", &ObjSettings::default(), &mut |_| None)
        .map_err(|error| Failure::Input(Box::new(error)))?;
    let faces = model.face_count();
    let gestures = read_gestures(GESTURES).map_err(|error| Failure::Input(Box::new(error)))?;
    let strokes = gestures.len();
    let mut bench = limits::empty_workbench("biped");
    bench.open(model, false)?;
    for answer in bench.gestures(gestures).iter().filter(|answer| !answer.done) {
        report.notes.push(format!("gesture {} ({}): {}", answer.number, answer.gesture, answer.message));
    }
    report.line(format!(
        "sketched {} with {} into {}",
        counted(bench.rig().len(), "joint", "joints"),
        counted(strokes, "gesture", "gestures"),
        counted(faces, "face", "faces")
    ));
    let template = new_template_text(bench.rig());
    save_new(rig_file, former_rig, template.as_bytes(), "the template", &mut report)?;
    bind(&mut bench, WeightSettings::default(), &[], Vec::new(), &mut report)?;
    let glb = write_glb(&bench.character(), &GltfWriteSettings::default());
    let glb = glb.map_err(|error| Failure::Input(Box::new(error)))?;
    if save_new(character_file, former_character, &glb, "the character", &mut report)? {
        report.line("drop it into any glTF viewer, Blender or a Bevy game");
    }
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

/// Content of a file under a default name; `None` if there is none.
fn content(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    match read_capped(&RealDisk, path, 1 << 30) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(ReadError::Missing { .. }) => Ok(None),
        Err(error) => Err(Failure::Input(Box::new(error))),
    }
}

/// Writes a file under a default name, unless a file of that name with other content, `former`, exists. Returns true if the
/// file now has this content.
fn save_new(
    path: &Path,
    former: Option<Vec<u8>>,
    bytes: &[u8],
    what: &str,
    report: &mut Report,
) -> Result<bool, Failure> {
    let name = path.display();
    match former {
        Some(former) if former != bytes => {
            report.notes.push(format!("kept the {name} that is there, which differs"));
            return Ok(false);
        }
        Some(_) => report.line(format!("{name} is there already")),
        None => {
            save_atomic(&RealDisk, path, bytes)?;
            report.line(format!("wrote {what} {name}"));
        }
    }
    Ok(true)
}
