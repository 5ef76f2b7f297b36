//! Bodies of instances: rigs and weights that many entities share.

use std::sync::Arc;

use bevy::prelude::*;

use crate::{
    plugins::landing::JobBasis,
    rig::{BuiltRig, Rig, SkinData, Uid},
};

/// Rig and build of an entity that has no document of its own; all instances of a template share them. Meshes of such an entity
/// have their weights as [`InstanceSkin`].
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone)]
pub struct InstanceBody {
    /// The rig.
    pub rig: Arc<Rig>,
    /// Nodes and constraints.
    pub built: Arc<BuiltRig>,
}

/// Weights of a mesh over the joints of an [`InstanceBody`], shared by equal meshes.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Debug, Clone)]
pub struct InstanceSkin(pub Arc<SkinData>);

/// Hash of the joints that weights of a mesh follow from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BodyBasis(JobBasis);

impl InstanceBody {
    /// Basis of weights of the mesh with that uid: they stay right while it is the same.
    pub fn basis(&self, mesh: Uid) -> BodyBasis {
        BodyBasis(JobBasis::of(&self.rig, mesh))
    }
}
