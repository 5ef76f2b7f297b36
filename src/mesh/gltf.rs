//! glTF 2.0 and GLB, read into a [`Model`] and written from one.
//!
//! Files come from anywhere, so the reader checks everything before it uses it: the container, the JSON's size in
//! memory, every reference between objects, every range of bytes, the node hierarchy, every URI. Invalid data becomes a
//! [`GltfError`] that names the file and the place in it as a JSON pointer (`/accessors/3/byteOffset`); oddities are
//! repaired or left out and reported in [`Model::notes`]. The memory a file may take is bounded by [`memory_limit`];
//! images count apart, up to [`MAX_IMAGE_BYTES`].
//!
//! Reading, in the order it happens: the container and its JSON, the typed and checked document, buffers and images,
//! the hierarchy (the nodes to keep and their transforms), meshes and weights, clips. Sections cited in the code are
//! those of the glTF 2.0 specification (Khronos, version 2.0.1).

mod accessor;
mod attributes;
mod budget;
mod clips;
mod container;
mod document;
mod geometry;
mod hierarchy;
mod json;
mod materials;
mod matrix;
mod primitive;
mod skin;
mod tree;
mod uri;
mod vrm;
mod write;

pub(super) use materials::append_materials;
pub use uri::{ExternalError, ExternalFile, ExternalKind, GltfUriError};
pub use vrm::read_avatar;
pub use write::{GltfWriteSettings, write_glb, write_gltf, write_vrm};

use crate::mesh::model::Model;
use budget::{Budget, Notes};

/// Largest number of bytes of all images of one file together.
pub const MAX_IMAGE_BYTES: u64 = 256 << 20;

/// True for bytes that may be the first of a glTF or GLB file.
pub fn may_begin_with(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    bytes.starts_with(b"glTF") || first.is_none_or(|byte| matches!(byte, b'{' | b'['))
}

/// Largest number of bytes of memory for reading a file of `input` bytes (with its external buffers): 64 MiB and 16
/// times the file.
pub fn memory_limit(input: u64) -> u64 {
    (64 << 20) + input.saturating_mul(16)
}

/// Error of reading a glTF file or of writing a model as glTF.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GltfError {
    /// The bytes are not a whole glTF or GLB file.
    #[error("{file}: byte {offset}: {what}")]
    Container {
        /// The file's name as given to the reader.
        file: String,
        /// Byte offset in the file.
        offset: usize,
        /// Description of the fault and of the expected bytes.
        what: String,
    },
    /// The JSON is not well-formed.
    #[error("{file}: line {line}, column {column} of the JSON: {what}")]
    Json {
        /// The file's name as given to the reader.
        file: String,
        /// Line in the JSON, from 1.
        line: usize,
        /// Column in the JSON, from 1.
        column: usize,
        /// The parser's message.
        what: String,
    },
    /// The JSON is well-formed but its content is invalid.
    #[error("{file}: {place}: {what}")]
    Invalid {
        /// The file's name as given to the reader.
        file: String,
        /// JSON pointer to the offending value.
        place: String,
        /// Description of the fault.
        what: String,
    },
    /// The file cannot be read without an extension that is not supported.
    #[error(
        "{file}: /extensionsRequired: needs the extension {name}, which is not supported; export the file without it"
    )]
    Extension {
        /// The file's name as given to the reader.
        file: String,
        /// The extension.
        name: String,
    },
    /// A buffer or image outside the file could not be loaded.
    #[error("{file}: {place}: \"{uri}\": {fault}")]
    External {
        /// The file's name as given to the reader.
        file: String,
        /// JSON pointer to the URI.
        place: String,
        /// The URI, shortened.
        uri: String,
        /// Fault of the URI, or reason for not loading its file.
        #[source]
        fault: GltfUriError,
    },
    /// Reading would take more memory than the file's size justifies.
    #[error("{file}: {place}: takes more than the {limit} bytes of memory that a file of its size may take")]
    TooLarge {
        /// The file's name as given to the reader.
        file: String,
        /// JSON pointer to the object that asked for the memory.
        place: String,
        /// The limit in bytes.
        limit: u64,
    },
    /// The model to write is not consistent, or glTF cannot hold it.
    #[error("the model cannot be written as glTF: {what}")]
    Model {
        /// Description of the fault.
        what: String,
    },
    /// Points of a skinned object have no influence.
    #[error(
        "object \"{object}\": {points} points have no weights; skin them, or write them bound to the skin's root joint"
    )]
    Unweighted {
        /// The object's name.
        object: String,
        /// The number of its points without an influence.
        points: usize,
    },
}

impl GltfError {
    /// The file's name as given to the reader; `None` for models to write.
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::Container { file, .. }
            | Self::Json { file, .. }
            | Self::Invalid { file, .. }
            | Self::Extension { file, .. }
            | Self::External { file, .. }
            | Self::TooLarge { file, .. } => Some(file),
            Self::Model { .. } | Self::Unweighted { .. } => None,
        }
    }

    /// Place in the file: a JSON pointer, line and column of the JSON, or a byte offset.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Container { offset, .. } => Some(format!("byte {offset}")),
            Self::Json { line, column, .. } => Some(format!("{line}:{column}")),
            Self::Invalid { place, .. } | Self::External { place, .. } | Self::TooLarge { place, .. } => {
                Some(place.clone())
            }
            Self::Extension { .. } => Some("/extensionsRequired".to_owned()),
            Self::Model { .. } | Self::Unweighted { .. } => None,
        }
    }

    /// An error at a JSON pointer; the file's name is added where the reader returns.
    fn at(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Invalid { file: String::new(), place: place.into(), what: what.into() }
    }

    fn container(offset: usize, what: impl Into<String>) -> Self {
        Self::Container { file: String::new(), offset, what: what.into() }
    }

    fn model(what: impl Into<String>) -> Self {
        Self::Model { what: what.into() }
    }

    fn in_file(mut self, name: &str) -> Self {
        match &mut self {
            Self::Container { file, .. }
            | Self::Json { file, .. }
            | Self::Invalid { file, .. }
            | Self::Extension { file, .. }
            | Self::External { file, .. }
            | Self::TooLarge { file, .. } => *file = name.to_owned(),
            Self::Model { .. } | Self::Unweighted { .. } => {}
        }
        self
    }
}

/// Reads a `.gltf` or `.glb` file (distinguished by its content).
///
/// `name` is the file's name or path; errors begin with it and [`Model::name`] is its stem. `external` loads the files
/// that it refers to, each buffer's file once: it is called with a path that has been percent-decoded and checked to be
/// relative, with `/` between its parts, and below the file's folder; its error text becomes part of the returned error. The bytes it
/// returns count as part of the file; it has to limit how many it reads. A buffer that cannot be loaded is an error, an
/// image that cannot be loaded a note.
///
/// * Nodes kept: joints, nodes moved by a clip, and the ancestors of both, depth first. A matrix becomes a
///   [`Trs`](crate::mesh::model::Trs).
/// * A mesh placed twice becomes two objects. Points of skinned objects keep their bits; others are moved to model
///   space, unless their node's rest transform is the identity to within rounding (then they keep their bits, too).
/// * A mesh at or below a joint or animated node is a rigid part ([`Object::node`](crate::mesh::model::Object::node));
///   its node is the nearest kept one.
/// * Missing normals are computed; several sets of joints and weights are merged, duplicates added up, sums made one.
///
/// # Errors
/// Any [`GltfError`] but the two about writing. Costs time and memory linear in the file and in the geometry it
/// describes.
pub fn read_gltf(
    bytes: &[u8],
    name: &str,
    external: &mut dyn FnMut(ExternalFile) -> Result<Vec<u8>, ExternalError>,
) -> Result<Model, GltfError> {
    read(bytes, name, external).map_err(|error| error.in_file(name))
}

fn read(
    bytes: &[u8],
    name: &str,
    external: &mut dyn FnMut(ExternalFile) -> Result<Vec<u8>, ExternalError>,
) -> Result<Model, GltfError> {
    let budget = Budget::new(bytes.len() as u64);
    let notes = Notes::default();
    let container = container::split(bytes)?;
    let root = container::parse(container.json, &budget)?;
    let document = document::Document::new(&root, &budget, &notes)?;
    let buffers = document.load_buffers(container.bin, &budget, external)?;
    let source = accessor::Source::new(&document, &buffers, &budget);

    let mut model = Model { name: stem(name).to_owned(), ..Default::default() };
    model.material_set = materials::read(&source, external, &notes)?;
    let hierarchy = hierarchy::Hierarchy::new(&source, &notes)?;
    model.nodes = hierarchy.kept_nodes(&source)?;
    model.skins = skin::read_bindings(&source, &hierarchy, &notes)?;
    let objects = geometry::read_objects(&source, &hierarchy, &notes, &mut model)?;
    clips::read_clips(&source, &hierarchy, &objects, &notes, &mut model)?;
    model.notes = notes.sentences();
    Ok(model)
}

/// Last part of a path without its extension.
fn stem(name: &str) -> &str {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    match file.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem,
        _ => file,
    }
}
