//! `rigsmith diff` and `rigsmith update`: what differs between versions of a template, and how a rig gets the new one.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{Failure, InPlaceArgs, Report};
use crate::{
    files::{FileKind, RealDisk, load_template, store_rig_over},
    rig::{
        Rig,
        update::{Change, ChangeKind, Take, diff, update},
    },
};

/// Arguments of `rigsmith diff`.
#[derive(Args, Debug)]
pub(super) struct DiffArgs {
    /// The one template, `.rig.ron`
    from: PathBuf,
    /// The other one
    to: PathBuf,
}

/// Arguments of `rigsmith update`.
#[derive(Args, Debug)]
pub(super) struct UpdateArgs {
    /// The rig, `.rig.ron`
    rig: PathBuf,
    /// The template in its new version
    #[arg(long)]
    from: PathBuf,
    /// The template in the version that the rig was made from; without it every difference is a conflict
    #[arg(long)]
    base: Option<PathBuf>,
    /// Say what would change, and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Side whose value is taken where both changed a field
    #[arg(long, value_enum)]
    take: Option<TakeArg>,
    /// The file to write, `.rig.ron`
    #[arg(short, long, required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum TakeArg {
    /// The new version's
    Theirs,
    /// The rig's
    Mine,
}

pub(super) fn run_diff(args: &DiffArgs) -> Result<Report, Failure> {
    let mut report = Report::default();
    let (from, to) = (load(&args.from, &mut report)?, load(&args.to, &mut report)?);
    tell(&mut report, &diff(&from, &to));
    Ok(report)
}

pub(super) fn run_update(args: &UpdateArgs) -> Result<Report, Failure> {
    let inputs: Vec<&Path> =
        [Some(&args.rig), Some(&args.from), args.base.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, args.output.as_deref(), &[])?;
    let mut report = Report::default();
    let (now, file) = (load(&args.rig, &mut report)?, load(&args.from, &mut report)?);
    let base = args.base.as_deref().map(|base| load(base, &mut report)).transpose()?;
    let take = match args.take {
        Some(TakeArg::Theirs) => Take::Theirs,
        Some(TakeArg::Mine) | None => Take::Mine,
    };
    let updated = update(base.as_ref(), &now, &file, take);
    tell(&mut report, &updated.changes);
    let conflicts = updated.conflicts();
    report.set("conflicts", conflicts);
    if conflicts > 0 && args.take.is_none() {
        report.notes.push(format!(
            "both sides changed {conflicts} {}: say --take theirs or --take mine; nothing was written",
            if conflicts == 1 { "field" } else { "fields" }
        ));
        report.at_fault = true;
        return Ok(report);
    }
    if let Some(output) = args.output.as_ref().filter(|_| !args.dry_run) {
        report.notes(store_rig_over(&RealDisk, output, &updated.rig, &[&args.rig])?);
        report.line(format!("wrote {}", output.display()));
    }
    Ok(report)
}

pub(super) fn load(path: &Path, report: &mut Report) -> Result<Rig, Failure> {
    if FileKind::of(path) != Some(FileKind::Template) {
        return Err(Failure::Usage(format!("`{}` is no template; give a .rig.ron", path.display())));
    }
    let template = load_template(&RealDisk, path)?;
    report.notes(template.notes);
    Ok(template.rig)
}

fn tell(report: &mut Report, changes: &[Change]) {
    for change in changes {
        report.line(told(change));
    }
    if changes.is_empty() {
        report.line("no differences");
    }
    let list: Vec<Value> = changes.iter().map(|change| serde_json::to_value(change).unwrap_or(Value::Null)).collect();
    report.set("changes", json!(list));
}

/// A change in a line.
fn told(change: &Change) -> String {
    let place = [change.joint.as_deref(), change.tag.as_deref()].into_iter().flatten().collect::<Vec<_>>().join(" ");
    let field = change.field.as_deref().unwrap_or_default();
    let what = [place.as_str(), field].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
    let value = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
    let (from, to) = (value(&change.from), value(&change.to));
    match (change.kind, change.conflict) {
        (ChangeKind::Added, false) => format!("added    {what}"),
        (ChangeKind::Added, true) => format!("conflict {what}: deleted here, changed there"),
        (ChangeKind::Removed, false) => format!("removed  {what}"),
        (ChangeKind::Removed, true) => format!("conflict {what}: changed here, deleted there"),
        (ChangeKind::Changed, false) => format!("changed  {what}: {from} to {to}"),
        (ChangeKind::Changed, true) => format!("conflict {what}: {from} here, {to} there"),
        (ChangeKind::Renamed, _) => format!("renamed  {from} to {to}?"),
    }
}
