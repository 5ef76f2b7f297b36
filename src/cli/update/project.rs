//! Rigs of projects: what a project keeps of a rig, its poses, clips and weights, goes with it to the new version.

use std::{path::Path, sync::Arc};

use serde_json::{Value, json};

use super::{UpdateArgs, clips, limits, tell_update, version};
use crate::{
    cli::{Failure, Report, report::counted},
    files::{
        DocumentBase, DocumentUpdate, FileKind, LoadedMesh, LoadedProject, MeshShape, MeshState, MeshToSave,
        ProjectTemplate, ProjectToSave, RealDisk, TemplateBase, TemplateVersion, is_same_file, store_project,
        update_document, update_with_known_parts,
    },
    processor::{BuildError, Builder, keep_clips},
    rig::{
        EditError, Rig,
        animation::NodeNames,
        update::{Choices, clip_edits, edits_between, pose_edits, update_with, with_identities},
    },
};

pub(super) fn run(args: &UpdateArgs) -> Result<Report, Failure> {
    if let Some(output) = args.output.as_ref().filter(|output| FileKind::of(output) != Some(FileKind::Project)) {
        let (rig, output) = (args.rig.display(), output.display());
        return Err(Failure::Usage(format!("`{rig}` is a project, and `{output}` is none; give a .rigsmith.ron")));
    }
    let inputs = args.inputs();
    args.in_place.check_names(&inputs, args.output.as_deref(), &[])?;
    let clip_files = clips::outputs(args, &inputs)?;
    args.check_places(&clip_files)?;
    let mut report = Report::default();
    let mut project = limits::load_project(&args.rig)?;
    report.notes(std::mem::take(&mut project.notes));
    let file = version(&args.from, &mut report)?;
    let number = number_of_rig(&project, &args.from);
    let Some(now) = project.rigs.get(number).cloned() else {
        return Err(Failure::Input(format!("`{}` has no rig to update", args.rig.display()).into()));
    };
    for other in project.rigs.iter().filter(|rig| rig.uid() != now.uid()) {
        report.notes.push(format!("the rig \"{}\" of the project stays as it is", other.about().name));
    }
    let given = args.base.as_ref().map(|base| version(base, &mut report)).transpose()?;
    let known = project.templates.iter().position(|template| template.rig == now.uid());
    let of_project = known.map(|at| project.templates[at].clone());
    let kept = of_project.as_ref().map(|template| &*template.base.rig);
    let base: Option<&Rig> = given.as_ref().map(TemplateVersion::rig).or(kept);
    let source = args.base.as_ref().or(known.map(|_| &args.rig));
    report.set("base", source.map(|path| path.display().to_string()));
    let choices: Choices = args.side().into();
    limits::check_time("updating the rig")?;
    let of_parts = match (&given, &of_project) {
        // A base that is known with its parts tells their fields.
        (Some(base), _) => update_document(&RealDisk, base, &now, &file, &choices),
        (None, Some(template)) => update_from_kept(template, &now, &file, &choices),
        (None, None) => None,
    };
    let (mut updated, taken_over) = match of_parts {
        Some(DocumentUpdate { update, base }) => (update, Some(base)),
        None => (update_with(base, &now, file.rig(), &choices), None),
    };
    tell_update(&mut report, (base.unwrap_or(&now), file.rig()), &now, &mut updated)?;
    re_express(args, &now, &mut updated.rig, &mut report)?;
    let clips = clips::updated(args, (&now, &updated.rig), &clip_files, &mut report)?;
    if args.is_undecided(updated.conflicts(), base.is_some(), &mut report) {
        return Ok(report);
    }
    let Some(output) = args.output.as_ref().filter(|_| !args.dry_run) else { return Ok(report) };
    limits::check_time("updating the rig")?;
    exchange(&mut project.rigs[number], &updated.rig).map_err(refused)?;
    let taken_over = taken_over.as_ref().unwrap_or(&file);
    let rig = Arc::new(with_identities(taken_over.rig(), &updated.identities));
    let base = TemplateBase { rig, text: taken_over.text_with_parts() };
    // A template that is called by its name has no file that could be followed.
    let path = Some(&args.from).filter(|from| FileKind::of(from) == Some(FileKind::Template));
    match (known, path) {
        (Some(at), path) => {
            let template = &mut project.templates[at];
            template.base = base;
            template.path = path.unwrap_or(&template.path).clone();
        }
        (None, Some(path)) if args.keep_base => {
            project.templates.push(ProjectTemplate { rig: now.uid(), path: path.clone(), base });
        }
        (None, _) => {}
    }
    let clips = clips::stage(&clips)?;
    report.notes(store_project(&RealDisk, output, &to_save(project, names_before(&now)))?);
    report.line(format!("wrote {}", output.display()));
    clips::store(clips, &mut report)?;
    Ok(report)
}

/// The update from the version that the project keeps; `None` where its part instances are those of the file.
fn update_from_kept(
    template: &ProjectTemplate,
    now: &Rig,
    file: &TemplateVersion,
    choices: &Choices,
) -> Option<DocumentUpdate> {
    let ProjectTemplate { path, base, .. } = template;
    match base.version(&RealDisk, path) {
        Some(version) => update_document(&RealDisk, &version, now, file, choices),
        None => {
            let parts = base.parts();
            let known = DocumentBase { rig: Some(&base.rig), parts: &parts };
            update_with_known_parts(&RealDisk, known, now, file, choices)
        }
    }
}

/// Number of the rig that follows the template, else of the first.
fn number_of_rig(project: &LoadedProject, from: &Path) -> usize {
    let is_followed = |template: &&ProjectTemplate| is_same_file(&RealDisk, &template.path, from);
    let follower = project.templates.iter().find(is_followed).map(|template| template.rig);
    project.rigs.iter().position(|rig| follower == Some(rig.uid())).unwrap_or(0)
}

/// Re-expresses the clips of the rig for its new version, and tells what they could not keep.
fn re_express(args: &UpdateArgs, now: &Rig, next: &mut Rig, report: &mut Report) -> Result<(), Failure> {
    if now.clips().is_empty() {
        return Ok(());
    }
    let modules = Arc::new(limits::modules());
    let built = |rig: &Rig| -> Result<(), BuildError> { Builder::build(rig, &modules).map(drop) };
    if let Err(error) = built(now).and_then(|()| built(next)) {
        let file = args.rig.display();
        report.notes.push(format!(
            "the clips stay as they are, because the rig of `{file}` cannot be built: {error}; mend that, and update again"
        ));
        return Ok(());
    }
    let kept = keep_clips(now, next, &modules).map_err(refused)?;
    for line in &kept.notes {
        report.line(format!("moves    {line}"));
    }
    for line in &kept.set_aside {
        report.line(format!("aside    {line}"));
    }
    let changed = now.clips().iter().filter(|clip| next.clip(clip.uid) != Some(*clip)).count();
    report.line(format!("clips    {} of the project re-expressed", counted(changed, "clip", "clips")));
    report.set(
        "own_clips",
        json!({
            "clips": now.clips().len(),
            "re_expressed": changed,
            "notes": serde_json::to_value(&kept.notes).unwrap_or(Value::Null),
            "set_aside": serde_json::to_value(&kept.set_aside).unwrap_or(Value::Null),
        }),
    );
    Ok(())
}

/// Makes a rig its new version, edit by edit.
fn exchange(rig: &mut Rig, next: &Rig) -> Result<(), EditError> {
    let mut edits = edits_between(rig, next)?;
    edits.extend(pose_edits(rig, next));
    edits.extend(clip_edits(rig, next)?);
    for edit in &edits {
        rig.apply(edit)?;
    }
    Ok(())
}

/// Names of the nodes that a rig had before an update: keys of those that are gone wait for others of their names.
fn names_before(rig: &Rig) -> NodeNames {
    let built = Builder::build(rig, &Arc::new(limits::modules())).ok();
    let mut names = NodeNames::default();
    for clip in rig.clips() {
        names.extend(&clip.names);
    }
    names.extend(&NodeNames::of(rig, built.as_ref()));
    names
}

fn refused(error: EditError) -> Failure {
    Failure::Input(Box::new(error))
}

/// The project as it is saved. A journal that continues from another save does not go on from this one.
fn to_save(project: LoadedProject, names: NodeNames) -> ProjectToSave {
    let LoadedProject { name, rigs, meshes, templates, view, .. } = project;
    let meshes = meshes.into_iter().map(|mesh| {
        let LoadedMesh { uid, rig, path, nodes, shape } = mesh;
        let shape = match shape {
            MeshState::Open { model, .. } => {
                MeshShape::Open { rest: Arc::new(model.at_rest()), triangles: model.point_triangles().into() }
            }
            MeshState::Missing { shape, .. } => shape,
        };
        MeshToSave { uid, rig, path, nodes, shape }
    });
    ProjectToSave { name, rigs, meshes: meshes.collect(), templates, view, journal: None, names }
}
