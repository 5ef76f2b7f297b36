//! Avatars: characters made ready for VRM 1.0.
//!
//! The format wants a figure that stands on the ground at the origin, faces +Z, counts in metres and rests in a T-pose
//! (`tpose.md`). The pose is that of the skinned mesh: only nodes are turned. Mesh, weights and bind poses stay, so that skin
//! bends in every pose as it does in the rig, and clips look as before.

mod ground;
mod helper_joints;
mod stance;
mod t_pose;

pub use self::t_pose::{TPose, t_pose};
use super::human_axes::human_axes;
use crate::{
    mesh::{
        model::Model,
        similarity::Similarity,
        vrm::{Avatar, SPEC_VERSION, Vrm, VrmMeta},
    },
    rig::vrm::{
        AvatarError, AvatarFrames, AvatarSource, ExpressionRecipe, expressions, human_nodes, look_at, node_constraints,
        node_globals, spring_bones,
    },
};

/// Avatar of a model, and what was done to the model for it.
#[derive(Debug, Clone, PartialEq)]
pub struct MadeAvatar {
    /// The avatar.
    pub avatar: Avatar,
    /// Rest pose.
    pub pose: TPose,
    /// Factor of all lengths.
    pub scale: f32,
    /// Sentences about what the format cannot hold, and about what was changed.
    pub notes: Vec<String>,
}

/// Makes an avatar of a model: stands it up, turns its rest into a T-pose and describes it. Half joints ought to hang beside
/// their joints ([`hang_half_joints`](crate::rig::vrm::hang_half_joints)), and clips to be baked already.
///
/// # Errors
/// [`AvatarError`] if bones are missing; the model then is as it was.
pub fn make_avatar(
    model: &mut Model,
    source: &AvatarSource,
    meta: VrmMeta,
    recipes: &[ExpressionRecipe],
) -> Result<MadeAvatar, AvatarError> {
    let human = human_nodes(model)?;
    let mut notes = Vec::new();
    let placement = stance::stance(model, &human);
    if placement.scale != 1.0 {
        notes.push(format!("VRM 1.0 counts in metres: all lengths were multiplied by {}", placement.scale));
    }
    if placement.rotation.xyz().length() > 1e-4 {
        notes.push("the figure was turned until it faces +Z with Y up, as VRM 1.0 requires".to_owned());
    }
    model.place(&placement);
    // Programs compute tangents themselves, by the specification ("Allow ignore stored TANGENT").
    for part in &mut model.parts {
        part.tangents.clear();
        part.morphs.iter_mut().for_each(|morph| morph.tangents.clear());
    }
    let bound = node_globals(model);
    let constraints = node_constraints(model, &bound, source);
    let pose = t_pose(model, &human.joints, source, &placement);
    if let Some(height) = ground::height(model, &human) {
        model.place(&Similarity::from_translation(-height * glam::Vec3::Y));
    }
    let frames = AvatarFrames { placement, bound, rest: node_globals(model) };
    let springs = spring_bones(model, source, &frames, &human);
    notes.extend(springs.notes);
    let expressions = expressions(model, recipes);
    let look_at = look_at(model, &frames.rest, &human, &expressions);
    let bones = human.bones.iter().map(|(bone, node)| (bone.clone(), crate::mesh::vrm::HumanBoneNode { node: *node }));
    let vrm = Vrm {
        spec_version: SPEC_VERSION.to_owned(),
        meta,
        humanoid: crate::mesh::vrm::Humanoid { human_bones: bones.collect() },
        expressions,
        look_at,
    };
    let avatar = Avatar { vrm, springs: springs.springs, constraints };
    Ok(MadeAvatar { avatar, pose, scale: placement.scale, notes })
}
