//! Entities that an app hangs on joints of instances without a hierarchy.

use bevy::prelude::*;

use super::NodeSlot;

/// Writes the world transforms of entities below joints in [`InstanceMode::Direct`](super::InstanceMode), such as a sword, or a
/// rider with nodes of its own: these joints have no local transforms, so Bevy's propagation ends there.
pub(super) fn place_attachments(
    joints: Query<(Ref<GlobalTransform>, Ref<Children>), (With<NodeSlot>, Without<Transform>)>,
    mut hung: Query<(Ref<Transform>, &mut GlobalTransform, Option<Ref<Children>>)>,
) {
    for (joint, children) in &joints {
        let is_moved = joint.is_changed() || children.is_changed();
        for child in &children {
            place(*child, &joint, is_moved, &mut hung);
        }
    }
}

/// Places an entity and what is below it, as far as something moved. What hangs there may be deeper than a stack of calls.
fn place(
    entity: Entity,
    above: &GlobalTransform,
    is_moved: bool,
    hung: &mut Query<(Ref<Transform>, &mut GlobalTransform, Option<Ref<Children>>)>,
) {
    let mut waiting = vec![(entity, *above, is_moved)];
    while let Some((entity, above, is_moved)) = waiting.pop() {
        let Ok((transform, mut global, children)) = hung.get_mut(entity) else { continue };
        let is_moved = is_moved || transform.is_changed();
        if is_moved {
            global.set_if_neq(above.mul_transform(*transform));
        }
        let Some(children) = children else { continue };
        let (here, is_moved) = (*global, is_moved || children.is_changed());
        for child in &children {
            waiting.push((*child, here, is_moved));
        }
    }
}
