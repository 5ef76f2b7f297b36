//! Avatars in VRM 1.0: which nodes of a model are bones of a human, what its morph targets express, and what of a rig swings.
//!
//! Only the description is made here. A model whose rest is the format's pose comes from [`crate::solve`], which is
//! no part of this module.

mod bones;
mod expressions;
mod gaze;
mod helpers;
mod springs;

use std::collections::BTreeMap;

pub use self::{
    bones::{HumanNodes, human_nodes},
    expressions::{ExpressionRecipe, expressions},
    gaze::look_at,
    helpers::{hang_half_joints, node_constraints},
    springs::{FoundSprings, spring_bones, spring_numbers},
};
use super::{BuiltRig, NodeType, Rig, RigAbout, Uid};
use crate::mesh::{
    model::{Model, Trs},
    similarity::Similarity,
    vrm::VrmMeta,
};

/// Reason why a rig is no avatar.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AvatarError {
    /// The skeleton has not all bones that the format requires.
    #[error(
        "the skeleton lacks bones that VRM 1.0 requires: {}; label joints so that they are known, such as leftHand or hand_l, \
         or fit a template of a human",
        .0.join(", ")
    )]
    MissingBones(Vec<String>),
    /// A bone does not hang on the bone that carries it.
    #[error("{bone} does not hang on {above}, as VRM 1.0 requires; connect the joints, or label others so")]
    Hierarchy {
        /// Name of the bone in VRM.
        bone: String,
        /// Bone on which it ought to hang.
        above: String,
    },
    /// Author that is not known.
    #[error(
        "VRM 1.0 requires an author, and \"{0}\" names none; say who made it with --author NAME, or in the template's header"
    )]
    NoAuthor(String),
}

/// Rig that a model was exported from.
#[derive(Debug, Clone, Copy)]
pub struct AvatarSource<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Result of the rig's commands; `None` for a rig that is not built, of which nothing swings.
    pub built: Option<&'a BuiltRig>,
    /// Node of the rig for each node of the model; further nodes of the model are no nodes of the rig.
    pub joints: &'a [Uid],
}

impl AvatarSource<'_> {
    /// Places of the rig's nodes in the model.
    pub fn places(&self) -> BTreeMap<Uid, usize> {
        self.joints.iter().enumerate().map(|(at, uid)| (*uid, at)).collect()
    }
}

/// Transforms of a model's nodes, in the model's space, and the way there from the rig's.
#[derive(Debug, Clone)]
pub struct AvatarFrames {
    /// Map from the rig's space to the model's, before the pose was changed.
    pub placement: Similarity,
    /// Transforms of the nodes before the pose was changed.
    pub bound: Vec<Trs>,
    /// Transforms of the nodes at rest.
    pub rest: Vec<Trs>,
}

/// Transforms of a model's nodes at rest, in the model's space.
pub fn node_globals(model: &Model) -> Vec<Trs> {
    let mut globals: Vec<Trs> = Vec::with_capacity(model.nodes.len());
    for node in &model.nodes {
        globals.push(node.parent.map_or(node.rest, |parent| globals[parent] * node.rest));
    }
    globals
}

/// Meta data of a rig's avatar: name, version and author of the header, and `authors` in place of that author if there are
/// any. A rig without a name gets `otherwise`.
///
/// # Errors
/// [`AvatarError::NoAuthor`].
pub fn avatar_meta(about: &RigAbout, authors: &[String], otherwise: &str) -> Result<VrmMeta, AvatarError> {
    let known = |text: &str| Some(text.trim().to_owned()).filter(|text| !text.is_empty());
    let name = known(&about.name).unwrap_or_else(|| otherwise.to_owned());
    let mut named: Vec<String> = authors.iter().filter_map(|author| known(author)).collect();
    if named.is_empty() {
        named.extend(known(&about.author));
    }
    if named.is_empty() {
        return Err(AvatarError::NoAuthor(name));
    }
    Ok(VrmMeta::new(name, about.version.trim(), named))
}

/// Built nodes with their places in a model.
struct BuiltPlaces<'a> {
    built: &'a BuiltRig,
    places: BTreeMap<Uid, usize>,
    /// Place of each node in the list of built nodes.
    index: BTreeMap<Uid, usize>,
    /// Transforms as built, in the rig's space.
    globals: Vec<Trs>,
}

impl<'a> BuiltPlaces<'a> {
    fn new(built: &'a BuiltRig, source: &AvatarSource) -> Self {
        let mut globals: Vec<Trs> = Vec::with_capacity(built.nodes.len());
        for node in &built.nodes {
            globals.push(node.parent.map_or(node.base, |parent| globals[parent] * node.base));
        }
        let index = built.nodes.iter().enumerate().map(|(at, node)| (node.uid, at)).collect();
        Self { built, places: source.places(), index, globals }
    }

    /// Joint of the model that a node of the rig is, that it was made for, or on which it hangs.
    fn joint_of(&self, uid: Uid) -> Option<usize> {
        let mut at = *self.index.get(&uid)?;
        loop {
            let node = &self.built.nodes[at];
            let place = self.places.get(&node.uid).filter(|_| node.kind == NodeType::Joint);
            let subject = node.origin.as_ref().and_then(|origin| self.places.get(&origin.subject));
            if let Some(place) = place.or(subject).or_else(|| self.places.get(&node.uid)) {
                return Some(*place);
            }
            at = node.parent?;
        }
    }

    /// Position of a node of the rig in the space of the joint that carries it.
    fn on_joint(&self, uid: Uid, joint: usize, frames: &AvatarFrames) -> Option<glam::Vec3> {
        let place = frames.placement.point(self.globals[*self.index.get(&uid)?].translation);
        let bound = frames.bound.get(joint)?;
        Some(bound.rotation.inverse() * (place - bound.translation))
    }
}
