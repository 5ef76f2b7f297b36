//! Inputs of running rigs: entities outside of them, such as a steering wheel that a hand holds.

use std::collections::BTreeMap;

use bevy::{ecs::system::SystemParam, math::Affine3, prelude::*};

use super::RigRuntime;
use crate::{
    mesh::model::Trs,
    rig::{RestTransform, nearest::did_you_mean},
};

/// Entities that stand for the declared inputs of a rig, by the inputs' names; on the rig's entity. An input without an
/// entity stands where the rig declares it.
///
/// ```
/// use bevy::prelude::*;
/// use rigsmith::plugins::runtime::RigInputs;
///
/// fn drive(mut commands: Commands, driver: Single<Entity, With<Name>>) {
///     let wheel = commands.spawn(Transform::from_xyz(0.0, 1.0, 0.4)).id();
///     commands.entity(*driver).insert(RigInputs::from([("wheel", wheel)]));
/// }
/// ```
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq, Eq, Deref, DerefMut)]
#[reflect(Component)]
pub struct RigInputs(pub BTreeMap<String, Entity>);

impl<const COUNT: usize> From<[(&str, Entity); COUNT]> for RigInputs {
    fn from(inputs: [(&str, Entity); COUNT]) -> Self {
        Self(inputs.into_iter().map(|(name, entity)| (name.to_owned(), entity)).collect())
    }
}

/// Writes where the entities of inputs stand, seen from the rig, before it runs: in this frame, not in the last one. What hangs
/// on a joint of an instance without a hierarchy, or is one, stands where the last frame showed it.
pub(super) fn read_inputs(mut rigs: Query<(Entity, &mut RigRuntime, Option<&RigInputs>)>, places: WorldPlaces) {
    for (rig, mut runtime, given) in &mut rigs {
        let program = runtime.state().program().clone();
        if program.declared_inputs().is_empty() {
            continue;
        }
        let world = given.and_then(|_| places.of(rig));
        let to_rig = world.map(|world| world.affine().inverse());
        for (slot, name) in program.declared_inputs().iter().enumerate() {
            let entity = given.and_then(|given| given.get(&**name));
            let place = entity.and_then(|entity| places.of(*entity));
            let place = place
                .zip(to_rig)
                .map(|(place, to_rig)| Trs::from(RestTransform::from_affine(&Affine3::from(to_rig * place.affine()))));
            let Some(place) = place.or_else(|| program.input_rest(slot)) else { continue };
            // A place without extent, or at infinity, is none: the input stays.
            runtime.bypass_change_detection().state_mut().set_input_at(slot, place);
        }
    }
}

/// Places of entities in the world, before transforms are propagated.
#[derive(SystemParam)]
pub(super) struct WorldPlaces<'w, 's> {
    now: TransformHelper<'w, 's>,
    shown: Query<'w, 's, &'static GlobalTransform>,
}

impl WorldPlaces<'_, '_> {
    /// The place that the transforms of an entity and of those above it give. Joints of instances without a hierarchy have none:
    /// for these, and for what hangs on them, it is the place in the last frame.
    pub fn of(&self, entity: Entity) -> Option<GlobalTransform> {
        self.now.compute_global_transform(entity).ok().or_else(|| self.shown.get(entity).ok().copied())
    }
}

/// Says which entities are given for inputs that the rig does not declare.
pub(super) fn check_inputs(changed: Query<(Entity, &RigRuntime, &RigInputs), Changed<RigInputs>>) {
    for (rig, runtime, given) in &changed {
        let declared = runtime.state().program().declared_inputs();
        for name in given.keys().filter(|name| declared.iter().all(|known| **known != ***name)) {
            warn!("rig {rig} declares no input \"{name}\"{}", did_you_mean(name, declared));
        }
    }
}
