//! `rigsmith diff` and `rigsmith update`: what differs between versions of a template, and how a rig gets the new one.

mod clips;
mod project;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{
    Failure, InPlaceArgs, Report,
    explanation::Explanation,
    limits,
    outputs::check_places,
    report::{counted, is_json},
};
use crate::{
    files::{
        Disk, EntryKind, FileKind, ReadError, RealDisk, StoreError, TemplateVersion, base_text, diff_templates,
        read_capped, save_atomic, update_template,
    },
    processor::keep_poses,
    rig::{
        Rig,
        part::{Part, PartInstance},
        template,
        update::{Change, Take, Update},
        version::VersionChange,
    },
};

/// Arguments of `rigsmith diff`.
#[derive(Args, Debug)]
pub(super) struct DiffArgs {
    /// The template before, `.rig.ron`
    from: PathBuf,
    /// The template after
    pub to: PathBuf,
}

/// Arguments of `rigsmith update`.
#[derive(Args, Debug)]
pub(super) struct UpdateArgs {
    /// The rig, `.rig.ron`, or a project, `.rigsmith.ron`. Of a project with several rigs it is the one that was made from
    /// the template, else the first
    pub rig: PathBuf,
    /// The template in its new version
    #[arg(long)]
    from: PathBuf,
    /// The template in the version that the rig was made from. If left out, it is the file `RIG.base` beside the rig, or the
    /// version that the project took over last; where there is neither, every difference is a conflict
    #[arg(long)]
    base: Option<PathBuf>,
    /// Keep the new version of the template for the next update: as `OUT.base`, or in the project
    #[arg(long)]
    keep_base: bool,
    /// Clips of the rig, `.anim.ron`, several times if need be: they are re-expressed, so that the joints move as before, and
    /// written under their names beside OUT
    #[arg(long, value_name = "FILE")]
    clips: Vec<PathBuf>,
    /// Say what would change, and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Side whose value is taken where both changed a field
    #[arg(long, value_enum)]
    take: Option<TakeArg>,
    /// The file to write, `.rig.ron`; `.rigsmith.ron` for a project
    #[arg(short, long, required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

impl UpdateArgs {
    /// Files that are read, clips excepted.
    fn inputs(&self) -> Vec<&Path> {
        [Some(&self.rig), Some(&self.from), self.base.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect()
    }

    /// Checks whether the rig and its clips can be written, unless nothing is to be written.
    fn check_places(&self, clips: &[PathBuf]) -> Result<(), Failure> {
        let outputs = self.output.iter().chain(clips).filter(|_| !self.dry_run);
        check_places(outputs.map(PathBuf::as_path))
    }

    /// Side whose values are taken in conflicts.
    fn side(&self) -> Take {
        match self.take {
            Some(TakeArg::Theirs) => Take::Theirs,
            Some(TakeArg::Mine) | None => Take::Mine,
        }
    }

    /// True if there are conflicts that nobody decided, which is told: nothing is written then. Without a base every
    /// difference is a conflict, so the fault names `--base` first.
    fn is_undecided(&self, conflicts: usize, has_base: bool, report: &mut Report) -> bool {
        report.set("conflicts", conflicts);
        let is_undecided = conflicts > 0 && self.take.is_none();
        if is_undecided {
            let fields = counted(conflicts, "field", "fields");
            let fault = if has_base {
                format!("both sides changed {fields}, and nothing was written; say --take theirs or mine")
            } else {
                format!(
                    "without a base every difference is a conflict, here in {fields}, and nothing was written; give the \
                     template that the rig was made from as --base, or say --take theirs or mine"
                )
            };
            report.fault = Some(Explanation::at(self.rig.display().to_string(), &fault));
            report.notes.push(fault);
            report.at_fault = true;
        }
        is_undecided
    }
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
    let (from, to) = (version(&args.from, &mut report)?, version(&args.to, &mut report)?);
    limits::check_time("comparing the templates")?;
    let changes = diff_templates(&RealDisk, &from, &to);
    drop((from, to));
    limits::check_time("comparing the templates")?;
    tell(&mut report, &changes);
    Ok(report)
}

pub(super) fn run_update(args: &UpdateArgs) -> Result<Report, Failure> {
    if FileKind::of(&args.rig) == Some(FileKind::Project) {
        return project::run(args);
    }
    let inputs = args.inputs();
    args.in_place.check_names(&inputs, args.output.as_deref(), &[])?;
    let clip_files = clips::outputs(args, &inputs)?;
    args.check_places(&clip_files)?;
    let mut report = Report::default();
    let (now, file) = (version(&args.rig, &mut report)?, version(&args.from, &mut report)?);
    let beside = companion(&args.rig);
    let is_beside = args.base.is_none() && RealDisk.entry(&beside, true).is_ok();
    let keeps_base = args.keep_base || is_beside;
    if let Some(output) = args.output.as_ref().filter(|_| keeps_base && !args.dry_run) {
        check_companion(output)?;
        check_places([companion(output).as_path()])?;
    }
    let base = match &args.base {
        Some(base) => Some(version(base, &mut report)?),
        None if is_beside => Some(limits::load_version(&beside)?),
        None => None,
    };
    report.set(
        "base",
        is_beside.then(|| beside.display().to_string()).or(args.base.as_ref().map(|base| base.display().to_string())),
    );
    limits::check_time("updating the rig")?;
    let mut update = update_template(&RealDisk, base.as_ref(), &now, &file, &args.side().into());
    let updated = &mut update.update;
    let was = base.as_ref().unwrap_or(&now).rig();
    tell_update(&mut report, (was, file.rig()), now.rig(), updated)?;
    let clips = clips::updated(args, (now.rig(), &updated.rig), &clip_files, &mut report)?;
    if args.is_undecided(updated.conflicts(), base.is_some(), &mut report) {
        return Ok(report);
    }
    // The versions are as large as what is written, which is read back.
    drop((base, now));
    let file = keeps_base.then_some(file);
    limits::check_time("updating the rig")?;
    if let Some(output) = args.output.as_ref().filter(|_| !args.dry_run) {
        let clips = clips::stage(&clips)?;
        report.notes(update.store(&RealDisk, output)?);
        report.line(format!("wrote {}", output.display()));
        report.set("output", output.display().to_string());
        clips::store(clips, &mut report)?;
        if let Some(file) = file {
            let base = companion(output);
            save_atomic(&RealDisk, &base, base_text(&RealDisk, &file, output).as_bytes()).map_err(StoreError::from)?;
            report.line(format!("wrote {}", base.display()));
        }
    }
    Ok(report)
}

/// Tells versions and changes of an update of the rig `now`, and re-expresses the poses.
fn tell_update(report: &mut Report, (was, is): (&Rig, &Rig), now: &Rig, updated: &mut Update) -> Result<(), Failure> {
    if let Some(version) = VersionChange::between(was.about(), is.about()) {
        report.line(format!("version  {version}"));
        report.set("version", json!({"from": version.from, "to": version.to}));
    }
    tell(report, &updated.changes);
    let poses = keep_poses(now, &mut updated.rig, &Arc::new(limits::modules()))
        .map_err(|error| Failure::Input(Box::new(error)))?;
    for note in &poses {
        report.line(format!("moves    {note}"));
    }
    report.set("poses", serde_json::to_value(&poses).unwrap_or(Value::Null));
    Ok(())
}

/// File beside a rig that has the version of the template that it was made from, or updated to last. Of a link it is beside the
/// file that the link leads to, as that is the one that is read and saved.
pub(super) fn companion(rig: &Path) -> PathBuf {
    let is_link = RealDisk.entry(rig, false).is_ok_and(|entry| entry.kind == EntryKind::Link);
    let linked = is_link.then(|| RealDisk.canonical(rig).ok()).flatten();
    let mut name = linked.as_deref().unwrap_or(rig).as_os_str().to_owned();
    name.push(".base");
    name.into()
}

/// Refuses an output beside which something else than a template has the name of its [`companion`]: it would be replaced,
/// although nobody named it.
pub(super) fn check_companion(output: &Path) -> Result<(), Failure> {
    let base = companion(output);
    let is_free = match read_capped(&RealDisk, &base, template::MAX_BYTES as u64) {
        Ok(bytes) => template::read_header(&bytes).is_ok(),
        Err(ReadError::Missing { .. }) => true,
        Err(_) => false,
    };
    if is_free {
        return Ok(());
    }
    let fault = format!(
        "`{}` is no template, and has the name under which the version of the template is kept beside `{}`; move it away, \
         or give another output",
        base.display(),
        output.display()
    );
    Err(Failure::Input(fault.into()))
}

pub(super) fn load(path: &Path, report: &mut Report) -> Result<Rig, Failure> {
    Ok(load_part(path, report)?.rig)
}

/// The version of a template that a file has.
fn version(path: &Path, report: &mut Report) -> Result<TemplateVersion, Failure> {
    check_kind(path)?;
    let version = limits::load_version(path)?;
    report.notes(version.notes().to_vec());
    Ok(version)
}

fn check_kind(path: &Path) -> Result<(), Failure> {
    // A name without an ending is that of a template in the folders of the site.
    if path.extension().is_some() && FileKind::of(path) != Some(FileKind::Template) {
        return Err(Failure::Usage(format!("`{}` is no template; give a .rig.ron", path.display())));
    }
    Ok(())
}

/// The template of a file, with what it says for its use as a part.
pub(super) fn load_part(path: &Path, report: &mut Report) -> Result<Part, Failure> {
    check_kind(path)?;
    let mut template = limits::load_template(path)?;
    report.notes(std::mem::take(&mut template.notes));
    Ok(template.into())
}

/// The rig of a template's file, with the part instances that the file has.
pub(super) fn load_with_parts(path: &Path, report: &mut Report) -> Result<(Rig, Vec<PartInstance>), Failure> {
    check_kind(path)?;
    let template = limits::load_template(path)?;
    report.notes(template.notes);
    Ok((template.rig, template.instances))
}

fn tell(report: &mut Report, changes: &[Change]) {
    if !is_json() {
        report.lines.extend(changes.iter().map(Change::to_string));
    }
    if changes.is_empty() {
        report.line("no differences");
    }
    report.set_list("changes", changes);
}
