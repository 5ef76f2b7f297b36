//! Templates of one name in a list, and a few words that tell each of them from the others.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    editor::counts::counted,
    files::{ListedTemplate, TemplatePlace},
};

/// Source of the templates that come with the program.
const BUNDLED: &str = "Rigsmith";

/// Words for each template that others of the list would be taken for; `None` where the name is enough.
pub(super) fn differences(listed: &[Arc<ListedTemplate>]) -> Vec<Option<String>> {
    let mut by_name: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (number, template) in listed.iter().enumerate() {
        let name = template.name().replace('_', " ").to_lowercase();
        by_name.entry(name).or_default().push(number);
    }
    let mut words = vec![None; listed.len()];
    for numbers in by_name.values().filter(|numbers| numbers.len() > 1) {
        let alike: Vec<&ListedTemplate> = numbers.iter().map(|number| &*listed[*number]).collect();
        for (number, told) in numbers.iter().zip(told_apart(&alike)) {
            words[*number] = Some(told);
        }
    }
    words
}

/// The first property that no two of some templates have in common; the whole place of each if there is none.
fn told_apart(alike: &[&ListedTemplate]) -> Vec<String> {
    let properties: [fn(&ListedTemplate) -> Option<String>; 5] = [kind, source, joints, version, file];
    for property in properties {
        let told: Vec<String> = alike.iter().filter_map(|template| property(template)).collect();
        let mut sorted = told.clone();
        sorted.sort_unstable();
        sorted.dedup();
        if sorted.len() == alike.len() {
            return told;
        }
    }
    alike.iter().map(|template| template.place.to_string()).collect()
}

fn kind(template: &ListedTemplate) -> Option<String> {
    Some(if template.is_part() { "part" } else { "template" }.to_owned())
}

/// Folder of a file.
fn source(template: &ListedTemplate) -> Option<String> {
    match &template.place {
        TemplatePlace::Bundled(_) => Some(BUNDLED.to_owned()),
        TemplatePlace::File(path) => Some(path.parent()?.file_name()?.to_string_lossy().into_owned()),
    }
}

fn joints(template: &ListedTemplate) -> Option<String> {
    let header = template.header.as_ref().ok()?;
    (header.joint_count > 0).then(|| counted(header.joint_count, "joint", "joints"))
}

fn version(template: &ListedTemplate) -> Option<String> {
    let header = template.header.as_ref().ok()?;
    (!header.version.is_empty()).then(|| format!("version {}", header.version))
}

/// Name of the file without its ending.
fn file(template: &ListedTemplate) -> Option<String> {
    Some(template.place.stem())
}
