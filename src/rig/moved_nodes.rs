//! Nodes of commands that moved to another joint: what a command makes for its joint has another uid there.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::{AttributeValues, BuiltRig, Origin, PoseOffset, Rig, Uid};

/// Tags that are on one joint in one version of a rig and on another joint in the next one.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MovedTags(BTreeMap<Uid, (Uid, Uid)>);

impl MovedTags {
    /// Tags that both versions have, on different joints.
    pub fn between(before: &Rig, after: &Rig) -> Self {
        let moved = before.tags.iter().filter_map(|(tag, from)| {
            let to = after.tags.get(tag)?;
            (from != to).then_some((*tag, (*from, *to)))
        });
        Self(moved.collect())
    }

    /// Adds a tag that was on the joint `from` and is on the joint `to`.
    pub fn add(&mut self, tag: Uid, from: Uid, to: Uid) {
        if from != to {
            self.0.insert(tag, (from, to));
        }
    }

    /// True if no tag has moved.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Nodes of the version `after` that follow from moved tags, each as (uid before, uid after): those that a moved command
    /// made for its joint or for a joint below it, and those that any command made for such a node. Joints below correspond
    /// by their places among their siblings. `built` is what the commands of `after` make.
    pub fn nodes(&self, before: &Rig, after: &Rig, built: &BuiltRig) -> Vec<(Uid, Uid)> {
        let mut former: BTreeMap<Uid, Uid> = BTreeMap::new();
        if self.is_empty() {
            return Vec::new();
        }
        // A node may be made for a node that comes after it in the list.
        loop {
            let known = former.len();
            for node in &built.nodes {
                let Some(origin) = node.origin.as_deref().filter(|_| !former.contains_key(&node.uid)) else { continue };
                let of_joint = || {
                    let (from, to) = self.0.get(&origin.command)?;
                    counterpart((after, *to), origin.subject, (before, *from))
                };
                let Some(subject) = former.get(&origin.subject).copied().or_else(of_joint) else { continue };
                let uid = Origin { subject, ..origin.clone() }.uid();
                if uid != node.uid {
                    former.insert(node.uid, uid);
                }
            }
            if former.len() == known {
                return former.into_iter().map(|(now, was)| (was, now)).collect();
            }
        }
    }
}

/// Joint that has the place below `from` that `joint` has below `to`; `None` if there is none, or if `joint` is not below `to`.
fn counterpart((after, to): (&Rig, Uid), joint: Uid, (before, from): (&Rig, Uid)) -> Option<Uid> {
    let (mut path, mut at) = (Vec::new(), joint);
    while at != to {
        let parent = after.joint(at)?.parent?;
        path.push(after.children(Some(parent)).iter().position(|child| *child == at)?);
        at = parent;
    }
    path.iter().rev().try_fold(from, |above, place| before.children(Some(above)).get(*place).copied())
}

/// Nodes that go on under another uid because their command moved to another joint.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MovedNodes(HashMap<Uid, Uid>);

impl MovedNodes {
    /// Nodes that the first version of a rig has under one uid, and the second one under another uid.
    pub fn between((before, was): (&Rig, &BuiltRig), (after, is): (&Rig, &BuiltRig)) -> Self {
        let tags = MovedTags::between(before, after);
        if tags.is_empty() {
            return Self::default();
        }
        let uids = |built: &BuiltRig| built.nodes.iter().map(|node| node.uid).collect::<HashSet<Uid>>();
        let (known, there) = (uids(was), uids(is));
        let is_moved = |(old, new): &(Uid, Uid)| known.contains(old) && !known.contains(new) && !there.contains(old);
        Self(tags.nodes(before, after, is).into_iter().filter(is_moved).collect())
    }

    /// True if no node has moved.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Uid of a node in the second version; `None` if it has not moved.
    pub fn get(&self, node: Uid) -> Option<Uid> {
        self.0.get(&node).copied()
    }

    /// Uids in the first and in the second version, in the order of the first.
    pub fn pairs(&self) -> Vec<(Uid, Uid)> {
        let mut pairs: Vec<(Uid, Uid)> = self.0.iter().map(|(was, is)| (*was, *is)).collect();
        pairs.sort_unstable();
        pairs
    }

    /// Offsets of the nodes that stay, under their uids, and of those that have moved, under their next ones.
    pub fn split_offsets(&self, pose: &BTreeMap<Uid, PoseOffset>) -> [BTreeMap<Uid, PoseOffset>; 2] {
        self.split(pose)
    }

    /// Attribute values of the nodes that stay, under their uids, and of those that have moved, under their next ones.
    pub fn split_values(&self, values: &AttributeValues) -> [AttributeValues; 2] {
        self.split(values)
    }

    fn split<T: Clone>(&self, map: &BTreeMap<Uid, T>) -> [BTreeMap<Uid, T>; 2] {
        let mut parts = [BTreeMap::new(), BTreeMap::new()];
        for (node, value) in map {
            match self.get(*node).filter(|next| !map.contains_key(next)) {
                Some(next) => parts[1].insert(next, value.clone()),
                None => parts[0].insert(*node, value.clone()),
            };
        }
        parts
    }
}
