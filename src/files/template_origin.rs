//! Templates that rigs were made from: a rig is written as changes of the text of its template, so that its parts stay parts.

use std::{
    collections::BTreeMap,
    path::{Component, Path, PathBuf},
};

use super::{
    BUNDLED_CHARACTERS, BUNDLED_PARTS, Disk, FileKind, FoundPart, LoadError, PartFiles, StoreError,
    atomic::linked_file,
    load::{in_source, template_file},
    store::save_template,
    store_rig,
    template_text::{PartReader, TemplateText, template_text},
};
use crate::rig::{
    EditError, Rig, RigEdit, Uid,
    part::PartInstance,
    template::{self, Template, read_template, text_of},
    update::edits_between,
};

/// Note about parts that cannot be found from the place of the file.
const PARTS_AWAY: &str =
    "the parts of the template were written out: their files cannot be named from the place of the new one";

/// Template that a rig was made from, by a fit for example.
#[derive(Debug, Clone)]
pub struct TemplateOrigin {
    /// The file; `None` for a template that comes with Rigsmith, whose parts are found from everywhere.
    path: Option<PathBuf>,
    text: String,
    /// The template with its parts.
    rig: Rig,
}

impl TemplateOrigin {
    /// The template of a file, which is found as [`load_template`](super::load_template) finds it.
    ///
    /// # Errors
    /// Those of [`load_template`](super::load_template).
    pub fn read(disk: &dyn Disk, path: &Path) -> Result<Self, LoadError> {
        let (path, bytes) = template_file(disk, path)?;
        let text = text_of(&bytes).map_err(|source| in_source(&path, &bytes, source))?.to_owned();
        let template = PartFiles::new(disk).complete(&path, &bytes);
        let rig = template.map_err(|source| in_source(&path, &bytes, source))?.rig;
        Ok(Self { path: Some(path), text, rig })
    }

    /// The character or part of that name that comes with Rigsmith, such as `biped` or `parts/hand`.
    pub fn bundled(name: &str) -> Option<Self> {
        let part = format!("{}.rig.ron", name.strip_suffix(".rig.ron").unwrap_or(name));
        let character = BUNDLED_CHARACTERS.iter().find(|(known, _)| *known == name);
        let (_, text) = character.or_else(|| BUNDLED_PARTS.iter().find(|(known, _)| *known == part))?;
        let none = BTreeMap::new();
        let template = PartFiles::given(&none).complete(Path::new(name), text.as_bytes()).ok()?;
        Some(Self { path: None, text: (*text).to_owned(), rig: template.rig })
    }

    /// The character that comes with Rigsmith of which a rig has most of the joints.
    pub fn of(rig: &Rig) -> Option<Self> {
        let has_most = |origin: &Self| {
            let there = origin.rig.walk().filter(|joint| rig.joint(joint.data.uid).is_some()).count();
            2 * there > origin.rig.len()
        };
        BUNDLED_CHARACTERS.iter().filter_map(|(name, _)| Self::bundled(name)).find(has_most)
    }

    /// The template with its parts.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The content of a rig that was made from the template, as a rig with the template's uid.
    ///
    /// # Errors
    /// [`EditError`] of an edit that is refused: the rig has values that no rig can have.
    pub fn adopted(&self, rig: &Rig) -> Result<Rig, EditError> {
        let mut own = self.rig.clone();
        for edit in edits_between(&self.rig, rig)? {
            own.apply(&edit)?;
        }
        own.apply(&RigEdit::SetDroppedParts(rig.dropped_parts().to_vec()))?;
        Ok(own)
    }

    /// The text for a file of a rig at `path`; `None` if its parts cannot be named from there.
    fn text_at(&self, path: &Path, rig: Uid, reader: PartReader) -> Option<String> {
        let text = match &self.path {
            Some(own) => moved_text(&self.text, own, path, reader)?,
            None => self.text.clone(),
        };
        if rig == self.rig.uid() { Some(text) } else { template::with_rig_uid(&text, rig) }
    }
}

/// Saves a rig as changes of the text of the template that it was made from: parts stay parts, and what is different of them,
/// such as the places of joints, stands with them. Parts beside the template are called by their way from `path`. Another kind
/// of file is saved as by [`store_rig`]. Returns notes, a sentence each: about what the format cannot hold, and about parts that
/// had to be written out.
///
/// # Errors
/// [`StoreError`]; the former file is unchanged.
pub fn store_rig_from(
    disk: &dyn Disk,
    path: &Path,
    rig: &Rig,
    origin: &TemplateOrigin,
) -> Result<Vec<String>, StoreError> {
    if FileKind::of(path) != Some(FileKind::Template) {
        return store_rig(disk, path, rig);
    }
    let reader = || PartFiles::new(disk);
    let linked = linked_file(disk, path);
    let of_link = origin.text_at(&linked, rig.uid(), &reader);
    let place = if of_link.is_some() { linked.as_path() } else { path };
    let source = of_link.or_else(|| origin.text_at(path, rig.uid(), &reader));
    let TemplateText { text, note } = template_text(rig, source.as_deref().map(|text| (place, text)), place, &reader);
    let (text, away) = match &source {
        Some(source) => (template::with_changes_on_lines(&text, source), None),
        None => (text, Some(PARTS_AWAY)),
    };
    save_template(disk, path, &text)?;
    Ok(note.into_iter().chain(away.map(str::to_owned)).collect())
}

/// True if a file is a template that has parts.
pub fn has_parts(disk: &dyn Disk, path: &Path) -> bool {
    let has = |bytes: &[u8]| read_template(bytes).is_ok_and(|template| !template.parts.is_empty());
    FileKind::of(path) == Some(FileKind::Template) && template_file(disk, path).is_ok_and(|(_, bytes)| has(&bytes))
}

/// The text of the template whose file is `from`, for a file at `to`: parts that lie beside the one are called by their way from
/// the other, unless they lie beside that, too. `None` if it does not say the same there.
pub(super) fn moved_text(text: &str, from: &Path, to: &Path, reader: PartReader) -> Option<String> {
    let template = read_template(text.as_bytes()).ok()?;
    let (old, new) = (folder_of(from)?, folder_of(to)?);
    if template.parts.is_empty() || old == new {
        return Some(text.to_owned());
    }
    let (mut before, mut after) = (reader(), reader());
    let whole = before.put_together(from, text, template.clone()).ok()?;
    // A part that is missing there is one that has to be called by its way.
    drop(after.put_together(to, text, template.clone()));
    let part_beside = |files: &PartFiles, at: &Path, part: &PartInstance| -> Option<FoundPart> {
        let first = at.parent()?.join(&part.part);
        files.found.get(&first).filter(|found| found.path == first).cloned()
    };
    let away = |part: &PartInstance| {
        let found = part_beside(&before, from, part)?;
        let is_there = part_beside(&after, to, part).is_some_and(|other| other.content == found.content);
        if is_there { None } else { std::path::absolute(&found.path).ok() }
    };
    let ways: [&dyn Fn(&Path) -> Option<String>; 2] =
        [&|part: &Path| way(&new, part), &|part: &Path| part.to_str().map(str::to_owned)];
    ways.into_iter().find_map(|name| {
        let file = |part: &PartInstance| Some((name(&away(part)?)?, part.uid));
        let files: Vec<_> = template.parts.iter().map(file).collect();
        let text = template::with_part_files(text, &files)?;
        is_same(&whole, &template.rig, reader().complete(to, text.as_bytes()).ok()?).then_some(text)
    })
}

/// True if two templates with their parts say the same; `own` is what they have besides their parts.
fn is_same(a: &Template, own: &Rig, b: Template) -> bool {
    template::says_the_same(&a.rig, &b.rig, own)
}

pub(super) fn folder_of(file: &Path) -> Option<PathBuf> {
    Some(std::path::absolute(file).ok()?.parent()?.to_owned())
}

/// The way from a folder to a file, both absolute, with slashes; `None` if they are on different drives.
pub(super) fn way(folder: &Path, file: &Path) -> Option<String> {
    let (folder, file) = (straight(folder), straight(file));
    let shared = folder.iter().zip(&file).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return None;
    }
    let up = folder[shared..].iter().map(|_| Some(".."));
    let down = file[shared..].iter().map(|component| component.as_os_str().to_str());
    Some(up.chain(down).collect::<Option<Vec<_>>>()?.join("/"))
}

/// The components of an absolute path without detours.
pub(super) fn straight(path: &Path) -> Vec<Component<'_>> {
    let mut out: Vec<Component> = Vec::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.last(), Some(Component::Normal(_))) => {
                out.pop();
            }
            component => out.push(component),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn ways_lead_from_folders_to_files() {
        let cases = [
            ("/a/b", "/a/b/parts/arm.rig.ron", "parts/arm.rig.ron"),
            ("/a/b", "/a/c/arm.rig.ron", "../c/arm.rig.ron"),
            ("/a/b/../c", "/a/./b/arm.rig.ron", "../b/arm.rig.ron"),
            ("/", "/arm.rig.ron", "arm.rig.ron"),
        ];
        for (folder, file, wanted) in cases {
            assert_eq!(way(Path::new(folder), Path::new(file)).as_deref(), Some(wanted), "{folder} {file}");
        }
    }
}
