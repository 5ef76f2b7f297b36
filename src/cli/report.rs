//! Results of commands, for people and for programs.

use std::{io::Write, process::ExitCode};

use miette::{Diagnostic, NamedSource, SourceSpan};
use serde_json::{Map, Value, json};

use crate::{
    files::{LoadError, LoadShapesError, StoreError},
    headless::WorkbenchError,
};

/// The result of a command that ran (also of one that found a fault in its input and still has a result).
#[derive(Default)]
pub(super) struct Report {
    /// Lines for people.
    pub lines: Vec<String>,
    /// Warnings for people, on standard error.
    pub notes: Vec<String>,
    /// Result for programs.
    pub json: Map<String, Value>,
    /// Result for programs that is not an object.
    pub list: Option<Value>,
    /// Marks a result that reports a fault of the input.
    pub at_fault: bool,
}

impl Report {
    /// Adds a line.
    pub fn line(&mut self, line: impl Into<String>) {
        self.lines.push(line.into());
    }

    /// Adds a value for programs.
    pub fn set(&mut self, key: &str, value: impl Into<Value>) {
        self.json.insert(key.to_owned(), value.into());
    }

    /// Adds warnings.
    pub fn notes(&mut self, notes: impl IntoIterator<Item = impl ToString>) {
        self.notes.extend(notes.into_iter().map(|note| note.to_string()));
    }
}

/// Error of a command.
pub(super) enum Failure {
    /// Fault of the input: exit code 1.
    Input(Box<dyn std::error::Error>),
    /// Wrong usage of the command: exit code 2.
    Usage(String),
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Kind { .. } => Self::Usage(error.to_string()),
            error => Self::Input(Box::new(error)),
        }
    }
}

impl From<LoadShapesError> for Failure {
    fn from(error: LoadShapesError) -> Self {
        match error {
            LoadShapesError::Load(error) => error.into(),
            LoadShapesError::Kind { .. } => Self::Usage(error.to_string()),
            error => Self::Input(Box::new(error)),
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Kind { .. } => Self::Usage(error.to_string()),
            error => Self::Input(Box::new(error)),
        }
    }
}

impl From<WorkbenchError> for Failure {
    fn from(error: WorkbenchError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// Error in a text file, shown with its source line.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{message}")]
struct InSource {
    message: String,
    what: String,
    #[source_code]
    code: NamedSource<String>,
    #[label("{what}")]
    place: SourceSpan,
}

/// Prints the result and returns the exit code.
pub(super) fn finish(result: Result<Report, Failure>, json: bool) -> ExitCode {
    let (code, answer) = match result {
        Ok(report) => {
            let code = u8::from(report.at_fault);
            if !json {
                print(report.lines.iter().map(String::as_str));
                for note in &report.notes {
                    eprintln!("note: {note}");
                }
            }
            if let (true, Some(list)) = (json, &report.list) {
                print([list.to_string().as_str()]);
                return ExitCode::from(code);
            }
            let mut answer = Map::from_iter([("ok".to_owned(), Value::from(!report.at_fault))]);
            answer.extend(report.json);
            if !report.notes.is_empty() {
                answer.insert("notes".to_owned(), report.notes.into());
            }
            (code, answer)
        }
        Err(Failure::Usage(message)) => {
            if !json {
                eprintln!("error: {message}\n\nFor more information, try 'rigsmith --help'.");
            }
            (2, failed(&message))
        }
        Err(Failure::Input(error)) => {
            if !json {
                show(error.as_ref());
            }
            (1, failed(&error.to_string()))
        }
    };
    if json {
        print([Value::Object(answer).to_string().as_str()]);
    }
    ExitCode::from(code)
}

/// Prints lines; a closed pipe is no error.
fn print<'a>(lines: impl IntoIterator<Item = &'a str>) {
    let mut out = std::io::stdout().lock();
    for line in lines {
        if writeln!(out, "{line}").is_err() {
            return;
        }
    }
}

fn failed(message: &str) -> Map<String, Value> {
    Map::from_iter([("ok".to_owned(), Value::from(false)), ("error".to_owned(), json!(message))])
}

fn show(error: &(dyn std::error::Error + 'static)) {
    if let Some(LoadError::Source { path, text, source }) = error.downcast_ref::<LoadError>() {
        let report = miette::Report::new(InSource {
            message: error.to_string(),
            what: source.message.clone(),
            code: NamedSource::new(path.display().to_string(), text.clone()),
            place: SourceSpan::from(source.offset.min(text.len())),
        });
        eprintln!("{report:?}");
    } else {
        // The text of an error contains those of its causes.
        eprintln!("error: {error}");
    }
}
