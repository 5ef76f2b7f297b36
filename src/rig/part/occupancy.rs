//! Joints that have a part already.
//!
//! A part goes onto joints once: two of a kind on the same joints drive them both, and the constraints of each wait for those of
//! the other.

use std::collections::HashMap;

use super::{Part, PartInstance};
use crate::rig::{Rig, RigJoint, TagKind, Uid};

/// Number of commands from which on the same ones on the same joints are those of the same part.
const TELLING: usize = 4;

/// Joint that belongs to a part of a kind, where another one of that kind was to go.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{joint} belongs to {part} already, and two of them cannot move the same joints; change that part, delete its tags \
     first, or choose other joints"
)]
pub struct OccupiedJoint {
    /// Name of the joint.
    pub joint: String,
    /// Name of the part, with its article.
    pub part: String,
}

impl OccupiedJoint {
    fn new(joint: &RigJoint, part: String) -> Self {
        Self { joint: joint.data.name().into_owned(), part }
    }
}

/// Refuses joints that have tags of an instance of the part, or the commands of such a part one by one. `instances` are the parts
/// that the rig has from its template, besides those that were dropped onto it.
///
/// # Errors
/// The first joint that is occupied.
pub fn check_unoccupied(
    rig: &Rig,
    instances: &[PartInstance],
    part: &Part,
    joints: &[Uid],
) -> Result<(), OccupiedJoint> {
    let dropped: Vec<PartInstance> =
        rig.dropped_parts().iter().map(|dropped| dropped.instance_onto(Vec::new())).collect();
    let own: Vec<Uid> = part.rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    let mut brought: HashMap<Uid, &PartInstance> = HashMap::new();
    for instance in dropped.iter().chain(instances) {
        brought.extend(own.iter().map(|tag| (instance.uid_of(*tag), instance)));
    }
    for joint in joints.iter().filter_map(|joint| rig.joint(*joint)) {
        if let Some(instance) = joint.data.tags.iter().find_map(|tag| brought.get(&tag.uid)) {
            let title = instance.title();
            let name = title.rsplit(['/', '\\']).next().unwrap_or(title);
            let name = name.strip_suffix(".rig.ron").unwrap_or(name);
            return Err(OccupiedJoint::new(joint, format!("the part \"{name}\"")));
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
            Err(OccupiedJoint::new(joint, "a part of this kind".to_owned()))
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
