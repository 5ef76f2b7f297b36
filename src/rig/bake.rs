//! Baking: a built rig as an ordinary skeleton without commands.

use std::collections::HashSet;

use super::{BuiltRig, GroupData, JointData, NodeKind, NodeType, Rig, RigAbout, RigEdit, Uid};

/// Makes a rig without tags from the joints of a built one and the nodes that carry them. Uids, labels and groups stay,
/// so that weights fit; controls and nulls that carry no joint are left out, other nodes become nulls.
pub fn baked(rig: &Rig, built: &BuiltRig) -> Rig {
    let mut kept: HashSet<usize> = HashSet::new();
    for (at, node) in built.nodes.iter().enumerate() {
        let mut next = (node.kind == NodeType::Joint || node.origin.is_none()).then_some(at);
        while let Some(at) = next.filter(|at| kept.insert(*at)) {
            next = built.nodes[at].parent;
        }
    }
    let mut baked = Rig::new(rig.uid(), rig.about().name.clone());
    let groups = rig.groups().iter().cloned().enumerate();
    // An edit is refused only for a rotation that is far from a unit quaternion; that joint is then left out.
    let mut apply = |edit: RigEdit| drop(baked.apply(&edit));
    // Without commands there is nothing that an option could set.
    apply(RigEdit::SetAbout(Box::new(RigAbout { options: Vec::new(), ..rig.about().clone() })));
    groups.for_each(|(at, group)| apply(RigEdit::AddLocalGroup(GroupData { enabled: true, ..group }, at)));
    let known: HashSet<Uid> = rig.groups().iter().map(|group| group.uid).collect();
    for (at, node) in built.nodes.iter().enumerate().filter(|(at, _)| kept.contains(at)) {
        let source = rig.joint(node.uid).map(|joint| &joint.data);
        let joint = JointData {
            uid: node.uid,
            // The label of a created node is that of another joint, so the node's own name says more.
            label: if source.is_some() {
                node.label.as_deref().map(str::to_owned)
            } else {
                Some(node.name.to_string())
            },
            group: node.group.filter(|group| known.contains(group)),
            kind: if node.kind == NodeType::Joint { NodeKind::Joint } else { NodeKind::Null },
            rest: node.base.into(),
            // A joint that is its own partner is a fault of a rig, which nobody could mend in its skeleton.
            mirror: source.and_then(|source| source.mirror).filter(|partner| *partner != node.uid),
            locked: source.is_some_and(|source| source.locked),
            tags: Vec::new(),
            face: None,
        };
        let parent = built.nodes[at].parent.map(|parent| built.nodes[parent].uid);
        apply(RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX });
    }
    rig.skins().for_each(|(mesh, skin)| apply(RigEdit::SetSkin(mesh, Some(skin.clone()))));
    baked
}
