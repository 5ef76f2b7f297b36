//! Projects, the `*.rigsmith.ron` files that the editor saves.
//!
//! A project names meshes and weights by path and content hash, holds the rigs inline, each as its template would be
//! with the poses beside it, and remembers the view. As with templates, one field group is a line, reading checks
//! everything before it returns, loading what was saved gives the same project, and saving that the same bytes.

mod read;
mod write;

use std::collections::BTreeMap;

use bevy::math::Vec3;
use serde::Deserialize;

pub use read::read_project;
pub use write::write_project;

use crate::rig::{Rig, Uid, animation::NodeNames};

/// Highest format that this version reads; written only for content that needs it.
///
/// Format 2 adds values of attributes, and poses of nodes that are not joints; format 3 adds clips, and the templates that rigs
/// follow; format 4 adds parts that were dropped onto joints, and selection sets; format 5 adds places in the graph; format 6 adds cuts
/// of faces; format 7 adds texts of templates with parts; format 8 adds the clip that is open. A project is written in the first
/// format that can hold it.
pub const FORMAT: u32 = 8;

/// Largest size in bytes of a project that is read.
pub const MAX_BYTES: usize = 64 << 20;

/// Content of a project file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Project {
    /// The project's name.
    pub name: String,
    /// Meshes of the project.
    pub meshes: Vec<MeshReference>,
    /// Rigs of the project.
    pub rigs: Vec<ProjectRig>,
    /// Templates that rigs of the project follow.
    pub templates: Vec<TemplateReference>,
    /// View of the project: camera, tool and display settings.
    pub view: ProjectView,
    /// Journal that continues from this file.
    pub journal: Option<JournalReference>,
    /// Names of animated nodes that are no joints of the rigs, by which their keys are offered to others once they are gone.
    /// They are written beside the keys; what is read is in the names of the clips.
    pub names: NodeNames,
}

/// Reference of a project to a mesh in a file of its own.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshReference {
    /// Uid by which rigs refer to the mesh's weights.
    pub uid: Uid,
    /// Uid of the rig that moves the mesh.
    pub rig: Uid,
    /// Path of the mesh's file: relative to the project's folder with `/` between names, or absolute.
    pub path: String,
    /// [`mesh_hash`](crate::rig::skin::mesh_hash) of the mesh's points and triangles at rest.
    #[serde(deserialize_with = "read::mesh_hash")]
    pub hash: u128,
    /// Joint that each node of the file became; empty if the file's skeleton was not imported.
    #[serde(default)]
    pub nodes: Vec<Uid>,
}

/// Rig of a project, with references to its weights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProjectRig {
    /// The rig with its poses. Its weights are in files of their own.
    pub rig: Rig,
    /// Weights, one file a mesh.
    pub skins: Vec<SkinReference>,
}

/// Template that a rig of a project follows.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateReference {
    /// The rig.
    pub rig: Uid,
    /// Path of the template's file: relative to the project's folder with `/` between names, or absolute.
    pub path: String,
    /// The version of the template that the rig took over last, with what its parts brought: base of the next update.
    pub base: Rig,
    /// Text of that version, in which part instances have the uids that they have in the rig; for templates with parts.
    pub text: Option<String>,
}

/// Reference to the weights of a mesh: a `.skin` file beside the project.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkinReference {
    /// The mesh.
    pub mesh: Uid,
    /// Path of the weights, relative to the project's folder.
    pub path: String,
    /// [`content_hash`](crate::rig::skin::content_hash) of that file.
    #[serde(deserialize_with = "read::content_hash")]
    pub hash: u64,
    /// True if the weights bind the mesh in its state at rest; see [`SkinData`](crate::rig::SkinData).
    pub at_rest: bool,
}

/// View of a project in the editor. Names are the editor's own; an unknown name is ignored.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectView {
    /// Position of the camera.
    #[serde(default)]
    pub camera: Option<ProjectCamera>,
    /// Name of the pointer's mode.
    #[serde(default)]
    pub mode: String,
    /// Name of the mesh's shading.
    #[serde(default)]
    pub shading: String,
    /// Display switches by name, `true` for what is shown.
    #[serde(default)]
    pub switches: BTreeMap<String, bool>,
    /// Places of the graph's nodes and folded frames that a person moved, by the uid of the command tag, feature or local group.
    #[serde(default)]
    pub graph: BTreeMap<Uid, [f32; 2]>,
    /// Clip that is open in the timeline; `None` for the first one.
    #[serde(default)]
    pub clip: Option<Uid>,
}

/// A camera that orbits a point of the world.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectCamera {
    /// Angle about the world's up axis, in radians.
    pub yaw: f32,
    /// Angle above the horizon, in radians.
    pub pitch: f32,
    /// Distance from the focus (perspective), or half the height that is seen (orthographic).
    pub distance: f32,
    /// Point that the camera looks at and orbits, in world space.
    #[serde(deserialize_with = "read::vector")]
    pub focus: Vec3,
    /// True for a view without perspective.
    #[serde(default)]
    pub orthographic: bool,
}

impl ProjectCamera {
    fn is_finite(&self) -> bool {
        self.yaw.is_finite() && self.pitch.is_finite() && self.distance.is_finite() && self.focus.is_finite()
    }
}

/// The journal of edits that were made after a project was saved.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JournalReference {
    /// Name of the journal's file, beside the project.
    pub file: String,
    /// Number of the last edit that the project contains.
    pub last: u64,
}

/// A project as read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadProject {
    /// The project.
    pub project: Project,
    /// Notes about content that the reader ignored, a sentence each.
    pub notes: Vec<String>,
}
