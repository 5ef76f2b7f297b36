//! Joints that a part goes onto, and the operation that puts it there.
//!
//! A part goes onto joints once: two of a kind on the same joints drive them both, and the constraints of each wait for those of
//! the other.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use super::sides::{partner, partners};
use crate::{
    editor::panels::joint_name,
    processor::Modules,
    rig::{
        Rig, RigEdit, RigJoint, TagKind, Uid,
        label::label_side,
        operations::{PartSide, TagOperation},
        part::{Part, PartError, PartInstance},
        step::Step,
    },
};

/// Number of commands from which on the same ones on the same joints are those of the same part.
const TELLING: usize = 4;

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
    #[error(
        "{joint} belongs to {part} already, and two of them cannot move the same joints; change that part, delete its tags \
         first, or choose other joints"
    )]
    Occupied {
        /// Name of the joint.
        joint: String,
        /// Name of the part, with its article.
        part: String,
    },
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
        check_free(rig, instances, &part, joints)?;
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

/// Refuses joints that have tags of an instance of the part, or the commands of such a part one by one.
fn check_free(rig: &Rig, instances: &[PartInstance], part: &Part, joints: &[Uid]) -> Result<(), AdditionError> {
    let dropped: Vec<PartInstance> =
        rig.dropped_parts().iter().map(|dropped| dropped.instance_onto(Vec::new())).collect();
    let own: Vec<Uid> = part.rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    let mut brought: HashMap<Uid, &PartInstance> = HashMap::new();
    for instance in dropped.iter().chain(instances) {
        brought.extend(own.iter().map(|tag| (instance.uid_of(*tag), instance)));
    }
    let occupied =
        |joint: &RigJoint, part: String| AdditionError::Occupied { joint: joint_name(&joint.data).into_owned(), part };
    for joint in joints.iter().filter_map(|joint| rig.joint(*joint)) {
        if let Some(instance) = joint.data.tags.iter().find_map(|tag| brought.get(&tag.uid)) {
            let title = instance.title();
            let name = title.rsplit(['/', '\\']).next().unwrap_or(title);
            let name = name.strip_suffix(".rig.ron").unwrap_or(name);
            return Err(occupied(joint, format!("the part \"{name}\"")));
        }
    }
    // Tags that were injected or written by hand belong to no instance.
    let pairs: Vec<(&RigJoint, Vec<&str>)> = part
        .rig
        .walk()
        .zip(joints)
        .filter_map(|(of_part, joint)| Some((rig.joint(*joint)?, modules_of(of_part))))
        .filter(|(_, modules)| !modules.is_empty())
        .collect();
    let has_all = |(joint, wanted): &(&RigJoint, Vec<&str>)| {
        let mut found = modules_of(joint);
        wanted.iter().all(|module| match found.iter().position(|other| other == module) {
            Some(place) => {
                found.swap_remove(place);
                true
            }
            None => false,
        })
    };
    let count: usize = pairs.iter().map(|(_, modules)| modules.len()).sum();
    match pairs.first() {
        Some(&(joint, _)) if count >= TELLING && pairs.iter().all(has_all) => {
            Err(occupied(joint, "a part of this kind".to_owned()))
        }
        _ => Ok(()),
    }
}

/// Modules of the commands of a joint.
fn modules_of(joint: &RigJoint) -> Vec<&str> {
    let tags = joint.data.tags.iter();
    tags.filter_map(|tag| match &tag.kind {
        TagKind::Command { module, .. } => Some(module.as_str()),
        TagKind::Feature { .. } => None,
    })
    .collect()
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
