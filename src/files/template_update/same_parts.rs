//! Versions of a template with equal uids for the part instances that correspond to each other.

use std::{collections::BTreeMap, path::Path};

use super::{Disk, TemplateVersion};
use crate::rig::{
    Uid,
    part::PartInstance,
    template::{FileMarks, with_part_uids},
    update::{Change, moved_part, same_parts},
};

/// Versions with the uids that part instances have in the template.
#[derive(Default)]
pub(super) struct SameParts {
    /// The base, where it has others.
    pub base: Option<TemplateVersion>,
    /// The file, where it has others.
    pub file: Option<TemplateVersion>,
    /// Instances that have another name or other joints in the file.
    pub moved: Vec<Change>,
}

/// The versions with the uids of `now` for the part instances that are those of `now`.
pub(super) fn with_same_parts(
    disk: &dyn Disk,
    base: Option<&TemplateVersion>,
    now: &TemplateVersion,
    file: &TemplateVersion,
) -> SameParts {
    // A base that has what parts bring as joints of its own tells nothing of the parts.
    let base = base.filter(|base| !base.parts().is_empty());
    let of_base = base.map(|base| same_parts(now.parts(), base.parts())).unwrap_or_default();
    let known = base.unwrap_or(now);
    let of_file = same_parts(known.parts(), file.parts());
    let has = |uid: Uid| file.parts().iter().any(|part| part.uid == uid);
    let mut uids = BTreeMap::new();
    let mut moved = Vec::new();
    for part in file.parts() {
        let there = of_file.get(&part.uid).copied().unwrap_or(part.uid);
        let uid = of_base.get(&there).copied().unwrap_or(there);
        if uid == part.uid || has(uid) {
            continue;
        }
        uids.insert(part.uid, uid);
        let former = known.parts().iter().find(|known| known.uid == there);
        moved.extend(former.and_then(|former| moved_part(uid, former, part)));
    }
    let renewed = if uids.is_empty() { None } else { file.with_part_uids(disk, &uids) };
    if renewed.is_none() {
        moved.clear();
    }
    let base = base.filter(|_| !of_base.is_empty()).and_then(|base| base.with_part_uids(disk, &of_base));
    SameParts { base, file: renewed, moved }
}

/// The version of a template in which the part instances that are those of `known` have their uids, and those that are called
/// otherwise. `None` where no other uid has to be given.
pub(super) fn with_uids_of(
    disk: &dyn Disk,
    known: &[PartInstance],
    file: &TemplateVersion,
) -> Option<(TemplateVersion, Vec<Change>)> {
    let uids = same_parts(known, file.parts());
    if uids.is_empty() {
        return None;
    }
    let moved = file.parts().iter().filter_map(|part| {
        let uid = *uids.get(&part.uid)?;
        moved_part(uid, known.iter().find(|known| known.uid == uid)?, part)
    });
    let moved = moved.collect();
    Some((file.with_part_uids(disk, &uids)?, moved))
}

/// The text of a template's file, in which the part instances that are those of `known` have their uids; `None` where no
/// other one has to be written.
pub(in crate::files) fn with_known_uids(
    disk: &dyn Disk,
    file: &Path,
    text: &str,
    known: &[PartInstance],
) -> Option<String> {
    if known.is_empty() {
        return None;
    }
    let version = TemplateVersion::of(disk, file.to_owned(), text.as_bytes()).ok()?;
    let uids = same_parts(known, version.parts());
    if uids.is_empty() { None } else { version.with_part_uids(disk, &uids).map(|renewed| renewed.text) }
}

impl TemplateVersion {
    /// The version with other uids of part instances, and what comes of these with the uids that follow. `None` where its text
    /// cannot say so.
    fn with_part_uids(&self, disk: &dyn Disk, uids: &BTreeMap<Uid, Uid>) -> Option<Self> {
        let (marks, plain) = FileMarks::of(&self.text);
        let given: Vec<Option<Uid>> = self.parts().iter().map(|part| uids.get(&part.uid).copied()).collect();
        let mut text = with_part_uids(&plain, &given)?;
        for (instance, fitted) in &self.content.fitted {
            let Some(uid) = uids.get(&instance.uid) else { continue };
            let renewed = PartInstance { uid: *uid, ..instance.clone() };
            // References may say uids.
            for (was, is) in instance.brought(fitted).into_iter().zip(renewed.brought(fitted)) {
                let was = was.to_string();
                if text.contains(&was) {
                    text = text.replace(&was, &is.to_string());
                }
            }
        }
        Self::put_together(self.reader(disk), self.path.clone(), marks.put_on(text).as_bytes()).ok()
    }
}
