//! Results of commands, for people and for programs.

use std::{
    borrow::Cow, collections::BTreeMap, fmt::Write as _, io::Write, path::Path, process::ExitCode, sync::OnceLock,
};

use miette::{Diagnostic, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};
use serde::Serialize;
use serde_json::{Map, Value};

use super::{
    explanation::Explanation,
    limits::{self, Limit, LimitError},
};
use crate::{
    files::{LoadError, LoadShapesError, SaveError, StoreError},
    headless::WorkbenchError,
    rig::format::json::json_text,
};

/// True if the command answers in JSON; set once, before the command runs.
static IS_JSON: OnceLock<bool> = OnceLock::new();

/// Notes whether the command answers in JSON.
pub(super) fn choose_json(is_json: bool) {
    // Set once: a process runs one command.
    let _ = IS_JSON.set(is_json);
}

/// True if results for programs are wanted; lists of thousands of joints are made for nobody else.
pub(super) fn is_json() -> bool {
    IS_JSON.get().copied().unwrap_or(true)
}

/// The result of a command that ran (also of one that found a fault in its input and still has a result).
#[derive(Default)]
pub(super) struct Report {
    /// Lines for people.
    pub lines: Vec<String>,
    /// Warnings for people, on standard error.
    pub notes: Vec<String>,
    /// Result for programs.
    pub json: Map<String, Value>,
    /// Lists for programs, by their keys in `json`, as the text of their JSON.
    lists: BTreeMap<String, String>,
    /// Marks a result that reports a fault of the input.
    pub at_fault: bool,
    /// Fault of the input, for programs.
    pub fault: Option<Explanation>,
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

    /// Adds a list for programs, if they are who the result is for. It is kept as text: the values of a list of thousands
    /// of things take ten times as much memory.
    pub fn set_list(&mut self, key: &str, items: impl IntoIterator<Item = impl Serialize>) {
        let is_wanted = is_json();
        let mut text = "[".to_owned();
        // Items are gone through in any case: the caller may look at them, too.
        for item in items.into_iter().filter(|_| is_wanted) {
            text.push_str(if text.len() > 1 { "," } else { "" });
            text.push_str(json_text(&item).as_deref().unwrap_or("null"));
        }
        text.push(']');
        self.json.insert(key.to_owned(), Value::Null);
        self.lists.insert(key.to_owned(), text);
    }

    /// Adds warnings.
    pub fn notes(&mut self, notes: impl IntoIterator<Item = impl ToString>) {
        self.notes.extend(notes.into_iter().map(|note| note.to_string()));
    }
}

/// A number with the words for what it counts: `one` for a single one, `many` for any other number.
pub(super) fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
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

impl From<SaveError> for Failure {
    fn from(error: SaveError) -> Self {
        Self::Input(Box::new(error))
    }
}

impl From<LimitError> for Failure {
    fn from(error: LimitError) -> Self {
        Self::Input(Box::new(error))
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
    code: FileText,
    #[label("{what}")]
    place: SourceSpan,
}

/// Text of a file. Its columns count characters, as those of errors do; a plain text has columns of bytes.
#[derive(Debug)]
struct FileText {
    name: String,
    text: String,
}

impl SourceCode for FileText {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let read = self.text.read_span(span, lines_before, lines_after)?;
        let place = *read.span();
        let before = self.text.get(..place.offset()).unwrap_or_default();
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let column = before[line_start..].chars().count();
        let (name, data) = (self.name.clone(), read.data());
        Ok(Box::new(MietteSpanContents::new_named(name, data, place, read.line(), column, read.line_count())))
    }
}

/// Notes within the limits of their number and length.
fn told_notes(mut notes: Vec<String>) -> Vec<String> {
    let most = limits::most(Limit::Notes);
    let more = notes.len().saturating_sub(most);
    notes.truncate(most);
    for note in &mut notes {
        *note = limits::message(note);
    }
    if more > 0 {
        let more = counted(more, "more note is", "more notes are");
        notes.push(format!("{more} left out; --limit notes=N tells more"));
    }
    notes
}

/// Prints the result and returns the exit code. `subject` is the file that the command works on. An output that is closed
/// or full is a failure: exit code 1 at least.
pub(super) fn finish(result: Result<Report, Failure>, json: bool, subject: &str) -> ExitCode {
    let mut is_told = true;
    let (code, answer, lists) = match result {
        Ok(mut report) => {
            report.notes = told_notes(report.notes);
            let code = u8::from(report.at_fault);
            if !json {
                is_told &= print(report.lines.iter().map(String::as_str));
                for note in &report.notes {
                    is_told &= complain(&one_line(&format!("note: {note}")));
                }
            }
            let mut answer = Map::from_iter([("ok".to_owned(), Value::from(!report.at_fault))]);
            answer.extend(report.json);
            if let Some(fault) = &report.fault {
                answer.insert("error".to_owned(), fault.json());
            }
            if !report.notes.is_empty() {
                answer.insert("notes".to_owned(), report.notes.into());
            }
            (code, answer, report.lists)
        }
        Err(Failure::Usage(message)) => {
            if !json {
                is_told = complain(&format!(
                    "error: {}\n\nFor more information, try 'rigsmith --help'.",
                    one_line(&limits::message(&message))
                ));
            }
            (2, failed(&of_usage(&message)), BTreeMap::new())
        }
        Err(Failure::Input(error)) => {
            if !json {
                is_told = show(error.as_ref());
            }
            (1, failed(&Explanation::of_error(error.as_ref(), subject)), BTreeMap::new())
        }
    };
    is_told &= !json || print_answer(&answer, &lists);
    ExitCode::from(if is_told { code } else { code.max(1) })
}

/// Prints lines, each within [`limits::line`]; `false` if standard output is closed or full.
pub(super) fn print<'a>(lines: impl IntoIterator<Item = &'a str>) -> bool {
    let mut out = std::io::stdout().lock();
    lines.into_iter().all(|line| writeln!(out, "{}", one_line(&limits::line(line))).is_ok()) && out.flush().is_ok()
}

/// Prints a value as one line of JSON; `false` if standard output is closed or full.
pub(super) fn print_json(value: &Value) -> bool {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", json_line(value)).is_ok() && out.flush().is_ok()
}

/// Prints an answer as one line of JSON, with `lists` as the values of their keys; `false` if standard output is closed or
/// full.
fn print_answer(answer: &Map<String, Value>, lists: &BTreeMap<String, String>) -> bool {
    let mut out = std::io::stdout().lock();
    let mut start = "{";
    let is_printed = answer.iter().all(|(key, value)| {
        let value = lists.get(key).map_or_else(|| json_line(value).into(), |list| escaped(list));
        let key = json_line(&Value::from(key.as_str()));
        write!(out, "{}{key}:{value}", std::mem::replace(&mut start, ",")).is_ok()
    });
    is_printed && writeln!(out, "}}").is_ok() && out.flush().is_ok()
}

/// JSON of a value without what a terminal obeys: such characters stand in strings only, where JSON has escapes for
/// them.
fn json_line(value: &Value) -> String {
    let text = json_text(value).unwrap_or_else(|_| value.to_string());
    if let Cow::Owned(line) = escaped(&text) {
        return line;
    }
    text
}

/// Text of JSON without what a terminal obeys.
fn escaped(text: &str) -> Cow<'_, str> {
    if !has_obeyed(text) {
        return Cow::Borrowed(text);
    }
    let mut line = String::with_capacity(text.len() + 16);
    let mut units = [0; 2];
    for c in text.chars() {
        if is_obeyed(c) {
            for unit in c.encode_utf16(&mut units) {
                let _ = write!(line, "\\u{unit:04x}");
            }
        } else {
            line.push(c);
        }
    }
    Cow::Owned(line)
}

/// Prints to standard error; `false` if that is closed or full.
fn complain(text: &str) -> bool {
    writeln!(std::io::stderr().lock(), "{}", printable(text)).is_ok()
}

/// A text without what a terminal obeys: names in files may hold control characters and marks that turn the direction
/// of writing. They are written as their numbers.
fn printable(text: &str) -> Cow<'_, str> {
    if !has_obeyed(text) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_obeyed(c) {
            let _ = write!(shown, "{}", c.escape_unicode());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// A [`printable`] text on one line: line breaks in names would make lines that look like those of a report.
fn one_line(text: &str) -> Cow<'_, str> {
    match printable(text) {
        shown if shown.contains('\n') => Cow::Owned(shown.replace('\n', "\\n")),
        shown => shown,
    }
}

fn failed(error: &Explanation) -> Map<String, Value> {
    Map::from_iter([("ok".to_owned(), Value::from(false)), ("error".to_owned(), error.json())])
}

/// A wrong use of the command. The parser of the command line tells the fault first, then usage and help.
fn of_usage(message: &str) -> Explanation {
    let fault = message.strip_prefix("error: ").unwrap_or(message);
    let fault = fault.split("\n\n").next().unwrap_or(fault);
    let fault = fault.split_whitespace().collect::<Vec<&str>>().join(" ");
    Explanation::at("command line".to_owned(), &fault)
}

/// True for characters that a terminal obeys instead of showing them, and for those that nobody sees. Joiners (200C, 200D)
/// belong to the spelling of some languages.
fn is_obeyed(c: char) -> bool {
    let is_mark = matches!(
        c,
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}'
    );
    is_mark || (c.is_control() && !matches!(c, '\n' | '\t'))
}

fn is_plain_line(text: &str) -> bool {
    !text.contains('\n') && !has_obeyed(text)
}

fn has_obeyed(text: &str) -> bool {
    text.contains(is_obeyed)
}

/// Length of a line, in bytes, from which only a piece of it is shown.
const LONG: usize = 200;

fn show(error: &(dyn std::error::Error + 'static)) -> bool {
    if let Some(LoadError::Source { path, text, source }) = error.downcast_ref::<LoadError>() {
        let offset = source.offset.min(text.len());
        let is_plain = |text: &str| text.lines().all(|line| line.len() <= LONG && !has_obeyed(line));
        let (message, what) = (limits::message(&error.to_string()), limits::message(&source.message));
        if !is_plain(lines_around(text, offset)) || !is_plain_line(&message) || !is_plain_line(&what) {
            let message = format!("error: {message}");
            return complain(&piece_of_line(path, text, offset, &message, &what));
        }
        let report = miette::Report::new(InSource {
            message,
            what,
            code: FileText { name: path.display().to_string(), text: text.clone() },
            place: SourceSpan::from(offset),
        });
        // The report is coloured by escapes of its own, which have to reach the terminal.
        writeln!(std::io::stderr().lock(), "{report:?}").is_ok()
    } else {
        // The text of an error contains those of its causes.
        complain(&one_line(&limits::message(&format!("error: {error}"))))
    }
}

/// The line of a place, the one before it and the one after it.
fn lines_around(text: &str, offset: usize) -> &str {
    let bytes = text.as_bytes();
    let mut start = offset;
    for _ in 0..2 {
        start = bytes[..start].iter().rposition(|byte| *byte == b'\n').unwrap_or(0);
    }
    let mut end = offset;
    for _ in 0..2 {
        end = bytes[end..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |next| end + next + 1);
    }
    text.get(start..end).unwrap_or(text)
}

/// An error in a long line: its place, and what stands around it.
fn piece_of_line(path: &Path, text: &str, offset: usize, message: &str, what: &str) -> String {
    let offset = text.floor_char_boundary(offset);
    let before = &text[..offset];
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let end = text[offset..].find(['\r', '\n']).map_or(text.len(), |newline| offset + newline);
    let (line, column) = (before.matches('\n').count() + 1, text[start..offset].chars().count() + 1);
    let from = text.floor_char_boundary(offset.saturating_sub(LONG / 2).max(start));
    let to = text.floor_char_boundary((offset + LONG / 2).min(end));
    let left = if from > start { "…" } else { "" };
    let right = if to < end { "…" } else { "" };
    let [piece, before] = [&text[from..to], &text[from..offset]].map(printable);
    let pad = " ".repeat(before.chars().count() + left.chars().count());
    let [message, what] = [message, what].map(one_line);
    let path = path.display().to_string();
    let path = one_line(&path);
    format!("{message}\n  --> {path}:{line}:{column}\n  | {left}{piece}{right}\n  | {pad}^ {what}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn terminals_obey_nothing_in_names() {
        assert_eq!(printable("arm\u{1b}[31m\u{202e}_l\n"), "arm\\u{1b}[31m\\u{202e}_l\n");
        assert!(matches!(printable("Kopf_ä"), Cow::Borrowed("Kopf_ä")));
        assert_eq!(one_line("arm\u{2028}\u{200b}\n{\"ok\": true}"), "arm\\u{2028}\\u{200b}\\n{\"ok\": true}");
        assert!(matches!(one_line("Kopf_ä\tb"), Cow::Borrowed("Kopf_ä\tb")));
    }

    #[test]
    fn json_with_obeyed_characters_stays_json() {
        let value = json!({ "label\u{9b}": "arm\u{202e}_l\u{7f}\u{1b}[31m ä" });
        let line = json_line(&value);
        assert!(!has_obeyed(&line), "{line:?}");
        assert_eq!(serde_json::from_str::<Value>(&line).unwrap(), value);
    }

    #[test]
    fn a_piece_of_a_long_line_is_shown() {
        let text = format!("first\n{}é?{}\nlast", "a".repeat(100_000), "b".repeat(100_000));
        let offset = text.find('?').unwrap();
        let shown = piece_of_line(Path::new("x.ron"), &text, offset, "error: no", "here");
        let lines: Vec<&str> = shown.lines().collect();
        assert_eq!(lines[1], "  --> x.ron:2:100002");
        assert!(lines[2].len() < 2 * LONG, "{}", lines[2].len());
        let column = |line: &str, c: char| line.chars().position(|other| other == c);
        assert_eq!(column(lines[2], '?'), column(lines[3], '^'));
        assert_eq!(lines_around("a\nb\nc\nd", 4), "\nb\nc\nd");
    }
}
