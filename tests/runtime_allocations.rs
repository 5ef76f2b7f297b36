//! Running rigs takes no memory once they are warm. A binary of its own: it counts what the whole process allocates.

#[path = "it/runtime/biped.rs"]
mod biped;

use std::{alloc::System, sync::Arc};

use bevy::{ecs::schedule::SingleThreadedExecutor, prelude::*};
use rigsmith::{
    plugins::runtime::{ControlPose, InstanceMode, RigRuntime, RuntimePlugin, spawn_instance},
    rig::PoseOffset,
    solve::program::{CompileOptions, ExposedNode, Keep, Memory, RigProgram, RigState},
};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn compile(keep: Keep) -> Arc<RigProgram> {
    let options = CompileOptions { keep, ..CompileOptions::default() };
    Arc::new(RigProgram::compile(&biped::biped(), &options).unwrap())
}

fn sample(frame: usize, slot: usize) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_rotation_x(0.3 * (frame as f32 * 0.7 + slot as f32).sin()))
}

/// Allocations of `frames` calls after ten that do not count.
fn allocations(frames: usize, mut call: impl FnMut(usize)) -> usize {
    (0..10).for_each(&mut call);
    let region = Region::new(GLOBAL);
    (10..10 + frames).for_each(&mut call);
    let change = region.change();
    change.allocations + change.reallocations
}

/// Allocations of a frame's systems, with `count` instances that all move.
fn frame_allocations(count: usize, frames: usize, mode: InstanceMode) -> usize {
    let keep = match mode {
        InstanceMode::Direct => Keep::DeformAndExposed(vec![ExposedNode::Controls]),
        InstanceMode::Hierarchy => Keep::All,
    };
    let program = compile(keep);
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, RuntimePlugin));
    app.edit_schedule(PostUpdate, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    app.finish();
    app.cleanup();
    app.update();
    let world = app.world_mut();
    let mut controls = Vec::new();
    for _ in 0..count {
        let rig = world.spawn((Transform::IDENTITY, GlobalTransform::IDENTITY)).id();
        spawn_instance(world, rig, &program, mode);
        let runtime = world.get::<RigRuntime>(rig).unwrap();
        let posable = (0..program.nodes().len()).filter(|slot| {
            program.nodes()[*slot].kind == rigsmith::rig::NodeType::Control && program.nodes()[*slot].is_posable()
        });
        controls.extend(posable.map(|slot| runtime.entity(slot).unwrap()));
    }
    allocations(frames, |frame| {
        for (number, control) in controls.iter().enumerate() {
            let offset = sample(frame, number);
            if let Some(mut pose) = world.get_mut::<ControlPose>(*control) {
                *pose = offset.into();
            } else if let Some(mut transform) = world.get_mut::<Transform>(*control) {
                transform.rotation = offset.rotation;
            }
        }
        world.run_schedule(PostUpdate);
    })
}

#[test]
fn nothing_is_allocated_once_warm() {
    for (keep, memory) in [
        (Keep::All, Memory::Whole),
        (Keep::DeformAndExposed(vec![ExposedNode::Controls]), Memory::Whole),
        (Keep::DeformAndExposed(vec![ExposedNode::Controls]), Memory::Results),
    ] {
        let program = compile(keep);
        let posable: Vec<usize> = (0..program.nodes().len()).filter(|at| program.nodes()[*at].is_posable()).collect();
        let mut state = RigState::with_memory(Arc::clone(&program), memory);
        // All controls in some frames, one in others.
        let taken = allocations(500, |frame| {
            let few = if frame % 5 == 0 { posable.len() } else { 1 };
            posable.iter().take(few).for_each(|slot| {
                state.set_offset_at(*slot, sample(frame, *slot));
            });
            state.evaluate(0.016);
        });
        assert_eq!(taken, 0, "{memory:?}");
    }
    // What the test itself would show if counting did not work.
    let mut kept = Vec::new();
    assert_eq!(allocations(7, |frame| kept.push(Box::new(frame))) / 7, 1);

    // Too few instances for threads.
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        assert_eq!(frame_allocations(3, 100, mode), 0, "{mode:?}");
    }
    // The queue by which work reaches rayon's threads is made of blocks of 63 entries.
    let (frames, queue) = (252, 252 / 63 + 1);
    let taken = frame_allocations(200, frames, InstanceMode::Direct);
    assert!(taken <= queue, "{taken} allocations in {frames} frames");
}
