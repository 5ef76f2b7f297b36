//! Clips of a file put onto a rig.

use std::collections::{BTreeMap, BTreeSet};

use super::{BoundClips, ReadAnimation};
use crate::rig::{Uid, animation::NodeNames};

/// The clips with uids of the nodes of a rig.
pub(super) fn bind_clips(read: &ReadAnimation, there: &NodeNames) -> BoundClips {
    let masked = read.clips.iter().flat_map(|clip| &clip.layers).flat_map(|layer| layer.mask.iter().copied());
    let nodes: BTreeSet<Uid> = read.clips.iter().flat_map(|clip| clip.nodes()).chain(masked).collect();
    let mut taken: BTreeSet<Uid> = nodes.iter().copied().filter(|node| there.0.contains_key(node)).collect();
    let mut map: BTreeMap<Uid, Uid> = BTreeMap::new();
    let mut missing = Vec::new();
    for node in nodes.iter().copied().filter(|node| !there.0.contains_key(node)) {
        let found = read.names.0.get(&node).and_then(|name| there.find(name));
        match found.filter(|found| taken.insert(*found)) {
            Some(found) => {
                map.insert(node, found);
            }
            None => missing.push(node),
        }
    }
    let clips = read.clips.iter().map(|clip| clip.with_nodes(|node| map.get(&node).copied().unwrap_or(node)));
    BoundClips { clips: clips.collect(), by_label: map.into_iter().collect(), missing }
}
