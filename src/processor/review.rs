//! Problems of a rig's commands, all at once.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use super::{BuildError, BuildProblem, Builder, ModuleError, Modules};
use crate::rig::{
    Field, Rig, SourceError, TagKind, Uid, fields,
    reference::{GroupScope, references_in},
    same_place,
    template::Explicit,
};

/// Largest number of failing commands that a review looks for.
const MOST: usize = 200;

/// The problems of all commands of a rig, in the order of the build list: those whose module or parameters are wrong,
/// switched off or not, and those that fail when they run. A command that fails is left out for the rest, and those that
/// cannot do without it are passed over: each fault is told once.
pub fn review(rig: &Rig, modules: &Arc<Modules>) -> Vec<BuildError> {
    let mut problems = Vec::new();
    let mut off = HashSet::new();
    let mut judged: HashMap<(&str, &str), Option<BuildProblem>> = HashMap::new();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, .. } = &tag.kind else { continue };
            // Equal commands have equal problems: a template may hold one command thousands of times.
            let problem = judged
                .entry((module.as_str(), params.as_str()))
                .or_insert_with(|| problem_before_run(rig, modules, module, params));
            if let Some(problem) = problem.clone() {
                problems.push(BuildError {
                    command: tag.uid,
                    joint: joint.data.uid,
                    joint_label: joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string()).into(),
                    module: module.as_str().into(),
                    problem,
                });
                off.insert(tag.uid);
            }
        }
    }
    let order: Vec<Uid> = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    let mut rig = rig.clone();
    rig.disable_tags(&off);
    let mut builder = Builder::new(modules.clone());
    for _ in 0..MOST {
        builder.sync(&rig);
        let Some(error) = builder.run_all().error else { break };
        if rig.find_tag(error.command).is_none() {
            break;
        }
        rig.disable_tags(&HashSet::from([error.command]));
        problems.push(error);
    }
    let places: HashMap<Uid, usize> = order.into_iter().enumerate().map(|(place, tag)| (tag, place)).collect();
    problems.sort_by_key(|error| places.get(&error.command).copied());
    problems
}

/// Problem of a command that is found without running it: in its module, its parameters, or the groups that these name.
fn problem_before_run(rig: &Rig, modules: &Modules, module: &str, params: &str) -> Option<BuildProblem> {
    let loaded = modules.load(module, params).map(drop);
    loaded.and_then(|()| Ok(known_groups(rig, params)?)).err()
}

/// Refuses local groups that the rig does not have: in references, and as the group of what is made.
fn known_groups(rig: &Rig, params: &str) -> Result<(), ModuleError> {
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
            return Err(ModuleError::reference(parameter, &references, problem));
        }
    }
    for field in fields.iter().filter(|field| field.name == "local_group") {
        let value = params[field.value..field.end].split('"').nth(1);
        if let Some(group) = value.and_then(|text| text.parse().ok()).filter(is_unknown) {
            let problem = format!("the rig has no local group {group}; choose another, or leave it out");
            return Err(ModuleError::parameter("local_group", problem));
        }
    }
    Ok(())
}

/// The text of a template, in which the places of problems are looked up.
pub struct SourceText<'a> {
    /// The text without shorthand, in which every declaration has its uid.
    explicit: &'a Explicit<'a>,
    fields: Vec<Field<'a>>,
}

impl<'a> SourceText<'a> {
    /// Scans a text once, for any number of problems.
    pub fn new(explicit: &'a Explicit<'a>) -> Self {
        Self { explicit, fields: fields(&explicit.text) }
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
        let (text, found) = (&*self.explicit.text, &self.fields);
        let message = format!("{}: {}", error.module, error.problem);
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
                self.at(start + offset, format!("{}: {}", error.module, inner.message))
            }
            BuildProblem::Module(
                ModuleError::Reference { parameter, .. } | ModuleError::Parameter { parameter, .. },
            ) => {
                let first = parameter.split([',', ' ', '[', '.']).next().unwrap_or_default();
                let named = fields(written).into_iter().find(|field| field.name == first);
                self.at(named.map_or(at_tag, |field| start + field.start), message)
            }
            _ => self.at(at_tag, message),
        }
    }

    /// The place where a joint, group or tag with that uid is declared, or of its field of that name, if it has one.
    pub fn locate_declared(&self, uid: Uid, field: &str, message: String) -> SourceError {
        let Some(declared) = declaration(&self.explicit.text, &self.fields, uid) else { return self.at(0, message) };
        let named = self.fields.iter().find(|other| other.bracket == declared.bracket && other.name == field);
        self.at(named.unwrap_or(declared).start, message)
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
