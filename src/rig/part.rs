//! Parts: the needs of a template from the rig that it is dropped into.
//!
//! The joints of a part go onto joints of the host in the order of the part's document. A joint is needed if commands
//! of other joints refer to it or to its commands; the joints behind the last one needed are extras. Besides, a part is
//! connected through its sockets.

mod branches;
mod change;
mod dropped_part;
mod error;
mod instance;
mod occupancy;
mod option;
mod overrides;
mod resize;
mod shortfall;
mod socket;
mod targets;

use std::{
    collections::{HashMap, HashSet},
    fmt,
};

pub use change::PartChange;
pub use dropped_part::DroppedPart;
pub(crate) use dropped_part::without_dropped;
pub use error::PartError;
pub(in crate::rig) use instance::{MOST_BROUGHT, switch_name};
pub use instance::{MirrorParams, Part, PartInstance, have_same_fields};
pub use occupancy::{OccupiedJoint, check_unoccupied};
pub use option::{OptionError, OptionForm, PartOption};
pub use overrides::PartOverride;
pub(in crate::rig) use resize::MOST_JOINTS;
pub use resize::PartChain;
pub(in crate::rig) use shortfall::Shortfall;
pub use socket::{HeaderSocket, PartSocket, SocketError};
pub(in crate::rig) use targets::PartTargets;

use crate::rig::{
    NodeRef, Rig, RigJoint, TagKind, Uid,
    label::mirrored_label,
    reference::{NameKind, Source, references_in},
};

/// Needs of a part from its host.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PartNeeds {
    /// Labels of the joints that make it whole, in the order in which they are put onto joints of the host. A joint
    /// without a label is told by its uid.
    pub joints: Vec<String>,
    /// Places of the host that it is connected to.
    pub sockets: Vec<Socket>,
}

/// Place of a host that a part is connected to.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Socket {
    /// The joint above the counterpart of a root joint of the part, with the label of that; the rig where there is none.
    Parent(String),
    /// The control that carries the rig, see [`Source::Root`]; the rig where there is none.
    Root,
}

impl fmt::Display for Socket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parent(joint) => write!(f, "parent of {joint}"),
            Self::Root => f.write_str("root"),
        }
    }
}

impl PartNeeds {
    /// Needs of a template.
    pub fn of(part: &Rig) -> Self {
        let places = places(part);
        let of_others = part.walk().enumerate().flat_map(|(place, joint)| {
            let needed = refers_to(joint).filter_map(|(_, uid)| places.get(&uid).copied());
            needed.filter(move |other| *other != place).collect::<Vec<_>>()
        });
        let least = of_others.max().map_or(part.len().min(1), |last| last + 1);
        let roots = part.walk().filter(|joint| joint.parent.is_none());
        let mut sockets: Vec<Socket> = roots.map(|joint| Socket::Parent(name_of(joint))).collect();
        let references = part.walk().flat_map(references_of);
        if references.into_iter().any(|reference| reference.source == Source::Root) {
            sockets.push(Socket::Root);
        }
        Self { joints: part.walk().take(least).map(name_of).collect(), sockets }
    }
}

/// Unique name of a tag for the options of its template.
pub fn tag_name(rig: &Rig, tag: Uid) -> String {
    PartInstance::default().name_of_tag(rig, tag)
}

/// Label of a joint, or its uid where it has none.
pub(in crate::rig) fn name_of(joint: &RigJoint) -> String {
    joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string())
}

/// The number of the joint that each joint is, and that carries each tag.
fn places(part: &Rig) -> HashMap<Uid, usize> {
    let tags = |(place, joint): (usize, &RigJoint)| {
        let own = std::iter::once((joint.data.uid, place));
        own.chain(joint.data.tags.iter().map(move |tag| (tag.uid, place))).collect::<Vec<_>>()
    };
    part.walk().enumerate().flat_map(tags).collect()
}

/// The references of a joint's commands.
fn references_of(joint: &RigJoint) -> Vec<NodeRef> {
    let params = joint.data.tags.iter().filter_map(|tag| match &tag.kind {
        TagKind::Command { params, .. } => Some(params.as_str()),
        TagKind::Feature { .. } => None,
    });
    params.flat_map(references_in).filter_map(|found| found.references.ok()).flat_map(|list| list.0).collect()
}

/// Joints and commands that the commands of a joint refer to.
fn refers_to(joint: &RigJoint) -> impl Iterator<Item = (NameKind, Uid)> {
    let uids = references_of(joint).into_iter().flat_map(|reference| reference.uids().collect::<Vec<_>>());
    uids.filter(|(kind, _)| matches!(kind, NameKind::Joint | NameKind::Command))
}

/// Joints whose labels differ by their side alone, where neither has a partner.
pub(in crate::rig) fn unpaired_sides(rig: &Rig) -> Vec<(Uid, Uid)> {
    let mut paired: HashSet<Uid> =
        rig.walk().filter(|joint| joint.data.mirror.is_some()).map(|joint| joint.data.uid).collect();
    let labelled = rig.joints_by_label();
    let mut pairs = Vec::new();
    for joint in rig.walk() {
        let (uid, opposite) = (joint.data.uid, joint.data.label.as_deref().and_then(mirrored_label));
        let Some(other) = opposite.and_then(|label| labelled.get(label.as_str()).copied()) else { continue };
        if !paired.contains(&uid) && !paired.contains(&other) {
            paired.extend([uid, other]);
            pairs.push((uid, other));
        }
    }
    pairs
}

/// Joints and commands beyond the first `count` joints of a part that the commands of others among its first `asking` joints
/// refer to.
pub(in crate::rig) fn left_out(part: &Rig, count: usize, asking: usize) -> Vec<(NameKind, Uid)> {
    let places = places(part);
    let mut left = Vec::new();
    for (place, joint) in part.walk().take(asking).enumerate() {
        let is_left = |uid: &Uid| places.get(uid).is_some_and(|other| *other >= count && *other != place);
        left.extend(refers_to(joint).filter(|(_, uid)| is_left(uid)));
    }
    left
}
