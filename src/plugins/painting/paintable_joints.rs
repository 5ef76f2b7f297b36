//! Joints that can be painted, their locks, their partners, and edits of painted points.

use crate::{
    algo::paint::{PaintStroke, RowRules, assign},
    mesh::model::Weights,
    rig::{
        BuiltRig, NodeKind, NodeType, Rig, RigEdit, SkinData, Uid, WeightPatch,
        operations::{MirrorPlane, Operation},
    },
};

/// Joint that moves meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PaintableJoint {
    /// Uid by which weights refer to the joint.
    pub uid: Uid,
    /// Node that a command made the joint for; `None` for joints of the document.
    pub subject: Option<Uid>,
}

/// Reason why a node has no weights; a sentence without its full stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PaintableError {
    /// A node that does not exist.
    #[error("there is no joint {0} in the rig; choose another")]
    NoNode(Uid),
    /// A null or control.
    #[error("only joints move points, and this is none; choose a joint")]
    NoJoint(Uid),
}

/// A node as a joint that moves meshes.
///
/// # Errors
/// See [`PaintableError`].
pub fn paintable(rig: &Rig, built: Option<&BuiltRig>, node: Uid) -> Result<PaintableJoint, PaintableError> {
    if let Some(joint) = rig.joint(node) {
        let is_joint = joint.data.kind == NodeKind::Joint;
        return if is_joint {
            Ok(PaintableJoint { uid: node, subject: None })
        } else {
            Err(PaintableError::NoJoint(node))
        };
    }
    let created = built.and_then(|built| built.node(node)).ok_or(PaintableError::NoNode(node))?;
    if created.kind != NodeType::Joint {
        return Err(PaintableError::NoJoint(node));
    }
    Ok(PaintableJoint { uid: node, subject: created.origin.as_ref().map(|origin| origin.subject) })
}

/// The joint on the other side of a plane: the partner, or the joint itself if it stands on the plane. Joints that commands
/// made have those as partners that were made in the same way for the partner.
pub fn opposite_of(
    rig: &Rig,
    built: Option<&BuiltRig>,
    joint: PaintableJoint,
    plane: &MirrorPlane,
) -> Option<PaintableJoint> {
    let of = |uid: Uid| match rig.joint(uid)?.data.mirror.filter(|partner| rig.joint(*partner).is_some()) {
        Some(partner) => Some(partner),
        None => (plane.distance(rig.position(uid)).abs() <= plane.tolerance).then_some(uid),
    };
    let Some(subject) = joint.subject else {
        return Some(PaintableJoint { uid: of(joint.uid)?, subject: None });
    };
    let (partner, built) = (of(subject)?, built?);
    if partner == subject {
        return Some(joint);
    }
    let own = built.node(joint.uid)?.origin.as_ref()?;
    let found = built.nodes.iter().find(|node| {
        let is_alike = |origin: &crate::rig::Origin| {
            origin.subject == partner
                && origin.role == own.role
                && origin.module == own.module
                && origin.number == own.number
        };
        node.kind == NodeType::Joint && node.origin.as_deref().is_some_and(is_alike)
    })?;
    Some(PaintableJoint { uid: found.uid, subject: Some(partner) })
}

/// Locks of joints; those that commands made are locked with the joint that they were made for.
pub fn locks(rig: &Rig, joints: impl IntoIterator<Item = (Uid, Option<Uid>)>) -> Vec<bool> {
    let is_locked = |(joint, subject): (Uid, Option<Uid>)| {
        rig.joint(subject.unwrap_or(joint)).is_some_and(|joint| joint.data.locked)
    };
    joints.into_iter().map(is_locked).collect()
}

/// The operation of a stroke as far as it has gone, with the joints that it adds to the weights; `None` if it changes
/// nothing. `before` are the weights before the stroke.
pub fn stroke_edit(
    mesh: Uid,
    before: &SkinData,
    added: &[(Uid, Option<Uid>)],
    stroke: &PaintStroke,
) -> Option<Operation> {
    let (points, rows) = stroke.changed(&before.weights);
    if points.is_empty() {
        return None;
    }
    let name = if stroke.brush().mode.is_relative() { "Smooth weights" } else { "Paint weights" };
    let patch = WeightPatch::new(before, added.to_vec(), points, rows);
    Some(Operation::Named { name, edits: vec![RigEdit::SetWeights(mesh, Box::new(patch))] })
}

/// The operation that gives a joint a weight at points of a mesh; `None` if nothing changes. Other free joints share the
/// rest of each point; locked ones keep theirs, and a weight above the share that they leave is taken down to it.
pub fn row_edit(
    rig: &Rig,
    (mesh, skin): (Uid, &SkinData),
    joint: PaintableJoint,
    points: impl IntoIterator<Item = u32>,
    weight: f32,
) -> Option<Operation> {
    let (numbers, added) = crate::rig::joint_numbers(skin, &[(joint.uid, joint.subject)]);
    let known = skin.joints.iter().map(|joint| (*joint, skin.subjects.get(joint).copied()));
    let locked = locks(rig, known.chain(added.iter().copied()));
    let rules = RowRules { locked: &locked, most: usize::MAX };
    let (mut changed, mut rows) = (Vec::new(), Weights { starts: vec![0], ..Weights::default() });
    for point in points.into_iter().filter(|point| (*point as usize) < skin.weights.len()) {
        let row: Vec<(u32, f32)> = skin.weights.of(point as usize).collect();
        let next = assign(&row, &[(*numbers.first()?, weight)], &rules);
        if next != row {
            changed.push(point);
            rows.push(next);
        }
    }
    if changed.is_empty() {
        return None;
    }
    let patch = WeightPatch::new(skin, added, changed, rows);
    Some(Operation::Named { name: "Set weights", edits: vec![RigEdit::SetWeights(mesh, Box::new(patch))] })
}
