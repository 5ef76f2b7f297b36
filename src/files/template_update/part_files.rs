//! Files of parts in versions of a template that lie in different folders.
//!
//! A part is called by its way from the template. So one file has two names in two folders, and one name is two files.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

use super::{Disk, FoundPart, TemplateVersion};
use crate::{
    files::template_origin::{folder_of, straight, way},
    rig::{part::PartInstance, update::TemplateWithParts},
};

/// Versions that are compared with a template, with the parts called as that would call them.
pub(super) struct Sides<'v> {
    pub base: Option<Cow<'v, TemplateWithParts>>,
    pub file: Cow<'v, TemplateWithParts>,
}

impl<'v> Sides<'v> {
    pub(super) fn of(base: Option<&'v TemplateVersion>, now: &TemplateVersion, file: &'v TemplateVersion) -> Self {
        let base = base.map(|base| (base, base.called_in(now, None)));
        let called = file.called_in(now, base.as_ref().map(|(base, called)| (*base, &**called)));
        Self { base: base.map(|(_, called)| called), file: called }
    }
}

impl TemplateVersion {
    /// The file of a part that is called so in this version; `None` for one that comes with Rigsmith.
    fn found_part(&self, part: &str) -> Option<&FoundPart> {
        self.found.get(&self.folder().join(part))
    }

    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The content with the parts called as `now` calls them, or would call them. What is the same as in the `base`, which is
    /// given with its content as `now` would call it, is called the same.
    fn called_in<'v>(&'v self, now: &Self, base: Option<(&Self, &TemplateWithParts)>) -> Cow<'v, TemplateWithParts> {
        if self.parts().is_empty() {
            return Cow::Borrowed(&self.content);
        }
        let mut content = self.content.clone();
        for part in &mut content.template.parts {
            let same = |parts: &[PartInstance]| parts.iter().position(|other| other.uid == part.uid);
            let mine = same(now.parts()).map(|place| (now, now.parts()[place].part.as_str(), &now.content));
            let based =
                base.and_then(|(base, called)| Some((base, base.parts()[same(base.parts())?].part.as_str(), called)));
            let known = mine
                .into_iter()
                .chain(based)
                .find(|(version, name, _)| *name == part.part || self.has_same_file(&part.part, version, name));
            let called = known
                .and_then(|(_, _, content)| Some(content.template.parts[same(&content.template.parts)?].part.clone()));
            part.part = called.unwrap_or_else(|| self.name_from(now, &part.part));
        }
        Cow::Owned(content)
    }

    /// True if a part of this version is in the file that a part of another version is in.
    fn has_same_file(&self, part: &str, other: &Self, name: &str) -> bool {
        let place = |found: &FoundPart| std::path::absolute(&found.path).ok();
        let (Some(own), Some(others)) = (self.found_part(part), other.found_part(name)) else { return false };
        let (Some(own), Some(others)) = (place(own), place(others)) else { return false };
        straight(&own) == straight(&others)
    }

    /// Name that a part of this version has in `now`.
    fn name_from(&self, now: &Self, part: &str) -> String {
        let away = || {
            let (own, there) = (folder_of(&self.path)?, folder_of(&now.path)?);
            let found = self.found_part(part)?;
            let is_there = now.found_part(part).is_some_and(|other| other.content == found.content);
            if straight(&own) == straight(&there) || is_there {
                return None;
            }
            way(&there, &std::path::absolute(&found.path).ok()?)
        };
        away().unwrap_or_else(|| part.to_owned())
    }

    /// Merged instances, whose parts are called as `now` calls them, with the names that the parts have in this version.
    /// `called` is the content of this version with the names of `now`.
    pub(super) fn instances_of(
        &self,
        disk: &dyn Disk,
        now: &Self,
        called: &TemplateWithParts,
        merged: &[PartInstance],
    ) -> Vec<PartInstance> {
        let mut instances = merged.to_vec();
        let is_elsewhere = folder_of(&self.path) != folder_of(&now.path);
        for instance in instances.iter_mut().filter(|_| is_elsewhere) {
            let own = self.parts().iter().zip(&called.template.parts).find(|(own, _)| own.uid == instance.uid);
            let file: PathBuf = now.folder().join(&instance.part);
            match own {
                Some((own, called)) if called.part == instance.part => instance.part.clone_from(&own.part),
                _ if disk.entry(&file, true).is_ok() => {
                    let file = std::path::absolute(&file).unwrap_or(file);
                    instance.part = file.to_string_lossy().into_owned();
                }
                _ => {}
            }
        }
        instances
    }
}
