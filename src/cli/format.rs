//! `rigsmith format`: templates in their layout.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::{Failure, Report, explanation::Explanation, limits, outputs::check_places};
use crate::{
    files::{FileKind, LoadError, RealDisk, format_template_file, read_capped, save_atomic},
    rig::template::{self, UidStyle},
};

/// Arguments of `rigsmith format`.
#[derive(Args, Debug)]
pub(super) struct FormatArgs {
    /// The templates, `.rig.ron`
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Change nothing, and fail if a file is not in its layout
    #[arg(long)]
    check: bool,
    /// Treatment of uids
    #[arg(long, value_enum, default_value_t = UidsArg::Keep)]
    uids: UidsArg,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum UidsArg {
    /// Leave them as they are
    Keep,
    /// Write in all that are left out
    Write,
    /// Take out those that follow from labels and names
    Derive,
}

/// Result for one file.
enum FileLayout {
    /// Text as it is, and in its layout.
    Texts(String, String),
    /// Words of the error of a file that cannot be read.
    Fault(String),
}

impl FileLayout {
    /// True for a text that is not in its layout.
    fn is_another(&self) -> bool {
        matches!(self, Self::Texts(before, after) if before != after)
    }
}

pub(super) fn run(args: &FormatArgs) -> Result<Report, Failure> {
    let style = match args.uids {
        UidsArg::Keep => UidStyle::Kept,
        UidsArg::Write => UidStyle::Written,
        UidsArg::Derive => UidStyle::Derived,
    };
    let mut report = Report::default();
    let mut list = Vec::new();
    // All of them are read before the first is written, and none is written while one is at fault.
    let mut formatted = Vec::new();
    for path in &args.files {
        limits::check_time("formatting the templates")?;
        match format(path, style) {
            Err(Failure::Input(error)) if args.files.len() > 1 => {
                report.at_fault = true;
                let name = path.display().to_string();
                report.fault.get_or_insert_with(|| Explanation::of_error(error.as_ref(), &name));
                formatted.push((path, FileLayout::Fault(limits::message(&error.to_string()))));
            }
            found => {
                let (before, after) = found?;
                formatted.push((path, FileLayout::Texts(before, after)));
            }
        }
    }
    limits::check_time("formatting the templates")?;
    let is_written = !args.check && !report.at_fault;
    if is_written {
        let changed = formatted.iter().filter(|(_, found)| found.is_another());
        check_places(changed.map(|(path, _)| path.as_path()))?;
    }
    for (path, found) in formatted {
        let file = path.display();
        let (before, after) = match found {
            FileLayout::Texts(before, after) => (before, after),
            FileLayout::Fault(error) => {
                report.line(format!("error: {error}"));
                list.push(json!({ "file": file.to_string(), "changed": false, "error": error }));
                continue;
            }
        };
        let changed = before != after;
        if changed && is_written {
            save_atomic(&RealDisk, path, after.as_bytes()).map_err(|error| Failure::Input(Box::new(error)))?;
        }
        report.line(match (changed, is_written) {
            (false, _) => format!("{file}: in its layout"),
            (true, true) => format!("{file}: formatted"),
            (true, false) if args.check => format!("{file}: not in its layout; `rigsmith format` changes it"),
            (true, false) => format!("{file}: not changed: another file is at fault"),
        });
        if changed && args.check {
            report.at_fault = true;
            let fault = format!("`{file}` is not in its layout; run `rigsmith format` without --check on it");
            report.fault.get_or_insert_with(|| Explanation::at(file.to_string(), &fault));
        }
        list.push(json!({ "file": file.to_string(), "changed": changed && (is_written || args.check), "error": null }));
    }
    report.set("files", Value::Array(list));
    Ok(report)
}

/// Text of a file, as it is and in its layout.
fn format(path: &Path, style: UidStyle) -> Result<(String, String), Failure> {
    if FileKind::of(path) != Some(FileKind::Template) {
        return Err(Failure::Usage(format!("`{}` is no template; `format` takes .rig.ron", path.display())));
    }
    let bytes =
        read_capped(&RealDisk, path, template::MAX_BYTES as u64).map_err(|error| Failure::Input(Box::new(error)))?;
    let formatted = template::text_of(&bytes).and_then(|text| format_template_file(&RealDisk, path, text, style));
    let all = String::from_utf8_lossy(&bytes).into_owned();
    match formatted {
        Ok(after) => Ok((all, after)),
        Err(source) => Err(LoadError::Source { path: path.into(), text: all, source }.into()),
    }
}
