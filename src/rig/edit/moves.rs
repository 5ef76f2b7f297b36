//! Edits that move what is stored of nodes to other nodes.

use std::collections::BTreeMap;

use crate::rig::{Rig, RigEdit, Uid};

impl Rig {
    /// Exchanges what is stored of the two nodes of each pair, pair after pair.
    pub(super) fn exchange_nodes(&mut self, pairs: &[(Uid, Uid)]) -> RigEdit {
        for &(one, other) in pairs {
            exchange(&mut self.pose, one, other);
            exchange(&mut self.values, one, other);
            self.poses.change_each(|pose| {
                exchange(&mut pose.offsets, one, other);
                exchange(&mut pose.values, one, other);
            });
            let other_of = |node: Uid| match node {
                node if node == one => other,
                node if node == other => one,
                node => node,
            };
            let concerned = self.clips.iter_mut().filter(|clip| {
                let is_one = |node: &Uid| [one, other].contains(node);
                clip.nodes().iter().any(is_one) || clip.layers.iter().any(|layer| layer.mask.iter().any(is_one))
            });
            concerned.for_each(|clip| *clip = clip.with_nodes(other_of));
        }
        RigEdit::ExchangeNodes(pairs.iter().rev().copied().collect())
    }

    /// True if the rig stores anything of a node: an offset, attribute values, a part of a stored pose, or keys.
    pub(in crate::rig) fn has_stored(&self, node: Uid) -> bool {
        let in_pose = self.pose.contains_key(&node) || self.values.contains_key(&node);
        in_pose
            || self.poses.iter().any(|pose| pose.offsets.contains_key(&node) || pose.values.contains_key(&node))
            || self.clips.iter().any(|clip| clip.nodes().contains(&node))
    }
}

fn exchange<T>(map: &mut BTreeMap<Uid, T>, one: Uid, other: Uid) {
    let (of_one, of_other) = (map.remove(&one), map.remove(&other));
    map.extend(of_one.map(|value| (other, value)));
    map.extend(of_other.map(|value| (one, value)));
}
