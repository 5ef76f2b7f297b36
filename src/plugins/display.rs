//! The mesh on the screen: solid with its materials, see-through, with its edges, or coloured by its weights.
//!
//! A [`RigMesh`](super::surface::RigMesh) is data. This plugin shows it: Bevy meshes, materials and images are built in
//! the background and handed to the renderer piece by piece, so that no frame waits for a large model. Weights move
//! the pieces on the graphics card as they move [`RigSurface`](super::surface::RigSurface), the surface that
//! rays meet, so that the picture and picking agree.
//!
//! No editor is needed: a game that has [`DefaultPlugins`] and [`RigPlugins`](super::RigPlugins) adds
//! [`DisplayPlugin`] and gives its camera [`ViewportLights`] or lights of its own. What is drawn are children of the
//! mesh's entity, which becomes a child of its rig; hide and show it with its [`Visibility`].

mod build;
mod colors;
mod follow;
mod layer;
mod lights;
mod looks;
mod plan;
mod textures;
mod wire;

use bevy::{prelude::*, window::RequestRedraw};

use self::follow::{EdgeMaterials, dress_pieces, follow_skins, land_jobs, place_meshes, start_jobs};
pub use self::{
    colors::{joint_color, weight_color},
    lights::ViewportLights,
    wire::WireMaterial,
};
use super::{RigSystems, configure_sets};
use crate::rig::Uid;

/// Shows the meshes of rigs. Needs Bevy's rendering plugins, as in [`DefaultPlugins`].
pub struct DisplayPlugin;

impl Plugin for DisplayPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        wire::add_wire(app);
        app.init_resource::<MeshDisplay>()
            .init_resource::<EdgeMaterials>()
            .add_message::<DisplayNote>()
            .add_message::<RequestRedraw>()
            .configure_sets(Update, DisplaySystems.after(RigSystems::Bind))
            .add_systems(
                Update,
                (place_meshes, start_jobs, land_jobs, follow_skins, dress_pieces).chain().in_set(DisplaySystems),
            );
    }
}

/// In `Update`, after [`RigSystems::Bind`]: what is drawn follows meshes, weights, rest poses and [`MeshDisplay`].
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DisplaySystems;

/// How meshes are shown.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshDisplay {
    /// What surfaces look like while no weights are shown.
    pub shading: Shading,
    /// True to see through the mesh, and both of its sides.
    pub xray: bool,
    /// True to draw the edges of its polygons.
    pub wireframe: bool,
    /// Weights as colours.
    pub weights: WeightColors,
}

/// What surfaces look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shading {
    /// With the file's materials; like clay where it has none.
    #[default]
    Shaded,
    /// Like clay, without materials.
    Clay,
}

/// Which weights are shown as colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WeightColors {
    /// None.
    #[default]
    Off,
    /// Those of one joint, from dark blue (little) over red to yellow (all); grey where it has none at all.
    Joint(Uid),
    /// Those of all joints: each has a colour of its own, mixed where several hold the surface.
    AllJoints,
}

/// Meshes and textures of a mesh that are still being built or handed to the renderer; on the entity with the
/// [`RigMesh`](super::surface::RigMesh), and gone when all is on the screen.
#[derive(Component, Debug)]
pub struct DisplayJob {
    done: f32,
}

impl DisplayJob {
    /// How much is done, 0 to 1.
    pub fn fraction(&self) -> f32 {
        self.done
    }
}

/// A child of a mesh's entity that draws a piece of it.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub enum DisplayPiece {
    /// Triangles of the surface.
    Surface,
    /// Edges of polygons.
    Edges,
}

/// Something of a mesh cannot be shown.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct DisplayNote {
    /// The mesh.
    pub mesh: Uid,
    /// What and why, in a sentence for people.
    pub text: String,
}
