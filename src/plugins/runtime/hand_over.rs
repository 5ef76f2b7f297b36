//! Joints that something else than their rig moves: physics, a cloth solver, a motion capture stream.

use bevy::{math::Affine3A, prelude::*};

use super::RigRuntime;

/// Hands the joints of a running rig over to something else, on the rig's entity: joints with an [`OutsideTransform`] go
/// there, and what hangs on them follows. Controls and constraints run on beneath, so that the rig can take over again at any
/// time: change the share little by little.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Default)]
#[reflect(Component, Default)]
pub struct HandOver {
    /// Share of the outside transforms, 0 (the rig alone) to 1.
    pub share: f32,
}

/// Transform, in the world, to which something outside the rig moves a joint.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
pub struct OutsideTransform(pub Isometry3d);

/// A rig whose nodes do not stand where its program puts them.
#[derive(Component)]
pub(super) struct HandedOverRig;

/// Writes the world transforms of nodes of rigs that are handed over.
pub(super) fn hand_over(
    rigs: Query<(Entity, &RigRuntime, Option<&HandOver>, &GlobalTransform, Has<HandedOverRig>)>,
    outside: Query<&OutsideTransform>,
    mut nodes: Query<&mut GlobalTransform, Without<RigRuntime>>,
    mut commands: Commands,
) {
    for (rig, runtime, hand_over, world, was_over) in &rigs {
        let share = hand_over.map_or(0.0, |hand_over| hand_over.share.clamp(0.0, 1.0));
        let is_over = share > 0.0;
        if is_over && !was_over {
            commands.entity(rig).try_insert(HandedOverRig);
        } else if was_over && !is_over {
            commands.entity(rig).try_remove::<HandedOverRig>();
        }
        if !is_over && !was_over {
            continue;
        }
        let world = world.affine();
        let program = runtime.state().program().clone();
        // What moves each node from where its program puts it, in the world.
        let mut moves: Vec<Affine3A> = Vec::with_capacity(program.nodes().len());
        for (slot, node) in program.nodes().iter().enumerate() {
            let own = world * runtime.state().global_at(slot).affine();
            let entity = runtime.entity(slot);
            let to = entity.and_then(|entity| outside.get(entity).ok()).filter(|_| is_over);
            let carried = node.parent.map_or(Affine3A::IDENTITY, |parent| moves[parent]);
            let moved = match to {
                Some(OutsideTransform(to)) => blend(&own, to, share) * own.inverse(),
                None => carried,
            };
            moves.push(if moved.is_finite() { moved } else { carried });
            let Some(mut written) = entity.and_then(|entity| nodes.get_mut(entity).ok()) else { continue };
            let next = GlobalTransform::from(moves[slot] * own);
            written.set_if_neq(next);
        }
    }
}

/// A transform on its way to another place and rotation; its scale stays.
fn blend(own: &Affine3A, to: &Isometry3d, share: f32) -> Affine3A {
    let (scale, rotation, translation) = own.to_scale_rotation_translation();
    let translation = translation.lerp(Vec3::from(to.translation), share);
    Affine3A::from_scale_rotation_translation(scale, rotation.slerp(to.rotation, share), translation)
}
