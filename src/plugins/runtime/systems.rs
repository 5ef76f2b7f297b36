//! The systems that run rigs, in their order.

use bevy::{math::Affine3A, prelude::*};
use rayon::prelude::*;

use super::{ControlPose, DrivenMorphs, InstanceMode, NodeSlot, RigRuntime, RuntimeNodeOf, spawn::transform};
use crate::{
    rig::{PoseOffset, RestTransform},
    solve::program::{LANES, RigState},
};

/// More instances than are handed to the threads at once hand out their joints on all threads, too.
const CROWD: usize = BATCH + 1;

/// Instances that are handed to the threads at once. A list of fixed size needs no memory of its own each frame.
const BATCH: usize = 256;

/// The same of joints, and how many of them a thread takes.
const JOINTS: usize = 2048;
const JOINT_RUN: usize = 256;

/// Notes which instances have a control that changed.
pub(super) fn note_controls(
    changed: Query<&RuntimeNodeOf, Or<(Changed<Transform>, Changed<ControlPose>)>>,
    mut rigs: Query<&mut RigRuntime>,
) {
    let mut last = Entity::PLACEHOLDER;
    for RuntimeNodeOf(rig) in &changed {
        // Nodes of one rig mostly follow one another.
        if *rig != last {
            last = *rig;
            if let Ok(mut runtime) = rigs.get_mut(*rig) {
                runtime.bypass_change_detection().is_due = true;
            }
        }
    }
}

/// Takes the poses of controls and runs the programs of all instances that have something to do.
pub(super) fn solve(
    mut rigs: Query<&mut RigRuntime>,
    transforms: Query<&Transform>,
    poses: Query<&ControlPose>,
    time: Res<Time>,
) {
    let dt = time.delta_secs();
    let run = |runtimes: &mut [Option<Mut<RigRuntime>>]| {
        for runtime in runtimes.iter_mut().flatten() {
            let unseen = runtime.bypass_change_detection();
            if std::mem::take(&mut unseen.is_due) {
                gather(unseen, &transforms, &poses);
            }
        }
        let mut states = runtimes.iter_mut().flatten().map(|runtime| &mut runtime.bypass_change_detection().state);
        let ran = RigState::evaluate_together(std::array::from_fn(|_| states.next()), dt);
        for (runtime, ran) in runtimes.iter_mut().flatten().zip(ran) {
            if ran {
                runtime.set_changed();
            }
        }
    };
    let due = rigs.iter_mut().filter(|runtime| runtime.is_due || runtime.state.is_dirty(dt));
    in_batches::<BATCH, _>(due, LANES, run);
}

/// Runs a function on runs of `run` items, on all threads if there are more. Bevy's own parallel iteration would leave one
/// of two processors to other tasks.
fn in_batches<const SIZE: usize, T: Send>(
    mut items: impl Iterator<Item = T>,
    run: usize,
    call: impl Fn(&mut [Option<T>]) + Send + Sync,
) {
    let mut batch = [const { None }; SIZE];
    loop {
        let mut count = 0;
        for (place, item) in batch.iter_mut().zip(&mut items) {
            *place = Some(item);
            count += 1;
        }
        let ready = &mut batch[..count];
        if count < run {
            call(ready);
        } else {
            ready.par_chunks_mut(run).for_each(&call);
        }
        if count < SIZE {
            break;
        }
    }
}

/// Takes the poses of an instance's controls.
fn gather(runtime: &mut RigRuntime, transforms: &Query<&Transform>, poses: &Query<&ControlPose>) {
    let RigRuntime { state, controls, mode, .. } = runtime;
    for (slot, entity) in controls.iter() {
        let slot = *slot as usize;
        match mode {
            InstanceMode::Direct => {
                if let Ok(pose) = poses.get(*entity) {
                    state.set_offset_at(slot, (*pose).into());
                }
            }
            InstanceMode::Hierarchy => {
                let Ok(posed) = transforms.get(*entity) else { continue };
                // What the rig itself wrote is no pose.
                if *posed != transform(&state.local_at(slot)) {
                    let base = state.program().nodes()[slot].base;
                    let (translation, rotation, scale) = (base.translation, base.rotation, base.scale);
                    let offset = PoseOffset::between(&RestTransform { translation, rotation, scale }, posed);
                    state.set_offset_at(slot, offset);
                }
            }
        }
    }
}

/// Writes the transforms of driven nodes where every node is an entity.
pub(super) fn scatter_locals(rigs: Query<&RigRuntime, Changed<RigRuntime>>, mut transforms: Query<&mut Transform>) {
    for runtime in rigs.iter().filter(|runtime| runtime.mode == InstanceMode::Hierarchy) {
        for (slot, entity) in &runtime.written {
            let slot = *slot as usize;
            if !runtime.state.is_moved(slot) {
                continue;
            }
            if let Ok(mut written) = transforms.get_mut(*entity) {
                written.set_if_neq(transform(&runtime.state.local_at(slot)));
            }
        }
    }
}

/// Hands out the weights of morph targets.
pub(super) fn scatter_morphs(rigs: Query<&RigRuntime, Changed<RigRuntime>>, mut meshes: Query<&mut DrivenMorphs>) {
    if rigs.is_empty() {
        return;
    }
    for mut morphs in &mut meshes {
        let Ok(runtime) = rigs.get(morphs.rig) else { continue };
        let values = runtime.state.morphs();
        let DrivenMorphs { targets, weights, .. } = morphs.bypass_change_detection();
        let mut is_changed = false;
        for ((_, slot), weight) in targets.iter().zip(weights) {
            if let Some(value) = values.get(*slot)
                && weight.to_bits() != value.to_bits()
            {
                *weight = *value;
                is_changed = true;
            }
        }
        if is_changed {
            morphs.set_changed();
        }
    }
}

/// Lets meshes be drawn with the weights of their morph targets.
#[cfg(feature = "draw")]
pub(super) fn show_morphs(
    mut meshes: Query<(&DrivenMorphs, &mut bevy::mesh::morph::MeshMorphWeights), Changed<DrivenMorphs>>,
) {
    for (morphs, mut shown) in &mut meshes {
        let bevy::mesh::morph::MeshMorphWeights::Value { weights } = &mut *shown else { continue };
        for ((number, _), value) in morphs.targets.iter().zip(&morphs.weights) {
            if let Some(weight) = weights.get_mut(*number) {
                *weight = *value;
            }
        }
    }
}

/// Writes where joints are in the world, where only they are entities.
pub(super) fn scatter_globals(
    rigs: Query<(&RigRuntime, &GlobalTransform), Or<(Changed<RigRuntime>, Changed<GlobalTransform>)>>,
    mut joints: Query<(&NodeSlot, &RuntimeNodeOf, &mut GlobalTransform), Without<RigRuntime>>,
) {
    let is_direct = |(runtime, _): &(&RigRuntime, &GlobalTransform)| runtime.mode == InstanceMode::Direct;
    let place = |runtime: &RigRuntime, world: &Affine3A, slot: usize| {
        GlobalTransform::from(*world * runtime.state.global_at(slot).affine())
    };
    if rigs.iter().filter(is_direct).count() < CROWD {
        for (runtime, world) in rigs.iter().filter(is_direct) {
            for (slot, entity) in &runtime.written {
                if let Ok((_, _, mut joint)) = joints.get_mut(*entity) {
                    *joint = place(runtime, &world.affine(), *slot as usize);
                }
            }
        }
        return;
    }
    // All joints there are, in the order of memory and on all threads; those of one rig mostly follow one another.
    let hand_out = |joints: &mut [Option<(&NodeSlot, &RuntimeNodeOf, Mut<GlobalTransform>)>]| {
        let (mut last, mut rig) = (Entity::PLACEHOLDER, None);
        for (NodeSlot(slot), RuntimeNodeOf(of), joint) in joints.iter_mut().flatten() {
            if last != *of {
                let found = rigs.get(*of).ok().filter(is_direct);
                (last, rig) = (*of, found.map(|(runtime, world)| (runtime, world.affine())));
            }
            if let Some((runtime, world)) = &rig {
                **joint = place(runtime, world, *slot as usize);
            }
        }
    };
    // From within the pool: every batch that reached it from outside would wear its queue.
    rayon::join(|| in_batches::<JOINTS, _>(joints.iter_mut(), JOINT_RUN, hand_out), || ());
}
