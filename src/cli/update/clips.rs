//! Clips of a rig in an update to a new version of its template.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use serde_json::{Value, json};

use super::{UpdateArgs, limits};
use crate::{
    cli::{Failure, Report, report::counted},
    files::{FileKind, RealDisk, StagedFile, is_same_file, load_animation, stage_animation},
    plugins::commands::NamedProgramError,
    processor::{BuildError, Builder, Modules, RigVersion, clips_between},
    rig::{
        BuiltRig, Rig,
        animation::{NodeNames, RigClip},
    },
    solve::program::{CompileOptions, RigProgram},
};

/// Reason for which clips cannot be re-expressed.
#[derive(Debug, thiserror::Error)]
enum ClipUpdateError {
    /// A command fails.
    #[error(
        "the clips cannot be re-expressed, because the rig of `{file}` cannot be built: {source}; mend that, or leave --clips out"
    )]
    NotBuilt {
        /// The rig, or the template.
        file: String,
        /// The reason.
        source: BuildError,
    },
    /// The built rig cannot run.
    #[error(
        "the clips cannot be re-expressed, because the rig of `{file}` cannot run: {source}; mend that, or leave --clips out"
    )]
    CannotRun {
        /// The rig, or the template.
        file: String,
        /// The reason.
        source: NamedProgramError,
    },
}

impl From<ClipUpdateError> for Failure {
    fn from(error: ClipUpdateError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// Clips for the new version, and the file that they are written to.
pub(super) struct UpdatedFile<'a> {
    output: &'a Path,
    rig: Arc<(Rig, BuiltRig)>,
    clips: Vec<RigClip>,
}

/// Files that the clips are written to: one for each file of clips, none without an output.
pub(super) fn outputs(args: &UpdateArgs, inputs: &[&Path]) -> Result<Vec<PathBuf>, Failure> {
    if let Some(path) = args.clips.iter().find(|path| FileKind::of(path) != Some(FileKind::Animation)) {
        return Err(Failure::Usage(format!(
            "--clips `{}`: that is no file of clips; give a .anim.ron",
            path.display()
        )));
    }
    let Some(output) = &args.output else { return Ok(Vec::new()) };
    let inputs: Vec<&Path> = inputs.iter().copied().chain(args.clips.iter().map(PathBuf::as_path)).collect();
    let beside = |clip: &PathBuf| output.with_file_name(clip.file_name().unwrap_or_default());
    let outputs: Vec<PathBuf> = args.clips.iter().map(beside).collect();
    for (number, path) in outputs.iter().enumerate() {
        args.in_place.check_names(&inputs, Some(path.as_path()), &[])?;
        if outputs[..number].iter().any(|other| is_same_file(&RealDisk, other, path)) {
            let fault = "two files of clips have that name, and would be written to one; rename one of them";
            return Err(Failure::Usage(format!("--clips `{}`: {fault}", path.display())));
        }
    }
    Ok(outputs)
}

/// Re-expresses the clips for the updated rig, and tells what they could not keep.
pub(super) fn updated<'a>(
    args: &UpdateArgs,
    (now, next): (&Rig, &Rig),
    outputs: &'a [PathBuf],
    report: &mut Report,
) -> Result<Vec<UpdatedFile<'a>>, Failure> {
    if args.clips.is_empty() {
        return Ok(Vec::new());
    }
    let modules = Arc::new(limits::modules());
    let (was, from) = built(now, &args.rig, &modules)?;
    let (is, to) = built(next, &args.from, &modules)?;
    let (from, to) =
        (RigVersion { rig: now, built: &was, program: &from }, RigVersion { rig: next, built: &is, program: &to });
    let (known, there) = (NodeNames::of(now, Some(&was)), NodeNames::of(next, Some(&is)));
    let rig = Arc::new((next.clone(), is.clone()));
    let (mut files, mut facts) = (Vec::new(), Vec::new());
    for (number, path) in args.clips.iter().enumerate() {
        limits::check_time("re-expressing the clips")?;
        let read = load_animation(&RealDisk, path)?;
        report.notes(read.notes.iter().cloned());
        let bound = read.onto(now, Some(&was));
        let missing = bound.missing_labels();
        if !missing.is_empty() {
            let count = counted(missing.len(), "node", "nodes");
            report.notes.push(format!(
                "`{}` has keys of {count} that the rig does not have, which stay as they are: {}",
                path.display(),
                missing.join(", ")
            ));
        }
        let mut kept = clips_between(&bound.clips, from, to);
        for line in &kept.report.notes {
            report.line(format!("moves    {line}"));
        }
        for line in &kept.report.set_aside {
            report.line(format!("aside    {line}"));
        }
        let changed = kept.clips.iter().zip(&bound.clips).filter(|(kept, was)| kept != was).count();
        report.line(format!("clips    {} of `{}` re-expressed", counted(changed, "clip", "clips"), path.display()));
        facts.push(json!({
            "file": path.display().to_string(),
            "clips": kept.clips.len(),
            "re_expressed": changed,
            "notes": serde_json::to_value(&kept.report.notes).unwrap_or(Value::Null),
            "set_aside": serde_json::to_value(&kept.report.set_aside).unwrap_or(Value::Null),
            "missing": missing,
        }));
        // The labels of nodes that are gone stay beside their keys, so that other nodes can be found by them.
        for clip in &mut kept.clips {
            let gone = clip.nodes().into_iter().filter(|node| !there.0.contains_key(node));
            let named = gone.filter_map(|node| Some((node, known.0.get(&node)?.clone())));
            let names = NodeNames(named.collect());
            clip.names.extend(&names);
        }
        if let Some(output) = outputs.get(number) {
            files.push(UpdatedFile { output, rig: rig.clone(), clips: kept.clips });
        }
    }
    report.set("clips", facts);
    Ok(files)
}

/// Writes the clips beside their places, where they wait for the rig.
pub(super) fn stage(files: &[UpdatedFile<'_>]) -> Result<Vec<StagedFile<'static>>, Failure> {
    let stage = |file: &UpdatedFile<'_>| {
        let (rig, built) = &*file.rig;
        stage_animation(&RealDisk, file.output, rig, Some(built), &file.clips).map_err(Failure::from)
    };
    files.iter().map(stage).collect()
}

/// Puts the clips in their places.
pub(super) fn store(staged: Vec<StagedFile<'static>>, report: &mut Report) -> Result<(), Failure> {
    for file in staged {
        let line = format!("wrote {}", file.path().display());
        file.put_in_place()?;
        report.line(line);
    }
    Ok(())
}

/// A rig as its commands build it, and the program with all of its nodes.
fn built(rig: &Rig, file: &Path, modules: &Arc<Modules>) -> Result<(BuiltRig, Arc<RigProgram>), ClipUpdateError> {
    let file = || file.display().to_string();
    let built = Builder::build(rig, modules).map_err(|source| ClipUpdateError::NotBuilt { file: file(), source })?;
    let program = RigProgram::compile(&built, &CompileOptions::default())
        .map_err(|error| NamedProgramError::new(error, rig))
        .map_err(|source| ClipUpdateError::CannotRun { file: file(), source })?;
    Ok((built, Arc::new(program)))
}
