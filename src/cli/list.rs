//! `rigsmith list`: templates of a folder, by their headers alone.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use clap::Args;
use serde_json::{Value, json};

use super::{Failure, Report};
use crate::{
    files::{Disk, EntryKind, FileKind, RealDisk, load_template},
    rig::{
        SourceError,
        template::{self, TemplateHeader},
    },
};

/// Arguments of `rigsmith list`.
#[derive(Args, Debug)]
pub(super) struct ListArgs {
    /// The folder; folders in it count, too
    #[arg(default_value = ".")]
    folder: PathBuf,
}

/// Bytes of a file that are read first: a header of usual length.
const FIRST_BYTES: u64 = 8 << 10;

/// Most files that are listed.
const MOST: usize = 10_000;

pub(super) fn run(args: &ListArgs) -> Result<Report, Failure> {
    let mut report = Report::default();
    let mut paths = Vec::new();
    let mut folders = vec![args.folder.clone()];
    let mut is_first = true;
    while let Some(folder) = folders.pop() {
        let names = match RealDisk.list(&folder, MOST) {
            Ok(names) => names,
            Err(error) if is_first => {
                return Err(Failure::Input(
                    format!("`{}` cannot be listed: {error}; give a folder", folder.display()).into(),
                ));
            }
            Err(error) => {
                report.notes.push(format!("`{}` is left out: {error}", folder.display()));
                continue;
            }
        };
        is_first = false;
        for name in names {
            let path = folder.join(&name);
            match RealDisk.entry(&path, false).map(|entry| entry.kind) {
                Ok(EntryKind::Folder) if !name.to_string_lossy().starts_with('.') => folders.push(path),
                Ok(EntryKind::File) if FileKind::of(&path) == Some(FileKind::Template) => paths.push(path),
                _ => {}
            }
        }
    }
    paths.sort();
    if paths.len() > MOST {
        report.notes.push(format!("{} more templates are not listed", paths.len() - MOST));
        paths.truncate(MOST);
    }
    let mut list = Vec::new();
    for path in &paths {
        match header(path) {
            Ok(header) => {
                report.line(line(path, &header));
                list.push(value(path, &header));
            }
            Err(error) => {
                report.line(format!("{}: {error}", path.display()));
                list.push(json!({ "file": path.display().to_string(), "error": error.to_string() }));
            }
        }
    }
    if paths.is_empty() {
        report.line(format!("no templates, .rig.ron, in {}", args.folder.display()));
    }
    report.set("templates", Value::Array(list));
    Ok(report)
}

/// Reason why a template of a folder cannot be listed.
#[derive(Debug, thiserror::Error)]
enum HeaderError {
    /// A file that cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// A file that is no template.
    #[error(transparent)]
    Template(#[from] SourceError),
}

/// Header of a file: of its beginning if that is enough, else of all of it, else of the template with its parts.
fn header(path: &Path) -> Result<TemplateHeader, HeaderError> {
    let read = |limit: u64| -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        RealDisk.open(path)?.take(limit).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let first = read(FIRST_BYTES)?;
    let is_whole = (first.len() as u64) < FIRST_BYTES;
    let mut header = match template::read_header(&first) {
        Ok(header) if is_whole || header.joint_count > 0 => header,
        _ => {
            let all = read(template::MAX_BYTES as u64)?;
            template::read_header(&all)?
        }
    };
    // What parts bring, and what a part needs, only the whole template tells, unless its author wrote it down.
    let is_unknown = header.joint_count == 0 || header.kind == "part" && header.needs.is_none();
    if is_unknown && let Ok(template) = load_template(&RealDisk, path) {
        header.complete_from(&template.rig);
    }
    Ok(header)
}

fn line(path: &Path, header: &TemplateHeader) -> String {
    let TemplateHeader { name, version, kind, joint_count, .. } = header;
    let parts = [kind.as_str(), version].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
    let about = header.description.split(['.', ':']).next().unwrap_or_default();
    let about = if about.is_empty() { String::new() } else { format!(": {about}") };
    format!(
        "{}  {name} ({parts}{}{joint_count} joints){about}",
        path.display(),
        if parts.is_empty() { "" } else { ", " }
    )
}

fn value(path: &Path, header: &TemplateHeader) -> Value {
    let mut value = serde_json::to_value(header).unwrap_or(Value::Null);
    if let Value::Object(fields) = &mut value {
        fields.insert("file".to_owned(), Value::from(path.display().to_string()));
    }
    value
}
