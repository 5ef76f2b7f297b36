//! Errors for programs: fault, place and remedy apart.

use std::{error::Error, path::Path};

use serde_json::{Value, json};

use super::limits;
use crate::{
    files::{LoadError, LoadShapesError, ReadError, SaveError, StoreError},
    mesh::gltf::GltfError,
};

/// Remedy where the text of an error names none.
const SEE_HELP: &str = "correct it and run the command again; `rigsmith --help` lists commands and options";

/// An error in three parts.
#[derive(Debug, PartialEq)]
pub(super) struct Explanation {
    /// Fault, in a sentence.
    pub what: String,
    /// Place of the fault: a file, with line and column where the reader knows them, or the command line.
    pub place: String,
    /// Remedy.
    pub remedy: String,
}

impl Explanation {
    /// An error of the input. `subject` is the file that the command works on, for errors that name no file themselves.
    pub fn of_error(error: &(dyn Error + 'static), subject: &str) -> Self {
        Self::of_error_or(error, subject, SEE_HELP)
    }

    /// An error of the input, with a remedy for one that names none.
    pub fn of_error_or(error: &(dyn Error + 'static), subject: &str, remedy: &str) -> Self {
        let place = place(error).unwrap_or_else(|| subject.to_owned());
        Self::parted(place, &error.to_string(), remedy)
    }

    /// A fault at a place, told by a text that ends in the remedy: texts of errors are written as `fault; remedy`.
    pub fn at(place: String, text: &str) -> Self {
        Self::parted(place, text, SEE_HELP)
    }

    fn parted(place: String, text: &str, otherwise: &str) -> Self {
        let (what, remedy) = text.rsplit_once("; ").unwrap_or((text, otherwise));
        Self { what: limits::message(what), place, remedy: limits::message(remedy) }
    }

    /// The object of `--json`.
    pub fn json(&self) -> Value {
        json!({ "what": self.what, "where": self.place, "do": self.remedy })
    }
}

/// Place that an error, or one of its causes, names.
fn place(error: &(dyn Error + 'static)) -> Option<String> {
    let mut cause = Some(error);
    while let Some(error) = cause {
        let found = of_load(error).or_else(|| of_save(error)).or_else(|| of_gltf(error));
        if found.is_some() {
            return found;
        }
        cause = error.source();
    }
    None
}

fn of_load(error: &(dyn Error + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref::<ReadError>() {
        return Some(named(error.path()));
    }
    if let Some(error) = error.downcast_ref::<LoadShapesError>() {
        return match error {
            LoadShapesError::Load(error) => of_load(error),
            LoadShapesError::Shapes { path, .. }
            | LoadShapesError::TooMany { path, .. }
            | LoadShapesError::Kind { path } => Some(named(path)),
        };
    }
    match error.downcast_ref::<LoadError>()? {
        LoadError::Read(error) => Some(named(error.path())),
        LoadError::Gltf(error) => of_gltf(error),
        LoadError::Source { path, source, .. } => Some(format!("{}:{}:{}", named(path), source.line, source.column)),
        error => {
            let file = named(error.path()?);
            Some(match error.line() {
                Some(line) => format!("{file}:{line}"),
                None => file,
            })
        }
    }
}

fn of_save(error: &(dyn Error + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref::<SaveError>() {
        return Some(named(error.path()));
    }
    error.downcast_ref::<StoreError>().map(|error| named(error.path()))
}

fn of_gltf(error: &(dyn Error + 'static)) -> Option<String> {
    let error = error.downcast_ref::<GltfError>()?;
    let file = error.file()?;
    Some(match error.place() {
        Some(place) => format!("{file}:{place}"),
        None => file.to_owned(),
    })
}

fn named(path: &Path) -> String {
    path.display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::SourceError;

    #[test]
    fn a_place_has_line_and_column() {
        let source = SourceError::at("(\n  oops: 1)", 4, "there is no field `oops` here; remove it");
        let error = LoadError::Source { path: "a.rig.ron".into(), text: String::new(), source };
        let explanation = Explanation::of_error(&error, "b.rig.ron");
        assert_eq!(explanation.place, "a.rig.ron:2:3");
        assert_eq!(explanation.remedy, "remove it");
        assert!(explanation.what.ends_with("there is no field `oops` here"), "{}", explanation.what);
    }

    #[test]
    fn an_error_without_place_is_that_of_the_subject() {
        let explanation = Explanation::of_error(&std::fmt::Error, "b.obj");
        assert_eq!((explanation.place.as_str(), explanation.remedy.as_str()), ("b.obj", SEE_HELP));
    }
}
