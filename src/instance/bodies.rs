//! Meshes of instances: bound to the joints of the template in the background, once for all instances that have the mesh.

use std::sync::{Arc, Weak};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{BoundTo, RigFailed, RigInstance, RunningTemplate, SkinBound, TemplateError};
use crate::{
    algo::weights::{WeightError, WeightSettings},
    mesh::model::Model,
    plugins::{
        commands::RigModules,
        skinning::{BodyBasis, BoundSkin, InstanceBody, InstanceSkin, SkinningInput},
        surface::{RigMesh, RigMeshes, SkinOf},
    },
    rig::SkinData,
};

/// Weights of instances' meshes: each mesh is bound once to the joints of a template.
#[derive(Resource, Default)]
pub struct InstanceSkins {
    known: Vec<(Key, Weak<SkinData>)>,
    running: Vec<Job>,
    computed: usize,
}

impl InstanceSkins {
    /// Number of meshes that were bound; what instances share counts once.
    pub fn computed(&self) -> usize {
        self.computed
    }
}

/// Basis of weights: the joints at rest and the mesh.
#[derive(Clone)]
struct Key {
    basis: BodyBasis,
    mesh: Weak<Model>,
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.basis == other.basis && self.mesh.ptr_eq(&other.mesh)
    }
}

struct Job {
    key: Key,
    task: Task<Result<BoundSkin, WeightError>>,
    /// Meshes that wait for the weights, with their instances.
    waiting: Vec<(Entity, Entity)>,
}

/// Gives instances with meshes the rig that these are bound to.
pub(super) fn give_bodies(
    instances: Query<
        (Entity, &RunningTemplate),
        (With<RigInstance>, With<RigMeshes>, Or<(Changed<RunningTemplate>, Added<RigMeshes>)>),
    >,
    mut commands: Commands,
) {
    for (entity, running) in &instances {
        let template = running.get();
        let body = InstanceBody { rig: template.rig.clone(), built: template.built.clone() };
        commands.entity(entity).try_insert(body);
    }
}

/// Binds meshes of instances that are new, or whose joints at rest are others now.
pub(super) fn bind_bodies(
    meshes: Query<(Entity, Ref<RigMesh>, Ref<SkinOf>, Option<Ref<InstanceSkin>>)>,
    bodies: Query<Ref<InstanceBody>>,
    modules: Res<RigModules>,
    mut skins: ResMut<InstanceSkins>,
    mut commands: Commands,
) {
    for (entity, mesh, of, own) in &meshes {
        let Ok(body) = bodies.get(of.0) else { continue };
        if !(mesh.is_changed() || of.is_changed() || body.is_changed()) {
            continue;
        }
        let key = Key { basis: body.basis(mesh.uid), mesh: Arc::downgrade(&mesh.rest) };
        let skins = &mut *skins;
        skins.known.retain(|(key, skin)| key.mesh.strong_count() > 0 && skin.strong_count() > 0);
        for job in &mut skins.running {
            job.waiting.retain(|(waiting, _)| *waiting != entity);
        }
        // Weights that came with another version of the mesh, transferred to it, are those of all meshes like it.
        if let Some(own) = own.as_ref().filter(|own| own.is_changed() && mesh.is_changed())
            && !of.is_changed()
            && !body.is_changed()
        {
            if skins.known.iter().all(|(known, _)| *known != key) {
                skins.known.push((key, Arc::downgrade(&own.0)));
            }
            continue;
        }
        if let Some(skin) = skins.known.iter().find(|(known, _)| *known == key).and_then(|(_, skin)| skin.upgrade()) {
            if of.is_changed() || own.is_none_or(|own| !Arc::ptr_eq(&own.0, &skin)) {
                bound(&mut commands, entity, of.0, skin);
            }
        } else if let Some(job) = skins.running.iter_mut().find(|job| job.key == key) {
            job.waiting.push((entity, of.0));
        } else {
            let (body, mesh, modules) = (InstanceBody::clone(&body), RigMesh::clone(&mesh), modules.0.clone());
            let task = AsyncComputeTaskPool::get().spawn(async move {
                let input = SkinningInput::new(&body.rig, Some(&body.built), Some(&modules), &mesh, &[]);
                input.compute(&mesh, &WeightSettings::default(), &|_| true)
            });
            skins.running.push(Job { key, task, waiting: vec![(entity, of.0)] });
        }
    }
}

/// Hands out weights that are computed.
pub(super) fn land_bodies(mut skins: ResMut<InstanceSkins>, mut commands: Commands) {
    let skins = &mut *skins;
    let mut number = 0;
    while number < skins.running.len() {
        let Some(result) = check_ready(&mut skins.running[number].task) else {
            number += 1;
            continue;
        };
        let Job { key, waiting, .. } = skins.running.remove(number);
        match result {
            Ok(BoundSkin { skin, .. }) => {
                skins.computed += 1;
                skins.known.push((key, Arc::downgrade(&skin)));
                for (mesh, instance) in waiting {
                    bound(&mut commands, mesh, instance, skin.clone());
                }
            }
            Err(source) => {
                for (_, instance) in waiting {
                    let error = TemplateError::CannotBind { source: source.clone() };
                    commands.trigger(RigFailed { entity: instance, error });
                }
            }
        }
    }
}

fn bound(commands: &mut Commands, mesh: Entity, instance: Entity, skin: Arc<SkinData>) {
    if let Ok(mut entity) = commands.get_entity(mesh) {
        entity.try_insert((InstanceSkin(skin), BoundTo(instance)));
        commands.trigger(SkinBound { entity: mesh, instance, unknown: Vec::new() });
    }
}
