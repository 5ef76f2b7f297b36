//! Files of templates as versions that rigs with documents took over.

use std::sync::{Arc, OnceLock};

use super::{BuiltTemplate, RigTemplate};
use crate::{
    files::{RealDisk, TemplateVersion, update_document},
    rig::{
        Rig,
        part::PartInstance,
        update::{Choices, Update},
    },
};

/// A template's file as it was read. Its parts are put into it when they are asked for.
#[derive(Debug)]
pub(super) struct TemplateFile {
    template: Option<RigTemplate>,
    version: OnceLock<Option<TemplateVersion>>,
}

impl TemplateFile {
    pub fn of(template: RigTemplate) -> Self {
        Self { template: Some(template), version: OnceLock::new() }
    }

    fn of_version(version: TemplateVersion) -> Self {
        Self { template: None, version: OnceLock::from(Some(version)) }
    }

    fn version(&self) -> Option<&TemplateVersion> {
        self.version.get_or_init(|| self.template.as_ref()?.version()).as_ref()
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

    /// The part instances of the version, with the uids that they have in the document.
    pub fn parts(&self) -> &[PartInstance] {
        self.file.as_ref().and_then(|file| file.version()).map_or(&[], TemplateVersion::parts)
    }

    /// The update of a document to a file in which part instances have other fields, and the version that the document has
    /// taken over then. `None` where the instances are the same, and where the fields are not known.
    pub fn update_of_parts(&self, document: &Rig, file: &TemplateFile, choices: &Choices) -> Option<(Update, Self)> {
        let (base, file) = (self.file.as_ref()?.version()?, file.version()?);
        let updated = update_document(&RealDisk, base, document, file, choices)?;
        let rig = Arc::new(updated.base.rig().clone());
        let file = Some(Arc::new(TemplateFile::of_version(updated.base)));
        Some((updated.update, Self { rig, file }))
    }
}
