//! Problems of a rig's commands, all at once.

use std::{
    cell::OnceCell,
    collections::{BTreeMap, HashMap, HashSet},
    sync::Arc,
};

use super::{
    BuildError, BuildProblem, Builder, ModuleError, Modules,
    parameter_faults::{SurveyedParams, field_of, survey_params, without_field},
};
use crate::rig::{
    Field, Rig, RigEdit, SourceError, TagData, TagKind, Uid, fields,
    reference::{GroupScope, RigNameIndex, references_in, without_uids},
    same_place,
    template::{self, ExplicitText, PartOrigin},
};

/// Largest number of failing commands that a review looks for, and of runs for further faults of theirs.
const MOST: usize = 200;

/// The problems of all commands of a rig, in the order of the build list: those whose module or parameters are wrong,
/// switched off or not, and those that fail when they run. A command that fails is left out for the rest, and those that
/// cannot do without it are passed over: each fault is told once. A command has several problems where several of its
/// parameters cannot be read, name what is not there, or are out of range. Behind a command that goes over a limit of the
/// whole rig no more is looked for.
pub fn review(rig: &Rig, modules: &Arc<Modules>) -> Vec<BuildError> {
    review_with(rig, modules, &mut Builder::new(modules.clone()))
}

/// Problems of [`review`], found with a builder that knows the same modules and keeps count of the work.
pub fn review_with(rig: &Rig, modules: &Modules, builder: &mut Builder) -> Vec<BuildError> {
    let (mut problems, mut repaired) = problems_before_run(rig, modules);
    let order: Vec<Uid> = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    let mut running = rig.clone();
    running.disable_tags(&problems.iter().map(|error| error.command).collect());
    builder.sync(&running);
    let mut is_full = false;
    for _ in 0..MOST {
        let Some(error) = builder.run_all().error else { break };
        if matches!(error.problem, BuildProblem::OutOfTime(_)) {
            return vec![error];
        }
        if running.find_tag(error.command).is_none() {
            break;
        }
        is_full = is_limit_of_rig(&error.problem);
        switch_off(&mut running, builder, error.command);
        repaired.extend(repaired_by_default(rig, &error));
        problems.push(error);
        // All commands behind it fail for the same reason.
        if is_full {
            break;
        }
    }
    if !is_full {
        problems.extend(further_problems(rig, &mut running, builder, &mut repaired));
        problems.extend(problems_behind(rig, &problems, &repaired, builder));
    }
    let places: HashMap<Uid, usize> = order.into_iter().enumerate().map(|(place, tag)| (tag, place)).collect();
    problems.sort_by_key(|error| places.get(&error.command).copied());
    show_names_alone(rig, &mut problems);
    problems
}

/// The error of a build with the reference that finds nothing, where parameters cannot be read: a build reads names that have
/// uids beside them, and tells the first name without one, whether a joint is called so or not.
pub fn with_missing_name(rig: &Rig, modules: &Modules, error: BuildError) -> BuildError {
    if !matches!(error.problem, BuildProblem::Parameters(_)) {
        return error;
    }
    let Some((_, TagData { kind: TagKind::Command { module, params, .. }, .. })) = rig.find_tag(error.command) else {
        return error;
    };
    let survey = survey_params(&RigNameIndex::new(rig), modules, module, params);
    match survey.problems.into_iter().find(|problem| matches!(problem, BuildProblem::Parameters(_))) {
        Some(problem) => BuildError { problem, ..error },
        None => error,
    }
}

/// True for more than all commands of a rig may make or do together.
fn is_limit_of_rig(problem: &BuildProblem) -> bool {
    matches!(problem, BuildProblem::Module(ModuleError::TooMany { name: "nodes" | "work", .. }))
}

/// Leaves out the uids of references in problems where the names beside them mean the same things.
fn show_names_alone(rig: &Rig, problems: &mut [BuildError]) {
    let names = OnceCell::new();
    for error in problems {
        let BuildProblem::Module(ModuleError::Reference { reference, .. }) = &mut error.problem else { continue };
        if reference.contains('#') {
            let quoted = format!("{reference:?}");
            let short = without_uids(&quoted, names.get_or_init(|| RigNameIndex::new(rig)), |_| true);
            *reference = ron::from_str(&short).unwrap_or_else(|_| reference.clone());
        }
    }
}

/// Problems of commands that are found without running them, and these commands with their readable parameters.
fn problems_before_run(rig: &Rig, modules: &Modules) -> (Vec<BuildError>, Vec<Repair>) {
    let (mut problems, mut repaired) = (Vec::new(), Vec::new());
    let mut judged: HashMap<(&str, &str), SurveyedParams> = HashMap::new();
    let names = RigNameIndex::new(rig);
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, .. } = &tag.kind else { continue };
            // Equal commands have equal problems: a template may hold one command thousands of times.
            let survey = judged
                .entry((module.as_str(), params.as_str()))
                .or_insert_with(|| survey_before_run(rig, &names, modules, module, params));
            if survey.problems.is_empty() {
                continue;
            }
            problems.extend(survey.problems.iter().map(|problem| BuildError {
                command: tag.uid,
                joint: joint.data.uid,
                joint_label: joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string()).into(),
                module: module.as_str().into(),
                problem: problem.clone(),
            }));
            let rest = survey.rest.as_ref().filter(|_| repaired.len() < MOST);
            repaired.extend(rest.map(|rest| Repair { command: tag.uid, params: rest.clone(), only_ranges: true }));
        }
    }
    (problems, repaired)
}

/// Command that failed, with its faulty parameters left out.
struct Repair {
    command: Uid,
    params: String,
    /// True if parameters are left out that say where the command works: what else it says then may follow from that.
    only_ranges: bool,
}

/// A command with a wrong value, with the default in place of that value.
fn repaired_by_default(rig: &Rig, error: &BuildError) -> Option<Repair> {
    let (_, tag) = rig.find_tag(error.command)?;
    let TagKind::Command { params, .. } = &tag.kind else { return None };
    let params = without_field(params, value_at_fault(&error.problem, params)?)?;
    let only_ranges = !matches!(error.problem, BuildProblem::Module(ModuleError::OutOfRange { .. }));
    Some(Repair { command: error.command, params, only_ranges })
}

/// Problems of commands that are found when these run without the parameters whose faults are known, which are left out of
/// `repaired`. `running` is the rig without all commands that fail, which `builder` follows.
fn further_problems(rig: &Rig, running: &mut Rig, builder: &mut Builder, repaired: &mut [Repair]) -> Vec<BuildError> {
    let mut found = Vec::new();
    let mut runs = 0;
    for next in repaired {
        let mut before = None;
        while runs < MOST
            && let Some(edit) = repair(rig, next)
        {
            runs += 1;
            let Some(inverse) = change(running, builder, &edit) else { break };
            before.get_or_insert(inverse);
            let Some(error) = builder.run_all().error.filter(|error| error.command == next.command) else { break };
            let left = match value_at_fault(&error.problem, &next.params) {
                Some(field) => without_field(&next.params, field),
                // A number that the text does not say is a default that fits no other value: no fault of its own.
                None if next.only_ranges
                    || matches!(error.problem, BuildProblem::Module(ModuleError::OutOfRange { .. })) =>
                {
                    break;
                }
                None => None,
            };
            found.push(error);
            let Some(params) = left else { break };
            next.params = params;
        }
        if let Some(before) = before {
            change(running, builder, &before);
        }
    }
    found
}

/// Problems of commands that wait for others that fail: those of values that they say themselves, found with the others
/// running as far as they can be read.
fn problems_behind(rig: &Rig, known: &[BuildError], repaired: &[Repair], builder: &mut Builder) -> Vec<BuildError> {
    let failing: HashSet<Uid> = known.iter().map(|error| error.command).collect();
    if repaired.is_empty() {
        return Vec::new();
    }
    let mut trial = rig.clone();
    trial.disable_tags(&failing);
    for edit in repaired.iter().filter_map(|next| repair(rig, next)) {
        // A repair that the rig refuses leaves the command off.
        let _ = trial.apply(&edit);
    }
    builder.sync(&trial);
    let mut found = Vec::new();
    for _ in 0..MOST {
        let Some(error) = builder.run_all().error else { break };
        let Some((_, tag)) = trial.find_tag(error.command) else { break };
        let TagKind::Command { params, .. } = &tag.kind else { break };
        let is_new = !failing.contains(&error.command) && value_at_fault(&error.problem, params).is_some();
        switch_off(&mut trial, builder, error.command);
        found.extend(is_new.then_some(error));
    }
    found
}

/// Name of the parameter whose value is wrong whatever else there is: one that the text says, without a reference in it.
fn value_at_fault<'p>(problem: &'p BuildProblem, params: &str) -> Option<&'p str> {
    let BuildProblem::Module(ModuleError::OutOfRange { parameter, .. } | ModuleError::Parameter { parameter, .. }) =
        problem
    else {
        return None;
    };
    let name = field_of(parameter);
    let field = fields(params).into_iter().find(|field| field.depth == 1 && field.name == name)?;
    (!params[field.value..field.end].contains("\"@")).then_some(name)
}

/// Edit that puts a repaired command in the place of one that is off; `None` if that command is not there.
fn repair(rig: &Rig, repaired: &Repair) -> Option<RigEdit> {
    let (joint, tag) = rig.find_tag(repaired.command)?;
    let TagKind::Command { module, feature, .. } = &tag.kind else { return None };
    let kind = TagKind::Command { module: module.clone(), params: repaired.params.clone(), feature: *feature };
    Some(RigEdit::SetTag(joint.data.uid, Box::new(TagData { kind, ..tag.clone() })))
}

/// Changes a rig that a builder follows, and returns the way back; `None` if the rig refuses the edit.
fn change(running: &mut Rig, builder: &mut Builder, edit: &RigEdit) -> Option<RigEdit> {
    let inverse = running.apply(edit).ok()?;
    builder.touch(running, edit);
    Some(inverse)
}

/// Switches a command of a rig off that a builder follows.
fn switch_off(running: &mut Rig, builder: &mut Builder, command: Uid) {
    let found = running.find_tag(command);
    let edit =
        found.map(|(joint, tag)| RigEdit::SetTag(joint.data.uid, Box::new(TagData { enabled: false, ..tag.clone() })));
    if edit.is_none_or(|edit| change(running, builder, &edit).is_none()) {
        running.disable_tags(&HashSet::from([command]));
        builder.sync(running);
    }
}

/// Problems of a command that are found without running it: in its module, its parameters, or the groups that these name.
fn survey_before_run(rig: &Rig, names: &RigNameIndex, modules: &Modules, module: &str, params: &str) -> SurveyedParams {
    let mut survey = survey_params(names, modules, module, params);
    if modules.get(module).is_some() {
        survey.problems.extend(unknown_groups(rig, params).into_iter().map(BuildProblem::Module));
    }
    survey
}

/// Local groups that the rig does not have: in references, and as the group of what is made.
fn unknown_groups(rig: &Rig, params: &str) -> Vec<ModuleError> {
    let mut problems = Vec::new();
    let fields = fields(params);
    let is_unknown = |uid: &Uid| rig.group(*uid).is_none();
    for found in references_in(params) {
        let Ok(references) = found.references else { continue };
        let groups = references.iter().filter_map(|reference| match reference.group {
            GroupScope::Group(uid) => Some(uid),
            _ => None,
        });
        if let Some(group) = groups.into_iter().find(is_unknown) {
            let field = fields.iter().rfind(|field| field.value <= found.range.start && found.range.end <= field.end);
            let parameter = field.map_or("params", |field| field.name);
            let problem = format!("the rig has no local group {group}; refer to another, or add it under `groups`");
            problems.push(ModuleError::reference(parameter, &references, problem));
        }
    }
    for field in fields.iter().filter(|field| field.name == "local_group") {
        let value = params[field.value..field.end].split('"').nth(1);
        if let Some(group) = value.and_then(|text| text.parse().ok()).filter(is_unknown) {
            let problem = format!("the rig has no local group {group}; choose another, or leave it out");
            problems.push(ModuleError::parameter("local_group", problem));
        }
    }
    problems
}

/// The text of a template, in which the places of problems are looked up.
pub struct SourceText<'a> {
    /// The text without shorthand, in which every declaration has its uid.
    explicit: &'a ExplicitText<'a>,
    /// Fields of the explicit text: a text without problems needs no list of them.
    fields: OnceCell<Vec<Field<'a>>>,
    of_source: OnceCell<Vec<Field<'a>>>,
}

impl<'a> SourceText<'a> {
    /// Places in a text, which is scanned once, for any number of problems.
    pub fn new(explicit: &'a ExplicitText<'a>) -> Self {
        Self { explicit, fields: OnceCell::new(), of_source: OnceCell::new() }
    }

    fn fields(&self) -> &[Field<'a>] {
        let text: &'a str = &self.explicit.text;
        self.fields.get_or_init(|| fields(text))
    }

    /// A problem of the whole text.
    pub fn beginning(&self, message: String) -> SourceError {
        self.at(0, message)
    }

    /// A problem at a place of the explicit text, placed in the source.
    fn at(&self, offset: usize, message: String) -> SourceError {
        self.explicit.fault(SourceError::at(&self.explicit.text, offset, message))
    }

    /// The place of a command's problem in the text of its template: in the parameter that is wrong, else at the tag.
    /// The beginning of the text if the tag is not in it. `rig` is the rig as it was read, whose parameters have uids
    /// beside the names that people write alone.
    pub fn locate(&self, rig: &Rig, error: &BuildError) -> SourceError {
        let (text, found) = (&*self.explicit.text, self.fields());
        let named = |problem: &str| format!("{} on joint {}: {problem}", error.module, error.joint_label);
        let message = named(&error.problem.to_string());
        let Some(tag) = declaration(text, found, error.command) else { return self.at(0, message) };
        let at_tag = tag.end - text[tag.value..tag.end].trim_start().len();
        let params = found.iter().find(|field| field.bracket == tag.bracket && field.name == "params");
        let Some(params) = params else { return self.at(at_tag, message) };
        let start = params.end - text[params.value..params.end].trim_start().len();
        let written = &text[start..params.end];
        match &error.problem {
            BuildProblem::Parameters(inner) => {
                let read = rig.find_tag(error.command).and_then(|(_, tag)| match &tag.kind {
                    TagKind::Command { params, .. } => Some(params.as_str()),
                    TagKind::Feature { .. } => None,
                });
                let offset = read.map_or(inner.offset, |read| same_place(read, written, inner.offset));
                self.at(start + offset, named(&inner.message))
            }
            BuildProblem::Module(
                ModuleError::Reference { parameter, .. }
                | ModuleError::Parameter { parameter, .. }
                | ModuleError::OutOfRange { parameter, .. },
            ) => {
                let first = field_of(parameter);
                let faulty = fields(written).into_iter().find(|field| field.name == first);
                self.at(faulty.map_or(at_tag, |field| start + field.start), message)
            }
            _ => self.at(at_tag, message),
        }
    }

    /// The place of a problem of a command that a part brought: the parameter that the instance gives it, else the instance.
    pub fn locate_in_part(&self, rig: &Rig, error: &BuildError, origin: &PartOrigin) -> SourceError {
        let problem = match &error.problem {
            BuildProblem::Parameters(inner) => inner.message.clone(),
            other => other.to_string(),
        };
        let PartOrigin { title, offset, .. } = origin;
        let source = self.explicit.source();
        let fields = self.of_source.get_or_init(|| fields(source));
        let params = fields.iter().position(|field| field.start == *offset && field.name == "params");
        let parameter = faulty_parameter(rig, error);
        let faulty = params.and_then(|params| {
            let name = parameter.as_ref()?;
            fields.iter().find(|field| field.parent == Some(params) && field.name == name)
        });
        // What the instance itself does not say stands in the part's file.
        let places = if faulty.is_some() { Vec::new() } else { places_in_parts(origin, parameter.as_deref()) };
        let place = if places.is_empty() { String::new() } else { format!(" ({})", places.join(", ")) };
        let message = format!("part \"{title}\"{place}: {} on joint {}: {problem}", error.module, error.joint_label);
        SourceError::at(source, faulty.map_or(*offset, |field| field.start), message)
    }

    /// The place of a command's problem in the text of a template with parts: `origins` tells the commands that parts brought.
    pub fn locate_with_parts(&self, rig: &Rig, error: &BuildError, origins: &BTreeMap<Uid, PartOrigin>) -> SourceError {
        match origins.get(&error.command) {
            Some(origin) => self.locate_in_part(rig, error, origin),
            None => self.locate(rig, error),
        }
    }

    /// Error at the declaration of the joint, group or tag with that uid, at the named field if the declaration has it.
    pub fn locate_declared(&self, uid: Uid, field: &str, message: String) -> SourceError {
        let Some(declared) = declaration(&self.explicit.text, self.fields(), uid) else { return self.at(0, message) };
        let named = self.fields().iter().find(|other| other.bracket == declared.bracket && other.name == field);
        self.at(named.unwrap_or(declared).start, message)
    }
}

/// Places of a command of a part, or of its parameter of that name, in the file of the part, and of the part's part that has it.
fn places_in_parts(origin: &PartOrigin, parameter: Option<&str>) -> Vec<String> {
    let mut places = Vec::new();
    let mut next = Some(origin);
    while let Some((origin, source)) = next.and_then(|origin| Some((origin, origin.source.as_deref()?))) {
        next = source.origins.get(&origin.tag);
        let at = match next {
            Some(inner) => Some(inner.offset),
            None => offset_of_command(&source.text, origin.tag, parameter),
        };
        let Some(at) = at else { break };
        let SourceError { line, column, .. } = SourceError::at(&source.text, at, "");
        places.push(format!("{}:{line}:{column}", source.file));
    }
    places
}

/// Place in a text of a command, or of its parameter of that name, in bytes.
fn offset_of_command(text: &str, command: Uid, parameter: Option<&str>) -> Option<usize> {
    let explicit = template::explicit(text);
    let (text, fields) = (&*explicit.text, fields(&explicit.text));
    let tag = declaration(text, &fields, command)?;
    let at_tag = tag.end - text[tag.value..tag.end].trim_start().len();
    let params = fields.iter().position(|field| field.bracket == tag.bracket && field.name == "params");
    let faulty =
        fields.iter().find(|field| params.is_some() && field.parent == params && Some(field.name) == parameter);
    Some(explicit.in_source(faulty.map_or(at_tag, |field| field.start)))
}

/// Name of the parameter that is wrong, if the problem is one of a parameter.
fn faulty_parameter(rig: &Rig, error: &BuildError) -> Option<String> {
    match &error.problem {
        BuildProblem::Parameters(inner) => {
            let (_, tag) = rig.find_tag(error.command)?;
            let TagKind::Command { params, .. } = &tag.kind else { return None };
            let mut fields = fields(params).into_iter().filter(|field| field.depth == 1);
            let faulty = fields.find(|field| field.start <= inner.offset && inner.offset < field.end)?;
            Some(faulty.name.to_owned())
        }
        problem => Some(field_of(problem.parameter()?).to_owned()),
    }
}

/// The field by which something introduces itself.
fn declaration<'f, 'a>(text: &str, fields: &'f [Field<'a>], uid: Uid) -> Option<&'f Field<'a>> {
    let digits = uid.to_string();
    fields.iter().find(|field| {
        let value = text[field.value..field.end].trim_start().trim_start_matches('"');
        field.depth > 1
            && field.name == "uid"
            && value.get(..digits.len()).is_some_and(|value| value.eq_ignore_ascii_case(&digits))
    })
}
