//! Reasons why a document is not opened or not written.

use std::path::PathBuf;

use crate::{
    files::{LoadError, ReadError, SaveError, StoreError, journal::JournalError},
    mesh::obj::ObjError,
    plugins::limits::LimitError,
    processor::BuildError,
    rig::{EditError, SourceError, skin::SkinError, vrm::AvatarError},
    solve::{bake_clip::BakeError, program::ProgramError},
};

/// Reason why a document is not opened.
#[derive(Debug, thiserror::Error)]
pub(in crate::editor) enum OpenError {
    /// The file has weights, which are no document.
    #[error("{name} has only weights; open the project or the .glb that they belong to")]
    WeightsAlone {
        /// Name of the file.
        name: String,
    },
    /// The file has animation clips, which are no document.
    #[error("{name} has only animation clips; open the rig or the project that they belong to first")]
    ClipsAlone {
        /// Name of the file.
        name: String,
    },
    /// The file has the motion of a skeleton, which is no document.
    #[error("{name} has only motion; open a mesh or a template with joints first, and then the motion onto it")]
    MotionAlone {
        /// Name of the file.
        name: String,
    },
    /// The file's name ends in `.ron`, like a list of gestures.
    #[error("{name} is neither template nor project; those end in .rig.ron and .rigsmith.ron")]
    Gestures {
        /// Name of the file.
        name: String,
    },
    /// The file's name has no known ending.
    #[error(
        "{name} is nothing that can be opened; a mesh ends in .obj, .gltf, .glb or .vrm, a template in .rig.ron or \
         .rig, a project in .rigsmith.ron"
    )]
    Unknown {
        /// Name of the file.
        name: String,
    },
    /// The project has no rig.
    #[error("`{}` has no rig; open its mesh instead", .0.display())]
    NoRig(PathBuf),
    /// The project has several rigs.
    #[error("`{}` has several rigs, and the window edits one; split it into one project a rig", .0.display())]
    SeveralRigs(PathBuf),
    /// The file cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The file of a journal cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The journal holds nothing to recover.
    #[error("`{}`: {source}", path.display())]
    Journal {
        /// The journal.
        path: PathBuf,
        /// Error of the reader.
        source: JournalError,
    },
    /// A bundled mesh is invalid.
    #[error(transparent)]
    Bundled(#[from] ObjError),
    /// A bundled template is invalid.
    #[error(transparent)]
    BundledTemplate(#[from] SourceError),
    /// Rigsmith comes with no such mesh or template.
    #[error("Rigsmith comes with no \"{name}\"; choose from the start page")]
    NotBundled {
        /// The name.
        name: String,
    },
    /// The rig refuses a joint of the file.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The file holds more than is taken.
    #[error(transparent)]
    Limit(#[from] LimitError),
}

/// Reason why a document is not written.
#[derive(Debug, thiserror::Error)]
pub(in crate::editor) enum WriteError {
    /// No document is open.
    #[error("nothing is open")]
    NothingOpen,
    /// The format of the file cannot hold the document, or the disk refuses it.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The disk refuses the file.
    #[error(transparent)]
    Save(#[from] SaveError),
    /// The weights are invalid.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// The mesh has no weights.
    #[error("there are no weights to export; skin the mesh first")]
    NoWeights,
    /// An avatar without an author.
    #[error("VRM 1.0 requires an author; type a name into the field Author, or into the template's header")]
    NoAuthor,
    /// The rig is no avatar.
    #[error(transparent)]
    Avatar(#[from] AvatarError),
    /// The document has no clips.
    #[error("there are no clips to export; make one in the Timeline first")]
    NoClips,
    /// The commands of the rig stop with an error, so that its clips cannot be played.
    #[error("the rig cannot be built, and its clips not be played: {0}")]
    Build(#[from] BuildError),
    /// The built rig cannot run.
    #[error("the built rig cannot run, and its clips not be played: {0}")]
    Program(#[from] ProgramError),
    /// A clip is too long to be baked.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The file's name has no fitting ending.
    #[error(
        "a character is exported as .glb, .gltf, .vrm or .obj, a rig as .rig.ron or .rig, weights as .skin, clips as \
         .anim.ron or .rigclip; choose one of these endings"
    )]
    Ending,
    /// Rigsmith comes with no such mesh, which work of another version may have.
    #[error("this version comes with no mesh \"{name}\"; open its file and skin it again")]
    NotBundled {
        /// The name.
        name: String,
    },
    /// The folder has other files under the names that the bundled mesh would get.
    #[error("there is another {names} in that folder already; choose another name or folder")]
    Occupied {
        /// The names, in words.
        names: String,
    },
}
