//! Files of templates as versions that rigs with documents took over.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use super::{BuiltTemplate, RigTemplate};
use crate::{
    files::{DocumentBase, RealDisk, TemplateBase, TemplateVersion, update_document, update_with_known_parts},
    rig::{
        Rig,
        part::PartInstance,
        update::{Choices, Update},
    },
};

/// A template's file as it was read. Its parts are put into it when they are asked for.
#[derive(Debug)]
pub(super) struct TemplateFile {
    content: FileContent,
    version: OnceLock<Option<TemplateVersion>>,
    /// Part instances of a version that a project keeps, and whose parts are others now.
    kept_parts: OnceLock<Vec<PartInstance>>,
}

/// Content of a template's file.
#[derive(Debug)]
enum FileContent {
    Template(RigTemplate),
    /// A version that a project keeps, and the file.
    Kept(TemplateBase, PathBuf),
    /// The version is known.
    Version,
}

impl TemplateFile {
    pub fn of(template: RigTemplate) -> Self {
        Self::of_content(FileContent::Template(template), OnceLock::new())
    }

    fn of_version(version: TemplateVersion) -> Self {
        Self::of_content(FileContent::Version, OnceLock::from(Some(version)))
    }

    fn of_content(content: FileContent, version: OnceLock<Option<TemplateVersion>>) -> Self {
        Self { content, version, kept_parts: OnceLock::new() }
    }

    fn version(&self) -> Option<&TemplateVersion> {
        let read = || match &self.content {
            FileContent::Template(template) => template.version(),
            FileContent::Kept(base, file) => base.version(&RealDisk, file),
            FileContent::Version => None,
        };
        self.version.get_or_init(read).as_ref()
    }

    /// The part instances, with the uids that they have in the document; none where nobody knows them.
    fn parts(&self) -> &[PartInstance] {
        match (self.version(), &self.content) {
            (Some(version), _) => version.parts(),
            (None, FileContent::Kept(base, _)) => self.kept_parts.get_or_init(|| base.parts()),
            (None, _) => &[],
        }
    }

    /// Text by which a project keeps the version; `None` for a template without parts.
    fn text(&self) -> Option<Arc<str>> {
        match (self.version(), &self.content) {
            (Some(version), _) => version.text_with_parts(),
            (None, FileContent::Kept(base, _)) => base.text.clone(),
            (None, _) => None,
        }
    }
}

/// Version of a template that a rig with a document took over.
#[derive(Debug, Clone)]
pub(super) struct BaseVersion {
    pub rig: Arc<Rig>,
    /// The file of that version; `None` if nobody knows it.
    pub file: Option<Arc<TemplateFile>>,
}

impl BaseVersion {
    pub fn of(built: &BuiltTemplate) -> Self {
        Self { rig: built.rig.clone(), file: built.file.clone() }
    }

    /// The version that a project keeps of the template in a file.
    pub fn kept(base: &TemplateBase, file: &Path) -> Self {
        let file = base.text.is_some().then(|| {
            let content = FileContent::Kept(base.clone(), file.to_owned());
            Arc::new(TemplateFile::of_content(content, OnceLock::new()))
        });
        Self { rig: base.rig.clone(), file }
    }

    /// The version as a project keeps it.
    pub fn to_keep(&self) -> TemplateBase {
        TemplateBase { rig: self.rig.clone(), text: self.file.as_ref().and_then(|file| file.text()) }
    }

    /// The part instances of the version, with the uids that they have in the document.
    pub fn parts(&self) -> &[PartInstance] {
        self.file.as_ref().map_or(&[], |file| file.parts())
    }

    /// The update of a document to a file in which part instances have other fields, and the version that the document has
    /// taken over then. `None` where the instances are the same, and where the fields are not known.
    pub fn update_of_parts(&self, document: &Rig, file: &TemplateFile, choices: &Choices) -> Option<(Update, Self)> {
        let (own, file) = (self.file.as_ref()?, file.version()?);
        let updated = match own.version() {
            Some(base) => update_document(&RealDisk, base, document, file, choices)?,
            None => {
                let base = DocumentBase { rig: Some(&self.rig), parts: own.parts() };
                update_with_known_parts(&RealDisk, base, document, file, choices)?
            }
        };
        let rig = Arc::new(updated.base.rig().clone());
        let file = Some(Arc::new(TemplateFile::of_version(updated.base)));
        Some((updated.update, Self { rig, file }))
    }
}
