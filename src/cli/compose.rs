//! `rigsmith merge`, `inject` and `extract`: rigs made of others.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{
    Failure, InPlaceArgs, Report, SEED, limits,
    report::counted,
    update::{load, load_part, load_with_parts},
};
use crate::{
    files::{RealDisk, stem, store_rig, store_rig_over},
    rig::{
        Rig, RigAbout, RigEdit, Uid, UidSource,
        extract::{self, Extraction},
        nearest::{did_you_mean, listed},
        operations::{Axis, Operation, TagOperation},
        part::check_unoccupied,
    },
};

/// Arguments of `rigsmith merge`.
#[derive(Args, Debug)]
pub(super) struct MergeArgs {
    /// The rigs, `.rig.ron`: all others come into the first
    #[arg(required = true, num_args = 2..)]
    pub rigs: Vec<PathBuf>,
    /// Joint on which the roots of the other rigs hang; without it they stay roots. FILE:LABEL sets the joint for the rig of
    /// one file alone, and may be repeated. The joint is one of the first rig or of a rig that comes before
    #[arg(long, value_name = "[FILE:]LABEL")]
    parent: Vec<String>,
    /// The file to write, `.rig.ron`
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

/// Arguments of `rigsmith inject`.
#[derive(Args, Debug)]
pub(super) struct InjectArgs {
    /// The template, such as a part
    template: PathBuf,
    /// The rig
    pub rig: PathBuf,
    /// Labels or uids of the joints, in the order in which they take the template's tags
    #[arg(long, value_delimiter = ',', required = true, value_name = "LABEL,...")]
    joints: Vec<String>,
    /// Turn these joints first, so that this axis points along their bones
    #[arg(long, value_enum, value_name = "AXIS")]
    orient: Option<AxisArg>,
    /// The file to write, `.rig.ron`
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

/// Axis of a joint.
#[derive(ValueEnum, Debug, Clone, Copy)]
enum AxisArg {
    /// The X axis, as in Maya and Unreal
    X,
    /// The Y axis, as in Blender
    Y,
    /// The Z axis
    Z,
}

/// Kind of what is extracted.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum ExtractKind {
    /// A rig of its own
    Template,
    /// A part, which says what it needs
    Part,
}

/// Arguments of `rigsmith extract`.
#[derive(Args, Debug)]
pub(super) struct ExtractArgs {
    /// The rig
    pub rig: PathBuf,
    /// Labels or uids of the joints
    #[arg(long, value_delimiter = ',', required = true, value_name = "LABEL,...")]
    joints: Vec<String>,
    /// Take the joints below them, too
    #[arg(long)]
    hierarchy: bool,
    /// Give everything a new uid
    #[arg(long)]
    new_uids: bool,
    /// Kind of the new file
    #[arg(long, value_enum, default_value = "part")]
    kind: ExtractKind,
    /// Turn the joints, so that this axis points along their bones
    #[arg(long, value_enum, value_name = "AXIS")]
    orient: Option<AxisArg>,
    /// The file to write, `.rig.ron`
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

pub(super) fn merge(args: &MergeArgs) -> Result<Report, Failure> {
    let inputs: Vec<&Path> = args.rigs.iter().map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, Some(&args.output), &[])?;
    let mut report = Report::default();
    let rigs = args.rigs.iter().map(|path| load(path, &mut report)).collect::<Result<Vec<_>, _>>()?;
    let parents = parents(&args.parent, &args.rigs[1..])?;
    let (mut uids, count) = (uids_of(&rigs), rigs.len());
    let mut rigs = rigs.into_iter();
    let Some(mut rig) = rigs.next() else { return Ok(report) };
    for (other, parent) in rigs.zip(parents) {
        let parent = parent.map(|label| joint(&rig, label)).transpose()?;
        limits::check_time("merging the rigs")?;
        let merged = Operation::merge_owned(std::mem::take(&mut rig), other, parent, &mut uids);
        let (merged, notes) = merged.map_err(|error| Failure::Input(Box::new(error)))?;
        rig = merged;
        report.notes(notes);
    }
    limits::check_time("merging the rigs")?;
    let joints = counted(rig.len(), "joint", "joints");
    write(&args.output, rig, &[&args.rigs[0]], &mut report)?;
    report.line(format!("{joints} of {}", counted(count, "rig", "rigs")));
    Ok(report)
}

/// Label of the joint on which each file's roots hang.
fn parents<'a>(wanted: &'a [String], files: &[PathBuf]) -> Result<Vec<Option<&'a str>>, Failure> {
    let mut all = None;
    let mut parents = vec![None; files.len()];
    for text in wanted {
        let is_called = |file: &Path, name: &str| file == Path::new(name) || stem(file) == name;
        let of_file = text.rsplit_once(':').and_then(|(name, label)| {
            let place = files.iter().position(|file| is_called(file, name))?;
            Some((place, label))
        });
        let known = match of_file {
            Some((place, label)) => parents[place].replace(label),
            None => all.replace(text.as_str()),
        };
        if known.is_some() {
            return Err(Failure::Usage(format!(
                "`--parent {text}`: another parent is given for the same rigs; keep one"
            )));
        }
    }
    Ok(parents.into_iter().map(|parent| parent.or(all)).collect())
}

/// Turns joints so that an axis points along their bones.
fn orient(
    rig: &mut Rig,
    joints: Vec<Uid>,
    along: AxisArg,
    uids: &mut UidSource,
    report: &mut Report,
) -> Result<(), Failure> {
    let along = match along {
        AxisArg::X => Axis::X,
        AxisArg::Y => Axis::Y,
        AxisArg::Z => Axis::Z,
    };
    run(rig, &Operation::Orient { joints, along }, uids, report)
}

pub(super) fn inject(args: &InjectArgs) -> Result<Report, Failure> {
    args.in_place.check(&[&args.template, &args.rig], Some(&args.output), &[])?;
    let mut report = Report::default();
    let part = load_part(&args.template, &mut report)?;
    let (mut rig, instances) = load_with_parts(&args.rig, &mut report)?;
    let joints = args.joints.iter().map(|label| joint(&rig, label)).collect::<Result<Vec<_>, _>>()?;
    if part.rig.about().kind == "part" {
        check_unoccupied(&rig, &instances, &part, &joints).map_err(|occupied| Failure::Input(Box::new(occupied)))?;
    }
    let mut uids = uids_of([&rig, &part.rig]);
    if let Some(along) = args.orient {
        orient(&mut rig, joints.clone(), along, &mut uids, &mut report)?;
    }
    let count = |rig: &Rig| rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>();
    let before = count(&rig);
    let size = part.sized_for(joints.len()).map_or(part.rig.len(), |sized| sized.len());
    let left = (size.saturating_sub(joints.len()), joints.len().saturating_sub(size));
    let operation = Operation::Tags(TagOperation::Drop { part: Arc::new(part), joints, bindings: Default::default() });
    limits::check_time("injecting the template")?;
    run(&mut rig, &operation, &mut uids, &mut report)?;
    limits::check_time("injecting the template")?;
    drop(operation);
    let tags = count(&rig) - before;
    write(&args.output, rig, &[&args.rig], &mut report)?;
    report.line(format!("{} injected", counted(tags, "tag", "tags")));
    report.set("tags", tags);
    report.set("joints_left", json!({ "template": left.0, "rig": left.1 }));
    Ok(report)
}

pub(super) fn extract(args: &ExtractArgs) -> Result<Report, Failure> {
    args.in_place.check(&[&args.rig], Some(&args.output), &[])?;
    let mut report = Report::default();
    let rig = load(&args.rig, &mut report)?;
    let mut joints = args.joints.iter().map(|label| joint(&rig, label)).collect::<Result<Vec<_>, _>>()?;
    if args.hierarchy {
        joints = joints.iter().flat_map(|top| rig.hierarchy(*top).map(|joint| joint.data.uid)).collect();
    }
    limits::check_time("extracting the joints")?;
    let mut uids = uids_of([&rig]);
    let name = stem(&args.output);
    let extracted = extract::extract(&rig, &joints, &name, args.new_uids.then_some(&mut uids));
    let Extraction { rig: mut out, left } = extracted.map_err(|error| Failure::Input(Box::new(error)))?;
    if args.kind == ExtractKind::Template {
        let about = RigAbout { kind: "template".to_owned(), ..out.about().clone() };
        out.apply(&RigEdit::SetAbout(Box::new(about))).map_err(|error| Failure::Input(Box::new(error)))?;
    }
    if let Some(along) = args.orient {
        let joints = out.walk().map(|joint| joint.data.uid).collect();
        orient(&mut out, joints, along, &mut uids, &mut report)?;
    }
    limits::check_time("extracting the joints")?;
    report.notes(store_rig(&RealDisk, &args.output, &out)?);
    report.notes.extend(left.iter().cloned());
    report.line(format!("wrote {}: {}", args.output.display(), counted(out.len(), "joint", "joints")));
    report.set("output", args.output.display().to_string());
    report.set("joints", out.len());
    report.set("left", Value::from(left));
    Ok(report)
}

/// Carries out an operation on a rig, which is empty after a refusal.
fn run(rig: &mut Rig, operation: &Operation, uids: &mut UidSource, report: &mut Report) -> Result<(), Failure> {
    let changed = operation.run_on(std::mem::take(rig), uids).map_err(|error| Failure::Input(Box::new(error)))?;
    *rig = changed.0;
    report.notes(changed.1);
    Ok(())
}

fn write(output: &Path, rig: Rig, sources: &[&Path], report: &mut Report) -> Result<(), Failure> {
    let joints = rig.len();
    report.notes(store_rig_over(&RealDisk, output, rig, sources)?);
    report.line(format!("wrote {}", output.display()));
    report.set("output", output.display().to_string());
    report.set("joints", joints);
    Ok(())
}

/// A source of uids that follows from the rigs: the same for the same.
fn uids_of<'r>(rigs: impl IntoIterator<Item = &'r Rig>) -> UidSource {
    let all = rigs.into_iter().flat_map(|rig| std::iter::once(rig.uid()).chain(rig.walk().map(|joint| joint.data.uid)));
    UidSource::seeded(all.fold(SEED, |seed, uid| seed.rotate_left(1) ^ uid.0))
}

/// The joint with a label, or with a uid.
fn joint(rig: &Rig, wanted: &str) -> Result<Uid, Failure> {
    if let Some(uid) = wanted.parse::<Uid>().ok().filter(|uid| rig.joint(*uid).is_some()) {
        return Ok(uid);
    }
    let labelled = rig.walk().filter(|joint| joint.data.label.as_deref() == Some(wanted));
    let found: Vec<Uid> = labelled.map(|joint| joint.data.uid).collect();
    match found[..] {
        [uid] => Ok(uid),
        [] => {
            let labels = rig.walk().filter_map(|joint| joint.data.label.as_deref());
            let name = &rig.about().name;
            Err(Failure::Input(
                format!("no joint of \"{name}\" is called \"{wanted}\"{}", did_you_mean(wanted, labels)).into(),
            ))
        }
        _ => {
            let uids: Vec<String> = found.iter().map(Uid::to_string).collect();
            let count = uids.len();
            let all = listed(&uids, "or");
            Err(Failure::Input(format!("{count} joints are called \"{wanted}\"; give the uid of one, {all}").into()))
        }
    }
}
