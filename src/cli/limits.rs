//! Limits of commands and of the window: `--limit NAME=NUMBER` sets each of [`RigLimits`].

use std::{borrow::Cow, fmt::Write as _, path::Path, str::FromStr, sync::OnceLock};

use super::{ArgumentError, Failure, SEED, outputs::check_named_files};
pub(super) use crate::plugins::limits::{Deadline, Limit, LimitError, RigLimits};
use crate::{
    files::{self, Disk, LoadError, LoadedProject, MeshState, RealDisk, TemplateVersion},
    headless::Workbench,
    mesh::model::Model,
    modules,
    plugins::gesture::Gesture,
    processor::Modules,
    rig::{Rig, template::Template, text::RigText},
};

/// Most characters of a line of a report, unless more are set for messages.
const MOST_LINE: usize = 10_000;

/// Values of the limits; set once, before the command runs.
static CHOSEN: OnceLock<RigLimits> = OnceLock::new();

/// End of the time of this command.
static DEADLINE: OnceLock<Deadline> = OnceLock::new();

/// Value of `--limit`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LimitSetting {
    limit: Limit,
    value: u64,
}

impl FromStr for LimitSetting {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let (name, value) = text.split_once('=').ok_or(ArgumentError::NoLimit)?;
        let limit = Limit::named(name.trim()).ok_or(ArgumentError::NoLimit)?;
        let value = value.trim().parse().map_err(|_| ArgumentError::NoLimit)?;
        Ok(Self { limit, value })
    }
}

/// Sets the limits of this process.
pub(super) fn choose(settings: &[LimitSetting]) {
    let limits = settings.iter().fold(RigLimits::default(), |limits, set| limits.with(set.limit, set.value));
    // Set once: a process runs one command.
    let _ = DEADLINE.set(limits.deadline());
    let _ = CHOSEN.set(limits);
}

/// Gives the command up where its time is over; `work` is the subject of a sentence.
pub(super) fn check_time(work: &'static str) -> Result<(), Failure> {
    DEADLINE.get().map_or(Ok(()), |deadline| deadline.check(work)).map_err(|late| Failure::Input(Box::new(late)))
}

/// The limits of this process.
pub(super) fn chosen() -> RigLimits {
    CHOSEN.get().cloned().unwrap_or_default()
}

/// Value of a limit, as a count of things in memory.
pub(super) fn most(of: Limit) -> usize {
    chosen().most(of)
}

/// The list for `--help`.
pub(super) fn listing() -> String {
    let mut text = String::from("Limits, as --limit NAME=NUMBER sets them:");
    for limit in Limit::all() {
        let _ = write!(text, "\n  {:<14} {:>12}  {}", limit.name(), limit.default_value(), limit.meaning());
    }
    text
}

/// A text within the limit of messages: its beginning and its end, which says what to do.
pub(super) fn message(text: &str) -> String {
    chosen().shortened(text)
}

/// A line of a report within a limit that leaves room for the lists of a line: its beginning and its end.
pub(super) fn line(text: &str) -> Cow<'_, str> {
    if text.len() <= MOST_LINE {
        return Cow::Borrowed(text);
    }
    let limits = chosen();
    let most = limits.get(Limit::Message).max(MOST_LINE as u64);
    Cow::Owned(limits.with(Limit::Message, most).shortened(text))
}

/// Refuses a mesh with more than is taken.
pub(super) fn check_model(path: &Path, model: &Model) -> Result<(), LimitError> {
    chosen().check_model(&path.display().to_string(), model)
}

/// Refuses a rig with more than is taken.
pub(super) fn check_rig(path: &Path, rig: &Rig) -> Result<(), LimitError> {
    chosen().check_rig(&path.display().to_string(), rig)
}

/// Refuses a project whose rigs or meshes have more than is taken.
pub(super) fn check_project(path: &Path, project: &LoadedProject) -> Result<(), LimitError> {
    project.rigs.iter().try_for_each(|rig| check_rig(path, rig))?;
    project.meshes.iter().try_for_each(|mesh| match &mesh.shape {
        MeshState::Open { model, .. } => check_model(&mesh.path, model),
        MeshState::Missing { .. } => Ok(()),
    })
}

/// Refuses more frames than pass for springs.
pub(super) fn check_frames(path: &Path, count: u32) -> Result<(), LimitError> {
    chosen().check_frames(&path.display().to_string(), count)
}

/// Refuses a list with more gestures than are taken, or with a stroke of more points.
pub(super) fn check_gestures(path: &Path, gestures: &[Gesture]) -> Result<(), LimitError> {
    chosen().check_gestures(&path.display().to_string(), gestures)
}

/// Reads an input, unless it names a file that is an output.
pub(super) fn load<T, E>(path: &Path, read: impl FnOnce(&dyn Disk) -> Result<T, E>) -> Result<T, Failure>
where
    Failure: From<E>,
{
    let (found, files) = files::read_noting_files(&RealDisk, read);
    let found = found?;
    check_named_files(path, &files)?;
    Ok(found)
}

/// Reads a mesh.
pub(super) fn load_model(path: &Path) -> Result<Model, Failure> {
    let model = load(path, |disk| files::load_model(disk, path))?;
    check_model(path, &model)?;
    Ok(model)
}

/// Reads packed clips as a model without a mesh.
pub(super) fn load_packed_clips(path: &Path) -> Result<Model, Failure> {
    let packed = files::load_packed_clips(&RealDisk, path)?;
    chosen().check_packed(&path.display().to_string(), &packed)?;
    let model = packed.model(&files::stem(path));
    check_model(path, &model)?;
    Ok(model)
}

/// Reads a `.rig` text.
pub(super) fn load_rig_text(path: &Path) -> Result<RigText, Failure> {
    let text = files::load_rig_text(&RealDisk, path)?;
    text.check_ways().map_err(|source| LoadError::RigText { path: path.into(), source })?;
    chosen().check_rig_text(&path.display().to_string(), &text)?;
    Ok(text)
}

/// Reads a template with its parts.
pub(super) fn load_template(path: &Path) -> Result<Template, Failure> {
    let template = load(path, |disk| files::load_template(disk, path))?;
    check_rig(path, &template.rig)?;
    Ok(template)
}

/// Reads a version of a template.
pub(super) fn load_version(path: &Path) -> Result<TemplateVersion, Failure> {
    let version = load(path, |disk| TemplateVersion::read(disk, path))?;
    check_rig(path, version.rig())?;
    Ok(version)
}

/// Reads a project with its meshes.
pub(super) fn load_project(path: &Path) -> Result<LoadedProject, Failure> {
    let project = load(path, |disk| files::load_project(disk, path))?;
    check_project(path, &project)?;
    Ok(project)
}

/// Refuses a project with a mesh outside of its folder, for commands that show or write its meshes.
pub(super) fn refuse_outside(project: &LoadedProject) -> Result<(), Failure> {
    let refused = project.meshes.iter().find_map(|mesh| match &mesh.shape {
        MeshState::Missing { error, .. } if matches!(**error, LoadError::Outside { .. }) => Some(error.clone()),
        _ => None,
    });
    refused.map_or(Ok(()), |error| Err(Failure::Input(Box::new(error))))
}

/// The modules, with the limits of builds.
pub(super) fn modules() -> Modules {
    let mut modules = modules::all();
    modules.limits = chosen().build();
    modules.deadline = DEADLINE.get().copied();
    modules
}

/// A workbench with a rig.
pub(super) fn workbench(rig: Rig) -> Workbench {
    limited(Workbench::with_rig(SEED, rig))
}

/// A workbench with an empty rig.
pub(super) fn empty_workbench(name: &str) -> Workbench {
    limited(Workbench::new(SEED, name))
}

fn limited(mut bench: Workbench) -> Workbench {
    bench.set_rig_limits(chosen());
    bench
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_the_limits() {
        for (at, limit) in Limit::all().enumerate() {
            assert_eq!(limit as usize, at);
            assert_eq!(Limit::named(limit.name()), Some(limit));
        }
    }

    #[test]
    fn settings_have_a_name_and_a_number() {
        let set = |text: &str| text.parse::<LimitSetting>();
        assert_eq!(set("joints=7"), Ok(LimitSetting { limit: Limit::Joints, value: 7 }));
        for wrong in ["joints", "joints=", "joints=-1", "nothing=7", ""] {
            assert_eq!(set(wrong), Err(ArgumentError::NoLimit), "{wrong}");
        }
    }

    #[test]
    fn readme_lists_all_limits() {
        let readme = include_str!("../../README.md");
        for limit in Limit::all() {
            let (name, value, meaning) = (limit.name(), limit.default_value(), limit.meaning());
            let line = readme.lines().find(|line| line.starts_with(&format!("| `{name}` |")));
            let line = line.unwrap_or_else(|| panic!("{name} is not listed"));
            assert!(line.replace(',', "").contains(&format!("| {value} |")), "{line}");
            assert!(line.contains(&meaning.replace(',', "")) || line.contains(meaning), "{line}");
        }
    }

    #[test]
    fn long_messages_keep_their_beginning_and_end() {
        let text = format!("a fault {}; do this", "é".repeat(5000));
        let cut = message(&text);
        assert!(cut.starts_with("a fault") && cut.ends_with("; do this"), "{cut}");
        let gap = " … 3517 characters left out … ";
        assert!(cut.contains(gap), "{cut}");
        assert_eq!(cut.chars().count(), 1500 + gap.chars().count());
        let name = "x".repeat(1 << 20);
        assert!(line(&name).len() < 2 * MOST_LINE && line("short") == "short");
        let accents = "é".repeat(1500);
        assert_eq!(message(&accents), accents);
        assert_eq!(message("short"), "short");
    }
}
