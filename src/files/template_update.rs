//! Updates of templates with parts: what a new version changes of a part instance is changed of the instance, not of what comes
//! of it.

mod document;
mod part_files;
mod same_parts;
mod template_base;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    Disk, FoundPart, LoadError, PartFiles, StoreError,
    load::{in_source, template_file},
    store::{save_template, store_rig_over},
    template_origin::moved_text,
    template_text::{TemplateText, template_text},
};
use crate::{
    modules,
    processor::Modules,
    rig::{
        Rig, SourceError, Uid,
        part::PartInstance,
        template::{FileMarks, read_template, text_of, with_instance_fields, with_instances_of, write_template},
        update::{
            Change, ChangeKind, Choices, FieldChange, MergedParts, RefittedTemplate, Take, TemplateWithParts, Update,
            diff, merge_parts, update_with, with_whole_parts,
        },
    },
};
pub use document::{DocumentUpdate, update_document, update_with_known_parts};
use part_files::Sides;
pub(super) use same_parts::with_known_uids;
use same_parts::with_same_parts;
pub use template_base::TemplateBase;

/// A version of a template: its file, and the rig with its parts.
#[derive(Debug, Clone)]
pub struct TemplateVersion {
    path: PathBuf,
    text: String,
    content: TemplateWithParts,
    /// Files of the parts, by the places beside the template.
    found: BTreeMap<PathBuf, FoundPart>,
    /// Modules whose parameters are mirrored.
    modules: Arc<Modules>,
    notes: Vec<String>,
}

impl TemplateVersion {
    /// The template of a file, which is found as [`load_template`](super::load_template) finds it.
    ///
    /// # Errors
    /// Those of [`load_template`](super::load_template).
    pub fn read(disk: &dyn Disk, path: &Path) -> Result<Self, LoadError> {
        let (path, bytes) = template_file(disk, path)?;
        Self::of(disk, path, &bytes)
    }

    /// The template with that content of its file, and parts that a reader has [found](PartFiles::found).
    ///
    /// # Errors
    /// See [`PartFiles::complete`].
    pub fn of_content(
        path: &Path,
        content: &[u8],
        found: &BTreeMap<PathBuf, FoundPart>,
        modules: &Arc<Modules>,
    ) -> Result<Self, SourceError> {
        Self::put_together(PartFiles::known(found, modules.clone()), path.to_owned(), content)
    }

    /// The template with that content of its file.
    fn of(disk: &dyn Disk, path: PathBuf, bytes: &[u8]) -> Result<Self, LoadError> {
        let read = Self::put_together(PartFiles::with_modules(disk, modules::all()), path.clone(), bytes);
        read.map_err(|source| in_source(&path, bytes, source))
    }

    fn put_together(mut files: PartFiles, path: PathBuf, bytes: &[u8]) -> Result<Self, SourceError> {
        let text = text_of(bytes)?;
        let template = read_template(bytes)?;
        let whole = files.put_together(&path, text, template.clone())?;
        let fitted = files.fitted(&path, &template).unwrap_or_default();
        // The marks of the file are kept.
        let text = String::from_utf8_lossy(bytes).into_owned();
        let content = TemplateWithParts { template, rig: whole.rig, fitted };
        let modules = files.modules().clone();
        Ok(Self { path, text, content, found: files.found, modules, notes: whole.notes })
    }

    /// A reader of the files of parts as they are now.
    fn reader<'d>(&self, disk: &'d dyn Disk) -> PartFiles<'d> {
        PartFiles::with_modules(disk, self.modules.clone())
    }

    /// The rig with its parts.
    pub fn rig(&self) -> &Rig {
        &self.content.rig
    }

    /// Notes of the reader, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The part instances, in their order.
    pub fn parts(&self) -> &[PartInstance] {
        &self.content.template.parts
    }

    /// The version with the fields of merged `instances`, and its rig then. `None` where its parts do not fit so.
    fn refitted(&self, disk: &dyn Disk, instances: &[PartInstance]) -> Option<(RefittedTemplate, Rig)> {
        if self.content.fitted.len() != self.parts().len() {
            return None;
        }
        let mut files = self.reader(disk);
        let mut fit = |instance: &PartInstance| files.fitted_part(&self.path, instance).ok();
        let refitted = self.content.with_fields(instances, &mut fit)?;
        let (_, text) = FileMarks::of(&self.text);
        let whole = files.put_together(&self.path, &text, refitted.template.clone()).ok()?;
        Some((refitted, whole.rig))
    }
}

/// An update of a template.
#[derive(Debug, Clone)]
pub struct TemplateUpdate {
    /// The rig after the update, and the changes: those of fields of part instances first.
    pub update: Update,
    /// The template that is updated.
    path: PathBuf,
    /// Texts of the template with the parts as they are after the update, best first.
    texts: Vec<String>,
}

/// The update of a template to the content of `file`: see [`update_with`]. Fields of part instances, such as `part`, `prefix`,
/// `count` and `socket`, are compared by themselves, and the rigs as they are with the fields that come of that. An instance
/// that has another uid in a version because its name or its joints are others is the same one where it has one counterpart
/// alone, which is told. Without a base whatever differs is a conflict.
pub fn update_template(
    disk: &dyn Disk,
    base: Option<&TemplateVersion>,
    now: &TemplateVersion,
    file: &TemplateVersion,
    choices: &Choices,
) -> TemplateUpdate {
    let path = now.path.clone();
    let same = with_same_parts(disk, base, now, file);
    let (base, file) = (same.base.as_ref().or(base), same.file.as_ref().unwrap_or(file));
    let FieldUpdate { mut update, told, brought, text } = with_fields_of_parts(disk, base, now, file, choices);
    let told = told_once(same.moved, told);
    update.changes = told.into_iter().chain(brought).chain(update.changes).collect();
    let (marks, plain) = FileMarks::of(&now.text);
    let of_fields = text.as_deref().unwrap_or(&plain);
    let fresh = fresh_parts(base, now, file);
    let (_, of_file) = FileMarks::of(&file.text);
    let whole = (!fresh.is_empty())
        .then(|| with_instances_of(of_fields, now.parts(), (&*of_file, file.parts()), &fresh))
        .flatten();
    // A part that cannot be had from here comes as joints and tags.
    let is_right = |text: &String| now.reader(disk).complete(&now.path, text.as_bytes()).is_ok();
    let texts = whole.into_iter().chain(text).filter(is_right).map(|text| marks.put_on(text)).collect();
    TemplateUpdate { update, path, texts }
}

/// Differences of two versions of a template, from the first to the second. Those of a part instance are told at the instance,
/// without what comes of them, and so is an instance that one of the two alone has.
pub fn diff_templates(disk: &dyn Disk, from: &TemplateVersion, to: &TemplateVersion) -> Vec<Change> {
    let same = with_same_parts(disk, None, from, to);
    let to = same.file.as_ref().unwrap_or(to);
    let FieldUpdate { update, told, .. } = with_fields_of_parts(disk, Some(from), from, to, &Take::Theirs.into());
    let changes = told_once(same.moved, told).into_iter().chain(update.changes).collect();
    with_whole_parts(changes, [&from.content, &to.content])
}

/// Changes of part instances that are `moved`, and of fields, each told once: another name as such, and as a conflict where both
/// sides gave one.
fn told_once(mut moved: Vec<Change>, mut told: Vec<FieldChange>) -> Vec<Change> {
    let is_name_of = |told: &FieldChange, of: &Change| told.is_name && told.change.uid == of.uid;
    moved.retain(|of| !told.iter().any(|told| told.change.conflict && is_name_of(told, of)));
    told.retain(|told| !moved.iter().any(|of| is_name_of(told, of)));
    moved.into_iter().chain(told.into_iter().map(|told| told.change)).collect()
}

/// Part instances of the file that neither the base nor the template has now.
fn fresh_parts(base: Option<&TemplateVersion>, now: &TemplateVersion, file: &TemplateVersion) -> Vec<Uid> {
    let is_known = |uid: Uid| {
        let mut versions = base.into_iter().chain([now]);
        versions.any(|version| version.parts().iter().any(|part| part.uid == uid))
    };
    file.parts().iter().map(|part| part.uid).filter(|uid| !is_known(*uid)).collect()
}

/// An update of versions whose part instances have the fields that they have after it.
struct FieldUpdate {
    /// The update, with what differs besides the fields.
    update: Update,
    /// Changes of fields, and of instances that lose what they changed.
    told: Vec<FieldChange>,
    /// Joints and tags that come and go with the fields.
    brought: Vec<Change>,
    /// Text of the template with the fields.
    text: Option<String>,
}

/// The update of the versions with the fields of their part instances merged; as they are where a version does not take these.
fn with_fields_of_parts(
    disk: &dyn Disk,
    base: Option<&TemplateVersion>,
    now: &TemplateVersion,
    file: &TemplateVersion,
    choices: &Choices,
) -> FieldUpdate {
    let sides = Sides::of(base, now, file);
    let merged = merge_parts(sides.base.as_deref(), &now.content, &sides.file, choices);
    let refitted =
        if merged.differs { with_merged_fields(disk, base, now, file, (&sides, merged), choices) } else { None };
    refitted.unwrap_or_else(|| FieldUpdate {
        update: update_with(base.map(TemplateVersion::rig), now.rig(), file.rig(), choices),
        told: Vec::new(),
        brought: Vec::new(),
        text: None,
    })
}

/// The update of the versions with the fields of instances that were merged. `None` where a version does not take them.
fn with_merged_fields(
    disk: &dyn Disk,
    base: Option<&TemplateVersion>,
    now: &TemplateVersion,
    file: &TemplateVersion,
    (sides, merged): (&Sides, MergedParts),
    choices: &Choices,
) -> Option<FieldUpdate> {
    let was = match (base, &sides.base) {
        (Some(base), Some(called)) => {
            Some(base.refitted(disk, &base.instances_of(disk, now, called, &merged.instances))?.1)
        }
        _ => None,
    };
    let (refitted, rig) = now.refitted(disk, &merged.instances)?;
    let (_, theirs) = file.refitted(disk, &file.instances_of(disk, now, &sides.file, &merged.instances))?;
    let update = update_with(was.as_ref(), &rig, &theirs, choices);
    // What comes and goes with other fields is told with them.
    let comes_or_goes = |change: &Change| matches!(change.kind, ChangeKind::Added | ChangeKind::Removed);
    let brought = diff(now.rig(), &rig).into_iter().filter(comes_or_goes).collect();
    let lost = refitted.lost.into_iter().map(|change| FieldChange { change, is_name: false });
    let told = merged.changes.into_iter().chain(lost).collect();
    let parts: Vec<(PartInstance, Rig)> = refitted.template.parts.into_iter().zip(refitted.fitted).collect();
    let (_, text) = FileMarks::of(&now.text);
    let text = with_instance_fields(&text, [now.content.fitted.as_slice(), parts.as_slice()], [now.rig(), &rig]);
    Some(FieldUpdate { update, told, brought, text })
}

impl TemplateUpdate {
    /// Saves the updated rig as changes of the template's text: parts stay parts. Returns notes, a sentence each.
    ///
    /// # Errors
    /// [`StoreError`]; the former file is unchanged.
    pub fn store(&self, disk: &dyn Disk, path: &Path) -> Result<Vec<String>, StoreError> {
        let reader = || PartFiles::new(disk);
        let mut first: Option<TemplateText> = None;
        for text in &self.texts {
            let is_elsewhere = self.path.parent() != path.parent();
            let moved = if is_elsewhere { moved_text(text, &self.path, path, &reader) } else { None };
            let source = moved.as_deref().map_or((self.path.as_path(), text.as_str()), |text| (path, text));
            let written = template_text(&self.update.rig, Some(source), path, &reader);
            if written.note.is_none() {
                first = Some(written);
                break;
            }
            first.get_or_insert(written);
        }
        let Some(TemplateText { text, note }) = first else {
            return store_rig_over(disk, path, &self.update.rig, &[&self.path]);
        };
        save_template(disk, path, &text)?;
        Ok(note.into_iter().collect())
    }
}

/// The text that a version is kept as for the next update of the rig in a file: with its parts if that has them all, too.
pub fn base_text(disk: &dyn Disk, version: &TemplateVersion, rig: &Path) -> String {
    let saved = TemplateVersion::read(disk, rig);
    let same = saved.as_ref().ok().and_then(|saved| with_same_parts(disk, None, saved, version).file);
    let version = same.as_ref().unwrap_or(version);
    let has = |uid: Uid| saved.as_ref().is_ok_and(|saved| saved.parts().iter().any(|part| part.uid == uid));
    let has_parts = !version.parts().is_empty() && version.parts().iter().all(|part| has(part.uid));
    let (_, text) = FileMarks::of(&version.text);
    let moved = if has_parts { moved_text(&text, &version.path, rig, &|| PartFiles::new(disk)) } else { None };
    moved.unwrap_or_else(|| write_template(version.rig()))
}
