//! Inputs of running rigs: entities outside of them, such as a steering wheel that a hand holds.

use std::collections::BTreeMap;

use bevy::{math::Affine3, prelude::*};

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

/// Writes where the entities of inputs stand, seen from the rig, before it runs: in this frame, not in the last one.
pub(super) fn read_inputs(mut rigs: Query<(Entity, &mut RigRuntime, Option<&RigInputs>)>, places: TransformHelper) {
    for (rig, mut runtime, given) in &mut rigs {
        let program = runtime.state().program().clone();
        if program.declared_inputs().is_empty() {
            continue;
        }
        let world = given.and_then(|_| places.compute_global_transform(rig).ok());
        let to_rig = world.map(|world| world.affine().inverse());
        for (slot, name) in program.declared_inputs().iter().enumerate() {
            let entity = given.and_then(|given| given.get(&**name));
            let place = entity.and_then(|entity| places.compute_global_transform(*entity).ok());
            let place = place
                .zip(to_rig)
                .map(|(place, to_rig)| Trs::from(RestTransform::from_affine(&Affine3::from(to_rig * place.affine()))));
            let Some(place) = place.or_else(|| program.input_rest(slot)) else { continue };
            // A place without extent, or at infinity, is none: the input stays.
            runtime.bypass_change_detection().state_mut().set_input_at(slot, place);
        }
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
