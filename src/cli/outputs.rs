//! Outputs of a command: checked against its inputs before the command does anything, and against the files that the inputs name
//! once these are read.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use clap::Args;

use super::Failure;
use crate::{
    files::{Disk, FileKind, PartFiles, RealDisk, check_place, is_same_file, read_capped},
    rig::template,
};

/// The permission to write over an input.
#[derive(Args, Debug, Clone, Copy, Default)]
pub(super) struct InPlaceArgs {
    /// Let the output replace an input of the same kind; without this no input is ever written to
    #[arg(long)]
    in_place: bool,
}

/// Outputs of this command that were checked, each with the permission to replace an input of its kind.
static CHECKED: Mutex<Vec<(PathBuf, bool)>> = Mutex::new(Vec::new());

impl InPlaceArgs {
    /// Checks that `output` is no input, unless replacing it was allowed, that each of the `further` outputs, with the
    /// options that name them, is neither an input nor another output, and that all of them can be written.
    pub fn check(
        self,
        inputs: &[&Path],
        output: Option<&Path>,
        further: &[(&'static str, &Path)],
    ) -> Result<(), Failure> {
        self.check_names(inputs, output, further)?;
        check_places(output.into_iter().chain(further.iter().map(|(_, path)| *path)))
    }

    /// Checks outputs as [`check`](Self::check) does, but for whether they can be written.
    pub fn check_names(
        self,
        inputs: &[&Path],
        output: Option<&Path>,
        further: &[(&'static str, &Path)],
    ) -> Result<(), Failure> {
        let named = output.into_iter().map(|path| (path.to_owned(), self.in_place));
        let named = named.chain(further.iter().map(|(_, path)| (path.to_path_buf(), false)));
        CHECKED.lock().unwrap_or_else(PoisonError::into_inner).extend(named);
        let is_same = |a: &Path, b: &Path| is_same_file(&RealDisk, a, b);
        for input in inputs {
            let Some(output) = output.filter(|output| is_same(input, output)) else { continue };
            if !self.in_place {
                return Err(Failure::Usage(format!(
                    "`{}` is an input and would be replaced; give another output, or --in-place where there is that option",
                    output.display()
                )));
            }
            if FileKind::of(input) != FileKind::of(output) {
                return Err(Failure::Usage(format!(
                    "`{}` is an input, and --in-place replaces only files of the same kind; give another output",
                    output.display()
                )));
            }
        }
        if let Some(output) = output.filter(|_| !self.in_place)
            && let Some(input) = inputs.iter().find(|input| has_part(input, output))
        {
            return Err(Failure::Usage(format!(
                "`{}` is a part of the input `{}` and would be replaced; give another output, or --in-place where there is \
                 that option",
                output.display(),
                input.display()
            )));
        }
        for (number, (option, path)) in further.iter().enumerate() {
            let earlier = further[..number].iter().map(|(_, path)| *path);
            let mut taken = inputs.iter().copied().chain(output).chain(earlier);
            if taken.any(|other| is_same(other, path)) {
                return Err(Failure::Usage(format!(
                    "{option} `{}`: that file is an input or another output; give it a name of its own",
                    path.display()
                )));
            }
        }
        Ok(())
    }
}

/// Checks that no output of this command is one of the files that an input names, of which those were read: buffers, materials,
/// pictures, parts, weights.
pub(super) fn check_named_files(input: &Path, read: &BTreeSet<PathBuf>) -> Result<(), Failure> {
    let outputs = CHECKED.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let is_there = |path: &Path| RealDisk.entry(path, true).is_ok();
    for (output, in_place) in outputs.iter().filter(|(output, _)| is_there(output)) {
        let is_same = |other: &Path| is_same_file(&RealDisk, other, output);
        // Whether the input itself may be replaced was asked before. Of what it names only parts are of a kind that a command
        // writes whole: a buffer may be called like a model, and is none.
        let may_replace = |file: &Path| *in_place && FileKind::of(file) == Some(FileKind::Template);
        if is_same(input) || !read.iter().any(|file| is_there(file) && is_same(file) && !may_replace(file)) {
            continue;
        }
        return Err(Failure::Usage(format!(
            "`{}` is an input, which `{}` names, and would be replaced; give another output",
            output.display(),
            input.display()
        )));
    }
    Ok(())
}

/// True if the template in the file `input` takes a part from the file `output`, which is as much of an input.
fn has_part(input: &Path, output: &Path) -> bool {
    let is_template = |path: &Path| FileKind::of(path) == Some(FileKind::Template);
    // Where nothing is replaced, the template does not have to be read.
    if !is_template(input) || !is_template(output) || RealDisk.entry(output, true).is_err() {
        return false;
    }
    let Ok(bytes) = read_capped(&RealDisk, input, template::MAX_BYTES as u64) else { return false };
    let mut parts = PartFiles::new(&RealDisk);
    // Faults of the template are told where the command reads it.
    let _ = parts.complete(input, &bytes);
    parts.asked.keys().any(|part| is_same_file(&RealDisk, part, output))
}

/// Checks whether files can be written at paths, before a command works for minutes or writes the first of its outputs.
pub(super) fn check_places<'p>(paths: impl IntoIterator<Item = &'p Path>) -> Result<(), Failure> {
    paths.into_iter().try_for_each(|path| Ok(check_place(&RealDisk, path)?))
}
