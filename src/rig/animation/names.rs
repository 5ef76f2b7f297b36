//! Names of nodes beside their uids, and keys of nodes that are gone.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::RigClip;
use crate::rig::{BuiltRig, Rig, Uid};

/// Names by which a node can be found again when it has another uid.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct NodeName {
    /// The label; empty without one.
    #[serde(default)]
    pub label: String,
    /// The purpose that a command gave to the node; empty for joints of the document.
    #[serde(default)]
    pub role: String,
}

/// Names of nodes by their uids.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct NodeNames(pub BTreeMap<Uid, NodeName>);

impl NodeNames {
    /// Names of the joints of a document and of the nodes that its commands built.
    pub fn of(rig: &Rig, built: Option<&BuiltRig>) -> Self {
        let mut names = BTreeMap::new();
        for node in built.into_iter().flat_map(|built| &built.nodes) {
            let label = node.label.as_deref().unwrap_or(&node.name).to_owned();
            let role = node.origin.as_ref().map_or_else(String::new, |origin| origin.role.to_string());
            names.insert(node.uid, NodeName { label, role });
        }
        for joint in rig.walk() {
            let label = joint.data.label.clone().unwrap_or_default();
            names.insert(joint.data.uid, NodeName { label, role: String::new() });
        }
        Self(names)
    }

    /// True without any names.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Takes in other names; nodes that are in both get the other ones.
    pub fn extend(&mut self, other: &Self) {
        self.0.extend(other.0.iter().map(|(uid, name)| (*uid, name.clone())));
    }

    /// The only node with the label and role of `name`; without a role in `name`, the only joint with its label, or else
    /// the only node with it. `None` if there are several, or none.
    pub fn find(&self, name: &NodeName) -> Option<Uid> {
        if name.label.is_empty() {
            return None;
        }
        let only = |is_it: &dyn Fn(&NodeName) -> bool| {
            let mut found = self.0.iter().filter(|(_, known)| is_it(known)).map(|(uid, _)| *uid);
            let first = found.next()?;
            found.next().is_none().then_some(first)
        };
        let same = only(&|known| known == name);
        if name.role.is_empty() { same.or_else(|| only(&|known| known.label == name.label)) } else { same }
    }
}

/// Keys of a node that is neither a joint nor built at present. They stay in the clip and take effect when the node is
/// back.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OrphanedKeys {
    /// The clip.
    pub clip: Uid,
    /// The layer.
    pub layer: Uid,
    /// The node that is gone.
    pub node: Uid,
    /// Last known names of the node.
    pub name: NodeName,
    /// Number of its tracks.
    pub tracks: usize,
    /// Number of its keys.
    pub keys: usize,
    /// Node of the same label and role under another uid, which the layer does not animate yet:
    /// [`KeyOperation::Adopt`](crate::rig::operations::KeyOperation::Adopt) gives it the keys.
    pub offer: Option<Uid>,
}

/// Keys of nodes that are neither joints of the document nor built, by clip, layer and node. Other nodes are offered by the names
/// of earlier builds in `known`, and else by those that the clip brought with it.
pub fn orphaned_keys(rig: &Rig, built: Option<&BuiltRig>, known: &NodeNames) -> Vec<OrphanedKeys> {
    let there = NodeNames::of(rig, built);
    rig.clips().iter().flat_map(|clip| of_clip(clip, &there, known)).collect()
}

/// Keys of a clip whose nodes one version of a rig has and the next one does not, by layer and node.
pub fn keys_set_aside(clip: &RigClip, before: &NodeNames, after: &NodeNames) -> Vec<OrphanedKeys> {
    let mut found = of_clip(clip, after, before);
    found.retain(|keys| before.0.contains_key(&keys.node));
    found
}

fn of_clip(clip: &RigClip, there: &NodeNames, known: &NodeNames) -> Vec<OrphanedKeys> {
    let mut found = Vec::new();
    for layer in &clip.layers {
        let mut counts: BTreeMap<Uid, (usize, usize)> = BTreeMap::new();
        for (target, track) in &layer.tracks {
            let count = counts.entry(target.node).or_default();
            *count = (count.0 + 1, count.1 + track.keys.len());
        }
        for (node, (tracks, keys)) in counts.iter().filter(|(node, _)| !there.0.contains_key(node)) {
            let name = known.0.get(node).or_else(|| clip.names.0.get(node)).cloned().unwrap_or_default();
            let offer = there.find(&name).filter(|offer| !counts.contains_key(offer));
            let (clip, layer) = (clip.uid, layer.uid);
            found.push(OrphanedKeys { clip, layer, node: *node, name, tracks: *tracks, keys: *keys, offer });
        }
    }
    found
}
