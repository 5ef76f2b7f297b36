//! Systems that run rigs, in their order.

use bevy::{
    math::{Affine3A, Vec3A},
    prelude::*,
};
use rayon::prelude::*;

use super::{
    ControlPose, DrivenMorphs, InstanceMode, NodeOf, NodeSlot, RigRuntime, inputs::WorldPlaces, spawn::transform,
};
use crate::{
    mesh::model::Trs,
    plugins::schema::Attributes,
    rig::{PoseOffset, RestTransform, Uid},
    solve::program::{LANES, RigState},
};

/// Least number of instances whose joints are written on all threads.
const CROWD: usize = BATCH + 1;

/// Largest number of instances that are distributed over the threads at once. A list of fixed size needs no allocation
/// in a frame.
const BATCH: usize = 256;

/// Largest number of joints that are distributed over the threads at once. A thread takes [`JOINT_RUN`] of them at a
/// time.
const JOINTS: usize = 2048;
const JOINT_RUN: usize = 256;

/// Marks the instances that have a changed control or attribute.
pub(super) fn note_controls(
    changed: Query<&NodeOf, Or<(Changed<Transform>, Changed<ControlPose>, Changed<Attributes>)>>,
    mut rigs: Query<&mut RigRuntime>,
) {
    let mut last = Entity::PLACEHOLDER;
    for NodeOf(rig) in &changed {
        // Nodes of one rig mostly follow one another in the query.
        if *rig != last {
            last = *rig;
            if let Ok(mut runtime) = rigs.get_mut(*rig) {
                runtime.bypass_change_detection().is_due = true;
            }
        }
    }
}

/// Tells springs how their rigs have moved in the world since the last run.
pub(super) fn feel_motion(mut rigs: Query<(Entity, &mut RigRuntime)>, places: WorldPlaces) {
    for (entity, mut runtime) in &mut rigs {
        if !runtime.state.program().has_springs() {
            continue;
        }
        let Some(world) = places.of(entity) else { continue };
        let (now, runtime) = (world.affine(), runtime.bypass_change_detection());
        match runtime.world.replace(now) {
            Some(before) if before != now => {
                let (scale, rotation, translation) = (before.inverse() * now).to_scale_rotation_translation();
                runtime.state.move_frame(&Trs { translation, rotation, scale });
            }
            _ => {}
        }
    }
}

/// Reads the poses of controls and evaluates the programs of all instances with changed inputs.
pub(super) fn solve(
    mut rigs: Query<&mut RigRuntime>,
    transforms: Query<&Transform>,
    poses: Query<&ControlPose>,
    attributes: Query<&Attributes>,
    time: Res<Time>,
) {
    let dt = time.delta_secs();
    let run = |runtimes: &mut [Option<Mut<RigRuntime>>]| {
        for runtime in runtimes.iter_mut().flatten() {
            let unseen = runtime.bypass_change_detection();
            if std::mem::take(&mut unseen.is_due) {
                gather(unseen, &transforms, &poses, &attributes);
            }
        }
        let mut states = runtimes.iter_mut().flatten().map(|runtime| &mut runtime.bypass_change_detection().state);
        let ran = RigState::evaluate_together(std::array::from_fn(|_| states.next()), dt);
        for (runtime, ran) in runtimes.iter_mut().flatten().zip(ran) {
            // Transforms that other code wrote have to be checked even if the program did not run.
            if ran || runtime.all_due || runtime.has_rewritten || runtime.attributes_due {
                runtime.set_changed();
            }
        }
    };
    let due = |runtime: &Mut<RigRuntime>| runtime.is_due || runtime.attributes_due || runtime.state.is_dirty(dt);
    let due = rigs.iter_mut().filter(due);
    in_batches::<BATCH, _>(due, LANES, run);
}

/// Calls a function on slices of `run` items, on all threads if there are more. Bevy's own parallel iteration would
/// leave one of two processors to other tasks.
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

/// Reads the poses and attribute values of an instance's nodes from their entities.
fn gather(
    runtime: &mut RigRuntime,
    transforms: &Query<&Transform>,
    poses: &Query<&ControlPose>,
    attributes: &Query<&Attributes>,
) {
    let RigRuntime {
        state,
        controls,
        mode,
        shown,
        rewritten,
        has_rewritten,
        attributes_due,
        attributes: holders,
        values,
        driven_writes,
        unknown_writes,
        is_of_document,
        ..
    } = runtime;
    for (slot, entity) in controls.iter() {
        let at = *slot as usize;
        match mode {
            InstanceMode::Direct => {
                if let Ok(pose) = poses.get(*entity) {
                    state.set_offset_at(at, (*pose).into());
                }
            }
            InstanceMode::Hierarchy => {
                let Ok(posed) = transforms.get(*entity) else { continue };
                // A transform that the rig itself wrote is no pose.
                if *posed == shown[at] {
                    continue;
                }
                if !shown[at].translation.is_nan() {
                    let base = state.program().nodes()[at].base;
                    let (translation, rotation, scale) = (base.translation, base.rotation, base.scale);
                    let offset = PoseOffset::between(&RestTransform { translation, rotation, scale }, posed);
                    state.set_offset_at(at, offset);
                }
                rewritten[at] = true;
                *has_rewritten = true;
            }
        }
    }
    if attributes.is_empty() {
        return;
    }
    for (entity, slots) in holders.iter() {
        let Ok(Attributes(told)) = attributes.get(*entity) else { continue };
        let mut found = 0;
        for slot in slots {
            let slot = *slot as usize;
            let Some(value) = told.get(&*state.program().attributes()[slot].name).copied() else {
                // Other code took it off; the run writes it again.
                values[slot] = f32::NAN;
                *attributes_due = true;
                continue;
            };
            found += 1;
            if values[slot].is_nan() && !*is_of_document && value.is_finite() {
                // What a game gives to a node of an instance counts from its first value on.
                state.set_attribute_at(slot, value);
                *attributes_due = true;
            }
            if !values[slot].is_nan() && value != values[slot] {
                if !state.set_attribute_at(slot, value) {
                    driven_writes.push((*entity, slot as u32));
                }
                // Written again after the run, which may do nothing, if the value is not allowed or driven.
                values[slot] = value;
                *attributes_due = true;
            }
        }
        if found < told.len() {
            unknown_writes.push(*entity);
            *attributes_due = true;
        }
    }
}

/// True if two transforms differ only by rounding; those with infinite or undefined numbers are near nothing.
pub(crate) fn is_near(a: &Transform, b: &Transform) -> bool {
    if !(a.is_finite() && b.is_finite()) {
        return false;
    }
    let size = a.translation.abs().max_element().max(1e-3);
    (a.translation - b.translation).abs().max_element() <= 1e-6 * size
        && (a.scale - b.scale).abs().max_element() <= 1e-6 * a.scale.abs().max_element().max(1e-3)
        && a.rotation.dot(b.rotation) > 0.0
        && (a.rotation - b.rotation).length_squared() <= 1e-12
}

/// Writes the local transforms of nodes in [`InstanceMode::Hierarchy`]: of nodes that moved, whose parent moved, or
/// that other code wrote.
pub(super) fn scatter_locals(
    mut rigs: Query<&mut RigRuntime, Changed<RigRuntime>>,
    mut transforms: Query<&mut Transform>,
) {
    for mut runtime in rigs.iter_mut().filter(|runtime| runtime.mode == InstanceMode::Hierarchy) {
        let RigRuntime { state, written, shown, rewritten, has_rewritten, all_due, .. } =
            runtime.bypass_change_detection();
        let is_all = std::mem::take(all_due);
        if !is_all && !*has_rewritten && !state.is_any_moved() {
            continue;
        }
        let nodes = state.program().nodes();
        for (slot, entity) in written.iter() {
            let at = *slot as usize;
            let is_rewritten = *has_rewritten && rewritten[at];
            let is_due = is_all
                || is_rewritten
                || state.is_moved(at)
                || nodes[at].parent.is_some_and(|parent| state.is_moved(parent));
            if !is_due {
                continue;
            }
            let local = transform(&state.local_at(at));
            // What nobody else wrote is on the entity as it was written last, which need not be looked up.
            if !is_rewritten && (shown[at] == local || is_near(&shown[at], &local)) {
                continue;
            }
            let Ok(mut written) = transforms.get_mut(*entity) else { continue };
            if *written != local && !is_near(&written, &local) {
                *written = local;
            }
            shown[at] = *written;
        }
        if std::mem::take(has_rewritten) {
            rewritten.fill(false);
        }
    }
}

/// Writes attribute values that are others than the last written or read ones to the entities that hold them.
pub(super) fn scatter_attributes(
    mut rigs: Query<&mut RigRuntime, Changed<RigRuntime>>,
    mut holders: Query<&mut Attributes>,
) {
    // Nodes of a game's instances hold no values before the game gives them some.
    let is_any_held = !holders.is_empty();
    for mut runtime in &mut rigs {
        let RigRuntime { state, attributes, values, attributes_due, .. } = runtime.bypass_change_detection();
        *attributes_due = false;
        if !is_any_held {
            continue;
        }
        for (entity, slots) in attributes.iter() {
            let is_other = |slot: &&u32| {
                let slot = **slot as usize;
                values[slot].to_bits() != state.attribute_at(slot).to_bits()
            };
            let Some(first) = slots.iter().position(|slot| is_other(&slot)) else { continue };
            let Ok(mut told) = holders.get_mut(*entity) else { continue };
            for slot in &slots[first..] {
                let slot = *slot as usize;
                let value = state.attribute_at(slot);
                if values[slot].to_bits() == value.to_bits() {
                    continue;
                }
                values[slot] = value;
                let name = &*state.program().attributes()[slot].name;
                if told.0.get(name) != Some(&value) {
                    told.0.insert(name.to_owned(), value);
                }
            }
        }
    }
}

/// Writes the weights of morph targets to the meshes that a running rig drives.
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

/// Copies the weights of morph targets to the renderer.
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

/// Corrects the world transforms of nodes where Bevy's propagation differs from the program: below an unevenly scaled
/// node Bevy multiplies matrices, which shear, while programs never do.
///
/// What neither Bevy nor the program has moved was correct before, and is not looked up.
pub(super) fn correct_globals(
    rigs: Query<(&RigRuntime, &GlobalTransform), Or<(Changed<RigRuntime>, Changed<GlobalTransform>)>>,
    mut nodes: ParamSet<(Query<&mut GlobalTransform, Without<RigRuntime>>, Query<MovedNode, MovedByBevy>)>,
) {
    let is_hierarchy = |(runtime, _): &(&RigRuntime, &GlobalTransform)| runtime.mode == InstanceMode::Hierarchy;
    if !rigs.iter().any(|found| is_hierarchy(&found)) {
        return;
    }
    let correct = |(runtime, world): (&RigRuntime, &GlobalTransform), slot: usize, mut node: Mut<GlobalTransform>| {
        let world = world.affine();
        let wanted = world * runtime.state.global_at(slot).affine();
        let height = runtime.state.program().rest_height() * world.matrix3.y_axis.length();
        if !is_same_place(&node.affine(), &wanted, height) {
            *node = GlobalTransform::from(wanted);
        }
    };
    // Nodes in the order of memory; those of one rig mostly follow one another.
    let (mut last, mut rig) = (Entity::PLACEHOLDER, None);
    for (entity, NodeOf(of), slot, uid, node) in &mut nodes.p1() {
        if last != *of {
            (last, rig) = (*of, rigs.get(*of).ok().filter(is_hierarchy));
        }
        let Some(rig) = rig else { continue };
        let slot = slot.map(|slot| slot.0 as usize).or_else(|| rig.0.state.program().node(*uid?));
        let Some(slot) = slot.filter(|slot| rig.0.entity(*slot) == Some(entity)) else { continue };
        // Those that the program has moved follow below.
        if !rig.0.state.is_moved(slot) {
            correct(rig, slot, node);
        }
    }
    let mut nodes = nodes.p0();
    for rig in rigs.iter().filter(is_hierarchy).filter(|(runtime, _)| runtime.state.is_any_moved()) {
        for (slot, entity) in rig.0.written.iter().filter(|(slot, _)| rig.0.state.is_moved(*slot as usize)) {
            if let Ok(node) = nodes.get_mut(*entity) {
                correct(rig, *slot as usize, node);
            }
        }
    }
}

/// Nodes that Bevy's propagation has moved.
type MovedByBevy = (Changed<GlobalTransform>, Without<RigRuntime>);
type MovedNode =
    (Entity, &'static NodeOf, Option<&'static NodeSlot>, Option<&'static Uid>, &'static mut GlobalTransform);

/// True if two world transforms of a node differ only by rounding: by less than a share of the rig's height or, far from
/// the origin, by the last digits of its coordinates.
pub(crate) fn is_same_place(now: &Affine3A, wanted: &Affine3A, height: f32) -> bool {
    let rounding = 2.0 * f32::EPSILON * wanted.translation.abs().max_element();
    let is_near = |a: Vec3A, b: Vec3A| (a - b).length_squared() <= 1.6e-11 * b.length_squared();
    (now.translation - wanted.translation).abs().max_element() <= rounding.max(4e-6 * height)
        && is_near(now.matrix3.x_axis, wanted.matrix3.x_axis)
        && is_near(now.matrix3.y_axis, wanted.matrix3.y_axis)
        && is_near(now.matrix3.z_axis, wanted.matrix3.z_axis)
}

/// Writes the world transforms of joints in [`InstanceMode::Direct`]: those that may have moved, or all where the rig has.
pub(super) fn scatter_globals(
    rigs: Query<(&RigRuntime, Ref<GlobalTransform>), Or<(Changed<RigRuntime>, Changed<GlobalTransform>)>>,
    mut joints: Query<(&NodeSlot, &NodeOf, &mut GlobalTransform), Without<RigRuntime>>,
) {
    let is_direct = |(runtime, _): &(&RigRuntime, Ref<GlobalTransform>)| runtime.mode == InstanceMode::Direct;
    let place = |runtime: &RigRuntime, world: &Affine3A, slot: usize| {
        GlobalTransform::from(*world * runtime.state.global_at(slot).affine())
    };
    if rigs.iter().filter(is_direct).count() < CROWD {
        for (runtime, world) in rigs.iter().filter(is_direct) {
            let (is_moved, world) = (world.is_changed(), world.affine());
            let due = runtime.written.iter().filter(|(slot, _)| is_moved || runtime.state.is_moved(*slot as usize));
            for (slot, entity) in due {
                if let Ok((_, _, mut joint)) = joints.get_mut(*entity) {
                    *joint = place(runtime, &world, *slot as usize);
                }
            }
        }
        return;
    }
    // Joints of all rigs in the order of memory, on all threads; joints of one rig mostly follow one another.
    let hand_out = |joints: &mut [Option<(&NodeSlot, &NodeOf, Mut<GlobalTransform>)>]| {
        let (mut last, mut rig) = (Entity::PLACEHOLDER, None);
        for (NodeSlot(slot), NodeOf(of), joint) in joints.iter_mut().flatten() {
            if last != *of {
                let found = rigs.get(*of).ok().filter(is_direct);
                (last, rig) = (*of, found.map(|(runtime, world)| (runtime, world.affine(), world.is_changed())));
            }
            if let Some((runtime, world, is_moved)) = &rig
                && (*is_moved || runtime.state.is_moved(*slot as usize))
            {
                **joint = place(runtime, world, *slot as usize);
            }
        }
    };
    // The batches start within the thread pool: each batch that entered it from outside would go through the pool's
    // queue.
    rayon::join(|| in_batches::<JOINTS, _>(joints.iter_mut(), JOINT_RUN, hand_out), || ());
}
