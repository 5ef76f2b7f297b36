//! Bones of a human among the nodes of a model, by the rules of VRM 1.0 (`humanoid.md`).

use std::collections::BTreeMap;

use glam::Vec3;

use super::AvatarError;
use crate::{
    mesh::{model::Model, vrm::REQUIRED_BONES},
    rig::{
        animation::humanoid::{
            BodySide, HeadBone, HumanBone, HumanJoints, SkeletonJoint, ancestors, by_names, by_shape, head_bones,
            is_above, named_bones,
        },
        skeleton_preset::SkeletonPreset,
    },
};

/// Number of known names below which names say nothing.
const FEW: usize = 3;

/// Nodes of a model that are bones of a human.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HumanNodes {
    /// Nodes by the names of the bones in VRM, each node once.
    pub bones: BTreeMap<String, usize>,
    /// Nodes by the bone that they belong to, with those between two bones.
    pub joints: HumanJoints,
}

impl HumanNodes {
    /// Node of a bone.
    pub fn get(&self, bone: &str) -> Option<usize> {
        self.bones.get(bone).copied()
    }
}

/// Finds the bones that VRM 1.0 knows by the names of the nodes, or by the shape of a skeleton without such names. Bones that
/// the format does not require are left out where they do not hang as it demands.
///
/// # Errors
/// [`AvatarError::MissingBones`] with all required bones that are not there, [`AvatarError::Hierarchy`] for a required bone
/// that hangs elsewhere.
pub fn human_nodes(model: &Model) -> Result<HumanNodes, AvatarError> {
    let globals = model.rest_globals();
    let joint = |(node, at): (&crate::mesh::model::Node, &glam::Affine3A)| SkeletonJoint {
        name: node.name.clone(),
        parent: node.parent,
        position: at.translation.into(),
        has_end: false,
    };
    let joints: Vec<SkeletonJoint> = model.nodes.iter().zip(&globals).map(joint).collect();
    let named = by_names(&joints);
    // A skeleton of which some bones are named lacks the others, whatever its shape.
    let is_nameless = named.is_empty() && named_bones(&joints).len() < FEW;
    let human = if is_nameless { by_shape(&joints, Vec3::Y, Vec3::Z) } else { named };
    let mut bones: BTreeMap<String, usize> = BTreeMap::new();
    for (bone, nodes) in &human {
        let names = SkeletonPreset::Vrm.names(*bone, nodes.len().max(1));
        bones.extend(nodes.iter().zip(names).filter_map(|(node, name)| Some((name?, *node))));
    }
    let missing = missing(&bones, &joints, human.is_empty());
    if !missing.is_empty() {
        return Err(AvatarError::MissingBones(missing));
    }
    if let Some(head) = bones.get("head").copied() {
        for (bone, node) in head_bones(&joints, head) {
            let name = match bone {
                HeadBone::Eye(BodySide::Left) => "leftEye",
                HeadBone::Eye(BodySide::Right) => "rightEye",
                HeadBone::Jaw => "jaw",
            };
            bones.insert(name.to_owned(), node);
        }
    }
    raise_hips(&mut bones, &joints);
    connect(&mut bones, &joints)?;
    Ok(HumanNodes { bones, joints: human })
}

/// Required bones that are not there. If there is no human at all, joints that are named as bones still count.
fn missing(bones: &BTreeMap<String, usize>, joints: &[SkeletonJoint], nobody: bool) -> Vec<String> {
    let mut known: Vec<String> = bones.keys().cloned().collect();
    if nobody {
        let named = named_bones(joints);
        let names = named.keys().flat_map(|bone: &HumanBone| SkeletonPreset::Vrm.names(*bone, 1));
        known.extend(names.flatten());
        // A spine is found between hips and arms, so a joint that is called one is not looked for elsewhere.
        let is_spine = |joint: &SkeletonJoint| joint.name.to_lowercase().contains("spine");
        known.extend(joints.iter().any(is_spine).then(|| "spine".to_owned()));
    }
    let is_missing = |bone: &&str| !known.iter().any(|known| known == bone);
    REQUIRED_BONES.iter().copied().filter(is_missing).map(str::to_owned).collect()
}

/// Moves the hips to the node that carries spine and legs, where the joint of that name is beside the spine.
fn raise_hips(bones: &mut BTreeMap<String, usize>, joints: &[SkeletonJoint]) {
    let carried: Vec<usize> =
        ["spine", "leftUpperLeg", "rightUpperLeg"].iter().filter_map(|bone| bones.get(*bone).copied()).collect();
    let carries = |node: usize| carried.iter().all(|child| is_above(joints, node, *child));
    let Some(hips) = bones.get("hips").copied().filter(|hips| !carries(*hips)) else { return };
    let taken: Vec<usize> = bones.values().copied().collect();
    if let Some(above) = ancestors(joints, hips).find(|above| carries(*above) && !taken.contains(above)) {
        bones.insert("hips".to_owned(), above);
    }
}

/// Checks that each bone hangs on the nearest of the bones above it that there are, and that no node is two bones.
fn connect(bones: &mut BTreeMap<String, usize>, joints: &[SkeletonJoint]) -> Result<(), AvatarError> {
    loop {
        let fault = bones.iter().find_map(|(bone, node)| {
            let twin = bones.iter().find(|(other, twin)| *twin == node && *other != bone);
            if let Some((twin, _)) = twin.filter(|(twin, _)| is_required(twin) || !is_required(bone)) {
                return Some((bone.clone(), twin.clone()));
            }
            let above = above(bone)?;
            let needs = above.clone();
            let nearest =
                std::iter::successors(Some(above), |name| self::above(name)).find(|name| bones.contains_key(name));
            let carrier = bones.get(nearest.as_ref()?)?;
            let lacks_own = needs_own_carrier(bone) && nearest.as_ref() != Some(&needs);
            (lacks_own || !is_above(joints, *carrier, *node)).then(|| (bone.clone(), nearest.unwrap_or(needs)))
        });
        match fault {
            None => return Ok(()),
            Some((bone, above)) if is_required(&bone) => return Err(AvatarError::Hierarchy { bone, above }),
            Some((bone, _)) => drop(bones.remove(&bone)),
        }
    }
}

fn is_required(bone: &str) -> bool {
    REQUIRED_BONES.contains(&bone)
}

/// True for bones that may be there only with the very bone above them.
fn needs_own_carrier(bone: &str) -> bool {
    let ends = ["Intermediate", "Distal", "ThumbProximal"];
    bone == "upperChest" || ends.iter().any(|end| bone.ends_with(end))
}

/// Bone on which a bone hangs, which may be one that is not required; `None` for the hips.
fn above(bone: &str) -> Option<String> {
    let plain = match bone {
        "hips" => return None,
        "spine" | "leftUpperLeg" | "rightUpperLeg" => "hips",
        "chest" => "spine",
        "upperChest" => "chest",
        "neck" | "leftShoulder" | "rightShoulder" => "upperChest",
        "head" => "neck",
        "leftEye" | "rightEye" | "jaw" => "head",
        _ => "",
    };
    if !plain.is_empty() {
        return Some(plain.to_owned());
    }
    let side = if bone.starts_with("left") { "left" } else { "right" };
    let own = bone.strip_prefix(side)?;
    let of_limb = match own {
        "UpperArm" => "Shoulder",
        "LowerArm" => "UpperArm",
        "Hand" => "LowerArm",
        "LowerLeg" => "UpperLeg",
        "Foot" => "LowerLeg",
        "Toes" => "Foot",
        "ThumbMetacarpal" => "Hand",
        "ThumbProximal" => "ThumbMetacarpal",
        "ThumbDistal" => "ThumbProximal",
        _ => "",
    };
    if !of_limb.is_empty() {
        return Some(format!("{side}{of_limb}"));
    }
    let finger = |part: &str| own.strip_suffix(part);
    if finger("Proximal").is_some() {
        return Some(format!("{side}Hand"));
    }
    let proximal = finger("Intermediate").map(|finger| format!("{side}{finger}Proximal"));
    proximal.or_else(|| finger("Distal").map(|finger| format!("{side}{finger}Intermediate")))
}
