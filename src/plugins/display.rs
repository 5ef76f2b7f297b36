//! The mesh on the screen: solid with its materials, see-through, with its edges, or coloured by its weights.
//!
//! A [`RigMesh`](super::surface::RigMesh) is data. This plugin shows it: Bevy meshes, materials and images are built in
//! the background and handed to the renderer piece by piece, so that no frame waits for a large model. Weights move the
//! pieces on the graphics card as they move [`RigSurface`](super::surface::RigSurface), the surface of ray queries, so
//! that the picture and picking agree.
//!
//! The editor is not needed: a game that has [`DefaultPlugins`] and [`RigPlugins`](super::RigPlugins) adds
//! [`DisplayPlugin`] and gives its camera [`ViewportLights`] or lights of its own. The drawn pieces are children of the
//! mesh's entity, which becomes a child of its rig; hide and show it with its [`Visibility`].

mod build;
mod colors;
mod follow;
mod layer;
mod lights;
mod materials;
mod plan;
mod textures;
mod wire;

use bevy::{prelude::*, window::RequestRedraw};

use self::follow::{EdgeMaterials, assign_materials, follow_skins, land_jobs, place_meshes, start_jobs};
pub use self::{
    colors::{joint_color, weight_color},
    lights::ViewportLights,
    wire::WireMaterial,
};
use super::{RigSystems, configure_sets};
use crate::rig::Uid;

/// Plugin that shows the meshes of rigs. Needs Bevy's rendering plugins, as in [`DefaultPlugins`].
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
                (place_meshes, start_jobs, land_jobs, follow_skins, assign_materials).chain().in_set(DisplaySystems),
            );
    }
}

/// System set in `Update`, after [`RigSystems::Bind`]: updates the picture after meshes, weights, rest poses and
/// [`MeshDisplay`].
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DisplaySystems;

/// Display settings of meshes.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshDisplay {
    /// Shading of surfaces while no weights are shown.
    pub shading: Shading,
    /// Shows the mesh half transparent, with both of its sides, if `true`.
    pub xray: bool,
    /// Draws the edges of the mesh's polygons if `true`.
    pub wireframe: bool,
    /// Weights as colours.
    pub weights: WeightColors,
}

/// Shading of surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shading {
    /// Shaded with the file's materials; a clay material for parts without one.
    #[default]
    Shaded,
    /// Shaded with a clay material everywhere.
    Clay,
}

/// Weights that are shown as colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WeightColors {
    /// Weights are not shown.
    #[default]
    Off,
    /// Weights of one joint, from dark blue (little) over red to yellow (all); grey for none.
    Joint(Uid),
    /// Weights of all joints: each has a colour of its own, and several influences mix.
    AllJoints,
}

/// Progress of meshes and textures that are still being built or handed to the renderer; on the entity with the
/// [`RigMesh`](super::surface::RigMesh), and removed when all is on the screen.
#[derive(Component, Reflect, Debug)]
#[reflect(Component)]
pub struct DisplayJob {
    done: f32,
}

impl DisplayJob {
    /// Finished share, 0 to 1.
    pub fn fraction(&self) -> f32 {
        self.done
    }
}

/// A child of a mesh's entity that draws a piece of it.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub enum DisplayPiece {
    /// Triangles of the surface.
    Surface,
    /// Edges of polygons.
    Edges,
}

/// Message about a part of a mesh that cannot be shown.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct DisplayNote {
    /// The mesh.
    pub mesh: Uid,
    /// Description with the reason, a sentence for people.
    pub text: String,
}
