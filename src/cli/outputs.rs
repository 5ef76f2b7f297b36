//! Outputs of a command: checked against its inputs before the command does anything.

use std::path::Path;

use clap::Args;

use super::Failure;
use crate::files::{FileKind, RealDisk, check_place, is_same_file};

/// The permission to write over an input.
#[derive(Args, Debug, Clone, Copy, Default)]
pub(super) struct InPlaceArgs {
    /// Let the output replace an input of the same kind; without this no input is ever written to
    #[arg(long)]
    in_place: bool,
}

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

/// Checks whether files can be written at paths, before a command works for minutes or writes the first of its outputs.
pub(super) fn check_places<'p>(paths: impl IntoIterator<Item = &'p Path>) -> Result<(), Failure> {
    paths.into_iter().try_for_each(|path| Ok(check_place(&RealDisk, path)?))
}
