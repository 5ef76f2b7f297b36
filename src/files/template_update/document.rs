//! Updates of documents: rigs that hold what parts bring, and not the parts themselves.
//!
//! A document is written as changes of the version that it took over last, and is then a version like the two others. So
//! documents and files are updated in one way.

use super::{
    Disk, PartFiles, TemplateVersion,
    same_parts::{with_same_parts, with_uids_of},
    template_text, update_template,
};
use crate::{
    files::DocumentBase,
    rig::{
        Rig,
        part::have_same_fields,
        update::{Choices, Update, edits_between, update_with},
    },
};

/// An update of a document.
#[derive(Debug, Clone)]
pub struct DocumentUpdate {
    /// The document after the update, and the changes: those of fields of part instances first.
    pub update: Update,
    /// The version that the document has taken over then, with the uids that part instances have in the document.
    pub base: TemplateVersion,
}

/// The update of a document to the content of `file`, as [`update_template`] updates a file. `base` is the version that the
/// document took over last. `None` where the two have the same part instances, whose fields need no comparison, and where the
/// text of the base cannot say what the document is.
pub fn update_document(
    disk: &dyn Disk,
    base: &TemplateVersion,
    document: &Rig,
    file: &TemplateVersion,
    choices: &Choices,
) -> Option<DocumentUpdate> {
    if have_same_fields(base.parts(), file.parts()) {
        return None;
    }
    let now = base.saying(document)?;
    let mut update = update_template(disk, Some(base), &now, file, choices).update;
    let mut rig = document.clone();
    for edit in edits_between(now.rig(), &update.rig).ok()? {
        rig.apply(&edit).ok()?;
    }
    update.rig = rig;
    let base = with_same_parts(disk, Some(base), &now, file).file.unwrap_or_else(|| file.clone());
    Some(DocumentUpdate { update, base })
}

/// The update of a document to the content of `file`, where of the base no more is known than its rig and its part instances.
/// Part instances that have another uid in the file, because their names or joints are others there, are the same ones. `None`
/// where the instances have the uids that they have in the document: the rigs tell all then.
pub fn update_with_known_parts(
    disk: &dyn Disk,
    base: DocumentBase,
    document: &Rig,
    file: &TemplateVersion,
    choices: &Choices,
) -> Option<DocumentUpdate> {
    let (renewed, moved) = with_uids_of(disk, base.parts, file)?;
    let mut update = update_with(base.rig, document, renewed.rig(), choices);
    update.changes.splice(..0, moved);
    Some(DocumentUpdate { update, base: renewed })
}

impl TemplateVersion {
    /// The version whose text is changed so that it says what a rig is. `None` where that needs parts to be written out.
    fn saying(&self, rig: &Rig) -> Option<Self> {
        let reader = || PartFiles::known(&self.found, self.modules.clone());
        let source = (self.path.as_path(), self.text.as_str());
        let written = template_text(rig, Some(source), &self.path, &reader);
        if written.note.is_some() {
            return None;
        }
        Self::put_together(reader(), self.path.clone(), written.text.as_bytes()).ok()
    }
}
