//! Limits of commands: how much a file may hold, how much a build may make, how long a job may take, and how much is told.
//! `--limit NAME=NUMBER` sets each of them, for every command but `edit`.

use std::{fmt::Write as _, path::Path, str::FromStr, sync::OnceLock, time::Duration};

use super::{ArgumentError, Failure, SEED};
use crate::{
    files::{self, LoadedProject, MeshState, RealDisk},
    headless::Workbench,
    mesh::model::Model,
    modules,
    plugins::gesture::Gesture,
    processor::{BuildLimits, Modules},
    rig::{Rig, template::Template},
};

/// Limit that can be set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Limit {
    Joints,
    Nodes,
    Attributes,
    Work,
    Points,
    Triangles,
    Influences,
    Gestures,
    StrokePoints,
    Seconds,
    Listed,
    Notes,
    Message,
}

/// Name, value and meaning of each limit, in the order of [`Limit`].
const LIMITS: [(Limit, &str, u64, &str); 13] = [
    (Limit::Joints, "joints", 500_000, "joints of a rig"),
    (Limit::Nodes, "nodes", 16_384, "nodes and constraints that the commands of a rig make"),
    (Limit::Attributes, "attributes", 1_024, "attributes of one node"),
    (Limit::Work, "work", 1_000_000_000, "values that commands read and write in one run"),
    (Limit::Points, "points", 100_000_000, "points of a mesh"),
    (Limit::Triangles, "triangles", 200_000_000, "triangles of a mesh"),
    (Limit::Influences, "influences", 1_000_000_000, "influences of a mesh, of all its points"),
    (Limit::Gestures, "gestures", 1_000_000, "gestures of a list"),
    (Limit::StrokePoints, "stroke_points", 1_000_000, "points of one stroke"),
    (Limit::Seconds, "seconds", 3_600, "seconds for gestures, binding, a fit and a face, together"),
    (Limit::Listed, "listed", 200, "joints and problems that are listed for people"),
    (Limit::Notes, "notes", 200, "notes of one command"),
    (Limit::Message, "message", 1_500, "characters of one note or error"),
];

/// Values of the limits; set once, before the command runs.
static CHOSEN: OnceLock<[u64; LIMITS.len()]> = OnceLock::new();

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
        let found = LIMITS.iter().find(|(_, known, ..)| *known == name.trim());
        let (limit, ..) = found.ok_or(ArgumentError::NoLimit)?;
        let value = value.trim().parse().map_err(|_| ArgumentError::NoLimit)?;
        Ok(Self { limit: *limit, value })
    }
}

/// Error of a file that holds more than a limit.
#[derive(Debug, thiserror::Error)]
#[error(
    "`{file}`: {holder} has {count} {what}, and no more than {limit} are taken; split it, or raise the limit: --limit \
     {name}={count}"
)]
pub(super) struct LimitError {
    file: String,
    holder: String,
    what: &'static str,
    name: &'static str,
    count: u64,
    limit: u64,
}

/// Sets the limits of this process.
pub(super) fn choose(settings: &[LimitSetting]) {
    let mut values = LIMITS.map(|(_, _, value, _)| value);
    for setting in settings {
        values[setting.limit as usize] = setting.value;
    }
    // Set once: a process runs one command.
    let _ = CHOSEN.set(values);
}

/// Value of a limit.
pub(super) fn limit(limit: Limit) -> u64 {
    CHOSEN.get().map_or(LIMITS[limit as usize].2, |values| values[limit as usize])
}

/// Value of a limit, as a count of things in memory.
pub(super) fn most(of: Limit) -> usize {
    usize::try_from(limit(of)).unwrap_or(usize::MAX)
}

/// The list for `--help`.
pub(super) fn listing() -> String {
    let mut text = String::from("Limits, as --limit NAME=NUMBER sets them:");
    for (_, name, value, meaning) in LIMITS {
        let _ = write!(text, "\n  {name:<14} {value:>12}  {meaning}");
    }
    text
}

/// A text within the limit of messages: its beginning and its end, which says what to do.
pub(super) fn message(text: &str) -> String {
    let most = most(Limit::Message);
    let count = text.chars().count();
    if count <= most {
        return text.to_owned();
    }
    // Byte at which a character begins.
    let start = |number: usize| text.char_indices().nth(number).map_or(text.len(), |(at, _)| at);
    let (head, tail) = (start(most - most / 4), start(count - most / 4));
    format!("{} … {}", &text[..head], &text[tail..])
}

fn check(of: Limit, count: usize, path: &Path, holder: &str) -> Result<(), LimitError> {
    let (count, limit) = (count as u64, limit(of));
    if count <= limit {
        return Ok(());
    }
    let (_, name, _, what) = LIMITS[of as usize];
    let what = what.split(" of ").next().unwrap_or(what);
    Err(LimitError { file: path.display().to_string(), holder: holder.to_owned(), what, name, count, limit })
}

/// Refuses a mesh with more than is taken.
pub(super) fn check_model(path: &Path, model: &Model) -> Result<(), LimitError> {
    check(Limit::Points, model.points.len(), path, "the mesh")?;
    let triangles: usize = model.parts.iter().map(|part| part.triangles.len()).sum();
    check(Limit::Triangles, triangles, path, "the mesh")?;
    check(Limit::Influences, model.weights.as_ref().map_or(0, |weights| weights.joints.len()), path, "the mesh")?;
    check(Limit::Joints, model.nodes.len(), path, "the skeleton")
}

/// Refuses a rig with more than is taken.
pub(super) fn check_rig(path: &Path, rig: &Rig) -> Result<(), LimitError> {
    check(Limit::Joints, rig.len(), path, "the rig")
}

/// Refuses a project whose rigs or meshes have more than is taken.
pub(super) fn check_project(path: &Path, project: &LoadedProject) -> Result<(), LimitError> {
    project.rigs.iter().try_for_each(|rig| check_rig(path, rig))?;
    project.meshes.iter().try_for_each(|mesh| match &mesh.shape {
        MeshState::Open { model, .. } => check_model(&mesh.path, model),
        MeshState::Missing { .. } => Ok(()),
    })
}

/// Refuses a list with more gestures than are taken, or with a stroke of more points.
pub(super) fn check_gestures(path: &Path, gestures: &[Gesture]) -> Result<(), LimitError> {
    check(Limit::Gestures, gestures.len(), path, "the list")?;
    for (at, gesture) in gestures.iter().enumerate() {
        if let Gesture::Stroke { points, .. } = gesture {
            check(Limit::StrokePoints, points.len(), path, &format!("gesture {} (Stroke)", at + 1))?;
        }
    }
    Ok(())
}

/// Reads a mesh.
pub(super) fn load_model(path: &Path) -> Result<Model, Failure> {
    let model = files::load_model(&RealDisk, path)?;
    check_model(path, &model)?;
    Ok(model)
}

/// Reads a template with its parts.
pub(super) fn load_template(path: &Path) -> Result<Template, Failure> {
    let template = files::load_template(&RealDisk, path)?;
    check_rig(path, &template.rig)?;
    Ok(template)
}

/// Reads a project with its meshes.
pub(super) fn load_project(path: &Path) -> Result<LoadedProject, Failure> {
    let project = files::load_project(&RealDisk, path)?;
    check_project(path, &project)?;
    Ok(project)
}

/// Limits of builds.
fn build_limits() -> BuildLimits {
    BuildLimits { made: most(Limit::Nodes), attributes: most(Limit::Attributes), work: limit(Limit::Work) }
}

/// The modules, with the limits of builds.
pub(super) fn modules() -> Modules {
    let mut modules = modules::all();
    modules.limits = build_limits();
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
    bench.set_limits(build_limits(), Duration::from_secs(limit(Limit::Seconds)));
    bench
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_the_limits() {
        for (at, (limit, ..)) in LIMITS.iter().enumerate() {
            assert_eq!(*limit as usize, at);
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
        for (_, name, value, meaning) in LIMITS {
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
        // The limit and the three characters of the gap.
        assert_eq!(cut.chars().count(), 1503);
        assert!(cut.starts_with("a fault") && cut.ends_with("; do this"), "{cut}");
        let accents = "é".repeat(1500);
        assert_eq!(message(&accents), accents);
        assert_eq!(message("short"), "short");
    }
}
