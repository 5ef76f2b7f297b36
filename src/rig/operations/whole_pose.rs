//! Whole poses as values: mixed, mirrored, and set in one step.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    MirrorPlane, Operation,
    clips::{frame_of, partners},
};
use crate::rig::{AttributeKind, AttributeValues, BuiltRig, PoseOffset, Rig, StoredPose, Uid, animation::slerp};

/// Offsets and attributes of all nodes of a rig.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WholePose {
    /// Offsets; a node without one is at rest.
    pub offsets: BTreeMap<Uid, PoseOffset>,
    /// Attributes that were set; all others have their defaults.
    pub values: AttributeValues,
}

impl From<&StoredPose> for WholePose {
    fn from(pose: &StoredPose) -> Self {
        Self { offsets: pose.offsets.clone(), values: pose.values.clone() }
    }
}

impl WholePose {
    /// Current pose of a document.
    pub fn of(rig: &Rig) -> Self {
        Self { offsets: rig.pose().clone(), values: rig.attribute_values().clone() }
    }

    /// Nodes with an offset from rest or with a value of an attribute.
    pub fn nodes(&self) -> BTreeSet<Uid> {
        self.offsets.keys().chain(self.values.keys()).copied().collect()
    }

    /// Pose between `self` (share 0) and `other` (share 1): rotations turn along the shorter way, and choices change
    /// in the middle. Both ends are exact.
    pub fn towards(&self, other: &Self, share: f32, built: Option<&BuiltRig>) -> Self {
        if share <= 0.0 {
            return self.clone();
        }
        if share >= 1.0 || !share.is_finite() {
            return other.clone();
        }
        let mut mixed = Self::default();
        for node in self.offsets.keys().chain(other.offsets.keys()) {
            let of = |pose: &Self| pose.offsets.get(node).copied().unwrap_or_default();
            mixed.offsets.entry(*node).or_insert_with(|| between(&of(self), &of(other), share));
        }
        let names = |pose: &Self| -> Vec<(Uid, String)> {
            let of = |(node, values): (&Uid, &BTreeMap<String, f32>)| {
                let node = *node;
                values.keys().map(move |name| (node, name.clone())).collect::<Vec<_>>()
            };
            pose.values.iter().flat_map(of).collect()
        };
        for (node, name) in names(self).into_iter().chain(names(other)) {
            let attribute =
                built.and_then(|built| built.node(node)?.attributes.iter().find(|known| *known.name == *name));
            let default = attribute.map(|attribute| attribute.default);
            let of = |pose: &Self| pose.values.get(&node).and_then(|of| of.get(&name)).copied();
            // A node that is not built has no default to go to or to come from.
            let (Some(from), Some(to)) = (of(self).or(default), of(other).or(default)) else {
                if let Some(value) = of(if share < 0.5 { self } else { other }) {
                    mixed.values.entry(node).or_default().insert(name, value);
                }
                continue;
            };
            let is_choice = attribute.is_some_and(|known| matches!(known.kind, AttributeKind::Choice(_)));
            let value = match is_choice {
                true => {
                    if share < 0.5 {
                        from
                    } else {
                        to
                    }
                }
                false => from + (to - from) * share,
            };
            mixed.values.entry(node).or_default().insert(name, value);
        }
        mixed
    }

    /// Mirror image: each node takes the pose of its partner, and a node without one its own on the other side.
    pub fn mirrored(&self, rig: &Rig, built: Option<&BuiltRig>, plane: &MirrorPlane) -> Self {
        let (pairs, reflection) = (partners(rig, built), plane.reflection());
        let other = |node: Uid| pairs.get(&node).copied().unwrap_or(node);
        let frame = |node: Uid| frame_of(rig, built, node);
        let carried = |(node, offset): (&Uid, &PoseOffset)| {
            let there = other(*node);
            (there, frame(*node).carried(offset, &frame(there), reflection))
        };
        Self {
            offsets: self.offsets.iter().map(carried).filter(|(_, offset)| *offset != PoseOffset::IDENTITY).collect(),
            values: self.values.iter().map(|(node, values)| (other(*node), values.clone())).collect(),
        }
    }

    /// Partners of nodes on the other side; a node without one is left out.
    pub fn other_side(nodes: &BTreeSet<Uid>, rig: &Rig, built: Option<&BuiltRig>) -> BTreeSet<Uid> {
        let pairs = partners(rig, built);
        nodes.iter().filter_map(|node| pairs.get(node).copied()).collect()
    }

    /// Operation that changes the shown pose (`self`) of some nodes, or of all nodes, to another pose. Nodes with the same
    /// offset in both poses are left alone.
    pub fn change_to(&self, other: &Self, nodes: Option<&BTreeSet<Uid>>, name: &'static str) -> Operation {
        let is_meant = |node: &Uid| nodes.is_none_or(|nodes| nodes.contains(node));
        let all: BTreeSet<Uid> = self.nodes().into_iter().chain(other.nodes()).filter(is_meant).collect();
        let offset = |pose: &Self, node: &Uid| pose.offsets.get(node).copied().unwrap_or_default();
        let is_moved = |node: &&Uid| offset(self, node) != offset(other, node);
        let offsets = all.iter().filter(is_moved).map(|node| (*node, offset(other, node))).collect();
        let mut values = Vec::new();
        for node in &all {
            let (now, then) = (self.values.get(node), other.values.get(node));
            let names: BTreeSet<&String> = now.into_iter().chain(then).flat_map(|values| values.keys()).collect();
            for name in names {
                let of = |values: Option<&BTreeMap<String, f32>>| values.and_then(|values| values.get(name)).copied();
                if of(now) != of(then) {
                    values.push((*node, name.clone(), of(then)));
                }
            }
        }
        Operation::SetPose { name, offsets, values }
    }
}

fn between(from: &PoseOffset, to: &PoseOffset, share: f32) -> PoseOffset {
    PoseOffset {
        translation: from.translation.lerp(to.translation, share),
        rotation: slerp(from.rotation, to.rotation, share),
        scale: from.scale.lerp(to.scale, share),
    }
}
