//! `rigsmith list`: templates of a folder, or of all folders in which templates are looked for, by their headers alone.

use std::{
    cmp::Ordering,
    collections::{BTreeMap, HashSet},
    path::PathBuf,
};

use clap::Args;
use serde_json::{Value, json};

use super::{
    Failure, Report,
    limits::{self, check_time},
    report::counted,
    timed_disk::TimedDisk,
};
use crate::{
    files::{
        FolderListError, FolderListing, HeaderMemory, ListedTemplate, NewestVersions, SearchPaths, TemplatePlace,
        VersionedTemplate, list_bundled, list_templates, newest_versions,
    },
    rig::{
        template::{FeatureSummary, TemplateHeader},
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

/// The work, as the subject of a sentence.
const LISTING: &str = "listing the templates";

/// Most templates that are listed.
const MOST: usize = 10_000;

/// Most files that are named with the fault that they have in common.
const NAMED: usize = 5;

pub(super) fn run(args: &ListArgs) -> Result<Report, Failure> {
    let mut report = Report::default();
    let site = SearchPaths::of_site().map_err(|error| Failure::Input(Box::new(error)))?;
    let own = args.folder.clone().unwrap_or_else(|| PathBuf::from("."));
    let none = HeaderMemory::default();
    let found = list_templates(&TimedDisk, &own, usize::MAX, &site, &none);
    check_time(LISTING)?;
    let mut listed = match found {
        Ok(listing) => taken(listing, &mut report),
        Err(error) => return Err(Failure::Input(format!("{error}; give a folder").into())),
    };
    let mut elsewhere = Vec::new();
    for folder in &site.folders {
        let found = list_templates(&TimedDisk, folder, usize::MAX, &site, &none);
        check_time(LISTING)?;
        match found {
            Ok(listing) => elsewhere.extend(taken(listing, &mut report)),
            Err(error) => report.notes.push(left_out(&error)),
        }
    }
    let own_places: HashSet<TemplatePlace> = listed.iter().map(|own| own.place.clone()).collect();
    elsewhere.retain(|other| !own_places.contains(&other.place));
    // Beside a folder's templates only their versions are of interest.
    let bundled = list_bundled(args.folder.is_none());
    if args.folder.is_none() {
        listed.append(&mut elsewhere);
    }
    if listed.len() > MOST {
        report
            .notes
            .push(format!("{} not listed", counted(listed.len() - MOST, "more template is", "more templates are")));
        listed.truncate(MOST);
    }
    let newest = newest_versions(listed.iter().chain(&elsewhere).chain(&bundled));
    if listed.is_empty() {
        report.line(format!("no templates, .rig.ron, in {}", own.display()));
    }
    let templates: Vec<Value> = listed.iter().map(|one| tell(one, &newest, &mut report)).collect();
    tell_faults(&listed, &mut report);
    report.set("templates", Value::Array(templates));
    if args.folder.is_none() {
        report.line("with Rigsmith:");
        let told: Vec<Value> = bundled.iter().map(|one| tell(one, &newest, &mut report)).collect();
        tell_faults(&bundled, &mut report);
        report.set("bundled", Value::Array(told));
    }
    Ok(report)
}

/// The templates of a listing; folders that it leaves out are noted.
fn taken(listing: FolderListing, report: &mut Report) -> Vec<ListedTemplate> {
    report.notes.extend(listing.left_out.iter().map(left_out));
    listing.templates
}

fn left_out(error: &FolderListError) -> String {
    format!("`{}` is left out: {}", error.folder.display(), error.source)
}

/// Tells what is wrong with templates that have no header: a line for each fault, with the files that have it.
fn tell_faults(listed: &[ListedTemplate], report: &mut Report) {
    let mut files: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for ListedTemplate { place, header, .. } in listed {
        if let Err(error) = header {
            files.entry(error.to_string()).or_default().push(place.to_string());
        }
    }
    for (fault, files) in files {
        let more = files.len().saturating_sub(NAMED);
        let named = files[..files.len() - more].join(", ");
        let more = if more > 0 { format!(" and {}", counted(more, "more file", "more files")) } else { String::new() };
        report.line(format!("{named}{more}: {fault}"));
    }
}

/// Tells a template in a line, but for one without a header; returns what programs read of it.
fn tell(one: &ListedTemplate, newest: &NewestVersions, report: &mut Report) -> Value {
    let ListedTemplate { place, header, .. } = one;
    let file = &place.to_string();
    let header = match header {
        Ok(header) => header,
        Err(error) => return json!({ "file": file, "error": limits::message(&error.to_string()) }),
    };
    let mut value = value(file, header);
    let newer = newest.get(&VersionedTemplate::of(header));
    // Those that come with the program are of one version.
    let newer = newer.filter(|(version, at)| {
        (place.path().is_some() || at.path().is_some()) && compare(&header.version, version) == Ordering::Less
    });
    let newer = newer.map(|(version, at)| {
        value["newer"] = json!({ "version": version, "file": at.to_string() });
        format!("; {version} is in {at}")
    });
    report.line(format!("{}{}", line(file, header), newer.unwrap_or_default()));
    details(header).into_iter().for_each(|detail| report.line(format!("    {detail}")));
    value
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
