//! Templates as assets.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::{
    asset::{
        Asset, AssetLoader, AssetPath, AsyncWriteExt, LoadContext,
        io::{Reader, Writer},
        saver::{AssetSaver, SavedAsset},
    },
    reflect::TypePath,
};

use crate::{
    files::{FoundPart, PartFiles, TemplateVersion, template_text},
    modules,
    processor::Modules,
    rig::{
        Rig, SourceError, Uid,
        part::{PartInstance, PartSocket},
        template::{PartOrigin, Template, text_of},
    },
};

const BYTE_ORDER_MARK: &str = "\u{FEFF}";

/// A template as an asset, `.rig.ron`.
#[derive(Asset, TypePath, Debug, Clone)]
pub struct RigTemplate {
    rig: Arc<Rig>,
    sockets: Arc<[PartSocket]>,
    /// Part instances that the text has.
    instances: Arc<[PartInstance]>,
    /// Origins of the commands that came of parts.
    origins: Arc<BTreeMap<Uid, PartOrigin>>,
    /// The text that the rig was read from; empty for a rig that was made by code.
    text: Arc<str>,
    /// True if the file begins with a byte order mark, which the text does not have.
    has_mark: bool,
    /// True if the rig is what the text says.
    is_of_text: bool,
    parts: Arc<TemplateParts>,
}

/// Parts of a template as they were when it was read.
#[derive(Debug)]
struct TemplateParts {
    /// The template's own file.
    path: PathBuf,
    found: BTreeMap<PathBuf, FoundPart>,
    modules: Arc<Modules>,
}

impl TemplateParts {
    fn reader(&self) -> PartFiles<'_> {
        PartFiles::known(&self.found, self.modules.clone())
    }
}

impl RigTemplate {
    /// A template of a rig.
    pub fn new(rig: Rig) -> Self {
        let parts = TemplateParts { path: PathBuf::new(), found: BTreeMap::new(), modules: modules::all().into() };
        Self {
            rig: Arc::new(rig),
            sockets: Arc::from([]),
            instances: Arc::from([]),
            origins: Arc::default(),
            text: Arc::from(""),
            has_mark: false,
            is_of_text: false,
            parts: Arc::new(parts),
        }
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
        let Template { rig, sockets, instances, origins, .. } = files.complete(path, content)?;
        let (found, modules) = (files.found.clone(), files.modules().clone());
        let parts = Arc::new(TemplateParts { path: path.to_owned(), found, modules });
        let text = Arc::from(text_of(content)?);
        let has_mark = content.starts_with(BYTE_ORDER_MARK.as_bytes());
        let (rig, sockets, instances) = (Arc::new(rig), sockets.into(), instances.into());
        Ok(Self { rig, sockets, instances, origins: Arc::new(origins), text, has_mark, is_of_text: true, parts })
    }

    /// The rig.
    pub fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// Places that other things hang on: those of the template itself and of its parts.
    pub fn sockets(&self) -> &Arc<[PartSocket]> {
        &self.sockets
    }

    /// Part instances that the text has, in its order.
    pub fn instances(&self) -> &Arc<[PartInstance]> {
        &self.instances
    }

    /// Origins of the commands that came of parts, with their places in the text.
    pub fn origins(&self) -> &BTreeMap<Uid, PartOrigin> {
        &self.origins
    }

    /// Replaces the rig; a save changes the text only where the rig differs from it, and parts stay parts.
    pub fn set_rig(&mut self, rig: Rig) {
        if rig != *self.rig {
            self.rig = Arc::new(rig);
            self.is_of_text = false;
        }
    }

    /// The text that the rig was read from; empty for a rig that was made by code.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The text that a save writes: that of the file where it was read from one, changed where the rig differs from it. What
    /// is different about parts becomes changes of their instances; a part of which these cannot say it is written out.
    pub fn saved(&self) -> String {
        let mark = if self.has_mark { BYTE_ORDER_MARK } else { "" };
        if self.is_of_text {
            return format!("{mark}{}", self.text);
        }
        let path = self.parts.path.as_path();
        let source = (!self.text.is_empty()).then(|| (path, &*self.text));
        format!("{mark}{}", template_text(&self.rig, source, path, &|| self.parts.reader()).text)
    }

    /// The template's own file; empty for a text that comes from none.
    pub(super) fn file(&self) -> &Path {
        &self.parts.path
    }

    /// The template as a version that updates compare, with the parts as they were when it was read. `None` for a rig that was
    /// made or changed by code.
    pub(super) fn version(&self) -> Option<TemplateVersion> {
        let TemplateParts { path, found, modules } = &*self.parts;
        let mark = if self.has_mark { BYTE_ORDER_MARK } else { "" };
        let content = format!("{mark}{}", self.text);
        if self.is_of_text { TemplateVersion::of_content(path, content.as_bytes(), found, modules).ok() } else { None }
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
