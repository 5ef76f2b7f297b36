//! Conversion between models and rigs: a skeleton imported with a mesh, and a mesh exported with a skeleton.

use std::{
    borrow::Cow,
    collections::{BTreeSet, HashMap},
    sync::Arc,
};

use bevy::math::{Affine3, Mat4};

use crate::{
    mesh::model::{Channel, ChannelTarget, Clip, Model, Node, Part, SkinBinding, Weights},
    rig::{
        BuiltRig, JointData, NodeKind, Rig, RigEdit, SkinData, Uid, UidSource,
        bake::baked,
        deform::{DeformSkeleton, replaced_joints},
        label::label_pairs,
        text::RigText,
    },
};

/// A mesh file's skeleton as edits, and its weights.
#[derive(Debug, Clone, Default)]
pub struct ImportedSkeleton {
    /// Edits that add the joints to a rig.
    pub edits: Vec<RigEdit>,
    /// The joint that each node of the model becomes.
    pub nodes: Vec<Uid>,
    /// The model's weights, if it has any. Objects that hang on a node follow that node alone.
    pub skin: Option<Arc<SkinData>>,
}

/// Turns a model's nodes and weights into joints: names become labels, rest transforms stay as they are. Joints whose names
/// differ in their side alone become pairs.
pub fn import_skeleton(model: &Model, uids: &mut UidSource) -> ImportedSkeleton {
    let nodes: Vec<Uid> = model.nodes.iter().map(|_| uids.next_uid()).collect();
    let edits = model.nodes.iter().zip(&nodes).map(|(node, uid)| {
        let joint = JointData {
            uid: *uid,
            label: Some(node.name.clone()).filter(|name| !name.is_empty()),
            kind: if node.joint { NodeKind::Joint } else { NodeKind::Null },
            rest: node.rest.into(),
            ..Default::default()
        };
        RigEdit::AddJoint { joint: Box::new(joint), parent: node.parent.map(|parent| nodes[parent]), index: usize::MAX }
    });
    let labels: Vec<Option<&str>> = model.nodes.iter().map(|node| Some(node.name.as_str())).collect();
    let edits = edits.chain(pair_edits(&labels, &nodes)).collect();
    let skin = followed(model).map(|weights| SkinData { joints: nodes.clone(), weights, ..SkinData::default() });
    ImportedSkeleton { edits, nodes, skin: skin.map(Arc::new) }
}

/// Weights of a model in which points of objects without a skin follow the node that the object hangs on, as helmets and
/// swords do. `None` for models in which nothing is skinned and no joint carries an object.
fn followed(model: &Model) -> Option<Weights> {
    let carriers = model.carriers();
    let is_joint = |node: &usize| model.nodes.get(*node).is_some_and(|node| node.joint);
    if carriers.is_empty() || model.weights.is_none() && !carriers.iter().flatten().any(is_joint) {
        return model.weights.clone();
    }
    let mut weights = Weights::default();
    for (point, carrier) in carriers.into_iter().enumerate() {
        match (carrier, &model.weights) {
            (Some(node), _) => weights.push([(node as u32, 1.0)]),
            (None, Some(given)) if point < given.len() => weights.push(given.of(point)),
            (None, _) => weights.push([]),
        }
    }
    Some(weights)
}

/// Turns a `.rig` text into edits that add its joints, parents before children, and returns their uids in its order.
pub fn import_rig_text(text: &RigText, uids: &mut UidSource) -> (Vec<RigEdit>, Vec<Uid>) {
    let ids: Vec<Uid> = text.joints.iter().map(|_| uids.next_uid()).collect();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); text.joints.len()];
    let mut stack = Vec::new();
    for (number, joint) in text.joints.iter().enumerate() {
        match joint.parent {
            Some(parent) => children[parent].push(number),
            None => stack.push(number),
        }
    }
    stack.reverse();
    let mut edits = Vec::with_capacity(text.joints.len());
    while let Some(number) = stack.pop() {
        let joint = &text.joints[number];
        let parent = joint.parent.map(|parent| text.joints[parent].position).unwrap_or_default();
        let data = JointData {
            uid: ids[number],
            label: joint.label.clone(),
            rest: crate::rig::RestTransform::from_translation(joint.position - parent),
            ..Default::default()
        };
        edits.push(RigEdit::AddJoint {
            joint: Box::new(data),
            parent: joint.parent.map(|parent| ids[parent]),
            index: usize::MAX,
        });
        stack.extend(children[number].iter().rev());
    }
    let labels: Vec<Option<&str>> = text.joints.iter().map(|joint| joint.label.as_deref()).collect();
    edits.extend(pair_edits(&labels, &ids));
    (edits, ids)
}

/// Edits that make pairs of joints whose labels differ in their side alone.
fn pair_edits(labels: &[Option<&str>], joints: &[Uid]) -> Vec<RigEdit> {
    let pair = |[a, b]: [usize; 2]| {
        [RigEdit::SetMirror(joints[a], Some(joints[b])), RigEdit::SetMirror(joints[b], Some(joints[a]))]
    };
    label_pairs(labels).into_iter().flat_map(pair).collect()
}

/// The `.rig` text of a rig: positions in the rig's space and topology, parents first.
pub fn rig_text(rig: &Rig) -> RigText {
    let globals = rig.rest_globals();
    let numbers: HashMap<Uid, usize> = globals.iter().enumerate().map(|(number, (uid, _))| (*uid, number)).collect();
    let joints = rig.walk().zip(&globals).map(|(joint, (_, global))| super::text::RigTextJoint {
        parent: joint.parent.and_then(|parent| numbers.get(&parent).copied()),
        position: global.translation,
        label: joint.data.label.clone(),
    });
    RigText { joints: joints.collect() }
}

/// Parts from which [`character`] makes a model.
pub struct Character<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Result of the rig's commands, if it is built: the character then has the built joints.
    pub built: Option<&'a BuiltRig>,
    /// The mesh as its file has it.
    pub file: &'a Model,
    /// The mesh skinned to its file's joints at rest.
    pub rest: &'a Model,
    /// The joint that each node of the file became.
    pub nodes: &'a [Uid],
    /// The mesh's weights.
    pub skin: Option<&'a SkinData>,
}

/// A model of the mesh with the rig's joints, weights and the remaining channels of the file's clips.
///
/// Joints are in the order of [`Rig::walk`]; labels become names. Without weights the mesh stays unskinned.
pub fn character(parts: &Character) -> Model {
    let Character { rig: document, built, file, rest, nodes: file_nodes, skin } = parts;
    let rig = &*built.map_or(Cow::Borrowed(*document), |built| Cow::Owned(baked(document, built)));
    let globals = rig.rest_globals();
    let place: HashMap<Uid, usize> = globals.iter().enumerate().map(|(number, (uid, _))| (*uid, number)).collect();
    let node_of: Vec<Option<usize>> = file_nodes.iter().map(|uid| place.get(uid).copied()).collect();
    // The first of equal uids counts.
    let file_number: HashMap<Uid, usize> = file_nodes.iter().enumerate().rev().map(|(at, uid)| (*uid, at)).collect();
    let from_file = skin.is_some_and(|skin| !skin.at_rest);
    let mut model = if from_file { (*file).clone() } else { (*rest).clone() };
    model.nodes = rig
        .walk()
        .map(|joint| {
            let source = file_number.get(&joint.data.uid).and_then(|number| file.nodes.get(*number));
            Node {
                name: joint.data.label.clone().unwrap_or_default(),
                parent: joint.parent.and_then(|parent| place.get(&parent).copied()),
                rest: joint.data.rest.into(),
                joint: joint.data.kind == NodeKind::Joint,
                extras: source.and_then(|source| source.extras.clone()),
            }
        })
        .collect();
    model.clips = file.clips.iter().filter_map(|clip| remaining_clip(clip, &node_of)).collect();
    model.weights = skin.map(|skin| remapped(skin, document, &DeformSkeleton::new(document, *built), &place));
    for object in &mut model.objects {
        object.node = object.node.and_then(|node| node_of.get(node).copied().flatten());
    }
    match skin {
        Some(skin) if skin.at_rest => {
            // A null that became one after the mesh was bound to it moves the mesh as before, as joints of a file do.
            let weights =
                model.weights.iter().flat_map(|weights| (0..weights.len()).flat_map(move |at| weights.of(at)));
            for (node, _) in weights.filter(|(_, weight)| *weight > 0.0) {
                model.nodes[node as usize].joint = true;
            }
            let joints: Vec<usize> = (0..model.nodes.len()).filter(|node| model.nodes[*node].joint).collect();
            let inverse_binds = joints.iter().map(|joint| inverse_bind(&globals[*joint].1)).collect();
            model.skins = vec![SkinBinding { name: rig.about().name.clone(), joints, inverse_binds }];
            for object in &mut model.objects {
                object.skin = Some(0);
                object.node = None;
            }
        }
        Some(_) => {
            model.skins = rebound(file, &node_of, &globals);
            settle_carried(&mut model, &globals);
        }
        None => {}
    }
    model
}

/// Settles the objects that hang on a node in their file: those that follow it alone go on to hang on it, without weights, as
/// files have them; others, as after painting, get a skin that is bound at rest.
fn settle_carried(model: &mut Model, globals: &[(Uid, Affine3)]) {
    let carriers = model.carriers();
    if carriers.is_empty() {
        return;
    }
    let Some(weights) = model.weights.take() else { return };
    let mut is_rebound = vec![false; model.objects.len()];
    let mut object_of = vec![0; carriers.len()];
    let hangs = |part: &&Part| {
        let object = &model.objects[part.object];
        object.skin.is_none() && object.node.is_some()
    };
    for part in model.parts.iter().filter(hangs) {
        for point in part.vertices.iter().map(|point| *point as usize) {
            let carrier = carriers.get(point).copied().flatten();
            let Some(node) = carrier.filter(|_| point < weights.len()) else { continue };
            object_of[point] = part.object;
            is_rebound[part.object] |= weights.of(point).any(|(joint, _)| joint as usize != node);
        }
    }
    let (mut settled, mut joints) = (Weights::default(), BTreeSet::new());
    for (point, carrier) in carriers.into_iter().enumerate().take(weights.len()) {
        match carrier {
            Some(node) if is_rebound[object_of[point]] => {
                let mut row: Vec<(u32, f32)> = weights.of(point).collect();
                if row.is_empty() {
                    row.push((node as u32, 1.0));
                }
                joints.extend(row.iter().map(|(joint, _)| *joint as usize));
                settled.push(row);
            }
            Some(_) => settled.push([]),
            None => settled.push(weights.of(point)),
        }
    }
    if !joints.is_empty() {
        let skin = model.skins.len();
        for (object, _) in model.objects.iter_mut().zip(&is_rebound).filter(|(_, rebound)| **rebound) {
            (object.skin, object.node) = (Some(skin), None);
        }
        joints.iter().for_each(|joint| model.nodes[*joint].joint = true);
        let inverse_binds = joints.iter().map(|joint| inverse_bind(&globals[*joint].1)).collect();
        let joints = joints.into_iter().collect();
        model.skins.push(SkinBinding { name: model.name.clone(), joints, inverse_binds });
    }
    model.weights = model.objects.iter().any(|object| object.skin.is_some()).then_some(settled);
}

/// Skin that lists all joints of `rig`, added to a model of it that has none: readers recognise joints by the skins that
/// list them, even without skinned points.
pub fn mark_joints(model: &mut Model, rig: &Rig) {
    let joints = rig.rest_globals();
    if model.skins.is_empty() && !joints.is_empty() {
        model.skins = vec![SkinBinding {
            name: rig.about().name.clone(),
            joints: (0..joints.len()).collect(),
            inverse_binds: joints.iter().map(|(_, global)| inverse_bind(global)).collect(),
        }];
    }
}

pub(crate) fn inverse_bind(global: &Affine3) -> Mat4 {
    let inverse = Mat4::from(*global).inverse();
    // The last row of an affine matrix is set exactly, as the glTF validator requires; a joint that is flat in one
    // direction has no inverse.
    let mut columns = if inverse.is_finite() { inverse.to_cols_array() } else { Mat4::IDENTITY.to_cols_array() };
    (columns[3], columns[7], columns[11], columns[15]) = (0.0, 0.0, 0.0, 1.0);
    Mat4::from_cols_array(&columns)
}

/// Bind poses of the file over the rig's joints. Moving a joint's rest transform after the import does not move the
/// mesh: the joint's matrix keeps its former effect on the mesh at rest.
fn rebound(file: &Model, node_of: &[Option<usize>], globals: &[(Uid, Affine3)]) -> Vec<SkinBinding> {
    let file_globals = file.rest_globals();
    let bind = |skin: &SkinBinding| {
        let pairs = skin.joints.iter().zip(&skin.inverse_binds).filter_map(|(joint, inverse)| {
            let node = node_of.get(*joint).copied().flatten()?;
            let before = Mat4::from(file_globals[*joint]);
            let now = Mat4::from(globals[node].1);
            let close = before.abs_diff_eq(now, 1e-6 * before.w_axis.length().max(1.0));
            let inverse = if close { *inverse } else { inverse_bind(&globals[node].1) * before * *inverse };
            Some((node, inverse))
        });
        let (joints, inverse_binds) = pairs.unzip();
        SkinBinding { name: skin.name.clone(), joints, inverse_binds }
    };
    file.skins.iter().map(bind).collect()
}

/// Weights over the nodes of the exported model. Influences of joints that are not built go to the joints that hold
/// them meanwhile; influences of deleted joints are shared among the others.
fn remapped(skin: &SkinData, rig: &Rig, skeleton: &DeformSkeleton, place: &HashMap<Uid, usize>) -> Weights {
    let holders = skeleton.holders(rig, skin).into_iter();
    let node_of: Vec<Option<usize>> =
        holders.map(|holder| place.get(&skeleton.joints()[holder?].uid).copied()).collect();
    let weights = replaced_joints(&skin.weights, &node_of);
    if node_of.iter().all(Option::is_some) {
        return weights;
    }
    let mut complete = Weights::default();
    for point in 0..weights.len() {
        let is_whole =
            skin.weights.of(point).all(|(joint, _)| node_of.get(joint as usize).is_some_and(Option::is_some));
        let sum: f32 = if is_whole { 1.0 } else { weights.of(point).map(|(_, value)| value).sum() };
        complete.push(weights.of(point).map(|(joint, value)| (joint, value / sum)));
    }
    complete
}

fn remaining_clip(clip: &Clip, node_of: &[Option<usize>]) -> Option<Clip> {
    let moved = |node: usize| node_of.get(node).copied().flatten();
    let channels: Vec<Channel> = clip
        .channels
        .iter()
        .filter_map(|channel| {
            let target = match channel.target {
                ChannelTarget::Translation(node) => ChannelTarget::Translation(moved(node)?),
                ChannelTarget::Rotation(node) => ChannelTarget::Rotation(moved(node)?),
                ChannelTarget::Scale(node) => ChannelTarget::Scale(moved(node)?),
                ChannelTarget::MorphWeights(object) => ChannelTarget::MorphWeights(object),
            };
            Some(Channel { target, ..channel.clone() })
        })
        .collect();
    (!channels.is_empty()).then(|| Clip { channels, ..clip.clone() })
}
