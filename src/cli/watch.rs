//! `rigsmith watch`: builds a template again whenever its file is saved.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    thread::sleep,
    time::{Duration, Instant},
};

use clap::Args;
use serde_json::{Value, json};

use super::{
    ExportArgs, Failure, InPlaceArgs, Report, WeightArgs,
    build::character_of,
    explanation::Explanation,
    limits,
    report::{counted, print, print_json},
};
use crate::{
    files::{FileKind, LOOK, LoadError, PartFiles, RealDisk, StoreError, TemplateWatch, store_model},
    headless::Workbench,
    plugins::commands::BuildStep,
    rig::{Rig, RigEdit, TagKind, Uid, operations::Operation, update::edits_between},
};

/// Arguments of `rigsmith watch`.
#[derive(Args, Debug)]
pub(super) struct WatchArgs {
    /// The template, `.rig.ron`
    pub template: PathBuf,
    /// A mesh to bind to what is built
    #[arg(long)]
    mesh: Option<PathBuf>,
    /// The character to write after every build, .glb or .gltf
    #[arg(short, long)]
    output: PathBuf,
    /// End after so many builds; otherwise it goes on until it is interrupted
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

/// Commands that are named after a build.
const NAMED: usize = 6;

/// Pause before a character that could not be written is written again.
const AGAIN: Duration = Duration::from_secs(1);

pub(super) fn run(args: &WatchArgs, is_json: bool) -> Result<Report, Failure> {
    if FileKind::of(&args.template) != Some(FileKind::Template) {
        return Err(Failure::Usage(format!("`{}` is no template; give a .rig.ron", args.template.display())));
    }
    if !matches!(FileKind::of(&args.output), Some(FileKind::Glb | FileKind::Gltf)) {
        return Err(Failure::Usage(format!("cannot write `{}`; give .glb or .gltf", args.output.display())));
    }
    let inputs: Vec<&Path> =
        [Some(&args.template), args.mesh.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    args.in_place.check(&inputs, Some(&args.output), &[])?;
    let mut file = TemplateWatch::new(&args.template);
    let first = file.read(&RealDisk).map_err(|error| Failure::Input(Box::new(error)))?;
    let rig = parsed(&mut file, &args.template, &first)?;
    let mut watch = Watch { args, bench: limits::workbench(rig), is_json, again: None };
    let first = Instant::now();
    let all = watch.build(first, &[], None)?;
    let mut is_heard = watch.say(&all);
    let mut builds = 1;
    // What is tried again fails for the same reason again and again.
    let mut last_error = None;
    while is_heard && args.count.is_none_or(|count| builds < count) {
        let bytes = next(&mut file, watch.again);
        let start = Instant::now();
        let is_again = bytes.is_none();
        let built = match bytes {
            Some(bytes) => watch.update(&mut file, &bytes, start),
            None => watch.build(start, &watch.runs(), None),
        };
        let (told, error) = match built {
            Ok(told) => {
                builds += 1;
                (told, None)
            }
            Err(Failure::Input(error)) => {
                let subject = args.template.display().to_string();
                let error = Explanation::of_error(error.as_ref(), &subject).json();
                (json!({ "ok": false, "error": error }), Some(error))
            }
            Err(usage) => return Err(usage),
        };
        if !is_again || error.is_none() || error != last_error {
            is_heard = watch.say(&told);
        }
        last_error = error;
    }
    Ok(Report { at_fault: !is_heard, ..Report::default() })
}

/// The template's content once it or a part has a new one; `None` at the time `again`, if there is none until then.
fn next(file: &mut TemplateWatch, again: Option<Instant>) -> Option<Vec<u8>> {
    loop {
        sleep(LOOK);
        let content = file.look(&RealDisk);
        if content.is_some() || again.is_some_and(|again| Instant::now() >= again) {
            return content;
        }
    }
}

/// The rig of a template, whose parts are watched from now on.
fn parsed(file: &mut TemplateWatch, path: &Path, bytes: &[u8]) -> Result<Rig, Failure> {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let mut files = PartFiles::new(&RealDisk);
    let read = files.complete(path, bytes);
    file.follow(files.asked, read.is_ok());
    let rig = read.map_err(|source| LoadError::Source { path: path.into(), text, source })?.rig;
    limits::check_rig(path, &rig)?;
    Ok(rig)
}

struct Watch<'a> {
    args: &'a WatchArgs,
    bench: Workbench,
    is_json: bool,
    /// Time at which the character is written again, because it could not be: the disk may be full only for a while.
    again: Option<Instant>,
}

impl Watch<'_> {
    /// Takes over a saved file. If it cannot be read or built, the rig stays as it was.
    fn update(&mut self, file: &mut TemplateWatch, bytes: &[u8], start: Instant) -> Result<Value, Failure> {
        let file = parsed(file, &self.args.template, bytes)?;
        let (before, runs) = (self.bench.rig().clone(), self.runs());
        self.change(&before, &file)?;
        self.build(start, &runs, Some(&before))
    }

    fn change(&mut self, from: &Rig, to: &Rig) -> Result<(), Failure> {
        let edits: Vec<RigEdit> = edits_between(from, to).map_err(|error| Failure::Input(Box::new(error)))?;
        Ok(self.bench.operate(Operation::Edits(edits))?)
    }

    /// Number of runs of every command, in the order of the build list.
    fn runs(&self) -> Vec<(Uid, u32)> {
        let Some(processor) = self.bench.processor() else { return Vec::new() };
        let builder = processor.builder();
        let runs = |tag: Uid| Some((tag, builder.status(tag)?.runs));
        builder.list().iter().filter_map(|entry| runs(entry.command)).collect()
    }

    /// Builds, writes the character and says which commands ran since `runs`; goes back to `before` if it cannot be built.
    fn build(&mut self, start: Instant, runs: &[(Uid, u32)], before: Option<&Rig>) -> Result<Value, Failure> {
        self.again = None;
        let outcome = self.bench.build(BuildStep::All);
        if let Some(error) = outcome.error {
            let message = format!("`{}`: {error} (tag {})", self.args.template.display(), error.command);
            if let Some(before) = before {
                let now = self.bench.rig().clone();
                self.change(&now, before)?;
                self.bench.build(BuildStep::All);
            }
            return Err(Failure::Input(message.into()));
        }
        let built_in = start.elapsed();
        let mut report = Report::default();
        let args = self.args;
        let mesh = args.mesh.as_deref();
        // Binding a mesh may change commands, and the rig here stays as its file has it.
        let mut bound = mesh.map(|_| {
            let mut bench = limits::workbench(self.bench.rig().clone());
            bench.build(BuildStep::All);
            bench
        });
        let bench = bound.as_mut().unwrap_or(&mut self.bench);
        let (model, settings) = character_of(bench, mesh, &args.weights, &args.export, &mut report)?;
        let stored = store_model(&RealDisk, &args.output, &model, &settings);
        self.again = matches!(stored, Err(StoreError::Save(_))).then(|| Instant::now() + AGAIN);
        stored?;
        let runs: HashMap<Uid, u32> = runs.iter().copied().collect();
        let is_newer = |(tag, count): &(Uid, u32)| *count > runs.get(tag).copied().unwrap_or_default();
        let ran: Vec<String> =
            self.runs().iter().filter(|run| is_newer(run)).map(|(tag, _)| named(self.bench.rig(), *tag)).collect();
        let milliseconds = |time: Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        Ok(json!({
            "ok": true,
            "ran": ran,
            "commands": outcome.cursor,
            "build_ms": milliseconds(built_in),
            "total_ms": milliseconds(start.elapsed()),
            "output": args.output.display().to_string(),
        }))
    }

    /// Says at once what happened; `false` if nobody can read it any more.
    fn say(&self, told: &Value) -> bool {
        if self.is_json {
            return print_json(told);
        }
        if let Some(error) = told.get("error") {
            let [what, place, remedy] = ["what", "where", "do"].map(|part| error[part].as_str().unwrap_or_default());
            return print([format!("not taken over: {place}: {what}; {remedy}").as_str()]);
        }
        let ran: Vec<&str> = told["ran"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let names = ran.iter().take(NAMED).copied().collect::<Vec<_>>().join(", ");
        let more = if ran.len() > NAMED { format!(" and {} more", ran.len() - NAMED) } else { String::new() };
        let what = if ran.is_empty() { String::new() } else { format!(": {names}{more}") };
        let commands = told["commands"].as_u64().and_then(|count| usize::try_from(count).ok()).unwrap_or_default();
        let of = counted(commands, "command", "commands");
        let (count, built, written) = (ran.len(), &told["build_ms"], &told["total_ms"]);
        print([format!("{count} of {of} ran{what}; built in {built} ms, written in {written} ms").as_str()])
    }
}

/// Module and joint of a command.
fn named(rig: &Rig, tag: Uid) -> String {
    match rig.find_tag(tag) {
        Some((joint, tag)) => {
            let label = joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string());
            let module = match &tag.kind {
                TagKind::Command { module, .. } => module.as_str(),
                TagKind::Feature { kind, .. } => kind.as_str(),
            };
            format!("{module} on {label}")
        }
        None => tag.to_string(),
    }
}
