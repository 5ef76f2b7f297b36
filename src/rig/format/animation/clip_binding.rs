//! Clips of a file put onto a rig.

use std::collections::{BTreeMap, BTreeSet};

use super::{BoundClips, ReadAnimation};
use crate::rig::{
    Uid,
    animation::{NodeNames, RigClip},
};

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
    let bound = |clip: &RigClip| {
        let mut clip = clip.with_nodes(|node| map.get(&node).copied().unwrap_or(node));
        let masked = clip.layers.iter().flat_map(|layer| &layer.mask);
        let nodes: BTreeSet<Uid> = clip.nodes().into_iter().chain(masked.copied()).collect();
        let named = missing.iter().filter(|node| nodes.contains(*node));
        let names = named.filter_map(|node| Some((*node, read.names.0.get(node)?.clone())));
        clip.names = NodeNames(names.collect());
        clip
    };
    let clips = read.clips.iter().map(bound).collect();
    BoundClips { clips, by_label: map.into_iter().collect(), missing }
}
