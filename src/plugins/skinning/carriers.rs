//! Joints of a rig that carry objects of a mesh whose skeleton is not the rig's own.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use bevy::math::Vec3;

use crate::{
    mesh::model::Model,
    rig::{Rig, Uid},
};

/// Distance up to which a joint is at the place of a node, as a share of the way to the furthest node.
const SAME_PLACE: f32 = 0.01;

/// Joints that have the name and the place of a node on which an object of a file hangs, by node.
///
/// Names of several joints are left out, and so are roots, on which a whole figure may hang that bends.
pub(super) fn joints_at_nodes(rig: &Rig, file: &Model) -> BTreeMap<usize, Uid> {
    let nodes: BTreeSet<usize> = file.objects.iter().filter_map(|object| object.node).collect();
    if nodes.is_empty() {
        return BTreeMap::new();
    }
    let places: Vec<Vec3> = file.rest_globals().iter().map(|place| place.translation.into()).collect();
    let first = places.first().copied().unwrap_or_default();
    let far = places.iter().map(|place| place.distance(first)).fold(0.0, f32::max);
    let mut joints: HashMap<&str, Option<Uid>> = HashMap::new();
    for joint in rig.walk() {
        if let Some(label) = joint.data.label.as_deref() {
            let own = joint.parent.map(|_| joint.data.uid);
            joints.entry(label).and_modify(|known| *known = None).or_insert(own);
        }
    }
    let at = |node: usize| {
        let joint = (*joints.get(&*file.nodes.get(node)?.name)?)?;
        let off = places.get(node)?.distance(rig.position(joint));
        (off <= SAME_PLACE * far).then_some((node, joint))
    };
    nodes.into_iter().filter_map(at).collect()
}
