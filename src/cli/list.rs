//! `rigsmith list`: templates of a folder, or of all folders in which templates are looked for, by their headers alone.

use std::{
    cmp::Ordering,
    collections::BTreeMap,
    io::Read,
    path::{Path, PathBuf},
};

use clap::Args;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::{Failure, Report, report::counted};
use crate::{
    files::{
        BUNDLED_CHARACTERS, BUNDLED_PARTS, Disk, EntryKind, FileKind, PartFiles, RealDisk, SearchPaths, load_template,
    },
    rig::{
        SourceError, Uid,
        template::{self, FeatureSummary, TemplateHeader},
        version::compare,
    },
};

/// Arguments of `rigsmith list`.
#[derive(Args, Debug)]
pub(super) struct ListArgs {
    /// The folder; folders in it count, too. Without one: the working folder, the folders of the site, and what comes with
    /// Rigsmith
    pub folder: Option<PathBuf>,
}

/// Bytes of a file that are read first: a header of usual length.
const FIRST_BYTES: u64 = 8 << 10;

/// Most files that are listed.
const MOST: usize = 10_000;

/// A template by its header.
struct ListedTemplate {
    file: String,
    header: Result<TemplateHeader, HeaderError>,
}

pub(super) fn run(args: &ListArgs) -> Result<Report, Failure> {
    let mut report = Report::default();
    let site = SearchPaths::of_site().map_err(|error| Failure::Input(Box::new(error)))?;
    let own = args.folder.clone().unwrap_or_else(|| PathBuf::from("."));
    let mut listed = in_folder(&own, true, &mut report)?;
    let mut elsewhere = Vec::new();
    for folder in &site.folders {
        elsewhere.extend(in_folder(folder, false, &mut report)?);
    }
    elsewhere.retain(|other| listed.iter().all(|own| own.file != other.file));
    let bundled: Vec<&(&str, &str)> = BUNDLED_CHARACTERS.iter().chain(BUNDLED_PARTS).collect();
    // Beside a folder's templates only their versions are of interest.
    let is_listed = args.folder.is_none();
    let mut bundled: Vec<ListedTemplate> = bundled.into_par_iter().map(|one| of_bundled(one, is_listed)).collect();
    bundled.sort_by(|a, b| a.file.cmp(&b.file));
    if args.folder.is_none() {
        listed.append(&mut elsewhere);
    }
    if listed.len() > MOST {
        report
            .notes
            .push(format!("{} not listed", counted(listed.len() - MOST, "more template is", "more templates are")));
        listed.truncate(MOST);
    }
    let newest = newest(listed.iter().chain(&elsewhere).chain(&bundled));
    if listed.is_empty() {
        report.line(format!("no templates, .rig.ron, in {}", own.display()));
    }
    let templates: Vec<Value> = listed.iter().map(|one| tell(one, &newest, &mut report)).collect();
    report.set("templates", Value::Array(templates));
    if args.folder.is_none() {
        report.line("with Rigsmith:");
        let bundled: Vec<Value> = bundled.iter().map(|one| tell(one, &newest, &mut report)).collect();
        report.set("bundled", Value::Array(bundled));
    }
    Ok(report)
}

/// The templates in a folder and in those below it, in the order of their paths.
fn in_folder(top: &Path, is_needed: bool, report: &mut Report) -> Result<Vec<ListedTemplate>, Failure> {
    let mut paths = Vec::new();
    let mut folders = vec![top.to_owned()];
    while let Some(folder) = folders.pop() {
        let names = match RealDisk.list(&folder, MOST) {
            Ok(names) => names,
            Err(error) if is_needed && folder == top => {
                return Err(Failure::Input(
                    format!("`{}` cannot be listed: {error}; give a folder", folder.display()).into(),
                ));
            }
            Err(error) => {
                report.notes.push(format!("`{}` is left out: {error}", folder.display()));
                continue;
            }
        };
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
    let listed = paths.par_iter().map_init(
        || PartFiles::new(&RealDisk),
        |files, path| ListedTemplate { file: path.display().to_string(), header: header(path, files) },
    );
    Ok(listed.collect())
}

/// A template that comes with Rigsmith; `is_whole` with what only all of it tells.
fn of_bundled((name, text): &(&str, &str), is_whole: bool) -> ListedTemplate {
    let header = template::read_header(text.as_bytes()).map_err(HeaderError::from);
    let completed = header.map(|mut header| {
        let none = BTreeMap::new();
        if is_whole
            && is_unknown(&header)
            && let Ok(template) = PartFiles::given(&none).complete(Path::new(name), text.as_bytes())
        {
            header.complete_from(&template.rig);
        }
        header
    });
    ListedTemplate { file: (*name).to_owned(), header: completed }
}

/// The newest version of each template, and where it is.
fn newest<'a>(all: impl Iterator<Item = &'a ListedTemplate>) -> BTreeMap<Uid, (&'a str, &'a str)> {
    let mut newest: BTreeMap<Uid, (&str, &str)> = BTreeMap::new();
    for ListedTemplate { file, header } in all {
        let Ok(header) = header else { continue };
        let known = newest.entry(header.uid).or_insert((&header.version, file));
        if compare(known.0, &header.version) == Ordering::Less {
            *known = (&header.version, file);
        }
    }
    newest
}

/// Tells a template in a line; returns what programs read of it.
fn tell(one: &ListedTemplate, newest: &BTreeMap<Uid, (&str, &str)>, report: &mut Report) -> Value {
    let ListedTemplate { file, header } = one;
    let header = match header {
        Ok(header) => header,
        Err(error) => {
            report.line(format!("{file}: {error}"));
            return json!({ "file": file, "error": error.to_string() });
        }
    };
    let mut value = value(file, header);
    let newer = newest.get(&header.uid).filter(|(version, _)| compare(&header.version, version) == Ordering::Less);
    let newer = newer.map(|(version, at)| {
        value["newer"] = json!({ "version": version, "file": at });
        format!("; {version} is in {at}")
    });
    report.line(format!("{}{}", line(file, header), newer.unwrap_or_default()));
    details(header).into_iter().for_each(|detail| report.line(format!("    {detail}")));
    value
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
fn header(path: &Path, files: &mut PartFiles) -> Result<TemplateHeader, HeaderError> {
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
    if header.kind == "part" && header.needs.is_none() {
        if let Ok(template) = load_template(&RealDisk, path) {
            header.complete_from(&template.rig);
        }
    } else if header.joint_count == 0 {
        let all = read(template::MAX_BYTES as u64)?;
        // What is wrong with a part is told where the template is used.
        if let Ok(template) = template::read_template(&all)
            && let Ok(parts) = files.counted(path, &template)
        {
            header.complete_from_parts(&template.rig, &parts);
        }
    }
    Ok(header)
}

/// True for what only the whole template tells, unless its author wrote it down: what parts bring, and what a part needs.
fn is_unknown(header: &TemplateHeader) -> bool {
    header.joint_count == 0 || header.kind == "part" && header.needs.is_none()
}

fn line(file: &str, header: &TemplateHeader) -> String {
    let TemplateHeader { name, version, kind, joint_count, .. } = header;
    let parts = [kind.as_str(), version].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
    let about = header.description.split(['.', ':']).next().unwrap_or_default();
    let about = if about.is_empty() { String::new() } else { format!(": {about}") };
    let joints = counted(*joint_count, "joint", "joints");
    format!("{file}  {name} ({parts}{}{joints}){about}", if parts.is_empty() { "" } else { ", " })
}

/// Author, picture, features with their switches, sockets and options, as far as there are any.
fn details(header: &TemplateHeader) -> Vec<String> {
    let mut lines = Vec::new();
    let mut add = |name: &str, items: Vec<String>| {
        if !items.is_empty() {
            lines.push(format!("{name}: {}", items.join(", ")));
        }
    };
    add("author", Some(header.author.clone()).filter(|author| !author.is_empty()).into_iter().collect());
    add("preview", header.preview.clone().into_iter().collect());
    let feature = |feature: &FeatureSummary| match feature.switches.as_slice() {
        [] => feature.name.clone(),
        switches => format!("{} ({})", feature.name, switches.join(", ")),
    };
    add("features", header.features.iter().map(feature).collect());
    add("sockets", header.sockets.iter().map(|socket| format!("{} on {}", socket.name, socket.joint)).collect());
    add("options", header.options.iter().map(|option| format!("{} = {}", option.name, option.default)).collect());
    if let Some(needs) = &header.needs {
        add("needs", needs.joints.iter().chain(&needs.sockets).cloned().collect());
    }
    lines
}

fn value(file: &str, header: &TemplateHeader) -> Value {
    let mut value = serde_json::to_value(header).unwrap_or(Value::Null);
    if let Value::Object(fields) = &mut value {
        fields.insert("file".to_owned(), Value::from(file));
    }
    value
}
