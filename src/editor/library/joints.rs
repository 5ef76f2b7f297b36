//! Joints that a part goes onto, and the operation that puts it there.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use super::sides::{partner, partners};
use crate::{
    processor::Modules,
    rig::{
        Rig, RigEdit, Uid,
        label::label_side,
        operations::{PartSide, TagOperation},
        part::{OccupiedJoint, Part, PartError, PartInstance, check_unoccupied},
        step::Step,
    },
};

/// An operation that adds a part.
pub(super) struct PartAddition {
    /// The operation.
    pub operation: TagOperation,
    /// Joint without a partner, for which a part that was to go onto both sides goes onto one.
    pub lonely: Option<Uid>,
}

/// Reason why a part does not go onto joints.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum AdditionError {
    /// The part does not take the joints, or one of its options not its value.
    #[error(transparent)]
    Part(#[from] PartError),
    /// The joints belong to a part of the same kind.
    #[error(transparent)]
    Occupied(#[from] OccupiedJoint),
}

/// The operation that puts a part onto the chosen joints of a rig, so that it stays a part: mirrored where these are on the
/// other side than its own. `name` is that by which the rig's file calls the part; `stroke` are the joints of the last step.
/// With `both`, a mirrored one goes onto the partners of the joints in the same step. `instances` are the parts that the rig has
/// from its template.
///
/// # Errors
/// A part that does not take so many joints, one of its options that does not take the value, or joints that have this part.
pub(super) fn added(
    (rig, instances): (&Rig, &[PartInstance]),
    (chosen, stroke): (&[Uid], &[Uid]),
    (name, part): (String, Part),
    options: &[(String, String)],
    both: bool,
    modules: &Modules,
) -> Result<PartAddition, AdditionError> {
    let joints = joints_for(rig, chosen, stroke, &part);
    part.sized_for(joints.len())?;
    let others = if both { partners(rig, &joints) } else { None };
    for joints in std::iter::once(&joints).chain(&others) {
        check_unoccupied(rig, instances, &part, joints)?;
    }
    let label = |joint: &Uid| rig.joint(*joint).and_then(|joint| joint.data.label.as_deref());
    let of_part = side(part.rig.walk().map(|joint| joint.data.label.as_deref()));
    let mirror = of_part != 0 && side(joints.iter().map(label)) == -of_part;
    let mirrored = |module: &str, params: &str| modules.get(module)?.mirrored(params).ok();
    let part = part.with_options(options)?;
    let on = |joints: Vec<Uid>, mirror: bool| -> Result<PartSide, PartError> {
        let onto = vec![String::new(); joints.len()];
        let instance = PartInstance { part: name.clone(), onto, mirror, ..PartInstance::default() };
        Ok(PartSide { fitted: Arc::new(instance.fitted(&part, &mirrored)?), joints, mirror })
    };
    if let Some(others) = others {
        let sides = [on(joints, mirror)?, on(others, !mirror)?];
        return Ok(PartAddition { operation: TagOperation::AddPair { part: name, sides }, lonely: None });
    }
    // Parts of the trunk have no other side.
    let (with, without): (Vec<Uid>, Vec<Uid>) =
        joints.iter().copied().partition(|joint| partner(rig, *joint).is_some());
    let lonely = without.first().filter(|_| both && !with.is_empty()).copied();
    let PartSide { fitted, joints, mirror } = on(joints, mirror)?;
    Ok(PartAddition { operation: TagOperation::AddPart { part: name, fitted, joints, mirror }, lonely })
}

/// Side of the first label that names one: see [`label_side`].
fn side<'l>(labels: impl Iterator<Item = Option<&'l str>>) -> i32 {
    labels.flatten().map(label_side).find(|side| *side != 0).unwrap_or_default()
}

/// Joints that a part goes onto: the chosen joints in the order of the rig. For a single joint it is the chain that was
/// drawn last, if that ends there; else the joint and those below it which are children of each other as the part's are,
/// until there is none; a chain at the part's end, which may have more joints, goes on down to the next branch.
fn joints_for(rig: &Rig, chosen: &[Uid], stroke: &[Uid], part: &Part) -> Vec<Uid> {
    let [top] = *chosen else {
        return rig.walk().map(|joint| joint.data.uid).filter(|joint| chosen.contains(joint)).collect();
    };
    if rig.children(Some(top)).is_empty() && stroke.contains(&top) {
        let above = rig.ancestors(top).map(|joint| joint.data.uid).take_while(|joint| stroke.contains(joint));
        let mut drawn: Vec<Uid> = std::iter::once(top).chain(above).collect();
        if drawn.len() > 1 {
            drawn.reverse();
            return drawn;
        }
    }
    let mut pairs: HashMap<Uid, Uid> = HashMap::new();
    let mut joints = Vec::new();
    for joint in part.rig.walk() {
        let below = |parent: Uid| {
            let number = part.rig.children(Some(parent)).iter().position(|child| *child == joint.data.uid)?;
            rig.children(Some(*pairs.get(&parent)?)).get(number).copied()
        };
        let found = match joint.parent {
            Some(parent) => below(parent),
            None => Some(top).filter(|_| joints.is_empty()),
        };
        let Some(found) = found else { return joints };
        pairs.insert(joint.data.uid, found);
        joints.push(found);
    }
    let end = part.rig.walk().last().map(|joint| joint.data.uid);
    if let ([chain], Some(end), Some(last)) = (part.chains.as_slice(), end, joints.last())
        && !chain.is_fan
        && chain.joints.contains(&end)
    {
        let most = (part.rig.len() - chain.joints.len()).saturating_add(chain.max);
        let mut last = *last;
        while let [next] = *rig.children(Some(last))
            && joints.len() < most
        {
            joints.push(next);
            last = next;
        }
    }
    joints
}

/// Joints that a step added.
pub(super) fn added_by(step: Option<&Step>) -> Vec<Uid> {
    fn collect(edits: &[RigEdit], joints: &mut Vec<Uid>, seen: &mut HashSet<Uid>) {
        for edit in edits {
            match edit {
                RigEdit::AddJoint { joint, .. } if seen.insert(joint.uid) => joints.push(joint.uid),
                RigEdit::Batch(edits) => collect(edits, joints, seen),
                _ => {}
            }
        }
    }
    let mut joints = Vec::new();
    if let Some(step) = step {
        collect(&step.forward, &mut joints, &mut HashSet::new());
    }
    joints
}
