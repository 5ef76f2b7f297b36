//! Projects, the `*.rigsmith.ron` files: what the editor saves.
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

use crate::rig::{Rig, Uid};

/// The highest format that this version reads, and writes where it is needed.
///
/// Format 2 adds values of attributes, and poses of nodes that are no joints. Projects without them are written in format
/// 1.
pub const FORMAT: u32 = 2;

/// The longest project that is read, in bytes.
pub const MAX_BYTES: usize = 64 << 20;

/// What a project file holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Project {
    /// The project's name.
    pub name: String,
    /// Its meshes.
    pub meshes: Vec<MeshReference>,
    /// Its rigs.
    pub rigs: Vec<ProjectRig>,
    /// How it was looked at.
    pub view: ProjectView,
    /// The journal that goes on from here.
    pub journal: Option<JournalReference>,
}

/// A mesh of a project: a file somewhere else.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshReference {
    /// Identity, by which rigs name the mesh's weights.
    pub uid: Uid,
    /// The rig that moves it.
    pub rig: Uid,
    /// Where it is: relative to the project's folder with `/` between names, or absolute.
    pub path: String,
    /// [`mesh_hash`](crate::rig::skin::mesh_hash) of its points and triangles at rest.
    #[serde(deserialize_with = "read::mesh_hash")]
    pub hash: u128,
    /// The joint that each node of the file became; empty if its skeleton was left aside.
    #[serde(default)]
    pub nodes: Vec<Uid>,
}

/// A rig of a project and where its weights are.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProjectRig {
    /// The rig with its poses. Its weights are in files of their own.
    pub rig: Rig,
    /// Weights, one file a mesh.
    pub skins: Vec<SkinReference>,
}

/// The weights of a mesh: a `.skin` file beside the project.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkinReference {
    /// The mesh.
    pub mesh: Uid,
    /// Where the weights are, relative to the project's folder.
    pub path: String,
    /// [`content_hash`](crate::rig::skin::content_hash) of that file.
    #[serde(deserialize_with = "read::content_hash")]
    pub hash: u64,
    /// True if the weights hold the mesh as it stands at rest; see [`SkinData`](crate::rig::SkinData).
    pub at_rest: bool,
}

/// How a project was looked at. Names are the editor's own; one that it does not know is as if there were none.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectView {
    /// Where the camera stood.
    #[serde(default)]
    pub camera: Option<ProjectCamera>,
    /// What the pointer did.
    #[serde(default)]
    pub mode: String,
    /// How the mesh was shown.
    #[serde(default)]
    pub shading: String,
    /// What was shown, and what was not.
    #[serde(default)]
    pub switches: BTreeMap<String, bool>,
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
    /// What it looks at.
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
    /// Its file name, beside the project.
    pub file: String,
    /// The number of the last edit that the project contains.
    pub last: u64,
}

/// A project as read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadProject {
    /// The project.
    pub project: Project,
    /// What the reader passed over, a sentence each.
    pub notes: Vec<String>,
}
