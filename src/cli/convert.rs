//! `rigsmith convert`: from one format to another.

use std::path::PathBuf;

use clap::Args;

use super::{ExportArgs, Failure, InPlaceArgs, Output, Report, SEED, limits, progress::spinning, skin::load_rig};
use crate::{
    files::{FileKind, RealDisk, stem, store_owned_model, store_rig, store_rig_over},
    mesh::{gltf::GltfWriteSettings, model::Model},
    rig::{
        Rig, UidSource,
        character::{Character, character, import_skeleton, mark_joints},
    },
};

/// Commands that give a mesh a skeleton.
const SKELETON_MAKERS: &str = "`rigsmith fit` puts one into it, `rigsmith sketch` draws one";

/// Arguments of `rigsmith convert`.
#[derive(Args, Debug)]
pub(super) struct ConvertArgs {
    /// The file to read
    pub input: PathBuf,
    /// The file to write
    output: Output,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn run(args: &ConvertArgs) -> Result<Report, Failure> {
    use FileKind::{Glb, Gltf, Obj, RigText, Template, Vrm};
    args.in_place.check(&[&args.input], Some(&args.output), &[])?;
    let (from, to) = (FileKind::of(&args.input), FileKind::of(&args.output));
    let mut report = Report::default();
    let notes = match (from, to) {
        (Some(Obj | Gltf | Glb | Vrm), Some(Obj | Gltf | Glb)) => {
            let model = spinning("reading", || limits::load_model(&args.input))?;
            report.notes(model.notes.iter().cloned());
            limits::check_time("converting the file")?;
            // Points without weights in the input stay unmoved in the only way that glTF offers: bound to the root.
            let settings = GltfWriteSettings { bind_unweighted: true, ..args.export.settings() };
            spinning("writing", || store_owned_model(&RealDisk, &args.output, model, &settings))?
        }
        (Some(Gltf | Glb | Vrm), Some(RigText | Template)) => {
            let model = limits::load_model(&args.input)?;
            if model.nodes.is_empty() {
                let message = format!("`{}` has no skeleton to convert; {SKELETON_MAKERS}", args.input.display());
                return Err(Failure::Input(message.into()));
            }
            let mut uids = UidSource::seeded(SEED);
            let mut rig = Rig::new(uids.next_uid(), stem(&args.input));
            for edit in &import_skeleton(&model, &mut uids).edits {
                rig.apply(edit).map_err(|error| Failure::Input(Box::new(error)))?;
            }
            limits::check_time("converting the file")?;
            store_rig(&RealDisk, &args.output, rig)?
        }
        (Some(RigText | Template), Some(RigText | Template)) => {
            let rig = load_rig(&args.input, &mut report)?;
            limits::check_time("converting the file")?;
            store_rig_over(&RealDisk, &args.output, rig, &[&args.input])?
        }
        (Some(RigText | Template), Some(Gltf | Glb)) => {
            let rig = load_rig(&args.input, &mut report)?;
            let settings = GltfWriteSettings { all_joints: true, ..args.export.settings() };
            let mut model = skeleton_model(&rig);
            mark_joints(&mut model, &rig);
            drop(rig);
            limits::check_time("converting the file")?;
            store_owned_model(&RealDisk, &args.output, model, &settings)?
        }
        (Some(Obj), Some(RigText | Template)) => {
            return Err(Failure::Usage(format!(
                "cannot make `{}` of `{}`, because an .obj has no skeleton; {SKELETON_MAKERS}",
                args.output.display(),
                args.input.display()
            )));
        }
        (_, Some(Vrm)) => {
            return Err(Failure::Usage(format!(
                "cannot make `{}` of `{}`; a .vrm is written by build, animate, fit and face, which know the rig",
                args.output.display(),
                args.input.display()
            )));
        }
        _ => {
            return Err(Failure::Usage(format!(
                "cannot make `{}` of `{}`; meshes (.obj, .gltf, .glb, .vrm) become .obj, .gltf and .glb, rigs (.rig, \
                 .rig.ron) and skeletons of .gltf, .glb and .vrm become rigs, rigs become .gltf and .glb",
                args.output.display(),
                args.input.display()
            )));
        }
    };
    report.notes(notes);
    report.line(format!("wrote {}", args.output.display()));
    report.set("output", args.output.display().to_string());
    Ok(report)
}

/// A model of a rig without a mesh.
pub(super) fn skeleton_model(rig: &Rig) -> Model {
    let empty = Model { name: rig.about().name.clone(), ..Model::default() };
    character(&Character { rig, built: None, file: &empty, rest: &empty, nodes: &[], skin: None })
}
