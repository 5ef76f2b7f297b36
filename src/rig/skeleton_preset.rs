//! Names and axes of skeletons, as other programs expect them.
//!
//! Bones of a human get the names of the other program, and their joints the axes that it has; all other joints keep
//! theirs. Where axes turn, keys and bind poses turn with them, so that the mesh moves as before.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Mat3, Mat4, Quat, Vec3};

use crate::{
    mesh::model::{Channel, ChannelTarget, Model},
    rig::animation::humanoid::{BodySide, Finger, HumanBone, HumanJoints, LimbBone, SkeletonJoint, by_names, by_shape},
};

/// Program whose names and axes a skeleton gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SkeletonPreset {
    /// Names and axes of the rig.
    #[default]
    Plain,
    /// Mixamo: `mixamorig:LeftUpLeg`, Y along the bone.
    Mixamo,
    /// Unreal's mannequin: `thigh_l`, X along the bone.
    Unreal,
    /// Unity's humanoid: `LeftUpperLeg`, axes of the model at rest.
    Unity,
    /// VRM 1.0: `leftUpperLeg`, axes of the model at rest.
    Vrm,
}

/// Axes of joints at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BoneAxes {
    /// Axes stay.
    Own,
    /// An axis lies along the bone, 0 to 2.
    Along(usize),
    /// Axes are those of the model.
    Model,
}

impl SkeletonPreset {
    fn axes(self) -> BoneAxes {
        match self {
            Self::Plain => BoneAxes::Own,
            Self::Mixamo => BoneAxes::Along(1),
            Self::Unreal => BoneAxes::Along(0),
            Self::Unity | Self::Vrm => BoneAxes::Model,
        }
    }

    /// Names for the joints of a bone, from the body outwards; `None` for a joint that keeps its name.
    pub(crate) fn names(self, bone: HumanBone, count: usize) -> Vec<Option<String>> {
        let one = |name: String| std::iter::once(Some(name)).chain(std::iter::repeat_n(None, count - 1)).collect();
        let numbered = |first: &str, name: &dyn Fn(usize) -> String| {
            (0..count).map(|at| Some(if at == 0 { first.to_owned() } else { name(at) })).collect()
        };
        match (self, bone) {
            (Self::Plain, _) => vec![None; count],
            (Self::Mixamo, HumanBone::Spine) => numbered("mixamorig:Spine", &|at| format!("mixamorig:Spine{at}")),
            (Self::Mixamo, HumanBone::Neck) => numbered("mixamorig:Neck", &|at| format!("mixamorig:Neck{at}")),
            (Self::Unreal, HumanBone::Spine) => numbered("spine_01", &|at| format!("spine_{:02}", at + 1)),
            (Self::Unreal, HumanBone::Neck) => numbered("neck_01", &|at| format!("neck_{:02}", at + 1)),
            (Self::Unity | Self::Vrm, HumanBone::Spine) => {
                let mut names = vec![None; count];
                let parts = ["spine", "chest", "upperChest"].map(|name| Some(self.cased(name)));
                let [spine, chest, upper] = parts;
                if count > 2 {
                    names[count - 1] = upper;
                    names[count / 2] = chest;
                } else if count == 2 {
                    names[1] = chest;
                }
                names[0] = spine;
                names
            }
            (Self::Mixamo, _) => one(format!("mixamorig:{}", mixamo(bone))),
            (Self::Unreal, _) => one(unreal(bone)),
            (Self::Unity, HumanBone::Finger(side, finger, number)) => {
                let part = ["Proximal", "Intermediate", "Distal"][usize::from(number.clamp(1, 3)) - 1];
                one(format!("{}{}{part}", side_word(side), finger_word(finger, "Little")))
            }
            (Self::Unity | Self::Vrm, _) => one(self.cased(&vrm(bone))),
        }
    }

    /// Name of VRM in the case of the program.
    fn cased(self, name: &str) -> String {
        let mut chars = name.chars();
        match chars.next().filter(|_| self == Self::Unity) {
            Some(first) => first.to_uppercase().chain(chars).collect(),
            None => name.to_owned(),
        }
    }
}

fn side_word(side: BodySide) -> &'static str {
    if side == BodySide::Left { "Left" } else { "Right" }
}

fn finger_word(finger: Finger, little: &'static str) -> &'static str {
    match finger {
        Finger::Thumb => "Thumb",
        Finger::Index => "Index",
        Finger::Middle => "Middle",
        Finger::Ring => "Ring",
        Finger::Little => little,
    }
}

fn mixamo(bone: HumanBone) -> String {
    match bone {
        HumanBone::Hips => "Hips".to_owned(),
        HumanBone::Spine => "Spine".to_owned(),
        HumanBone::Neck => "Neck".to_owned(),
        HumanBone::Head => "Head".to_owned(),
        HumanBone::Limb(side, bone) => {
            let word = match bone {
                LimbBone::Shoulder => "Shoulder",
                LimbBone::UpperArm => "Arm",
                LimbBone::LowerArm => "ForeArm",
                LimbBone::Hand => "Hand",
                LimbBone::UpperLeg => "UpLeg",
                LimbBone::LowerLeg => "Leg",
                LimbBone::Foot => "Foot",
                LimbBone::Toes => "ToeBase",
            };
            format!("{}{word}", side_word(side))
        }
        HumanBone::Finger(side, finger, number) => {
            format!("{}Hand{}{number}", side_word(side), finger_word(finger, "Pinky"))
        }
    }
}

fn unreal(bone: HumanBone) -> String {
    let side_letter = |side: BodySide| if side == BodySide::Left { "l" } else { "r" };
    match bone {
        HumanBone::Hips => "pelvis".to_owned(),
        HumanBone::Spine => "spine_01".to_owned(),
        HumanBone::Neck => "neck_01".to_owned(),
        HumanBone::Head => "head".to_owned(),
        HumanBone::Limb(side, bone) => {
            let word = match bone {
                LimbBone::Shoulder => "clavicle",
                LimbBone::UpperArm => "upperarm",
                LimbBone::LowerArm => "lowerarm",
                LimbBone::Hand => "hand",
                LimbBone::UpperLeg => "thigh",
                LimbBone::LowerLeg => "calf",
                LimbBone::Foot => "foot",
                LimbBone::Toes => "ball",
            };
            format!("{word}_{}", side_letter(side))
        }
        HumanBone::Finger(side, finger, number) => {
            format!("{}_{number:02}_{}", finger_word(finger, "Pinky").to_lowercase(), side_letter(side))
        }
    }
}

fn vrm(bone: HumanBone) -> String {
    match bone {
        HumanBone::Hips => "hips".to_owned(),
        HumanBone::Spine => "spine".to_owned(),
        HumanBone::Neck => "neck".to_owned(),
        HumanBone::Head => "head".to_owned(),
        HumanBone::Limb(side, bone) => {
            let word = match bone {
                LimbBone::Shoulder => "Shoulder",
                LimbBone::UpperArm => "UpperArm",
                LimbBone::LowerArm => "LowerArm",
                LimbBone::Hand => "Hand",
                LimbBone::UpperLeg => "UpperLeg",
                LimbBone::LowerLeg => "LowerLeg",
                LimbBone::Foot => "Foot",
                LimbBone::Toes => "Toes",
            };
            format!("{}{word}", side_word(side).to_lowercase())
        }
        HumanBone::Finger(side, finger, number) => {
            let parts = match finger {
                Finger::Thumb => ["Metacarpal", "Proximal", "Distal"],
                _ => ["Proximal", "Intermediate", "Distal"],
            };
            let part = parts[usize::from(number.clamp(1, 3)) - 1];
            format!("{}{}{part}", side_word(side).to_lowercase(), finger_word(finger, "Little"))
        }
    }
}

/// Gives the bones of a human in a model the names and axes of a program; skins and clips follow. Returns the number of
/// joints that have another name, or `None` if the model has no human, and then leaves it as it is. Joints of unequal
/// scale keep their axes.
pub fn apply_preset(model: &mut Model, preset: SkeletonPreset) -> Option<usize> {
    if preset == SkeletonPreset::Plain {
        return Some(0);
    }
    let joints: Vec<SkeletonJoint> = model
        .nodes
        .iter()
        .zip(model.rest_globals())
        .map(|(node, at)| SkeletonJoint {
            name: node.name.clone(),
            parent: node.parent,
            position: at.translation.into(),
            has_end: false,
        })
        .collect();
    let named = by_names(&joints);
    let human = if named.is_empty() { by_shape(&joints, Vec3::Y, Vec3::Z) } else { named };
    if human.is_empty() {
        return None;
    }
    let turns = turns(model, &joints, &human, preset.axes());
    turn_axes(model, &turns);
    Some(rename(model, &human, preset))
}

/// Renames the joints of a human; others get a number where they have one of those names.
fn rename(model: &mut Model, human: &HumanJoints, preset: SkeletonPreset) -> usize {
    let mut given: BTreeMap<usize, String> = BTreeMap::new();
    for (bone, joints) in human {
        for (joint, name) in joints.iter().zip(preset.names(*bone, joints.len())) {
            given.extend(name.map(|name| (*joint, name)));
        }
    }
    let wanted: BTreeSet<String> = given.values().cloned().collect();
    let others = model.nodes.iter().enumerate().filter(|(at, _)| !given.contains_key(at));
    let mut taken: BTreeSet<String> = others.map(|(_, node)| node.name.clone()).chain(wanted.iter().cloned()).collect();
    let mut count = 0;
    for (at, node) in model.nodes.iter_mut().enumerate() {
        let name = match given.get(&at) {
            Some(name) => name.clone(),
            None if wanted.contains(&node.name) => {
                let mut numbered = (1..).map(|number| format!("{}.{number:03}", node.name));
                numbered.find(|name| !taken.contains(name)).unwrap_or_else(|| node.name.clone())
            }
            None => continue,
        };
        taken.insert(name.clone());
        count += usize::from(name != node.name);
        node.name = name;
    }
    count
}

/// Rotations that take the axes of each joint to those of the program, in the joint's own space.
fn turns(model: &Model, joints: &[SkeletonJoint], human: &HumanJoints, axes: BoneAxes) -> Vec<Quat> {
    let mut turns = vec![Quat::IDENTITY; model.nodes.len()];
    let rotations: Vec<Quat> = model.nodes.iter().fold(Vec::new(), |mut all, node| {
        let own = node.rest.rotation;
        all.push(node.parent.map_or(own, |parent| all[parent] * own).normalize());
        all
    });
    let mut wanted: BTreeMap<usize, Quat> = BTreeMap::new();
    match axes {
        BoneAxes::Own => return turns,
        BoneAxes::Model => wanted.extend(human.values().flatten().map(|joint| (*joint, Quat::IDENTITY))),
        BoneAxes::Along(axis) => {
            for chain in chains(human) {
                let mut along = first_direction(&chain, joints);
                for (place, joint) in chain.iter().enumerate() {
                    let next = chain.get(place + 1).map(|next| joints[*next].position - joints[*joint].position);
                    along = next.and_then(Vec3::try_normalize).unwrap_or(along);
                    wanted.entry(*joint).or_insert_with(|| along_bone(along, axis));
                }
            }
        }
    }
    for (joint, rotation) in wanted {
        if is_even(model, joint) {
            turns[joint] = (rotations[joint].inverse() * rotation).normalize();
        }
    }
    turns
}

/// Direction of a chain at its first joint: to the next joint at another place, else away from the parent, else up.
fn first_direction(chain: &[usize], joints: &[SkeletonJoint]) -> Vec3 {
    let Some(first) = chain.first().map(|first| &joints[*first]) else { return Vec3::Y };
    let later = chain.iter().find_map(|joint| (joints[*joint].position - first.position).try_normalize());
    let above = first.parent.and_then(|parent| (first.position - joints[parent].position).try_normalize());
    later.or(above).unwrap_or(Vec3::Y)
}

/// Chains of joints from the body outwards: trunk, arms, legs and fingers.
fn chains(human: &HumanJoints) -> Vec<Vec<usize>> {
    let chain = |bones: &[HumanBone]| bones.iter().filter_map(|bone| human.get(bone)).flatten().copied().collect();
    let mut chains: Vec<Vec<usize>> =
        vec![chain(&[HumanBone::Hips, HumanBone::Spine, HumanBone::Neck, HumanBone::Head])];
    for side in BodySide::BOTH {
        let limb = |bones: [LimbBone; 4]| chain(&bones.map(|bone| HumanBone::Limb(side, bone)));
        chains.push(limb([LimbBone::Shoulder, LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand]));
        chains.push(limb([LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot, LimbBone::Toes]));
        for finger in [Finger::Thumb, Finger::Index, Finger::Middle, Finger::Ring, Finger::Little] {
            chains.push(chain(&[1, 2, 3].map(|number| HumanBone::Finger(side, finger, number))));
        }
    }
    chains
}

/// Rotation of a joint with an axis along a direction, and the next axis towards the front.
fn along_bone(along: Vec3, axis: usize) -> Quat {
    let front = if along.dot(Vec3::Z).abs() > 0.9 { Vec3::Y } else { Vec3::Z };
    let side = (front - along * front.dot(along)).normalize();
    let third = along.cross(side);
    let columns = match axis {
        0 => [along, side, third],
        1 => [third, along, side],
        _ => [side, third, along],
    };
    Quat::from_mat3(&Mat3::from_cols(columns[0], columns[1], columns[2])).normalize()
}

/// True if a node has one scale in all directions, at rest and in all clips.
fn is_even(model: &Model, node: usize) -> bool {
    let is_one = |scale: &[f32]| scale.iter().all(|factor| (factor - scale[0]).abs() <= 1e-4 * scale[0].abs());
    let is_scale = |channel: &&Channel| channel.target == ChannelTarget::Scale(node);
    let channels = model.clips.iter().flat_map(|clip| &clip.channels).filter(is_scale);
    is_one(&model.nodes[node].rest.scale.to_array())
        && channels.flat_map(|channel| channel.values.chunks_exact(3)).all(is_one)
}

/// Turns the axes of nodes, each in its own space; what hangs on them, and how they move, stays as it is in the model's
/// space.
fn turn_axes(model: &mut Model, turns: &[Quat]) {
    let parents: Vec<Option<usize>> = model.nodes.iter().map(|node| node.parent).collect();
    let back = |node: usize| parents[node].map_or(Quat::IDENTITY, |parent| turns[parent].inverse());
    for (at, node) in model.nodes.iter_mut().enumerate() {
        node.rest.translation = back(at) * node.rest.translation;
        node.rest.rotation = (back(at) * node.rest.rotation * turns[at]).normalize();
    }
    for skin in &mut model.skins {
        for (joint, matrix) in skin.joints.iter().zip(&mut skin.inverse_binds) {
            if turns[*joint] != Quat::IDENTITY {
                *matrix = Mat4::from_quat(turns[*joint].inverse()) * *matrix;
            }
        }
    }
    for channel in model.clips.iter_mut().flat_map(|clip| &mut clip.channels) {
        match channel.target {
            ChannelTarget::Translation(node) => {
                for value in channel.values.chunks_exact_mut(3) {
                    value.copy_from_slice(&(back(node) * Vec3::from_slice(value)).to_array());
                }
            }
            ChannelTarget::Rotation(node) => {
                for value in channel.values.chunks_exact_mut(4) {
                    let turned = back(node) * Quat::from_slice(value) * turns[node];
                    value.copy_from_slice(&turned.to_array());
                }
            }
            ChannelTarget::Scale(_) | ChannelTarget::MorphWeights(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::model::Node;

    #[test]
    fn chains_without_length_have_a_direction() {
        let joint =
            |parent: Option<usize>, position: Vec3| SkeletonJoint { parent, position, ..SkeletonJoint::default() };
        let joints = [joint(None, Vec3::Y), joint(Some(0), Vec3::Y), joint(Some(1), Vec3::new(2.0, 1.0, 0.0))];
        for (chain, wanted) in [
            (vec![0, 1, 2], Vec3::X),
            (vec![2], Vec3::X),
            (vec![1], Vec3::Y),
            (vec![0], Vec3::Y),
            (Vec::new(), Vec3::Y),
        ] {
            assert_eq!(first_direction(&chain, &joints), wanted, "{chain:?}");
        }
    }

    #[test]
    fn names_stay_different() {
        let names = ["mixamorig:Hips.001", "mixamorig:Hips", "pelvis"];
        let node = |name: &str| Node { name: name.to_owned(), ..Node::default() };
        let mut model = Model { nodes: names.iter().map(|name| node(name)).collect(), ..Model::default() };
        let human = HumanJoints::from_iter([(HumanBone::Hips, vec![2])]);
        assert_eq!(rename(&mut model, &human, SkeletonPreset::Mixamo), 2);
        let names: Vec<&str> = model.nodes.iter().map(|node| node.name.as_str()).collect();
        assert_eq!(names, ["mixamorig:Hips.001", "mixamorig:Hips.002", "mixamorig:Hips"]);
    }
}
