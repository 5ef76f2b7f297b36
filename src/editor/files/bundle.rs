//! Meshes and templates that come with Rigsmith, opened without a file.

use std::{collections::BTreeMap, path::Path};

use super::error::OpenError;
use crate::{
    files::{BUNDLED_CHARACTERS, PartFiles},
    mesh::{
        model::Model,
        obj::{ObjSettings, read_model},
    },
    rig::Rig,
};

/// A mesh that comes with Rigsmith.
#[derive(Debug, Clone, Copy)]
pub struct BundledModel {
    /// Name of the mesh, and of the file to which a project copies it.
    pub name: &'static str,
    /// Description within a sentence: "the bundled hand".
    pub about: &'static str,
    /// Bytes of the OBJ file.
    pub(super) bytes: &'static [u8],
}

/// The meshes that come with Rigsmith.
pub static BUNDLED_MODELS: [BundledModel; 3] = [
    BundledModel {
        name: BODY,
        about: "the bundled character",
        bytes: include_bytes!("../../../assets/models/biped.obj"),
    },
    BundledModel { name: "hand", about: "the bundled hand", bytes: include_bytes!("../../../assets/models/hand.obj") },
    BundledModel { name: HEAD, about: "the bundled head", bytes: include_bytes!("../../../assets/models/head.obj") },
];

/// Name of the bundled body.
pub const BODY: &str = "biped";
/// Name of the bundled head.
pub const HEAD: &str = "head";

impl BundledModel {
    /// The mesh of that name.
    ///
    /// # Errors
    /// There is no such mesh.
    pub(in crate::editor) fn named(name: &str) -> Result<&'static Self, OpenError> {
        let found = BUNDLED_MODELS.iter().find(|model| model.name == name);
        found.ok_or_else(|| OpenError::NotBundled { name: name.to_owned() })
    }

    /// Reads the mesh.
    pub(in crate::editor) fn read(&self) -> Result<Model, OpenError> {
        Ok(read_model(self.bytes, self.name, &ObjSettings::default(), &mut |_| None)?)
    }
}

/// Description within a sentence of bundled content of that name.
pub(in crate::editor) fn describe(name: &str) -> String {
    let model = BUNDLED_MODELS.iter().find(|model| model.name == name);
    model.map_or_else(|| format!("the bundled {name}"), |model| model.about.to_owned())
}

/// The bundled template of that name, with its parts.
///
/// # Errors
/// There is no such template, or it cannot be read.
pub(in crate::editor) fn template(name: &str) -> Result<Rig, OpenError> {
    let found = BUNDLED_CHARACTERS.iter().find(|(known, _)| *known == name);
    let (_, text) = found.ok_or_else(|| OpenError::NotBundled { name: name.to_owned() })?;
    let none = BTreeMap::new();
    Ok(PartFiles::given(&none).complete(Path::new(name), text.as_bytes())?.rig)
}
