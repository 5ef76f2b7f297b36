//! Templates as assets.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bevy::{
    asset::{
        Asset, AssetLoader, AssetPath, AsyncWriteExt, LoadContext,
        io::{Reader, Writer},
        saver::{AssetSaver, SavedAsset},
    },
    reflect::TypePath,
};

use crate::{
    files::PartFiles,
    rig::{
        Rig, SourceError,
        part::PartSocket,
        template::{Template, text_of, write_template, write_template_over},
    },
};

/// A template as an asset, `.rig.ron`.
#[derive(Asset, TypePath, Debug, Clone)]
pub struct RigTemplate {
    /// True if the text has parts, whose content the rig has.
    has_parts: bool,
    rig: Arc<Rig>,
    sockets: Arc<[PartSocket]>,
    /// The text that the rig was read from; empty for a rig that was made by code.
    text: Arc<str>,
}

impl RigTemplate {
    /// A template of a rig.
    pub fn new(rig: Rig) -> Self {
        Self { has_parts: false, rig: Arc::new(rig), sockets: Arc::from([]), text: Arc::from("") }
    }

    /// The template that a text holds. Its parts are those that come with Rigsmith.
    ///
    /// # Errors
    /// See [`PartFiles::complete`]. A template with other parts needs [`read_with_parts`](Self::read_with_parts).
    pub fn read(content: &[u8]) -> Result<Self, SourceError> {
        Self::read_with_parts(content, Path::new(""), &mut PartFiles::given(&BTreeMap::new()))
    }

    /// The template that a file holds, with its parts.
    ///
    /// # Errors
    /// See [`PartFiles::complete`].
    pub fn read_with_parts(content: &[u8], path: &Path, files: &mut PartFiles) -> Result<Self, SourceError> {
        Self::of(files.complete(path, content)?, content)
    }

    fn of(template: Template, content: &[u8]) -> Result<Self, SourceError> {
        let has_parts = !template.instances.is_empty();
        let (rig, sockets, text) = (Arc::new(template.rig), template.sockets.into(), Arc::from(text_of(content)?));
        Ok(Self { has_parts, rig, sockets, text })
    }

    /// The rig.
    pub fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// Places that other things hang on: those of the template itself and of its parts.
    pub fn sockets(&self) -> &Arc<[PartSocket]> {
        &self.sockets
    }

    /// Replaces the rig; a save changes the text only where the rig differs from it.
    pub fn set_rig(&mut self, rig: Rig) {
        if rig != *self.rig {
            self.rig = Arc::new(rig);
            if std::mem::take(&mut self.has_parts) {
                // Parts are written out: the text does not say what is different about them.
                self.text = Arc::from("");
            }
        }
    }

    /// The text that the rig was read from; empty for a rig that was made by code.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The text that a save writes: that of the file where it was read from one, changed where the rig differs from it.
    pub fn saved(&self) -> String {
        if self.has_parts {
            return self.text.to_string();
        }
        write_template_over(&self.rig, &self.text).unwrap_or_else(|| write_template(&self.rig))
    }

    /// True if both are the same in memory.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.rig, &other.rig)
    }
}

/// Reader of templates for Bevy's asset server.
#[derive(Debug, Clone, Copy, Default, TypePath)]
pub struct RigTemplateLoader;

/// Reason for not loading or saving a template.
#[derive(Debug, thiserror::Error)]
pub enum RigTemplateError {
    /// The source of assets cannot be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The file is no template.
    #[error(transparent)]
    Source(#[from] SourceError),
}

impl AssetLoader for RigTemplateLoader {
    type Asset = RigTemplate;
    type Settings = ();
    type Error = RigTemplateError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<RigTemplate, Self::Error> {
        let mut content = Vec::new();
        reader.read_to_end(&mut content).await?;
        let path = context.path().clone();
        // The parts that are asked for are read until all are there; the server loads the template again when one changes.
        let mut parts = BTreeMap::new();
        loop {
            let mut files = PartFiles::given(&parts);
            let template = RigTemplate::read_with_parts(&content, path.path(), &mut files);
            let missing = files.missing;
            if missing.is_empty() {
                return Ok(template?);
            }
            for part in missing {
                let of_source = AssetPath::from_path_buf(part.clone()).with_source(path.source().clone_owned());
                let content = context.read_asset_bytes(of_source).await.ok();
                parts.insert(part, content);
            }
        }
    }

    fn extensions(&self) -> &[&str] {
        &["rig.ron"]
    }
}

/// Writer of templates for Bevy's asset server: see [`RigTemplate::saved`].
#[derive(Debug, Clone, Copy, Default, TypePath)]
pub struct RigTemplateSaver;

impl AssetSaver for RigTemplateSaver {
    type Asset = RigTemplate;
    type Settings = ();
    type OutputLoader = RigTemplateLoader;
    type Error = RigTemplateError;

    async fn save(
        &self,
        writer: &mut Writer,
        asset: SavedAsset<'_, '_, RigTemplate>,
        (): &(),
        _: AssetPath<'_>,
    ) -> Result<(), Self::Error> {
        Ok(writer.write_all(asset.get().saved().as_bytes()).await?)
    }
}
