//! `rigsmith new`: templates to start from.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{Failure, Report};
use crate::files::{Disk, FileKind, RealDisk, save_atomic};

/// Arguments of `rigsmith new`.
#[derive(Args, Debug)]
pub(super) struct NewArgs {
    /// Kind of template
    #[arg(value_enum)]
    kind: KindArg,
    /// The file to write, `.rig.ron`; one that is there stays
    #[arg(short, long)]
    pub output: PathBuf,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum KindArg {
    /// A chain of joints with a control each
    Chain,
    /// An arm with forward and inverse kinematics, pole, stretch and twist
    Limb,
    /// Joints in pairs, left and right, in groups, with limits
    Sides,
    /// A figure of parts: a trunk of its own, with arms, legs and a neck that come with Rigsmith
    Figure,
    /// A part of its own, for figures: a finger with a number of joints, an option and a place where others hang
    Part,
}

pub(super) fn run(args: &NewArgs) -> Result<Report, Failure> {
    let text = match args.kind {
        KindArg::Chain => include_str!("../../assets/start/chain.rig.ron"),
        KindArg::Limb => include_str!("../../assets/start/limb.rig.ron"),
        KindArg::Sides => include_str!("../../assets/start/sides.rig.ron"),
        KindArg::Figure => include_str!("../../assets/start/figure.rig.ron"),
        KindArg::Part => include_str!("../../assets/start/part.rig.ron"),
    };
    let path = &args.output;
    if FileKind::of(path) != Some(FileKind::Template) {
        return Err(Failure::Usage(format!("`{}` is no template; give a .rig.ron", path.display())));
    }
    if RealDisk.entry(path, true).is_ok() {
        return Err(Failure::Usage(format!("`{}` is there already; give another name", path.display())));
    }
    save_atomic(&RealDisk, path, text.as_bytes()).map_err(|error| Failure::Input(Box::new(error)))?;
    let mut report = Report::default();
    report.line(format!(
        "wrote {}; `rigsmith check` tells whether it is right, `rigsmith build` builds it",
        path.display()
    ));
    Ok(report)
}
