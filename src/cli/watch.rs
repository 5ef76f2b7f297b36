//! `rigsmith watch`: builds a template again whenever its file is saved, or that of its mesh.

use std::{
    collections::{BTreeMap, HashMap},
    path::{Path, PathBuf},
    thread::sleep,
    time::{Duration, Instant},
};

use clap::Args;
use serde_json::{Value, json};

use super::{
    ExportArgs, Failure, InPlaceArgs, Report, WeightArgs,
    build::{MeshSource, bound_meshes, model_of_skeleton, posed_character, posed_skeleton},
    explanation::Explanation,
    limits,
    outputs::check_named_files,
    pose::{built_with, is_still},
    report::{counted, print, print_json},
};
use crate::{
    files::{
        FailedSave, FileKind, LOOK, LoadError, ModelWatch, PartFiles, RealDisk, StoreError, TemplateWatch,
        store_owned_model,
    },
    headless::{Workbench, posing::PoseError},
    mesh::{gltf::GltfWriteSettings, model::Model},
    plugins::{
        commands::{BuildStep, NamedProgramError},
        mesh_reload::ReloadReport,
    },
    processor::{BuildError, SourceText},
    rig::{
        Rig, RigEdit, TagKind, Uid,
        bake::baked,
        operations::Operation,
        template::{self, PartOrigin, Template},
        update::edits_between,
    },
    solve::program::RigProgram,
};

/// Arguments of `rigsmith watch`.
#[derive(Args, Debug)]
pub(super) struct WatchArgs {
    /// The template, `.rig.ron`. A file that is not there yet, or that cannot be built, is waited for
    pub template: PathBuf,
    /// A mesh to bind to what is built. When it is saved, joints stay, and its weights are transferred
    #[arg(long)]
    mesh: Option<PathBuf>,
    /// The character to write after every build, .glb or .gltf
    #[arg(short, long)]
    output: PathBuf,
    /// End after so many builds; otherwise it goes on until it is interrupted
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    export: ExportArgs,
    #[command(flatten)]
    in_place: InPlaceArgs,
}

/// Commands that are named after a build.
const NAMED: usize = 6;

/// Remedy where the text of an error names none.
const SAVE_AGAIN: &str = "correct it and save the file again, which is waited for";

pub(super) fn run(args: &WatchArgs, is_json: bool) -> Result<Report, Failure> {
    if FileKind::of(&args.template) != Some(FileKind::Template) {
        return Err(Failure::Usage(format!("`{}` is no template; give a .rig.ron", args.template.display())));
    }
    if !matches!(FileKind::of(&args.output), Some(FileKind::Glb | FileKind::Gltf)) {
        return Err(Failure::Usage(format!("cannot write `{}`; give .glb or .gltf", args.output.display())));
    }
    if let Some(mesh) = &args.mesh
        && !FileKind::of(mesh).is_some_and(|kind| kind == FileKind::Obj || kind.is_gltf())
    {
        return Err(Failure::Usage(format!("`{}` is no mesh; give .obj, .gltf, .glb or .vrm", mesh.display())));
    }
    let inputs: Vec<&Path> =
        [Some(&args.template), args.mesh.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    // A folder that is not there yet may come while templates are watched.
    args.in_place.check_names(&inputs, Some(&args.output), &[])?;
    let mut watch = Watch {
        args,
        is_json,
        template: TemplateWatch::new(&args.template),
        mesh: args.mesh.as_deref().map(ModelWatch::new),
        bench: None,
        still: None,
        model: None,
        bound: None,
        failed_save: None,
    };
    let mut news = vec![News::Mesh, News::FirstTemplate];
    let (mut builds, mut is_heard) = (0_u64, true);
    // What is tried again fails for the same reason again and again.
    let mut last_error = None;
    loop {
        for one in news {
            let is_again = matches!(one, News::Again);
            let subject = watch.subject(&one);
            let (told, error) = match watch.take(one) {
                Ok(None) => continue,
                Ok(Some(told)) => {
                    builds += 1;
                    (told, None)
                }
                Err(Failure::Input(error)) => {
                    let error = Explanation::of_error_or(error.as_ref(), &subject, SAVE_AGAIN).json();
                    (json!({ "ok": false, "error": error }), Some(error))
                }
                Err(usage) => return Err(usage),
            };
            if !is_again || error.is_none() || error != last_error {
                is_heard = watch.say(&told);
            }
            last_error = error;
            if !is_heard || args.count.is_some_and(|count| builds >= count) {
                let mut report = Report::default();
                report.at_fault = !is_heard;
                return Ok(report);
            }
        }
        news = watch.next();
    }
}

/// Reason to build or to write.
enum News {
    /// The template is read for the first time.
    FirstTemplate,
    /// The template, or a part of it, was saved; the template's content.
    Template(Vec<u8>),
    /// The mesh was saved, or is read for the first time.
    Mesh,
    /// The character could not be written, and may be now.
    Again,
}

/// Content of a template's file, for places of errors.
struct TemplateFile {
    text: String,
    origins: BTreeMap<Uid, PartOrigin>,
}

impl TemplateFile {
    /// An error of a command of the file's rig, at its place in the text.
    fn placed(&self, path: &Path, rig: &Rig, error: &BuildError) -> Failure {
        let explicit = template::explicit(&self.text);
        let source = SourceText::new(&explicit).locate_with_parts(rig, error, &self.origins);
        LoadError::Source { path: path.into(), text: self.text.clone(), source }.into()
    }
}

/// A mesh that is bound to what is built.
struct BoundMesh {
    /// The rig with what binding changes; the rig of the watch stays as its file has it.
    bench: Workbench,
    /// The mesh with its weights.
    own: Workbench,
}

struct Watch<'a> {
    args: &'a WatchArgs,
    is_json: bool,
    template: TemplateWatch,
    mesh: Option<ModelWatch>,
    /// The rig of the last template that could be built; `None` until there is one, and while [`Watch::still`] has its text.
    bench: Option<Workbench>,
    /// Text of the last template, if nothing moves its rig and no mesh is bound to it. The rig is written without an app, whose
    /// entities take several times its memory, and is not kept meanwhile.
    still: Option<Vec<u8>>,
    /// The mesh as it was read last; `None` until it can be read.
    model: Option<Model>,
    bound: Option<BoundMesh>,
    /// Save of the character that failed, and is tried again: the disk may be full only for a while.
    failed_save: Option<FailedSave>,
}

impl Watch<'_> {
    /// Waits for news.
    fn next(&mut self) -> Vec<News> {
        loop {
            sleep(LOOK);
            let is_mesh = self.mesh.as_mut().is_some_and(|mesh| mesh.look(&RealDisk));
            let template = self.template.look(&RealDisk).map(News::Template);
            let mut news: Vec<News> = is_mesh.then_some(News::Mesh).into_iter().chain(template).collect();
            if news.is_empty()
                && self.failed_save.as_mut().is_some_and(|failed| failed.is_due(&RealDisk, Instant::now()))
            {
                news.push(News::Again);
            }
            if !news.is_empty() {
                return news;
            }
        }
    }

    /// The file that an error is of, if it names none itself.
    fn subject(&self, news: &News) -> String {
        let mesh = self.args.mesh.as_ref().filter(|_| matches!(news, News::Mesh));
        mesh.unwrap_or(&self.args.template).display().to_string()
    }

    /// Takes over what is new, and writes the character; `None` while the template or the mesh is waited for. What cannot be
    /// read or built changes nothing.
    fn take(&mut self, news: News) -> Result<Option<Value>, Failure> {
        let start = Instant::now();
        let runs = self.runs();
        match news {
            News::FirstTemplate => {
                let bytes = self.template.read(&RealDisk).map_err(|error| Failure::Input(Box::new(error)))?;
                self.take_template(start, &runs, &bytes)
            }
            News::Template(bytes) => self.take_template(start, &runs, &bytes),
            News::Mesh => self.take_mesh(start, &runs),
            News::Again => match self.still.clone() {
                Some(bytes) => {
                    // Where a part of the template is not there for a while, its return is news.
                    self.failed_save = None;
                    let rig = self.parsed(&bytes)?.0;
                    self.write_still(start, rig)
                }
                None => self.write(start, start.elapsed(), &runs, None),
            },
        }
    }

    /// Takes over a saved template. If it cannot be read or built, the rig stays as it was.
    fn take_template(&mut self, start: Instant, runs: &[(Uid, u32)], bytes: &[u8]) -> Result<Option<Value>, Failure> {
        let (rig, file) = self.parsed(bytes)?;
        if self.mesh.is_none() && is_still(&rig) {
            (self.bench, self.still) = (None, Some(bytes.to_vec()));
            drop(file);
            return self.write_still(start, rig);
        }
        let before = self.bench.as_ref().map(|bench| bench.rig().clone());
        match (&mut self.bench, &before) {
            (Some(bench), Some(before)) => change(bench, before, &rig)?,
            _ => self.bench = Some(limits::workbench(rig)),
        }
        let Some(bench) = &mut self.bench else { return Ok(None) };
        if let Some(error) = bench.build(BuildStep::All).error {
            let failure = file.placed(&self.args.template, bench.rig(), &error);
            match &before {
                Some(before) => {
                    let now = bench.rig().clone();
                    change(bench, &now, before)?;
                    bench.build(BuildStep::All);
                }
                None => self.bench = None,
            }
            return Err(failure);
        }
        drop((before, file));
        (self.bound, self.still) = (None, None);
        self.write(start, start.elapsed(), runs, None)
    }

    /// Takes over a saved mesh: joints stay, and weights that it has are transferred.
    fn take_mesh(&mut self, start: Instant, runs: &[(Uid, u32)]) -> Result<Option<Value>, Failure> {
        let (Some(mesh), Some(path)) = (&mut self.mesh, &self.args.mesh) else { return Ok(None) };
        // A file that changed while it was read is told again.
        let Some(model) = mesh.read(&RealDisk) else { return Ok(None) };
        let model = model?;
        check_named_files(path, &mesh.files())?;
        limits::check_model(path, &model)?;
        let mut reloaded = None;
        if let Some(BoundMesh { own, .. }) = &mut self.bound {
            // The time that work may take counts from now on.
            own.set_rig_limits(limits::chosen());
            reloaded = Some(own.reload(model.clone())?);
        }
        self.model = Some(model);
        self.write(start, start.elapsed(), runs, reloaded)
    }

    /// The rig and the text of a template, whose parts are watched from now on.
    fn parsed(&mut self, bytes: &[u8]) -> Result<(Rig, TemplateFile), Failure> {
        let path = &self.args.template;
        let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)).into_owned();
        let mut files = PartFiles::new(&RealDisk);
        let read = files.complete(path, bytes);
        self.template.follow(files.asked, read.is_ok());
        let Template { rig, origins, .. } = match read {
            Ok(read) => read,
            Err(source) => return Err(LoadError::Source { path: path.clone(), text, source }.into()),
        };
        limits::check_rig(path, &rig)?;
        Ok((rig, TemplateFile { text, origins }))
    }

    /// Number of runs of every command, in the order of the build list.
    fn runs(&self) -> Vec<(Uid, u32)> {
        let Some(processor) = self.bench.as_ref().and_then(Workbench::processor) else { return Vec::new() };
        let builder = processor.builder();
        let runs = |tag: Uid| Some((tag, builder.status(tag)?.runs));
        builder.list().iter().filter_map(|entry| runs(entry.command)).collect()
    }

    /// Writes the character and says which commands ran since `runs`, and how a mesh was exchanged. `None` while there is no
    /// template, or no mesh where one is to be bound.
    fn write(
        &mut self,
        start: Instant,
        built_in: Duration,
        runs: &[(Uid, u32)],
        reloaded: Option<ReloadReport>,
    ) -> Result<Option<Value>, Failure> {
        self.failed_save = None;
        let args = self.args;
        let Some(bench) = &self.bench else { return Ok(None) };
        let (model, settings) = if self.mesh.is_none() {
            posed_skeleton(bench, &args.export)?
        } else {
            let BoundMesh { bench, own } = match &mut self.bound {
                Some(bound) => bound,
                none => {
                    let Some(model) = self.model.clone() else { return Ok(None) };
                    // Binding a mesh may change commands, and the rig here stays as its file has it.
                    let mut bench = limits::workbench(bench.rig().clone());
                    bench.build(BuildStep::All);
                    let meshes = vec![MeshSource::Model(Box::new(model))];
                    let own = bound_meshes(&mut bench, meshes, &args.weights, &mut Report::default())?;
                    none.insert(BoundMesh { bench, own })
                }
            };
            posed_character(bench, own, &args.export)?
        };
        self.store(model, &settings)?;
        Ok(Some(self.answer(start, built_in, runs, reloaded)))
    }

    /// Writes a rig that nothing moves, and says so as [`Watch::write`] does.
    fn write_still(&mut self, start: Instant, rig: Rig) -> Result<Option<Value>, Failure> {
        self.failed_save = None;
        let (model, settings) = still_skeleton(rig, &self.args.export)?;
        let built_in = start.elapsed();
        self.store(model, &settings)?;
        Ok(Some(self.answer(start, built_in, &[], None)))
    }

    /// Saves the character; where that fails, it is tried again after a while.
    fn store(&mut self, model: Model, settings: &GltfWriteSettings) -> Result<(), Failure> {
        // What is written is read back, which takes as much memory again.
        let output = &self.args.output;
        let stored = store_owned_model(&RealDisk, output, model, settings);
        if let Err(StoreError::Save(error)) = &stored {
            self.failed_save = Some(FailedSave::new(&RealDisk, output, error, Instant::now()));
        }
        stored?;
        Ok(())
    }

    /// Answer for programs about what happened since a time.
    fn answer(&self, start: Instant, built_in: Duration, runs: &[(Uid, u32)], reloaded: Option<ReloadReport>) -> Value {
        let runs: HashMap<Uid, u32> = runs.iter().copied().collect();
        let is_newer = |(tag, count): &(Uid, u32)| *count > runs.get(tag).copied().unwrap_or_default();
        let now = self.runs();
        let ran: Vec<String> = match &self.bench {
            Some(bench) => now.iter().filter(|run| is_newer(run)).map(|(tag, _)| named(bench.rig(), *tag)).collect(),
            None => Vec::new(),
        };
        let milliseconds = |time: Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        let mut told = json!({
            "ok": true,
            "ran": ran,
            "commands": now.len(),
            "build_ms": milliseconds(built_in),
            "total_ms": milliseconds(start.elapsed()),
            "output": self.args.output.display().to_string(),
        });
        if let Some(ReloadReport { points, moved, weights }) = reloaded {
            told["mesh"] = json!({
                "points": points,
                "moved": moved,
                "weights": weights.map(|weights| json!({
                    "copied": weights.copied, "matched": weights.matched,
                    "inpainted": weights.inpainted, "nearest": weights.nearest,
                })),
            });
        }
        told
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
        let mesh = told.get("mesh").map(said_of_mesh).unwrap_or_default();
        let (count, built, written) = (ran.len(), &told["build_ms"], &told["total_ms"]);
        print([format!("{mesh}{count} of {of} ran{what}; built in {built} ms, written in {written} ms").as_str()])
    }
}

/// Clause about a mesh that was exchanged.
fn said_of_mesh(mesh: &Value) -> String {
    let (before, now) = (&mesh["points"][0], &mesh["points"][1]);
    let points = if before == now { String::new() } else { format!("{now} points instead of {before}, ") };
    let weights = if mesh["weights"].is_null() { "" } else { ", weights transferred" };
    let moved = mesh["moved"].as_f64().unwrap_or_default();
    format!("mesh read again: {points}points moved by {moved:.4} at most{weights}; ")
}

/// Built skeleton of a rig that nothing moves, and the settings for writing it.
fn still_skeleton(rig: Rig, export: &ExportArgs) -> Result<(Model, GltfWriteSettings), Failure> {
    let mut modules = limits::modules();
    // A watch goes on for longer than the time of a command.
    modules.deadline = None;
    let built = built_with(&rig, modules)?;
    RigProgram::check(&built).map_err(|error| PoseError::CannotRun(NamedProgramError::new(error, &rig)))?;
    let skeleton = baked(&rig, &built);
    drop((rig, built));
    Ok(model_of_skeleton(skeleton, export))
}

fn change(bench: &mut Workbench, from: &Rig, to: &Rig) -> Result<(), Failure> {
    let edits: Vec<RigEdit> = edits_between(from, to).map_err(|error| Failure::Input(Box::new(error)))?;
    Ok(bench.operate(Operation::Edits(edits))?)
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
