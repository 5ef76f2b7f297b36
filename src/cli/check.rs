//! `rigsmith check`: problems in files.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use serde_json::{Value, json};

use super::{
    Failure, Report,
    explanation::Explanation,
    limits::{self, Limit},
    report::counted,
    skin::load_rig,
};
use crate::{
    files::{
        FileKind, LoadError, PartFiles, ProjectNote, RealDisk, load_animation, load_gestures, load_model, load_motion,
        load_packed_clips, load_project, load_skin, read_capped,
    },
    mesh::{
        adjacency::{edges, islands, weld},
        model::Model,
    },
    processor::{BuildError, BuildProblem, Builder, ModuleError, Modules, SourceText, review},
    rig::{
        JointData, Rig, RigJoint, SourceError, TagData, TagKind, Uid,
        feature::{FeatureKinds, undecided_choices},
        nearest::listed,
        proportion,
        template::{self, PartOrigin, Template},
    },
    solve::program::RigProgram,
};

/// Arguments of `rigsmith check`.
#[derive(Args, Debug)]
pub(super) struct CheckArgs {
    /// The files: meshes, templates, projects, clips, motion, weights or lists of gestures
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
}

/// Problems of one file.
#[derive(Default)]
struct Findings {
    error: Option<String>,
    /// Place of the error, where its reader knows more of it than the file.
    place: Option<String>,
    /// Problems of single commands of a rig, each with its place in the file.
    problems: Vec<SourceError>,
    remarks: Vec<String>,
}

impl Findings {
    /// The findings with messages of limited length: one may list thousands of names.
    fn cut(mut self) -> Self {
        let remarks = self.remarks.iter_mut().chain(&mut self.error);
        for message in remarks.chain(self.problems.iter_mut().map(|problem| &mut problem.message)) {
            *message = limits::message(message);
        }
        self
    }
}

pub(super) fn run(args: &CheckArgs) -> Result<Report, Failure> {
    let mut report = Report::default();
    let mut list = Vec::new();
    for path in &args.files {
        limits::check_time("checking the files")?;
        let found = check(path)?.cut();
        match &found.error {
            Some(error) => report.line(format!("{}: error: {error}", path.display())),
            None => report.line(format!("{}: ok", path.display())),
        }
        for problem in &found.problems {
            report.line(format!("{}:{}:{}: {}", path.display(), problem.line, problem.column, problem.message));
        }
        for remark in &found.remarks {
            report.line(format!("  {remark}"));
        }
        if let Some(error) = &found.error {
            report.at_fault = true;
            let first = found.problems.first();
            let place = first.map(|problem| format!("{}:{}:{}", path.display(), problem.line, problem.column));
            let place = place.or_else(|| found.place.clone());
            let what = first.map_or(error.as_str(), |problem| problem.message.as_str());
            report
                .fault
                .get_or_insert_with(|| Explanation::at(place.unwrap_or_else(|| path.display().to_string()), what));
        }
        let problems = found.problems.iter();
        let problems = problems.map(|p| json!({ "line": p.line, "column": p.column, "message": p.message }));
        list.push(json!({
            "file": path.display().to_string(),
            "error": found.error,
            "problems": problems.collect::<Vec<Value>>(),
            "remarks": found.remarks,
        }));
    }
    report.set("files", Value::Array(list));
    Ok(report)
}

fn check(path: &Path) -> Result<Findings, Failure> {
    let mut found = Findings::default();
    let loaded: Result<(), LoadError> = match FileKind::of(path) {
        Some(FileKind::Obj | FileKind::Gltf | FileKind::Glb | FileKind::Vrm) => {
            load_model(&RealDisk, path).map(|model| match limits::check_model(path, &model) {
                Ok(()) => found.remarks = remarks_on_model(&model),
                Err(error) => found.error = Some(error.to_string()),
            })
        }
        Some(FileKind::Template) => {
            check_template(path, &mut found)?;
            Ok(())
        }
        Some(FileKind::RigText) => {
            let mut told = Report::default();
            match load_rig(path, &mut told) {
                Ok(rig) => {
                    found.remarks = told.notes;
                    found.remarks.extend(remarks_on_rig(&rig));
                    found.error = faults_of_places(&rig).into_iter().next().map(|(_, fault)| fault);
                }
                Err(Failure::Input(error)) => {
                    found.place = Some(Explanation::of_error(error.as_ref(), &path.display().to_string()).place);
                    found.error = Some(error.to_string());
                }
                Err(usage) => return Err(usage),
            }
            Ok(())
        }
        Some(FileKind::Project) => load_project(&RealDisk, path).map(|project| {
            found.remarks = project.notes.iter().map(ToString::to_string).collect();
            found.remarks.extend(project.rigs.iter().flat_map(remarks_on_rig));
            let outside = project.notes.iter().find(|note| matches!(note, ProjectNote::MeshOutside(_)));
            let outside = outside.map(ToString::to_string);
            let beyond = limits::check_project(path, &project).err().map(|error| error.to_string());
            let faults = |rig| faults_of_places(rig).into_iter().chain(faults_of_mirrors(rig));
            let nowhere = project.rigs.iter().flat_map(faults).next().map(|(_, fault)| fault);
            found.error = outside.or(beyond).or(nowhere);
        }),
        Some(FileKind::Skin) => load_skin(&RealDisk, path).map(drop),
        Some(FileKind::Animation) => load_animation(&RealDisk, path).map(|read| found.remarks = read.notes),
        Some(FileKind::Bvh) => load_motion(&RealDisk, path).map(|motion| found.remarks = motion.notes),
        Some(FileKind::PackedClips) => load_packed_clips(&RealDisk, path).map(drop),
        Some(FileKind::Gestures) => load_gestures(&RealDisk, path).map(|gestures| {
            found.error = limits::check_gestures(path, &gestures).err().map(|error| error.to_string());
        }),
        None if path.is_dir() => {
            let files = path.join("*.rig.ron");
            found.error = Some(format!("this is a folder; give the files in it, such as {}", files.display()));
            Ok(())
        }
        None => {
            found.error = Some(
                "Rigsmith knows .obj, .gltf, .glb, .vrm, .rig, .rig.ron, .rigsmith.ron, .anim.ron, .rigclip, .bvh, .skin and .ron"
                    .to_owned(),
            );
            Ok(())
        }
    };
    if let Err(error) = loaded {
        found.place = Some(Explanation::of_error(&error, &path.display().to_string()).place);
        found.error = Some(error.to_string());
    }
    Ok(found)
}

/// Tells all that is wrong with a template: its structure, kinds of features that nobody registered, and its commands.
fn check_template(path: &Path, found: &mut Findings) -> Result<(), Failure> {
    let bytes = match read_capped(&RealDisk, path, template::MAX_BYTES as u64) {
        Ok(bytes) => bytes,
        Err(error) => {
            found.error = Some(error.to_string());
            return Ok(());
        }
    };
    let (template, mut faults) = match template::survey_template(&bytes) {
        Ok(surveyed) => surveyed,
        Err(faults) => {
            found.error = Some(format!(
                "{} is no template that can be read: {}",
                path.display(),
                counted(faults.len(), "fault", "faults")
            ));
            found.problems = faults;
            return Ok(());
        }
    };
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes));
    // The survey has read it with the commas that it lacks.
    let text = if faults.is_empty() { text } else { template::with_missing_commas(&text).0.into_owned().into() };
    let (template, of_parts) = PartFiles::new(&RealDisk).survey(path, &text, template);
    faults.extend(of_parts);
    if let Err(error) = limits::check_rig(path, &template.rig) {
        found.error = Some(error.to_string());
        found.problems = faults;
        return Ok(());
    }
    let Template { rig, notes: remarks, origins, unbound, .. } = template;
    let explicit = template::explicit(&text);
    let places = SourceText::new(&explicit);
    let CommandProblems { listed: commands, problems, commands: failing, readable } =
        problems_of_commands(&rig, &places, &origins);
    let unknown = FeatureKinds::default().unknown_in(&rig);
    let unknown_kinds = unknown.len();
    let kinds: Vec<SourceError> = unknown
        .into_iter()
        .take(limits::most(Limit::Listed))
        .map(|kind| places.locate_declared(kind.tag, "kind", kind.to_string()))
        .collect();
    let undecided = undecided_choices(&rig);
    let undecided_count = undecided.len();
    let choices: Vec<SourceError> = undecided
        .into_iter()
        .take(limits::most(Limit::Listed))
        .map(|(feature, choice, tag)| {
            let feature = feature.name;
            let message = format!(
                "not exactly one switch of the choice \"{choice}\" of the feature \"{feature}\" is on; choose one"
            );
            places.locate_declared(tag, "choice", message)
        })
        .collect();
    let nowhere = faults_of_places(&rig);
    let nowhere_count = nowhere.len();
    let lost: Vec<SourceError> = nowhere
        .into_iter()
        .take(limits::most(Limit::Listed))
        .map(|(joint, fault)| places.locate_declared(joint, "translation", fault))
        .collect();
    let rings = faults_of_mirrors(&rig);
    let ring_count = rings.len();
    let mirrors: Vec<SourceError> = rings
        .into_iter()
        .take(limits::most(Limit::Listed))
        .map(|(joint, fault)| places.locate_declared(joint, "mirror", fault))
        .collect();
    let told = [
        (nowhere_count, "joint is at no finite place", "joints are at no finite place"),
        (ring_count, "ring of mirror partners", "rings of mirror partners"),
        (undecided_count, "choice is not decided", "choices are not decided"),
        (faults.len(), "fault of the structure", "faults of the structure"),
        (unknown_kinds, "kind of feature is not registered", "kinds of features are not registered"),
        (failing, "command cannot be built", "commands cannot be built"),
    ];
    let told = told.into_iter().filter(|(count, ..)| *count > 0);
    let told: Vec<String> = told.map(|(count, one, many)| counted(count, one, many)).collect();
    found.error = (!told.is_empty()).then(|| told.join(", "));
    found.remarks = remarks;
    // Of a command that is told, its references are among what is told, unless nobody knows its module.
    found.remarks.extend(unbound.into_iter().filter(|(tag, _)| !readable.contains(tag)).map(|(_, told)| told));
    found.remarks.extend(remarks_on_rig(&rig));
    let unlisted = problems - commands.len() + unknown_kinds - kinds.len() + undecided_count - choices.len()
        + nowhere_count
        - lost.len()
        + ring_count
        - mirrors.len();
    if unlisted > 0 {
        found.remarks.push(format!("{} not listed", counted(unlisted, "more problem is", "more problems are")));
    }
    found.problems =
        faults.into_iter().chain(kinds).chain(choices).chain(lost).chain(mirrors).chain(commands).collect();
    found.problems.sort_by_key(|problem| problem.offset);
    Ok(())
}

/// Problems of the commands of a rig.
struct CommandProblems {
    /// The first of them, with their places.
    listed: Vec<SourceError>,
    /// Number of all.
    problems: usize,
    /// Number of commands that have any.
    commands: usize,
    /// Commands among them whose parameters were read.
    readable: HashSet<Uid>,
}

fn problems_of_commands(rig: &Rig, places: &SourceText, origins: &BTreeMap<Uid, PartOrigin>) -> CommandProblems {
    // Joints that no command and no switch concerns are what the template says, and a build of many takes memory.
    if !rig.has_tags() && rig.groups().iter().all(|group| group.enabled) {
        return CommandProblems { listed: Vec::new(), problems: 0, commands: 0, readable: HashSet::new() };
    }
    let locate = |error: &BuildError| places.locate_with_parts(rig, error, origins);
    let modules = Arc::new(limits::modules());
    let problems = review(rig, &modules);
    if problems.is_empty() {
        let listed: Vec<SourceError> = problem_of_program(rig, &modules, places, &locate).into_iter().collect();
        let count = listed.len();
        return CommandProblems { listed, problems: count, commands: count, readable: HashSet::new() };
    }
    let commands: HashSet<Uid> = problems.iter().map(|problem| problem.command).collect();
    let listed = problems.iter().take(limits::most(Limit::Listed)).map(locate).collect();
    let is_read = |error: &&BuildError| !matches!(error.problem, BuildProblem::NoModule { .. });
    let readable = problems.iter().filter(is_read).map(|error| error.command).collect();
    CommandProblems { listed, problems: problems.len(), commands: commands.len(), readable }
}

/// Problem that keeps a fully built rig from moving, such as constraints that wait for each other by way of a parent;
/// placed at the first command that it names.
fn problem_of_program(
    rig: &Rig,
    modules: &Arc<Modules>,
    places: &SourceText,
    locate: &dyn Fn(&BuildError) -> SourceError,
) -> Option<SourceError> {
    let built = Builder::build(rig, modules).ok()?;
    let problem = RigProgram::check(&built).err()?;
    let found = problem.commands().iter().find_map(|command| rig.find_tag(*command));
    let Some((joint, TagData { uid, kind: TagKind::Command { module, .. }, .. })) = found else {
        return Some(places.beginning(problem.to_string()));
    };
    let error = BuildError {
        command: *uid,
        joint: joint.data.uid,
        joint_label: joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string()).into(),
        module: module.as_str().into(),
        problem: BuildProblem::Module(ModuleError::other(problem.to_string())),
    };
    Some(locate(&error))
}

fn remarks_on_model(model: &Model) -> Vec<String> {
    let mut remarks = model.notes.clone();
    let (points, count) = weld(&model.points);
    let triangles: Vec<[u32; 3]> =
        model.point_triangles().iter().map(|triangle| triangle.map(|corner| points[corner as usize])).collect();
    if triangles.is_empty() {
        remarks.push("there are no triangles: nothing can be drawn on".to_owned());
        return remarks;
    }
    let flat = triangles.iter().filter(|[a, b, c]| a == b || b == c || c == a).count();
    let edges = edges(&triangles);
    let open = edges.iter().filter(|edge| edge.triangles == 1).count();
    let shared = edges.iter().filter(|edge| edge.triangles > 2).count();
    let (island_of, _) = islands(&triangles, count);
    let mut used: Vec<u32> = triangles.iter().map(|triangle| island_of[triangle[0] as usize]).collect();
    used.sort_unstable();
    used.dedup();
    let mut say = |number: usize, one: &str, many: &str| {
        if number > 0 {
            remarks.push(counted(number, one, many));
        }
    };
    let coincident = model.points.len() - count;
    say(
        coincident,
        "point lies exactly on another (seams, unwelded faces)",
        "points lie exactly on others (seams, unwelded faces)",
    );
    say(flat, "triangle has two corners at one place", "triangles have two corners at one place");
    say(open, "edge has one face only (holes, borders)", "edges have one face only (holes, borders)");
    say(shared, "edge has more than two faces", "edges have more than two faces");
    say(if used.len() > 1 { used.len() } else { 0 }, "separate island", "separate islands");
    if let Some(weights) = &model.weights {
        let unweighted = (0..weights.len()).filter(|point| weights.of(*point).len() == 0).count();
        say(unweighted, "point has no weights", "points have no weights");
    }
    remarks
}

/// Joints whose place in the rig is no finite number, though their own numbers are: the first of each chain.
fn faults_of_places(rig: &Rig) -> Vec<(Uid, String)> {
    let globals = rig.rest_globals();
    let lost: HashSet<Uid> =
        globals.iter().filter(|(_, global)| !global.is_finite()).map(|(joint, _)| *joint).collect();
    let is_first = |parent: Option<Uid>| parent.is_none_or(|parent| !lost.contains(&parent));
    rig.walk()
        .filter(|joint| lost.contains(&joint.data.uid) && is_first(joint.parent))
        .map(|joint| {
            let fault = format!(
                "joint {} is at no finite place: its numbers and those of the joints above it add up to more than a number \
                 can hold; write smaller ones",
                name_of(&joint.data)
            );
            (joint.data.uid, fault)
        })
        .collect()
}

/// Joints that name themselves as mirror partners, and rings of three and more: the first joint of each. Two joints are a pair;
/// a joint whose partner has another one is no fault.
fn faults_of_mirrors(rig: &Rig) -> Vec<(Uid, String)> {
    let partner = |joint: &Uid| rig.joint(*joint).and_then(|joint| joint.data.mirror);
    // First joint of the way on which each joint was reached.
    let mut reached: HashMap<Uid, Uid> = HashMap::new();
    let mut faults = Vec::new();
    for start in rig.walk().map(|joint| joint.data.uid) {
        let mut next = Some(start);
        while let Some(joint) = next.filter(|joint| !reached.contains_key(joint)) {
            reached.insert(joint, start);
            next = partner(&joint);
        }
        let Some(first) = next.filter(|joint| reached.get(joint) == Some(&start)) else { continue };
        let others = std::iter::successors(partner(&first), partner).take_while(|joint| *joint != first);
        let ring: Vec<Uid> = std::iter::once(first).chain(others).collect();
        let names: Vec<String> =
            ring.iter().filter_map(|joint| rig.joint(*joint)).map(|joint| name_of(&joint.data)).collect();
        let fault = match ring.len() {
            1 => format!(
                "joint {} is its own mirror partner; name the joint on its other side, or leave `mirror` out",
                names.concat()
            ),
            2 => continue,
            _ => format!(
                "the mirror partners {} make a ring; let two joints name each other, or leave `mirror` out",
                listed(&names, "and")
            ),
        };
        faults.push((first, fault));
    }
    faults
}

fn name_of(joint: &JointData) -> String {
    joint.label.clone().unwrap_or_else(|| joint.uid.to_string())
}

fn remarks_on_rig(rig: &Rig) -> Vec<String> {
    let mut remarks = Vec::new();
    let mut labels: Vec<&str> = rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect();
    let unlabelled = rig.len() - labels.len();
    labels.sort_unstable();
    let mut doubled: Vec<&str> = labels.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
    doubled.dedup();
    if !doubled.is_empty() {
        remarks.push(format!("labels used more than once: {}", doubled.join(", ")));
    }
    if unlabelled > 0 {
        remarks.push(counted(unlabelled, "joint has no label", "joints have no label"));
    }
    let short =
        rig.walk().filter(|joint| joint.parent.is_some() && joint.data.rest.translation.length() == 0.0).count();
    if short > 0 {
        remarks.push(counted(short, "joint lies exactly on its parent", "joints lie exactly on their parent"));
    }
    let is_flat = |joint: &&RigJoint| joint.data.rest.scale.abs().min_element() < 1.0 / proportion::MOST;
    let flat: Vec<String> = rig.walk().filter(is_flat).map(|joint| name_of(&joint.data)).collect();
    if !flat.is_empty() {
        let count = counted(flat.len(), "joint has a scale of nothing", "joints have a scale of nothing");
        remarks.push(format!(
            "{count}, which flattens all that hangs below and cannot be undone: {}; write other factors",
            flat.join(", ")
        ));
    }
    remarks
}
