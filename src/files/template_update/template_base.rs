//! Versions that rigs of projects took over, with their part instances, which the rig of a version does not have.

use std::{path::Path, sync::Arc};

use super::{Disk, TemplateVersion};
use crate::rig::{
    Rig, RigEdit, Uid,
    part::PartInstance,
    template::{FileMarks, read_template, says_the_same},
};

/// Version of its template that a rig of a project took over last.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateBase {
    /// The rig, with what its parts brought.
    pub rig: Arc<Rig>,
    /// Text of the version, in which part instances have the uids that they have in the rig. `None` for a template without
    /// parts, and where nobody knows it.
    pub text: Option<Arc<str>>,
}

impl From<Arc<Rig>> for TemplateBase {
    fn from(rig: Arc<Rig>) -> Self {
        Self { rig, text: None }
    }
}

impl TemplateBase {
    /// The version as its text says it, with its parts as they are now for the template's `file`. `None` where nobody knows
    /// the text, and where it says another rig: a part has changed since, and what it brought then is in the rig alone.
    pub fn version(&self, disk: &dyn Disk, file: &Path) -> Option<TemplateVersion> {
        let text = self.text.as_deref()?;
        let version = TemplateVersion::of(disk, file.to_owned(), text.as_bytes()).ok()?;
        // A project keeps no poses of templates.
        let (said, kept) = (without_poses(version.rig()), without_poses(&self.rig));
        says_the_same(&said, &kept, &version.content.template.rig).then_some(version)
    }

    /// Part instances of the version, with the uids that they have in the rig; none where nobody knows them.
    pub fn parts(&self) -> Vec<PartInstance> {
        let read = self.text.as_deref().and_then(|text| read_template(text.as_bytes()).ok());
        read.map_or_else(Vec::new, |template| template.parts)
    }
}

fn without_poses(rig: &Rig) -> Rig {
    let mut rig = rig.clone();
    let poses: Vec<Uid> = rig.stored_poses().iter().map(|pose| pose.uid).collect();
    for pose in poses {
        let removed = rig.apply(&RigEdit::RemoveStoredPose(pose));
        debug_assert!(removed.is_ok(), "a pose of the rig was refused: {removed:?}");
    }
    rig
}

impl TemplateVersion {
    /// Text by which a project keeps the version; `None` for a template without parts.
    pub fn text_with_parts(&self) -> Option<Arc<str>> {
        let (_, text) = FileMarks::of(&self.text);
        (!self.parts().is_empty()).then(|| Arc::from(&*text))
    }
}
